// Programs against their formulas in the C library's own arithmetic, and drivers: who sets a layer's colour, and when it counts as changed.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "runtime_maker.h"

#include <math.h>

static const double pi = 3.14159265358979323846;

static void evaluate(const lxrt_program *program, double time_s, float rgb[3])
{
    const lxrt_result result = lxrt_program_evaluate(program, time_s, rgb);
    if (result != LXRT_OK) fail_msg("at %g s: %s", time_s, lxrt_result_name(result));
}

static float red_at(const lxrt_program *program, double time_s)
{
    float rgb[3];
    evaluate(program, time_s, rgb);
    return rgb[0];
}

static void assert_rgb(const float *rgb, float r, float g, float b)
{
    if (rgb[0] != r || rgb[1] != g || rgb[2] != b) fail_msg("%.9g %.9g %.9g, not %.9g %.9g %.9g", rgb[0], rgb[1], rgb[2], r, g, b);
}

static void constant_is_color_times_intensity_at_any_time(void **state)
{
    (void)state;
    lxrt_program p = lxrt_program_default();
    float rgb[3];
    evaluate(&p, 17, rgb);
    assert_rgb(rgb, 1, 1, 1);
    p = (lxrt_program){.kind = LXRT_PROGRAM_CONSTANT, .color = {0.5f, 0.25f, -1}, .intensity = 8, .period_s = 1};
    evaluate(&p, -1e300, rgb);
    assert_rgb(rgb, 4, 2, -8);
}

static void blink_is_high_for_its_duty_and_low_for_the_rest(void **state)
{
    (void)state;
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_BLINK;
    p.period_s = 4;
    p.duty = 0.25f;
    p.low = 0.5f;
    p.high = 3;
    p.intensity = 2;
    static const struct {
        double time_s;
        float red;
    } cases[] = {{0, 6}, {0.999, 6}, {1, 1}, {3.999, 1}, {4, 6}, {-0.001, 1}, {-4, 6}, {-3.5, 6}, {4e9, 6}, {4e9 + 2, 1}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) assert_float_equal(red_at(&p, cases[i].time_s), cases[i].red, 0);
    p.phase_s = 1;
    assert_float_equal(red_at(&p, 0), 1, 0);
    assert_float_equal(red_at(&p, 3), 6, 0);
    p.duty = 0;
    for (double t = 0; t < 8; t += 0.25) assert_float_equal(red_at(&p, t), 1, 0);
    p.duty = 1;
    for (double t = 0; t < 8; t += 0.25) assert_float_equal(red_at(&p, t), 6, 0);
}

static void pulse_is_a_raised_cosine(void **state)
{
    (void)state;
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_PULSE;
    p.period_s = 2.5f;
    p.low = 0.125f;
    p.high = 1.125f;
    assert_float_equal(red_at(&p, 0), 0.125f, 0);
    assert_float_equal(red_at(&p, 1.25), 1.125f, 0);
    for (double t = -6; t < 6; t += 0.0137) {
        const double want = 0.125 + 0.5 - 0.5 * cos(2 * pi * t / 2.5);
        const double got = red_at(&p, t);
        if (fabs(got - want) > 0x1p-24 * want * 1.001) fail_msg("at %g s: %.9g, not %.9g", t, got, want); // a float's own rounding
    }
}

static void flicker_stays_between_low_and_high_and_takes_a_new_value_every_period(void **state)
{
    (void)state;
    lxrt_program p = lxrt_program_default(), other;
    p.kind = LXRT_PROGRAM_FLICKER;
    p.period_s = 0.125f;
    p.low = 0.25f;
    p.high = 0.75f;
    p.seed = 5;
    other = p;
    other.seed = 6;
    double sum = 0, squares = 0, products = 0;
    enum { count = 20000 };
    float before = red_at(&p, -0.125);
    for (int i = 0; i < count; ++i) {
        const float here = red_at(&p, 0.125 * i);
        assert_true(here >= 0.25f && here < 0.75f);
        // Between two values: smoothstep
        const double third = red_at(&p, 0.125 * i - 0.125 + 0.125 / 4), s = 0.25 * 0.25 * (3 - 2 * 0.25);
        assert_float_equal(third, before + (here - before) * s, 1e-6);
        const double u = (here - 0.25) / 0.5, v = (red_at(&other, 0.125 * i) - 0.25) / 0.5, previous = (before - 0.25) / 0.5;
        sum += u;
        squares += u * u;
        products += (u - 0.5) * (v - 0.5) + (u - 0.5) * (previous - 0.5);
        before = here;
    }
    // Uniform and independent: mean 1/2, mean square 1/3, products of different ones 0. Five standard deviations.
    assert_float_equal(sum / count, 0.5, 5 * sqrt(1.0 / 12 / count));
    assert_float_equal(squares / count, 1.0 / 3, 5 * sqrt(4.0 / 45 / count));
    assert_float_equal(products / count, 0, 5 * sqrt(2.0 / 144 / count));
    for (int i = 0; i < 100; ++i) assert_float_equal(red_at(&p, i * 0.0371), red_at(&p, i * 0.0371), 0);
}

static void wheel_starts_at_its_color_and_passes_through_the_other_hues(void **state)
{
    (void)state;
    lxrt_program p = lxrt_program_default();
    float rgb[3];
    p.kind = LXRT_PROGRAM_WHEEL;
    p.period_s = 6;
    p.intensity = 10;
    p.color[1] = p.color[2] = 0; // red
    static const float sixths[6][3] = {{10, 0, 0}, {10, 10, 0}, {0, 10, 0}, {0, 10, 10}, {0, 0, 10}, {10, 0, 10}};
    for (int i = -6; i < 12; ++i) {
        const float *want = sixths[(i + 6) % 6];
        evaluate(&p, i, rgb);
        assert_rgb(rgb, want[0], want[1], want[2]);
    }
    evaluate(&p, 0.25, rgb);
    assert_rgb(rgb, 10, 2.5f, 0);
    // Any colour: after whole turns it is itself again, after a third its channels have moved on by one; the largest stays the largest.
    const float colors[][3] = {{0.25f, 0.5f, 0.125f}, {0.125f, 0.25f, 1}, {1, 0.5f, 0.75f}, {0.5f, 0.75f, 0.75f}};
    for (size_t i = 0; i < sizeof colors / sizeof *colors; ++i) {
        const float *c = colors[i];
        memcpy(p.color, c, sizeof p.color);
        p.intensity = 1;
        evaluate(&p, 12, rgb);
        for (int k = 0; k < 3; ++k) assert_float_equal(rgb[k], c[k], 1e-7);
        evaluate(&p, 2, rgb);
        for (int k = 0; k < 3; ++k) assert_float_equal(rgb[(k + 1) % 3], c[k], 1e-7);
        for (double t = 0; t < 6; t += 0.01) {
            evaluate(&p, t, rgb);
            assert_float_equal(fmaxf(rgb[0], fmaxf(rgb[1], rgb[2])), fmaxf(c[0], fmaxf(c[1], c[2])), 1e-7);
            assert_float_equal(fminf(rgb[0], fminf(rgb[1], rgb[2])), fminf(c[0], fminf(c[1], c[2])), 1e-7);
        }
    }
    p.color[0] = p.color[1] = p.color[2] = 0.5f; // no hue to turn
    evaluate(&p, 1.7, rgb);
    assert_rgb(rgb, 0.5f, 0.5f, 0.5f);
}

static void keys_step_and_interpolate_and_are_held_at_the_ends(void **state)
{
    (void)state;
    static const float keys[] = {1, 10, 0, 5, 3, 20, 1, 5, 3, 50, 0, 5, 7, 30, 2, 5}; // two keys at 3 s: a jump
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_KEYS;
    p.keys = keys;
    p.key_count = 4;
    p.loop = 0;
    static const struct {
        double time_s;
        float linear, step;
    } cases[] = {{-5, 10, 10}, {0, 10, 10}, {1, 10, 10}, {2, 15, 10}, {2.5, 17.5f, 10}, {3, 50, 50}, {5, 40, 50}, {7, 30, 30}, {1e9, 30, 30}};
    float rgb[3];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        p.interpolation = LXRT_LINEAR;
        assert_float_equal(red_at(&p, cases[i].time_s), cases[i].linear, 0);
        p.interpolation = LXRT_STEP;
        assert_float_equal(red_at(&p, cases[i].time_s), cases[i].step, 0);
    }
    p.interpolation = LXRT_LINEAR;
    evaluate(&p, 5, rgb);
    assert_rgb(rgb, 40, 1, 5);
    p.loop = 1; // every 7 s; before the first key of each turn that key is held
    for (size_t i = 1; i < 7; ++i) {
        assert_float_equal(red_at(&p, cases[i].time_s + 7 * 1000), cases[i].linear, 0);
        assert_float_equal(red_at(&p, cases[i].time_s - 7 * 3), cases[i].linear, 0);
    }
    assert_float_equal(red_at(&p, 7), 10, 0);
    p.phase_s = 2;
    assert_float_equal(red_at(&p, 0), 15, 0);
    p.key_count = 1;
    assert_float_equal(red_at(&p, 4.4), 10, 0);
    static const float before_zero[] = {-4, 1, 1, 1, -2, 2, 2, 2}; // nothing to repeat: held
    p.keys = before_zero;
    p.key_count = 2;
    p.phase_s = 0;
    assert_float_equal(red_at(&p, -3), 1.5f, 0);
    assert_float_equal(red_at(&p, 3), 2, 0);
}

static void cubic_keys_follow_the_hermite_spline_of_gltf(void **state)
{
    (void)state;
    // x³ − 2x + 1 on [1, 4] and [4, 5]: a cubic is its own spline. {time, in-tangent, value, out-tangent}
    float keys[3][10];
    const float times[] = {1, 4, 5};
    for (int i = 0; i < 3; ++i) {
        const float x = times[i];
        keys[i][0] = x;
        for (int k = 0; k < 3; ++k) {
            keys[i][1 + k] = keys[i][7 + k] = (float)(k + 1) * (3 * x * x - 2);
            keys[i][4 + k] = (float)(k + 1) * (x * x * x - 2 * x + 1);
        }
    }
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_KEYS;
    p.interpolation = LXRT_CUBIC;
    p.keys = keys[0];
    p.key_count = 3;
    p.loop = 0;
    for (double x = 1; x <= 5; x += 0.03125) {
        float rgb[3];
        evaluate(&p, x, rgb);
        for (int k = 0; k < 3; ++k) assert_float_equal(rgb[k], (k + 1) * (x * x * x - 2 * x + 1), 1e-4);
    }
    keys[0][7] = 100; // the tangent that leaves key 0 is its last part
    keys[0][1] = -100; // and the first means nothing there
    const double s = 0.5, leaving = 3 * (100 - 1.0) * (s * s * s - 2 * s * s + s); // beyond x³ − 2x + 1, whose own tangent is 1
    assert_float_equal(red_at(&p, 2.5), 2.5 * 2.5 * 2.5 - 5 + 1 + leaving, 1e-4);
}

static void schedule_fades_into_each_key_and_repeats(void **state)
{
    (void)state;
    static const float keys[] = {6, 1, 0, 0, 20, 4, 0, 0, 21, 2, 0, 0};
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_SCHEDULE;
    p.period_s = 24;
    p.keys = keys;
    p.key_count = 3;
    p.fade_s = 2;
    static const struct {
        double time_s;
        float red;
    } cases[] = {{6, 2}, {7, 1.5f}, {8, 1}, {19.99, 1}, {20, 1}, {20.5, 2.5f}, // fades in an hour: its key lasts no longer
                 {21, 4}, {22, 3}, {23, 2}, {0, 2}, {5.99, 2}, {24 + 7, 1.5f}, {-17, 1.5f}, {-3, 4}};
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        const float red = red_at(&p, cases[i].time_s);
        if (red != cases[i].red) fail_msg("at %g: %g, not %g", cases[i].time_s, red, cases[i].red);
    }
    p.fade_s = 0;
    assert_float_equal(red_at(&p, 6), 1, 0);
    assert_float_equal(red_at(&p, 20), 4, 0);
    p.key_count = 1;
    p.fade_s = 30;
    assert_float_equal(red_at(&p, 5), 1, 0);
    static const float at_midnight[] = {6, 1, 1, 1, 24, 5, 5, 5};
    p.keys = at_midnight;
    p.key_count = 2;
    p.fade_s = 0;
    assert_float_equal(red_at(&p, 0), 5, 0);
    assert_float_equal(red_at(&p, 6), 1, 0);
}

static void programs_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    static const float backward[] = {2, 0, 0, 0, 1, 0, 0, 0}, late[] = {0, 0, 0, 0, 2, 0, 0, 0}, early[] = {-1, 0, 0, 0}, nan_key[] = {0, 0, NAN, 0};
    const lxrt_program fine = lxrt_program_default();
    lxrt_program cases[32];
    int count = 0;
    float rgb[3] = {7, 7, 7};
#define BROKEN(field, value) (cases[count] = fine, cases[count++].field = (value))
    BROKEN(kind, (lxrt_program_kind)7);
    BROKEN(kind, (lxrt_program_kind)-1);
    BROKEN(kind, LXRT_PROGRAM_KEYS); // without keys
    BROKEN(kind, LXRT_PROGRAM_SCHEDULE);
    BROKEN(color[2], NAN);
    BROKEN(intensity, INFINITY);
    BROKEN(period_s, 0);
    BROKEN(period_s, -1);
    BROKEN(period_s, INFINITY);
    BROKEN(period_s, NAN);
    BROKEN(phase_s, NAN);
    BROKEN(duty, -0.01f);
    BROKEN(duty, 1.01f);
    BROKEN(duty, NAN);
    BROKEN(low, -INFINITY);
    BROKEN(high, NAN);
    BROKEN(fade_s, -1);
    BROKEN(fade_s, INFINITY);
    BROKEN(interpolation, (lxrt_interpolation)3);
    const struct {
        const float *keys;
        uint32_t count;
        lxrt_program_kind kind;
    } keys[] = {{backward, 2, LXRT_PROGRAM_KEYS}, {backward, 0, LXRT_PROGRAM_KEYS}, {nan_key, 1, LXRT_PROGRAM_KEYS},
                {late, 2, LXRT_PROGRAM_SCHEDULE}, {early, 1, LXRT_PROGRAM_SCHEDULE}, {backward, 2, LXRT_PROGRAM_SCHEDULE}};
    for (size_t i = 0; i < sizeof keys / sizeof *keys; ++i) {
        BROKEN(kind, keys[i].kind);
        cases[count - 1].keys = keys[i].keys;
        cases[count - 1].key_count = keys[i].count;
    }
#undef BROKEN
    made_pack made = made_create(&(made_desc){.layer_count = 1});
    assert_int_equal(made_open(&made), LXRT_OK);
    for (int i = 0; i < count; ++i) {
        if (lxrt_program_evaluate(&cases[i], 0, rgb) != LXRT_ERROR_INVALID_ARGUMENT) fail_msg("case %d passed", i);
        assert_int_equal(lxrt_set_program(made.pack, 0, &cases[i]), LXRT_ERROR_INVALID_ARGUMENT);
    }
    assert_int_equal(lxrt_program_evaluate(&fine, NAN, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_program_evaluate(&fine, -INFINITY, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_program_evaluate(NULL, 0, rgb), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_program_evaluate(&fine, 0, NULL), LXRT_ERROR_INVALID_ARGUMENT);
    assert_rgb(rgb, 7, 7, 7);
    assert_int_equal(lxrt_set_program(made.pack, 1, &fine), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_set_callback(made.pack, 1, NULL, NULL), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_reset_driver(made.pack, 1), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_update(made.pack, 0), 0); // none of them drives the layer
    made_release(&made);
}

// Whatever passes stays finite at any time, also with the largest of floats everywhere.
static void programs_at_the_limits_of_floats_stay_finite(void **state)
{
    (void)state;
    static const float keys[] = {-3e38f, 3e38f, -3e38f, 3e38f, 3e38f,  -3e38f, 3e38f, 3e38f,  3e38f, 3e38f,
                                 3e38f,  3e38f, 3e38f,  3e38f, -3e38f, -3e38f, 3e38f, -3e38f, 3e38f, -3e38f};
    static const float daily[] = {0, 3e38f, -3e38f, 1, 1e38f, -3e38f, 3e38f, 1};
    static const double times[] = {0, 1e-300, 1, -1, 1e15, 1e38, -1e38, 1e300, -1e300};
    static const float periods[] = {1e-45f, 1e-38f, 1, 3e38f};
    for (int kind = LXRT_PROGRAM_CONSTANT; kind <= LXRT_PROGRAM_SCHEDULE; ++kind) {
        for (size_t i = 0; i < sizeof periods / sizeof *periods; ++i) {
            for (int interpolation = LXRT_STEP; interpolation <= LXRT_CUBIC; ++interpolation) {
                for (size_t t = 0; t < sizeof times / sizeof *times; ++t) {
                    lxrt_program p = {(lxrt_program_kind)kind, {3e38f, -3e38f, 3e38f}, 3e38f, periods[i], -3e38f, 0.5f, -3e38f, 3e38f, 3e38f,
                                      UINT32_MAX, keys, 2, (lxrt_interpolation)interpolation, 1};
                    float rgb[3];
                    if (kind == LXRT_PROGRAM_SCHEDULE) {
                        p.keys = daily;
                        p.key_count = periods[i] > 1e38f ? 2 : 1;
                    }
                    evaluate(&p, times[t], rgb);
                    for (int k = 0; k < 3; ++k) assert_true(fabsf(rgb[k]) <= 1e27f);
                }
            }
        }
    }
}

static void layer_color(const lxrt_pack *pack, uint32_t layer, float rgb[3])
{
    assert_int_equal(lxrt_get_layer(pack, layer, rgb), LXRT_OK);
}

static lxrt_program constant(float r, float g, float b, float intensity)
{
    lxrt_program p = lxrt_program_default();
    p.color[0] = r;
    p.color[1] = g;
    p.color[2] = b;
    p.intensity = intensity;
    return p;
}

static lxrt_program linear_keys(const float *keys, uint32_t count)
{
    lxrt_program p = lxrt_program_default();
    p.kind = LXRT_PROGRAM_KEYS;
    p.keys = keys;
    p.key_count = count;
    return p;
}

static void layers_without_animations_keep_what_set_layer_gave_them(void **state)
{
    (void)state;
    const made_layer layers[] = {{{1, 0.5f, 0}, 4, 1}, {{1, 1, 1}, 2, 1}};
    const made_animation animation = {"sweep", 1, 0, constant(0, 0, 1, 3)};
    made_pack made = made_create(&(made_desc){.layers = layers, .layer_count = 2, .animations = &animation, .animation_count = 1});
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    layer_color(made.pack, 1, rgb); // authored until the first update
    assert_rgb(rgb, 2, 2, 2);
    lxrt_set_layer(made.pack, 0, (const float[3]){9, 8, 7}, 1);
    assert_int_equal(lxrt_update(made.pack, 0), 1);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 9, 8, 7);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 0, 0, 3);
    assert_int_equal(lxrt_update(made.pack, 100), 0); // driven, but the same colour
    assert_int_equal(lxrt_reset_driver(made.pack, 0), LXRT_OK);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 4, 2, 0);
    made_release(&made);
}

static void color_and_intensity_tracks_combine_and_the_last_name_wins(void **state)
{
    (void)state;
    static const float red_to_green[] = {0, 1, 0, 0, 2, 0, 1, 0}, blue[] = {0, 0, 0, 1}, brighter[] = {0, 10, 2, 30}, dim[] = {0, 0.5f};
    const made_layer layers[] = {{{1, 0.5f, 0.25f}, 4, 1}};
    const made_animation animations[] = {
        {"day", 0, 1, linear_keys(red_to_green, 2)},
        {"day", 0, 2, linear_keys(brighter, 2)},
        {"solid", 0, 0, constant(1, 1, 1, 7)},
        {"night", 0, 2, linear_keys(dim, 1)},
        {"night", 0, 1, linear_keys(blue, 1)},
    };
    made_pack made = made_create(&(made_desc){layers, 1, NULL, 0, animations, 5});
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    lxrt_update(made.pack, 1);
    layer_color(made.pack, 0, rgb); // night: both channels
    assert_rgb(rgb, 0, 0, 0.5f);

    lxrt_play(made.pack, "night", 0);
    lxrt_update(made.pack, 1);
    layer_color(made.pack, 0, rgb); // solid hides day
    assert_rgb(rgb, 7, 7, 7);

    lxrt_play(made.pack, "solid", 0);
    lxrt_update(made.pack, 1);
    layer_color(made.pack, 0, rgb); // (½, ½, 0) × 20
    assert_rgb(rgb, 10, 10, 0);
    made_release(&made);

    // A colour alone keeps the layer's intensity, an intensity alone its colour, also behind a whole one.
    const made_animation alone[] = {{"a", 0, 0, constant(5, 5, 5, 5)}, {"b", 0, 1, linear_keys(blue, 1)}, {"c", 0, 0, constant(5, 5, 5, 5)},
                                    {"d", 0, 2, linear_keys(dim, 1)}};
    made = made_create(&(made_desc){layers, 1, NULL, 0, alone, 4});
    assert_int_equal(made_open(&made), LXRT_OK);
    lxrt_update(made.pack, 0);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 0.5f, 0.25f, 0.125f);
    lxrt_play(made.pack, "d", 0);
    lxrt_play(made.pack, "c", 0);
    lxrt_update(made.pack, 0);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 0, 0, 4);
    made_release(&made);
}

static void stopped_animations_leave_the_color_and_start_again_where_time_is(void **state)
{
    (void)state;
    static const float ramp[] = {0, 0, 0, 0, 10, 10, 20, 30};
    const made_animation animations[] = {{"sun", 1, 0, linear_keys(ramp, 2)}, {"", 0, 0, linear_keys(ramp, 2)}};
    made_pack made = made_create(&(made_desc){.layer_count = 2, .animations = animations, .animation_count = 2});
    float rgb[3];
    lxrt_animation info;
    assert_int_equal(made_open(&made), LXRT_OK);
    assert_int_equal(lxrt_get_animation(made.pack, 0, &info), LXRT_OK);
    assert_string_equal(info.name, "sun");
    assert_int_equal(info.layer, 1);
    assert_int_equal(info.kind, LXRT_PROGRAM_KEYS);
    assert_float_equal(info.duration_s, 10, 0);
    assert_int_equal(info.playing, 1);
    assert_int_equal(lxrt_get_animation(made.pack, 2, &info), LXRT_ERROR_NOT_FOUND);

    assert_int_equal(lxrt_update(made.pack, 3), 2);
    assert_int_equal(lxrt_play(made.pack, "sun", 0), LXRT_OK);
    assert_int_equal(lxrt_get_animation(made.pack, 0, &info), LXRT_OK);
    assert_int_equal(info.playing, 0);
    assert_int_equal(lxrt_update(made.pack, 5), 1);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 3, 6, 9);
    assert_int_equal(lxrt_play(made.pack, "sun", 1), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 5), 1);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 5, 10, 15);
    assert_int_equal(lxrt_play(made.pack, NULL, 0), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 8), 0);
    assert_int_equal(lxrt_play(made.pack, "", 1), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 8), 1);
    assert_int_equal(lxrt_play(made.pack, "moon", 1), LXRT_ERROR_NOT_FOUND);
    assert_int_equal(lxrt_update(made.pack, NAN), 0);
    made_release(&made);
}

static void program_takes_over_and_the_animations_come_back(void **state)
{
    (void)state;
    const made_animation animation = {"", 0, 0, constant(1, 0, 0, 5)};
    made_pack made = made_create(&(made_desc){.layer_count = 1, .animations = &animation, .animation_count = 1});
    lxrt_program blink = lxrt_program_default();
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    blink.kind = LXRT_PROGRAM_BLINK;
    assert_int_equal(lxrt_set_program(made.pack, 0, &blink), LXRT_OK);
    blink.high = 77; // a copy was kept
    assert_int_equal(lxrt_update(made.pack, 0.25), 0); // 1, as authored
    assert_int_equal(lxrt_update(made.pack, 0.75), 1);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 0, 0, 0);
    assert_int_equal(lxrt_set_program(made.pack, 0, NULL), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 0.25), 0);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 0, 0, 0);
    assert_int_equal(lxrt_reset_driver(made.pack, 0), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 0.25), 1);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 5, 0, 0);
    made_release(&made);
}

// A scale makes texels × factor overflow where c alone would not: such colours are dimmed, not skipped, so that time alone decides.
static void colors_too_bright_to_be_summed_are_dimmed_to_the_brightest(void **state)
{
    (void)state;
    const made_layer layers[] = {{{0, 0, 0}, 0, 0x1p20f}, {{0, 0, 0}, 0, 0x1p-20f}};
    const made_animation animations[] = {{"", 0, 0, constant(1e30f, -1e30f, 1, 1e30f)}, {"", 1, 0, constant(1e30f, -1e30f, 1, 1)}};
    made_pack made = made_create(&(made_desc){layers, 2, NULL, 0, animations, 2});
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 0), 2);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 1e27f / 0x1p20f, -1e27f / 0x1p20f, 1e27f / 0x1p20f);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 1e27f, -1e27f, 1);
    made_release(&made);
}

// ---- as an engine would: its own lights, animated by whatever it has, drive the layers -------------------------------------------

typedef struct engine_light {
    const char *name;
    float color[3], candela;
    int on;
} engine_light;

typedef struct engine {
    engine_light lights[2];
    const engine_light *of_layer[2];
    int reads;
} engine;

static void read_engine_light(void *user, uint32_t layer, double time_s, float rgb[3])
{
    engine *e = user;
    const engine_light *light = e->of_layer[layer];
    (void)time_s;
    ++e->reads;
    for (int i = 0; i < 3; ++i) rgb[i] = light->on ? light->color[i] * light->candela : 0;
}

static void write_garbage(void *user, uint32_t layer, double time_s, float rgb[3])
{
    (void)layer;
    (void)time_s;
    assert_rgb(rgb, 3, 3, 3); // what it holds now
    rgb[1] = *(const float *)user;
}

static void engine_lights_drive_their_layers_through_callbacks(void **state)
{
    (void)state;
    made_pack made = made_create(&(made_desc){.layer_count = 2});
    engine e = {{{"lamp", {1, 0.5f, 0}, 100, 1}, {"neon", {0, 1, 1}, 8, 0}}, {&e.lights[0], &e.lights[1]}, 0};
    float rgb[3];
    assert_int_equal(made_open(&made), LXRT_OK);
    for (uint32_t layer = 0; layer < 2; ++layer) assert_int_equal(lxrt_set_callback(made.pack, layer, read_engine_light, &e), LXRT_OK);
    assert_int_equal(lxrt_update(made.pack, 0), 2);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 100, 50, 0);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 0, 0, 0);
    e.lights[1].on = 1; // a switch in the game
    assert_int_equal(lxrt_update(made.pack, 0.016), 1);
    layer_color(made.pack, 1, rgb);
    assert_rgb(rgb, 0, 8, 8);
    assert_int_equal(lxrt_update(made.pack, 0.032), 0);
    assert_int_equal(e.reads, 6);
    assert_int_equal(lxrt_set_callback(made.pack, 0, NULL, NULL), LXRT_OK);
    e.lights[0].on = e.lights[1].on = 0;
    assert_int_equal(lxrt_update(made.pack, 0.048), 1);
    layer_color(made.pack, 0, rgb);
    assert_rgb(rgb, 100, 50, 0);

    const float garbage[] = {NAN, INFINITY, -1e30f};
    for (int i = 0; i < 3; ++i) {
        lxrt_set_layer(made.pack, 0, (const float[3]){3, 3, 3}, 1);
        assert_int_equal(lxrt_set_callback(made.pack, 0, write_garbage, (void *)&garbage[i]), LXRT_OK);
        assert_int_equal(lxrt_update(made.pack, 0.048), 0);
        layer_color(made.pack, 0, rgb);
        assert_rgb(rgb, 3, 3, 3);
    }
    made_release(&made);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(constant_is_color_times_intensity_at_any_time),
        cmocka_unit_test(blink_is_high_for_its_duty_and_low_for_the_rest),
        cmocka_unit_test(pulse_is_a_raised_cosine),
        cmocka_unit_test(flicker_stays_between_low_and_high_and_takes_a_new_value_every_period),
        cmocka_unit_test(wheel_starts_at_its_color_and_passes_through_the_other_hues),
        cmocka_unit_test(keys_step_and_interpolate_and_are_held_at_the_ends),
        cmocka_unit_test(cubic_keys_follow_the_hermite_spline_of_gltf),
        cmocka_unit_test(schedule_fades_into_each_key_and_repeats),
        cmocka_unit_test(programs_that_make_no_sense_are_refused),
        cmocka_unit_test(programs_at_the_limits_of_floats_stay_finite),
        cmocka_unit_test(layers_without_animations_keep_what_set_layer_gave_them),
        cmocka_unit_test(color_and_intensity_tracks_combine_and_the_last_name_wins),
        cmocka_unit_test(stopped_animations_leave_the_color_and_start_again_where_time_is),
        cmocka_unit_test(program_takes_over_and_the_animations_come_back),
        cmocka_unit_test(colors_too_bright_to_be_summed_are_dimmed_to_the_brightest),
        cmocka_unit_test(engine_lights_drive_their_layers_through_callbacks),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
