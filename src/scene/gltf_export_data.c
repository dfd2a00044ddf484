// The bytes behind bufferViews, old and new. New data is found again by its content: accessors that were shared and are
// changed in the same way come out shared, without anyone keeping book of it.
#include "scene/gltf_export_private.h"

#include "math/hash.h"

#include <string.h>

static lx_result add_source(lx_exporter *exporter, lx_export_source source, uint32_t *out, lx_error *error)
{
    if (exporter->source_count >= LX_EXPORT_NONE ||
        !lx_array_reserve(&exporter->sources, &exporter->source_capacity, exporter->source_count + 1,
                          sizeof *exporter->sources))
        return lx_fail_memory(error, "glTF buffers");
    *out = (uint32_t)exporter->source_count;
    exporter->sources[exporter->source_count++] = source;
    return LX_OK;
}

static void open_elements(lx_exporter *exporter, lx_gltf_kind kind, const char *key)
{
    json_t *list = json_object_get(exporter->scene->document, key);
    exporter->input.elements[kind] = list;
    exporter->input.counts[kind] = (uint32_t)json_array_size(list);
}

static lx_result open_views(lx_exporter *exporter, lx_error *error)
{
    const size_t count = exporter->input_view_count;
    exporter->input.views = lx_calloc_array(count, sizeof *exporter->input.views);
    if (!exporter->input.views || !lx_array_reserve(&exporter->slices, &exporter->slice_capacity, count, sizeof *exporter->slices))
        return lx_fail_memory(error, "bufferViews");
    for (size_t i = 0; i < count; ++i) {
        const json_t *object = json_array_get(exporter->input.elements[LX_GLTF_VIEW], i);
        exporter->input.views[i] = (lx_gltf_view){
            .buffer = lx_export_get_index(object, "buffer", LX_EXPORT_NONE),
            .offset = lx_export_get_size(object, "byteOffset"),
            .size = lx_export_get_size(object, "byteLength"),
            .stride = lx_export_get_size(object, "byteStride"),
            .compressed = lx_export_extension(object, "EXT_meshopt_compression") ||
                          lx_export_extension(object, "KHR_meshopt_compression"),
        };
        exporter->slices[i] = (lx_export_slice){LX_EXPORT_NONE, 0, 0, LX_EXPORT_NONE};
    }
    exporter->slice_count = count;
    return LX_OK;
}

lx_result lx_export_open_input(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_scene *scene = exporter->scene;
    // The importer's functions only read from a scene when they are asked for data of its document.
    exporter->input = (lx_gltf_reader){.scene = (lx_scene *)scene, .memory_left = UINT64_MAX};
    open_elements(exporter, LX_GLTF_BUFFER, "buffers");
    open_elements(exporter, LX_GLTF_VIEW, "bufferViews");
    open_elements(exporter, LX_GLTF_ACCESSOR, "accessors");
    exporter->input_view_count = exporter->input.counts[LX_GLTF_VIEW];
    exporter->input_accessor_count = exporter->input.counts[LX_GLTF_ACCESSOR];
    for (uint32_t i = 0; i < scene->buffer_count; ++i) {
        uint32_t source;
        LX_TRY(add_source(exporter, (lx_export_source){scene->buffers[i].data, scene->buffers[i].size, NULL}, &source, error));
    }
    LX_TRY(open_views(exporter, error));
cleanup:
    return result;
}

void lx_export_close_input(lx_exporter *exporter)
{
    for (size_t i = 0; exporter->input.views && i < exporter->input_view_count; ++i)
        lx_free(exporter->input.views[i].decoded);
    lx_free(exporter->input.views);
    exporter->input.views = NULL;
}

static lx_result resolve_input(lx_exporter *exporter, uint32_t index, lx_export_slice *out, lx_error *error)
{
    const lx_gltf_view *view = &exporter->input.views[index];
    const lx_scene *scene = exporter->scene;
    const uint8_t *data;
    if (!view->compressed) {
        if (view->buffer >= scene->buffer_count || view->offset > scene->buffers[view->buffer].size ||
            view->size > scene->buffers[view->buffer].size - view->offset)
            return lx_fail(error, LX_ERROR_FORMAT, "bufferView %u: its buffer does not hold it", index);
        *out = (lx_export_slice){view->buffer, view->offset, view->size, LX_EXPORT_NONE};
        return LX_OK;
    }
    const lx_result result = lx_gltf_view_data(&exporter->input, index, &data, error);
    if (result != LX_OK) return result;
    *out = (lx_export_slice){.size = view->size, .accessor = LX_EXPORT_NONE};
    return add_source(exporter, (lx_export_source){data, view->size, NULL}, &out->source, error);
}

lx_result lx_export_resolve(lx_exporter *exporter, uint32_t view, lx_export_slice *out, lx_error *error)
{
    if (view >= exporter->slice_count) return lx_fail(error, LX_ERROR_FORMAT, "bufferView %u does not exist", view);
    lx_export_slice *slice = &exporter->slices[view];
    if (slice->source == LX_EXPORT_NONE) {
        lx_export_slice found;
        const lx_result result = resolve_input(exporter, view, &found, error);
        if (result != LX_OK) return result;
        *slice = found;
    }
    *out = *slice;
    return LX_OK;
}

// ---- finding equal data again

static size_t blob_place(const lx_export_blob *blobs, size_t capacity, uint64_t hash)
{
    size_t place = (size_t)hash & (capacity - 1);
    while (blobs[place].view != LX_EXPORT_NONE && blobs[place].hash != hash) place = (place + 1) & (capacity - 1);
    return place;
}

static bool reserve_blobs(lx_exporter *exporter)
{
    if ((exporter->blob_count + 1) * 2 <= exporter->blob_capacity) return true;
    const size_t capacity = exporter->blob_capacity ? exporter->blob_capacity * 2 : 256;
    lx_export_blob *grown = lx_malloc_array(capacity, sizeof *grown);
    if (!grown) return false;
    for (size_t i = 0; i < capacity; ++i) grown[i] = (lx_export_blob){.view = LX_EXPORT_NONE};
    for (size_t i = 0; i < exporter->blob_capacity; ++i) {
        const lx_export_blob *blob = &exporter->blobs[i];
        if (blob->view != LX_EXPORT_NONE) grown[blob_place(grown, capacity, blob->hash)] = *blob;
    }
    lx_free(exporter->blobs);
    exporter->blobs = grown;
    exporter->blob_capacity = capacity;
    return true;
}

static uint64_t blob_hash(const lx_bytes *bytes, int target, uint32_t stride)
{
    uint64_t hash = lx_hash64(0xcbf29ce484222325u ^ bytes->size ^ ((uint64_t)target << 32) ^ ((uint64_t)stride << 56));
    size_t i = 0;
    for (; i + 8 <= bytes->size; i += 8) { // eight at a time: lx_hash_bytes takes seconds for what fits into a file
        uint64_t word;
        memcpy(&word, bytes->data + i, 8);
        hash = lx_hash64(hash ^ word) + i;
    }
    return lx_hash_bytes(hash, bytes->data + i, bytes->size - i);
}

static bool is_same_view(const lx_exporter *exporter, uint32_t view, const lx_bytes *bytes, int target, uint32_t stride)
{
    const lx_export_slice *slice = &exporter->slices[view];
    const json_t *object = json_array_get(exporter->views, view);
    return slice->size == bytes->size && lx_export_get_size(object, "target") == (size_t)target &&
           lx_export_get_size(object, "byteStride") == stride &&
           (bytes->size == 0 || memcmp(exporter->sources[slice->source].data, bytes->data, bytes->size) == 0);
}

static lx_result append_view(lx_exporter *exporter, lx_bytes *bytes, int target, uint32_t stride, uint32_t *out_view,
                             lx_error *error)
{
    lx_result result = LX_OK;
    lx_export_slice slice = {.size = bytes->size, .accessor = LX_EXPORT_NONE};
    json_t *object = json_object();
    if (!object || !lx_array_reserve(&exporter->slices, &exporter->slice_capacity, exporter->slice_count + 1,
                                     sizeof *exporter->slices)) {
        result = lx_fail_memory(error, "bufferViews");
        goto cleanup;
    }
    if (stride) LX_TRY(lx_export_set(object, "byteStride", json_integer(stride), error));
    if (target) LX_TRY(lx_export_set(object, "target", json_integer(target), error));
    LX_TRY(add_source(exporter, (lx_export_source){bytes->data, bytes->size, bytes->data}, &slice.source, error));
    *bytes = (lx_bytes){0};
    LX_TRY(lx_export_append(exporter->views, json_incref(object), error));
    *out_view = (uint32_t)exporter->slice_count;
    exporter->slices[exporter->slice_count++] = slice;
cleanup:
    json_decref(object);
    return result;
}

lx_result lx_export_add_view(lx_exporter *exporter, lx_bytes *bytes, int target, uint32_t stride, uint32_t *out_view,
                             lx_error *error)
{
    lx_result result = LX_OK;
    const uint64_t hash = blob_hash(bytes, target, stride);
    if (!reserve_blobs(exporter)) {
        result = lx_fail_memory(error, "bufferViews");
        goto cleanup;
    }
    lx_export_blob *blob = &exporter->blobs[blob_place(exporter->blobs, exporter->blob_capacity, hash)];
    if (blob->view != LX_EXPORT_NONE && is_same_view(exporter, blob->view, bytes, target, stride)) {
        *out_view = blob->view;
        goto cleanup;
    }
    LX_TRY(append_view(exporter, bytes, target, stride, out_view, error));
    if (blob->view == LX_EXPORT_NONE) { // else two contents have one hash: the second is written, but not found again
        *blob = (lx_export_blob){hash, *out_view};
        ++exporter->blob_count;
    }
cleanup:
    lx_bytes_release(bytes);
    return result;
}

lx_result lx_export_add_accessor(lx_exporter *exporter, json_t *accessor, uint32_t view, uint32_t *out_accessor,
                                 lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t *known = view == LX_EXPORT_NONE ? NULL : &exporter->slices[view].accessor;
    if (known) LX_TRY(lx_export_set(accessor, "bufferView", json_integer(view), error));
    if (known && *known != LX_EXPORT_NONE && json_equal(json_array_get(exporter->accessors, *known), accessor)) {
        *out_accessor = *known;
        goto cleanup;
    }
    *out_accessor = (uint32_t)json_array_size(exporter->accessors);
    LX_TRY(lx_export_append(exporter->accessors, json_incref(accessor), error));
    if (known && *known == LX_EXPORT_NONE) *known = *out_accessor;
cleanup:
    json_decref(accessor);
    return result;
}

lx_result lx_export_add_floats(lx_exporter *exporter, const float *values, uint32_t width, size_t count, int target,
                               uint32_t *out_accessor, lx_error *error)
{
    static const char *const types[] = {"", "SCALAR", "VEC2", "VEC3", "VEC4"};
    lx_bytes bytes = {.size = count * width * sizeof(float)};
    uint32_t view;
    bytes.data = lx_malloc_array(count, width * sizeof(float));
    json_t *accessor = json_pack("{sisIss}", "componentType", lx_gltf_f32, "count", (json_int_t)count, "type", types[width]);
    if (!bytes.data || !accessor) {
        lx_bytes_release(&bytes);
        json_decref(accessor);
        return lx_fail_memory(error, "accessor");
    }
    memcpy(bytes.data, values, bytes.size);
    const lx_result result = lx_export_add_view(exporter, &bytes, target, 0, &view, error);
    if (result != LX_OK) {
        json_decref(accessor);
        return result;
    }
    return lx_export_add_accessor(exporter, accessor, view, out_accessor, error);
}
