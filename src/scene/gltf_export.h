/// Writes the scene back as one .glb with its lightmap coordinates.
#ifndef LX_SCENE_GLTF_EXPORT_H
#define LX_SCENE_GLTF_EXPORT_H

#include "scene/atlas.h"

/// The input document with: lightmap coordinates as TEXCOORD_n of every lit primitive (vertices split where charts part them; then the
/// primitive becomes indexed triangles and every attribute and morph target is re-indexed in its own component type; accessors
/// that were shared stay shared), `extras.luxel_lightmap` = {page, texCoord, scale, offset} on nodes with a rectangle,
/// `_LUXEL_RECT` (VEC4 scale, offset) and `_LUXEL_PAGE` (SCALAR, float; -1: no rectangle) on EXT_mesh_gpu_instancing nodes, whose
/// extras.luxel_lightmap has texCoord alone, `extras.luxel_baked: true` on light nodes and materials whose light is wholly in the
/// lightmap (not on mixed ones), `extras.luxel` = version on the asset. Extras that are no object become {"value": …} first; marks of an
/// earlier bake are removed. A mesh used at several morph weights is written several times, over the same data where it can be.
/// External buffers and images are embedded, compressed bufferViews are written decompressed; all else is kept.
/// Passes the Khronos validator. `out` is owned by the caller.
lx_result lx_gltf_export(const lx_scene *scene, const lx_atlas *atlas, lx_bytes *out, lx_error *error);

#endif
