/// The picture on a monitor as the file has it, cell by cell.
#ifndef LX_SCENE_MONITOR_H
#define LX_SCENE_MONITOR_H

#include "scene/scene.h"

/// Mean linear texel of the emissive texture in each cell of source `index` (a monitor): out[columns × rows], row by row. White without a
/// texture. Exact by area where the picture is mapped by TEXCOORD_0 without being turned or repeated, which is what
/// lxrt_monitor_update makes of the same picture; else from many lookups.
lx_result lx_monitor_average(const lx_scene *scene, uint32_t index, lx_rgb *out, lx_error *error);

#endif
