/// Authoring keys (`luxel_…`) in the extras of nodes, lights and materials.
#ifndef LX_SCENE_GLTF_EXTRAS_H
#define LX_SCENE_GLTF_EXTRAS_H

#include "scene/gltf_json.h"
#include "scene/scene.h"

struct lx_gltf_reader;

typedef enum lx_area_shape { LX_AREA_NONE, LX_AREA_RECT, LX_AREA_DISK } lx_area_shape;

/// The keys of one object. What is not set can be completed from an object that ranks lower.
typedef struct lx_gltf_extras {
    const char *layer;             ///< In the scene's arena; NULL: not set.
    int8_t mode;                   ///< An lx_light_mode; -1: not set.
    int8_t is_static, transparent; ///< 0, 1; -1: not set.
    float density;                 ///< 0: not set.
    float radius;                  ///< As written: metres or degrees; -1: not set.
    lx_area_shape area;
    float area_width, area_height; ///< RECT: edges; DISK: radius in both.
    bool has_color, has_intensity;
    lx_rgb color;    ///< Linear.
    float intensity; ///< Nit.
    uint32_t monitor_columns, monitor_rows; ///< 0: not set.
    const lx_program *animate; ///< In the scene's arena; NULL: not set.
} lx_gltf_extras;

/// Where an object may stand; decides which keys make sense there.
typedef enum lx_extras_place {
    LX_EXTRAS_NODE = 1,
    LX_EXTRAS_LIGHT = 2,
    LX_EXTRAS_MATERIAL = 4,
    LX_EXTRAS_ELSEWHERE = 8
} lx_extras_place;

lx_gltf_extras lx_gltf_extras_unset(void);

/// Reads the luxel_ keys of object's extras. Unknown keys and values that make no sense get a warning.
lx_result lx_gltf_extras_read(struct lx_gltf_reader *reader, const lx_gltf_object *object, lx_extras_place place,
                              lx_gltf_extras *out, lx_error *error);

/// What `first` leaves open is taken from `second`.
lx_gltf_extras lx_gltf_extras_merge(lx_gltf_extras first, const lx_gltf_extras *second);

#endif
