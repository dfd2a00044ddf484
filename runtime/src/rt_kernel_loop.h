// The kernel, written once in the words of an rt_simd_*.h; a file that includes one of those and then this defines KERNEL.
//
// A texel's sum stays in registers over all layers of the job, so that each block is read once and nothing else moves through memory.
// Two vectors at a time keep enough operations in flight. What a lane computes does not depend on its neighbours or on the number of
// lanes: +, − and × as written (never fused), comparisons and integers; hence all kernels give the same bits.
#include <string.h>

enum { chunk = 2 * lanes }; // texels; divides 32

typedef struct sums {
    vfloat r[2], g[2], b[2];
} sums;

// Adds texel × factor. Each mantissa m is put where it lies among the fraction bits of a float whose exponent field holds e + 96 (that
// is `|`, since 96 has no bit below 32): 2^(e - 31) + m 2^(e - 54 + place). Subtracting 2^(e - 31) leaves the texel's channel times a
// power of two, exactly, and lxrt_group_add has put the inverse of that power into the factor. One shift is all: blue and e do not
// lie where a float's fraction and exponent are, but four bits above.
SIMD static inline void add_texels(vint words, const float factor[3], vfloat *r, vfloat *g, vfloat *b)
{
    const vint shifted = i_shr(words, 4);
    const vint power = i_pick(shifted, i_set1(31 << 23), i_set1(96 << 23));
    const vfloat red = f_sub(float_of(i_pick(words, i_set1(511), power)), float_of(power));
    const vfloat green = f_sub(float_of(i_pick(words, i_set1(511 << 9), power)), float_of(power));
    const vfloat blue = f_sub(float_of(i_pick(shifted, i_set1(511 << 14), power)), float_of(power));
    *r = f_add(*r, f_mul(red, f_set1(factor[0])));
    *g = f_add(*g, f_mul(green, f_set1(factor[1])));
    *b = f_add(*b, f_mul(blue, f_set1(factor[2])));
}

// RGB9E5 as EXT_texture_shared_exponent says it, rounding halves up. The exponent is that of the largest channel after rounding to nine
// bits: a carry out of the fraction moves into the float's exponent field. floor(x / unit + 1/2) = (floor(2x / unit) + 1) >> 1, where
// the quotient is exact (a power of two) and the sum an integer: no rounding happens but the one that is asked for.
SIMD static inline vint encode_rgb9e5(vfloat r, vfloat g, vfloat b)
{
    const vfloat zero = f_set1(0), greatest = f_set1(65408), least = f_set1(0x1p-16f);
    r = f_min(f_max(r, zero), greatest);
    g = f_min(f_max(g, zero), greatest);
    b = f_min(f_max(b, zero), greatest);
    const vint largest = bits_of(f_max(f_max(f_max(r, g), b), least));
    const vint exponent = i_shr(i_add(largest, i_set1(1 << 14)), 23); // 111 … 142
    const vfloat inverse = float_of(i_shl(i_sub(i_set1(127 + 25 + 111), exponent), 23)); // 2 / unit
    const vint one = i_set1(1), even = i_set1(~1);
    const vint r2 = i_add(i_trunc(f_mul(r, inverse)), one);
    const vint g2 = i_add(i_trunc(f_mul(g, inverse)), one);
    const vint b2 = i_add(i_trunc(f_mul(b, inverse)), one);
    const vint rg = i_or(i_shr(r2, 1), i_shl(i_and(g2, even), 8));
    return i_or(i_or(rg, i_shl(i_and(b2, even), 17)), i_shl(i_sub(exponent, i_set1(111)), 27));
}

// A finite number as a half, in the low 16 bits; nearest even, clamped.
SIMD static inline vint encode_half(vfloat value)
{
    value = f_min(f_max(value, f_set1(-65504)), f_set1(65504));
#ifdef i_half
    return i_half(value);
#else
    const vint bits = bits_of(value), magnitude = i_and(bits, i_set1(0x7fffffff));
    const vint odd = i_and(i_shr(magnitude, 13), i_set1(1));
    const vint normal = i_shr(i_add(i_add(magnitude, i_set1(0xfff - (112 << 23))), odd), 13);
    // Denormal halves are multiples of 2^-24, the last place of 1/2.
    const vint denormal = i_sub(bits_of(f_add(float_of(magnitude), f_set1(0.5f))), i_set1(0x3f000000));
    const vint half = i_select(i_less(magnitude, i_set1(0x38800000)), denormal, normal);
    return i_or(half, i_and(i_shr(bits, 16), i_set1(0x8000)));
#endif
}

SIMD static inline void encode(const sums *s, lxrt_format format, float scale, unsigned char *out)
{
    const vfloat factor = f_set1(scale);
    for (int i = 0; i < 2; ++i) {
        const vfloat r = f_mul(s->r[i], factor), g = f_mul(s->g[i], factor), b = f_mul(s->b[i], factor);
        if (format == LXRT_FORMAT_RGB32F)
            f_store_triples(out + 12 * lanes * i, r, g, b);
        else if (format == LXRT_FORMAT_RGBA16F)
            i_store_pairs(out + 8 * lanes * i, i_or(encode_half(r), i_shl(encode_half(g), 16)), i_or(encode_half(b), i_set1(0x3c00 << 16)));
        else
            i_store(out + 4 * lanes * i, encode_rgb9e5(r, g, b));
    }
}

SIMD static inline void run(const lxrt_job *job, const lxrt_format format, const size_t texel_bytes)
{
    const lxrt_group *group = job->group, *next = job->next;
    for (uint32_t y = job->y0; y < job->y1; ++y) {
        unsigned char *const row = job->texels ? job->texels + (y - job->y0) * job->row_bytes : NULL;
        for (uint32_t x = job->x0 & ~(uint32_t)(chunk - 1); x < job->x1; x += chunk) {
            const size_t at = 4 * (size_t)(32 * y + x), sums_at = (size_t)lxrt_row_floats * y + x;
            sums s;
            for (int i = 0; i < 2; ++i) {
                const float *from = job->from ? job->from + sums_at + lanes * i : NULL;
                s.r[i] = from ? f_load(from) : f_set1(0);
                s.g[i] = from ? f_load(from + lxrt_plane_floats) : f_set1(0);
                s.b[i] = from ? f_load(from + 2 * lxrt_plane_floats) : f_set1(0);
            }
            for (uint32_t k = 0; k < group->count; ++k) {
                const unsigned char *words = group->blocks[k] + at;
                add_texels(i_load(words), group->factors[k], &s.r[0], &s.g[0], &s.b[0]);
                add_texels(i_load(words + 4 * lanes), group->factors[k], &s.r[1], &s.g[1], &s.b[1]);
            }
            if (at % 64 == 0)
                for (uint32_t k = 0; k < next->count; ++k)
                    for (size_t line = 0; line < 4 * chunk; line += 64) prefetch(next->blocks[k] + at + line);
            if (job->to) {
                for (int i = 0; i < 2; ++i) {
                    float *to = job->to + sums_at + lanes * i;
                    f_store(to, s.r[i]);
                    f_store(to + lxrt_plane_floats, s.g[i]);
                    f_store(to + 2 * lxrt_plane_floats, s.b[i]);
                }
            }
            if (row && x >= job->x0 && x + chunk <= job->x1) {
                encode(&s, format, job->scale, row + (x - job->x0) * texel_bytes);
            } else if (row) { // a chunk that reaches over the edge
                unsigned char texels[12 * chunk];
                const uint32_t first = x < job->x0 ? job->x0 : x, end = x + chunk < job->x1 ? x + chunk : job->x1;
                encode(&s, format, job->scale, texels);
                memcpy(row + (first - job->x0) * texel_bytes, texels + (first - x) * texel_bytes, (end - first) * texel_bytes);
            }
        }
    }
}

SIMD void KERNEL(const lxrt_job *job)
{
    switch (job->format) { // a loop of its own for each
    case LXRT_FORMAT_RGB32F: run(job, LXRT_FORMAT_RGB32F, 12); break;
    case LXRT_FORMAT_RGBA16F: run(job, LXRT_FORMAT_RGBA16F, 8); break;
    case LXRT_FORMAT_RGB9E5: run(job, LXRT_FORMAT_RGB9E5, 4); break;
    }
}
