// The public side of pictures: sets up tracer, colours and lightmaps.
#include "luxel/render.h"

#include "bake/baked.h"
#include "bake/layers.h"
#include "base/error.h"
#include "render/develop.h"
#include "render/picture.h"

lx_render_desc lx_render_desc_default(void)
{
    return (lx_render_desc){.width = 1280, .height = 720, .samples = 16, .auto_exposure = true,
                            .tonemap = LX_TONEMAP_PBR_NEUTRAL, .view = LX_VIEW_LIT, .transport = lx_transport_desc_default()};
}

static lx_result check_desc(const lx_render_desc *desc, lx_error *error)
{
    if (desc->width < 1 || desc->height < 1 || desc->width > 16384 || desc->height > 16384)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "a picture of %u x %u pixels is not possible (1 to 16384 each)",
                       desc->width, desc->height);
    if (desc->samples < 1 || desc->samples > 1u << 20)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "samples must be 1 to %u, not %u", 1u << 20, desc->samples);
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
    LX_TRY(lx_view_choose(scene, desc, &view, error));
    LX_TRY(lx_tracer_create(scene, &desc->transport, true, &tracer, error));
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
