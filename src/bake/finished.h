/// The layers of a bake when they are done: one colour per luxel instead of whole pages, in memory or in a temporary file.
///
/// Use:
///     lx_finished_create(map, layer_count, false, NULL, &f, error);   // once the luxels are numbered
///     lx_finished_dilate(f, map, page, padding, chart, error);        // each page, once it is known which luxels are valid
///     lx_finished_extend(f, texels, count, error);                     // optional: padding texels with a colour of their own
///     lx_finished_write(f, layer, 0, lx_finished_count(f), rgb, error);
///     lx_finished_image(f, page, layer, image, error);
///
/// Writing and reading may be done from any thread, if not the same layer at once.
#ifndef LX_BAKE_FINISHED_H
#define LX_BAKE_FINISHED_H

#include "luxel/base.h"
#include "post/luxel_map.h"

typedef struct lx_finished lx_finished;

/// `map` is read during the call only: its counts. `on_disk`: layers go to a temporary file in `folder` (NULL: as lx_scratch_create says).
lx_result lx_finished_create(const lx_luxel_map *map, uint32_t layer_count, bool on_disk, const char *folder, lx_finished **out, lx_error *error);
void lx_finished_destroy(lx_finished *finished);

/// Where the texels of page `page` take their colour from: valid luxels from themselves, all others as lx_dilate_map says, which extends `page_chart`
/// ([page_size²], the page's part of lx_bake.texel_chart). Pages may be done at the same time.
lx_result lx_finished_dilate(lx_finished *finished, const lx_luxel_map *map, uint32_t page, uint32_t padding, uint32_t *page_chart,
                             lx_error *error);

/// [page_count * page_size²] the luxel whose colour each texel shows, or UINT32_MAX. Borrowed; valid until lx_finished_extend. For lx_stitch_create.
const uint32_t *lx_finished_entries(const lx_finished *finished);

/// Gives texels that are no luxels (page * page_size² + y * page_size + x, ascending) a colour of their own: entries lx_luxel_map.count and up, in
/// this order. Once, after all pages were dilated and before such an entry is written.
lx_result lx_finished_extend(lx_finished *finished, const uint32_t *texels, uint32_t count, lx_error *error);

/// Entries of a layer: the luxels, then the texels of lx_finished_extend.
uint32_t lx_finished_count(const lx_finished *finished);

/// Sets entries first … first + count - 1 of a layer. All of them must have been set before the layer is read.
lx_result lx_finished_write(lx_finished *finished, uint32_t layer, uint32_t first, uint32_t count, const lx_rgb *rgb, lx_error *error);

/// The layer as an image of a page: `out_rgb` [page_size²] RGB, row 0 first, padding and invalid texels filled. Black where nothing is.
lx_result lx_finished_image(const lx_finished *finished, uint32_t page, uint32_t layer, float *out_rgb, lx_error *error);

/// A layer's light in numbers.
typedef struct lx_layer_range {
    float largest; ///< Channel of any texel.
    double mean;   ///< Of the channels of all valid luxels.
} lx_layer_range;

lx_result lx_finished_range(const lx_finished *finished, uint32_t layer, lx_layer_range *out, lx_error *error);

/// Bytes of memory that so many luxels, texels of pages and layers take, without those in the temporary file; and what lx_finished_image and
/// lx_finished_range need for themselves, at most, where layers are on disk.
uint64_t lx_finished_bytes(uint64_t luxel_count, uint64_t texel_count, uint32_t layer_count, bool on_disk);

#endif
