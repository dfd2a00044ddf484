// Writes a scene as one .glb: a copy of the input's document, edited step by step, and one buffer.
//
// Based on: Khronos glTF 2.0 specification (ISO/IEC 12113:2022), section 4 for the container.
#include "scene/gltf_export.h"

#include "scene/gltf_export_private.h"

#include <stdlib.h>
#include <string.h>

static lx_result open_document(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    exporter->document = json_deep_copy(exporter->scene->document);
    exporter->accessors = lx_export_array_in(exporter->document, "accessors");
    exporter->views = lx_export_array_in(exporter->document, "bufferViews");
    if (!exporter->accessors || !exporter->views) return lx_fail_memory(error, "glTF document");
    exporter->keep_all = lx_export_has_unknown_references(exporter->document);
    LX_TRY(lx_export_open_input(exporter, error));
    exporter->accessor_used = lx_calloc_array(exporter->input_accessor_count, 1);
    exporter->view_used = lx_calloc_array(exporter->input_view_count, 1);
    if (!exporter->accessor_used || !exporter->view_used) return lx_fail_memory(error, "glTF document");
    LX_TRY(lx_export_mark_accessors(exporter, exporter->accessor_used, exporter->input_accessor_count, error));
    LX_TRY(lx_export_mark_views(exporter, exporter->accessor_used, exporter->input_accessor_count, exporter->view_used,
                                exporter->input_view_count, error));
cleanup:
    return result;
}

static void close_document(lx_exporter *exporter)
{
    json_decref(exporter->document);
    for (size_t i = 0; i < exporter->source_count; ++i) lx_free(exporter->sources[i].owned);
    lx_free(exporter->sources);
    lx_free(exporter->slices);
    lx_free(exporter->blobs);
    lx_free(exporter->accessor_used);
    lx_free(exporter->view_used);
    lx_bytes_release(&exporter->bin);
    lx_export_close_input(exporter);
}

static void put_u32(uint8_t *at, uint32_t value)
{
    for (int i = 0; i < 4; ++i) at[i] = (uint8_t)(value >> (8 * i));
}

// Header, JSON padded with spaces, BIN (padded already) if there is any.
static lx_result write_container(const char *text, const lx_bytes *bin, lx_bytes *out, lx_error *error)
{
    enum { header_bytes = 12, chunk_bytes = 8, magic = 0x46546c67, json_type = 0x4e4f534a, bin_type = 0x004e4942 };
    const size_t length = strlen(text), padded = (length + 3) / 4 * 4;
    const size_t total = header_bytes + chunk_bytes + padded + (bin->size ? chunk_bytes + bin->size : 0);
    if (total > UINT32_MAX)
        return lx_fail(error, LX_ERROR_LIMIT, "the scene with its lightmap coordinates takes %zu bytes; a .glb holds 4 GiB",
                       total);
    uint8_t *data = lx_malloc_array(total, 1);
    if (!data) return lx_fail_memory(error, "glTF file");
    put_u32(data, magic);
    put_u32(data + 4, 2);
    put_u32(data + 8, (uint32_t)total);
    put_u32(data + 12, (uint32_t)padded);
    put_u32(data + 16, json_type);
    uint8_t *at = data + header_bytes + chunk_bytes;
    memcpy(at, text, length);
    memset(at + length, ' ', padded - length);
    at += padded;
    if (bin->size) {
        put_u32(at, (uint32_t)bin->size);
        put_u32(at + 4, bin_type);
        memcpy(at + chunk_bytes, bin->data, bin->size);
    }
    *out = (lx_bytes){data, total};
    return LX_OK;
}

static lx_result write_document(const lx_exporter *exporter, lx_bytes *out, lx_error *error)
{
    // 17 digits: every double, and so every float, comes back as it was.
    char *text = json_dumps(exporter->document, JSON_COMPACT | JSON_REAL_PRECISION(17));
    if (!text) return lx_fail_memory(error, "glTF document");
    const lx_result result = write_container(text, &exporter->bin, out, error);
    free(text);
    return result;
}

lx_result lx_gltf_export(const lx_scene *scene, const lx_atlas *atlas, lx_bytes *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_exporter exporter = {.scene = scene, .atlas = atlas};
    LX_TRY(open_document(&exporter, error));
    LX_TRY(lx_export_primitives(&exporter, error));
    LX_TRY(lx_export_extras(&exporter, error));
    LX_TRY(lx_export_images(&exporter, error));
    LX_TRY(lx_export_pack(&exporter, error));
    LX_TRY(write_document(&exporter, out, error));
cleanup:
    close_document(&exporter);
    return result;
}
