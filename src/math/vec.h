/// Vectors and colours: small structs by value.
#ifndef LX_MATH_VEC_H
#define LX_MATH_VEC_H

#include <math.h>
#include <stdbool.h>

#define LX_PI 3.14159265358979323846f

/// Of functions in loops that must become vectors: a call would keep them from it, and instruction sets are chosen by who includes them.
#if defined(__GNUC__)
#define LX_INLINED static inline __attribute__((always_inline))
#else
#define LX_INLINED static inline
#endif

// fminf and fmaxf are calls: they must treat NaN with care that only a library function gives. These are one instruction.
static inline float lx_min(float a, float b) { return a < b ? a : b; }
static inline float lx_max(float a, float b) { return a > b ? a : b; }

typedef struct lx_vec2 { float x, y; } lx_vec2;
typedef struct lx_vec3 { float x, y, z; } lx_vec3;
typedef struct lx_vec4 { float x, y, z, w; } lx_vec4;

/// Linear Rec. 709, scene-referred. A type of its own, so that a colour is never taken for a direction.
typedef struct lx_rgb { float r, g, b; } lx_rgb;

static inline lx_vec2 lx_v2(float x, float y) { return (lx_vec2){x, y}; }
static inline lx_vec2 lx_sub2(lx_vec2 a, lx_vec2 b) { return (lx_vec2){a.x - b.x, a.y - b.y}; }
static inline float lx_dot2(lx_vec2 a, lx_vec2 b) { return a.x * b.x + a.y * b.y; }

static inline lx_vec3 lx_v3(float x, float y, float z) { return (lx_vec3){x, y, z}; }
static inline lx_vec3 lx_add(lx_vec3 a, lx_vec3 b) { return (lx_vec3){a.x + b.x, a.y + b.y, a.z + b.z}; }
static inline lx_vec3 lx_sub(lx_vec3 a, lx_vec3 b) { return (lx_vec3){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline lx_vec3 lx_scale(lx_vec3 a, float s) { return (lx_vec3){a.x * s, a.y * s, a.z * s}; }
/// a + b·s
static inline lx_vec3 lx_mad(lx_vec3 a, lx_vec3 b, float s) { return (lx_vec3){a.x + b.x * s, a.y + b.y * s, a.z + b.z * s}; }
static inline lx_vec3 lx_neg(lx_vec3 a) { return (lx_vec3){-a.x, -a.y, -a.z}; }
static inline float lx_dot(lx_vec3 a, lx_vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
static inline lx_vec3 lx_cross(lx_vec3 a, lx_vec3 b)
{
    return (lx_vec3){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
static inline float lx_length(lx_vec3 a) { return sqrtf(lx_dot(a, a)); }
static inline float lx_distance(lx_vec3 a, lx_vec3 b) { return lx_length(lx_sub(a, b)); }
static inline lx_vec3 lx_min3(lx_vec3 a, lx_vec3 b) { return (lx_vec3){lx_min(a.x, b.x), lx_min(a.y, b.y), lx_min(a.z, b.z)}; }
static inline lx_vec3 lx_max3(lx_vec3 a, lx_vec3 b) { return (lx_vec3){lx_max(a.x, b.x), lx_max(a.y, b.y), lx_max(a.z, b.z)}; }
static inline float lx_max_abs(lx_vec3 a) { return lx_max(fabsf(a.x), lx_max(fabsf(a.y), fabsf(a.z))); }

/// Unit vector of `a`, or `fallback` when `a` has no usable length. Scaled first: 1e-30 and 1e30 both work.
static inline lx_vec3 lx_normalize_or(lx_vec3 a, lx_vec3 fallback)
{
    const float m = lx_max_abs(a);
    if (!(m > 0) || !(m < INFINITY)) return fallback;
    a = (lx_vec3){a.x / m, a.y / m, a.z / m};
    return lx_scale(a, 1.0f / lx_length(a));
}
static inline lx_vec3 lx_normalize(lx_vec3 a) { return lx_normalize_or(a, (lx_vec3){0, 0, 1}); }

/// Two unit tangents that make (t, b, n) a right-handed frame. Duff et al. 2017, "Building an Orthonormal Basis, Revisited".
static inline void lx_tangent_frame(lx_vec3 n, lx_vec3 *t, lx_vec3 *b)
{
    const float sign = copysignf(1.0f, n.z);
    const float a = -1.0f / (sign + n.z);
    const float c = n.x * n.y * a;
    *t = (lx_vec3){1.0f + sign * n.x * n.x * a, sign * c, -sign * n.x};
    *b = (lx_vec3){c, sign + n.y * n.y * a, -n.y};
}

static inline float lx_clamp(float x, float low, float high) { return x < low ? low : x > high ? high : x; }

static inline lx_rgb lx_rgb_of(float r, float g, float b) { return (lx_rgb){r, g, b}; }
static inline lx_rgb lx_rgb_grey(float v) { return (lx_rgb){v, v, v}; }
static inline float lx_rgb_mean(lx_rgb c) { return (c.r + c.g + c.b) / 3; }
static inline lx_rgb lx_rgb_add(lx_rgb a, lx_rgb b) { return (lx_rgb){a.r + b.r, a.g + b.g, a.b + b.b}; }
static inline lx_rgb lx_rgb_mul(lx_rgb a, lx_rgb b) { return (lx_rgb){a.r * b.r, a.g * b.g, a.b * b.b}; }
static inline lx_rgb lx_rgb_scale(lx_rgb a, float s) { return (lx_rgb){a.r * s, a.g * s, a.b * s}; }
static inline float lx_rgb_max(lx_rgb a) { return lx_max(a.r, lx_max(a.g, a.b)); }
static inline bool lx_rgb_is_black(lx_rgb a) { return a.r == 0 && a.g == 0 && a.b == 0; }
/// Rec. 709 luminance.
static inline float lx_luminance(lx_rgb a) { return 0.2126f * a.r + 0.7152f * a.g + 0.0722f * a.b; }

typedef struct lx_bounds { lx_vec3 low, high; } lx_bounds;
static inline lx_bounds lx_bounds_empty(void)
{
    return (lx_bounds){{INFINITY, INFINITY, INFINITY}, {-INFINITY, -INFINITY, -INFINITY}};
}
static inline void lx_bounds_add(lx_bounds *b, lx_vec3 p)
{
    b->low = lx_min3(b->low, p);
    b->high = lx_max3(b->high, p);
}

#endif
