// The denoiser: less noise, sharp shadow edges, nothing through walls, nothing done to what is exact.
#include "unit/post_fixture.h"

#include "post/denoise.h"

static lx_pool *pool;
static lx_estimate noisy[page_texels];
static lx_rgb truth[page_texels], clean[page_texels];

static int setup(void **state)
{
    (void)state;
    pool = lx_pool_create(2);
    return pool ? 0 : -1;
}

static int teardown(void **state)
{
    (void)state;
    lx_pool_destroy(pool);
    return 0;
}

// A floor of one chart, 1 m a texel.
static void one_floor(void)
{
    map_clear();
    map_add(0, 4, 4, 56, 56, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
}

// Estimates as a gather of four half buffers gives them: noise of the truth's relative standard error, variances from the buffers' spread.
static void add_noise(float relative, uint32_t seed)
{
    for (uint32_t i = 0; i < map.count; ++i) {
        float part[4], mean = 0, spread = 0;
        const float value = (truth[i].r + truth[i].g + truth[i].b) / 3;
        for (uint32_t k = 0; k < 4; ++k) mean += part[k] = 1 + 2 * relative * normal_of(seed + 1000 * k, i);
        mean /= 4;
        for (uint32_t k = 0; k < 4; ++k) spread += (part[k] - mean) * (part[k] - mean);
        noisy[i] = (lx_estimate){lx_rgb_scale(truth[i], mean), value * value * spread / 12};
    }
}

static const lx_denoise_knots *knots; // that denoise_part hands on

static void denoise_part(lx_step_test can_step, lx_light_part part)
{
    lx_denoise_graph *graph;
    lx_error error;
    if (lx_denoise_graph_create(&map, can_step, NULL, pool, &graph, &error) != LX_OK) fail_msg("%s", error.message);
    void *scratch = malloc(lx_denoise_scratch_bytes(graph));
    memset(scratch, 0x7f, lx_denoise_scratch_bytes(graph));
    lx_denoise_layer(graph, part, noisy, knots, scratch, clean);
    free(scratch);
    lx_denoise_graph_destroy(graph);
}

static void denoise_with(lx_step_test can_step) { denoise_part(can_step, lx_light_indirect); }

// Error after over error before, root mean square, over luxels whose texel's column lies in low … high - 1.
static double error_ratio(uint32_t low, uint32_t high)
{
    double before = 0, after = 0;
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t x = map.texel[i] % page_edge;
        if (x < low || x >= high) continue;
        before += pow((double)(noisy[i].mean.g - truth[i].g), 2);
        after += pow((double)(clean[i].g - truth[i].g), 2);
    }
    return sqrt(after / before);
}

static void denoise_smooth_light_loses_most_of_its_noise(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) {
        const lx_vec3 p = map.position[i];
        truth[i] = lx_rgb_of(1 + 0.02f * p.x, 2 + 0.02f * p.x + 0.01f * p.z, 3 - 0.01f * p.z);
    }
    static const float noises[] = {0.02f, 0.1f, 0.4f};
    for (int k = 0; k < 3; ++k) {
        add_noise(noises[k], 7);
        denoise_with(NULL);
        // A kernel of 3 × 3 alone would leave 0.375.
        const double ratio = error_ratio(0, page_edge);
        if (!(ratio < 0.35)) fail_msg("noise of %g: %.3f of it is left", (double)noises[k], ratio);
    }
}

enum { spacing = 4 };

static uint32_t luxel_at(uint32_t x, uint32_t z) { return luxel_index[(4 + z) * page_edge + 4 + x]; }

// Light between knots from the four around: a floor of 53 texels is 13 spacings wide.
static void interpolate(void *user, lx_rgb *light)
{
    (void)user;
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t x = (uint32_t)map.position[i].x, z = (uint32_t)map.position[i].z, x0 = x - x % spacing, z0 = z - z % spacing;
        if (x == x0 && z == z0) continue;
        light[i] = lx_rgb_grey(0);
        for (uint32_t k = 0; k < 4; ++k) {
            const float u = (float)(x - x0) / spacing, v = (float)(z - z0) / spacing, weight = (k & 1 ? u : 1 - u) * (k & 2 ? v : 1 - v);
            if (weight > 0) light[i] = lx_rgb_add(light[i], lx_rgb_scale(light[luxel_at(x0 + (k & 1) * spacing, z0 + (k >> 1) * spacing)], weight));
        }
    }
}

static void denoise_interpolated_light_loses_its_knots_noise(void **state)
{
    (void)state;
    static lx_rgb light[page_texels];
    static float share[page_texels];
    map_clear();
    map_add(0, 4, 4, 53, 53, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
    for (uint32_t i = 0; i < map.count; ++i) {
        const lx_vec3 p = map.position[i];
        truth[i] = lx_rgb_grey(2 + 0.02f * p.x + 0.01f * p.z);
        share[i] = (uint32_t)p.x % spacing || (uint32_t)p.z % spacing ? 0 : spacing * spacing;
    }
    add_noise(0.1f, 11);
    for (uint32_t i = 0; i < map.count; ++i) light[i] = noisy[i].mean;
    interpolate(NULL, light);
    for (uint32_t i = 0; i < map.count; ++i) noisy[i].mean = light[i];
    denoise_part(NULL, lx_light_indirect);
    const double untold = error_ratio(0, page_edge);
    knots = &(lx_denoise_knots){.share = share, .interpolate = interpolate};
    denoise_part(NULL, lx_light_indirect);
    knots = NULL;
    const double told = error_ratio(0, page_edge);
    if (!(told < 0.5 && told < 0.8 * untold)) fail_msg("%.3f of the error is left, %.3f if nobody tells", told, untold);
    memcpy(light, clean, sizeof light);
    interpolate(NULL, light);
    assert_memory_equal(light, clean, map.count * sizeof *clean);
}

static void denoise_shadow_edge_stays(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(map.texel[i] % page_edge < 30 ? 10 : 0.5f);
    add_noise(0.05f, 11);
    denoise_part(NULL, lx_light_direct);
    const double all = error_ratio(0, page_edge), edge = error_ratio(28, 32);
    if (!(all < 0.5) || !(edge < 0.9)) fail_msg("%.3f of the noise is left, %.3f at the edge", all, edge);
}

// What one source's light through a grille looks like: bars of two texels, slanted, and all of it is seen well enough.
static void denoise_fine_shadows_stay(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t x = map.texel[i] % page_edge, y = map.texel[i] / page_edge;
        truth[i] = lx_rgb_grey((x + y / 3) % 4 < 2 ? 1 : 0.7f);
    }
    static const float noises[] = {0.02f, 0.05f, 0.1f};
    for (int k = 0; k < 3; ++k) {
        add_noise(noises[k], 23);
        denoise_part(NULL, lx_light_direct);
        const double ratio = error_ratio(0, page_edge);
        if (!(ratio < 1)) fail_msg("noise of %g: error became %.3f of what it was", (double)noises[k], ratio);
    }
}

// An edge along the grid is as long as it is sharp: what lies along it is smoothed all the same.
static void denoise_straight_edge_loses_noise_along_itself(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(map.texel[i] / page_edge < 30 ? 2 : 0.5f);
    add_noise(0.1f, 29);
    denoise_part(NULL, lx_light_direct);
    double before = 0, after = 0;
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t y = map.texel[i] / page_edge;
        if (y < 29 || y > 30) continue;
        before += pow((double)(noisy[i].mean.g - truth[i].g), 2);
        after += pow((double)(clean[i].g - truth[i].g), 2);
    }
    if (!(sqrt(after / before) < 0.75)) fail_msg("%.3f of the noise is left beside the edge", sqrt(after / before));
}

// Well spread samples have less error together than their halves: variances of three times the error must not make the filter blur.
static void denoise_overstated_variance_does_not_blur(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) {
        const float x = map.position[i].x, z = map.position[i].z;
        truth[i] = lx_rgb_grey(1 + 0.1f * sinf(0.7f * x) + 0.1f * cosf(0.5f * z + 0.2f * x)); // waves of nine texels and more
    }
    static const float noises[] = {0.01f, 0.02f, 0.05f};
    for (int k = 0; k < 3; ++k) {
        add_noise(noises[k], 31);
        for (uint32_t i = 0; i < map.count; ++i) noisy[i].variance *= 3;
        denoise_with(NULL);
        const double ratio = error_ratio(0, page_edge);
        if (!(ratio < 0.9)) fail_msg("noise of %g: error became %.3f of what it was", (double)noises[k], ratio);
    }
}

static void denoise_no_value_is_invented(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(random_of(37, i / 16) < 0.1f ? 50 : 0); // on black
    add_noise(0.5f, 37);
    float most = 0;
    for (uint32_t i = 0; i < map.count; ++i) {
        noisy[i].mean.g = lx_max(noisy[i].mean.g, 0);
        noisy[i].variance += 0.01f;
        most = lx_max(most, noisy[i].mean.g);
    }
    for (int part = 0; part < 2; ++part) {
        denoise_part(NULL, part ? lx_light_indirect : lx_light_direct);
        for (uint32_t i = 0; i < map.count; ++i)
            if (!(clean[i].g >= 0 && clean[i].g <= most)) fail_msg("texel %u became %g", map.texel[i], (double)clean[i].g);
    }
}

static void denoise_bright_spot_does_not_run(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(map.texel[i] == 30 * page_edge + 30 ? 1000 : 1);
    add_noise(0.03f, 13);
    denoise_part(NULL, lx_light_direct);
    for (uint32_t i = 0; i < map.count; ++i)
        if (map.texel[i] != 30 * page_edge + 30 && !(clean[i].g < 1.2f)) fail_msg("texel %u became %g", map.texel[i], (double)clean[i].g);
    assert_true(fabsf(clean[luxel_index[30 * page_edge + 30]].g - 1000) < 100); // three standard errors
}

static void denoise_exact_light_stays_bit_by_bit(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) {
        truth[i] = lx_rgb_grey(random_of(3, i));
        noisy[i] = (lx_estimate){truth[i], 0};
    }
    denoise_with(NULL);
    assert_memory_equal(clean, truth, map.count * sizeof *truth);
    // Exact but for one far corner: what that cannot reach stays too.
    noisy[map.count - 1].variance = 0.1f;
    denoise_with(NULL);
    assert_memory_equal(clean, truth, 28 * 56 * sizeof *truth);
}

static void denoise_nearly_clean_light_stays(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(1 + 0.3f * random_of(5, i)); // a pattern that is no noise
    add_noise(0.002f, 17);
    for (int part = 0; part < 2; ++part) {
        denoise_part(NULL, part ? lx_light_indirect : lx_light_direct);
        const double ratio = error_ratio(0, page_edge);
        // The guide follows the noise of luxels that chance made alike, and indirect light is never such a pattern.
        if (!(ratio <= (part ? 1.1 : 1.01))) fail_msg("error became %.3f of what it was", ratio);
    }
}

// Indirect light changes within few luxels where a sunlit edge is near: candidates that the pilot guides stay on their side.
static void denoise_indirect_light_is_guided(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(map.texel[i] % page_edge < 30 ? 1 : 1.3f);
    add_noise(0.03f, 23);
    denoise_with(NULL);
    const double ratio = error_ratio(26, 34); // 0.79 without a guide
    if (!(ratio < 0.65)) fail_msg("beside the edge %.3f of the noise is left", ratio);
}

static bool crosses(float a, float b) { return (a < 30) != (b < 30); }

static void wall_at_30(void *user, const lx_luxel_step *steps, size_t count, bool *open)
{
    (void)user;
    for (size_t i = 0; i < count; ++i) open[i] = !crosses(map.position[steps[i].from].x, map.position[steps[i].to].x);
}

static void denoise_light_does_not_pass_a_wall(void **state)
{
    (void)state;
    one_floor();
    // Noise that hides the difference: only the wall can keep the two rooms apart.
    for (uint32_t i = 0; i < map.count; ++i) {
        truth[i] = lx_rgb_grey(map.position[i].x < 30 ? 1 : 0);
        noisy[i] = (lx_estimate){truth[i], 4};
    }
    denoise_with(wall_at_30);
    for (uint32_t i = 0; i < map.count; ++i)
        if (!(fabsf(clean[i].g - truth[i].g) < 1e-5f)) fail_msg("texel %u became %g", map.texel[i], (double)clean[i].g); // rounding
    denoise_with(NULL);
    double leaked = 0;
    for (uint32_t i = 0; i < map.count; ++i) leaked += (double)fabsf(clean[i].g - truth[i].g);
    assert_true(leaked > 1); // without it they would mix: the test can fail
}

static void denoise_invalid_luxels_give_nothing_and_part_what_they_part(void **state)
{
    (void)state;
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) {
        const uint32_t x = map.texel[i] % page_edge;
        luxel_valid[i] = x != 30;
        truth[i] = lx_rgb_grey(x < 30 ? 1 : x == 30 ? 1e6f : 0);
        noisy[i] = (lx_estimate){truth[i], 4};
    }
    denoise_with(NULL);
    for (uint32_t i = 0; i < map.count; ++i)
        if (map.valid[i] && !(fabsf(clean[i].g - truth[i].g) < 1e-5f)) fail_msg("texel %u became %g", map.texel[i], (double)clean[i].g);
}

static void denoise_goes_on_across_a_seam_and_not_across_a_right_angle(void **state)
{
    (void)state;
    // Two halves of one floor in charts that are turned against each other, and a wall at the first one's far end.
    map_clear();
    map_add(0, 2, 2, 6, 20, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
    map_add(1, 20, 2, 20, 6, lx_v3(6, 0, 19), lx_v3(0, 0, -1), lx_v3(1, 0, 0));
    for (uint32_t i = 120; i < 240; ++i) luxel_normal[i] = lx_v3(0, 1, 0); // turned, not turned over
    for (uint32_t i = 0; i < 120; ++i) luxel_normal[i] = lx_v3(0, 1, 0);
    map_add(2, 2, 40, 6, 10, lx_v3(0, 0.5f, -0.5f), lx_v3(1, 0, 0), lx_v3(0, 1, 0));
    for (uint32_t i = 240; i < map.count; ++i) luxel_normal[i] = lx_v3(0, 0, 1);
    for (uint32_t i = 0; i < map.count; ++i) noisy[i] = (lx_estimate){lx_rgb_grey(luxel_chart[i] == 1 ? 1 : 0), 4};
    denoise_with(NULL);
    const uint32_t at_seam = luxel_index[10 * page_edge + 7], on_wall = luxel_index[40 * page_edge + 4];
    if (!(clean[at_seam].g > 0.1f)) fail_msg("beside the seam: %g", (double)clean[at_seam].g);
    assert_true(clean[on_wall].g == 0);
}

static void denoise_any_number_of_threads_gives_the_same_bits(void **state)
{
    (void)state;
    static lx_rgb first[page_texels];
    one_floor();
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(1 + random_of(9, i / 64));
    add_noise(0.2f, 19);
    denoise_with(wall_at_30);
    memcpy(first, clean, sizeof first);
    lx_pool *const two = pool;
    pool = lx_pool_create(1);
    denoise_with(wall_at_30);
    lx_pool_destroy(pool);
    pool = two;
    assert_memory_equal(first, clean, map.count * sizeof *clean);
}

static void swap_luxels(uint32_t a, uint32_t b)
{
#define SWAP(array) do { const __typeof__(array[0]) kept = array[a]; array[a] = array[b]; array[b] = kept; } while (0)
    SWAP(luxel_texel);
    SWAP(luxel_position);
    SWAP(noisy);
#undef SWAP
    luxel_index[luxel_texel[a]] = a;
    luxel_index[luxel_texel[b]] = b;
}

// Luxels that lie far from each other in memory: pools of a block reach more of them than are mixed at a time.
static void denoise_order_of_luxels_does_not_matter(void **state)
{
    (void)state;
    static lx_rgb by_texel[page_texels];
    map_clear();
    map_add(0, 0, 0, page_edge, page_edge, lx_v3(0, 0, 0), lx_v3(1, 0, 0), lx_v3(0, 0, 1));
    for (uint32_t i = 0; i < map.count; ++i) truth[i] = lx_rgb_grey(1 + random_of(41, i / 64));
    add_noise(0.2f, 41);
    for (int part = 0; part < 2; ++part) {
        denoise_part(NULL, part ? lx_light_indirect : lx_light_direct);
        for (uint32_t i = 0; i < map.count; ++i) by_texel[map.texel[i]] = clean[i];
        for (uint32_t i = map.count; i-- > 1;) swap_luxels(i, (uint32_t)(random_of(43, i) * (float)i));
        denoise_part(NULL, part ? lx_light_indirect : lx_light_direct);
        for (uint32_t i = 0; i < map.count; ++i) assert_memory_equal(&by_texel[map.texel[i]], &clean[i], sizeof *clean);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(denoise_smooth_light_loses_most_of_its_noise),
        cmocka_unit_test(denoise_interpolated_light_loses_its_knots_noise),
        cmocka_unit_test(denoise_shadow_edge_stays),
        cmocka_unit_test(denoise_fine_shadows_stay),
        cmocka_unit_test(denoise_straight_edge_loses_noise_along_itself),
        cmocka_unit_test(denoise_overstated_variance_does_not_blur),
        cmocka_unit_test(denoise_no_value_is_invented),
        cmocka_unit_test(denoise_bright_spot_does_not_run),
        cmocka_unit_test(denoise_exact_light_stays_bit_by_bit),
        cmocka_unit_test(denoise_nearly_clean_light_stays),
        cmocka_unit_test(denoise_indirect_light_is_guided),
        cmocka_unit_test(denoise_light_does_not_pass_a_wall),
        cmocka_unit_test(denoise_invalid_luxels_give_nothing_and_part_what_they_part),
        cmocka_unit_test(denoise_goes_on_across_a_seam_and_not_across_a_right_angle),
        cmocka_unit_test(denoise_any_number_of_threads_gives_the_same_bits),
        cmocka_unit_test(denoise_order_of_luxels_does_not_matter),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
