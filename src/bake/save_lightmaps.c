// Lightmaps as image files: KTX2 arrays, EXR, Radiance HDR. The pack is written besides, by save.c, from the same mip levels.
#include "bake/save.h"

#include "base/error.h"
#include "image/encode.h"
#include "image/ktx2.h"
#include "post/dilate.h"

#include <ctype.h>
#include <string.h>

enum { max_slices = 64 }; // layers of one KTX2 array

lx_result lx_page_mips_create(const lx_bake *bake, uint32_t page, uint32_t level_count, lx_page_mips *out, lx_error *error)
{
    const uint32_t size = bake->atlas->page_size;
    size_t texel_count = 0; // of levels 1 and up
    for (uint32_t level = 1; level < level_count; ++level) texel_count += (size_t)(size >> level) * (size >> level);
    *out = (lx_page_mips){.size = size, .level_count = level_count};
    out->owned = lx_malloc_array(texel_count, sizeof(uint32_t) + 3 * sizeof(float));
    if (!out->owned) return lx_fail_memory(error, "mip levels");
    uint32_t *charts = out->owned;
    float *rgb = (float *)(charts + texel_count);
    out->charts[0] = bake->texel_chart + (size_t)page * size * size;
    for (uint32_t level = 1; level < level_count; ++level) {
        const size_t count = (size_t)(size >> level) * (size >> level);
        lx_mip_halve_chart(size >> (level - 1), out->charts[level - 1], charts);
        out->charts[level] = charts;
        out->rgb[level] = rgb;
        charts += count;
        rgb += 3 * count;
    }
    return LX_OK;
}

void lx_page_mips_release(lx_page_mips *mips)
{
    lx_free(mips->owned);
    *mips = (lx_page_mips){0};
}

void lx_page_mips_build(lx_page_mips *mips, const float *rgb)
{
    mips->rgb[0] = rgb;
    for (uint32_t level = 1; level < mips->level_count; ++level)
        lx_mip_halve(mips->size >> (level - 1), mips->charts[level - 1], mips->charts[level], mips->rgb[level - 1],
                     (float *)mips->rgb[level]); // ours, above level 0
}

static bool same_ignoring_case(const char *a, const char *b)
{
    for (; *a && tolower((unsigned char)*a) == tolower((unsigned char)*b); ++a, ++b) {}
    return *a == *b || tolower((unsigned char)*a) == tolower((unsigned char)*b);
}

char **lx_layer_file_names(lx_arena *arena, const lx_layer *layers, uint32_t layer_count)
{
    enum { longest = 64 };
    char **names = lx_arena_alloc(arena, layer_count, sizeof *names);
    for (uint32_t i = 0; names && i < layer_count; ++i) {
        char clean[longest + 1], candidate[longest + 16];
        size_t length = 0;
        for (const char *c = layers[i].name; *c && length < longest; ++c) {
            const bool plain = (*c >= 'a' && *c <= 'z') || (*c >= 'A' && *c <= 'Z') || (*c >= '0' && *c <= '9') || *c == '-' || *c == '_' ||
                               (*c == '.' && length > 0);
            if (((unsigned char)*c & 0xc0) == 0x80) continue; // one '_' for each character beyond ASCII
            clean[length++] = plain ? *c : '_';
        }
        clean[length] = '\0';
        snprintf(candidate, sizeof candidate, "%s", length ? clean : "layer");
        for (uint32_t number = 2, k = 0; k < i; ++k) {
            if (!same_ignoring_case(names[k], candidate)) continue;
            snprintf(candidate, sizeof candidate, "%s_%u", length ? clean : "layer", number++);
            k = UINT32_MAX; // look at all of them again
        }
        names[i] = lx_arena_strdup(arena, candidate);
        if (!names[i]) return NULL;
    }
    return names;
}

struct lx_lightmap_writer {
    const lx_bake *bake;
    const lx_new_folder *folder;
    lx_manifest *manifest;
    const float *scales;
    uint32_t formats;
    bool half;
    char **names;
    lx_ktx2 array; // the part at hand
    uint32_t first_slice, slice_count, part;
};

lx_result lx_lightmap_writer_create(const lx_bake *bake, const lx_save_desc *desc, const float *scales, const lx_new_folder *folder,
                                    lx_manifest *manifest, lx_lightmap_writer **out_writer, lx_error *error)
{
    size_t image_count, file_count;
    if (!lx_mul_size(bake->atlas->page_count, bake->layer_count, &image_count) || !lx_mul_size(image_count, 3, &file_count) ||
        file_count > UINT32_MAX)
        return lx_fail(error, LX_ERROR_LIMIT, "too many lightmaps");
    lx_lightmap_writer *writer = lx_calloc_array(1, sizeof *writer);
    if (!writer) return lx_fail_memory(error, "lightmaps");
    *writer = (lx_lightmap_writer){
        .bake = bake,
        .folder = folder,
        .manifest = manifest,
        .scales = scales,
        .formats = desc->formats,
        .half = desc->encoding == LX_ENCODING_HALF,
        .names = lx_layer_file_names(&manifest->strings, bake->layers, bake->layer_count),
    };
    manifest->files = lx_malloc_array(desc->formats ? file_count : 0, sizeof *manifest->files);
    if (!writer->names || !manifest->files) {
        lx_lightmap_writer_destroy(writer);
        return lx_fail_memory(error, "lightmaps");
    }
    *out_writer = writer;
    return LX_OK;
}

void lx_lightmap_writer_destroy(lx_lightmap_writer *writer)
{
    if (!writer) return;
    lx_ktx2_release(&writer->array);
    lx_free(writer);
}

static lx_result write_file(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const char *format, const char *name,
                            const lx_bytes *bytes, lx_error *error)
{
    lx_manifest *manifest = writer->manifest;
    const char *kept = lx_arena_strdup(&manifest->strings, name);
    if (!kept) return lx_fail_memory(error, "lightmaps");
    manifest->files[manifest->file_count++] = (lx_manifest_file){page, layer, format, kept};
    return lx_new_folder_write(writer->folder, name, bytes->data, bytes->size, error);
}

// ---- KTX2

static lx_result begin_array(lx_lightmap_writer *writer, uint32_t layer, const lx_page_mips *mips, lx_error *error)
{
    const uint32_t left = writer->bake->layer_count - layer;
    writer->part = layer / max_slices;
    writer->first_slice = layer;
    writer->slice_count = left < max_slices ? left : max_slices;
    writer->array = (lx_ktx2){
        .format = writer->half ? LX_KTX2_RGBA16F : LX_KTX2_RGB9E5,
        .width = mips->size,
        .height = mips->size,
        .layer_count = writer->slice_count,
        .level_count = mips->level_count,
    };
    for (uint32_t level = 0; level < mips->level_count; ++level) {
        const size_t texel_count = (size_t)(mips->size >> level) * (mips->size >> level);
        lx_bytes *bytes = &writer->array.levels[level];
        bytes->size = texel_count * (writer->half ? 8 : 4) * writer->slice_count;
        bytes->data = lx_malloc_array(bytes->size, 1);
        if (!bytes->data) return lx_fail_memory(error, "KTX2 lightmaps");
    }
    return LX_OK;
}

static void put_u16(uint8_t *out, uint16_t value)
{
    out[0] = (uint8_t)value;
    out[1] = (uint8_t)(value >> 8);
}

static void fill_slice(lx_lightmap_writer *writer, uint32_t layer, const lx_page_mips *mips)
{
    const float inverse = 1 / writer->scales[layer];
    for (uint32_t level = 0; level < mips->level_count; ++level) {
        const size_t texel_count = (size_t)(mips->size >> level) * (mips->size >> level), texel_bytes = writer->half ? 8 : 4;
        uint8_t *out = writer->array.levels[level].data + texel_count * texel_bytes * (layer - writer->first_slice);
        const float *rgb = mips->rgb[level];
        for (size_t i = 0; i < texel_count; ++i, rgb += 3, out += texel_bytes) {
            if (writer->half) {
                for (int k = 0; k < 3; ++k) put_u16(out + 2 * k, lx_half_from_float(rgb[k] * inverse));
                put_u16(out + 6, 0x3c00); // alpha 1
            } else {
                const uint32_t bits = lx_rgb9e5_encode((lx_rgb){rgb[0] * inverse, rgb[1] * inverse, rgb[2] * inverse});
                put_u16(out, (uint16_t)bits);
                put_u16(out + 2, (uint16_t)(bits >> 16));
            }
        }
    }
}

static lx_result end_array(lx_lightmap_writer *writer, uint32_t page, lx_error *error)
{
    char name[64];
    lx_bytes bytes = {0};
    if (writer->part == 0)
        snprintf(name, sizeof name, "lightmap_page%u.ktx2", page);
    else
        snprintf(name, sizeof name, "lightmap_page%u_part%u.ktx2", page, writer->part);
    lx_result result = lx_ktx2_encode(&writer->array, true, "luxel " LX_VERSION, &bytes, error);
    lx_ktx2_release(&writer->array);
    if (result != LX_OK)
        lx_error_prefix(error, "%s", name);
    else
        result = write_file(writer, page, writer->first_slice, "ktx2", name, &bytes, error);
    lx_bytes_release(&bytes);
    return result;
}

static lx_result add_ktx2(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const lx_page_mips *mips, lx_error *error)
{
    lx_result result = LX_OK;
    if (layer % max_slices == 0) LX_TRY(begin_array(writer, layer, mips, error));
    fill_slice(writer, layer, mips);
    if (layer + 1 == writer->first_slice + writer->slice_count) LX_TRY(end_array(writer, page, error));
cleanup:
    return result;
}

// ---- one file per page and layer

static lx_result add_exr(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const lx_page_mips *mips, const char *name,
                         lx_error *error)
{
    lx_result result = LX_OK;
    const size_t texel_count = (size_t)mips->size * mips->size;
    const uint8_t *coverage = writer->bake->texel_coverage + page * texel_count;
    lx_image image = {0};
    lx_bytes bytes = {0};
    LX_TRY(lx_image_create(mips->size, mips->size, 4, LX_PIXEL_F32, &image, error));
    for (size_t i = 0; i < texel_count; ++i) {
        memcpy(image.f32 + 4 * i, mips->rgb[0] + 3 * i, 3 * sizeof *image.f32);
        image.f32[4 * i + 3] = coverage[i] ? 1 : 0; // tells comparisons which texels are a surface's and not padding
    }
    LX_TRY(lx_exr_encode(&image, writer->half, &bytes, error));
    LX_TRY(write_file(writer, page, layer, "exr", name, &bytes, error));
cleanup:
    lx_image_release(&image);
    lx_bytes_release(&bytes);
    return result;
}

static lx_result add_hdr(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const lx_page_mips *mips, const char *name,
                         lx_error *error)
{
    lx_result result = LX_OK;
    lx_image image = {0};
    lx_bytes bytes = {0};
    LX_TRY(lx_image_create(mips->size, mips->size, 3, LX_PIXEL_F32, &image, error));
    memcpy(image.f32, mips->rgb[0], 3 * (size_t)mips->size * mips->size * sizeof *image.f32);
    LX_TRY(lx_hdr_encode(&image, &bytes, error));
    LX_TRY(write_file(writer, page, layer, "hdr", name, &bytes, error));
cleanup:
    lx_image_release(&image);
    lx_bytes_release(&bytes);
    return result;
}

lx_result lx_lightmap_writer_add(lx_lightmap_writer *writer, uint32_t page, uint32_t layer, const lx_page_mips *mips, lx_error *error)
{
    lx_result result = LX_OK;
    char name[128];
    if (writer->formats & LX_LIGHTMAP_KTX2) LX_TRY(add_ktx2(writer, page, layer, mips, error));
    if (writer->formats & LX_LIGHTMAP_EXR) {
        snprintf(name, sizeof name, "lightmap_page%u_%s.exr", page, writer->names[layer]);
        LX_TRY(add_exr(writer, page, layer, mips, name, error));
    }
    if (writer->formats & LX_LIGHTMAP_HDR) {
        snprintf(name, sizeof name, "lightmap_page%u_%s.hdr", page, writer->names[layer]);
        LX_TRY(add_hdr(writer, page, layer, mips, name, error));
    }
cleanup:
    return result;
}
