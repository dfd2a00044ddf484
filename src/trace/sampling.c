#include "trace/sampling.h"

#include <string.h>

// NaN becomes `low`.
static double clamp_double(double x, double low, double high)
{
    x = x > low ? x : low;
    return x < high ? x : high;
}

// A unit complex number: an angle by its cosine and sine. Angles add as numbers multiply, without an arc cosine for each.
typedef struct turn {
    double c, s;
} turn;

static turn add_turns(turn a, turn b)
{
    return (turn){a.c * b.c - a.s * b.s, a.s * b.c + a.c * b.s};
}

// The z component of the unit normal of one face of the pyramid, and 1 - its square without cancellation.
typedef struct face {
    double n, rest;
} face;

static face face_of(double edge, double z2)
{
    const double length2 = z2 + edge * edge;
    return (face){edge / sqrt(length2), z2 / length2};
}

// The angle between two faces: acos(-a b).
static turn angle_between(face a, face b)
{
    return (turn){-(a.n * b.n), sqrt(a.rest + a.n * a.n * b.rest)};
}

// [Urena2013] listing 1, with the viewer at the origin.
lx_spherical_rectangle lx_spherical_rectangle_of(lx_vec3 corner, float width, float height)
{
    lx_spherical_rectangle r = {.x0 = corner.x, .y0 = corner.y, .x1 = (double)corner.x + width, .y1 = (double)corner.y + height,
                                .z = fabs(corner.z)}; // it may be seen from either side; the map only needs |z|
    const double z2 = r.z * r.z;
    const face n0 = face_of(-r.y0, z2), n1 = face_of(r.x1, z2), n2 = face_of(r.y1, z2), n3 = face_of(-r.x0, z2);
    const turn g01 = add_turns(angle_between(n0, n1), angle_between(n1, n2)), g23 = add_turns(angle_between(n2, n3), angle_between(n3, n0));
    r.b0 = n0.n;
    r.b0_rest = n0.rest;
    r.b1 = n2.n;
    r.cos_k = g23.c; // k = 2 pi - g2 - g3
    r.sin_k = -g23.s;
    // The sum of all angles less 2 pi, between 0 and 2 pi. What rounding puts below 0 is 0.
    const turn all = add_turns(g01, g23);
    const float angle = atan2f((float)all.s, (float)all.c);
    r.solid_angle = angle >= 0 ? angle : angle > -1e-6f ? 0 : angle + 2 * LX_PI;
    return r;
}

lx_vec3 lx_sample_spherical_rectangle(const lx_spherical_rectangle *r, lx_vec2 u)
{
    // Along x: invert the area of the part of the rectangle with smaller x.
    const float part = u.x * r->solid_angle;
    const turn angle = add_turns((turn){(double)cosf(part), (double)sinf(part)}, (turn){r->cos_k, r->sin_k});
    const double f = (angle.c * r->b0 - r->b1) / angle.s;
    const double x = clamp_double(copysign(r->z, f) / sqrt(fmax(f * f - r->b0_rest, 1e-30)), r->x0, r->x1);
    // Along y: uniform in the sine of the elevation.
    const double d2 = x * x + r->z * r->z;
    const double h0 = r->y0 / sqrt(d2 + r->y0 * r->y0), h1 = r->y1 / sqrt(d2 + r->y1 * r->y1);
    const double h = h0 + (double)u.y * (h1 - h0), rest = 1 - h * h;
    const double y = rest > 1e-12 ? h * sqrt(d2 / rest) : r->y1;
    return (lx_vec3){(float)x, (float)clamp_double(y, r->y0, r->y1), (float)-r->z};
}

// ---- spherical triangles: [Arvo1995], as [PBR4] 6.5.4 writes it ------------------------------------------------------------------

static double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static bool normalize3(double v[3])
{
    const double length = sqrt(dot3(v, v)), inverse = 1 / length;
    for (int k = 0; k < 3; ++k) v[k] *= inverse;
    return length > 0 && length < INFINITY;
}

static void cross3(const double a[3], const double b[3], double out[3])
{
    out[0] = a[1] * b[2] - a[2] * b[1];
    out[1] = a[2] * b[0] - a[0] * b[2];
    out[2] = a[0] * b[1] - a[1] * b[0];
}

lx_spherical_triangle lx_spherical_triangle_of(const lx_vec3 corner[3])
{
    lx_spherical_triangle t = {.a = {(double)corner[0].x, (double)corner[0].y, (double)corner[0].z}, .b = {(double)corner[1].x, (double)corner[1].y, (double)corner[1].z},
                               .c = {(double)corner[2].x, (double)corner[2].y, (double)corner[2].z}};
    double ab[3], ac[3];
    if (!normalize3(t.a) || !normalize3(t.b) || !normalize3(t.c)) return t;
    cross3(t.a, t.b, ab);
    cross3(t.a, t.c, ac);
    // The angle at a, between the planes through it, and the area by [VanOosterom1983].
    const double lengths = sqrt(dot3(ab, ab) * dot3(ac, ac)), volume = fabs(dot3(ab, t.c));
    if (!(lengths > 0) || !(volume > 0)) return t;
    t.cos_alpha = dot3(ab, ac) / lengths;
    t.sin_alpha = volume / lengths;
    t.solid_angle = (float)(2 * atan2(volume, 1 + dot3(t.a, t.b) + dot3(t.b, t.c) + dot3(t.c, t.a)));
    return t;
}

// The unit direction at the angle of cosine `cosine` from unit `from`, towards `to`.
static void turn_towards(const double from[3], const double to[3], double cosine, double out[3])
{
    const double along = dot3(from, to), sine = sqrt(fmax(0, 1 - cosine * cosine));
    double across[3];
    for (int k = 0; k < 3; ++k) across[k] = to[k] - along * from[k];
    if (!normalize3(across)) {
        memcpy(out, from, sizeof across);
        return;
    }
    for (int k = 0; k < 3; ++k) out[k] = cosine * from[k] + sine * across[k];
}

lx_vec3 lx_sample_spherical_triangle(const lx_spherical_triangle *t, lx_vec2 u)
{
    // The smaller triangle a, b, c' with a share u.x of the area: its third corner lies on the arc from a to c. Its angles sum up to pi and that area.
    const float part = u.x * t->solid_angle;
    const double sine = -(double)sinf(part), cosine = -(double)cosf(part);
    const double sin_phi = sine * t->cos_alpha - cosine * t->sin_alpha, cos_phi = cosine * t->cos_alpha + sine * t->sin_alpha;
    const double k1 = cos_phi + t->cos_alpha, k2 = sin_phi - t->sin_alpha * dot3(t->a, t->b);
    const double below = (k2 * sin_phi + k1 * cos_phi) * t->sin_alpha, above = k2 + (k2 * cos_phi - k1 * sin_phi) * t->cos_alpha;
    double on_arc[3], out[3];
    turn_towards(t->a, t->c, clamp_double(above / below, -1, 1), on_arc);
    // Along the arc from b to c', uniform in its cosine.
    turn_towards(t->b, on_arc, clamp_double(1 - (double)u.y * (1 - dot3(on_arc, t->b)), -1, 1), out);
    return (lx_vec3){(float)out[0], (float)out[1], (float)out[2]};
}
