#include "bake/luxel_map.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

enum { size = 80, pages = 2, texels = size * size * pages }; // the last tile of a row is half a tile

static void cover(uint32_t *chart, uint8_t *coverage, uint32_t page, uint32_t x, uint32_t y, uint32_t number)
{
    const uint32_t texel = (page * size + y) * size + x;
    chart[texel] = number;
    coverage[texel] = 1 + (uint8_t)(x + y);
}

static void luxels_are_numbered_tile_by_tile_and_row_by_row(void **state)
{
    (void)state;
    static uint32_t chart[texels];
    static uint8_t coverage[texels];
    lx_bake_map map = {0};
    memset(chart, 0xff, sizeof chart);
    cover(chart, coverage, 1, 0, 0, 4);   // 5
    cover(chart, coverage, 0, 79, 79, 3); // 4
    cover(chart, coverage, 0, 32, 0, 2);  // 3: a tile further
    cover(chart, coverage, 0, 0, 31, 1);  // 2
    cover(chart, coverage, 0, 31, 5, 1);  // 1
    cover(chart, coverage, 0, 7, 5, 0);   // 0
    assert_int_equal(lx_bake_map_build(size, pages, chart, coverage, &map, NULL), LX_OK);

    static const uint32_t where[6][4] = {{0, 7, 5, 0}, {0, 31, 5, 1}, {0, 0, 31, 1}, {0, 32, 0, 2}, {0, 79, 79, 3}, {1, 0, 0, 4}};
    assert_int_equal(map.view.count, 6);
    for (uint32_t i = 0; i < 6; ++i) {
        assert_int_equal(map.view.texel[i], (where[i][0] * size + where[i][2]) * size + where[i][1]);
        assert_int_equal(lx_luxel_x(&map.view, i), where[i][1]);
        assert_int_equal(lx_luxel_y(&map.view, i), where[i][2]);
        assert_int_equal(map.view.chart[i], where[i][3]);
        assert_int_equal(map.view.index[map.view.texel[i]], i);
        assert_true(map.view.valid[i]);
    }
    static const lx_luxel_tile tiles[4] = {{0, 0, 0, 0, 3}, {0, 32, 0, 3, 1}, {0, 64, 64, 4, 1}, {1, 0, 0, 5, 1}};
    assert_int_equal(map.tile_count, 4);
    assert_memory_equal(map.tiles, tiles, sizeof tiles);

    uint32_t none = 0;
    for (uint32_t i = 0; i < texels; ++i) none += map.view.index[i] == LX_NO_LUXEL;
    assert_int_equal(none, texels - 6);
    lx_bake_map_release(&map);
}

static void pages_without_any_luxel_have_no_tiles(void **state)
{
    (void)state;
    static const uint32_t chart[texels];
    static const uint8_t coverage[texels];
    lx_bake_map map = {0};
    assert_int_equal(lx_bake_map_build(size, pages, chart, coverage, &map, NULL), LX_OK);
    assert_int_equal(map.view.count, 0);
    assert_int_equal(map.tile_count, 0);
    lx_bake_map_release(&map);
}

static void more_texels_than_32_bits_tell_apart_are_refused(void **state)
{
    (void)state;
    lx_bake_map map = {0};
    lx_error error = {0};
    assert_int_equal(lx_bake_map_build(65536, 1, NULL, NULL, &map, &error), LX_ERROR_LIMIT);
    assert_non_null(strstr(error.message, "1 pages of 65536 x 65536 texels"));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(luxels_are_numbered_tile_by_tile_and_row_by_row),
        cmocka_unit_test(pages_without_any_luxel_have_no_tiles),
        cmocka_unit_test(more_texels_than_32_bits_tell_apart_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
