// lx_bake_save as a program calls it: preview and exposure included, and nothing left behind when it fails.
#define _POSIX_C_SOURCE 200809L // mkdtemp
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "bake/baked.h"
#include "bake_fixture.h"
#include "store/folder.h"

#include <stdio.h>
#include <unistd.h>

static bake_fixture fixture;
static char root[256], out_path[300], partial_path[320];

static int setup(void **state)
{
    (void)state;
    lx_error error = {0};
    lx_bake_desc desc = lx_bake_desc_default();
    desc.samples = 4;
    const char *base = getenv("TMPDIR");
    snprintf(root, sizeof root, "%.200s/luxel-api-XXXXXX", base ? base : "/tmp");
    if (!mkdtemp(root)) return -1;
    snprintf(out_path, sizeof out_path, "%s/room.baked", root);
    snprintf(partial_path, sizeof partial_path, "%s.partial", out_path);
    fixture = (bake_fixture){0};
    lx_result result = fixture_create(&fixture, &desc, &error);
    if (result == LX_OK) result = lx_bake_run(fixture.bake, NULL, &error);
    if (result != LX_OK) print_message("%s\n", error.message);
    return result == LX_OK ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    fixture_destroy(&fixture);
    return lx_folder_remove(root, NULL) == LX_OK ? 0 : -1;
}

static bool has(const char *name)
{
    char *path = lx_path_join(out_path, name);
    const bool found = lx_path_exists(path);
    lx_free(path);
    return found;
}

static void save_with_preview_stores_picture_and_exposure(void **state)
{
    (void)state;
    lx_error error = {0};
    lx_save_desc desc = lx_save_desc_default();
    assert_int_equal(desc.preview_width, 960);
    desc.preview_width = 48;
    desc.preview_height = 27;
    if (lx_bake_save(fixture.bake, out_path, &desc, NULL, &error) != LX_OK) fail_msg("%s", error.message);
    assert_true(has("preview.png") && has("scene.glb") && has("luxel.json") && has("luxel.pack"));
    assert_false(has("sky.hdr") || lx_path_exists(partial_path));
    lx_bake_summary summary;
    lx_bake_get_summary(fixture.bake, &summary);
    assert_true(summary.pack_bytes > 0);
    lx_baked *baked = NULL;
    if (lx_baked_open(fixture.context, out_path, true, &baked, &error) != LX_OK) fail_msg("%s", error.message);
    assert_true(baked->manifest.has_view);
    assert_float_equal(baked->manifest.view_ev, summary.view_ev, 0);
    assert_true(baked->manifest.bake.isa[0] != '\0');
    assert_int_equal(baked->manifest.bake.threads, 2);
    lx_baked_destroy(baked);

    desc.preview = false;
    if (lx_bake_save(fixture.bake, out_path, &desc, NULL, &error) != LX_OK) fail_msg("%s", error.message);
    assert_false(has("preview.png"));
}

static bool stop_in_stage(void *user, const lx_progress *progress)
{
    return strcmp(progress->stage, user) == 0;
}

static void save_that_is_stopped_in_the_preview_leaves_nothing(void **state)
{
    (void)state;
    lx_error error = {0};
    lx_save_desc desc = lx_save_desc_default();
    desc.preview_width = 480;
    desc.preview_height = 270;
    const lx_progress_sink sink = {stop_in_stage, "save"};
    assert_int_equal(lx_bake_save(fixture.bake, out_path, &desc, &sink, &error), LX_ERROR_CANCELLED);
    assert_false(lx_path_exists(out_path) || lx_path_exists(partial_path));
}

static void save_refuses_what_makes_no_sense(void **state)
{
    (void)state;
    lx_error error = {0};
    lx_save_desc desc = lx_save_desc_default();
    desc.formats = 1 << 9;
    assert_int_equal(lx_bake_save(fixture.bake, out_path, &desc, NULL, &error), LX_ERROR_INVALID_ARGUMENT);
    desc = lx_save_desc_default();
    desc.preview_height = 0;
    assert_int_equal(lx_bake_save(fixture.bake, out_path, &desc, NULL, &error), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_bake_save(fixture.bake, "", NULL, NULL, &error), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_bake_check_folder("/nowhere/at/all", &error), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_bake_check_folder(out_path, &error), LX_OK);
    assert_false(lx_path_exists(out_path));
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(save_with_preview_stores_picture_and_exposure),
        TEST(save_that_is_stopped_in_the_preview_leaves_nothing),
        TEST(save_refuses_what_makes_no_sense),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
