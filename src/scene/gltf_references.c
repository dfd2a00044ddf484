// Indices that the importer does not follow itself, but that export keeps: skins, animations, textures that do not
// matter to light. A file that points nowhere is refused here rather than handed on.
#include "scene/gltf_reader.h"

#include "base/error.h"

static lx_result check_key(const lx_gltf_reader *reader, const lx_gltf_object *object, const char *key,
                           lx_gltf_kind kind, lx_error *error)
{
    int32_t index;
    return lx_gltf_get_index(object, key, reader->counts[kind], &index, error);
}

static lx_result check_skin(const lx_gltf_reader *reader, const lx_gltf_object *skin, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *joints;
    uint32_t count, joint;
    LX_TRY(check_key(reader, skin, "inverseBindMatrices", LX_GLTF_ACCESSOR, error));
    LX_TRY(check_key(reader, skin, "skeleton", LX_GLTF_NODE, error));
    LX_TRY(lx_gltf_get_array(skin, "joints", &joints, &count, error));
    for (uint32_t i = 0; i < count; ++i)
        LX_TRY(lx_gltf_index_of(skin, json_array_get(joints, i), "joint", reader->counts[LX_GLTF_NODE], &joint, error));
cleanup:
    return result;
}

static lx_result check_animation(const lx_gltf_reader *reader, const lx_gltf_object *animation, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *samplers, *channels;
    uint32_t sampler_count, channel_count;
    int32_t index;
    LX_TRY(lx_gltf_get_array(animation, "samplers", &samplers, &sampler_count, error));
    for (uint32_t i = 0; i < sampler_count; ++i) {
        const lx_gltf_object sampler = lx_gltf_object_inside(animation, json_array_get(samplers, i), "sampler");
        LX_TRY(check_key(reader, &sampler, "input", LX_GLTF_ACCESSOR, error));
        LX_TRY(check_key(reader, &sampler, "output", LX_GLTF_ACCESSOR, error));
    }
    LX_TRY(lx_gltf_get_array(animation, "channels", &channels, &channel_count, error));
    for (uint32_t i = 0; i < channel_count; ++i) {
        const lx_gltf_object channel = lx_gltf_object_inside(animation, json_array_get(channels, i), "channel");
        LX_TRY(lx_gltf_get_index(&channel, "sampler", sampler_count, &index, error));
    }
cleanup:
    return result;
}

static lx_result check_material(const lx_gltf_reader *reader, const lx_gltf_object *material, lx_error *error)
{
    static const char *const slots[] = {"normalTexture", "occlusionTexture"};
    for (int i = 0; i < 2; ++i) {
        lx_gltf_object info;
        lx_result result = lx_gltf_get_object(material, slots[i], &info, error);
        if (result == LX_OK) result = check_key(reader, &info, "index", LX_GLTF_TEXTURE, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

lx_result lx_gltf_check_references(lx_gltf_reader *reader, lx_error *error)
{
    static const struct {
        lx_gltf_kind kind;
        lx_result (*check)(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_error *error);
    } checks[] = {{LX_GLTF_SKIN, check_skin}, {LX_GLTF_ANIMATION, check_animation}, {LX_GLTF_MATERIAL, check_material}};
    for (int c = 0; c < 3; ++c)
        for (uint32_t i = 0; i < reader->counts[checks[c].kind]; ++i) {
            lx_gltf_object object;
            lx_result result = lx_gltf_element(reader, checks[c].kind, i, &object, error);
            if (result == LX_OK) result = checks[c].check(reader, &object, error);
            if (result != LX_OK) return result;
        }
    return LX_OK;
}
