// Accumulators on a page whose layers lie in known blocks: what a begin asks for, what an update writes and what it leaves alone.
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <cmocka.h>

#include "luxel_rt.h"
#include "runtime_random_pack.h"

#include <math.h>
#include <pthread.h>

enum { size = 160, across = 5, layer_count = 6, guard = 0x5a };

static unsigned char *data;
static lxrt_pack *pack;
static void *pack_memory, *memory;
static lxrt_accumulator *accumulator;
static unsigned char target_bytes[size * size * 12], composed[size * size * 12];

static int open_page(void **state)
{
    (void)state;
    size_t bytes, needed;
    data = random_pack_make(&(random_pack){.page_size = size, .page_count = 2, .layer_count = layer_count, .level_count = 2, .density = 1,
                                           .exponent_min = 14, .exponent_max = 24, .seed = 4}, &bytes);
    // Of page 1, layer 2 keeps blocks (1, 2) and (3, 3) of level 0 and none of level 1, layer 5 nothing.
    unsigned char *index = NULL;
    for (int i = 0; i < 5; ++i)
        if (memcmp(data + 64 + 32 * i, "BIDX", 4) == 0) index = data + (data[64 + 32 * i + 8] | data[64 + 32 * i + 9] << 8 | data[64 + 32 * i + 10] << 16);
    const uint32_t entries = across * across + 9;
    for (uint32_t entry = 0; entry < entries; ++entry) {
        if (entry != 2 * across + 1 && entry != 3 * across + 3) random_put_u32(index + 4 * ((layer_count + 2) * entries + entry), 0);
        random_put_u32(index + 4 * ((layer_count + 5) * entries + entry), 0);
    }
    if (lxrt_memory_bytes(data, bytes, &needed) != LXRT_OK) return 1;
    pack_memory = malloc(needed);
    if (lxrt_open(data, bytes, pack_memory, needed, &pack) != LXRT_OK) return 1;
    memory = malloc(lxrt_accumulator_bytes(pack) + 1);
    return lxrt_accumulator_create(pack, 1, (char *)memory + 1, lxrt_accumulator_bytes(pack), &accumulator) != LXRT_OK; // any alignment
}

static int close_page(void **state)
{
    (void)state;
    free(memory);
    free(pack_memory);
    free(data);
    return 0;
}

static lxrt_target target_at(const lxrt_region *region, unsigned char *bytes, lxrt_format format)
{
    const size_t texel = lxrt_format_bytes(format), row = (size >> region->level) * texel;
    return (lxrt_target){bytes + row * region->y + texel * region->x, row, format, 1};
}

static lxrt_result update(uint32_t level, lxrt_format format)
{
    lxrt_region region;
    assert_int_equal(lxrt_accumulator_bounds(accumulator, level, &region), LXRT_OK);
    const lxrt_target target = target_at(&region, target_bytes, format);
    return lxrt_accumulator_update(accumulator, &region, &target);
}

static void compose_page(uint32_t level, lxrt_format format)
{
    const lxrt_region region = {1, level, 0, 0, size >> level, size >> level};
    const lxrt_target target = target_at(&region, composed, format);
    assert_int_equal(lxrt_compose(pack, &region, &target), LXRT_OK);
}

static size_t page_bytes(uint32_t level, lxrt_format format)
{
    return (size_t)(size >> level) * (size >> level) * lxrt_format_bytes(format);
}

static void set_grey(uint32_t layer, float grey)
{
    assert_int_equal(lxrt_set_layer(pack, layer, (const float[3]){grey, grey, grey}, 1), LXRT_OK);
}

static void first_begin_asks_for_the_page_and_gives_the_composed_bytes(void **state)
{
    (void)state;
    assert_true(lxrt_accumulator_begin(accumulator) > 0);
    for (uint32_t level = 0; level < 2; ++level) {
        lxrt_region bounds;
        assert_int_equal(lxrt_accumulator_bounds(accumulator, level, &bounds), LXRT_OK);
        assert_int_equal(bounds.page, 1);
        assert_int_equal(bounds.level, level);
        assert_int_equal(bounds.width, size >> level);
        assert_int_equal(bounds.height, size >> level);
        for (int f = 0; f < 3; ++f) {
            assert_int_equal(update(level, (lxrt_format)f), LXRT_OK);
            compose_page(level, (lxrt_format)f);
            assert_memory_equal(target_bytes, composed, page_bytes(level, (lxrt_format)f));
        }
    }
}

static void first_begin_of_a_black_page_clears_it(void **state)
{
    (void)state;
    for (uint32_t layer = 0; layer < layer_count; ++layer) set_grey(layer, 0);
    assert_true(lxrt_accumulator_begin(accumulator) > 0);
    memset(target_bytes, guard, sizeof target_bytes);
    assert_int_equal(update(0, LXRT_FORMAT_RGB9E5), LXRT_OK);
    for (size_t i = 0; i < page_bytes(0, LXRT_FORMAT_RGB9E5); ++i) assert_int_equal(target_bytes[i], 0);
}

static void unchanged_colours_ask_for_nothing_and_write_nothing(void **state)
{
    (void)state;
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB9E5);
    memset(target_bytes, guard, sizeof target_bytes);
    for (int i = 0; i < 200; ++i) {
        lxrt_region bounds;
        assert_int_equal(lxrt_accumulator_begin(accumulator), 0);
        assert_int_equal(lxrt_accumulator_bounds(accumulator, 0, &bounds), LXRT_OK);
        assert_int_equal(bounds.width, 0);
        bounds = (lxrt_region){1, 0, 0, 0, size, size};
        const lxrt_target target = {target_bytes, 0, LXRT_FORMAT_RGB9E5, 1};
        assert_int_equal(lxrt_accumulator_update(accumulator, &bounds, &target), LXRT_OK);
    }
    for (size_t i = 0; i < sizeof target_bytes; ++i) assert_int_equal(target_bytes[i], guard);
}

static void one_changed_layer_touches_its_own_blocks_alone(void **state)
{
    (void)state;
    lxrt_accumulator_begin(accumulator);
    for (uint32_t level = 0; level < 2; ++level) update(level, LXRT_FORMAT_RGB32F);
    set_grey(2, 3.5f);
    set_grey(5, 9); // lies on the other page
    assert_int_equal(lxrt_accumulator_begin(accumulator), 1);
    lxrt_region bounds;
    lxrt_accumulator_bounds(accumulator, 1, &bounds);
    assert_int_equal(bounds.width, 0);
    lxrt_accumulator_bounds(accumulator, 0, &bounds);
    assert_int_equal(bounds.x, 32);
    assert_int_equal(bounds.y, 64);
    assert_int_equal(bounds.width, 96);
    assert_int_equal(bounds.height, 64);
    memset(target_bytes, guard, sizeof target_bytes);
    assert_int_equal(update(0, LXRT_FORMAT_RGB32F), LXRT_OK);
    compose_page(0, LXRT_FORMAT_RGB32F);
    for (uint32_t y = 0; y < size; ++y) {
        for (uint32_t x = 0; x < size; ++x) {
            const int is_changed = (x / 32 == 1 && y / 32 == 2) || (x / 32 == 3 && y / 32 == 3);
            for (uint32_t k = 0; k < 3; ++k) {
                const size_t at = 4 * (3 * (size_t)(size * y + x) + k);
                float got, want;
                memcpy(&got, target_bytes + at, 4);
                memcpy(&want, composed + at, 4);
                if (!is_changed) {
                    assert_int_equal(target_bytes[at], guard);
                } else if (!(fabsf(got - want) <= 1e-6f * want)) { // some ten roundings of positive numbers, 2^-24 each
                    fail_msg("(%u, %u) channel %u: %.9g, not %.9g", x, y, k, got, want);
                }
            }
        }
    }
}

static void all_layers_changed_give_the_composed_bytes(void **state)
{
    (void)state;
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB32F);
    for (uint32_t layer = 0; layer < layer_count; ++layer) set_grey(layer, 0.3f + (float)layer);
    assert_int_equal(lxrt_accumulator_begin(accumulator), layer_count - 1); // layer 5 is not here
    assert_int_equal(update(0, LXRT_FORMAT_RGB32F), LXRT_OK);
    compose_page(0, LXRT_FORMAT_RGB32F);
    assert_memory_equal(target_bytes, composed, page_bytes(0, LXRT_FORMAT_RGB32F));
}

// Updates by differences until a begin asks for everything; returns how many begins that took.
static int begins_until_full(int changes)
{
    static float grey = 2;
    for (int i = 1;; ++i) {
        lxrt_region bounds;
        if (changes) set_grey(2, grey += 0.37f);
        lxrt_accumulator_begin(accumulator);
        update(0, LXRT_FORMAT_RGB32F);
        lxrt_accumulator_bounds(accumulator, 0, &bounds);
        if (bounds.width == size) return i;
        assert_true(i < 1000);
    }
}

static void every_64th_begin_makes_all_sums_anew(void **state)
{
    (void)state;
    begins_until_full(1);
    for (int round = 0; round < 3; ++round) {
        assert_int_equal(begins_until_full(1), 64);
        compose_page(0, LXRT_FORMAT_RGB32F);
        assert_memory_equal(target_bytes, composed, page_bytes(0, LXRT_FORMAT_RGB32F));
    }
}

static void what_a_bright_light_leaves_behind_is_gone_after_64_begins(void **state)
{
    (void)state;
    for (uint32_t layer = 0; layer < layer_count; ++layer) set_grey(layer, layer == 1 ? 1e-6f : 0);
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB32F);
    set_grey(2, 1e9f);
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB32F);
    set_grey(2, 0);
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB32F);
    assert_true(begins_until_full(0) < 64); // though nothing changes any more
    compose_page(0, LXRT_FORMAT_RGB32F);
    assert_memory_equal(target_bytes, composed, page_bytes(0, LXRT_FORMAT_RGB32F));
    assert_int_equal(lxrt_accumulator_begin(accumulator), 0);
}

static void reset_asks_for_the_whole_page_again(void **state)
{
    (void)state;
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGBA16F);
    lxrt_accumulator_reset(accumulator);
    memset(target_bytes, guard, sizeof target_bytes);
    assert_int_equal(lxrt_accumulator_begin(accumulator), 1);
    update(0, LXRT_FORMAT_RGBA16F);
    compose_page(0, LXRT_FORMAT_RGBA16F);
    assert_memory_equal(target_bytes, composed, page_bytes(0, LXRT_FORMAT_RGBA16F));
}

static void two_hundred_changes_stay_within_roundings_of_the_composer(void **state)
{
    (void)state;
    uint32_t random = 17;
    for (int i = 0; i < 200; ++i) {
        set_grey(random_next(&random) % layer_count, (float)(random_next(&random) % 1000) * 0.01f);
        lxrt_accumulator_begin(accumulator);
        update(0, LXRT_FORMAT_RGB32F);
        compose_page(0, LXRT_FORMAT_RGB32F);
        for (size_t at = 0; at < page_bytes(0, LXRT_FORMAT_RGB32F); at += 4) {
            float got, want;
            memcpy(&got, target_bytes + at, 4);
            memcpy(&want, composed + at, 4);
            // at most 63 changes, each a rounding of the change and one of the sum; terms are below 10 × 511 × 2^0 × 6 layers
            if (!(fabsf(got - want) <= 63 * 2 * 30660 * 0x1p-24f)) fail_msg("step %d, byte %zu: %.9g, not %.9g", i, at, got, want);
        }
    }
}

typedef struct half_page {
    lxrt_region region;
    lxrt_result result;
} half_page;

static void *update_half(void *argument)
{
    half_page *half = argument;
    const lxrt_target target = target_at(&half->region, target_bytes, LXRT_FORMAT_RGB9E5);
    half->result = lxrt_accumulator_update(accumulator, &half->region, &target);
    return NULL;
}

static void parts_by_two_threads_give_the_bytes_of_the_whole(void **state)
{
    (void)state;
    lxrt_accumulator_begin(accumulator);
    update(0, LXRT_FORMAT_RGB9E5);
    for (int round = 0; round < 64; ++round) {
        for (uint32_t layer = 0; layer < layer_count; ++layer) set_grey(layer, 1 + (float)((round + 1) * (layer + 1)));
        lxrt_accumulator_begin(accumulator);
        half_page halves[2] = {{{1, 0, 0, 0, size, 64}, LXRT_OK}, {{1, 0, 0, 64, size, size - 64}, LXRT_OK}};
        pthread_t thread;
        assert_int_equal(pthread_create(&thread, NULL, update_half, &halves[1]), 0);
        update_half(&halves[0]);
        pthread_join(thread, NULL);
        assert_int_equal(halves[0].result, LXRT_OK);
        assert_int_equal(halves[1].result, LXRT_OK);
        compose_page(0, LXRT_FORMAT_RGB9E5);
        assert_memory_equal(target_bytes, composed, page_bytes(0, LXRT_FORMAT_RGB9E5)); // all change: made anew
    }
}

static void changes_added_by_two_threads_give_the_bytes_of_one(void **state)
{
    (void)state;
    static unsigned char by_one[sizeof target_bytes];
    for (int threads = 1; threads <= 2; ++threads) {
        lxrt_accumulator_reset(accumulator);
        for (uint32_t layer = 0; layer < layer_count; ++layer) set_grey(layer, 1 + (float)layer);
        lxrt_accumulator_begin(accumulator);
        update(0, LXRT_FORMAT_RGB9E5);
        for (int round = 0; round < 20; ++round) {
            // One layer changes: what has enough others to be worth it, blocks (1, 2) and (3, 3), gets the difference added.
            set_grey((uint32_t)round % 2, 0.37f * (float)(round + 1));
            assert_int_equal(lxrt_accumulator_begin(accumulator), 1);
            half_page halves[2] = {{{1, 0, 0, 0, size, 96}, LXRT_OK}, {{1, 0, 0, 96, size, size - 96}, LXRT_OK}};
            pthread_t thread;
            if (threads == 2) assert_int_equal(pthread_create(&thread, NULL, update_half, &halves[1]), 0);
            if (threads == 1) update_half(&halves[1]);
            update_half(&halves[0]);
            if (threads == 2) pthread_join(thread, NULL);
            assert_int_equal(halves[0].result, LXRT_OK);
            assert_int_equal(halves[1].result, LXRT_OK);
        }
        if (threads == 1) memcpy(by_one, target_bytes, sizeof by_one);
    }
    assert_memory_equal(target_bytes, by_one, page_bytes(0, LXRT_FORMAT_RGB9E5));
}

static void arguments_that_make_no_sense_are_refused(void **state)
{
    (void)state;
    const lxrt_target target = {target_bytes, 0, LXRT_FORMAT_RGB32F, 1};
    lxrt_accumulator *other = NULL;
    const size_t bytes = lxrt_accumulator_bytes(pack);
    assert_true(bytes >= 12 * (size * size + size * size / 4));
    assert_int_equal(lxrt_accumulator_create(pack, 2, memory, bytes, &other), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_accumulator_create(pack, 0, NULL, bytes, &other), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_accumulator_create(pack, 0, memory, bytes - 1, &other), LXRT_ERROR_MEMORY_TOO_SMALL);
    assert_null(other);
    lxrt_accumulator_begin(accumulator);
    static const lxrt_region regions[] = {{0, 0, 0, 0, 32, 32}, {1, 2, 0, 0, 32, 32}, {1, 0, 16, 0, 32, 32}, {1, 0, 0, 0, 31, 32},
                                          {1, 0, 0, 0, 32, 33}, {1, 0, 160, 0, 32, 32}, {1, 1, 64, 64, 17, 16}};
    for (size_t i = 0; i < sizeof regions / sizeof *regions; ++i)
        assert_int_equal(lxrt_accumulator_update(accumulator, &regions[i], &target), LXRT_ERROR_INVALID_ARGUMENT);
    assert_int_equal(lxrt_accumulator_update(accumulator, &(lxrt_region){1, 1, 64, 64, 16, 16}, &target), LXRT_OK); // the page's corner
    lxrt_region bounds;
    assert_int_equal(lxrt_accumulator_bounds(accumulator, 2, &bounds), LXRT_ERROR_INVALID_ARGUMENT);
}

int main(void)
{
#define TEST(name) cmocka_unit_test_setup_teardown(name, open_page, close_page)
    const struct CMUnitTest tests[] = {
        TEST(first_begin_asks_for_the_page_and_gives_the_composed_bytes),
        TEST(first_begin_of_a_black_page_clears_it),
        TEST(unchanged_colours_ask_for_nothing_and_write_nothing),
        TEST(one_changed_layer_touches_its_own_blocks_alone),
        TEST(all_layers_changed_give_the_composed_bytes),
        TEST(every_64th_begin_makes_all_sums_anew),
        TEST(what_a_bright_light_leaves_behind_is_gone_after_64_begins),
        TEST(reset_asks_for_the_whole_page_again),
        TEST(two_hundred_changes_stay_within_roundings_of_the_composer),
        TEST(parts_by_two_threads_give_the_bytes_of_the_whole),
        TEST(changes_added_by_two_threads_give_the_bytes_of_one),
        TEST(arguments_that_make_no_sense_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
