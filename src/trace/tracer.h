/// Batches of rays against a scene, and what they hit.
///
/// Arrays of rays in, arrays of hits or transmittances out; shading is a second batch step. Embree sits behind accel.h alone.
#ifndef LX_TRACE_TRACER_H
#define LX_TRACE_TRACER_H

#include "luxel/bake.h"
#include "scene/scene.h"

#include <string.h>

#define LX_MISS UINT32_MAX

/// Points origin + t · direction with t in (t_min, t_max). `direction` needs no unit length; t counts in its lengths.
typedef struct lx_ray {
    lx_vec3 origin;
    float t_min;
    lx_vec3 direction;
    float t_max;
} lx_ray;

typedef struct lx_hit {
    uint32_t surface;  ///< Index into the scene's surfaces, LX_MISS for none.
    uint32_t triangle; ///< Of the surface's primitive.
    float t;
    float u, v;        ///< Barycentrics: position = (1-u-v) p0 + u p1 + v p2 over the primitive's corners in index order.
    bool back;         ///< The ray came to the back side.
} lx_hit;

/// A hit as light transport sees it (spec: surfaces). Colours are linear.
typedef struct lx_shading {
    lx_vec3 position;         ///< On the triangle, world.
    lx_vec3 geometric_normal; ///< Unit, front side.
    lx_vec3 normal;           ///< Interpolated vertex normal, unit, on the geometric normal's side.
    bool front;               ///< The ray came to the front side.
    bool lit;                 ///< This side scatters and is not black: front, or double-sided.
    float opacity;            ///< Share of light that meets the diffuse surface; 1 for opaque ones.
    lx_rgb albedo;            ///< Diffuse reflectance of that share, at most 0.99.
    lx_rgb transmittance;     ///< Share of light that passes straight on; 0 for opaque surfaces. opacity + transmittance <= 1.
    lx_rgb emission;          ///< Radiance in nit towards the ray's origin at unit factor and strength (texture alone; 1 for monitors told
                              ///< by cell); 0 if none.
                              ///< Unlit materials: their base colour.
} lx_shading;

/// A place that receives light. Normals are unit and on the same side.
typedef struct lx_receiver {
    lx_vec3 position;         ///< On the surface.
    lx_vec3 normal;           ///< Interpolated: of the cosine.
    lx_vec3 geometric_normal; ///< Light from below it does not count.
} lx_receiver;

typedef struct lx_tracer lx_tracer;

/// Builds the acceleration structure and the tables for sampling sources. `include_dynamic`: non-static instances are in it
/// (pictures); else they are not there at all (bakes). The sky is read from transport->sky. `cells`: per source of the scene, true: this
/// monitor shines white all over, so that its light can be told by cell; NULL, or false: it shines with its picture as any emitter does.
lx_result lx_tracer_create(const lx_scene *scene, const lx_transport_desc *transport, bool include_dynamic, const bool *cells,
                           lx_tracer **out_tracer, lx_error *error);
void lx_tracer_destroy(lx_tracer *tracer);

const lx_scene *lx_tracer_scene(const lx_tracer *tracer);
/// Sources of the scene, then the sky if there is one (kind LX_SOURCE_SKY, name "sky").
uint32_t lx_tracer_source_count(const lx_tracer *tracer);
const lx_source *lx_tracer_source(const lx_tracer *tracer, uint32_t index);
/// Number of cells that the light of a source is told by: those of a monitor with `cells`; else 1.
uint32_t lx_tracer_cell_count(const lx_tracer *tracer, uint32_t source);
/// True for a monitor with `cells`, also one of a single cell.
bool lx_tracer_is_told_by_cell(const lx_tracer *tracer, uint32_t source);
/// The cell a point of an emitting surface lies in; 0 unless its source is a monitor with `cells`.
uint32_t lx_tracer_cell_at(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v);
/// Radiance of the sky at unit intensity and white tint in a direction (picture alone); black without a sky.
lx_rgb lx_tracer_sky_radiance(const lx_tracer *tracer, lx_vec3 direction);

/// Nearest hits. Cutouts are seen through; blended and transmitting surfaces are hits. Thread-safe.
void lx_trace_closest(const lx_tracer *tracer, const lx_ray *rays, lx_hit *hits, size_t count);
/// How much light passes each ray: product over crossed surfaces, each triangle once. Thread-safe.
void lx_trace_transmittance(const lx_tracer *tracer, const lx_ray *rays, lx_rgb *transmittance, size_t count);
/// A flat piece of surface: a convex polygon of at most 8 corners.
typedef struct lx_patch {
    lx_vec3 centre, normal;
    lx_vec3 corners[8];
    uint32_t corner_count;
} lx_patch;

/// Does anything reach into the patches, or so close above them that one place there may be inside a solid, or in another room, and the next not? True
/// too often rather than too rarely. Surfaces that only touch a patch along its edge, as walls do the floor of their room, do not count. Thread-safe.
bool lx_trace_crowded(const lx_tracer *tracer, const lx_patch *patches, size_t count);
/// Shades hits; misses are skipped. Thread-safe.
void lx_shade_hits(const lx_tracer *tracer, const lx_hit *hits, lx_shading *shading, size_t count);
/// The same, but positions and normals are left as they are.
void lx_shade_materials(const lx_tracer *tracer, const lx_hit *hits, lx_shading *shading, size_t count);

/// Many hits as places that receive light, on the sides that were hit, without asking their materials.
void lx_hit_receivers(const lx_tracer *tracer, const lx_hit *hits, lx_receiver *receivers, size_t count);
/// The bare geometry of a hit: what is there without asking its material. `normal` is the unit geometric normal of the front side.
void lx_hit_geometry(const lx_tracer *tracer, const lx_hit *hit, lx_vec3 *position, lx_vec3 *normal);
/// Corners of a triangle in world space.
void lx_triangle_corners(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, lx_vec3 corners[3]);
/// Unit vertex normals of a triangle in world space; false if it is flat-shaded.
bool lx_triangle_normals(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, lx_vec3 normals[3]);
/// Its unit geometric normal, on the front side.
lx_vec3 lx_triangle_normal(const lx_tracer *tracer, uint32_t surface, const lx_vec3 corners[3]);
/// Does the surface shine or shade from its back too?
bool lx_surface_is_double_sided(const lx_tracer *tracer, uint32_t surface);
/// Is a hit on its front (or on its back, which is black unless it is double-sided) all there is to know of it: opaque, and no light source?
bool lx_surface_is_plain(const lx_tracer *tracer, uint32_t surface);
/// Has the surface an inside behind it? Opaque ones with one side have; panes, cutouts and sheets with two sides don't.
bool lx_surface_is_solid(const lx_tracer *tracer, uint32_t surface);

LX_INLINED float lx_offset_component(float position, float normal)
{
    const float origin = 1.0f / 32, float_scale = 1.0f / 65536, int_scale = 256;
    int32_t bits;
    memcpy(&bits, &position, sizeof bits);
    const int32_t steps = (int32_t)(int_scale * normal);
    bits += position < 0 ? -steps : steps;
    float moved;
    memcpy(&moved, &bits, sizeof moved);
    return fabsf(position) < origin ? position + float_scale * normal : moved;
}

/// A ray's origin moved off its surface to the side of `normal` (unit, geometric) by a few roundings of the coordinates. No branches: loops over it become
/// vectors.
/// Based on: [WachterBinder2019] "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, ch. 6.
LX_INLINED lx_vec3 lx_offset_origin(lx_vec3 position, lx_vec3 normal)
{
    // Coordinates of different size get steps of different size, so the sum of all three would also drift along the surface, and near an edge
    // through the next wall. Only its share along the normal is taken.
    const lx_vec3 moved = {lx_offset_component(position.x, normal.x), lx_offset_component(position.y, normal.y),
                           lx_offset_component(position.z, normal.z)};
    return lx_mad(position, normal, lx_dot(lx_sub(moved, position), normal));
}

/// Lets the ray go on behind a hit: t_min moves past hit.t by a few roundings. The same triangle may still be hit once more;
/// callers that count crossings skip it.
void lx_ray_step_past(lx_ray *ray, const lx_hit *hit);

/// Instruction set of the ray tracing kernel, for the record.
const char *lx_tracer_isa(const lx_tracer *tracer);

#endif
