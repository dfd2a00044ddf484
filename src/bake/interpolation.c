#include "bake/interpolation.h"

enum { last = lx_luxel_tile_edge - 1 }; // its texels are knots too: grids end with the tile

static const float contrast = 2;
static const float same_normal = 0.9999f; // cosine
static const float same_place = 0.2f;     // of a texel, between a luxel's sites and where its knots say it is

typedef struct grid_step {
    uint32_t low, high; // knots on either side
    float above, below; // texels from them
} grid_step;

static grid_step step_of(uint32_t x, uint32_t spacing)
{
    const uint32_t low = x == last ? last : x / spacing * spacing;
    if (x == low) return (grid_step){x, x, 0, 0};
    const uint32_t high = low + spacing < last ? low + spacing : last;
    return x == high ? (grid_step){x, x, 0, 0} : (grid_step){low, high, (float)(x - low), (float)(high - x)};
}

static bool add_knot(const lx_luxel_map *map, const lx_luxel_tile *tile, uint32_t x, uint32_t y, float weight, lx_knots *out)
{
    x += tile->x;
    y += tile->y;
    if (x >= map->page_size || y >= map->page_size) return false;
    const uint32_t luxel = map->index[((size_t)tile->page * map->page_size + y) * map->page_size + x];
    if (luxel == LX_NO_LUXEL) return false;
    out->luxel[out->count] = luxel;
    out->weight[out->count++] = weight;
    return true;
}

static bool find(const lx_luxel_map *map, const lx_luxel_tile *tile, uint32_t luxel, uint32_t spacing, lx_knots *out, float *out_reach)
{
    const grid_step x = step_of(lx_luxel_x(map, luxel) - tile->x, spacing), y = step_of(lx_luxel_y(map, luxel) - tile->y, spacing);
    *out = (lx_knots){0};
    if (x.low == x.high && y.low == y.high) return false;
    *out_reach = x.above * x.below + y.above * y.below;
    const float u = x.low == x.high ? 0 : x.above / (x.above + x.below), v = y.low == y.high ? 0 : y.above / (y.above + y.below);
    if (!add_knot(map, tile, x.low, y.low, (1 - u) * (1 - v), out)) return false;
    if (u > 0 && !add_knot(map, tile, x.high, y.low, u * (1 - v), out)) return false;
    if (v > 0 && !add_knot(map, tile, x.low, y.high, (1 - u) * v, out)) return false;
    return !(u > 0 && v > 0) || add_knot(map, tile, x.high, y.high, u * v, out);
}

bool lx_find_knots(const lx_luxel_map *map, const lx_luxel_tile *tile, uint32_t luxel, uint32_t spacing, lx_knots *out)
{
    float reach;
    return find(map, tile, luxel, spacing, out, &reach);
}

static bool is_smooth(const lx_luxel_map *map, const lx_luxel_tile *tile, const float *closeness, uint32_t luxel, uint32_t spacing, float bound)
{
    lx_knots knots;
    float reach, closest = closeness[luxel];
    if (!find(map, tile, luxel, spacing, &knots, &reach)) return false;
    lx_vec3 place = {0, 0, 0};
    for (uint32_t k = 0; k < knots.count; ++k) {
        const uint32_t knot = knots.luxel[k];
        if (map->chart[knot] != map->chart[luxel] || !(lx_dot(map->normal[knot], map->normal[luxel]) > same_normal)) return false;
        place = lx_mad(place, map->position[knot], knots.weight[k]);
        closest = lx_max(closest, closeness[knot]);
    }
    const float size = map->size_m[luxel];
    if (!(lx_distance(place, map->position[luxel]) < same_place * size)) return false;
    return 0.5f * contrast * size * size * reach * closest <= bound; // false if infinite
}

void lx_choose_spacing(const lx_luxel_map *map, const lx_luxel_tile *tile, const float *closeness, float bound, uint8_t *spacing)
{
    static const uint8_t spacings[] = {lx_wide_spacing, lx_narrow_spacing};
    for (uint32_t i = tile->first; i < tile->first + tile->count; ++i) {
        spacing[i] = 0;
        for (size_t k = 0; k < sizeof spacings && spacing[i] == 0; ++k)
            if (is_smooth(map, tile, closeness, i, spacings[k], bound)) spacing[i] = spacings[k];
    }
}

void lx_visit_interpolated(const lx_luxel_map *map, const lx_luxel_tile *tile, const uint8_t *spacing, bool coarse_first,
                           void (*visit)(void *user, uint32_t luxel, const lx_knots *knots), void *user)
{
    const uint32_t grids[] = {coarse_first ? lx_wide_spacing : lx_narrow_spacing, coarse_first ? lx_narrow_spacing : lx_wide_spacing};
    lx_knots knots;
    for (int k = 0; k < 2; ++k)
        for (uint32_t i = tile->first; i < tile->first + tile->count; ++i)
            if (spacing[i] == grids[k] && lx_find_knots(map, tile, i, grids[k], &knots)) visit(user, i, &knots);
}
