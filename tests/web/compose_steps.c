// For compose.test.mjs: takes the steps that it reads from stdin on a pack of noise, with the native runtime.
//
//     compose_steps PACK OUT      writes the pack, and the bytes of every step one after the other
//
// A line is a step: its name and whole numbers; floats are given by their bits.
#include "luxel_rt.h"
#include "runtime_random_pack.h"

#include <stdio.h>

static float float_of(unsigned long bits)
{
    const uint32_t word = (uint32_t)bits;
    float value;
    memcpy(&value, &word, 4);
    return value;
}

// Composes a region, or the accumulator's bounds on a level, into a buffer of its own.
static int write_region(FILE *out, const lxrt_pack *pack, lxrt_accumulator *accumulator, const lxrt_region *region, lxrt_format format,
                        float scale)
{
    const size_t bytes = region->width * (size_t)region->height * lxrt_format_bytes(format);
    unsigned char *texels = calloc(bytes + 1, 1);
    const lxrt_target target = {texels, 0, format, scale};
    const lxrt_result result = accumulator ? lxrt_accumulator_update(accumulator, region, &target) : lxrt_compose(pack, region, &target);
    const int fine = result == LXRT_OK && fwrite(texels, 1, bytes, out) == bytes;
    free(texels);
    return fine;
}

int main(int argc, char **argv)
{
    static const random_pack desc = {.page_size = 100, .page_count = 2, .layer_count = 13, .level_count = 3, .density = 0.7f, .exponent_max = 31,
                                     .scale_spread = 9, .seed = 21};
    if (argc != 3) return 2;
    size_t size, needed = 0;
    unsigned char *data = random_pack_make(&desc, &size);
    FILE *file = fopen(argv[1], "wb"), *out = fopen(argv[2], "wb");
    if (!file || !out || fwrite(data, 1, size, file) != size || fclose(file) != 0) return 1;
    lxrt_pack *pack;
    lxrt_accumulator *accumulator;
    if (lxrt_memory_bytes(data, size, &needed) != LXRT_OK) return 1;
    void *memory = malloc(needed);
    if (lxrt_open(data, size, memory, needed, &pack) != LXRT_OK) return 1;
    const size_t accumulator_bytes = lxrt_accumulator_bytes(pack);
    void *accumulator_memory = malloc(accumulator_bytes);
    if (lxrt_accumulator_create(pack, 1, accumulator_memory, accumulator_bytes, &accumulator) != LXRT_OK) return 1;

    char line[256], name[16];
    while (fgets(line, sizeof line, stdin)) {
        unsigned long n[8] = {0};
        int fine = 1;
        if (sscanf(line, "%15s %lu %lu %lu %lu %lu %lu %lu %lu", name, &n[0], &n[1], &n[2], &n[3], &n[4], &n[5], &n[6], &n[7]) < 1) continue;
        if (strcmp(name, "layer") == 0) {
            fine = lxrt_set_layer(pack, (uint32_t)n[0], (const float[3]){float_of(n[1]), float_of(n[2]), float_of(n[3])}, 1) == LXRT_OK;
        } else if (strcmp(name, "compose") == 0) {
            const lxrt_region region = {(uint32_t)n[0], (uint32_t)n[1], (uint32_t)n[2], (uint32_t)n[3], (uint32_t)n[4], (uint32_t)n[5]};
            fine = write_region(out, pack, NULL, &region, (lxrt_format)n[6], float_of(n[7]));
        } else if (strcmp(name, "begin") == 0) {
            const uint32_t changed = lxrt_accumulator_begin(accumulator);
            fine = fwrite(&changed, 4, 1, out) == 1;
        } else if (strcmp(name, "update") == 0) {
            lxrt_region region;
            fine = lxrt_accumulator_bounds(accumulator, (uint32_t)n[0], &region) == LXRT_OK && fwrite(&region, sizeof region, 1, out) == 1 &&
                   write_region(out, pack, accumulator, &region, (lxrt_format)n[1], 1);
        } else if (strcmp(name, "sample") == 0) {
            float rgb[3];
            fine = lxrt_lightmap_sample(pack, (uint32_t)n[0], float_of(n[1]), float_of(n[2]), (lxrt_filter)n[3], rgb) == LXRT_OK &&
                   fwrite(rgb, sizeof rgb, 1, out) == 1;
        } else {
            fine = 0;
        }
        if (!fine) {
            fprintf(stderr, "compose_steps: %s", line);
            return 1;
        }
    }
    free(accumulator_memory);
    free(memory);
    free(data);
    return fclose(out) != 0;
}
