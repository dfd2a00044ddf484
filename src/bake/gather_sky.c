// Where luxels sample a uniform sky besides their gather rays: in the cells of directions of which the cache's rays, in a luxel and around it, saw some clear and some
// not, and less in the cells beside those. Rays that decide are others than those that count, so nothing is lost on average.
#include "bake/gather_job.h"

#include <string.h>

enum {
    edge = lx_luxel_tile_edge,
    reach = 3,        // luxels
    enough_looks = 16, // at a cell, from as many luxels of the same chart
};

// The cells and the eight around each.
static uint64_t widen(uint64_t cells, uint32_t count)
{
    const uint32_t sectors = lx_sky_sectors(count);
    uint64_t wide = cells;
    for (uint32_t k = 0; k < count; ++k) {
        const uint32_t ring = k - k % sectors;
        if (cells >> k & 1) wide |= (uint64_t)1 << (ring + (k + 1) % sectors) | (uint64_t)1 << (ring + (k + sectors - 1) % sectors);
    }
    return wide | wide << sectors | wide >> sectors;
}

static lx_sky_cells choose(const lx_gather_scratch *s, const uint16_t *grid, uint32_t luxel, uint32_t count)
{
    const int32_t x0 = s->place[luxel] % edge, y0 = s->place[luxel] / edge;
    const uint64_t all_cells = ~(uint64_t)0 >> (lx_sky_most_cells - count);
    uint32_t looks = 0;
    uint64_t clear = 0, open = 0, blocked = 0; // to some look each; open: without a pane
    for (int32_t y = y0 > reach ? y0 - reach : 0; y <= y0 + reach && y < edge; ++y)
        for (int32_t x = x0 > reach ? x0 - reach : 0; x <= x0 + reach && x < edge; ++x) {
            const uint32_t other = grid[y * edge + x];
            if (other == 0 || s->chart[other - 1] != s->chart[luxel]) continue;
            clear |= s->sky_seen[other - 1];
            blocked |= ~s->sky_seen[other - 1];
            open |= s->sky_seen[other - 1] & ~s->sky_through[other - 1];
            ++looks;
        }
    const uint64_t wide = widen(clear & all_cells, count) & widen(blocked & all_cells, count) & all_cells;
    // Which rays a pane lets pass is chance, and no outline: shadow rays lose the same share each.
    const uint64_t likely = looks < enough_looks ? widen(open & all_cells, count) & wide : open & blocked & all_cells;
    return (lx_sky_cells){.mixed = likely, .beside = wide & ~likely};
}

void lx_gather_choose_sky_cells(const lx_gather_job *g, lx_gather_scratch *s)
{
    uint16_t grid[edge * edge]; // luxel + 1, 0: none
    memset(grid, 0, sizeof grid);
    for (uint32_t i = 0; i < s->count; ++i) grid[s->place[i]] = (uint16_t)(i + 1);
    for (uint32_t i = 0; i < s->count; ++i) s->sky_cells[i] = g->sky_cells[s->luxel[i]] = choose(s, grid, i, g->sky_cell_count);
}
