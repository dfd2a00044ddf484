/// From a hit to the luxel whose light it reflects.
#ifndef LX_BAKE_LOOKUP_H
#define LX_BAKE_LOOKUP_H

#include "bake/bake.h"
#include "base/memory.h"
#include "post/luxel_map.h"

/// A triangle's lightmap coordinates in its mesh's unit square. Two of them fill a cache line.
typedef struct lx_lookup_triangle {
    float u, v, u1, v1, u2, v2; ///< Of corner 0, and the edges to corners 1 and 2.
    uint32_t chart;             ///< Within the mesh; LX_NO_CHART: no luxels.
    uint32_t unused;
} lx_lookup_triangle;

typedef struct lx_lookup_surface {
    const lx_lookup_triangle *triangles; ///< NULL: the surface has no luxels.
    float scale[2], offset[2];           ///< From the unit square to texels of the page.
    uint32_t page, first_chart;
    float texel_m;                       ///< Edge of a texel on the surface, metres, by areas.
    bool plain;                          ///< lx_surface_is_plain: a hit on its front needs no shading to be looked up.
    bool double_sided;
} lx_lookup_surface;

/// Beside a luxel's number: it lies there, but its light says nothing of what is hit there. Its albedo does.
#define LX_SILENT 0x80000000u

/// What covers a texel: with the chart beside the luxel one cache line answers.
typedef struct lx_place {
    uint32_t luxel, chart; ///< The luxel that answers there, or a silent one; LX_NO_LUXEL: none.
} lx_place;

typedef struct lx_lookup {
    lx_lookup_surface *surfaces; ///< Parallel to the scene's.
    lx_lookup_triangle *triangles;
    lx_place *places;            ///< [page][page_size²]
    uint32_t page_size;
} lx_lookup;

/// All luxels of `map` answer until lx_lookup_silence.
lx_result lx_lookup_create(const lx_bake *bake, const lx_luxel_map *map, lx_lookup *out, lx_error *error);
void lx_lookup_release(lx_lookup *lookup);

/// Where a hit may be looked up: the texel that holds it, and one tap of a stochastic bilinear filter (`random`: 32 bits). Numbers of places.
typedef struct lx_taps {
    uint32_t tap, holder, chart;
} lx_taps;

static inline lx_taps lx_lookup_taps(const lx_lookup *lookup, const lx_hit *hit, uint32_t random)
{
    const lx_lookup_surface *s = &lookup->surfaces[hit->surface];
    const lx_lookup_triangle *t = &s->triangles[hit->triangle];
    const float x = (t->u + hit->u * t->u1 + hit->v * t->u2) * s->scale[0] + s->offset[0];
    const float y = (t->v + hit->u * t->v1 + hit->v * t->v2) * s->scale[1] + s->offset[1];
    // A shift by up to half a texel either way chooses among the four nearest centres with bilinear probability.
    const float dx = (float)(random & 0xffff) * 0x1p-16f - 0.5f, dy = (float)(random >> 16) * 0x1p-16f - 0.5f;
    const float most = (float)lookup->page_size - 0.5f;
    const uint32_t base = s->page * lookup->page_size * lookup->page_size;
    const uint32_t tap_x = (uint32_t)lx_clamp(x + dx, 0, most), tap_y = (uint32_t)lx_clamp(y + dy, 0, most);
    const uint32_t x0 = (uint32_t)lx_clamp(x, 0, most), y0 = (uint32_t)lx_clamp(y, 0, most);
    return (lx_taps){base + tap_y * lookup->page_size + tap_x, base + y0 * lookup->page_size + x0, s->first_chart + t->chart};
}

/// The luxel that answers for the taps, of their chart, or a silent one; LX_NO_LUXEL: none does. Where the texel that holds the hit says nothing, its neighbours say
/// nothing of it either: they may lie on the other side of what it reaches under.
static inline uint32_t lx_lookup_luxel(const lx_lookup *lookup, lx_taps taps)
{
    const lx_place tap = lookup->places[taps.tap], holder = lookup->places[taps.holder];
    if (holder.chart == taps.chart && holder.luxel >= LX_SILENT) return holder.luxel;
    if (tap.chart == taps.chart && tap.luxel < LX_SILENT) return tap.luxel;
    return holder.chart == taps.chart ? holder.luxel : LX_NO_LUXEL;
}

static inline void lx_lookup_fetch(const lx_lookup *lookup, lx_taps taps)
{
    LX_PREFETCH(&lookup->places[taps.tap]);
    LX_PREFETCH(&lookup->places[taps.holder]);
}

/// Luxels whose `answers` is false fall silent.
void lx_lookup_silence(lx_lookup *lookup, const lx_luxel_map *map, const uint8_t *answers);

#endif
