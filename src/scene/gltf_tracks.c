// Animations of light: keys of light colours and intensities, emissive factors and strengths.
//
// Based on: glTF 2.0, section 3.11 and appendix C; KHR_animation_pointer. What moves things is read in gltf_nodes.c; what else may be animated
// (a light's range, a spot's cone, base colours) cannot be baked, and a note says so for lights.
#include "scene/gltf_accessors.h"

#include "base/error.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

// What a pointer means to the baker.
typedef struct track_target {
    lx_track_object object;
    lx_track_channel channel;
    uint32_t index;
} track_target;

typedef enum pointer_kind { pointer_of_no_interest, pointer_of_light, pointer_not_baked } pointer_kind;

static pointer_kind parse_pointer(const lx_gltf_reader *reader, const char *pointer, track_target *out)
{
    static const struct {
        const char *prefix, *property;
        lx_track_object object;
        lx_track_channel channel;
    } known[] = {
        {"/extensions/KHR_lights_punctual/lights/", "color", LX_TRACK_LIGHT, LX_TRACK_COLOR},
        {"/extensions/KHR_lights_punctual/lights/", "intensity", LX_TRACK_LIGHT, LX_TRACK_INTENSITY},
        {"/materials/", "emissiveFactor", LX_TRACK_MATERIAL, LX_TRACK_COLOR},
        {"/materials/", "extensions/KHR_materials_emissive_strength/emissiveStrength", LX_TRACK_MATERIAL, LX_TRACK_INTENSITY},
    };
    pointer_kind kind = pointer_of_no_interest;
    for (size_t i = 0; i < sizeof known / sizeof *known; ++i) {
        const size_t length = strlen(known[i].prefix);
        if (strncmp(pointer, known[i].prefix, length) != 0) continue;
        uint32_t index;
        int used = 0;
        if (sscanf(pointer + length, "%9u/%n", &index, &used) != 1 || used == 0) continue;
        const uint32_t count = reader->counts[known[i].object == LX_TRACK_LIGHT ? LX_GLTF_LIGHT : LX_GLTF_MATERIAL];
        if (index >= count) continue;
        *out = (track_target){known[i].object, known[i].channel, index};
        if (strcmp(pointer + length + used, known[i].property) == 0) return pointer_of_light;
        if (known[i].object == LX_TRACK_LIGHT) kind = pointer_not_baked;
    }
    return kind;
}

static lx_result get_numbers(lx_gltf_reader *reader, const lx_gltf_object *sampler, const char *key, uint32_t components, float **out,
                             uint32_t *count, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_accessor accessor;
    LX_TRY(lx_gltf_get_index(sampler, key, reader->counts[LX_GLTF_ACCESSOR], &index, error));
    if (index < 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: no %s", sampler->label, key);
    LX_TRY(lx_gltf_get_accessor(reader, (uint32_t)index, &accessor, error));
    if (accessor.matrix || accessor.components != components)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %s (%s) has not %u numbers an element", sampler->label, key, accessor.object.label,
                       components);
    LX_TRY(lx_gltf_read_floats(reader, &accessor, out, error));
    *count = accessor.count;
cleanup:
    return result;
}

static lx_result read_interpolation(const lx_gltf_object *sampler, lx_interpolation *out, lx_error *error)
{
    static const char *const names[] = {"STEP", "LINEAR", "CUBICSPLINE"};
    const char *text = "LINEAR";
    const lx_result result = lx_gltf_get_string(sampler, "interpolation", &text, error);
    if (result != LX_OK) return result;
    for (int i = 0; i < 3; ++i)
        if (strcmp(text, names[i]) == 0) {
            *out = (lx_interpolation)i;
            return LX_OK;
        }
    return lx_fail(error, LX_ERROR_FORMAT, "%s: interpolation '%.20s' is not STEP, LINEAR or CUBICSPLINE", sampler->label, text);
}

static lx_result check_times(const lx_gltf_object *sampler, const float *times, uint32_t count, lx_error *error)
{
    if (count == 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: no keys", sampler->label);
    for (uint32_t i = 0; i < count; ++i)
        if (times[i] < 0 || (i > 0 && times[i] < times[i - 1]))
            return lx_fail(error, LX_ERROR_FORMAT, "%s: key %u: times must ascend from 0, but here is %g s", sampler->label, i,
                           (double)times[i]);
    return LX_OK;
}

// Interleaves times and values: {time, value}, or {time, in-tangent, value, out-tangent}. Light is never negative.
static bool fill_keys(const float *times, const float *values, uint32_t width, bool cubic, uint32_t key_count, float *out)
{
    const uint32_t per_key = cubic ? 3 * width : width;
    bool negative = false;
    for (uint32_t key = 0; key < key_count; ++key) {
        *out++ = times[key];
        for (uint32_t i = 0; i < per_key; ++i) {
            float value = values[(size_t)key * per_key + i];
            const bool tangent = cubic && i / width != 1;
            negative |= !tangent && value < 0;
            *out++ = tangent ? value : fmaxf(value, 0);
        }
    }
    return negative;
}

// All channels of an animation begin anew together: when the longest has ended, be it one of light or of what moves. Inputs say in `max` when
// they end; where that is missing the channel's own keys say it.
static float animation_end(const lx_gltf_reader *reader, const json_t *samplers)
{
    float end = 0;
    size_t i;
    json_t *sampler;
    json_array_foreach(samplers, i, sampler)
    {
        const json_t *input = json_object_get(sampler, "input");
        if (!json_is_integer(input) || json_integer_value(input) < 0 || json_integer_value(input) >= reader->counts[LX_GLTF_ACCESSOR]) continue;
        const json_t *accessor = json_array_get(reader->elements[LX_GLTF_ACCESSOR], (size_t)json_integer_value(input));
        const float last = (float)json_number_value(json_array_get(json_object_get(accessor, "max"), 0));
        if (isfinite(last)) end = fmaxf(end, last);
    }
    return end;
}

// A key at `end` that holds the last one's value.
static void hold(float *keys, uint32_t key_count, size_t stride, uint32_t width, bool cubic, float end)
{
    float *last = keys + stride * (key_count - 1), *added = last + stride;
    if (cubic) memset(last + 1 + 2 * (size_t)width, 0, width * sizeof *keys); // leaves the last value level
    memcpy(added, last, stride * sizeof *keys);
    *added = end;
    if (cubic) memset(added + 1, 0, width * sizeof *keys); // and arrives level
}

static lx_result keep_track(lx_gltf_reader *reader, const lx_gltf_object *animation, uint32_t animation_index, float animation_end_s,
                            const track_target *target, const lx_gltf_object *sampler, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    const uint32_t width = target->channel == LX_TRACK_COLOR ? 3 : 1;
    float *times = NULL, *values = NULL;
    uint32_t time_count = 0, value_count = 0;
    lx_track track = {.object = target->object, .channel = target->channel, .index = target->index};
    LX_TRY(read_interpolation(sampler, &track.interpolation, error));
    const bool cubic = track.interpolation == LX_CUBIC;
    const uint32_t values_per_key = cubic ? 3 : 1;
    LX_TRY(get_numbers(reader, sampler, "input", 1, &times, &time_count, error));
    LX_TRY(check_times(sampler, times, time_count, error));
    LX_TRY(get_numbers(reader, sampler, "output", width, &values, &value_count, error));
    if ((uint64_t)time_count * values_per_key != value_count) {
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: %u values for %u keys", sampler->label, value_count, time_count);
        goto cleanup;
    }
    const size_t stride = lx_track_stride(&track);
    const bool ends_early = times[time_count - 1] < animation_end_s;
    const uint32_t key_count = time_count + ends_early; // accessors have fewer than 2^32 - 1 elements
    LX_TRY(lx_gltf_charge(reader, key_count, stride * sizeof(float), sampler->label, error));
    float *keys = lx_arena_alloc(&scene->strings, key_count, stride * sizeof *keys);
    if (!keys || !lx_array_reserve(&scene->tracks, &reader->track_capacity, (size_t)scene->track_count + 1, sizeof *scene->tracks)) {
        result = lx_fail_memory(error, "animations");
        goto cleanup;
    }
    if (fill_keys(times, values, width, cubic, time_count, keys))
        lx_log_warning(reader->log, "%s: negative light is taken as 0", sampler->label);
    if (ends_early) hold(keys, time_count, stride, width, cubic, animation_end_s);
    track.keys = keys;
    track.key_count = key_count;
    LX_TRY(lx_gltf_name(reader, animation, NULL, "animation", animation_index, &track.name, error));
    scene->tracks[scene->track_count++] = track;
    if (target->object == LX_TRACK_MATERIAL) scene->materials[target->index].emission_animated = true;
cleanup:
    lx_free(times);
    lx_free(values);
    return result;
}

static lx_result read_channel(lx_gltf_reader *reader, const lx_gltf_object *animation, uint32_t animation_index, float animation_end_s,
                              const json_t *samplers, const lx_gltf_object *channel, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object target;
    const char *pointer = "";
    track_target found;
    int32_t index;
    LX_TRY(lx_gltf_get_object(channel, "target", &target, error));
    const lx_gltf_object extension = lx_gltf_extension(&target, "KHR_animation_pointer");
    LX_TRY(lx_gltf_get_string(&extension, "pointer", &pointer, error));
    const pointer_kind kind = parse_pointer(reader, pointer, &found);
    if (kind == pointer_not_baked)
        lx_log_note(reader->log, "%s: '%.80s' is animated, which cannot be baked; it stays as it is authored", animation->label, pointer);
    if (kind != pointer_of_light) return LX_OK;
    LX_TRY(lx_gltf_get_index(channel, "sampler", (uint32_t)json_array_size(samplers), &index, error));
    if (index < 0) return lx_fail(error, LX_ERROR_FORMAT, "%s: no sampler", channel->label);
    char what[32];
    snprintf(what, sizeof what, "sampler %d", index);
    const lx_gltf_object sampler = lx_gltf_object_inside(animation, json_array_get(samplers, (size_t)index), what);
    LX_TRY(keep_track(reader, animation, animation_index, animation_end_s, &found, &sampler, error));
cleanup:
    return result;
}

lx_result lx_gltf_load_tracks(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_ANIMATION]; ++i) {
        lx_gltf_object animation;
        json_t *channels, *samplers;
        uint32_t count, sampler_count;
        LX_TRY(lx_gltf_element(reader, LX_GLTF_ANIMATION, i, &animation, error));
        LX_TRY(lx_gltf_get_array(&animation, "samplers", &samplers, &sampler_count, error));
        LX_TRY(lx_gltf_get_array(&animation, "channels", &channels, &count, error));
        const float end_s = animation_end(reader, samplers);
        for (uint32_t c = 0; c < count; ++c) {
            const lx_gltf_object channel = lx_gltf_object_inside(&animation, json_array_get(channels, c), "channel");
            LX_TRY(read_channel(reader, &animation, i, end_s, samplers, &channel, error));
        }
    }
cleanup:
    return result;
}
