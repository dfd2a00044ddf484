/// From radiance to pixels: exposure and tone mapping.
#ifndef LX_RENDER_DEVELOP_H
#define LX_RENDER_DEVELOP_H

#include "luxel/render.h"
#include "math/vec.h"

/// Khronos PBR Neutral Tone Mapper (KhronosGroup/ToneMapping, 2024): keeps base colours as they are up to 0.8 - F90, compresses highlights.
lx_rgb lx_tonemap_pbr_neutral(lx_rgb color);

/// The exposure that puts the log-average luminance of the pixels that are not black at 0.18; 0 for a black picture.
float lx_auto_exposure(const float *rgb, size_t pixel_count);

#endif
