/// Baked folders: opening, looking inside, recolouring.
#ifndef LUXEL_BAKED_H
#define LUXEL_BAKED_H

#include "luxel/bake.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct lx_baked lx_baked;

/// True if `path` is a folder that holds a luxel.json.
LX_API bool lx_baked_is_folder(const char *path);

/// Opens OUT/luxel.json and OUT/luxel.pack, and with `with_scene` OUT/scene.glb too (needed by lx_render_image).
LX_API lx_result lx_baked_open(lx_context *context, const char *folder, bool with_scene, lx_baked **out_baked, lx_error *error);
LX_API void lx_baked_destroy(lx_baked *baked);

LX_API uint32_t lx_baked_page_count(const lx_baked *baked);
LX_API uint32_t lx_baked_page_size(const lx_baked *baked);
LX_API uint32_t lx_baked_layer_count(const lx_baked *baked);
LX_API const char *lx_baked_layer_name(const lx_baked *baked, uint32_t layer); ///< Borrowed.
/// Current colour of a layer, colour × intensity; authored at first.
LX_API void lx_baked_get_layer(const lx_baked *baked, uint32_t layer, float out_rgb[3]);
LX_API void lx_baked_set_layer(lx_baked *baked, uint32_t layer, const float rgb[3]);
/// Applies one `LAYER=COLOUR[*INTENSITY]`: LAYER may be a glob, COLOUR is #rrggbb (sRGB), r,g,b (linear) or `off`. Without *INTENSITY
/// the layer keeps its authored intensity. A name that fits nothing gives LX_ERROR_INVALID_ARGUMENT with the nearest names.
LX_API lx_result lx_baked_set(lx_baked *baked, const char *assignment, lx_error *error);

/// Irradiance of one page at the current colours: page_size² RGB floats, row 0 first.
LX_API lx_result lx_baked_compose(const lx_baked *baked, uint32_t page, float *out_rgb, lx_error *error);

/// What the folder costs at run time.
LX_API void lx_baked_get_budget(const lx_baked *baked, lx_budget *out);

/// What is in the folder as JSON text (the manifest, plus sizes in bytes); free with lx_text_free.
LX_API lx_result lx_baked_describe(const lx_baked *baked, char **out_json, lx_error *error);

#ifdef __cplusplus
}
#endif
#endif
