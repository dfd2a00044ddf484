// The kernel in plain C.
#include "rt_kernel.h"

#include "rt_simd_scalar.h"

#define KERNEL lxrt_kernel_scalar
#include "rt_kernel_loop.h"
