// The kernel for WebAssembly.
#include "rt_pixels.h"

#if defined(__wasm_simd128__)
#include <wasm_simd128.h>

#define SIMD

enum { width = 16, granule = width / 4, excess = 4 };
typedef v128_t vbytes;

#define v_splat(a) wasm_i8x16_splat(a)
#define v_lookup(table, index) wasm_i8x16_swizzle(table, index)
#define v_lookup_first(table, index) wasm_i8x16_swizzle(table, index)
#define v_shift4(a) wasm_u16x8_shr(a, 4)
#define v_and(a, b) wasm_v128_and(a, b)
#define v_add8(a, b) wasm_i8x16_add(a, b)
#define v_add16(a, b) wasm_i16x8_add(a, b)
#define v_sub16(a, b) wasm_i16x8_sub(a, b)
#define v_add32(a, b) wasm_i32x4_add(a, b)
#define v_dot16(a) wasm_i32x4_extadd_pairwise_i16x8(a)
#define v_sum8(a) wasm_u32x4_extadd_pairwise_u16x8(wasm_u16x8_extadd_pairwise_u8x16(a))
#define v_low32(a, b) wasm_i32x4_shuffle(a, b, 0, 4, 1, 5)
#define v_high32(a, b) wasm_i32x4_shuffle(a, b, 2, 6, 3, 7)
#define v_low64(a, b) wasm_i64x2_shuffle(a, b, 0, 2)
#define v_table(bytes) wasm_v128_load(bytes)
#define v_load4(p) wasm_i8x16_swizzle(wasm_v128_load(p), wasm_i8x16_make(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, -1, -1, -1, -1))
#define v_load3(p) wasm_i8x16_swizzle(wasm_v128_load(p), wasm_i8x16_make(0, 3, 6, 9, 1, 4, 7, 10, 2, 5, 8, 11, -1, -1, -1, -1))
#define v_store(out, v) wasm_v128_store(out, v)
#define v_prefetch(p) ((void)(p))

static inline vbytes v_dot8(vbytes a, vbytes b)
{
    const vbytes low = wasm_i16x8_splat(0xff);
    return wasm_i16x8_add(wasm_i16x8_mul(wasm_v128_and(a, low), wasm_v128_and(b, low)),
                          wasm_i16x8_mul(wasm_u16x8_shr(a, 8), wasm_u16x8_shr(b, 8)));
}

// Wholes or nothing.
#define v_part4(p, count) ((count) > 0 ? v_load4(p) : v_splat(0))
#define v_part3(p, count) ((count) > 0 ? v_load3(p) : v_splat(0))

#define KERNEL lxrt_sum_pixels_wasm
#include "rt_pixels_loop.h"
#endif
