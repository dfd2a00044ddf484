// JPEG through libjpeg-turbo. Errors leave the library by longjmp into decode_guarded; everything that must survive the
// jump lives in the reader struct.
#include "image/codec.h"

#include "base/memory.h"

#include <stdio.h> // jpeglib.h needs it first

#include <jerror.h>
#include <jpeglib.h>
#include <setjmp.h>
#include <stdlib.h>
#include <string.h>

// A progressive file can ask for any number of passes over the whole image; encoders write about ten.
enum { max_scans = 200 };

struct jpeg_reader {
    struct jpeg_decompress_struct info;
    struct jpeg_error_mgr errors;
    struct jpeg_source_mgr source;
    struct jpeg_progress_mgr progress;
    jmp_buf escape;
    char message[JMSG_LENGTH_MAX];
    lx_result code;
    uint64_t max_pixels;
    lx_image image;
    uint8_t *row; // of CMYK
};

static void escape_with(struct jpeg_reader *reader, lx_result code, const char *message)
{
    reader->code = code;
    snprintf(reader->message, sizeof reader->message, "%s", message);
    longjmp(reader->escape, 1);
}

static void on_error(j_common_ptr info)
{
    struct jpeg_reader *reader = info->client_data;
    char message[JMSG_LENGTH_MAX];
    info->err->format_message(info, message);
    escape_with(reader, info->err->msg_code == JERR_OUT_OF_MEMORY ? LX_ERROR_OUT_OF_MEMORY : LX_ERROR_FORMAT, message);
}

// Most warnings are about odd but readable files. This one means that pixels are missing.
static void on_message(j_common_ptr info, int level)
{
    if (level < 0 && info->err->msg_code == JWRN_HIT_MARKER)
        escape_with(info->client_data, LX_ERROR_FORMAT, "truncated or damaged");
}

static void no_output(j_common_ptr info)
{
    (void)info;
}

static void no_source_change(j_decompress_ptr info)
{
    (void)info;
}

// The file has ended: hand out end markers. If the decoder still wanted pixels, it says JWRN_HIT_MARKER; but whole scans
// of a progressive file may be missing without a word.
static boolean fill_with_end(j_decompress_ptr info)
{
    static const JOCTET end[2] = {0xff, JPEG_EOI};
    struct jpeg_reader *reader = info->client_data;
    if (!reader->image.data || jpeg_has_multiple_scans(info)) escape_with(reader, LX_ERROR_FORMAT, "truncated");
    info->src->next_input_byte = end;
    info->src->bytes_in_buffer = sizeof end;
    return TRUE;
}

static void skip_bytes(j_decompress_ptr info, long count)
{
    struct jpeg_source_mgr *source = info->src;
    if (count <= 0) return;
    const size_t skipped = (size_t)count < source->bytes_in_buffer ? (size_t)count : source->bytes_in_buffer;
    source->next_input_byte += skipped;
    source->bytes_in_buffer -= skipped;
}

static void limit_scans(j_common_ptr info)
{
    if (((j_decompress_ptr)info)->input_scan_number > max_scans)
        escape_with(info->client_data, LX_ERROR_LIMIT, "too many scans");
}

static void set_up(struct jpeg_reader *reader, const void *data, size_t size)
{
    j_decompress_ptr info = &reader->info;
    info->err = jpeg_std_error(&reader->errors);
    info->client_data = reader;
    reader->errors.error_exit = on_error;
    reader->errors.emit_message = on_message;
    reader->errors.output_message = no_output;
    reader->source = (struct jpeg_source_mgr){.next_input_byte = data,
                                              .bytes_in_buffer = size,
                                              .init_source = no_source_change,
                                              .fill_input_buffer = fill_with_end,
                                              .skip_input_data = skip_bytes,
                                              .resync_to_restart = jpeg_resync_to_restart,
                                              .term_source = no_source_change};
    reader->progress.progress_monitor = limit_scans;
}

// Adobe's writers store CMYK inverted (255 = no ink) and say so by their marker.
static void cmyk_row_to_rgb(const uint8_t *cmyk, uint32_t width, bool inverted, uint8_t *rgb)
{
    for (uint32_t x = 0; x < width; ++x)
        for (uint32_t c = 0; c < 3; ++c) {
            const uint32_t color = inverted ? cmyk[x * 4 + c] : 255u - cmyk[x * 4 + c];
            const uint32_t black = inverted ? cmyk[x * 4 + 3] : 255u - cmyk[x * 4 + 3];
            rgb[x * 3 + c] = (uint8_t)((color * black + 127) / 255);
        }
}

static lx_result choose_output(j_decompress_ptr info, lx_error *error)
{
    switch (info->jpeg_color_space) {
    case JCS_GRAYSCALE: info->out_color_space = JCS_GRAYSCALE; return LX_OK;
    case JCS_RGB:
    case JCS_YCbCr: info->out_color_space = JCS_RGB; return LX_OK;
    case JCS_CMYK:
    case JCS_YCCK: info->out_color_space = JCS_CMYK; return LX_OK;
    default:
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "JPEG: %d channels of unknown meaning", info->num_components);
    }
}

static void read_rows(struct jpeg_reader *reader)
{
    j_decompress_ptr info = &reader->info;
    lx_image *image = &reader->image;
    while (info->output_scanline < info->output_height) {
        uint8_t *pixels = image->u8 + (size_t)info->output_scanline * image->width * image->channels;
        JSAMPROW row = reader->row ? reader->row : pixels;
        jpeg_read_scanlines(info, &row, 1);
        if (reader->row) cmyk_row_to_rgb(row, image->width, info->saw_Adobe_marker, pixels);
    }
}

static lx_result decode_guarded(struct jpeg_reader *reader, const void *data, size_t size, lx_error *error)
{
    j_decompress_ptr info = &reader->info;
    set_up(reader, data, size);
    if (setjmp(reader->escape)) return lx_fail(error, reader->code, "JPEG: %s", reader->message);

    jpeg_create_decompress(info); // clears the struct except err and client_data
    info->src = &reader->source;
    info->progress = &reader->progress;
    jpeg_read_header(info, TRUE);
    lx_result result = lx_image_check_size(info->image_width, info->image_height, reader->max_pixels, error);
    if (result == LX_OK) result = choose_output(info, error);
    if (result != LX_OK) return result;

    const bool cmyk = info->out_color_space == JCS_CMYK;
    const uint32_t channels = info->out_color_space == JCS_GRAYSCALE ? 1 : 3;
    result = lx_image_create(info->image_width, info->image_height, channels, LX_PIXEL_U8, &reader->image, error);
    if (result != LX_OK) return result;
    if (cmyk && !(reader->row = lx_malloc_array(info->image_width, 4))) return lx_fail_memory(error, "JPEG");
    jpeg_start_decompress(info);
    read_rows(reader);
    return LX_OK;
}

lx_result lx_jpeg_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    struct jpeg_reader reader = {.max_pixels = max_pixels};
    const lx_result result = decode_guarded(&reader, data, size, error);
    if (result == LX_OK)
        *out = reader.image;
    else
        lx_image_release(&reader.image);
    jpeg_destroy_decompress(&reader.info);
    lx_free(reader.row);
    return result;
}

// ---- writing

struct jpeg_writer {
    struct jpeg_compress_struct info;
    struct jpeg_error_mgr errors;
    jmp_buf escape;
    char message[JMSG_LENGTH_MAX];
    unsigned char *data; // ours at first; the library's own, malloc'ed, if that was too small
    unsigned long size;
};

static void on_write_error(j_common_ptr info)
{
    struct jpeg_writer *writer = info->client_data;
    info->err->format_message(info, writer->message);
    longjmp(writer->escape, 1);
}

static lx_result encode_guarded(struct jpeg_writer *writer, const lx_image *image, int quality, lx_error *error)
{
    j_compress_ptr info = &writer->info;
    info->err = jpeg_std_error(&writer->errors);
    info->client_data = writer;
    writer->errors.error_exit = on_write_error;
    writer->errors.output_message = no_output;
    if (setjmp(writer->escape)) return lx_fail(error, LX_ERROR_BACKEND, "JPEG: %s", writer->message);

    jpeg_create_compress(info);
    jpeg_mem_dest(info, &writer->data, &writer->size);
    info->image_width = image->width;
    info->image_height = image->height;
    info->input_components = 3;
    info->in_color_space = JCS_RGB;
    jpeg_set_defaults(info);
    jpeg_set_quality(info, quality, TRUE);
    info->optimize_coding = TRUE;
    jpeg_start_compress(info, TRUE);
    while (info->next_scanline < info->image_height) {
        JSAMPROW row = image->u8 + (size_t)info->next_scanline * image->width * 3;
        jpeg_write_scanlines(info, &row, 1);
    }
    jpeg_finish_compress(info);
    return LX_OK;
}

lx_result lx_jpeg_encode(const lx_image *image, int quality, lx_bytes *out, lx_error *error)
{
    if (image->type != LX_PIXEL_U8 || image->channels != 3)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "JPEG: only 8-bit RGB can be written");
    // Room for more than any picture takes at any quality. Should it not do, the library goes on in memory of its own, and only after a success
    // can be known where that is.
    size_t room;
    if (!lx_mul_size((size_t)image->width * image->height, 6, &room) || room > SIZE_MAX - 65536) return lx_fail_memory(error, "JPEG");
    room += 65536;
    unsigned char *own = lx_malloc_array(room, 1);
    if (!own) return lx_fail_memory(error, "JPEG");
    struct jpeg_writer writer = {.data = own, .size = (unsigned long)room};
    lx_result result = encode_guarded(&writer, image, quality, error);
    if (result == LX_OK) {
        lx_bytes bytes = {.data = lx_malloc_array(writer.size, 1), .size = writer.size};
        if (bytes.data) {
            memcpy(bytes.data, writer.data, writer.size);
            *out = bytes;
        } else {
            result = lx_fail_memory(error, "JPEG");
        }
    }
    jpeg_destroy_compress(&writer.info);
    if (writer.data != own) free(writer.data);
    lx_free(own);
    return result;
}
