// The kernel for x86-64 with AVX-512.
#include "rt_kernel.h"

#if LXRT_X86
#include "rt_simd_avx512.h"

#define KERNEL lxrt_kernel_avx512
#include "rt_kernel_loop.h"
#endif
