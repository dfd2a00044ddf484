// PNG through libpng. Errors leave libpng by longjmp into the one guarded function of each direction; everything that must
// survive the jump lives in a struct of the caller.
#include "image/codec.h"

#include "base/memory.h"

#include <png.h>
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

struct png_job {
    jmp_buf escape;
    char message[128];
    png_structp png;
    png_infop info;
};

static void on_error(png_structp png, png_const_charp message)
{
    struct png_job *job = png_get_error_ptr(png);
    snprintf(job->message, sizeof job->message, "%s", message);
    longjmp(job->escape, 1);
}

static void on_warning(png_structp png, png_const_charp message)
{
    (void)png;
    (void)message; // libpng would print it
}

struct png_reader {
    struct png_job job;
    const uint8_t *data;
    size_t size, position;
    uint64_t max_pixels;
    lx_image image;
    png_bytep *rows;
};

static void read_bytes(png_structp png, png_bytep out, size_t count)
{
    struct png_reader *reader = png_get_io_ptr(png);
    if (count > reader->size - reader->position) png_error(png, "truncated");
    memcpy(out, reader->data + reader->position, count);
    reader->position += count;
}

// Whatever the file holds becomes 8-bit grey, grey + alpha, RGB or RGBA.
static void request_bytes(const struct png_job *job)
{
    const int color_type = png_get_color_type(job->png, job->info);
    if (color_type == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(job->png);
    if (color_type == PNG_COLOR_TYPE_GRAY) png_set_expand_gray_1_2_4_to_8(job->png);
    if (png_get_valid(job->png, job->info, PNG_INFO_tRNS)) png_set_tRNS_to_alpha(job->png);
    png_set_scale_16(job->png);
    png_set_interlace_handling(job->png);
    png_read_update_info(job->png, job->info);
}

static lx_result read_image(struct png_reader *reader, lx_error *error)
{
    struct png_job *job = &reader->job;
    if (setjmp(job->escape)) return lx_fail(error, LX_ERROR_FORMAT, "PNG: %s", job->message);

    job->png = png_create_read_struct(PNG_LIBPNG_VER_STRING, job, on_error, on_warning);
    if (job->png) job->info = png_create_info_struct(job->png);
    if (!job->info) return lx_fail_memory(error, "PNG");
    png_set_read_fn(job->png, reader, read_bytes);
    png_set_user_limits(job->png, PNG_UINT_31_MAX, PNG_UINT_31_MAX); // ours follow, with a better message
    png_read_info(job->png, job->info);

    const uint32_t width = png_get_image_width(job->png, job->info);
    const uint32_t height = png_get_image_height(job->png, job->info);
    lx_result result = lx_image_check_size(width, height, reader->max_pixels, error);
    if (result != LX_OK) return result;
    request_bytes(job);
    result = lx_image_create(width, height, png_get_channels(job->png, job->info), LX_PIXEL_U8, &reader->image, error);
    if (result != LX_OK) return result;

    const size_t row_bytes = (size_t)width * reader->image.channels;
    if (png_get_rowbytes(job->png, job->info) != row_bytes) png_error(job->png, "unexpected pixel layout");
    reader->rows = lx_malloc_array(height, sizeof *reader->rows);
    if (!reader->rows) return lx_fail_memory(error, "PNG");
    for (uint32_t y = 0; y < height; ++y) reader->rows[y] = reader->image.u8 + y * row_bytes;
    png_read_image(job->png, reader->rows);
    return LX_OK;
}

lx_result lx_png_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    struct png_reader reader = {.data = data, .size = size, .max_pixels = max_pixels};
    const lx_result result = read_image(&reader, error);
    if (result == LX_OK)
        *out = reader.image;
    else
        lx_image_release(&reader.image);
    png_destroy_read_struct(&reader.job.png, &reader.job.info, NULL);
    lx_free(reader.rows);
    return result;
}

struct png_writer {
    struct png_job job;
    lx_sink sink;
};

static void write_bytes(png_structp png, png_bytep data, size_t count)
{
    struct png_writer *writer = png_get_io_ptr(png);
    if (!lx_sink_append(&writer->sink, data, count)) png_error(png, "out of memory");
}

static void flush_bytes(png_structp png)
{
    (void)png;
}

// Only a lack of memory can fail here: the image was checked before.
static lx_result write_image(struct png_writer *writer, const lx_image *image, lx_error *error)
{
    static const int color_types[] = {PNG_COLOR_TYPE_GRAY, PNG_COLOR_TYPE_GRAY_ALPHA, PNG_COLOR_TYPE_RGB,
                                      PNG_COLOR_TYPE_RGB_ALPHA};
    struct png_job *job = &writer->job;
    if (setjmp(job->escape)) return lx_fail_memory(error, job->message);

    job->png = png_create_write_struct(PNG_LIBPNG_VER_STRING, job, on_error, on_warning);
    if (job->png) job->info = png_create_info_struct(job->png);
    if (!job->info) return lx_fail_memory(error, "PNG");
    png_set_write_fn(job->png, writer, write_bytes, flush_bytes);
    png_set_IHDR(job->png, job->info, image->width, image->height, 8, color_types[image->channels - 1],
                 PNG_INTERLACE_NONE, PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_write_info(job->png, job->info);
    const size_t row_bytes = (size_t)image->width * image->channels;
    for (uint32_t y = 0; y < image->height; ++y) png_write_row(job->png, image->u8 + y * row_bytes);
    png_write_end(job->png, NULL);
    return LX_OK;
}

lx_result lx_png_encode(const lx_image *image, lx_bytes *out, lx_error *error)
{
    if (image->type != LX_PIXEL_U8 || image->channels < 1 || image->channels > 4)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "PNG holds 8-bit images of one to four channels");
    struct png_writer writer = {0};
    const lx_result result = write_image(&writer, image, error);
    if (result == LX_OK)
        *out = writer.sink.bytes;
    else
        lx_sink_release(&writer.sink);
    png_destroy_write_struct(&writer.job.png, &writer.job.info);
    return result;
}
