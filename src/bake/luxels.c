// From charts to luxels: which triangles cover which texels.
#include "bake/luxels.h"

#include "bake/texel_polygon.h"
#include "base/error.h"

#include <string.h>

static const double least_area = 1e-4; // of a texel's square: thinner slivers would sample one spot of another texel's light

// ---- rasterisation -------------------------------------------------------------------------------------------------------

uint32_t *lx_chart_bases(const lx_atlas *atlas)
{
    const lx_scene *scene = atlas->scene;
    uint32_t *bases = lx_calloc_array(scene->instance_count, sizeof *bases);
    if (!bases) return NULL;
    uint32_t next = 0;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        bases[i] = next;
        if (atlas->rects[i].used) next += atlas->meshes[scene->instances[i].mesh].chart_count;
    }
    return bases;
}

typedef struct raw_fragment {
    uint32_t texel, chart;
    lx_fragment fragment;
} raw_fragment;

typedef struct raw_fragments {
    raw_fragment *items;
    size_t count, capacity;
} raw_fragments;

static lx_result cover(raw_fragments *out, uint32_t size, const lx_point corner[3], raw_fragment fragment, lx_error *error)
{
    double low_x = size, low_y = size, high_x = 0, high_y = 0;
    for (int i = 0; i < 3; ++i) {
        low_x = fmin(low_x, corner[i].x);
        low_y = fmin(low_y, corner[i].y);
        high_x = fmax(high_x, corner[i].x);
        high_y = fmax(high_y, corner[i].y);
    }
    const int64_t x0 = low_x > 0 ? (int64_t)low_x : 0, y0 = low_y > 0 ? (int64_t)low_y : 0;
    const int64_t x1 = high_x < size ? (int64_t)high_x : (int64_t)size - 1, y1 = high_y < size ? (int64_t)high_y : (int64_t)size - 1;
    for (int64_t y = y0; y <= y1; ++y)
        for (int64_t x = x0; x <= x1; ++x) {
            const lx_polygon part = lx_clip_to_texel(corner, (double)x, (double)y);
            const double area = part.count >= 3 ? lx_polygon_area(&part) : 0;
            if (area < least_area) continue;
            if (!lx_array_reserve(&out->items, &out->capacity, out->count + 1, sizeof *out->items))
                return lx_fail_memory(error, "luxels");
            fragment.texel = (uint32_t)((size_t)y * size + (size_t)x);
            fragment.fragment.area = (float)area;
            out->items[out->count++] = fragment;
        }
    return LX_OK;
}

static lx_result cover_page(const lx_bake *bake, uint32_t page, const uint32_t *bases, raw_fragments *out, lx_error *error)
{
    const lx_scene *scene = bake->scene;
    const lx_atlas *atlas = bake->atlas;
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const lx_surface *surface = &scene->surfaces[s];
        const lx_atlas_rect *rect = &atlas->rects[surface->instance];
        if (!rect->used || rect->page != page) continue;
        const lx_atlas_primitive *charts = &atlas->primitives[surface->primitive];
        for (uint32_t t = 0; t < scene->primitives[surface->primitive].triangle_count; ++t) {
            lx_point corner[3];
            if (!lx_triangle_on_page(atlas, surface->instance, surface->primitive, t, corner)) continue;
            const raw_fragment f = {.chart = bases[surface->instance] + charts->triangle_chart[t],
                                    .fragment = {.surface = s, .triangle = t}};
            const lx_result result = cover(out, atlas->page_size, corner, f, error);
            if (result != LX_OK) return result;
        }
    }
    return LX_OK;
}

// Of the charts that touch a texel, the one with the largest share; ties go to the lowest number.
static uint32_t owner_of(const raw_fragment *f, const uint32_t *order, size_t count)
{
    uint32_t best = LX_NO_CHART;
    float best_area = 0;
    for (size_t i = 0; i < count; ++i) {
        const uint32_t chart = f[order[i]].chart;
        float area = 0;
        for (size_t k = 0; k < count; ++k) area += f[order[k]].chart == chart ? f[order[k]].fragment.area : 0;
        if (area > best_area || (area == best_area && chart < best)) {
            best = chart;
            best_area = area;
        }
    }
    return best;
}

// Groups raw fragments by texel (counting sort, stable) and drops those of charts that lost their texel.
static lx_result group_by_texel(lx_bake *bake, uint32_t page, const raw_fragments *raw, lx_luxel_page *out, lx_error *error)
{
    const size_t texel_count = (size_t)bake->atlas->page_size * bake->atlas->page_size;
    uint32_t *start = lx_calloc_array(texel_count + 1, sizeof *start);
    uint32_t *order = lx_malloc_array(raw->count, sizeof *order);
    out->first = lx_calloc_array(texel_count + 1, sizeof *out->first);
    out->fragments = lx_malloc_array(raw->count, sizeof *out->fragments);
    lx_result result = LX_OK;
    if (!start || !order || !out->first || !out->fragments) {
        result = lx_fail_memory(error, "luxels");
        goto cleanup;
    }
    for (size_t i = 0; i < raw->count; ++i) ++start[raw->items[i].texel + 1];
    for (size_t i = 0; i < texel_count; ++i) start[i + 1] += start[i];
    for (size_t i = 0; i < raw->count; ++i) order[start[raw->items[i].texel]++] = (uint32_t)i; // start[t] is now the end of t
    uint32_t *charts = bake->texel_chart + page * texel_count;
    uint8_t *coverage = bake->texel_coverage + page * texel_count;
    uint32_t kept = 0;
    for (size_t t = 0, begin = 0; t < texel_count; begin = start[t++]) {
        const uint32_t owner = owner_of(raw->items, order + begin, start[t] - begin);
        float area = 0;
        for (size_t k = begin; k < start[t]; ++k) {
            const raw_fragment *f = &raw->items[order[k]];
            if (f->chart != owner) continue;
            out->fragments[kept++] = f->fragment;
            area += f->fragment.area;
        }
        out->first[t + 1] = kept;
        charts[t] = owner;
        coverage[t] = owner == LX_NO_CHART ? 0 : (uint8_t)lx_clamp(ceilf(area * 255), 1, 255);
    }
cleanup:
    lx_free(start);
    lx_free(order);
    return result;
}

// ---- gaps between charts ----------------------------------------------------------------------------------------------------

// How much bilinear filtering of the surface within texel `neighbour` reads the texel (x, y) beside it.
static double need_of(const lx_bake *bake, const lx_luxel_page *page, uint32_t neighbour, uint32_t x, uint32_t y)
{
    const uint32_t size = bake->atlas->page_size;
    const double nx = neighbour % size, ny = neighbour / size, cx = x + 0.5, cy = y + 0.5;
    const lx_point low = {fmax(nx, cx - 1), fmax(ny, cy - 1)}, high = {fmin(nx + 1, cx + 1), fmin(ny + 1, cy + 1)};
    double sum = 0;
    for (uint32_t f = page->first[neighbour]; f < page->first[neighbour + 1]; ++f) {
        const lx_surface *surface = &bake->scene->surfaces[page->fragments[f].surface];
        lx_point corner[3];
        if (!lx_triangle_on_page(bake->atlas, surface->instance, surface->primitive, page->fragments[f].triangle, corner)) continue;
        const lx_polygon part = lx_clip_to_rect(corner, low, high);
        if (part.count < 3) continue;
        lx_point middle = {0, 0};
        for (int i = 0; i < part.count; ++i) middle = (lx_point){middle.x + part.p[i].x / part.count, middle.y + part.p[i].y / part.count};
        sum += lx_polygon_area(&part) * (1 - fabs(middle.x - cx)) * (1 - fabs(middle.y - cy));
    }
    return sum;
}

// An empty texel goes to the chart whose surface is filtered with it, if there are several to the one that reads it most. Charts that are two texels apart then never
// show each other's light. Dilation, which has the rest, knows whole texels only: it would give a gap of one texel to either chart, whichever needs it.
static void claim_gap(lx_bake *bake, const lx_luxel_page *page, uint32_t x, uint32_t y)
{
    const uint32_t size = bake->atlas->page_size;
    uint32_t *charts = bake->texel_chart + (size_t)page->number * size * size;
    uint32_t chart[8], count = 0;
    double need[8];
    for (int dy = -1; dy <= 1; ++dy)
        for (int dx = -1; dx <= 1; ++dx) {
            const int64_t nx = (int64_t)x + dx, ny = (int64_t)y + dy;
            if (nx < 0 || ny < 0 || nx >= size || ny >= size) continue;
            const uint32_t neighbour = (uint32_t)(ny * size + nx);
            if (page->first[neighbour] == page->first[neighbour + 1]) continue;
            uint32_t i = 0;
            while (i < count && chart[i] != charts[neighbour]) ++i;
            if (i == count) {
                chart[count] = charts[neighbour];
                need[count++] = 0;
            }
            need[i] += need_of(bake, page, neighbour, x, y);
        }
    if (count == 0) return;
    uint32_t best = 0;
    for (uint32_t i = 1; i < count; ++i)
        if (need[i] > need[best] || (need[i] == need[best] && chart[i] < chart[best])) best = i;
    if (need[best] > 0) charts[(size_t)y * size + x] = chart[best];
}

static void claim_gaps(lx_bake *bake, const lx_luxel_page *page)
{
    const uint32_t size = bake->atlas->page_size;
    for (uint32_t y = 0; y < size; ++y)
        for (uint32_t x = 0; x < size; ++x) {
            const size_t texel = (size_t)y * size + x;
            if (page->first[texel] == page->first[texel + 1]) claim_gap(bake, page, x, y);
        }
}

lx_result lx_luxels_rasterise(lx_bake *bake, uint32_t page, lx_luxel_page *out, lx_error *error)
{
    lx_result result = LX_OK;
    raw_fragments raw = {0};
    const uint32_t size = bake->atlas->page_size, edge = (size + lx_site_block - 1) / lx_site_block;
    *out = (lx_luxel_page){.number = page, .block_count = edge * edge};
    uint32_t *bases = lx_chart_bases(bake->atlas);
    if (!bases) return lx_fail_memory(error, "luxels");
    LX_TRY(cover_page(bake, page, bases, &raw, error));
    if (raw.count > UINT32_MAX) {
        result = lx_fail(error, LX_ERROR_LIMIT, "page %u: too many triangles per texel; use more or larger pages", page);
        goto cleanup;
    }
    LX_TRY(group_by_texel(bake, page, &raw, out, error));
    claim_gaps(bake, out);
    out->state = lx_malloc_array((size_t)size * size, sizeof *out->state);
    out->settled = lx_calloc_array(out->block_count, sizeof *out->settled);
    if (!out->state || !out->settled) {
        result = lx_fail_memory(error, "luxels");
        goto cleanup;
    }
    for (size_t i = 0; i < (size_t)size * size; ++i) out->state[i] = LX_SITES_PLAIN;
cleanup:
    lx_free(bases);
    lx_free(raw.items);
    if (result != LX_OK) lx_luxels_release(out);
    return result;
}

void lx_luxels_release(lx_luxel_page *page)
{
    lx_free(page->first);
    lx_free(page->fragments);
    lx_free(page->state);
    for (uint32_t i = 0; page->settled && i < page->block_count; ++i) lx_free(page->settled[i]);
    lx_free(page->settled);
    *page = (lx_luxel_page){0};
}
