/// Accessors: typed arrays in the file's buffers, any component type, normalised, strided, sparse.
#ifndef LX_SCENE_GLTF_ACCESSORS_H
#define LX_SCENE_GLTF_ACCESSORS_H

#include "scene/gltf_reader.h"

typedef struct lx_gltf_sparse {
    uint32_t count, index_type;
    uint32_t index_view, value_view;
    size_t index_offset, value_offset;
} lx_gltf_sparse;

/// What the JSON says, checked against the sizes of the views but without their bytes.
typedef struct lx_gltf_accessor {
    lx_gltf_object object;
    uint32_t count;
    uint32_t components;     ///< 1 … 4, or 4, 9, 16 for matrices.
    uint32_t component_type; ///< 5120 …
    uint32_t component_size; ///< Bytes.
    bool matrix, normalized;
    int32_t view; ///< -1: zeros.
    size_t offset, stride, element_size;
    lx_gltf_sparse sparse; ///< count 0: none.
} lx_gltf_accessor;

/// Checks every accessor of the file.
lx_result lx_gltf_check_accessors(lx_gltf_reader *reader, lx_error *error);

lx_result lx_gltf_get_accessor(const lx_gltf_reader *reader, uint32_t index, lx_gltf_accessor *out, lx_error *error);

/// Calls `func` with the bytes of each element, in order: dense ones first, then those that a sparse accessor puts in
/// their place.
typedef lx_result (*lx_gltf_element_func)(void *user, const lx_gltf_accessor *accessor, uint32_t element,
                                          const uint8_t *bytes, lx_error *error);
lx_result lx_gltf_visit_elements(lx_gltf_reader *reader, const lx_gltf_accessor *accessor, lx_gltf_element_func func,
                                 void *user, lx_error *error);

/// Its elements as floats, count × components of them, in a fresh array. Integers become 0…1 or -1…1 where the accessor
/// is normalised, else their own value. NaN and infinity are refused.
lx_result lx_gltf_read_floats(lx_gltf_reader *reader, const lx_gltf_accessor *accessor, float **out, lx_error *error);

/// Its elements as vertex indices below `limit`, in a fresh array.
lx_result lx_gltf_read_indices(lx_gltf_reader *reader, const lx_gltf_accessor *accessor, uint32_t limit, uint32_t **out,
                               lx_error *error);

#endif
