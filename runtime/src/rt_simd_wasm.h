// Four lanes of WebAssembly's SIMD128. The words are explained in rt_simd_scalar.h.
#ifndef LXRT_RT_SIMD_WASM_H
#define LXRT_RT_SIMD_WASM_H

#include <wasm_simd128.h>

#define SIMD

enum { lanes = 4 };
typedef v128_t vfloat;
typedef v128_t vint;

#define i_shl(a, n) wasm_i32x4_shl(a, n)
#define i_shr(a, n) wasm_u32x4_shr(a, n)

static inline vfloat f_set1(float a) { return wasm_f32x4_splat(a); }
static inline vfloat f_load(const float *p) { return wasm_v128_load(p); }
static inline void f_store(float *p, vfloat a) { wasm_v128_store(p, a); }
static inline vfloat f_add(vfloat a, vfloat b) { return wasm_f32x4_add(a, b); }
static inline vfloat f_sub(vfloat a, vfloat b) { return wasm_f32x4_sub(a, b); }
static inline vfloat f_mul(vfloat a, vfloat b) { return wasm_f32x4_mul(a, b); }
// As x86 has it, one instruction there; they differ from f32x4.min and max in NaN alone, which never comes here.
static inline vfloat f_min(vfloat a, vfloat b) { return wasm_f32x4_pmin(b, a); }
static inline vfloat f_max(vfloat a, vfloat b) { return wasm_f32x4_pmax(b, a); }

static inline vint i_set1(int32_t a) { return wasm_i32x4_splat(a); }
static inline vint i_load(const unsigned char *p) { return wasm_v128_load(p); }
static inline void i_store(unsigned char *p, vint a) { wasm_v128_store(p, a); }
static inline vint i_add(vint a, vint b) { return wasm_i32x4_add(a, b); }
static inline vint i_sub(vint a, vint b) { return wasm_i32x4_sub(a, b); }
static inline vint i_and(vint a, vint b) { return wasm_v128_and(a, b); }
static inline vint i_or(vint a, vint b) { return wasm_v128_or(a, b); }
static inline vint i_pick(vint a, vint mask, vint b) { return wasm_v128_or(wasm_v128_and(a, mask), b); }
static inline vint i_less(vint a, vint b) { return wasm_i32x4_lt(a, b); }
static inline vint i_select(vint mask, vint a, vint b) { return wasm_v128_bitselect(a, b, mask); }
static inline vint i_trunc(vfloat a) { return wasm_i32x4_trunc_sat_f32x4(a); }
static inline vint bits_of(vfloat a) { return a; }
static inline vfloat float_of(vint a) { return a; }

static inline void f_store_triples(unsigned char *p, vfloat r, vfloat g, vfloat b)
{
    const v128_t rg_low = wasm_i32x4_shuffle(r, g, 0, 4, 1, 5), rg_high = wasm_i32x4_shuffle(r, g, 2, 6, 3, 7);
    i_store(p, wasm_i32x4_shuffle(rg_low, b, 0, 1, 4, 2));                                        // r0 g0 b0 r1
    i_store(p + 16, wasm_i32x4_shuffle(wasm_i32x4_shuffle(g, b, 1, 5, 1, 5), rg_high, 0, 1, 4, 5)); // g1 b1 r2 g2
    i_store(p + 32, wasm_i32x4_shuffle(rg_high, b, 6, 2, 3, 7));                                  // b2 r3 g3 b3
}

static inline void i_store_pairs(unsigned char *p, vint a, vint b)
{
    i_store(p, wasm_i32x4_shuffle(a, b, 0, 4, 1, 5));
    i_store(p + 16, wasm_i32x4_shuffle(a, b, 2, 6, 3, 7));
}

static inline void prefetch(const unsigned char *p)
{
    (void)p;
}

#endif
