/// Baking: irradiance in every texel of the atlas, one layer per light source or group.
#ifndef LUXEL_BAKE_H
#define LUXEL_BAKE_H

#include "luxel/atlas.h"

#ifdef __cplusplus
extern "C" {
#endif

#define LX_BOUNCES_INF UINT32_MAX ///< Paths are ended by Russian roulette alone: unbiased.

/// Light from outside the scene. All zero with a NULL file: no sky.
typedef struct lx_sky_desc {
    float color[3];      ///< Radiance in nit, linear Rec. 709. With a file: a tint. Default 0 (file: 1).
    const char *file;    ///< Equirectangular .hdr or .exr, 1.0 = 1 nit, row 0 at +Y, u = 1/2 + atan2(z, x) / 2 pi. NULL: one colour.
    float rotation_deg;  ///< About +Y.
    float intensity;     ///< Multiplies. Default 1.
} lx_sky_desc;

/// How light is followed. Shared by bakes, irradiance probes and path-traced pictures.
typedef struct lx_transport_desc {
    uint32_t bounces;       ///< 0: direct light only; LX_BOUNCES_INF. Default 8; bakes: LX_BOUNCES_INF. A finite number is the truncated series.
    bool coloured_shadows;  ///< Blended surfaces tint the light that passes. Default false.
    lx_sky_desc sky;
    uint32_t seed;          ///< Same seed, same bits, for any number of threads. Default 1.
} lx_transport_desc;

typedef enum lx_integrator {
    LX_INTEGRATOR_GATHER, ///< Fast: one gather ray serves all layers and all bounces (irradiance cache).
    LX_INTEGRATOR_PATH,   ///< The unbiased referee.
} lx_integrator;

typedef enum lx_denoiser {
    LX_DENOISE_NONE,
    LX_DENOISE_BUILTIN, ///< Guided by the estimate's own variance and by geometry.
    LX_DENOISE_OIDN,    ///< Intel Open Image Denoise, where its library is installed.
} lx_denoiser;

/// What to bake and how well. Fill with lx_bake_desc_default(), then change what you need.
typedef struct lx_bake_desc {
    lx_transport_desc transport;
    lx_integrator integrator; ///< Default LX_INTEGRATOR_GATHER.
    uint32_t samples;     ///< Per texel at most, 1 … 16 M: samples of each light source, with four gather rays for each; or paths. Error falls with 1/sqrt(n) or faster. Default 256.
    float noise;          ///< Gather: a tile of texels is done where each layer's standard error over max(texel, 1 % of the layer's mean), root mean
                          ///< square, is below it. 0: all samples are taken. Default 0.02.
    float interpolation;  ///< Gather: indirect light is interpolated between texels where that errs by at most this share of it, as distances of what is around
                          ///< tell. 0: nowhere. Default 0.02.
    double time_s;        ///< Gather: samples are added in rounds until this much time has passed; `samples` and `noise` count too. The result depends on
                          ///< the machine. 0 (default): no limit.
    uint64_t memory_bytes; ///< Gather: layers are baked in groups so that the process stays below it. 0 (default): no limit.
    const char *scratch_folder; ///< Where finished layers wait on disk if there is a memory limit. NULL (default): as TMPDIR says, else /var/tmp.
    lx_denoiser denoise;  ///< Gather only. Default LX_DENOISE_BUILTIN.
    bool combined;        ///< One layer with all sources at their authored colours. Default false.
    uint32_t max_layers;  ///< More sources are grouped by material, then by parent node. Default 64.
    bool direct_only;     ///< Leave out what bounces.
    bool indirect_only;   ///< Leave out what comes straight from a source.
} lx_bake_desc;

LX_API lx_transport_desc lx_transport_desc_default(void);
LX_API lx_bake_desc lx_bake_desc_default(void);

typedef struct lx_bake lx_bake;

/// Prepares a bake: layers, texels, ray tracing structures. Scene and atlas must outlive it.
LX_API lx_result lx_bake_create(const lx_scene *scene, const lx_atlas *atlas, const lx_bake_desc *desc, lx_bake **out_bake,
                                lx_error *error);
/// Traces and post-processes. Long: `progress` is called with the stages "luxels", "padding", then "bake" (path) or, for each
/// group of layers, "direct", "cache", "gather", "denoise"; false cancels.
LX_API lx_result lx_bake_run(lx_bake *bake, const lx_progress_sink *progress, lx_error *error);

typedef enum lx_lightmap_format {
    LX_LIGHTMAP_KTX2 = 1 << 0, ///< 2D array per page (at most 64 layers each), RGB9E5 or half, zstd.
    LX_LIGHTMAP_EXR = 1 << 1,  ///< One file per page and layer, 32-bit float (16 with LX_ENCODING_HALF), zip.
    LX_LIGHTMAP_HDR = 1 << 2,  ///< One Radiance RGBE file per page and layer.
} lx_lightmap_format;

typedef enum lx_encoding {
    LX_ENCODING_DEFAULT, ///< RGB9E5 in KTX2, 32-bit float in EXR.
    LX_ENCODING_RGB9E5,
    LX_ENCODING_HALF,
} lx_encoding;

typedef struct lx_save_desc {
    uint32_t formats;        ///< OR of lx_lightmap_format, besides the pack, which is always written. Default 0.
    lx_encoding encoding;
    bool preview;            ///< Render preview.png. Default true.
    bool report;             ///< Write report.html: a page that shows all there is to see. Default true.
    uint32_t preview_width;  ///< Default 960.
    uint32_t preview_height; ///< Default 540.
} lx_save_desc;

LX_API lx_save_desc lx_save_desc_default(void);

/// Checks early that `folder` can be (re)placed: its parent exists, and it is missing, empty or a baked folder.
LX_API lx_result lx_bake_check_folder(const char *folder, lx_error *error);
/// Writes scene.glb, luxel.json, luxel.pack and what `desc` (NULL: defaults) asks for into `folder`, all at once: the folder holds the old
/// or the new result, never a mixture. A folder that holds no luxel.json is never replaced.
LX_API lx_result lx_bake_save(lx_bake *bake, const char *folder, const lx_save_desc *desc, const lx_progress_sink *progress,
                              lx_error *error);
LX_API void lx_bake_destroy(lx_bake *bake);

/// What a baked folder costs at run time, in bytes (lxrt_get_budget says more).
typedef struct lx_budget {
    uint64_t ram;          ///< The pack, and the handle of the runtime.
    uint64_t accumulator;  ///< Beside it, if the sum of all pages is kept so that only changes are added.
    uint64_t gpu_composed; ///< One lightmap with mips as RGB9E5, composed on the CPU. Twice that in half floats.
    uint64_t gpu_layers;   ///< All layers with mips as RGB9E5, summed per pixel.
    uint64_t dense;        ///< The pack's texels if no block were absent.
} lx_budget;

/// Where the time went, in seconds.
typedef struct lx_stage_seconds {
    double import, unwrap, luxels, bake, post, save, preview;
    double direct, cache, gather, denoise; ///< Parts of `bake`; 0 where an integrator has no such stage.
} lx_stage_seconds;

typedef struct lx_bake_summary {
    uint32_t page_count, page_size, layer_count, source_count;
    uint64_t texel_count;  ///< Texels that are covered by a surface.
    uint64_t invalid_count; ///< Of them: inside solid geometry, filled from neighbours.
    float texels_per_m;
    float coverage;        ///< Covered share of all pages.
    uint64_t path_count, ray_count; ///< Rays of both kinds that were traced.
    float noise;           ///< Estimated relative standard error of the sum at authored colours before denoising, root mean square over valid texels (each over
                           ///< max(texel, 1 % of the mean)). 0: unknown (path).
    uint32_t group_count;  ///< Groups of layers that were baked one after the other.
    uint64_t predicted_bytes; ///< Peak memory of the process as predicted before the first ray.
    double seconds;        ///< lx_bake_run.
    lx_stage_seconds stages; ///< Those of saving after lx_bake_save.
    uint64_t pack_bytes;   ///< After lx_bake_save.
    lx_budget budget;      ///< After lx_bake_save.
    float view_ev;         ///< Exposure of the preview, after lx_bake_save with a preview.
} lx_bake_summary;

LX_API void lx_bake_get_summary(const lx_bake *bake, lx_bake_summary *out);

/// Path-traced irradiance (lux; linear Rec. 709) at authored colours at `count` points. `positions` and `normals` are xyz triples in
/// world space; normals need not have unit length. `out_rgb` has 3 * count floats. The points are free: no push-off is applied.
LX_API lx_result lx_irradiance(const lx_scene *scene, const lx_transport_desc *transport, uint32_t samples, const float *positions,
                               const float *normals, size_t count, const lx_progress_sink *progress, float *out_rgb,
                               lx_error *error);

#ifdef __cplusplus
}
#endif
#endif
