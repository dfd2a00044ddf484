// Radiance pictures (.hdr): 8-bit mantissas with a shared exponent, run-length coded.
//
// Based on: the Radiance reference manual's picture format and its two run-length codings. A byte triple stands for
// mantissa · 2^(exponent - 136), without the half unit that Radiance's own tools add: this is what nearly every other
// program reads and writes, and it keeps small integers exact.
#include "image/codec.h"

#include "base/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    min_run_width = 8,     // narrower or wider scanlines are stored without runs
    max_run_width = 32767, // the width is stored in 15 bits
    min_run = 4,           // shorter repeats do not pay
    max_line = 2048,
    exponent_bias = 136,   // 128, and 8 for mantissas that are integers
};

struct hdr_reader {
    const uint8_t *data;
    size_t size, position;
    double exposure;   // product of all EXPOSURE lines; stored = physical · exposure
    uint32_t width, height;
    bool bottom_up, mirrored;
};

static lx_result fail_truncated(lx_error *error)
{
    return lx_fail(error, LX_ERROR_FORMAT, "HDR: truncated");
}

// Copies the next line without its newline. False at the end of the data or if it is too long.
static bool next_line(struct hdr_reader *reader, char line[max_line])
{
    size_t length = 0;
    while (reader->position < reader->size && length < max_line - 1) {
        const char c = (char)reader->data[reader->position++];
        if (c == '\n') {
            if (length > 0 && line[length - 1] == '\r') --length;
            line[length] = '\0';
            return true;
        }
        line[length++] = c;
    }
    return false;
}

static lx_result read_variable(struct hdr_reader *reader, const char *line, lx_error *error)
{
    if (strncmp(line, "FORMAT=", 7) == 0 && strcmp(line + 7, "32-bit_rle_rgbe") != 0)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "HDR: only 32-bit_rle_rgbe is supported, not %.40s", line + 7);
    if (strncmp(line, "EXPOSURE=", 9) == 0) {
        const double exposure = strtod(line + 9, NULL);
        if (exposure > 0 && isfinite(exposure)) reader->exposure *= exposure;
    }
    return LX_OK;
}

// One of "-Y 480", "+X 640". Returns what follows, or NULL.
static const char *parse_axis(const char *text, char axis, bool *negative, uint32_t *length)
{
    if ((text[0] != '-' && text[0] != '+') || text[1] != axis || text[2] != ' ') return NULL;
    *negative = text[0] == '-';
    uint64_t value = 0;
    const char *c = text + 3;
    for (; *c >= '0' && *c <= '9' && value <= UINT32_MAX; ++c) value = value * 10 + (uint64_t)(*c - '0');
    if (c == text + 3 || value > UINT32_MAX) return NULL;
    *length = (uint32_t)value;
    return c;
}

static lx_result parse_size(struct hdr_reader *reader, const char *line, lx_error *error)
{
    bool y_negative = false, x_negative = false;
    if ((line[0] == '-' || line[0] == '+') && line[1] == 'X')
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "HDR: pictures stored column by column are not supported");
    const char *rest = parse_axis(line, 'Y', &y_negative, &reader->height);
    if (rest && *rest == ' ') rest = parse_axis(rest + 1, 'X', &x_negative, &reader->width);
    if (!rest || *rest != '\0') return lx_fail(error, LX_ERROR_FORMAT, "HDR: no valid size");
    reader->bottom_up = !y_negative;
    reader->mirrored = x_negative;
    return LX_OK;
}

static lx_result read_header(struct hdr_reader *reader, lx_error *error)
{
    char line[max_line];
    if (!next_line(reader, line)) return fail_truncated(error); // "#?…", checked by the caller
    for (;;) {
        if (!next_line(reader, line)) return fail_truncated(error);
        if (line[0] == '\0') break;
        const lx_result result = read_variable(reader, line, error);
        if (result != LX_OK) return result;
    }
    if (!next_line(reader, line)) return fail_truncated(error);
    return parse_size(reader, line, error);
}

// The newer coding: the four components one after the other, each in runs. `position` is behind the four start bytes.
static lx_result read_component_runs(struct hdr_reader *reader, uint8_t *rgbe, lx_error *error)
{
    for (uint32_t component = 0; component < 4; ++component)
        for (uint32_t x = 0; x < reader->width;) {
            if (reader->size - reader->position < 2) return fail_truncated(error);
            const uint8_t code = reader->data[reader->position++];
            const uint32_t count = code > 128 ? code - 128u : code;
            if (count == 0 || count > reader->width - x) return lx_fail(error, LX_ERROR_FORMAT, "HDR: damaged scanline");
            if (code <= 128 && reader->size - reader->position < count) return fail_truncated(error);
            for (uint32_t i = 0; i < count; ++i, ++x)
                rgbe[x * 4 + component] = reader->data[reader->position + (code > 128 ? 0 : i)];
            reader->position += code > 128 ? 1 : count;
        }
    return LX_OK;
}

// The older coding: pixels; (1, 1, 1, n) repeats the one before n times, the next such code in a row n · 256 times, ….
static lx_result read_pixel_runs(struct hdr_reader *reader, uint8_t *rgbe, lx_error *error)
{
    uint32_t shift = 0;
    for (uint32_t x = 0; x < reader->width;) {
        if (reader->size - reader->position < 4) return fail_truncated(error);
        const uint8_t *pixel = reader->data + reader->position;
        reader->position += 4;
        if (pixel[0] != 1 || pixel[1] != 1 || pixel[2] != 1) {
            memcpy(rgbe + 4 * (size_t)x++, pixel, 4);
            shift = 0;
            continue;
        }
        const uint32_t count = shift < 24 ? (uint32_t)pixel[3] << shift : UINT32_MAX;
        if (x == 0 || count > reader->width - x) return lx_fail(error, LX_ERROR_FORMAT, "HDR: damaged scanline");
        for (uint32_t i = 0; i < count; ++i, ++x) memcpy(rgbe + 4 * (size_t)x, rgbe + 4 * (size_t)(x - 1), 4);
        shift += 8;
    }
    return LX_OK;
}

static lx_result read_scanline(struct hdr_reader *reader, uint8_t *rgbe, lx_error *error)
{
    const uint8_t *start = reader->data + reader->position;
    const bool has_start = reader->size - reader->position >= 4 && start[0] == 2 && start[1] == 2 && start[2] < 128;
    if (!has_start || reader->width < min_run_width || reader->width > max_run_width)
        return read_pixel_runs(reader, rgbe, error);
    if (((uint32_t)start[2] << 8 | start[3]) != reader->width)
        return lx_fail(error, LX_ERROR_FORMAT, "HDR: damaged scanline");
    reader->position += 4;
    return read_component_runs(reader, rgbe, error);
}

static void store_row(const struct hdr_reader *reader, const uint8_t *rgbe, float *row)
{
    const double scale = 1.0 / reader->exposure;
    for (uint32_t x = 0; x < reader->width; ++x) {
        const uint8_t *pixel = rgbe + 4 * (size_t)x;
        float *rgb = row + 3 * (size_t)(reader->mirrored ? reader->width - 1 - x : x);
        const double unit = pixel[3] ? ldexp(scale, pixel[3] - exponent_bias) : 0;
        for (int c = 0; c < 3; ++c) rgb[c] = (float)fmin(pixel[c] * unit, 3.402823466e38); // a tiny EXPOSURE overflows
    }
}

lx_result lx_hdr_decode(const void *data, size_t size, uint64_t max_pixels, lx_image *out, lx_error *error)
{
    lx_result result = LX_OK;
    struct hdr_reader reader = {.data = data, .size = size, .exposure = 1};
    lx_image image = {0};
    uint8_t *rgbe = NULL;
    LX_TRY(read_header(&reader, error));
    LX_TRY(lx_image_check_size(reader.width, reader.height, max_pixels, error));
    LX_TRY(lx_image_create(reader.width, reader.height, 3, LX_PIXEL_F32, &image, error));
    rgbe = lx_malloc_array(reader.width, 4);
    if (!rgbe) {
        result = lx_fail_memory(error, "HDR");
        goto cleanup;
    }
    for (uint32_t y = 0; y < reader.height; ++y) {
        LX_TRY(read_scanline(&reader, rgbe, error));
        const uint32_t row = reader.bottom_up ? reader.height - 1 - y : y;
        store_row(&reader, rgbe, image.f32 + (size_t)row * reader.width * 3);
    }
    *out = image;
    image = (lx_image){0};
cleanup:
    lx_free(rgbe);
    lx_image_release(&image);
    return result;
}

// Negative values and NaN become 0; what is beyond the format's range its largest value.
static float clamp_to_range(float value)
{
    const float largest = 0x1.fep+126f; // 255 · 2^(255 - 136)
    if (!(value > 0)) return 0;
    return value < largest ? value : largest;
}

// Rounds to nearest. The largest mantissa lies in 128 … 255, so no pixel looks like a code of either run-length coding.
static void encode_pixel(const float *rgb, uint8_t rgbe[4])
{
    const float clamped[3] = {clamp_to_range(rgb[0]), clamp_to_range(rgb[1]), clamp_to_range(rgb[2])};
    const float largest = fmaxf(clamped[0], fmaxf(clamped[1], clamped[2]));
    int exponent;
    const double mantissa = frexp(largest, &exponent); // 0.5 … 1, largest = mantissa · 2^exponent
    if (mantissa * 256 + 0.5 >= 256) ++exponent;
    memset(rgbe, 0, 4);
    if (largest == 0 || exponent + 128 < 1) return;
    for (int c = 0; c < 3; ++c) rgbe[c] = (uint8_t)(ldexp(clamped[c], 8 - exponent) + 0.5);
    rgbe[3] = (uint8_t)(exponent + 128);
}

static uint32_t run_length(const uint8_t *values, uint32_t count)
{
    uint32_t length = 1;
    while (length < count && length < 127 && values[length] == values[0]) ++length;
    return length;
}

// Writes one component of a scanline as runs (128 + n, value) and literals (n, values…). Returns the bytes written:
// at most count + count / 128 + 1.
static size_t encode_component(const uint8_t *values, uint32_t count, uint8_t *out)
{
    size_t written = 0;
    for (uint32_t x = 0; x < count;) {
        const uint32_t run = run_length(values + x, count - x);
        if (run >= min_run) {
            out[written++] = (uint8_t)(128 + run);
            out[written++] = values[x];
            x += run;
            continue;
        }
        uint32_t end = x;
        while (end < count && end - x < 128 && run_length(values + end, count - end) < min_run) ++end;
        out[written++] = (uint8_t)(end - x);
        memcpy(out + written, values + x, end - x);
        written += end - x;
        x = end;
    }
    return written;
}

// `planes` holds the four components of a row one after the other, `out` room for the worst case.
static size_t encode_scanline(const float *row, uint32_t width, uint8_t *planes, uint8_t *out)
{
    const bool runs = width >= min_run_width && width <= max_run_width;
    for (uint32_t x = 0; x < width; ++x) {
        uint8_t rgbe[4];
        encode_pixel(row + 3 * (size_t)x, rgbe);
        if (!runs) memcpy(out + 4 * (size_t)x, rgbe, 4);
        for (uint32_t c = 0; c < 4; ++c) planes[(size_t)c * width + x] = rgbe[c];
    }
    if (!runs) return 4 * (size_t)width;
    const uint8_t start[4] = {2, 2, (uint8_t)(width >> 8), (uint8_t)width};
    memcpy(out, start, 4);
    size_t written = 4;
    for (uint32_t c = 0; c < 4; ++c) written += encode_component(planes + (size_t)c * width, width, out + written);
    return written;
}

lx_result lx_hdr_encode(const lx_image *image, lx_bytes *out, lx_error *error)
{
    if (image->type != LX_PIXEL_F32 || image->channels != 3)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "HDR holds floating-point images of three channels");
    lx_result result = LX_ERROR_OUT_OF_MEMORY;
    lx_sink sink = {0};
    uint8_t *planes = lx_malloc_array(image->width, 4);
    uint8_t *scanline = lx_malloc_array(image->width, 8); // twice the pixels is more than the worst case
    char *header = lx_format("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y %u +X %u\n", image->height, image->width);
    if (!planes || !scanline || !header || !lx_sink_append(&sink, header, strlen(header))) goto cleanup;
    for (uint32_t y = 0; y < image->height; ++y) {
        const float *row = image->f32 + (size_t)y * image->width * 3;
        if (!lx_sink_append(&sink, scanline, encode_scanline(row, image->width, planes, scanline))) goto cleanup;
    }
    *out = sink.bytes;
    sink = (lx_sink){0};
    result = LX_OK;
cleanup:
    if (result != LX_OK) lx_fail_memory(error, "HDR");
    lx_sink_release(&sink);
    lx_free(header);
    lx_free(scanline);
    lx_free(planes);
    return result;
}
