/// Whether light may be taken from one luxel to the next: what the denoiser asks of the scene.
#ifndef LX_BAKE_STEPS_H
#define LX_BAKE_STEPS_H

#include "post/denoise.h"
#include "trace/tracer.h"

typedef struct lx_step_rays {
    const lx_tracer *tracer;
    const lx_luxel_map *map;
} lx_step_rays;

/// An lx_step_test; `user` is an lx_step_rays. A ray a quarter of a texel above both luxels tells: what stands on a floor, however thin, parts it.
void lx_steps_are_clear(void *user, const lx_luxel_step *steps, size_t count, bool *open);

#endif
