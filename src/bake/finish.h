/// From estimates to finished layers: denoise, add direct to indirect light, make both sides of seams agree, hand over.
///
///     lx_finish_open(&job, &finish, error);                                     // once luxels are placed and pages dilated
///     lx_finish_layers(finish, direct, indirect, spacing, first, count, error); // each group of layers
///     lx_finish_close(finish);
#ifndef LX_BAKE_FINISH_H
#define LX_BAKE_FINISH_H

#include "bake/bake_job.h"

typedef struct lx_finish lx_finish;

/// What all layers share: who neighbours whom, the seams, the library of `--denoise oidn`. `job` must outlive it.
lx_result lx_finish_open(const lx_bake_job *job, lx_finish **out_finish, lx_error *error);
void lx_finish_close(lx_finish *finish);
/// Memory that a worker takes for a layer at work. What the library of `--denoise oidn` takes on top is not known.
uint64_t lx_finish_worker_bytes(const lx_finish *finish);

/// Estimates of `layer_count` layers from number `first_layer` on, [layer][luxel], direct and indirect light apart: what is noisy in one may be sharp in
/// the other. Luxels that are not valid are black; dilation fills them. `spacing`: [luxel] of the knots between which indirect light is interpolated (bake/interpolation.h), 0 where it isn't.
lx_result lx_finish_layers(lx_finish *finish, const lx_estimate *direct, const lx_estimate *indirect, const uint8_t *spacing, uint32_t first_layer,
                           uint32_t layer_count, lx_error *error);

#endif
