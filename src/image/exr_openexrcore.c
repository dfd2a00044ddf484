// OpenEXR through OpenEXRCore's C API, in memory. The only file that includes its headers.
//
// The library parses, validates, reads and decompresses. Unpacking is done here: the library's own (3.1) picks fast paths
// that mix up the channels of interleaved halves, or write through null pointers where one of them is not wanted.
#include "image/codec.h"
#include "image/encode.h"

#include "base/memory.h"

#include <openexr.h>
#include <stdio.h>
#include <string.h>

enum {
    max_side = 65535,
    max_file_channels = 1024, // of all names; keeps a chunk's buffers in proportion to the image
    flags_offset = 4,         // version and flags follow the magic number
};

// User data of a context.
struct exr_stream {
    const uint8_t *data; // reading
    size_t size;
    lx_sink sink; // writing
    char message[200];
};

// For the library's buffers, whose sizes come from the file. Zeroed, because a chunk that decompresses to less than its size
// leaves the rest as it was.
static void *allocate(size_t size)
{
    return size <= (size_t)4 << 30 ? lx_calloc_array(size, 1) : NULL;
}

static struct exr_stream *stream_of(exr_const_context_t context)
{
    void *user = NULL;
    if (context) exr_get_user_data(context, &user);
    return user;
}

// Keeps the first message; the ones after it are consequences. Without a handler the library prints to stderr.
static void on_error(exr_const_context_t context, exr_result_t code, const char *message)
{
    (void)code;
    struct exr_stream *stream = stream_of(context);
    if (stream && !stream->message[0]) snprintf(stream->message, sizeof stream->message, "%s", message);
}

static int64_t read_stream(exr_const_context_t context, void *user, void *buffer, uint64_t size, uint64_t offset,
                           exr_stream_error_func_ptr_t error_func)
{
    (void)context;
    (void)error_func;
    const struct exr_stream *stream = user;
    if (offset >= stream->size) return 0;
    const uint64_t left = stream->size - offset;
    const size_t count = (size_t)(size < left ? size : left);
    memcpy(buffer, stream->data + offset, count);
    return (int64_t)count;
}

static int64_t stream_size(exr_const_context_t context, void *user)
{
    (void)context;
    return (int64_t)((const struct exr_stream *)user)->size;
}

static int64_t write_stream(exr_const_context_t context, void *user, const void *buffer, uint64_t size, uint64_t offset,
                            exr_stream_error_func_ptr_t error_func)
{
    struct exr_stream *stream = user;
    if (lx_sink_write_at(&stream->sink, (size_t)offset, buffer, (size_t)size)) return (int64_t)size;
    error_func(context, EXR_ERR_OUT_OF_MEMORY, "out of memory");
    return -1;
}

static lx_result fail_exr(exr_result_t code, const struct exr_stream *stream, lx_error *error)
{
    if (code == EXR_ERR_OUT_OF_MEMORY) return lx_fail_memory(error, "EXR");
    if (code == EXR_ERR_FEATURE_NOT_IMPLEMENTED) // DWA in OpenEXRCore 3.1
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: unsupported compression; save the picture with ZIP");
    const char *message = stream->message[0] ? stream->message : exr_get_default_error_message(code);
    return lx_fail(error, LX_ERROR_FORMAT, "EXR: %s", message);
}

// Calls the library; on failure jumps to `cleanup`. Needs the locals result, stream and error.
#define EXR_TRY(call)                                                                                                  \
    do {                                                                                                               \
        const exr_result_t exr_code = (call);                                                                          \
        if (exr_code != EXR_ERR_SUCCESS) {                                                                             \
            result = fail_exr(exr_code, stream, error);                                                                \
            goto cleanup;                                                                                              \
        }                                                                                                              \
    } while (0)

// Which channel of the file goes where: file_index[k] is the place of our channel k in the file's list, -1 if absent.
struct channel_map {
    uint32_t count;
    int file_index[4];
    uint32_t pixel_bytes; // of all channels of the file
};

static int find_channel(const exr_attr_chlist_t *list, const char *name)
{
    for (int i = 0; i < list->num_channels; ++i)
        if (strcmp(list->entries[i].name.str, name) == 0) return i;
    return -1;
}

static void map_channels(const exr_attr_chlist_t *list, struct channel_map *map)
{
    const int r = find_channel(list, "R"), g = find_channel(list, "G"), b = find_channel(list, "B");
    const int y = find_channel(list, "Y"), a = find_channel(list, "A");
    const bool color = r >= 0 || g >= 0 || b >= 0;
    *map = (struct channel_map){0};
    if (color) { // a missing one reads as zeros, as everywhere in OpenEXR
        map->file_index[map->count++] = r;
        map->file_index[map->count++] = g;
        map->file_index[map->count++] = b;
    } else if (y >= 0) {
        map->file_index[map->count++] = y;
    }
    if (map->count > 0 && a >= 0) map->file_index[map->count++] = a;
    for (int i = 0; i < list->num_channels; ++i)
        map->pixel_bytes += list->entries[i].pixel_type == EXR_PIXEL_HALF ? 2 : 4;
}

static lx_result check_channels(const exr_attr_chlist_t *list, const struct channel_map *map, lx_error *error)
{
    if (list->num_channels > max_file_channels)
        return lx_fail(error, LX_ERROR_LIMIT, "EXR: %d channels are more than the limit", list->num_channels);
    if (map->count == 0)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: no channels named R, G, B or Y");
    for (int i = 0; i < list->num_channels; ++i) {
        const exr_attr_chlist_entry_t *channel = &list->entries[i];
        if (channel->x_sampling != 1 || channel->y_sampling != 1)
            return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: channel %s is subsampled", channel->name.str);
    }
    for (uint32_t k = 0; k < map->count; ++k) {
        if (map->file_index[k] < 0) continue;
        const exr_attr_chlist_entry_t *channel = &list->entries[map->file_index[k]];
        if (channel->pixel_type != EXR_PIXEL_HALF && channel->pixel_type != EXR_PIXEL_FLOAT)
            return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: channel %s holds integers", channel->name.str);
    }
    return LX_OK;
}

struct exr_reader {
    exr_context_t context;
    exr_decode_pipeline_t pipeline;
    bool pipeline_ready;
    struct channel_map map;
    exr_attr_box2i_t window;
    lx_image image;
};

// Where the pixels of the current chunk, whose top left pixel is (x, y) of the image, are to be put.
static void aim_channels(struct exr_reader *reader, uint32_t x, uint32_t y)
{
    const lx_image *image = &reader->image;
    float *pixel = image->f32 + ((size_t)y * image->width + x) * image->channels;
    for (int16_t i = 0; i < reader->pipeline.channel_count; ++i) {
        exr_coding_channel_info_t *channel = &reader->pipeline.channels[i];
        channel->decode_to_ptr = NULL; // skipped
        for (uint32_t k = 0; k < reader->map.count; ++k) {
            if (reader->map.file_index[k] != i) continue;
            channel->decode_to_ptr = (uint8_t *)(pixel + k);
            channel->user_data_type = EXR_PIXEL_FLOAT;
            channel->user_bytes_per_element = sizeof(float);
            channel->user_pixel_stride = (int32_t)(image->channels * sizeof(float));
            channel->user_line_stride = (int32_t)(image->width * image->channels * sizeof(float));
        }
    }
}

static float load_value(const uint8_t *in, bool is_half)
{
    if (is_half) return lx_half_to_float((uint16_t)(in[0] | in[1] << 8));
    const uint32_t bits = in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
    float value;
    memcpy(&value, &bits, sizeof value);
    return value;
}

// A chunk is its lines one after the other, a line its channels one after the other, little-endian. Nothing is subsampled.
static exr_result_t unpack_chunk(exr_decode_pipeline_t *pipeline)
{
    const uint8_t *in = pipeline->unpacked_buffer;
    const int32_t width = pipeline->chunk.width;
    for (int32_t y = 0; y < pipeline->chunk.height; ++y)
        for (int16_t c = 0; c < pipeline->channel_count; ++c) {
            const exr_coding_channel_info_t *channel = &pipeline->channels[c];
            const size_t value_bytes = (size_t)channel->bytes_per_element;
            if (channel->decode_to_ptr) {
                uint8_t *out = channel->decode_to_ptr + (ptrdiff_t)y * channel->user_line_stride;
                for (int32_t x = 0; x < width; ++x, out += channel->user_pixel_stride) {
                    const float value = load_value(in + value_bytes * (size_t)x, value_bytes == 2);
                    memcpy(out, &value, sizeof value);
                }
            }
            in += value_bytes * (size_t)width;
        }
    return EXR_ERR_SUCCESS;
}

// The chunk must lie inside the image and be as large as its pixels, whatever the file says.
static bool chunk_is_sound(const struct exr_reader *reader, const exr_chunk_info_t *chunk, uint32_t x, uint32_t y)
{
    const lx_image *image = &reader->image;
    if (x >= image->width || y >= image->height || chunk->width < 1 || chunk->height < 1) return false;
    if ((uint32_t)chunk->width > image->width - x || (uint32_t)chunk->height > image->height - y) return false;
    if (chunk->unpacked_size != (uint64_t)chunk->width * (uint64_t)chunk->height * reader->map.pixel_bytes) return false;
    if (chunk->packed_size == 0 || chunk->packed_size > chunk->unpacked_size) return false;
    return chunk->compression != EXR_COMPRESSION_NONE || chunk->packed_size == chunk->unpacked_size;
}

static lx_result read_chunk(struct exr_reader *reader, const exr_chunk_info_t *chunk, uint32_t x, uint32_t y,
                            const struct exr_stream *stream, lx_error *error)
{
    lx_result result = LX_OK;
    exr_decode_pipeline_t *pipeline = &reader->pipeline;
    if (!chunk_is_sound(reader, chunk, x, y)) return lx_fail(error, LX_ERROR_FORMAT, "EXR: damaged chunk");
    if (reader->pipeline_ready) {
        EXR_TRY(exr_decoding_update(reader->context, 0, chunk, pipeline));
        aim_channels(reader, x, y);
    } else {
        reader->pipeline_ready = true; // from here on it needs destroying, even if this fails
        EXR_TRY(exr_decoding_initialize(reader->context, 0, chunk, pipeline));
        aim_channels(reader, x, y);
        EXR_TRY(exr_decoding_choose_default_routines(reader->context, 0, pipeline));
        // Null if the chosen read function puts a single channel of floats straight into the image.
        if (pipeline->unpack_and_convert_fn) pipeline->unpack_and_convert_fn = unpack_chunk;
    }
    EXR_TRY(exr_decoding_run(reader->context, 0, pipeline));
cleanup:
    return result;
}

static lx_result read_scanlines(struct exr_reader *reader, const struct exr_stream *stream, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t step = 0;
    EXR_TRY(exr_get_scanlines_per_chunk(reader->context, 0, &step));
    if (step < 1) return lx_fail(error, LX_ERROR_FORMAT, "EXR: damaged");
    for (uint32_t y = 0; y < reader->image.height; y += (uint32_t)step) {
        exr_chunk_info_t chunk;
        EXR_TRY(exr_read_scanline_chunk_info(reader->context, 0, reader->window.min.y + (int32_t)y, &chunk));
        LX_TRY(read_chunk(reader, &chunk, 0, y, stream, error));
    }
cleanup:
    return result;
}

// The finest level alone.
static lx_result read_tiles(struct exr_reader *reader, const struct exr_stream *stream, lx_error *error)
{
    lx_result result = LX_OK;
    int32_t tile_width = 0, tile_height = 0;
    EXR_TRY(exr_get_tile_sizes(reader->context, 0, 0, 0, &tile_width, &tile_height));
    if (tile_width < 1 || tile_height < 1) return lx_fail(error, LX_ERROR_FORMAT, "EXR: damaged");
    for (uint32_t y = 0, row = 0; y < reader->image.height; y += (uint32_t)tile_height, ++row)
        for (uint32_t x = 0, column = 0; x < reader->image.width; x += (uint32_t)tile_width, ++column) {
            exr_chunk_info_t chunk;
            EXR_TRY(exr_read_tile_chunk_info(reader->context, 0, (int)column, (int)row, 0, 0, &chunk));
            LX_TRY(read_chunk(reader, &chunk, x, y, stream, error));
        }
cleanup:
    return result;
}

// OpenEXRCore 3.1 decodes B44 to wrong pixels without saying so.
static lx_result check_compression(const struct exr_reader *reader, const struct exr_stream *stream, lx_error *error)
{
    lx_result result = LX_OK;
    exr_compression_t compression;
    EXR_TRY(exr_get_compression(reader->context, 0, &compression));
    if (compression == EXR_COMPRESSION_B44 || compression == EXR_COMPRESSION_B44A)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: unsupported compression; save the picture with ZIP");
cleanup:
    return result;
}

// Sets up map, window and image.
static lx_result read_header(struct exr_reader *reader, uint64_t max_pixels, const struct exr_stream *stream,
                             lx_error *error)
{
    lx_result result = LX_OK;
    const exr_attr_chlist_t *list = NULL;
    EXR_TRY(exr_get_channels(reader->context, 0, &list));
    map_channels(list, &reader->map);
    LX_TRY(check_channels(list, &reader->map, error));
    LX_TRY(check_compression(reader, stream, error));
    EXR_TRY(exr_get_data_window(reader->context, 0, &reader->window));
    const int64_t width = (int64_t)reader->window.max.x - reader->window.min.x + 1;
    const int64_t height = (int64_t)reader->window.max.y - reader->window.min.y + 1;
    if (width < 1 || height < 1) return lx_fail(error, LX_ERROR_FORMAT, "image has no pixels");
    LX_TRY(lx_image_check_size((uint64_t)width, (uint64_t)height, max_pixels, error));
    LX_TRY(lx_image_create((uint32_t)width, (uint32_t)height, reader->map.count, LX_PIXEL_F32, &reader->image, error));
cleanup:
    return result;
}

// Deep and multi-part files are refused before the library parses them.
static lx_result check_flags(const uint8_t *data, size_t size, lx_error *error)
{
    if (size < flags_offset + 4) return lx_fail(error, LX_ERROR_FORMAT, "EXR: truncated");
    const uint8_t flags = data[flags_offset + 1];
    if (flags & 0x08) return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: deep images are not supported");
    if (flags & 0x10) return lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: files of several parts are not supported");
    return LX_OK;
}

lx_result lx_exr_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    struct exr_stream memory = {.data = data, .size = size}, *stream = &memory;
    struct exr_reader reader = {0};
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = on_error;
    setup.alloc_fn = allocate;
    setup.free_fn = lx_free;
    setup.user_data = stream;
    setup.read_fn = read_stream;
    setup.size_fn = stream_size;
    setup.max_tile_width = setup.max_tile_height = max_side;
    setup.flags = EXR_CONTEXT_FLAG_DISABLE_CHUNK_RECONSTRUCTION; // searching a damaged file is slow and guesswork

    LX_TRY(check_flags(data, size, error));
    EXR_TRY(exr_start_read(&reader.context, "memory", &setup));
    LX_TRY(read_header(&reader, max_pixels, stream, error));
    exr_storage_t storage;
    EXR_TRY(exr_get_storage(reader.context, 0, &storage));
    if (storage == EXR_STORAGE_SCANLINE)
        LX_TRY(read_scanlines(&reader, stream, error));
    else if (storage == EXR_STORAGE_TILED)
        LX_TRY(read_tiles(&reader, stream, error));
    else
        LX_TRY(lx_fail(error, LX_ERROR_UNSUPPORTED, "EXR: deep images are not supported"));
    *out = reader.image;
    reader.image = (lx_image){0};
cleanup:
    if (reader.pipeline_ready) exr_decoding_destroy(reader.context, &reader.pipeline);
    if (reader.context) exr_finish(&reader.context);
    lx_image_release(&reader.image);
    return result;
}

struct exr_writer {
    exr_context_t context;
    exr_encode_pipeline_t pipeline;
    bool pipeline_ready;
    const uint8_t *pixels;     // interleaved, of half or float
    uint32_t bytes_per_element;
};

static const char *channel_name(const lx_image *image, uint32_t channel)
{
    static const char *const grey[] = {"Y", "A"}, *const color[] = {"R", "G", "B", "A"};
    return image->channels < 3 ? grey[channel] : color[channel];
}

// The library sorts the channels by name, so each is looked up by its name.
static void aim_sources(struct exr_writer *writer, const lx_image *image, uint32_t y)
{
    const size_t pixel_bytes = (size_t)image->channels * writer->bytes_per_element;
    const uint8_t *row = writer->pixels + (size_t)y * image->width * pixel_bytes;
    for (int16_t i = 0; i < writer->pipeline.channel_count; ++i) {
        exr_coding_channel_info_t *channel = &writer->pipeline.channels[i];
        uint32_t k = 0;
        while (k < image->channels - 1 && strcmp(channel->channel_name, channel_name(image, k)) != 0) ++k;
        channel->encode_from_ptr = row + (size_t)k * writer->bytes_per_element;
        channel->user_data_type = writer->bytes_per_element == 2 ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
        channel->user_bytes_per_element = (int16_t)writer->bytes_per_element;
        channel->user_pixel_stride = (int32_t)pixel_bytes;
        channel->user_line_stride = (int32_t)(image->width * pixel_bytes);
    }
}

static lx_result write_header(struct exr_writer *writer, const lx_image *image, const struct exr_stream *stream,
                              lx_error *error)
{
    lx_result result = LX_OK;
    const exr_pixel_type_t type = writer->bytes_per_element == 2 ? EXR_PIXEL_HALF : EXR_PIXEL_FLOAT;
    int part;
    EXR_TRY(exr_add_part(writer->context, NULL, EXR_STORAGE_SCANLINE, &part));
    EXR_TRY(exr_initialize_required_attr_simple(writer->context, part, (int32_t)image->width, (int32_t)image->height,
                                                EXR_COMPRESSION_ZIP));
    for (uint32_t k = 0; k < image->channels; ++k)
        EXR_TRY(exr_add_channel(writer->context, part, channel_name(image, k), type, EXR_PERCEPTUALLY_LOGARITHMIC, 1, 1));
    EXR_TRY(exr_write_header(writer->context));
cleanup:
    return result;
}

static lx_result write_scanlines(struct exr_writer *writer, const lx_image *image, const struct exr_stream *stream,
                                 lx_error *error)
{
    lx_result result = LX_OK;
    int32_t step = 0;
    EXR_TRY(exr_get_scanlines_per_chunk(writer->context, 0, &step));
    for (uint32_t y = 0; y < image->height; y += (uint32_t)step) {
        exr_chunk_info_t chunk;
        EXR_TRY(exr_write_scanline_chunk_info(writer->context, 0, (int)y, &chunk));
        if (writer->pipeline_ready) {
            EXR_TRY(exr_encoding_update(writer->context, 0, &chunk, &writer->pipeline));
            aim_sources(writer, image, y);
        } else {
            writer->pipeline_ready = true;
            EXR_TRY(exr_encoding_initialize(writer->context, 0, &chunk, &writer->pipeline));
            aim_sources(writer, image, y);
            EXR_TRY(exr_encoding_choose_default_routines(writer->context, 0, &writer->pipeline));
        }
        EXR_TRY(exr_encoding_run(writer->context, 0, &writer->pipeline));
    }
cleanup:
    return result;
}

// Converted here, not by the library, so that all half floats of Luxel are rounded alike.
static uint16_t *to_halves(const lx_image *image)
{
    const size_t count = (size_t)image->width * image->height * image->channels;
    uint16_t *halves = lx_malloc_array(count, sizeof *halves);
    for (size_t i = 0; halves && i < count; ++i) halves[i] = lx_half_from_float(image->f32[i]);
    return halves;
}

lx_result lx_exr_encode(const lx_image *image, bool half_float, lx_bytes *out, lx_error *error)
{
    if (image->type != LX_PIXEL_F32 || image->channels < 1 || image->channels > 4)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "EXR holds floating-point images of one to four channels");
    lx_result result = LX_OK;
    struct exr_stream memory = {0}, *stream = &memory;
    struct exr_writer writer = {.pixels = image->data, .bytes_per_element = half_float ? 2 : 4};
    uint16_t *halves = NULL;
    exr_context_initializer_t setup = EXR_DEFAULT_CONTEXT_INITIALIZER;
    setup.error_handler_fn = on_error;
    setup.user_data = stream;
    setup.write_fn = write_stream;
    if (half_float) {
        halves = to_halves(image);
        if (!halves) return lx_fail_memory(error, "EXR");
        writer.pixels = (const uint8_t *)halves;
    }
    EXR_TRY(exr_start_write(&writer.context, "memory", EXR_WRITE_FILE_DIRECTLY, &setup));
    LX_TRY(write_header(&writer, image, stream, error));
    LX_TRY(write_scanlines(&writer, image, stream, error));
    exr_encoding_destroy(writer.context, &writer.pipeline);
    writer.pipeline_ready = false;
    EXR_TRY(exr_finish(&writer.context)); // writes the chunk offsets
    *out = memory.sink.bytes;
    memory.sink = (lx_sink){0};
cleanup:
    if (writer.pipeline_ready) exr_encoding_destroy(writer.context, &writer.pipeline);
    if (writer.context) exr_finish(&writer.context);
    lx_sink_release(&memory.sink);
    lx_free(halves);
    return result;
}
