#include "trace/sampling.h"

static double clamp_double(double x, double low, double high)
{
    return x < low ? low : x > high ? high : x;
}

// [Urena2013] listing 1, with the viewer at the origin.
lx_spherical_rectangle lx_spherical_rectangle_of(lx_vec3 corner, float width, float height)
{
    lx_spherical_rectangle r = {.x0 = corner.x, .y0 = corner.y, .z0 = corner.z};
    if (r.z0 > 0) r.z0 = -r.z0; // the rectangle may be seen from either side; the map only needs |z|
    r.x1 = r.x0 + width;
    r.y1 = r.y0 + height;
    // z components of the unit normals of the four faces of the pyramid; the other components are not needed.
    const double z0_squared = r.z0 * r.z0;
    const double n0 = -r.y0 / sqrt(z0_squared + r.y0 * r.y0), n1 = r.x1 / sqrt(z0_squared + r.x1 * r.x1);
    const double n2 = r.y1 / sqrt(z0_squared + r.y1 * r.y1), n3 = -r.x0 / sqrt(z0_squared + r.x0 * r.x0);
    const double g0 = acos(clamp_double(-n0 * n1, -1, 1)), g1 = acos(clamp_double(-n1 * n2, -1, 1));
    const double g2 = acos(clamp_double(-n2 * n3, -1, 1)), g3 = acos(clamp_double(-n3 * n0, -1, 1));
    r.b0 = n0;
    r.b1 = n2;
    r.k = 2 * 3.14159265358979323846 - g2 - g3;
    r.solid_angle = g0 + g1 - r.k;
    return r;
}

lx_vec3 lx_sample_spherical_rectangle(const lx_spherical_rectangle *r, lx_vec2 u)
{
    // Along x: invert the area of the part of the rectangle with smaller x.
    const double angle = (double)u.x * r->solid_angle + r->k;
    const double f = (cos(angle) * r->b0 - r->b1) / sin(angle);
    const double cosine = copysign(1.0, f) / sqrt(f * f + r->b0 * r->b0);
    const double cu = clamp_double(cosine, -1, 1);
    double x = -(cu * r->z0) / sqrt(fmax(1 - cu * cu, 1e-30));
    x = clamp_double(x, r->x0, r->x1);
    // Along y: uniform in the sine of the elevation.
    const double d = sqrt(x * x + r->z0 * r->z0);
    const double h0 = r->y0 / sqrt(d * d + r->y0 * r->y0), h1 = r->y1 / sqrt(d * d + r->y1 * r->y1);
    const double h = h0 + (double)u.y * (h1 - h0);
    const double y = h * h < 1 - 1e-12 ? h * d / sqrt(1 - h * h) : r->y1;
    return (lx_vec3){(float)x, (float)clamp_double(y, r->y0, r->y1), (float)r->z0};
}
