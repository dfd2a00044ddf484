// Seam stitching: see stitch.h.
//
// Unknowns are the texels that points along seams read; each point is one equation "the one side minus the other is zero". We minimise
//     sum over unknowns  inertia_i (x_i - x0_i)²  +  strength · sum over points  (a_p · x)²
// over the change y = x - x0, whose normal equations are (M + strength · AᵀA) y = -strength · AᵀA x0. The matrix is never formed: conjugate gradients need its
// products only, and M is diagonal.
#include "post/stitch.h"

#include "base/error.h"
#include "base/memory.h"

#include <stdlib.h>
#include <string.h>

enum {
    taps_per_side = 4,
    taps = 2 * taps_per_side,
    most_iterations = 60,
    points_per_texel = 2, // along the longer side
    most_points = 4096,   // of one seam
};

static const float strength = 100;         // of agreement against staying: what is left of a difference is about 1 / strength of it
static const float padding_inertia = 0.1f; // padding is read beside the seam only, luxels are read everywhere
static const float most_hidden = 0.3f;     // share of a footprint that may lie inside solid geometry
static const double converged = 1e-6;      // squared residual over where it began

typedef struct point_equation {
    uint32_t unknown[taps];
    float weight[taps]; // + for one side, - for the other; equal unknowns are merged, 0 fills up
} point_equation;

struct lx_stitch {
    uint32_t luxel_count;
    uint32_t texel_count;   // padding
    uint32_t *texels;       // [texel_count] ascending
    uint32_t *sources;      // [texel_count] the luxel that each showed before
    uint32_t unknown_count;
    uint32_t *entries;      // [unknown_count] where each lives: a luxel, or luxel_count + number of the padding texel; ascending
    float *diagonal;        // [unknown_count] of the matrix
    float *inertia;         // [unknown_count]
    point_equation *points;
    size_t point_count;
};

// ---- building -----------------------------------------------------------------------------------------------------------------------

typedef struct tap_list {
    uint32_t texel[taps_per_side];
    float weight[taps_per_side];
} tap_list;

typedef struct build {
    const lx_luxel_map *map;
    const uint32_t *shown, *chart;
    point_equation *points; // unknowns are texels, later entries, later numbers
    size_t count, capacity;
} build;

// The bilinear footprint of a place on a page; false if it reads what is not this chart's, or too much that is hidden.
static bool footprint(const build *b, const lx_seam_side *side, float t, tap_list *out)
{
    const lx_luxel_map *map = b->map;
    const uint32_t size = map->page_size;
    const float x = side->from.x + t * (side->to.x - side->from.x) - 0.5f, y = side->from.y + t * (side->to.y - side->from.y) - 0.5f;
    const float x0 = floorf(x), y0 = floorf(y), fx = x - x0, fy = y - y0;
    float hidden = 0;
    for (int k = 0; k < taps_per_side; ++k) {
        const float column = x0 + (float)(k & 1), row = y0 + (float)(k >> 1);
        const float weight = (k & 1 ? fx : 1 - fx) * (k >> 1 ? fy : 1 - fy);
        out->weight[k] = weight;
        out->texel[k] = UINT32_MAX;
        if (weight < 1e-3f) { // on the line of centres: the next column or row may be another chart's
            out->weight[k] = 0;
            continue;
        }
        if (!(column >= 0) || !(row >= 0) || column >= (float)size || row >= (float)size) return false;
        const size_t texel = (size_t)side->page * size * size + (size_t)row * size + (size_t)column;
        if (b->chart[texel] != side->chart || b->shown[texel] >= map->count) return false;
        if (map->index[texel] != LX_NO_LUXEL && b->shown[texel] != map->index[texel]) hidden += weight;
        out->texel[k] = (uint32_t)texel;
    }
    return hidden <= most_hidden;
}

// Adds weight × the colour that `texel` shows: a luxel that is hidden shows another one's.
static uint32_t entry_of(const build *b, uint32_t texel)
{
    return b->map->index[texel] != LX_NO_LUXEL ? b->shown[texel] : UINT32_MAX;
}

static void add_tap(const build *b, point_equation *p, uint32_t texel, float weight)
{
    // Until padding is numbered, its texels stand behind all luxels of all pages: count + texel fits, since there are fewer than 2^31 of either.
    const uint32_t luxel = entry_of(b, texel), unknown = luxel != UINT32_MAX ? luxel : b->map->count + texel;
    int k = 0;
    while (k < taps && p->weight[k] != 0 && p->unknown[k] != unknown) ++k;
    p->unknown[k] = unknown;
    p->weight[k] += weight;
    if (p->weight[k] == 0) { // cancelled: keep the list without holes
        int last = k;
        while (last + 1 < taps && p->weight[last + 1] != 0) ++last;
        p->unknown[k] = p->unknown[last];
        p->weight[k] = p->weight[last];
        p->unknown[last] = 0;
        p->weight[last] = 0;
    }
}

static float length_of(const lx_seam_side *side)
{
    const lx_vec2 d = lx_sub2(side->to, side->from);
    return sqrtf(lx_dot2(d, d));
}

static lx_result add_seam(build *b, const lx_seam *seam, lx_error *error)
{
    const float length = lx_max(length_of(&seam->sides[0]), length_of(&seam->sides[1])) * points_per_texel;
    const uint32_t count = length < 1 ? 1 : length < most_points ? (uint32_t)ceilf(length) : most_points;
    for (uint32_t i = 0; i < count; ++i) {
        const float t = ((float)i + 0.5f) / (float)count;
        tap_list one, other;
        if (!footprint(b, &seam->sides[0], t, &one) || !footprint(b, &seam->sides[1], t, &other)) continue;
        if (!lx_array_reserve(&b->points, &b->capacity, b->count + 1, sizeof *b->points)) return lx_fail_memory(error, "seams");
        point_equation *p = &b->points[b->count];
        memset(p, 0, sizeof *p);
        for (int k = 0; k < taps_per_side; ++k)
            if (one.weight[k] > 0) add_tap(b, p, one.texel[k], one.weight[k]);
        for (int k = 0; k < taps_per_side; ++k)
            if (other.weight[k] > 0) add_tap(b, p, other.texel[k], -other.weight[k]);
        if (p->weight[0] != 0) ++b->count; // else both sides read the same texels
    }
    return LX_OK;
}

static int compare_numbers(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;
    return x < y ? -1 : x > y;
}

static uint32_t number_of(const uint32_t *sorted, uint32_t count, uint32_t value)
{
    uint32_t low = 0, high = count;
    while (low + 1 < high) {
        const uint32_t middle = (low + high) / 2;
        if (sorted[middle] <= value)
            low = middle;
        else
            high = middle;
    }
    return low;
}

// Numbers the unknowns: sorted without repeats, luxels first, then padding texels.
static lx_result number_unknowns(build *b, lx_stitch *s, lx_error *error)
{
    uint32_t *all = lx_malloc_array(b->count, taps * sizeof *all);
    if (!all) return lx_fail_memory(error, "seams");
    size_t count = 0, kept = 0;
    for (size_t i = 0; i < b->count; ++i)
        for (int k = 0; k < taps && b->points[i].weight[k] != 0; ++k) all[count++] = b->points[i].unknown[k];
    qsort(all, count, sizeof *all, compare_numbers);
    for (size_t i = 0; i < count; ++i)
        if (i == 0 || all[i] != all[i - 1]) all[kept++] = all[i];
    s->unknown_count = (uint32_t)kept;
    uint32_t first_padding = 0;
    while (first_padding < kept && all[first_padding] < b->map->count) ++first_padding;
    s->texel_count = s->unknown_count - first_padding;
    s->entries = all;
    s->texels = lx_malloc_array(s->texel_count, sizeof *s->texels);
    s->sources = lx_malloc_array(s->texel_count, sizeof *s->sources);
    s->diagonal = lx_calloc_array(s->unknown_count, sizeof *s->diagonal);
    s->inertia = lx_malloc_array(s->unknown_count, sizeof *s->inertia);
    if (!s->texels || !s->sources || !s->diagonal || !s->inertia) return lx_fail_memory(error, "seams");
    for (size_t i = 0; i < b->count; ++i)
        for (int k = 0; k < taps && b->points[i].weight[k] != 0; ++k)
            b->points[i].unknown[k] = number_of(all, s->unknown_count, b->points[i].unknown[k]);
    for (uint32_t i = 0; i < s->texel_count; ++i) {
        s->texels[i] = all[first_padding + i] - b->map->count;
        s->sources[i] = b->shown[s->texels[i]];
        all[first_padding + i] = b->map->count + i;
    }
    for (uint32_t i = 0; i < s->unknown_count; ++i) s->diagonal[i] = s->inertia[i] = i < first_padding ? 1 : padding_inertia;
    for (size_t i = 0; i < b->count; ++i)
        for (int k = 0; k < taps; ++k) s->diagonal[b->points[i].unknown[k]] += strength * b->points[i].weight[k] * b->points[i].weight[k];
    return LX_OK;
}

lx_result lx_stitch_create(const lx_luxel_map *map, const uint32_t *shown, const uint32_t *chart, const lx_seam *seams, size_t seam_count,
                           lx_stitch **out_stitch, lx_error *error)
{
    lx_result result = LX_OK;
    build b = {.map = map, .shown = shown, .chart = chart};
    size_t texel_count;
    lx_stitch *s = lx_calloc_array(1, sizeof *s);
    if (!s) return lx_fail_memory(error, "seams");
    s->luxel_count = map->count;
    if (!lx_mul_size((size_t)map->page_size * map->page_size, map->page_count, &texel_count) || texel_count > INT32_MAX) {
        result = lx_fail(error, LX_ERROR_LIMIT, "%u pages of %u texels are too many to stitch; fewer or smaller pages do", map->page_count,
                         map->page_size);
        goto cleanup;
    }
    for (size_t i = 0; i < seam_count; ++i) LX_TRY(add_seam(&b, &seams[i], error));
    LX_TRY(number_unknowns(&b, s, error));
    s->points = b.points;
    s->point_count = b.count;
    b.points = NULL;
    *out_stitch = s;
    s = NULL;
cleanup:
    lx_free(b.points);
    lx_stitch_destroy(s);
    return result;
}

void lx_stitch_destroy(lx_stitch *stitch)
{
    if (!stitch) return;
    lx_free(stitch->texels);
    lx_free(stitch->sources);
    lx_free(stitch->entries);
    lx_free(stitch->diagonal);
    lx_free(stitch->inertia);
    lx_free(stitch->points);
    lx_free(stitch);
}

uint32_t lx_stitch_texel_count(const lx_stitch *stitch) { return stitch->texel_count; }
const uint32_t *lx_stitch_texels(const lx_stitch *stitch) { return stitch->texels; }

// ---- solving ------------------------------------------------------------------------------------------------------------------------

// Four vectors over the unknowns; channels are solved side by side.
typedef struct vectors {
    lx_rgb *change, *residual, *direction, *product;
} vectors;

size_t lx_stitch_scratch_bytes(const lx_stitch *stitch) { return 4 * (size_t)stitch->unknown_count * sizeof(lx_rgb); }

// out = strength · AᵀA in
static void agreement(const lx_stitch *s, const lx_rgb *in, lx_rgb *out)
{
    memset(out, 0, s->unknown_count * sizeof *out);
    for (size_t i = 0; i < s->point_count; ++i) {
        const point_equation *p = &s->points[i];
        lx_rgb difference = {0, 0, 0};
        for (int k = 0; k < taps; ++k) difference = lx_rgb_add(difference, lx_rgb_scale(in[p->unknown[k]], p->weight[k]));
        difference = lx_rgb_scale(difference, strength);
        for (int k = 0; k < taps; ++k) out[p->unknown[k]] = lx_rgb_add(out[p->unknown[k]], lx_rgb_scale(difference, p->weight[k]));
    }
}

typedef struct channels {
    double of[3];
} channels;

static channels product_of(const lx_stitch *s, const lx_rgb *a, const lx_rgb *b)
{
    channels sum = {{0, 0, 0}};
    for (uint32_t i = 0; i < s->unknown_count; ++i) {
        sum.of[0] += (double)a[i].r * (double)b[i].r;
        sum.of[1] += (double)a[i].g * (double)b[i].g;
        sum.of[2] += (double)a[i].b * (double)b[i].b;
    }
    return sum;
}

// r · M⁻¹ r with the matrix' diagonal M: Jacobi's preconditioner.
static channels preconditioned(const lx_stitch *s, const lx_rgb *r)
{
    channels sum = {{0, 0, 0}};
    for (uint32_t i = 0; i < s->unknown_count; ++i) {
        const double scale = 1 / (double)s->diagonal[i];
        sum.of[0] += scale * (double)r[i].r * (double)r[i].r;
        sum.of[1] += scale * (double)r[i].g * (double)r[i].g;
        sum.of[2] += scale * (double)r[i].b * (double)r[i].b;
    }
    return sum;
}

static lx_rgb quotient(channels a, channels b)
{
    float q[3];
    for (int c = 0; c < 3; ++c) q[c] = b.of[c] > 0 ? (float)(a.of[c] / b.of[c]) : 0;
    return lx_rgb_of(q[0], q[1], q[2]);
}

// [Shewchuk1994] B3. Leaves the change of every unknown in v->change.
static void solve(const lx_stitch *s, const lx_rgb *start, vectors *v)
{
    agreement(s, start, v->residual);
    for (uint32_t i = 0; i < s->unknown_count; ++i) {
        v->residual[i] = lx_rgb_scale(v->residual[i], -1);
        v->change[i] = lx_rgb_of(0, 0, 0);
        v->direction[i] = lx_rgb_scale(v->residual[i], 1 / s->diagonal[i]);
    }
    channels error = preconditioned(s, v->residual);
    const channels first = error;
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        bool done = true;
        for (int c = 0; c < 3; ++c) done &= !(error.of[c] > converged * first.of[c]);
        if (done) break;
        agreement(s, v->direction, v->product);
        for (uint32_t i = 0; i < s->unknown_count; ++i)
            v->product[i] = lx_rgb_add(v->product[i], lx_rgb_scale(v->direction[i], s->inertia[i]));
        const lx_rgb step = quotient(error, product_of(s, v->direction, v->product));
        for (uint32_t i = 0; i < s->unknown_count; ++i) {
            v->change[i] = lx_rgb_add(v->change[i], lx_rgb_mul(v->direction[i], step));
            v->residual[i] = lx_rgb_add(v->residual[i], lx_rgb_scale(lx_rgb_mul(v->product[i], step), -1));
        }
        const channels next = preconditioned(s, v->residual);
        const lx_rgb turn = quotient(next, error);
        error = next;
        for (uint32_t i = 0; i < s->unknown_count; ++i)
            v->direction[i] = lx_rgb_add(lx_rgb_scale(v->residual[i], 1 / s->diagonal[i]), lx_rgb_mul(v->direction[i], turn));
    }
}

void lx_stitch_apply(const lx_stitch *stitch, lx_rgb *entries, void *scratch)
{
    const uint32_t count = stitch->unknown_count;
    for (uint32_t i = 0; i < stitch->texel_count; ++i) entries[stitch->luxel_count + i] = entries[stitch->sources[i]];
    vectors v = {scratch, (lx_rgb *)scratch + count, (lx_rgb *)scratch + 2 * (size_t)count, (lx_rgb *)scratch + 3 * (size_t)count};
    // The products' memory holds the values at the start, which the solver needs once.
    for (uint32_t i = 0; i < count; ++i) v.product[i] = entries[stitch->entries[i]];
    solve(stitch, v.product, &v);
    for (uint32_t i = 0; i < count; ++i) {
        lx_rgb *entry = &entries[stitch->entries[i]];
        const lx_rgb sum = lx_rgb_add(*entry, v.change[i]);
        *entry = lx_rgb_of(lx_max(0, sum.r), lx_max(0, sum.g), lx_max(0, sum.b));
    }
}
