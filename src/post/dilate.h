/// Padding and mip levels of lightmap pages.
#ifndef LX_POST_DILATE_H
#define LX_POST_DILATE_H

#include "luxel/base.h"

#ifndef LX_NO_CHART
#define LX_NO_CHART UINT32_MAX ///< As in scene/atlas.h.
#endif

/// Where padding texels take their value from. Computed once per page, applied to every layer.
/// `valid`: texels that hold a trustworthy value. Every invalid texel of a chart, and every empty texel within `radius` steps of a chart, gets the index of
/// the nearest valid texel of the same chart (Euclidean, ties by index); `chart` is extended accordingly, in place. Charts never claim each other's
/// texels; between two charts each empty texel goes to the nearer one. source[i] == i for valid texels, UINT32_MAX for texels nobody claims.
/// A chart without any valid texel takes black (source UINT32_MAX).
/// `chart`, `valid`, `out_source`: [size * size].
lx_result lx_dilate_map(uint32_t size, uint32_t radius, uint32_t *chart, const uint8_t *valid, uint32_t *out_source, lx_error *error);

/// rgb[i] = rgb[source[i]], zero where source is UINT32_MAX.
void lx_dilate_apply(uint32_t size, const uint32_t *source, float *rgb);

/// One mip level from the next finer one, of size >> 1. A coarse texel belongs to the chart that covers most of its four fine
/// texels (ties: lowest number) and is the mean of that chart's texels alone, so charts don't bleed into each other.
/// Run it over dilated images. fine_chart: [size²]; coarse_chart: [(size / 2)²], written.
void lx_mip_halve_chart(uint32_t size, const uint32_t *fine_chart, uint32_t *coarse_chart);
void lx_mip_halve(uint32_t size, const uint32_t *fine_chart, const uint32_t *coarse_chart, const float *fine_rgb, float *coarse_rgb);

#endif
