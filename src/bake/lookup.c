#include "bake/lookup.h"

#include "base/error.h"

static lx_result build_triangles(const lx_bake *bake, lx_lookup *out, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    size_t total = 0;
    size_t *first = lx_calloc_array((size_t)scene->primitive_count + 1, sizeof *first);
    if (!first) return lx_fail_memory(error, "lookup");
    for (uint32_t p = 0; p < scene->primitive_count; ++p) {
        first[p] = total;
        if (bake->atlas->primitives[p].corner_uv) total += scene->primitives[p].triangle_count;
    }
    out->triangles = lx_malloc_array(total, sizeof *out->triangles);
    if (!out->triangles) {
        lx_free(first);
        return lx_fail_memory(error, "lookup");
    }
    for (uint32_t p = 0; p < scene->primitive_count; ++p) {
        const lx_atlas_primitive *a = &bake->atlas->primitives[p];
        if (!a->corner_uv) continue;
        for (uint32_t t = 0; t < scene->primitives[p].triangle_count; ++t) {
            const lx_vec2 *c = a->corner_uv + 3 * (size_t)t;
            out->triangles[first[p] + t] = (lx_lookup_triangle){.u = c[0].x, .v = c[0].y, .u1 = c[1].x - c[0].x, .v1 = c[1].y - c[0].y,
                                                                .u2 = c[2].x - c[0].x, .v2 = c[2].y - c[0].y, .chart = a->triangle_chart[t]};
        }
    }
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const lx_surface *surface = &scene->surfaces[s];
        if (bake->atlas->rects[surface->instance].used && bake->atlas->primitives[surface->primitive].corner_uv)
            out->surfaces[s].triangles = out->triangles + first[surface->primitive];
    }
    lx_free(first);
    return LX_OK;
}

// Edge of a texel: root of the surface's area in the world over its area in texels.
static float texel_edge(const lx_bake *bake, uint32_t s, const lx_lookup_surface *out)
{
    const uint32_t count = bake->scene->primitives[bake->scene->surfaces[s].primitive].triangle_count;
    double world = 0, texels = 0;
    for (uint32_t t = 0; t < count; ++t) {
        const lx_lookup_triangle *l = &out->triangles[t];
        if (l->chart == LX_NO_CHART) continue;
        lx_vec3 p[3];
        lx_triangle_corners(bake->tracer, s, t, p);
        world += (double)lx_length(lx_cross(lx_sub(p[1], p[0]), lx_sub(p[2], p[0])));
        texels += fabs((double)l->u1 * (double)l->v2 - (double)l->v1 * (double)l->u2) * (double)out->scale[0] * (double)out->scale[1];
    }
    return texels > 0 ? (float)sqrt(world / texels) : 0;
}

lx_result lx_lookup_create(const lx_bake *bake, const lx_luxel_map *map, lx_lookup *out, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    const lx_atlas *atlas = bake->atlas;
    if (map->count >= LX_SILENT) return lx_fail(error, LX_ERROR_LIMIT, "%u texels are too many; fewer or smaller pages need less", map->count);
    const size_t texels = (size_t)map->page_size * map->page_size * map->page_count;
    lx_result result = LX_OK;
    uint32_t *first_chart = lx_calloc_array(scene->instance_count, sizeof *first_chart);
    *out = (lx_lookup){.page_size = map->page_size};
    out->surfaces = lx_calloc_array(scene->surface_count, sizeof *out->surfaces);
    out->places = lx_malloc_array(texels, sizeof *out->places);
    if (!first_chart || !out->surfaces || !out->places) {
        result = lx_fail_memory(error, "lookup");
        goto cleanup;
    }
    LX_TRY(build_triangles(bake, out, error));
    uint32_t next = 0;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        first_chart[i] = next;
        if (atlas->rects[i].used) next += atlas->meshes[scene->instances[i].mesh].chart_count;
    }
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        lx_lookup_surface *l = &out->surfaces[s];
        l->plain = lx_surface_is_plain(bake->tracer, s);
        l->double_sided = lx_surface_is_double_sided(bake->tracer, s);
        if (!l->triangles) continue;
        const lx_surface *surface = &scene->surfaces[s];
        const lx_atlas_rect *rect = &atlas->rects[surface->instance];
        for (int k = 0; k < 2; ++k) {
            l->scale[k] = rect->scale[k] * (float)atlas->page_size;
            l->offset[k] = rect->offset[k] * (float)atlas->page_size;
        }
        l->page = rect->page;
        l->first_chart = first_chart[surface->instance];
        l->texel_m = texel_edge(bake, s, l);
    }
    for (size_t i = 0; i < texels; ++i) {
        const uint32_t luxel = map->index[i];
        out->places[i] = (lx_place){luxel, luxel == LX_NO_LUXEL ? LX_NO_CHART : map->chart[luxel]};
    }
cleanup:
    lx_free(first_chart);
    if (result != LX_OK) lx_lookup_release(out);
    return result;
}

void lx_lookup_release(lx_lookup *lookup)
{
    lx_free(lookup->surfaces);
    lx_free(lookup->triangles);
    lx_free(lookup->places);
    *lookup = (lx_lookup){0};
}

void lx_lookup_silence(lx_lookup *lookup, const lx_luxel_map *map, const uint8_t *answers)
{
    for (uint32_t i = 0; i < map->count; ++i)
        if (!answers[i]) lookup->places[map->texel[i]].luxel = i | LX_SILENT;
}
