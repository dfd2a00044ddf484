/// Denoising of one layer's irradiance along the surface: linear filters of several widths side by side, and for each luxel the mixture of
/// the input and them that has the least squared error around it by Stein's unbiased estimate.
///
/// Three things keep it honest. Light moves along links between neighbouring luxels only, and links never cross a wall, an invalid luxel or a
/// fold. The filters do not look at the light, so that the estimate of their error is exact but for the variance. And the input is
/// part of every mixture: where differences are larger than the variance explains (shadow edges), or there is no noise, it stays.
///
/// Based on: [Blu2007] "The SURE-LET Approach to Image Denoising" (the best mixture as linear equations), here in the neighbourhood of
/// each luxel; [Li2012] "SURE-based Optimization for Adaptive Sampling and Reconstruction"; [Dammertz2010] "Edge-Avoiding À-Trous Wavelet Transform
/// for fast Global Illumination Filtering" (the filters, without its edges).
///
/// Use:
///     lx_denoise_graph_create(map, can_step, user, pool, &graph, error);            // once, for all layers
///     void *scratch = lx_malloc_array(1, lx_denoise_scratch_bytes(graph));          // per worker
///     lx_denoise_layer(graph, lx_light_direct, direct, NULL, scratch, direct_out);                   // any layer from any thread
///     lx_denoise_layer(graph, lx_light_indirect, indirect, &knots, scratch, indirect_out);
#ifndef LX_POST_DENOISE_H
#define LX_POST_DENOISE_H

#include "base/thread.h"
#include "post/luxel_map.h"

/// A step from one luxel to a neighbour, in its chart or across a seam.
typedef struct lx_luxel_step {
    uint32_t from, to;
} lx_luxel_step;

/// Sets open[i] to whether light may be taken along steps[i]: nothing stands between the two luxels. Called with batches from the pool's threads;
/// must be pure. The two are no more than about two texels apart, and face the same way.
typedef void (*lx_step_test)(void *user, const lx_luxel_step *steps, size_t count, bool *open);

/// Who neighbours whom at which distance. Immutable: all threads share it.
typedef struct lx_denoise_graph lx_denoise_graph;

/// `can_step` NULL: every step that geometry allows is open. The map is read during the call only. LX_ERROR_LIMIT beyond 2^28 luxels.
lx_result lx_denoise_graph_create(const lx_luxel_map *map, lx_step_test can_step, void *user, lx_pool *pool, lx_denoise_graph **out_graph,
                                  lx_error *error);
void lx_denoise_graph_destroy(lx_denoise_graph *graph);

/// Bytes of a graph of so many luxels, and at most while it is built; bytes of scratch memory that one call of lx_denoise_layer needs.
size_t lx_denoise_graph_bytes(uint32_t luxel_count);
size_t lx_denoise_graph_build_bytes(uint32_t luxel_count);
size_t lx_denoise_scratch_bytes(const lx_denoise_graph *graph);

/// What light is denoised. Direct light has shadow edges: it is also filtered along each axis of the grid alone. Indirect light is smooth: mixtures may
/// have weights below zero, which keeps its curvature.
typedef enum lx_light_part { lx_light_direct, lx_light_indirect } lx_light_part;

/// Luxels whose light was interpolated between others, their knots, up to four texels apart: they have no noise of their own, so knots are denoised and the rest is interpolated again.
typedef struct lx_denoise_knots {
    const float *share; ///< [luxel] Sum of the weights that its estimate has in all luxels' light, its own included: 1 or more. 0: it has none, its light is interpolated.
    void (*interpolate)(void *user, lx_rgb *light); ///< Sets light[luxel] where the share is 0. Called from any thread; must be pure.
    void *user;
} lx_denoise_knots;

/// Denoises one layer: `in` [luxel] → `out` [luxel], means alone. `scratch`: lx_denoise_scratch_bytes, 16-byte aligned, content irrelevant before
/// and after. Variances are those of the mean of the channels, 0 where the light is exact: it stays bit by bit where all within reach are.
/// `knots` NULL: no luxel's light is interpolated. Luxels that are not valid keep their value and give none. No value is invented: every channel of `out` lies between those of `in`.
void lx_denoise_layer(const lx_denoise_graph *graph, lx_light_part part, const lx_estimate *in, const lx_denoise_knots *knots, void *scratch, lx_rgb *out);

#endif
