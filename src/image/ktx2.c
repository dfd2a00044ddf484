// KTX 2.0 files: 2D arrays of the two formats that lightmaps come in.
//
// Based on: Khronos KTX File Format Specification 2.0, sections "File Structure", "levels[p]", "mipPadding", "KTXorientation";
// Khronos Data Format Specification 1.3, chapter "Khronos Basic Data Format Descriptor Block".
#include "image/ktx2.h"

#include "base/memory.h"
#include "image/codec.h"

#include <string.h>
#include <zstd.h>

enum {
    identifier_size = 12,
    header_size = 80, // identifier, 9 fields, index without levels
    level_entry_size = 24,
    scheme_none = 0,
    scheme_zstd = 2,
    // Not the highest: more effort gains little on noisy radiance and costs seconds a page.
    zstd_level = 9,
    // A block of Zstandard yields at most 128 KiB and takes at least four bytes (header of 3, one repeated byte).
    zstd_max_ratio = 128 * 1024 / 4,
};

static const uint8_t identifier[identifier_size] = {0xab, 'K', 'T', 'X', ' ', '2', '0', 0xbb, '\r', '\n', 0x1a, '\n'};

// Places in the header.
enum {
    at_vk_format = 12, at_type_size = 16, at_width = 20, at_height = 24, at_depth = 28, at_layer_count = 32,
    at_face_count = 36, at_level_count = 40, at_scheme = 44, at_dfd = 48, at_kvd = 56,
};

struct format_info {
    uint32_t vk_format, type_size, texel_bytes;
};

static struct format_info info_of(lx_ktx2_format format)
{
    if (format == LX_KTX2_RGB9E5) return (struct format_info){.vk_format = 123, .type_size = 4, .texel_bytes = 4};
    return (struct format_info){.vk_format = 97, .type_size = 2, .texel_bytes = 8};
}

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; ++i) out[i] = (uint8_t)(value >> 8 * i);
}

static void put_u64(uint8_t *out, uint64_t value)
{
    put_u32(out, (uint32_t)value);
    put_u32(out + 4, (uint32_t)(value >> 32));
}

static uint32_t get_u32(const uint8_t *in)
{
    return in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
}

static uint64_t get_u64(const uint8_t *in)
{
    return get_u32(in) | (uint64_t)get_u32(in + 4) << 32;
}

static uint32_t level_side(uint32_t side, uint32_t level)
{
    return side >> level ? side >> level : 1;
}

// Fits: sides and layers have at most 16 bits each, a texel 8 bytes.
static uint64_t level_bytes(const lx_ktx2 *texture, uint32_t level)
{
    return (uint64_t)level_side(texture->width, level) * level_side(texture->height, level) * texture->layer_count *
           info_of(texture->format).texel_bytes;
}

size_t lx_ktx2_level_size(const lx_ktx2 *texture, uint32_t level)
{
    return (size_t)level_bytes(texture, level);
}

// A full pyramid ends at 1×1.
static uint32_t most_levels(const lx_ktx2 *texture)
{
    uint32_t count = 1;
    while (count < lx_ktx2_max_levels && (texture->width >> count || texture->height >> count)) ++count;
    return count;
}

// What is in the way of this being a texture; NULL if nothing is.
static const char *shape_problem(const lx_ktx2 *texture)
{
    if (texture->width == 0 || texture->height == 0) return "no texels";
    if (texture->width > 65535 || texture->height > 65535) return "more than 65535 texels wide or high";
    if (texture->layer_count == 0 || texture->layer_count > 65535) return "no or more than 65535 layers";
    if (texture->level_count == 0 || texture->level_count > most_levels(texture)) return "impossible number of mip levels";
    return NULL;
}

// One sample of a data format descriptor: where the bits of a channel are and what they mean.
struct dfd_sample {
    uint32_t bit_offset, bit_count, channel, lower, upper;
};

enum {
    channel_r = 0, channel_g = 1, channel_b = 2, channel_a = 15,
    is_exponent = 0x20, is_signed_float = 0xc0, // qualifiers, in the same byte
    color_model_rgbsda = 1, primaries_bt709 = 1, transfer_linear = 1, dfd_version = 2,
};

// Shared exponent: every channel has its mantissa and the one exponent, with its bias and its largest value. 8448 is what
// Khronos' dfdutils writes for the mantissas.
static const struct dfd_sample rgb9e5_samples[] = {
    {0, 9, channel_r, 0, 8448},  {27, 5, channel_r | is_exponent, 15, 31},
    {9, 9, channel_g, 0, 8448},  {27, 5, channel_g | is_exponent, 15, 31},
    {18, 9, channel_b, 0, 8448}, {27, 5, channel_b | is_exponent, 15, 31},
};

// The range is -1 to 1, as bits of floats.
static const struct dfd_sample rgba16f_samples[] = {
    {0, 16, channel_r | is_signed_float, 0xbf800000u, 0x3f800000u},
    {16, 16, channel_g | is_signed_float, 0xbf800000u, 0x3f800000u},
    {32, 16, channel_b | is_signed_float, 0xbf800000u, 0x3f800000u},
    {48, 16, channel_a | is_signed_float, 0xbf800000u, 0x3f800000u},
};

enum { dfd_max_size = 4 + 24 + 6 * 16 };

// Total size, one basic descriptor block, its samples. Returns the bytes written.
static uint32_t write_dfd(lx_ktx2_format format, uint8_t out[dfd_max_size])
{
    const bool shared = format == LX_KTX2_RGB9E5;
    const struct dfd_sample *samples = shared ? rgb9e5_samples : rgba16f_samples;
    const uint32_t count = shared ? 6 : 4;
    const uint32_t block_size = 24 + 16 * count;
    memset(out, 0, dfd_max_size);
    put_u32(out, 4 + block_size);
    put_u32(out + 8, dfd_version | block_size << 16);
    put_u32(out + 12, color_model_rgbsda | primaries_bt709 << 8 | transfer_linear << 16);
    put_u32(out + 20, info_of(format).texel_bytes);
    for (uint32_t i = 0; i < count; ++i) {
        uint8_t *sample = out + 28 + 16 * i;
        put_u32(sample, samples[i].bit_offset | (samples[i].bit_count - 1) << 16 | samples[i].channel << 24);
        put_u32(sample + 8, samples[i].lower);
        put_u32(sample + 12, samples[i].upper);
    }
    return 4 + block_size;
}

// Fills with zeros up to a multiple of `alignment`.
static bool pad_to(lx_sink *sink, size_t alignment)
{
    const size_t aligned = (sink->bytes.size + alignment - 1) / alignment * alignment;
    return lx_sink_write_at(sink, aligned, NULL, 0);
}

// Key and value end with a zero byte each; both are counted.
static bool append_key_value(lx_sink *sink, const char *key, const char *value)
{
    const size_t key_size = strlen(key) + 1, value_size = strlen(value) + 1;
    uint8_t length[4];
    put_u32(length, (uint32_t)(key_size + value_size));
    return lx_sink_append(sink, length, 4) && lx_sink_append(sink, key, key_size) &&
           lx_sink_append(sink, value, value_size) && pad_to(sink, 4);
}

// Everything before the levels. The level index stays zero for now.
static bool append_head(lx_sink *sink, const lx_ktx2 *texture, bool zstd, const char *writer)
{
    const struct format_info info = info_of(texture->format);
    uint8_t header[header_size] = {0}, dfd[dfd_max_size];
    const uint32_t dfd_size = write_dfd(texture->format, dfd);
    const uint32_t dfd_offset = header_size + level_entry_size * texture->level_count;
    const uint32_t kvd_offset = dfd_offset + dfd_size;
    memcpy(header, identifier, identifier_size);
    put_u32(header + at_vk_format, info.vk_format);
    put_u32(header + at_type_size, info.type_size);
    put_u32(header + at_width, texture->width);
    put_u32(header + at_height, texture->height);
    put_u32(header + at_layer_count, texture->layer_count);
    put_u32(header + at_face_count, 1);
    put_u32(header + at_level_count, texture->level_count);
    put_u32(header + at_scheme, zstd ? scheme_zstd : scheme_none);
    put_u32(header + at_dfd, dfd_offset);
    put_u32(header + at_dfd + 4, dfd_size);
    // Keys in the order of their bytes, as the specification asks.
    if (!lx_sink_append(sink, header, header_size) || !lx_sink_write_at(sink, dfd_offset, dfd, dfd_size) ||
        !append_key_value(sink, "KTXorientation", "rd") || !append_key_value(sink, "KTXwriter", writer))
        return false;
    put_u32(sink->bytes.data + at_kvd, kvd_offset);
    put_u32(sink->bytes.data + at_kvd + 4, (uint32_t)(sink->bytes.size - kvd_offset));
    return true;
}

static lx_result append_compressed(lx_sink *sink, const lx_bytes *level, lx_error *error)
{
    const size_t bound = ZSTD_compressBound(level->size);
    void *packed = ZSTD_isError(bound) ? NULL : lx_malloc_array(bound, 1);
    if (!packed) return lx_fail_memory(error, "KTX2");
    lx_result result = LX_OK;
    const size_t size = ZSTD_compress(packed, bound, level->data, level->size, zstd_level);
    if (ZSTD_isError(size))
        result = lx_fail(error, LX_ERROR_BACKEND, "KTX2: cannot compress: %s", ZSTD_getErrorName(size));
    else if (!lx_sink_append(sink, packed, size))
        result = lx_fail_memory(error, "KTX2");
    lx_free(packed);
    return result;
}

// Appends a level and fills its place in the index.
static lx_result append_level(lx_sink *sink, const lx_ktx2 *texture, uint32_t level, bool zstd, lx_error *error)
{
    const lx_bytes *bytes = &texture->levels[level];
    // lcm(texel size, 4), and none for compressed levels
    if (!zstd && !pad_to(sink, info_of(texture->format).texel_bytes)) return lx_fail_memory(error, "KTX2");
    const size_t offset = sink->bytes.size;
    if (zstd) {
        const lx_result result = append_compressed(sink, bytes, error);
        if (result != LX_OK) return result;
    } else if (!lx_sink_append(sink, bytes->data, bytes->size)) {
        return lx_fail_memory(error, "KTX2");
    }
    uint8_t *entry = sink->bytes.data + header_size + level_entry_size * level;
    put_u64(entry, offset);
    put_u64(entry + 8, sink->bytes.size - offset);
    put_u64(entry + 16, bytes->size);
    return LX_OK;
}

lx_result lx_ktx2_encode(const lx_ktx2 *texture, bool zstd, const char *writer, lx_bytes *out, lx_error *error)
{
    const char *problem = shape_problem(texture);
    if (problem) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "KTX2: %s", problem);
    for (uint32_t level = 0; level < texture->level_count; ++level)
        if (texture->levels[level].size != level_bytes(texture, level))
            return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "KTX2: mip level %u has %zu bytes instead of %llu", level,
                           texture->levels[level].size, (unsigned long long)level_bytes(texture, level));
    lx_result result = LX_OK;
    lx_sink sink = {0};
    if (!append_head(&sink, texture, zstd, writer)) {
        result = lx_fail_memory(error, "KTX2");
        goto cleanup;
    }
    for (uint32_t level = texture->level_count; level-- > 0;) // smallest first
        LX_TRY(append_level(&sink, texture, level, zstd, error));
    *out = sink.bytes;
    sink = (lx_sink){0};
cleanup:
    lx_sink_release(&sink);
    return result;
}

static lx_result read_header(const uint8_t *data, size_t size, lx_ktx2 *texture, lx_error *error)
{
    if (size < identifier_size || memcmp(data, identifier, identifier_size) != 0)
        return lx_fail(error, LX_ERROR_FORMAT, "not a KTX2 texture");
    if (size < header_size) return lx_fail(error, LX_ERROR_FORMAT, "KTX2: truncated");
    const uint32_t vk_format = get_u32(data + at_vk_format);
    if (vk_format == info_of(LX_KTX2_RGB9E5).vk_format)
        texture->format = LX_KTX2_RGB9E5;
    else if (vk_format == info_of(LX_KTX2_RGBA16F).vk_format)
        texture->format = LX_KTX2_RGBA16F;
    else
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "KTX2: only E5B9G9R9 and R16G16B16A16 floats are supported, not VkFormat %u",
                       vk_format);
    if (get_u32(data + at_depth) != 0 || get_u32(data + at_face_count) != 1)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "KTX2: only 2D textures and their arrays are supported");
    const uint32_t layers = get_u32(data + at_layer_count), levels = get_u32(data + at_level_count);
    texture->width = get_u32(data + at_width);
    texture->height = get_u32(data + at_height);
    texture->layer_count = layers ? layers : 1;
    texture->level_count = levels ? levels : 1; // 0: "make your own mips"
    const char *problem = shape_problem(texture);
    if (problem) return lx_fail(error, LX_ERROR_FORMAT, "KTX2: %s", problem);
    if ((size - header_size) / level_entry_size < texture->level_count)
        return lx_fail(error, LX_ERROR_FORMAT, "KTX2: truncated");
    return LX_OK;
}

static lx_result decompress_level(const uint8_t *packed, size_t packed_size, uint32_t level, lx_bytes *out, lx_error *error)
{
    const size_t size = ZSTD_decompress(out->data, out->size, packed, packed_size);
    if (ZSTD_isError(size) || size != out->size)
        return lx_fail(error, LX_ERROR_FORMAT, "KTX2: mip level %u does not decompress to its size", level);
    return LX_OK;
}

static lx_result read_level(const uint8_t *data, size_t size, uint32_t level, lx_ktx2 *texture, lx_error *error)
{
    const uint8_t *entry = data + header_size + level_entry_size * (size_t)level;
    const uint64_t offset = get_u64(entry), stored = get_u64(entry + 8), unpacked = get_u64(entry + 16);
    const uint64_t expected = level_bytes(texture, level);
    const bool zstd = get_u32(data + at_scheme) == scheme_zstd;
    if (offset > size || stored > size - offset) return lx_fail(error, LX_ERROR_FORMAT, "KTX2: truncated");
    if (unpacked != expected || (!zstd && stored != expected))
        return lx_fail(error, LX_ERROR_FORMAT, "KTX2: mip level %u has the wrong size", level);
    if (zstd && expected / zstd_max_ratio > stored) // before allocating what cannot be there
        return lx_fail(error, LX_ERROR_FORMAT, "KTX2: mip level %u does not decompress to its size", level);
    lx_bytes *out = &texture->levels[level];
    out->data = lx_malloc_array((size_t)expected, 1);
    if (!out->data) return lx_fail_memory(error, "KTX2");
    out->size = (size_t)expected;
    if (zstd) return decompress_level(data + offset, (size_t)stored, level, out, error);
    memcpy(out->data, data + offset, out->size);
    return LX_OK;
}

lx_result lx_ktx2_decode(const void *data, size_t size, lx_ktx2 *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_ktx2 texture = {0};
    LX_TRY(read_header(data, size, &texture, error));
    const uint32_t scheme = get_u32((const uint8_t *)data + at_scheme);
    if (scheme != scheme_none && scheme != scheme_zstd)
        return lx_fail(error, LX_ERROR_UNSUPPORTED, "KTX2: supercompression scheme %u is not supported", scheme);
    uint64_t total = 0;
    for (uint32_t level = 0; level < texture.level_count; ++level) total += level_bytes(&texture, level);
    if (total > LX_KTX2_MAX_BYTES)
        return lx_fail(error, LX_ERROR_LIMIT, "KTX2: %llu bytes of texels are more than the limit",
                       (unsigned long long)total);
    for (uint32_t level = 0; level < texture.level_count; ++level)
        LX_TRY(read_level(data, size, level, &texture, error));
    *out = texture;
    texture = (lx_ktx2){0};
cleanup:
    lx_ktx2_release(&texture);
    return result;
}

void lx_ktx2_release(lx_ktx2 *texture)
{
    for (uint32_t level = 0; level < lx_ktx2_max_levels; ++level) lx_bytes_release(&texture->levels[level]);
    *texture = (lx_ktx2){0};
}
