// Instances and surfaces: meshes at their places in the world.
#include "scene/gltf_accessors.h"

#include "base/error.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

#define MAX_TRIANGLES (1ull << 31) // in all instances
#define MAX_COORDINATE 1e15f       // metres: areas and volumes further out do not fit into floats
#define MAX_MEASURED (8ull << 20)  // triangles that are measured one by one; boxes of later instances are looser

static lx_result add_surfaces(lx_gltf_reader *reader, lx_instance *instance, uint32_t instance_index,
                              int8_t transparent, lx_error *error)
{
    lx_scene *scene = reader->scene;
    const lx_mesh *mesh = &scene->meshes[instance->mesh];
    if (scene->surface_count > INT32_MAX - mesh->primitive_count)
        return lx_fail(error, LX_ERROR_LIMIT, "node %u: too many surfaces", instance->node);
    lx_result result = lx_gltf_charge(reader, mesh->primitive_count, sizeof *scene->surfaces, "surfaces", error);
    if (result != LX_OK) return result;
    if (!lx_array_reserve(&scene->surfaces, &reader->surface_capacity,
                          (size_t)scene->surface_count + mesh->primitive_count, sizeof *scene->surfaces))
        return lx_fail_memory(error, "surfaces");
    instance->first_surface = scene->surface_count;
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        const uint32_t primitive = mesh->first_primitive + i, material = scene->primitives[primitive].material;
        scene->surfaces[scene->surface_count++] = (lx_surface){
            .instance = instance_index,
            .primitive = primitive,
            .material = material,
            .transparent = transparent >= 0 ? transparent : scene->materials[material].transparent,
            .source = -1,
        };
    }
    return LX_OK;
}

static lx_result add_instance(lx_gltf_reader *reader, lx_instance instance, int8_t transparent, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    LX_TRY(lx_gltf_charge(reader, 1, sizeof instance, "instances", error));
    if (!lx_array_reserve(&scene->instances, &reader->instance_capacity, (size_t)scene->instance_count + 1,
                          sizeof *scene->instances))
        return lx_fail_memory(error, "instances");
    LX_TRY(add_surfaces(reader, &instance, scene->instance_count, transparent, error));
    scene->instances[scene->instance_count++] = instance;
cleanup:
    return result;
}

// The per-instance attributes of EXT_mesh_gpu_instancing; NULL: none.
typedef struct gpu_instances {
    float *translation, *rotation, *scale;
    uint32_t count;
} gpu_instances;

static lx_result read_instance_attribute(lx_gltf_reader *reader, const lx_gltf_object *attributes, const char *name,
                                         uint32_t components, gpu_instances *all, float **out, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_accessor accessor;
    LX_TRY(lx_gltf_get_index(attributes, name, reader->counts[LX_GLTF_ACCESSOR], &index, error));
    if (index < 0) return LX_OK;
    LX_TRY(lx_gltf_get_accessor(reader, (uint32_t)index, &accessor, error));
    if (accessor.matrix || accessor.components != components)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %s (%s) is not of type VEC%u", attributes->label, name,
                       accessor.object.label, components);
    if (all->count != UINT32_MAX && all->count != accessor.count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %s (%s) has %u elements, others %u", attributes->label, name,
                       accessor.object.label, accessor.count, all->count);
    all->count = accessor.count;
    LX_TRY(lx_gltf_read_floats(reader, &accessor, out, error));
cleanup:
    return result;
}

// Another attribute (colours, our own _LUXEL_RECT) tells the count when there is no transform.
static lx_result count_from_any(const lx_gltf_reader *reader, const lx_gltf_object *attributes, gpu_instances *all,
                                lx_error *error)
{
    const char *name;
    json_t *value;
    json_object_foreach(attributes->json, name, value)
    {
        lx_result result = LX_OK;
        uint32_t index;
        lx_gltf_accessor accessor;
        result = lx_gltf_index_of(attributes, value, name, reader->counts[LX_GLTF_ACCESSOR], &index, error);
        if (result == LX_OK) result = lx_gltf_get_accessor(reader, index, &accessor, error);
        if (result != LX_OK) return result;
        if (all->count == UINT32_MAX) all->count = accessor.count;
    }
    return LX_OK;
}

static lx_result read_gpu_instances(lx_gltf_reader *reader, const lx_gltf_object *extension, gpu_instances *out,
                                    lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object attributes;
    out->count = UINT32_MAX;
    LX_TRY(lx_gltf_get_object(extension, "attributes", &attributes, error));
    LX_TRY(read_instance_attribute(reader, &attributes, "TRANSLATION", 3, out, &out->translation, error));
    LX_TRY(read_instance_attribute(reader, &attributes, "ROTATION", 4, out, &out->rotation, error));
    LX_TRY(read_instance_attribute(reader, &attributes, "SCALE", 3, out, &out->scale, error));
    LX_TRY(count_from_any(reader, &attributes, out, error));
    if (out->count == UINT32_MAX) return lx_fail(error, LX_ERROR_FORMAT, "%s: no attributes", extension->label);
cleanup:
    return result;
}

static lx_mat4 gpu_instance_matrix(const lx_gltf_reader *reader, const char *label, const gpu_instances *all,
                                   uint32_t i)
{
    static const float zero[3] = {0, 0, 0}, one[3] = {1, 1, 1}, none[4] = {0, 0, 0, 1};
    const float *t = all->translation ? all->translation + 3 * (size_t)i : zero;
    const float *q = all->rotation ? all->rotation + 4 * (size_t)i : none;
    const float *s = all->scale ? all->scale + 3 * (size_t)i : one;
    return lx_mat4_trs(lx_v3(t[0], t[1], t[2]), lx_gltf_unit_rotation(reader->log, label, q), lx_v3(s[0], s[1], s[2]));
}

static lx_result add_gpu_instances(lx_gltf_reader *reader, const lx_gltf_object *extension, const lx_instance *model,
                                   int8_t transparent, lx_error *error)
{
    lx_result result = LX_OK;
    gpu_instances all = {0};
    LX_TRY(read_gpu_instances(reader, extension, &all, error));
    for (uint32_t i = 0; i < all.count; ++i) {
        lx_instance instance = *model;
        const lx_mat4 local = gpu_instance_matrix(reader, extension->label, &all, i);
        instance.gpu_instance = (int32_t)i;
        instance.transform = lx_gltf_multiply(&model->transform, &local);
        LX_TRY(add_instance(reader, instance, transparent, error));
    }
cleanup:
    lx_free(all.translation);
    lx_free(all.rotation);
    lx_free(all.scale);
    return result;
}

// Why an instance is not static by the file's own doing; NULL: it may be.
static const char *reason_to_move(const lx_gltf_node *node, bool skinned)
{
    if (skinned) return "skinned";
    if (node->moves) return "animated";
    return node->weights_animated ? "animated shape" : NULL;
}

static lx_result load_instance(lx_gltf_reader *reader, uint32_t index, const lx_gltf_object *object, uint32_t file_mesh,
                               lx_error *error)
{
    lx_result result = LX_OK;
    const lx_gltf_node *node = &reader->nodes[index];
    lx_gltf_object mesh;
    lx_instance instance = {.node = index, .gpu_instance = -1, .transform = node->world};
    int32_t skin;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_MESH, file_mesh, &mesh, error));
    LX_TRY(lx_gltf_get_index(object, "skin", reader->counts[LX_GLTF_SKIN], &skin, error));
    LX_TRY(lx_gltf_mesh_index(reader, file_mesh, object, &instance.mesh, error));
    LX_TRY(lx_gltf_name(reader, object, &mesh, "node", index, &instance.name, error));
    if (reader->scene->meshes[instance.mesh].primitive_count == 0) return LX_OK;
    instance.density = node->extras.density > 0 ? node->extras.density : 1;
    instance.is_static = node->extras.is_static != 0 && !reason_to_move(node, skin >= 0);
    const lx_gltf_object gpu = lx_gltf_extension(object, "EXT_mesh_gpu_instancing");
    if (gpu.json)
        LX_TRY(add_gpu_instances(reader, &gpu, &instance, node->extras.transparent, error));
    else
        LX_TRY(add_instance(reader, instance, node->extras.transparent, error));
cleanup:
    return result;
}

// One line of up to `max_named` names.
typedef struct name_list {
    char text[700];
    size_t length;
    uint32_t count;
} name_list;

enum { max_named = 8 };

static void list_name(name_list *list, const char *label, const char *reason)
{
    if (list->count++ >= max_named) return;
    const int written = snprintf(list->text + list->length, sizeof list->text - list->length, "%s%s (%s)",
                                 list->length ? ", " : "", label, reason);
    if (written > 0) list->length += (size_t)written;
    if (list->length >= sizeof list->text) list->length = sizeof list->text - 1;
}

// Meshes and lamps that move are left to real-time light; a person should know, once.
static lx_result note_movers(const lx_gltf_reader *reader, lx_error *error)
{
    name_list list = {.text = ""};
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i) {
        const lx_gltf_node *node = &reader->nodes[i];
        lx_gltf_object object;
        const lx_result result = lx_gltf_element(reader, LX_GLTF_NODE, i, &object, error);
        if (result != LX_OK) return result;
        const bool mesh = json_object_get(object.json, "mesh") != NULL;
        const bool lamp = lx_gltf_extension(&object, "KHR_lights_punctual").json != NULL && !node->holds_no_lamps;
        const char *reason = reason_to_move(node, mesh && json_object_get(object.json, "skin") != NULL);
        if (node->in_scene && reason && (mesh || lamp)) list_name(&list, object.label, reason);
    }
    if (list.count > max_named)
        lx_log_note(reader->log, "not static, so not baked: %s and %u more", list.text, list.count - max_named);
    else if (list.count > 0)
        lx_log_note(reader->log, "not static, so not baked: %s", list.text);
    return LX_OK;
}

static bool is_in_reach(lx_vec3 p)
{
    return fabsf(p.x) <= MAX_COORDINATE && fabsf(p.y) <= MAX_COORDINATE && fabsf(p.z) <= MAX_COORDINATE; // NaN is not
}

// Bounds of a mesh by the vertices that its triangles use, transformed. False: one of them is NaN or out of reach
// there.
static bool mesh_bounds(const lx_scene *scene, const lx_mesh *mesh, lx_mat4 transform, lx_bounds *bounds)
{
    *bounds = lx_bounds_empty();
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        const lx_primitive *p = &scene->primitives[mesh->first_primitive + i];
        for (size_t k = 0; k < 3 * (size_t)p->triangle_count; ++k) {
            const lx_vec3 point = lx_mat4_point(transform, p->positions[p->indices[k]]);
            if (!is_in_reach(point)) return false;
            lx_bounds_add(bounds, point);
        }
    }
    return true;
}

// The same from the corners of the mesh's own box: looser, but at a cost that does not grow with the mesh. All partial
// sums for points in the box lie between those for its corners, so what is in reach at the corners is in reach inside.
static bool corner_bounds(const lx_bounds *local, lx_mat4 transform, lx_bounds *bounds)
{
    *bounds = lx_bounds_empty();
    for (int i = 0; i < 8; ++i) {
        const lx_vec3 corner = {i & 1 ? local->high.x : local->low.x, i & 2 ? local->high.y : local->low.y,
                                i & 4 ? local->high.z : local->low.z};
        const lx_vec3 point = lx_mat4_point(transform, corner);
        if (!is_in_reach(point)) return false;
        lx_bounds_add(bounds, point);
    }
    return true;
}

static uint64_t mesh_triangles(const lx_scene *scene, const lx_mesh *mesh)
{
    uint64_t count = 0;
    for (uint32_t p = 0; p < mesh->primitive_count; ++p)
        count += scene->primitives[mesh->first_primitive + p].triangle_count;
    return count;
}

// Totals over the instances, with the box and the size of each mesh at hand.
static lx_result sum_up(lx_scene *scene, const lx_bounds *boxes, const uint64_t *sizes, lx_error *error)
{
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        const lx_instance *instance = &scene->instances[i];
        const uint64_t count = sizes[instance->mesh];
        triangles += count;
        if (triangles > MAX_TRIANGLES)
            return lx_fail(error, LX_ERROR_LIMIT, "node %u '%.60s': more than 2^31 triangles in all instances",
                           instance->node, instance->name);
        lx_bounds bounds;
        const bool in_reach = triangles <= MAX_MEASURED
                                  ? mesh_bounds(scene, &scene->meshes[instance->mesh], instance->transform, &bounds)
                                  : corner_bounds(&boxes[instance->mesh], instance->transform, &bounds);
        if (!in_reach)
            return lx_fail(error, LX_ERROR_FORMAT,
                           "node %u '%.60s': its vertices are not finite in the world, or 1e15 m away", instance->node,
                           instance->name);
        if (!instance->is_static) continue;
        scene->triangle_count += count;
        lx_bounds_add(&scene->bounds, bounds.low);
        lx_bounds_add(&scene->bounds, bounds.high);
    }
    return LX_OK;
}

static lx_result measure(lx_scene *scene, lx_error *error)
{
    lx_bounds *boxes = lx_malloc_array(scene->mesh_count, sizeof *boxes);
    uint64_t *sizes = lx_malloc_array(scene->mesh_count, sizeof *sizes);
    lx_result result = boxes && sizes ? LX_OK : lx_fail_memory(error, "bounds");
    for (uint32_t i = 0; result == LX_OK && i < scene->mesh_count; ++i) {
        if (!mesh_bounds(scene, &scene->meshes[i], lx_mat4_identity(), &boxes[i]))
            boxes[i] = (lx_bounds){{-INFINITY, -INFINITY, -INFINITY}, {INFINITY, INFINITY, INFINITY}};
        sizes[i] = mesh_triangles(scene, &scene->meshes[i]);
    }
    if (result == LX_OK) result = sum_up(scene, boxes, sizes, error);
    lx_free(boxes);
    lx_free(sizes);
    return result;
}

lx_result lx_gltf_load_instances(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i) {
        lx_gltf_object object;
        int32_t mesh;
        if (!reader->nodes[i].in_scene) continue;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_NODE, i, &object, error));
        LX_TRY(lx_gltf_get_index(&object, "mesh", reader->counts[LX_GLTF_MESH], &mesh, error));
        if (mesh >= 0) LX_TRY(load_instance(reader, i, &object, (uint32_t)mesh, error));
    }
    if (reader->scene->instance_count == 0)
        return lx_fail(error, LX_ERROR_FORMAT, "scene: no mesh with triangles in it, so there is nothing to bake");
    LX_TRY(note_movers(reader, error));
    LX_TRY(measure(reader->scene, error));
cleanup:
    return result;
}
