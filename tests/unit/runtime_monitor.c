// Monitors: cells against areas and sRGB curve in double precision, every kernel against the scalar one, orientation, smoothing, misuse.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "runtime_maker.h"

#include "rt_pixels.h"

#include <math.h>
#include <stdbool.h>

// Of white: half a step of 16-bit linear numbers, and as much again for the curve between them (rt_pixels.h).
static const double curve_error = 8.1e-6;

static uint32_t random_state = 1;
static uint32_t random_u32(void)
{
    random_state = random_state * 1664525 + 1013904223;
    return random_state >> 8 ^ random_state << 16;
}

static double linear_of_srgb(unsigned v)
{
    const double x = v / 255.0;
    return x <= 0.04045 ? x / 12.92 : pow((x + 0.055) / 1.055, 2.4);
}

static made_pack make_monitor(uint32_t columns, uint32_t rows, float r, float g, float b)
{
    const made_monitor monitor = {columns, rows, 0, {r, g, b}};
    made_pack made = made_create(&(made_desc){.layer_count = columns * rows, .monitors = &monitor, .monitor_count = 1});
    assert_int_equal(made_open(&made), LXRT_OK);
    return made;
}

static void cell_color(const made_pack *made, uint32_t cell, float rgb[3])
{
    assert_int_equal(lxrt_get_layer(made->pack, cell, rgb), LXRT_OK);
}

static size_t pixel_bytes(lxrt_pixels format)
{
    return format == LXRT_PIXELS_RGBA8_SRGB ? 4 : format == LXRT_PIXELS_RGB8_SRGB ? 3 : 16;
}

// A picture in memory that ends with its last pixel, so that the address sanitizer sees every byte read beyond.
typedef struct picture {
    uint8_t *bytes;
    uint32_t width, height;
    size_t stride;
    lxrt_pixels format;
} picture;

static picture random_picture(uint32_t width, uint32_t height, size_t padding, lxrt_pixels format)
{
    picture p = {NULL, width, height, width * pixel_bytes(format) + padding, format};
    const size_t size = p.stride * (height - 1) + width * pixel_bytes(format);
    p.bytes = malloc(size);
    for (size_t i = 0; i < size; ++i) p.bytes[i] = (uint8_t)random_u32();
    for (uint32_t y = 0; format == LXRT_PIXELS_RGBA32F && y < height; ++y) {
        for (uint32_t i = 0; i < 4 * width; ++i) {
            const float value = i % 4 == 3 ? NAN : (float)(random_u32() % 100000) / 1000; // alpha must not matter
            memcpy(p.bytes + y * p.stride + 4 * i, &value, 4);
        }
    }
    return p;
}

static double linear_at(const picture *p, uint32_t x, uint32_t y, int channel)
{
    const uint8_t *pixel = p->bytes + y * p->stride + x * pixel_bytes(p->format);
    if (p->format != LXRT_PIXELS_RGBA32F) return linear_of_srgb(pixel[channel]);
    float value;
    memcpy(&value, pixel + 4 * channel, 4);
    return isfinite(value) ? value : 0;
}

static double overlap(double begin, double end, double pixel)
{
    return fmax(0, fmin(end, pixel + 1) - fmax(begin, pixel));
}

// Mean of a cell by the plain definition: each pixel's square with the cell's rectangle.
static double cell_mean(const picture *p, uint32_t columns, uint32_t rows, uint32_t column, uint32_t row, int channel)
{
    const double x0 = (double)column * p->width / columns, x1 = (double)(column + 1) * p->width / columns;
    const double y0 = (double)row * p->height / rows, y1 = (double)(row + 1) * p->height / rows;
    double sum = 0;
    for (uint32_t y = (uint32_t)y0; y < p->height && y < y1; ++y)
        for (uint32_t x = (uint32_t)x0; x < p->width && x < x1; ++x)
            sum += overlap(x0, x1, x) * overlap(y0, y1, y) * linear_at(p, x, y, channel);
    return sum / ((x1 - x0) * (y1 - y0));
}

static lxrt_result show(const made_pack *made, const picture *p)
{
    return lxrt_monitor_update(made->pack, 0, p->bytes, p->width, p->height, p->stride, p->format);
}

static void srgb_pixels_are_decoded_to_within_16_bits(void **state)
{
    (void)state;
    made_pack made = make_monitor(1, 1, 1, 1, 1);
    double worst = 0, worst_relative = 0;
    float rgb[3], before = -1;
    for (unsigned v = 0; v < 256; ++v) {
        const uint8_t pixel[4] = {(uint8_t)v, 0, 255, 77};
        assert_int_equal(lxrt_monitor_update(made.pack, 0, pixel, 1, 1, 0, LXRT_PIXELS_RGBA8_SRGB), LXRT_OK);
        cell_color(&made, 0, rgb);
        const double error = fabs(rgb[0] - linear_of_srgb(v));
        worst = fmax(worst, error);
        if (v > 0) worst_relative = fmax(worst_relative, error / linear_of_srgb(v));
        assert_true(rgb[0] > before);
        assert_float_equal(rgb[1], 0, 0); // black and white are exact
        assert_float_equal(rgb[2], 1, 0);
        before = rgb[0];
    }
    print_message("largest error %.2e of white, %.2f %% of the value\n", worst, 100 * worst_relative);
    assert_true(worst < curve_error);
    assert_true(worst_relative < 0.0025);
    made_release(&made);
}

static void every_kernel_gives_the_same_sums(void **state)
{
    (void)state;
    uint32_t table[256];
    lxrt_pixel_sum sum;
    const char *name;
    lxrt_fill_srgb_table(table);
    for (uint32_t k = 1; (sum = lxrt_get_pixel_sum(k, &name)) != NULL; ++k) {
        print_message("%s\n", name);
        for (int round = 0; round < 3000; ++round) {
            const lxrt_pixels format = round % 2 ? LXRT_PIXELS_RGB8_SRGB : LXRT_PIXELS_RGBA8_SRGB;
            picture p = random_picture(1 + random_u32() % 150, 1 + random_u32() % 9, random_u32() % 3 * 5, format);
            const lxrt_pixel_block block = {p.bytes, p.stride, p.width, p.height, (uint32_t)pixel_bytes(format), table};
            uint64_t want[3] = {1, 2, 3}, got[3] = {1, 2, 3}; // sums are added to
            lxrt_sum_pixels_scalar(&block, want);
            sum(&block, got);
            if (memcmp(want, got, sizeof want) != 0) fail_msg("%s: %u x %u pixels of %u bytes", name, p.width, p.height, block.pixel_bytes);
            free(p.bytes);
        }
        // The largest block of each extreme value: nothing overflows.
        for (int value = 0; value < 256; value += 5) {
            const uint32_t bytes = value % 2 ? 3 : 4;
            uint8_t *row = malloc(lxrt_max_sum_width * bytes);
            memset(row, value, lxrt_max_sum_width * bytes);
            const lxrt_pixel_block block = {row, 0, lxrt_max_sum_width, lxrt_max_sum_rows, bytes, table}; // one row, again and again
            uint64_t got[3] = {0};
            sum(&block, got);
            for (int i = 0; i < 3; ++i) assert_int_equal(got[i], (uint64_t)table[value] * lxrt_max_sum_width * lxrt_max_sum_rows);
            free(row);
        }
    }
}

static void cells_are_exact_by_area_for_any_grid_and_picture(void **state)
{
    (void)state;
    static const struct {
        uint32_t columns, rows, width, height;
    } cases[] = {{1, 1, 1, 1},   {16, 9, 16, 9},   {16, 9, 160, 90}, {16, 9, 161, 91}, {16, 9, 5, 3},    {16, 9, 1, 1},   {7, 5, 13, 3},
                 {3, 2, 100, 1}, {2, 3, 1, 100},   {5, 1, 64, 2},    {31, 17, 30, 16}, {31, 17, 32, 18}, {64, 64, 7, 11}, {4, 4, 131, 67},
                 {1, 1, 97, 89}, {10, 10, 99, 101}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        const uint32_t columns = cases[i].columns, rows = cases[i].rows;
        made_pack made = make_monitor(columns, rows, 100, 200, 50);
        const float strength[3] = {100, 200, 50};
        for (int format = LXRT_PIXELS_RGBA8_SRGB; format <= LXRT_PIXELS_RGBA32F; ++format) {
            for (size_t padding = 0; padding <= 7; padding += 7) { // 7: floats at odd addresses
                picture p = random_picture(cases[i].width, cases[i].height, padding, (lxrt_pixels)format);
                assert_int_equal(show(&made, &p), LXRT_OK);
                for (uint32_t cell = 0; cell < columns * rows; ++cell) {
                    float rgb[3];
                    cell_color(&made, cell, rgb);
                    for (int k = 0; k < 3; ++k) {
                        const double want = strength[k] * cell_mean(&p, columns, rows, cell % columns, cell / columns, k);
                        // One rounding to float, besides the curve's own error of bytes. 1e-12: the reference's.
                        const double bound = want * (0x1p-24 + 1e-12) + (format == LXRT_PIXELS_RGBA32F ? 0 : strength[k] * curve_error);
                        if (fabs(rgb[k] - want) > bound)
                            fail_msg("%u x %u cells, %u x %u pixels, format %d, cell %u, channel %d: %.9g, not %.9g", columns, rows, p.width,
                                     p.height, format, cell, k, rgb[k], want);
                    }
                }
                free(p.bytes);
            }
        }
        made_release(&made);
    }
}

static void cells_together_show_what_one_cell_shows(void **state)
{
    (void)state;
    picture p = random_picture(193, 77, 0, LXRT_PIXELS_RGBA8_SRGB);
    made_pack whole = make_monitor(1, 1, 1, 1, 1);
    float want[3];
    assert_int_equal(show(&whole, &p), LXRT_OK);
    cell_color(&whole, 0, want);
    static const uint32_t grids[][2] = {{2, 1}, {16, 9}, {7, 11}, {200, 100}};
    for (size_t i = 0; i < sizeof grids / sizeof *grids; ++i) {
        const uint32_t count = grids[i][0] * grids[i][1];
        made_pack made = make_monitor(grids[i][0], grids[i][1], 1, 1, 1);
        double sums[3] = {0};
        assert_int_equal(show(&made, &p), LXRT_OK);
        for (uint32_t cell = 0; cell < count; ++cell) {
            float rgb[3];
            cell_color(&made, cell, rgb);
            for (int k = 0; k < 3; ++k) sums[k] += rgb[k];
        }
        for (int k = 0; k < 3; ++k) assert_float_equal(sums[k] / count, want[k], 1e-7); // sums of whole numbers: no error but of floats
        made_release(&made);
    }
    free(p.bytes);
    made_release(&whole);
}

// An F reads as one way up and one way round only.
static void letters_stand_upright_from_the_top_left_cell(void **state)
{
    (void)state;
    static const char *letter[5] = {"###.", "#...", "##..", "#...", "#..."};
    enum { scale = 9 };
    static uint8_t pixels[5 * scale][4 * scale][4];
    made_pack made = make_monitor(4, 5, 300, 300, 300);
    for (int y = 0; y < 5 * scale; ++y)
        for (int x = 0; x < 4 * scale; ++x) memset(pixels[y][x], letter[y / scale][x / scale] == '#' ? 255 : 0, 4);
    assert_int_equal(lxrt_monitor_update(made.pack, 0, pixels, 4 * scale, 5 * scale, 0, LXRT_PIXELS_RGBA8_SRGB), LXRT_OK);
    for (uint32_t cell = 0; cell < 20; ++cell) {
        float rgb[3];
        cell_color(&made, cell, rgb);
        assert_float_equal(rgb[1], (letter[cell / 4][cell % 4] == '#' ? 300 : 0), 0);
    }
    // Red on the left, green at the top.
    static const uint8_t corner[2][2][3] = {{{255, 255, 0}, {0, 255, 0}}, {{255, 0, 0}, {0, 0, 0}}};
    made_pack quad = make_monitor(2, 2, 1, 1, 1);
    assert_int_equal(lxrt_monitor_update(quad.pack, 0, corner, 2, 2, 0, LXRT_PIXELS_RGB8_SRGB), LXRT_OK);
    for (uint32_t cell = 0; cell < 4; ++cell) {
        float rgb[3];
        cell_color(&quad, cell, rgb);
        assert_float_equal(rgb[0], (cell % 2 == 0), 0);
        assert_float_equal(rgb[1], (cell / 2 == 0), 0);
        assert_float_equal(rgb[2], 0, 0);
    }
    made_release(&quad);
    made_release(&made);
}

static void pixels_are_made_linear_before_they_are_averaged(void **state)
{
    (void)state;
    static const uint8_t checker[2][2][3] = {{{255, 0, 0}, {0, 255, 0}}, {{0, 255, 0}, {255, 0, 0}}};
    made_pack made = make_monitor(1, 1, 1, 1, 1);
    float rgb[3];
    assert_int_equal(lxrt_monitor_update(made.pack, 0, checker, 2, 2, 0, LXRT_PIXELS_RGB8_SRGB), LXRT_OK);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 0.5f, 0); // the mean byte, 127.5, would give 0.213
    assert_float_equal(rgb[1], 0.5f, 0);
    made_release(&made);
}

static void smoothing_keeps_its_share_and_comes_to_rest(void **state)
{
    (void)state;
    static const uint8_t white[4] = {255, 255, 255, 255}, black[4] = {0};
    made_pack made = make_monitor(1, 1, 10, 20, 0);
    float rgb[3];
    lxrt_set_layer(made.pack, 0, (const float[3]){0, 0, 0}, 1);
    assert_int_equal(lxrt_monitor_configure(made.pack, 0, NULL, 0.75f), LXRT_OK);
    lxrt_monitor_update(made.pack, 0, white, 1, 1, 0, LXRT_PIXELS_RGBA8_SRGB);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 2.5f, 0);
    lxrt_monitor_update(made.pack, 0, white, 1, 1, 0, LXRT_PIXELS_RGBA8_SRGB);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[1], 20 * (1 - 0.75 * 0.75), 0);
    for (int i = 0; i < 50; ++i) lxrt_monitor_update(made.pack, 0, white, 1, 1, 0, LXRT_PIXELS_RGBA8_SRGB);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 10, 0); // exactly: a still picture costs nothing after a while
    for (int i = 0; i < 50; ++i) lxrt_monitor_update(made.pack, 0, black, 1, 1, 0, LXRT_PIXELS_RGBA8_SRGB);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 0, 0);
    assert_float_equal(rgb[1], 0, 0);
    made_release(&made);
}

static void strength_is_authored_until_it_is_configured(void **state)
{
    (void)state;
    static const float pixel[4] = {0.5f, 1, 2, 0};
    made_pack made = make_monitor(1, 1, 10, 20, 30);
    lxrt_monitor info;
    float rgb[3];
    lxrt_monitor_update(made.pack, 0, pixel, 1, 1, 0, LXRT_PIXELS_RGBA32F);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 5, 0);
    assert_float_equal(rgb[2], 60, 0);
    assert_int_equal(lxrt_monitor_configure(made.pack, 0, (const float[3]){1, 0, 4}, 0), LXRT_OK);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[2], 60, 0); // from the next update on
    lxrt_monitor_update(made.pack, 0, pixel, 1, 1, 0, LXRT_PIXELS_RGBA32F);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 0.5f, 0);
    assert_float_equal(rgb[1], 0, 0);
    assert_float_equal(rgb[2], 8, 0);
    assert_int_equal(lxrt_get_monitor(made.pack, 0, &info), LXRT_OK);
    assert_float_equal(info.strength[2], 4, 0);
    made_release(&made);
}

static void numbers_that_are_not_finite_count_as_nothing(void **state)
{
    (void)state;
    const float pixels[4][4] = {{NAN, 1, INFINITY, 1}, {4, -INFINITY, 1, NAN}, {4, 3, 2, 1}, {4, NAN, -1, 1}};
    const float bright[4] = {3e38f, -3e38f, 3e38f, 1};
    made_pack made = make_monitor(1, 1, 1, 1, 1e27f);
    float rgb[3];
    assert_int_equal(lxrt_monitor_update(made.pack, 0, pixels, 4, 1, 0, LXRT_PIXELS_RGBA32F), LXRT_OK);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 3, 0);
    assert_float_equal(rgb[1], 1, 0);
    assert_float_equal(rgb[2], 0.5f * 1e27f, 0);
    assert_int_equal(lxrt_monitor_update(made.pack, 0, bright, 1, 1, 0, LXRT_PIXELS_RGBA32F), LXRT_OK);
    cell_color(&made, 0, rgb); // no more than can be summed
    assert_float_equal(rgb[0], 1e27f, 0);
    assert_float_equal(rgb[1], -1e27f, 0);
    assert_float_equal(rgb[2], 1e27f, 0);
    made_release(&made);
}

static void monitors_that_share_cells_show_the_last_picture(void **state)
{
    (void)state;
    static const uint8_t first[3] = {255, 0, 0}, second[3] = {0, 255, 0};
    const made_monitor monitors[] = {{2, 1, 1, {5, 5, 5}}, {2, 1, 1, {7, 7, 7}}};
    made_pack made = made_create(&(made_desc){.layer_count = 4, .monitors = monitors, .monitor_count = 2});
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    lxrt_monitor_update(made.pack, 0, first, 1, 1, 0, LXRT_PIXELS_RGB8_SRGB);
    lxrt_monitor_update(made.pack, 1, second, 1, 1, 0, LXRT_PIXELS_RGB8_SRGB);
    for (uint32_t layer = 0; layer < 4; ++layer) {
        const bool is_cell = layer == 1 || layer == 2;
        cell_color(&made, layer, rgb);
        assert_float_equal(rgb[0], (is_cell ? 0 : 1), 0); // layers beside the cells are left alone
        assert_float_equal(rgb[1], (is_cell ? 7 : 1), 0);
    }
    made_release(&made);
}

static void arguments_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    static const uint8_t pixels[64];
    made_pack made = make_monitor(2, 2, 1, 1, 1);
    float rgb[3];
    const struct {
        uint32_t monitor;
        const void *pixels;
        uint32_t width, height;
        size_t stride;
        int format;
        lxrt_result result;
    } cases[] = {
        {1, pixels, 2, 2, 0, 0, LXRT_ERROR_NOT_FOUND},
        {UINT32_MAX, pixels, 2, 2, 0, 0, LXRT_ERROR_NOT_FOUND},
        {0, NULL, 2, 2, 0, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 0, 2, 0, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 0, 0, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 2, 7, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 2, 31, 2, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 2, SIZE_MAX / 2 + 1, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 2, 0, 3, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 2, 2, 0, -1, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, UINT32_MAX, UINT32_MAX, 0, 0, LXRT_ERROR_INVALID_ARGUMENT},
        {0, pixels, 1u << 20, (1u << 20) + 1, 0, 1, LXRT_ERROR_INVALID_ARGUMENT},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        const lxrt_result result = lxrt_monitor_update(made.pack, cases[i].monitor, cases[i].pixels, cases[i].width, cases[i].height,
                                                       cases[i].stride, (lxrt_pixels)cases[i].format);
        if (result != cases[i].result) fail_msg("case %zu: %s, not %s", i, lxrt_result_name(result), lxrt_result_name(cases[i].result));
    }
    static const float bad_strengths[][3] = {{-1, 0, 0}, {0, NAN, 0}, {0, 0, INFINITY}, {1.1e27f, 0, 0}};
    for (size_t i = 0; i < sizeof bad_strengths / sizeof *bad_strengths; ++i)
        assert_int_equal(lxrt_monitor_configure(made.pack, 0, bad_strengths[i], 0), LXRT_ERROR_INVALID_ARGUMENT);
    static const float bad_smoothings[] = {-0.01f, 1, NAN, INFINITY};
    for (size_t i = 0; i < sizeof bad_smoothings / sizeof *bad_smoothings; ++i)
        assert_int_equal(lxrt_monitor_configure(made.pack, 0, (const float[3]){9, 9, 9}, bad_smoothings[i]), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_monitor_configure(made.pack, 1, NULL, 0), LXRT_ERROR_NOT_FOUND);
    cell_color(&made, 0, rgb);
    assert_float_equal(rgb[0], 1, 0); // nothing has changed
    lxrt_monitor info;
    lxrt_get_monitor(made.pack, 0, &info);
    assert_float_equal(info.strength[0], 1, 0);
    made_release(&made);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(srgb_pixels_are_decoded_to_within_16_bits),
        cmocka_unit_test(every_kernel_gives_the_same_sums),
        cmocka_unit_test(cells_are_exact_by_area_for_any_grid_and_picture),
        cmocka_unit_test(cells_together_show_what_one_cell_shows),
        cmocka_unit_test(letters_stand_upright_from_the_top_left_cell),
        cmocka_unit_test(pixels_are_made_linear_before_they_are_averaged),
        cmocka_unit_test(smoothing_keeps_its_share_and_comes_to_rest),
        cmocka_unit_test(strength_is_authored_until_it_is_configured),
        cmocka_unit_test(numbers_that_are_not_finite_count_as_nothing),
        cmocka_unit_test(monitors_that_share_cells_show_the_last_picture),
        cmocka_unit_test(arguments_that_make_no_sense_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
