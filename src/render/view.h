/// Cameras: which one, and its rays.
#ifndef LX_RENDER_VIEW_H
#define LX_RENDER_VIEW_H

#include "luxel/render.h"
#include "trace/tracer.h"

typedef struct lx_view_rays {
    lx_vec3 origin, corner;   ///< Perspective: rays from `origin` through corner + x · right + y · down. Orthographic: origins lie there.
    lx_vec3 right, down;      ///< Across the whole picture.
    lx_vec3 forward;          ///< Unit.
    bool perspective;
} lx_view_rays;

/// The camera a desc asks for: by place, by name, by index, the file's first, or one that frames the scene from the side that shows most. A
/// wrong name lists those that exist.
lx_result lx_view_choose(const lx_tracer *tracer, const lx_render_desc *desc, lx_view_rays *out, lx_error *error);
/// Ray through (x, y) in 0…1, from the top left. Unit direction.
lx_ray lx_view_ray(const lx_view_rays *view, float x, float y);

#endif
