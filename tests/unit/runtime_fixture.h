/// What tests of the runtime share.
#ifndef RUNTIME_FIXTURE_H
#define RUNTIME_FIXTURE_H

#include "luxel_rt.h"

// A rectangle as floats, `row_stride` of them from row to row (0: tight).
static inline lxrt_result compose(const lxrt_pack *pack, uint32_t page, uint32_t level, uint32_t x, uint32_t y, uint32_t width,
                                  uint32_t height, float *rgb, size_t row_stride)
{
    const lxrt_region region = {page, level, x, y, width, height};
    const lxrt_target target = {rgb, row_stride * sizeof(float), LXRT_FORMAT_RGB32F, 1};
    return lxrt_compose(pack, &region, &target);
}

#endif
