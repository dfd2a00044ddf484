// The kernel for WebAssembly.
#include "rt_kernel.h"

#if LXRT_WASM
#include "rt_simd_wasm.h"

#define KERNEL lxrt_kernel_wasm
#include "rt_kernel_loop.h"
#endif
