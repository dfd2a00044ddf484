// Half floats against a reference in doubles, RGB9E5 against its definition.
#include "image/encode.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

static uint32_t bits_of(float value)
{
    uint32_t bits;
    memcpy(&bits, &value, sizeof bits);
    return bits;
}

static float float_of(uint32_t bits)
{
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// By the definition of binary16, in doubles.
static double half_value(uint16_t half)
{
    const int exponent = half >> 10 & 0x1f, mantissa = half & 0x3ff;
    const double sign = half & 0x8000 ? -1 : 1;
    if (exponent == 31) return mantissa ? NAN : sign * INFINITY;
    if (exponent == 0) return sign * ldexp(mantissa, -24);
    return sign * ldexp(1024 + mantissa, exponent - 25);
}

// Nearest half, ties to even: quantises with rint in units of the last place.
static double nearest_half(double value)
{
    int exponent;
    if (value == 0 || !isfinite(value)) return value;
    frexp(value, &exponent);
    const int unit = exponent - 11 > -24 ? exponent - 11 : -24;
    const double rounded = ldexp(rint(ldexp(value, -unit)), unit);
    return fabs(rounded) > 65504 ? copysign(INFINITY, value) : rounded;
}

static void half_decodes_every_value_exactly(void **state)
{
    (void)state;
    for (uint32_t h = 0; h < 65536; ++h) {
        const double expected = half_value((uint16_t)h);
        const float actual = lx_half_to_float((uint16_t)h);
        if (isnan(expected)) {
            assert_true(isnan(actual));
        } else {
            assert_true((double)actual == expected);
            assert_int_equal(signbit(actual) != 0, h >> 15);
        }
    }
}

static void half_round_trips_every_value(void **state)
{
    (void)state;
    for (uint32_t h = 0; h < 65536; ++h) {
        const uint16_t back = lx_half_from_float(lx_half_to_float((uint16_t)h));
        if ((h & 0x7c00) == 0x7c00 && (h & 0x3ff))
            assert_int_equal(back, h | 0x200); // NaNs stay NaNs and become quiet
        else
            assert_int_equal(back, h);
    }
}

static void check_rounding(float value)
{
    const double actual = half_value(lx_half_from_float(value)), expected = nearest_half(value);
    if (isnan(value))
        assert_true(isnan(actual));
    else if (actual != expected)
        fail_msg("%a becomes %a instead of %a", value, actual, expected);
}

static void half_rounds_to_nearest_even_at_every_boundary(void **state)
{
    (void)state;
    for (uint32_t h = 0; h < 0x7c00; ++h) {
        const double middle = (half_value((uint16_t)h) + (h == 0x7bff ? 65536 : half_value((uint16_t)(h + 1)))) / 2;
        const uint32_t bits = bits_of((float)middle); // exact: a half has 11 bits
        for (uint32_t step = 0; step < 3; ++step) {
            check_rounding(float_of(bits + step - 1));
            check_rounding(-float_of(bits + step - 1));
        }
    }
}

static void half_rounds_like_the_reference_all_over_the_range(void **state)
{
    (void)state;
    for (uint64_t bits = 0; bits < (uint64_t)1 << 32; bits += 4093) check_rounding(float_of((uint32_t)bits));
}

static void half_overflow_becomes_infinity(void **state)
{
    (void)state;
    assert_int_equal(lx_half_from_float(65519.996f), 0x7bff);
    assert_int_equal(lx_half_from_float(65520.0f), 0x7c00);
    assert_int_equal(lx_half_from_float(1e30f), 0x7c00);
    assert_int_equal(lx_half_from_float(-INFINITY), 0xfc00);
}

static void half_denormals_are_kept(void **state)
{
    (void)state;
    assert_int_equal(lx_half_from_float(0x1p-24f), 1);
    assert_int_equal(lx_half_from_float(0x1p-25f), 0);
    assert_int_equal(lx_half_from_float(0x1.000002p-25f), 1);
    assert_int_equal(lx_half_from_float(-0x1.ff8p-15f), 0x83ff);
}

static void assert_rgb(lx_rgb actual, float r, float g, float b)
{
    if (actual.r != r || actual.g != g || actual.b != b)
        fail_msg("(%a, %a, %a) instead of (%a, %a, %a)", actual.r, actual.g, actual.b, r, g, b);
}

static void assert_exact(float r, float g, float b)
{
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){r, g, b})), r, g, b);
}

static void rgb9e5_keeps_representable_values(void **state)
{
    (void)state;
    assert_exact(0, 0, 0);
    assert_exact(1, 0.5f, 0.25f);
    assert_exact(511, 1, 256);
    assert_exact(65408, 128, 0);
    assert_exact(0x1p-24f, 0, 0x1.fep-16f);
    for (int exponent = -24; exponent < 16; ++exponent) assert_exact(ldexpf(1, exponent), 0, ldexpf(1, exponent));
}

static void rgb9e5_has_the_bit_layout_of_the_extension(void **state)
{
    (void)state;
    // 1.0 = 256 · 2^(16 - 24)
    assert_int_equal(lx_rgb9e5_encode((lx_rgb){1, 0, 0}), 16u << 27 | 256u);
    assert_int_equal(lx_rgb9e5_encode((lx_rgb){0, 1, 0}), 16u << 27 | 256u << 9);
    assert_int_equal(lx_rgb9e5_encode((lx_rgb){0, 0, 1}), 16u << 27 | 256u << 18);
    assert_rgb(lx_rgb9e5_decode(31u << 27 | 511u | 1u << 9 | 2u << 18), 65408, 128, 256);
}

static void rgb9e5_round_trips_every_normalised_code(void **state)
{
    (void)state;
    for (uint32_t exponent = 0; exponent < 32; ++exponent)
        for (uint32_t mantissa = exponent ? 256 : 0; mantissa < 512; ++mantissa) {
            const uint32_t bits = exponent << 27 | mantissa | (mantissa / 3) << 9 | (511 - mantissa) / 2 << 18;
            assert_int_equal(lx_rgb9e5_encode(lx_rgb9e5_decode(bits)), bits);
        }
}

static void rgb9e5_clamps_what_it_cannot_hold(void **state)
{
    (void)state;
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){-1, NAN, 1e30f})), 0, 0, 65408);
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){INFINITY, -INFINITY, 65408.0f})), 65408, 0, 65408);
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){1e-30f, 0x1p-140f, 0})), 0, 0, 0);
}

// Rounds up to the next exponent: 511.5 / 256 has no 9-bit mantissa.
static void rgb9e5_rounding_up_carries_into_the_exponent(void **state)
{
    (void)state;
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){511.6f, 511.4f, 3})), 512, 512, 4);
    assert_rgb(lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){511.4f, 0.4999999f, 0.5f})), 511, 0, 1);
}

// Half a unit of the mantissa, which is at least 256: 2^-9 of the largest channel.
static void rgb9e5_error_is_bounded_by_the_largest_channel(void **state)
{
    (void)state;
    uint32_t random = 1;
    for (int i = 0; i < 200000; ++i) {
        float c[3];
        for (int k = 0; k < 3; ++k) {
            random = random * 1664525u + 1013904223u;
            c[k] = exp2f((float)(random >> 8) * 0x1p-24f * 30 - 14);
        }
        const lx_rgb back = lx_rgb9e5_decode(lx_rgb9e5_encode((lx_rgb){c[0], c[1], c[2]}));
        const double bound = fmax(c[0], fmax(c[1], c[2])) * 0x1p-9;
        if (fabs((double)back.r - c[0]) > bound || fabs((double)back.g - c[1]) > bound || fabs((double)back.b - c[2]) > bound)
            fail_msg("(%a, %a, %a) becomes (%a, %a, %a)", c[0], c[1], c[2], back.r, back.g, back.b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(half_decodes_every_value_exactly),
        cmocka_unit_test(half_round_trips_every_value),
        cmocka_unit_test(half_rounds_to_nearest_even_at_every_boundary),
        cmocka_unit_test(half_rounds_like_the_reference_all_over_the_range),
        cmocka_unit_test(half_overflow_becomes_infinity),
        cmocka_unit_test(half_denormals_are_kept),
        cmocka_unit_test(rgb9e5_keeps_representable_values),
        cmocka_unit_test(rgb9e5_has_the_bit_layout_of_the_extension),
        cmocka_unit_test(rgb9e5_round_trips_every_normalised_code),
        cmocka_unit_test(rgb9e5_clamps_what_it_cannot_hold),
        cmocka_unit_test(rgb9e5_rounding_up_carries_into_the_exponent),
        cmocka_unit_test(rgb9e5_error_is_bounded_by_the_largest_channel),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
