// The kernel for x86-64 with AVX2 and F16C.
#include "rt_kernel.h"

#if LXRT_X86
#include "rt_simd_avx2.h"

#define KERNEL lxrt_kernel_avx2
#include "rt_kernel_loop.h"
#endif
