// Sums of layers over a region, block by block: what lxrt_compose and accumulators share.
#ifndef LXRT_RT_SUM_H
#define LXRT_RT_SUM_H

#include "rt_kernel.h"
#include "rt_pack.h"

// One factor per layer, `stride` floats apart. Black ones are not looked at.
typedef struct lxrt_factors {
    const float *first;
    size_t stride;
} lxrt_factors;

// Sums that are kept from frame to frame.
typedef struct lxrt_kept {
    float *sums;          // of the level's blocks, row by row, lxrt_sums_floats each
    lxrt_factors changes; // to be added to the sums
    int afresh;           // 1: the sums are not used but made anew
} lxrt_kept;

// LXRT_OK if region and target make sense together.
lxrt_result lxrt_check_region(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target);
// Writes Σ factor × texel of a region that has been checked. With `kept`, blocks without changes are neither read nor written.
void lxrt_sum_region(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target, lxrt_factors factors,
                     const lxrt_kept *kept);

#endif
