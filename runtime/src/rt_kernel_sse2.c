// The kernel for any x86-64.
#include "rt_kernel.h"

#if LXRT_X86
#include "rt_simd_sse2.h"

#define KERNEL lxrt_kernel_sse2
#include "rt_kernel_loop.h"
#endif
