/// Scenes: glTF 2.0 files (.glb, .gltf) as the baker sees them.
#ifndef LUXEL_SCENE_H
#define LUXEL_SCENE_H

#include "luxel/base.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct lx_scene lx_scene;

typedef enum lx_light_units {
    LX_LIGHT_UNITS_GLTF,    ///< Candela, lux, nit, as the file says. Default.
    LX_LIGHT_UNITS_BLENDER, ///< Emission × 683, to match what Blender's exporter does to lamps.
} lx_light_units;

typedef struct lx_scene_load_desc {
    lx_light_units light_units;
    size_t max_file_bytes; ///< Of the file and of each file it names. Default 4 GiB.
} lx_scene_load_desc;

LX_API lx_scene_load_desc lx_scene_load_desc_default(void);

/// Reads a .glb or .gltf file with all it names, and checks everything. Problems are one line that starts with the path and names
/// the object: "room.glb: accessor 7: index 812 out of range (count 640)". Notes and warnings go to the context's logger.
/// `desc` NULL: defaults. The context must outlive the scene.
LX_API lx_result lx_scene_load(lx_context *context, const char *path, const lx_scene_load_desc *desc, lx_scene **out_scene,
                               lx_error *error);
LX_API void lx_scene_destroy(lx_scene *scene);

/// What is in the scene as JSON text (counts, lights, layers, cameras, materials, bounds); free with lx_text_free.
LX_API lx_result lx_scene_describe(const lx_scene *scene, char **out_json, lx_error *error);
LX_API void lx_text_free(char *text);

#ifdef __cplusplus
}
#endif
#endif
