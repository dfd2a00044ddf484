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
    LX_TRY(lx_tracer_create(scene, &desc->transport, true, NULL, &tracer, error));
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

// Colours of now: every source at its layer's colour, in layer 0. Sources the bake did not know (realtime ones) keep their authored strength.
// A monitor shows its own picture until one of its cells gets another colour; then all its cells.
typedef struct current_colors {
    lx_source_use *uses, *mixed_uses; // all sources; those alone whose direct part is not in the lightmap
    bool *cells;                      // [source of the scene] the monitor shows cells
    lx_rgb *cell_colors;              // of all such monitors
} current_colors;

static void release_colors(current_colors *colors)
{
    lx_free(colors->uses);
    lx_free(colors->mixed_uses);
    lx_free(colors->cells);
    lx_free(colors->cell_colors);
}

static lx_result choose_cells(const lx_baked *baked, current_colors *out, lx_error *error)
{
    const lx_scene *scene = baked->scene;
    size_t total = 0;
    out->cells = lx_calloc_array(scene->source_count, sizeof *out->cells);
    if (!out->cells) return lx_fail_memory(error, "picture");
    for (uint32_t i = 0; i < scene->source_count; ++i) {
        const lx_manifest_monitor *monitor = lx_baked_monitor(baked, i);
        out->cells[i] = monitor && lx_baked_monitor_shows_cells(baked, monitor);
        if (out->cells[i]) total += lx_source_cell_count(&scene->sources[i]);
    }
    out->cell_colors = lx_calloc_array(total, sizeof *out->cell_colors);
    return out->cell_colors ? LX_OK : lx_fail_memory(error, "picture");
}

static void use_cells(const lx_baked *baked, uint32_t source, lx_source_use *use, lx_rgb *colors)
{
    const lx_manifest_monitor *monitor = lx_baked_monitor(baked, source);
    for (uint32_t cell = 0; cell < monitor->columns * monitor->rows; ++cell) {
        float c[3];
        lx_baked_get_layer(baked, monitor->first_layer + cell, c);
        colors[cell] = lx_rgb_of(c[0], c[1], c[2]);
    }
    use->weight = baked->uses[source].weight;
    use->cells = colors;
}

static lx_result find_colors(const lx_baked *baked, const lx_tracer *tracer, current_colors *out, lx_error *error)
{
    const uint32_t count = lx_tracer_source_count(tracer), scene_count = baked->scene->source_count;
    lx_rgb *next = out->cell_colors;
    out->uses = lx_calloc_array(count, sizeof *out->uses);
    out->mixed_uses = lx_calloc_array(count, sizeof *out->mixed_uses);
    if (!out->uses || !out->mixed_uses) return lx_fail_memory(error, "picture");
    for (uint32_t i = 0; i < count; ++i) {
        const lx_source *source = lx_tracer_source(tracer, i);
        const uint32_t index = i < scene_count ? i : baked->use_count - 1;
        const bool known = baked->uses[index].layer >= 0;
        lx_source_use *use = &out->uses[i];
        *use = (lx_source_use){.layer = 0, .direct = true};
        use->weight = known ? lx_baked_source_strength(baked, index) : lx_rgb_scale(source->color, source->intensity);
        if (i < scene_count && out->cells[i]) {
            use_cells(baked, i, use, next);
            next += lx_source_cell_count(source);
        }
        out->mixed_uses[i] = *use;
        if (source->mode != LX_MODE_MIXED) out->mixed_uses[i].layer = -1;
    }
    return LX_OK;
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
    current_colors colors = {0};
    float **pages = NULL;
    lx_view_rays view;
    lx_transport_desc transport = desc->transport;
    transport.sky = baked->sky;
    const uint32_t page_count = lx_baked_page_count(baked);
    LX_TRY(choose_cells(baked, &colors, error));
    LX_TRY(lx_tracer_create(baked->scene, &transport, true, colors.cells, &tracer, error));
    LX_TRY(lx_view_choose(tracer, desc, &view, error));
    LX_TRY(find_colors(baked, tracer, &colors, error));
    pages = lx_calloc_array(page_count, sizeof *pages);
    if (!pages) {
        result = lx_fail_memory(error, "picture");
        goto cleanup;
    }
    lx_picture picture = {.tracer = tracer, .uses = colors.uses};
    if (!reference) {
        LX_TRY(compose_pages(baked, pages, error));
        picture.atlas = baked->atlas;
        picture.pages = (const float *const *)pages;
        if (any_mixed(baked->scene)) picture.mixed_uses = colors.mixed_uses;
    }
    LX_TRY(lx_picture_render(&picture, &view, desc, progress, out_rgb, error));
    choose_exposure(desc, out_rgb, out_ev);
cleanup:
    for (uint32_t i = 0; pages && i < page_count; ++i) lx_free(pages[i]);
    lx_free(pages);
    release_colors(&colors);
    lx_tracer_destroy(tracer);
    return result;
}
