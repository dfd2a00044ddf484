// New charts: whatever the mesh, nothing overlaps, nothing is turned over, everything has the density it should have.
#include "unwrap_scenes.h"

static lx_atlas_desc small_page(void)
{
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 256;
    return desc;
}

/// Builds, checks, reports and frees the atlas of a scene of new charts.
static atlas_facts check_scene(builder *b, const char *name)
{
    const lx_atlas_desc desc = small_page();
    lx_atlas *atlas = build_atlas(b, &desc);
    const atlas_facts facts = check_atlas(atlas, true);
    print_message("  %-28s %6u triangles %5u charts %4.0f %% covered, %.3g texels/m\n", name, facts.triangles, facts.charts,
                  facts.coverage * 100, (double)atlas->texels_per_m);
    lx_atlas_destroy(atlas);
    return facts;
}

static void assert_density(atlas_facts facts)
{
    assert_true(facts.lowest_density > 0.98 && facts.highest_density < 1.02);
}

static void a_cube_becomes_six_charts(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_box(b, "cube", 1, 1, 1));
    const atlas_facts facts = check_scene(b, "cube");
    assert_int_equal(facts.charts, 6);
    assert_int_equal(facts.uncharted, 0);
    assert_true(facts.coverage > 0.58); // three by two equal squares in a square: 60 % is all there is
    assert_density(facts);
    end(b);
}

static void a_sphere_becomes_about_a_dozen_charts(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "sphere", sphere_point, 48, 24, true, false));
    const atlas_facts facts = check_scene(b, "sphere");
    assert_in_range(facts.charts, 6, 16);
    assert_density(facts);
    end(b);
}

static void a_cylinder_becomes_at_most_five_charts(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "cylinder", cylinder_point, 64, 12, true, false));
    const atlas_facts facts = check_scene(b, "cylinder");
    assert_in_range(facts.charts, 3, 5);
    assert_density(facts);
    end(b);
}

static void a_torus_unwraps(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "torus", torus_point, 64, 24, true, true));
    const atlas_facts facts = check_scene(b, "torus");
    assert_in_range(facts.charts, 6, 40);
    assert_density(facts);
    end(b);
}

static void a_bent_tube_that_passes_over_itself_is_cut(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "spring", spring_point, 16, 180, true, false));
    const atlas_facts facts = check_scene(b, "spring");
    assert_in_range(facts.charts, 8, 80);
    assert_density(facts);
    end(b);
}

static void a_spiral_ramp_that_covers_itself_is_cut(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "ramp", ramp_point, 4, 200, false, false));
    const atlas_facts facts = check_scene(b, "ramp");
    assert_in_range(facts.charts, 4, 12);
    end(b);
}

static void a_moebius_strip_unwraps(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "Moebius strip", moebius_point, 60, 4, false, false));
    check_scene(b, "Moebius strip");
    end(b);
}

static void waves_unwrap(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_surface(b, "waves", wave_point, 60, 60, false, false));
    assert_density(check_scene(b, "waves"));
    end(b);
}

static uint32_t rng_state;
static float random_float(void)
{
    return lx_unit_float(rng_state = lx_hash32(rng_state + 0x9e3779b9u));
}

static void add_soup(builder *b, uint32_t triangles, float spread, float size)
{
    lx_vec3 *p = malloc(3 * (size_t)triangles * sizeof *p);
    uint32_t *indices = malloc(3 * (size_t)triangles * sizeof *indices);
    assert_true(p && indices);
    for (uint32_t t = 0; t < triangles; ++t) {
        const lx_vec3 c = lx_v3(spread * random_float(), spread * random_float(), spread * random_float());
        for (uint32_t k = 0; k < 3; ++k) {
            const lx_vec3 d = lx_v3(random_float() - 0.5f, random_float() - 0.5f, random_float() - 0.5f);
            p[3 * t + k] = lx_mad(c, d, size);
            indices[3 * t + k] = 3 * t + k;
        }
    }
    add_mesh(b, "soup");
    add_primitive(b, p, 3 * triangles, indices, triangles, 0);
    free(p);
    free(indices);
}

static void a_soup_of_triangles_is_a_chart_each(void **state)
{
    (void)state;
    builder *b = begin(1);
    rng_state = 7;
    add_soup(b, 150, 10, 2);
    place(b, 0);
    const atlas_facts facts = check_scene(b, "soup");
    assert_int_equal(facts.charts, 150);
    assert_density(facts);
    end(b);
}

static void t_junctions_do_not_disturb(void **state)
{
    (void)state;
    // A quad whose right neighbour is split at half its height, without a vertex there on the left.
    const lx_vec3 p[] = {{0, 0, 0}, {0, 0, 2}, {1, 0, 2}, {1, 0, 0}, {1, 0, 1}, {2, 0, 0}, {2, 0, 1}, {2, 0, 2}};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3, 3, 4, 6, 3, 6, 5, 4, 2, 7, 4, 7, 6};
    builder *b = begin(1);
    add_mesh(b, "T-junction");
    add_primitive(b, p, 8, indices, 6, 0);
    place(b, 0);
    check_scene(b, "T-junction");
    end(b);
}

static void degenerate_triangles_take_the_place_of_a_neighbour(void **state)
{
    (void)state;
    const lx_vec3 p[] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0.5f, 0, 0.5f}, {5, 5, 5}};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3, /* collinear */ 0, 4, 2, /* twice one vertex */ 0, 0, 3, /* a point */ 5, 5, 5};
    builder *b = begin(1);
    add_mesh(b, "degenerate");
    add_primitive(b, p, 6, indices, 5, 0);
    place(b, 0);
    const lx_atlas_desc desc = small_page();
    lx_atlas *atlas = build_atlas(b, &desc);
    const atlas_facts facts = check_atlas(atlas, true);
    assert_int_equal(facts.charts, 1);
    assert_int_equal(facts.uncharted, 3);
    const lx_vec2 *uv = atlas->primitives[0].corner_uv;
    assert_memory_equal(&uv[6], &uv[0], sizeof *uv); // at vertex 0
    assert_memory_equal(&uv[9], &uv[0], sizeof *uv);
    for (uint32_t t = 2; t < 5; ++t) assert_int_equal(atlas->primitives[0].triangle_chart[t], LX_NO_CHART);
    lx_atlas_destroy(atlas);
    end(b);
}

static void a_mesh_of_degenerate_triangles_alone_is_not_used(void **state)
{
    (void)state;
    const lx_vec3 p[] = {{1, 1, 1}, {2, 2, 2}, {NAN, 0, 0}};
    const uint32_t indices[] = {0, 0, 1, 1, 1, 1, 0, 1, 2};
    builder *b = begin(1);
    add_mesh(b, "nothing");
    add_primitive(b, p, 3, indices, 3, 0);
    place(b, 0);
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_false(atlas->rects[0].used);
    assert_non_null(atlas->primitives[0].corner_uv);
    lx_atlas_destroy(atlas);
    end(b);
}

static void coincident_and_duplicate_faces_get_texels_of_their_own(void **state)
{
    (void)state;
    const lx_vec3 p[] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3, /* the back */ 0, 2, 1, 0, 3, 2, /* again */ 0, 1, 2, 0, 2, 3};
    builder *b = begin(1);
    add_mesh(b, "double faces");
    add_primitive(b, p, 4, indices, 6, 0);
    place(b, 0);
    check_scene(b, "double faces");
    end(b);
}

static void needles_and_huge_triangles_unwrap(void **state)
{
    (void)state;
    const lx_vec3 p[] = {{0, 0, 0}, {1000, 0, 0}, {0, 0, 1000}, {0, 1, 0}, {100, 1, 0}, {50, 1, 0.001f},
                         {0, 2, 0}, {0.001f, 2, 0}, {0, 2, 0.001f}};
    const uint32_t indices[] = {0, 1, 2, 3, 4, 5, 6, 7, 8};
    builder *b = begin(1);
    add_mesh(b, "needles");
    add_primitive(b, p, 9, indices, 3, 0);
    place(b, 0);
    const atlas_facts facts = check_scene(b, "needle, huge, tiny");
    assert_int_equal(facts.charts, 3);
    end(b);
}

static void a_fan_of_many_needles_stays_one_chart(void **state)
{
    (void)state;
    enum { spokes = 6000 };
    lx_vec3 *p = malloc((spokes + 1) * sizeof *p);
    uint32_t *indices = malloc(3 * spokes * sizeof *indices);
    for (uint32_t i = 0; i < spokes; ++i) {
        const float a = 2 * LX_PI * (float)i / spokes;
        p[i] = lx_v3(cosf(a), 0, -sinf(a));
        memcpy(&indices[3 * i], (uint32_t[]){spokes, i, (i + 1) % spokes}, 3 * sizeof *indices);
    }
    p[spokes] = lx_v3(0, 0, 0);
    builder *b = begin(1);
    add_mesh(b, "fan");
    add_primitive(b, p, spokes + 1, indices, spokes, 0);
    place(b, 0);
    assert_int_equal(check_scene(b, "fan of 6000").charts, 1);
    free(p);
    free(indices);
    end(b);
}

static void scenes_of_micrometres_and_of_thousands_of_kilometres_unwrap(void **state)
{
    (void)state;
    for (int i = 0; i < 2; ++i) {
        builder *b = begin(1);
        const float s = i ? 1e6f : 1e-6f;
        add_surface(b, "sphere", sphere_point, 24, 12, true, false);
        add_instance(b, 0, scaling(s, s, s));
        const uint32_t box = add_box(b, "box", s, 2 * s, 0.1f * s);
        place(b, box);
        assert_density(check_scene(b, i ? "1e6 m" : "1e-6 m"));
        end(b);
    }
}

static void unevenly_scaled_instances_have_one_density_on_all_sides(void **state)
{
    (void)state;
    builder *b = begin(1);
    add_box(b, "slab", 1, 1, 1);
    add_instance(b, 0, scaling(10, 0.5f, 7));
    const atlas_facts facts = check_scene(b, "slab");
    assert_density(facts);
    assert_true(facts.coverage > 0.65);
    end(b);
}

static void mirrored_instances_unwrap(void **state)
{
    (void)state;
    builder *b = begin(1);
    add_surface(b, "torus", torus_point, 32, 16, true, true);
    add_instance(b, 0, scaling(-1, 1, 1));
    add_instance(b, 0, scaling(1, 1, 1));
    assert_density(check_scene(b, "mirrored tori"));
    end(b);
}

static void materials_and_instances_multiply_the_density(void **state)
{
    (void)state;
    builder *b = begin(1);
    const uint32_t fine = add_material(b, false, 2);
    const lx_vec3 p[] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    add_mesh(b, "two materials");
    add_primitive(b, p, 4, indices, 2, 0);
    add_primitive(b, p, 4, indices, 2, fine);
    place(b, 0);
    b->scene.instances[0].density = 1.5f;
    add_box(b, "plain", 1, 1, 1);
    place(b, 1);
    assert_density(check_scene(b, "densities"));
    end(b);
}

static void unlit_and_moving_surfaces_get_no_texels(void **state)
{
    (void)state;
    builder *b = begin(1);
    const uint32_t unlit = add_material(b, true, 1);
    const lx_vec3 p[] = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};
    const uint32_t indices[] = {0, 1, 2, 0, 2, 3};
    add_mesh(b, "sign");
    add_primitive(b, p, 4, indices, 2, unlit);
    add_primitive(b, p, 4, indices, 2, 0);
    add_mesh(b, "unlit");
    add_primitive(b, p, 4, indices, 2, unlit);
    add_mesh(b, "moving");
    add_primitive(b, p, 4, indices, 2, 0);
    place(b, 0);
    place(b, 1);
    place(b, 2);
    add_instance(b, 0, lx_mat4_identity());
    b->scene.instances[2].is_static = b->scene.instances[3].is_static = false;
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_null(atlas->primitives[0].corner_uv);
    assert_non_null(atlas->primitives[1].corner_uv);
    assert_null(atlas->primitives[2].corner_uv);
    assert_null(atlas->primitives[3].corner_uv);
    assert_true(atlas->rects[0].used);
    for (int i = 1; i < 4; ++i) assert_false(atlas->rects[i].used);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void add_zoo(builder *b)
{
    add_surface(b, "sphere", sphere_point, 32, 16, true, false);
    add_surface(b, "torus", torus_point, 32, 16, true, true);
    add_surface(b, "spring", spring_point, 8, 90, true, false);
    add_surface(b, "ramp", ramp_point, 4, 80, false, false);
    add_surface(b, "waves", wave_point, 30, 30, false, false);
    add_box(b, "box", 1, 2, 3);
    rng_state = 99;
    add_soup(b, 60, 4, 1);
    for (uint32_t m = 0; m < b->scene.mesh_count; ++m) place(b, m);
    add_instance(b, 0, scaling(0.7f, 0.7f, 0.7f));
    add_instance(b, 5, scaling(2, 1, 1));
}

static void one_and_three_threads_give_the_same_bits(void **state)
{
    (void)state;
    builder *one = begin(1), *three = begin(3);
    add_zoo(one);
    add_zoo(three);
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 512;
    desc.max_pages = 2;
    lx_atlas *a = build_atlas(one, &desc), *c = build_atlas(three, &desc);
    const atlas_facts facts = check_atlas(a, true);
    print_message("  zoo: %u charts, %u pages, %.0f %% covered\n", facts.charts, a->page_count, facts.coverage * 100);
    assert_true(same_atlas(a, c));
    lx_atlas_destroy(a);
    lx_atlas_destroy(c);
    end(one);
    end(three);
}

/// A random mesh: a bumpy grid whose vertices are moved, some triangles dropped, doubled, turned or made degenerate.
static void add_random_mesh(builder *b, uint32_t key)
{
    rng_state = key;
    const uint32_t columns = 2 + (uint32_t)(random_float() * 14), rows = 2 + (uint32_t)(random_float() * 14);
    const float noise = random_float() * random_float() * 3, scale = powf(10, random_float() * 6 - 3);
    const uint32_t vertices = (columns + 1) * (rows + 1), capacity = columns * rows * 6;
    lx_vec3 *p = malloc(vertices * sizeof *p);
    uint32_t *indices = malloc((capacity + 3) * 2 * sizeof *indices), n = 0;
    for (uint32_t i = 0; i < vertices; ++i) {
        const lx_vec3 d = lx_v3(random_float() - 0.5f, random_float() - 0.5f, random_float() - 0.5f);
        p[i] = lx_scale(lx_mad(lx_v3((float)(i % (columns + 1)), 0, (float)(i / (columns + 1))), d, noise), scale);
        if (random_float() < 0.05f && i > 0) p[i] = p[(uint32_t)(random_float() * (float)i)];
    }
    for (uint32_t j = 0; j < rows; ++j)
        for (uint32_t i = 0; i < columns; ++i) {
            const uint32_t a = j * (columns + 1) + i, c = a + columns + 1;
            const uint32_t quad[2][3] = {{a, c, c + 1}, {a, c + 1, a + 1}};
            for (int k = 0; k < 2; ++k) {
                const float dice = random_float();
                if (dice < 0.05f) continue;
                uint32_t t[3] = {quad[k][0], quad[k][1], quad[k][2]};
                if (dice > 0.95f) t[1] = quad[k][2], t[2] = quad[k][1];
                if (dice > 0.98f) t[2] = t[0];
                for (int copies = dice > 0.9f && dice < 0.92f ? 2 : 1; copies > 0; --copies) {
                    memcpy(&indices[n], t, sizeof t);
                    n += 3;
                }
            }
        }
    add_mesh(b, "random");
    add_primitive(b, p, vertices, indices, n / 3, 0);
    free(p);
    free(indices);
}

static void random_meshes_keep_every_promise(void **state)
{
    (void)state;
    for (uint32_t seed = 0; seed < 120; ++seed) {
        builder *b = begin(1);
        const uint32_t count = 1 + seed % 4;
        for (uint32_t m = 0; m < count; ++m) {
            add_random_mesh(b, seed * 16 + m);
            lx_mat4 t = lx_mat4_identity();
            if (seed % 3 == 1)
                for (int i = 0; i < 12; ++i)
                    if (i % 4 != 3) t.m[i] = random_float() * 4 - 2;
            add_instance(b, m, t);
        }
        lx_atlas_desc desc = lx_atlas_desc_default();
        desc.page_size = 256;
        desc.max_pages = 4;
        desc.padding = 2 + seed % 5;
        lx_atlas *atlas = NULL;
        lx_error error = {0};
        const lx_result result = lx_atlas_build(&b->scene, &desc, NULL, &atlas, &error);
        if (result != LX_OK) fail_msg("seed %u: %s", seed, error.message);
        const atlas_facts facts = check_atlas(atlas, true);
        if (facts.lowest_density < 0.98 || (facts.highest_density > 1.02))
            fail_msg("seed %u: densities %g to %g", seed, facts.lowest_density, facts.highest_density);
        lx_atlas_destroy(atlas);
        end(b);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_cube_becomes_six_charts),
        cmocka_unit_test(a_sphere_becomes_about_a_dozen_charts),
        cmocka_unit_test(a_cylinder_becomes_at_most_five_charts),
        cmocka_unit_test(a_torus_unwraps),
        cmocka_unit_test(a_bent_tube_that_passes_over_itself_is_cut),
        cmocka_unit_test(a_spiral_ramp_that_covers_itself_is_cut),
        cmocka_unit_test(a_moebius_strip_unwraps),
        cmocka_unit_test(waves_unwrap),
        cmocka_unit_test(a_soup_of_triangles_is_a_chart_each),
        cmocka_unit_test(t_junctions_do_not_disturb),
        cmocka_unit_test(degenerate_triangles_take_the_place_of_a_neighbour),
        cmocka_unit_test(a_mesh_of_degenerate_triangles_alone_is_not_used),
        cmocka_unit_test(coincident_and_duplicate_faces_get_texels_of_their_own),
        cmocka_unit_test(needles_and_huge_triangles_unwrap),
        cmocka_unit_test(a_fan_of_many_needles_stays_one_chart),
        cmocka_unit_test(scenes_of_micrometres_and_of_thousands_of_kilometres_unwrap),
        cmocka_unit_test(unevenly_scaled_instances_have_one_density_on_all_sides),
        cmocka_unit_test(mirrored_instances_unwrap),
        cmocka_unit_test(materials_and_instances_multiply_the_density),
        cmocka_unit_test(unlit_and_moving_surfaces_get_no_texels),
        cmocka_unit_test(one_and_three_threads_give_the_same_bits),
        cmocka_unit_test(random_meshes_keep_every_promise),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
