// Milliseconds to show a 1920×1080 frame on a monitor of 16×9 cells, on one thread, and over a plain read of the same frames in the same run.
// Sixteen frames in turn, 127 MiB, so that they come from memory as frames of a decoder do, not from this benchmark's cache.
#include "base/clock.h"
#include "base/error.h"
#include "luxel_rt.h"
#include "rt_pixels.h"
#include "store/pack.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { width = 1920, height = 1080, columns = 16, rows = 9, frame_count = 16, float_frames = 4, repeats = 5 };

static lx_result write_pack(lx_bytes *out, lx_error *error)
{
    static lx_pack_layer layers[columns * rows];
    lx_pack_writer *writer = NULL;
    for (int i = 0; i < columns * rows; ++i) layers[i] = (lx_pack_layer){.name = "cell", .color = {1, 1, 1}, .intensity = 1, .scale = 1};
    const lx_pack_monitor monitor = {.name = "tv", .columns = columns, .rows = rows, .strength = {100, 100, 100}};
    const lx_pack_desc desc = {.page_size = 32, .level_count = 1, .layers = layers, .layer_count = columns * rows, .monitors = &monitor,
                               .monitor_count = 1};
    lx_result result = lx_pack_begin(&desc, &writer, error);
    if (result == LX_OK) result = lx_pack_finish(writer, out, NULL, error);
    lx_pack_destroy(writer);
    return result;
}

// The fastest of all frames; each was last touched fifteen frames ago.
static double show_ms(lxrt_pack *pack, const unsigned char *frames, int count, size_t frame_bytes, lxrt_pixels format)
{
    double best = INFINITY;
    for (int run = 0; run < repeats; ++run) {
        for (int i = 0; i < count; ++i) {
            const double start = lx_seconds();
            if (lxrt_monitor_update(pack, 0, frames + (size_t)i * frame_bytes, width, height, 0, format) != LXRT_OK) abort();
            best = fmin(best, lx_seconds() - start);
        }
    }
    return 1e3 * best;
}

static uint64_t read_sum;

static double read_ms(const unsigned char *frames, int count, size_t frame_bytes)
{
    double best = INFINITY;
    for (int run = 0; run < repeats; ++run) {
        for (int i = 0; i < count; ++i) {
            const double start = lx_seconds();
            uint64_t sums[8] = {0};
            for (size_t at = i * frame_bytes; at < (i + 1) * frame_bytes; at += sizeof sums) {
                uint64_t words[8];
                memcpy(words, frames + at, sizeof words);
                for (int k = 0; k < 8; ++k) sums[k] += words[k];
            }
            best = fmin(best, lx_seconds() - start);
            for (int k = 0; k < 8; ++k) read_sum += sums[k];
        }
    }
    return 1e3 * best;
}

int main(void)
{
    const size_t frame_bytes = (size_t)width * height * 4;
    const char *best_name = "scalar";
    lx_bytes bytes = {0};
    lx_error error = {0};
    size_t needed = 0;
    lxrt_pack *pack = NULL;
    if (write_pack(&bytes, &error) != LX_OK || lxrt_memory_bytes(bytes.data, bytes.size, &needed) != LXRT_OK) return 1;
    void *memory = malloc(needed);
    unsigned char *frames = malloc(frame_count * frame_bytes);
    float *floats = malloc(float_frames * frame_bytes * sizeof *floats);
    if (!memory || !frames || !floats || lxrt_open(bytes.data, bytes.size, memory, needed, &pack) != LXRT_OK) return 1;
    uint32_t noise = 1;
    for (size_t i = 0; i < frame_count * frame_bytes; ++i) frames[i] = (unsigned char)((noise = noise * 1664525 + 1013904223) >> 24);
    for (size_t i = 0; i < float_frames * frame_bytes; ++i) floats[i] = frames[i] / 255.0f;
    for (uint32_t i = 0; lxrt_get_pixel_sum(i, NULL) != NULL; ++i) lxrt_get_pixel_sum(i, &best_name);

    const double read = read_ms(frames, frame_count, frame_bytes);
    const double rgba8 = show_ms(pack, frames, frame_count, frame_bytes, LXRT_PIXELS_RGBA8_SRGB);
    const double cached = show_ms(pack, frames, 1, frame_bytes, LXRT_PIXELS_RGBA8_SRGB);
    const double rgb8 = show_ms(pack, frames, frame_count, (size_t)width * height * 3, LXRT_PIXELS_RGB8_SRGB);
    const double rgba32f = show_ms(pack, (const unsigned char *)floats, float_frames, frame_bytes * sizeof *floats, LXRT_PIXELS_RGBA32F);
    printf("{\"kernel\": \"%s\", \"rgba8_ms\": %.3f, \"rgba8_in_cache_ms\": %.3f, \"rgb8_ms\": %.3f, \"rgba32f_ms\": %.3f, \"read_ms\": %.3f, "
           "\"ratio\": %.3f",
           best_name, rgba8, cached, rgb8, rgba32f, read, rgba8 / read);
    const char *name;
    lxrt_pixel_sum sum;
    for (uint32_t i = 0; (sum = lxrt_get_pixel_sum(i, &name)) != NULL; ++i) {
        lxrt_use_pixel_sum(pack, sum);
        printf(", \"%s_ms\": %.3f", name, show_ms(pack, frames, frame_count, frame_bytes, LXRT_PIXELS_RGBA8_SRGB));
    }
    printf("}\n");
    free(floats);
    free(frames);
    free(memory);
    lx_bytes_release(&bytes);
    return read_sum == 0; // always 0: the reads are not in vain
}
