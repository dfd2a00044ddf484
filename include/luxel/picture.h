/// Picture files for pipelines: saving floats, comparing.
#ifndef LUXEL_PICTURE_H
#define LUXEL_PICTURE_H

#include "luxel/base.h"

#ifdef __cplusplus
extern "C" {
#endif

/// Saves 3 * width * height linear values by the ending of `path`: .exr (32-bit float), .hdr, .png (clamped, sRGB). Atomic.
LX_API lx_result lx_picture_save(const char *path, uint32_t width, uint32_t height, const float *rgb, lx_error *error);
/// Saves 3 * width * height sRGB bytes as .png. Atomic.
LX_API lx_result lx_picture_save_bytes(const char *path, uint32_t width, uint32_t height, const uint8_t *rgb, lx_error *error);

/// How far B is from A, over the pixels that are valid in both: alpha > 0 where there is alpha, else all.
typedef struct lx_comparison {
    uint32_t width, height;
    uint64_t valid_count;
    double mean_a, mean_b;   ///< Over all channels.
    double rmse;
    double relative_rmse;    ///< rmse / mean_a.
    double rel_mse;          ///< mean of (b - a)² / (a² + 0.01 mean_a²).
    double worst;            ///< Largest |b - a| of any channel,
    uint32_t worst_x, worst_y; ///< and where.
} lx_comparison;

/// Compares two images of one size (.exr .hdr .png .jpg .webp; 8-bit ones are read as sRGB → linear). `erode`: leave out pixels nearer than
/// that many to an invalid one. `difference_path` (may be NULL): writes |b - a| as a picture.
LX_API lx_result lx_picture_compare(const char *path_a, const char *path_b, uint32_t erode, const char *difference_path,
                                    lx_comparison *out, lx_error *error);

#ifdef __cplusplus
}
#endif
#endif
