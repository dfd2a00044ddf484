/// Pictures on the CPU: a baked scene with its lightmaps, or the path-traced reference of any scene.
#ifndef LUXEL_RENDER_H
#define LUXEL_RENDER_H

#include "luxel/baked.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum lx_tonemap { LX_TONEMAP_PBR_NEUTRAL, LX_TONEMAP_NONE } lx_tonemap;
typedef enum lx_view { LX_VIEW_LIT, LX_VIEW_LIGHTMAP, LX_VIEW_ALBEDO } lx_view;

typedef struct lx_render_desc {
    uint32_t width, height;   ///< Default 1280 × 720.
    const char *camera;       ///< Name or index of a camera in the file; NULL (default): the first, else one that frames the scene.
    bool look;                ///< Instead of a camera of the file: look from `eye` to `target`. Default false.
    float eye[3], target[3];  ///< World, metres. +Y is up in the picture.
    float yfov_deg;           ///< Vertical field of view of such a look. Default 60.
    uint32_t samples;         ///< Camera rays per pixel; reference: paths per pixel. Default 16.
    bool auto_exposure;       ///< Default true: log-average luminance at 0.18.
    float exposure_ev;        ///< Otherwise: pixel = sRGB(tone(2^EV · L)).
    lx_tonemap tonemap;
    lx_view view;             ///< LIGHTMAP: E / pi without tone mapping.
    lx_transport_desc transport; ///< Of the reference, and of what is not baked (mixed lights, moving objects).
} lx_render_desc;

LX_API lx_render_desc lx_render_desc_default(void);

/// Renders a baked folder (opened with its scene) at its current colours, without baking. With `reference` the same view is path-traced
/// instead, at the current colours too. Writes 3 * width * height linear radiance values (nit; row 0 is the top) before exposure
/// and tone mapping; `out_ev` (may be NULL) gets the exposure used.
LX_API lx_result lx_render_baked(lx_baked *baked, const lx_render_desc *desc, bool reference, const lx_progress_sink *progress,
                                 float *out_rgb, float *out_ev, lx_error *error);
/// Path-traces a scene at its authored colours.
LX_API lx_result lx_render_scene(const lx_scene *scene, const lx_render_desc *desc, const lx_progress_sink *progress,
                                 float *out_rgb, float *out_ev, lx_error *error);
/// Exposure, tone mapping and sRGB: 3 * width * height bytes from linear radiance.
LX_API void lx_render_develop(const lx_render_desc *desc, float ev, const float *rgb, uint8_t *out_srgb);

#ifdef __cplusplus
}
#endif
#endif
