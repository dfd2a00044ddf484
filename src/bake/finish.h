/// From estimates to finished layers: denoise, add direct to indirect light, hand over.
#ifndef LX_BAKE_FINISH_H
#define LX_BAKE_FINISH_H

#include "bake/bake_job.h"

/// Estimates of `layer_count` layers from number `first_layer` on, [layer][luxel], direct and indirect light apart: what is noisy in one may be sharp in
/// the other. Luxels that are not valid are black; dilation fills them.
lx_result lx_bake_finish_layers(const lx_bake_job *job, const lx_estimate *direct, const lx_estimate *indirect, uint32_t first_layer,
                                uint32_t layer_count, lx_error *error);

#endif
