// What does the arithmetic of composing: one block of 32×32 texels, some layers, one format. There is one kernel per instruction set,
// all made from rt_kernel_loop.h, and all give the same bytes; lxrt_open chooses one for the processor it runs on.
#ifndef LXRT_RT_KERNEL_H
#define LXRT_RT_KERNEL_H

#include "luxel_rt.h"

enum {
    lxrt_plane_floats = 32, // of sums: a row of 32 texels is 32 reds, 32 greens, 32 blues
    lxrt_row_floats = 3 * lxrt_plane_floats,
    lxrt_sums_floats = 32 * lxrt_row_floats,
    lxrt_group_layers = 4,  // of one job; more of them go through the sums. This job and the next, with the sums, fit a first-level cache
};

// Present blocks of one place and what their texels are multiplied by, in the kernel's own units (rt_kernel_loop.h).
typedef struct lxrt_group {
    uint32_t count;
    const unsigned char *blocks[lxrt_group_layers];
    float factors[lxrt_group_layers][3];
} lxrt_group;

// Adds a block to a group that has room for it. Powers of two are exact: |factor| is 2·10^27 at most, and 2^30 times that fits a float.
static inline void lxrt_group_add(lxrt_group *group, const unsigned char *block, const float factor[3])
{
    float *const out = group->factors[group->count];
    group->blocks[group->count++] = block;
    out[0] = factor[0] * 0x1p30f;
    out[1] = factor[1] * 0x1p21f;
    out[2] = factor[2] * 0x1p16f;
}

typedef struct lxrt_job {
    const lxrt_group *group; // added in order
    const lxrt_group *next;  // what comes after; fetched into the cache meanwhile. May be empty
    const float *from;       // sums to start from; NULL: 0
    float *to;               // where sums are kept; NULL: nowhere
    uint32_t x0, y0, x1, y1; // of the block; ends excluded
    unsigned char *texels;   // of (x0, y0), any alignment; NULL: nothing is encoded
    size_t row_bytes;
    lxrt_format format;
    float scale;
} lxrt_job;

typedef void (*lxrt_kernel)(const lxrt_job *job);

#if defined(__x86_64__)
#define LXRT_X86 1
#else
#define LXRT_X86 0
#endif
#if defined(__wasm_simd128__)
#define LXRT_WASM 1
#else
#define LXRT_WASM 0
#endif

void lxrt_kernel_scalar(const lxrt_job *job);
#if LXRT_X86
void lxrt_kernel_sse2(const lxrt_job *job);
void lxrt_kernel_avx2(const lxrt_job *job);
void lxrt_kernel_avx512(const lxrt_job *job);
#endif
#if LXRT_WASM
void lxrt_kernel_wasm(const lxrt_job *job);
#endif

// The fastest kernel of this processor.
lxrt_kernel lxrt_best_kernel(void);
// Kernels that this processor can run, slowest first: 0 is the scalar one. NULL beyond the last. `out_name` may be NULL.
lxrt_kernel lxrt_get_kernel(uint32_t index, const char **out_name);
// Makes a pack use a kernel from now on. For tests and measurements.
void lxrt_use_kernel(lxrt_pack *pack, lxrt_kernel kernel);

#endif
