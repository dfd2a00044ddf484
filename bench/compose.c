// How close composing comes to the machine's memory bandwidth: bench_compose [PAGE_SIZE [LAYERS [SECONDS]]], JSON on stdout; and what a pack
// costs in memory: bench_compose --resident PACK.
//
// The bandwidth is measured on the pack's own bytes, by the same threads, in turn with composing: reading all of it into registers, and
// copying half of it onto the other half. Composing moves each block once and writes each texel once; what it reaches is (bytes read +
// bytes written) / seconds, over the better of the two. Texels are noise with exponents of a real lightmap; no block is absent.
#define _POSIX_C_SOURCE 200809L
#include "luxel_rt.h"
#include "rt_kernel.h"
#include "runtime_random_pack.h"

#include <immintrin.h>
#include <pthread.h>
#include <stdio.h>
#include <string.h>
#include <time.h>

enum { max_threads = 2 };

typedef struct work {
    void (*function)(struct work *, uint32_t thread, uint32_t threads);
    unsigned char *bytes;
    size_t size;
    unsigned char *spare;
    const lxrt_pack *pack;
    lxrt_accumulator *accumulator;
    lxrt_format format;
    unsigned char *texels;
    uint32_t page_size;
    uint64_t sink[max_threads][8];
} work;

static double now_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void part_of(size_t size, uint32_t thread, uint32_t threads, size_t *first, size_t *bytes)
{
    *bytes = size / threads / 4096 * 4096;
    *first = *bytes * thread;
}

__attribute__((target("avx2"))) static void read_all(work *w, uint32_t thread, uint32_t threads)
{
    size_t first, bytes;
    part_of(w->size, thread, threads, &first, &bytes);
    const unsigned char *p = w->bytes + first;
    __m256i sums[4] = {_mm256_setzero_si256(), _mm256_setzero_si256(), _mm256_setzero_si256(), _mm256_setzero_si256()};
    for (size_t i = 0; i < bytes; i += 128)
        for (size_t k = 0; k < 4; ++k) sums[k] = _mm256_xor_si256(sums[k], _mm256_load_si256((const __m256i *)(const void *)(p + i + 32 * k)));
    const __m256i all = _mm256_xor_si256(_mm256_xor_si256(sums[0], sums[1]), _mm256_xor_si256(sums[2], sums[3]));
    w->sink[thread][0] ^= (uint64_t)_mm256_extract_epi64(all, 0) ^ (uint64_t)_mm256_extract_epi64(all, 2);
}

static void copy_half(work *w, uint32_t thread, uint32_t threads)
{
    size_t first, bytes;
    part_of(w->size / 2, thread, threads, &first, &bytes);
    memcpy(w->spare + first, w->bytes + first, bytes);
}

static void compose_all(work *w, uint32_t thread, uint32_t threads)
{
    const uint32_t rows = w->page_size / threads;
    const size_t row_bytes = w->page_size * lxrt_format_bytes(w->format);
    lxrt_compose(w->pack, &(lxrt_region){0, 0, 0, rows * thread, w->page_size, rows},
                 &(lxrt_target){w->texels + row_bytes * rows * thread, row_bytes, w->format, 1});
}

static void update_all(work *w, uint32_t thread, uint32_t threads)
{
    lxrt_region region;
    lxrt_accumulator_bounds(w->accumulator, 0, &region);
    const uint32_t rows = region.height / threads / 32 * 32;
    const size_t texel_bytes = lxrt_format_bytes(w->format), row_bytes = w->page_size * texel_bytes;
    region.y += rows * thread;
    region.height = thread + 1 == threads ? region.height - rows * thread : rows;
    if (region.height > 0 && region.width > 0)
        lxrt_accumulator_update(w->accumulator, &region,
                                &(lxrt_target){w->texels + row_bytes * region.y + region.x * texel_bytes, row_bytes, w->format, 1});
}

typedef struct thread_start {
    work *w;
    uint32_t thread, threads;
} thread_start;

static void *run_thread(void *argument)
{
    const thread_start *start = argument;
    start->w->function(start->w, start->thread, start->threads);
    return NULL;
}

// Seconds of one run by `threads` threads. Starting one costs some ten microseconds, which counts against us.
static double run_once(work *w, void (*function)(work *, uint32_t, uint32_t), uint32_t threads)
{
    pthread_t handles[max_threads];
    thread_start starts[max_threads];
    w->function = function;
    const double begin = now_s();
    for (uint32_t i = 1; i < threads; ++i) {
        starts[i] = (thread_start){w, i, threads};
        pthread_create(&handles[i], NULL, run_thread, &starts[i]);
    }
    function(w, 0, threads);
    for (uint32_t i = 1; i < threads; ++i) pthread_join(handles[i], NULL);
    return now_s() - begin;
}

static void keep_least(double *best, double seconds)
{
    if (seconds < *best) *best = seconds;
}

// Resident bytes of this process.
static double resident_bytes(void)
{
    long pages = 0;
    FILE *file = fopen("/proc/self/statm", "r");
    if (file && fscanf(file, "%*d %ld", &pages) != 1) pages = 0;
    if (file) fclose(file);
    return 4096.0 * (double)pages;
}

static void other_color(lxrt_pack *pack, uint32_t layer, uint32_t round)
{
    const float level = 1 + 0.01f * (float)(round % 16);
    lxrt_set_layer(pack, layer, (const float[3]){level, level, level}, 1);
}

// Reads a pack as an engine would, composes all of it row by row, and prints by how much this process has grown.
static int print_resident(const char *path)
{
    static unsigned char row[16384 * 12];
    memset(row, 1, sizeof row);
    const double before = resident_bytes();
    FILE *file = fopen(path, "rb");
    if (!file || fseek(file, 0, SEEK_END) != 0) return 1;
    const size_t size = (size_t)ftell(file);
    unsigned char *data = malloc(size);
    rewind(file);
    if (!data || fread(data, 1, size, file) != size) return 1;
    fclose(file);
    size_t bytes;
    lxrt_pack *pack;
    if (lxrt_memory_bytes(data, size, &bytes) != LXRT_OK || lxrt_open(data, size, malloc(bytes), bytes, &pack) != LXRT_OK) return 1;
    lxrt_info info;
    lxrt_budget budget;
    lxrt_get_info(pack, &info);
    lxrt_get_budget(pack, &budget);
    for (uint32_t page = 0; page < info.page_count; ++page)
        for (uint32_t level = 0; level < info.level_count; ++level)
            for (uint32_t y = 0; y < info.page_size >> level; ++y)
                lxrt_compose(pack, &(lxrt_region){page, level, 0, y, info.page_size >> level, 1}, &(lxrt_target){row, 0, LXRT_FORMAT_RGB32F, 1});
    printf("{\"pack_bytes\": %zu, \"resident_bytes\": %.0f, \"dense_bytes\": %.0f, \"page_size\": %u, \"layers\": %u, \"pages\": %u}\n", size,
           resident_bytes() - before, (double)budget.dense_bytes, info.page_size, info.layer_count, info.page_count);
    return 0;
}

int main(int argc, char **argv)
{
    if (argc == 3 && strcmp(argv[1], "--resident") == 0) return print_resident(argv[2]);
    const uint32_t page_size = argc > 1 ? (uint32_t)atoi(argv[1]) : 2048, layer_count = argc > 2 ? (uint32_t)atoi(argv[2]) : 16;
    const double budget_s = argc > 3 ? atof(argv[3]) : 20;
    static const char *const format_names[3] = {"rgb32f", "rgba16f", "rgb9e5"};

    size_t size;
    unsigned char *data = random_pack_make(&(random_pack){.page_size = page_size, .page_count = 1, .layer_count = layer_count, .level_count = 1,
                                                    .density = 1, .exponent_min = 14, .exponent_max = 31, .seed = 1}, &size);
    size_t handle_bytes;
    lxrt_pack *pack, *one;
    if (lxrt_memory_bytes(data, size, &handle_bytes) != LXRT_OK) return 1;
    if (lxrt_open(data, size, malloc(handle_bytes), handle_bytes, &pack) != LXRT_OK) return 1;
    if (lxrt_open(data, size, malloc(handle_bytes), handle_bytes, &one) != LXRT_OK) return 1;
    for (uint32_t i = 1; i < layer_count; ++i) lxrt_set_layer(one, i, (const float[3]){0, 0, 0}, 0);

    const size_t texels_bytes = 12 * (size_t)page_size * page_size, blocks_bytes = 4 * (size_t)page_size * page_size * layer_count;
    work w = {.pack = pack, .page_size = page_size, .bytes = data + size - blocks_bytes, .size = blocks_bytes};
    w.texels = aligned_alloc(4096, texels_bytes);
    w.spare = aligned_alloc(4096, blocks_bytes / 2);
    const size_t accumulator_bytes = lxrt_accumulator_bytes(pack);
    void *const accumulator_memory = malloc(accumulator_bytes);
    memset(w.texels, 1, texels_bytes);
    memset(w.spare, 1, blocks_bytes / 2);
    if (lxrt_accumulator_create(pack, 0, accumulator_memory, accumulator_bytes, &w.accumulator) != LXRT_OK) return 1;

    double read_s[max_threads], copy_s[max_threads], compose_s[3][max_threads], single_s[3], full_s = 1e9, same_s = 1e9, changed_s[3];
    double kernels_s[4] = {1e9, 1e9, 1e9, 1e9};
    for (int t = 0; t < max_threads; ++t) read_s[t] = copy_s[t] = compose_s[0][t] = compose_s[1][t] = compose_s[2][t] = 1e9;
    for (int f = 0; f < 3; ++f) single_s[f] = changed_s[f] = 1e9;
    const double end = now_s() + budget_s;
    for (uint32_t round = 0; round < 5 || now_s() < end; ++round) {
        for (uint32_t t = 0; t < max_threads; ++t) {
            keep_least(&read_s[t], run_once(&w, read_all, t + 1));
            keep_least(&copy_s[t], run_once(&w, copy_half, t + 1));
            for (int f = 0; f < 3; ++f) {
                w.format = (lxrt_format)f;
                keep_least(&compose_s[f][t], run_once(&w, compose_all, t + 1));
            }
        }
        for (int f = 0; f < 3; ++f) {
            w.format = (lxrt_format)f;
            w.pack = one;
            keep_least(&single_s[f], run_once(&w, compose_all, 1));
            w.pack = pack;
        }
        // Accumulators, one thread: everything, then nothing changed, then one layer.
        w.format = LXRT_FORMAT_RGB9E5;
        lxrt_accumulator_reset(w.accumulator);
        double begin = now_s();
        lxrt_accumulator_begin(w.accumulator);
        update_all(&w, 0, 1);
        keep_least(&full_s, now_s() - begin);
        begin = now_s();
        if (lxrt_accumulator_begin(w.accumulator) != 0) return 1;
        update_all(&w, 0, 1);
        keep_least(&same_s, now_s() - begin);
        for (int f = 0; f < 3; ++f) {
            w.format = (lxrt_format)f;
            other_color(pack, layer_count / 2, 3 * round + (uint32_t)f);
            begin = now_s();
            if (lxrt_accumulator_begin(w.accumulator) != 1) return 1;
            update_all(&w, 0, 1);
            keep_least(&changed_s[f], now_s() - begin);
        }
        w.format = LXRT_FORMAT_RGB9E5;
        lxrt_kernel kernel;
        for (uint32_t k = 0; round < 3 && (kernel = lxrt_get_kernel(k, NULL)) != NULL; ++k) {
            lxrt_use_kernel(pack, kernel);
            keep_least(&kernels_s[k], run_once(&w, compose_all, 1));
        }
        lxrt_use_kernel(pack, lxrt_best_kernel());
    }

    const double gib = 1 << 30;
    printf("{\"page_size\": %u, \"layers\": %u, \"pack_bytes\": %zu, \"full_ms\": %.4f, \"same_ms\": %.6f",
           page_size, layer_count, size, 1e3 * full_s, 1e3 * same_s);
    for (uint32_t t = 0; t < max_threads; ++t) {
        const double read = (double)blocks_bytes / read_s[t] / gib, copy = (double)blocks_bytes / copy_s[t] / gib;
        printf(",\n \"threads_%u\": {\"read_gib_per_s\": %.2f, \"copy_gib_per_s\": %.2f", t + 1, read, copy);
        for (int f = 0; f < 3; ++f) {
            const double moved = (double)blocks_bytes + (double)page_size * page_size * (double)lxrt_format_bytes((lxrt_format)f);
            const double reached = moved / compose_s[f][t] / gib;
            printf(", \"%s\": {\"ms\": %.3f, \"gib_per_s\": %.2f, \"share\": %.4f}", format_names[f], 1e3 * compose_s[f][t], reached,
                   reached / (read > copy ? read : copy));
        }
        printf("}");
    }
    printf(",\n \"one_layer\": {");
    for (int f = 0; f < 3; ++f)
        printf("%s\"%s\": {\"compose_ms\": %.3f, \"update_ms\": %.3f, \"ratio\": %.4f}", f ? ", " : "", format_names[f], 1e3 * single_s[f],
               1e3 * changed_s[f], changed_s[f] / single_s[f]);
    printf("},\n \"kernels_ms\": {");
    const char *name;
    for (uint32_t k = 0; lxrt_get_kernel(k, &name); ++k) printf("%s\"%s\": %.3f", k ? ", " : "", name, 1e3 * kernels_s[k]);
    printf("}}\n");
    return 0;
}
