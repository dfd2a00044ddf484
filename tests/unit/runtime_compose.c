// The composer on packs of noise: against a double-precision sum that is read from the file as documented, and every kernel against
// the scalar one, byte by byte.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "../../runtime/src/rt_kernel.h"
#include "luxel_rt.h"
#include "runtime_random_pack.h"

#include <float.h>
#include <math.h>

typedef struct opened {
    unsigned char *data;
    void *memory;
    lxrt_pack *pack;
    random_pack desc;
} opened;

static opened open_noise(random_pack desc)
{
    opened o = {.desc = desc};
    size_t size, needed;
    o.data = random_pack_make(&desc, &size);
    assert_int_equal(lxrt_memory_bytes(o.data, size, &needed), LXRT_OK);
    o.memory = malloc(needed);
    assert_int_equal(lxrt_open(o.data, size, o.memory, needed, &o.pack), LXRT_OK);
    return o;
}

static void close_noise(opened *o)
{
    free(o->memory);
    free(o->data);
}

static uint32_t read_u32(const unsigned char *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8 | (uint32_t)p[2] << 16 | (uint32_t)p[3] << 24;
}

static const unsigned char *section(const unsigned char *data, const char *type)
{
    for (uint32_t i = 0;; ++i) {
        const unsigned char *entry = data + 64 + 32 * i;
        if (memcmp(entry, type, 4) == 0) return data + read_u32(entry + 8);
    }
}

// E of a texel as docs/pack-format.md has it, in double, and the sum of absolute values.
static void reference_texel(const opened *o, uint32_t page, uint32_t level, uint32_t x, uint32_t y, double sum[3], double sum_abs[3])
{
    uint32_t all = 0, first = 0;
    for (uint32_t k = 0; k < o->desc.level_count; ++k) {
        const uint32_t across = ((o->desc.page_size >> k) + 31) / 32;
        if (k < level) first += across * across;
        all += across * across;
    }
    const uint32_t across = ((o->desc.page_size >> level) + 31) / 32;
    const unsigned char *index = section(o->data, "BIDX"), *blocks = section(o->data, "BLKS");
    for (int k = 0; k < 3; ++k) sum[k] = sum_abs[k] = 0;
    for (uint32_t layer = 0; layer < o->desc.layer_count; ++layer) {
        const size_t entry = (size_t)(page * o->desc.layer_count + layer) * all + first + y / 32 * across + x / 32;
        const uint32_t block = read_u32(index + 4 * entry);
        if (block == 0) continue;
        const uint32_t word = read_u32(blocks + (size_t)(block - 1) * 4096 + 4 * (32 * (y % 32) + x % 32));
        float c[3];
        lxrt_layer info;
        lxrt_get_layer(o->pack, layer, c);
        lxrt_get_layer_info(o->pack, layer, &info);
        for (int k = 0; k < 3; ++k) {
            const double value = (word >> (9 * k) & 511) * pow(2, (int)(word >> 27) - 24) * info.scale * c[k];
            sum[k] += value;
            sum_abs[k] += fabs(value);
        }
    }
}

static void compose_any_pack_is_the_documented_sum(void **state)
{
    (void)state;
    static const random_pack descs[] = {
        {.page_size = 70, .page_count = 2, .layer_count = 5, .level_count = 3, .density = 0.6f, .exponent_max = 31, .scale_spread = 20, .seed = 1},
        {.page_size = 33, .page_count = 1, .layer_count = 300, .level_count = 2, .density = 0.5f, .exponent_min = 10, .exponent_max = 31, .seed = 2},
        {.page_size = 31, .page_count = 1, .layer_count = 1, .level_count = 1, .density = 1, .exponent_max = 31, .seed = 3},
        {.page_size = 40, .page_count = 1, .layer_count = 4, .level_count = 1, .density = 1, .exponent_max = 31, .scale_spread = 60, .seed = 4},
    };
    static float rgb[3 * 70 * 70];
    for (size_t i = 0; i < sizeof descs / sizeof *descs; ++i) {
        opened o = open_noise(descs[i]);
        for (uint32_t layer = 0; layer < o.desc.layer_count; layer += 3) // black ones, negative ones
            lxrt_set_layer(o.pack, layer, (const float[3]){layer % 2 ? 0 : 7, 0, layer % 2 ? 0 : -0.3f}, 3);
        for (uint32_t page = 0; page < o.desc.page_count; ++page) {
            for (uint32_t level = 0; level < o.desc.level_count; ++level) {
                const uint32_t size = o.desc.page_size >> level;
                assert_int_equal(lxrt_compose(o.pack, &(lxrt_region){page, level, 0, 0, size, size},
                                              &(lxrt_target){rgb, 0, LXRT_FORMAT_RGB32F, 1}), LXRT_OK);
                for (uint32_t texel = 0; texel < size * size; ++texel) {
                    double want[3], magnitude[3];
                    reference_texel(&o, page, level, texel % size, texel / size, want, magnitude);
                    for (int k = 0; k < 3; ++k) // each layer rounds c × scale, the product and the sum
                        if (!(fabs(rgb[3 * texel + k] - want[k]) <= (o.desc.layer_count + 2) * magnitude[k] * FLT_EPSILON / 2))
                            fail_msg("pack %zu, level %u, texel %u, channel %d: %.9g, not %.9g", i, level, texel, k, rgb[3 * texel + k], want[k]);
                }
            }
        }
        close_noise(&o);
    }
}

enum { guard = 0xa5 };

static void compare_kernels(const opened *o, const lxrt_region *region, lxrt_format format, float scale, size_t padding)
{
    const size_t row_bytes = region->width * lxrt_format_bytes(format) + padding, bytes = row_bytes * region->height + 64;
    unsigned char *want = malloc(bytes), *got = malloc(bytes);
    const char *name;
    lxrt_kernel kernel;
    for (uint32_t k = 0; (kernel = lxrt_get_kernel(k, &name)) != NULL; ++k) {
        unsigned char *out = k == 0 ? want : got;
        memset(out, guard, bytes);
        lxrt_use_kernel(o->pack, kernel);
        assert_int_equal(lxrt_compose(o->pack, region, &(lxrt_target){out, row_bytes, format, scale}), LXRT_OK);
        for (size_t i = 0; i < bytes; ++i) {
            const int is_texel = i < row_bytes * region->height && i % row_bytes < row_bytes - padding;
            if (!is_texel && out[i] != guard) fail_msg("%s: byte %zu behind a row of %zu was written", name, i, row_bytes - padding);
            if (out[i] != want[i])
                fail_msg("%s: format %d, (%u, %u) %u×%u, byte %zu: %02x, not %02x", name, (int)format, region->x, region->y, region->width,
                         region->height, i, out[i], want[i]);
        }
    }
    free(want);
    free(got);
}

static void every_kernel_gives_the_bytes_of_the_scalar_one(void **state)
{
    (void)state;
    static const uint32_t sizes[] = {1, 2, 31, 32, 33, 100, 200}, layer_counts[] = {0, 1, 3, 4, 5, 9, 150};
    uint32_t random = 99;
    for (int round = 0; round < 84; ++round) {
        const uint32_t size = sizes[round % 7];
        opened o = open_noise((random_pack){.page_size = size, .page_count = 1, .layer_count = layer_counts[round / 7 % 7], .level_count = size > 1 ? 2 : 1,
                                     .density = round % 3 ? 0.7f : 1, .exponent_min = round % 2 ? 14 : 0, .exponent_max = 31,
                                     .scale_spread = round % 5 == 0 ? 30 : 0, .seed = (uint32_t)round});
        for (uint32_t layer = 0; layer < o.desc.layer_count; ++layer) {
            if (random_next(&random) % 4 == 0) lxrt_set_layer(o.pack, layer, (const float[3]){0, 0, 0}, 1);
            if (random_next(&random) % 4 == 0) lxrt_set_layer(o.pack, layer, (const float[3]){-1, 2, 1e-6f}, 3);
        }
        for (int part = 0; part < 9; ++part) {
            const uint32_t level = o.desc.level_count > 1 ? random_next(&random) % 2 : 0, edge = size >> level;
            lxrt_region region = {0, level, 0, 0, edge, edge};
            if (part >= 3) {
                region.x = random_next(&random) % edge;
                region.y = random_next(&random) % edge;
                region.width = 1 + random_next(&random) % (edge - region.x);
                region.height = 1 + random_next(&random) % (edge - region.y);
            }
            static const float scales[] = {1, 0x1p-7f, 3.7f};
            const lxrt_format format = (lxrt_format)(part % 3);
            compare_kernels(&o, &region, format, scales[(part + round) % 3], part < 6 ? 0 : 4 * (random_next(&random) % 9));
        }
        close_noise(&o);
    }
}

static void kernels_agree_on_the_brightest_sums_there_are(void **state)
{
    (void)state;
    opened o = open_noise((random_pack){.page_size = 64, .page_count = 1, .layer_count = 40, .level_count = 1, .density = 1, .exponent_max = 31, .seed = 6});
    for (uint32_t layer = 0; layer < 40; ++layer)
        assert_int_equal(lxrt_set_layer(o.pack, layer, (const float[3]){1e27f, layer % 2 ? -1e27f : 1e27f, 1e-38f}, 1), LXRT_OK);
    for (int format = 0; format < 3; ++format) {
        compare_kernels(&o, &(lxrt_region){0, 0, 0, 0, 64, 64}, (lxrt_format)format, 1, 0);
        compare_kernels(&o, &(lxrt_region){0, 0, 0, 0, 64, 64}, (lxrt_format)format, 1e6f, 0); // beyond a float: infinite, or clamped
    }
    close_noise(&o);
}

static void parts_of_a_page_give_the_bytes_of_the_whole(void **state)
{
    (void)state;
    enum { size = 100 };
    static unsigned char whole[size * size * 12], parts[size * size * 12];
    opened o = open_noise((random_pack){.page_size = size, .page_count = 1, .layer_count = 11, .level_count = 1, .density = 0.8f, .exponent_max = 31, .seed = 8});
    for (int f = 0; f < 3; ++f) {
        const lxrt_format format = (lxrt_format)f;
        const size_t texel = lxrt_format_bytes(format), row = size * texel;
        static const uint32_t cuts[] = {0, 7, 31, 32, 65, 100};
        assert_int_equal(lxrt_compose(o.pack, &(lxrt_region){0, 0, 0, 0, size, size}, &(lxrt_target){whole, 0, format, 1}), LXRT_OK);
        memset(parts, guard, sizeof parts);
        for (int j = 0; j < 5; ++j)
            for (int i = 0; i < 5; ++i) {
                const lxrt_region region = {0, 0, cuts[i], cuts[j], cuts[i + 1] - cuts[i], cuts[j + 1] - cuts[j]};
                assert_int_equal(lxrt_compose(o.pack, &region, &(lxrt_target){parts + region.y * row + region.x * texel, row, format, 1}), LXRT_OK);
            }
        assert_memory_equal(whole, parts, size * row);
    }
    close_noise(&o);
}

static void a_row_of_bytes_at_odd_addresses_is_written_too(void **state)
{
    (void)state;
    static unsigned char aligned[64 * 64 * 12], odd[64 * 64 * 12 + 3];
    opened o = open_noise((random_pack){.page_size = 64, .page_count = 1, .layer_count = 3, .level_count = 1, .density = 1, .exponent_max = 31, .seed = 8});
    for (int f = 0; f < 3; ++f) {
        const lxrt_region region = {0, 0, 0, 0, 64, 64};
        lxrt_compose(o.pack, &region, &(lxrt_target){aligned, 0, (lxrt_format)f, 1});
        lxrt_compose(o.pack, &region, &(lxrt_target){odd + 3, 0, (lxrt_format)f, 1});
        assert_memory_equal(aligned, odd + 3, 64 * 64 * lxrt_format_bytes((lxrt_format)f));
    }
    close_noise(&o);
}

static void arguments_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    opened o = open_noise((random_pack){.page_size = 64, .page_count = 1, .layer_count = 1, .level_count = 2, .density = 1, .exponent_max = 31, .seed = 8});
    static float out[3 * 64 * 64];
    const lxrt_region good = {0, 1, 0, 0, 32, 32};
    const lxrt_target fine = {out, 0, LXRT_FORMAT_RGB32F, 1};
    assert_int_equal(lxrt_compose(o.pack, &good, &fine), LXRT_OK);
    assert_int_equal(lxrt_compose(NULL, &good, &fine), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_compose(o.pack, NULL, &fine), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_compose(o.pack, &good, NULL), LXRT_ERROR_INVALID_ARGUMENT);
    static const lxrt_region regions[] = {{1, 0, 0, 0, 1, 1}, {0, 2, 0, 0, 1, 1}, {0, 1, 32, 0, 1, 1}, {0, 1, 0, 1, 1, 32},
                                          {0, 1, 1, 0, UINT32_MAX, 1}, {0, 1, 0, UINT32_MAX, 1, 1}};
    for (size_t i = 0; i < sizeof regions / sizeof *regions; ++i)
        assert_int_equal(lxrt_compose(o.pack, &regions[i], &fine), LXRT_ERROR_INVALID_ARGUMENT);
    const lxrt_target targets[] = {{NULL, 0, LXRT_FORMAT_RGB32F, 1}, {out, 32 * 12 - 1, LXRT_FORMAT_RGB32F, 1}, {out, 0, (lxrt_format)3, 1},
                                   {out, 0, (lxrt_format)-1, 1}, {out, 0, LXRT_FORMAT_RGB32F, 0}, {out, 0, LXRT_FORMAT_RGB32F, -1},
                                   {out, 0, LXRT_FORMAT_RGB32F, NAN}, {out, 0, LXRT_FORMAT_RGB32F, INFINITY}};
    for (size_t i = 0; i < sizeof targets / sizeof *targets; ++i)
        assert_int_equal(lxrt_compose(o.pack, &good, &targets[i]), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_compose(o.pack, &(lxrt_region){0, 0, 64, 64, 0, 0}, &targets[0]), LXRT_OK); // nothing to do
    close_noise(&o);
}

// ---- sampling ----

static double spline(double t) // the cubic B-spline around 0
{
    t = fabs(t);
    return t < 1 ? (4 - 6 * t * t + 3 * t * t * t) / 6 : t < 2 ? (2 - t) * (2 - t) * (2 - t) / 6 : 0;
}

static double tent(double t)
{
    return fabs(t) < 1 ? 1 - fabs(t) : 0;
}

static void samples_are_the_filtered_texels(void **state)
{
    (void)state;
    enum { size = 70 };
    opened o = open_noise((random_pack){.page_size = size, .page_count = 1, .layer_count = 6, .level_count = 1, .density = 0.8f, .exponent_min = 20, .exponent_max = 28, .seed = 12});
    static float page[size * size][3];
    lxrt_set_layer(o.pack, 3, (const float[3]){0, 0, 0}, 1);
    lxrt_compose(o.pack, &(lxrt_region){0, 0, 0, 0, size, size}, &(lxrt_target){page, 0, LXRT_FORMAT_RGB32F, 1});
    uint32_t random = 3;
    for (int i = 0; i < 3000; ++i) {
        float u = (float)(random_next(&random) >> 8) * 0x1.4p-24f - 0.1f, v = (float)(random_next(&random) >> 8) * 0x1.4p-24f - 0.1f;
        if (i == 0) u = v = NAN;
        if (i == 1) u = INFINITY, v = -INFINITY;
        if (i == 2) u = 1, v = 0.5f / size;
        const double x = fmin(fmax(i == 0 ? 0 : u, 0), 1) * size - 0.5, y = fmin(fmax(i == 0 ? 0 : v, 0), 1) * size - 0.5;
        for (int filter = 0; filter < 2; ++filter) {
            double want[3] = {0}, magnitude = 0;
            for (int row = (int)floor(y) - 1; row <= (int)floor(y) + 2; ++row)
                for (int column = (int)floor(x) - 1; column <= (int)floor(x) + 2; ++column) {
                    const double weight = filter ? spline(x - column) * spline(y - row) : tent(x - column) * tent(y - row);
                    const int cx = column < 0 ? 0 : column > size - 1 ? size - 1 : column, cy = row < 0 ? 0 : row > size - 1 ? size - 1 : row;
                    for (int k = 0; k < 3; ++k) {
                        want[k] += weight * page[cy * size + cx][k];
                        magnitude = fmax(magnitude, page[cy * size + cx][k]);
                    }
                }
            float got[3];
            assert_int_equal(lxrt_lightmap_sample(o.pack, 0, u, v, (lxrt_filter)filter, got), LXRT_OK);
            // u × size rounds by up to 2^-18 of a texel, over which the filter changes by no more than the largest texel nearby
            for (int k = 0; k < 3; ++k)
                if (!(fabs(got[k] - want[k]) <= 2e-5 * magnitude))
                    fail_msg("filter %d at (%.9g, %.9g), channel %d: %.9g, not %.9g", filter, u, v, k, got[k], want[k]);
        }
    }
    float rgb[3];
    assert_int_equal(lxrt_lightmap_sample(o.pack, 1, 0, 0, LXRT_FILTER_BILINEAR, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_lightmap_sample(o.pack, 0, 0, 0, (lxrt_filter)2, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_lightmap_sample(o.pack, 0, 0, 0, LXRT_FILTER_BILINEAR, NULL), LXRT_ERROR_INVALID_ARGUMENT);
    close_noise(&o);
}

static void sample_of_a_texel_centre_is_the_composed_texel(void **state)
{
    (void)state;
    enum { size = 64 }; // centres are exact in floats
    opened o = open_noise((random_pack){.page_size = size, .page_count = 1, .layer_count = 9, .level_count = 1, .density = 0.8f, .exponent_max = 31, .seed = 2});
    for (uint32_t i = 0; i < size * size; i += 7) {
        float texel[3], sample[3];
        lxrt_compose(o.pack, &(lxrt_region){0, 0, i % size, i / size, 1, 1}, &(lxrt_target){texel, 0, LXRT_FORMAT_RGB32F, 1});
        lxrt_lightmap_sample(o.pack, 0, ((float)(i % size) + 0.5f) / size, ((float)(i / size) + 0.5f) / size, LXRT_FILTER_BILINEAR, sample);
        assert_memory_equal(texel, sample, sizeof texel);
    }
    close_noise(&o);
}

static void budget_counts_what_is_there(void **state)
{
    (void)state;
    opened o = open_noise((random_pack){.page_size = 100, .page_count = 3, .layer_count = 5, .level_count = 2, .density = 0.5f, .exponent_max = 31, .seed = 2});
    lxrt_budget budget;
    size_t needed = 0;
    const size_t file_bytes = read_u32(o.data + 16);
    lxrt_get_budget(o.pack, &budget);
    assert_int_equal(lxrt_memory_bytes(o.data, file_bytes, &needed), LXRT_OK);
    assert_int_equal(budget.pack_bytes, file_bytes);
    assert_int_equal(budget.handle_bytes, needed);
    assert_int_equal(budget.accumulator_bytes, 3 * lxrt_accumulator_bytes(o.pack));
    assert_int_equal(budget.gpu_composed_bytes, 3 * (100 * 100 + 50 * 50) * 4);
    assert_int_equal(budget.gpu_layers_bytes, 3 * 5 * (100 * 100 + 50 * 50) * 4);
    assert_int_equal(budget.dense_bytes, 3 * 5 * (16 + 4) * 4096);
    close_noise(&o);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(compose_any_pack_is_the_documented_sum),
        cmocka_unit_test(every_kernel_gives_the_bytes_of_the_scalar_one),
        cmocka_unit_test(kernels_agree_on_the_brightest_sums_there_are),
        cmocka_unit_test(parts_of_a_page_give_the_bytes_of_the_whole),
        cmocka_unit_test(a_row_of_bytes_at_odd_addresses_is_written_too),
        cmocka_unit_test(arguments_that_make_no_sense_are_refused),
        cmocka_unit_test(samples_are_the_filtered_texels),
        cmocka_unit_test(sample_of_a_texel_centre_is_the_composed_texel),
        cmocka_unit_test(budget_counts_what_is_there),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
