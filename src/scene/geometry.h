/// Making plain triangles and sound normals of what a file gives.
#ifndef LX_SCENE_GEOMETRY_H
#define LX_SCENE_GEOMETRY_H

#include "scene/scene.h"

typedef enum lx_topology {
    LX_TRIANGLES = 4,
    LX_TRIANGLE_STRIP = 5,
    LX_TRIANGLE_FAN = 6
} lx_topology; ///< glTF's numbers.

/// Triangles that `index_count` indices make.
uint32_t lx_triangle_count(lx_topology topology, uint32_t index_count);

/// Writes 3 × lx_triangle_count indices; every second triangle of a strip is turned, so that all face the same side.
void lx_triangulate(lx_topology topology, const uint32_t *indices, uint32_t index_count, uint32_t *out);

/// Makes all normals unit length. One that has no length becomes the mean of the triangles at its vertex. Returns how
/// many had none.
uint32_t lx_repair_normals(lx_primitive *primitive);

void lx_primitive_release(lx_primitive *primitive);

/// Triangles that name a vertex twice or whose corners lie on a line.
uint32_t lx_count_degenerate_triangles(const lx_primitive *primitive);

#endif
