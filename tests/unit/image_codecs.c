#define _GNU_SOURCE // mkdtemp, fileno
// The image formats: round trips, files built by other means, hostile input.
#include "base/memory.h"
#include "image/image.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include <jpeglib.h>
#include <png.h>
#include <webp/encode.h>

#include <cmocka.h>

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; ++i) out[i] = (uint8_t)(value >> 8 * i);
}

// A file being put together.
struct file {
    uint8_t data[1 << 16];
    size_t size;
};

static void add(struct file *file, const void *data, size_t size)
{
    assert_true(size <= sizeof file->data - file->size);
    memcpy(file->data + file->size, data, size);
    file->size += size;
}

static void add_text(struct file *file, const char *text)
{
    add(file, text, strlen(text));
}

static void add_u32(struct file *file, uint32_t value)
{
    uint8_t bytes[4];
    put_u32(bytes, value);
    add(file, bytes, 4);
}

static lx_image make_image(uint32_t width, uint32_t height, uint32_t channels, lx_pixel_type type)
{
    lx_image image = {0};
    assert_int_equal(lx_image_create(width, height, channels, type, &image, NULL), LX_OK);
    for (uint32_t i = 0; i < width * height * channels; ++i)
        if (type == LX_PIXEL_U8)
            image.u8[i] = (uint8_t)(i * 5 + i / 13);
        else
            image.f32[i] = expf(6 * sinf((float)i * 0.37f));
    return image;
}

static lx_image decode(const void *data, size_t size)
{
    lx_image image = {0};
    lx_error error = {0};
    if (lx_image_decode(data, size, &image, &error) != LX_OK) fail_msg("%s", error.message);
    return image;
}

static void assert_refused(const void *data, size_t size, lx_result code, const char *message)
{
    lx_image image = {0};
    lx_error error = {0};
    assert_int_equal(lx_image_decode(data, size, &image, &error), code);
    assert_null(image.data);
    assert_string_equal(error.message, message);
}

static void assert_shape(const lx_image *image, uint32_t width, uint32_t height, uint32_t channels, lx_pixel_type type)
{
    assert_int_equal(image->width, width);
    assert_int_equal(image->height, height);
    assert_int_equal(image->channels, channels);
    assert_int_equal(image->type, type);
}

static void assert_same_image(const lx_image *a, const lx_image *b)
{
    assert_shape(a, b->width, b->height, b->channels, b->type);
    const size_t texel = a->channels * (a->type == LX_PIXEL_F32 ? sizeof(float) : 1);
    assert_memory_equal(a->data, b->data, a->width * a->height * texel);
}

// ---- PNG

static void png_round_trips_one_to_four_channels(void **state)
{
    (void)state;
    for (uint32_t channels = 1; channels <= 4; ++channels) {
        lx_image image = make_image(19, 7, channels, LX_PIXEL_U8);
        lx_bytes file = {0};
        assert_int_equal(lx_png_encode(&image, &file, NULL), LX_OK);
        assert_int_equal(lx_image_sniff(file.data, file.size), LX_IMAGE_PNG);
        lx_image back = decode(file.data, file.size);
        assert_same_image(&back, &image);
        lx_image_release(&back);
        lx_bytes_release(&file);
        lx_image_release(&image);
    }
}

static void write_to_file(png_structp png, png_bytep data, size_t size)
{
    add(png_get_io_ptr(png), data, size);
}

struct png_recipe {
    uint32_t width, height;
    int bit_depth, color_type, interlace;
    bool transparency, header_only;
    const uint8_t *rows; // one after the other, packed as the file has them
    size_t row_bytes;
};

static void build_png(const struct png_recipe *recipe, struct file *file)
{
    png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, NULL, NULL, NULL);
    png_infop info = png_create_info_struct(png);
    png_set_write_fn(png, file, write_to_file, NULL);
    png_set_user_limits(png, PNG_UINT_31_MAX, PNG_UINT_31_MAX);
    png_set_IHDR(png, info, recipe->width, recipe->height, recipe->bit_depth, recipe->color_type, recipe->interlace,
                 PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
    png_color palette[4] = {{10, 20, 30}, {40, 50, 60}, {70, 80, 90}, {255, 0, 1}};
    png_byte alpha[2] = {0, 128};
    png_color_16 clear = {.gray = 1};
    const bool indexed = recipe->color_type == PNG_COLOR_TYPE_PALETTE;
    if (indexed) png_set_PLTE(png, info, palette, 4);
    if (recipe->transparency) png_set_tRNS(png, info, indexed ? alpha : NULL, indexed ? 2 : 0, indexed ? NULL : &clear);
    png_write_info(png, info);
    if (!recipe->header_only) {
        const int passes = png_set_interlace_handling(png);
        for (int pass = 0; pass < passes; ++pass)
            for (uint32_t y = 0; y < recipe->height; ++y) png_write_row(png, recipe->rows + y * recipe->row_bytes);
        png_write_end(png, NULL);
    }
    png_destroy_write_struct(&png, &info);
}

static void png_of_16_bits_is_rounded_to_8(void **state)
{
    (void)state;
    const uint8_t rows[] = {0x80, 0x00, 0x7f, 0xff, 0x00, 0x81, 0xff, 0xff};
    struct file file = {.size = 0};
    build_png(&(struct png_recipe){.width = 4, .height = 1, .bit_depth = 16, .rows = rows, .row_bytes = 8}, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 4, 1, 1, LX_PIXEL_U8);
    const uint8_t expected[] = {128, 127, 1, 255};
    for (int i = 0; i < 4; ++i) assert_int_equal(image.u8[i], expected[i]);
    lx_image_release(&image);
}

static void png_palette_with_transparency_becomes_rgba(void **state)
{
    (void)state;
    const uint8_t rows[] = {0x1b}; // 0 1 2 3
    struct file file = {.size = 0};
    build_png(&(struct png_recipe){.width = 4, .height = 1, .bit_depth = 2, .color_type = PNG_COLOR_TYPE_PALETTE,
                                   .transparency = true, .rows = rows, .row_bytes = 1}, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 4, 1, 4, LX_PIXEL_U8);
    const uint8_t expected[] = {10, 20, 30, 0, 40, 50, 60, 128, 70, 80, 90, 255, 255, 0, 1, 255};
    assert_memory_equal(image.u8, expected, sizeof expected);
    lx_image_release(&image);
}

static void png_grey_bits_with_transparency_become_grey_and_alpha(void **state)
{
    (void)state;
    const uint8_t rows[] = {0x40, 0x80}; // 0 1 / 1 0, of one bit
    struct file file = {.size = 0};
    build_png(&(struct png_recipe){.width = 2, .height = 2, .bit_depth = 1, .transparency = true,
                                   .interlace = PNG_INTERLACE_ADAM7, .rows = rows, .row_bytes = 1}, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 2, 2, 2, LX_PIXEL_U8);
    const uint8_t expected[] = {0, 255, 255, 0, 255, 0, 0, 255};
    assert_memory_equal(image.u8, expected, sizeof expected);
    lx_image_release(&image);
}

// ---- JPEG

static void build_jpeg(J_COLOR_SPACE space, int channels, bool progressive, const lx_image *image, struct file *file)
{
    struct jpeg_compress_struct info;
    struct jpeg_error_mgr errors;
    unsigned char *data = NULL;
    unsigned long size = 0;
    info.err = jpeg_std_error(&errors);
    jpeg_create_compress(&info);
    jpeg_mem_dest(&info, &data, &size);
    info.image_width = image->width;
    info.image_height = image->height;
    info.input_components = channels;
    info.in_color_space = space;
    jpeg_set_defaults(&info);
    jpeg_set_quality(&info, 95, TRUE);
    if (progressive) jpeg_simple_progression(&info);
    jpeg_start_compress(&info, TRUE);
    for (uint32_t y = 0; y < image->height; ++y) {
        JSAMPROW row = image->u8 + (size_t)y * image->width * image->channels;
        jpeg_write_scanlines(&info, &row, 1);
    }
    jpeg_finish_compress(&info);
    jpeg_destroy_compress(&info);
    add(file, data, size);
    free(data);
}

static lx_image smooth_image(uint32_t channels)
{
    lx_image image = make_image(24, 16, channels, LX_PIXEL_U8);
    for (uint32_t i = 0; i < 24 * 16; ++i)
        for (uint32_t c = 0; c < channels; ++c)
            image.u8[i * channels + c] = (uint8_t)(40 + (i % 24) * 4 + (i / 24) * 3 + c * 20);
    return image;
}

static void assert_near_bytes(const lx_image *a, const lx_image *b, int tolerance)
{
    assert_shape(a, b->width, b->height, b->channels, LX_PIXEL_U8);
    for (uint32_t i = 0; i < a->width * a->height * a->channels; ++i)
        if (abs(a->u8[i] - b->u8[i]) > tolerance) fail_msg("value %u: %u instead of %u", i, a->u8[i], b->u8[i]);
}

static void jpeg_grey_and_rgb_are_close_to_the_original(void **state)
{
    (void)state;
    for (int progressive = 0; progressive < 2; ++progressive)
        for (uint32_t channels = 1; channels <= 3; channels += 2) {
            lx_image image = smooth_image(channels);
            struct file file = {.size = 0};
            build_jpeg(channels == 1 ? JCS_GRAYSCALE : JCS_RGB, (int)channels, progressive, &image, &file);
            assert_int_equal(lx_image_sniff(file.data, file.size), LX_IMAGE_JPEG);
            lx_image back = decode(file.data, file.size);
            assert_near_bytes(&back, &image, 8);
            lx_image_release(&back);
            lx_image_release(&image);
        }
}

static void jpeg_round_trip_is_close_and_finer_quality_larger(void **state)
{
    (void)state;
    lx_image image = smooth_image(3);
    lx_bytes coarse = {0}, fine = {0};
    lx_error error = {0};
    assert_int_equal(lx_jpeg_encode(&image, 50, &coarse, &error), LX_OK);
    assert_int_equal(lx_jpeg_encode(&image, 95, &fine, &error), LX_OK);
    assert_true(coarse.size < fine.size);
    lx_image back = decode(fine.data, fine.size);
    assert_near_bytes(&back, &image, 8);
    lx_image_release(&back);
    lx_bytes_release(&coarse);
    lx_bytes_release(&fine);
    image.channels = 1; // not written
    assert_int_equal(lx_jpeg_encode(&image, 95, &fine, &error), LX_ERROR_INVALID_ARGUMENT);
    lx_image_release(&image);
}

// libjpeg writes an Adobe marker with CMYK, so 255 means no ink and the colour is C·K / 255.
static void jpeg_cmyk_becomes_rgb(void **state)
{
    (void)state;
    lx_image inks = make_image(16, 16, 4, LX_PIXEL_U8), expected = make_image(16, 16, 3, LX_PIXEL_U8);
    for (uint32_t i = 0; i < 256; ++i) {
        const uint8_t cmyk[4] = {200, 100, 255, 128}, rgb[3] = {100, 50, 128};
        memcpy(inks.u8 + 4 * i, cmyk, 4);
        memcpy(expected.u8 + 3 * i, rgb, 3);
    }
    struct file file = {.size = 0};
    build_jpeg(JCS_CMYK, 4, false, &inks, &file);
    lx_image image = decode(file.data, file.size);
    assert_near_bytes(&image, &expected, 3);
    lx_image_release(&image);
    lx_image_release(&expected);
    lx_image_release(&inks);
}

// ---- WebP

static void build_webp(const lx_image *image, bool lossless, struct file *file)
{
    const int width = (int)image->width, height = (int)image->height, stride = width * (int)image->channels;
    uint8_t *data = NULL;
    size_t size;
    if (image->channels == 4)
        size = lossless ? WebPEncodeLosslessRGBA(image->u8, width, height, stride, &data)
                        : WebPEncodeRGBA(image->u8, width, height, stride, 95, &data);
    else
        size = lossless ? WebPEncodeLosslessRGB(image->u8, width, height, stride, &data)
                        : WebPEncodeRGB(image->u8, width, height, stride, 95, &data);
    add(file, data, size);
    WebPFree(data);
}

static void webp_lossless_is_exact_and_lossy_is_close(void **state)
{
    (void)state;
    for (uint32_t channels = 3; channels <= 4; ++channels)
        for (int lossless = 0; lossless < 2; ++lossless) {
            lx_image image = smooth_image(channels);
            struct file file = {.size = 0};
            build_webp(&image, lossless, &file);
            assert_int_equal(lx_image_sniff(file.data, file.size), LX_IMAGE_WEBP);
            lx_image back = decode(file.data, file.size);
            assert_near_bytes(&back, &image, lossless ? 0 : 16);
            lx_image_release(&back);
            lx_image_release(&image);
        }
}

// ---- EXR

static void exr_round_trips_floats_exactly(void **state)
{
    (void)state;
    for (uint32_t channels = 1; channels <= 4; ++channels) {
        lx_image image = make_image(37, 53, channels, LX_PIXEL_F32); // several chunks of 16 lines, the last one short
        image.f32[0] = INFINITY;
        image.f32[1] = -1e-40f;
        lx_bytes file = {0};
        assert_int_equal(lx_exr_encode(&image, false, &file, NULL), LX_OK);
        assert_int_equal(lx_image_sniff(file.data, file.size), LX_IMAGE_EXR);
        lx_image back = decode(file.data, file.size);
        assert_same_image(&back, &image);
        lx_image_release(&back);
        lx_bytes_release(&file);
        lx_image_release(&image);
    }
}

static void exr_halves_keep_eleven_bits(void **state)
{
    (void)state;
    lx_image image = make_image(37, 53, 4, LX_PIXEL_F32);
    lx_bytes file = {0};
    assert_int_equal(lx_exr_encode(&image, true, &file, NULL), LX_OK);
    lx_image back = decode(file.data, file.size);
    assert_shape(&back, 37, 53, 4, LX_PIXEL_F32);
    for (uint32_t i = 0; i < 37 * 53 * 4; ++i)
        assert_true(fabsf(back.f32[i] - image.f32[i]) <= image.f32[i] * 0x1p-11f);
    lx_image_release(&back);
    lx_bytes_release(&file);
    lx_image_release(&image);
}

enum { exr_uint = 0, exr_half = 1, exr_float = 2 };

struct exr_channel {
    const char *name;
    uint32_t type;
};

// An uncompressed file by the OpenEXR File Layout document, without the library. Pixel (x, y) of channel c holds
// x + 100 y + 10000 c (for half: 1 at odd x, else 0.5).
struct exr_recipe {
    struct exr_channel channels[4]; // sorted by name
    uint32_t channel_count;
    int32_t min_x, min_y, width, height;
    int32_t tile; // 0: scanlines
    uint32_t sampling, compression, extra_flags;
};

static void add_attribute(struct file *file, const char *name, const char *type, uint32_t size)
{
    add(file, name, strlen(name) + 1);
    add(file, type, strlen(type) + 1);
    add_u32(file, size);
}

static void add_box(struct file *file, const char *name, const struct exr_recipe *recipe)
{
    add_attribute(file, name, "box2i", 16);
    add_u32(file, (uint32_t)recipe->min_x);
    add_u32(file, (uint32_t)recipe->min_y);
    add_u32(file, (uint32_t)(recipe->min_x + recipe->width - 1));
    add_u32(file, (uint32_t)(recipe->min_y + recipe->height - 1));
}

static void add_exr_header(struct file *file, const struct exr_recipe *recipe)
{
    add_u32(file, 20000630);
    add_u32(file, 2 | (recipe->tile ? 0x200u : 0) | recipe->extra_flags);
    uint32_t size = 1;
    for (uint32_t c = 0; c < recipe->channel_count; ++c) size += (uint32_t)strlen(recipe->channels[c].name) + 17;
    add_attribute(file, "channels", "chlist", size);
    for (uint32_t c = 0; c < recipe->channel_count; ++c) {
        add(file, recipe->channels[c].name, strlen(recipe->channels[c].name) + 1);
        add_u32(file, recipe->channels[c].type);
        add_u32(file, 0);
        add_u32(file, recipe->sampling);
        add_u32(file, recipe->sampling);
    }
    add(file, "", 1);
    add_attribute(file, "compression", "compression", 1);
    add(file, &(uint8_t){(uint8_t)recipe->compression}, 1);
    add_box(file, "dataWindow", recipe);
    add_box(file, "displayWindow", recipe);
    add_attribute(file, "lineOrder", "lineOrder", 1);
    add(file, "", 1);
    add_attribute(file, "pixelAspectRatio", "float", 4);
    add_u32(file, 0x3f800000);
    add_attribute(file, "screenWindowCenter", "v2f", 8);
    add(file, "\0\0\0\0\0\0\0\0", 8);
    add_attribute(file, "screenWindowWidth", "float", 4);
    add_u32(file, 0x3f800000);
    if (recipe->tile) {
        add_attribute(file, "tiles", "tiledesc", 9);
        add_u32(file, (uint32_t)recipe->tile);
        add_u32(file, (uint32_t)recipe->tile);
        add(file, "", 1);
    }
    add(file, "", 1);
}

static void add_exr_row(struct file *file, const struct exr_recipe *recipe, int32_t x0, int32_t x1, int32_t y)
{
    for (uint32_t c = 0; c < recipe->channel_count; ++c)
        for (int32_t x = x0; x < x1; ++x) {
            const float value = (float)(x + 100 * y + 10000 * (int32_t)c);
            const uint16_t half = x % 2 ? 0x3c00 : 0x3800;
            if (recipe->channels[c].type == exr_half)
                add(file, &half, 2);
            else
                add(file, &value, 4);
        }
}

static uint32_t row_bytes(const struct exr_recipe *recipe, int32_t width)
{
    uint32_t bytes = 0;
    for (uint32_t c = 0; c < recipe->channel_count; ++c)
        bytes += (recipe->channels[c].type == exr_half ? 2 : 4) * (uint32_t)width;
    return bytes;
}

static int32_t smaller(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static void build_exr(const struct exr_recipe *recipe, struct file *file)
{
    const int32_t step_x = recipe->tile ? recipe->tile : recipe->width, step_y = recipe->tile ? recipe->tile : 1;
    const int32_t columns = (recipe->width + step_x - 1) / step_x, rows = (recipe->height + step_y - 1) / step_y;
    add_exr_header(file, recipe);
    size_t table = file->size;
    for (int32_t i = 0; i < columns * rows * 2; ++i) add_u32(file, 0);
    for (int32_t row = 0; row < rows; ++row)
        for (int32_t column = 0; column < columns; ++column, table += 8) {
            const int32_t x0 = column * step_x, x1 = smaller(x0 + step_x, recipe->width);
            const int32_t y0 = row * step_y, y1 = smaller(y0 + step_y, recipe->height);
            put_u32(file->data + table, (uint32_t)file->size);
            if (recipe->tile) {
                add_u32(file, (uint32_t)column);
                add_u32(file, (uint32_t)row);
                add(file, "\0\0\0\0\0\0\0\0", 8);
            } else {
                add_u32(file, (uint32_t)(recipe->min_y + y0));
            }
            add_u32(file, row_bytes(recipe, x1 - x0) * (uint32_t)(y1 - y0));
            for (int32_t y = y0; y < y1; ++y) add_exr_row(file, recipe, x0, x1, y);
        }
}

// What the recipe's pixels should be in `out_channel` of an image that reads it from the file's channel `c`.
static void assert_exr_channel(const lx_image *image, uint32_t out_channel, uint32_t c, bool half)
{
    for (uint32_t y = 0; y < image->height; ++y)
        for (uint32_t x = 0; x < image->width; ++x) {
            const float expected = half ? (x % 2 ? 1.0f : 0.5f) : (float)(x + 100 * y + 10000 * c);
            assert_true(image->f32[((size_t)y * image->width + x) * image->channels + out_channel] == expected);
        }
}

static void exr_scanlines_with_an_offset_window_and_other_channels_are_read(void **state)
{
    (void)state;
    const struct exr_recipe recipe = {.channels = {{"B", exr_float}, {"G", exr_half}, {"R", exr_float}, {"Z", exr_uint}},
                                      .channel_count = 4, .min_x = -7, .min_y = 11, .width = 9, .height = 5, .sampling = 1};
    struct file file = {.size = 0};
    build_exr(&recipe, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 9, 5, 3, LX_PIXEL_F32);
    assert_exr_channel(&image, 0, 2, false);
    assert_exr_channel(&image, 1, 1, true);
    assert_exr_channel(&image, 2, 0, false);
    lx_image_release(&image);
}

static void exr_tiles_are_put_in_their_places(void **state)
{
    (void)state;
    const struct exr_recipe recipe = {.channels = {{"A", exr_half}, {"Y", exr_float}}, .channel_count = 2,
                                      .min_x = 3, .min_y = -2, .width = 21, .height = 13, .tile = 8, .sampling = 1};
    struct file file = {.size = 0};
    build_exr(&recipe, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 21, 13, 2, LX_PIXEL_F32);
    assert_exr_channel(&image, 0, 1, false);
    assert_exr_channel(&image, 1, 0, true);
    lx_image_release(&image);
}

static void exr_missing_colour_channels_read_as_zero(void **state)
{
    (void)state;
    const struct exr_recipe recipe = {.channels = {{"R", exr_float}}, .channel_count = 1, .width = 3, .height = 2,
                                      .sampling = 1};
    struct file file = {.size = 0};
    build_exr(&recipe, &file);
    lx_image image = decode(file.data, file.size);
    assert_shape(&image, 3, 2, 3, LX_PIXEL_F32);
    assert_exr_channel(&image, 0, 0, false);
    assert_true(image.f32[16] == 0);
    lx_image_release(&image);
}

static void assert_exr_refused(const struct exr_recipe *recipe, lx_result code, const char *message)
{
    struct file file = {.size = 0};
    build_exr(recipe, &file);
    assert_refused(file.data, file.size, code, message);
}

static void exr_kinds_that_are_not_supported_say_so(void **state)
{
    (void)state;
    struct exr_recipe recipe = {.channels = {{"Y", exr_uint}}, .channel_count = 1, .width = 4, .height = 4, .sampling = 1};
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: channel Y holds integers");
    recipe.channels[0] = (struct exr_channel){"depth", exr_float};
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: no channels named R, G, B or Y");
    recipe.channels[0] = (struct exr_channel){"Y", exr_float};
    recipe.compression = 6; // B44
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: unsupported compression; save the picture with ZIP");
    recipe.compression = 0;
    recipe.sampling = 2;
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: channel Y is subsampled");
    recipe.sampling = 1;
    recipe.extra_flags = 0x800;
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: deep images are not supported");
    recipe.extra_flags = 0x1000;
    assert_exr_refused(&recipe, LX_ERROR_UNSUPPORTED, "EXR: files of several parts are not supported");
}

// ---- Radiance

static void hdr_round_trip_keeps_eight_bits_of_the_largest_channel(void **state)
{
    (void)state;
    const uint32_t widths[] = {1, 7, 8, 127, 128, 129, 1000};
    for (size_t k = 0; k < sizeof widths / sizeof widths[0]; ++k) {
        lx_image image = make_image(widths[k], 5, 3, LX_PIXEL_F32);
        for (uint32_t i = widths[k] * 6; i < widths[k] * 12; ++i) image.f32[i] = 0.25f; // long runs
        lx_bytes file = {0};
        assert_int_equal(lx_hdr_encode(&image, &file, NULL), LX_OK);
        assert_int_equal(lx_image_sniff(file.data, file.size), LX_IMAGE_HDR);
        lx_image back = decode(file.data, file.size);
        assert_shape(&back, widths[k], 5, 3, LX_PIXEL_F32);
        for (uint32_t i = 0; i < widths[k] * 5; ++i) {
            const float *a = image.f32 + 3 * i, *b = back.f32 + 3 * i;
            const float bound = fmaxf(a[0], fmaxf(a[1], a[2])) * 0x1p-8f;
            for (int c = 0; c < 3; ++c) assert_true(fabsf(a[c] - b[c]) <= bound);
        }
        lx_image_release(&back);
        lx_bytes_release(&file);
        lx_image_release(&image);
    }
}

static void hdr_holds_extreme_values(void **state)
{
    (void)state;
    lx_image image = make_image(4, 1, 3, LX_PIXEL_F32);
    const float values[12] = {0, -1, NAN, INFINITY, 1e38f, 1, 0x1p-120f, 0, 0x1p-127f, 1e-44f, 0, 0};
    memcpy(image.f32, values, sizeof values);
    lx_bytes file = {0};
    assert_int_equal(lx_hdr_encode(&image, &file, NULL), LX_OK);
    lx_image back = decode(file.data, file.size);
    assert_true(back.f32[0] == 0 && back.f32[1] == 0 && back.f32[2] == 0);
    assert_true(back.f32[3] == 0x1.fep+126f && back.f32[5] == 0);
    assert_true(fabsf(back.f32[4] / 1e38f - 1) < 0.01f);
    assert_true(back.f32[6] == 0x1p-120f && back.f32[8] == 0x1p-127f);
    assert_true(back.f32[9] == 0);
    lx_image_release(&back);
    lx_bytes_release(&file);
    lx_image_release(&image);
}

static lx_image decode_hdr(const char *header, const void *pixels, size_t size)
{
    struct file file = {.size = 0};
    add_text(&file, header);
    add(&file, pixels, size);
    return decode(file.data, file.size);
}

static void hdr_repeats_of_the_old_coding_are_expanded(void **state)
{
    (void)state;
    // One pixel, 3 repeats, then a second one with 256·1 + 2 repeats as two codes in a row, low byte first.
    const uint8_t pixels[] = {128, 64, 0, 129, 1, 1, 1, 3, 0, 0, 128, 136, 1, 1, 1, 2, 1, 1, 1, 1};
    lx_image image = decode_hdr("#?RGBE\n\n-Y 1 +X 263\n", pixels, sizeof pixels);
    for (int x = 0; x < 4; ++x) assert_true(image.f32[3 * x] == 1 && image.f32[3 * x + 1] == 0.5f);
    for (int x = 4; x < 263; ++x) assert_true(image.f32[3 * x] == 0 && image.f32[3 * x + 2] == 128);
    lx_image_release(&image);
}

static void hdr_orientations_by_rows_are_turned_upright(void **state)
{
    (void)state;
    const uint8_t pixels[] = {128, 0, 0, 129, 0, 128, 0, 129, 0, 0, 128, 129, 128, 128, 128, 129}; // red green / blue white
    const char *const headers[] = {"#?RADIANCE\n\n-Y 2 +X 2\n", "#?RADIANCE\n\n+Y 2 +X 2\n", "#?RADIANCE\n\n-Y 2 -X 2\n",
                                   "#?RADIANCE\r\n\r\n+Y 2 -X 2\r\n"};
    const int red_at[] = {0, 2, 1, 3}, white_at[] = {3, 1, 2, 0};
    for (int k = 0; k < 4; ++k) {
        lx_image image = decode_hdr(headers[k], pixels, sizeof pixels);
        const float *red = image.f32 + 3 * red_at[k], *white = image.f32 + 3 * white_at[k];
        assert_true(red[0] == 1 && red[1] == 0 && red[2] == 0);
        assert_true(white[0] == 1 && white[1] == 1 && white[2] == 1);
        lx_image_release(&image);
    }
}

static void hdr_exposure_is_divided_out(void **state)
{
    (void)state;
    const uint8_t pixels[] = {128, 64, 0, 129};
    lx_image image = decode_hdr("#?RADIANCE\nEXPOSURE=4\nEXPOSURE= 0.5\n\n-Y 1 +X 1\n", pixels, 4);
    assert_true(image.f32[0] == 0.5f && image.f32[1] == 0.25f);
    lx_image_release(&image);
}

static void assert_hdr_refused(const char *text, lx_result code, const char *message)
{
    assert_refused(text, strlen(text), code, message);
}

static void hdr_kinds_that_are_not_supported_say_so(void **state)
{
    (void)state;
    assert_hdr_refused("#?RADIANCE\n\n+X 2 -Y 2\n", LX_ERROR_UNSUPPORTED,
                       "HDR: pictures stored column by column are not supported");
    assert_hdr_refused("#?RADIANCE\nFORMAT=32-bit_rle_xyze\n\n-Y 2 +X 2\n", LX_ERROR_UNSUPPORTED,
                       "HDR: only 32-bit_rle_rgbe is supported, not 32-bit_rle_xyze");
    assert_hdr_refused("#?RADIANCE\n\n-Y two +X 2\n", LX_ERROR_FORMAT, "HDR: no valid size");
    assert_hdr_refused("#?RADIANCE\n\n-Y 99999999999999999999 +X 2\n", LX_ERROR_FORMAT, "HDR: no valid size");
    assert_hdr_refused("#?RADIANCE\n\n-Y 0 +X 2\n", LX_ERROR_FORMAT, "image has no pixels");
    assert_hdr_refused("#?RADIANCE\n\n-Y 1 +X 1\n\1\1\1\5", LX_ERROR_FORMAT, "HDR: damaged scanline");
}

// ---- Hostile input

enum { sample_count = 12 };

// Small files of every kind.
static void build_sample(int kind, struct file *file)
{
    static const struct exr_recipe tiled = {.channels = {{"A", exr_half}, {"Y", exr_float}}, .channel_count = 2,
                                            .width = 9, .height = 7, .tile = 4, .sampling = 1};
    lx_image bytes = smooth_image(3), rgba = smooth_image(4), floats = make_image(11, 20, 3, LX_PIXEL_F32);
    lx_bytes encoded = {0};
    switch (kind) {
    case 0: lx_png_encode(&bytes, &encoded, NULL); break;
    case 1: lx_png_encode(&rgba, &encoded, NULL); break;
    case 2: build_jpeg(JCS_RGB, 3, false, &bytes, file); break;
    case 3: build_jpeg(JCS_RGB, 3, true, &bytes, file); break;
    case 4: build_jpeg(JCS_CMYK, 4, false, &rgba, file); break;
    case 5: build_webp(&bytes, false, file); break;
    case 6: build_webp(&rgba, true, file); break;
    case 7: build_webp(&rgba, false, file); break;
    case 8: lx_exr_encode(&floats, false, &encoded, NULL); break;
    case 9: lx_exr_encode(&floats, true, &encoded, NULL); break;
    case 10: build_exr(&tiled, file); break;
    case 11: lx_hdr_encode(&floats, &encoded, NULL); break;
    }
    if (encoded.data) add(file, encoded.data, encoded.size);
    assert_true(file->size > 0);
    lx_bytes_release(&encoded);
    lx_image_release(&floats);
    lx_image_release(&rgba);
    lx_image_release(&bytes);
}

// What follows the last pixel may be missing: PNG's checksums and end chunk, JPEG's end marker.
static size_t bytes_after_pixels(lx_image_format format)
{
    return format == LX_IMAGE_PNG ? 20 : format == LX_IMAGE_JPEG ? 2 : 0;
}

static void every_shorter_file_is_refused(void **state)
{
    (void)state;
    for (int kind = 0; kind < sample_count; ++kind) {
        struct file file = {.size = 0};
        build_sample(kind, &file);
        const size_t tail = bytes_after_pixels(lx_image_sniff(file.data, file.size));
        for (size_t size = 0; size < file.size; ++size) {
            uint8_t *shorter = lx_malloc_array(size, 1); // of its own, so that reading beyond is noticed
            memcpy(shorter, file.data, size);
            lx_image image = {0};
            lx_error error = {0};
            const lx_result result = lx_image_decode(shorter, size, &image, &error);
            if (result == LX_OK && size < file.size - tail)
                fail_msg("kind %d is read from %zu of %zu bytes", kind, size, file.size);
            if (result != LX_OK && (!error.message[0] || image.data)) fail_msg("kind %d of %zu bytes", kind, size);
            lx_image_release(&image);
            lx_free(shorter);
        }
    }
}

static void every_damaged_byte_is_survived(void **state)
{
    (void)state;
    for (int kind = 0; kind < sample_count; ++kind) {
        struct file file = {.size = 0};
        build_sample(kind, &file);
        uint8_t *exact = lx_malloc_array(file.size, 1);
        for (size_t i = 0; i < file.size * 3; ++i) {
            memcpy(exact, file.data, file.size);
            exact[i / 3] = i % 3 == 0 ? 0 : i % 3 == 1 ? 0xff : (uint8_t)(exact[i / 3] ^ (1 << i % 8));
            lx_image image = {0};
            lx_image_decode_limited(exact, file.size, 1 << 16, &image, NULL);
            lx_image_release(&image);
        }
        lx_free(exact);
    }
}

// The libraries underneath like to print to stderr; a library must not.
static void decoders_print_nothing(void **state)
{
    (void)state;
    FILE *capture = tmpfile();
    assert_non_null(capture);
    const int saved = dup(STDERR_FILENO);
    fflush(stderr);
    dup2(fileno(capture), STDERR_FILENO);
    every_damaged_byte_is_survived(NULL);
    fflush(stderr);
    dup2(saved, STDERR_FILENO);
    close(saved);
    fseek(capture, 0, SEEK_END);
    assert_int_equal(ftell(capture), 0);
    fclose(capture);
}

static const char *const too_large = "image of 60000x60000 pixels is larger than the limit";

static void png_bomb_is_refused(void **state)
{
    (void)state;
    struct file file = {.size = 0};
    build_png(&(struct png_recipe){.width = 60000, .height = 60000, .bit_depth = 8, .header_only = true}, &file);
    add(&file, "\0\0\0\0IDAT\x35\xaf\x06\x1e", 12); // libpng reads on to the first pixel chunk
    assert_refused(file.data, file.size, LX_ERROR_LIMIT, too_large);
}

static void jpeg_bomb_is_refused(void **state)
{
    (void)state;
    struct file file = {.size = 0};
    build_sample(2, &file);
    for (size_t i = 0; i + 8 < file.size; ++i) {
        if (file.data[i] != 0xff || file.data[i + 1] != 0xc0) continue;
        const uint8_t size[4] = {60000 >> 8, 60000 & 0xff, 60000 >> 8, 60000 & 0xff};
        memcpy(file.data + i + 5, size, 4);
        break;
    }
    assert_refused(file.data, file.size, LX_ERROR_LIMIT, too_large);
}

static void exr_bomb_is_refused(void **state)
{
    (void)state;
    struct exr_recipe recipe = {.channels = {{"Y", exr_float}}, .channel_count = 1, .width = 60000, .height = 60000,
                                .sampling = 1};
    struct file file = {.size = 0};
    add_exr_header(&file, &recipe);
    assert_refused(file.data, file.size, LX_ERROR_LIMIT, too_large);
    recipe.tile = 1;
    file.size = 0;
    add_exr_header(&file, &recipe);
    lx_image image = {0};
    assert_int_not_equal(lx_image_decode(file.data, file.size, &image, NULL), LX_OK);
}

static void hdr_bomb_is_refused(void **state)
{
    (void)state;
    assert_hdr_refused("#?RADIANCE\n\n-Y 60000 +X 60000\n", LX_ERROR_LIMIT, too_large);
}

static void limit_of_the_caller_is_kept(void **state)
{
    (void)state;
    for (int kind = 0; kind < sample_count; ++kind) {
        struct file file = {.size = 0};
        build_sample(kind, &file);
        lx_image image = decode(file.data, file.size), refused = {0};
        const uint64_t pixels = (uint64_t)image.width * image.height;
        lx_image_release(&image);
        assert_int_equal(lx_image_decode_limited(file.data, file.size, pixels - 1, &refused, NULL), LX_ERROR_LIMIT);
        assert_int_equal(lx_image_decode_limited(file.data, file.size, pixels, &image, NULL), LX_OK);
        lx_image_release(&image);
    }
}

static void unknown_data_is_refused(void **state)
{
    (void)state;
    assert_refused("hello", 5, LX_ERROR_FORMAT, "not a PNG, JPEG, WebP, EXR or HDR image");
    assert_refused("", 0, LX_ERROR_FORMAT, "not a PNG, JPEG, WebP, EXR or HDR image");
    assert_refused("\xabKTX 20\xbb\r\n\x1a\n", 12, LX_ERROR_UNSUPPORTED, "KTX2 textures are not supported here");
}

// ---- Files

static void save_chooses_the_format_by_the_ending(void **state)
{
    (void)state;
    char folder[] = "/tmp/luxel_image_XXXXXX";
    assert_non_null(mkdtemp(folder));
    lx_image image = make_image(9, 6, 3, LX_PIXEL_F32);
    image.f32[0] = 0.5f;
    image.f32[1] = -3;
    image.f32[2] = 7;
    const char *const names[] = {"a.png", "a.HDR", "a.exr"};
    const lx_image_format formats[] = {LX_IMAGE_PNG, LX_IMAGE_HDR, LX_IMAGE_EXR};
    for (int i = 0; i < 3; ++i) {
        char *path = lx_path_join(folder, names[i]);
        assert_int_equal(lx_image_save(&image, path, NULL), LX_OK);
        lx_bytes file = {0};
        assert_int_equal(lx_file_read(path, 1 << 20, &file, NULL), LX_OK);
        assert_int_equal(lx_image_sniff(file.data, file.size), formats[i]);
        lx_image back = {0};
        assert_int_equal(lx_image_load(path, &back, NULL), LX_OK);
        if (i == 0) {
            assert_int_equal(back.u8[0], 188); // 0.5 in sRGB
            assert_int_equal(back.u8[1], 0);
            assert_int_equal(back.u8[2], 255);
        } else if (i == 2) {
            assert_same_image(&back, &image);
        }
        lx_image_release(&back);
        lx_bytes_release(&file);
        lx_free(path);
    }
    lx_error error = {0};
    assert_int_equal(lx_image_save(&image, "picture.bmp", &error), LX_ERROR_INVALID_ARGUMENT);
    assert_string_equal(error.message, "the name must end in .png, .hdr or .exr");
    lx_image_release(&image);
    lx_folder_remove(folder, NULL);
}

static void encoders_refuse_what_their_format_cannot_hold(void **state)
{
    (void)state;
    lx_image bytes = make_image(2, 2, 3, LX_PIXEL_U8), floats = make_image(2, 2, 4, LX_PIXEL_F32);
    lx_bytes file = {0};
    assert_int_equal(lx_png_encode(&floats, &file, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_hdr_encode(&floats, &file, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_hdr_encode(&bytes, &file, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_exr_encode(&bytes, false, &file, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_null(file.data);
    lx_image_release(&floats);
    lx_image_release(&bytes);
}

static void create_checks_its_arguments(void **state)
{
    (void)state;
    lx_image image = {0};
    assert_int_equal(lx_image_create(0, 1, 3, LX_PIXEL_U8, &image, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_image_create(1, 1, 5, LX_PIXEL_U8, &image, NULL), LX_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lx_image_create(65536, 1, 1, LX_PIXEL_U8, &image, NULL), LX_ERROR_LIMIT);
    assert_int_equal(lx_image_create(65535, 65535, 1, LX_PIXEL_U8, &image, NULL), LX_ERROR_LIMIT);
    assert_null(image.data);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(png_round_trips_one_to_four_channels),
        cmocka_unit_test(png_of_16_bits_is_rounded_to_8),
        cmocka_unit_test(png_palette_with_transparency_becomes_rgba),
        cmocka_unit_test(png_grey_bits_with_transparency_become_grey_and_alpha),
        cmocka_unit_test(jpeg_grey_and_rgb_are_close_to_the_original),
        cmocka_unit_test(jpeg_round_trip_is_close_and_finer_quality_larger),
        cmocka_unit_test(jpeg_cmyk_becomes_rgb),
        cmocka_unit_test(webp_lossless_is_exact_and_lossy_is_close),
        cmocka_unit_test(exr_round_trips_floats_exactly),
        cmocka_unit_test(exr_halves_keep_eleven_bits),
        cmocka_unit_test(exr_scanlines_with_an_offset_window_and_other_channels_are_read),
        cmocka_unit_test(exr_tiles_are_put_in_their_places),
        cmocka_unit_test(exr_missing_colour_channels_read_as_zero),
        cmocka_unit_test(exr_kinds_that_are_not_supported_say_so),
        cmocka_unit_test(hdr_round_trip_keeps_eight_bits_of_the_largest_channel),
        cmocka_unit_test(hdr_holds_extreme_values),
        cmocka_unit_test(hdr_repeats_of_the_old_coding_are_expanded),
        cmocka_unit_test(hdr_orientations_by_rows_are_turned_upright),
        cmocka_unit_test(hdr_exposure_is_divided_out),
        cmocka_unit_test(hdr_kinds_that_are_not_supported_say_so),
        cmocka_unit_test(every_shorter_file_is_refused),
        cmocka_unit_test(every_damaged_byte_is_survived),
        cmocka_unit_test(decoders_print_nothing),
        cmocka_unit_test(png_bomb_is_refused),
        cmocka_unit_test(jpeg_bomb_is_refused),
        cmocka_unit_test(exr_bomb_is_refused),
        cmocka_unit_test(hdr_bomb_is_refused),
        cmocka_unit_test(limit_of_the_caller_is_kept),
        cmocka_unit_test(unknown_data_is_refused),
        cmocka_unit_test(save_chooses_the_format_by_the_ending),
        cmocka_unit_test(encoders_refuse_what_their_format_cannot_hold),
        cmocka_unit_test(create_checks_its_arguments),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
