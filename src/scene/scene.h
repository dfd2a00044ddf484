/// A scene as the baker sees it: plain arrays, indices between them, immutable once imported.
///
/// Built by gltf_import.c from one glTF file. World space is glTF's: right-handed, +Y up, metres. All strings and arrays are
/// owned by the scene; strings are never NULL unless said so.
#ifndef LX_SCENE_SCENE_H
#define LX_SCENE_SCENE_H

#include "base/context.h"
#include "base/file.h"
#include "base/memory.h"
#include "image/image.h"
#include "luxel/scene.h"
#include "math/mat.h"
#include "scene/program.h"

struct json_t; // jansson's; the document is kept and edited, so that nothing of the input is lost on export

enum { lx_most_monitor_cells = 4096 }; ///< Of one `luxel_monitor`: each is a layer.
enum { lx_texcoord_sets = 4 }; ///< TEXCOORD_0 … 3 are read; a material that asks for a later set gets a warning and set 0.

typedef enum lx_wrap { LX_WRAP_REPEAT, LX_WRAP_CLAMP, LX_WRAP_MIRROR } lx_wrap;

typedef struct lx_texture {
    int32_t image; ///< Index into images; -1: missing or undecodable (reads as white).
    lx_wrap wrap_s, wrap_t;
    bool nearest; ///< magFilter NEAREST; else bilinear.
} lx_texture;

/// A use of a texture by a material. uv' = (m[0] u + m[1] v + m[2], m[3] u + m[4] v + m[5]) (KHR_texture_transform).
typedef struct lx_texture_slot {
    int32_t texture;   ///< -1: none.
    uint32_t texcoord; ///< Set index below lx_texcoord_sets.
    float m[6];
} lx_texture_slot;

typedef enum lx_alpha_mode { LX_ALPHA_OPAQUE, LX_ALPHA_MASK, LX_ALPHA_BLEND } lx_alpha_mode;

/// How a light takes part (`luxel_mode`).
typedef enum lx_light_mode {
    LX_MODE_BAKED,
    LX_MODE_MIXED,    ///< What bounces is baked, the direct part is left out.
    LX_MODE_REALTIME, ///< Left out altogether.
} lx_light_mode;

/// Factors multiply textures as glTF 2.0 says. pbrSpecularGlossiness arrives here as its diffuse, metallic 0.
typedef struct lx_material {
    const char *name;   ///< "" when the file gives none.
    int32_t file_index; ///< In the file's materials; -1: glTF's default material.
    lx_rgb base_color;
    float base_alpha;
    float metallic, roughness, transmission;
    lx_rgb emissive_factor; ///< 0…1 per channel.
    float emissive_strength; ///< KHR_materials_emissive_strength × the light-units factor: radiance (nit) of factor 1.
    lx_texture_slot base_color_texture;         ///< sRGB, alpha linear.
    lx_texture_slot metallic_roughness_texture; ///< G roughness, B metallic.
    lx_texture_slot emissive_texture;           ///< sRGB.
    lx_texture_slot transmission_texture;       ///< R.
    uint32_t sampled_texcoords; ///< Bit n: some texture of the material, also one the baker ignores (a normal map), samples TEXCOORD_n.
    lx_alpha_mode alpha_mode;
    float alpha_cutoff;
    bool double_sided, unlit;
    bool transparent;      ///< `luxel_transparent` on the material.
    lx_light_mode mode;    ///< `luxel_mode` on the material (of its emission).
    const char *layer;     ///< `luxel_layer` on the material; NULL: none.
    float density;         ///< `luxel_density` on the material; 1: none. Multiplies the node's.
    uint32_t monitor_columns, monitor_rows; ///< `luxel_monitor` on the material; 0: none.
    const lx_program *animate; ///< `luxel_animate` on the material; NULL: none.
    bool emission_animated;    ///< An animation of the file changes its factor or strength: it emits, also where it begins black.
    float factor_scale, strength_scale; ///< emissive_factor = the file's × factor_scale; emissive_strength = the file's × strength_scale.
} lx_material;

/// One glTF primitive as indexed triangles (strips and fans converted, points and lines dropped). Local space.
/// Triangles that name one vertex twice or have no area stay: they get texels of size zero and are never hit.
typedef struct lx_primitive {
    uint32_t vertex_count, triangle_count;
    lx_vec3 *positions;                      ///< [vertex_count]; morph targets at their default weights are added.
    lx_vec3 *normals;                        ///< [vertex_count], unit length; NULL: flat.
    lx_vec2 *texcoords[lx_texcoord_sets];    ///< [vertex_count] each, or NULL.
    lx_vec4 *colors;                         ///< [vertex_count], linear, alpha in w; NULL: white.
    uint32_t *indices;                       ///< [3 * triangle_count], counter-clockwise seen from the front.
    uint32_t material;                       ///< Index into materials (always valid; the default material is appended when needed).
    uint32_t file_mesh, file_primitive;      ///< meshes[file_mesh].primitives[file_primitive] in the file.
} lx_primitive;

typedef struct lx_mesh {
    const char *name;
    uint32_t first_primitive, primitive_count; ///< Primitives that have triangles, in file order.
    uint32_t file_index;       ///< Repeats where nodes give one file mesh different morph weights.
} lx_mesh;

/// A mesh at a place in the world. An EXT_mesh_gpu_instancing node yields one per instance.
typedef struct lx_instance {
    const char *name;          ///< Of the node, else of the mesh, else "node_K". For messages.
    uint32_t node;             ///< Index in the file.
    uint32_t mesh;
    int32_t gpu_instance;      ///< Number within the node's EXT_mesh_gpu_instancing, -1 without.
    lx_mat4 transform;         ///< Local to world. A negative determinant keeps the front side: world triangles swap two corners.
    bool is_static;            ///< Baked and casting. False: skinned, morph- or transform-animated, or luxel_static: false.
    float density;             ///< `luxel_density` of the nearest node, 1 by default.
    uint32_t first_surface;    ///< One surface per primitive of the mesh, in its order.
} lx_instance;

/// A primitive of an instance: the unit of tracing and shading.
typedef struct lx_surface {
    uint32_t instance, primitive, material;
    bool transparent; ///< `luxel_transparent`, node before material: passes light by its alpha whatever the alpha mode.
    int32_t source;   ///< The emissive source it belongs to; -1: none, or its mode is realtime.
} lx_surface;

typedef enum lx_light_kind { LX_LIGHT_POINT, LX_LIGHT_SPOT, LX_LIGHT_DIRECTIONAL, LX_LIGHT_RECT, LX_LIGHT_DISK } lx_light_kind;

/// A light node in world space. Invisible to rays.
typedef struct lx_light {
    lx_light_kind kind;
    const char *name; ///< Of the node, else of the light, else "light_K".
    uint32_t node;
    lx_vec3 position;
    lx_vec3 direction;   ///< Unit, -Z of the node: where spot, directional and area lights shine.
    lx_vec3 axis_x, axis_y; ///< RECT: half edges in metres. DISK: two perpendicular radii in metres. Node scale is in them.
    lx_rgb color;
    float intensity; ///< Candela (point, spot), lux (directional), nit (rect, disk). Never negative or not finite.
    float range;     ///< Metres; 0: unlimited.
    float inner_angle, outer_angle; ///< Spot half-angles, radians.
    float radius;    ///< Point, spot: sphere, metres. Directional: angular diameter, radians. 0: sharp shadows.
    int32_t file_index;    ///< In the file's lights; -1: made by `luxel_area` alone.
    float intensity_scale; ///< intensity = the file's × intensity_scale: 1 / area for `luxel_area`, else 1.
} lx_light;

typedef enum lx_source_kind {
    LX_SOURCE_POINT, LX_SOURCE_SPOT, LX_SOURCE_DIRECTIONAL, LX_SOURCE_RECT, LX_SOURCE_DISK, ///< As lx_light_kind.
    LX_SOURCE_EMISSIVE, ///< An emissive material on one node.
    LX_SOURCE_SKY,
} lx_source_kind;

/// What light comes from, with the name a person calls it by: the candidates for layers. Lights in node order, then emissive
/// materials in node order. Realtime ones are left out. The sky is not among them: the bake adds it.
typedef struct lx_source {
    lx_source_kind kind;
    const char *name;  ///< Unique among sources: node's name, `node/material`, `light_K`; repeats get #2, #3 …
    const char *layer; ///< `luxel_layer`; NULL: a layer of its own.
    lx_light_mode mode; ///< BAKED or MIXED.
    int32_t light;     ///< Index into lights; -1 for emissive materials.
    uint32_t node;
    int32_t parent_node; ///< -1: a root. For grouping when there are too many.
    int32_t material;  ///< Emissive: index into materials; else -1.
    lx_rgb color;      ///< Authored; emissive: emissive_factor.
    float intensity;   ///< In the unit of its kind; emissive: emissive_strength (nit).
    int32_t file_light;     ///< In the file's lights; -1: none.
    float color_scale, intensity_scale; ///< color and intensity = the file's × this.
    const lx_program *animate; ///< `luxel_animate`; NULL: none.
    uint32_t columns, rows; ///< A monitor (`luxel_monitor`): its grid of cells over TEXCOORD_0. 0: none.
    lx_rgb white;      ///< Monitor: radiance of a white pixel = white × intensity. `color`, but white where that is black.
    const lx_rgb *picture; ///< Monitor: [columns × rows] mean linear texel of the emissive texture in each cell, row by row; white without one.
} lx_source;

static inline uint32_t lx_source_cell_count(const lx_source *source) { return source->columns * source->rows; }

typedef enum lx_track_object { LX_TRACK_LIGHT, LX_TRACK_MATERIAL } lx_track_object;
typedef enum lx_track_channel { LX_TRACK_COLOR, LX_TRACK_INTENSITY } lx_track_channel;
typedef enum lx_interpolation { LX_STEP, LX_LINEAR, LX_CUBIC } lx_interpolation; ///< As glTF's STEP, LINEAR, CUBICSPLINE.

/// Keys of an animation of the file for a light or an emissive material (KHR_animation_pointer). Values are the file's own: times the source's
/// color_scale or intensity_scale they are what sources have.
typedef struct lx_track {
    const char *name; ///< Of the animation, else "animation_K".
    lx_track_object object;
    uint32_t index;   ///< In the file's lights or materials.
    lx_track_channel channel; ///< COLOR: a light's color, a material's emissiveFactor. INTENSITY: intensity, emissiveStrength.
    lx_interpolation interpolation;
    const float *keys; ///< In the arena: {time_s, value…}, times ascending; CUBIC: {time_s, in-tangent…, value…, out-tangent…}. COLOR has
                       ///< three numbers a value, INTENSITY one. Values are not negative.
    uint32_t key_count;
} lx_track;

/// Numbers from one key of a track to the next.
static inline size_t lx_track_stride(const lx_track *track)
{
    const size_t width = track->channel == LX_TRACK_COLOR ? 3 : 1;
    return 1 + width * (track->interpolation == LX_CUBIC ? 3 : 1);
}

typedef struct lx_camera {
    const char *name; ///< Of the node, else of the camera, else "camera_K".
    lx_mat4 transform; ///< Looks along -Z, +Y up. Scale removed.
    bool perspective;
    float yfov;        ///< Radians (perspective).
    float xmag, ymag;  ///< Half extents (orthographic).
    float aspect;      ///< 0: the picture's.
} lx_camera;

struct lx_scene {
    lx_context *context; ///< Borrowed.
    char *path;          ///< As given, for messages.
    lx_arena strings;

    lx_image *images;    ///< Only those that materials use are decoded; the others have width 0.
    lx_texture *textures;
    lx_material *materials;
    lx_primitive *primitives;
    lx_mesh *meshes;
    lx_instance *instances;
    lx_surface *surfaces;
    lx_light *lights;
    lx_source *sources;
    lx_camera *cameras;
    lx_track *tracks;
    uint32_t image_count, texture_count, material_count, primitive_count, mesh_count, instance_count, surface_count, light_count,
        source_count, camera_count, track_count;

    lx_bounds bounds;         ///< Of all static instances, world.
    uint64_t triangle_count;  ///< Of all static instances.
    double import_seconds;    ///< What lx_scene_load took.
    bool from_blender;        ///< asset.generator names Blender's exporter.

    // The file, for export.
    struct json_t *document;
    lx_bytes *buffers;       ///< [buffer_count] in file order, external ones loaded, meshopt fallback ones empty.
    lx_bytes *image_files;   ///< [file_image_count] undecoded content of images given by URI (external or data:); else empty.
    uint32_t buffer_count, file_image_count;
};

/// Texture lookup at uv (before the slot's transform), wrap and filter applied; bytes to 0…1, no sRGB decoding for `linear`.
/// A slot without texture gives white. srgb: RGB decoded to linear before filtering, alpha untouched.
lx_vec4 lx_texture_sample(const lx_scene *scene, const lx_texture_slot *slot, lx_vec2 uv, bool srgb);

/// Its alpha alone.
float lx_texture_sample_alpha(const lx_scene *scene, const lx_texture_slot *slot, lx_vec2 uv);

/// True if a texel of the image has alpha below 1, i.e. the slot can let light through.
bool lx_texture_has_alpha(const lx_scene *scene, const lx_texture_slot *slot);

/// True if the material emits: factor and strength above zero, or animated, and not unlit, which ignores emission. (Its texture may still be
/// black.)
bool lx_material_emits(const lx_material *material);

/// The cell of a monitor that TEXCOORD_0 = `uv` lies in: (0, 0) is in cell 0, what lies outside belongs to the nearest one.
static inline uint32_t lx_monitor_cell(const lx_source *monitor, lx_vec2 uv)
{
    // lx_max takes NaN, which overflow may leave, for its second argument.
    const float x = lx_min(lx_max(uv.x * (float)monitor->columns, 0), (float)(monitor->columns - 1));
    const float y = lx_min(lx_max(uv.y * (float)monitor->rows, 0), (float)(monitor->rows - 1));
    return (uint32_t)y * monitor->columns + (uint32_t)x;
}

#endif
