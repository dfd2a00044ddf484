/// Emissive triangles, ready to be sampled by area and brightness.
#ifndef LX_TRACE_EMITTERS_H
#define LX_TRACE_EMITTERS_H

#include "scene/scene.h"
#include "trace/light_tree.h"

/// One triangle of an emissive source. Textured ones are cut into grid² pieces of equal area, so that bright texels get more samples.
typedef struct lx_emitter_triangle {
    lx_vec3 origin, edge1, edge2; ///< World: a point is origin + u edge1 + v edge2.
    lx_vec3 normal;    ///< Unit, the shining side.
    bool double_sided; ///< Shines from both sides.
    bool plain;        ///< Radiance 1 everywhere: no texture, no holes.
    uint32_t surface, triangle;
    float probability; ///< Its share of its source's power; of being chosen, where there is no tree.
    float area;        ///< m²
    uint32_t grid;     ///< Pieces per edge; 1: uniform, no table.
    uint32_t first_cdf; ///< Into piece_cdf: grid² + 1 entries, if grid > 1.
} lx_emitter_triangle;

typedef struct lx_emitters {
    lx_emitter_triangle *triangles; ///< Grouped by source.
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
    const lx_emitter_triangle *triangle;
    float u, v;
    float pdf_area; ///< Density per m² within the source.
} lx_emitter_sample;

struct lx_tracer;

/// Reads the surfaces of `tracer` and fills tracer->emitters.
lx_result lx_emitters_build(struct lx_tracer *tracer, lx_error *error);
void lx_emitters_release(lx_emitters *emitters);

/// Chooses a point of a source, for what lies at `viewer`, by a table of its tree if there is one; `by_power`: whatever lies at `viewer`. False if the source has nothing
/// bright, or nothing that faces there.
bool lx_emitters_sample(const lx_emitters *emitters, uint32_t source, const lx_light_table *table, bool by_power, lx_vec3 viewer, lx_vec2 u,
                        lx_emitter_sample *out);
/// The density with which lx_emitters_sample chooses that point without a table and not by power alone. `index` is the emitter triangle's number.
float lx_emitters_pdf_area(const lx_emitters *emitters, uint32_t source, uint32_t index, lx_vec3 viewer, float u, float v);

/// Is a point chosen by a tree, rather than by power alone?
static inline bool lx_emitters_has_tree(const lx_emitters *emitters, uint32_t source)
{
    return emitters->roots[source].root != LX_NO_LIGHT_NODE;
}

#endif
