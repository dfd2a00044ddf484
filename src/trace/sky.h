/// The sky: one colour or an equirectangular picture, sampled by brightness.
#ifndef LX_TRACE_SKY_H
#define LX_TRACE_SKY_H

#include "image/image.h"
#include "luxel/bake.h"
#include "math/vec.h"

typedef struct lx_sky {
    bool present;
    lx_image image; ///< F32 RGB; width 0: one colour, radiance 1.
    float rotation; ///< Radians about +Y, counter-clockwise seen from above.
    // A grid of cells of equal angles, for sampling; the density within a cell is uniform in solid angle.
    uint32_t columns, rows;
    float *row_cdf;  ///< [rows + 1]
    float *cell_cdf; ///< [rows][columns + 1]
} lx_sky;

lx_result lx_sky_load(const lx_sky_desc *desc, lx_sky *out, lx_error *error);
void lx_sky_release(lx_sky *sky);

lx_rgb lx_sky_radiance(const lx_sky *sky, lx_vec3 direction);
/// True if sampling by brightness is worth a ray of its own; one colour is best met by cosine-weighted rays.
bool lx_sky_has_samples(const lx_sky *sky);
/// True if it is there and of one colour.
bool lx_sky_is_uniform(const lx_sky *sky);
/// pdf_solid_angle is written.
lx_vec3 lx_sky_sample(const lx_sky *sky, lx_vec2 u, float *pdf_solid_angle);
float lx_sky_pdf(const lx_sky *sky, lx_vec3 direction);

#endif
