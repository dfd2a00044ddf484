// Seams agree after stitching, what is not near one stays, and black stays black.
#include "unit/post_fixture.h"

#include "post/stitch.h"

static uint32_t shown[page_texels], chart[page_texels];
static lx_rgb entries[2 * page_texels], before[2 * page_texels];

// Texels' luxels and charts after dilation.
static void dilate(void)
{
    uint8_t valid[page_texels];
    lx_error error;
    for (uint32_t t = 0; t < page_texels; ++t) {
        chart[t] = map.index[t] == LX_NO_LUXEL ? LX_NO_CHART : map.chart[map.index[t]];
        valid[t] = map.index[t] != LX_NO_LUXEL && map.valid[map.index[t]];
    }
    assert_int_equal(lx_dilate_map(page_edge, 4, chart, valid, shown, &error), LX_OK);
    for (uint32_t t = 0; t < page_texels; ++t)
        if (shown[t] != UINT32_MAX) shown[t] = map.index[shown[t]];
}

// Two halves of one floor, chart 0 and chart 1; the second lies on its side on the page, half a texel off the grid of the first along the seam.
static lx_seam two_charts(void)
{
    map_clear();
    map_add(0, 4, 4, 16, 24, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
    map_add(1, 30, 40, 24, 12, lx_v3(16, 0, -0.5f), lx_v3(0, 0, 1), lx_v3(1, 0, 0)); // its right is the first one's down
    dilate();
    return (lx_seam){{{{20, 5}, {20, 27}, 0, 0}, {{31.5f, 40}, {53.5f, 40}, 0, 1}}};
}

// What bilinear filtering shows at a place on the page.
static float filtered(const lx_stitch *stitch, float x, float y)
{
    const float x0 = floorf(x - 0.5f), y0 = floorf(y - 0.5f), fx = x - 0.5f - x0, fy = y - 0.5f - y0;
    float sum = 0;
    for (int k = 0; k < 4; ++k) {
        const uint32_t texel = ((uint32_t)y0 + (uint32_t)(k >> 1)) * page_edge + (uint32_t)x0 + (k & 1);
        uint32_t entry = shown[texel];
        for (uint32_t i = 0; i < lx_stitch_texel_count(stitch); ++i)
            if (lx_stitch_texels(stitch)[i] == texel) entry = map.count + i;
        if (entry != UINT32_MAX) sum += entries[entry].r * (k & 1 ? fx : 1 - fx) * (k >> 1 ? fy : 1 - fy);
    }
    return sum;
}

static float difference_along(const lx_stitch *stitch, const lx_seam *seam)
{
    float sum = 0;
    for (int i = 0; i <= 100; ++i) {
        float side[2];
        for (int k = 0; k < 2; ++k) {
            const lx_seam_side *s = &seam->sides[k];
            const float t = 0.01f * (float)i;
            side[k] = filtered(stitch, s->from.x + t * (s->to.x - s->from.x), s->from.y + t * (s->to.y - s->from.y));
        }
        sum += (side[0] - side[1]) * (side[0] - side[1]);
    }
    return sqrtf(sum / 101);
}

static lx_stitch *stitch_of(const lx_seam *seams, size_t count)
{
    lx_stitch *stitch;
    lx_error error;
    if (lx_stitch_create(&map, shown, chart, seams, count, &stitch, &error) != LX_OK) fail_msg("%s", error.message);
    return stitch;
}

static void apply(const lx_stitch *stitch)
{
    for (uint32_t i = 0; i < lx_stitch_texel_count(stitch); ++i) entries[map.count + i] = entries[shown[lx_stitch_texels(stitch)[i]]];
    memcpy(before, entries, sizeof entries);
    void *scratch = malloc(lx_stitch_scratch_bytes(stitch));
    lx_stitch_apply(stitch, entries, scratch);
    free(scratch);
}

static void fill(float of_first, float of_second, float noise)
{
    for (uint32_t i = 0; i < map.count; ++i)
        for (int c = 0; c < 3; ++c)
            (&entries[i].r)[c] = (map.chart[i] == 0 ? of_first : of_second) * (1 + noise * (2 * random_of(3 + (uint32_t)c, i) - 1));
}

static void stitch_unequal_charts_agree_along_the_seam(void **state)
{
    (void)state;
    const lx_seam seam = two_charts();
    lx_stitch *stitch = stitch_of(&seam, 1);
    fill(1, 2, 0.3f);
    apply(stitch);
    const float after = difference_along(stitch, &seam);
    memcpy(entries, before, sizeof entries);
    const float at_first = difference_along(stitch, &seam);
    if (!(after * 10 < at_first)) fail_msg("%g of %g is left", (double)after, (double)at_first);
    lx_stitch_destroy(stitch);
}

static void stitch_leaves_luxels_beyond_the_first_row_alone(void **state)
{
    (void)state;
    const lx_seam seam = two_charts();
    lx_stitch *stitch = stitch_of(&seam, 1);
    fill(1, 2, 0.3f);
    apply(stitch);
    uint32_t moved = 0;
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t x = map.texel[i] % page_edge, y = map.texel[i] / page_edge;
        const bool at_seam = map.chart[i] == 0 ? x == 19 : y == 40;
        if (memcmp(&entries[i], &before[i], sizeof entries[i]) == 0) continue;
        if (!at_seam) fail_msg("texel %u, %u moved", x, y);
        ++moved;
    }
    assert_true(moved > 40);
    lx_stitch_destroy(stitch);
}

static void stitch_equal_light_stays(void **state)
{
    (void)state;
    const lx_seam seam = two_charts();
    lx_stitch *stitch = stitch_of(&seam, 1);
    fill(3, 3, 0);
    apply(stitch);
    for (uint32_t i = 0; i < map.count + lx_stitch_texel_count(stitch); ++i)
        if (!(fabsf(entries[i].g - 3) < 1e-5f)) fail_msg("entry %u became %g", i, (double)entries[i].g); // rounding of weights that sum to 1
    lx_stitch_destroy(stitch);
}

static void stitch_black_stays_black_and_nothing_becomes_negative(void **state)
{
    (void)state;
    const lx_seam seam = two_charts();
    lx_stitch *stitch = stitch_of(&seam, 1);
    fill(0, 0, 0);
    apply(stitch);
    for (uint32_t i = 0; i < map.count + lx_stitch_texel_count(stitch); ++i) assert_true(lx_rgb_is_black(entries[i]));
    fill(0, 1, 1); // single bright and dark texels at the seam
    apply(stitch);
    for (uint32_t i = 0; i < map.count + lx_stitch_texel_count(stitch); ++i)
        assert_true(entries[i].r >= 0 && entries[i].g >= 0 && entries[i].b >= 0);
    lx_stitch_destroy(stitch);
}

static void stitch_without_seams_changes_nothing(void **state)
{
    (void)state;
    two_charts();
    lx_stitch *stitch = stitch_of(NULL, 0);
    assert_int_equal(lx_stitch_texel_count(stitch), 0);
    fill(1, 2, 0.5f);
    apply(stitch);
    assert_memory_equal(entries, before, sizeof entries);
    lx_stitch_destroy(stitch);
}

static void stitch_leaves_the_seam_open_where_a_side_is_hidden(void **state)
{
    (void)state;
    const lx_seam seam = two_charts();
    for (uint32_t i = 0; i < map.count; ++i) luxel_valid[i] = map.texel[i] % page_edge < 18 || map.chart[i] == 1;
    dilate();
    lx_stitch *stitch = stitch_of(&seam, 1);
    fill(1, 2, 0.3f);
    apply(stitch);
    assert_memory_equal(entries, before, sizeof entries);
    lx_stitch_destroy(stitch);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(stitch_unequal_charts_agree_along_the_seam),
        cmocka_unit_test(stitch_leaves_luxels_beyond_the_first_row_alone),
        cmocka_unit_test(stitch_equal_light_stays),
        cmocka_unit_test(stitch_black_stays_black_and_nothing_becomes_negative),
        cmocka_unit_test(stitch_without_seams_changes_nothing),
        cmocka_unit_test(stitch_leaves_the_seam_open_where_a_side_is_hidden),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
