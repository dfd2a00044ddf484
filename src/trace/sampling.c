#include "trace/sampling.h"

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
