// Materials: what of them decides how light is reflected, passed and emitted.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <math.h>
#include <string.h>

static const lx_texture_slot no_texture = {.texture = -1, .m = {1, 0, 0, 0, 1, 0}};

// KHR_texture_transform: translation · rotation · scale, rotation by the sign the specification has since its erratum
// (and three.js and Babylon.js use): u' = cos u + sin v, v' = -sin u + cos v.
static lx_result read_transform(const lx_gltf_object *info, lx_texture_slot *slot, uint64_t *texcoord, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_gltf_object transform = lx_gltf_extension(info, "KHR_texture_transform");
    float offset[2] = {0, 0}, scale[2] = {1, 1}, rotation = 0;
    if (!transform.json) return LX_OK;
    LX_TRY(lx_gltf_get_floats(&transform, "offset", offset, 2, NULL, error));
    LX_TRY(lx_gltf_get_floats(&transform, "scale", scale, 2, NULL, error));
    LX_TRY(lx_gltf_get_float(&transform, "rotation", &rotation, error));
    LX_TRY(lx_gltf_get_size(&transform, "texCoord", texcoord, error));
    const float c = cosf(rotation), s = sinf(rotation);
    const float m[6] = {c * scale[0], s * scale[1], offset[0], -s * scale[0], c * scale[1], offset[1]};
    memcpy(slot->m, m, sizeof m);
cleanup:
    return result;
}

static lx_result read_slot(const lx_gltf_reader *reader, const lx_gltf_object *holder, const char *key,
                           lx_texture_slot *slot, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object info;
    uint64_t texcoord = 0;
    LX_TRY(lx_gltf_get_object(holder, key, &info, error));
    if (!info.json) return LX_OK;
    LX_TRY(lx_gltf_get_index(&info, "index", reader->counts[LX_GLTF_TEXTURE], &slot->texture, error));
    if (slot->texture < 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: no index", info.label);
    LX_TRY(lx_gltf_get_size(&info, "texCoord", &texcoord, error));
    LX_TRY(read_transform(&info, slot, &texcoord, error));
    if (texcoord >= lx_texcoord_sets) {
        lx_log_warning(reader->log, "%s: TEXCOORD_%llu is not read (0 to %d are); set 0 is taken", info.label,
                       (unsigned long long)texcoord, lx_texcoord_sets - 1);
        texcoord = 0;
    }
    slot->texcoord = (uint32_t)texcoord;
cleanup:
    return result;
}

// Every object with an `index` below a material is a use of a texture, those of extensions included. `extras` may hold anything.
static uint32_t sampled_texcoords(const json_t *value)
{
    uint32_t bits = 0;
    const char *key;
    json_t *member;
    if (json_is_integer(json_object_get(value, "index"))) {
        const json_t *transform = json_object_get(json_object_get(value, "extensions"), "KHR_texture_transform");
        const json_t *texcoord = json_object_get(transform, "texCoord");
        if (!texcoord) texcoord = json_object_get(value, "texCoord");
        const json_int_t set = json_integer_value(texcoord); // 0 without one
        if (set >= 0 && set < 32) bits |= 1u << set;
    }
    json_object_foreach((json_t *)value, key, member)
        if (strcmp(key, "extras") != 0 && json_is_object(member)) bits |= sampled_texcoords(member);
    return bits;
}

static lx_result read_unit_float(const lx_gltf_object *object, const char *key, float *value, lx_error *error)
{
    const lx_result result = lx_gltf_get_float(object, key, value, error);
    *value = lx_clamp(*value, 0, 1);
    return result;
}

static void set_base(lx_material *out, const float rgba[4])
{
    out->base_color = lx_rgb_of(lx_clamp(rgba[0], 0, 1), lx_clamp(rgba[1], 0, 1), lx_clamp(rgba[2], 0, 1));
    out->base_alpha = lx_clamp(rgba[3], 0, 1);
}

static lx_result read_metallic_roughness(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_material *out,
                                         lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object pbr;
    float base[4] = {1, 1, 1, 1};
    LX_TRY(lx_gltf_get_object(object, "pbrMetallicRoughness", &pbr, error));
    LX_TRY(lx_gltf_get_floats(&pbr, "baseColorFactor", base, 4, NULL, error));
    LX_TRY(read_unit_float(&pbr, "metallicFactor", &out->metallic, error));
    LX_TRY(read_unit_float(&pbr, "roughnessFactor", &out->roughness, error));
    LX_TRY(read_slot(reader, &pbr, "baseColorTexture", &out->base_color_texture, error));
    LX_TRY(read_slot(reader, &pbr, "metallicRoughnessTexture", &out->metallic_roughness_texture, error));
    set_base(out, base);
cleanup:
    return result;
}

// The diffuse part replaces the base colour; the specular part is not baked.
static lx_result read_specular_glossiness(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_material *out,
                                          lx_error *error)
{
    lx_result result = LX_OK;
    const lx_gltf_object pbr = lx_gltf_extension(object, "KHR_materials_pbrSpecularGlossiness");
    float base[4] = {1, 1, 1, 1}, glossiness = 1;
    if (!pbr.json) return LX_OK;
    out->base_color_texture = out->metallic_roughness_texture = no_texture;
    LX_TRY(lx_gltf_get_floats(&pbr, "diffuseFactor", base, 4, NULL, error));
    LX_TRY(read_unit_float(&pbr, "glossinessFactor", &glossiness, error));
    LX_TRY(read_slot(reader, &pbr, "diffuseTexture", &out->base_color_texture, error));
    set_base(out, base);
    out->metallic = 0;
    out->roughness = 1 - glossiness;
cleanup:
    return result;
}

// The factor is kept in 0…1; what some exporters write above 1 moves to the strength.
static lx_result read_emission(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_material *out,
                               lx_error *error)
{
    lx_result result = LX_OK;
    float factor[3] = {0, 0, 0}, strength = 1;
    const lx_gltf_object extension = lx_gltf_extension(object, "KHR_materials_emissive_strength");
    LX_TRY(lx_gltf_get_floats(object, "emissiveFactor", factor, 3, NULL, error));
    LX_TRY(lx_gltf_get_float(&extension, "emissiveStrength", &strength, error));
    LX_TRY(read_slot(reader, object, "emissiveTexture", &out->emissive_texture, error));
    if (strength < 0 || factor[0] < 0 || factor[1] < 0 || factor[2] < 0)
        lx_log_warning(reader->log, "%s: negative emission is taken as 0", object->label);
    out->emissive_factor = lx_rgb_of(fmaxf(factor[0], 0), fmaxf(factor[1], 0), fmaxf(factor[2], 0));
    const float excess = fmaxf(lx_rgb_max(out->emissive_factor), 1);
    out->emissive_factor = lx_rgb_scale(out->emissive_factor, 1 / excess);
    out->factor_scale = 1 / excess;
    out->strength_scale = excess * reader->emission_scale;
    out->emissive_strength = fmaxf(strength, 0) * out->strength_scale;
    if (!isfinite(out->emissive_strength))
        return lx_fail(error, LX_ERROR_FORMAT, "%s: emission is infinite", object->label);
cleanup:
    return result;
}

static lx_result read_alpha(const lx_gltf_object *object, lx_material *out, lx_error *error)
{
    lx_result result = LX_OK;
    const char *mode = "OPAQUE";
    LX_TRY(lx_gltf_get_string(object, "alphaMode", &mode, error));
    LX_TRY(lx_gltf_get_float(object, "alphaCutoff", &out->alpha_cutoff, error));
    if (strcmp(mode, "OPAQUE") == 0)
        out->alpha_mode = LX_ALPHA_OPAQUE;
    else if (strcmp(mode, "MASK") == 0)
        out->alpha_mode = LX_ALPHA_MASK;
    else if (strcmp(mode, "BLEND") == 0)
        out->alpha_mode = LX_ALPHA_BLEND;
    else
        return lx_fail(error, LX_ERROR_FORMAT, "%s: alphaMode '%.20s' is not OPAQUE, MASK or BLEND", object->label,
                       mode);
cleanup:
    return result;
}

static lx_result read_authoring(lx_gltf_reader *reader, const lx_gltf_object *object, lx_material *out, lx_error *error)
{
    lx_gltf_extras extras;
    const lx_result result = lx_gltf_extras_read(reader, object, LX_EXTRAS_MATERIAL, &extras, error);
    if (result != LX_OK) return result;
    out->transparent = extras.transparent == 1;
    out->mode = extras.mode >= 0 ? (lx_light_mode)extras.mode : LX_MODE_BAKED;
    out->layer = extras.layer;
    out->density = extras.density > 0 ? extras.density : 1;
    out->monitor_columns = extras.monitor_columns;
    out->monitor_rows = extras.monitor_rows;
    out->animate = extras.animate;
    return LX_OK;
}

static lx_material default_material(void)
{
    return (lx_material){
        .name = "",
        .file_index = -1,
        .base_color = {1, 1, 1},
        .base_alpha = 1,
        .metallic = 1,
        .roughness = 1,
        .emissive_strength = 1,
        .factor_scale = 1,
        .strength_scale = 1,
        .base_color_texture = no_texture,
        .metallic_roughness_texture = no_texture,
        .emissive_texture = no_texture,
        .transmission_texture = no_texture,
        .alpha_cutoff = 0.5f,
        .density = 1,
    };
}

static lx_result read_material(lx_gltf_reader *reader, uint32_t index, lx_material *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    *out = default_material();
    out->file_index = (int32_t)index;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_MATERIAL, index, &object, error));
    LX_TRY(lx_gltf_keep_string(reader, json_string_value(json_object_get(object.json, "name")), &out->name, error));
    out->sampled_texcoords = sampled_texcoords(object.json);
    LX_TRY(read_metallic_roughness(reader, &object, out, error));
    LX_TRY(read_specular_glossiness(reader, &object, out, error));
    LX_TRY(read_emission(reader, &object, out, error));
    LX_TRY(read_alpha(&object, out, error));
    LX_TRY(lx_gltf_get_bool(&object, "doubleSided", &out->double_sided, error));
    out->unlit = lx_gltf_extension(&object, "KHR_materials_unlit").json != NULL;
    const lx_gltf_object transmission = lx_gltf_extension(&object, "KHR_materials_transmission");
    LX_TRY(read_unit_float(&transmission, "transmissionFactor", &out->transmission, error));
    LX_TRY(read_slot(reader, &transmission, "transmissionTexture", &out->transmission_texture, error));
    LX_TRY(read_authoring(reader, &object, out, error));
cleanup:
    return result;
}

lx_result lx_gltf_load_materials(lx_gltf_reader *reader, lx_error *error)
{
    lx_scene *scene = reader->scene;
    const uint32_t count = reader->counts[LX_GLTF_MATERIAL];
    scene->materials = lx_calloc_array((size_t)count + 1, sizeof *scene->materials); // one more: the default material
    if (!scene->materials) return lx_fail_memory(error, "materials");
    for (uint32_t i = 0; i < count; ++i) {
        const lx_result result = read_material(reader, i, &scene->materials[i], error);
        if (result != LX_OK) return result;
        scene->material_count = i + 1;
    }
    return LX_OK;
}

uint32_t lx_gltf_material_index(lx_gltf_reader *reader, int32_t file_index)
{
    lx_scene *scene = reader->scene;
    if (file_index >= 0) return (uint32_t)file_index;
    if (reader->default_material < 0) {
        reader->default_material = (int32_t)scene->material_count;
        scene->materials[scene->material_count++] = default_material();
    }
    return (uint32_t)reader->default_material;
}
