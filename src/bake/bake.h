/// A bake in progress and its result, as the files of this folder share it.
#ifndef LX_BAKE_BAKE_H
#define LX_BAKE_BAKE_H

#include "bake/finished.h"
#include "luxel/bake.h"
#include "scene/atlas.h"
#include "trace/path.h"

/// What one vector of colours drives. Members: the sources whose lx_source_use.layer is this layer.
typedef struct lx_layer {
    char *name;          ///< Owned.
    lx_source_kind kind; ///< Of its first source.
    const char *node;    ///< Name of the first source's node ("" for the sky); borrowed from the scene.
    const char *unit;    ///< "cd", "lx", "nt" as in glTF and Khronos texts: candela, lux, nit.
    lx_light_mode mode;
    float color[3];      ///< c = color × intensity at authored strength.
    float intensity;
    uint32_t source_count;
    const lx_source *monitor; ///< Whose cell it is, the first of its monitors; NULL: none. Borrowed from the scene.
    uint32_t cell;            ///< Number of the cell.
    lx_rgb white;             ///< Monitors: c of a white pixel = white × intensity.
} lx_layer;

struct lx_bake {
    const lx_scene *scene; ///< Borrowed.
    const lx_atlas *atlas; ///< Borrowed.
    lx_bake_desc desc;     ///< Strings inside are borrowed from the caller.
    lx_tracer *tracer;

    lx_layer *layers;
    uint32_t layer_count;
    lx_source_use *uses;   ///< [source_count] per source of the tracer: its layer and its share of it (weight).
    uint32_t source_count;

    struct lx_bake_animations *animations; ///< What drives the layers (bake/animations.h); NULL: nothing.

    /// Chart that owns a texel, [page_count][page_size²], numbered over the whole atlas; LX_NO_CHART: empty. With dilation's claims.
    uint32_t *texel_chart;
    /// Share of a texel's square that surfaces cover, 0…255, [page_count][page_size²]; 0: none (padding or empty).
    uint8_t *texel_coverage;
    lx_finished *finished; ///< T of every layer, black until lx_bake_run. Unit light: lux per cd, lx or nt (for `combined`: lux).

    uint64_t created_bytes; ///< Resident size of the process when the bake was created.
    lx_bake_summary summary;
};

#endif
