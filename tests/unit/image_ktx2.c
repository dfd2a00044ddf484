// KTX2 files: layout as the specification has it, round trips, hostile input.
#include "base/memory.h"
#include "image/ktx2.h"

#include <setjmp.h>
#include <stdarg.h>
#include <string.h>

#include <cmocka.h>

static uint32_t get_u32(const uint8_t *in)
{
    return in[0] | (uint32_t)in[1] << 8 | (uint32_t)in[2] << 16 | (uint32_t)in[3] << 24;
}

static void put_u32(uint8_t *out, uint32_t value)
{
    for (int i = 0; i < 4; ++i) out[i] = (uint8_t)(value >> 8 * i);
}

// Bytes that differ by level and place.
static lx_ktx2 make_texture(lx_ktx2_format format, uint32_t width, uint32_t height, uint32_t layers, uint32_t levels)
{
    lx_ktx2 texture = {.format = format, .width = width, .height = height, .layer_count = layers, .level_count = levels};
    for (uint32_t level = 0; level < levels; ++level) {
        lx_bytes *bytes = &texture.levels[level];
        bytes->size = lx_ktx2_level_size(&texture, level);
        bytes->data = lx_malloc_array(bytes->size, 1);
        assert_non_null(bytes->data);
        for (size_t i = 0; i < bytes->size; ++i) bytes->data[i] = (uint8_t)(i * 7 + i / 50 + level * 31);
    }
    return texture;
}

static lx_bytes encode(const lx_ktx2 *texture, bool zstd)
{
    lx_bytes file = {0};
    lx_error error = {0};
    if (lx_ktx2_encode(texture, zstd, "luxel test", &file, &error) != LX_OK) fail_msg("%s", error.message);
    return file;
}

static lx_bytes encode_small(bool zstd)
{
    lx_ktx2 texture = make_texture(LX_KTX2_RGB9E5, 4, 4, 2, 2);
    const lx_bytes file = encode(&texture, zstd);
    lx_ktx2_release(&texture);
    return file;
}

static void check_round_trip(lx_ktx2_format format, uint32_t width, uint32_t height, uint32_t layers, uint32_t levels,
                             bool zstd)
{
    lx_ktx2 texture = make_texture(format, width, height, layers, levels), back = {0};
    lx_bytes file = encode(&texture, zstd);
    lx_error error = {0};
    if (lx_ktx2_decode(file.data, file.size, &back, &error) != LX_OK) fail_msg("%s", error.message);
    assert_int_equal(back.format, format);
    assert_int_equal(back.width, width);
    assert_int_equal(back.height, height);
    assert_int_equal(back.layer_count, layers);
    assert_int_equal(back.level_count, levels);
    for (uint32_t level = 0; level < levels; ++level) {
        assert_int_equal(back.levels[level].size, texture.levels[level].size);
        assert_memory_equal(back.levels[level].data, texture.levels[level].data, texture.levels[level].size);
    }
    lx_bytes_release(&file);
    lx_ktx2_release(&back);
    lx_ktx2_release(&texture);
}

static void ktx2_round_trips_in_all_variants(void **state)
{
    (void)state;
    for (int zstd = 0; zstd < 2; ++zstd) {
        check_round_trip(LX_KTX2_RGB9E5, 16, 16, 1, 1, zstd);
        check_round_trip(LX_KTX2_RGB9E5, 64, 32, 3, 7, zstd);
        check_round_trip(LX_KTX2_RGBA16F, 8, 8, 5, 4, zstd);
        check_round_trip(LX_KTX2_RGBA16F, 5, 3, 2, 3, zstd);
        check_round_trip(LX_KTX2_RGB9E5, 1, 1, 1, 1, zstd);
    }
}

static void ktx2_header_says_what_the_specification_asks(void **state)
{
    (void)state;
    lx_ktx2 texture = make_texture(LX_KTX2_RGBA16F, 12, 8, 3, 3);
    lx_bytes file = encode(&texture, false);
    const uint32_t expected[9] = {97, 2, 12, 8, 0, 3, 1, 3, 0};
    for (int i = 0; i < 9; ++i) assert_int_equal(get_u32(file.data + 12 + 4 * i), expected[i]);
    const uint32_t dfd_offset = get_u32(file.data + 48), dfd_size = get_u32(file.data + 52);
    const uint32_t kvd_offset = get_u32(file.data + 56), kvd_size = get_u32(file.data + 60);
    assert_int_equal(dfd_offset, 80 + 3 * 24);
    assert_int_equal(dfd_size, get_u32(file.data + dfd_offset));
    assert_int_equal(dfd_size, 4 + 24 + 4 * 16);
    assert_int_equal(kvd_offset, dfd_offset + dfd_size);
    assert_int_equal(kvd_size % 4, 0);
    assert_int_equal(get_u32(file.data + kvd_offset), 18);
    assert_memory_equal(file.data + kvd_offset + 4, "KTXorientation\0rd\0", 18);
    assert_memory_equal(file.data + kvd_offset + 28, "KTXwriter\0luxel test\0", 21);
    lx_bytes_release(&file);
    lx_ktx2_release(&texture);
}

static void ktx2_levels_are_stored_smallest_first_and_aligned(void **state)
{
    (void)state;
    lx_ktx2 texture = make_texture(LX_KTX2_RGBA16F, 4, 4, 3, 3);
    lx_bytes file = encode(&texture, false);
    uint32_t end = get_u32(file.data + 56) + get_u32(file.data + 60);
    for (uint32_t level = 3; level-- > 0;) {
        const uint8_t *entry = file.data + 80 + 24 * level;
        const uint32_t offset = get_u32(entry);
        assert_int_equal(offset, (end + 7) / 8 * 8);
        assert_int_equal(get_u32(entry + 8), texture.levels[level].size);
        assert_int_equal(get_u32(entry + 16), texture.levels[level].size);
        end = offset + get_u32(entry + 8);
    }
    assert_int_equal(end, file.size);
    lx_bytes_release(&file);
    lx_ktx2_release(&texture);
}

// The words that Khronos' own descriptor writer produces for VK_FORMAT_E5B9G9R9_UFLOAT_PACK32.
static void ktx2_rgb9e5_descriptor_shares_the_exponent(void **state)
{
    (void)state;
    lx_bytes file = encode_small(false);
    const uint8_t *dfd = file.data + get_u32(file.data + 48);
    const uint32_t expected[] = {
        124,        0,  2 | 120 << 16, 0x00010101, 0, 4, 0,
        0x00080000, 0, 0, 8448, 0x2004001b, 0, 15, 31,
        0x01080009, 0, 0, 8448, 0x2104001b, 0, 15, 31,
        0x02080012, 0, 0, 8448, 0x2204001b, 0, 15, 31,
    };
    for (size_t i = 0; i < sizeof expected / sizeof expected[0]; ++i) assert_int_equal(get_u32(dfd + 4 * i), expected[i]);
    lx_bytes_release(&file);
}

static void ktx2_every_shorter_file_is_refused(void **state)
{
    (void)state;
    for (int zstd = 0; zstd < 2; ++zstd) {
        lx_bytes file = encode_small(zstd);
        for (size_t size = 0; size < file.size; ++size) {
            uint8_t *shorter = lx_malloc_array(size, 1); // of its own, so that reading beyond is noticed
            memcpy(shorter, file.data, size);
            lx_ktx2 texture = {0};
            lx_error error = {0};
            assert_int_equal(lx_ktx2_decode(shorter, size, &texture, &error), LX_ERROR_FORMAT);
            assert_true(error.message[0] != '\0');
            lx_free(shorter);
        }
        lx_bytes_release(&file);
    }
}

static void ktx2_every_damaged_byte_is_survived(void **state)
{
    (void)state;
    for (int zstd = 0; zstd < 2; ++zstd) {
        lx_bytes file = encode_small(zstd);
        for (size_t i = 0; i < file.size * 8; ++i) {
            file.data[i / 8] ^= (uint8_t)(1 << i % 8);
            lx_ktx2 texture = {0};
            lx_ktx2_decode(file.data, file.size, &texture, NULL);
            lx_ktx2_release(&texture);
            file.data[i / 8] ^= (uint8_t)(1 << i % 8);
        }
        lx_bytes_release(&file);
    }
}

static void check_patched(uint32_t offset, uint32_t value, bool zstd, lx_result expected)
{
    lx_bytes file = encode_small(zstd);
    lx_ktx2 texture = {0};
    lx_error error = {0};
    put_u32(file.data + offset, value);
    const lx_result result = lx_ktx2_decode(file.data, file.size, &texture, &error);
    if (result != expected) fail_msg("%u at %u gives %d (%s) instead of %d", value, offset, result, error.message, expected);
    lx_bytes_release(&file);
}

static void ktx2_impossible_headers_are_refused(void **state)
{
    (void)state;
    check_patched(12, 37, false, LX_ERROR_UNSUPPORTED); // R8G8B8A8
    check_patched(20, 0, false, LX_ERROR_FORMAT);
    check_patched(24, 0, false, LX_ERROR_FORMAT);
    check_patched(20, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(28, 4, false, LX_ERROR_UNSUPPORTED); // 3D
    check_patched(32, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(36, 6, false, LX_ERROR_UNSUPPORTED); // cube
    check_patched(40, 4, false, LX_ERROR_FORMAT);
    check_patched(40, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(44, 1, false, LX_ERROR_UNSUPPORTED); // BasisLZ
    check_patched(80, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(84, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(92, 0xffffffff, false, LX_ERROR_FORMAT);
    check_patched(96, 0, false, LX_ERROR_FORMAT);
}

static void ktx2_bombs_are_refused_before_allocating(void **state)
{
    (void)state;
    check_patched(32, 60000, true, LX_ERROR_FORMAT); // more layers than the level's size says
    lx_bytes file = encode_small(true);
    lx_ktx2 texture = {0};
    lx_error error = {0};
    put_u32(file.data + 20, 60000);
    put_u32(file.data + 24, 60000);
    assert_int_equal(lx_ktx2_decode(file.data, file.size, &texture, &error), LX_ERROR_LIMIT);
    put_u32(file.data + 20, 16384);
    put_u32(file.data + 24, 16384);
    const uint64_t claimed = (uint64_t)16384 * 16384 * 4 * 2;
    put_u32(file.data + 96, (uint32_t)claimed);
    put_u32(file.data + 100, (uint32_t)(claimed >> 32));
    assert_int_equal(lx_ktx2_decode(file.data, file.size, &texture, &error), LX_ERROR_FORMAT);
    assert_string_equal(error.message, "KTX2: mip level 0 does not decompress to its size");
    lx_bytes_release(&file);
}

static void ktx2_without_layers_and_levels_reads_as_one(void **state)
{
    (void)state;
    lx_ktx2 texture = make_texture(LX_KTX2_RGBA16F, 8, 8, 1, 1), back = {0};
    lx_bytes file = encode(&texture, false);
    put_u32(file.data + 32, 0);
    put_u32(file.data + 40, 0);
    assert_int_equal(lx_ktx2_decode(file.data, file.size, &back, NULL), LX_OK);
    assert_int_equal(back.layer_count, 1);
    assert_int_equal(back.level_count, 1);
    lx_bytes_release(&file);
    lx_ktx2_release(&back);
    lx_ktx2_release(&texture);
}

static void ktx2_encoder_refuses_levels_of_the_wrong_size(void **state)
{
    (void)state;
    lx_ktx2 texture = make_texture(LX_KTX2_RGB9E5, 8, 8, 1, 2);
    lx_bytes file = {0};
    lx_error error = {0};
    texture.levels[1].size -= 4;
    assert_int_equal(lx_ktx2_encode(&texture, false, "x", &file, &error), LX_ERROR_INVALID_ARGUMENT);
    assert_string_equal(error.message, "KTX2: mip level 1 has 60 bytes instead of 64");
    assert_null(file.data);
    lx_ktx2_release(&texture);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(ktx2_round_trips_in_all_variants),
        cmocka_unit_test(ktx2_header_says_what_the_specification_asks),
        cmocka_unit_test(ktx2_levels_are_stored_smallest_first_and_aligned),
        cmocka_unit_test(ktx2_rgb9e5_descriptor_shares_the_exponent),
        cmocka_unit_test(ktx2_every_shorter_file_is_refused),
        cmocka_unit_test(ktx2_every_damaged_byte_is_survived),
        cmocka_unit_test(ktx2_impossible_headers_are_refused),
        cmocka_unit_test(ktx2_bombs_are_refused_before_allocating),
        cmocka_unit_test(ktx2_without_layers_and_levels_reads_as_one),
        cmocka_unit_test(ktx2_encoder_refuses_levels_of_the_wrong_size),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
