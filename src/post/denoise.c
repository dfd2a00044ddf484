// The denoiser's filter: see denoise.h.
//
// 1. Variances, as half buffers tell them, are pooled over neighbours, and lowered where differences between neighbours are smaller than
//    they say.
// 2. Candidates: the light at widths of up to 31 texels, for direct light also along each axis of the grid alone.
// 3. For each luxel the mixture of the input and the candidates that has the least squared error around it. What a candidate differs from the
//    input, squared, is known; how much of that difference is the input's noise is the variance times the weight that the luxel itself
//    does not have in the candidate. That is all it takes: linear equations, as many as candidates.
// 4. The same once more, with what came out as a pilot ([Dabov2007], "Image Denoising by Sparse 3-D Transform-Domain Collaborative Filtering", does so): what candidates do to
//    the light is seen in the pilot, and what they do to the noise is known from their kernels, so that the equations are hardly noisy any more. For indirect light the pilot
//    guides further candidates, which keep to luxels where it is alike.
//
// Where light is interpolated between knots, all luxels are filtered, but only knots are mixed, by what kernels do to the noise of knots so far apart. What is between them
// is interpolated again.
#include "post/denoise_graph.h"

#include "base/memory.h"

#include <string.h>

enum {
    direction_count = lx_denoise_direction_count,
    level_count = lx_denoise_level_count,
    narrow_levels = level_count,                      // along one axis
    most_candidates = level_count + 2 * narrow_levels, // a guided candidate has the place of one along an axis
    pool_levels = 3,                                  // over which products of differences, and variances, are pooled
    pilot_levels = 2,                                 // over which products of a pilot's are
    most_products = most_candidates * (most_candidates + 1) / 2 + 1, // and a weight
    block_luxels = 1024,  // mixed at a time
    region_luxels = 3072, // what a block's pools reach; one luxel's reach 729
    spacing_count = 3,    // knots are 1, 2 or 4 texels apart
};

enum { every_axis = -1 }; // else 0 or 2: the direction along it

// A neighbour without one on the other side would tilt a slope: so much of its weight counts.
static const float unpaired_share = 0.5f;
// By how much the variance beside a bright spot may exceed what the value suggests; and the share of a luxel's own variance that counts at least.
static const float contrast = 6, own_share = 0.25f;
static const float unsure = 0.05f; // relative variance at which a luxel's own value and its neighbourhood's count alike
// Differences between neighbours tell of noise up to so many times what variances expect, and lower these to a tenth at most.
static const float most_difference = 4, least_calm = 0.1f;
static const float pilot_trust = 0.8f; // there is noise left in it that passes for light
static const float guide_width = 4;    // standard deviations of the input's noise by which a pilot's luxels that are alike may differ
// Covariances come from some tens of luxels: their diagonals are raised by a share, and by that of the noise; less so where a pilot tells of the light.
static const float ridges[] = {0.2f, 0.05f}, ridges_of_noise[] = {0.01f, 0.003f};

// The kernel [1 2 1; 2 4 2; 1 2 1] / 16 in the links' order, over 15 for their weights.
static const float kernel_center = 0.25f;
static const float kernel[direction_count] = {0.125f / 15, 0.0625f / 15, 0.125f / 15, 0.0625f / 15,
                                              0.125f / 15, 0.0625f / 15, 0.125f / 15, 0.0625f / 15};

// What pools of one block of luxels need: the block, then what each level further out reaches.
typedef struct region {
    uint32_t *slot;                 // [luxel] place in the list; LX_NO_LUXEL: not in it
    uint32_t list[region_luxels];
    uint32_t end[pool_levels + 1];  // [0]: the block
    float products[2][region_luxels * most_products];
} region;

// Of unit noise, where no neighbour is missing: what a candidate has of a luxel's own, and covariances of what candidates differ from the input by.
typedef struct unit_noise {
    float own[most_candidates], covariance[most_candidates][most_candidates];
} unit_noise;

typedef struct work {
    const lx_denoise_graph *graph;
    const lx_denoise_knots *knots; // NULL: every luxel is one
    lx_light_part part;
    uint32_t candidate_count;
    lx_rgb *candidates[most_candidates]; // [luxel]
    float *variances;            // [luxel]
    int mix_levels;              // over which products of differences are pooled
    bool has_pilot;
    float *pilot;                // [luxel] mean of the channels
    float *filtered[most_candidates];     // [luxel] the pilot as the candidates are the input
    unit_noise noise[spacing_count];      // of knots 1, 2 and 4 texels apart and what is interpolated between them
    region *region;
} work;

static float mean_of(lx_rgb c) { return (c.r + c.g + c.b) * (1.0f / 3); }

static float share_of(const work *w, uint32_t luxel) { return w->knots ? w->knots->share[luxel] : 1; }

static const uint32_t *links_at(const lx_denoise_graph *graph, int level)
{
    return graph->links + (size_t)level * graph->luxel_count * direction_count;
}

size_t lx_denoise_scratch_bytes(const lx_denoise_graph *graph)
{
    return sizeof(region) + (size_t)graph->luxel_count * (most_candidates * (sizeof(lx_rgb) + sizeof(float)) + 2 * sizeof(float) + sizeof(uint32_t));
}

static work lay_out(const lx_denoise_graph *graph, lx_light_part part, const lx_denoise_knots *knots, void *scratch)
{
    work w = {.graph = graph, .knots = knots, .part = part, .candidate_count = part == lx_light_direct ? most_candidates : level_count, .mix_levels = pool_levels};
    const size_t count = graph->luxel_count;
    w.region = scratch;
    lx_rgb *next = (lx_rgb *)(void *)(w.region + 1);
    for (int k = 0; k < most_candidates; ++k, next += count) w.candidates[k] = next;
    w.variances = (float *)(void *)next;
    w.pilot = w.variances + count;
    for (int k = 0; k < most_candidates; ++k) w.filtered[k] = w.pilot + (size_t)(k + 1) * count;
    w.region->slot = (uint32_t *)(void *)(w.pilot + (size_t)(most_candidates + 1) * count);
    memset(w.region->slot, 0xff, count * sizeof *w.region->slot);
    return w;
}

// Means over a luxel and its neighbours of `size` numbers each, for those that `list` names (NULL: all), at their place in it.
static void pool(const lx_denoise_graph *graph, int level, const uint32_t *list, uint32_t count, const uint32_t *slot, size_t size,
                 const float *restrict in, float *restrict out)
{
    const uint32_t *links = links_at(graph, level);
    for (uint32_t i = 0; i < count; ++i) {
        const uint32_t *link = links + (size_t)(list ? list[i] : i) * direction_count;
        const float *restrict own = in + size * i;
        float *restrict sum = out + size * i;
        float total = kernel_center;
        for (size_t k = 0; k < size; ++k) sum[k] = kernel_center * own[k];
        for (int d = 0; d < direction_count; ++d) {
            const float weight = kernel[d] * (float)(link[d] & lx_denoise_most_weight);
            if (weight == 0) continue;
            const uint32_t luxel = link[d] >> lx_denoise_weight_bits;
            const float *restrict other = in + size * (slot ? slot[luxel] : luxel);
            for (size_t k = 0; k < size; ++k) sum[k] += weight * other[k];
            total += weight;
        }
        const float scale = 1 / total;
        for (size_t k = 0; k < size; ++k) sum[k] *= scale;
    }
}

// ---- variances ------------------------------------------------------------------------------------------------------------------

// Variances of single luxels, from a few half buffers each, are mostly noise themselves. Means over the neighbourhood: of the variance, of its share of
// the squared value, and of the value. Beside a bright spot the first is far too high for the dark, beside a dark spot the second for the
// bright; the lower of what they say is not far from the truth in both. Of knots alone: interpolating makes variances lower.
typedef struct spread {
    float absolute, relative, value, weight;
} spread;

static void pool_variances(const work *w, const lx_estimate *in)
{
    const uint32_t count = w->graph->luxel_count;
    spread *a = (spread *)(void *)w->candidates[0], *b = (spread *)(void *)w->candidates[2]; // four numbers: one array's place and a part of the next
    for (uint32_t i = 0; i < count; ++i) {
        const bool is_knot = share_of(w, i) > 0;
        const float value = mean_of(in[i].mean), square = value * value;
        a[i] = is_knot ? (spread){in[i].variance, square > 0 ? lx_min(1, in[i].variance / square) : 0, value, 1} : (spread){0, 0, 0, 0};
    }
    for (int level = 0; level < pool_levels; ++level) {
        pool(w->graph, level, NULL, count, NULL, 4, &a->absolute, &b->absolute);
        spread *swap = a;
        a = b;
        b = swap;
    }
    for (uint32_t i = 0; i < count; ++i) {
        const float unit = a[i].weight > 0 ? 1 / a[i].weight : 0, relative = unit * a[i].relative;
        // Where the noise is strong a single value says little about the light; the neighbourhood's does.
        const float shared = relative * relative / (relative * relative + unsure * unsure);
        const float value = (1 - shared) * mean_of(in[i].mean) + shared * unit * a[i].value;
        const float smooth = lx_min(unit * a[i].absolute, contrast * relative * value * value);
        float variance = lx_max(smooth, own_share * in[i].variance); // an outlier knows that it is one
        // What is below rounding is nothing.
        w->variances[i] = variance > lx_max(1e-12f * value * value, 1e-30f) ? variance : 0;
    }
}

// ---- candidates -----------------------------------------------------------------------------------------------------------------

// A candidate is filtered up to `level` along an axis, or both; from the input if `before` is -1, else from that candidate.
typedef struct shape {
    int axis, level, before;
    bool is_guided; // by the pilot
} shape;

static shape shape_of(lx_light_part part, int candidate)
{
    if (candidate < level_count) return (shape){every_axis, candidate, candidate - 1, false};
    const int level = (candidate - level_count) % narrow_levels, before = level == 0 ? -1 : candidate - 1;
    if (part == lx_light_indirect) return (shape){every_axis, level, before, true};
    return (shape){candidate < level_count + narrow_levels ? 0 : 2, level, before, false};
}

// How far the pilot's light is the same in two luxels, as far as noise would let it be told: 0 … 1.
static inline float likeness(const work *w, uint32_t a, uint32_t b)
{
    const float difference = w->pilot[a] - w->pilot[b], allowed = guide_width * guide_width * (w->variances[a] + w->variances[b]);
    return allowed > 0 ? allowed / (allowed + difference * difference) : 0;
}

// Weights of a luxel's neighbours at a level; returns their sum and the luxel's own.
static inline __attribute__((always_inline)) float neighbour_weights(const work *w, uint32_t luxel, shape s, float *weights)
{
    const uint32_t *link = links_at(w->graph, s.level) + (size_t)luxel * direction_count;
    float total = kernel_center;
    for (int d = 0; d < direction_count / 2; ++d) {
        const int back = d + direction_count / 2;
        float a = 0, b = 0;
        if (s.axis == every_axis || s.axis == d) {
            a = kernel[d] * (float)(link[d] & lx_denoise_most_weight);
            b = kernel[back] * (float)(link[back] & lx_denoise_most_weight);
            if (s.is_guided) {
                a *= likeness(w, luxel, link[d] >> lx_denoise_weight_bits);
                b *= likeness(w, luxel, link[back] >> lx_denoise_weight_bits);
            }
            const float most = lx_min(a, b) + unpaired_share * fabsf(a - b);
            a = lx_min(a, most);
            b = lx_min(b, most);
        }
        weights[d] = a;
        weights[back] = b;
        total += a + b;
    }
    return total;
}

// One level of the wavelet, [Dammertz2010] with its edges or without, of the first `size` of `stride` numbers a luxel.
static inline __attribute__((always_inline)) void filter_level(const work *w, shape s, size_t size, size_t stride, const float *restrict in, float *restrict out)
{
    const uint32_t *link = links_at(w->graph, s.level);
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i, link += direction_count) {
        float weights[direction_count], sum[3];
        const float scale = 1 / neighbour_weights(w, i, s, weights);
        for (size_t k = 0; k < size; ++k) sum[k] = kernel_center * in[stride * i + k];
        for (int d = 0; d < direction_count; ++d) {
            if (weights[d] == 0) continue;
            const float *other = in + stride * (link[d] >> lx_denoise_weight_bits);
            for (size_t k = 0; k < size; ++k) sum[k] += weights[d] * other[k];
        }
        for (size_t k = 0; k < size; ++k) out[size * i + k] = scale * sum[k];
    }
}

// Candidates first … end - 1 of the input.
static void filter_input(const work *w, const lx_estimate *in, int first, int end)
{
    for (int k = first; k < end; ++k) {
        const shape s = shape_of(w->part, k);
        if (s.before < 0)
            filter_level(w, s, 3, sizeof *in / sizeof(float), &in->mean.r, &w->candidates[k]->r);
        else
            filter_level(w, s, 3, 3, &w->candidates[s.before]->r, &w->candidates[k]->r);
    }
}

// From now on there is a pilot, and candidates that it guides.
static void take_pilot(work *w, const lx_rgb *pilot, const lx_estimate *in)
{
    const int before = (int)w->candidate_count;
    for (uint32_t i = 0; i < w->graph->luxel_count; ++i) w->pilot[i] = mean_of(pilot[i]);
    w->has_pilot = true;
    if (w->part == lx_light_indirect) w->candidate_count = 2 * level_count;
    for (int k = 0; k < (int)w->candidate_count; ++k) {
        const shape s = shape_of(w->part, k);
        filter_level(w, s, 1, 1, s.before < 0 ? w->pilot : w->filtered[s.before], w->filtered[k]);
    }
    filter_input(w, in, before, (int)w->candidate_count);
}

// Kernels are products of one along each axis, of [1 2 1] / 4 at the steps of all levels up to theirs. What a kernel has of a knot is what it has of the luxels around, each as far
// as it is interpolated from the knot.
static void find_unit_noise(work *w)
{
    enum { middle = (1 << level_count) - 1, width = 2 * middle + 1 };
    float line[level_count + 1][width] = {{0}}; // [levels]
    line[0][middle] = 1;
    for (int n = 0; n < level_count; ++n)
        for (int i = 0; i < width; ++i) {
            const int step = 1 << n;
            line[n + 1][i] = 0.5f * line[n][i] + 0.25f * ((i >= step ? line[n][i - step] : 0) + (i + step < width ? line[n][i + step] : 0));
        }
    for (int s = 0; s < spacing_count; ++s) {
        enum { most_reach = 1 << (spacing_count - 1), most_knots = width + 2 * most_reach };
        const int spacing = 1 << s, first = middle % spacing - spacing; // beyond both ends there is a knot more
        float of_knot[level_count + 1][most_knots] = {{0}}, inner[level_count + 1][level_count + 1] = {{0}}, own_line[level_count + 1];
        int count = 0;
        for (int knot = first; knot < width + spacing; knot += spacing, ++count)
            for (int n = 0; n <= level_count; ++n) {
                for (int i = 0; i < width; ++i) of_knot[n][count] += line[n][i] * lx_max(0, 1 - fabsf((float)(i - knot)) / (float)spacing);
                if (knot == middle) own_line[n] = of_knot[n][count];
            }
        for (int a = 0; a <= level_count; ++a)
            for (int b = 0; b <= level_count; ++b)
                for (int i = 0; i < count; ++i) inner[a][b] += of_knot[a][i] * of_knot[b][i];
        unit_noise *out = &w->noise[s];
        int across[most_candidates], down[most_candidates];
        for (int k = 0; k < most_candidates; ++k) {
            const shape of = shape_of(lx_light_direct, k);
            across[k] = of.axis == 2 ? 0 : of.level + 1;
            down[k] = of.axis == 0 ? 0 : of.level + 1;
            out->own[k] = own_line[across[k]] * own_line[down[k]];
            for (int j = 0; j <= k; ++j)
                out->covariance[k][j] = inner[across[k]][across[j]] * inner[down[k]][down[j]] - out->own[k] - out->own[j] + 1;
        }
    }
}

// The candidate whose kernel a guided one has where light is the same all around: how much more of its noise the guide leaves, a luxel's own weight tells.
static uint32_t unguided(const work *w, uint32_t candidate)
{
    return w->part == lx_light_indirect && candidate >= level_count ? candidate - level_count : candidate;
}

static float covariance_of(const work *w, const unit_noise *noise, uint32_t a, uint32_t b)
{
    a = unguided(w, a);
    b = unguided(w, b);
    return a > b ? noise->covariance[a][b] : noise->covariance[b][a];
}

// The like around a luxel that is in so many luxels' light: a knot among others 1, 2, 4 texels apart is in that of 1, 4, 16.
static const unit_noise *noise_around(const work *w, uint32_t luxel, unit_noise *room)
{
    const float share = share_of(w, luxel);
    if (share == 1) return &w->noise[0];
    const bool is_wide = share > 4;
    const unit_noise *a = &w->noise[is_wide], *b = a + 1;
    const float t = is_wide ? lx_min((share - 4) / 12, 1) : (share - 1) / 3;
    for (uint32_t k = 0; k < level_count; ++k) { // interpolated light is indirect
        room->own[k] = a->own[k] + t * (b->own[k] - a->own[k]);
        for (uint32_t j = 0; j <= k; ++j) room->covariance[k][j] = a->covariance[k][j] + t * (b->covariance[k][j] - a->covariance[k][j]);
    }
    return room;
}

// Weight that a luxel has itself in each candidate: no way leads back to it, since the steps of each level are longer than those before together.
static void find_own_weights(const work *w, uint32_t luxel, const unit_noise *noise, float *own)
{
    const float *alone = w->noise[0].own;
    float white[most_candidates]; // if neighbours' noise were not its own in part
    for (uint32_t k = 0; k < w->candidate_count; ++k) {
        const shape s = shape_of(w->part, (int)k);
        const uint32_t like = unguided(w, k);
        float weights[direction_count];
        white[k] = kernel_center / neighbour_weights(w, luxel, s, weights);
        if (s.before >= 0) white[k] *= white[s.before];
        own[k] = noise == &w->noise[0] ? white[k] : 1 - (1 - white[k]) * (1 - noise->own[like]) / (1 - alone[like]);
    }
}

// Samples that are spread well have less error together than their halves suggest; how much less, only the picture tells. Noise makes neighbours
// differ: where they differ less than the variances expect, these are lowered. (Where they differ more, that is light.)
static void calm_variances(const work *w, const lx_rgb *input)
{
    typedef struct calm {
        float share, weight;
    } calm;
    const uint32_t count = w->graph->luxel_count;
    calm *a = (calm *)(void *)w->filtered[0], *b = (calm *)(void *)w->filtered[2]; // two numbers: two arrays' place
    for (uint32_t i = 0; i < count; ++i) {
        a[i] = (calm){0, 0};
        if (!(w->variances[i] > 0) || share_of(w, i) == 0) continue;
        float weights[direction_count];
        const float scale = 1 / neighbour_weights(w, i, (shape){every_axis, 0, -1, false}, weights);
        float expected = (1 - kernel_center * scale) * (1 - kernel_center * scale);
        for (int d = 0; d < direction_count; ++d) expected += weights[d] * weights[d] * scale * scale;
        unit_noise room;
        expected *= noise_around(w, i, &room)->covariance[0][0] / w->noise[0].covariance[0][0];
        if (!(expected > 0)) continue;
        const float difference = mean_of(w->candidates[0][i]) - mean_of(input[i]);
        a[i] = (calm){lx_min(difference * difference / (expected * w->variances[i]), most_difference), 1};
    }
    for (int level = 0; level < level_count; ++level) {
        pool(w->graph, level, NULL, count, NULL, 2, &a->share, &b->share);
        calm *swap = a;
        a = b;
        b = swap;
    }
    for (uint32_t i = 0; i < count; ++i)
        if (a[i].weight > 0) w->variances[i] *= lx_clamp(a[i].share / a[i].weight, least_calm, 1);
}

// ---- mixtures -------------------------------------------------------------------------------------------------------------------

// Takes into the list what those in it have for neighbours at `level`; false: too many.
static bool widen(const work *w, int level, uint32_t *count)
{
    region *r = w->region;
    const uint32_t before = *count;
    for (uint32_t i = 0; i < before; ++i) {
        const uint32_t *link = links_at(w->graph, level) + (size_t)r->list[i] * direction_count;
        for (int d = 0; d < direction_count; ++d) {
            const uint32_t other = link[d] >> lx_denoise_weight_bits;
            if ((link[d] & lx_denoise_most_weight) == 0 || r->slot[other] != LX_NO_LUXEL) continue;
            if (*count == region_luxels) return false;
            r->slot[other] = *count;
            r->list[(*count)++] = other;
        }
    }
    return true;
}

static void forget(region *r, uint32_t count)
{
    for (uint32_t i = 0; i < count; ++i) r->slot[r->list[i]] = LX_NO_LUXEL;
}

// Noisy knots of first … end - 1 and all that their pools reach. Returns how many luxels that are; 0: none is noisy, or too many are reached (`*fits` tells).
static uint32_t collect(const work *w, uint32_t first, uint32_t end, bool *fits)
{
    region *r = w->region;
    uint32_t count = 0;
    *fits = true;
    for (uint32_t i = first; i < end; ++i) {
        if (!(w->variances[i] > 0) || share_of(w, i) == 0) continue;
        r->slot[i] = count;
        r->list[count++] = i;
    }
    r->end[0] = count;
    for (int k = 1; k <= w->mix_levels && *fits; ++k) {
        *fits = widen(w, w->mix_levels - k, &count);
        r->end[k] = count;
    }
    if (*fits) return count;
    forget(r, count);
    return 0;
}

// Products of the candidates' differences from the input, or of their likes from the pilot, in units of the input's variance, and the weight that they have: none where
// nothing is noise, or none of the luxel's own.
static void multiply(const work *w, const lx_estimate *in, uint32_t luxel, size_t size, float *out)
{
    const float variance = w->variances[luxel];
    if (!(variance > 0) || share_of(w, luxel) == 0) {
        memset(out, 0, size * sizeof *out);
        return;
    }
    const float value = mean_of(in[luxel].mean), scale = 1 / variance;
    float difference[most_candidates];
    size_t at = 0;
    for (uint32_t k = 0; k < w->candidate_count; ++k) {
        difference[k] = w->has_pilot ? w->filtered[k][luxel] - w->pilot[luxel] : mean_of(w->candidates[k][luxel]) - value;
        for (uint32_t j = 0; j <= k; ++j) out[at++] = difference[k] * difference[j] * scale;
    }
    out[at] = 1;
}

// Solves A y = b by Cholesky's method, A symmetric, its lower half given; y takes b's place.
static void solve(float a[most_candidates][most_candidates], uint32_t count, float *y)
{
    float inverse[most_candidates]; // of the factor's diagonal
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t j = 0; j < i; ++j) {
            float sum = a[i][j];
            for (uint32_t k = 0; k < j; ++k) sum -= a[i][k] * a[j][k];
            a[i][j] = sum * inverse[j];
        }
        float square = a[i][i];
        for (uint32_t k = 0; k < i; ++k) square -= a[i][k] * a[i][k];
        inverse[i] = 1 / sqrtf(lx_max(square, 1e-9f));
        for (uint32_t k = 0; k < i; ++k) y[i] -= a[i][k] * y[k];
        y[i] *= inverse[i];
    }
    for (uint32_t i = count; i-- > 0;) {
        for (uint32_t k = i + 1; k < count; ++k) y[i] -= a[k][i] * y[k];
        y[i] *= inverse[i];
    }
}

// Weights x of the candidates that have the least of 1 - 2 xᵀ(1 - own) + xᵀ C x: the squared error of input + Σ x (candidate - input) by [Blu2007], in units
// of the input's variance. Unless they may sharpen: not below zero (negative ones are left out and the rest solved again), and together at most 1.
static void find_weights(const work *w, const float *products, const unit_noise *noise, const float *own, float *x)
{
    const uint32_t count = w->candidate_count;
    const float trust = (w->has_pilot ? pilot_trust : 1) / products[count * (count + 1) / 2];
    uint32_t used[most_candidates], used_count = 0;
    for (uint32_t k = 0; k < count; ++k) {
        x[k] = 0;
        if (own[k] < 1) used[used_count++] = k;
    }
    const bool may_sharpen = w->part == lx_light_indirect; // weights below zero: kernels that keep curvature
    while (used_count > 0) {
        float a[most_candidates][most_candidates], y[most_candidates], whole[most_candidates]; // how much of a kernel's noise is left where neighbours are missing
        for (uint32_t i = 0; i < used_count; ++i) {
            const uint32_t k = used[i];
            y[i] = 1 - own[k];
            whole[i] = w->has_pilot ? sqrtf(y[i] / (1 - noise->own[unguided(w, k)])) : 0;
            for (uint32_t j = 0; j <= i; ++j) a[i][j] = products[k * (k + 1) / 2 + used[j]] * trust + whole[i] * whole[j] * covariance_of(w, noise, k, used[j]);
            a[i][i] = a[i][i] * (1 + ridges[w->has_pilot]) + ridges_of_noise[w->has_pilot];
        }
        solve(a, used_count, y);
        uint32_t kept = 0;
        float sum = 0;
        for (uint32_t i = 0; i < used_count; ++i) {
            sum += y[i];
            if (may_sharpen || y[i] >= 0) used[kept++] = used[i];
        }
        if (kept < used_count) {
            used_count = kept;
            continue;
        }
        const float most = may_sharpen || sum <= 1 ? 1 : 1 / sum;
        for (uint32_t i = 0; i < used_count; ++i) x[used[i]] = y[i] * most;
        return;
    }
}

static lx_rgb mix(const work *w, const lx_estimate *in, uint32_t luxel, const float *x)
{
    float left = 1;
    lx_rgb sum = {0, 0, 0};
    for (uint32_t k = 0; k < w->candidate_count; ++k) {
        sum = lx_rgb_add(sum, lx_rgb_scale(w->candidates[k][luxel], x[k]));
        left -= x[k];
    }
    sum = lx_rgb_add(sum, lx_rgb_scale(in[luxel].mean, left));
    lx_rgb low = in[luxel].mean, high = low;
    const float share = share_of(w, luxel);
    const uint32_t *link = links_at(w->graph, share > 4 ? 2 : share > 1) + (size_t)luxel * direction_count; // to the next knots
    for (int d = 0; d < direction_count; ++d) { // the luxel itself where there is no neighbour
        const lx_rgb other = in[link[d] >> lx_denoise_weight_bits].mean;
        low = (lx_rgb){lx_min(low.r, other.r), lx_min(low.g, other.g), lx_min(low.b, other.b)};
        high = (lx_rgb){lx_max(high.r, other.r), lx_max(high.g, other.g), lx_max(high.b, other.b)};
    }
    return (lx_rgb){lx_clamp(sum.r, low.r, high.r), lx_clamp(sum.g, low.g, high.g), lx_clamp(sum.b, low.b, high.b)};
}

static void mix_block(const work *w, const lx_estimate *in, uint32_t first, uint32_t end, lx_rgb *out)
{
    region *r = w->region;
    bool fits;
    const uint32_t count = collect(w, first, end, &fits);
    if (!fits) {
        const uint32_t middle = first + (end - first) / 2;
        mix_block(w, in, first, middle, out);
        mix_block(w, in, middle, end, out);
        return;
    }
    if (count == 0) return;
    const size_t size = (size_t)w->candidate_count * (w->candidate_count + 1) / 2 + 1;
    float *from = r->products[0], *to = r->products[1];
    for (uint32_t i = 0; i < count; ++i) multiply(w, in, r->list[i], size, from + size * i);
    for (int level = 0; level < w->mix_levels; ++level) {
        pool(w->graph, level, r->list, r->end[w->mix_levels - 1 - level], r->slot, size, from, to);
        float *swap = from;
        from = to;
        to = swap;
    }
    for (uint32_t i = 0; i < r->end[0]; ++i) {
        float own[most_candidates], x[most_candidates];
        unit_noise room;
        const unit_noise *noise = noise_around(w, r->list[i], &room);
        find_own_weights(w, r->list[i], noise, own);
        find_weights(w, from + size * i, noise, own, x);
        out[r->list[i]] = mix(w, in, r->list[i], x);
    }
    forget(r, count);
}

static void mix_all(const work *w, const lx_estimate *in, lx_rgb *out)
{
    const uint32_t count = w->graph->luxel_count;
    for (uint32_t first = 0; first < count; first += block_luxels) mix_block(w, in, first, count - first < block_luxels ? count : first + block_luxels, out);
    if (w->knots) w->knots->interpolate(w->knots->user, out);
}

void lx_denoise_layer(const lx_denoise_graph *graph, lx_light_part part, const lx_estimate *in, const lx_denoise_knots *knots, void *scratch, lx_rgb *out)
{
    bool is_exact = true;
    for (uint32_t i = 0; i < graph->luxel_count; ++i) {
        out[i] = in[i].mean;
        is_exact &= !(in[i].variance > 0);
    }
    if (is_exact) return;
    work w = lay_out(graph, part, knots, scratch);
    find_unit_noise(&w);
    pool_variances(&w, in);
    filter_input(&w, in, 0, (int)w.candidate_count);
    calm_variances(&w, out);
    mix_all(&w, in, out);
    take_pilot(&w, out, in);
    if (part == lx_light_direct) w.mix_levels = pilot_levels; // its detail is finer, and a pilot tells enough of fewer luxels
    mix_all(&w, in, out);
}
