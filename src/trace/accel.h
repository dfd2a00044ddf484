/// The ray tracing kernel behind the tracer: triangles in, hits out. Nothing here knows of materials.
#ifndef LX_TRACE_ACCEL_H
#define LX_TRACE_ACCEL_H

#include "trace/tracer.h"

typedef struct lx_accel lx_accel;

/// One indexed triangle mesh in world space; its number is lx_hit.surface. Arrays are shared: they must outlive the accel, and 16 bytes
/// past the last vertex must be readable.
typedef struct lx_accel_mesh {
    const lx_vec3 *vertices;
    const uint32_t *indices;
    uint32_t vertex_count, triangle_count;
    bool has_holes;     ///< Some hits may be holes (cutouts): asks `is_hole`.
    bool mirrored;      ///< The front side is the one from which the corners run clockwise.
    bool transmits;     ///< Some light may pass: asks `transmittance` on shadow rays.
    float front;        ///< The side that triangles show to the outside: 1 where they are counter-clockwise, -1 clockwise, 0: both sides are outside.
} lx_accel_mesh;

/// Asked during traversal, from any thread; must be pure.
typedef struct lx_accel_surface_queries {
    void *user;
    bool (*is_hole)(void *user, uint32_t mesh, uint32_t triangle, float u, float v);
    lx_rgb (*transmittance)(void *user, uint32_t mesh, uint32_t triangle, float u, float v);
} lx_accel_surface_queries;

/// `isa`: as in lx_context_desc, "" for the best there is. Meshes without triangles are fine.
lx_result lx_accel_create(const lx_accel_mesh *meshes, uint32_t mesh_count, lx_accel_surface_queries queries, const char *isa,
                          lx_accel **out_accel, lx_error *error);
void lx_accel_destroy(lx_accel *accel);

void lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count);
void lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count);
/// As lx_trace_crowded.
bool lx_accel_crowded(const lx_accel *accel, const lx_patch *patches, size_t count);

/// The instruction set in use, for the record ("avx2").
const char *lx_accel_isa(const lx_accel *accel);

#endif
