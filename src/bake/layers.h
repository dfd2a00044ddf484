/// Which source goes into which layer.
#ifndef LX_BAKE_LAYERS_H
#define LX_BAKE_LAYERS_H

#include "bake/bake.h"

/// Fills bake->layers, layer_count, uses and source_count from the tracer's sources and the desc (spec: layers and groups).
lx_result lx_layers_build(lx_bake *bake, lx_error *error);
void lx_layers_release(lx_bake *bake);

/// Traces a few paths from `points` twice, once into layers and once combined, and warns if the sum of layers times colours is not what was
/// combined: it is the promise that everything rests on.
void lx_layers_check(const lx_bake *bake, lx_path_batch *batch, const lx_receiver *points, uint32_t count);

/// Does the track change the source? Sources of one light of the file, or of one material, have the same tracks.
bool lx_source_is_driven(const lx_scene *scene, const lx_source *source, const lx_track *track);
/// Does any track of the scene?
bool lx_source_has_track(const lx_scene *scene, const lx_source *source);

/// Uses that put every source into layer 0 at its authored colour; [source count], owned by the caller; NULL: no memory. Monitors told by
/// cell shine with the mean colour of each cell.
lx_source_use *lx_uses_combined(const lx_tracer *tracer);

#endif
