// Directions and points against their densities: chi-square tests with fixed seeds and stated significance, closed forms.
#include "math/sobol.h"
#include "trace/lamp_sample.h"
#include "trace/light_sample.h"
#include "trace/sampling.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <cmocka.h>

enum { side = 16, cell_count = side * side, sample_count = 200000 };

static lx_vec2 random_pair(uint32_t index)
{
    return (lx_vec2){lx_unit_float(lx_hash32(2 * index + 1)), lx_unit_float(lx_hash32(0x9e3779b9u + 2 * index))};
}

// Cells of equal expected count: the statistic has cell_count - 1 degrees of freedom; by Wilson and Hilferty its cube root is close to normal.
// 4.3 standard deviations: one false alarm in 10^5.
static void check_uniform_counts(const uint32_t *counts)
{
    const double expected = (double)sample_count / cell_count, freedom = cell_count - 1;
    double statistic = 0;
    for (int i = 0; i < cell_count; ++i) statistic += ((double)counts[i] - expected) * ((double)counts[i] - expected) / expected;
    const double z = (cbrt(statistic / freedom) - (1 - 2 / (9 * freedom))) / sqrt(2 / (9 * freedom));
    if (fabs(z) > 4.3) printf("chi-square %.1f with %.0f degrees of freedom (z %.2f)\n", statistic, freedom, z);
    assert_true(fabs(z) <= 4.3);
}

static void count_cell(uint32_t *counts, float a, float b)
{
    const int x = (int)(lx_clamp(a, 0, 0.999999f) * side), y = (int)(lx_clamp(b, 0, 0.999999f) * side);
    ++counts[y * side + x];
}

static void cosine_hemisphere_has_the_density_it_states(void **state)
{
    (void)state;
    uint32_t counts[cell_count] = {0};
    for (uint32_t i = 0; i < sample_count; ++i) {
        const lx_vec3 d = lx_sample_cosine_hemisphere(random_pair(i));
        // Under cos / pi, sin² of the elevation from the axis and the azimuth are uniform and independent.
        count_cell(counts, d.x * d.x + d.y * d.y, atan2f(d.y, d.x) / (2 * LX_PI) + 0.5f);
        assert_true(fabsf(lx_length(d) - 1) < 1e-5f);
    }
    check_uniform_counts(counts);
}

static void cone_has_the_density_it_states(void **state)
{
    (void)state;
    static const float one_minus_cos[] = {1e-6f, 0.01f, 0.5f, 1, 2};
    for (size_t k = 0; k < sizeof one_minus_cos / sizeof *one_minus_cos; ++k) {
        uint32_t counts[cell_count] = {0};
        for (uint32_t i = 0; i < sample_count; ++i) {
            const lx_vec3 d = lx_sample_cone(random_pair(i), one_minus_cos[k]);
            // 1 - cos from the sine, which keeps its digits for narrow cones.
            const float sine2 = d.x * d.x + d.y * d.y;
            const float height = d.z >= 0 ? sine2 / (1 + d.z) : 1 - d.z;
            count_cell(counts, height / one_minus_cos[k], atan2f(d.y, d.x) / (2 * LX_PI) + 0.5f);
        }
        check_uniform_counts(counts);
    }
}

static void triangle_points_are_uniform_by_area(void **state)
{
    (void)state;
    uint32_t counts[cell_count] = {0};
    for (uint32_t i = 0; i < sample_count; ++i) {
        const lx_vec2 b = lx_sample_triangle(random_pair(i));
        assert_true(b.x >= 0 && b.y >= 0 && b.x + b.y <= 1.000001f);
        // Inverse of the map: (root)² and y / root are uniform.
        const float root = b.x + b.y;
        count_cell(counts, root * root, root > 0 ? b.y / root : 0);
    }
    check_uniform_counts(counts);
}

// Solid angle of a rectangle parallel to the viewer's plane: sum of arctangents over its corners.
static double solid_angle_by_corners(double x0, double y0, double x1, double y1, double z)
{
    const double xs[2] = {x0, x1}, ys[2] = {y0, y1};
    double sum = 0;
    for (int i = 0; i < 2; ++i)
        for (int k = 0; k < 2; ++k) {
            const double x = xs[i], y = ys[k];
            sum += (i == k ? 1 : -1) * atan(x * y / (z * sqrt(x * x + y * y + z * z)));
        }
    return sum;
}

static void spherical_rectangle_knows_its_solid_angle_and_samples_it_evenly(void **state)
{
    (void)state;
    static const float cases[][5] = {// x0, y0, width, height, distance
                                     {-1, -1, 2, 2, 1}, {0.5f, 0.2f, 3, 1, 0.7f}, {-5, 2, 0.5f, 9, 3}, {-0.1f, -0.1f, 0.2f, 0.2f, 0.01f},
                                     {10, 10, 1, 1, 5}};
    for (size_t k = 0; k < sizeof cases / sizeof *cases; ++k) {
        const float *c = cases[k];
        const lx_spherical_rectangle r = lx_spherical_rectangle_of((lx_vec3){c[0], c[1], c[4]}, c[2], c[3]);
        const double exact = solid_angle_by_corners((double)c[0], (double)c[1], (double)(c[0] + c[2]), (double)(c[1] + c[3]), (double)c[4]);
        assert_true(fabs((double)r.solid_angle - exact) < 1e-9 + 1e-6 * exact);
        // Counts by the inverse of the map: share of solid angle left of the sample, and below it within its line.
        uint32_t counts[cell_count] = {0};
        for (uint32_t i = 0; i < sample_count; ++i) {
            const lx_vec3 p = lx_sample_spherical_rectangle(&r, random_pair(i));
            assert_true(p.x >= c[0] - 1e-4f && p.x <= c[0] + c[2] + 1e-4f && p.y >= c[1] - 1e-4f && p.y <= c[1] + c[3] + 1e-4f);
            const double left = solid_angle_by_corners((double)c[0], (double)c[1], (double)p.x, (double)(c[1] + c[3]), (double)c[4]);
            const double d2 = (double)p.x * (double)p.x + (double)c[4] * (double)c[4];
            const double y0 = (double)c[1], y1 = (double)(c[1] + c[3]), y = (double)p.y;
            const double h0 = y0 / sqrt(d2 + y0 * y0), h1 = y1 / sqrt(d2 + y1 * y1), h = y / sqrt(d2 + y * y);
            count_cell(counts, (float)(left / exact), (float)((h - h0) / (h1 - h0)));
        }
        check_uniform_counts(counts);
    }
}

// Between the planes through `at` and either of the others.
static double angle_at(lx_vec3 at, lx_vec3 b, lx_vec3 c)
{
    const lx_vec3 n = lx_normalize_or(lx_cross(at, b), (lx_vec3){0, 0, 0}), m = lx_normalize_or(lx_cross(at, c), (lx_vec3){0, 0, 0});
    return acos(fmin(fmax((double)lx_dot(n, m), -1), 1));
}

// Girard: the sum of the angles less pi.
static double solid_angle_by_angles(lx_vec3 a, lx_vec3 b, lx_vec3 c)
{
    return angle_at(a, b, c) + angle_at(b, c, a) + angle_at(c, a, b) - 3.14159265358979323846;
}

static void spherical_triangle_knows_its_solid_angle_and_samples_it_evenly(void **state)
{
    (void)state;
    static const lx_vec3 cases[][3] = {{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, // an eighth of the sphere
                                       {{-1, -1, 0.5f}, {2, -1, 0.5f}, {0, 3, 0.7f}}, {{4, 1, 2}, {4, 2, 2}, {3, 1, 3}}, {{0, 0, -1}, {0.1f, 0, -1}, {0, 5, 1}}};
    const double eighth = (double)lx_spherical_triangle_of(cases[0]).solid_angle;
    assert_true(fabs(eighth - 3.14159265358979323846 / 2) < 1e-6);
    for (size_t k = 0; k < sizeof cases / sizeof *cases; ++k) {
        const lx_spherical_triangle t = lx_spherical_triangle_of(cases[k]);
        lx_vec3 a = lx_normalize_or(cases[k][0], (lx_vec3){0, 0, 0}), b = lx_normalize_or(cases[k][1], a), c = lx_normalize_or(cases[k][2], a);
        const double all = solid_angle_by_angles(a, b, c);
        assert_true(fabs((double)t.solid_angle - all) < 1e-5 * all + 2e-6);
        // Counts by the inverse of the map: the share of the triangle on a's side of the arc from b through the sample, and how far along that arc it lies.
        uint32_t counts[cell_count] = {0};
        for (uint32_t i = 0; i < sample_count; ++i) {
            const lx_vec3 d = lx_sample_spherical_triangle(&t, random_pair(i));
            assert_true(fabsf(lx_length(d) - 1) < 1e-5f);
            lx_vec3 on_arc = lx_normalize_or(lx_cross(lx_cross(b, d), lx_cross(a, c)), c);
            if (lx_dot(on_arc, lx_add(a, c)) < 0) on_arc = lx_neg(on_arc);
            const double left = solid_angle_by_angles(a, b, on_arc);
            count_cell(counts, lx_clamp((float)(left / all), 0, 0.99999f), lx_clamp((1 - lx_dot(d, b)) / (1 - lx_dot(on_arc, b)), 0, 0.99999f));
        }
        check_uniform_counts(counts);
    }
    const lx_vec3 flat[3] = {{1, 0, 0}, {2, 0, 0}, {3, 0, 0}};
    assert_true(lx_spherical_triangle_of(flat).solid_angle == 0);
}

static void range_and_spot_factors_follow_the_khronos_formulas(void **state)
{
    (void)state;
    assert_true(lx_range_factor(5, 0) == 1);
    assert_true(lx_range_factor(0, 10) == 1);
    assert_true(lx_range_factor(10, 10) == 0);
    assert_true(lx_range_factor(20, 10) == 0);
    assert_true(fabsf(lx_range_factor(5, 10) - (1 - 0.0625f)) < 1e-6f);
    const lx_light light = {.kind = LX_LIGHT_SPOT, .inner_angle = 0.3f, .outer_angle = 0.6f};
    const lx_lamp spot = lx_lamp_of(&light);
    assert_true(lx_spot_factor(&spot, cosf(0.2f)) == 1);
    assert_true(lx_spot_factor(&spot, cosf(0.7f)) == 0);
    const float c = cosf(0.45f), a = (c - cosf(0.6f)) / (cosf(0.3f) - cosf(0.6f));
    assert_true(fabsf(lx_spot_factor(&spot, c) - a * a) < 1e-5f);
}

static void offset_origins_leave_the_surface_at_any_scale(void **state)
{
    (void)state;
    for (float scale = 1e-5f; scale < 1e6f; scale *= 10) {
        const lx_vec3 p = {0.3f * scale, -1.7f * scale, 0.9f * scale}, n = lx_normalize((lx_vec3){1, 2, -2});
        const float distance = lx_dot(lx_sub(lx_offset_origin(p, n), p), n);
        assert_true(distance > 0);
        assert_true(distance < 1e-4f * scale + 1e-4f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(cosine_hemisphere_has_the_density_it_states),
        cmocka_unit_test(cone_has_the_density_it_states),
        cmocka_unit_test(triangle_points_are_uniform_by_area),
        cmocka_unit_test(spherical_rectangle_knows_its_solid_angle_and_samples_it_evenly),
        cmocka_unit_test(spherical_triangle_knows_its_solid_angle_and_samples_it_evenly),
        cmocka_unit_test(range_and_spot_factors_follow_the_khronos_formulas),
        cmocka_unit_test(offset_origins_leave_the_surface_at_any_scale),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
