/// Denoising of one layer's irradiance along the surface: a wavelet filter that looks at the estimate's own variance, several widths of it
/// side by side, and for each luxel the mixture that has the least error by the estimate's own account.
///
/// Three things keep it honest. Light moves along links between neighbouring luxels only, and links never cross a wall, an invalid luxel or a
/// fold. Differences that the variance does not explain (shadow edges) stop it. And where no width promises less error than the input, the
/// input stays.
///
/// Based on: [Dammertz2010] "Edge-Avoiding À-Trous Wavelet Transform for fast Global Illumination Filtering"; [Schied2017] "Spatiotemporal
/// Variance-Guided Filtering" (a stopping function on variance that is filtered along); [Rousselle2012] "Adaptive Rendering with Non-Local
/// Means Filtering" (differences less what noise explains); [Li2012] "SURE-based Optimization for Adaptive Sampling and
/// Reconstruction" (choice among filters by Stein's unbiased estimate of their error).
///
/// Use:
///     lx_denoise_graph_create(map, can_step, user, pool, &graph, error);            // once, for all layers
///     void *scratch = lx_malloc_array(1, lx_denoise_scratch_bytes(graph));          // per worker
///     lx_denoise_layer(graph, lx_light_direct, direct, scratch, direct_out);                         // any layer from any thread
///     lx_denoise_layer(graph, lx_light_indirect, indirect, scratch, indirect_out);
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

/// What light is denoised. Direct light has shadow edges, whose differences count for more; indirect light is smooth and its noise has outliers.
typedef enum lx_light_part { lx_light_direct, lx_light_indirect } lx_light_part;

/// Denoises one layer: `in` [luxel] → `out` [luxel], means alone. `scratch`: lx_denoise_scratch_bytes, 16-byte aligned, content irrelevant before
/// and after. Variances are those of the mean of the channels, 0 where the light is exact: it stays bit by bit where all within reach are.
/// Luxels that are not valid keep their value and give none. No value is invented: every channel of `out` lies between those of `in`.
void lx_denoise_layer(const lx_denoise_graph *graph, lx_light_part part, const lx_estimate *in, void *scratch, lx_rgb *out);

#endif
