// Baked folders: opening, with or without their scene, and composing.
#include "bake/baked.h"

#include "base/context.h"
#include "base/error.h"
#include "store/folder.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const size_t max_manifest_bytes = (size_t)1 << 28;
static const size_t max_pack_bytes = SIZE_MAX / 4;

bool lx_baked_is_folder(const char *path)
{
    return lx_folder_is_baked(path);
}

// ---- opening

static lx_result open_manifest(lx_baked *baked, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes text = {0};
    char *path = lx_path_join(baked->folder, LX_MANIFEST_NAME);
    if (!path) return lx_fail_memory(error, "path");
    LX_TRY(lx_file_read(path, max_manifest_bytes, &text, error));
    LX_TRY(lx_manifest_read((const char *)text.data, text.size, &baked->manifest, error));
cleanup:
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
    lx_bytes_release(&text);
    lx_free(path);
    return result;
}

// "folder/name", refusing names that lead out of the folder through a symbolic link. (The manifest's reader has checked the text.)
static lx_result path_inside(const lx_baked *baked, const char *name, char **out, lx_error *error)
{
    char *path = lx_path_join(baked->folder, name);
    if (!path) return lx_fail_memory(error, "path");
    if (lx_path_exists(path) && !lx_path_is_inside(path, baked->folder)) {
        lx_fail(error, LX_ERROR_FORMAT, "%s: lies outside of the folder", path);
        lx_free(path);
        return LX_ERROR_FORMAT;
    }
    *out = path;
    return LX_OK;
}

static lx_result check_pack(const lx_baked *baked, lx_error *error)
{
    const lx_manifest *manifest = &baked->manifest;
    lxrt_info info;
    lxrt_get_info(baked->pack, &info);
    bool fits = info.page_count == manifest->page_count && info.layer_count == manifest->layer_count;
    for (uint32_t i = 0; fits && i < info.page_count; ++i)
        fits = manifest->pages[i].width == info.page_size && manifest->pages[i].height == info.page_size;
    for (uint32_t i = 0; fits && i < info.layer_count; ++i) {
        lxrt_layer layer;
        fits = lxrt_get_layer_info(baked->pack, i, &layer) == LXRT_OK && strcmp(layer.name, manifest->layers[i].name) == 0;
    }
    return fits ? LX_OK : lx_fail(error, LX_ERROR_FORMAT, "does not fit " LX_MANIFEST_NAME ": pages or layers differ");
}

// Of a mapped pack a part at a time.
static uint64_t hash_pack(const lx_baked *baked, const lx_bytes *data)
{
    enum { part_bytes = 4 << 20 };
    uint64_t hash = LX_CONTENT_HASH_START;
    for (size_t at = 0; at < data->size; at += part_bytes) {
        const size_t left = data->size - at;
        hash = lx_content_hash_add(hash, data->data + at, left < part_bytes ? left : part_bytes);
        lx_baked_rest(baked);
    }
    return lx_content_hash_end(hash);
}

static lx_result open_pack(lx_baked *baked, bool mapped, lx_error *error)
{
    lx_result result = LX_OK;
    char *path = NULL;
    LX_TRY(path_inside(baked, baked->manifest.pack, &path, error));
    result = mapped ? lx_file_map_open(path, &baked->pack_map, error) : lx_file_read(path, max_pack_bytes, &baked->pack_data, error);
    if (result == LX_OK) {
        const lx_bytes view = {(uint8_t *)baked->pack_map.data, baked->pack_map.size}, *data = mapped ? &view : &baked->pack_data;
        size_t needed = 0;
        lxrt_result rt = lxrt_memory_bytes(data->data, data->size, &needed);
        if (rt == LXRT_OK) {
            baked->pack_memory = lx_malloc_array(needed, 1);
            if (baked->pack_memory) rt = lxrt_open(data->data, data->size, baked->pack_memory, needed, &baked->pack);
        }
        if (rt != LXRT_OK)
            result = lx_fail(error, rt == LXRT_ERROR_VERSION ? LX_ERROR_UNSUPPORTED : LX_ERROR_FORMAT, "%s", lxrt_result_name(rt));
        else if (!baked->pack_memory)
            result = lx_fail_memory(error, "pack");
        else if (baked->manifest.pack_hash && hash_pack(baked, data) != baked->manifest.pack_hash)
            result = lx_fail(error, LX_ERROR_FORMAT, "is not the file that " LX_MANIFEST_NAME " was written for (hashes differ)");
        else
            result = check_pack(baked, error);
    }
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
cleanup:
    lx_free(path);
    return result;
}

// ---- the scene again

static void release_atlas(lx_atlas *atlas)
{
    if (!atlas) return;
    for (uint32_t i = 0; atlas->primitives && i < atlas->scene->primitive_count; ++i) lx_free(atlas->primitives[i].corner_uv);
    lx_free(atlas->primitives);
    lx_free(atlas->meshes);
    lx_free(atlas->rects);
    lx_free(atlas);
}

static lx_result create_atlas(lx_baked *baked, lx_error *error)
{
    const lx_scene *scene = baked->scene;
    lx_atlas *atlas = baked->atlas = lx_calloc_array(1, sizeof *atlas);
    if (!atlas) return lx_fail_memory(error, "atlas");
    *atlas = (lx_atlas){
        .scene = scene,
        .page_size = lx_baked_page_size(baked),
        .page_count = lx_baked_page_count(baked),
        .padding = baked->manifest.padding,
        .texels_per_m = baked->manifest.texels_per_m,
        .primitives = lx_calloc_array(scene->primitive_count, sizeof *atlas->primitives),
        .meshes = lx_calloc_array(scene->mesh_count, sizeof *atlas->meshes),
        .rects = lx_calloc_array(scene->instance_count, sizeof *atlas->rects),
    };
    return atlas->primitives && atlas->meshes && atlas->rects ? LX_OK : lx_fail_memory(error, "atlas");
}

static lx_result read_corners(lx_baked *baked, const lx_instance *instance, uint32_t texcoord, lx_error *error)
{
    const lx_scene *scene = baked->scene;
    const lx_mesh *mesh = &scene->meshes[instance->mesh];
    for (uint32_t i = mesh->first_primitive; i < mesh->first_primitive + mesh->primitive_count; ++i) {
        const lx_primitive *primitive = &scene->primitives[i];
        lx_atlas_primitive *out = &baked->atlas->primitives[i];
        if (out->corner_uv || scene->materials[primitive->material].unlit) continue;
        const lx_vec2 *uv = texcoord < lx_texcoord_sets ? primitive->texcoords[texcoord] : NULL;
        if (!uv) {
            lx_log_warning(scene->context->log, "%s: mesh '%s' has no readable TEXCOORD_%u and shows without its lightmap", scene->path,
                           mesh->name, texcoord);
            return LX_OK;
        }
        out->corner_uv = lx_malloc_array((size_t)primitive->triangle_count * 3, sizeof *out->corner_uv);
        if (!out->corner_uv) return lx_fail_memory(error, "atlas");
        for (size_t corner = 0; corner < (size_t)primitive->triangle_count * 3; ++corner)
            out->corner_uv[corner] = uv[primitive->indices[corner]];
    }
    return LX_OK;
}

static lx_result rebuild_atlas(lx_baked *baked, lx_error *error)
{
    const lx_scene *scene = baked->scene;
    lx_result result = create_atlas(baked, error);
    for (uint32_t i = 0; result == LX_OK && i < scene->instance_count; ++i) {
        const lx_instance *instance = &scene->instances[i];
        lxrt_rect rect;
        if (lxrt_find_rect(baked->pack, instance->node, instance->gpu_instance, &rect) != LXRT_OK) continue;
        lx_atlas_rect *out = &baked->atlas->rects[i];
        *out = (lx_atlas_rect){
            .used = true,
            .page = rect.page,
            .x = rect.x,
            .y = rect.y,
            .width = rect.width,
            .height = rect.height,
        };
        memcpy(out->scale, rect.scale, sizeof out->scale);
        memcpy(out->offset, rect.offset, sizeof out->offset);
        baked->atlas->meshes[instance->mesh] = (lx_atlas_mesh){.existing = true, .texcoord = rect.texcoord};
        result = read_corners(baked, instance, rect.texcoord, error);
    }
    return result;
}

static lx_source_use find_use(const lx_baked *baked, const char *name, bool is_sky)
{
    lxrt_source source;
    for (uint32_t i = 0; lxrt_get_source(baked->pack, i, &source) == LXRT_OK; ++i)
        if ((source.kind == LXRT_KIND_SKY) == is_sky && strcmp(source.name, name) == 0)
            return (lx_source_use){.layer = (int32_t)source.layer, .weight = {source.weight[0], source.weight[1], source.weight[2]}, .direct = true};
    return (lx_source_use){.layer = -1};
}

static lx_result find_uses(lx_baked *baked, lx_error *error)
{
    const lx_scene *scene = baked->scene;
    baked->use_count = scene->source_count + 1;
    baked->uses = lx_calloc_array(baked->use_count, sizeof *baked->uses);
    if (!baked->uses) return lx_fail_memory(error, "sources");
    for (uint32_t i = 0; i < scene->source_count; ++i) {
        baked->uses[i] = find_use(baked, scene->sources[i].name, false);
        baked->uses[i].direct = scene->sources[i].mode != LX_MODE_MIXED;
    }
    baked->uses[scene->source_count] = find_use(baked, "sky", true);
    return LX_OK;
}

static lx_result open_sky(lx_baked *baked, lx_error *error)
{
    const lx_manifest_sky *sky = &baked->manifest.sky;
    baked->sky = (lx_sky_desc){.intensity = 1};
    if (!baked->manifest.has_sky) return LX_OK;
    const lx_result result = path_inside(baked, sky->file, &baked->sky_path, error);
    if (result != LX_OK) return result;
    baked->sky = (lx_sky_desc){
        .color = {sky->color[0], sky->color[1], sky->color[2]},
        .file = baked->sky_path,
        .rotation_deg = sky->rotation_deg,
        .intensity = sky->intensity,
    };
    return LX_OK;
}

static lx_result check_scene_hash(const lx_baked *baked, const char *path, lx_error *error)
{
    lx_bytes bytes = {0};
    if (!baked->manifest.scene_hash) return LX_OK;
    const lx_result result = lx_file_read(path, SIZE_MAX / 4, &bytes, error);
    if (result == LX_OK && lx_content_hash(bytes.data, bytes.size) != baked->manifest.scene_hash)
        lx_log_warning(baked->context->log, "%s: was changed since the bake; what moved keeps its old light", path);
    lx_bytes_release(&bytes);
    if (result != LX_OK) lx_error_prefix(error, "%s", path);
    return result;
}

static lx_result open_scene(lx_baked *baked, lx_error *error)
{
    lx_result result = LX_OK;
    char *path = NULL;
    if (!baked->manifest.scene) return lx_fail(error, LX_ERROR_FORMAT, "%s: has no scene", baked->folder);
    LX_TRY(path_inside(baked, baked->manifest.scene, &path, error));
    LX_TRY(check_scene_hash(baked, path, error));
    LX_TRY(lx_scene_load(baked->context, path, NULL, &baked->scene, error));
    LX_TRY(rebuild_atlas(baked, error));
    LX_TRY(find_uses(baked, error));
    LX_TRY(open_sky(baked, error));
cleanup:
    lx_free(path);
    return result;
}

static lx_result open_folder(lx_context *context, const char *folder, bool with_scene, bool mapped, lx_baked **out_baked, lx_error *error)
{
    lx_result result = LX_OK;
    lx_baked *baked = lx_calloc_array(1, sizeof *baked);
    if (!baked) return lx_fail_memory(error, "baked folder");
    baked->context = context;
    baked->folder = lx_strdup(folder);
    if (!baked->folder) {
        result = lx_fail_memory(error, "path");
        goto cleanup;
    }
    if (!lx_folder_is_baked(folder)) {
        result = lx_fail(error, LX_ERROR_FORMAT, "%s: %s", folder,
                         lx_path_is_folder(folder) ? "holds no " LX_MANIFEST_NAME : "is no baked folder");
        goto cleanup;
    }
    LX_TRY(open_manifest(baked, error));
    LX_TRY(open_pack(baked, mapped, error));
    if (with_scene) LX_TRY(open_scene(baked, error));
    *out_baked = baked;
    baked = NULL;
cleanup:
    lx_baked_destroy(baked);
    return result;
}

lx_result lx_baked_open(lx_context *context, const char *folder, bool with_scene, lx_baked **out_baked, lx_error *error)
{
    return open_folder(context, folder, with_scene, false, out_baked, error);
}

lx_result lx_baked_open_mapped(lx_context *context, const char *folder, bool with_scene, lx_baked **out_baked, lx_error *error)
{
    return open_folder(context, folder, with_scene, true, out_baked, error);
}

void lx_baked_rest(const lx_baked *baked)
{
    lx_file_map_rest(&baked->pack_map);
}

void lx_baked_destroy(lx_baked *baked)
{
    if (!baked) return;
    release_atlas(baked->atlas);
    lx_scene_destroy(baked->scene);
    lx_free(baked->uses);
    lx_free(baked->sky_path);
    lx_free(baked->pack_memory);
    lx_bytes_release(&baked->pack_data);
    lx_file_map_release(&baked->pack_map);
    lx_manifest_release(&baked->manifest);
    lx_free(baked->folder);
    lx_free(baked);
}

// ---- looking inside

uint32_t lx_baked_page_count(const lx_baked *baked)
{
    return baked->manifest.page_count;
}

uint32_t lx_baked_page_size(const lx_baked *baked)
{
    lxrt_info info;
    lxrt_get_info(baked->pack, &info);
    return info.page_size;
}

uint32_t lx_baked_layer_count(const lx_baked *baked)
{
    return baked->manifest.layer_count;
}

const char *lx_baked_layer_name(const lx_baked *baked, uint32_t layer)
{
    return layer < baked->manifest.layer_count ? baked->manifest.layers[layer].name : "";
}

void lx_baked_get_layer(const lx_baked *baked, uint32_t layer, float out_rgb[3])
{
    if (lxrt_get_layer(baked->pack, layer, out_rgb) != LXRT_OK) memset(out_rgb, 0, 3 * sizeof *out_rgb);
}

void lx_baked_set_layer(lx_baked *baked, uint32_t layer, const float rgb[3])
{
    lxrt_set_layer(baked->pack, layer, rgb, 1); // refuses what it cannot sum; the layer keeps its colour then
}

lx_rgb lx_baked_source_strength(const lx_baked *baked, uint32_t index)
{
    const lx_source_use *use = &baked->uses[index];
    if (use->layer < 0) return (lx_rgb){0, 0, 0};
    const lx_manifest_monitor *monitor = lx_baked_monitor(baked, index);
    float c[3];
    lx_baked_get_layer(baked, (uint32_t)use->layer, c);
    if (monitor) {
        const bool off = lx_rgb_is_black(baked->scene->sources[index].color);
        for (int i = 0; i < 3; ++i) c[i] = off ? 0 : monitor->strength[i];
    }
    return (lx_rgb){use->weight.r * c[0], use->weight.g * c[1], use->weight.b * c[2]};
}

const lx_manifest_monitor *lx_baked_monitor(const lx_baked *baked, uint32_t index)
{
    const lx_scene *scene = baked->scene;
    if (index >= scene->source_count || scene->sources[index].columns == 0) return NULL;
    for (uint32_t i = 0; i < baked->manifest.monitor_count; ++i) {
        const lx_manifest_monitor *monitor = &baked->manifest.monitors[i];
        const lx_source *source = &scene->sources[index];
        if (strcmp(monitor->name, source->name) == 0 && monitor->columns == source->columns && monitor->rows == source->rows) return monitor;
    }
    return NULL;
}

bool lx_baked_monitor_shows_cells(const lx_baked *baked, const lx_manifest_monitor *monitor)
{
    for (uint32_t cell = 0; cell < monitor->columns * monitor->rows; ++cell) {
        const lx_manifest_layer *layer = &baked->manifest.layers[monitor->first_layer + cell];
        float c[3];
        lx_baked_get_layer(baked, monitor->first_layer + cell, c);
        for (int i = 0; i < 3; ++i)
            if (c[i] != layer->color[i] * layer->intensity) return true;
    }
    return false;
}

// A mapped pack in rows of blocks, so that no more of it is in memory than they need.
lx_result lx_baked_compose_level(const lx_baked *baked, uint32_t page, uint32_t level, float *out_rgb, lx_error *error)
{
    enum { block_edge = 32 };
    const uint32_t size = lx_baked_page_size(baked) >> level, rows = baked->pack_map.data ? block_edge : size;
    for (uint32_t y = 0; y < size; y += rows) {
        const lxrt_region region = {.page = page, .level = level, .y = y, .width = size, .height = size - y < rows ? size - y : rows};
        const lxrt_target target = {.texels = out_rgb + 3 * (size_t)y * size, .format = LXRT_FORMAT_RGB32F, .scale = 1};
        const lxrt_result rt = lxrt_compose(baked->pack, &region, &target);
        if (rt != LXRT_OK) return lx_fail(error, LX_ERROR_BACKEND, "%s: page %u: %s", baked->folder, page, lxrt_result_name(rt));
        lx_baked_rest(baked);
    }
    return LX_OK;
}

lx_result lx_baked_compose(const lx_baked *baked, uint32_t page, float *out_rgb, lx_error *error)
{
    if (page >= baked->manifest.page_count)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s: there is no page %u; it has %u", baked->folder, page,
                       baked->manifest.page_count);
    return lx_baked_compose_level(baked, page, 0, out_rgb, error);
}

void lx_baked_get_budget(const lx_baked *baked, lx_budget *out)
{
    lxrt_budget budget;
    lxrt_get_budget(baked->pack, &budget);
    *out = (lx_budget){
        .ram = budget.pack_bytes + budget.handle_bytes,
        .accumulator = budget.accumulator_bytes,
        .gpu_composed = budget.gpu_composed_bytes,
        .gpu_layers = budget.gpu_layers_bytes,
        .dense = budget.dense_bytes,
    };
}

static uint64_t file_bytes(const lx_baked *baked, const char *name)
{
    char *path = name ? lx_path_join(baked->folder, name) : NULL;
    const uint64_t bytes = path ? lx_file_bytes(path) : 0;
    lx_free(path);
    return bytes;
}

lx_result lx_baked_describe(const lx_baked *baked, char **out_json, lx_error *error)
{
    lx_manifest copy = baked->manifest, *manifest = &copy; // shallow
    lx_baked_get_budget(baked, &copy.memory);
    uint64_t *sizes = lx_calloc_array((size_t)manifest->file_count + 2, sizeof *sizes);
    if (!sizes) return lx_fail_memory(error, "description");
    sizes[0] = file_bytes(baked, manifest->scene);
    sizes[1] = baked->pack_data.size;
    for (uint32_t i = 0; i < manifest->file_count; ++i) sizes[2 + i] = file_bytes(baked, manifest->files[i].file);
    const lx_result result = lx_manifest_write(manifest, sizes, out_json, error);
    lx_free(sizes);
    return result;
}
