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

lx_result lx_light_tree_add(lx_light_tree *tree, lx_light_leaf *leaves, uint32_t count, uint32_t *out_root, lx_error *error)
{
    return add_node(tree, leaves, count, LX_NO_LIGHT_NODE, out_root, error);
}

void lx_light_tree_release(lx_light_tree *tree)
{
    lx_free(tree->nodes);
    lx_free(tree->order);
    lx_free(tree->share);
    lx_free(tree->place);
    lx_free(tree->share_of);
    *tree = (lx_light_tree){0};
}

// ---- choices -------------------------------------------------------------------------------------------------------------------

// Power × largest cosine at the emitters / d² ([PBR4] 12.6.3 without the receiver's cosine, so that places alone decide): angle from the cone's axis to
// the viewer, less the cone's, less that of the sphere. 0: all of the child turns away. Returns the sum.
static float find_importances(const lx_light_node *n, lx_vec3 viewer, float importance[restrict width])
{
    for (int k = 0; k < width; ++k) {
        const float x = viewer.x - n->x[k], y = viewer.y - n->y[k], z = viewer.z - n->z[k];
        const float d2 = lx_max(x * x + y * y + z * z, 1e-30f);
        const float along = (x * n->axis_x[k] + y * n->axis_y[k] + z * n->axis_z[k]) / sqrtf(d2);
        const float c = lx_min(n->both_sides[k] != 0 ? fabsf(along) : along, 1), s = sqrtf(lx_max(0, 1 - c * c));
        const float c1 = c * n->cos_cone[k] + s * n->sin_cone[k], s1 = s * n->cos_cone[k] - c * n->sin_cone[k];
        const bool in_cone = c >= n->cos_cone[k];
        const float cos_outside = in_cone ? 1 : c1, sin_outside = in_cone ? 0 : s1;
        const float sine2 = lx_min(1, n->radius2[k] / d2), cos_sphere = sqrtf(1 - sine2), sin_sphere = sqrtf(sine2);
        const bool in_reach = cos_outside >= cos_sphere;
        const float cosine = in_reach ? 1 : cos_outside * cos_sphere + sin_outside * sin_sphere;
        importance[k] = n->power[k] * lx_max(0, cosine) / lx_max(d2, n->radius2[k]);
    }
    return (importance[0] + importance[1]) + (importance[2] + importance[3]);
}

bool lx_light_tree_sample(const lx_light_tree *tree, uint32_t root, lx_vec3 viewer, float *u, uint32_t *triangle, float *probability)
{
    *probability = 1;
    for (uint32_t number = root;;) {
        const lx_light_node *n = &tree->nodes[number];
        float importance[width];
        const float total = find_importances(n, viewer, importance);
        if (!(total > 0)) return false;
        float left = *u * total;
        int k = 0, last = 0;
        for (; k < width; ++k) {
            if (!(importance[k] > 0)) continue;
            last = k;
            if (left < importance[k]) break;
            left -= importance[k];
        }
        if (k == width) { // rounding: the end of the last one
            k = last;
            left = importance[k];
        }
        *probability *= importance[k] / total;
        *u = lx_clamp(left / importance[k], 0, 0x1.fffffep-1f);
        if (n->count[k] == 0) {
            number = n->first[k];
            continue;
        }
        const float *share = tree->share + n->first[k];
        uint32_t i = 0;
        left = *u;
        while (i + 1 < n->count[k] && left >= share[i]) left -= share[i++];
        *u = lx_clamp(left / share[i], 0, 0x1.fffffep-1f);
        *triangle = tree->order[n->first[k] + i];
        *probability *= share[i];
        return *probability > 0;
    }
}

float lx_light_tree_probability(const lx_light_tree *tree, uint32_t triangle, lx_vec3 viewer)
{
    float probability = tree->share_of[triangle];
    if (!(probability > 0)) return 0;
    for (uint32_t at = tree->place[triangle]; at != LX_NO_LIGHT_NODE; at = tree->nodes[at / width].parent) {
        float importance[width];
        const float total = find_importances(&tree->nodes[at / width], viewer, importance);
        if (!(importance[at % width] > 0)) return 0;
        probability *= importance[at % width] / total;
    }
    return probability;
}
