/// One picture of a traced scene, lit by lightmaps or by paths.
#ifndef LX_RENDER_PICTURE_H
#define LX_RENDER_PICTURE_H

#include "render/view.h"
#include "scene/atlas.h"
#include "trace/path.h"

/// What lights the picture. Everything borrowed.
typedef struct lx_picture {
    const lx_tracer *tracer;      ///< With moving instances.
    const lx_source_use *uses;    ///< Per source: layer 0 and its colour now. What is not in a lightmap is path-traced with it, and emitters
                                  ///< show their colour by it.
    const lx_source_use *mixed_uses; ///< Per source: layer 0 for mixed lights alone, whose direct part is not in the lightmap; NULL: there are none.
    const lx_atlas *atlas;        ///< NULL: everything is path-traced.
    const float *const *pages;    ///< Composed irradiance per page, RGB; with `atlas`.
} lx_picture;

/// Writes 3 * width * height radiance values (nit).
lx_result lx_picture_render(const lx_picture *picture, const lx_view_rays *view, const lx_render_desc *desc, const lx_progress_sink *progress,
                            float *out_rgb, lx_error *error);

#endif
