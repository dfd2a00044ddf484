// The runtime's encoders against those of the image module: bit for bit, on each kernel. One texel of value 1, one layer: what is
// composed is the layer's colour itself.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "../../runtime/src/rt_kernel.h"
#include "image/encode.h"
#include "luxel_rt.h"
#include "runtime_random_pack.h"

#include <math.h>

static lxrt_pack *pack;
static unsigned char *data;
static uint64_t memory[512];
static lxrt_kernel kernels[8];
static const char *kernel_names[8];

static int open_white_texel(void **state)
{
    (void)state;
    size_t size, needed;
    for (uint32_t i = 0; (kernels[i] = lxrt_get_kernel(i, &kernel_names[i])) != NULL;) ++i; // asking is slow on virtual machines
    data = random_pack_make(&(random_pack){.page_size = 1, .page_count = 1, .layer_count = 1, .level_count = 1, .density = 1, .exponent_max = 31, .seed = 1},
                     &size);
    random_put_u32(data + size - 4096, 256 | 256 << 9 | 256 << 18 | 16u << 27); // 256 × 2^(16 - 24)
    return lxrt_memory_bytes(data, size, &needed) != LXRT_OK || needed > sizeof memory ||
           lxrt_open(data, size, memory, sizeof memory, &pack) != LXRT_OK;
}

static int close_white_texel(void **state)
{
    (void)state;
    free(data);
    return 0;
}

static float clamp(float value, float low, float high)
{
    return value < low ? low : value > high ? high : value;
}

static void check(const float rgb[3])
{
    assert_int_equal(lxrt_set_layer(pack, 0, rgb, 1), LXRT_OK);
    const lxrt_region region = {0, 0, 0, 0, 1, 1};
    const uint32_t want_word = lx_rgb9e5_encode((lx_rgb){rgb[0], rgb[1], rgb[2]});
    uint16_t want_halves[4] = {0, 0, 0, 0x3c00};
    for (int k = 0; k < 3; ++k) want_halves[k] = lx_half_from_float(0 + clamp(rgb[k], -65504, 65504));
    for (uint32_t i = 0; kernels[i]; ++i) {
        const char *name = kernel_names[i];
        uint32_t word;
        uint16_t halves[4];
        float floats[3];
        lxrt_use_kernel(pack, kernels[i]);
        assert_int_equal(lxrt_compose(pack, &region, &(lxrt_target){&word, 0, LXRT_FORMAT_RGB9E5, 1}), LXRT_OK);
        assert_int_equal(lxrt_compose(pack, &region, &(lxrt_target){halves, 0, LXRT_FORMAT_RGBA16F, 1}), LXRT_OK);
        assert_int_equal(lxrt_compose(pack, &region, &(lxrt_target){floats, 0, LXRT_FORMAT_RGB32F, 1}), LXRT_OK);
        if (word != want_word) fail_msg("%s: (%a, %a, %a) as RGB9E5: %08x, not %08x", name, rgb[0], rgb[1], rgb[2], word, want_word);
        for (int k = 0; k < 4; ++k)
            if (halves[k] != want_halves[k]) fail_msg("%s: half %d of (%a, %a, %a): %04x, not %04x", name, k, rgb[0], rgb[1], rgb[2], halves[k], want_halves[k]);
        for (int k = 0; k < 3; ++k)
            if (floats[k] != rgb[k]) fail_msg("%s: float %d: %a, not %a", name, k, floats[k], rgb[k]);
    }
}

static void every_kernel_encodes_corner_cases_as_the_image_module_does(void **state)
{
    (void)state;
    static const float corners[] = {0, 1, -1, 65408, 65407.9f, 65409, 65472, 65504, 65505, 65519.99f, 65520, 65536, 9e26f, -9e26f, 1e-30f, 0x1p-24f,
                                    0x1p-25f, 0x1.000002p-25f, 0x1p-26f, 0x1p-14f, 0x1.ffcp-15f, 0x1.ffep-15f, 0x1.fffp-15f, 0x1p-15f, 0x1p-16f,
                                    0x1.fep-16f, 0x1.ffp-16f, 0x1.fffffep-17f, 511.5f, 511.49997f, 0.49999997f, 255.5f, 255.49998f, 2047.5f, 2048.5f, 2049.5f};
    enum { count = sizeof corners / sizeof *corners };
    for (int r = 0; r < count; ++r)
        for (int g = 0; g < count; ++g) {
            check((const float[3]){corners[r], corners[g], corners[(r + g) % count]});
            // one step to either side: ties
            check((const float[3]){nextafterf(corners[r], 1e30f), nextafterf(corners[g], -1e30f), corners[g]});
        }
}

static void every_kernel_encodes_random_numbers_as_the_image_module_does(void **state)
{
    (void)state;
    uint32_t random = 5;
    for (int i = 0; i < 60000; ++i) {
        float rgb[3];
        for (int k = 0; k < 3; ++k) {
            // any sign and fraction; exponents from below the smallest half to above the largest
            const uint32_t bits = (random_next(&random) & 0x807fffffu) | (127 - 30 + random_next(&random) % 50) << 23;
            memcpy(&rgb[k], &bits, 4);
        }
        check(rgb);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_kernel_encodes_corner_cases_as_the_image_module_does),
        cmocka_unit_test(every_kernel_encodes_random_numbers_as_the_image_module_does),
    };
    return cmocka_run_group_tests(tests, open_white_texel, close_white_texel);
}
