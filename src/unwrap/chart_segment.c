// Cuts a patch into charts that face one way: greedy growth from the largest triangles, then merging of neighbours.
// Flatness comes first (the charts are projected, not flattened), a compact outline second.
//
// Based on: the growth step follows [Sander2003] Sander, Wood, Gortler, Snyder, Hoppe, "Multi-Chart Geometry Images",
// SGP 2003, section 3.1 (a priority queue of faces by deviation from the chart's normal). Different: charts grow one after
// the other until a fixed cone is full, so that their number follows from the shape, and no reseeding iterations.
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <stdlib.h>
#include <string.h>

static const double grow_cosine = 0.64;                // 50° around the mean normal: a cylinder is four charts, a 45° bevel joins
static const double merge_angle = 0.90;                // 51.6°, of bounding cones
static const double merge_crease = 0.70;               // 40°: sharper folds between two charts stay a border
static const double merge_min_shared = 0.15;           // of the smaller outline; less makes dumbbells
static const double crumb_share = 0.05;                // a chart this small beside its neighbour joins it more readily:
static const double crumb_angle = 1.10;                // up to 63°, whatever the fold; better squeezed than a padding of its own
enum { merge_passes = 8, evict_rounds = 6 };

void lx_segmentation_release(lx_segmentation *segmentation)
{
    lx_free(segmentation->chart_of);
    lx_free(segmentation->normals);
    *segmentation = (lx_segmentation){0};
}

uint32_t lx_segmentation_add(lx_segmentation *segmentation, lx_dvec3 normal)
{
    if (!lx_array_reserve(&segmentation->normals, &segmentation->normal_capacity, (size_t)segmentation->chart_count + 1,
                          sizeof *segmentation->normals))
        return LX_NONE;
    segmentation->normals[segmentation->chart_count] = normal;
    return segmentation->chart_count++;
}

// ---- A heap of triangles, cheapest first; equal costs by index, so that the order is a function of the input alone. ----

typedef struct candidate { float cost; uint32_t triangle; } candidate;
typedef struct heap { candidate *items; size_t count, capacity; } heap;

static bool cheaper(candidate a, candidate b)
{
    return a.cost != b.cost ? a.cost < b.cost : a.triangle < b.triangle;
}

static bool heap_push(heap *h, candidate item)
{
    if (!lx_array_reserve(&h->items, &h->capacity, h->count + 1, sizeof *h->items)) return false;
    size_t i = h->count++;
    for (; i > 0 && cheaper(item, h->items[(i - 1) / 2]); i = (i - 1) / 2) h->items[i] = h->items[(i - 1) / 2];
    h->items[i] = item;
    return true;
}

static candidate heap_pop(heap *h)
{
    const candidate top = h->items[0], last = h->items[--h->count];
    size_t i = 0;
    for (;;) {
        size_t child = 2 * i + 1;
        if (child >= h->count) break;
        if (child + 1 < h->count && cheaper(h->items[child + 1], h->items[child])) ++child;
        if (!cheaper(h->items[child], last)) break;
        h->items[i] = h->items[child];
        i = child;
    }
    h->items[i] = last;
    return top;
}

// ---- Growth ------------------------------------------------------------------------------------------------------------

static bool push_neighbors(const lx_patch *patch, const uint32_t *chart_of, uint32_t triangle, lx_dvec3 normal, heap *queue)
{
    for (int k = 0; k < 3; ++k) {
        const uint32_t other = patch->neighbors[3 * triangle + k];
        if (other == LX_NONE || chart_of[other] != LX_NO_CHART) continue;
        const double cosine = lx_ddot(patch->normals[other], normal);
        if (cosine < grow_cosine) continue;
        // Rounded to steps of about 1/2000, so that noise in flat regions does not decide the order.
        if (!heap_push(queue, (candidate){(float)floor((1 - cosine) * 2048), other})) return false;
    }
    return true;
}

static bool grow(const lx_patch *patch, uint32_t seed, uint32_t chart, uint32_t *chart_of, heap *queue)
{
    const double seed_area = patch->areas[seed];
    lx_dvec3 sum = patch->normals[seed], normal = sum; // in units of the seed's area
    chart_of[seed] = chart;
    queue->count = 0;
    if (!push_neighbors(patch, chart_of, seed, normal, queue)) return false;
    while (queue->count > 0) {
        const uint32_t t = heap_pop(queue).triangle;
        if (chart_of[t] != LX_NO_CHART || lx_ddot(patch->normals[t], normal) < grow_cosine) continue;
        chart_of[t] = chart;
        sum = lx_dmad(sum, patch->normals[t], patch->areas[t] / seed_area);
        normal = lx_dnormalize(sum);
        if (!push_neighbors(patch, chart_of, t, normal, queue)) return false;
    }
    return true;
}

typedef struct seed { double area; uint32_t triangle; } seed;

static int compare_seeds(const void *pa, const void *pb)
{
    const seed *a = pa, *b = pb;
    if (a->area != b->area) return a->area > b->area ? -1 : 1;
    return a->triangle < b->triangle ? -1 : a->triangle > b->triangle;
}

static lx_result grow_all(const lx_patch *patch, const seed *seeds, uint32_t seed_count, const atomic_bool *stop,
                          lx_segmentation *out, heap *queue, lx_error *error)
{
    for (uint32_t i = 0; i < seed_count; ++i) {
        if (out->chart_of[seeds[i].triangle] != LX_NO_CHART) continue;
        if (stop && atomic_load(stop)) return lx_fail(error, LX_ERROR_CANCELLED, "cancelled");
        const uint32_t chart = lx_segmentation_add(out, (lx_dvec3){0, 0, 1});
        if (chart == LX_NONE || !grow(patch, seeds[i].triangle, chart, out->chart_of, queue))
            return lx_fail_memory(error, "chart segmentation");
    }
    return LX_OK;
}

// ---- Merging -----------------------------------------------------------------------------------------------------------

typedef struct chart_state {
    lx_dvec3 sum;      // of area × normal
    lx_dvec3 normal;
    double area;
    double cone;       // radians that bound the deviation of all triangles from `normal`
    double outline;    // length of the border
    uint32_t parent;   // union-find
    bool busy;         // took part in a merge of this pass
} chart_state;

typedef struct contact { uint32_t a, b; double length, fold; } contact; // fold: length × angle between the triangles

static int compare_contacts(const void *pa, const void *pb)
{
    const contact *a = pa, *b = pb;
    if (a->a != b->a) return a->a < b->a ? -1 : 1;
    return a->b < b->b ? -1 : a->b > b->b;
}

static int compare_contact_shares(const void *pa, const void *pb)
{
    const contact *a = pa, *b = pb;
    if (a->length != b->length) return a->length > b->length ? -1 : 1;
    return compare_contacts(pa, pb);
}

static uint32_t find_root(chart_state *states, uint32_t chart)
{
    while (states[chart].parent != chart) {
        states[chart].parent = states[states[chart].parent].parent;
        chart = states[chart].parent;
    }
    return chart;
}

static double angle_between(lx_dvec3 a, lx_dvec3 b)
{
    const double d = lx_ddot(a, b);
    return acos(d < -1 ? -1 : d > 1 ? 1 : d);
}

static double edge_length(const lx_patch *patch, uint32_t half_edge)
{
    const uint32_t a = patch->corners[half_edge], b = patch->corners[half_edge % 3 == 2 ? half_edge - 2 : half_edge + 1];
    const lx_dvec3 d = lx_dsub(patch->positions[a], patch->positions[b]);
    return sqrt(lx_ddot(d, d));
}

static void sum_normals(const lx_patch *patch, const uint32_t *chart_of, chart_state *states)
{
    for (uint32_t t = 0; t < patch->triangle_count; ++t)
        if (chart_of[t] != LX_NO_CHART)
            states[chart_of[t]].sum = lx_dmad(states[chart_of[t]].sum, patch->normals[t], patch->areas[t]);
}

// Contacts between charts with their lengths summed, in order of (a, b). Returns their number.
static size_t gather_contacts(const lx_patch *patch, const uint32_t *chart_of, chart_state *states, contact *contacts)
{
    size_t count = 0;
    for (uint32_t h = 0; h < 3 * patch->triangle_count; ++h) {
        const uint32_t t = h / 3, other = patch->neighbors[h];
        if (chart_of[t] == LX_NO_CHART) continue;
        const uint32_t a = find_root(states, chart_of[t]);
        const uint32_t b = other == LX_NONE ? LX_NONE : find_root(states, chart_of[other]);
        if (a == b) continue;
        const double length = edge_length(patch, h);
        states[a].outline += length;
        if (b != LX_NONE && a < b) contacts[count++] = (contact){a, b, length, length * angle_between(patch->normals[t], patch->normals[other])};
    }
    qsort(contacts, count, sizeof *contacts, compare_contacts);
    size_t kept = 0;
    for (size_t i = 0; i < count; ++i) {
        if (kept > 0 && contacts[kept - 1].a == contacts[i].a && contacts[kept - 1].b == contacts[i].b) {
            contacts[kept - 1].length += contacts[i].length;
            contacts[kept - 1].fold += contacts[i].fold;
        } else {
            contacts[kept++] = contacts[i];
        }
    }
    return kept;
}

// One pass: contacts in order of their share of the smaller outline, each chart at most once.
static uint32_t merge_pass(const lx_patch *patch, const uint32_t *chart_of, chart_state *states, uint32_t chart_count,
                           contact *contacts)
{
    for (uint32_t c = 0; c < chart_count; ++c) {
        states[c].outline = 0;
        states[c].busy = false;
    }
    const size_t count = gather_contacts(patch, chart_of, states, contacts);
    for (size_t i = 0; i < count; ++i) { // folds become mean angles, lengths become shares
        contacts[i].fold /= contacts[i].length;
        contacts[i].length /= fmin(states[contacts[i].a].outline, states[contacts[i].b].outline);
    }
    qsort(contacts, count, sizeof *contacts, compare_contact_shares);
    uint32_t merged = 0;
    for (size_t i = 0; i < count && contacts[i].length >= merge_min_shared; ++i) {
        chart_state *a = &states[contacts[i].a], *b = &states[contacts[i].b];
        if (a->busy || b->busy) continue;
        const bool crumb = fmin(a->area, b->area) < crumb_share * fmax(a->area, b->area);
        if (!crumb && contacts[i].fold > merge_crease) continue;
        const lx_dvec3 sum = lx_dmad(a->sum, b->sum, 1), normal = lx_dnormalize(sum);
        const double cone = fmax(angle_between(normal, a->normal) + a->cone, angle_between(normal, b->normal) + b->cone);
        if (cone > (crumb ? crumb_angle : merge_angle)) continue;
        a->area += b->area;
        a->sum = sum;
        a->normal = normal;
        a->cone = cone;
        a->busy = b->busy = true;
        b->parent = contacts[i].a;
        ++merged;
    }
    return merged;
}

static lx_result merge(const lx_patch *patch, lx_segmentation *out, lx_error *error)
{
    if (out->chart_count < 2) return LX_OK;
    chart_state *states = lx_calloc_array(out->chart_count, sizeof *states);
    contact *contacts = lx_malloc_array((size_t)patch->triangle_count * 3, sizeof *contacts);
    if (!states || !contacts) {
        lx_free(states);
        lx_free(contacts);
        return lx_fail_memory(error, "chart segmentation");
    }
    sum_normals(patch, out->chart_of, states);
    for (uint32_t c = 0; c < out->chart_count; ++c) {
        states[c].parent = c;
        states[c].normal = lx_dnormalize(states[c].sum);
    }
    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        if (out->chart_of[t] == LX_NO_CHART) continue;
        chart_state *s = &states[out->chart_of[t]];
        s->area += patch->areas[t];
        s->cone = fmax(s->cone, angle_between(s->normal, patch->normals[t]));
    }
    for (int pass = 0; pass < merge_passes; ++pass)
        if (merge_pass(patch, out->chart_of, states, out->chart_count, contacts) == 0) break;
    for (uint32_t t = 0; t < patch->triangle_count; ++t)
        if (out->chart_of[t] != LX_NO_CHART) out->chart_of[t] = find_root(states, out->chart_of[t]);
    lx_free(states);
    lx_free(contacts);
    return LX_OK;
}

// ---- Normals, evictions, components ---------------------------------------------------------------------------------------

// Gives every chart its mean normal and throws out triangles that turn too far away from it. Returns how many.
static lx_result evict(const lx_patch *patch, uint32_t first_chart, lx_segmentation *out, uint32_t *evicted, lx_error *error)
{
    chart_state *states = lx_calloc_array(out->chart_count, sizeof *states);
    if (!states) return lx_fail_memory(error, "chart segmentation");
    sum_normals(patch, out->chart_of, states);
    for (uint32_t c = first_chart; c < out->chart_count; ++c) out->normals[c] = lx_dnormalize(states[c].sum);
    *evicted = 0;
    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        const uint32_t c = out->chart_of[t];
        if (c == LX_NO_CHART || c < first_chart || lx_ddot(patch->normals[t], out->normals[c]) >= lx_keep_cosine) continue;
        out->chart_of[t] = LX_NO_CHART;
        ++*evicted;
    }
    lx_free(states);
    return LX_OK;
}

lx_result lx_segmentation_connect(const lx_patch *patch, lx_segmentation *out, lx_error *error)
{
    const uint32_t count = patch->triangle_count;
    uint32_t *stack = lx_malloc_array(count, sizeof *stack);
    uint32_t *part_of = lx_malloc_array(count, sizeof *part_of);
    lx_segmentation parts = {0};
    lx_result result = stack && part_of ? LX_OK : lx_fail_memory(error, "chart segmentation");
    for (uint32_t t = 0; result == LX_OK && t < count; ++t) part_of[t] = LX_NO_CHART;
    for (uint32_t t = 0; result == LX_OK && t < count; ++t) {
        const uint32_t chart = out->chart_of[t];
        if (chart == LX_NO_CHART || part_of[t] != LX_NO_CHART) continue;
        const uint32_t part = lx_segmentation_add(&parts, out->normals[chart]);
        if (part == LX_NONE) {
            result = lx_fail_memory(error, "chart segmentation");
            break;
        }
        uint32_t top = 0;
        stack[top++] = t;
        part_of[t] = part;
        while (top > 0) {
            const uint32_t *n = &patch->neighbors[3 * stack[--top]];
            for (int k = 0; k < 3; ++k) {
                if (n[k] == LX_NONE || out->chart_of[n[k]] != chart || part_of[n[k]] != LX_NO_CHART) continue;
                part_of[n[k]] = part;
                stack[top++] = n[k];
            }
        }
    }
    lx_free(stack);
    if (result != LX_OK) {
        lx_free(part_of);
        lx_segmentation_release(&parts);
        return result;
    }
    lx_segmentation_release(out);
    *out = parts;
    out->chart_of = part_of;
    return LX_OK;
}

lx_result lx_segment(const lx_patch *patch, const atomic_bool *stop, lx_segmentation *out, lx_error *error)
{
    lx_result result = LX_OK;
    heap queue = {0};
    uint32_t seed_count = 0, evicted = 0;
    seed *seeds = lx_malloc_array(patch->triangle_count, sizeof *seeds);
    *out = (lx_segmentation){.chart_of = lx_malloc_array(patch->triangle_count, sizeof *out->chart_of)};
    if (!seeds || !out->chart_of) LX_TRY(lx_fail_memory(error, "chart segmentation"));

    for (uint32_t t = 0; t < patch->triangle_count; ++t) {
        out->chart_of[t] = LX_NO_CHART;
        if (patch->areas[t] > 0) seeds[seed_count++] = (seed){patch->areas[t], t};
    }
    qsort(seeds, seed_count, sizeof *seeds, compare_seeds);
    LX_TRY(grow_all(patch, seeds, seed_count, stop, out, &queue, error));
    LX_TRY(merge(patch, out, error));
    LX_TRY(evict(patch, 0, out, &evicted, error));
    for (int round = 0; evicted > 0 && round < evict_rounds; ++round) {
        const uint32_t first_chart = out->chart_count;
        LX_TRY(grow_all(patch, seeds, seed_count, stop, out, &queue, error));
        LX_TRY(evict(patch, first_chart, out, &evicted, error));
    }
    for (uint32_t i = 0; evicted > 0 && i < seed_count; ++i) { // what still will not settle stands alone
        const uint32_t t = seeds[i].triangle;
        if (out->chart_of[t] != LX_NO_CHART) continue;
        out->chart_of[t] = lx_segmentation_add(out, patch->normals[t]);
        if (out->chart_of[t] == LX_NONE) LX_TRY(lx_fail_memory(error, "chart segmentation"));
    }
    LX_TRY(lx_segmentation_connect(patch, out, error));
cleanup:
    lx_free(seeds);
    lx_free(queue.items);
    if (result != LX_OK) lx_segmentation_release(out);
    return result;
}
