/// luxel.json: what is in a baked folder, for people and tools. The schema is docs/luxel.schema.json.
#ifndef LX_STORE_MANIFEST_H
#define LX_STORE_MANIFEST_H

#include "base/file.h"
#include "base/memory.h"
#include "luxel/bake.h"

enum { lx_manifest_version = 1 };

typedef struct lx_manifest_page {
    uint32_t width, height;
    float coverage; ///< Covered share, 0…1.
} lx_manifest_page;

typedef struct lx_manifest_layer {
    const char *name;
    const char *kind; ///< "point", "spot", "directional", "rect", "disk", "emissive", "sky", "combined".
    const char *node; ///< Of its first source; "" for the sky.
    const char *unit; ///< "cd", "lx", "nt".
    const char *mode; ///< "baked" or "mixed".
    float color[3], intensity; ///< c = color × intensity, authored.
    float scale; ///< KTX2 texels × scale = lux per unit light. Almost always 1 and left out then: only what is far too dark or bright
                 ///< for half floats is scaled. (The pack has scales of its own; EXR and HDR hold physical values.)
} lx_manifest_layer;

typedef struct lx_manifest_file {
    uint32_t page;
    uint32_t layer;     ///< The one it holds; of an array: of its first slice, the others follow.
    const char *format; ///< "ktx2", "exr", "hdr".
    const char *file;
} lx_manifest_file;

typedef struct lx_manifest_sky {
    const char *file; ///< Equirectangular picture; its radiance × color × intensity is the authored sky.
    float color[3], rotation_deg, intensity;
} lx_manifest_sky;

typedef struct lx_manifest_monitor {
    const char *name;
    uint32_t node;          ///< In the scene file.
    int32_t material;       ///< Likewise; -1: none.
    uint32_t columns, rows; ///< Cell k = row × columns + column is layer first_layer + k.
    uint32_t first_layer;
    float strength[3];      ///< c of a white pixel, nit.
} lx_manifest_monitor;

typedef struct lx_manifest_animation {
    const char *name;    ///< Of the file's animation; "": `luxel_animate`.
    uint32_t layer;
    const char *program; ///< "keys", "blink", "flicker", "pulse", "wheel", "schedule", "constant".
    const char *channel; ///< "light": colour × intensity. "color", "intensity".
    float duration_s;    ///< Of keys; the period of others.
} lx_manifest_animation;

typedef struct lx_manifest_bake {
    uint32_t samples, bounces; ///< LX_BOUNCES_INF is written as "inf".
    const char *integrator; ///< "gather", "path".
    const char *denoise;    ///< "none", "builtin", "oidn".
    float noise;            ///< Estimated relative standard error before denoising; 0: not known, and not written.
    uint32_t seed;
    const char *isa;
    double seconds;
    lx_stage_seconds stages;
    uint32_t threads;
} lx_manifest_bake;

/// Strings are never NULL unless said so, and borrowed when writing; a manifest that was read owns them in `strings`.
typedef struct lx_manifest {
    const char *generator;
    const char *scene; ///< File name; NULL: none.
    const char *pack;
    uint32_t padding;
    float texels_per_m;
    lx_manifest_page *pages; ///< Arrays are owned.
    lx_manifest_layer *layers;
    lx_manifest_file *files;
    lx_manifest_monitor *monitors;
    lx_manifest_animation *animations;
    uint32_t page_count, layer_count, file_count, monitor_count, animation_count;
    bool has_sky, has_view;
    bool has_report; ///< report.html is in the folder. Not read: nobody but the viewer asks.
    lx_manifest_sky sky;
    float view_ev;
    lx_budget memory; ///< All 0: not known, and not written. Not read: the pack says it.
    lx_manifest_bake bake;
    uint64_t scene_hash, pack_hash; ///< lx_content_hash; 0: not known.
    lx_arena strings;
} lx_manifest;

void lx_manifest_release(lx_manifest *manifest);

/// FNV-1a of a file's bytes, never 0.
uint64_t lx_content_hash(const void *data, size_t size);
/// The same piece by piece: start, add …, end.
#define LX_CONTENT_HASH_START 0xcbf29ce484222325u
uint64_t lx_content_hash_add(uint64_t hash, const void *data, size_t size);
uint64_t lx_content_hash_end(uint64_t hash);

/// True if `path` is relative and stays below the folder it starts from: no "..", no backslash, no drive, nothing empty.
bool lx_path_stays_inside(const char *path);

/// JSON text, indented, ending in a newline; owned by the caller (lx_free). `sizes` (may be NULL) adds "sizes": bytes of each file
/// named in the manifest, in the order scene, pack, files; 0 leaves one out.
lx_result lx_manifest_write(const lx_manifest *manifest, const uint64_t *sizes, char **out_text, lx_error *error);

/// The same text without what it says of lightmap files, for a copy of the folder that leaves them out. What it holds besides stays, known or not.
/// Owned by the caller (lx_free).
lx_result lx_manifest_drop_files(const char *text, size_t size, char **out_text, lx_error *error);

/// Reads what lx_manifest_write writes; unknown fields are ignored. Hostile text gives an error that names the field.
lx_result lx_manifest_read(const char *text, size_t size, lx_manifest *out, lx_error *error);

#endif
