// Which kernel runs: the widest that processor and operating system have.
#include "rt_kernel.h"
#include "rt_pack.h"

#if LXRT_X86
#include <cpuid.h>

static int has_f16c(void)
{
    unsigned a, b, c, d;
    return __get_cpuid(1, &a, &b, &c, &d) && (c & bit_F16C);
}
#endif

lxrt_kernel lxrt_get_kernel(uint32_t index, const char **out_name)
{
    struct {
        lxrt_kernel kernel;
        const char *name;
    } kernels[4] = {{lxrt_kernel_scalar, "scalar"}};
    uint32_t count = 1;
#define ADD(which) (kernels[count].kernel = lxrt_kernel_##which, kernels[count++].name = #which)
#if LXRT_X86
    __builtin_cpu_init();
    ADD(sse2);
    if (__builtin_cpu_supports("avx2") && has_f16c()) ADD(avx2);
    if (__builtin_cpu_supports("avx512f")) ADD(avx512);
#endif
#if LXRT_WASM
    ADD(wasm);
#endif
#undef ADD
    if (index >= count) return NULL;
    if (out_name) *out_name = kernels[index].name;
    return kernels[index].kernel;
}

lxrt_kernel lxrt_best_kernel(void)
{
    lxrt_kernel best = lxrt_kernel_scalar, kernel;
    for (uint32_t i = 1; (kernel = lxrt_get_kernel(i, NULL)) != NULL; ++i) best = kernel;
    return best;
}

void lxrt_use_kernel(lxrt_pack *pack, lxrt_kernel kernel)
{
    pack->kernel = kernel;
}
