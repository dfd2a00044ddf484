/// report.html: one page that shows what a bake gave and what it costs.
#ifndef LX_API_REPORT_H
#define LX_API_REPORT_H

#include "bake/baked.h"
#include "bake/bake.h"
#include "base/builder.h"
#include "image/image.h"
#include "render/seen.h"

typedef struct lx_report {
    const char *title;         ///< Name of the baked folder.
    const char *files_folder;  ///< Where the files are whose sizes are shown.
    const lx_bake *bake;
    lx_baked *baked;           ///< The same, opened: its colours are changed.
    const lx_manifest *manifest;
    const lx_image *preview;   ///< U8 RGB; NULL: none.
    const lx_seen *seen;       ///< Through the preview's camera, for pictures of layers; NULL: they are shown in the atlas.
} lx_report;

/// The whole page, self-contained: pictures are data: addresses, there is no script and no address of another host.
lx_result lx_report_build(const lx_report *report, lx_builder *out, lx_error *error);

// ---- its pictures (report_pictures.c)

/// Adds the `data:` address of a JPEG.
lx_result lx_report_add_jpeg(lx_builder *html, const lx_image *image, int quality, lx_error *error);
/// A page at the current colours: irradiance as a white wall shows it, at most `largest` pixels along an edge, at the exposure that suits it.
lx_result lx_report_page_picture(const lx_baked *baked, uint32_t page, uint32_t largest, lx_image *out, lx_error *error);
/// What the camera sees of the light at the current colours, at the exposure that suits it. *out_black: none of it.
lx_result lx_report_seen_picture(const lx_baked *baked, const lx_seen *seen, lx_image *out, bool *out_black, lx_error *error);
/// The page on which layers shine most at the current colours.
lx_result lx_report_brightest_page(const lx_baked *baked, uint32_t *out_page, lx_error *error);
/// "#rrggbb" (sRGB) of a linear colour, made as bright as it goes.
void lx_report_swatch(const float rgb[3], char out[8]);

#endif
