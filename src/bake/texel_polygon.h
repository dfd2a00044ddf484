/// Triangles on a lightmap page, cut to the square of one texel. Coordinates count in texels of the page.
#ifndef LX_BAKE_TEXEL_POLYGON_H
#define LX_BAKE_TEXEL_POLYGON_H

#include "bake/bake.h"

enum { lx_most_corners = 8 }; ///< A triangle cut by four lines has at most seven.

typedef struct lx_point {
    double x, y;
} lx_point;

/// Convex.
typedef struct lx_polygon {
    lx_point p[lx_most_corners];
    int count;
} lx_polygon;

/// Twice the signed area of the triangle a b c.
static inline double lx_cross_of(lx_point a, lx_point b, lx_point c)
{
    return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

double lx_polygon_area(const lx_polygon *p);

/// The part of a triangle within a rectangle; count 0: none.
lx_polygon lx_clip_to_rect(const lx_point corner[3], lx_point low, lx_point high);
/// The same for the square of a texel, (x, y) … (x + 1, y + 1).
static inline lx_polygon lx_clip_to_texel(const lx_point corner[3], double x, double y)
{
    return lx_clip_to_rect(corner, (lx_point){x, y}, (lx_point){x + 1, y + 1});
}

/// A triangle's corners on its page. False: it has no texels.
bool lx_triangle_on_page(const lx_atlas *atlas, uint32_t instance, uint32_t primitive, uint32_t triangle, lx_point out[3]);

#endif
