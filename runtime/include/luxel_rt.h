/// luxel_rt: baked light at run time. Reads luxel.pack and sums its layers at any colours.
///
/// One vector of colours drives everything: E = Σ c_i T_i, where T_i is what layer i sends everywhere at unit strength, all bounces
/// included. Needs libc and libm; allocates nothing, reads no files, has no globals and no locks. The caller owns all memory; any
/// number of packs can be open side by side.
///
/// A frame has two halves. First one thread says what shines: lxrt_set_layer, lxrt_monitor_update, or lxrt_update, which asks every
/// layer's driver. Then any number of threads may read at once: lxrt_compose, lxrt_lightmap_sample. Functions that take a
/// `const lxrt_pack *` only read; calls that take a non-const one must not overlap with any other call on the same pack.
///
///     size_t bytes;
///     lxrt_pack *pack;
///     if (lxrt_memory_bytes(data, size, &bytes) == LXRT_OK && lxrt_open(data, size, malloc(bytes), bytes, &pack) == LXRT_OK) {
///         lxrt_set_layer(pack, lxrt_find_layer(pack, "desk lamp"), (const float[3]){0, 0.5f, 1}, 80);
///         lxrt_compose(pack, &(lxrt_region){0, 0, 0, 0, n, n}, &(lxrt_target){texels, 0, LXRT_FORMAT_RGB9E5, 1});
///     }
///
/// The same source compiles to WebAssembly and gives the same bits there: what reaches a texel or a layer's colour uses only
/// + − × ÷ √, comparisons, integers and tables.
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

/// Checks the pack and tells how much memory lxrt_open needs for it (about 100 bytes a layer). No alignment is asked of `data`.
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
    uint32_t animation_count;
    uint32_t monitor_count;
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

/// Sets c of a layer = rgb × intensity: linear Rec. 709, in the layer's unit (cd, lx or nit). Black costs nothing later on.
/// LXRT_ERROR_INVALID_ARGUMENT, and nothing changes, if a channel is not finite or too large to be summed (10^27).
LXRT_API lxrt_result lxrt_set_layer(lxrt_pack *pack, uint32_t layer, const float rgb[3], float intensity);
/// The same by name; LXRT_ERROR_NOT_FOUND if no layer has it.
LXRT_API lxrt_result lxrt_set_layer_named(lxrt_pack *pack, const char *name, const float rgb[3], float intensity);
/// c of a layer now.
LXRT_API lxrt_result lxrt_get_layer(const lxrt_pack *pack, uint32_t layer, float out_rgb[3]);

// ---- compose: E = Σ c T for rectangles of texels -------------------------------------------------------------------------------

/// How composed texels are written. Values are irradiance in lux times lxrt_target.scale.
typedef enum lxrt_format {
    LXRT_FORMAT_RGB32F,  ///< 12 bytes: three floats.
    LXRT_FORMAT_RGBA16F, ///< 8 bytes: four halves, alpha 1. Rounded to nearest even, clamped to ±65504.
    LXRT_FORMAT_RGB9E5,  ///< 4 bytes: shared exponent (docs/pack-format.md). Clamped to 0…65408; 1/512 of the largest channel.
} lxrt_format;
/// Bytes of one texel.
LXRT_API size_t lxrt_format_bytes(lxrt_format format);

/// A rectangle of texels of one mip level of one page; (0, 0) is where row 0 begins.
typedef struct lxrt_region {
    uint32_t page, level, x, y, width, height;
} lxrt_region;

/// Where composed texels go: caller's memory.
typedef struct lxrt_target {
    void *texels;       ///< Of the region's first texel. Aligned to the format's channel (4, 2 or 4 bytes).
    size_t row_bytes;   ///< From row to row; 0: width × lxrt_format_bytes.
    lxrt_format format;
    float scale;        ///< Multiplies E before it is encoded, so that very bright or dark scenes fit halves; 1 for lux. Must be > 0.
} lxrt_target;

/// Irradiance of a region at the current colours. Layers are added in their order, whatever the region and the processor: the same
/// texel always gets the same bits. Absent blocks and black layers cost nothing. Split a page into regions to use several threads.
LXRT_API lxrt_result lxrt_compose(const lxrt_pack *pack, const lxrt_region *region, const lxrt_target *target);

/// Keeps the sum of one page's layers between frames and adds only what changed: unchanged layers cost nothing.
///
/// After lxrt_accumulator_begin, every level's region from lxrt_accumulator_bounds is handed to lxrt_accumulator_update, in parts
/// on block borders (multiples of 32 texels, or the page's edge) and by as many threads as one likes. Targets must keep what
/// earlier updates wrote: blocks in which nothing changed are skipped. The first begin asks for all of it, and so does every 64th
/// after a change, so that rounding does not pile up: until then the result is within some roundings of lxrt_compose, from then on,
/// if nothing changes any more, it is the same to the bit.
typedef struct lxrt_accumulator lxrt_accumulator;
/// Memory for the accumulator of one page: 12 bytes a texel of whole blocks, all mip levels, and some dozen bytes a layer.
LXRT_API size_t lxrt_accumulator_bytes(const lxrt_pack *pack);
LXRT_API lxrt_result lxrt_accumulator_create(const lxrt_pack *pack, uint32_t page, void *memory, size_t memory_bytes,
                                             lxrt_accumulator **out_accumulator);
/// Notes the colours of now; what was begun before must be updated whole. Returns how many layers changed on this page, at
/// least 1 when all of it is asked for; 0: nothing to do.
LXRT_API uint32_t lxrt_accumulator_begin(lxrt_accumulator *accumulator);
/// Makes the next begin ask for the whole page, e.g. when targets were lost.
LXRT_API void lxrt_accumulator_reset(lxrt_accumulator *accumulator);
/// The smallest rectangle of whole blocks that holds all changes of this update on a level; width 0: none.
LXRT_API lxrt_result lxrt_accumulator_bounds(const lxrt_accumulator *accumulator, uint32_t level, lxrt_region *out);
/// Adds and writes a part of the page. Each block once between two begins. Several threads may work on different blocks.
LXRT_API lxrt_result lxrt_accumulator_update(lxrt_accumulator *accumulator, const lxrt_region *region, const lxrt_target *target);

typedef enum lxrt_filter {
    LXRT_FILTER_BILINEAR,
    LXRT_FILTER_BICUBIC, ///< Cubic B-spline: smooth, slightly blurred. Reads 4 × 4 texels; wants a padding of 2 or more.
} lxrt_filter;

/// Irradiance at a point of a page (level 0), clamped at the edges. (0, 0) is the corner where row 0 begins. NaN counts as 0.
LXRT_API lxrt_result lxrt_lightmap_sample(const lxrt_pack *pack, uint32_t page, float u, float v, lxrt_filter filter, float out_rgb[3]);

/// What a pack costs, in bytes.
typedef struct lxrt_budget {
    uint64_t pack_bytes;        ///< The file in memory.
    uint64_t handle_bytes;      ///< lxrt_memory_bytes.
    uint64_t accumulator_bytes; ///< Accumulators of all pages, if they are used.
    uint64_t gpu_composed_bytes; ///< All pages with mips as RGB9E5: the way of composing on the CPU. Twice that as RGBA16F.
    uint64_t gpu_layers_bytes;  ///< All layers of all pages with mips as RGB9E5: the way of summing per pixel.
    uint64_t dense_bytes;       ///< What the blocks would take if none were absent.
} lxrt_budget;
LXRT_API void lxrt_get_budget(const lxrt_pack *pack, lxrt_budget *out);

// ---- drivers: what sets the colours each frame ------------------------------------------------------------------------------------

typedef enum lxrt_program_kind {
    LXRT_PROGRAM_CONSTANT, ///< color × intensity.
    LXRT_PROGRAM_KEYS,     ///< Keyframes.
    LXRT_PROGRAM_BLINK,    ///< `high` for the first `duty` of each period, then `low`.
    LXRT_PROGRAM_FLICKER,  ///< Smooth noise between `low` and `high`, a new value every period: flames, tired tubes.
    LXRT_PROGRAM_PULSE,    ///< Raised cosine: `low` at the period's start, `high` in its middle.
    LXRT_PROGRAM_WHEEL,    ///< Turns the hue once a period, from that of `color` on, keeping saturation, value, intensity. White has none to turn.
    LXRT_PROGRAM_SCHEDULE, ///< Keys as steps, fading for `fade_s` into each; repeats every period (24 h: 86400 s).
} lxrt_program_kind;

typedef enum lxrt_interpolation { LXRT_STEP, LXRT_LINEAR, LXRT_CUBIC } lxrt_interpolation; ///< As glTF's STEP, LINEAR, CUBICSPLINE.

/// A layer's colour as a function of time; formulas: docs/drivers.md. Fill with lxrt_program_default(), then change what you need.
/// BLINK, FLICKER, PULSE multiply color × intensity by a factor from low to high.
typedef struct lxrt_program {
    lxrt_program_kind kind;
    float color[3], intensity; ///< Default white, 1.
    float period_s;  ///< > 0. Default 1.
    float phase_s;   ///< Added to the time. Default 0.
    float duty;      ///< 0…1. Default 0.5.
    float low, high; ///< Default 0 and 1.
    float fade_s;    ///< SCHEDULE. Default 0.
    uint32_t seed;   ///< FLICKER: equal seeds flicker alike. Default 0.
    const float *keys; ///< KEYS, SCHEDULE: key_count × {time_s, r, g, b} with c in rgb, times ascending; LXRT_CUBIC: {time_s, in-tangent
                       ///< rgb, value rgb, out-tangent rgb}. Borrowed for as long as the program is set.
    uint32_t key_count;
    lxrt_interpolation interpolation; ///< KEYS. Default LXRT_LINEAR. Held before the first and after the last key, unless `loop`.
    int loop;                         ///< KEYS: repeats from the last key's time. Default 1.
} lxrt_program;
LXRT_API lxrt_program lxrt_program_default(void);
/// c at a time. LXRT_ERROR_INVALID_ARGUMENT if the program makes no sense (a period of 0, keys out of order, not finite).
LXRT_API lxrt_result lxrt_program_evaluate(const lxrt_program *program, double time_s, float out_rgb[3]);

/// Lets a program drive a layer; it is copied (its keys are not). NULL: nothing drives the layer any more, it keeps its colour.
LXRT_API lxrt_result lxrt_set_program(lxrt_pack *pack, uint32_t layer, const lxrt_program *program);
/// Lets the engine's own light drive a layer: `read` is called by lxrt_update and fills c (colour × intensity in the layer's unit),
/// which holds the colour of now on entry. NULL: nothing drives the layer.
typedef void (*lxrt_read_light)(void *user, uint32_t layer, double time_s, float rgb[3]);
LXRT_API lxrt_result lxrt_set_callback(lxrt_pack *pack, uint32_t layer, lxrt_read_light read, void *user);
/// Lets the pack's own animations drive the layer again, as they do after lxrt_open. Where there are none the layer gets its authored colour.
LXRT_API lxrt_result lxrt_reset_driver(lxrt_pack *pack, uint32_t layer);

/// An animation of the pack: baked from `luxel_animate` keys and from the scene's own animations of lights and emissive materials.
typedef struct lxrt_animation {
    const char *name;      ///< UTF-8; "" for `luxel_animate`. Tracks of one glTF animation share its name.
    uint32_t layer;
    lxrt_program_kind kind;
    float duration_s;      ///< Of keys; the period of others.
    uint32_t playing;      ///< 1 at first.
} lxrt_animation;
LXRT_API lxrt_result lxrt_get_animation(const lxrt_pack *pack, uint32_t index, lxrt_animation *out);
/// Starts or stops all animations of a name (NULL: all). A layer whose animations have all been stopped keeps its colour.
LXRT_API lxrt_result lxrt_play(lxrt_pack *pack, const char *name, int playing);

/// Asks every layer's driver for its colour at a time. Returns how many layers changed. The result depends on the time alone, not on
/// earlier calls (callbacks apart).
LXRT_API uint32_t lxrt_update(lxrt_pack *pack, double time_s);

// ---- monitors: screens whose cells are layers -------------------------------------------------------------------------------------

typedef struct lxrt_monitor {
    const char *name;       ///< UTF-8; lies in the pack's data.
    uint32_t node;          ///< In scene.glb.
    int32_t material;       ///< In scene.glb: what shows the picture.
    uint32_t columns, rows;
    uint32_t first_layer;   ///< Cell k = row × columns + column is layer first_layer + k; cell 0 is at TEXCOORD_0 = (0, 0), the picture's top left.
    float strength[3];      ///< Radiance (nit) of a white pixel; authored at first.
} lxrt_monitor;
LXRT_API lxrt_result lxrt_get_monitor(const lxrt_pack *pack, uint32_t index, lxrt_monitor *out);

typedef enum lxrt_pixels {
    LXRT_PIXELS_RGBA8_SRGB,   ///< 4 bytes; alpha is ignored.
    LXRT_PIXELS_RGB8_SRGB,    ///< 3 bytes.
    LXRT_PIXELS_RGBA32F,      ///< 4 linear floats; alpha is ignored.
} lxrt_pixels;

/// Shows a picture: c of cell k = strength × mean of the linear pixels in it, exact by area for any size of picture (pixels that lie in
/// two cells count in both by their share). `pixels`: row 0 is the top; `stride` bytes from row to row (0: tight). Pixels that are not
/// finite count as 0. Cells are shared where several monitors share their layers: the last update wins.
LXRT_API lxrt_result lxrt_monitor_update(lxrt_pack *pack, uint32_t monitor, const void *pixels, uint32_t width, uint32_t height,
                                         size_t stride, lxrt_pixels format);
/// `strength`: radiance (nit) of a white pixel from the next update on; NULL keeps it. `smoothing` in [0, 1): how much of the old colour
/// an update keeps, against flicker (0 at first).
LXRT_API lxrt_result lxrt_monitor_configure(lxrt_pack *pack, uint32_t monitor, const float strength[3], float smoothing);

// ---- what is where ------------------------------------------------------------------------------------------------------------------

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
