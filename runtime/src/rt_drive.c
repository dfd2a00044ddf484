// Drivers: what gives each layer its colour at a time. A layer has one at most: the pack's animations, a program, or the caller's own light.
#include "rt_drive.h"

#include <math.h>

lxrt_program lxrt_stored_program(const unsigned char *animation)
{
    return (lxrt_program){
        .kind = (lxrt_program_kind)lxrt_load_u32(animation + 12),
        .color = {lxrt_load_f32(animation + 32), lxrt_load_f32(animation + 36), lxrt_load_f32(animation + 40)},
        .intensity = lxrt_load_f32(animation + 44),
        .period_s = lxrt_load_f32(animation + 48),
        .phase_s = lxrt_load_f32(animation + 52),
        .duty = lxrt_load_f32(animation + 56),
        .low = lxrt_load_f32(animation + 60),
        .high = lxrt_load_f32(animation + 64),
        .fade_s = lxrt_load_f32(animation + 68),
        .seed = lxrt_load_u32(animation + 72),
        .interpolation = (lxrt_interpolation)lxrt_load_u32(animation + 20),
        .loop = (int)lxrt_load_u32(animation + 76),
    };
}

lxrt_keys lxrt_stored_keys(const lxrt_pack *pack, const unsigned char *animation)
{
    const uint32_t first = lxrt_load_u32(animation + 24);
    return (lxrt_keys){
        .packed = first < pack->animation_keys.count ? lxrt_element(&pack->animation_keys, first) : NULL,
        .count = lxrt_load_u32(animation + 28),
        .width = lxrt_load_u32(animation + 16) == lxrt_channel_intensity ? 1 : 3,
        .cubic = lxrt_load_u32(animation + 12) == LXRT_PROGRAM_KEYS && lxrt_load_u32(animation + 20) == LXRT_CUBIC,
    };
}

void lxrt_begin_drivers(lxrt_pack *pack)
{
    for (uint32_t i = 0; i < pack->layer_count; ++i)
        pack->drivers[i] = (lxrt_driver){.kind = lxrt_driver_none, .first_animation = LXRT_NONE};
    for (uint32_t i = pack->animations.count; i-- > 0;) { // from behind, so that each layer's list runs forward
        lxrt_driver *driver = &pack->drivers[lxrt_load_u32(lxrt_element(&pack->animations, i) + 8)];
        pack->animation_states[i] = (lxrt_animation_state){.next = driver->first_animation, .playing = 1};
        driver->kind = lxrt_driver_animations;
        driver->first_animation = i;
    }
}

void lxrt_drive_layer(lxrt_pack *pack, uint32_t layer, const double rgb[3])
{
    const float scale = lxrt_load_f32(lxrt_element(&pack->layers, layer) + 24);
    const float limit = scale > 1 ? LXRT_MAX_FACTOR / scale : LXRT_MAX_FACTOR; // exact: the scale is a power of two
    float color[3];
    for (int i = 0; i < 3; ++i) color[i] = lxrt_clamp(rgb[i], limit);
    lxrt_set_layer(pack, layer, color, 1);
}

// c of a layer by the pack's animations that play; 0: none does.
static int run_animations(const lxrt_pack *pack, uint32_t layer, double time_s, double out[3])
{
    const unsigned char *authored = lxrt_element(&pack->layers, layer);
    double color[3], intensity = lxrt_load_f32(authored + 20);
    int any = 0, whole = 0; // whole: colour and intensity come from one animation, in color
    for (int i = 0; i < 3; ++i) color[i] = lxrt_load_f32(authored + 8 + 4 * i);
    for (uint32_t index = pack->drivers[layer].first_animation; index != LXRT_NONE; index = pack->animation_states[index].next) {
        if (!pack->animation_states[index].playing) continue;
        const unsigned char *data = lxrt_element(&pack->animations, index);
        const uint32_t channel = lxrt_load_u32(data + 16);
        const lxrt_program program = lxrt_stored_program(data);
        const lxrt_keys keys = lxrt_stored_keys(pack, data);
        if (whole) { // whatever this one does not say is the layer's again
            for (int i = 0; i < 3; ++i) color[i] = lxrt_load_f32(authored + 8 + 4 * i);
            intensity = lxrt_load_f32(authored + 20);
        }
        any = 1;
        whole = channel == lxrt_channel_whole;
        lxrt_run_program(&program, &keys, time_s, channel == lxrt_channel_intensity ? &intensity : color);
    }
    for (int i = 0; i < 3; ++i) out[i] = whole ? color[i] : color[i] * intensity;
    return any;
}

static void update_layer(lxrt_pack *pack, uint32_t layer, double time_s)
{
    const lxrt_driver *driver = &pack->drivers[layer];
    double rgb[3];
    if (driver->kind == lxrt_driver_animations) {
        if (run_animations(pack, layer, time_s, rgb)) lxrt_drive_layer(pack, layer, rgb);
    } else if (driver->kind == lxrt_driver_program) {
        const lxrt_keys keys = lxrt_program_keys(&driver->by.program);
        lxrt_run_program(&driver->by.program, &keys, time_s, rgb);
        lxrt_drive_layer(pack, layer, rgb);
    } else if (driver->kind == lxrt_driver_callback) {
        float read[3];
        memcpy(read, pack->colors[layer].color, sizeof read);
        driver->by.callback.read(driver->by.callback.user, layer, time_s, read);
        lxrt_set_layer(pack, layer, read, 1); // refuses what cannot be summed; the layer keeps its colour then
    }
}

uint32_t lxrt_update(lxrt_pack *pack, double time_s)
{
    uint32_t changed = 0;
    if (!pack || !isfinite(time_s)) return 0;
    for (uint32_t layer = 0; layer < pack->layer_count; ++layer) {
        const lxrt_color before = pack->colors[layer];
        const float *now = pack->colors[layer].color;
        update_layer(pack, layer, time_s);
        changed += now[0] != before.color[0] || now[1] != before.color[1] || now[2] != before.color[2];
    }
    return changed;
}

static lxrt_result set_driver(lxrt_pack *pack, uint32_t layer, lxrt_driver driver)
{
    driver.first_animation = pack->drivers[layer].first_animation;
    pack->drivers[layer] = driver;
    return LXRT_OK;
}

lxrt_result lxrt_set_program(lxrt_pack *pack, uint32_t layer, const lxrt_program *program)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    if (!program) return set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_none});
    float rgb[3];
    const lxrt_result result = lxrt_program_evaluate(program, 0, rgb); // checks all of it
    if (result != LXRT_OK) return result;
    return set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_program, .by.program = *program});
}

lxrt_result lxrt_set_callback(lxrt_pack *pack, uint32_t layer, lxrt_read_light read, void *user)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    if (!read) return set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_none});
    return set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_callback, .by.callback = {read, user}});
}

lxrt_result lxrt_reset_driver(lxrt_pack *pack, uint32_t layer)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    if (layer >= pack->layer_count) return LXRT_ERROR_NOT_FOUND;
    if (pack->drivers[layer].first_animation != LXRT_NONE) return set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_animations});
    set_driver(pack, layer, (lxrt_driver){.kind = lxrt_driver_none});
    lxrt_layer authored;
    lxrt_get_layer_info(pack, layer, &authored);
    return lxrt_set_layer(pack, layer, authored.color, authored.intensity);
}

lxrt_result lxrt_get_animation(const lxrt_pack *pack, uint32_t index, lxrt_animation *out)
{
    if (!pack || !out) return LXRT_ERROR_INVALID_ARGUMENT;
    if (index >= pack->animations.count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->animations, index);
    const lxrt_program program = lxrt_stored_program(data);
    const lxrt_keys keys = lxrt_stored_keys(pack, data);
    *out = (lxrt_animation){
        .name = lxrt_name(pack, data),
        .layer = lxrt_load_u32(data + 8),
        .kind = program.kind,
        .duration_s = program.kind == LXRT_PROGRAM_KEYS ? lxrt_last_key_time(&keys) : program.period_s,
        .playing = pack->animation_states[index].playing,
    };
    return LXRT_OK;
}

lxrt_result lxrt_play(lxrt_pack *pack, const char *name, int playing)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    lxrt_result result = name ? LXRT_ERROR_NOT_FOUND : LXRT_OK;
    for (uint32_t i = 0; i < pack->animations.count; ++i) {
        if (name && strcmp(lxrt_name(pack, lxrt_element(&pack->animations, i)), name) != 0) continue;
        pack->animation_states[i].playing = playing != 0;
        result = LXRT_OK;
    }
    return result;
}
