// What lxrt_accumulator_bytes counts, where 32 bits may not hold it.
#ifndef LXRT_RT_ACCUMULATOR_H
#define LXRT_RT_ACCUMULATOR_H

#include "rt_pack.h"

uint64_t lxrt_accumulator_bytes64(const lxrt_pack *pack);

#endif
