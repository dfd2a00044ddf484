/// Lightmap atlases: texture coordinates and rectangles for all static surfaces of a scene.
#ifndef LUXEL_ATLAS_H
#define LUXEL_ATLAS_H

#include "luxel/scene.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct lx_atlas lx_atlas;

/// Fill with lx_atlas_desc_default(), then change what you need.
typedef struct lx_atlas_desc {
    uint32_t page_size;      ///< Texels along an edge; a multiple of 4, 16…4096. Default 1024.
    uint32_t max_pages;      ///< Default 1, at most 256.
    float texels_per_m;      ///< Texels per metre at density 1. 0 (default): what just fills the pages.
    uint32_t padding;        ///< Texels between charts, 2…32. Default 4.
    bool force_unwrap;       ///< Ignore lightmap sets that the file brings. Default false.
} lx_atlas_desc;

LX_API lx_atlas_desc lx_atlas_desc_default(void);

/// Uses the file's TEXCOORD_1 where it is good, unwraps elsewhere (with a warning when a set was there but bad), packs all
/// instances. LX_ERROR_LIMIT if texels_per_m was asked for and does not fit the pages: the message says what would.
/// The scene must outlive the atlas. Same input, same bits, for any number of threads.
LX_API lx_result lx_atlas_build(const lx_scene *scene, const lx_atlas_desc *desc, const lx_progress_sink *progress,
                                lx_atlas **out_atlas, lx_error *error);
LX_API void lx_atlas_destroy(lx_atlas *atlas);

#ifdef __cplusplus
}
#endif
#endif
