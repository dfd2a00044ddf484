/// From finished texels to files.
#ifndef LX_BAKE_SAVE_H
#define LX_BAKE_SAVE_H

#include "bake/bake.h"
#include "store/folder.h"
#include "store/manifest.h"

/// Mip levels of one page: charts for all layers, colours of the layer at hand.
typedef struct lx_page_mips {
    uint32_t size, level_count;
    const uint32_t *charts[16]; ///< [0] is borrowed, the others are owned.
    const float *rgb[16];       ///< Likewise. Filled by lx_page_mips_build.
    void *owned;
} lx_page_mips;

lx_result lx_page_mips_create(const lx_bake *bake, uint32_t page, uint32_t level_count, lx_page_mips *out, lx_error *error);
void lx_page_mips_release(lx_page_mips *mips);
/// `rgb`: level 0, borrowed until the next call.
void lx_page_mips_build(lx_page_mips *mips, const float *rgb);

/// The lightmap files of a bake, page by page and layer by layer. All zero is legal to release.
typedef struct lx_lightmap_writer lx_lightmap_writer;
/// `scales`: [layer_count] of KTX2; borrowed.
lx_result lx_lightmap_writer_create(const lx_bake *bake, const lx_save_desc *desc, const float *scales, const lx_new_folder *folder,
                                    lx_manifest *manifest, lx_lightmap_writer **out_writer, lx_error *error);
/// Pages and layers in ascending order, layers within pages. Files are added to the manifest.
lx_result lx_lightmap_writer_add(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const lx_page_mips *mips, lx_error *error);
void lx_lightmap_writer_destroy(lx_lightmap_writer *writer);

/// Layer names as parts of file names: letters, digits, `-`, `_` and `.`, at most 64 of them, unique even where case is ignored.
/// [layer_count] strings in `arena`; NULL: no memory.
char **lx_layer_file_names(lx_arena *arena, const lx_layer *layers, uint32_t layer_count);

/// Everything but the preview and luxel.json: scene.glb, luxel.pack, lightmaps, the sky. `out_manifest` describes it (borrows strings
/// of the bake); summary.pack_bytes is filled. Calls `progress` with the stage "save".
lx_result lx_bake_write(lx_bake *bake, const lx_save_desc *desc, const lx_new_folder *folder, const lx_progress_sink *progress,
                        lx_manifest *out_manifest, lx_error *error);
/// luxel.json.
lx_result lx_bake_write_manifest(const lx_manifest *manifest, const lx_new_folder *folder, lx_error *error);

#endif
