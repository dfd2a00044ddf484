// Saving a bake: all files into OUT.partial, the preview from what was just written, then the swap.
#include "api/report.h"
#include "bake/baked.h"
#include "bake/save.h"
#include "base/clock.h"
#include "base/context.h"
#include "base/error.h"
#include "image/image.h"
#include "luxel/render.h"

#include <string.h>

lx_save_desc lx_save_desc_default(void)
{
    return (lx_save_desc){.preview = true, .report = true, .preview_width = 960, .preview_height = 540};
}

lx_result lx_bake_check_folder(const char *folder, lx_error *error)
{
    return lx_folder_check(folder, error);
}

static lx_result check_desc(const lx_save_desc *desc, lx_error *error)
{
    enum { known = LX_LIGHTMAP_KTX2 | LX_LIGHTMAP_EXR | LX_LIGHTMAP_HDR, longest = 16384 };
    if (desc->formats & ~(uint32_t)known)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "lightmap formats %#x: unknown bits", desc->formats);
    if (desc->preview && (desc->preview_width < 1 || desc->preview_width > longest || desc->preview_height < 1 ||
                          desc->preview_height > longest))
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "preview of %u x %u pixels: 1 to %d are possible", desc->preview_width,
                       desc->preview_height, longest);
    return LX_OK;
}

static void drop_message(void *user, lx_log_level level, const char *message)
{
    (void)user;
    (void)level;
    (void)message;
}

// A context like the bake's, but silent: opening the scene again would repeat what its import had to say.
static lx_result create_silent_context(const lx_context *like, lx_context **out, lx_error *error)
{
    lx_context_desc desc = lx_context_desc_default();
    desc.logger = (lx_logger){drop_message, NULL};
    desc.thread_count = lx_pool_worker_count(like->pool);
    desc.isa = like->isa[0] ? like->isa : NULL;
    return lx_context_create(&desc, out, error);
}

static lx_result write_preview(lx_bake *bake, const lx_save_desc *desc, lx_baked *baked, const lx_new_folder *folder,
                               const lx_progress_sink *progress, lx_manifest *manifest, lx_image *out_picture, lx_error *error)
{
    lx_result result = LX_OK;
    lx_bytes png = {0};
    lx_render_desc render = lx_render_desc_default();
    render.width = desc->preview_width;
    render.height = desc->preview_height;
    float *rgb = lx_malloc_array((size_t)render.width * render.height, 3 * sizeof *rgb);
    if (!rgb) {
        result = lx_fail_memory(error, "preview");
        goto cleanup;
    }
    LX_TRY(lx_image_create(render.width, render.height, 3, LX_PIXEL_U8, out_picture, error));
    LX_TRY(lx_render_baked(baked, &render, false, progress, rgb, &manifest->view_ev, error));
    lx_render_develop(&render, manifest->view_ev, rgb, out_picture->u8);
    LX_TRY(lx_png_encode(out_picture, &png, error));
    LX_TRY(lx_new_folder_write(folder, "preview.png", png.data, png.size, error));
    manifest->has_view = true;
    bake->summary.view_ev = manifest->view_ev;
cleanup:
    lx_bytes_release(&png);
    lx_free(rgb);
    return result;
}

static lx_result write_report(const lx_bake *bake, lx_baked *baked, const lx_new_folder *folder, const lx_manifest *manifest,
                              const lx_image *preview, lx_error *error)
{
    enum { thumbnail_width = 240, thumbnail_samples = 4 };
    lx_result result = LX_OK;
    lx_builder html = {0};
    lx_seen seen = {0};
    if (preview) {
        lx_render_desc desc = lx_render_desc_default();
        desc.width = thumbnail_width;
        desc.height = (uint32_t)((uint64_t)thumbnail_width * preview->height / preview->width);
        if (desc.height == 0) desc.height = 1;
        if (desc.height > 4 * thumbnail_width) desc.height = 4 * thumbnail_width;
        desc.samples = thumbnail_samples;
        LX_TRY(lx_seen_create(baked, &desc, &seen, error));
    }
    const lx_report report = {
        .title = lx_path_name(folder->path),
        .files_folder = folder->partial,
        .bake = bake,
        .baked = baked,
        .manifest = manifest,
        .preview = preview,
        .seen = preview ? &seen : NULL,
    };
    LX_TRY(lx_report_build(&report, &html, error));
    LX_TRY(lx_new_folder_write(folder, "report.html", html.text, html.length, error));
cleanup:
    lx_seen_release(&seen);
    lx_builder_release(&html);
    return result;
}

// Opens the folder as it will be opened later, so that preview and report also prove that it can be.
static lx_result write_from_folder(lx_bake *bake, const lx_save_desc *desc, const lx_new_folder *folder, const lx_progress_sink *progress,
                                   lx_manifest *manifest, lx_error *error)
{
    lx_result result = LX_OK;
    lx_context *context = NULL;
    lx_baked *baked = NULL;
    lx_image picture = {0};
    const double start = lx_seconds();
    LX_TRY(create_silent_context(bake->scene->context, &context, error));
    LX_TRY(lx_baked_open_mapped(context, folder->partial, desc->preview, &baked, error));
    lx_baked_get_budget(baked, &manifest->memory);
    bake->summary.budget = manifest->memory;
    if (desc->preview) {
        LX_TRY(write_preview(bake, desc, baked, folder, progress, manifest, &picture, error));
        manifest->bake.stages.preview = lx_seconds() - start;
    }
    manifest->has_report = desc->report;
    LX_TRY(lx_bake_write_manifest(manifest, folder, error));
    if (desc->report) LX_TRY(write_report(bake, baked, folder, manifest, desc->preview ? &picture : NULL, error));
cleanup:
    lx_image_release(&picture);
    lx_baked_destroy(baked);
    lx_context_destroy(context);
    return result;
}

lx_result lx_bake_save(lx_bake *bake, const char *folder, const lx_save_desc *desc, const lx_progress_sink *progress, lx_error *error)
{
    lx_result result = LX_OK;
    lx_new_folder fresh = {0};
    lx_manifest manifest = {0};
    const lx_save_desc defaults = lx_save_desc_default();
    const double start = lx_seconds();
    if (!desc) desc = &defaults;
    LX_TRY(check_desc(desc, error));
    LX_TRY(lx_new_folder_begin(folder, &fresh, error));
    LX_TRY(lx_bake_write(bake, desc, &fresh, progress, &manifest, error));
    manifest.bake.stages.save = lx_seconds() - start;
    LX_TRY(lx_bake_write_manifest(&manifest, &fresh, error));
    LX_TRY(write_from_folder(bake, desc, &fresh, progress, &manifest, error));
    bake->summary.stages = manifest.bake.stages;
    LX_TRY(lx_new_folder_commit(&fresh, error));
cleanup:
    lx_new_folder_abort(&fresh);
    lx_manifest_release(&manifest);
    return result;
}
