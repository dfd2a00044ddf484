/// The graph that the denoiser walks, shared by its two files.
#ifndef LX_POST_DENOISE_GRAPH_H
#define LX_POST_DENOISE_GRAPH_H

#include "post/denoise.h"

enum {
    lx_denoise_direction_count = 8, ///< Along the texel grid: +x, +x+y, +y … counterclockwise; even ones along an axis.
    lx_denoise_level_count = 4,     ///< Steps of 1, 2, 4, 8 texels.
    lx_denoise_weight_bits = 4,
    lx_denoise_most_weight = (1 << lx_denoise_weight_bits) - 1,
};

/// links[(level * luxel_count + luxel) * 8 + direction]: neighbour << 4 | weight. No neighbour: the luxel itself with weight 0.
/// The weight (of 15) says how much alike the two normals are.
struct lx_denoise_graph {
    uint32_t luxel_count;
    uint32_t *links;
};

#endif
