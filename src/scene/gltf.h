/// glTF in and out.
#ifndef LX_SCENE_GLTF_H
#define LX_SCENE_GLTF_H

#include "scene/scene.h"

/// Reads a scene from memory. `folder`: where relative URIs are looked up; NULL refuses external files (fuzzing).
/// `name` is for messages, which do start with it. lx_scene_load is a thin wrapper.
lx_result lx_gltf_import(lx_context *context, const char *name, const char *folder, const void *data, size_t size,
                         const lx_scene_load_desc *desc, lx_scene **out_scene, lx_error *error);

/// Lets go of scene->document; NULL is fine.
void lx_gltf_document_release(struct json_t *document);

#endif
