// The node hierarchy: who is whose child, what the default scene reaches, where things are in the world, what moves,
// and which authoring keys are handed down. Nothing here recurses, so depth costs no stack.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

enum { max_depth = 4096 };

// --- Structure ---

static lx_result adopt(lx_gltf_reader *reader, const lx_gltf_object *parent, uint32_t parent_index, uint32_t child,
                       lx_error *error)
{
    lx_gltf_node *node = &reader->nodes[child];
    lx_gltf_object object;
    if (node->parent < 0) {
        node->parent = (int32_t)parent_index;
        return LX_OK;
    }
    const lx_result result = lx_gltf_element(reader, LX_GLTF_NODE, child, &object, error);
    if (result != LX_OK) return result;
    return lx_fail(error, LX_ERROR_FORMAT, "%s: is a child of node %d and of %s", object.label, node->parent,
                   parent->label);
}

static lx_result link_nodes(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = reader->counts[LX_GLTF_NODE];
    for (uint32_t i = 0; i < count; ++i) {
        lx_gltf_object object;
        json_t *children;
        uint32_t child_count, child;
        int32_t index;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, i, &object, error));
        LX_TRY(lx_gltf_get_index(&object, "mesh", reader->counts[LX_GLTF_MESH], &index, error));
        LX_TRY(lx_gltf_get_index(&object, "skin", reader->counts[LX_GLTF_SKIN], &index, error));
        LX_TRY(lx_gltf_get_index(&object, "camera", reader->counts[LX_GLTF_CAMERA], &index, error));
        LX_TRY(lx_gltf_get_array(&object, "children", &children, &child_count, error));
        for (uint32_t c = 0; c < child_count; ++c) {
            LX_TRY(lx_gltf_index_of(&object, json_array_get(children, c), "child", count, &child, error));
            LX_TRY(adopt(reader, &object, i, child, error));
        }
    }
cleanup:
    return result;
}

// Every node has at most one parent now, so what no root leads to is a ring. Fills `order` with all nodes below the
// given roots, parents first; `order` holds the roots already.
static lx_result spread(lx_gltf_reader *reader, uint32_t *order, uint32_t *order_count, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t level_end = *order_count, depth = 0;
    for (uint32_t at = 0; at < *order_count; ++at) {
        if (at == level_end) {
            level_end = *order_count;
            if (++depth > max_depth)
                return lx_fail(error, LX_ERROR_LIMIT, "node %u: more than %d nodes deep", order[at], max_depth);
        }
        lx_gltf_object object;
        json_t *children;
        uint32_t child_count, child;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, order[at], &object, error));
        LX_TRY(lx_gltf_get_array(&object, "children", &children, &child_count, error));
        for (uint32_t c = 0; c < child_count; ++c) {
            LX_TRY(lx_gltf_index_of(&object, json_array_get(children, c), "child", reader->counts[LX_GLTF_NODE], &child,
                                    error));
            order[(*order_count)++] = child;
        }
    }
cleanup:
    return result;
}

static void take_all_roots(lx_gltf_reader *reader)
{
    reader->order_count = 0;
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i)
        if (reader->nodes[i].parent < 0) reader->order[reader->order_count++] = i;
}

static lx_result check_rings(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = reader->counts[LX_GLTF_NODE];
    bool *seen = lx_calloc_array(count, sizeof *seen);
    if (!seen) return lx_fail_memory(error, "nodes");
    take_all_roots(reader);
    LX_TRY(spread(reader, reader->order, &reader->order_count, error));
    for (uint32_t i = 0; i < reader->order_count; ++i) seen[reader->order[i]] = true;
    for (uint32_t i = 0; i < count; ++i) {
        lx_gltf_object object;
        if (seen[i]) continue;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, i, &object, error));
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: is below itself", object.label);
        goto cleanup;
    }
cleanup:
    lx_free(seen);
    return result;
}

static lx_result take_scene_roots(lx_gltf_reader *reader, const lx_gltf_object *scene, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *roots;
    uint32_t root_count, root;
    reader->order_count = 0;
    LX_TRY(lx_gltf_get_array(scene, "nodes", &roots, &root_count, error));
    for (uint32_t i = 0; i < root_count; ++i) {
        LX_TRY(lx_gltf_index_of(scene, json_array_get(roots, i), "node", reader->counts[LX_GLTF_NODE], &root, error));
        lx_gltf_node *node = &reader->nodes[root];
        if (node->parent >= 0)
            return lx_fail(error, LX_ERROR_FORMAT, "%s: node %u is not a root but a child of node %d", scene->label,
                           root, node->parent);
        if (node->in_scene) return lx_fail(error, LX_ERROR_FORMAT, "%s: node %u is named twice", scene->label, root);
        node->in_scene = true;
        reader->order[reader->order_count++] = root;
    }
cleanup:
    return result;
}

// The scene that "scene" names, else the first, else all roots.
static lx_result reach_default_scene(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_object scene;
    lx_gltf_extras extras;
    LX_TRY(lx_gltf_get_index(&reader->root, "scene", reader->counts[LX_GLTF_SCENE], &index, error));
    if (index < 0 && reader->counts[LX_GLTF_SCENE] > 0) index = 0;
    if (index >= 0) {
        LX_TRY(lx_gltf_element(reader, LX_GLTF_SCENE, (uint32_t)index, &scene, error));
        LX_TRY(lx_gltf_extras_read(reader, &scene, LX_EXTRAS_ELSEWHERE, &extras, error));
        LX_TRY(take_scene_roots(reader, &scene, error));
    } else {
        take_all_roots(reader);
    }
    LX_TRY(spread(reader, reader->order, &reader->order_count, error));
    for (uint32_t i = 0; i < reader->order_count; ++i) reader->nodes[reader->order[i]].in_scene = true;
    if (reader->counts[LX_GLTF_SCENE] > 1)
        lx_log_note(reader->log, "%s is read, the other %u scenes are not", scene.label,
                    reader->counts[LX_GLTF_SCENE] - 1);
cleanup:
    return result;
}

// --- Places ---

static lx_result matrix_from_array(const lx_gltf_object *object, const float *m, lx_mat4 *out, lx_error *error)
{
    static const float last_row[4] = {0, 0, 0, 1};
    memcpy(out->m, m, sizeof out->m);
    for (int column = 0; column < 4; ++column) {
        if (fabsf(m[column * 4 + 3] - last_row[column]) > 1e-5f)
            return lx_fail(error, LX_ERROR_FORMAT, "%s: the matrix's last row is not 0 0 0 1", object->label);
        out->m[column * 4 + 3] = last_row[column];
    }
    return LX_OK;
}

lx_vec4 lx_gltf_unit_rotation(lx_log *log, const char *label, const float q[4])
{
    const double length = sqrt((double)q[0] * q[0] + (double)q[1] * q[1] + (double)q[2] * q[2] + (double)q[3] * q[3]);
    if (!(length > 1e-6)) {
        lx_log_warning(log, "%s: a rotation of length zero is taken as none", label);
        return (lx_vec4){0, 0, 0, 1};
    }
    return (lx_vec4){(float)(q[0] / length), (float)(q[1] / length), (float)(q[2] / length), (float)(q[3] / length)};
}

static lx_result local_matrix(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_mat4 *out, lx_error *error)
{
    lx_result result = LX_OK;
    float m[16], t[3] = {0, 0, 0}, q[4] = {0, 0, 0, 1}, s[3] = {1, 1, 1};
    bool has_matrix;
    LX_TRY(lx_gltf_get_floats(object, "matrix", m, 16, &has_matrix, error));
    if (has_matrix) return matrix_from_array(object, m, out, error);
    LX_TRY(lx_gltf_get_floats(object, "translation", t, 3, NULL, error));
    LX_TRY(lx_gltf_get_floats(object, "rotation", q, 4, NULL, error));
    LX_TRY(lx_gltf_get_floats(object, "scale", s, 3, NULL, error));
    *out = lx_mat4_trs(lx_v3(t[0], t[1], t[2]), lx_gltf_unit_rotation(reader->log, object->label, q),
                       lx_v3(s[0], s[1], s[2]));
cleanup:
    return result;
}

// Sums in double and rounded once, so that long chains of nodes lose nothing.
lx_mat4 lx_gltf_multiply(const lx_mat4 *a, const lx_mat4 *b)
{
    lx_mat4 out;
    for (int column = 0; column < 4; ++column)
        for (int row = 0; row < 4; ++row) {
            double sum = 0;
            for (int k = 0; k < 4; ++k) sum += (double)a->m[k * 4 + row] * b->m[column * 4 + k];
            out.m[column * 4 + row] = (float)sum;
        }
    return out;
}

// --- What moves ---

static bool is_transform(const char *path)
{
    return strcmp(path, "translation") == 0 || strcmp(path, "rotation") == 0 || strcmp(path, "scale") == 0;
}

static void mark_animated(lx_gltf_node *node, const char *path)
{
    if (is_transform(path))
        node->transform_animated = true;
    else if (strcmp(path, "weights") == 0)
        node->weights_animated = true;
}

// KHR_animation_pointer: "/nodes/3/translation". Other pointers (colours, intensities) move nothing.
static void mark_pointer(lx_gltf_reader *reader, const char *pointer)
{
    uint32_t index;
    int used = 0;
    if (sscanf(pointer, "/nodes/%u/%n", &index, &used) == 1 && used > 0 && index < reader->counts[LX_GLTF_NODE])
        mark_animated(&reader->nodes[index], pointer + used);
}

static lx_result read_channel(lx_gltf_reader *reader, const lx_gltf_object *channel, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object target;
    int32_t node;
    const char *path = "", *pointer = "";
    LX_TRY(lx_gltf_get_object(channel, "target", &target, error));
    LX_TRY(lx_gltf_get_index(&target, "node", reader->counts[LX_GLTF_NODE], &node, error));
    LX_TRY(lx_gltf_get_string(&target, "path", &path, error));
    if (node >= 0) mark_animated(&reader->nodes[node], path);
    const lx_gltf_object extension = lx_gltf_extension(&target, "KHR_animation_pointer");
    LX_TRY(lx_gltf_get_string(&extension, "pointer", &pointer, error));
    mark_pointer(reader, pointer);
cleanup:
    return result;
}

static lx_result read_animations(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_ANIMATION]; ++i) {
        lx_gltf_object animation;
        json_t *channels;
        uint32_t count;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_ANIMATION, i, &animation, error));
        LX_TRY(lx_gltf_get_array(&animation, "channels", &channels, &count, error));
        for (uint32_t c = 0; c < count; ++c) {
            const lx_gltf_object channel = lx_gltf_object_inside(&animation, json_array_get(channels, c), "channel");
            LX_TRY(read_channel(reader, &channel, error));
        }
    }
cleanup:
    return result;
}

// --- Handing down ---

static bool is_light_group(const json_t *node)
{
    const char *name = json_string_value(json_object_get(node, "name"));
    return name && (strncmp(name, "VPLS", 4) == 0 || strncmp(name, "BLOCKERS", 8) == 0);
}

static lx_result complete_node(lx_gltf_reader *reader, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    lx_gltf_node *node = &reader->nodes[index];
    const lx_gltf_node *parent = node->parent >= 0 ? &reader->nodes[node->parent] : NULL;
    lx_mat4 local;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, index, &object, error));
    LX_TRY(local_matrix(reader, &object, &local, error));
    node->world = parent ? lx_gltf_multiply(&parent->world, &local) : local;
    for (int i = 0; i < 16; ++i)
        if (!isfinite(node->world.m[i]))
            return lx_fail(error, LX_ERROR_FORMAT, "%s: its place in the world is not finite", object.label);
    LX_TRY(lx_gltf_extras_read(reader, &object, LX_EXTRAS_NODE, &node->extras, error));
    node->area_owner = node->extras.area != LX_AREA_NONE ? (int32_t)index : parent ? parent->area_owner : -1;
    node->monitor_owner = node->extras.monitor_columns > 0 ? (int32_t)index : parent ? parent->monitor_owner : -1;
    node->moves = node->transform_animated || (parent && parent->moves);
    node->holds_no_lamps = is_light_group(object.json) || (parent && parent->holds_no_lamps);
    if (parent) node->extras = lx_gltf_extras_merge(node->extras, &parent->extras);
cleanup:
    return result;
}

lx_result lx_gltf_load_nodes(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = reader->counts[LX_GLTF_NODE];
    reader->nodes = lx_calloc_array(count, sizeof *reader->nodes);
    reader->order = lx_malloc_array(count, sizeof *reader->order);
    if (!reader->nodes || !reader->order) return lx_fail_memory(error, "nodes");
    for (uint32_t i = 0; i < count; ++i) reader->nodes[i].parent = reader->nodes[i].area_owner = reader->nodes[i].monitor_owner = -1;
    LX_TRY(link_nodes(reader, error));
    LX_TRY(check_rings(reader, error));
    LX_TRY(reach_default_scene(reader, error));
    LX_TRY(read_animations(reader, error));
    for (uint32_t i = 0; i < reader->order_count; ++i) LX_TRY(complete_node(reader, reader->order[i], error));
cleanup:
    return result;
}
