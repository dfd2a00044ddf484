// A primitive in new vertices: every attribute is copied element by element in its own component type.
#include "scene/gltf_export_private.h"

#include <string.h>

// Element i of the result is element old[i]; elements begin at multiples of four bytes, as vertex attributes must.
static lx_result gather(const lx_export_elements *from, const lx_export_weld *weld, const char *label,
                        lx_export_elements *out, lx_error *error)
{
    *out = *from;
    out->data = NULL;
    out->count = weld->count;
    out->size = (from->size + 3) / 4 * 4;
    if (!from->data) return LX_OK;
    out->data = lx_calloc_array(weld->count, out->size);
    if (!out->data) return lx_fail_memory(error, "vertices");
    for (uint32_t i = 0; i < weld->count; ++i) {
        if (weld->old[i] >= from->count) {
            lx_export_elements_release(out);
            return lx_fail(error, LX_ERROR_FORMAT, "%s: vertex %u, but its accessor has only %u elements", label, weld->old[i],
                           from->count);
        }
        memcpy(out->data + (size_t)i * out->size, from->data + (size_t)weld->old[i] * from->size, from->size);
    }
    return LX_OK;
}

// A copy of accessor `old` without its data.
static json_t *describe_like(const lx_exporter *exporter, uint32_t old, size_t count)
{
    json_t *accessor = json_deep_copy(json_array_get(exporter->accessors, old));
    if (!accessor) return NULL;
    json_object_del(accessor, "bufferView");
    json_object_del(accessor, "byteOffset");
    json_object_del(accessor, "sparse");
    if (json_object_set_new(accessor, "count", json_integer((json_int_t)count)) == 0) return accessor;
    json_decref(accessor);
    return NULL;
}

static lx_result reindex_accessor(lx_exporter *exporter, uint32_t old, const lx_export_weld *weld, const char *semantic,
                                  uint32_t *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_export_elements before = {0}, after = {0};
    uint32_t view = LX_EXPORT_NONE;
    json_t *accessor = describe_like(exporter, old, weld->count);
    if (!accessor) return lx_fail_memory(error, "accessor");
    LX_TRY(lx_export_read_elements(exporter, old, &before, error));
    LX_TRY(gather(&before, weld, semantic, &after, error));
    if (strcmp(semantic, "POSITION") == 0 || json_object_get(accessor, "min") || json_object_get(accessor, "max"))
        LX_TRY(lx_export_set_bounds(accessor, &after, error));
    if (after.data) {
        lx_bytes bytes = {after.data, (size_t)after.count * after.size};
        after.data = NULL;
        LX_TRY(lx_export_add_view(exporter, &bytes, lx_gltf_array_buffer, after.size == before.size ? 0 : after.size, &view,
                                  error));
    }
    LX_TRY(lx_export_add_accessor(exporter, json_incref(accessor), view, out, error));
cleanup:
    json_decref(accessor);
    lx_export_elements_release(&before);
    lx_export_elements_release(&after);
    return result;
}

static lx_result reindex_attributes(lx_exporter *exporter, json_t *attributes, const lx_export_weld *weld, const char *skip,
                                    lx_error *error)
{
    lx_result result = LX_OK;
    const char *semantic;
    json_t *value;
    void *next;
    json_object_del(attributes, skip);
    json_object_foreach_safe(attributes, next, semantic, value)
    {
        uint32_t fresh;
        const uint32_t old = lx_export_get_index(attributes, semantic, LX_EXPORT_NONE);
        LX_TRY(reindex_accessor(exporter, old, weld, semantic, &fresh, error));
        LX_TRY(lx_export_set(attributes, semantic, json_integer(fresh), error));
    }
cleanup:
    return result;
}

// The narrowest of the three types that is not narrower than `least` and does not need its greatest value, which restarts strips.
static uint32_t index_type_for(uint32_t vertex_count, uint32_t least)
{
    if (least == lx_gltf_u8 && vertex_count <= UINT8_MAX) return lx_gltf_u8;
    return least != lx_gltf_u32 && vertex_count <= UINT16_MAX ? lx_gltf_u16 : lx_gltf_u32;
}

static lx_bytes pack_indices(const lx_export_weld *weld, size_t count, uint32_t type)
{
    const size_t size = type == lx_gltf_u8 ? 1 : type == lx_gltf_u16 ? 2 : 4;
    lx_bytes bytes = {lx_malloc_array(count, size), count * size};
    for (size_t i = 0; bytes.data && i < count; ++i)
        for (size_t k = 0; k < size; ++k) bytes.data[i * size + k] = (uint8_t)(weld->indices[i] >> (8 * k));
    return bytes;
}

static lx_result describe_indices(json_t *accessor, const lx_export_weld *weld, uint32_t type, size_t count,
                                  lx_error *error)
{
    lx_result result = LX_OK;
    const bool bounded = json_object_get(accessor, "min") || json_object_get(accessor, "max");
    LX_TRY(lx_export_set(accessor, "componentType", json_integer(type), error));
    LX_TRY(lx_export_set(accessor, "count", json_integer((json_int_t)count), error));
    LX_TRY(lx_export_set(accessor, "type", json_string("SCALAR"), error));
    if (bounded) { // every vertex is named by some index
        LX_TRY(lx_export_set(accessor, "min", json_pack("[i]", 0), error));
        LX_TRY(lx_export_set(accessor, "max", json_pack("[I]", (json_int_t)weld->count - 1), error));
    }
cleanup:
    return result;
}

static lx_result set_indices(lx_exporter *exporter, json_t *primitive, const lx_export_weld *weld, uint32_t triangle_count,
                             lx_error *error)
{
    lx_result result = LX_OK;
    const size_t count = 3 * (size_t)triangle_count;
    const uint32_t old = lx_export_get_index(primitive, "indices", LX_EXPORT_NONE);
    const uint32_t old_type = lx_export_get_index(json_array_get(exporter->accessors, old), "componentType", lx_gltf_u16);
    const uint32_t type = index_type_for(weld->count, old_type);
    json_t *accessor = old == LX_EXPORT_NONE ? json_object() : describe_like(exporter, old, count);
    lx_bytes bytes = pack_indices(weld, count, type);
    uint32_t view, fresh;
    if (!accessor || !bytes.data) {
        lx_bytes_release(&bytes);
        json_decref(accessor);
        return lx_fail_memory(error, "indices");
    }
    LX_TRY(lx_export_add_view(exporter, &bytes, lx_gltf_element_array_buffer, 0, &view, error));
    LX_TRY(describe_indices(accessor, weld, type, count, error));
    LX_TRY(lx_export_add_accessor(exporter, json_incref(accessor), view, &fresh, error));
    LX_TRY(lx_export_set(primitive, "indices", json_integer(fresh), error));
    if (json_object_get(primitive, "mode"))
        LX_TRY(lx_export_set(primitive, "mode", json_integer(lx_gltf_triangles), error));
cleanup:
    json_decref(accessor);
    return result;
}

lx_result lx_export_reindex(lx_exporter *exporter, json_t *primitive, const lx_export_weld *weld, uint32_t triangle_count,
                            const char *skip, lx_error *error)
{
    lx_result result = LX_OK;
    size_t i;
    json_t *target;
    LX_TRY(reindex_attributes(exporter, json_object_get(primitive, "attributes"), weld, skip, error));
    json_array_foreach(json_object_get(primitive, "targets"), i, target)
        LX_TRY(reindex_attributes(exporter, target, weld, skip, error));
    LX_TRY(set_indices(exporter, primitive, weld, triangle_count, error));
cleanup:
    return result;
}
