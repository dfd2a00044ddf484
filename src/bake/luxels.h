/// Luxels: texels of the lightmap with their places in the world.
///
/// A texel's light is that of its *sites*, lx_site_count places spread over its covered part. Before light is baked the sites are settled, once for
/// all stages: those inside solid geometry or beyond a wall are replaced, and texels that have no place left are told.
#ifndef LX_BAKE_LUXELS_H
#define LX_BAKE_LUXELS_H

#include "bake/bake.h"

enum {
    lx_site_count = 16,  ///< Sites of a texel. Any aligned run of 2^k of them is well spread in itself.
    lx_site_block = 32,  ///< Sites are settled by squares of as many texels: no two tasks write the same memory.
};

/// The part of one texel's square that one triangle covers.
typedef struct lx_fragment {
    uint32_t surface, triangle;
    float area; ///< Share of the texel's square, 0…1.
} lx_fragment;

/// Sites of a texel of which some do not lie where their numbers say: site k is that of number `number[k]`, at `position[k]`.
typedef struct lx_settled {
    lx_vec3 position[lx_site_count];
    uint8_t number[lx_site_count];
    bool split; ///< Some of the texel lies in another room, or under something low: its light is not that of every place on it.
} lx_settled;

/// First number of each instance's charts in lx_bake.texel_chart: [instance_count], owned by the caller; NULL: no memory.
uint32_t *lx_chart_bases(const lx_atlas *atlas);

/// All fragments of a page, grouped by texel: those of texel i are first[i] … first[i + 1] - 1. All of a texel's fragments belong to one chart.
typedef struct lx_luxel_page {
    uint32_t number;
    uint32_t *first;        ///< [page_size² + 1]
    lx_fragment *fragments;
    uint16_t *state;        ///< [page_size²] how the texel's sites settled: LX_SITES_PLAIN, LX_SITES_INVALID, or an index into its block's list.
    lx_settled **settled;   ///< [block_count], rows of blocks.
    uint32_t block_count;
} lx_luxel_page;

#define LX_SITES_PLAIN 0xffffu
#define LX_SITES_INVALID 0xfffeu

/// Conservative rasterisation of page `page`: fills `out`, and bake->texel_chart and bake->texel_coverage of that page.
/// Where two charts touch one texel the larger share wins; an empty texel beside charts goes to the one whose bilinear filtering reads it most (in
/// texel_chart alone; its coverage stays 0).
lx_result lx_luxels_rasterise(lx_bake *bake, uint32_t page, lx_luxel_page *out, lx_error *error);
void lx_luxels_release(lx_luxel_page *page);

/// Settles the sites of the block whose first texel is (x, y), multiples of lx_site_block. Blocks may be settled by different threads.
///
/// A site is good if at most a quarter of its hemisphere looks at the back of solid surfaces (opaque ones with one side). A texel takes its light from its
/// good sites alone; where it has next to none, from those that can be moved out from under what covers them, along the texel's own surface and by a texel at most.
/// Sites that cannot see each other lie in different rooms: the texel belongs to the one where more of its good sites lie.
lx_result lx_luxels_settle(const lx_bake *bake, lx_luxel_page *page, uint32_t x, uint32_t y, lx_error *error);

/// True if light at the texel means something: false where no good site was found.
static inline bool lx_luxel_is_valid(const lx_luxel_page *page, uint32_t texel)
{
    return page->state[texel] != LX_SITES_INVALID;
}

/// False where the texel reaches into more than one room, or under something low: what is hit there may be lit quite differently from the texel's sites.
bool lx_luxel_is_whole(const lx_bake *bake, const lx_luxel_page *page, uint32_t texel);

/// Key of a texel's random streams, from the seed, its page and its number there.
uint32_t lx_luxel_stream(const lx_bake *bake, const lx_luxel_page *page, uint32_t texel);

#endif
