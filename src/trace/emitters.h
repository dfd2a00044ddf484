/// Emissive triangles, ready to be sampled by area and brightness.
#ifndef LX_TRACE_EMITTERS_H
#define LX_TRACE_EMITTERS_H

#include "scene/scene.h"
#include "trace/light_tree.h"

/// One triangle of an emissive source: a cache line. Textured ones are cut into grid² pieces of equal area, so that bright texels get more samples.
typedef struct lx_emitter_triangle {
    lx_vec3 origin, edge1, edge2; ///< World: a point is origin + u edge1 + v edge2.
    lx_vec3 normal;     ///< Unit, the shining side.
    float probability;  ///< Its share of its source's power; of being chosen, where there is no tree.
    float area;         ///< m²
    uint32_t first_cdf; ///< Into piece_cdf: grid² + 1 entries, if grid > 1.
    uint8_t grid;       ///< Pieces per edge; 1: uniform, no table.
    bool double_sided;  ///< Shines from both sides.
    bool plain;         ///< Radiance 1 everywhere: no texture, no holes.
} lx_emitter_triangle;

/// Where it is in the scene.
typedef struct lx_emitter_place {
    uint32_t surface, triangle;
} lx_emitter_place;

typedef struct lx_emitters {
    lx_emitter_triangle *triangles; ///< Grouped by source.
    lx_emitter_place *places;       ///< [triangle_count]
    float *triangle_cdf;            ///< [triangle_count + source_count]; per source its triangles' running sum, starting at 0.
    float *piece_cdf;
    uint32_t *triangle_guide;       ///< Beside the running sums: the step at which the search for u = k / count may begin.
    uint16_t *piece_guide;
    uint32_t *first_triangle;       ///< [source_count + 1]
    lx_light_tree tree;             ///< Of all sources that have one.
    lx_light_roots *roots;          ///< [source_count] No tree: few triangles, chosen by power.
    float *source_power;            ///< [source_count] sum of area × mean texture brightness, m²; 0 for sources that are not emissive.
    size_t triangle_count, piece_count;
} lx_emitters;

typedef struct lx_emitter_sample {
    uint32_t index; ///< Of the triangle.
    float u, v;
    float pdf_area; ///< Density per m² within the source.
} lx_emitter_sample;

struct lx_tracer;

/// Reads the surfaces of `tracer` and fills tracer->emitters.
lx_result lx_emitters_build(struct lx_tracer *tracer, lx_error *error);
void lx_emitters_release(lx_emitters *emitters);

#define LX_NO_EMITTER UINT32_MAX

/// Chooses a triangle of a source, for what lies at `viewer`, by its tree if there is one; `by_power`: whatever lies at `viewer`. `u` becomes its place within
/// the choice. LX_NO_EMITTER if the source has nothing bright, or nothing that faces there.
uint32_t lx_emitters_choose(const lx_emitters *emitters, uint32_t source, bool by_power, lx_vec3 viewer, float *u, float *probability);
/// Asks for the memory that lx_emitters_locate waits for, given the triangle and its `u`.
void lx_emitters_prefetch(const lx_emitters *emitters, uint32_t index, float u);
/// Chooses a point of a triangle that was chosen with `probability`. False: none counts.
bool lx_emitters_locate(const lx_emitters *emitters, uint32_t index, float probability, lx_vec3 viewer, lx_vec2 u, lx_emitter_sample *out);
/// Both.
bool lx_emitters_sample(const lx_emitters *emitters, uint32_t source, bool by_power, lx_vec3 viewer, lx_vec2 u, lx_emitter_sample *out);
/// The density with which lx_emitters_sample chooses that point, not by power alone. `index` is the emitter triangle's number.
float lx_emitters_pdf_area(const lx_emitters *emitters, uint32_t source, uint32_t index, lx_vec3 viewer, float u, float v);

/// A plain triangle so near that cosine and distance differ a lot over it is sampled by solid angle. `corner`: its origin from the viewer.
LX_INLINED bool lx_emitter_is_near(lx_vec3 corner, lx_vec3 edge1, lx_vec3 edge2, float area)
{
    const float near_areas = 16; // square of the distance over the area
    const lx_vec3 centre = lx_mad(corner, lx_add(edge1, edge2), 1.0f / 3);
    return lx_dot(centre, centre) < near_areas * area;
}

/// Is a point chosen by a tree, rather than by power alone?
static inline bool lx_emitters_has_tree(const lx_emitters *emitters, uint32_t source)
{
    return emitters->roots[source].root != LX_NO_LIGHT_NODE;
}

#endif
