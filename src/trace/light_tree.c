#include "trace/light_tree.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

enum { width = lx_light_tree_width, buckets = 12 };

// Of triangle i of a bin, of the leaf's power.
static inline float share_in(const lx_light_bin *bin, uint32_t i)
{
    return lx_min(bin->until[i], 1) - (i > 0 ? bin->until[i - 1] : 0);
}

// ---- construction --------------------------------------------------------------------------------------------------------------

typedef struct cluster {
    lx_bounds bounds;
    lx_vec3 normals; // sum of power × normal
    float power;
} cluster;

static const cluster empty_cluster = {{{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}}, {0, 0, 0}, 0};

static lx_vec3 centre_of(const lx_light_leaf *leaf)
{
    return lx_scale(lx_add(lx_add(leaf->corner[0], leaf->corner[1]), leaf->corner[2]), 1.0f / 3);
}

static void add_leaf(cluster *c, const lx_light_leaf *leaf)
{
    for (int k = 0; k < 3; ++k) lx_bounds_add(&c->bounds, leaf->corner[k]);
    // What shines from both sides adds to the side that is there already.
    const bool flip = leaf->both_sides && lx_dot(leaf->normal, c->normals) < 0;
    c->normals = lx_mad(c->normals, leaf->normal, flip ? -leaf->power : leaf->power);
    c->power += leaf->power;
}

static void add_cluster(cluster *c, const cluster *other)
{
    c->bounds.low = lx_min3(c->bounds.low, other->bounds.low);
    c->bounds.high = lx_max3(c->bounds.high, other->bounds.high);
    c->normals = lx_add(c->normals, other->normals);
    c->power += other->power;
}

// [ContyKulla2018] section 4.4: power × surface of the box × measure of the directions. The latter goes from pi for one normal to 4 pi for all; the length of
// the mean normal tells which.
static float cost_of(const cluster *c)
{
    if (!(c->power > 0)) return 0;
    const lx_vec3 d = lx_sub(c->bounds.high, c->bounds.low);
    const float surface = d.x * d.y + d.y * d.z + d.z * d.x, even = lx_min(1, lx_length(c->normals) / c->power);
    return c->power * surface * (1 + 3 * (1 - even));
}

static float component(lx_vec3 v, int axis)
{
    return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

static int bucket_of(lx_vec3 centre, const lx_bounds *range, int axis)
{
    const float low = component(range->low, axis), extent = component(range->high, axis) - low;
    return (int)lx_clamp((component(centre, axis) - low) / extent * buckets, 0, buckets - 1);
}

// Sorts the leaves into two parts and returns the size of the first, by the cheapest of the planes between buckets.
static uint32_t split(lx_light_leaf *leaves, uint32_t count)
{
    lx_bounds range = lx_bounds_empty();
    for (uint32_t i = 0; i < count; ++i) lx_bounds_add(&range, centre_of(&leaves[i]));
    float least = INFINITY;
    int best_axis = -1, best_bucket = 0;
    for (int axis = 0; axis < 3; ++axis) {
        if (!(component(range.high, axis) > component(range.low, axis))) continue;
        cluster bucket[buckets], above[buckets];
        for (int k = 0; k < buckets; ++k) bucket[k] = empty_cluster;
        for (uint32_t i = 0; i < count; ++i) add_leaf(&bucket[bucket_of(centre_of(&leaves[i]), &range, axis)], &leaves[i]);
        above[buckets - 1] = bucket[buckets - 1];
        for (int k = buckets - 2; k > 0; --k) {
            above[k] = bucket[k];
            add_cluster(&above[k], &above[k + 1]);
        }
        cluster below = empty_cluster;
        for (int k = 1; k < buckets; ++k) {
            add_cluster(&below, &bucket[k - 1]);
            const float cost = cost_of(&below) + cost_of(&above[k]);
            if (!(below.power > 0) || !(above[k].power > 0) || !(cost < least)) continue;
            least = cost;
            best_axis = axis;
            best_bucket = k;
        }
    }
    if (best_axis < 0) return count / 2; // all in one place
    uint32_t first = 0;
    for (uint32_t i = 0; i < count; ++i) {
        if (bucket_of(centre_of(&leaves[i]), &range, best_axis) >= best_bucket) continue;
        const lx_light_leaf leaf = leaves[i];
        leaves[i] = leaves[first];
        leaves[first++] = leaf;
    }
    return first > 0 && first < count ? first : count / 2;
}

// A little wider than they are: what rounding hides must not be taken for impossible.
static void bound_child(lx_light_node *node, uint32_t child, const lx_light_leaf *leaves, uint32_t count)
{
    cluster all = empty_cluster;
    for (uint32_t i = 0; i < count; ++i) add_leaf(&all, &leaves[i]);
    const lx_vec3 centre = lx_scale(lx_add(all.bounds.low, all.bounds.high), 0.5f);
    const lx_vec3 axis = lx_normalize_or(all.normals, leaves[0].normal);
    float radius2 = 0, cosine = 1;
    bool both_sides = false;
    for (uint32_t i = 0; i < count; ++i) {
        for (int k = 0; k < 3; ++k) {
            const lx_vec3 d = lx_sub(leaves[i].corner[k], centre);
            radius2 = lx_max(radius2, lx_dot(d, d));
        }
        const float along = lx_dot(leaves[i].normal, axis);
        cosine = lx_min(cosine, leaves[i].both_sides ? fabsf(along) : along);
        both_sides |= leaves[i].both_sides;
    }
    cosine = lx_clamp(cosine - 1e-4f, -1, 1);
    node->x[child] = centre.x;
    node->y[child] = centre.y;
    node->z[child] = centre.z;
    node->radius2[child] = radius2 * 1.001f;
    node->radius[child] = sqrtf(radius2 * 1.001f);
    node->axis_x[child] = axis.x;
    node->axis_y[child] = axis.y;
    node->axis_z[child] = axis.z;
    node->cos_cone[child] = cosine;
    node->sin_cone[child] = sqrtf(1 - cosine * cosine);
    node->both_sides[child] = both_sides ? 1 : 0;
    node->power[child] = all.power;
}

// Bins begin at cache lines, which lx_array_reserve knows nothing of.
static bool reserve_bin(lx_light_tree *tree)
{
    if (tree->bin_count < tree->bin_capacity) return true;
    const size_t capacity = tree->bin_capacity + tree->bin_capacity / 2 + 16;
    lx_light_bin *bins = lx_malloc_array(capacity, sizeof *bins);
    if (!bins) return false;
    if (tree->bin_count > 0) memcpy(bins, tree->bins, tree->bin_count * sizeof *bins);
    lx_free(tree->bins);
    tree->bins = bins;
    tree->bin_capacity = capacity;
    return true;
}

static lx_result add_bin(lx_light_tree *tree, const lx_light_leaf *leaves, uint32_t count, uint32_t place, lx_error *error)
{
    if (tree->bin_count >= UINT32_MAX || !reserve_bin(tree)) return lx_fail_memory(error, "light tree");
    lx_light_bin *bin = &tree->bins[tree->bin_count++];
    double power = 0, running = 0;
    for (uint32_t i = 0; i < count; ++i) power += (double)leaves[i].power;
    for (uint32_t i = 0; i < lx_light_leaf_size; ++i) {
        bin->until[i] = 2;
        bin->triangle[i] = leaves[i < count ? i : count - 1].triangle;
        if (i + 1 >= count) continue;
        running += (double)leaves[i].power;
        bin->until[i] = (float)(running / power);
    }
    for (uint32_t i = 0; i < count; ++i) {
        tree->place[leaves[i].triangle] = place;
        tree->share_of[leaves[i].triangle] = share_in(bin, i);
    }
    return LX_OK;
}

static lx_result add_node(lx_light_tree *tree, lx_light_leaf *leaves, uint32_t count, uint32_t parent, uint32_t *out_node, lx_error *error)
{
    if (tree->node_count >= UINT32_MAX / width || !lx_array_reserve(&tree->nodes, &tree->node_capacity, tree->node_count + 1, sizeof *tree->nodes))
        return lx_fail_memory(error, "light tree");
    const uint32_t number = (uint32_t)tree->node_count++;
    *out_node = number;
    tree->nodes[number] = (lx_light_node){.parent = parent};
    // Into two parts and each into two, as far as they are larger than a leaf.
    uint32_t begin[width + 1] = {0, count}, parts = 1;
    while (parts < width) {
        uint32_t largest = 0;
        for (uint32_t k = 1; k < parts; ++k)
            if (begin[k + 1] - begin[k] > begin[largest + 1] - begin[largest]) largest = k;
        const uint32_t size = begin[largest + 1] - begin[largest];
        if (size <= lx_light_leaf_size) break;
        for (uint32_t k = parts; k > largest; --k) begin[k + 1] = begin[k];
        begin[largest + 1] = begin[largest] + split(leaves + begin[largest], size);
        ++parts;
    }
    for (uint32_t k = 0; k < parts; ++k) {
        const uint32_t size = begin[k + 1] - begin[k];
        bound_child(&tree->nodes[number], k, leaves + begin[k], size);
        lx_result result;
        if (size <= lx_light_leaf_size) {
            tree->nodes[number].first[k] = (uint32_t)tree->bin_count;
            tree->nodes[number].is_leaf[k] = true;
            result = add_bin(tree, leaves + begin[k], size, width * number + k, error);
        } else {
            uint32_t child;
            result = add_node(tree, leaves + begin[k], size, width * number + k, &child, error);
            if (result == LX_OK) tree->nodes[number].first[k] = child;
        }
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static bool is_inner(const lx_light_node *n, uint32_t child)
{
    return n->power[child] > 0 && !n->is_leaf[child];
}

static void copy_cluster(const lx_light_node *n, uint32_t child, lx_light_block *to, uint32_t k)
{
    to->x[k] = n->x[child];
    to->y[k] = n->y[child];
    to->z[k] = n->z[child];
    to->radius[k] = n->radius[child];
    to->radius2[k] = n->radius2[child];
    to->axis_x[k] = n->axis_x[child];
    to->axis_y[k] = n->axis_y[child];
    to->axis_z[k] = n->axis_z[child];
    to->cos_cone[k] = n->cos_cone[child];
    to->sin_cone[k] = n->sin_cone[child];
    to->both_sides[k] = n->both_sides[child];
    to->power[k] = n->power[child];
    to->first[k] = n->first[child];
    to->is_leaf[k] = n->is_leaf[child];
}

// Clusters from the root downwards, breadth first: one after the other gives way to its children, while at most `most` blocks of them are needed.
static lx_result add_cut(lx_light_tree *tree, uint32_t root, uint32_t most, lx_light_cut *out, lx_error *error)
{
    enum { room = lx_light_fine_blocks * lx_light_block_size + width };
    uint32_t list[room], count = 0, at = 0; // clusters, as width * node + child
    for (uint32_t k = 0; k < width; ++k)
        if (tree->nodes[root].power[k] > 0) list[count++] = width * root + k;
    for (uint32_t left = count; left > 0;) { // clusters that were not looked at
        const lx_light_node *n = &tree->nodes[list[at] / width];
        const uint32_t child = list[at] % width;
        --left;
        if (!is_inner(n, child)) {
            ++at;
            continue;
        }
        if (count - 1 + width > most * lx_light_block_size) break;
        const uint32_t node = n->first[child];
        for (uint32_t k = at + 1; k < count; ++k) list[k - 1] = list[k];
        --count;
        for (uint32_t k = 0; k < width; ++k)
            if (tree->nodes[node].power[k] > 0) {
                list[count++] = width * node + k;
                ++left;
            }
    }
    const uint32_t blocks = (count + lx_light_block_size - 1) / lx_light_block_size;
    if (tree->block_count + blocks > UINT32_MAX || !lx_array_reserve(&tree->blocks, &tree->block_capacity, tree->block_count + blocks, sizeof *tree->blocks))
        return lx_fail_memory(error, "light tree");
    *out = (lx_light_cut){(uint32_t)tree->block_count, blocks};
    for (uint32_t b = 0; b < blocks; ++b) tree->blocks[tree->block_count++] = (lx_light_block){.power = {0}};
    for (uint32_t i = 0; i < count; ++i)
        copy_cluster(&tree->nodes[list[i] / width], list[i] % width, &tree->blocks[out->first + i / lx_light_block_size], i % lx_light_block_size);
    return LX_OK;
}

lx_result lx_light_tree_add(lx_light_tree *tree, lx_light_leaf *leaves, uint32_t count, lx_light_roots *out_roots, lx_error *error)
{
    lx_result result = add_node(tree, leaves, count, LX_NO_LIGHT_NODE, &out_roots->root, error);
    if (result == LX_OK) result = add_cut(tree, out_roots->root, lx_light_coarse_blocks, &out_roots->coarse, error);
    if (result == LX_OK) result = add_cut(tree, out_roots->root, lx_light_fine_blocks, &out_roots->fine, error);
    return result;
}

void lx_light_tree_release(lx_light_tree *tree)
{
    lx_free(tree->nodes);
    lx_free(tree->bins);
    lx_free(tree->blocks);
    lx_free(tree->place);
    lx_free(tree->share_of);
    *tree = (lx_light_tree){0};
}

// Radii of a view within which its receivers see a cluster differently, and how much of all importance may lie there.
static const float close_radii = 3, most_close = 0.25f;

// ---- choices -------------------------------------------------------------------------------------------------------------------

typedef struct bounds {
    lx_vec3 centre, axis;
    float radius, radius2, cos_cone, sin_cone, both_sides, power;
} bounds;

LX_INLINED bounds bounds_in_node(const lx_light_node *n, int k)
{
    return (bounds){{n->x[k], n->y[k], n->z[k]}, {n->axis_x[k], n->axis_y[k], n->axis_z[k]}, n->radius[k], n->radius2[k],
                    n->cos_cone[k], n->sin_cone[k], n->both_sides[k], n->power[k]};
}

LX_INLINED bounds bounds_in_block(const lx_light_block *n, int k)
{
    return (bounds){{n->x[k], n->y[k], n->z[k]}, {n->axis_x[k], n->axis_y[k], n->axis_z[k]}, n->radius[k], n->radius2[k],
                    n->cos_cone[k], n->sin_cone[k], n->both_sides[k], n->power[k]};
}

// Largest cosine at the emitters towards the viewer, times the squared distance d2 ([PBR4] 12.6.3): angle from the cone's axis to the viewer, less the cone's, less that of the
// sphere of `radius`. 0: all of the cluster turns away. Sines and cosines are kept times the distance d, so that the three roots wait for nothing but d².
LX_INLINED float turned_cosine(bounds b, lx_vec3 to_viewer, float d2, float d, float radius, float radius2)
{
    const float signed_along = lx_dot(to_viewer, b.axis), along = signed_along + b.both_sides * (fabsf(signed_along) - signed_along);
    const float across = sqrtf(lx_max(0, d2 - along * along)), reach = sqrtf(lx_max(0, d2 - radius2));
    const float c1 = along * b.cos_cone + across * b.sin_cone, s1 = across * b.cos_cone - along * b.sin_cone;
    const bool in_cone = along >= b.cos_cone * d;
    const float c = in_cone ? d : c1, s = in_cone ? 0 : s1;
    const float turned = c * reach + s * lx_min(radius, d);
    return lx_max(0, c >= reach ? d2 : turned);
}

// Power × that cosine / d², without the receiver's cosine, so that places alone decide. One division is all there is.
LX_INLINED float importance_of(bounds b, lx_vec3 viewer)
{
    const lx_vec3 to_viewer = lx_sub(viewer, b.centre);
    const float d2 = lx_max(lx_dot(to_viewer, to_viewer), 1e-18f), d = sqrtf(d2); // whose square is not 0
    return b.power * turned_cosine(b, to_viewer, d2, d, b.radius, b.radius2) / (d2 * lx_max(d2, b.radius2));
}

static void find_importances(const lx_light_node *restrict n, lx_vec3 viewer, float importance[restrict width])
{
    for (int k = 0; k < width; ++k) importance[k] = importance_of(bounds_in_node(n, k), viewer);
}

// The same for all receivers of a view, as if the sphere were larger by theirs, times the largest cosine at a receiver. `close`: the importances of what
// is so close that receivers see it differently are added.
LX_INLINED void find_view_importances(const lx_light_block *restrict n, const lx_light_view *restrict view, float importance[restrict lx_light_block_size],
                                      float close[restrict lx_light_block_size])
{
    const float close_by = close_radii * view->radius;
    for (int k = 0; k < lx_light_block_size; ++k) {
        const bounds b = bounds_in_block(n, k);
        const lx_vec3 to_viewer = lx_sub(view->centre, b.centre);
        const float radius = b.radius + view->radius, radius2 = radius * radius;
        const float d2 = lx_max(lx_dot(to_viewer, to_viewer), 1e-18f), d = sqrtf(d2);
        const float height = radius + view->spread * (d + radius) - lx_dot(to_viewer, view->normal);
        const float received = lx_min(d, lx_max(0, height));
        importance[k] = b.power * received * turned_cosine(b, to_viewer, d2, d, radius, radius2) / (d2 * d * lx_max(d2, radius2));
        close[k] += d < b.radius + close_by ? importance[k] : 0;
    }
}

LX_INLINED float add_up(const float *importance, int count, float *sums)
{
    sums[0] = importance[0];
    for (int k = 1; k < count; ++k) sums[k] = sums[k - 1] + importance[k];
    return sums[count - 1];
}

LX_INLINED float below_one(float x)
{
    return lx_max(0, lx_min(x, 0x1.fffffep-1f));
}

// The cluster that `at` falls into, among running sums; rounding must not reach the end. `place` becomes its share of that. Counted, not searched: which way it goes is
// nothing that a processor could guess.
LX_INLINED int choose_cluster(const float *importance, const float *sums, int count, float at, float *place)
{
    int k = 0;
    for (int i = 0; i < count; ++i) k += at >= sums[i];
    k = k < count ? k : count - 1;
    while (!(importance[k] > 0)) --k;
    *place = below_one((at - (sums[k] - importance[k])) / importance[k]);
    return k;
}

// A triangle of a leaf, by power.
static inline bool choose_in_bin(const lx_light_bin *bin, float *u, uint32_t *triangle, float *probability)
{
    uint32_t i = 0;
    for (uint32_t k = 0; k < lx_light_leaf_size; ++k) i += *u >= bin->until[k];
    const float share = share_in(bin, i);
    *u = below_one((*u - (i > 0 ? bin->until[i - 1] : 0)) / share);
    *triangle = bin->triangle[i];
    *probability *= share;
    return *probability > 0;
}

// On from node `number`, which was reached with `probability`.
static inline bool descend(const lx_light_tree *tree, uint32_t number, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    for (;;) {
        const lx_light_node *n = &tree->nodes[number];
        float importance[width], sums[width];
        find_importances(n, viewer, importance);
        const float total = add_up(importance, width, sums);
        if (!(total > 0)) return false;
        const int k = choose_cluster(importance, sums, width, lx_min(*u * total, total * 0x1.fffffep-1f), u);
        *probability *= importance[k] / total;
        if (n->is_leaf[k]) return choose_in_bin(&tree->bins[n->first[k]], u, triangle, probability);
        number = n->first[k];
    }
}

bool lx_light_tree_sample(const lx_light_tree *tree, uint32_t root, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    *probability = 1;
    return descend(tree, root, viewer, u, triangle, probability);
}

float lx_light_tree_probability(const lx_light_tree *tree, uint32_t triangle, lx_vec3 viewer)
{
    float probability = tree->share_of[triangle];
    if (!(probability > 0)) return 0;
    for (uint32_t at = tree->place[triangle]; at != LX_NO_LIGHT_NODE; at = tree->nodes[at / width].parent) {
        float importance[width], sums[width];
        find_importances(&tree->nodes[at / width], viewer, importance);
        const float total = add_up(importance, width, sums);
        if (!(importance[at % width] > 0)) return 0;
        probability *= importance[at % width] / total;
    }
    return probability;
}

float lx_light_tree_sum(const lx_light_tree *tree, const lx_light_roots *roots, lx_vec3 viewer)
{
    float sum = 0;
    for (uint32_t i = 0; i < roots->coarse.count; ++i) {
        const lx_light_block *block = &tree->blocks[roots->coarse.first + i];
        float importance[lx_light_block_size];
        for (int k = 0; k < lx_light_block_size; ++k) importance[k] = importance_of(bounds_in_block(block, k), viewer);
        for (int k = 0; k < lx_light_block_size; ++k) sum += importance[k];
    }
    return sum;
}

// ---- tables ----------------------------------------------------------------------------------------------------------------------

LX_INLINED void fill_table(lx_light_table *table, uint32_t count, const lx_light_view *view)
{
    float sum = 0, close_sum = 0, close[lx_light_block_size] = {0};
    for (uint32_t i = 0; i < count; ++i) {
        float *v = table->importance[i];
        find_view_importances(&table->blocks[i], view, v, close);
        sum += ((v[0] + v[1]) + (v[2] + v[3])) + ((v[4] + v[5]) + (v[6] + v[7]));
        table->sums[i] = sum;
    }
    for (uint32_t i = count; i < lx_light_fine_blocks; ++i) table->sums[i] = sum;
    for (int k = 0; k < lx_light_block_size; ++k) close_sum += close[k];
    table->rough = close_sum > most_close * sum;
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void fill_table_avx2(lx_light_table *table, uint32_t count, const lx_light_view *view)
{
    fill_table(table, count, view);
}
#endif

bool lx_light_table_fill(lx_light_table *table, const lx_light_tree *tree, const lx_light_roots *roots, const lx_light_view *view)
{
    table->blocks = tree->blocks + roots->fine.first;
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        fill_table_avx2(table, roots->fine.count, view);
        return table->sums[lx_light_fine_blocks - 1] > 0;
    }
#endif
    fill_table(table, roots->fine.count, view);
    return table->sums[lx_light_fine_blocks - 1] > 0;
}

lx_light_choice lx_light_table_choose(const lx_light_table *table, const lx_light_tree *tree, float u)
{
    const float total = table->sums[lx_light_fine_blocks - 1], at = lx_min(u * total, total * 0x1.fffffep-1f);
    uint32_t i = 0;
    for (uint32_t block = 0; block < lx_light_fine_blocks; ++block) i += at >= table->sums[block];
    i = i < lx_light_fine_blocks ? i : lx_light_fine_blocks - 1;
    const float *importance = table->importance[i], before = i > 0 ? table->sums[i - 1] : 0;
    float sums[lx_light_block_size];
    lx_light_choice choice = {.probability = 0};
    const float all = add_up(importance, lx_light_block_size, sums);
    if (!(all > 0)) return choice; // not with sums that rise there
    const int k = choose_cluster(importance, sums, lx_light_block_size, lx_min(at - before, all * 0x1.fffffep-1f), &choice.u);
    choice.probability = importance[k] / total;
    choice.first = table->blocks[i].first[k];
    choice.is_leaf = table->blocks[i].is_leaf[k];
    if (choice.is_leaf) LX_PREFETCH(&tree->bins[choice.first]);
    return choice;
}

bool lx_light_tree_finish(const lx_light_tree *tree, const lx_light_choice *choice, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    *u = choice->u;
    *probability = choice->probability;
    if (!(choice->probability > 0)) return false;
    if (choice->is_leaf) return choose_in_bin(&tree->bins[choice->first], u, triangle, probability);
    return descend(tree, choice->first, viewer, u, triangle, probability);
}
