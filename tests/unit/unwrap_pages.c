// Pages, densities and limits.
#include "unwrap_scenes.h"

#include "base/clock.h"

static void five_thousand_leaves_fit_one_page(void **state)
{
    (void)state;
    builder *b = begin(2);
    const uint32_t leaf = add_quad(b, "leaf", 0.05f, 0.08f);
    for (uint32_t i = 0; i < 5000; ++i) {
        const float s = 0.3f + 0.7f * lx_unit_float(lx_hash32(i));
        add_instance(b, leaf, scaling(s, s, s));
    }
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_int_equal(atlas->page_count, 1);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void leaves_that_do_not_fit_say_what_would_do(void **state)
{
    (void)state;
    builder *b = begin(1);
    const uint32_t leaf = add_quad(b, "leaf", 0.05f, 0.08f);
    for (uint32_t i = 0; i < 300; ++i) place(b, leaf);
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 64;
    lx_atlas *atlas = NULL;
    lx_error error = {0};
    assert_int_equal(lx_atlas_build(&b->scene, &desc, NULL, &atlas, &error), LX_ERROR_LIMIT);
    assert_null(atlas);
    if (!strstr(error.message, "300 instances") || !strstr(error.message, "pages would do")) fail_msg("%s", error.message);
    unsigned pages = 0;
    assert_int_equal(sscanf(strstr(error.message, "density; ") + 9, "%u pages", &pages), 1);
    desc.max_pages = pages;
    atlas = build_atlas(b, &desc);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void one_mesh_of_too_many_charts_names_a_page_size(void **state)
{
    (void)state;
    builder *b = begin(1);
    enum { count = 400 };
    lx_vec3 p[3 * count];
    uint32_t indices[3 * count];
    for (uint32_t i = 0; i < count; ++i) {
        p[3 * i] = lx_v3(0, (float)i, 0);
        p[3 * i + 1] = lx_v3(0, (float)i, 1);
        p[3 * i + 2] = lx_v3(1, (float)i, 0);
        for (uint32_t k = 0; k < 3; ++k) indices[3 * i + k] = 3 * i + k;
    }
    add_mesh(b, "stack");
    add_primitive(b, p, 3 * count, indices, count, 0);
    place(b, 0);
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 64;
    lx_atlas *atlas = NULL;
    lx_error error = {0};
    assert_int_equal(lx_atlas_build(&b->scene, &desc, NULL, &atlas, &error), LX_ERROR_LIMIT);
    if (!strstr(error.message, "of 128 texels would do")) fail_msg("%s", error.message);
    desc.page_size = 128;
    atlas = build_atlas(b, &desc);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void an_asked_density_is_met_or_the_message_says_what_fits(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_box(b, "room", 4, 3, 5));
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 256;
    desc.texels_per_m = 10;
    lx_atlas *atlas = build_atlas(b, &desc);
    assert_true(atlas->texels_per_m == 10);
    const atlas_facts facts = check_atlas(atlas, true);
    assert_true(facts.lowest_density > 0.99 && facts.highest_density < 1.01);
    lx_atlas_destroy(atlas);

    desc.texels_per_m = 500;
    atlas = NULL;
    lx_error error = {0};
    assert_int_equal(lx_atlas_build(&b->scene, &desc, NULL, &atlas, &error), LX_ERROR_LIMIT);
    const char *would = strstr(error.message, "; ");
    if (!would || !strstr(error.message, "texels per metre would fit")) fail_msg("%s", error.message);
    assert_int_equal(sscanf(would + 2, "%f", &desc.texels_per_m), 1);
    assert_true(desc.texels_per_m > 15);
    atlas = build_atlas(b, &desc);
    check_atlas(atlas, true);
    lx_atlas_destroy(atlas);
    end(b);
}

static void more_pages_give_more_texels(void **state)
{
    (void)state;
    builder *b = begin(2);
    for (int i = 0; i < 12; ++i) place(b, add_box(b, "crate", 1, 1 + 0.1f * (float)i, 1));
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 128;
    float before = 0;
    for (desc.max_pages = 1; desc.max_pages <= 4; desc.max_pages *= 2) {
        lx_atlas *atlas = build_atlas(b, &desc);
        assert_int_equal(atlas->page_count, desc.max_pages);
        assert_true(atlas->texels_per_m > before * 1.25f);
        before = atlas->texels_per_m;
        check_atlas(atlas, true);
        lx_atlas_destroy(atlas);
    }
    end(b);
}

static void ordinary_rooms_cover_two_thirds_of_the_page(void **state)
{
    (void)state;
    builder *b = begin(2);
    place(b, add_box(b, "room", 6, 3, 8));
    place(b, add_box(b, "table", 1.6f, 0.8f, 0.9f));
    place(b, add_surface(b, "lamp", sphere_point, 32, 16, true, false));
    const uint32_t chair = add_box(b, "chair", 0.5f, 0.9f, 0.5f);
    for (int i = 0; i < 6; ++i) place(b, chair);
    lx_atlas *atlas = build_atlas(b, NULL);
    const atlas_facts facts = check_atlas(atlas, true);
    print_message("  %.1f %% covered\n", facts.coverage * 100);
    assert_true(facts.coverage > 0.65);
    lx_atlas_destroy(atlas);
    end(b);
}

static void small_copies_keep_two_texels_of_padding(void **state)
{
    (void)state;
    builder *b = begin(1);
    const uint32_t box = add_box(b, "box", 1, 1, 1);
    const float scales[] = {1, 0.8f, 0.5f, 0.1f, 0.001f, 0};
    for (size_t i = 0; i < sizeof scales / sizeof *scales; ++i) add_instance(b, box, scaling(scales[i], scales[i], scales[i]));
    lx_atlas_desc desc = lx_atlas_desc_default();
    desc.page_size = 256;
    lx_atlas *atlas = build_atlas(b, &desc);
    for (uint32_t i = 1; i < b->scene.instance_count; ++i) assert_true(atlas->rects[i].width <= atlas->rects[i - 1].width);
    check_atlas(atlas, false); // two texels everywhere
    lx_atlas_destroy(atlas);
    end(b);
}

static void wrong_settings_are_refused(void **state)
{
    (void)state;
    builder *b = begin(1);
    place(b, add_quad(b, "quad", 1, 1));
    lx_atlas_desc bad[8];
    for (int i = 0; i < 8; ++i) bad[i] = lx_atlas_desc_default();
    bad[0].page_size = 12;
    bad[1].page_size = 8192;
    bad[2].page_size = 1022;
    bad[3].max_pages = 0;
    bad[4].max_pages = 257;
    bad[5].padding = 1;
    bad[6].padding = 33;
    bad[7].texels_per_m = NAN;
    for (int i = 0; i < 8; ++i) {
        lx_atlas *atlas = NULL;
        assert_int_equal(lx_atlas_build(&b->scene, &bad[i], NULL, &atlas, NULL), LX_ERROR_INVALID_ARGUMENT);
        assert_null(atlas);
    }
    lx_atlas_destroy(NULL);
    end(b);
}

static void a_scene_without_lit_surfaces_has_no_pages(void **state)
{
    (void)state;
    builder *b = begin(1);
    lx_atlas *atlas = build_atlas(b, NULL);
    assert_int_equal(atlas->page_count, 0);
    assert_int_equal(b->warnings.count, 1);
    lx_atlas_destroy(atlas);
    end(b);
}

typedef struct progress_log { double last; int calls, stop_after; } progress_log;

static bool watch(void *user, const lx_progress *progress)
{
    progress_log *log = user;
    assert_string_equal(progress->stage, "unwrap");
    assert_true(progress->fraction >= log->last && progress->fraction <= 1);
    log->last = progress->fraction;
    return ++log->calls != log->stop_after;
}

static void progress_never_falls_and_cancelling_stops(void **state)
{
    (void)state;
    builder *b = begin(2);
    place(b, add_surface(b, "torus", torus_point, 64, 32, true, true));
    place(b, add_box(b, "box", 1, 2, 3));
    progress_log log = {0};
    const lx_progress_sink sink = {watch, &log};
    lx_atlas *atlas = NULL;
    assert_int_equal(lx_atlas_build(&b->scene, NULL, &sink, &atlas, NULL), LX_OK);
    assert_true(log.calls > 3 && log.last > 0.999);
    lx_atlas_destroy(atlas);
    for (int stop = 1; stop <= log.calls; ++stop) {
        progress_log again = {.stop_after = stop};
        const lx_progress_sink stopping = {watch, &again};
        lx_error error = {0};
        atlas = NULL;
        const lx_result result = lx_atlas_build(&b->scene, NULL, &stopping, &atlas, &error);
        assert_int_equal(result, again.calls == stop ? LX_ERROR_CANCELLED : LX_OK);
        lx_atlas_destroy(atlas);
    }
    end(b);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(five_thousand_leaves_fit_one_page),
        cmocka_unit_test(leaves_that_do_not_fit_say_what_would_do),
        cmocka_unit_test(one_mesh_of_too_many_charts_names_a_page_size),
        cmocka_unit_test(an_asked_density_is_met_or_the_message_says_what_fits),
        cmocka_unit_test(more_pages_give_more_texels),
        cmocka_unit_test(ordinary_rooms_cover_two_thirds_of_the_page),
        cmocka_unit_test(small_copies_keep_two_texels_of_padding),
        cmocka_unit_test(wrong_settings_are_refused),
        cmocka_unit_test(a_scene_without_lit_surfaces_has_no_pages),
        cmocka_unit_test(progress_never_falls_and_cancelling_stops),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
