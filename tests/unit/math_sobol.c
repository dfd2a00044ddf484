// Low-discrepancy points and colour tables.
#include "math/color.h"
#include "math/sobol.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <cmocka.h>

static uint32_t second_by_definition(uint32_t index)
{
    // Direction numbers of dimension 2: v_0 = 1, v_k = v_{k-1} xor (v_{k-1} >> 1), as left-aligned binary fractions.
    uint32_t result = 0;
    for (uint32_t v = 1u << 31; index; index >>= 1, v ^= v >> 1)
        if (index & 1u) result ^= v;
    return result;
}

static void second_dimension_matches_its_direction_numbers(void **state)
{
    (void)state;
    for (uint32_t i = 0; i < 100000; ++i)
        assert_int_equal(lx_reverse_bits(lx_sobol_second_reversed(i)), second_by_definition(i));
    for (uint32_t i = 0; i < 32; ++i)
        assert_int_equal(lx_reverse_bits(lx_sobol_second_reversed(1u << i)), second_by_definition(1u << i));
}

static void first_points_of_a_stream_fill_every_elementary_interval_once(void **state)
{
    (void)state;
    for (uint32_t key = 0; key < 200; ++key)
        for (int log_count = 1; log_count <= 8; ++log_count)
            for (int log_columns = 0; log_columns <= log_count; ++log_columns) {
                const uint32_t count = 1u << log_count, columns = 1u << log_columns, rows = count / columns;
                unsigned char hit[256] = {0};
                for (uint32_t i = 0; i < count; ++i) {
                    const lx_vec2 p = lx_sobol_pair(i, key * 2654435761u);
                    assert_true(p.x >= 0 && p.x < 1 && p.y >= 0 && p.y < 1);
                    const uint32_t cell = (uint32_t)(p.x * (float)columns) + columns * (uint32_t)(p.y * (float)rows);
                    assert_int_equal(hit[cell]++, 0);
                }
            }
}

static void streams_of_different_keys_are_uncorrelated(void **state)
{
    (void)state;
    // Mean product of centred coordinates over many keys: standard deviation 1 / (12 sqrt(n)).
    double sum = 0;
    const int n = 200000;
    for (int key = 0; key < n; ++key) {
        const lx_vec2 a = lx_sobol_pair(5, (uint32_t)key), b = lx_sobol_pair(5, (uint32_t)key + 1);
        sum += ((double)a.x - 0.5) * ((double)b.x - 0.5);
    }
    assert_true(fabs(sum / n) < 5 / (12 * sqrt(n)));
}

static void srgb_table_matches_the_formula(void **state)
{
    (void)state;
    for (int i = 0; i < 256; ++i) {
        assert_true(fabsf(lx_srgb_byte_to_linear[i] - lx_srgb_to_linear((float)i / 255)) < 1e-6f);
        assert_int_equal((int)(lx_linear_to_srgb(lx_srgb_byte_to_linear[i]) * 255 + 0.5f), i);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(second_dimension_matches_its_direction_numbers),
        cmocka_unit_test(first_points_of_a_stream_fill_every_elementary_interval_once),
        cmocka_unit_test(streams_of_different_keys_are_uncorrelated),
        cmocka_unit_test(srgb_table_matches_the_formula),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
