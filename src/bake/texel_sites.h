/// Where a texel's sites stand before anything is known of what is around them.
#ifndef LX_BAKE_TEXEL_SITES_H
#define LX_BAKE_TEXEL_SITES_H

#include "bake/luxels.h"
#include "bake/texel_polygon.h"

/// A fragment made ready: what does not depend on where in it a site lies, and but for `part` not on the texel either.
typedef struct lx_piece {
    bool known;         ///< Else an empty slot.
    uint32_t surface, triangle;
    uint32_t fragment;  ///< Of the texel; UINT32_MAX: of one that was open before.
    lx_point corner[3]; ///< Of its triangle, on the page.
    double whole;       ///< Twice the triangle's area there, with sign.
    lx_polygon part;    ///< Within the texel, where `clipped`: lx_texel_part.
    bool clipped;
    lx_vec3 world[3], vertex_normal[3];
    lx_vec3 normal;     ///< Geometric.
    bool smooth;        ///< False: its vertex normals are all `normal`, or equal each other: `shading_normal`.
    lx_vec3 shading_normal;
    float texel_m;      ///< Edge of a texel on this triangle, metres.
} lx_piece;

enum { lx_piece_slots = 4 }; ///< Most texels have one or two fragments.

typedef struct lx_texel {
    const lx_bake *bake;
    const lx_fragment *fragments;
    uint32_t x, y, fragment_count, stream;
    float area;    ///< Of all fragments, share of the square.
    lx_piece pieces[lx_piece_slots]; ///< Those seen last, by fragment number modulo lx_piece_slots.
} lx_texel;

/// `t` is all zeros, or was opened before for the same bake: neighbours mostly share their triangles, which are kept.
void lx_texel_open(lx_texel *t, const lx_bake *bake, const lx_luxel_page *page, uint32_t texel);
const lx_piece *lx_texel_piece(lx_texel *t, uint32_t fragment);

/// The part of a piece's triangle within the texel. Sites of texels that are covered all over do without.
const lx_polygon *lx_texel_part(lx_texel *t, const lx_piece *piece);

/// A place on a piece's triangle, in the world.
lx_vec3 lx_piece_point(const lx_piece *piece, lx_point on_page);

/// Edge of the open texel on its surface, metres; 0 if nothing covers it.
float lx_texel_size(lx_texel *t);

/// Where a place near the piece lies on its triangle: barycentrics of the second and third corner.
lx_vec2 lx_piece_barycentrics(const lx_piece *piece, lx_vec3 place);

/// Site `number` of the open texel as it falls. Returns the piece it lies on.
const lx_piece *lx_texel_site(lx_texel *t, uint32_t number, lx_receiver *out);

/// Sites first … first + count - 1 of a valid texel of a settled block, first + count <= lx_site_count: positions on the surface, lifted off it where smooth
/// shading asks for it. Every site counts the same. A site does not depend on which others are asked for. Opens the texel.
void lx_luxel_sites(lx_texel *t, const lx_bake *bake, const lx_luxel_page *page, uint32_t texel, uint32_t first, uint32_t count, lx_receiver *out);

#endif
