// From finished texels to a folder and back: every file, the scene again, recolouring.
#define _POSIX_C_SOURCE 200809L // mkdtemp
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "bake/baked.h"
#include "bake/save.h"
#include "bake_fixture.h"
#include "image/encode.h"
#include "image/ktx2.h"

#include <stdio.h>
#include <unistd.h>

static bake_fixture fixture;
static char root[256], out_path[300];

static int setup(void **state)
{
    (void)state;
    lx_error error = {0};
    lx_bake_desc desc = lx_bake_desc_default();
    desc.transport.sky.color[0] = desc.transport.sky.color[1] = desc.transport.sky.color[2] = 0.5f;
    desc.transport.sky.intensity = 6;
    desc.transport.bounces = LX_BOUNCES_INF;
    const char *base = getenv("TMPDIR");
    snprintf(root, sizeof root, "%.200s/luxel-save-XXXXXX", base ? base : "/tmp");
    if (!mkdtemp(root)) return -1;
    snprintf(out_path, sizeof out_path, "%s/room.baked", root);
    fixture = (bake_fixture){0};
    const lx_result result = fixture_create(&fixture, &desc, &error);
    if (result != LX_OK) print_message("%s\n", error.message);
    return result == LX_OK ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    fixture_destroy(&fixture);
    return lx_folder_remove(root, NULL) == LX_OK ? 0 : -1;
}

static lx_result try_save(uint32_t formats, lx_encoding encoding, const lx_progress_sink *sink, lx_error *error)
{
    const lx_save_desc desc = {.formats = formats, .encoding = encoding};
    lx_new_folder folder = {0};
    lx_manifest manifest = {0};
    lx_result result = lx_new_folder_begin(out_path, &folder, error);
    if (result == LX_OK) result = lx_bake_write(fixture.bake, &desc, &folder, sink, &manifest, error);
    if (result == LX_OK) result = lx_bake_write_manifest(&manifest, &folder, error);
    if (result == LX_OK) result = lx_new_folder_commit(&folder, error);
    lx_manifest_release(&manifest);
    lx_new_folder_abort(&folder);
    return result;
}

static void save(uint32_t formats, lx_encoding encoding)
{
    lx_error error = {0};
    if (try_save(formats, encoding, NULL, &error) != LX_OK) fail_msg("%s", error.message);
}

static lx_baked *open_baked(bool with_scene)
{
    lx_baked *baked = NULL;
    lx_error error = {0};
    if (lx_baked_open(fixture.context, out_path, with_scene, &baked, &error) != LX_OK) fail_msg("%s", error.message);
    return baked;
}

static lx_bytes read_out(const char *name)
{
    lx_bytes bytes = {0};
    char *path = lx_path_join(out_path, name);
    lx_error error = {0};
    if (lx_file_read(path, 1 << 30, &bytes, &error) != LX_OK) fail_msg("%s: %s", name, error.message);
    lx_free(path);
    return bytes;
}

static float relative_error(const float *a, const float *b, size_t texel_count)
{
    float worst = 0;
    for (size_t i = 0; i < texel_count; ++i) {
        const float largest = fmaxf(b[3 * i], fmaxf(b[3 * i + 1], b[3 * i + 2]));
        for (size_t k = 0; k < 3; ++k) {
            const float difference = fabsf(a[3 * i + k] - b[3 * i + k]);
            if (difference > 0) worst = fmaxf(worst, difference / largest);
        }
    }
    return worst;
}

static uint32_t find_layer(const lx_baked *baked, const char *name)
{
    for (uint32_t i = 0; i < lx_baked_layer_count(baked); ++i)
        if (strcmp(lx_baked_layer_name(baked, i), name) == 0) return i;
    fail_msg("no layer %s", name);
    return 0;
}

static void saved_bake_opens_and_composes_to_the_sum(void **state)
{
    (void)state;
    save(0, LX_ENCODING_DEFAULT);
    assert_true(lx_baked_is_folder(out_path));
    lx_baked *baked = open_baked(false);
    const lx_bake *bake = fixture.bake;
    const size_t texel_count = (size_t)bake->atlas->page_size * bake->atlas->page_size;
    assert_int_equal(lx_baked_page_count(baked), bake->atlas->page_count);
    assert_int_equal(lx_baked_page_size(baked), 80);
    assert_int_equal(lx_baked_layer_count(baked), 4);
    float *want = calloc(3 * texel_count, sizeof *want), *got = calloc(3 * texel_count, sizeof *got);
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
        float c[3], *image = fixture_image(bake, 0, layer);
        lx_baked_get_layer(baked, layer, c);
        for (size_t k = 0; k < 3; ++k) {
            assert_float_equal(c[k], bake->layers[layer].color[k] * bake->layers[layer].intensity, 0);
            for (size_t i = 0; i < texel_count; ++i) want[3 * i + k] += c[k] * image[3 * i + k];
        }
        free(image);
    }
    assert_int_equal(lx_baked_compose(baked, 0, got, NULL), LX_OK);
    const float worst = relative_error(got, want, texel_count);
    print_message("composed against the sum of floats: %.5f\n", worst);
    assert_true(worst < 3.0f / 512);
    assert_int_equal(lx_baked_compose(baked, bake->atlas->page_count, got, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_true(bake->summary.pack_bytes == baked->pack_data.size);
    free(want);
    free(got);
    lx_baked_destroy(baked);
}

static void scene_comes_back_with_coordinates_and_sources(void **state)
{
    (void)state;
    save(0, LX_ENCODING_DEFAULT);
    lx_baked *baked = open_baked(true);
    const lx_scene *before = fixture.scene, *after = baked->scene;
    assert_int_equal(after->instance_count, before->instance_count);
    assert_int_equal(after->primitive_count, before->primitive_count);
    for (uint32_t i = 0; i < before->instance_count; ++i) {
        const lx_atlas_rect *a = &fixture.atlas->rects[i], *b = &baked->atlas->rects[i];
        assert_int_equal(a->used, b->used);
        assert_int_equal(a->page, b->page);
        assert_int_equal(a->x, b->x);
        assert_int_equal(a->height, b->height);
        assert_memory_equal(a->scale, b->scale, sizeof a->scale);
        assert_memory_equal(a->offset, b->offset, sizeof a->offset);
    }
    for (uint32_t i = 0; i < before->primitive_count; ++i) {
        const lx_vec2 *a = fixture.atlas->primitives[i].corner_uv, *b = baked->atlas->primitives[i].corner_uv;
        assert_int_equal(a != NULL, b != NULL);
        if (a) assert_memory_equal(a, b, 3 * before->primitives[i].triangle_count * sizeof *a);
    }
    assert_int_equal(after->source_count, before->source_count);
    assert_int_equal(baked->use_count, before->source_count + 1);
    for (uint32_t i = 0; i < baked->use_count; ++i) {
        const lx_source_use *a = &fixture.bake->uses[i], *b = &baked->uses[i];
        assert_int_equal(a->layer, b->layer);
        assert_memory_equal(&a->weight, &b->weight, sizeof a->weight);
        // At authored colours every source shines as the file says.
        const lx_source *source = lx_tracer_source(fixture.bake->tracer, i);
        const lx_rgb strength = lx_baked_source_strength(baked, i);
        assert_float_equal(strength.r, source->color.r * source->intensity, 1e-5 * (double)source->intensity);
        assert_float_equal(strength.g, source->color.g * source->intensity, 1e-5 * (double)source->intensity);
        assert_float_equal(strength.b, source->color.b * source->intensity, 1e-5 * (double)source->intensity);
    }
    assert_non_null(baked->sky.file);
    assert_float_equal(baked->sky.color[1], 0.5f, 0);
    assert_float_equal(baked->sky.intensity, 6, 0);
    lx_tracer *tracer = NULL;
    lx_transport_desc transport = lx_transport_desc_default();
    transport.sky = baked->sky;
    assert_int_equal(lx_tracer_create(after, &transport, true, NULL, &tracer, NULL), LX_OK);
    assert_int_equal(lx_tracer_source_count(tracer), baked->use_count);
    const lx_rgb sky = lx_tracer_sky_radiance(tracer, lx_v3(0, 1, 0));
    assert_float_equal(sky.g, 1, 0);
    lx_tracer_destroy(tracer);
    lx_baked_destroy(baked);
}

static void ktx2_files_hold_the_layers_and_mips_that_do_not_bleed(void **state)
{
    (void)state;
    for (int half = 0; half < 2; ++half) {
        save(LX_LIGHTMAP_KTX2, half ? LX_ENCODING_HALF : LX_ENCODING_DEFAULT);
        lx_baked *baked = open_baked(false);
        assert_int_equal(baked->manifest.file_count, 1);
        assert_string_equal(baked->manifest.files[0].file, "lightmap_page0.ktx2");
        lx_bytes bytes = read_out("lightmap_page0.ktx2");
        lx_ktx2 texture = {0};
        assert_int_equal(lx_ktx2_decode(bytes.data, bytes.size, &texture, NULL), LX_OK);
        assert_int_equal(texture.format, half ? LX_KTX2_RGBA16F : LX_KTX2_RGB9E5);
        assert_int_equal(texture.layer_count, 4);
        assert_int_equal(texture.level_count, 3);
        for (uint32_t level = 0; level < 3; ++level) {
            const uint32_t size = 80 >> level;
            for (uint32_t layer = 0; layer < 4; ++layer) {
                const float scale = baked->manifest.layers[layer].scale;
                assert_true((scale == 1) == (layer != 2)); // layer 2 is the one too dark for half floats
                for (uint32_t i = 0; i < size * size; ++i) {
                    const size_t texel = (size_t)layer * size * size + i;
                    float got[3];
                    if (half) {
                        const uint8_t *p = texture.levels[level].data + 8 * texel;
                        for (int k = 0; k < 3; ++k) got[k] = lx_half_to_float((uint16_t)(p[2 * k] | p[2 * k + 1] << 8));
                    } else {
                        uint32_t bits;
                        memcpy(&bits, texture.levels[level].data + 4 * texel, 4);
                        const lx_rgb rgb = lx_rgb9e5_decode(bits);
                        got[0] = rgb.r, got[1] = rgb.g, got[2] = rgb.b;
                    }
                    // Within a chart T is almost linear in x and y; across charts it jumps by half and more.
                    const uint32_t x = (i % size << level), y = (i / size << level), step = (1u << level) - 1;
                    if (y >= 72 || y + step >= 72) continue;
                    const uint32_t chart_first = (x + 2) / 20, chart_last = (x + step + 2) / 20;
                    bool fits = false;
                    for (uint32_t chart = chart_first; chart <= chart_last; ++chart) {
                        const float low = fixture_texel(0, layer, chart, x, y, 0);
                        const float high = fixture_texel(0, layer, chart, x + step, y + step, 0);
                        fits |= got[0] * scale >= low * 0.997f && got[0] * scale <= high * 1.003f;
                    }
                    if (!fits) fail_msg("level %u, layer %u, texel %u %u: %g", level, layer, x, y, got[0] * scale);
                }
            }
        }
        lx_ktx2_release(&texture);
        lx_bytes_release(&bytes);
        lx_baked_destroy(baked);
    }
}

static void exr_and_hdr_files_hold_physical_values(void **state)
{
    (void)state;
    save(LX_LIGHTMAP_EXR | LX_LIGHTMAP_HDR, LX_ENCODING_DEFAULT);
    lx_baked *baked = open_baked(false);
    const size_t texel_count = 80 * 80;
    assert_int_equal(baked->manifest.file_count, 8);
    for (uint32_t i = 0; i < 8; ++i) {
        const lx_manifest_file *file = &baked->manifest.files[i];
        float *want = fixture_image(fixture.bake, file->page, file->layer);
        lx_bytes bytes = read_out(file->file);
        lx_image image = {0};
        lx_error error = {0};
        if (lx_image_decode(bytes.data, bytes.size, &image, &error) != LX_OK) fail_msg("%s: %s", file->file, error.message);
        assert_int_equal(image.width, 80);
        assert_int_equal(image.height, 80);
        if (strcmp(file->format, "exr") == 0) {
            assert_int_equal(image.channels, 4);
            for (size_t t = 0; t < texel_count; ++t) {
                assert_memory_equal(image.f32 + 4 * t, want + 3 * t, 12);
                assert_float_equal(image.f32[4 * t + 3], fixture.bake->texel_coverage[t] ? 1 : 0, 0);
            }
        } else {
            assert_int_equal(image.channels, 3);
            assert_true(relative_error(image.f32, want, texel_count) < 1.0f / 127);
        }
        free(want);
        lx_image_release(&image);
        lx_bytes_release(&bytes);
    }
    assert_string_equal(baked->manifest.layers[1].unit, "cd");
    lx_baked_destroy(baked);
}

static void more_than_64_layers_become_several_arrays(void **state)
{
    (void)state;
    enum { size = 16, layers = 130 };
    static uint32_t chart[size * size];
    static uint8_t coverage[size * size];
    static float texels[layers][3 * size * size], scales[layers];
    static lx_layer layer_list[layers];
    lx_atlas atlas = {.page_size = size, .page_count = 1, .padding = 4};
    lx_bake bake = {.atlas = &atlas, .layers = layer_list, .layer_count = layers, .texel_chart = chart, .texel_coverage = coverage};
    for (uint32_t i = 0; i < layers; ++i) {
        layer_list[i].name = "same";
        scales[i] = 1;
        for (size_t k = 0; k < 3 * size * size; ++k) texels[i][k] = (float)(i + 1);
    }
    const lx_save_desc desc = {.formats = LX_LIGHTMAP_KTX2};
    lx_new_folder folder = {0};
    lx_manifest manifest = {0};
    lx_lightmap_writer *writer = NULL;
    lx_page_mips mips = {0};
    assert_int_equal(lx_new_folder_begin(out_path, &folder, NULL), LX_OK);
    assert_int_equal(lx_lightmap_writer_create(&bake, &desc, scales, &folder, &manifest, &writer, NULL), LX_OK);
    assert_int_equal(lx_page_mips_create(&bake, 0, 3, &mips, NULL), LX_OK);
    for (uint32_t i = 0; i < layers; ++i) {
        lx_page_mips_build(&mips, texels[i]);
        assert_int_equal(lx_lightmap_writer_add(writer, 0, i, &mips, NULL), LX_OK);
    }
    static const char *const names[] = {"lightmap_page0.ktx2", "lightmap_page0_part1.ktx2", "lightmap_page0_part2.ktx2"};
    assert_int_equal(manifest.file_count, 3);
    for (uint32_t part = 0; part < 3; ++part) {
        assert_string_equal(manifest.files[part].file, names[part]);
        assert_int_equal(manifest.files[part].layer, 64 * part);
        char *path = lx_path_join(folder.partial, names[part]);
        lx_bytes bytes = {0};
        lx_ktx2 texture = {0};
        assert_int_equal(lx_file_read(path, 1 << 20, &bytes, NULL), LX_OK);
        assert_int_equal(lx_ktx2_decode(bytes.data, bytes.size, &texture, NULL), LX_OK);
        assert_int_equal(texture.layer_count, part < 2 ? 64 : 2);
        for (uint32_t i = 0; i < texture.layer_count; ++i) {
            uint32_t bits; // the last texel of the coarsest level
            memcpy(&bits, texture.levels[2].data + 4 * (16 * i + 15), 4);
            assert_float_equal(lx_rgb9e5_decode(bits).g, (float)(64 * part + i + 1), 0);
        }
        lx_ktx2_release(&texture);
        lx_bytes_release(&bytes);
        lx_free(path);
    }
    lx_page_mips_release(&mips);
    lx_lightmap_writer_destroy(writer);
    lx_manifest_release(&manifest);
    lx_new_folder_abort(&folder);
}

static void file_names_are_plain_and_unique(void **state)
{
    (void)state;
    char longest[200];
    memset(longest, 'x', sizeof longest - 1);
    longest[sizeof longest - 1] = '\0';
    lx_layer layers[] = {{.name = "a/b"},  {.name = "a b"},   {.name = "A?B"},   {.name = ""},      {.name = "/../../etc"},
                         {.name = "Stra\xc3\x9f" "e"}, {.name = longest}, {.name = "layer"}, {.name = "a_b_2"}, {.name = longest},
                         {.name = ".hidden"}};
    static const char *const want[] = {"a_b", "a_b_2", "A_B_3", "layer", "_.._.._etc", "Stra_e", NULL, "layer_2", "a_b_2_2", NULL, "_hidden"};
    const uint32_t count = sizeof layers / sizeof *layers;
    lx_arena arena = {0};
    char **names = lx_layer_file_names(&arena, layers, count);
    assert_non_null(names);
    for (uint32_t i = 0; i < count; ++i) {
        for (uint32_t k = 0; k < i; ++k) assert_string_not_equal(names[i], names[k]);
        assert_null(strchr(names[i], '/'));
        assert_true(names[i][0] != '.' && strlen(names[i]) < 80);
        if (want[i]) assert_string_equal(names[i], want[i]);
    }
    lx_arena_release(&arena);
}

static bool cancel(void *user, const lx_progress *progress)
{
    assert_string_equal(progress->stage, "save");
    assert_true(progress->fraction >= 0 && progress->fraction <= 1);
    return --*(int *)user > 0;
}

static void cancelled_save_leaves_the_old_folder(void **state)
{
    (void)state;
    save(0, LX_ENCODING_DEFAULT);
    const lx_bytes before = read_out("luxel.pack");
    for (int calls = 1; calls <= 6; ++calls) {
        int left = calls;
        lx_error error = {0};
        const lx_rgb changed = {(float)calls, 1, 1};
        assert_int_equal(lx_finished_write(fixture.bake->finished, 0, 0, 1, &changed, NULL), LX_OK);
        const lx_progress_sink sink = {cancel, &left};
        assert_int_equal(try_save(LX_LIGHTMAP_KTX2, LX_ENCODING_DEFAULT, &sink, &error), LX_ERROR_CANCELLED);
        lx_bytes after = read_out("luxel.pack");
        assert_int_equal(after.size, before.size);
        assert_memory_equal(after.data, before.data, after.size);
        lx_bytes_release(&after);
        char partial[320];
        snprintf(partial, sizeof partial, "%s.partial", out_path);
        assert_false(lx_path_exists(partial));
    }
    lx_free(before.data);
}

static void changed_pack_is_refused(void **state)
{
    (void)state;
    save(0, LX_ENCODING_DEFAULT);
    lx_bytes pack = read_out("luxel.pack");
    char path[320];
    snprintf(path, sizeof path, "%s/luxel.pack", out_path);
    pack.data[pack.size - 1] ^= 1;
    assert_int_equal(lx_file_write(path, pack.data, pack.size, NULL), LX_OK);
    lx_baked *baked = NULL;
    lx_error error = {0};
    assert_int_equal(lx_baked_open(fixture.context, out_path, false, &baked, &error), LX_ERROR_FORMAT);
    assert_non_null(strstr(error.message, "luxel.pack: is not the file"));
    assert_int_equal(lx_file_write(path, pack.data, pack.size / 2, NULL), LX_OK);
    assert_int_equal(lx_baked_open(fixture.context, out_path, false, &baked, &error), LX_ERROR_FORMAT);
    assert_non_null(strstr(error.message, "luxel.pack: truncated"));
    assert_int_equal(unlink(path), 0);
    assert_int_equal(lx_baked_open(fixture.context, out_path, false, &baked, &error), LX_ERROR_FORMAT);
    assert_non_null(strstr(error.message, "luxel.pack: cannot read"));
    assert_int_equal(symlink("/etc/passwd", path), 0);
    assert_int_equal(lx_baked_open(fixture.context, out_path, false, &baked, &error), LX_ERROR_FORMAT);
    assert_non_null(strstr(error.message, "outside of the folder"));
    assert_int_equal(lx_baked_open(fixture.context, root, false, &baked, &error), LX_ERROR_FORMAT);
    assert_int_equal(lx_baked_open(fixture.context, "/nowhere/at/all", false, &baked, &error), LX_ERROR_FORMAT);
    lx_bytes_release(&pack);
}

static void recolouring_understands_what_people_type(void **state)
{
    (void)state;
    save(0, LX_ENCODING_DEFAULT);
    lx_baked *baked = open_baked(false);
    const uint32_t lamp = find_layer(baked, "lamp");
    static const struct {
        const char *text;
        float c[3];
    } good[] = {
        {"lamp=1,0.5,0", {8, 4, 0}},           {"lamp=1,0.5,0*2", {2, 1, 0}},  {"lamp=off", {0, 0, 0}},
        {"lamp=#ffffff", {8, 8, 8}},           {"lamp=#FF0000*1.5", {1.5f, 0, 0}}, {"lamp=#808080*1", {0.2158605f, 0.2158605f, 0.2158605f}},
        {"la*=1,1,1*3", {3, 3, 3}},            {"l?mp=1,1,1*4", {4, 4, 4}},    {"*=1e2,.5,0*1", {100, 0.5f, 0}},
        {"*=off*7", {0, 0, 0}},
    };
    for (size_t i = 0; i < sizeof good / sizeof *good; ++i) {
        lx_error error = {0};
        float c[3];
        if (lx_baked_set(baked, good[i].text, &error) != LX_OK) fail_msg("%s: %s", good[i].text, error.message);
        lx_baked_get_layer(baked, lamp, c);
        for (int k = 0; k < 3; ++k) assert_float_equal(c[k], good[i].c[k], 1e-6);
    }
    static const char *const bad[] = {
        "",         "lamp",          "=1,1,1",        "lamp=",        "lamp=1,1",      "lamp=1,1,1,1",    "lamp=#fff",
        "lamp=#gg0000", "lamp=1,1,1*",   "lamp=1,1,1*x",  "lamp=-1,0,0",  "lamp=nan,0,0",  "lamp=inf,0,0",    "lamp=1,1,1*-2",
        "lamp=offf",    "lamp= 1,1,1",   "lamp=1e60,0,0", "lamp=1,1,1*1e39", "lamp=1e20,1,1*1e20", "Lamp=off", "x*=off",
    };
    for (size_t i = 0; i < sizeof bad / sizeof *bad; ++i) {
        lx_error error = {0};
        float c[3];
        assert_int_equal(lx_baked_set(baked, "lamp=1,2,3*1", &error), LX_OK);
        if (lx_baked_set(baked, bad[i], &error) != LX_ERROR_INVALID_ARGUMENT) fail_msg("%s was taken", bad[i]);
        lx_baked_get_layer(baked, lamp, c);
        assert_float_equal(c[2], 3, 0);
    }
    lx_error error = {0};
    assert_int_equal(lx_baked_set(baked, "lampe=off", &error), LX_ERROR_INVALID_ARGUMENT);
    print_message("%s\n", error.message);
    assert_non_null(strstr(error.message, "there is no layer 'lampe'; nearest: 'lamp', "));
    char *json = NULL;
    assert_int_equal(lx_baked_describe(baked, &json, &error), LX_OK);
    assert_non_null(strstr(json, "\"scene.glb\": "));
    assert_non_null(strstr(json, "\"coverage\": "));
    lx_free(json);
    lx_baked_destroy(baked);
}

static void globs_match_like_in_a_shell(void **state)
{
    (void)state;
    assert_true(lx_glob_matches("*", ""));
    assert_true(lx_glob_matches("a*c*e", "abcde"));
    assert_true(lx_glob_matches("*ab", "aab"));
    assert_true(lx_glob_matches("a**", "a"));
    assert_false(lx_glob_matches("a?", "a"));
    assert_false(lx_glob_matches("", "a"));
    assert_false(lx_glob_matches("*a", "ab"));
    assert_int_equal(lx_edit_distance("kitten", "sitting"), 3);
    assert_int_equal(lx_edit_distance("", "abc"), 3);
    assert_int_equal(lx_edit_distance("Neon", "nEON"), 0);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, setup, teardown)
    const struct CMUnitTest tests[] = {
        TEST(saved_bake_opens_and_composes_to_the_sum),
        TEST(scene_comes_back_with_coordinates_and_sources),
        TEST(ktx2_files_hold_the_layers_and_mips_that_do_not_bleed),
        TEST(exr_and_hdr_files_hold_physical_values),
        TEST(more_than_64_layers_become_several_arrays),
        TEST(cancelled_save_leaves_the_old_folder),
        TEST(changed_pack_is_refused),
        TEST(recolouring_understands_what_people_type),
        cmocka_unit_test(file_names_are_plain_and_unique),
        cmocka_unit_test(globs_match_like_in_a_shell),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
