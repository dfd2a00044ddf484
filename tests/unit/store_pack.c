// The pack as written by store/, read back by the runtime: round trips, absent blocks, hostile data.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/memory.h"
#include "runtime_fixture.h"
#include "math/hash.h"
#include "store/pack.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { page_size = 72, page_count = 2, layer_count = 3, level_count = 3 }; // 72: blocks that stick out of the page

static uint32_t random_state = 1;
static float random_float(void)
{
    return lx_unit_float(random_state = lx_hash32(random_state + 1));
}

// T of all images, level k of (page, layer) at texels[page][layer][k].
static float texels[page_count][layer_count][level_count][3 * page_size * page_size];

static const char *const names[layer_count] = {"desk lamp", "neon", "sky"};
static const float brightness[layer_count] = {1e-7f, 3, 5e6f};

static void fill_texels(void)
{
    for (int page = 0; page < page_count; ++page)
        for (int layer = 0; layer < layer_count; ++layer)
            for (int level = 0; level < level_count; ++level)
                for (int i = 0; i < 3 * (page_size >> level) * (page_size >> level); ++i)
                    texels[page][layer][level][i] = brightness[layer] * powf(2, -12 * random_float());
}

static float layer_largest(int layer)
{
    float largest = 0;
    for (int page = 0; page < page_count; ++page)
        for (int i = 0; i < 3 * page_size * page_size; ++i) largest = fmaxf(largest, texels[page][layer][0][i]);
    return largest;
}

static void write_pack(lx_bytes *out, lx_pack_stats *stats)
{
    lx_error error = {0};
    lx_pack_layer layers[layer_count];
    for (int i = 0; i < layer_count; ++i)
        layers[i] = (lx_pack_layer){
            .name = names[i],
            .kind = i == 2 ? LX_SOURCE_SKY : LX_SOURCE_SPOT,
            .mode = i == 1 ? LX_MODE_MIXED : LX_MODE_BAKED,
            .color = {1, 0.5f, 0.25f},
            .intensity = (float)(i + 2),
            .scale = lx_pack_scale(layer_largest(i)),
            .threshold = 0,
        };
    const lx_pack_source sources[] = {
        {"desk lamp", LX_SOURCE_SPOT, 0, {1, 1, 1}, 4, -1},
        {"tube/glow", LX_SOURCE_EMISSIVE, 1, {1, 0.5f, 0}, 9, 3},
        {"sky", LX_SOURCE_SKY, 2, {1, 1, 1}, UINT32_MAX, -1},
    };
    const lx_pack_rect rects[] = {
        {.node = 7, .gpu_instance = 2, .page = 1, .texcoord = 1, .x = 4, .y = 8, .width = 16, .height = 12, .scale = {0.5f, 0.25f}},
        {.node = 7, .gpu_instance = 0, .page = 0, .texcoord = 1, .width = 72, .height = 72, .scale = {1, 1}},
        {.node = 3, .gpu_instance = -1, .page = 1, .texcoord = 2, .scale = {1, 1}, .offset = {0.125f, 0.75f}},
    };
    const float coverage[page_count] = {0.5f, 0.25f};
    const lx_pack_desc desc = {
        .page_size = page_size,
        .page_count = page_count,
        .level_count = level_count,
        .page_coverage = coverage,
        .layers = layers,
        .layer_count = layer_count,
        .sources = sources,
        .source_count = 3,
        .rects = rects,
        .rect_count = 3,
    };
    lx_pack_writer *writer = NULL;
    assert_int_equal(lx_pack_begin(&desc, &writer, &error), LX_OK);
    for (int layer = layer_count; layer-- > 0;) // any order will do
        for (int page = 0; page < page_count; ++page)
            for (int level = 0; level < level_count; ++level)
                assert_int_equal(
                    lx_pack_add_image(writer, (uint32_t)page, (uint32_t)layer, (uint32_t)level, texels[page][layer][level], &error),
                    LX_OK);
    assert_int_equal(lx_pack_finish(writer, out, stats, &error), LX_OK);
    lx_pack_destroy(writer);
}

static lxrt_pack *open_pack(const lx_bytes *bytes, void **memory)
{
    size_t needed = 0;
    lxrt_pack *pack = NULL;
    assert_int_equal(lxrt_memory_bytes(bytes->data, bytes->size, &needed), LXRT_OK);
    *memory = malloc(needed);
    assert_int_equal(lxrt_open(bytes->data, bytes->size, *memory, needed - 1, &pack), LXRT_ERROR_MEMORY_TOO_SMALL);
    assert_int_equal(lxrt_open(bytes->data, bytes->size, *memory, needed, &pack), LXRT_OK);
    return pack;
}

static void pack_tables_come_back(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    void *memory;
    fill_texels();
    write_pack(&bytes, NULL);
    lxrt_pack *pack = open_pack(&bytes, &memory);

    lxrt_info info;
    lxrt_get_info(pack, &info);
    assert_int_equal(info.page_size, page_size);
    assert_int_equal(info.page_count, page_count);
    assert_int_equal(info.layer_count, layer_count);
    assert_int_equal(info.level_count, level_count);
    assert_int_equal(info.rect_count, 3);
    assert_int_equal(info.source_count, 3);
    assert_float_equal(lxrt_page_coverage(pack, 1), 0.25f, 0);
    assert_float_equal(lxrt_page_coverage(pack, 2), 0, 0);

    lxrt_layer layer;
    assert_int_equal(lxrt_get_layer_info(pack, 1, &layer), LXRT_OK);
    assert_string_equal(layer.name, "neon");
    assert_int_equal(layer.kind, LXRT_KIND_SPOT);
    assert_int_equal(layer.mixed, 1);
    assert_float_equal(layer.intensity, 3, 0);
    assert_int_equal(lxrt_find_layer(pack, "sky"), 2);
    assert_int_equal(lxrt_find_layer(pack, "sk"), LXRT_NONE);
    float rgb[3];
    assert_int_equal(lxrt_get_layer(pack, 2, rgb), LXRT_OK);
    assert_float_equal(rgb[0], 4, 0);
    assert_float_equal(rgb[2], 1, 0);
    assert_int_equal(lxrt_get_layer_info(pack, 3, &layer), LXRT_ERROR_NOT_FOUND);

    lxrt_rect rect;
    assert_int_equal(lxrt_find_rect(pack, 7, 2, &rect), LXRT_OK);
    assert_int_equal(rect.page, 1);
    assert_int_equal(rect.height, 12);
    assert_float_equal(rect.scale[1], 0.25f, 0);
    assert_int_equal(lxrt_find_rect(pack, 3, -1, &rect), LXRT_OK);
    assert_int_equal(rect.texcoord, 2);
    assert_float_equal(rect.offset[1], 0.75f, 0);
    assert_int_equal(lxrt_find_rect(pack, 7, 1, &rect), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_find_rect(pack, 7, -1, &rect), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_find_rect(pack, 8, 0, &rect), LXRT_ERROR_NOT_FOUND);

    lxrt_source source;
    assert_int_equal(lxrt_get_source(pack, 1, &source), LXRT_OK);
    assert_string_equal(source.name, "tube/glow");
    assert_int_equal(source.layer, 1);
    assert_int_equal(source.material, 3);
    assert_float_equal(source.weight[1], 0.5f, 0);
    assert_int_equal(lxrt_get_source(pack, 3, &source), LXRT_ERROR_NOT_FOUND);
    free(memory);
    lx_bytes_release(&bytes);
}

static void pack_round_trip_stays_within_rgb9e5_error(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    void *memory;
    lx_pack_stats stats;
    fill_texels();
    write_pack(&bytes, &stats);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    assert_true(stats.largest_error <= 1.0f / 512);
    assert_true(stats.largest_error > 1.0f / 1024);
    float worst = 0;
    for (uint32_t only = 0; only < layer_count; ++only) {
        for (uint32_t layer = 0; layer < layer_count; ++layer) {
            const float white = layer == only;
            assert_int_equal(lxrt_set_layer(pack, layer, (const float[3]){white, white, white}, 1), LXRT_OK);
        }
        for (uint32_t page = 0; page < page_count; ++page) {
            for (uint32_t level = 0; level < level_count; ++level) {
                static float rgb[3 * page_size * page_size];
                const uint32_t size = page_size >> level;
                assert_int_equal(compose(pack, page, level, 0, 0, size, size, rgb, 0), LXRT_OK);
                for (uint32_t i = 0; i < 3 * size * size; i += 3) {
                    const float *want = &texels[page][only][level][i];
                    const float largest = fmaxf(want[0], fmaxf(want[1], want[2]));
                    for (int k = 0; k < 3; ++k) worst = fmaxf(worst, fabsf(rgb[i + k] - want[k]) / largest);
                }
            }
        }
    }
    print_message("largest error %.6f, as reported %.6f (bound %.6f)\n", worst, stats.largest_error, 1.0 / 512);
    assert_true(worst <= stats.largest_error * 1.0001f);
    free(memory);
    lx_bytes_release(&bytes);
}

static void compose_equals_the_sum_of_layers_in_any_rectangle(void **state)
{
    (void)state;
    static float whole[3 * page_size * page_size], parts[layer_count][3 * page_size * page_size], rectangle[3 * page_size * page_size];
    lx_bytes bytes = {0};
    void *memory;
    fill_texels();
    write_pack(&bytes, NULL);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    const float colors[layer_count][3] = {{1e6f, 2e6f, 3e5f}, {0.5f, 0, 8}, {1e-6f, 1e-5f, 0}};
    for (uint32_t layer = 0; layer < layer_count; ++layer) {
        for (uint32_t other = 0; other < layer_count; ++other)
            lxrt_set_layer(pack, other, other == layer ? colors[layer] : (const float[3]){0, 0, 0}, 1);
        assert_int_equal(compose(pack, 1, 0, 0, 0, page_size, page_size, parts[layer], 0), LXRT_OK);
    }
    for (uint32_t layer = 0; layer < layer_count; ++layer) lxrt_set_layer(pack, layer, colors[layer], 1);
    assert_int_equal(compose(pack, 1, 0, 0, 0, page_size, page_size, whole, 0), LXRT_OK);
    for (int i = 0; i < 3 * page_size * page_size; ++i) {
        float sum = 0;
        for (int layer = 0; layer < layer_count; ++layer) sum += parts[layer][i];
        assert_memory_equal(&whole[i], &sum, sizeof sum); // same order, same bits
    }
    for (int round = 0; round < 200; ++round) {
        const uint32_t x = (uint32_t)(random_float() * page_size), y = (uint32_t)(random_float() * page_size);
        const uint32_t width = (uint32_t)(random_float() * (float)(page_size + 1 - x));
        const uint32_t height = (uint32_t)(random_float() * (float)(page_size + 1 - y));
        const size_t stride = 3 * (size_t)width + 5;
        if (stride * height > sizeof rectangle / sizeof *rectangle) continue;
        for (size_t i = 0; i < sizeof rectangle / sizeof *rectangle; ++i) rectangle[i] = -1;
        assert_int_equal(compose(pack, 1, 0, x, y, width, height, rectangle, stride), LXRT_OK);
        for (uint32_t row = 0; row < height; ++row) {
            assert_memory_equal(rectangle + row * stride, whole + 3 * ((y + row) * page_size + x), 3 * width * sizeof(float));
            assert_float_equal(rectangle[row * stride + 3 * width], -1, 0);
        }
    }
    assert_int_equal(compose(pack, 1, 0, 1, 0, page_size, 1, whole, 0), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(compose(pack, 1, 0, 2, 2, UINT32_MAX, 1, whole, 0), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(compose(pack, 2, 0, 0, 0, 1, 1, whole, 0), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(compose(pack, 1, 3, 0, 0, 1, 1, whole, 0), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(compose(pack, 1, 0, 0, 0, 2, 2, whole, 5), LXRT_ERROR_INVALID_ARGUMENT);
    free(memory);
    lx_bytes_release(&bytes);
}

static void lightmap_sample_is_bilinear_and_clamped(void **state)
{
    (void)state;
    static float whole[3 * page_size * page_size];
    lx_bytes bytes = {0};
    void *memory;
    fill_texels();
    write_pack(&bytes, NULL);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    assert_int_equal(compose(pack, 0, 0, 0, 0, page_size, page_size, whole, 0), LXRT_OK);
    float rgb[3];
    for (int round = 0; round < 500; ++round) {
        const float u = random_float() * 1.2f - 0.1f, v = random_float() * 1.2f - 0.1f;
        assert_int_equal(lxrt_lightmap_sample(pack, 0, u, v, LXRT_FILTER_BILINEAR, rgb), LXRT_OK);
        const double fx = fmin(fmax((double)u * page_size - 0.5, 0), page_size - 1);
        const double fy = fmin(fmax((double)v * page_size - 0.5, 0), page_size - 1);
        const int x = (int)fx, y = (int)fy, x1 = x + 1 < page_size ? x + 1 : x, y1 = y + 1 < page_size ? y + 1 : y;
        for (int k = 0; k < 3; ++k) {
            const double a = whole[3 * (y * page_size + x) + k], b = whole[3 * (y * page_size + x1) + k];
            const double c = whole[3 * (y1 * page_size + x) + k], d = whole[3 * (y1 * page_size + x1) + k];
            const double want = (a + (b - a) * (fx - x)) * (1 - fy + y) + (c + (d - c) * (fx - x)) * (fy - y);
            assert_true(fabs(rgb[k] - want) <= 1e-4 * (a + b + c + d));
        }
    }
    assert_int_equal(lxrt_lightmap_sample(pack, 0, NAN, INFINITY, LXRT_FILTER_BILINEAR, rgb), LXRT_OK);
    assert_int_equal(lxrt_lightmap_sample(pack, page_count, 0, 0, LXRT_FILTER_BILINEAR, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    free(memory);
    lx_bytes_release(&bytes);
}

static void set_layer_refuses_numbers_that_cannot_be_summed(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    void *memory;
    fill_texels();
    write_pack(&bytes, NULL);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    float rgb[3];
    assert_int_equal(lxrt_set_layer(pack, 0, (const float[3]){1, 2, 3}, 1), LXRT_OK);
    assert_int_equal(lxrt_set_layer(pack, 0, (const float[3]){NAN, 0, 0}, 1), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_set_layer(pack, 0, (const float[3]){0, INFINITY, 0}, 1), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_set_layer(pack, 0, (const float[3]){0, 0, -3e38f}, 1), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_set_layer(pack, layer_count, (const float[3]){0, 0, 0}, 1), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_get_layer(pack, 0, rgb), LXRT_OK);
    assert_float_equal(rgb[1], 2, 0);
    free(memory);
    lx_bytes_release(&bytes);
}

static void write_single_layer(const float *rgb, uint32_t size, float threshold, lx_bytes *out, lx_pack_stats *stats)
{
    const lx_pack_layer layer = {.name = "a", .color = {1, 1, 1}, .intensity = 1, .scale = 1, .threshold = threshold};
    const lx_pack_desc desc = {.page_size = size, .page_count = 1, .level_count = 1, .layers = &layer, .layer_count = 1};
    lx_pack_writer *writer = NULL;
    assert_int_equal(lx_pack_begin(&desc, &writer, NULL), LX_OK);
    assert_int_equal(lx_pack_add_image(writer, 0, 0, 0, rgb, NULL), LX_OK);
    assert_int_equal(lx_pack_finish(writer, out, stats, NULL), LX_OK);
    lx_pack_destroy(writer);
}

static void pack_leaves_out_blocks_below_the_threshold(void **state)
{
    (void)state;
    static float rgb[3 * 128 * 128], back[3 * 128 * 128];
    lx_pack_stats stats;
    lx_bytes bytes = {0};
    void *memory;
    memset(rgb, 0, sizeof rgb);
    for (int i = 0; i < 3 * 128 * 128; ++i) rgb[i] = 0.0099f;
    rgb[3 * (40 * 128 + 70) + 1] = 0.01f; // in block (2, 1), just enough
    write_single_layer(rgb, 128, 0.01f, &bytes, &stats);
    assert_int_equal(stats.block_count, 1);
    assert_int_equal(stats.absent_count, 15);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    assert_int_equal(compose(pack, 0, 0, 0, 0, 128, 128, back, 0), LXRT_OK);
    for (int y = 0; y < 128; ++y) {
        for (int x = 0; x < 128; ++x) {
            const bool there = x / 32 == 2 && y / 32 == 1;
            assert_float_equal(back[3 * (y * 128 + x)], there ? 0.0099f : 0, 0.0001);
        }
    }
    free(memory);
    lx_bytes_release(&bytes);

    memset(rgb, 0, sizeof rgb);
    rgb[5] = NAN;
    rgb[6] = -4;
    write_single_layer(rgb, 128, 0, &bytes, &stats);
    assert_int_equal(stats.block_count, 0);
    lx_bytes_release(&bytes);
}

static void pack_without_pages_or_layers_opens(void **state)
{
    (void)state;
    const lx_pack_desc desc = {.page_size = 64, .level_count = 1};
    lx_pack_writer *writer = NULL;
    lx_bytes bytes = {0};
    void *memory;
    assert_int_equal(lx_pack_begin(&desc, &writer, NULL), LX_OK);
    assert_int_equal(lx_pack_finish(writer, &bytes, NULL, NULL), LX_OK);
    assert_int_equal(lx_pack_finish(writer, &bytes, NULL, NULL), LX_ERROR_INVALID_ARGUMENT);
    lx_pack_destroy(writer);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    assert_int_equal(lxrt_find_layer(pack, ""), LXRT_NONE);
    free(memory);
    lx_bytes_release(&bytes);
}

static const float cubic_intensities[] = {0, 1, 2, 3, 4, 5, 6, 7}, color_keys[] = {0.5f, 1, 0, 0, 2, 0, 1, 0, 2.5f, 0, 0, 1};

static lxrt_program keyed(lxrt_program_kind kind, const float *keys, uint32_t count, lxrt_interpolation interpolation)
{
    lxrt_program program = lxrt_program_default();
    program.kind = kind;
    program.keys = keys;
    program.key_count = count;
    program.interpolation = interpolation;
    return program;
}

static lx_result begin_driven(const lx_pack_monitor *monitors, uint32_t monitor_count, const lx_pack_animation *animations,
                              uint32_t animation_count, lx_bytes *out, lx_error *error)
{
    const lx_pack_layer layers[] = {{.name = "tv", .color = {1, 1, 1}, .intensity = 1, .scale = 1},
                                    {.name = "tv", .color = {1, 1, 1}, .intensity = 1, .scale = 1},
                                    {.name = "lamp", .color = {1, 0.5f, 0}, .intensity = 8, .scale = 1}};
    const lx_pack_desc desc = {.page_size = 32, .level_count = 1, .layers = layers, .layer_count = 3, .monitors = monitors,
                               .monitor_count = monitor_count, .animations = animations, .animation_count = animation_count};
    lx_pack_writer *writer = NULL;
    lx_result result = lx_pack_begin(&desc, &writer, error);
    if (result == LX_OK) result = lx_pack_finish(writer, out, NULL, error);
    lx_pack_destroy(writer);
    return result;
}

static void pack_monitors_and_animations_come_back(void **state)
{
    (void)state;
    const lx_pack_monitor monitors[] = {{"screen", 11, 4, 2, 1, 0, {100, 200, 300}}, {"screen two", 12, -1, 1, 2, 0, {0, 0, 0}}};
    lx_pack_animation animations[] = {
        {"dusk", 2, LX_PACK_CHANNEL_COLOR, keyed(LXRT_PROGRAM_KEYS, color_keys, 3, LXRT_STEP)},
        {"dusk", 2, LX_PACK_CHANNEL_INTENSITY, keyed(LXRT_PROGRAM_KEYS, cubic_intensities, 2, LXRT_CUBIC)},
        {"", 0, LX_PACK_CHANNEL_WHOLE, lxrt_program_default()},
        {"", 1, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_SCHEDULE, color_keys, 3, LXRT_LINEAR)},
    };
    lxrt_program *pulse = &animations[2].program;
    *pulse = (lxrt_program){LXRT_PROGRAM_PULSE, {0.5f, 1, 0.25f}, 3, 2, 0.25f, 0.75f, 0.125f, 2, 1.5f, 99, NULL, 0, LXRT_LINEAR, 0};
    animations[3].program.period_s = 5;
    lx_bytes bytes = {0};
    lx_error error = {0};
    void *memory;
    assert_int_equal(begin_driven(monitors, 2, animations, 4, &bytes, &error), LX_OK);
    lxrt_pack *pack = open_pack(&bytes, &memory);
    lxrt_info info;
    lxrt_monitor monitor;
    lxrt_animation animation;
    lxrt_get_info(pack, &info);
    assert_int_equal(info.monitor_count, 2);
    assert_int_equal(info.animation_count, 4);
    assert_int_equal(lxrt_get_monitor(pack, 0, &monitor), LXRT_OK);
    assert_string_equal(monitor.name, "screen");
    assert_int_equal(monitor.node, 11);
    assert_int_equal(monitor.material, 4);
    assert_int_equal(monitor.columns, 2);
    assert_int_equal(monitor.rows, 1);
    assert_float_equal(monitor.strength[1], 200, 0);
    assert_int_equal(lxrt_get_monitor(pack, 1, &monitor), LXRT_OK);
    assert_string_equal(monitor.name, "screen two");
    assert_int_equal(monitor.material, -1);
    assert_int_equal(lxrt_get_animation(pack, 1, &animation), LXRT_OK);
    assert_string_equal(animation.name, "dusk");
    assert_int_equal(animation.layer, 2);
    assert_float_equal(animation.duration_s, 4, 0);
    assert_int_equal(lxrt_get_animation(pack, 2, &animation), LXRT_OK);
    assert_string_equal(animation.name, "");
    assert_int_equal(animation.kind, LXRT_PROGRAM_PULSE);
    assert_float_equal(animation.duration_s, 2, 0);
    // The runtime's own programs, evaluated from the fields that were written: any field lost would show.
    for (double t = -3; t < 9; t += 0.31) {
        float want[3], got[3];
        lxrt_update(pack, t);
        assert_int_equal(lxrt_program_evaluate(pulse, t, want), LXRT_OK);
        assert_int_equal(lxrt_get_layer(pack, 0, got), LXRT_OK);
        assert_memory_equal(got, want, sizeof got);
        assert_int_equal(lxrt_program_evaluate(&animations[3].program, t, want), LXRT_OK);
        assert_int_equal(lxrt_get_layer(pack, 1, got), LXRT_OK);
        assert_memory_equal(got, want, sizeof got);
    }
    float rgb[3];
    lxrt_update(pack, 2); // green, times the spline half way from 2 (leaving with 3 per second) to 6 (arriving with 5 per second)
    assert_int_equal(lxrt_get_layer(pack, 2, rgb), LXRT_OK);
    assert_float_equal(rgb[0], 0, 0);
    assert_float_equal(rgb[1], 0.5f * 2 + 0.125f * 4 * 3 + 0.5f * 6 - 0.125f * 4 * 5, 0);
    free(memory);
    lx_bytes_release(&bytes);
}

static void pack_refuses_monitors_and_animations_that_make_no_sense(void **state)
{
    (void)state;
    static const float backward[] = {2, 0, 0, 0, 1, 0, 0, 0}, not_finite[] = {0, 0, INFINITY, 0};
    lx_bytes bytes = {0};
    lx_error error = {0};
    const lx_pack_monitor monitors[] = {{"tv", 0, -1, 0, 1, 0, {1, 1, 1}},  {"tv", 0, -1, 1, 4097, 0, {1, 1, 1}},
                                        {"tv", 0, -1, 2, 2, 0, {1, 1, 1}},  {"tv", 0, -1, 1, 1, UINT32_MAX, {1, 1, 1}},
                                        {"tv", 0, -1, 1, 1, 0, {1, NAN, 1}}, {"tv", 0, -1, 1, 1, 0, {-1, 0, 0}}};
    for (size_t i = 0; i < sizeof monitors / sizeof *monitors; ++i) {
        assert_int_not_equal(begin_driven(&monitors[i], 1, NULL, 0, &bytes, &error), LX_OK);
        assert_non_null(strstr(error.message, "monitor tv"));
    }
    struct {
        lx_pack_animation animation;
        const char *says;
    } cases[] = {
        {{"a", 3, LX_PACK_CHANNEL_WHOLE, lxrt_program_default()}, "no layer 3"},
        {{"a", 2, (lx_pack_channel)3, lxrt_program_default()}, "no such channel"},
        {{"a", 2, LX_PACK_CHANNEL_COLOR, lxrt_program_default()}, "only keys drive"},
        {{"a", 2, LX_PACK_CHANNEL_INTENSITY, keyed(LXRT_PROGRAM_SCHEDULE, color_keys, 1, LXRT_LINEAR)}, "only keys drive"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_SCHEDULE, color_keys, 1, LXRT_CUBIC)}, "only keys are cubic"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_KEYS, color_keys, 0, LXRT_LINEAR)}, "no keys"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_KEYS, NULL, 1, LXRT_LINEAR)}, "no keys"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_KEYS, backward, 2, LXRT_LINEAR)}, "order of their times"},
        {{"a", 2, LX_PACK_CHANNEL_INTENSITY, keyed(LXRT_PROGRAM_KEYS, backward, 3, LXRT_LINEAR)}, "order of their times"},
        {{"a", 2, LX_PACK_CHANNEL_COLOR, keyed(LXRT_PROGRAM_KEYS, not_finite, 1, LXRT_STEP)}, "not finite"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed((lxrt_program_kind)9, color_keys, 1, LXRT_STEP)}, "out of range"},
        {{"a", 2, LX_PACK_CHANNEL_WHOLE, keyed(LXRT_PROGRAM_SCHEDULE, color_keys, 3, LXRT_LINEAR)}, "out of range"}, // 1 s
        {{"a", 2, LX_PACK_CHANNEL_INTENSITY, keyed(LXRT_PROGRAM_KEYS, cubic_intensities, 1, LXRT_CUBIC)}, "out of range"},
    };
    cases[12].animation.program.period_s = 0;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        assert_int_not_equal(begin_driven(NULL, 0, &cases[i].animation, 1, &bytes, &error), LX_OK);
        if (!strstr(error.message, cases[i].says)) fail_msg("case %zu: '%s' does not say '%s'", i, error.message, cases[i].says);
    }
    assert_null(bytes.data);
}

static void pack_scale_keeps_every_brightness_in_range(void **state)
{
    (void)state;
    for (int exponent = -80; exponent <= 80; ++exponent) {
        for (float m = 1; m < 2; m += 0.1f) {
            const float largest = ldexpf(m, exponent), stored = largest / lx_pack_scale(largest);
            assert_true(stored >= 0x1p14f && stored < 0x1p15f);
        }
    }
    assert_float_equal(lx_pack_scale(0), 1, 0);
    assert_float_equal(lx_pack_scale(NAN), 1, 0);
    assert_int_equal(lx_pack_level_count(1024, 4), 3);
    assert_int_equal(lx_pack_level_count(1024, 7), 3);
    assert_int_equal(lx_pack_level_count(1024, 8), 4);
    assert_int_equal(lx_pack_level_count(1024, 1), 1);
    assert_int_equal(lx_pack_level_count(16, 32), 5);
}

// Uses everything an opened pack offers; under the sanitizers this is the test that it stays within its data.
static void use_everything(lxrt_pack *pack)
{
    lxrt_info info;
    lxrt_layer layer;
    lxrt_rect rect;
    lxrt_source source;
    size_t length = 0;
    lxrt_get_info(pack, &info);
    for (uint32_t i = 0; i < info.layer_count && i < 64; ++i) {
        assert_int_equal(lxrt_get_layer_info(pack, i, &layer), LXRT_OK);
        length += strlen(layer.name);
    }
    for (uint32_t i = 0; i < info.source_count && i < 64; ++i) {
        assert_int_equal(lxrt_get_source(pack, i, &source), LXRT_OK);
        length += strlen(source.name);
    }
    for (uint32_t i = 0; i < info.rect_count && i < 64; ++i) {
        assert_int_equal(lxrt_get_rect(pack, i, &rect), LXRT_OK);
        assert_int_equal(lxrt_find_rect(pack, rect.node, rect.gpu_instance, &rect), LXRT_OK);
    }
    (void)length;
    for (uint32_t page = 0; page < info.page_count && page < 4; ++page) {
        for (uint32_t level = 0; level < info.level_count; ++level) {
            const uint32_t size = info.page_size >> level;
            float *rgb = malloc(3 * (size_t)size * sizeof *rgb);
            assert_int_equal(compose(pack, page, level, 0, size - 1, size, 1, rgb, 0), LXRT_OK);
            assert_int_equal(compose(pack, page, level, size / 2, 0, 1, size, rgb, 0), LXRT_OK);
            for (uint32_t i = 0; i < size; ++i) assert_true(isfinite(rgb[3 * i]) && isfinite(rgb[3 * i + 1]));
            free(rgb);
        }
        float rgb[3];
        assert_int_equal(lxrt_lightmap_sample(pack, page, 0.4f, 0.9f, LXRT_FILTER_BILINEAR, rgb), LXRT_OK);
    }
}

static lxrt_result try_data(const uint8_t *data, size_t size)
{
    size_t needed = 0;
    lxrt_result result = lxrt_memory_bytes(data, size, &needed);
    if (result != LXRT_OK) return result;
    void *memory = malloc(needed);
    lxrt_pack *pack = NULL;
    result = lxrt_open(data, size, memory, needed, &pack);
    assert_int_equal(result, LXRT_OK);
    use_everything(pack);
    free(memory);
    return result;
}

// A copy of exactly `size` bytes, so that the address sanitizer sees the first byte read beyond.
static uint8_t *exact_copy(const uint8_t *data, size_t size)
{
    uint8_t *copy = malloc(size ? size : 1);
    memcpy(copy, data, size);
    return copy;
}

static lxrt_result try_copy(const uint8_t *data, size_t size)
{
    uint8_t *copy = exact_copy(data, size);
    const lxrt_result result = try_data(copy, size);
    free(copy);
    return result;
}

static void pack_cut_anywhere_is_refused(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    fill_texels();
    write_pack(&bytes, NULL);
    assert_int_equal(try_data(bytes.data, bytes.size), LXRT_OK);
    for (size_t size = 0; size < bytes.size; size += size < 5000 ? 1 : 997) {
        const lxrt_result result = try_copy(bytes.data, size);
        assert_int_equal(result, size == 0 ? LXRT_ERROR_NOT_A_PACK : LXRT_ERROR_TRUNCATED);
    }
    lx_bytes_release(&bytes);
}

// The header claims the size of the cut file, so that the tables' own checks are what refuses it.
static void pack_cut_with_a_matching_header_is_refused(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    fill_texels();
    write_pack(&bytes, NULL);
    for (size_t size = 64; size < bytes.size; size += size < 5000 ? 1 : 997) {
        for (int i = 0; i < 8; ++i) bytes.data[16 + i] = (uint8_t)((uint64_t)size >> (8 * i));
        assert_int_equal(try_copy(bytes.data, size), LXRT_ERROR_CORRUPT);
    }
    lx_bytes_release(&bytes);
}

static void pack_with_random_corruption_never_crashes(void **state)
{
    (void)state;
    static const uint32_t nasty[] = {0, 1, 2, 31, 32, 0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff, 0x10000, 0x7f800000, 0x7fc00000};
    lx_bytes bytes = {0};
    uint32_t opened = 0, refused = 0;
    fill_texels();
    write_pack(&bytes, NULL);
    uint8_t *data = exact_copy(bytes.data, bytes.size);
    for (int round = 0; round < 20000; ++round) {
        uint8_t saved[4][4];
        size_t places[4];
        const int changes = 1 + round % 4;
        for (int i = 0; i < changes; ++i) {
            random_state = lx_hash32(random_state + 1);
            places[i] = random_state % (round & 1 ? 1024 : 3000) / 4 * 4; // header, directory, tables; at last the block index
            memcpy(saved[i], data + places[i], 4);
            random_state = lx_hash32(random_state + 1);
            if (random_state & 1) {
                const uint32_t value = nasty[(random_state >> 8) % (sizeof nasty / sizeof *nasty)];
                memcpy(data + places[i], &value, 4);
            } else {
                data[places[i] + (random_state >> 1) % 4] ^= (uint8_t)(1 << (random_state >> 4) % 8);
            }
        }
        if (try_data(data, bytes.size) == LXRT_OK)
            ++opened;
        else
            ++refused;
        for (int i = changes; i-- > 0;) memcpy(data + places[i], saved[i], 4);
    }
    print_message("%u opened, %u refused\n", opened, refused);
    assert_true(opened > 100 && refused > 100);
    assert_int_equal(try_data(data, bytes.size), LXRT_OK);
    free(data);
    lx_bytes_release(&bytes);
}

static void pack_of_another_version_is_told_apart(void **state)
{
    (void)state;
    lx_bytes bytes = {0};
    fill_texels();
    write_pack(&bytes, NULL);
    bytes.data[8] = 2;
    assert_int_equal(try_data(bytes.data, bytes.size), LXRT_ERROR_VERSION);
    bytes.data[8] = 1;
    bytes.data[0] = 'L';
    assert_int_equal(try_data(bytes.data, bytes.size), LXRT_ERROR_NOT_A_PACK);
    bytes.data[0] = 'l';
    bytes.data[64 + 4] = 9; // version of the first section
    assert_int_equal(try_data(bytes.data, bytes.size), LXRT_ERROR_VERSION);
    for (int result = LXRT_OK; result <= LXRT_ERROR_NOT_FOUND + 1; ++result)
        assert_true(strlen(lxrt_result_name((lxrt_result)result)) > 0);
    lx_bytes_release(&bytes);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(pack_tables_come_back),
        cmocka_unit_test(pack_round_trip_stays_within_rgb9e5_error),
        cmocka_unit_test(compose_equals_the_sum_of_layers_in_any_rectangle),
        cmocka_unit_test(lightmap_sample_is_bilinear_and_clamped),
        cmocka_unit_test(set_layer_refuses_numbers_that_cannot_be_summed),
        cmocka_unit_test(pack_leaves_out_blocks_below_the_threshold),
        cmocka_unit_test(pack_without_pages_or_layers_opens),
        cmocka_unit_test(pack_monitors_and_animations_come_back),
        cmocka_unit_test(pack_refuses_monitors_and_animations_that_make_no_sense),
        cmocka_unit_test(pack_scale_keeps_every_brightness_in_range),
        cmocka_unit_test(pack_cut_anywhere_is_refused),
        cmocka_unit_test(pack_cut_with_a_matching_header_is_refused),
        cmocka_unit_test(pack_with_random_corruption_never_crashes),
        cmocka_unit_test(pack_of_another_version_is_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
