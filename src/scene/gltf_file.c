// The outside of a glTF file: GLB container, JSON text, version, and which extensions it asks for.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <stdio.h>
#include <string.h>

static uint32_t read_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

enum {
    glb_magic = 0x46546c67,
    chunk_json = 0x4e4f534a,
    chunk_bin = 0x004e4942,
    header_bytes = 12,
    chunk_header_bytes = 8
};

typedef struct glb_parts {
    const char *json;
    size_t json_size;
    const uint8_t *binary;
    size_t binary_size;
} glb_parts;

static lx_result split_glb(lx_log *log, const uint8_t *data, size_t size, glb_parts *parts, lx_error *error)
{
    if (size < header_bytes) return lx_fail(error, LX_ERROR_FORMAT, "GLB: truncated after %zu bytes", size);
    const uint32_t version = read_u32(data + 4), length = read_u32(data + 8);
    if (version != 2) return lx_fail(error, LX_ERROR_UNSUPPORTED, "GLB: version %u (only 2 is read)", version);
    if (length > size) return lx_fail(error, LX_ERROR_FORMAT, "GLB: truncated: %zu bytes of %u", size, length);
    if (length < size) lx_log_warning(log, "GLB: %zu bytes behind its end are ignored", size - length);
    size_t at = header_bytes;
    for (uint32_t chunk = 0; at < length; ++chunk) {
        if (length - at < chunk_header_bytes) {
            if (chunk > 0 && length - at < 4) break; // padding behind the last chunk
            return lx_fail(error, LX_ERROR_FORMAT, "GLB: chunk %u: truncated header", chunk);
        }
        const uint32_t chunk_length = read_u32(data + at), type = read_u32(data + at + 4);
        at += chunk_header_bytes;
        if (chunk_length > length - at)
            return lx_fail(error, LX_ERROR_FORMAT, "GLB: chunk %u: length %u is more than the %zu bytes left", chunk,
                           chunk_length, length - at);
        if (chunk == 0) {
            if (type != chunk_json) return lx_fail(error, LX_ERROR_FORMAT, "GLB: chunk 0 is not JSON");
            parts->json = (const char *)data + at;
            parts->json_size = chunk_length;
        } else if (chunk == 1 && type == chunk_bin) {
            parts->binary = data + at;
            parts->binary_size = chunk_length;
        }
        at += chunk_length;
    }
    if (!parts->json) return lx_fail(error, LX_ERROR_FORMAT, "GLB: no JSON chunk");
    return LX_OK;
}

static lx_result check_version(const lx_gltf_reader *reader, lx_error *error)
{
    lx_gltf_object asset;
    const char *version = NULL, *min_version = NULL;
    lx_result result = LX_OK;
    LX_TRY(lx_gltf_get_object(&reader->root, "asset", &asset, error));
    if (!asset.json) return lx_fail(error, LX_ERROR_FORMAT, "asset: missing (not a glTF file?)");
    LX_TRY(lx_gltf_get_string(&asset, "version", &version, error));
    LX_TRY(lx_gltf_get_string(&asset, "minVersion", &min_version, error));
    if (!version) return lx_fail(error, LX_ERROR_FORMAT, "asset: no version");
    if (strncmp(version, "2.", 2) != 0)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "asset: glTF version %.20s (only 2.0 is read)", version);
    if (min_version && strcmp(min_version, "2.0") != 0)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "asset: needs glTF version %.20s (only 2.0 is read)", min_version);
cleanup:
    return result;
}

// Extensions whose meaning is taken in.
static const char *const read_extensions[] = {
    "EXT_mesh_gpu_instancing",
    "EXT_meshopt_compression",
    "EXT_texture_webp",
    "KHR_animation_pointer",
    "KHR_lights_punctual",
    "KHR_materials_emissive_strength",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_transmission",
    "KHR_materials_unlit",
    "KHR_mesh_quantization",
    "KHR_meshopt_compression",
    "KHR_texture_transform",
};

// Extensions that a file may even require: without them all geometry and light is still read rightly.
static const char *const harmless_extensions[] = {
    "KHR_materials_anisotropy",
    "KHR_materials_clearcoat",
    "KHR_materials_diffuse_transmission",
    "KHR_materials_dispersion",
    "KHR_materials_ior",
    "KHR_materials_iridescence",
    "KHR_materials_sheen",
    "KHR_materials_specular",
    "KHR_materials_variants",
    "KHR_materials_volume",
    "KHR_xmp",
    "KHR_xmp_json_ld",
};

// Ways out of extensions that change how data is stored, with a tool that people have.
static const struct {
    const char *name, *advice;
} advices[] = {
    {"KHR_draco_mesh_compression", "decode it first: npx @gltf-transform/cli copy in.glb out.glb"},
    {"KHR_texture_basisu", "convert its textures first: npx @gltf-transform/cli ktxdecompress in.glb out.glb"},
    {"EXT_texture_avif", "convert its textures first: npx @gltf-transform/cli png in.glb out.glb"},
};

static bool is_among(const char *name, const char *const *names, size_t count)
{
    for (size_t i = 0; i < count; ++i)
        if (strcmp(name, names[i]) == 0) return true;
    return false;
}

#define COUNT_OF(array) (sizeof(array) / sizeof *(array))

const char *lx_gltf_draco_advice(void) { return advices[0].advice; }

static const char *advice_for(const char *name)
{
    for (size_t i = 0; i < COUNT_OF(advices); ++i)
        if (strcmp(name, advices[i].name) == 0) return advices[i].advice;
    return "export without it, or drop it: npx @gltf-transform/cli copy in.glb out.glb";
}

static lx_result check_required(const lx_gltf_reader *reader, lx_error *error)
{
    json_t *required;
    uint32_t count;
    const lx_result result = lx_gltf_get_array(&reader->root, "extensionsRequired", &required, &count, error);
    if (result != LX_OK) return result;
    for (uint32_t i = 0; i < count; ++i) {
        const char *name = json_string_value(json_array_get(required, i));
        if (!name) return lx_fail(error, LX_ERROR_FORMAT, "extensionsRequired: [%u] is not a string", i);
        if (!is_among(name, read_extensions, COUNT_OF(read_extensions)) &&
            !is_among(name, harmless_extensions, COUNT_OF(harmless_extensions)))
            return lx_fail(error, LX_ERROR_UNSUPPORTED, "extensionsRequired: %.64s is not supported; %s", name,
                           advice_for(name));
    }
    return LX_OK;
}

static lx_result note_ignored(const lx_gltf_reader *reader, lx_error *error)
{
    json_t *used;
    uint32_t count;
    const lx_result result = lx_gltf_get_array(&reader->root, "extensionsUsed", &used, &count, error);
    if (result != LX_OK) return result;
    char list[512] = "";
    size_t length = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const char *name = json_string_value(json_array_get(used, i));
        if (!name) return lx_fail(error, LX_ERROR_FORMAT, "extensionsUsed: [%u] is not a string", i);
        if (is_among(name, read_extensions, COUNT_OF(read_extensions)) || length >= sizeof list - 1) continue;
        const int written = snprintf(list + length, sizeof list - length, "%s%.64s", length ? ", " : "", name);
        length += written > 0 ? (size_t)written : 0;
    }
    if (length) lx_log_note(reader->log, "extensions that are ignored: %s", list);
    return LX_OK;
}

static void recognise_exporter(lx_gltf_reader *reader)
{
    const char *generator =
        json_string_value(json_object_get(json_object_get(reader->root.json, "asset"), "generator"));
    // The second is what versions before 2.83 wrote.
    reader->scene->from_blender = generator && (strstr(generator, "Khronos glTF Blender I/O") != NULL ||
                                                strstr(generator, "Khronos Blender glTF 2.0 I/O") != NULL);
}

lx_result lx_gltf_open(lx_gltf_reader *reader, const void *data, size_t size, lx_error *error)
{
    lx_result result = LX_OK;
    glb_parts parts = {.json = data, .json_size = size};
    if (size >= 4 && read_u32(data) == glb_magic) {
        parts = (glb_parts){0};
        LX_TRY(split_glb(reader->log, data, size, &parts, error));
    }
    LX_TRY(lx_gltf_json_parse(parts.json, parts.json_size, &reader->scene->document, error));
    reader->root = (lx_gltf_object){.json = reader->scene->document, .label = "glTF"};
    reader->binary = parts.binary;
    reader->binary_size = parts.binary_size;
    LX_TRY(check_version(reader, error));
    LX_TRY(check_required(reader, error));
    LX_TRY(note_ignored(reader, error));
    recognise_exporter(reader);
cleanup:
    return result;
}
