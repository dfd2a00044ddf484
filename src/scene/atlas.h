/// The lightmap atlas: where on which page every triangle of every static instance keeps its light.
#ifndef LX_SCENE_ATLAS_H
#define LX_SCENE_ATLAS_H

#include "luxel/atlas.h"
#include "scene/scene.h"

#define LX_NO_CHART UINT32_MAX

/// Lightmap coordinates of one lx_primitive, per triangle corner, in its mesh's unit square (v downwards like glTF: row 0 is v = 0).
/// Corners of one vertex differ where a chart boundary runs between them; export welds them back into vertices.
typedef struct lx_atlas_primitive {
    lx_vec2 *corner_uv;      ///< [3 * triangle_count]; NULL: the primitive gets no texels (unlit material, non-static mesh).
    uint32_t *triangle_chart; ///< [triangle_count], numbered within the mesh; LX_NO_CHART for triangles without area, in space or in uv.
} lx_atlas_primitive;

typedef struct lx_atlas_mesh {
    bool existing;        ///< The file's own set serves; nothing is written.
    /// TEXCOORD_n that holds (existing) or will hold the lightmap coordinates. New ones go to 1 (a bad set there is replaced); if
    /// a material of the mesh samples 1, to the first of 2, 3, … that no primitive has and no material samples; to 0 if the mesh
    /// has no set and no texture at all. glTF wants sets without gaps: where a primitive lacks lower ones, export adds zeros.
    uint32_t texcoord;
    uint32_t chart_count;
} lx_atlas_mesh;

/// Place of one instance: page and rectangle in texels; uv_page = uv * scale + offset. The rectangle holds what the mesh uses of
/// its unit square: all of it for new charts, for a set of the file the part between its bounds (offset may then be negative).
typedef struct lx_atlas_rect {
    bool used; ///< False: not static, or nothing in its mesh takes light.
    uint32_t page, x, y, width, height;
    float scale[2], offset[2];
} lx_atlas_rect;

/// Arrays run parallel to the scene's primitives, meshes and instances.
struct lx_atlas {
    const lx_scene *scene; ///< Borrowed.
    uint32_t page_size, page_count, padding; ///< page_count 0: nothing takes light.
    float texels_per_m; ///< What came out.
    double seconds;     ///< What lx_atlas_build took.
    bool scene_atlas;   ///< The file brought one atlas for everything: one page, identity rectangles.
    lx_atlas_primitive *primitives;
    lx_atlas_mesh *meshes;
    lx_atlas_rect *rects;
};

#endif
