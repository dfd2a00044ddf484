#include "bake/gather_rays.h"

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>

#include <cmocka.h>

static void four_rays_serve_each_sample(void **state)
{
    (void)state;
    assert_int_equal(lx_gather_rays(1), 4);
    assert_int_equal(lx_gather_rays(1 << 24), 1 << 26);
}

static void large_scenes_spend_a_quarter_of_their_rays_at_most(void **state)
{
    (void)state;
    const uint32_t many = 1 << 24;
    for (uint32_t rays = 4; rays <= 1 << 16; rays *= 2) {
        const uint32_t count = lx_gather_pass_rays(rays, many);
        assert_int_equal(count, rays <= 64 ? 16 : rays >= 256 ? 64 : rays / 4);
    }
}

static void few_luxels_have_more_each(void **state)
{
    (void)state;
    assert_int_equal(lx_gather_pass_rays(1024, 1000), 256);
    assert_int_equal(lx_gather_pass_rays(1 << 16, 1000), lx_gather_most_pass_rays);
    assert_int_equal(lx_gather_pass_rays(256, 1000), 64); // a draft does not
    for (uint32_t luxels = 1; luxels < 1 << 22; luxels *= 2) { // twice as many luxels: as many rays in all at least, and never much beyond what is enough
        const uint64_t one = (uint64_t)lx_gather_pass_rays(4096, luxels) * luxels, two = (uint64_t)lx_gather_pass_rays(4096, 2 * luxels) * 2 * luxels;
        assert_true(one <= two);
        assert_true(one <= 2u << 24 || lx_gather_pass_rays(4096, luxels) == 64);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(four_rays_serve_each_sample), cmocka_unit_test(large_scenes_spend_a_quarter_of_their_rays_at_most),
                                       cmocka_unit_test(few_luxels_have_more_each)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
