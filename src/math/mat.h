/// 4×4 matrices, column-major like glTF.
#ifndef LX_MATH_MAT_H
#define LX_MATH_MAT_H

#include "math/vec.h"

/// m[column * 4 + row].
typedef struct lx_mat4 { float m[16]; } lx_mat4;

static inline lx_mat4 lx_mat4_identity(void)
{
    return (lx_mat4){{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1}};
}

/// Translation · rotation (unit quaternion x y z w) · scale.
static inline lx_mat4 lx_mat4_trs(lx_vec3 t, lx_vec4 q, lx_vec3 s)
{
    const float x = q.x, y = q.y, z = q.z, w = q.w;
    return (lx_mat4){{(1 - 2 * (y * y + z * z)) * s.x, 2 * (x * y + z * w) * s.x, 2 * (x * z - y * w) * s.x, 0,
                      2 * (x * y - z * w) * s.y, (1 - 2 * (x * x + z * z)) * s.y, 2 * (y * z + x * w) * s.y, 0,
                      2 * (x * z + y * w) * s.z, 2 * (y * z - x * w) * s.z, (1 - 2 * (x * x + y * y)) * s.z, 0,
                      t.x, t.y, t.z, 1}};
}

static inline lx_vec3 lx_mat4_point(lx_mat4 a, lx_vec3 p)
{
    return (lx_vec3){a.m[0] * p.x + a.m[4] * p.y + a.m[8] * p.z + a.m[12],
                     a.m[1] * p.x + a.m[5] * p.y + a.m[9] * p.z + a.m[13],
                     a.m[2] * p.x + a.m[6] * p.y + a.m[10] * p.z + a.m[14]};
}

static inline lx_vec3 lx_mat4_direction(lx_mat4 a, lx_vec3 d)
{
    return (lx_vec3){a.m[0] * d.x + a.m[4] * d.y + a.m[8] * d.z, a.m[1] * d.x + a.m[5] * d.y + a.m[9] * d.z,
                     a.m[2] * d.x + a.m[6] * d.y + a.m[10] * d.z};
}

/// Cofactors of the upper 3×3: transforms normals (up to length) and, unlike the inverse transpose, exists for singular
/// matrices. For a negative determinant the result points to the other side; callers multiply by the determinant's sign.
static inline lx_vec3 lx_mat4_normal(lx_mat4 a, lx_vec3 n)
{
    const lx_vec3 x = {a.m[0], a.m[1], a.m[2]}, y = {a.m[4], a.m[5], a.m[6]}, z = {a.m[8], a.m[9], a.m[10]};
    const lx_vec3 cx = lx_cross(y, z), cy = lx_cross(z, x), cz = lx_cross(x, y);
    return lx_add(lx_add(lx_scale(cx, n.x), lx_scale(cy, n.y)), lx_scale(cz, n.z));
}

static inline float lx_mat4_determinant3(lx_mat4 a)
{
    const lx_vec3 x = {a.m[0], a.m[1], a.m[2]}, y = {a.m[4], a.m[5], a.m[6]}, z = {a.m[8], a.m[9], a.m[10]};
    return lx_dot(lx_cross(x, y), z);
}

#endif
