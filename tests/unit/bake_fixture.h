// A small room as a .glb in memory, baked by hand: for tests of what happens to finished texels.
#ifndef BAKE_FIXTURE_H
#define BAKE_FIXTURE_H

#include "bake/bake.h"
#include "bake/luxel_map.h"
#include "scene/gltf.h"

#include <stdlib.h>
#include <string.h>

// A floor and a wall of one mesh, a glowing quad, a lamp, and two lamps that share a layer: 4 layers with the sky.
static const char fixture_json[] =
    "{\"asset\":{\"version\":\"2.0\"},\"extensionsUsed\":[\"KHR_lights_punctual\",\"KHR_materials_emissive_strength\"],"
    "\"scene\":0,\"scenes\":[{\"nodes\":[0,1,2,3,4,5]}],"
    "\"nodes\":[{\"name\":\"floor\",\"mesh\":0},"
    "{\"name\":\"wall\",\"mesh\":0,\"rotation\":[0.70710678,0,0,0.70710678],\"translation\":[0,1,-1]},"
    "{\"name\":\"glow\",\"mesh\":1,\"translation\":[0,2,0],\"scale\":[0.2,0.2,0.2]},"
    "{\"name\":\"lamp\",\"translation\":[0,1,0],\"extensions\":{\"KHR_lights_punctual\":{\"light\":0}}},"
    "{\"name\":\"left\",\"translation\":[-1,1,0],\"extensions\":{\"KHR_lights_punctual\":{\"light\":1}},"
    "\"extras\":{\"luxel_layer\":\"pair\"}},"
    "{\"name\":\"right\",\"translation\":[1,1,0],\"extensions\":{\"KHR_lights_punctual\":{\"light\":2}},"
    "\"extras\":{\"luxel_layer\":\"pair\"}}],"
    "\"meshes\":[{\"name\":\"quad\",\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1,\"material\":0}]},"
    "{\"name\":\"tube\",\"primitives\":[{\"attributes\":{\"POSITION\":0},\"indices\":1,\"material\":1}]}],"
    "\"materials\":[{\"name\":\"plaster\"},{\"name\":\"neon\",\"emissiveFactor\":[1,0.5,0],"
    "\"extensions\":{\"KHR_materials_emissive_strength\":{\"emissiveStrength\":50}}}],"
    "\"extensions\":{\"KHR_lights_punctual\":{\"lights\":[{\"type\":\"point\",\"color\":[1,0.5,0.25],\"intensity\":8},"
    "{\"type\":\"point\",\"color\":[1,0,0],\"intensity\":4},{\"type\":\"point\",\"color\":[0,1,0],\"intensity\":1}]}},"
    "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":4,\"type\":\"VEC3\",\"min\":[-1,0,-1],\"max\":[1,0,1]},"
    "{\"bufferView\":1,\"componentType\":5123,\"count\":6,\"type\":\"SCALAR\"}],"
    "\"bufferViews\":[{\"buffer\":0,\"byteOffset\":0,\"byteLength\":48},{\"buffer\":0,\"byteOffset\":48,\"byteLength\":12}],"
    "\"buffers\":[{\"byteLength\":60}]}";

typedef struct bake_fixture {
    lx_context *context;
    lx_scene *scene;
    lx_atlas *atlas;
    lx_bake *bake;
} bake_fixture;

static void fixture_drop(void *user, lx_log_level level, const char *message)
{
    (void)level;
    if (user) ++*(int *)user;
    (void)message;
}

static size_t fixture_glb(uint8_t *out)
{
    static const float positions[12] = {-1, 0, -1, -1, 0, 1, 1, 0, 1, 1, 0, -1};
    static const uint16_t indices[6] = {0, 1, 2, 0, 2, 3};
    const uint32_t json_bytes = ((uint32_t)strlen(fixture_json) + 3) / 4 * 4, total = 12 + 8 + json_bytes + 8 + 60;
    const uint32_t header[5] = {0x46546c67, 2, total, json_bytes, 0x4e4f534a}, binary[2] = {60, 0x004e4942};
    memcpy(out, header, 20);
    memset(out + 20, ' ', json_bytes);
    memcpy(out + 20, fixture_json, strlen(fixture_json));
    memcpy(out + 20 + json_bytes, binary, 8);
    memcpy(out + 28 + json_bytes, positions, 48);
    memcpy(out + 76 + json_bytes, indices, 12);
    return total;
}

// T of a layer in a texel: something that differs everywhere, smooth within a chart.
static inline float fixture_texel(uint32_t page, uint32_t layer, uint32_t chart, uint32_t x, uint32_t y, int channel)
{
    static const float brightness[8] = {0.5f, 40, 2e-5f, 3, 1, 1, 1, 1};
    return brightness[layer % 8] * (float)(1 + chart + page) * (1 + 0.01f * (float)x) * (1 + 0.003f * (float)y) / (float)(1 + channel);
}

// Charts are columns of 16 texels with a gap of 4; what is left of the middle of a gap belongs to the chart at its left, as texels with a colour of
// their own.
static lx_result fixture_fill(lx_bake *bake, lx_error *error)
{
    const uint32_t size = bake->atlas->page_size, page_texels = size * size, texel_count = bake->atlas->page_count * page_texels;
    uint32_t *extras = malloc(texel_count * sizeof *extras), extra_count = 0;
    for (uint32_t i = 0; i < texel_count; ++i) {
        const uint32_t x = i % size, y = i / size % size, chart = y < size - 8 ? (x + 2) / 20 : LX_NO_CHART;
        bake->texel_chart[i] = chart;
        bake->texel_coverage[i] = chart == LX_NO_CHART || (x + 2) % 20 < 2 || (x + 2) % 20 >= 18 ? 0 : 255;
        if (chart != LX_NO_CHART && !bake->texel_coverage[i]) extras[extra_count++] = i;
    }
    lx_bake_map map = {0};
    lx_finished_destroy(bake->finished);
    bake->finished = NULL;
    lx_result result = lx_bake_map_build(size, bake->atlas->page_count, bake->texel_chart, bake->texel_coverage, &map, error);
    if (result == LX_OK) result = lx_finished_create(&map.view, bake->layer_count, false, NULL, &bake->finished, error);
    for (uint32_t page = 0; page < bake->atlas->page_count && result == LX_OK; ++page)
        result = lx_finished_dilate(bake->finished, &map.view, page, 0, bake->texel_chart + page * page_texels, error);
    if (result == LX_OK) result = lx_finished_extend(bake->finished, extras, extra_count, error);
    for (uint32_t layer = 0; layer < bake->layer_count && result == LX_OK; ++layer)
        for (uint32_t entry = 0; entry < lx_finished_count(bake->finished) && result == LX_OK; ++entry) {
            const uint32_t i = entry < map.view.count ? map.texel[entry] : extras[entry - map.view.count];
            const uint32_t page = i / page_texels, x = i % size, y = i / size % size, chart = bake->texel_chart[i];
            const lx_rgb rgb = {fixture_texel(page, layer, chart, x, y, 0), fixture_texel(page, layer, chart, x, y, 1),
                                fixture_texel(page, layer, chart, x, y, 2)};
            result = lx_finished_write(bake->finished, layer, entry, 1, &rgb, error);
        }
    lx_bake_map_release(&map);
    free(extras);
    return result;
}

// Of one page and layer, owned by the caller.
static inline float *fixture_image(const lx_bake *bake, uint32_t page, uint32_t layer)
{
    float *image = malloc((size_t)bake->atlas->page_size * bake->atlas->page_size * 3 * sizeof *image);
    if (lx_finished_image(bake->finished, page, layer, image, NULL) != LX_OK) abort();
    return image;
}

static lx_result fixture_create(bake_fixture *out, const lx_bake_desc *desc, lx_error *error)
{
    uint8_t glb[4096];
    lx_context_desc context_desc = lx_context_desc_default();
    lx_atlas_desc atlas_desc = lx_atlas_desc_default();
    context_desc.logger.func = fixture_drop;
    context_desc.thread_count = 2;
    atlas_desc.page_size = 80;
    const lx_scene_load_desc load_desc = lx_scene_load_desc_default();
    const size_t bytes = fixture_glb(glb);
    lx_result result = lx_context_create(&context_desc, &out->context, error);
    if (result == LX_OK) result = lx_gltf_import(out->context, "room.glb", NULL, glb, bytes, &load_desc, &out->scene, error);
    if (result == LX_OK) result = lx_atlas_build(out->scene, &atlas_desc, NULL, &out->atlas, error);
    if (result == LX_OK) result = lx_bake_create(out->scene, out->atlas, desc, &out->bake, error);
    if (result == LX_OK) result = fixture_fill(out->bake, error);
    return result;
}

static void fixture_destroy(bake_fixture *fixture)
{
    lx_bake_destroy(fixture->bake);
    lx_atlas_destroy(fixture->atlas);
    lx_scene_destroy(fixture->scene);
    lx_context_destroy(fixture->context);
}

#endif
