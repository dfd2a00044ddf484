// The public side of pictures: sets up tracer, colours and lightmaps.
#include "luxel/render.h"

#include "bake/baked.h"
#include "bake/layers.h"
#include "base/error.h"
#include "render/develop.h"
#include "render/picture.h"

lx_render_desc lx_render_desc_default(void)
{
    return (lx_render_desc){.width = 1280, .height = 720, .yfov_deg = 60, .samples = 16, .auto_exposure = true,
                            .tonemap = LX_TONEMAP_PBR_NEUTRAL, .view = LX_VIEW_LIT, .transport = lx_transport_desc_default()};
}

static lx_result check_desc(const lx_render_desc *desc, lx_error *error)
{
    if (desc->width < 1 || desc->height < 1 || desc->width > 16384 || desc->height > 16384)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "a picture of %u x %u pixels is not possible (1 to 16384 each)",
                       desc->width, desc->height);
    if (desc->samples < 1 || desc->samples > 1u << 20)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "samples must be 1 to %u, not %u", 1u << 20, desc->samples);
    if (desc->look && !(desc->yfov_deg > 0 && desc->yfov_deg < 180))
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "a field of view of %g degrees is not possible",
                       (double)desc->yfov_deg);
    return LX_OK;
}

static void choose_exposure(const lx_render_desc *desc, const float *rgb, float *out_ev)
{
    if (!out_ev) return;
    *out_ev = desc->auto_exposure ? lx_auto_exposure(rgb, (size_t)desc->width * desc->height) : desc->exposure_ev;
}

lx_result lx_render_scene(const lx_scene *scene, const lx_render_desc *desc, const lx_progress_sink *progress, float *out_rgb,
                          float *out_ev, lx_error *error)
{
    lx_result result = check_desc(desc, error);
    if (result != LX_OK) return result;
    lx_tracer *tracer = NULL;
    lx_source_use *uses = NULL;
    lx_view_rays view;
    LX_TRY(lx_tracer_create(scene, &desc->transport, true, &tracer, error));
    LX_TRY(lx_view_choose(tracer, desc, &view, error));
    uses = lx_uses_combined(tracer);
    if (!uses) {
        result = lx_fail_memory(error, "picture");
        goto cleanup;
    }
    // A picture shows what is there: mixed lights shine in full.
    for (uint32_t i = 0; i < lx_tracer_source_count(tracer); ++i) uses[i].direct = true;
    const lx_picture picture = {.tracer = tracer, .uses = uses};
    LX_TRY(lx_picture_render(&picture, &view, desc, progress, out_rgb, error));
    choose_exposure(desc, out_rgb, out_ev);
cleanup:
    lx_free(uses);
    lx_tracer_destroy(tracer);
    return result;
}

// ---- baked folders -------------------------------------------------------------------------------------------------------

// Every source at its layer's colour now, in layer 0. Sources the bake did not know (realtime ones) keep their authored strength.
static lx_source_use *current_uses(const lx_baked *baked, const lx_tracer *tracer, bool mixed_only)
{
    const uint32_t count = lx_tracer_source_count(tracer), scene_count = baked->scene->source_count;
    lx_source_use *uses = lx_calloc_array(count, sizeof *uses);
    if (!uses) return NULL;
    for (uint32_t i = 0; i < count; ++i) {
        const lx_source *source = lx_tracer_source(tracer, i);
        const uint32_t index = i < scene_count ? i : baked->use_count - 1;
        const bool known = baked->uses[index].layer >= 0;
        uses[i].weight = known ? lx_baked_source_strength(baked, index) : lx_rgb_scale(source->color, source->intensity);
        uses[i].layer = mixed_only && source->mode != LX_MODE_MIXED ? -1 : 0;
        uses[i].direct = true;
    }
    return uses;
}

static bool any_mixed(const lx_scene *scene)
{
    for (uint32_t i = 0; i < scene->source_count; ++i)
        if (scene->sources[i].mode == LX_MODE_MIXED) return true;
    return false;
}

static lx_result compose_pages(const lx_baked *baked, float **pages, lx_error *error)
{
    const size_t size = lx_baked_page_size(baked);
    for (uint32_t i = 0; i < lx_baked_page_count(baked); ++i) {
        pages[i] = lx_malloc_array(size * size, 3 * sizeof(float));
        if (!pages[i]) return lx_fail_memory(error, "lightmap pages");
        const lx_result result = lx_baked_compose(baked, i, pages[i], error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

lx_result lx_render_baked(lx_baked *baked, const lx_render_desc *desc, bool reference, const lx_progress_sink *progress,
                          float *out_rgb, float *out_ev, lx_error *error)
{
    lx_result result = check_desc(desc, error);
    if (result != LX_OK) return result;
    if (!baked->scene) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "the folder was opened without its scene");
    lx_tracer *tracer = NULL;
    lx_source_use *uses = NULL, *mixed_uses = NULL;
    float **pages = NULL;
    lx_view_rays view;
    lx_transport_desc transport = desc->transport;
    transport.sky = baked->sky;
    const uint32_t page_count = lx_baked_page_count(baked);
    LX_TRY(lx_tracer_create(baked->scene, &transport, true, &tracer, error));
    LX_TRY(lx_view_choose(tracer, desc, &view, error));
    uses = current_uses(baked, tracer, false);
    pages = lx_calloc_array(page_count, sizeof *pages);
    if (!uses || !pages) {
        result = lx_fail_memory(error, "picture");
        goto cleanup;
    }
    lx_picture picture = {.tracer = tracer, .uses = uses};
    if (!reference) {
        LX_TRY(compose_pages(baked, pages, error));
        picture.atlas = baked->atlas;
        picture.pages = (const float *const *)pages;
        if (any_mixed(baked->scene)) {
            mixed_uses = current_uses(baked, tracer, true);
            if (!mixed_uses) {
                result = lx_fail_memory(error, "picture");
                goto cleanup;
            }
            picture.mixed_uses = mixed_uses;
        }
    }
    LX_TRY(lx_picture_render(&picture, &view, desc, progress, out_rgb, error));
    choose_exposure(desc, out_rgb, out_ev);
cleanup:
    for (uint32_t i = 0; pages && i < page_count; ++i) lx_free(pages[i]);
    lx_free(pages);
    lx_free(uses);
    lx_free(mixed_uses);
    lx_tracer_destroy(tracer);
    return result;
}
