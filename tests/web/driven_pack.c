// For drivers.test.mjs: writes a pack with every program and two monitors, a picture, and what the native runtime makes of them.
//
//     driven_pack FOLDER     drivers.pack, frame.rgba, frame.float, colors.bin
//
// colors.bin: all layers' colours, three floats each, after every step that drivers.test.mjs takes in the same order.
#include "base/file.h"
#include "store/pack.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { columns = 7, rows = 5, cells = columns * rows, layer_count = cells + 16, width = 101, height = 67, step_count = 400 };

static const float color_keys[] = {0, 1, 0, 0.3f, 0.7f, 0.2f, 1, 0, 2.9f, 0, 0.1f, 1.7f};
static const float cubic_keys[] = {0.1f, 0, 0, 0, 1, 2, 3, 0.3f, -2, 1, 1.3f, 1, -1, 3, 0.1f, 0.2f, 0.3f, 0, 2, 0};
static const float intensity_keys[] = {0, 1, 0.9f, 7, 1.7f, 3};

static lxrt_program program_of(uint32_t number)
{
    lxrt_program p = lxrt_program_default();
    p.kind = (lxrt_program_kind)(number % 7);
    p.period_s = 0.1f + 0.37f * (float)number;
    p.phase_s = 0.05f * (float)number;
    p.color[1] = 0.3f;
    p.color[2] = 0.07f * (float)number;
    p.intensity = 1 + 13.7f * (float)number;
    p.duty = 0.3f;
    p.low = 0.1f;
    p.seed = number;
    if (p.kind == LXRT_PROGRAM_KEYS && number > 7) {
        p.interpolation = LXRT_CUBIC;
        p.keys = cubic_keys;
        p.key_count = 2;
    } else if (p.kind == LXRT_PROGRAM_KEYS || p.kind == LXRT_PROGRAM_SCHEDULE) {
        p.period_s = 3;
        p.fade_s = 0.31f;
        p.keys = color_keys;
        p.key_count = 3;
    }
    return p;
}

static lx_result write_pack(lx_bytes *out, lx_error *error)
{
    lx_pack_layer layers[layer_count];
    lx_pack_animation animations[16];
    for (uint32_t i = 0; i < layer_count; ++i)
        layers[i] = (lx_pack_layer){.name = i < cells ? "cell" : "lamp", .color = {1, 0.7f, 0.2f}, .intensity = 3, .scale = 1};
    for (uint32_t i = 0; i < 14; ++i) animations[i] = (lx_pack_animation){"", cells + i, LX_PACK_CHANNEL_WHOLE, program_of(i)};
    animations[14] = (lx_pack_animation){"mood", cells + 14, LX_PACK_CHANNEL_COLOR, program_of(1)};
    animations[15] = (lx_pack_animation){"mood", cells + 14, LX_PACK_CHANNEL_INTENSITY, program_of(1)};
    animations[15].program.keys = intensity_keys;
    const lx_pack_monitor monitors[] = {{"tv", 1, 2, columns, rows, 0, {120, 90.5f, 77.7f}}, {"radio", 2, -1, 1, 1, cells + 15, {1, 1, 1}}};
    const lx_pack_desc desc = {.page_size = 32, .level_count = 1, .layers = layers, .layer_count = layer_count, .monitors = monitors,
                               .monitor_count = 2, .animations = animations, .animation_count = 16};
    lx_pack_writer *writer = NULL;
    lx_result result = lx_pack_begin(&desc, &writer, error);
    if (result == LX_OK) result = lx_pack_finish(writer, out, NULL, error);
    lx_pack_destroy(writer);
    return result;
}

static int write_bytes(const char *folder, const char *name, const void *data, size_t size)
{
    char path[4096];
    snprintf(path, sizeof path, "%s/%s", folder, name);
    FILE *file = fopen(path, "wb");
    const int fine = file && fwrite(data, 1, size, file) == size;
    return file && fclose(file) == 0 && fine;
}

int main(int argc, char **argv)
{
    static uint8_t frame[width * height * 4];
    static float floats[width * height * 4], colors[step_count + 4][layer_count][3];
    lx_bytes bytes = {0};
    lx_error error = {0};
    size_t needed = 0;
    lxrt_pack *pack = NULL;
    if (argc != 2) return 2;
    if (write_pack(&bytes, &error) != LX_OK || lxrt_memory_bytes(bytes.data, bytes.size, &needed) != LXRT_OK) return 1;
    void *memory = malloc(needed);
    if (lxrt_open(bytes.data, bytes.size, memory, needed, &pack) != LXRT_OK) return 1;
    uint32_t noise = 1;
    for (size_t i = 0; i < sizeof frame; ++i) {
        frame[i] = (uint8_t)((noise = noise * 1664525 + 1013904223) >> 24);
        floats[i] = (float)(noise >> 8) * 0x1p-20f - 2;
    }
    for (uint32_t step = 0; step < step_count + 4; ++step) {
        lxrt_result result = LXRT_OK;
        if (step < step_count)
            lxrt_update(pack, step * 0.171 - 20);
        else if (step == step_count)
            result = lxrt_monitor_update(pack, 0, frame, width, height, 0, LXRT_PIXELS_RGBA8_SRGB);
        else if (step == step_count + 1)
            result = lxrt_monitor_update(pack, 0, frame, width, height, 0, LXRT_PIXELS_RGB8_SRGB);
        else if (step == step_count + 2)
            result = lxrt_monitor_update(pack, 1, floats, width, height, 0, LXRT_PIXELS_RGBA32F);
        else
            result = lxrt_monitor_configure(pack, 0, NULL, 0.7f) == LXRT_OK
                         ? lxrt_monitor_update(pack, 0, floats, width, height, 0, LXRT_PIXELS_RGBA32F)
                         : LXRT_ERROR_INVALID_ARGUMENT;
        if (result != LXRT_OK) return 1;
        for (uint32_t layer = 0; layer < layer_count; ++layer) lxrt_get_layer(pack, layer, colors[step][layer]);
    }
    const int fine = write_bytes(argv[1], "drivers.pack", bytes.data, bytes.size) && write_bytes(argv[1], "frame.rgba", frame, sizeof frame) &&
                     write_bytes(argv[1], "frame.float", floats, sizeof floats) && write_bytes(argv[1], "colors.bin", colors, sizeof colors);
    free(memory);
    lx_bytes_release(&bytes);
    return fine ? 0 : 1;
}
