#include "trace/light_tree.h"

#include "base/error.h"
#include "base/memory.h"

enum { width = lx_light_tree_width, buckets = 12 };

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

static lx_result add_order(lx_light_tree *tree, const lx_light_leaf *leaves, uint32_t count, uint32_t place, lx_error *error)
{
    const size_t end = tree->order_count + count;
    if (end > UINT32_MAX || !lx_array_reserve(&tree->order, &tree->order_capacity[0], end, sizeof *tree->order) ||
        !lx_array_reserve(&tree->share, &tree->order_capacity[1], end, sizeof *tree->share))
        return lx_fail_memory(error, "light tree");
    double power = 0;
    for (uint32_t i = 0; i < count; ++i) power += (double)leaves[i].power;
    for (uint32_t i = 0; i < count; ++i) {
        const float share = (float)((double)leaves[i].power / power);
        tree->order[tree->order_count] = leaves[i].triangle;
        tree->share[tree->order_count++] = share;
        tree->place[leaves[i].triangle] = place;
        tree->share_of[leaves[i].triangle] = share;
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
            tree->nodes[number].first[k] = (uint32_t)tree->order_count;
            tree->nodes[number].count[k] = size;
            result = add_order(tree, leaves + begin[k], size, width * number + k, error);
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
    return n->power[child] > 0 && n->count[child] == 0;
}

// Nodes from the root downwards, breadth first, each as its leaves and its children's nodes, as far as `most` parts go (and
// for a moment one more).
static lx_result add_cut(lx_light_tree *tree, uint32_t root, uint32_t most, lx_light_cut *out, lx_error *error)
{
    if (tree->part_count + most + 1 > UINT32_MAX || !lx_array_reserve(&tree->parts, &tree->part_capacity, tree->part_count + most + 1, sizeof *tree->parts))
        return lx_fail_memory(error, "light tree");
    lx_light_branch *parts = tree->parts + tree->part_count;
    uint32_t count = 1, at = 0;
    parts[0] = (lx_light_branch){root, {1, 1, 1, 1}};
    while (at < count) {
        const lx_light_node *n = &tree->nodes[parts[at].node];
        uint32_t inner = 0, leaves = 0;
        for (uint32_t k = 0; k < width; ++k) {
            inner += is_inner(n, k);
            leaves += n->count[k] > 0;
        }
        if (inner == 0) {
            ++at;
            continue;
        }
        if (count + inner - (leaves == 0) > most) break;
        for (uint32_t k = 0; k < width; ++k) {
            if (!is_inner(n, k)) continue;
            parts[count++] = (lx_light_branch){n->first[k], {1, 1, 1, 1}};
            parts[at].keep[k] = 0;
        }
        if (leaves > 0) {
            ++at;
            continue;
        }
        --count; // nothing is left of it: the others move up, in their order
        for (uint32_t k = at; k < count; ++k) parts[k] = parts[k + 1];
    }
    *out = (lx_light_cut){(uint32_t)tree->part_count, count};
    tree->part_count += count;
    return LX_OK;
}

lx_result lx_light_tree_add(lx_light_tree *tree, lx_light_leaf *leaves, uint32_t count, lx_light_roots *out_roots, lx_error *error)
{
    lx_result result = add_node(tree, leaves, count, LX_NO_LIGHT_NODE, &out_roots->root, error);
    if (result == LX_OK) result = add_cut(tree, out_roots->root, lx_light_coarse_parts, &out_roots->coarse, error);
    if (result == LX_OK) result = add_cut(tree, out_roots->root, lx_light_fine_parts, &out_roots->fine, error);
    return result;
}

void lx_light_tree_release(lx_light_tree *tree)
{
    lx_free(tree->nodes);
    lx_free(tree->parts);
    lx_free(tree->order);
    lx_free(tree->share);
    lx_free(tree->place);
    lx_free(tree->share_of);
    *tree = (lx_light_tree){0};
}

// Radii of a view within which its receivers see a cluster differently, and how much of all importance may lie there.
static const float close_radii = 3, most_close = 0.25f;

// ---- choices -------------------------------------------------------------------------------------------------------------------

// Power × largest cosine at the emitters / d² ([PBR4] 12.6.3 without the receiver's cosine, so that places alone decide): angle from the cone's axis to
// the viewer, less the cone's, less that of the sphere. 0: all of the child turns away. Sines and cosines are kept times the distance d, so that the three
// roots wait for nothing but d², and one division is all there is.
static void find_importances(const lx_light_node *restrict n, lx_vec3 viewer, float importance[restrict width])
{
    for (int k = 0; k < width; ++k) {
        const float x = viewer.x - n->x[k], y = viewer.y - n->y[k], z = viewer.z - n->z[k];
        const float d2 = lx_max(x * x + y * y + z * z, 1e-18f); // whose square is not 0
        const float signed_along = x * n->axis_x[k] + y * n->axis_y[k] + z * n->axis_z[k];
        const float along = signed_along + n->both_sides[k] * (fabsf(signed_along) - signed_along);
        const float d = sqrtf(d2), across = sqrtf(lx_max(0, d2 - along * along)), reach = sqrtf(lx_max(0, d2 - n->radius2[k]));
        const float c1 = along * n->cos_cone[k] + across * n->sin_cone[k], s1 = across * n->cos_cone[k] - along * n->sin_cone[k];
        const bool in_cone = along >= n->cos_cone[k] * d;
        const float c = in_cone ? d : c1, s = in_cone ? 0 : s1;
        const float turned = c * reach + s * lx_min(n->radius[k], d), cosine = c >= reach ? d2 : turned;
        importance[k] = n->power[k] * lx_max(0, cosine) / (d2 * lx_max(d2, n->radius2[k]));
    }
}

// The same for all receivers of a view, as if the sphere were larger by theirs, times the largest cosine at a receiver. `close`: the importances of what
// is so close that receivers see it differently.
static void find_view_importances(const lx_light_node *restrict n, const lx_light_view *restrict view, const float keep[restrict width],
                                  float importance[restrict width], float close[restrict width])
{
    const lx_vec3 viewer = view->centre, normal = view->normal;
    const float close_by = close_radii * view->radius;
    for (int k = 0; k < width; ++k) {
        const float x = viewer.x - n->x[k], y = viewer.y - n->y[k], z = viewer.z - n->z[k], radius = n->radius[k] + view->radius, radius2 = radius * radius;
        const float d2 = lx_max(x * x + y * y + z * z, 1e-18f);
        const float signed_along = x * n->axis_x[k] + y * n->axis_y[k] + z * n->axis_z[k];
        const float along = signed_along + n->both_sides[k] * (fabsf(signed_along) - signed_along);
        const float d = sqrtf(d2), across = sqrtf(lx_max(0, d2 - along * along)), reach = sqrtf(lx_max(0, d2 - radius2));
        const float c1 = along * n->cos_cone[k] + across * n->sin_cone[k], s1 = across * n->cos_cone[k] - along * n->sin_cone[k];
        const bool in_cone = along >= n->cos_cone[k] * d;
        const float c = in_cone ? d : c1, s = in_cone ? 0 : s1;
        const float turned = c * reach + s * lx_min(radius, d), cosine = c >= reach ? d2 : turned;
        const float height = radius + view->spread * (d + radius) - (x * normal.x + y * normal.y + z * normal.z);
        const float received = lx_min(d, lx_max(0, height));
        importance[k] = keep[k] * n->power[k] * received * lx_max(0, cosine) / (d2 * d * lx_max(d2, radius2));
        close[k] = d < n->radius[k] + close_by ? importance[k] : 0;
    }
}

static inline float add_up(const float importance[width], float sums[width])
{
    sums[0] = importance[0];
    for (int k = 1; k < width; ++k) sums[k] = sums[k - 1] + importance[k];
    return sums[width - 1];
}

// The child that `place`, a share of all importance, falls into; place becomes its share of that. Counted, not searched: which way it goes is nothing
// that a processor could guess.
static inline int choose_child(const float importance[width], const float sums[width], float *place)
{
    const float at = lx_min(*place * sums[width - 1], sums[width - 1] * 0x1.fffffep-1f); // rounding must not reach the end
    int k = 0;
    for (int i = 0; i < width - 1; ++i) k += at >= sums[i];
    while (!(importance[k] > 0)) --k;
    *place = lx_clamp((at - (sums[k] - importance[k])) / importance[k], 0, 0x1.fffffep-1f);
    return k;
}

// A triangle of a leaf, by power.
static inline bool choose_in_leaf(const lx_light_tree *tree, const lx_light_node *n, int k, float *u, uint32_t *triangle, float *probability)
{
    const float *share = tree->share + n->first[k];
    uint32_t i = 0;
    while (i + 1 < n->count[k] && *u >= share[i]) *u -= share[i++];
    *u = lx_clamp(*u / share[i], 0, 0x1.fffffep-1f);
    *triangle = tree->order[n->first[k] + i];
    *probability *= share[i];
    return *probability > 0;
}

// On from node `number`, which was reached with `probability`.
static inline bool descend(const lx_light_tree *tree, uint32_t number, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    for (;;) {
        const lx_light_node *n = &tree->nodes[number];
        float importance[width], sums[width];
        find_importances(n, viewer, importance);
        const float total = add_up(importance, sums);
        if (!(total > 0)) return false;
        const int k = choose_child(importance, sums, u);
        *probability *= importance[k] / total;
        if (n->count[k] > 0) return choose_in_leaf(tree, n, k, u, triangle, probability);
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
        const float total = add_up(importance, sums);
        if (!(importance[at % width] > 0)) return 0;
        probability *= importance[at % width] / total;
    }
    return probability;
}

float lx_light_tree_sum(const lx_light_tree *tree, const lx_light_roots *roots, lx_vec3 viewer)
{
    float sum = 0;
    for (uint32_t i = 0; i < roots->coarse.count; ++i) {
        const lx_light_branch *part = &tree->parts[roots->coarse.first + i];
        float importance[width];
        find_importances(&tree->nodes[part->node], viewer, importance);
        for (int k = 0; k < width; ++k) sum += part->keep[k] * importance[k];
    }
    return sum;
}

// ---- tables ----------------------------------------------------------------------------------------------------------------------

bool lx_light_table_fill(lx_light_table *table, const lx_light_tree *tree, const lx_light_roots *roots, const lx_light_view *view)
{
    table->parts = tree->parts + roots->fine.first;
    table->count = roots->fine.count;
    float sum = 0, close_sum = 0;
    for (uint32_t i = 0; i < table->count; ++i) {
        float *importance = table->importance[i], close[width];
        find_view_importances(&tree->nodes[table->parts[i].node], view, table->parts[i].keep, importance, close);
        sum += (importance[0] + importance[1]) + (importance[2] + importance[3]);
        close_sum += (close[0] + close[1]) + (close[2] + close[3]);
        table->sums[i] = sum;
    }
    table->rough = close_sum > most_close * sum;
    return sum > 0;
}

bool lx_light_table_sample(const lx_light_table *table, const lx_light_tree *tree, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    const uint32_t last = table->count - 1;
    const float total = table->sums[last], at = lx_min(*u * total, total * 0x1.fffffep-1f);
    uint32_t i = 0;
    for (uint32_t part = 0; part < last; ++part) i += at >= table->sums[part];
    float sums[width];
    const float *importance = table->importance[i], before = i > 0 ? table->sums[i - 1] : 0;
    const float all = add_up(importance, sums);
    if (!(all > 0)) return false; // not with sums that rise there
    *u = lx_clamp((at - before) / all, 0, 0x1.fffffep-1f);
    const int k = choose_child(importance, sums, u);
    *probability = importance[k] / total;
    const lx_light_node *n = &tree->nodes[table->parts[i].node];
    if (n->count[k] > 0) return choose_in_leaf(tree, n, k, u, triangle, probability);
    return descend(tree, n->first[k], viewer, u, triangle, probability);
}
