/// What a camera sees of the lightmap: traced once, lit as often as one likes. For pictures of single layers.
#ifndef LX_RENDER_SEEN_H
#define LX_RENDER_SEEN_H

#include "bake/baked.h"
#include "luxel/render.h"
#include "trace/tracer.h"

/// A place of the lightmap that a pixel shows, and by how much: albedo over pi, opacity, and the panes before it.
typedef struct lx_seen_texel {
    uint32_t pixel, page;
    float u, v;
    lx_rgb weight;
} lx_seen_texel;

typedef struct lx_seen {
    uint32_t width, height;
    lx_seen_texel *texels; ///< Owned; several for a pixel.
    size_t count, capacity;
} lx_seen;

/// Where on its page a hit keeps its light; false: the surface has no texels.
bool lx_lightmap_place(const lx_scene *scene, const lx_atlas *atlas, const lx_hit *hit, uint32_t *out_page, lx_vec2 *out_uv);

/// Of a folder that was opened with its scene, through the camera of `desc` (size and samples are those of `desc` too).
lx_result lx_seen_create(const lx_baked *baked, const lx_render_desc *desc, lx_seen *out, lx_error *error);
void lx_seen_release(lx_seen *seen);

/// 3 * width * height radiance values (nit) at the pack's current colours: light on surfaces that have a lightmap, and nothing else.
void lx_seen_light(const lx_seen *seen, const lx_baked *baked, float *out_rgb);

#endif
