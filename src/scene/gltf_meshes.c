// Meshes: primitives as indexed triangles, morph targets at their default weights added.
#include "scene/geometry.h"
#include "scene/gltf_accessors.h"

#include "base/error.h"

#include <stdio.h>
#include <string.h>

_Static_assert(sizeof(lx_vec2) == 2 * sizeof(float) && sizeof(lx_vec3) == 3 * sizeof(float) &&
                   sizeof(lx_vec4) == 4 * sizeof(float),
               "float arrays are used as vectors");

static const char *const texcoord_names[lx_texcoord_sets] = {"TEXCOORD_0", "TEXCOORD_1", "TEXCOORD_2", "TEXCOORD_3"};

// Mesh data is per vertex of a mesh; what is said about a mesh as a whole is counted here.
typedef struct mesh_report {
    uint32_t skipped_modes, without_positions, degenerate, repaired_normals, cut_triangles;
} mesh_report;

// One primitive on its way in.
typedef struct primitive_job {
    lx_gltf_reader *reader;
    lx_gltf_object object, attributes;
    const float *weights;
    uint32_t weight_count;
    lx_primitive out;
} primitive_job;

static lx_result primitive_object(const lx_gltf_object *mesh, const json_t *array, uint32_t index, lx_gltf_object *out,
                                  lx_error *error)
{
    char what[32];
    snprintf(what, sizeof what, "primitive %u", index);
    json_t *json = json_array_get(array, index);
    *out = lx_gltf_object_inside(mesh, json, what);
    return json_is_object(json) ? LX_OK : lx_fail(error, LX_ERROR_FORMAT, "%s: not an object", out->label);
}

// The floats of an attribute with `components` numbers for each of `count` vertices; *out stays NULL if there is none.
static lx_result read_attribute(lx_gltf_reader *reader, const lx_gltf_object *attributes, const char *name,
                                uint32_t components, uint32_t count, float **out, lx_error *error)
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
    if (accessor.count != count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %s (%s) has %u elements for %u vertices", attributes->label, name,
                       accessor.object.label, accessor.count, count);
    LX_TRY(lx_gltf_read_floats(reader, &accessor, out, error));
cleanup:
    return result;
}

static lx_result accessor_components(const lx_gltf_reader *reader, const lx_gltf_object *attributes, const char *name,
                                     uint32_t *out, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_accessor accessor;
    LX_TRY(lx_gltf_get_index(attributes, name, reader->counts[LX_GLTF_ACCESSOR], &index, error));
    if (index < 0) return LX_OK;
    LX_TRY(lx_gltf_get_accessor(reader, (uint32_t)index, &accessor, error));
    *out = accessor.components;
cleanup:
    return result;
}

// RGB or RGBA; integers always mean 0…1 here, and colours below zero make no sense.
static lx_result read_colors(primitive_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    float *values = NULL;
    uint32_t components = 4;
    const uint32_t count = job->out.vertex_count;
    LX_TRY(accessor_components(job->reader, &job->attributes, "COLOR_0", &components, error));
    if (components != 3) components = 4;
    LX_TRY(read_attribute(job->reader, &job->attributes, "COLOR_0", components, count, &values, error));
    if (!values) return LX_OK;
    LX_TRY(lx_gltf_charge(job->reader, count, sizeof(lx_vec4), job->object.label, error));
    job->out.colors = lx_malloc_array(count, sizeof *job->out.colors);
    if (!job->out.colors) {
        result = lx_fail_memory(error, job->object.label);
        goto cleanup;
    }
    for (uint32_t i = 0; i < count; ++i) {
        const float *v = values + (size_t)i * components;
        job->out.colors[i] =
            (lx_vec4){fmaxf(v[0], 0), fmaxf(v[1], 0), fmaxf(v[2], 0), components == 4 ? lx_clamp(v[3], 0, 1) : 1};
    }
cleanup:
    lx_free(values);
    return result;
}

static lx_result read_attributes(primitive_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    lx_primitive *out = &job->out;
    float *values = NULL;
    LX_TRY(read_attribute(job->reader, &job->attributes, "POSITION", 3, out->vertex_count, &values, error));
    out->positions = (lx_vec3 *)values;
    values = NULL;
    LX_TRY(read_attribute(job->reader, &job->attributes, "NORMAL", 3, out->vertex_count, &values, error));
    out->normals = (lx_vec3 *)values;
    for (int set = 0; set < lx_texcoord_sets; ++set) {
        values = NULL;
        LX_TRY(
            read_attribute(job->reader, &job->attributes, texcoord_names[set], 2, out->vertex_count, &values, error));
        out->texcoords[set] = (lx_vec2 *)values;
    }
    LX_TRY(read_colors(job, error));
cleanup:
    return result;
}

// base += weight × target's attribute, if both are there.
static lx_result add_target(primitive_job *job, const lx_gltf_object *target, const char *name, uint32_t components,
                            float weight, float *base, lx_error *error)
{
    if (!base) return LX_OK;
    float *delta = NULL;
    const lx_result result =
        read_attribute(job->reader, target, name, components, job->out.vertex_count, &delta, error);
    for (size_t i = 0; delta && i < (size_t)job->out.vertex_count * components; ++i) base[i] += weight * delta[i];
    lx_free(delta);
    return result;
}

static lx_result add_color_target(primitive_job *job, const lx_gltf_object *target, float weight, lx_error *error)
{
    uint32_t components = 4;
    lx_result result = accessor_components(job->reader, target, "COLOR_0", &components, error);
    if (result != LX_OK || !job->out.colors) return result;
    if (components == 4) return add_target(job, target, "COLOR_0", 4, weight, (float *)job->out.colors, error);
    float *delta = NULL;
    result = read_attribute(job->reader, target, "COLOR_0", 3, job->out.vertex_count, &delta, error);
    for (size_t i = 0; delta && i < job->out.vertex_count; ++i) {
        job->out.colors[i].x += weight * delta[3 * i];
        job->out.colors[i].y += weight * delta[3 * i + 1];
        job->out.colors[i].z += weight * delta[3 * i + 2];
    }
    lx_free(delta);
    return result;
}

static lx_result apply_target(primitive_job *job, const lx_gltf_object *target, float weight, lx_error *error)
{
    lx_result result = LX_OK;
    lx_primitive *out = &job->out;
    LX_TRY(add_target(job, target, "POSITION", 3, weight, (float *)out->positions, error));
    LX_TRY(add_target(job, target, "NORMAL", 3, weight, (float *)out->normals, error));
    for (int set = 0; set < lx_texcoord_sets; ++set)
        LX_TRY(add_target(job, target, texcoord_names[set], 2, weight, (float *)out->texcoords[set], error));
    LX_TRY(add_color_target(job, target, weight, error));
cleanup:
    return result;
}

static bool are_finite(const float *values, size_t count)
{
    for (size_t i = 0; values && i < count; ++i)
        if (!isfinite(values[i])) return false;
    return true;
}

static lx_result check_morphed(const primitive_job *job, lx_error *error)
{
    const lx_primitive *out = &job->out;
    const size_t count = out->vertex_count;
    bool finite = are_finite((const float *)out->positions, 3 * count) &&
                  are_finite((const float *)out->normals, 3 * count) &&
                  are_finite((const float *)out->colors, 4 * count);
    for (int set = 0; set < lx_texcoord_sets; ++set)
        finite = finite && are_finite((const float *)out->texcoords[set], 2 * count);
    if (finite) return LX_OK;
    return lx_fail(error, LX_ERROR_FORMAT, "%s: morph targets make its vertices infinite", job->object.label);
}

static lx_result apply_targets(primitive_job *job, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *targets;
    uint32_t count;
    bool moved = false;
    LX_TRY(lx_gltf_get_array(&job->object, "targets", &targets, &count, error));
    if (job->weight_count > 0 && count != job->weight_count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %u weights for %u morph targets", job->object.label,
                       job->weight_count, count);
    for (uint32_t i = 0; i < job->weight_count; ++i) {
        char what[32];
        snprintf(what, sizeof what, "target %u", i);
        const lx_gltf_object target = lx_gltf_object_inside(&job->object, json_array_get(targets, i), what);
        if (!json_is_object(target.json)) return lx_fail(error, LX_ERROR_FORMAT, "%s: not an object", target.label);
        if (job->weights[i] == 0) continue;
        LX_TRY(apply_target(job, &target, job->weights[i], error));
        moved = true;
    }
    if (moved) LX_TRY(check_morphed(job, error));
cleanup:
    return result;
}

static lx_result read_index_list(primitive_job *job, uint32_t **out, uint32_t *count, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_accessor accessor;
    LX_TRY(lx_gltf_get_index(&job->object, "indices", job->reader->counts[LX_GLTF_ACCESSOR], &index, error));
    if (index >= 0) {
        LX_TRY(lx_gltf_get_accessor(job->reader, (uint32_t)index, &accessor, error));
        *count = accessor.count;
        return lx_gltf_read_indices(job->reader, &accessor, job->out.vertex_count, out, error);
    }
    *count = job->out.vertex_count;
    LX_TRY(lx_gltf_charge(job->reader, *count, sizeof **out, job->object.label, error));
    *out = lx_malloc_array(*count, sizeof **out);
    if (!*out) return lx_fail_memory(error, job->object.label);
    for (uint32_t i = 0; i < *count; ++i) (*out)[i] = i;
cleanup:
    return result;
}

static lx_result read_triangles(primitive_job *job, lx_topology topology, mesh_report *report, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t *list = NULL, count = 0;
    LX_TRY(read_index_list(job, &list, &count, error));
    report->cut_triangles += topology == LX_TRIANGLES && count % 3 != 0;
    job->out.triangle_count = lx_triangle_count(topology, count);
    if (topology == LX_TRIANGLES) {
        job->out.indices = list;
        list = NULL;
        goto cleanup;
    }
    LX_TRY(lx_gltf_charge(job->reader, job->out.triangle_count, 3 * sizeof(uint32_t), job->object.label, error));
    job->out.indices = lx_malloc_array(job->out.triangle_count, 3 * sizeof(uint32_t));
    if (job->out.indices)
        lx_triangulate(topology, list, count, job->out.indices);
    else
        result = lx_fail_memory(error, job->object.label);
cleanup:
    lx_free(list);
    return result;
}

static lx_result add_primitive(lx_gltf_reader *reader, const lx_primitive *primitive, lx_error *error)
{
    lx_scene *scene = reader->scene;
    if (!lx_array_reserve(&scene->primitives, &reader->primitive_capacity, (size_t)scene->primitive_count + 1,
                          sizeof *scene->primitives))
        return lx_fail_memory(error, "primitives");
    scene->primitives[scene->primitive_count++] = *primitive;
    return LX_OK;
}

// Geometry that only Draco's decoder can give has accessors without any data, which would read as zeros.
static lx_result refuse_draco(const primitive_job *job, const lx_gltf_accessor *positions, lx_error *error)
{
    const lx_gltf_object draco = lx_gltf_extension(&job->object, "KHR_draco_mesh_compression");
    if (!draco.json || positions->view >= 0 || positions->sparse.count > 0) return LX_OK;
    return lx_fail(error, LX_ERROR_UNSUPPORTED, "%s: KHR_draco_mesh_compression is not supported; %s",
                   job->object.label, lx_gltf_draco_advice());
}

static lx_result read_primitive(primitive_job *job, mesh_report *report, lx_error *error)
{
    lx_result result = LX_OK;
    uint64_t mode = LX_TRIANGLES;
    int32_t position_index, material;
    lx_gltf_accessor positions;
    LX_TRY(lx_gltf_get_size(&job->object, "mode", &mode, error));
    if (mode > LX_TRIANGLE_FAN)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown mode %llu", job->object.label, (unsigned long long)mode);
    LX_TRY(lx_gltf_get_object(&job->object, "attributes", &job->attributes, error));
    LX_TRY(
        lx_gltf_get_index(&job->attributes, "POSITION", job->reader->counts[LX_GLTF_ACCESSOR], &position_index, error));
    report->skipped_modes += mode < LX_TRIANGLES;
    report->without_positions += mode >= LX_TRIANGLES && position_index < 0;
    if (mode < LX_TRIANGLES || position_index < 0) return LX_OK;
    LX_TRY(lx_gltf_get_accessor(job->reader, (uint32_t)position_index, &positions, error));
    LX_TRY(refuse_draco(job, &positions, error));
    job->out.vertex_count = positions.count;
    LX_TRY(read_attributes(job, error));
    LX_TRY(apply_targets(job, error));
    LX_TRY(read_triangles(job, (lx_topology)mode, report, error));
    if (job->out.triangle_count == 0) return LX_OK;
    if (job->out.normals) report->repaired_normals += lx_repair_normals(&job->out);
    if (mode == LX_TRIANGLES)
        report->degenerate += lx_count_degenerate_triangles(&job->out); // strips have them on purpose
    LX_TRY(lx_gltf_get_index(&job->object, "material", job->reader->counts[LX_GLTF_MATERIAL], &material, error));
    job->out.material = lx_gltf_material_index(job->reader, material);
    LX_TRY(add_primitive(job->reader, &job->out, error));
    job->out = (lx_primitive){0}; // the scene owns it now
cleanup:
    return result;
}

static void tell(lx_log *log, const char *label, const mesh_report *report)
{
    if (report->skipped_modes)
        lx_log_warning(log, "%s: %u primitives of points or lines are skipped", label, report->skipped_modes);
    if (report->without_positions)
        lx_log_warning(log, "%s: %u primitives without POSITION are skipped", label, report->without_positions);
    if (report->cut_triangles)
        lx_log_warning(log, "%s: %u primitives end in an incomplete triangle", label, report->cut_triangles);
    if (report->degenerate) lx_log_warning(log, "%s: %u degenerate triangles (no area)", label, report->degenerate);
    if (report->repaired_normals)
        lx_log_note(log, "%s: %u normals without length are replaced by those of the triangles", label,
                    report->repaired_normals);
}

static lx_result read_primitives(lx_gltf_reader *reader, uint32_t file_mesh, const lx_gltf_object *object,
                                 const float *weights, uint32_t weight_count, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *primitives;
    uint32_t count;
    mesh_report report = {0};
    LX_TRY(lx_gltf_get_array(object, "primitives", &primitives, &count, error));
    for (uint32_t i = 0; i < count; ++i) {
        primitive_job job = {.reader = reader, .weights = weights, .weight_count = weight_count};
        job.out.file_mesh = file_mesh;
        job.out.file_primitive = i;
        LX_TRY(primitive_object(object, primitives, i, &job.object, error));
        result = read_primitive(&job, &report, error);
        lx_primitive_release(&job.out);
        if (result != LX_OK) goto cleanup;
    }
    tell(reader->log, object->label, &report);
cleanup:
    return result;
}

// The weights that `object` (a mesh or a node) gives; NULL if none.
static lx_result read_weights(const lx_gltf_object *object, float **out, uint32_t *count, lx_error *error)
{
    json_t *array;
    lx_result result = lx_gltf_get_array(object, "weights", &array, count, error);
    if (result != LX_OK || *count == 0) return result;
    *out = lx_malloc_array(*count, sizeof **out);
    if (!*out) return lx_fail_memory(error, object->label);
    return lx_gltf_get_floats(object, "weights", *out, *count, NULL, error);
}

static int32_t find_variant(const lx_gltf_reader *reader, uint32_t file_mesh, const float *weights, uint32_t count)
{
    int32_t index = reader->first_variant[file_mesh];
    for (; index >= 0; index = reader->variants[index].next) {
        const lx_gltf_mesh_variant *variant = &reader->variants[index];
        if (variant->weight_count == count &&
            (count == 0 || memcmp(variant->weights, weights, count * sizeof *weights) == 0))
            break;
    }
    return index;
}

// Takes `weights`.
static lx_result add_variant(lx_gltf_reader *reader, uint32_t file_mesh, float *weights, uint32_t weight_count,
                             lx_error *error)
{
    lx_scene *scene = reader->scene;
    if (!lx_array_reserve(&reader->variants, &reader->variant_capacity, reader->variant_count + 1,
                          sizeof *reader->variants) ||
        !lx_array_reserve(&scene->meshes, &reader->mesh_capacity, (size_t)scene->mesh_count + 1,
                          sizeof *scene->meshes)) {
        lx_free(weights);
        return lx_fail_memory(error, "meshes");
    }
    reader->variants[reader->variant_count] = (lx_gltf_mesh_variant){.mesh = scene->mesh_count,
                                                                     .next = reader->first_variant[file_mesh],
                                                                     .weights = weights,
                                                                     .weight_count = weight_count};
    reader->first_variant[file_mesh] = (int32_t)reader->variant_count++;
    lx_mesh mesh = {.first_primitive = scene->primitive_count, .file_index = file_mesh};
    lx_result result = LX_OK;
    lx_gltf_object object;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_MESH, file_mesh, &object, error));
    LX_TRY(lx_gltf_name(reader, &object, NULL, "mesh", file_mesh, &mesh.name, error));
    LX_TRY(read_primitives(reader, file_mesh, &object, weights, weight_count, error));
    mesh.primitive_count = scene->primitive_count - mesh.first_primitive;
    scene->meshes[scene->mesh_count++] = mesh;
cleanup:
    return result;
}

lx_result lx_gltf_mesh_index(lx_gltf_reader *reader, uint32_t file_mesh, const lx_gltf_object *node, uint32_t *out,
                             lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    float *weights = NULL;
    uint32_t count = 0;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_MESH, file_mesh, &object, error));
    LX_TRY(read_weights(node, &weights, &count, error));
    if (count == 0) LX_TRY(read_weights(&object, &weights, &count, error));
    int32_t variant = find_variant(reader, file_mesh, weights, count);
    if (variant < 0) {
        float *const taken = weights;
        weights = NULL;
        LX_TRY(add_variant(reader, file_mesh, taken, count, error));
        variant = reader->first_variant[file_mesh];
    }
    *out = reader->variants[variant].mesh;
cleanup:
    lx_free(weights);
    return result;
}

// All accessors that `attributes` names exist.
static lx_result check_attributes(const lx_gltf_reader *reader, const lx_gltf_object *attributes, lx_error *error)
{
    const char *name;
    json_t *value;
    json_object_foreach(attributes->json, name, value)
    {
        uint32_t index;
        const lx_result result =
            lx_gltf_index_of(attributes, value, name, reader->counts[LX_GLTF_ACCESSOR], &index, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static lx_result check_primitive(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object attributes;
    json_t *targets;
    uint32_t target_count;
    int32_t index;
    LX_TRY(lx_gltf_get_object(object, "attributes", &attributes, error));
    if (!attributes.json) return lx_fail(error, LX_ERROR_FORMAT, "%s: no attributes", object->label);
    LX_TRY(check_attributes(reader, &attributes, error));
    LX_TRY(lx_gltf_get_index(object, "indices", reader->counts[LX_GLTF_ACCESSOR], &index, error));
    LX_TRY(lx_gltf_get_index(object, "material", reader->counts[LX_GLTF_MATERIAL], &index, error));
    LX_TRY(lx_gltf_get_array(object, "targets", &targets, &target_count, error));
    for (uint32_t i = 0; i < target_count; ++i) {
        const lx_gltf_object target = lx_gltf_object_inside(object, json_array_get(targets, i), "target");
        LX_TRY(check_attributes(reader, &target, error));
    }
cleanup:
    return result;
}

lx_result lx_gltf_check_meshes(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t mesh_count = reader->counts[LX_GLTF_MESH];
    reader->first_variant = lx_malloc_array(mesh_count, sizeof *reader->first_variant);
    if (!reader->first_variant) return lx_fail_memory(error, "meshes");
    for (uint32_t m = 0; m < mesh_count; ++m) {
        lx_gltf_object object;
        json_t *primitives;
        uint32_t count;
        lx_gltf_extras extras;
        reader->first_variant[m] = -1;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_MESH, m, &object, error));
        LX_TRY(lx_gltf_get_array(&object, "primitives", &primitives, &count, error));
        LX_TRY(lx_gltf_extras_read(reader, &object, LX_EXTRAS_ELSEWHERE, &extras, error));
        for (uint32_t i = 0; i < count; ++i) {
            lx_gltf_object primitive;
            LX_TRY(primitive_object(&object, primitives, i, &primitive, error));
            LX_TRY(check_primitive(reader, &primitive, error));
        }
    }
cleanup:
    return result;
}
