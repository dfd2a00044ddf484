// Accessors: typed arrays in the file's buffers.
#include "scene/gltf_accessors.h"

#include "base/error.h"

#include <math.h>
#include <string.h>

enum { type_i8 = 5120, type_u8 = 5121, type_i16 = 5122, type_u16 = 5123, type_u32 = 5125, type_f32 = 5126 };

static uint32_t size_of_type(uint64_t component_type)
{
    switch (component_type) {
    case type_i8:
    case type_u8:
        return 1;
    case type_i16:
    case type_u16:
        return 2;
    case type_u32:
    case type_f32:
        return 4;
    default:
        return 0;
    }
}

static lx_result read_type(const lx_gltf_object *object, lx_gltf_accessor *out, lx_error *error)
{
    static const struct {
        const char *name;
        uint32_t components, columns;
    } types[] = {{"SCALAR", 1, 1}, {"VEC2", 2, 1}, {"VEC3", 3, 1}, {"VEC4", 4, 1},
                 {"MAT2", 4, 2},   {"MAT3", 9, 3}, {"MAT4", 16, 4}};
    lx_result result = LX_OK;
    const char *type = NULL;
    uint64_t component_type = 0;
    LX_TRY(lx_gltf_get_string(object, "type", &type, error));
    LX_TRY(lx_gltf_get_size(object, "componentType", &component_type, error));
    out->component_size = size_of_type(component_type);
    if (out->component_size == 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown componentType %llu", object->label,
                       (unsigned long long)component_type);
    out->component_type = (uint32_t)component_type;
    for (size_t i = 0; type && i < sizeof types / sizeof *types; ++i) {
        if (strcmp(type, types[i].name) != 0) continue;
        out->components = types[i].components;
        out->matrix = types[i].columns > 1;
        // Columns of matrices start at multiples of 4 bytes.
        const size_t column = types[i].components / types[i].columns * out->component_size;
        out->element_size = out->matrix ? types[i].columns * ((column + 3) / 4 * 4) : column;
        return LX_OK;
    }
    return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown type '%.20s'", object->label, type ? type : "");
cleanup:
    return result;
}

// True if `count` elements of `size` bytes, `stride` apart, fit into a view from `offset` on.
static bool fits(const lx_gltf_view *view, size_t offset, uint32_t count, size_t stride, size_t size)
{
    if (offset > view->size) return false;
    if (count == 0) return true;
    const size_t room = view->size - offset;
    return size <= room && (count - 1) <= (room - size) / stride;
}

static lx_result out_of_view(const lx_gltf_object *object, uint32_t count, int32_t view, size_t size, lx_error *error)
{
    return lx_fail(error, LX_ERROR_FORMAT, "%s: %u elements do not fit into bufferView %d (%zu bytes)", object->label,
                   count, view, size);
}

static lx_result read_sparse(const lx_gltf_reader *reader, const lx_gltf_object *object, lx_gltf_accessor *out,
                             lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object sparse, indices, values;
    uint64_t count = 0, type = 0, index_offset = 0, value_offset = 0;
    int32_t index_view, value_view;
    LX_TRY(lx_gltf_get_object(object, "sparse", &sparse, error));
    if (!sparse.json) return LX_OK;
    LX_TRY(lx_gltf_get_size(&sparse, "count", &count, error));
    LX_TRY(lx_gltf_get_object(&sparse, "indices", &indices, error));
    LX_TRY(lx_gltf_get_object(&sparse, "values", &values, error));
    LX_TRY(lx_gltf_get_index(&indices, "bufferView", reader->counts[LX_GLTF_VIEW], &index_view, error));
    LX_TRY(lx_gltf_get_index(&values, "bufferView", reader->counts[LX_GLTF_VIEW], &value_view, error));
    LX_TRY(lx_gltf_get_size(&indices, "componentType", &type, error));
    LX_TRY(lx_gltf_get_size(&indices, "byteOffset", &index_offset, error));
    LX_TRY(lx_gltf_get_size(&values, "byteOffset", &value_offset, error));
    if (count > out->count)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: count %llu is more than the accessor's %u", sparse.label,
                       (unsigned long long)count, out->count);
    if (index_view < 0 || value_view < 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: no bufferView", index_view < 0 ? indices.label : values.label);
    if (type != type_u8 && type != type_u16 && type != type_u32)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown componentType %llu", indices.label,
                       (unsigned long long)type);
    const size_t index_size = size_of_type(type);
    if (!fits(&reader->views[index_view], (size_t)index_offset, (uint32_t)count, index_size, index_size))
        return out_of_view(&indices, (uint32_t)count, index_view, reader->views[index_view].size, error);
    if (!fits(&reader->views[value_view], (size_t)value_offset, (uint32_t)count, out->element_size, out->element_size))
        return out_of_view(&values, (uint32_t)count, value_view, reader->views[value_view].size, error);
    out->sparse = (lx_gltf_sparse){(uint32_t)count,      (uint32_t)type,       (uint32_t)index_view,
                                   (uint32_t)value_view, (size_t)index_offset, (size_t)value_offset};
cleanup:
    return result;
}

lx_result lx_gltf_get_accessor(const lx_gltf_reader *reader, uint32_t index, lx_gltf_accessor *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    uint64_t count = 0, offset = 0;
    *out = (lx_gltf_accessor){0};
    LX_TRY(lx_gltf_element(reader, LX_GLTF_ACCESSOR, index, &object, error));
    out->object = object;
    LX_TRY(read_type(&object, out, error));
    LX_TRY(lx_gltf_get_size(&object, "count", &count, error));
    LX_TRY(lx_gltf_get_size(&object, "byteOffset", &offset, error));
    LX_TRY(lx_gltf_get_bool(&object, "normalized", &out->normalized, error));
    LX_TRY(lx_gltf_get_index(&object, "bufferView", reader->counts[LX_GLTF_VIEW], &out->view, error));
    if (count > INT32_MAX)
        return lx_fail(error, LX_ERROR_LIMIT, "%s: count %llu is too large", object.label, (unsigned long long)count);
    out->count = (uint32_t)count;
    out->offset = (size_t)offset;
    out->stride = out->element_size;
    if (out->view >= 0) {
        const lx_gltf_view *view = &reader->views[out->view];
        if (view->stride) out->stride = view->stride;
        if (out->stride < out->element_size)
            return lx_fail(error, LX_ERROR_FORMAT, "%s: byteStride %zu is less than its elements' %zu bytes",
                           object.label, out->stride, out->element_size);
        if (!fits(view, out->offset, out->count, out->stride, out->element_size))
            return out_of_view(&object, out->count, out->view, view->size, error);
    }
    LX_TRY(read_sparse(reader, &object, out, error));
cleanup:
    return result;
}

lx_result lx_gltf_check_accessors(lx_gltf_reader *reader, lx_error *error)
{
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_ACCESSOR]; ++i) {
        lx_gltf_accessor accessor;
        const lx_result result = lx_gltf_get_accessor(reader, i, &accessor, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static uint16_t load_u16(const uint8_t *bytes) { return (uint16_t)(bytes[0] | bytes[1] << 8); }

static uint32_t load_u32(const uint8_t *bytes)
{
    return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

// glTF 2.0, section 3.6.2.2: c / (2^n - 1), or c / (2^(n-1) - 1) clamped at -1.
static float load_component(const uint8_t *bytes, uint32_t type, bool normalized)
{
    switch (type) {
    case type_i8:
        return normalized ? fmaxf((float)(int8_t)bytes[0] / 127.0f, -1.0f) : (float)(int8_t)bytes[0];
    case type_u8:
        return normalized ? (float)bytes[0] / 255.0f : (float)bytes[0];
    case type_i16: {
        const float value = (float)(int16_t)load_u16(bytes);
        return normalized ? fmaxf(value / 32767.0f, -1.0f) : value;
    }
    case type_u16:
        return normalized ? (float)load_u16(bytes) / 65535.0f : (float)load_u16(bytes);
    case type_u32:
        return (float)load_u32(bytes);
    default: {
        const uint32_t bits = load_u32(bytes);
        float value;
        memcpy(&value, &bits, sizeof value);
        return value;
    }
    }
}

static uint32_t load_index(const uint8_t *bytes, uint32_t type)
{
    return type == type_u8 ? bytes[0] : type == type_u16 ? load_u16(bytes) : load_u32(bytes);
}

static lx_result visit_dense(lx_gltf_reader *reader, const lx_gltf_accessor *a, lx_gltf_element_func func, void *user,
                             lx_error *error)
{
    if (a->view < 0 || a->count == 0) return LX_OK;
    const uint8_t *data;
    lx_result result = lx_gltf_view_data(reader, (uint32_t)a->view, &data, error);
    for (uint32_t i = 0; result == LX_OK && i < a->count; ++i)
        result = func(user, a, i, data + a->offset + i * a->stride, error);
    return result;
}

static lx_result visit_sparse(lx_gltf_reader *reader, const lx_gltf_accessor *a, lx_gltf_element_func func, void *user,
                              lx_error *error)
{
    const lx_gltf_sparse *s = &a->sparse;
    if (s->count == 0) return LX_OK;
    const uint8_t *indices, *values;
    lx_result result = lx_gltf_view_data(reader, s->index_view, &indices, error);
    if (result == LX_OK) result = lx_gltf_view_data(reader, s->value_view, &values, error);
    const size_t index_size = size_of_type(s->index_type);
    for (uint32_t i = 0; result == LX_OK && i < s->count; ++i) {
        const uint32_t element = load_index(indices + s->index_offset + i * index_size, s->index_type);
        if (element >= a->count)
            return lx_fail(error, LX_ERROR_FORMAT, "%s sparse: index %u out of range (count %u)", a->object.label,
                           element, a->count);
        result = func(user, a, element, values + s->value_offset + i * a->element_size, error);
    }
    return result;
}

lx_result lx_gltf_visit_elements(lx_gltf_reader *reader, const lx_gltf_accessor *a, lx_gltf_element_func func,
                                 void *user, lx_error *error)
{
    const lx_result result = visit_dense(reader, a, func, user, error);
    return result == LX_OK ? visit_sparse(reader, a, func, user, error) : result;
}

static lx_result store_floats(void *user, const lx_gltf_accessor *a, uint32_t element, const uint8_t *bytes,
                              lx_error *error)
{
    float *out = (float *)user + (size_t)element * a->components;
    for (uint32_t c = 0; c < a->components; ++c) {
        out[c] = load_component(bytes + c * a->component_size, a->component_type, a->normalized);
        if (!isfinite(out[c]))
            return lx_fail(error, LX_ERROR_FORMAT, "%s: element %u is not a finite number", a->object.label, element);
    }
    return LX_OK;
}

lx_result lx_gltf_read_floats(lx_gltf_reader *reader, const lx_gltf_accessor *accessor, float **out, lx_error *error)
{
    lx_result result = LX_OK;
    float *values = NULL;
    const size_t size = accessor->components * sizeof(float);
    if (accessor->matrix)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: a matrix is no vertex attribute", accessor->object.label);
    LX_TRY(lx_gltf_charge(reader, accessor->count, size, accessor->object.label, error));
    values = lx_calloc_array(accessor->count, size);
    if (!values) return lx_fail_memory(error, accessor->object.label);
    LX_TRY(lx_gltf_visit_elements(reader, accessor, store_floats, values, error));
    *out = values;
    values = NULL;
cleanup:
    lx_free(values);
    return result;
}

typedef struct index_target {
    uint32_t *indices, limit;
} index_target;

static lx_result store_index(void *user, const lx_gltf_accessor *a, uint32_t element, const uint8_t *bytes,
                             lx_error *error)
{
    const index_target *target = user;
    const uint32_t index = load_index(bytes, a->component_type);
    if (index >= target->limit)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: index %u out of range (count %u)", a->object.label, index,
                       target->limit);
    target->indices[element] = index;
    return LX_OK;
}

lx_result lx_gltf_read_indices(lx_gltf_reader *reader, const lx_gltf_accessor *accessor, uint32_t limit, uint32_t **out,
                               lx_error *error)
{
    lx_result result = LX_OK;
    index_target target = {.limit = limit};
    const uint32_t type = accessor->component_type;
    if (accessor->components != 1 || (type != type_u8 && type != type_u16 && type != type_u32))
        return lx_fail(error, LX_ERROR_FORMAT, "%s: indices are not unsigned scalars", accessor->object.label);
    if (limit == 0 && accessor->count > 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: indices into no vertices", accessor->object.label);
    LX_TRY(lx_gltf_charge(reader, accessor->count, sizeof(uint32_t), accessor->object.label, error));
    target.indices = lx_calloc_array(accessor->count, sizeof *target.indices);
    if (!target.indices) return lx_fail_memory(error, accessor->object.label);
    LX_TRY(lx_gltf_visit_elements(reader, accessor, store_index, &target, error));
    *out = target.indices;
    target.indices = NULL;
cleanup:
    lx_free(target.indices);
    return result;
}
