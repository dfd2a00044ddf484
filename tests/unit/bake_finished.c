#include "bake/finished.h"
#include "bake/luxel_map.h"

#include "scene/atlas.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include <cmocka.h>

// Two pages. On each a chart of 20 x 20 texels in the corner, whose texel (5, 5) is invalid and which has padding of 2 texels around; on the second
// page also a chart of one invalid texel, far from all others.
enum { size = 48, pages = 2, page_texels = size * size, edge = 20, padding = 2, layers = 3 };

static uint32_t chart[pages * page_texels], claimed[pages * page_texels]; // without and with padding
static lx_bake_map map;

static int number(void **state)
{
    (void)state;
    static uint8_t coverage[pages * page_texels];
    memset(chart, 0xff, sizeof chart);
    for (uint32_t page = 0; page < pages; ++page)
        for (uint32_t i = 0; i < edge * edge; ++i) {
            const uint32_t texel = page * page_texels + i / edge * size + i % edge;
            chart[texel] = page;
            coverage[texel] = 255;
        }
    const uint32_t lonely = page_texels + 40 * size + 40;
    chart[lonely] = pages;
    coverage[lonely] = 1;
    if (lx_bake_map_build(size, pages, chart, coverage, &map, NULL) != LX_OK) return -1;
    map.valid[map.index[5 * size + 5]] = map.valid[map.index[page_texels + 5 * size + 5]] = map.valid[map.index[lonely]] = 0;
    return 0;
}

static int release(void **state)
{
    (void)state;
    lx_bake_map_release(&map);
    return 0;
}

static lx_rgb colour(uint32_t layer, uint32_t entry)
{
    return (lx_rgb){(float)(layer + 1), (float)(entry + 1), 0.25f};
}

// Two texels of padding beside the first chart's right edge have their own colour, and one on the other page.
static const uint32_t extra_texels[] = {7 * size + edge, 8 * size + edge, page_texels + 9 * size + edge};
enum { extras = sizeof extra_texels / sizeof *extra_texels };

// In pieces that cut both kinds of entries, as tiles do.
static lx_finished *finish(bool on_disk, bool extended)
{
    enum { piece = 77 };
    lx_finished *f = NULL;
    lx_rgb values[piece];
    assert_int_equal(lx_finished_create(&map.view, layers, on_disk, NULL, &f, NULL), LX_OK);
    memcpy(claimed, chart, sizeof chart);
    for (uint32_t page = 0; page < pages; ++page)
        assert_int_equal(lx_finished_dilate(f, &map.view, page, padding, claimed + page * page_texels, NULL), LX_OK);
    if (extended) assert_int_equal(lx_finished_extend(f, extra_texels, extras, NULL), LX_OK);
    assert_int_equal(lx_finished_count(f), map.view.count + (extended ? extras : 0));
    for (uint32_t layer = layers; layer-- > 0;)
        for (uint32_t first = 0; first < lx_finished_count(f); first += piece) {
            const uint32_t left = lx_finished_count(f) - first, count = left < piece ? left : piece;
            for (uint32_t i = 0; i < count; ++i) values[i] = colour(layer, first + i);
            assert_int_equal(lx_finished_write(f, layer, first, count, values, NULL), LX_OK);
        }
    return f;
}

static void assert_shows(const float *image, uint32_t texel, lx_rgb want)
{
    assert_float_equal(image[3 * texel], want.r, 0);
    assert_float_equal(image[3 * texel + 1], want.g, 0);
    assert_float_equal(image[3 * texel + 2], want.b, 0);
}

static void images_show_luxels_and_fill_what_is_none(void **state)
{
    (void)state;
    static float image[3 * page_texels];
    lx_finished *f = finish(false, false);
    for (uint32_t page = 0; page < pages; ++page)
        for (uint32_t layer = 0; layer < layers; ++layer) {
            assert_int_equal(lx_finished_image(f, page, layer, image, NULL), LX_OK);
            for (uint32_t i = 0; i < page_texels; ++i) {
                uint32_t x = i % size, y = i / size;
                const uint32_t luxel = map.index[page * page_texels + i];
                if (luxel != LX_NO_LUXEL && map.valid[luxel]) {
                    assert_shows(image, i, colour(layer, luxel));
                } else if (x < edge + padding && y < edge + padding) { // the nearest luxel; of the hole's neighbours the first
                    if (x == 5 && y == 5) y = 4;
                    x = x < edge ? x : edge - 1;
                    y = y < edge ? y : edge - 1;
                    assert_shows(image, i, colour(layer, map.index[page * page_texels + y * size + x]));
                } else {
                    assert_shows(image, i, (lx_rgb){0, 0, 0});
                }
            }
        }
    assert_int_equal(claimed[7 * size + edge + 1], 0); // the claim is written down
    assert_int_equal(claimed[7 * size + edge + padding], LX_NO_CHART);
    lx_finished_destroy(f);
}

static void padding_may_have_a_colour_of_its_own(void **state)
{
    (void)state;
    static float plain[3 * page_texels], image[3 * page_texels];
    lx_finished *without = finish(false, false), *f = finish(false, true);
    for (uint32_t page = 0; page < pages; ++page) {
        assert_int_equal(lx_finished_image(without, page, 1, plain, NULL), LX_OK);
        assert_int_equal(lx_finished_image(f, page, 1, image, NULL), LX_OK);
        for (uint32_t i = 0; i < page_texels; ++i) {
            lx_rgb want = {plain[3 * i], plain[3 * i + 1], plain[3 * i + 2]};
            for (uint32_t k = 0; k < extras; ++k)
                if (extra_texels[k] == page * page_texels + i) want = colour(1, map.view.count + k);
            assert_shows(image, i, want);
        }
    }
    lx_finished_destroy(without);
    lx_finished_destroy(f);
}

static void layers_on_disk_are_those_in_memory(void **state)
{
    (void)state;
    static float here[3 * page_texels], there[3 * page_texels];
    lx_finished *memory = finish(false, true), *disk = finish(true, true);
    for (uint32_t layer = 0; layer < layers; ++layer) {
        lx_layer_range a, b;
        for (uint32_t page = 0; page < pages; ++page) {
            assert_int_equal(lx_finished_image(memory, page, layer, here, NULL), LX_OK);
            assert_int_equal(lx_finished_image(disk, page, layer, there, NULL), LX_OK);
            assert_memory_equal(here, there, sizeof here);
        }
        assert_int_equal(lx_finished_range(memory, layer, &a, NULL), LX_OK);
        assert_int_equal(lx_finished_range(disk, layer, &b, NULL), LX_OK);
        assert_float_equal(a.largest, b.largest, 0);
        assert_float_equal(a.mean, b.mean, 0);
    }
    lx_finished_destroy(memory);
    lx_finished_destroy(disk);
}

static void ranges_count_what_is_shown(void **state)
{
    (void)state;
    lx_finished *f = finish(false, true);
    const lx_rgb bright = {1000, 0, 0}, brighter = {2000, 0, 0};
    lx_layer_range before, range;
    assert_int_equal(lx_finished_range(f, 2, &before, NULL), LX_OK);
    assert_float_equal(before.largest, (float)(map.view.count + extras), 0); // the last extra's green

    double sum = 0;
    uint32_t count = 0;
    for (uint32_t i = 0; i < map.view.count; ++i) {
        const lx_rgb c = colour(2, i);
        if (!map.valid[i]) continue;
        sum += (double)c.r + (double)c.g + (double)c.b;
        ++count;
    }
    assert_int_equal(count, map.view.count - 3);
    assert_float_equal(before.mean, sum / (3.0 * count), 1e-12 * sum);

    assert_int_equal(lx_finished_write(f, 2, map.index[5 * size + 5], 1, &bright, NULL), LX_OK); // nobody sees that
    assert_int_equal(lx_finished_range(f, 2, &range, NULL), LX_OK);
    assert_float_equal(range.largest, before.largest, 0);
    assert_float_equal(range.mean, before.mean, 0);
    assert_int_equal(lx_finished_write(f, 2, map.view.count + 1, 1, &brighter, NULL), LX_OK);
    assert_int_equal(lx_finished_range(f, 2, &range, NULL), LX_OK);
    assert_float_equal(range.largest, 2000, 0);
    lx_finished_destroy(f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(images_show_luxels_and_fill_what_is_none),
        cmocka_unit_test(padding_may_have_a_colour_of_its_own),
        cmocka_unit_test(layers_on_disk_are_those_in_memory),
        cmocka_unit_test(ranges_count_what_is_shown),
    };
    return cmocka_run_group_tests(tests, number, release);
}
