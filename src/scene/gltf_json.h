/// Typed access to the JSON of a glTF file. Every problem is told with the words a person finds the object by:
/// "node 12 'lamp'", "mesh 3 'room' primitive 0".
#ifndef LX_SCENE_GLTF_JSON_H
#define LX_SCENE_GLTF_JSON_H

#include "luxel/base.h"

#include <jansson.h>

/// A JSON object of the file and what messages call it. `json` NULL: the object is absent, and so is all that is asked
/// of it.
typedef struct lx_gltf_object {
    json_t *json;
    char label[192];
} lx_gltf_object;

/// Parses UTF-8 JSON whose root is an object. Nesting is limited; a byte order mark and trailing zero bytes are
/// forgiven.
lx_result lx_gltf_json_parse(const char *text, size_t size, json_t **out_root, lx_error *error);

/// The object `json` called "KIND INDEX" or "KIND INDEX 'NAME'".
lx_gltf_object lx_gltf_object_of(json_t *json, const char *kind, uint32_t index);
/// The object `json` inside `parent`, called "PARENT WHAT".
lx_gltf_object lx_gltf_object_inside(const lx_gltf_object *parent, json_t *json, const char *what);
/// The extension of that name; json NULL if the object has none.
lx_gltf_object lx_gltf_extension(const lx_gltf_object *object, const char *name);

// What is absent leaves the default that the caller put into *value, and NULL, 0 or -1 in pointers, counts and indices.
// What is there but of the wrong type is LX_ERROR_FORMAT.
lx_result lx_gltf_get_object(const lx_gltf_object *object, const char *key, lx_gltf_object *out, lx_error *error);
lx_result lx_gltf_get_array(const lx_gltf_object *object, const char *key, json_t **out, uint32_t *count,
                            lx_error *error);
lx_result lx_gltf_get_string(const lx_gltf_object *object, const char *key, const char **value, lx_error *error);
lx_result lx_gltf_get_bool(const lx_gltf_object *object, const char *key, bool *value, lx_error *error);
lx_result lx_gltf_get_float(const lx_gltf_object *object, const char *key, float *value, lx_error *error);
/// Exactly `count` finite numbers. `present` may be NULL.
lx_result lx_gltf_get_floats(const lx_gltf_object *object, const char *key, float *values, uint32_t count,
                             bool *present, lx_error *error);
/// A whole number from 0 to 2^53.
lx_result lx_gltf_get_size(const lx_gltf_object *object, const char *key, uint64_t *value, lx_error *error);
/// A whole number below `count`, or -1 if absent.
lx_result lx_gltf_get_index(const lx_gltf_object *object, const char *key, uint32_t count, int32_t *index,
                            lx_error *error);
/// The same for a JSON value that is at hand (an array's element); `what` is for the message.
lx_result lx_gltf_index_of(const lx_gltf_object *object, const json_t *value, const char *what, uint32_t count,
                           uint32_t *index, lx_error *error);

#endif
