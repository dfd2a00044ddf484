// Images that lie outside of the file, or in it as data: URIs, become bufferViews.
#include "scene/gltf_export_private.h"

#include "image/image.h"

#include <string.h>

static const char *sniffed_type(const lx_bytes *content)
{
    switch (lx_image_sniff(content->data, content->size)) {
    case LX_IMAGE_PNG: return "image/png";
    case LX_IMAGE_JPEG: return "image/jpeg";
    case LX_IMAGE_WEBP: return "image/webp";
    case LX_IMAGE_KTX2: return "image/ktx2";
    default: return NULL;
    }
}

// "image/avif" from "data:image/avif;base64,…".
static json_t *declared_type(const char *uri)
{
    if (strncmp(uri, "data:", 5) != 0) return NULL;
    const size_t length = strcspn(uri + 5, ";,");
    return length ? json_stringn(uri + 5, length) : NULL;
}

static const char *type_by_ending(const char *uri)
{
    static const char *const types[][2] = {
        {"png", "image/png"}, {"jpg", "image/jpeg"}, {"jpeg", "image/jpeg"}, {"webp", "image/webp"},
        {"ktx2", "image/ktx2"}, {"avif", "image/avif"}, {"dds", "image/vnd-ms.dds"}, {"gif", "image/gif"},
    };
    char ending[8];
    lx_path_extension(uri, ending);
    for (size_t i = 0; i < sizeof types / sizeof *types; ++i)
        if (strcmp(ending, types[i][0]) == 0) return types[i][1];
    return "application/octet-stream";
}

static lx_result set_type(json_t *image, const lx_bytes *content, const char *uri, lx_error *error)
{
    const char *sniffed = sniffed_type(content);
    if (sniffed) return lx_export_set(image, "mimeType", json_string(sniffed), error);
    if (json_object_get(image, "mimeType")) return LX_OK;
    json_t *declared = declared_type(uri);
    return lx_export_set(image, "mimeType", declared ? declared : json_string(type_by_ending(uri)), error);
}

// An image without a name keeps its file's name as one.
static lx_result set_name(json_t *image, const char *uri, lx_error *error)
{
    if (json_object_get(image, "name") || strncmp(uri, "data:", 5) == 0) return LX_OK;
    return lx_export_set(image, "name", json_string(lx_path_name(uri)), error);
}

static lx_result embed(lx_exporter *exporter, json_t *image, const lx_bytes *content, lx_error *error)
{
    lx_result result = LX_OK;
    const char *uri = json_string_value(json_object_get(image, "uri"));
    lx_bytes copy = {0};
    uint32_t view;
    if (!uri || !content->data) return LX_OK; // a file that was not there keeps its name
    LX_TRY(set_type(image, content, uri, error));
    LX_TRY(set_name(image, uri, error));
    copy = (lx_bytes){lx_malloc_array(content->size, 1), content->size};
    if (!copy.data) return lx_fail_memory(error, "image");
    memcpy(copy.data, content->data, content->size);
    LX_TRY(lx_export_add_view(exporter, &copy, 0, 0, &view, error));
    LX_TRY(lx_export_set(image, "bufferView", json_integer(view), error));
    json_object_del(image, "uri");
cleanup:
    return result;
}

lx_result lx_export_images(lx_exporter *exporter, lx_error *error)
{
    lx_result result = LX_OK;
    json_t *images = json_object_get(exporter->document, "images");
    for (uint32_t i = 0; i < exporter->scene->file_image_count; ++i) {
        json_t *image = json_array_get(images, i);
        if (image) LX_TRY(embed(exporter, image, &exporter->scene->image_files[i], error));
    }
cleanup:
    return result;
}
