#define _POSIX_C_SOURCE 200112L // setenv

// Open Image Denoise through a stand-in (stub/oidn_stub.c) that checks how it is called: what Luxel shows it, what it takes back, what it says when it fails.
#include "unit/post_fixture.h"

#include "post/oidn.h"

static uint32_t shown[page_texels], chart[page_texels];
static lx_rgb luxels[page_texels];

static lx_oidn *open_stub(void)
{
    lx_oidn *oidn;
    lx_error error;
    if (lx_oidn_open(OIDN_STUB, 2, &oidn, &error) != LX_OK) fail_msg("%s", error.message);
    return oidn;
}

// One chart with its padding; luxel (20, 20) is not valid.
static void one_chart(void)
{
    uint8_t valid[page_texels];
    lx_error error;
    map_clear();
    map_add(0, 10, 10, 24, 24, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
    luxel_valid[luxel_index[20 * page_edge + 20]] = 0;
    for (uint32_t t = 0; t < page_texels; ++t) {
        chart[t] = map.index[t] == LX_NO_LUXEL ? LX_NO_CHART : 0;
        valid[t] = map.index[t] != LX_NO_LUXEL && map.valid[map.index[t]];
    }
    assert_int_equal(lx_dilate_map(page_edge, 4, chart, valid, shown, &error), LX_OK);
    for (uint32_t t = 0; t < page_texels; ++t)
        if (shown[t] != UINT32_MAX) shown[t] = map.index[shown[t]];
    for (uint32_t i = 0; i < map.count; ++i) luxels[i] = map.valid[i] ? lx_rgb_of(5, 10, 15) : lx_rgb_of(1000, 1000, 1000);
}

static void oidn_sees_charts_with_padding_and_without_hidden_luxels(void **state)
{
    (void)state;
    lx_error error;
    one_chart();
    lx_oidn *oidn = open_stub();
    assert_int_equal(lx_oidn_denoise(oidn, &map, shown, luxels, &error), LX_OK);
    // A chart of one colour stays so up to its border only if the border's neighbours hold it too.
    for (uint32_t i = 0; i < map.count; ++i) {
        if (!map.valid[i])
            assert_true(luxels[i].r == 1000);
        else if (!(fabsf(luxels[i].r - 5) < 1e-5f && fabsf(luxels[i].b - 15) < 1e-5f))
            fail_msg("luxel %u became %g %g %g", i, (double)luxels[i].r, (double)luxels[i].g, (double)luxels[i].b);
    }
    lx_oidn_close(oidn);
}

static void oidn_result_is_taken_back(void **state)
{
    (void)state;
    lx_error error;
    one_chart();
    const uint32_t bright = luxel_index[15 * page_edge + 15];
    luxels[bright] = lx_rgb_of(105, 10, 15);
    lx_oidn *oidn = open_stub();
    for (int layer = 0; layer < 2; ++layer) { // the filter is kept
        assert_int_equal(lx_oidn_denoise(oidn, &map, shown, luxels, &error), LX_OK);
        if (layer == 0) assert_true(fabsf(luxels[bright].r - 25) < 1e-5f);
    }
    assert_true(fabsf(luxels[bright].r - 25) < 1e-5f); // (25 + 4 · 25) / 5: the cross that the first pass made
    lx_oidn_close(oidn);
}

static void oidn_missing_library_is_told_with_its_reason(void **state)
{
    (void)state;
    lx_oidn *oidn;
    lx_error error;
    assert_int_equal(lx_oidn_open("/nowhere/libOpenImageDenoise.so", 0, &oidn, &error), LX_ERROR_BACKEND);
    assert_non_null(strstr(error.message, "/nowhere/libOpenImageDenoise.so"));
    setenv("LUXEL_OIDN_LIBRARY", "libm.so.6", 1);
    assert_int_equal(lx_oidn_open(NULL, 0, &oidn, &error), LX_ERROR_BACKEND);
    assert_non_null(strstr(error.message, "oidnNewDevice"));
    unsetenv("LUXEL_OIDN_LIBRARY");
}

static void oidn_errors_of_the_library_are_passed_on(void **state)
{
    (void)state;
    lx_oidn *oidn;
    lx_error error;
    one_chart();
    setenv("OIDN_STUB_NO_DEVICE", "1", 1);
    assert_int_equal(lx_oidn_open(OIDN_STUB, 0, &oidn, &error), LX_ERROR_BACKEND);
    assert_non_null(strstr(error.message, "unsupported CPU"));
    unsetenv("OIDN_STUB_NO_DEVICE");
    oidn = open_stub();
    setenv("OIDN_STUB_FAIL", "1", 1);
    assert_int_equal(lx_oidn_denoise(oidn, &map, shown, luxels, &error), LX_ERROR_BACKEND);
    assert_non_null(strstr(error.message, "out of memory"));
    unsetenv("OIDN_STUB_FAIL");
    assert_int_equal(lx_oidn_denoise(oidn, &map, shown, luxels, &error), LX_OK);
    lx_oidn_close(oidn);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(oidn_sees_charts_with_padding_and_without_hidden_luxels),
        cmocka_unit_test(oidn_result_is_taken_back),
        cmocka_unit_test(oidn_missing_library_is_told_with_its_reason),
        cmocka_unit_test(oidn_errors_of_the_library_are_passed_on),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
