/// An opened baked folder, as bake/ and render/ share it.
#ifndef LX_BAKE_BAKED_H
#define LX_BAKE_BAKED_H

#include "luxel/baked.h"
#include "luxel_rt.h"
#include "scene/atlas.h"
#include "store/manifest.h"
#include "trace/path.h"

struct lx_baked {
    lx_context *context; ///< Borrowed.
    char *folder;
    lx_manifest manifest;
    lx_bytes pack_data;   ///< luxel.pack, unless it is
    lx_file_map pack_map; ///< mapped.
    void *pack_memory;
    lxrt_pack *pack; ///< In pack_memory; holds the current colours.

    // With the scene only; else NULL.
    lx_scene *scene;  ///< OUT/scene.glb.
    lx_atlas *atlas;  ///< For it: corner_uv from the lightmap set, rects from the pack. triangle_chart is NULL, chart_count 0.
    char *sky_path;
    lx_sky_desc sky;  ///< For a tracer of the scene: the sky of the bake; no sky without one.
    /// Per source of such a tracer (those of the scene, then the sky): its layer, and what to multiply the layer's current colour by
    /// to get the source's strength (lx_baked_source_strength). Sources the bake did not know have layer -1: they are not baked.
    lx_source_use *uses;
    uint32_t use_count; ///< scene->source_count + 1; the last is the sky's, whether there is one or not.
};

/// Opens a folder of our own without reading luxel.pack into memory: it stays on disk but for what is just used, see lx_baked_rest.
lx_result lx_baked_open_mapped(lx_context *context, const char *folder, bool with_scene, lx_baked **out_baked, lx_error *error);
/// Forgets what was read of a mapped pack; a few milliseconds where it is read again, nothing to others.
void lx_baked_rest(const lx_baked *baked);
/// A whole mip level of a page at current colours: [(page size >> level)²] RGB.
lx_result lx_baked_compose_level(const lx_baked *baked, uint32_t page, uint32_t level, float *out_rgb, lx_error *error);

/// Current colour × intensity of a source, in its unit: what an emitter's texture or a sky's picture is multiplied by. 0 for sources
/// that are not in the bake. `index`: as in uses.
/// Of a monitor: what its authored picture is multiplied by; see lx_baked_monitor_shows_cells.
lx_rgb lx_baked_source_strength(const lx_baked *baked, uint32_t index);
/// What the bake knows of source `index` of the scene as a monitor; NULL: it is none.
const lx_manifest_monitor *lx_baked_monitor(const lx_baked *baked, uint32_t index);
/// True if some cell of the monitor has another colour than the authored one: it no longer shows its own picture.
bool lx_baked_monitor_shows_cells(const lx_baked *baked, const lx_manifest_monitor *monitor);

/// `*` stands for any text and `?` for one byte; everything else for itself.
bool lx_glob_matches(const char *pattern, const char *text);
/// How many letters must be inserted, left out or exchanged to get from one to the other; case does not count. Long texts are cut.
uint32_t lx_edit_distance(const char *a, const char *b);

#endif
