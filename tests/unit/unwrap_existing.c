// Lightmap sets that a file brings: kept where they are good, replaced with a warning where they are not.
#include "unwrap_scenes.h"

/// Gives primitive `index` a TEXCOORD_1 (and TEXCOORD_0): per vertex, from x and z of its positions, moved and scaled.
static void set_uv(builder *b, uint32_t index, float scale, float x, float y)
{
    lx_primitive *p = &b->scene.primitives[index];
    p->texcoords[0] = calloc(p->vertex_count, sizeof *p->texcoords[0]);
    p->texcoords[1] = calloc(p->vertex_count, sizeof *p->texcoords[1]);
    assert_true(p->texcoords[0] && p->texcoords[1]);
    for (uint32_t i = 0; i < p->vertex_count; ++i)
        p->texcoords[1][i] = lx_v2(x + scale * p->positions[i].x, y + scale * p->positions[i].z);
}

/// A mesh of two separate unit quads, the second at x = 1 + gap.
static uint32_t add_two_quads(builder *b, const char *name, float gap)
{
    const float s = 1 + gap;
    const lx_vec3 p[8] = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {s, 0, 0}, {s + 1, 0, 0}, {s + 1, 0, 1}, {s, 0, 1}};
    static const uint32_t indices[12] = {0, 2, 1, 0, 3, 2, 4, 6, 5, 4, 7, 6};
    const uint32_t mesh = add_mesh(b, name);
    add_primitive(b, p, 8, indices, 4, 0);
    return mesh;
}

static lx_atlas_desc page(uint32_t size)
{
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = size;
    return desc;
}

static void an_atlas_of_the_whole_scene_is_kept(void **state)
{
    (void)state;
    builder *b = begin(2);
    for (uint32_t m = 0; m < 4; ++m) {
        place(b, add_quad(b, "quad", 1, 1));
        set_uv(b, m, 0.4f, 0.05f + 0.5f * (float)(m % 2), 0.05f + 0.5f * (float)(m / 2));
    }
    const lx_atlas_desc desc = page(128);
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_true(atlas->scene_atlas);
    assert_int_equal(atlas->page_count, 1);
    assert_int_equal(b->warnings.count, 0);
    for (uint32_t i = 0; i < 4; ++i) {
        assert_true(atlas->rects[i].used && atlas->meshes[i].existing);
        assert_int_equal(atlas->meshes[i].texcoord, 1);
        assert_int_equal(atlas->rects[i].width, 128);
        assert_true(atlas->rects[i].scale[0] == 1 && atlas->rects[i].offset[1] == 0);
    }
    assert_true(fabsf(atlas->texels_per_m - 0.4f * 128) < 0.01f);
    check_atlas(atlas, false);
    lx_atlas_destroy(atlas);
    end(b);
}

static void force_unwrap_ignores_a_good_atlas(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "quad", 1, 1));
    set_uv(b, 0, 0.5f, 0.1f, 0.1f);
    lx_atlas_desc desc = page(64);
    desc.force_unwrap = true;
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_false(atlas->scene_atlas || atlas->meshes[0].existing);
    assert_int_equal(atlas->meshes[0].texcoord, 1);
    assert_int_equal(b->warnings.count, 0);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void sets_of_meshes_that_share_the_unit_square_get_rectangles(void **state)
{
    (void)state;
    builder *b = begin(2);
    place(b, add_quad(b, "one", 1, 1));
    place(b, add_quad(b, "two", 1, 1));
    set_uv(b, 0, 1, 0, 0); // both use all of it
    set_uv(b, 1, 1, 0, 0);
    const lx_atlas_desc desc = page(128);
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_false(atlas->scene_atlas);
    assert_true(atlas->meshes[0].existing && atlas->meshes[1].existing);
    assert_int_equal(b->warnings.count, 0);
    check_atlas(atlas, false);
    lx_atlas_destroy(atlas);
    end(b);
}

static void a_mesh_used_twice_keeps_its_set_but_not_the_scene_atlas(void **state)
{
    (void)state;
    builder *b = begin(2);
    const uint32_t mesh = add_two_quads(b, "pair", 0.5f);
    set_uv(b, 0, 0.2f, 0.3f, 0.6f); // a corner of an atlas that others share
    place(b, mesh);
    place(b, mesh);
    const lx_atlas_desc desc = page(128);
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_false(atlas->scene_atlas);
    assert_true(atlas->meshes[0].existing);
    assert_int_equal(atlas->meshes[0].chart_count, 2);
    const atlas_facts facts = check_atlas(atlas, false);
    assert_true(facts.coverage > 0.4); // the rest of the unit square costs no texels
    lx_atlas_destroy(atlas);
    end(b);
}

static void flipped_triangles_in_a_set_are_fine(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_two_quads(b, "mirrored", 0.5f));
    set_uv(b, 0, 0.3f, 0.1f, 0.1f);
    for (uint32_t i = 4; i < 8; ++i) b->scene.primitives[0].texcoords[1][i].x = 1.4f - b->scene.primitives[0].texcoords[1][i].x;
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_true(atlas->scene_atlas);
    lx_atlas_destroy(atlas);
    end(b);
}

/// Expects one warning that names the mesh and holds `reason`, and new charts.
static void expect_replaced(builder *b, const char *name, const char *reason)
{
    const lx_atlas_desc desc = page(128);
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_false(atlas->scene_atlas || atlas->meshes[0].existing);
    if (b->warnings.count != 1 || !strstr(b->warnings.text, name) || !strstr(b->warnings.text, reason))
        fail_msg("warnings: %s", b->warnings.text);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void a_set_that_overlaps_itself_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_two_quads(b, "tiled", 0.5f));
    set_uv(b, 0, 0.3f, 0.1f, 0.1f);
    for (uint32_t i = 4; i < 8; ++i) b->scene.primitives[0].texcoords[1][i] = b->scene.primitives[0].texcoords[1][i - 4];
    expect_replaced(b, "tiled", "overlaps");
}

static void a_set_outside_of_the_unit_square_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "large", 1, 1));
    set_uv(b, 0, 4, 0, 0);
    expect_replaced(b, "large", "outside");
}

static void a_set_that_is_not_a_number_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "nan", 1, 1));
    set_uv(b, 0, 0.5f, 0, NAN);
    expect_replaced(b, "nan", "outside");
}

static void a_set_without_area_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "zero", 1, 1));
    set_uv(b, 0, 0, 0.5f, 0.5f);
    expect_replaced(b, "zero", "without area");
}

static void a_set_that_only_some_primitives_have_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    const lx_vec3 p[3] = {{0, 1, 0}, {0, 1, 1}, {1, 1, 0}};
    place(b, add_quad(b, "half", 1, 1));
    add_primitive(b, p, 3, (uint32_t[]){0, 1, 2}, 1, 0);
    set_uv(b, 0, 0.5f, 0.1f, 0.1f);
    expect_replaced(b, "half", "missing");
}

static void a_set_with_too_little_padding_is_replaced(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_two_quads(b, "tight", 0.01f)); // half a texel at 128
    set_uv(b, 0, 0.4f, 0.1f, 0.1f);
    lx_atlas_desc desc = page(128);
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_false(atlas->scene_atlas || atlas->meshes[0].existing);
    assert_non_null(strstr(b->warnings.text, "tight"));
    assert_non_null(strstr(b->warnings.text, "2 texels"));
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void three_texels_between_charts_are_enough(void **state)
{
    (void)state;
    for (int shift = 0; shift < 8; ++shift) { // wherever the texel borders lie
        builder *b = begin(1);
        place(b, add_two_quads(b, "apart", 3.0f / (0.4f * 128)));
        set_uv(b, 0, 0.4f, 0.1f + (float)shift / (8 * 128), 0.1f);
        const lx_atlas_desc desc = page(128);
        lx_atlas *atlas = build_atlas(b, &desc);
        assert_true(atlas->scene_atlas);
        lx_atlas_destroy(atlas);
        end(b);
    }
}

static void a_texture_on_set_one_sends_the_lightmap_to_the_next_free_set(void **state)
{
    (void)state;
    for (int with_set_2 = 0; with_set_2 < 2; ++with_set_2) {
        builder *b = begin(1);
        place(b, add_quad(b, "textured", 1, 1));
        set_uv(b, 0, 3, 0, 0);
        b->scene.materials[0].base_color_texture.texture = 0;
        b->scene.materials[0].sampled_texcoords = 1u << 1; // by any texture, a normal map too
        if (with_set_2) b->scene.primitives[0].texcoords[2] = calloc(4, sizeof(lx_vec2));
        lx_atlas *atlas = build_atlas(b, NULL);
        assert_false(atlas->meshes[0].existing);
        assert_int_equal(atlas->meshes[0].texcoord, with_set_2 ? 3 : 2);
        lx_atlas_destroy(atlas);
        end(b);
    }
}

static void meshes_without_any_set_get_set_zero_unless_a_texture_wants_it(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "plain", 1, 1));
    place(b, add_quad(b, "textured", 1, 1));
    const uint32_t textured = add_material(b, false, 1);
    b->scene.materials[textured].sampled_texcoords = 1u << 0;
    b->scene.primitives[1].material = textured;
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_int_equal(atlas->meshes[0].texcoord, 0);
    assert_int_equal(atlas->meshes[1].texcoord, 1);
    lx_atlas_destroy(atlas);
    end(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(an_atlas_of_the_whole_scene_is_kept),
        cmocka_unit_test(force_unwrap_ignores_a_good_atlas),
        cmocka_unit_test(sets_of_meshes_that_share_the_unit_square_get_rectangles),
        cmocka_unit_test(a_mesh_used_twice_keeps_its_set_but_not_the_scene_atlas),
        cmocka_unit_test(flipped_triangles_in_a_set_are_fine),
        cmocka_unit_test(a_set_that_overlaps_itself_is_replaced),
        cmocka_unit_test(a_set_outside_of_the_unit_square_is_replaced),
        cmocka_unit_test(a_set_that_is_not_a_number_is_replaced),
        cmocka_unit_test(a_set_without_area_is_replaced),
        cmocka_unit_test(a_set_that_only_some_primitives_have_is_replaced),
        cmocka_unit_test(a_set_with_too_little_padding_is_replaced),
        cmocka_unit_test(three_texels_between_charts_are_enough),
        cmocka_unit_test(a_texture_on_set_one_sends_the_lightmap_to_the_next_free_set),
        cmocka_unit_test(meshes_without_any_set_get_set_zero_unless_a_texture_wants_it),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
