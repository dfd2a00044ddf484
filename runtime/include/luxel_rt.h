/// luxel_rt: baked light at run time. Reads luxel.pack and sums its layers at any colours.
///
/// One vector of colours drives everything: E = Σ c_i T_i, where T_i is what layer i sends everywhere at unit strength, all bounces
/// included. Needs libc and libm; allocates nothing, reads no files, has no globals and no locks. The caller owns all memory.
/// A pack may be read from many threads at once while nobody calls lxrt_set_layer.
///
///     size_t bytes;
///     lxrt_pack *pack;
///     if (lxrt_memory_bytes(data, size, &bytes) == LXRT_OK && lxrt_open(data, size, malloc(bytes), bytes, &pack) == LXRT_OK) {
///         lxrt_set_layer(pack, lxrt_find_layer(pack, "desk lamp"), (const float[3]){0, 40, 80});
///         lxrt_compose(pack, 0, 0, 0, 0, n, n, rgb, 0);
///     }
#ifndef LUXEL_RT_H
#define LUXEL_RT_H

#include <stddef.h>
#include <stdint.h>

#if defined(__GNUC__)
#define LXRT_API __attribute__((visibility("default")))
#else
#define LXRT_API
#endif

#ifdef __cplusplus
extern "C" {
#endif

#define LXRT_NONE UINT32_MAX ///< No such layer.

typedef enum lxrt_result {
    LXRT_OK = 0,
    LXRT_ERROR_INVALID_ARGUMENT, ///< A NULL, an index out of range, a number that is not finite or far too large.
    LXRT_ERROR_MEMORY_TOO_SMALL, ///< lxrt_open was given less than lxrt_memory_bytes asks for.
    LXRT_ERROR_NOT_A_PACK,       ///< The data does not begin like a pack.
    LXRT_ERROR_VERSION,          ///< Written by a version of Luxel with another layout.
    LXRT_ERROR_TRUNCATED,        ///< The data ends early.
    LXRT_ERROR_CORRUPT,          ///< Sizes, offsets or numbers inside make no sense.
    LXRT_ERROR_NOT_FOUND,        ///< Nothing has that name or number.
} lxrt_result;

/// English name of a result, e.g. "not a pack". Never NULL.
LXRT_API const char *lxrt_result_name(lxrt_result result);

typedef struct lxrt_pack lxrt_pack;

/// Checks the pack and tells how much memory lxrt_open needs for it (some dozen bytes a layer). No alignment is asked of `data`.
LXRT_API lxrt_result lxrt_memory_bytes(const void *data, size_t size, size_t *out_bytes);
/// Checks the pack, hostile ones too, and puts a handle into `memory`. Layers start at their authored colours. `data` and `memory`
/// must stay as long as the pack is used; `data` is never written to. There is nothing to close.
LXRT_API lxrt_result lxrt_open(const void *data, size_t size, void *memory, size_t memory_bytes, lxrt_pack **out_pack);

typedef struct lxrt_info {
    uint32_t page_size;   ///< Texels along an edge; all pages are square and alike.
    uint32_t page_count;
    uint32_t layer_count;
    uint32_t level_count; ///< Mip levels; level k has page_size >> k texels along an edge.
    uint32_t rect_count;
    uint32_t source_count;
    uint32_t block_count; ///< Blocks of 32×32 texels that are stored.
} lxrt_info;
LXRT_API void lxrt_get_info(const lxrt_pack *pack, lxrt_info *out);

/// Covered share of a page, 0…1; 0 for a page that is not there.
LXRT_API float lxrt_page_coverage(const lxrt_pack *pack, uint32_t page);

typedef enum lxrt_kind {
    LXRT_KIND_POINT, LXRT_KIND_SPOT, LXRT_KIND_DIRECTIONAL, LXRT_KIND_RECT, LXRT_KIND_DISK,
    LXRT_KIND_EMISSIVE, ///< An emissive material on one node.
    LXRT_KIND_SKY,
    LXRT_KIND_COMBINED, ///< Of a layer alone: all sources together, at their authored colours.
} lxrt_kind;

typedef struct lxrt_layer {
    const char *name;  ///< UTF-8; lies in the pack's data.
    lxrt_kind kind;    ///< Of the layer's first source.
    uint32_t mixed;    ///< 1: the direct part is not in the lightmap.
    float color[3];    ///< Authored, linear Rec. 709. At first c = color × intensity.
    float intensity;
    float scale;       ///< Stored texels × scale = irradiance per unit light.
} lxrt_layer;
LXRT_API lxrt_result lxrt_get_layer_info(const lxrt_pack *pack, uint32_t layer, lxrt_layer *out);
/// The layer of that name, LXRT_NONE if there is none.
LXRT_API uint32_t lxrt_find_layer(const lxrt_pack *pack, const char *name);

/// Sets c of a layer: colour × intensity, linear Rec. 709, in the layer's unit (cd, lx or nit). Black costs nothing later on.
LXRT_API lxrt_result lxrt_set_layer(lxrt_pack *pack, uint32_t layer, const float rgb[3]);
LXRT_API lxrt_result lxrt_get_layer(const lxrt_pack *pack, uint32_t layer, float out_rgb[3]);

/// Irradiance (lux) of a rectangle of texels at the current colours: RGB floats, `row_stride` floats from row to row (0: 3 × width).
/// Layers are added in their order, whatever the rectangle: the same texel always gets the same bits.
LXRT_API lxrt_result lxrt_compose(const lxrt_pack *pack, uint32_t page, uint32_t level, uint32_t x, uint32_t y, uint32_t width,
                                  uint32_t height, float *out_rgb, size_t row_stride);

/// Irradiance at a point of a page, bilinear between texel centres, clamped at the edges. (0, 0) is the corner where row 0 begins.
LXRT_API lxrt_result lxrt_lightmap_sample(const lxrt_pack *pack, uint32_t page, float u, float v, float out_rgb[3]);

/// Where an instance keeps its light: uv_page = TEXCOORD_{texcoord} × scale + offset.
typedef struct lxrt_rect {
    uint32_t node;        ///< In scene.glb.
    int32_t gpu_instance; ///< Number within the node's EXT_mesh_gpu_instancing; -1 without.
    uint32_t page, texcoord;
    uint32_t x, y, width, height; ///< Texels of level 0.
    float scale[2], offset[2];
} lxrt_rect;
LXRT_API lxrt_result lxrt_get_rect(const lxrt_pack *pack, uint32_t index, lxrt_rect *out);
LXRT_API lxrt_result lxrt_find_rect(const lxrt_pack *pack, uint32_t node, int32_t gpu_instance, lxrt_rect *out);

/// What light came from. Several sources may share a layer: at run time a source shines with weight × c of its layer.
typedef struct lxrt_source {
    const char *name; ///< UTF-8; lies in the pack's data.
    uint32_t layer;
    lxrt_kind kind;
    float weight[3];
    uint32_t node;    ///< In scene.glb; LXRT_NONE for the sky.
    int32_t material; ///< In scene.glb; -1 unless the source is an emissive material.
} lxrt_source;
LXRT_API lxrt_result lxrt_get_source(const lxrt_pack *pack, uint32_t index, lxrt_source *out);

#ifdef __cplusplus
}
#endif
#endif
