/// Directions and points by density. Every function states its pdf and measure.
///
/// Based on: [PBR4] Pharr, Jakob, Humphreys, "Physically Based Rendering", 4th ed., appendix A.5;
/// [Urena2013] Ureña, Fajardo, King, "An Area-Preserving Parametrization for Spherical Rectangles", EGSR 2013;
/// [Arvo1995] Arvo, "Stratified Sampling of Spherical Triangles", SIGGRAPH 1995;
/// [VanOosterom1983] van Oosterom, Strackee, "The Solid Angle of a Plane Triangle", IEEE Trans. Biomed. Eng. 30(2).
#ifndef LX_TRACE_SAMPLING_H
#define LX_TRACE_SAMPLING_H

#include "math/vec.h"

#include <stdbool.h>

/// Sine and cosine of 2 pi t, t in [0, 1): Taylor series about the nearest quarter turn, within a few roundings; no branches and no calls, so that loops stay tight.
LX_INLINED void lx_sincos_of_turn(float t, float *sine, float *cosine)
{
    const int quarter = (int)(4 * t + 0.5f);
    const float x = (t - 0.25f * (float)quarter) * (2 * LX_PI), x2 = x * x;
    const float s = x * (1 - x2 * (1.0f / 6 - x2 * (1.0f / 120 - x2 * (1.0f / 5040 - x2 * (1.0f / 362880)))));
    const float c = 1 - x2 * (0.5f - x2 * (1.0f / 24 - x2 * (1.0f / 720 - x2 * (1.0f / 40320))));
    const bool odd = quarter & 1;
    const float a = odd ? c : s, b = odd ? s : c;
    *sine = quarter & 2 ? -a : a;
    *cosine = (quarter + 1) & 2 ? -b : b;
}

/// Uniform on the unit disk (concentric map, [PBR4] A.5.1). pdf_area = 1 / pi.
LX_INLINED lx_vec2 lx_sample_disk(lx_vec2 u)
{
    const float x = 2 * u.x - 1, y = 2 * u.y - 1;
    if (x == 0 && y == 0) return (lx_vec2){0, 0};
    float radius, theta;
    if (fabsf(x) > fabsf(y)) {
        radius = x;
        theta = LX_PI / 4 * (y / x);
    } else {
        radius = y;
        theta = LX_PI / 2 - LX_PI / 4 * (x / y);
    }
    return (lx_vec2){radius * cosf(theta), radius * sinf(theta)};
}

/// Cosine-weighted direction around +Z (Malley's method, [PBR4] A.5.3). pdf_solid_angle = cos(theta) / pi.
static inline lx_vec3 lx_sample_cosine_hemisphere(lx_vec2 u)
{
    const lx_vec2 d = lx_sample_disk(u);
    return (lx_vec3){d.x, d.y, sqrtf(lx_max(0.0f, 1 - d.x * d.x - d.y * d.y))};
}

/// The same as lx_sample_cosine_hemisphere by a disk in polar coordinates: rings and sectors of the unit square are rings and sectors of directions.
LX_INLINED lx_vec3 lx_sample_polar_hemisphere(lx_vec2 u)
{
    float sine, cosine;
    lx_sincos_of_turn(u.y, &sine, &cosine);
    const float radius = sqrtf(u.x);
    return (lx_vec3){radius * cosine, radius * sine, sqrtf(1 - u.x)};
}

/// Uniform direction within a cone around +Z, given 1 - cos(half angle), which keeps its precision for narrow cones.
/// pdf_solid_angle = 1 / (2 pi one_minus_cos).
LX_INLINED lx_vec3 lx_sample_cone(lx_vec2 u, float one_minus_cos)
{
    const float height = u.x * one_minus_cos; // 1 - cos(theta)
    const float sine = sqrtf(lx_max(0.0f, height * (2 - height)));
    float sin_phi, cos_phi;
    lx_sincos_of_turn(u.y, &sin_phi, &cos_phi);
    return (lx_vec3){sine * cos_phi, sine * sin_phi, 1 - height};
}

/// From the frame whose +Z is `n` to the world.
LX_INLINED lx_vec3 lx_to_world(lx_vec3 n, lx_vec3 local)
{
    lx_vec3 t, b;
    lx_tangent_frame(n, &t, &b);
    return lx_add(lx_add(lx_scale(t, local.x), lx_scale(b, local.y)), lx_scale(n, local.z));
}

/// Barycentrics (of the second and third corner), uniform over a triangle's area ([PBR4] A.5.2, square-root form).
LX_INLINED lx_vec2 lx_sample_triangle(lx_vec2 u)
{
    const float root = sqrtf(u.x);
    return (lx_vec2){root * (1 - u.y), root * u.y};
}

/// A rectangle as seen from a point: what [Urena2013] needs to sample it by solid angle. Double precision: for small rectangles the four
/// dihedral angles all but cancel.
typedef struct lx_spherical_rectangle {
    float solid_angle;
    double x0, y0, x1, y1, z;
    double b0, b0_rest, b1;  ///< b0_rest: 1 - b0², to full precision.
    double cos_k, sin_k;
} lx_spherical_rectangle;

/// `corner` is the lower left corner relative to the viewer in a frame whose axes are the edges' unit directions and their cross product.
lx_spherical_rectangle lx_spherical_rectangle_of(lx_vec3 corner, float width, float height);

/// Point on the rectangle, same frame, relative to the viewer, z towards the viewer's negative side. pdf_solid_angle = 1 / solid_angle.
lx_vec3 lx_sample_spherical_rectangle(const lx_spherical_rectangle *r, lx_vec2 u);

/// A triangle as seen from a point: what [Arvo1995] needs to sample it by solid angle.
typedef struct lx_spherical_triangle {
    float solid_angle; ///< 0: too thin or too near to tell.
    double a[3], b[3], c[3]; ///< Unit directions of the corners.
    double cos_alpha, sin_alpha; ///< Of the angle at a.
} lx_spherical_triangle;

/// `corner`: relative to the viewer.
lx_spherical_triangle lx_spherical_triangle_of(const lx_vec3 corner[3]);

/// Unit direction within the triangle; solid_angle > 0. pdf_solid_angle = 1 / solid_angle.
lx_vec3 lx_sample_spherical_triangle(const lx_spherical_triangle *t, lx_vec2 u);

#endif
