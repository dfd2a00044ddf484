/// Inside a tracer, for the files of this folder.
#ifndef LX_TRACE_TRACER_DATA_H
#define LX_TRACE_TRACER_DATA_H

#include "trace/accel.h"
#include "trace/emitters.h"
#include "trace/sky.h"

/// How a surface meets rays.
typedef enum lx_surface_kind {
    LX_SURFACE_OPAQUE,
    LX_SURFACE_CUTOUT,       ///< Alpha test: a hit is a hole or opaque.
    LX_SURFACE_TRANSLUCENT,  ///< Light passes in part: blended, transmitting, luxel_transparent.
} lx_surface_kind;

typedef struct lx_traced_surface {
    lx_surface_kind kind;
    const lx_vec3 *positions; ///< World, [vertex_count] of its primitive; NULL if it is not traced.
    float orientation;        ///< Sign of the instance's determinant.
    uint32_t first_emitter_triangle; ///< Into emitters.triangles if the surface emits.
    // What shading reads of every hit, in one place.
    const lx_material *material;
    const uint32_t *indices;
    const lx_vec3 *normals;   ///< Of the primitive, local; NULL: flat.
    lx_vec3 normal_axes[3];   ///< A local normal n becomes n.x [0] + n.y [1] + n.z [2] in the world, up to length.
    bool even;                ///< No texture and no vertex colour counts: what follows holds all over its lit side.
    float opacity;
    lx_rgb albedo, transmittance, emission;
} lx_traced_surface;

/// Where a source is and how much it can give, for leaving it out cheaply.
typedef struct lx_source_sphere {
    lx_vec3 centre;
    float radius;
    float power;     ///< Largest E · d² at unit strength: candela, or nit × m². Infinity: the source is everywhere (sun, sky).
    float cos_outer; ///< Spots.
} lx_source_sphere;

struct lx_tracer {
    const lx_scene *scene;
    bool coloured_shadows;
    lx_traced_surface *surfaces; ///< Parallel to the scene's.
    lx_vec3 *positions;          ///< World positions of all traced surfaces, with room behind the last one.
    lx_accel *accel;
    lx_emitters emitters;
    lx_sky sky;
    lx_source sky_source;
    uint32_t *source_keys;       ///< [source count] random stream of each source, from its name: see lx_tracer_source_key.
    float *source_scales;        ///< [source count] a small share of the mean irradiance that a source of strength 1 gives the scene's surfaces.
    lx_source_sphere *source_spheres; ///< [source count]
    uint32_t *source_cells;      ///< [source count] cells that the source's light is told by; 0: not told by cell.
    uint32_t source_count;
};

/// Mean unshadowed irradiance that a source of strength 1 gives the scene's surfaces.
static inline float lx_source_mean(const lx_tracer *tracer, uint32_t source)
{
    return 20 * tracer->source_scales[source]; // see build_scales
}

/// True if the surface belongs to a monitor whose light is told by cell.
static inline bool lx_surface_is_told_by_cell(const lx_tracer *tracer, uint32_t surface)
{
    const int32_t source = tracer->scene->surfaces[surface].source;
    return source >= 0 && tracer->source_cells[source] > 0;
}

/// Radiance (unit factor and strength, textures and coverage by alpha applied) that a point of an emitting surface sends out of its shining side(s).
lx_rgb lx_surface_emission(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v);

#endif
