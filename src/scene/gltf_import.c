// Reads a scene from a glTF file in memory: the order of the steps, and what they share.
//
// Based on: Khronos glTF 2.0 specification (ISO/IEC 12113:2022).
#include "scene/gltf.h"

#include "base/error.h"
#include "scene/checks.h"
#include "scene/gltf_accessors.h"
#include "scene/gltf_reader.h"

#include <string.h>

// What decoding may allocate: a basis that holds any honest texture, and so much per byte of input; and never more than
// so many times the largest file that is allowed. A file of a few lines can ask for thousands of copies of one mesh, or
// for a mesh of two thousand million zeros.
#define BASE_ALLOWANCE (2ull << 30)
enum { allowance_per_byte = 64, allowance_per_limit_byte = 16 };

static const struct {
    const char *array, *element;
} kinds[lx_gltf_kind_count] = {
    [LX_GLTF_BUFFER] = {"buffers", "buffer"},
    [LX_GLTF_VIEW] = {"bufferViews", "bufferView"},
    [LX_GLTF_ACCESSOR] = {"accessors", "accessor"},
    [LX_GLTF_SAMPLER] = {"samplers", "sampler"},
    [LX_GLTF_IMAGE] = {"images", "image"},
    [LX_GLTF_TEXTURE] = {"textures", "texture"},
    [LX_GLTF_MATERIAL] = {"materials", "material"},
    [LX_GLTF_MESH] = {"meshes", "mesh"},
    [LX_GLTF_SKIN] = {"skins", "skin"},
    [LX_GLTF_CAMERA] = {"cameras", "camera"},
    [LX_GLTF_LIGHT] = {"lights", "light"},
    [LX_GLTF_ANIMATION] = {"animations", "animation"},
    [LX_GLTF_NODE] = {"nodes", "node"},
    [LX_GLTF_SCENE] = {"scenes", "scene"},
};

lx_result lx_gltf_element(const lx_gltf_reader *reader, lx_gltf_kind kind, uint32_t index, lx_gltf_object *out,
                          lx_error *error)
{
    json_t *json = json_array_get(reader->elements[kind], index);
    *out = lx_gltf_object_of(json, kinds[kind].element, index);
    return json_is_object(json) ? LX_OK : lx_fail(error, LX_ERROR_FORMAT, "%s: not an object", out->label);
}

void lx_gltf_grant(lx_gltf_reader *reader, size_t input_bytes)
{
    uint64_t grant =
        input_bytes > UINT64_MAX / allowance_per_byte ? UINT64_MAX : (uint64_t)input_bytes * allowance_per_byte;
    if (grant > reader->memory_reserve) grant = reader->memory_reserve;
    reader->memory_reserve -= grant;
    reader->memory_left += grant;
}

lx_result lx_gltf_charge(lx_gltf_reader *reader, uint64_t count, size_t size, const char *label, lx_error *error)
{
    if (size != 0 && count > reader->memory_left / size)
        return lx_fail(error, LX_ERROR_LIMIT,
                       "%s: the scene would take more memory than is allowed (%llu times %zu bytes more)", label,
                       (unsigned long long)count, size);
    reader->memory_left -= count * size;
    return LX_OK;
}

lx_result lx_gltf_keep_string(lx_gltf_reader *reader, const char *text, const char **out, lx_error *error)
{
    char *copy = lx_arena_strdup(&reader->scene->strings, text ? text : "");
    if (!copy) return lx_fail_memory(error, "names");
    *out = copy;
    return LX_OK;
}

static const char *name_of(const lx_gltf_object *object)
{
    const char *name = object ? json_string_value(json_object_get(object->json, "name")) : NULL;
    return name && name[0] ? name : NULL;
}

lx_result lx_gltf_name(lx_gltf_reader *reader, const lx_gltf_object *element, const lx_gltf_object *second,
                       const char *fallback, uint32_t index, const char **out, lx_error *error)
{
    const char *name = name_of(element);
    if (!name) name = name_of(second);
    if (name) return lx_gltf_keep_string(reader, name, out, error);
    char *made = lx_format("%s_%u", fallback, index);
    if (!made) return lx_fail_memory(error, "names");
    const lx_result result = lx_gltf_keep_string(reader, made, out, error);
    lx_free(made);
    return result;
}

// The top-level arrays must be arrays; that their elements are objects is checked when they are looked at.
static lx_result find_elements(lx_gltf_reader *reader, lx_error *error)
{
    for (int kind = 0; kind < lx_gltf_kind_count; ++kind) {
        lx_gltf_object holder = reader->root;
        if (kind == LX_GLTF_LIGHT) holder = lx_gltf_extension(&reader->root, "KHR_lights_punctual");
        const lx_result result =
            lx_gltf_get_array(&holder, kinds[kind].array, &reader->elements[kind], &reader->counts[kind], error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static lx_result read_scene(lx_gltf_reader *reader, const void *data, size_t size, const lx_scene_load_desc *desc,
                            lx_error *error)
{
    lx_result result = LX_OK;
    LX_TRY(lx_gltf_open(reader, data, size, error));
    LX_TRY(find_elements(reader, error));
    LX_TRY(lx_gltf_load_buffers(reader, error));
    LX_TRY(lx_gltf_check_accessors(reader, error));
    LX_TRY(lx_gltf_load_textures(reader, error));
    LX_TRY(lx_gltf_load_materials(reader, error));
    LX_TRY(lx_gltf_check_meshes(reader, error));
    LX_TRY(lx_gltf_check_references(reader, error));
    LX_TRY(lx_gltf_load_nodes(reader, error));
    LX_TRY(lx_gltf_load_instances(reader, error));
    LX_TRY(lx_gltf_load_images(reader, error));
    LX_TRY(lx_gltf_load_lights(reader, error));
    LX_TRY(lx_gltf_load_cameras(reader, error));
    LX_TRY(lx_gltf_load_tracks(reader, error));
    LX_TRY(lx_gltf_load_sources(reader, error));
    lx_scene_advise(reader->scene, desc->light_units, reader->counts[LX_GLTF_LIGHT] > 0, reader->extras_count > 0);
cleanup:
    return result;
}

static void release(lx_gltf_reader *reader)
{
    for (uint32_t i = 0; reader->views && i < reader->counts[LX_GLTF_VIEW]; ++i) lx_free(reader->views[i].decoded);
    lx_free(reader->views);
    lx_free(reader->nodes);
    lx_free(reader->order);
    for (size_t i = 0; i < reader->variant_count; ++i) lx_free(reader->variants[i].weights);
    lx_free(reader->variants);
    lx_free(reader->first_variant);
    lx_free(reader->light_uses);
}

lx_result lx_gltf_import(lx_context *context, const char *name, const char *folder, const void *data, size_t size,
                         const lx_scene_load_desc *desc, lx_scene **out_scene, lx_error *error)
{
    const lx_scene_load_desc defaults = lx_scene_load_desc_default();
    if (!desc) desc = &defaults;
    lx_result result = LX_OK;
    lx_gltf_reader reader = {
        .context = context,
        .log = context->log,
        .folder = folder,
        .max_file_bytes = desc->max_file_bytes,
        .memory_reserve = desc->max_file_bytes > UINT64_MAX / allowance_per_limit_byte
                              ? UINT64_MAX
                              : (uint64_t)desc->max_file_bytes * allowance_per_limit_byte,
        .emission_scale = desc->light_units == LX_LIGHT_UNITS_BLENDER ? 683.0f : 1.0f,
        .default_material = -1,
    };
    lx_gltf_grant(&reader, BASE_ALLOWANCE / allowance_per_byte);
    lx_gltf_grant(&reader, size);
    reader.scene = lx_calloc_array(1, sizeof *reader.scene);
    if (!reader.scene) {
        result = lx_fail_memory(error, "scene");
        goto cleanup;
    }
    reader.scene->context = context;
    reader.scene->bounds = lx_bounds_empty();
    reader.scene->path = lx_strdup(name);
    if (!reader.scene->path) {
        result = lx_fail_memory(error, "scene");
        goto cleanup;
    }
    LX_TRY(read_scene(&reader, data, size, desc, error));
    *out_scene = reader.scene;
    reader.scene = NULL; // ownership moved to the caller
cleanup:
    if (result != LX_OK) lx_error_prefix(error, "%s", name);
    release(&reader);
    lx_scene_destroy(reader.scene);
    return result;
}
