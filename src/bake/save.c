// A bake on its way to disk: one pass over pages and layers builds mip levels, which go into the pack and into the lightmap files
// asked for.
#include "bake/save.h"

#include "bake/animations.h"
#include "base/clock.h"
#include "base/error.h"
#include "scene/gltf_export.h"
#include "store/pack.h"

#include <string.h>

static const char scene_name[] = "scene.glb";
static const char pack_name[] = "luxel.pack";

// ---- progress

typedef struct save_progress {
    const lx_progress_sink *sink;
    double start;
    uint64_t done, total;
} save_progress;

static lx_result advance(save_progress *progress, lx_error *error)
{
    ++progress->done;
    if (!progress->sink || !progress->sink->func) return LX_OK;
    const lx_progress now = {"save", (double)progress->done / (double)progress->total, lx_seconds() - progress->start};
    return progress->sink->func(progress->sink->user, &now) ? LX_OK : lx_fail(error, LX_ERROR_CANCELLED, "cancelled");
}

// ---- what a layer's light looks like as numbers

// KTX2 holds physical values wherever they fit what half floats and RGB9E5 do well: full precision from 2^-14 (2^-16) to 2^16.
static float ktx2_scale(float largest)
{
    return largest == 0 || (largest >= 0x1p-6f && largest < 0x1p15f) ? 1 : lx_pack_scale(largest);
}

// Blocks below that everywhere are left out of the pack: far below what other layers, or RGB9E5's own steps, let anyone see.
static float absent_threshold(double mean)
{
    return (float)(mean * 0x1p-14);
}

// ---- manifest

static const char *kind_name(const lx_bake *bake, lx_source_kind kind)
{
    static const char *const names[] = {
        [LX_SOURCE_POINT] = "point", [LX_SOURCE_SPOT] = "spot",         [LX_SOURCE_DIRECTIONAL] = "directional",
        [LX_SOURCE_RECT] = "rect",   [LX_SOURCE_DISK] = "disk",         [LX_SOURCE_EMISSIVE] = "emissive",
        [LX_SOURCE_SKY] = "sky",
    };
    return bake->desc.combined ? "combined" : names[kind];
}

static const char *denoiser_name(const lx_bake *bake)
{
    static const char *const names[] = {[LX_DENOISE_NONE] = "none", [LX_DENOISE_BUILTIN] = "builtin", [LX_DENOISE_OIDN] = "oidn"};
    return bake->desc.integrator == LX_INTEGRATOR_PATH ? "none" : names[bake->desc.denoise]; // paths are never denoised
}

// Every monitor, also those that share their layers with others.
static void list_monitors(const lx_bake *bake, lx_manifest *manifest)
{
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        const int32_t first = bake->uses[i].layer;
        if (first < 0 || !bake->layers[first].monitor) continue;
        const lx_layer *layer = &bake->layers[first];
        manifest->monitors[manifest->monitor_count++] = (lx_manifest_monitor){
            .name = source->name,
            .node = source->node,
            .material = bake->scene->materials[source->material].file_index,
            .columns = source->columns,
            .rows = source->rows,
            .first_layer = (uint32_t)first,
            .strength = {layer->white.r * layer->intensity, layer->white.g * layer->intensity, layer->white.b * layer->intensity},
        };
    }
}

static void list_animations(const lx_bake *bake, lx_manifest *manifest)
{
    static const char *const channels[] = {"light", "color", "intensity"};
    for (size_t i = 0; bake->animations && i < bake->animations->count; ++i) {
        const lx_pack_animation *item = &bake->animations->items[i];
        const lxrt_program *program = &item->program;
        float duration_s = program->kind == LXRT_PROGRAM_CONSTANT ? 0 : program->period_s;
        if (program->kind == LXRT_PROGRAM_KEYS) // the time of the last key
            duration_s = program->keys[(size_t)lx_pack_key_stride(item) * (program->key_count - 1)];
        manifest->animations[manifest->animation_count++] = (lx_manifest_animation){
            .name = item->name,
            .layer = item->layer,
            .program = lx_program_name((lx_program_kind)program->kind),
            .channel = channels[item->channel],
            .duration_s = duration_s,
        };
    }
}

static lx_result describe(const lx_bake *bake, lx_manifest *manifest, lx_error *error)
{
    const lx_atlas *atlas = bake->atlas;
    const size_t texel_count = (size_t)atlas->page_size * atlas->page_size;
    *manifest = (lx_manifest){
        .generator = "luxel " LX_VERSION,
        .scene = scene_name,
        .pack = pack_name,
        .padding = atlas->padding,
        .texels_per_m = atlas->texels_per_m,
        .pages = lx_calloc_array(atlas->page_count, sizeof *manifest->pages),
        .layers = lx_calloc_array(bake->layer_count, sizeof *manifest->layers),
        .page_count = atlas->page_count,
        .layer_count = bake->layer_count,
        .monitors = lx_calloc_array(bake->source_count, sizeof *manifest->monitors),
        .animations = lx_calloc_array(bake->animations ? bake->animations->count : 0, sizeof *manifest->animations),
        .bake = {
            .samples = bake->desc.samples,
            .bounces = bake->desc.direct_only ? 0 : bake->desc.transport.bounces,
            .integrator = bake->desc.integrator == LX_INTEGRATOR_PATH ? "path" : "gather",
            .denoise = denoiser_name(bake),
            .noise = bake->summary.noise,
            .seed = bake->desc.transport.seed,
            .isa = bake->tracer ? lx_tracer_isa(bake->tracer) : "",
            .seconds = bake->summary.seconds,
            .stages = bake->summary.stages,
            .threads = bake->scene->context ? lx_pool_worker_count(bake->scene->context->pool) : 0,
        },
    };
    if (!manifest->pages || !manifest->layers || !manifest->monitors || !manifest->animations) return lx_fail_memory(error, "luxel.json");
    for (uint32_t page = 0; page < atlas->page_count; ++page) {
        size_t covered = 0;
        for (size_t i = 0; i < texel_count; ++i) covered += bake->texel_coverage[page * texel_count + i] != 0;
        manifest->pages[page] = (lx_manifest_page){atlas->page_size, atlas->page_size, (float)((double)covered / (double)texel_count)};
    }
    for (uint32_t i = 0; i < bake->layer_count; ++i) {
        const lx_layer *layer = &bake->layers[i];
        manifest->layers[i] = (lx_manifest_layer){
            .name = layer->name,
            .kind = kind_name(bake, layer->kind),
            .node = layer->node,
            .unit = layer->unit,
            .mode = layer->mode == LX_MODE_MIXED ? "mixed" : "baked",
            .color = {layer->color[0], layer->color[1], layer->color[2]},
            .intensity = layer->intensity,
            .scale = 1,
        };
    }
    list_monitors(bake, manifest);
    list_animations(bake, manifest);
    return LX_OK;
}

// ---- scene and sky

static lx_result write_scene(const lx_bake *bake, const lx_new_folder *folder, lx_manifest *manifest, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes bytes = {0};
    LX_TRY(lx_gltf_export(bake->scene, bake->atlas, &bytes, error));
    manifest->scene_hash = lx_content_hash(bytes.data, bytes.size);
    LX_TRY(lx_new_folder_write(folder, scene_name, bytes.data, bytes.size, error));
cleanup:
    lx_bytes_release(&bytes);
    return result;
}

// A sky of one colour, as a picture like any other; its tint is in the manifest.
static lx_result white_sky(lx_bytes *out, lx_error *error)
{
    lx_image image = {0};
    lx_result result = lx_image_create(16, 8, 3, LX_PIXEL_F32, &image, error);
    if (result != LX_OK) return result;
    for (size_t i = 0; i < 3 * 16 * 8; ++i) image.f32[i] = 1;
    result = lx_hdr_encode(&image, out, error);
    lx_image_release(&image);
    return result;
}

static bool is_black(const float rgb[3])
{
    return rgb[0] == 0 && rgb[1] == 0 && rgb[2] == 0;
}

static lx_result write_sky(const lx_bake *bake, const lx_new_folder *folder, lx_manifest *manifest, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_sky_desc *sky = &bake->desc.transport.sky;
    const char *name = "sky.hdr";
    lx_bytes bytes = {0};
    if (!sky->file && is_black(sky->color)) return LX_OK;
    if (sky->file) {
        LX_TRY(lx_file_read(sky->file, (size_t)1 << 30, &bytes, error));
        if (lx_image_sniff(bytes.data, bytes.size) == LX_IMAGE_EXR) name = "sky.exr";
    } else {
        LX_TRY(white_sky(&bytes, error));
    }
    LX_TRY(lx_new_folder_write(folder, name, bytes.data, bytes.size, error));
    manifest->has_sky = true;
    manifest->sky = (lx_manifest_sky){
        .file = name,
        .color = {sky->color[0], sky->color[1], sky->color[2]},
        .rotation_deg = sky->rotation_deg,
        .intensity = sky->intensity,
    };
    if (sky->file && is_black(sky->color)) // no tint given
        for (int i = 0; i < 3; ++i) manifest->sky.color[i] = 1;
cleanup:
    if (result != LX_OK) lx_error_prefix(error, "sky");
    lx_bytes_release(&bytes);
    return result;
}

// ---- pack

typedef struct pack_tables {
    lx_pack_layer *layers;
    lx_pack_source *sources;
    lx_pack_rect *rects;
    lx_pack_monitor *monitors;
    float *coverage;
    uint32_t source_count, rect_count;
} pack_tables;

static void pack_tables_release(pack_tables *tables)
{
    lx_free(tables->layers);
    lx_free(tables->sources);
    lx_free(tables->rects);
    lx_free(tables->monitors);
    lx_free(tables->coverage);
}

static void list_sources(const lx_bake *bake, pack_tables *tables)
{
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        const lx_source_use *use = &bake->uses[i];
        if (use->layer < 0) continue;
        tables->sources[tables->source_count++] = (lx_pack_source){
            .name = source->name,
            .kind = source->kind,
            .layer = (uint32_t)use->layer,
            .weight = {use->weight.r, use->weight.g, use->weight.b},
            .node = source->kind == LX_SOURCE_SKY ? UINT32_MAX : source->node,
            .material = source->material < 0 ? -1 : bake->scene->materials[source->material].file_index,
        };
    }
}

static void list_rects(const lx_bake *bake, pack_tables *tables)
{
    for (uint32_t i = 0; i < bake->scene->instance_count; ++i) {
        const lx_instance *instance = &bake->scene->instances[i];
        const lx_atlas_rect *rect = &bake->atlas->rects[i];
        if (!rect->used) continue;
        tables->rects[tables->rect_count++] = (lx_pack_rect){
            .node = instance->node,
            .gpu_instance = instance->gpu_instance,
            .page = rect->page,
            .texcoord = bake->atlas->meshes[instance->mesh].texcoord,
            .x = rect->x,
            .y = rect->y,
            .width = rect->width,
            .height = rect->height,
            .scale = {rect->scale[0], rect->scale[1]},
            .offset = {rect->offset[0], rect->offset[1]},
        };
    }
}

// `ranges`: [layer_count].
static lx_result begin_pack(const lx_bake *bake, const lx_manifest *manifest, const lx_layer_range *ranges, uint32_t level_count,
                            const char *path, lx_pack_writer **out, lx_error *error)
{
    pack_tables tables = {
        .layers = lx_calloc_array(bake->layer_count, sizeof *tables.layers),
        .sources = lx_calloc_array(bake->source_count, sizeof *tables.sources),
        .rects = lx_calloc_array(bake->scene->instance_count, sizeof *tables.rects),
        .monitors = lx_calloc_array(manifest->monitor_count, sizeof *tables.monitors),
        .coverage = lx_calloc_array(manifest->page_count, sizeof *tables.coverage),
    };
    lx_result result = LX_OK;
    if (!tables.layers || !tables.sources || !tables.rects || !tables.monitors || !tables.coverage) {
        result = lx_fail_memory(error, "luxel.pack");
        goto cleanup;
    }
    for (uint32_t i = 0; i < bake->layer_count; ++i) {
        const lx_layer *layer = &bake->layers[i];
        tables.layers[i] = (lx_pack_layer){
            .name = layer->name,
            .kind = bake->desc.combined ? lx_pack_kind_combined : (uint32_t)layer->kind,
            .mode = layer->mode,
            .color = {layer->color[0], layer->color[1], layer->color[2]},
            .intensity = layer->intensity,
            .scale = lx_pack_scale(ranges[i].largest),
            .threshold = absent_threshold(ranges[i].mean),
        };
    }
    for (uint32_t i = 0; i < manifest->page_count; ++i) tables.coverage[i] = manifest->pages[i].coverage;
    for (uint32_t i = 0; i < manifest->monitor_count; ++i) {
        const lx_manifest_monitor *m = &manifest->monitors[i];
        tables.monitors[i] = (lx_pack_monitor){.name = m->name, .node = m->node, .material = m->material, .columns = m->columns,
                                               .rows = m->rows, .first_layer = m->first_layer,
                                               .strength = {m->strength[0], m->strength[1], m->strength[2]}};
    }
    list_sources(bake, &tables);
    list_rects(bake, &tables);
    const lx_pack_desc desc = {
        .page_size = bake->atlas->page_size,
        .page_count = bake->atlas->page_count,
        .level_count = level_count,
        .page_coverage = tables.coverage,
        .layers = tables.layers,
        .layer_count = bake->layer_count,
        .sources = tables.sources,
        .source_count = tables.source_count,
        .rects = tables.rects,
        .rect_count = tables.rect_count,
        .monitors = tables.monitors,
        .monitor_count = manifest->monitor_count,
        .animations = bake->animations ? bake->animations->items : NULL,
        .animation_count = bake->animations ? (uint32_t)bake->animations->count : 0,
    };
    LX_TRY(lx_pack_begin_file(&desc, path, out, error));
cleanup:
    pack_tables_release(&tables);
    return result;
}

static lx_result finish_pack(lx_bake *bake, lx_pack_writer *pack, lx_manifest *manifest, lx_error *error)
{
    lx_bytes none = {0};
    lx_pack_stats stats;
    const lx_result result = lx_pack_finish(pack, &none, &stats, error);
    if (result != LX_OK) return result;
    bake->summary.pack_bytes = stats.bytes;
    manifest->pack_hash = stats.hash;
    return LX_OK;
}

// ---- all of it

static lx_result write_page(lx_bake *bake, uint32_t page, uint32_t level_count, lx_pack_writer *pack, lx_lightmap_writer *lightmaps,
                            save_progress *progress, lx_error *error)
{
    lx_result result = LX_OK;
    lx_page_mips mips = {0};
    float *image = lx_malloc_array((size_t)bake->atlas->page_size * bake->atlas->page_size, 3 * sizeof *image);
    if (!image) {
        result = lx_fail_memory(error, "page");
        goto cleanup;
    }
    LX_TRY(lx_page_mips_create(bake, page, level_count, &mips, error));
    for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
        LX_TRY(lx_finished_image(bake->finished, page, layer, image, error));
        lx_page_mips_build(&mips, image);
        for (uint32_t level = 0; level < level_count; ++level)
            LX_TRY(lx_pack_add_image(pack, page, layer, level, mips.rgb[level], error));
        LX_TRY(lx_lightmap_writer_add(lightmaps, page, layer, &mips, error));
        LX_TRY(advance(progress, error));
    }
cleanup:
    lx_page_mips_release(&mips);
    lx_free(image);
    return result;
}

lx_result lx_bake_write(lx_bake *bake, const lx_save_desc *desc, const lx_new_folder *folder, const lx_progress_sink *progress,
                        lx_manifest *out_manifest, lx_error *error)
{
    lx_result result = LX_OK;
    lx_manifest manifest = {0};
    lx_pack_writer *pack = NULL;
    lx_lightmap_writer *lightmaps = NULL;
    const uint32_t level_count = lx_pack_level_count(bake->atlas->page_size, bake->atlas->padding);
    lx_layer_range *ranges = lx_calloc_array(bake->layer_count, sizeof *ranges);
    float *scales = lx_calloc_array(bake->layer_count, sizeof *scales);
    save_progress steps = {progress, lx_seconds(), 0, (uint64_t)bake->atlas->page_count * bake->layer_count + 2};
    char *pack_path = lx_path_join(folder->partial, pack_name);
    if (!ranges || !scales || !pack_path) {
        result = lx_fail_memory(error, "layers");
        goto cleanup;
    }
    LX_TRY(describe(bake, &manifest, error));
    LX_TRY(write_scene(bake, folder, &manifest, error));
    LX_TRY(write_sky(bake, folder, &manifest, error));
    LX_TRY(advance(&steps, error));
    for (uint32_t i = 0; i < bake->layer_count; ++i) {
        LX_TRY(lx_finished_range(bake->finished, i, &ranges[i], error));
        scales[i] = ktx2_scale(ranges[i].largest);
        if (desc->formats & LX_LIGHTMAP_KTX2) manifest.layers[i].scale = scales[i];
    }
    result = begin_pack(bake, &manifest, ranges, level_count, pack_path, &pack, error);
    if (result != LX_OK) {
        lx_error_prefix(error, "%s", pack_path);
        goto cleanup;
    }
    LX_TRY(lx_lightmap_writer_create(bake, desc, scales, folder, &manifest, &lightmaps, error));
    for (uint32_t page = 0; page < bake->atlas->page_count; ++page)
        LX_TRY(write_page(bake, page, level_count, pack, lightmaps, &steps, error));
    LX_TRY(finish_pack(bake, pack, &manifest, error));
    LX_TRY(advance(&steps, error));
    *out_manifest = manifest;
    manifest = (lx_manifest){0};
cleanup:
    lx_lightmap_writer_destroy(lightmaps);
    lx_pack_destroy(pack);
    lx_manifest_release(&manifest);
    lx_free(pack_path);
    lx_free(ranges);
    lx_free(scales);
    return result;
}

lx_result lx_bake_write_manifest(const lx_manifest *manifest, const lx_new_folder *folder, lx_error *error)
{
    char *text = NULL;
    lx_result result = lx_manifest_write(manifest, NULL, &text, error);
    if (result == LX_OK) result = lx_new_folder_write(folder, LX_MANIFEST_NAME, text, strlen(text), error);
    lx_free(text);
    return result;
}
