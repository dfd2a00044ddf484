// Buffers and the views into them, compressed ones included.
//
// Based on: EXT_meshopt_compression (Khronos vendor extension); its successor KHR_meshopt_compression is read as far as
// the installed meshoptimizer decodes it.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <meshoptimizer.h>
#include <string.h>

static const char *const meshopt_names[] = {"EXT_meshopt_compression", "KHR_meshopt_compression"};

static lx_gltf_object meshopt_extension(const lx_gltf_object *object)
{
    lx_gltf_object extension = lx_gltf_extension(object, meshopt_names[0]);
    return extension.json ? extension : lx_gltf_extension(object, meshopt_names[1]);
}

static lx_result copy_binary_chunk(const lx_gltf_reader *reader, uint64_t length, lx_bytes *out, lx_error *error)
{
    if (length > reader->binary_size)
        return lx_fail(error, LX_ERROR_FORMAT, "buffer 0: byteLength %llu is more than the %zu bytes of the BIN chunk",
                       (unsigned long long)length, reader->binary_size);
    out->data = lx_malloc_array((size_t)length, 1);
    if (!out->data) return lx_fail_memory(error, "buffer 0");
    memcpy(out->data, reader->binary, (size_t)length);
    out->size = (size_t)length;
    return LX_OK;
}

static lx_result load_buffer(lx_gltf_reader *reader, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    lx_bytes *out = &reader->scene->buffers[index];
    uint64_t length = UINT64_MAX;
    const char *uri = NULL;
    bool fallback = false;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_BUFFER, index, &object, error));
    LX_TRY(lx_gltf_get_size(&object, "byteLength", &length, error));
    LX_TRY(lx_gltf_get_string(&object, "uri", &uri, error));
    if (length == UINT64_MAX) return lx_fail(error, LX_ERROR_FORMAT, "%s: no byteLength", object.label);
    const lx_gltf_object meshopt = meshopt_extension(&object);
    LX_TRY(lx_gltf_get_bool(&meshopt, "fallback", &fallback, error));
    if (fallback) return LX_OK; // a copy for readers without the decompressor
    if (!uri) return index == 0 && reader->binary ? copy_binary_chunk(reader, length, out, error) : LX_OK;
    LX_TRY(lx_gltf_load_uri(reader, &object, uri, out, error));
    LX_TRY(lx_gltf_charge(reader, out->size, 1, object.label, error));
    if (out->size < length)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: byteLength %llu is more than the %zu bytes there are", object.label,
                       (unsigned long long)length, out->size);
    out->size = (size_t)length;
cleanup:
    return result;
}

// byteOffset and byteLength of `object` within the buffer it names.
static lx_result read_range(const lx_gltf_reader *reader, const lx_gltf_object *object, uint32_t *buffer,
                            size_t *offset, size_t *size, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    uint64_t start = 0, length = UINT64_MAX, available = 0;
    lx_gltf_object target;
    LX_TRY(lx_gltf_get_index(object, "buffer", reader->counts[LX_GLTF_BUFFER], &index, error));
    LX_TRY(lx_gltf_get_size(object, "byteOffset", &start, error));
    LX_TRY(lx_gltf_get_size(object, "byteLength", &length, error));
    if (index < 0 || length == UINT64_MAX)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: no %s", object->label, index < 0 ? "buffer" : "byteLength");
    LX_TRY(lx_gltf_element(reader, LX_GLTF_BUFFER, (uint32_t)index, &target, error));
    LX_TRY(lx_gltf_get_size(&target, "byteLength", &available, error));
    if (start > available || length > available - start)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: bytes %llu to %llu are outside of %s (%llu bytes)", object->label,
                       (unsigned long long)start, (unsigned long long)(start + length), target.label,
                       (unsigned long long)available);
    *buffer = (uint32_t)index;
    *offset = (size_t)start;
    *size = (size_t)length;
cleanup:
    return result;
}

static lx_result check_view(lx_gltf_reader *reader, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    lx_gltf_view *view = &reader->views[index];
    uint64_t stride = 0;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_VIEW, index, &object, error));
    LX_TRY(read_range(reader, &object, &view->buffer, &view->offset, &view->size, error));
    LX_TRY(lx_gltf_get_size(&object, "byteStride", &stride, error));
    if (stride > 252) // glTF's own limit
        return lx_fail(error, LX_ERROR_FORMAT, "%s: byteStride %llu is more than 252", object.label,
                       (unsigned long long)stride);
    view->stride = (size_t)stride;
    const lx_gltf_object meshopt = meshopt_extension(&object);
    view->compressed = meshopt.json != NULL;
    if (view->compressed) {
        uint32_t buffer;
        size_t offset, size;
        LX_TRY(read_range(reader, &meshopt, &buffer, &offset, &size, error));
    }
cleanup:
    return result;
}

lx_result lx_gltf_load_buffers(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    const uint32_t buffer_count = reader->counts[LX_GLTF_BUFFER], view_count = reader->counts[LX_GLTF_VIEW];
    scene->buffers = lx_calloc_array(buffer_count, sizeof *scene->buffers);
    reader->views = lx_calloc_array(view_count, sizeof *reader->views);
    if (!scene->buffers || !reader->views) return lx_fail_memory(error, "buffers");
    scene->buffer_count = buffer_count;
    for (uint32_t i = 0; i < buffer_count; ++i) LX_TRY(load_buffer(reader, i, error));
    for (uint32_t i = 0; i < view_count; ++i) LX_TRY(check_view(reader, i, error));
cleanup:
    return result;
}

// How a view is compressed.
typedef struct packing {
    const uint8_t *data;
    size_t size, stride, count;
    const char *mode, *filter;
} packing;

// A block of up to 256 elements takes at least one byte per four bytes of an element in any version of the codec.
enum { max_expansion = 1024 };

static lx_result read_packing(const lx_gltf_reader *reader, const lx_gltf_view *view, const lx_gltf_object *object,
                              packing *out, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t buffer;
    size_t offset;
    uint64_t stride = 0, count = 0;
    out->filter = "NONE";
    LX_TRY(read_range(reader, object, &buffer, &offset, &out->size, error));
    LX_TRY(lx_gltf_get_size(object, "byteStride", &stride, error));
    LX_TRY(lx_gltf_get_size(object, "count", &count, error));
    LX_TRY(lx_gltf_get_string(object, "mode", &out->mode, error));
    LX_TRY(lx_gltf_get_string(object, "filter", &out->filter, error));
    if (!out->mode) return lx_fail(error, LX_ERROR_FORMAT, "%s: no mode", object->label);
    if (!reader->scene->buffers[buffer].data)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: buffer %u has no data", object->label, buffer);
    if (stride == 0 || stride > 256 || count != view->size / stride || view->size % stride != 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %llu elements of %llu bytes do not fill the bufferView's %zu bytes",
                       object->label, (unsigned long long)count, (unsigned long long)stride, view->size);
    if (view->size / max_expansion > out->size)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: %zu bytes cannot hold %zu", object->label, out->size, view->size);
    out->data = reader->scene->buffers[buffer].data + offset;
    out->stride = (size_t)stride;
    out->count = (size_t)count;
cleanup:
    return result;
}

// Applies the filter of ATTRIBUTES data in place.
static lx_result apply_filter(const packing *p, const lx_gltf_object *object, uint8_t *data, lx_error *error)
{
    if (strcmp(p->filter, "NONE") == 0) return LX_OK;
    if (strcmp(p->filter, "OCTAHEDRAL") == 0 && (p->stride == 4 || p->stride == 8))
        meshopt_decodeFilterOct(data, p->count, p->stride);
    else if (strcmp(p->filter, "QUATERNION") == 0 && p->stride == 8)
        meshopt_decodeFilterQuat(data, p->count, p->stride);
    else if (strcmp(p->filter, "EXPONENTIAL") == 0 && p->stride % 4 == 0)
        meshopt_decodeFilterExp(data, p->count, p->stride);
    else
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "%s: filter '%.20s' with byteStride %zu is not supported",
                       object->label, p->filter, p->stride);
    return LX_OK;
}

static lx_result unpack(const packing *p, const lx_gltf_object *object, uint8_t *out, lx_error *error)
{
    int status = -1;
    if (strcmp(p->mode, "ATTRIBUTES") == 0 && p->stride % 4 == 0)
        status = meshopt_decodeVertexBuffer(out, p->count, p->stride, p->data, p->size);
    else if (strcmp(p->mode, "TRIANGLES") == 0 && (p->stride == 2 || p->stride == 4) && p->count % 3 == 0)
        status = meshopt_decodeIndexBuffer(out, p->count, p->stride, p->data, p->size);
    else if (strcmp(p->mode, "INDICES") == 0 && (p->stride == 2 || p->stride == 4))
        status = meshopt_decodeIndexSequence(out, p->count, p->stride, p->data, p->size);
    else
        return lx_fail(error, LX_ERROR_FORMAT, "%s: mode '%.20s' with byteStride %zu and count %zu makes no sense",
                       object->label, p->mode, p->stride, p->count);
    if (status != 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: damaged, or of a newer version than this build reads",
                       object->label);
    return strcmp(p->mode, "ATTRIBUTES") == 0 ? apply_filter(p, object, out, error) : LX_OK;
}

static lx_result decompress_view(lx_gltf_reader *reader, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    lx_gltf_view *view = &reader->views[index];
    uint8_t *data = NULL;
    packing p = {0};
    LX_TRY(lx_gltf_element(reader, LX_GLTF_VIEW, index, &object, error));
    const lx_gltf_object meshopt = meshopt_extension(&object);
    LX_TRY(read_packing(reader, view, &meshopt, &p, error));
    LX_TRY(lx_gltf_charge(reader, view->size, 1, object.label, error));
    data = lx_malloc_array(view->size, 1);
    if (!data) return lx_fail_memory(error, object.label);
    LX_TRY(unpack(&p, &meshopt, data, error));
    view->decoded = data;
    data = NULL;
cleanup:
    lx_free(data);
    return result;
}

lx_result lx_gltf_view_data(lx_gltf_reader *reader, uint32_t index, const uint8_t **out, lx_error *error)
{
    lx_gltf_view *view = &reader->views[index];
    if (view->compressed) {
        const lx_result result = view->decoded ? LX_OK : decompress_view(reader, index, error);
        *out = view->decoded;
        return result;
    }
    const lx_bytes *buffer = &reader->scene->buffers[view->buffer];
    if (!buffer->data)
        return lx_fail(error, LX_ERROR_FORMAT, "bufferView %u: buffer %u has no data", index, view->buffer);
    *out = buffer->data + view->offset;
    return LX_OK;
}
