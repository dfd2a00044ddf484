// Monitors and animations in a pack: every rule of docs/pack-format.md at its limits, and every shorter file.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "runtime_maker.h"

#include <math.h>

enum { layer_count = 6 };

static const float color_keys[] = {0, 1, 0, 0, 2, 0, 1, 0}, daily[] = {0, 1, 1, 1, 8, 0, 0, 0};
static const float intensity_keys[] = {0.5f, 0, 1, 0, 1.5f, 0, 2, 0}; // cubic

// A monitor of 3 × 2 cells and one of a single cell; keys, a cubic track of intensity, a schedule, a program without keys.
static made_pack make_pack(void)
{
    static const made_monitor monitors[] = {{3, 2, 0, {100, 200, 300}}, {1, 1, 5, {0, 0, 1e27f}}};
    made_animation animations[4] = {{"a", 0, 1, lxrt_program_default()},
                                    {"a", 0, 2, lxrt_program_default()},
                                    {"", 1, 0, lxrt_program_default()},
                                    {"", 5, 0, lxrt_program_default()}};
    animations[0].program.kind = animations[1].program.kind = LXRT_PROGRAM_KEYS;
    animations[0].program.keys = color_keys;
    animations[0].program.key_count = 2;
    animations[1].program.interpolation = LXRT_CUBIC;
    animations[1].program.keys = intensity_keys;
    animations[1].program.key_count = 2;
    animations[2].program.kind = LXRT_PROGRAM_SCHEDULE;
    animations[2].program.period_s = 10;
    animations[2].program.keys = daily;
    animations[2].program.key_count = 2;
    animations[3].program.kind = LXRT_PROGRAM_FLICKER;
    return made_create(&(made_desc){.layer_count = layer_count, .monitors = monitors, .monitor_count = 2, .animations = animations,
                                    .animation_count = 4});
}

static void use_everything(lxrt_pack *pack)
{
    static const uint8_t picture[5 * 7 * 4] = {1, 2, 3};
    lxrt_info info;
    lxrt_monitor monitor;
    lxrt_animation animation;
    float rgb[3];
    lxrt_get_info(pack, &info);
    for (uint32_t i = 0; i < info.monitor_count; ++i) {
        assert_int_equal(lxrt_get_monitor(pack, i, &monitor), LXRT_OK);
        assert_true((uint64_t)monitor.first_layer + monitor.columns * monitor.rows <= info.layer_count && strlen(monitor.name) < 1000);
        assert_int_equal(lxrt_monitor_configure(pack, i, NULL, 0.5f), LXRT_OK);
        assert_int_equal(lxrt_monitor_update(pack, i, picture, 5, 7, 0, LXRT_PIXELS_RGBA8_SRGB), LXRT_OK);
    }
    for (uint32_t i = 0; i < info.animation_count; ++i) {
        assert_int_equal(lxrt_get_animation(pack, i, &animation), LXRT_OK);
        assert_true(animation.layer < info.layer_count && isfinite(animation.duration_s) && strlen(animation.name) < 1000);
    }
    static const double times[] = {-1e300, -3, 0, 0.7, 1e9};
    for (size_t t = 0; t < sizeof times / sizeof *times; ++t) {
        lxrt_update(pack, times[t]);
        for (uint32_t i = 0; i < info.layer_count; ++i) {
            assert_int_equal(lxrt_get_layer(pack, i, rgb), LXRT_OK);
            assert_true(isfinite(rgb[0]) && isfinite(rgb[1]) && isfinite(rgb[2]));
        }
    }
}

static void monitors_and_animations_are_read_as_documented(void **state)
{
    (void)state;
    made_pack made = make_pack();
    lxrt_info info;
    lxrt_monitor monitor;
    lxrt_animation animation;
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    lxrt_get_info(made.pack, &info);
    assert_int_equal(info.monitor_count, 2);
    assert_int_equal(info.animation_count, 4);
    assert_int_equal(lxrt_get_monitor(made.pack, 0, &monitor), LXRT_OK);
    assert_string_equal(monitor.name, "tv");
    assert_int_equal(monitor.node, 7);
    assert_int_equal(monitor.material, -1);
    assert_int_equal(monitor.columns, 3);
    assert_int_equal(monitor.rows, 2);
    assert_int_equal(monitor.first_layer, 0);
    assert_float_equal(monitor.strength[2], 300, 0);
    assert_int_equal(lxrt_get_monitor(made.pack, 2, &monitor), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_get_animation(made.pack, 1, &animation), LXRT_OK);
    assert_float_equal(animation.duration_s, 1.5f, 0);
    assert_int_equal(lxrt_get_animation(made.pack, 2, &animation), LXRT_OK);
    assert_float_equal(animation.duration_s, 10, 0);
    assert_int_equal(animation.kind, LXRT_PROGRAM_SCHEDULE);
    lxrt_update(made.pack, 1);
    assert_int_equal(lxrt_get_layer(made.pack, 0, rgb), LXRT_OK);
    assert_float_equal(rgb[0], 0.5f * 1.5f, 0); // half way of both tracks
    assert_float_equal(rgb[1], 0.5f * 1.5f, 0);
    use_everything(made.pack);
    made_release(&made);
}

static void every_documented_rule_is_checked(void **state)
{
    (void)state;
    const made_pack good = make_pack();
    const size_t m = good.monitors_at, a = good.animations_at, k = good.keys_at, d = made_directory_at;
    const uint32_t infinite = 0x7f800000, nan_bits = 0x7fc00000, negative = 0xbf800000, two = 0x40000000;
    const struct {
        size_t at;
        uint32_t value;
        lxrt_result result;
    } cases[] = {
        {m, 0, LXRT_ERROR_CORRUPT},                      // "", but not of two bytes
        {m, 1000, LXRT_ERROR_CORRUPT},
        {m, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {m + 4, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {m + 8, UINT32_MAX, LXRT_OK},
        {m + 12, 0x7fffffff, LXRT_OK},
        {m + 12, 0xfffffffe, LXRT_ERROR_CORRUPT},        // material -2
        {m + 16, 0, LXRT_ERROR_CORRUPT},
        {m + 16, 4, LXRT_ERROR_CORRUPT},                 // more cells than layers
        {m + 16, 4097, LXRT_ERROR_CORRUPT},
        {m + 20, 0, LXRT_ERROR_CORRUPT},
        {m + 20, 0x80000000, LXRT_ERROR_CORRUPT},
        {m + 24, 1, LXRT_ERROR_CORRUPT},
        {m + 24, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {m + 28, infinite, LXRT_ERROR_CORRUPT},
        {m + 28, nan_bits, LXRT_ERROR_CORRUPT},
        {m + 32, negative, LXRT_ERROR_CORRUPT},
        {m + 36, 0x7f000000, LXRT_ERROR_CORRUPT},        // 1.7e38
        {m + 36, 0x80000000, LXRT_OK},                   // -0
        {m + 40, UINT32_MAX, LXRT_OK},                   // reserved
        {a, 1000, LXRT_ERROR_CORRUPT},
        {a + 4, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {a + 8, layer_count, LXRT_ERROR_CORRUPT},
        {a + 8, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {a + 12, 0, LXRT_ERROR_CORRUPT},                 // a colour track without keys
        {a + 12, 6, LXRT_ERROR_CORRUPT},
        {a + 12, 7, LXRT_ERROR_CORRUPT},
        {a + 16, 0, LXRT_OK},
        {a + 16, 2, LXRT_OK},                            // read as {time, value}: 0 1, 0 0
        {a + 16, 3, LXRT_ERROR_CORRUPT},
        {a + 20, 0, LXRT_OK},
        {a + 20, 2, LXRT_ERROR_CORRUPT},                 // cubic keys run into the next ones
        {a + 20, 3, LXRT_ERROR_CORRUPT},
        {a + 24, 1, LXRT_ERROR_CORRUPT},                 // 1 0 0 2, 0 1 0 0: not ascending
        {a + 24, 24, LXRT_ERROR_CORRUPT},
        {a + 24, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {a + 28, 0, LXRT_ERROR_CORRUPT},
        {a + 28, 3, LXRT_ERROR_CORRUPT},
        {a + 28, 0x40000000, LXRT_ERROR_CORRUPT},        // × 4 numbers overflows 32 bits
        {a + 28, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {a + 32, infinite, LXRT_ERROR_CORRUPT},
        {a + 44, nan_bits, LXRT_ERROR_CORRUPT},
        {a + 48, 0, LXRT_ERROR_CORRUPT},
        {a + 48, negative, LXRT_ERROR_CORRUPT},
        {a + 48, infinite, LXRT_ERROR_CORRUPT},
        {a + 48, 1, LXRT_OK},                            // the smallest float
        {a + 52, infinite, LXRT_ERROR_CORRUPT},
        {a + 56, two, LXRT_ERROR_CORRUPT},
        {a + 56, negative, LXRT_ERROR_CORRUPT},
        {a + 60, nan_bits, LXRT_ERROR_CORRUPT},
        {a + 64, infinite, LXRT_ERROR_CORRUPT},
        {a + 68, negative, LXRT_ERROR_CORRUPT},
        {a + 72, UINT32_MAX, LXRT_OK},
        {a + 76, 2, LXRT_ERROR_CORRUPT},
        {a + 80 + 16, 1, LXRT_ERROR_CORRUPT},            // intensities read as colours: too many numbers
        {a + 80 + 20, 1, LXRT_OK},
        {a + 160 + 16, 1, LXRT_ERROR_CORRUPT},           // a schedule drives c
        {a + 160 + 20, 2, LXRT_ERROR_CORRUPT},           // and is not cubic
        {a + 160 + 48, 0x40e00000, LXRT_ERROR_CORRUPT},  // a period of 7 s with a key at 8 s
        {a + 160 + 48, 0x41000000, LXRT_OK},             // 8 s
        {a + 240 + 16, 2, LXRT_ERROR_CORRUPT},
        {a + 240 + 24, UINT32_MAX, LXRT_OK},             // keys are ignored
        {a + 240 + 28, UINT32_MAX, LXRT_OK},
        {k, nan_bits, LXRT_ERROR_CORRUPT},
        {k, infinite, LXRT_ERROR_CORRUPT},
        {k, 0x40400000, LXRT_ERROR_CORRUPT},             // 3 s before 2 s
        {k, two, LXRT_OK},
        {k + 4, infinite, LXRT_ERROR_CORRUPT},
        {d + 32 * made_monitors + 4, 2, LXRT_ERROR_VERSION},
        {d + 32 * made_animations + 4, 0, LXRT_ERROR_VERSION},
        {d + 32 * made_keys + 4, 7, LXRT_ERROR_VERSION},
        {d + 32 * made_monitors + 12, 1, LXRT_ERROR_CORRUPT},
        {d + 32 * made_monitors + 16, 95, LXRT_ERROR_CORRUPT},
        {d + 32 * made_monitors + 24, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {d + 32 * made_monitors + 28, 47, LXRT_ERROR_CORRUPT},
        {d + 32 * made_animations + 24, 0, LXRT_OK},
        {d + 32 * made_animations + 28, 79, LXRT_ERROR_CORRUPT},
        {d + 32 * made_animations + 28, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {d + 32 * made_keys, 0x3f3f3f3f, LXRT_ERROR_CORRUPT},   // no keys at all
        {d + 32 * made_keys + 24, 23, LXRT_ERROR_CORRUPT},
        {d + 32 * made_keys + 28, 3, LXRT_ERROR_CORRUPT},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        made_pack made = make_pack();
        made_put_u32(&made, cases[i].at, cases[i].value);
        const lxrt_result result = made_open(&made);
        if (result != cases[i].result)
            fail_msg("case %zu, u32 at %zu = %u: %s, not %s", i, cases[i].at, cases[i].value, lxrt_result_name(result),
                     lxrt_result_name(cases[i].result));
        if (made.pack) use_everything(made.pack);
        made_release(&made);
    }
    made_pack release = good;
    made_release(&release);
}

// A key that two animations name twice would let a small file ask for much checking.
static void animations_share_no_keys(void **state)
{
    (void)state;
    made_pack made = make_pack();
    made_put_u32(&made, made.animations_at + 160 + 12, LXRT_PROGRAM_KEYS);
    assert_int_equal(made_open(&made), LXRT_OK);
    made_put_u32(&made, made.animations_at + 160 + 24, 0);
    assert_int_equal(made_open(&made), LXRT_OK); // its own two are unused now
    made_put_u32(&made, made.animations_at + 240 + 12, LXRT_PROGRAM_KEYS);
    made_put_u32(&made, made.animations_at + 240 + 28, 1);
    assert_int_equal(made_open(&made), LXRT_ERROR_CORRUPT);
    made_release(&made);
}

static lxrt_result open_copy(const made_pack *made, size_t size)
{
    made_pack copy = {.bytes = malloc(size ? size : 1), .size = size};
    memcpy(copy.bytes, made->bytes, size);
    if (size >= 24) made_put_u32(&copy, 16, (uint32_t)size);
    const lxrt_result result = made_open(&copy);
    if (copy.pack) use_everything(copy.pack);
    made_release(&copy);
    return result;
}

static void every_shorter_file_is_refused(void **state)
{
    (void)state;
    made_pack made = make_pack();
    assert_int_equal(open_copy(&made, made.size), LXRT_OK);
    const size_t tables_end = made.animations_at + 4 * 80;
    for (size_t size = 0; size < tables_end; ++size) assert_int_not_equal(open_copy(&made, size), LXRT_OK);
    for (size_t size = tables_end; size < made.size; ++size) assert_int_equal(open_copy(&made, size), LXRT_ERROR_CORRUPT);
    made_release(&made);
}

static void random_corruption_never_crashes(void **state)
{
    (void)state;
    static const uint32_t nasty[] = {0, 1, 2, 3, 6, 0x7fffffff, 0x80000000, 0xfffffffe, 0xffffffff, 0x10000, 0x7f800000, 0x7fc00000};
    uint32_t random = 1;
    int accepted = 0;
    for (int round = 0; round < 20000; ++round) {
        made_pack made = make_pack();
        for (int hit = 0; hit < 2; ++hit) {
            random = random * 1664525 + 1013904223;
            const size_t tables = made.animations_at + 320 - made.monitors_at;
            const size_t at = (random >> 8) % 3 ? made.monitors_at + random / 4096 % (tables / 4) * 4 : random / 4096 % 80 * 4;
            random = random * 1664525 + 1013904223;
            made_put_u32(&made, at, nasty[(random >> 8) % (sizeof nasty / sizeof *nasty)]);
        }
        if (made_open(&made) == LXRT_OK) {
            ++accepted;
            use_everything(made.pack);
        }
        made_release(&made);
    }
    assert_true(accepted > 500); // or the sanitizers saw nothing
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(monitors_and_animations_are_read_as_documented),
        cmocka_unit_test(every_documented_rule_is_checked),
        cmocka_unit_test(animations_share_no_keys),
        cmocka_unit_test(every_shorter_file_is_refused),
        cmocka_unit_test(random_corruption_never_crashes),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
