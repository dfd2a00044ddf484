/// Writes the scene back as one .glb with its lightmap coordinates.
#ifndef LX_SCENE_GLTF_EXPORT_H
#define LX_SCENE_GLTF_EXPORT_H

#include "scene/atlas.h"

/// The input document with: lightmap coordinates as TEXCOORD_n of every lit primitive (vertices split where charts part them; then the
/// primitive becomes indexed triangles and every attribute and morph target is re-indexed in its own component type; accessors
/// that were shared stay shared), `extras.luxel_lightmap` = {page, texCoord, scale, offset} on nodes with a rectangle,
/// `_LUXEL_RECT` (VEC4 scale, offset) and `_LUXEL_PAGE` (SCALAR) on EXT_mesh_gpu_instancing nodes, `extras.luxel_baked: true` on
/// light nodes and materials that are in the lightmap. External buffers and images are embedded; all else is kept.
/// Passes the Khronos validator. `out` is owned by the caller.
lx_result lx_gltf_export(const lx_scene *scene, const lx_atlas *atlas, lx_bytes *out, lx_error *error);

#endif
