// Textures, their samplers, and the images behind them.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <string.h>

enum { gl_nearest = 9728, gl_clamp = 33071, gl_mirror = 33648 };

static lx_wrap wrap_of(uint64_t mode)
{
    return mode == gl_clamp ? LX_WRAP_CLAMP : mode == gl_mirror ? LX_WRAP_MIRROR : LX_WRAP_REPEAT;
}

static lx_result read_sampler(const lx_gltf_reader *reader, const lx_gltf_object *texture, lx_texture *out,
                              lx_error *error)
{
    lx_result result = LX_OK;
    int32_t index;
    lx_gltf_object sampler;
    uint64_t wrap_s = 0, wrap_t = 0, filter = 0;
    LX_TRY(lx_gltf_get_index(texture, "sampler", reader->counts[LX_GLTF_SAMPLER], &index, error));
    if (index < 0) return LX_OK;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_SAMPLER, (uint32_t)index, &sampler, error));
    LX_TRY(lx_gltf_get_size(&sampler, "wrapS", &wrap_s, error));
    LX_TRY(lx_gltf_get_size(&sampler, "wrapT", &wrap_t, error));
    LX_TRY(lx_gltf_get_size(&sampler, "magFilter", &filter, error));
    out->wrap_s = wrap_of(wrap_s);
    out->wrap_t = wrap_of(wrap_t);
    out->nearest = filter == gl_nearest;
cleanup:
    return result;
}

// EXT_texture_webp names a better source; other image extensions leave the texture's own one as the way out.
static lx_result read_texture(lx_gltf_reader *reader, uint32_t index, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object object;
    lx_texture *out = &reader->scene->textures[index];
    const uint32_t image_count = reader->counts[LX_GLTF_IMAGE];
    int32_t source;
    LX_TRY(lx_gltf_element(reader, LX_GLTF_TEXTURE, index, &object, error));
    LX_TRY(lx_gltf_get_index(&object, "source", image_count, &out->image, error));
    const lx_gltf_object webp = lx_gltf_extension(&object, "EXT_texture_webp");
    LX_TRY(lx_gltf_get_index(&webp, "source", image_count, &source, error));
    if (source >= 0) out->image = source;
    if (out->image < 0) lx_log_warning(reader->log, "%s: no image that can be read; taken as white", object.label);
    LX_TRY(read_sampler(reader, &object, out, error));
cleanup:
    return result;
}

lx_result lx_gltf_load_textures(lx_gltf_reader *reader, lx_error *error)
{
    lx_scene *scene = reader->scene;
    const uint32_t count = reader->counts[LX_GLTF_TEXTURE];
    scene->textures = lx_calloc_array(count, sizeof *scene->textures);
    if (!scene->textures) return lx_fail_memory(error, "textures");
    scene->texture_count = count;
    for (uint32_t i = 0; i < count; ++i) {
        const lx_result result = read_texture(reader, i, error);
        if (result != LX_OK) return result;
    }
    return LX_OK;
}

static void mark_slot(const lx_scene *scene, const lx_texture_slot *slot, bool *used)
{
    if (slot->texture >= 0 && scene->textures[slot->texture].image >= 0)
        used[scene->textures[slot->texture].image] = true;
}

static void mark_used(const lx_scene *scene, bool *used)
{
    for (uint32_t i = 0; i < scene->surface_count; ++i) {
        const lx_material *material = &scene->materials[scene->surfaces[i].material];
        mark_slot(scene, &material->base_color_texture, used);
        mark_slot(scene, &material->metallic_roughness_texture, used);
        mark_slot(scene, &material->emissive_texture, used);
        mark_slot(scene, &material->transmission_texture, used);
    }
}

typedef struct encoded_image {
    lx_gltf_object object;
    const uint8_t *data; ///< Borrowed; NULL: not to be decoded.
    size_t size;
    lx_result result;
    lx_error error;
} encoded_image;

// Finds the bytes of an image. Those given by URI are kept for export, whether we use them or not.
static lx_result fetch_image(lx_gltf_reader *reader, uint32_t index, bool used, encoded_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object *object = &out->object;
    int32_t view;
    const char *uri = NULL;
    lx_bytes *file = &reader->scene->image_files[index];
    LX_TRY(lx_gltf_element(reader, LX_GLTF_IMAGE, index, object, error));
    LX_TRY(lx_gltf_get_index(object, "bufferView", reader->counts[LX_GLTF_VIEW], &view, error));
    LX_TRY(lx_gltf_get_string(object, "uri", &uri, error));
    if (view >= 0) {
        if (!used) return LX_OK;
        LX_TRY(lx_gltf_view_data(reader, (uint32_t)view, &out->data, error));
        out->size = reader->views[view].size;
        return LX_OK;
    }
    if (!uri) {
        if (used) return lx_fail(error, LX_ERROR_FORMAT, "%s: neither uri nor bufferView", object->label);
        return LX_OK;
    }
    lx_error problem = {0};
    result = lx_gltf_load_uri(reader, object, uri, file, &problem);
    if (result != LX_OK && result != LX_ERROR_OUT_OF_MEMORY && !used) {
        lx_log_warning(reader->log, "%s (the baker does not need it)", problem.message);
        return LX_OK;
    }
    if (result != LX_OK) return lx_fail(error, result, "%s", problem.message);
    LX_TRY(lx_gltf_charge(reader, file->size, 1, object->label, error));
    if (!used) return LX_OK;
    out->data = file->data;
    out->size = file->size;
cleanup:
    return result;
}

typedef struct decode_job {
    encoded_image *images;
    const uint32_t *wanted; ///< Indices of the images to decode.
    lx_image *out;
} decode_job;

// Never fails itself: each image keeps its own error, so that the first in the file is reported, whoever decodes what.
static lx_result decode_task(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const decode_job *job = user;
    encoded_image *image = &job->images[job->wanted[task]];
    const lx_image_format format = lx_image_sniff(image->data, image->size);
    if (format != LX_IMAGE_PNG && format != LX_IMAGE_JPEG && format != LX_IMAGE_WEBP)
        image->result = lx_fail(&image->error, LX_ERROR_UNSUPPORTED, "not a PNG, JPEG or WebP image");
    else
        image->result = lx_image_decode(image->data, image->size, &job->out[job->wanted[task]], &image->error);
    return LX_OK;
}

static lx_result decode_images(lx_gltf_reader *reader, encoded_image *images, uint32_t count, lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t wanted_count = 0;
    uint32_t *wanted = lx_malloc_array(count, sizeof *wanted);
    if (!wanted) return lx_fail_memory(error, "images");
    for (uint32_t i = 0; i < count; ++i)
        if (images[i].data) wanted[wanted_count++] = i;
    decode_job job = {images, wanted, reader->scene->images};
    LX_TRY(lx_pool_run(reader->context->pool, wanted_count, decode_task, &job, "import", NULL, error));
    for (uint32_t i = 0; i < count; ++i) {
        const lx_image *image = &reader->scene->images[i];
        if (images[i].result != LX_OK) {
            result = lx_fail(error, images[i].result, "%s: %s", images[i].object.label, images[i].error.message);
            goto cleanup;
        }
        LX_TRY(lx_gltf_charge(reader, (uint64_t)image->width * image->height, image->channels, images[i].object.label,
                              error));
    }
cleanup:
    lx_free(wanted);
    return result;
}

lx_result lx_gltf_load_images(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    lx_scene *scene = reader->scene;
    const uint32_t count = reader->counts[LX_GLTF_IMAGE];
    bool *used = lx_calloc_array(count, sizeof *used);
    encoded_image *images = lx_calloc_array(count, sizeof *images);
    scene->images = lx_calloc_array(count, sizeof *scene->images);
    scene->image_files = lx_calloc_array(count, sizeof *scene->image_files);
    if (!used || !images || !scene->images || !scene->image_files) {
        result = lx_fail_memory(error, "images");
        goto cleanup;
    }
    scene->image_count = scene->file_image_count = count;
    mark_used(scene, used);
    for (uint32_t i = 0; i < count; ++i) LX_TRY(fetch_image(reader, i, used[i], &images[i], error));
    LX_TRY(decode_images(reader, images, count, error));
cleanup:
    lx_free(used);
    lx_free(images);
    return result;
}
