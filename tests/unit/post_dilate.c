// Dilation against brute force, and mip levels that keep charts apart.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "math/hash.h"
#include "post/dilate.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { max_size = 48 };

static uint32_t chart[max_size * max_size], original[max_size * max_size], source[max_size * max_size];
static uint8_t valid[max_size * max_size];

static int64_t squared_distance(uint32_t size, uint32_t a, uint32_t b)
{
    const int64_t dx = (int64_t)(a % size) - b % size, dy = (int64_t)(a / size) - b / size;
    return dx * dx + dy * dy;
}

static uint32_t king_distance(uint32_t size, uint32_t a, uint32_t b)
{
    const int dx = abs((int)(a % size) - (int)(b % size)), dy = abs((int)(a / size) - (int)(b / size));
    return (uint32_t)(dx > dy ? dx : dy);
}

// Nearest texel of `number` (LX_NO_CHART: of any chart) in `original`, lowest index on ties; UINT32_MAX: none.
static uint32_t nearest(uint32_t size, uint32_t from, uint32_t number, bool only_valid)
{
    uint32_t best = UINT32_MAX;
    int64_t best_distance = INT64_MAX;
    for (uint32_t i = 0; i < size * size; ++i) {
        if (original[i] == LX_NO_CHART || (number != LX_NO_CHART && original[i] != number) || (only_valid && !valid[i])) continue;
        const int64_t distance = squared_distance(size, from, i);
        if (distance < best_distance) {
            best = i;
            best_distance = distance;
        }
    }
    return best;
}

static void check_against_brute_force(uint32_t size, uint32_t radius)
{
    lx_error error;
    memcpy(original, chart, sizeof original);
    assert_int_equal(lx_dilate_map(size, radius, chart, valid, source, &error), LX_OK);
    for (uint32_t i = 0; i < size * size; ++i) {
        uint32_t owner = original[i];
        if (owner == LX_NO_CHART) {
            bool claimed = false;
            for (uint32_t k = 0; k < size * size && !claimed; ++k)
                claimed = original[k] != LX_NO_CHART && king_distance(size, i, k) <= radius;
            if (claimed) owner = original[nearest(size, i, LX_NO_CHART, false)];
        }
        assert_int_equal(chart[i], owner);
        assert_int_equal(source[i], owner == LX_NO_CHART ? UINT32_MAX : nearest(size, i, owner, true));
    }
}

static void clear(uint32_t size)
{
    for (uint32_t i = 0; i < size * size; ++i) {
        chart[i] = LX_NO_CHART;
        valid[i] = 0;
    }
}

static void dilate_random_pages_match_brute_force(void **state)
{
    (void)state;
    uint32_t random = 1;
    for (uint32_t page = 0; page < 60; ++page) {
        const uint32_t size = 1 + (random = lx_hash32(random + page)) % 32;
        const uint32_t density = 1 + (random = lx_hash32(random)) % 24; // one texel in so many is covered
        const uint32_t chart_count = 1 + (random = lx_hash32(random)) % 5;
        clear(size);
        for (uint32_t i = 0; i < size * size; ++i) {
            random = lx_hash32(random + i);
            if (random % density == 0) chart[i] = 7 + (random >> 8) % chart_count;
            valid[i] = (random >> 20) % 3 != 0; // on empty texels too: it means nothing there
        }
        check_against_brute_force(size, page % 7);
    }
}

static void dilate_boxes_with_holes_match_brute_force(void **state)
{
    (void)state;
    uint32_t random = 99;
    for (uint32_t page = 0; page < 12; ++page) {
        const uint32_t size = max_size;
        clear(size);
        for (uint32_t box = 0; box < 6; ++box) {
            const uint32_t x0 = (random = lx_hash32(random)) % size, y0 = (random = lx_hash32(random)) % size;
            for (uint32_t y = y0; y < size && y < y0 + 14; ++y) {
                for (uint32_t x = x0; x < size && x < x0 + 9; ++x) {
                    chart[y * size + x] = box;
                    valid[y * size + x] = (box & 1) || (x + y) % 5 > 2;
                }
            }
        }
        check_against_brute_force(size, 4);
    }
}

static void dilate_empty_page_stays_empty(void **state)
{
    (void)state;
    clear(16);
    assert_int_equal(lx_dilate_map(16, 4, chart, valid, source, NULL), LX_OK);
    for (uint32_t i = 0; i < 256; ++i) {
        assert_int_equal(source[i], UINT32_MAX);
        assert_int_equal(chart[i], LX_NO_CHART);
    }
}

static void dilate_chart_without_valid_texels_is_black(void **state)
{
    (void)state;
    static float rgb[3 * 64];
    clear(8);
    chart[8 * 3 + 3] = 5; // invalid, alone
    for (size_t i = 0; i < 3 * 64; ++i) rgb[i] = 1;
    assert_int_equal(lx_dilate_map(8, 1, chart, valid, source, NULL), LX_OK);
    lx_dilate_apply(8, source, rgb);
    assert_int_equal(chart[8 * 2 + 2], 5);
    for (size_t i = 0; i < 3 * 64; ++i) assert_float_equal(rgb[i], 0, 0);
}

static void dilate_apply_copies_sources(void **state)
{
    (void)state;
    static float rgb[3 * 64];
    clear(8);
    chart[0] = 0, valid[0] = 1;
    chart[63] = 1, valid[63] = 1;
    memset(rgb, 0, sizeof rgb);
    rgb[0] = 2;
    rgb[3 * 63 + 1] = 3;
    assert_int_equal(lx_dilate_map(8, 8, chart, valid, source, NULL), LX_OK);
    lx_dilate_apply(8, source, rgb);
    assert_float_equal(rgb[3 * 9], 2, 0);      // (1, 1): nearer to the first
    assert_float_equal(rgb[3 * 54 + 1], 3, 0); // (6, 6): nearer to the second
    assert_float_equal(rgb[3 * 54], 0, 0);
}

// Two charts side by side, every combination of where the boundary falls: no level may hold a mixture.
static void mips_of_two_charts_do_not_bleed(void **state)
{
    (void)state;
    for (uint32_t split = 0; split <= 32; ++split) {
        static uint32_t levels[6][32 * 32];
        static float rgb[6][3 * 32 * 32];
        for (uint32_t i = 0; i < 32 * 32; ++i) {
            const bool left = i % 32 < split;
            levels[0][i] = left ? 4 : 9;
            rgb[0][3 * i] = left ? 1000 : 1;
            rgb[0][3 * i + 1] = left ? 0 : 7;
            rgb[0][3 * i + 2] = 0;
        }
        for (uint32_t level = 1, size = 32; level < 6; ++level, size /= 2) {
            lx_mip_halve_chart(size, levels[level - 1], levels[level]);
            lx_mip_halve(size, levels[level - 1], levels[level], rgb[level - 1], rgb[level]);
            for (uint32_t i = 0; i < size / 2 * (size / 2); ++i) {
                const bool left = levels[level][i] == 4;
                assert_true(left || levels[level][i] == 9);
                assert_float_equal(rgb[level][3 * i], left ? 1000 : 1, 0);
                assert_float_equal(rgb[level][3 * i + 1], left ? 0 : 7, 0);
            }
        }
    }
}

static void mip_texel_goes_to_the_chart_that_covers_most(void **state)
{
    (void)state;
    const uint32_t quads[][5] = {
        {3, 3, 3, 1, 3}, {5, 2, 2, 5, 2}, {9, LX_NO_CHART, LX_NO_CHART, LX_NO_CHART, 9},
        {LX_NO_CHART, LX_NO_CHART, LX_NO_CHART, LX_NO_CHART, LX_NO_CHART}, {4, 3, 2, 1, 1}, {LX_NO_CHART, LX_NO_CHART, 8, 6, 6},
    };
    for (size_t i = 0; i < sizeof quads / sizeof *quads; ++i) {
        uint32_t coarse = 77;
        const float fine[12] = {1, 2, 3, 10, 20, 30, 100, 200, 300, 1000, 2000, 3000};
        float rgb[3];
        lx_mip_halve_chart(2, quads[i], &coarse);
        lx_mip_halve(2, quads[i], &coarse, fine, rgb);
        assert_int_equal(coarse, quads[i][4]);
        float sum = 0, count = 0;
        for (int k = 0; k < 4; ++k)
            if (coarse != LX_NO_CHART && quads[i][k] == coarse) sum += fine[3 * k], ++count;
        assert_float_equal(rgb[0], count > 0 ? sum / count : 0, 1e-4);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(dilate_random_pages_match_brute_force),
        cmocka_unit_test(dilate_boxes_with_holes_match_brute_force),
        cmocka_unit_test(dilate_empty_page_stays_empty),
        cmocka_unit_test(dilate_chart_without_valid_texels_is_black),
        cmocka_unit_test(dilate_apply_copies_sources),
        cmocka_unit_test(mips_of_two_charts_do_not_bleed),
        cmocka_unit_test(mip_texel_goes_to_the_chart_that_covers_most),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
