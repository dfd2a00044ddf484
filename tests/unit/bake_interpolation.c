#include "bake/interpolation.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { size = lx_luxel_tile_edge, texels = size * size };

static lx_bake_map map;
static float closeness[texels];
static uint8_t spacing[texels];

// One tile, a flat chart in the plane y = 0, texels of 0.1 m, nothing nearer than 10 m.
static int set_up(void **state)
{
    (void)state;
    static uint32_t chart[texels];
    static uint8_t coverage[texels];
    memset(coverage, 255, sizeof coverage);
    memset(chart, 0, sizeof chart);
    if (lx_bake_map_build(size, 1, chart, coverage, &map, NULL) != LX_OK) return 1;
    for (uint32_t i = 0; i < texels; ++i) {
        map.position[i] = (lx_vec3){0.1f * (float)lx_luxel_x(&map.view, i), 0, 0.1f * (float)lx_luxel_y(&map.view, i)};
        map.normal[i] = (lx_vec3){0, 1, 0};
        map.size_m[i] = 0.1f;
        closeness[i] = 0.01f;
    }
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    lx_bake_map_release(&map);
    return 0;
}

static void choose(float bound)
{
    memset(spacing, 0xff, sizeof spacing);
    lx_choose_spacing(&map.view, &map.tiles[0], closeness, bound, spacing);
}

static uint32_t at(uint32_t x, uint32_t y)
{
    return y * size + x;
}

static void wide_open_places_need_few_rays(void **state)
{
    (void)state;
    choose(0.02f);
    uint32_t senders = 0;
    for (uint32_t i = 0; i < texels; ++i) senders += spacing[i] == 0;
    assert_int_equal(senders, 9 * 9); // 0, 4, … 28 and 31
    assert_int_equal(spacing[at(0, 0)], 0);
    assert_int_equal(spacing[at(31, 28)], 0);
    assert_int_equal(spacing[at(2, 2)], lx_wide_spacing);
}

// 2 · 1/2 · 0.1² (1 + 1) · closeness for a luxel amid four knots of the narrow grid, four times that in the wide one.
static void the_bound_decides_between_grids(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < texels; ++i) closeness[i] = 1;
    choose(0.081f);
    assert_int_equal(spacing[at(2, 2)], lx_wide_spacing);
    choose(0.079f);
    assert_int_equal(spacing[at(2, 2)], 0); // a knot of the narrow grid
    assert_int_equal(spacing[at(3, 3)], lx_wide_spacing); // three texels from one knot, one from the other: 0.06
    assert_int_equal(spacing[at(1, 2)], lx_wide_spacing); // 0.07
    choose(0.059f);
    assert_int_equal(spacing[at(3, 3)], lx_narrow_spacing);
    choose(0.019f);
    assert_int_equal(spacing[at(3, 3)], 0);
    assert_int_equal(spacing[at(3, 2)], lx_narrow_spacing); // between two knots
    choose(0);
    for (uint32_t i = 0; i < texels; ++i) assert_int_equal(spacing[i], 0);
}

static void linear_light_is_met_exactly(void **state)
{
    (void)state;
    for (uint32_t grid = lx_narrow_spacing; grid <= lx_wide_spacing; grid *= 2)
        for (uint32_t i = 0; i < texels; ++i) {
            lx_knots knots;
            if (!lx_find_knots(&map.view, &map.tiles[0], i, grid, &knots)) continue;
            float x = 0, y = 0, weight = 0;
            for (uint32_t k = 0; k < knots.count; ++k) {
                lx_knots none;
                assert_false(lx_find_knots(&map.view, &map.tiles[0], knots.luxel[k], grid, &none)); // a knot has none
                x += knots.weight[k] * (float)lx_luxel_x(&map.view, knots.luxel[k]);
                y += knots.weight[k] * (float)lx_luxel_y(&map.view, knots.luxel[k]);
                weight += knots.weight[k];
            }
            assert_float_equal(weight, 1, 1e-6);
            assert_float_equal(x, lx_luxel_x(&map.view, i), 1e-4);
            assert_float_equal(y, lx_luxel_y(&map.view, i), 1e-4);
        }
}

static void near_things_ask_for_rays_around_them(void **state)
{
    (void)state;
    closeness[at(9, 9)] = 100;
    closeness[at(20, 20)] = INFINITY; // not a knot
    choose(0.02f);
    assert_int_equal(spacing[at(9, 9)], 0);
    assert_int_equal(spacing[at(10, 9)], lx_wide_spacing); // its knots look elsewhere
    for (uint32_t y = 17; y < 24; ++y)
        for (uint32_t x = 17; x < 24; ++x) {
            const bool reads_wide = spacing[at(x, y)] == lx_wide_spacing;
            assert_false(reads_wide);
        }
    assert_int_equal(spacing[at(18, 18)], 0); // sends its own, for it has no other
    assert_int_equal(spacing[at(17, 17)], lx_narrow_spacing);
}

static void edges_bends_and_steps_are_not_bridged(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < texels; ++i) {
        const uint32_t x = lx_luxel_x(&map.view, i), y = lx_luxel_y(&map.view, i);
        if (y < 10) map.chart[i] = x >= 6;                                         // another chart
        if (y >= 10 && y < 20 && x >= 6) map.normal[i] = (lx_vec3){0.1f, 0.995f, 0}; // a bend
        if (y >= 20 && x >= 6) map.position[i].y = 0.1f;                           // a step of a texel
    }
    choose(1);
    static const uint32_t rows[3] = {5, 14, 25};
    for (int k = 0; k < 3; ++k) {
        assert_int_equal(spacing[at(5, rows[k])], 0);
        assert_int_equal(spacing[at(7, rows[k])] == lx_wide_spacing, 0);
        assert_int_equal(spacing[at(3, rows[k])], lx_wide_spacing);
    }
}

int main(void)
{
#define CASE(name) cmocka_unit_test_setup_teardown(name, set_up, tear_down)
    const struct CMUnitTest tests[] = {CASE(wide_open_places_need_few_rays), CASE(the_bound_decides_between_grids), CASE(linear_light_is_met_exactly),
                                       CASE(near_things_ask_for_rays_around_them), CASE(edges_bends_and_steps_are_not_bridged)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
