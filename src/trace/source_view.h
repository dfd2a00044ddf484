/// Samples of one source from the sixteen sites of a luxel at a time: the same estimates as lx_sample_source, in loops that become vectors, with what the
/// luxel's samples share found once.
#ifndef LX_TRACE_SOURCE_VIEW_H
#define LX_TRACE_SOURCE_VIEW_H

#include "trace/lamp_sample.h"
#include "trace/light_tree.h"

enum { lx_view_size = 16 };

/// Vectors, field by field.
typedef struct lx_view_vectors {
    float x[lx_view_size], y[lx_view_size], z[lx_view_size];
} lx_view_vectors;

typedef struct lx_source_view {
    const lx_tracer *tracer;
    uint32_t source;
    lx_view_vectors position, normal, geometric_normal; ///< Of the receivers,
    lx_view_vectors origin;                             ///< and where their shadow rays start.
    float t_max;                       ///< Of all shadow rays.
    bool reaches;                      ///< Something may reach one of the receivers.
    int32_t reached[lx_view_size];     ///< 1: it may reach this one, 0: it does not.
    // Lamps.
    lx_lamp lamp;
    lx_area_view areas[lx_view_size];
    // Emissive meshes, and those of them that have a tree.
    bool has_cells;
    bool alone[lx_view_size];          ///< Samples bring all light; else hits have a share of it.
    bool has_table;
    lx_light_table table;
} lx_source_view;

/// Looks at a source, of whatever kind but a sky of one colour, from lx_view_size receivers close together.
void lx_source_view_fill(lx_source_view *view, const lx_tracer *tracer, uint32_t source, const lx_receiver *receivers);

/// One sample from each receiver.
typedef struct lx_view_samples {
    lx_view_vectors direction;    ///< Of the shadow ray, from the receiver's origin, for t from 0 to t_max.
    lx_rgb light[lx_view_size];   ///< Irradiance without occluders; black: nothing arrives, no ray.
    uint32_t cell[lx_view_size];
} lx_view_samples;

/// Samples first … first + lx_view_size - 1 of the stream `key`, from the receivers in their order. `count`: as lx_sample_source.
void lx_source_view_sample(const lx_source_view *view, uint32_t key, uint32_t first, uint32_t count, lx_view_samples *out);

#endif
