/// Writes luxel.pack, the file of the runtime (docs/pack-format.md), image by image. It is read by runtime/.
#ifndef LX_STORE_PACK_H
#define LX_STORE_PACK_H

#include "base/file.h"
#include "luxel_rt.h"
#include "scene/scene.h"

enum { lx_pack_kind_combined = LX_SOURCE_SKY + 1 }; ///< A layer of all sources at their authored colours.

typedef struct lx_pack_layer {
    const char *name;
    uint32_t kind;       ///< lx_source_kind of its first source, or lx_pack_kind_combined.
    lx_light_mode mode;
    float color[3];      ///< Authored; c = color × intensity.
    float intensity;
    float scale;         ///< Power of two; lx_pack_scale.
    float threshold;     ///< Blocks with no channel of that or more, in lux per unit light, are left out.
} lx_pack_layer;

typedef struct lx_pack_source {
    const char *name;
    lx_source_kind kind;
    uint32_t layer;
    float weight[3];  ///< The source shines with weight × c.
    uint32_t node;    ///< In the file; UINT32_MAX: the sky.
    int32_t material; ///< In the file; -1: not an emissive material.
} lx_pack_source;

typedef struct lx_pack_rect {
    uint32_t node;        ///< In the file.
    int32_t gpu_instance; ///< -1: none.
    uint32_t page, texcoord, x, y, width, height;
    float scale[2], offset[2];
} lx_pack_rect;

typedef struct lx_pack_monitor {
    const char *name;
    uint32_t node;    ///< In the file.
    int32_t material; ///< In the file; -1: none.
    uint32_t columns, rows;
    uint32_t first_layer; ///< Of cell 0; the others follow row by row.
    float strength[3];    ///< Radiance (nit) of a white pixel.
} lx_pack_monitor;

/// What an animation's values are.
typedef enum lx_pack_channel {
    LX_PACK_CHANNEL_WHOLE,     ///< c itself: colour × intensity.
    LX_PACK_CHANNEL_COLOR,     ///< The colour, with the layer's authored intensity. Of LXRT_PROGRAM_KEYS alone.
    LX_PACK_CHANNEL_INTENSITY, ///< The intensity, with the layer's authored colour. Of LXRT_PROGRAM_KEYS alone.
} lx_pack_channel;

typedef struct lx_pack_animation {
    const char *name; ///< "" for `luxel_animate`.
    uint32_t layer;
    lx_pack_channel channel;
    /// Start from lxrt_program_default: every field must make sense, also those that the kind has no use for. With
    /// LX_PACK_CHANNEL_INTENSITY a value in `keys` is one number instead of three: {time_s, value}, or with LXRT_CUBIC
    /// {time_s, in-tangent, value, out-tangent}.
    lxrt_program program;
} lx_pack_animation;

/// Numbers from one key of an animation to the next: its time and its value, with cubic interpolation two tangents more.
uint32_t lx_pack_key_stride(const lx_pack_animation *animation);

#define LX_PACK_MOST_LIGHT 1e27f ///< The largest channel of a colour, or of a monitor's strength, that the runtime sums.

/// Everything but the texels. Arrays are borrowed during lx_pack_begin alone.
typedef struct lx_pack_desc {
    uint32_t page_size, page_count, level_count;
    const float *page_coverage; ///< [page_count], 0…1; NULL: 0.
    const lx_pack_layer *layers;
    uint32_t layer_count;
    const lx_pack_source *sources;
    uint32_t source_count;
    const lx_pack_rect *rects; ///< In any order, but no (node, gpu_instance) twice.
    uint32_t rect_count;
    const lx_pack_monitor *monitors;
    uint32_t monitor_count;
    const lx_pack_animation *animations; ///< Where several play at once on a layer the last wins.
    uint32_t animation_count;
} lx_pack_desc;

typedef struct lx_pack_stats {
    uint64_t block_count, absent_count;
    /// Largest error of a stored texel relative to its largest channel, over texels that RGB9E5 holds with its full precision
    /// (the 30 octaves below the layer's brightest). At most 1/512.
    float largest_error;
    uint64_t bytes, hash; ///< Of the whole file; the hash as lx_content_hash, of packs that went to a file.
} lx_pack_stats;

/// The scale for a layer whose largest channel anywhere is `largest`: that becomes 2^14 … 2^15. 1 for a black layer.
float lx_pack_scale(float largest);
/// ⌊log2 padding⌋ + 1, and never a level without texels.
uint32_t lx_pack_level_count(uint32_t page_size, uint32_t padding);

typedef struct lx_pack_writer lx_pack_writer;

lx_result lx_pack_begin(const lx_pack_desc *desc, lx_pack_writer **out_writer, lx_error *error);
/// The same into a new file at `path`, block by block: only tables are in memory.
lx_result lx_pack_begin_file(const lx_pack_desc *desc, const char *path, lx_pack_writer **out_writer, lx_error *error);
/// One layer of one mip level of a page: (page_size >> level)² RGB floats, row 0 first. Images may come in any order, each at most
/// once; those that don't come are black.
lx_result lx_pack_add_image(lx_pack_writer *writer, uint32_t page, uint32_t layer, uint32_t level, const float *rgb, lx_error *error);
/// The finished file, or nothing where it was written by lx_pack_begin_file; the writer is left empty, good for lx_pack_destroy alone.
/// `out_stats` may be NULL.
lx_result lx_pack_finish(lx_pack_writer *writer, lx_bytes *out, lx_pack_stats *out_stats, lx_error *error);
void lx_pack_destroy(lx_pack_writer *writer);

#endif
