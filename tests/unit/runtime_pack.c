// The runtime against a pack that is put together here byte by byte, after docs/pack-format.md and without our writer.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "runtime_fixture.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    directory_at = 64,
    pages_at = 320,
    layers_at = 384,
    strings_at = 512,
    rects_at = 576,
    index_at = 704,
    unknown_at = 768,
    blocks_at = 4096,
    file_bytes = blocks_at + 2 * 4096,
    sections = 7,
    layer_stride = 56, // longer than version 1 needs
};

static uint8_t pack_bytes[file_bytes];

static void put_u32(size_t at, uint32_t value)
{
    for (size_t i = 0; i < 4; ++i) pack_bytes[at + i] = (uint8_t)(value >> (8 * i));
}

static void put_f32(size_t at, float value)
{
    uint32_t bits;
    memcpy(&bits, &value, 4);
    put_u32(at, bits);
}

static void put_section(size_t number, const char *type, uint32_t offset, uint32_t count, uint32_t stride)
{
    const size_t at = directory_at + 32 * number;
    memcpy(pack_bytes + at, type, 4);
    put_u32(at + 4, 1);
    put_u32(at + 8, offset);
    put_u32(at + 16, count * stride);
    put_u32(at + 24, count);
    put_u32(at + 28, stride);
}

static void put_layer(uint32_t number, uint32_t name, uint32_t name_bytes, float intensity, float scale)
{
    const size_t at = layers_at + layer_stride * number;
    put_u32(at, name);
    put_u32(at + 4, name_bytes);
    for (size_t k = 0; k < 3; ++k) put_f32(at + 8 + 4 * k, 1);
    put_f32(at + 20, intensity);
    put_f32(at + 24, scale);
}

// red, green, blue mantissas of 9 bits and an exponent: value = mantissa × 2^(e - 24)
static uint32_t texel(uint32_t r, uint32_t g, uint32_t b, uint32_t e)
{
    return r | g << 9 | b << 18 | e << 27;
}

// One page of 40 texels with two levels (4 blocks + 1 block) and two layers. Layer "a" has block (1, 0) of level 0, "b" has level 1.
static void make_pack(void)
{
    memset(pack_bytes, 0, sizeof pack_bytes);
    memcpy(pack_bytes, "luxelpak", 8);
    put_u32(8, 1);
    put_u32(12, 64);
    put_u32(16, file_bytes);
    put_u32(24, 40);
    put_u32(28, 1);
    put_u32(32, 2);
    put_u32(36, 2);
    put_u32(40, 32);
    put_u32(44, sections);
    put_u32(48, directory_at);
    put_section(0, "????", unknown_at, 3, 7); // from a later version
    put_section(1, "PAGE", pages_at, 1, 16);
    put_section(2, "LAYR", layers_at, 2, layer_stride);
    put_section(3, "STRS", strings_at, 4, 1);
    put_section(4, "RECT", rects_at, 2, 48);
    put_section(5, "BIDX", index_at, 10, 4);
    put_section(6, "BLKS", blocks_at, 2, 4096);
    put_u32(pages_at, 40);
    put_u32(pages_at + 4, 40);
    put_f32(pages_at + 8, 0.5f);
    memcpy(pack_bytes + strings_at, "a\0b", 4);
    put_layer(0, 0, 1, 2, 4);
    put_layer(1, 2, 1, 1, 1);
    for (size_t i = 0; i < 2; ++i) {
        put_u32(rects_at + 48 * i, 5 + (uint32_t)i);
        put_u32(rects_at + 48 * i + 4, UINT32_MAX);
        put_f32(rects_at + 48 * i + 32, 1);
    }
    put_u32(index_at + 4 * 1, 1);       // layer a, level 0, block (1, 0)
    put_u32(index_at + 4 * (5 + 4), 2); // layer b, level 1
    put_u32(blocks_at, texel(256, 128, 511, 24));
    put_u32(blocks_at + 4 * (2 * 32 + 7), texel(1, 0, 0, 0)); // (39, 2): the smallest value
    put_u32(blocks_at + 4096 + 4 * (19 * 32 + 19), texel(511, 511, 511, 31));
}

static lxrt_result open_pack(void *memory, size_t memory_bytes, lxrt_pack **out)
{
    return lxrt_open(pack_bytes, sizeof pack_bytes, memory, memory_bytes, out);
}

static void hand_made_pack_is_read_as_documented(void **state)
{
    (void)state;
    static unsigned char memory[4096];
    lxrt_pack *pack = NULL;
    make_pack();
    assert_int_equal(open_pack(memory + 1, sizeof memory - 1, &pack), LXRT_OK); // memory of any alignment
    assert_int_equal(lxrt_find_layer(pack, "b"), 1);

    float rgb[3];
    assert_int_equal(compose(pack, 0, 0, 32, 0, 1, 1, rgb, 0), LXRT_OK);
    assert_float_equal(rgb[0], 256 * 2 * 4, 0); // mantissa × 2^(24 - 24) × intensity × scale
    assert_float_equal(rgb[1], 128 * 2 * 4, 0);
    assert_float_equal(rgb[2], 511 * 2 * 4, 0);
    assert_int_equal(compose(pack, 0, 0, 39, 2, 1, 1, rgb, 0), LXRT_OK);
    assert_float_equal(rgb[0], 0x1p-24f * 8, 0);
    assert_int_equal(compose(pack, 0, 0, 31, 0, 1, 1, rgb, 0), LXRT_OK);
    assert_float_equal(rgb[0], 0, 0);
    assert_int_equal(compose(pack, 0, 1, 19, 19, 1, 1, rgb, 0), LXRT_OK);
    assert_float_equal(rgb[2], 65408, 0);
    assert_int_equal(lxrt_set_layer(pack, 1, (const float[3]){0, 0.5f, 0}, 1), LXRT_OK);
    assert_int_equal(compose(pack, 0, 1, 19, 19, 1, 1, rgb, 0), LXRT_OK);
    assert_float_equal(rgb[1], 32704, 0);
    assert_float_equal(rgb[2], 0, 0);

    lxrt_rect rect;
    assert_int_equal(lxrt_find_rect(pack, 6, -1, &rect), LXRT_OK);
    assert_int_equal(lxrt_find_rect(pack, 7, -1, &rect), LXRT_ERROR_NOT_FOUND);
    // Texel centres of (32, 0) lie at (32.5 / 40, 0.5 / 40); half a texel further left the absent block begins.
    assert_int_equal(lxrt_lightmap_sample(pack, 0, 32.5f / 40, 0.5f / 40, LXRT_FILTER_BILINEAR, rgb), LXRT_OK);
    assert_float_equal(rgb[0], 2048, 0.01);
    assert_int_equal(lxrt_lightmap_sample(pack, 0, 32.25f / 40, 0.75f / 40, LXRT_FILTER_BILINEAR, rgb), LXRT_OK);
    assert_float_equal(rgb[0], 2048 * 0.75 * 0.75, 0.01);
}

static void every_documented_rule_is_checked(void **state)
{
    (void)state;
    static const struct {
        size_t at;
        uint32_t value;
        lxrt_result result;
    } cases[] = {
        {0, 0, LXRT_ERROR_NOT_A_PACK},
        {8, 0, LXRT_ERROR_VERSION},
        {12, 60, LXRT_ERROR_CORRUPT},
        {16, file_bytes + 1, LXRT_ERROR_TRUNCATED},
        {20, 1, LXRT_ERROR_TRUNCATED},
        {16, 63, LXRT_ERROR_CORRUPT},
        {24, 0, LXRT_ERROR_CORRUPT},
        {24, 41, LXRT_ERROR_CORRUPT},
        {24, 16385, LXRT_ERROR_CORRUPT},
        {28, 2, LXRT_ERROR_CORRUPT},
        {32, 1, LXRT_ERROR_CORRUPT},
        {32, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {36, 0, LXRT_ERROR_CORRUPT},
        {36, 7, LXRT_ERROR_CORRUPT}, // 40 >> 6 == 0
        {40, 64, LXRT_ERROR_CORRUPT},
        {44, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {44, 6, LXRT_ERROR_CORRUPT}, // the blocks are missing
        {pages_at + 8, 0xbf800000, LXRT_ERROR_CORRUPT}, // a coverage of -1
        {pages_at + 8, 0x3f800001, LXRT_ERROR_CORRUPT}, // beyond 1
        {48, file_bytes - 32, LXRT_ERROR_CORRUPT},
        {52, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {directory_at, 0x52594c41, LXRT_OK},                             // "ALYR": unknown as well
        {directory_at, 0x5259414c, LXRT_ERROR_CORRUPT},                  // "LAYR" twice
        {directory_at + 32 + 4, 2, LXRT_ERROR_VERSION},
        {directory_at + 32 + 8, file_bytes, LXRT_ERROR_CORRUPT},
        {directory_at + 32 + 12, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {directory_at + 32 + 16, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {directory_at + 32 + 16, 15, LXRT_ERROR_CORRUPT},
        {directory_at + 32 + 24, 0, LXRT_ERROR_CORRUPT},
        {directory_at + 32 + 28, 15, LXRT_ERROR_CORRUPT},
        {pages_at, 41, LXRT_ERROR_CORRUPT},
        {pages_at + 8, 0x7f800000, LXRT_ERROR_CORRUPT},
        {layers_at, 4, LXRT_ERROR_CORRUPT},                              // a name beyond the text
        {layers_at + 4, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {layers_at + 4, 2, LXRT_ERROR_CORRUPT},                          // a name that does not end
        {layers_at + 8, 0x7fc00000, LXRT_ERROR_CORRUPT},
        {layers_at + 20, 0x7f7fffff, LXRT_ERROR_CORRUPT},                // too bright to be summed
        {layers_at + 24, 0x40400000, LXRT_ERROR_CORRUPT},                // scale 3
        {layers_at + 24, 0, LXRT_ERROR_CORRUPT},
        {layers_at + 24, 0x80000000, LXRT_ERROR_CORRUPT},
        {layers_at + 28, 7, LXRT_OK},
        {layers_at + 28, 8, LXRT_ERROR_CORRUPT},
        {layers_at + 32, 2, LXRT_ERROR_CORRUPT},
        {layers_at + 48, 77, LXRT_OK},                                   // a later version's field
        {rects_at, 6, LXRT_ERROR_CORRUPT},                               // the same node twice
        {rects_at, 9, LXRT_ERROR_CORRUPT},                               // not sorted
        {rects_at + 4, 0x80000000, LXRT_ERROR_CORRUPT},
        {rects_at + 8, 1, LXRT_ERROR_CORRUPT},
        {rects_at + 16, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {rects_at + 28, 41, LXRT_ERROR_CORRUPT},
        {rects_at + 44, 0x7f800000, LXRT_ERROR_CORRUPT},
        {index_at + 8, 2, LXRT_OK},
        {index_at + 8, 3, LXRT_ERROR_CORRUPT},
        {index_at + 8, UINT32_MAX, LXRT_ERROR_CORRUPT},
        {blocks_at, UINT32_MAX, LXRT_OK},
    };
    static unsigned char memory[4096];
    for (size_t i = 0; i < sizeof cases / sizeof *cases; ++i) {
        lxrt_pack *pack = NULL;
        make_pack();
        put_u32(cases[i].at, cases[i].value);
        const lxrt_result result = open_pack(memory, sizeof memory, &pack);
        if (result != cases[i].result)
            fail_msg("u32 at %zu = %u: %s, not %s", cases[i].at, cases[i].value, lxrt_result_name(result),
                     lxrt_result_name(cases[i].result));
        assert_true((pack != NULL) == (result == LXRT_OK));
    }
}

static void arguments_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    static unsigned char memory[4096];
    lxrt_pack *pack = NULL;
    size_t needed = 0;
    make_pack();
    assert_int_equal(lxrt_memory_bytes(NULL, 0, &needed), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_memory_bytes(pack_bytes, sizeof pack_bytes, NULL), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_open(pack_bytes, sizeof pack_bytes, NULL, 0, &pack), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_memory_bytes(pack_bytes, sizeof pack_bytes, &needed), LXRT_OK);
    assert_true(needed <= sizeof memory);
    assert_int_equal(lxrt_open(pack_bytes, sizeof pack_bytes, memory, needed - 1, &pack), LXRT_ERROR_MEMORY_TOO_SMALL);
    assert_null(pack);
    assert_int_equal(lxrt_open(pack_bytes, sizeof pack_bytes, memory, needed, &pack), LXRT_OK);
    assert_int_equal(compose(pack, 0, 0, 0, 0, 0, 40, NULL, 0), LXRT_OK); // nothing to do
    assert_int_equal(compose(pack, 0, 0, 0, 0, 1, 1, NULL, 0), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(compose(pack, 0, 0, 41, 0, 0, 0, NULL, 0), LXRT_ERROR_INVALID_ARGUMENT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(hand_made_pack_is_read_as_documented),
        cmocka_unit_test(every_documented_rule_is_checked),
        cmocka_unit_test(arguments_that_make_no_sense_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
