// luxel.json: written, read back, and hostile.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "base/memory.h"
#include "luxel/bake.h"
#include "math/hash.h"
#include "store/manifest.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void fill(lx_manifest *manifest)
{
    *manifest = (lx_manifest){
        .generator = "luxel test",
        .scene = "scene.glb",
        .pack = "luxel.pack",
        .padding = 4,
        .texels_per_m = 31.25f,
        .pages = calloc(2, sizeof *manifest->pages),
        .layers = calloc(2, sizeof *manifest->layers),
        .files = calloc(2, sizeof *manifest->files),
        .monitors = calloc(2, sizeof *manifest->monitors),
        .animations = calloc(1, sizeof *manifest->animations),
        .page_count = 2,
        .layer_count = 2,
        .file_count = 2,
        .monitor_count = 2,
        .animation_count = 1,
        .has_sky = true,
        .has_view = true,
        .sky = {"sky.exr", {1, 0.5f, 0.25f}, 45, 3},
        .view_ev = -3.1415927f,
        .bake = {256, LX_BOUNCES_INF, "gather", "builtin", 0.0175f, 7, "avx2", 12.5, {0.5, 1, 0.25, 9, 0.125, 2, 3, 4, 0, 3.5, 0.75}, 8},
        .scene_hash = 0x0123456789abcdef,
        .pack_hash = 0xfedcba9876543210,
    };
    manifest->pages[0] = (lx_manifest_page){1024, 1024, 0.75f};
    manifest->pages[1] = (lx_manifest_page){1024, 1024, 0.1f};
    manifest->layers[0] = (lx_manifest_layer){"Straße \"A\"\n#2", "spot", "node", "cd", "mixed", {0.1f, 0.2f, 0.3f}, 683.3f, 1};
    manifest->layers[1] = (lx_manifest_layer){"sky", "sky", "", "nt", "baked", {1, 1, 1}, 1e-20f, 0x1p-30f};
    manifest->files[0] = (lx_manifest_file){0, 0, "ktx2", "lightmap_page0.ktx2"};
    manifest->files[1] = (lx_manifest_file){1, 1, "exr", "lightmap_page1_sky.exr"};
    manifest->monitors[0] = (lx_manifest_monitor){"tv \"1\"", 7, 3, 2, 1, 0, {0.1f, 18, 1e9f}};
    manifest->monitors[1] = (lx_manifest_monitor){"bare", 8, -1, 1, 1, 1, {1, 1, 1}};
    manifest->animations[0] = (lx_manifest_animation){"dusk", 1, "keys", "color", 12.1f};
}

static void manifest_round_trip_keeps_every_bit(void **state)
{
    (void)state;
    lx_manifest manifest, back;
    lx_error error = {0};
    char *text = NULL;
    fill(&manifest);
    assert_int_equal(lx_manifest_write(&manifest, NULL, &text, &error), LX_OK);
    assert_non_null(strstr(text, "\"bounces\": \"inf\""));
    assert_null(strstr(text, "\"memory\""));
    assert_null(strstr(text, "sizes"));
    assert_int_equal(lx_manifest_read(text, strlen(text), &back, &error), LX_OK);
    assert_memory_equal(&back.bake.stages, &manifest.bake.stages, sizeof back.bake.stages);
    assert_string_equal(back.generator, manifest.generator);
    assert_string_equal(back.scene, manifest.scene);
    assert_string_equal(back.pack, manifest.pack);
    assert_int_equal(back.padding, 4);
    assert_memory_equal(&back.texels_per_m, &manifest.texels_per_m, 4);
    assert_int_equal(back.page_count, 2);
    assert_memory_equal(back.pages, manifest.pages, 2 * sizeof *back.pages);
    assert_int_equal(back.layer_count, 2);
    for (int i = 0; i < 2; ++i) {
        assert_string_equal(back.layers[i].name, manifest.layers[i].name);
        assert_string_equal(back.layers[i].kind, manifest.layers[i].kind);
        assert_string_equal(back.layers[i].node, manifest.layers[i].node);
        assert_string_equal(back.layers[i].unit, manifest.layers[i].unit);
        assert_string_equal(back.layers[i].mode, manifest.layers[i].mode);
        assert_memory_equal(back.layers[i].color, manifest.layers[i].color, 12);
        assert_memory_equal(&back.layers[i].intensity, &manifest.layers[i].intensity, 4);
        assert_memory_equal(&back.layers[i].scale, &manifest.layers[i].scale, 4);
        assert_string_equal(back.files[i].file, manifest.files[i].file);
        assert_string_equal(back.files[i].format, manifest.files[i].format);
        assert_int_equal(back.files[i].page, manifest.files[i].page);
        assert_int_equal(back.files[i].layer, manifest.files[i].layer);
    }
    assert_int_equal(back.monitor_count, 2);
    for (int i = 0; i < 2; ++i) {
        const lx_manifest_monitor *a = &back.monitors[i], *b = &manifest.monitors[i];
        assert_string_equal(a->name, b->name);
        assert_true(a->node == b->node && a->material == b->material && a->columns == b->columns && a->rows == b->rows);
        assert_int_equal(a->first_layer, b->first_layer);
        assert_memory_equal(a->strength, b->strength, 12);
    }
    assert_int_equal(back.animation_count, 1);
    assert_string_equal(back.animations[0].name, "dusk");
    assert_int_equal(back.animations[0].layer, 1);
    assert_string_equal(back.animations[0].program, "keys");
    assert_string_equal(back.animations[0].channel, "color");
    assert_memory_equal(&back.animations[0].duration_s, &manifest.animations[0].duration_s, 4);
    assert_true(back.has_sky && back.has_view);
    assert_string_equal(back.sky.file, "sky.exr");
    assert_memory_equal(back.sky.color, manifest.sky.color, 12);
    assert_float_equal(back.sky.rotation_deg, 45, 0);
    assert_memory_equal(&back.view_ev, &manifest.view_ev, 4);
    assert_int_equal(back.bake.bounces, LX_BOUNCES_INF);
    assert_string_equal(back.bake.integrator, "gather");
    assert_string_equal(back.bake.denoise, "builtin");
    assert_memory_equal(&back.bake.noise, &manifest.bake.noise, 4);
    assert_null(strstr(text, "\"cache\"")); // a part of the bake that there was not
    assert_int_equal(back.bake.seed, 7);
    assert_string_equal(back.bake.isa, "avx2");
    assert_true(back.scene_hash == manifest.scene_hash && back.pack_hash == manifest.pack_hash);
    lx_manifest_release(&back);

    lx_free(text);
    const uint64_t sizes[4] = {10, 20, 0, 40};
    assert_int_equal(lx_manifest_write(&manifest, sizes, &text, &error), LX_OK);
    assert_non_null(strstr(text, "\"luxel.pack\": 20"));
    lx_free(text);
    lx_manifest_release(&manifest);
}

static const char *const smallest =
    "{\"version\":1,\"pack\":\"luxel.pack\",\"atlas\":{\"pages\":[{\"width\":64,\"height\":64}]},"
    "\"layers\":[{\"name\":\"a\",\"color\":[1,1,1],\"intensity\":2}],\"unknown\":{}}";

static lx_result read_text(const char *text, char message[512])
{
    lx_manifest manifest;
    lx_error error = {0};
    const lx_result result = lx_manifest_read(text, strlen(text), &manifest, &error);
    if (result == LX_OK) lx_manifest_release(&manifest);
    if (message) strcpy(message, error.message);
    return result;
}

// The smallest manifest with one part exchanged.
static lx_result read_changed(const char *from, const char *to, char message[512])
{
    char text[1024];
    const char *at = strstr(smallest, from);
    assert_non_null(at);
    snprintf(text, sizeof text, "%.*s%s%s", (int)(at - smallest), smallest, to, at + strlen(from));
    return read_text(text, message);
}

static void manifest_without_files_keeps_all_else(void **state)
{
    (void)state;
    static const char text[] = "{\"version\":1,\"later\":{\"x\":[1,2]},\"files\":[{\"file\":\"a.exr\"}],"
                               "\"layers\":[{\"name\":\"a\",\"scale\":0.5},{\"name\":\"b\"}]}";
    char *lean = NULL;
    lx_error error = {0};
    assert_int_equal(lx_manifest_drop_files(text, strlen(text), &lean, &error), LX_OK);
    assert_non_null(strstr(lean, "\"later\""));
    assert_non_null(strstr(lean, "\"name\": \"b\""));
    assert_non_null(strstr(lean, "\"files\": []"));
    assert_null(strstr(lean, "a.exr"));
    assert_null(strstr(lean, "scale"));
    lx_free(lean);
    assert_int_equal(lx_manifest_drop_files("{", 1, &lean, &error), LX_ERROR_FORMAT);
    static const char odd[] = "{\"layers\":[1,null]}"; // whatever it holds
    assert_int_equal(lx_manifest_drop_files(odd, strlen(odd), &lean, &error), LX_OK);
    lx_free(lean);
    assert_int_equal(lx_manifest_drop_files("[]", 2, &lean, &error), LX_OK);
    lx_free(lean);
}

static void manifest_with_optional_fields_left_out_is_read(void **state)
{
    (void)state;
    assert_int_equal(read_text(smallest, NULL), LX_OK);
}

static void manifest_with_wrong_fields_names_them(void **state)
{
    (void)state;
    static const struct {
        const char *from, *to, *told;
        lx_result result;
    } cases[] = {
        {"\"version\":1", "\"version\":2", "version 2", LX_ERROR_UNSUPPORTED},
        {"\"version\":1", "\"version\":\"1\"", "version: is no whole number", LX_ERROR_FORMAT},
        {"\"version\":1,", "", "version: is missing", LX_ERROR_FORMAT},
        {"luxel.pack", "../luxel.pack", "pack: must be a path inside the folder", LX_ERROR_FORMAT},
        {"luxel.pack", "/etc/passwd", "pack: must be a path inside the folder", LX_ERROR_FORMAT},
        {"\"width\":64", "\"width\":-64", "atlas.pages[0].width: is out of range", LX_ERROR_FORMAT},
        {"\"width\":64", "\"width\":64.5", "atlas.pages[0].width: is no whole number", LX_ERROR_FORMAT},
        {"\"name\":\"a\"", "\"name\":3", "layers[0].name: is no text", LX_ERROR_FORMAT},
        {"[1,1,1]", "[1,1]", "layers[0].color: must be three numbers", LX_ERROR_FORMAT},
        {"[1,1,1]", "[1,1,1e60]", "layers[0].color: is out of range", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"files\":[{\"page\":1,\"layer\":0,\"format\":\"exr\",\"file\":\"x\"}]", "files[0]", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"monitors\":[{\"name\":\"m\",\"node\":0,\"columns\":2,\"rows\":1,\"firstLayer\":0,\"strength\":[1,1,1]}]",
         "monitors[0].columns, rows, firstLayer: there are no such layers", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"monitors\":[{\"name\":\"m\",\"node\":0,\"columns\":65536,\"rows\":65536,\"firstLayer\":0,\"strength\":[1,1,1]}]",
         "monitors[0].columns, rows, firstLayer: there are no such layers", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"monitors\":[{\"name\":\"m\",\"node\":0,\"columns\":1,\"rows\":1,\"firstLayer\":1,\"strength\":[1,1,1]}]",
         "monitors[0].columns, rows, firstLayer: there are no such layers", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"monitors\":[{\"name\":\"m\",\"node\":0,\"columns\":1,\"rows\":1,\"firstLayer\":0}]",
         "monitors[0].strength: must be three numbers", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"animations\":[{\"layer\":1,\"program\":\"keys\"}]", "animations[0].layer: there is no such layer", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"animations\":[{\"layer\":0}]", "animations[0].program: is missing", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"sky\":{\"file\":\"a/../../b\",\"color\":[1,1,1]}", "sky.file", LX_ERROR_FORMAT},
        {"\"unknown\":{}", "\"hashes\":{\"luxel.pack\":\"12\"}", "hashes.luxel.pack", LX_ERROR_FORMAT},
        {"\"layers\":[", "\"layers\":[[],", "layers[0].name", LX_ERROR_FORMAT},
        {"{\"pages\":", "{\"sides\":", "atlas.pages: is missing", LX_ERROR_FORMAT},
        {"}}", "}", "line 1", LX_ERROR_FORMAT},
    };
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        char message[512];
        const lx_result result = read_changed(cases[i].from, cases[i].to, message);
        if (result != cases[i].result || !strstr(message, cases[i].told))
            fail_msg("%s -> %s: %d '%s'", cases[i].from, cases[i].to, result, message);
    }
}

static void manifest_with_any_byte_changed_never_crashes(void **state)
{
    (void)state;
    lx_manifest manifest;
    char *text = NULL;
    fill(&manifest);
    assert_int_equal(lx_manifest_write(&manifest, NULL, &text, NULL), LX_OK);
    const size_t length = strlen(text);
    uint32_t random = 5;
    for (int round = 0; round < 4000; ++round) {
        random = lx_hash32(random + 1);
        const size_t at = random % length;
        const char saved = text[at];
        text[at] = "\0\"{}[],:-.0129eE\\/ \xff\x80t"[(random >> 16) % 23];
        lx_manifest back;
        if (lx_manifest_read(text, length, &back, NULL) == LX_OK) lx_manifest_release(&back);
        if (lx_manifest_read(text, at, &back, NULL) == LX_OK) lx_manifest_release(&back);
        text[at] = saved;
    }
    lx_free(text);
    lx_manifest_release(&manifest);
}

static void manifest_with_text_that_is_not_utf8_is_still_written(void **state)
{
    (void)state;
    lx_manifest manifest;
    char *text = NULL;
    fill(&manifest);
    manifest.layers[0].name = "bad \xff name";
    manifest.view_ev = NAN;
    assert_int_equal(lx_manifest_write(&manifest, NULL, &text, NULL), LX_OK);
    assert_non_null(strstr(text, "bad ? name"));
    assert_int_equal(read_text(text, NULL), LX_OK);
    lx_free(text);
    lx_manifest_release(&manifest);
}

static void paths_that_leave_the_folder_are_told_apart(void **state)
{
    (void)state;
    static const char *const inside[] = {"a", "a/b", "..a", "a..", ".hidden", "a b.glb"};
    static const char *const outside[] = {"", "/", "/a", "..", "../a", "a/..", "a/../b", ".", "./a", "a//b", "a/", "c:\\a", "a\\b", "c:a"};
    for (size_t i = 0; i < sizeof inside / sizeof *inside; ++i) assert_true(lx_path_stays_inside(inside[i]));
    for (size_t i = 0; i < sizeof outside / sizeof *outside; ++i) assert_false(lx_path_stays_inside(outside[i]));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(manifest_round_trip_keeps_every_bit),
        cmocka_unit_test(manifest_without_files_keeps_all_else),
        cmocka_unit_test(manifest_with_optional_fields_left_out_is_read),
        cmocka_unit_test(manifest_with_wrong_fields_names_them),
        cmocka_unit_test(manifest_with_any_byte_changed_never_crashes),
        cmocka_unit_test(manifest_with_text_that_is_not_utf8_is_still_written),
        cmocka_unit_test(paths_that_leave_the_folder_are_told_apart),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
