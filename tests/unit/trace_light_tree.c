// The light tree over a long tube of triangles, seen from near its ends, from its middle, from afar and from inside.
#include "trace/light_tree.h"
#include "math/hash.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdio.h>
#include <stdlib.h>
#include <cmocka.h>

enum { around = 8, along = 60, triangles = 2 * around * along, draws = 200000 };

static const lx_vec3 viewers[] = {{-2.9f, 0.4f, 0.1f}, {0, 0.2f, 0}, {1, -3, 2}, {0.5f, 0, 0.01f}, {200, 50, -70}};
enum { viewer_count = sizeof viewers / sizeof *viewers };

typedef struct tube {
    lx_light_leaf leaves[triangles]; // by triangle
    lx_light_tree tree;
    lx_light_roots roots;
} tube;

static lx_vec3 corner_at(uint32_t i, uint32_t k)
{
    const float angle = 2 * LX_PI * (float)k / around;
    return (lx_vec3){6 * (float)i / along - 3, 0.05f * cosf(angle), 0.05f * sinf(angle)};
}

static void make_tube(tube *t, bool both_sides)
{
    *t = (tube){.roots = {0}};
    for (uint32_t i = 0, n = 0; i < along; ++i)
        for (uint32_t k = 0; k < around; ++k)
            for (uint32_t half = 0; half < 2; ++half, ++n) {
                lx_light_leaf *leaf = &t->leaves[n];
                leaf->corner[0] = corner_at(i, k);
                leaf->corner[1] = half ? corner_at(i + 1, k + 1) : corner_at(i + 1, k);
                leaf->corner[2] = half ? corner_at(i, k + 1) : corner_at(i + 1, k + 1);
                const lx_vec3 cross = lx_cross(lx_sub(leaf->corner[1], leaf->corner[0]), lx_sub(leaf->corner[2], leaf->corner[0]));
                leaf->normal = lx_neg(lx_normalize(cross)); // outwards
                leaf->power = lx_length(cross) / 2 * (i % 7 == 0 ? 3.0f : 1.0f); // brighter rings
                leaf->both_sides = both_sides;
                leaf->triangle = n;
            }
    assert_true(lx_dot(t->leaves[0].normal, corner_at(0, 0)) > 0);
    t->tree.place = calloc(triangles, sizeof *t->tree.place);
    t->tree.share_of = calloc(triangles, sizeof *t->tree.share_of);
    static lx_light_leaf shuffled[triangles];
    for (uint32_t n = 0; n < triangles; ++n) shuffled[n] = t->leaves[n];
    assert_int_equal(lx_light_tree_add(&t->tree, shuffled, triangles, &t->roots, NULL), LX_OK);
}

// Light of a triangle's centre at the viewer, without the receiver's cosine.
static double light_of(const lx_light_leaf *leaf, lx_vec3 viewer)
{
    const lx_vec3 centre = lx_scale(lx_add(lx_add(leaf->corner[0], leaf->corner[1]), leaf->corner[2]), 1.0f / 3);
    const lx_vec3 to = lx_sub(viewer, centre);
    const double cosine = (double)(lx_dot(leaf->normal, to) / lx_length(to)), d2 = (double)lx_dot(to, to);
    return (double)leaf->power * (leaf->both_sides ? fabs(cosine) : fmax(0, cosine)) / d2;
}

static void every_triangle_that_shines_can_be_chosen_and_probabilities_add_up(void **state)
{
    (void)state;
    static tube t;
    for (int both = 0; both < 2; ++both) {
        make_tube(&t, both);
        for (int v = 0; v < viewer_count; ++v) {
            double sum = 0;
            for (uint32_t n = 0; n < triangles; ++n) {
                const float p = lx_light_tree_probability(&t.tree, n, viewers[v]);
                sum += (double)p;
                if (light_of(&t.leaves[n], viewers[v]) > 0) assert_true(p > 0);
            }
            // What is missing led to nodes all of whose children turn away.
            assert_true(sum < 1 + 1e-4);
            uint32_t failures = 0;
            for (uint32_t i = 0; i < 20000; ++i) {
                float u = lx_unit_float(lx_hash32(i)), p;
                uint32_t n;
                failures += !lx_light_tree_sample(&t.tree, t.roots.root, viewers[v], &u, &n, &p);
            }
            const double lost = 1 - sum;
            assert_true(fabs(failures / 20000.0 - lost) < 5 * sqrt(fmax(lost, 0) / 20000) + 1e-3);
        }
        lx_light_tree_release(&t.tree);
    }
}

// Cells are runs of triangles with at least 5 expected draws. By Wilson and Hilferty, 4.3 standard deviations: one false alarm in 10^5.
static void draws_follow_the_probabilities(void **state)
{
    (void)state;
    static tube t;
    make_tube(&t, false);
    for (int v = 0; v < viewer_count; ++v) {
        static uint32_t counts[triangles];
        double rest = 0;
        for (uint32_t n = 0; n < triangles; ++n) counts[n] = 0;
        for (uint32_t i = 0; i < draws; ++i) {
            float u = lx_unit_float(lx_hash32(i * 2 + 1)), p;
            uint32_t n;
            if (!lx_light_tree_sample(&t.tree, t.roots.root, viewers[v], &u, &n, &p)) continue;
            assert_true(u >= 0 && u < 1);
            assert_true(fabsf(p - lx_light_tree_probability(&t.tree, n, viewers[v])) < 1e-5f * p);
            ++counts[n];
            rest += (double)u;
        }
        double statistic = 0, expected = 0, total = 0;
        int cells = 0;
        uint32_t seen = 0, all = 0;
        for (uint32_t n = 0; n < triangles; ++n) {
            const double e = draws * (double)lx_light_tree_probability(&t.tree, n, viewers[v]);
            assert_true(e > 0 || counts[n] == 0);
            expected += e;
            seen += counts[n];
            total += e;
            all += counts[n];
            if (expected < 5) continue;
            statistic += (seen - expected) * (seen - expected) / expected;
            ++cells;
            expected = 0;
            seen = 0;
        }
        assert_true(fabs(all - total) < 5 * sqrt(draws - total + 1) + 1);
        assert_true(cells > 20);
        const double f = cells - 1, z = (cbrt(statistic / f) - (1 - 2 / (9 * f))) / sqrt(2 / (9 * f));
        if (fabs(z) > 4.3) printf("viewer %d: chi-square %.1f with %.0f degrees of freedom\n", v, statistic, f);
        assert_true(fabs(z) <= 4.3);
        assert_true(fabs(rest / all - 0.5) < 5 / sqrt(12.0 * all) + 1e-3); // what is left of u is uniform
    }
    lx_light_tree_release(&t.tree);
}

// Exact second moments, no draws: sum of f² / p. By power, three quarters of the choices near a long tube are too far away or face away.
static void variance_near_a_long_tube_is_a_fraction_of_that_by_power(void **state)
{
    (void)state;
    static tube t;
    make_tube(&t, false);
    double power = 0;
    for (uint32_t n = 0; n < triangles; ++n) power += (double)t.leaves[n].power;
    for (int v = 0; v < 3; ++v) {
        double light = 0, by_tree = 0, by_power = 0;
        for (uint32_t n = 0; n < triangles; ++n) {
            const double f = light_of(&t.leaves[n], viewers[v]);
            if (f == 0) continue;
            light += f;
            by_tree += f * f / (double)lx_light_tree_probability(&t.tree, n, viewers[v]);
            by_power += f * f / ((double)t.leaves[n].power / power);
        }
        const double tree_variance = by_tree - light * light, power_variance = by_power - light * light;
        const double share = v == 2 ? 0.5 : 0.3; // 3 m off, distances tell less
        if (!(tree_variance < share * power_variance))
            fail_msg("viewer %d: variance %g of %g by power (light %g)", v, tree_variance, power_variance, light);
    }
    lx_light_tree_release(&t.tree);
}

// One table for receivers around a place: what each gets by it, over evenly spread draws, is the sum over all triangles.
static void table_of_a_view_gives_each_receiver_its_light(void **state)
{
    (void)state;
    static tube t;
    make_tube(&t, false);
    static lx_light_table table;
    const lx_light_view view = {.centre = {0.3f, -1.2f, 0.4f}, .normal = {0, 0.8f, -0.6f}, .radius = 0.1f, .spread = 0.05f};
    assert_true(lx_light_table_fill(&table, &t.tree, &t.roots, &view));
    assert_false(table.rough);
    static const lx_vec3 offsets[] = {{0, 0, 0}, {0.09f, 0, 0}, {-0.05f, 0.04f, 0.06f}, {0, -0.06f, -0.07f}};
    for (size_t r = 0; r < sizeof offsets / sizeof *offsets; ++r) {
        const lx_vec3 viewer = lx_add(view.centre, offsets[r]);
        double expected = 0, got = 0;
        for (uint32_t n = 0; n < triangles; ++n) expected += light_of(&t.leaves[n], viewer);
        for (uint32_t i = 0; i < draws; ++i) {
            float u = ((float)i + 0.5f) / draws, p;
            uint32_t n;
            const lx_light_choice choice = lx_light_table_choose(&table, &t.tree, u);
            if (!lx_light_tree_finish(&t.tree, &choice, viewer, &u, &n, &p)) continue;
            assert_true(u >= 0 && u < 1 && p > 0 && p <= 1);
            got += light_of(&t.leaves[n], viewer) / (double)p / draws;
        }
        assert_true(fabs(got / expected - 1) < 1e-3); // draws are a stratum of 1 / 200000 each, and there are 960 triangles
    }
    // From within a hand's breadth each receiver sees another part of the tube; with its back to it none sees anything.
    const lx_light_view near = {.centre = {0.3f, -0.2f, 0}, .normal = {0, 1, 0}, .radius = 0.2f, .spread = 0.01f};
    assert_true(lx_light_table_fill(&table, &t.tree, &t.roots, &near) && table.rough);
    const lx_light_view back = {.centre = {0.3f, -1.2f, 0.4f}, .normal = {0, -1, 0}, .radius = 0.1f, .spread = 0.01f};
    assert_false(lx_light_table_fill(&table, &t.tree, &t.roots, &back));
    lx_light_tree_release(&t.tree);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_triangle_that_shines_can_be_chosen_and_probabilities_add_up),
        cmocka_unit_test(draws_follow_the_probabilities),
        cmocka_unit_test(table_of_a_view_gives_each_receiver_its_light),
        cmocka_unit_test(variance_near_a_long_tube_is_a_fraction_of_that_by_power),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
