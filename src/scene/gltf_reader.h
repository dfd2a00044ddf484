/// What the parts of the importer share. Each part is one file; gltf_import.c calls them in order.
///
/// Messages do not name the file: lx_gltf_import puts its name in front.
#ifndef LX_SCENE_GLTF_READER_H
#define LX_SCENE_GLTF_READER_H

#include "scene/gltf_extras.h"
#include "scene/gltf_json.h"
#include "scene/scene.h"

/// The top-level arrays of a file.
typedef enum lx_gltf_kind {
    LX_GLTF_BUFFER,
    LX_GLTF_VIEW,
    LX_GLTF_ACCESSOR,
    LX_GLTF_SAMPLER,
    LX_GLTF_IMAGE,
    LX_GLTF_TEXTURE,
    LX_GLTF_MATERIAL,
    LX_GLTF_MESH,
    LX_GLTF_SKIN,
    LX_GLTF_CAMERA,
    LX_GLTF_LIGHT, ///< Of KHR_lights_punctual.
    LX_GLTF_ANIMATION,
    LX_GLTF_NODE,
    LX_GLTF_SCENE,
    lx_gltf_kind_count
} lx_gltf_kind;

/// A bufferView: where its bytes lie, decompressed when first asked for.
typedef struct lx_gltf_view {
    uint32_t buffer;
    size_t offset, size;
    size_t stride; ///< 0: elements lie close together.
    bool compressed;
    uint8_t *decoded; ///< Owned.
} lx_gltf_view;

/// A mesh of the file at one set of morph weights.
typedef struct lx_gltf_mesh_variant {
    uint32_t mesh;  ///< Index into the scene's meshes.
    int32_t next;   ///< Another variant of the same file mesh; -1: none.
    float *weights; ///< Owned; NULL: no morph targets.
    uint32_t weight_count;
} lx_gltf_mesh_variant;

typedef struct lx_gltf_node {
    int32_t parent; ///< -1: a root.
    bool in_scene;  ///< Reached from the default scene.
    lx_mat4 world;
    bool transform_animated; ///< This node's own; then what it hands down.
    bool weights_animated;   ///< This node's own.
    bool moves;              ///< It or a node above it has an animated transform.
    bool holds_no_lamps;     ///< In a VPLS… or BLOCKERS… group.
    int32_t area_owner;      ///< The nearest node upwards (or itself) with luxel_area; -1: none.
    bool area_taken;         ///< A lamp below uses this node's luxel_area.
    int32_t monitor_owner;   ///< The nearest node upwards (or itself) with luxel_monitor; -1: none.
    bool monitor_taken;      ///< A screen at or below this node uses its luxel_monitor.
    lx_gltf_extras extras;   ///< Its own keys, then completed by those of the nodes above.
} lx_gltf_node;

/// What a light is made a source with, beside what lx_light says.
typedef struct lx_gltf_light_use {
    lx_gltf_extras extras; ///< Of node, then light.
    bool realtime;
} lx_gltf_light_use;

typedef struct lx_gltf_reader {
    lx_context *context;
    lx_log *log;
    lx_scene *scene;    ///< Under construction; owns all results.
    const char *folder; ///< NULL: no external files.
    size_t max_file_bytes;
    uint64_t memory_left;    ///< What decoding may still allocate, so that a small file cannot ask for all memory.
    uint64_t memory_reserve; ///< What more input may add to it.
    float emission_scale;

    lx_gltf_object root;
    json_t *elements[lx_gltf_kind_count];
    uint32_t counts[lx_gltf_kind_count];
    const uint8_t *binary; ///< The GLB's second chunk, borrowed; NULL: none.
    size_t binary_size;

    lx_gltf_view *views;
    lx_gltf_node *nodes;
    uint32_t *order; ///< The nodes in the scene, parents before children.
    uint32_t order_count;

    lx_gltf_mesh_variant *variants;
    size_t variant_count, variant_capacity;
    int32_t *first_variant; ///< Per file mesh.
    size_t primitive_capacity, mesh_capacity, instance_capacity, surface_capacity, light_capacity;
    int32_t default_material; ///< -1: not needed so far.

    lx_gltf_light_use *light_uses; ///< One per light of the scene.
    size_t light_use_capacity, track_capacity;
    uint32_t extras_count; ///< Keys of any kind in the extras that were read.
} lx_gltf_reader;

// gltf_import.c

/// The element of that kind; it must be an object.
lx_result lx_gltf_element(const lx_gltf_reader *reader, lx_gltf_kind kind, uint32_t index, lx_gltf_object *out,
                          lx_error *error);
/// Input of so many bytes was read: decoding may allocate in proportion.
void lx_gltf_grant(lx_gltf_reader *reader, size_t input_bytes);
/// Takes count × size bytes from what decoding may allocate; LX_ERROR_LIMIT names `label` when that is used up.
lx_result lx_gltf_charge(lx_gltf_reader *reader, uint64_t count, size_t size, const char *label, lx_error *error);
/// The string in the scene's arena; "" for NULL.
lx_result lx_gltf_keep_string(lx_gltf_reader *reader, const char *text, const char **out, lx_error *error);
/// The element's name, or `fallback` with `index` behind an underscore.
lx_result lx_gltf_name(lx_gltf_reader *reader, const lx_gltf_object *element, const lx_gltf_object *second,
                       const char *fallback, uint32_t index, const char **out, lx_error *error);

// gltf_file.c: container, JSON, version, extensions.
lx_result lx_gltf_open(lx_gltf_reader *reader, const void *data, size_t size, lx_error *error);
/// What to do about Draco, as the end of a sentence.
const char *lx_gltf_draco_advice(void);

// gltf_uri.c: the content of a data: URI or of a file in the scene's folder.
lx_result lx_gltf_load_uri(lx_gltf_reader *reader, const lx_gltf_object *object, const char *uri, lx_bytes *out,
                           lx_error *error);

// gltf_buffers.c
lx_result lx_gltf_load_buffers(lx_gltf_reader *reader, lx_error *error);
/// The bytes of a bufferView: views[index].size of them.
lx_result lx_gltf_view_data(lx_gltf_reader *reader, uint32_t index, const uint8_t **out, lx_error *error);

// gltf_images.c
lx_result lx_gltf_load_textures(lx_gltf_reader *reader, lx_error *error);
/// Reads all image files, decodes what the materials on surfaces use.
lx_result lx_gltf_load_images(lx_gltf_reader *reader, lx_error *error);

// gltf_materials.c
lx_result lx_gltf_load_materials(lx_gltf_reader *reader, lx_error *error);
/// The scene's index of a primitive's material; -1 asks for glTF's default material.
uint32_t lx_gltf_material_index(lx_gltf_reader *reader, int32_t file_index);

// gltf_meshes.c
/// Checks every mesh of the file without reading its data.
lx_result lx_gltf_check_meshes(lx_gltf_reader *reader, lx_error *error);
/// The scene's mesh for `file_mesh` at the weights of `node` (else the mesh's), read when first asked for.
lx_result lx_gltf_mesh_index(lx_gltf_reader *reader, uint32_t file_mesh, const lx_gltf_object *node, uint32_t *out,
                             lx_error *error);

// gltf_references.c: indices that the importer does not follow itself, but that export keeps.
lx_result lx_gltf_check_references(lx_gltf_reader *reader, lx_error *error);

// gltf_nodes.c
/// a · b, summed in double.
lx_mat4 lx_gltf_multiply(const lx_mat4 *a, const lx_mat4 *b);
/// The quaternion x y z w at unit length; none at all (with a warning) if it has no length.
lx_vec4 lx_gltf_unit_rotation(lx_log *log, const char *label, const float q[4]);
lx_result lx_gltf_load_nodes(lx_gltf_reader *reader, lx_error *error);

// gltf_instances.c
lx_result lx_gltf_load_instances(lx_gltf_reader *reader, lx_error *error);

// gltf_lights.c
lx_result lx_gltf_load_lights(lx_gltf_reader *reader, lx_error *error);

// gltf_cameras.c
lx_result lx_gltf_load_cameras(lx_gltf_reader *reader, lx_error *error);

// gltf_tracks.c: animated light.
lx_result lx_gltf_load_tracks(lx_gltf_reader *reader, lx_error *error);

// gltf_sources.c
lx_result lx_gltf_load_sources(lx_gltf_reader *reader, lx_error *error);

#endif
