// Bakes one scene several times in one process, in turn, and tells how far the results are from each other.
//
//     bench_bakes SCENE [OPTION=VALUE...] BAKE...
//
// A BAKE is `bake:SETTING=VALUE,...` or `exr:PATH[,scale=X]` (a picture of the atlas that another program baked). What is compared is the sum of all
// layers at their authored colours, over the texels that count: covered, valid in all of them, and inside their charts by one texel (`borders=1`: or not). Printed as JSON: per
// bake the best seconds of `repeat` rounds and the mean; and `products`, the matrix of mean (X_i - X_0)(X_j - X_0) over texels and channels, from which
// every error follows: the squared error of i against j is p_ii - 2 p_ij + p_jj; and where the referee is noisy, two referees j and k of independent noise
// give it free of theirs: p_ii - p_ij - p_ik + p_jk.
//
// `off_by` is the difference from the last bake as the summary's `noise` estimates it: each texel's grey over the last bake's, but over a hundredth of its mean at least; root mean square.
//
// `salt` gives a bake other random numbers at the same places: sites of luxels are drawn from the seed alone, so bakes of one seed and different salts differ by
// the integrator's noise and by nothing else. The linker's --wrap does that; nothing in the product knows of it.
#include "bake/bake.h"
#include "bake/finished.h"
#include "bake/gather_rays.h"
#include "bake/luxels.h"
#include "base/clock.h"
#include "base/error.h"
#include "image/image.h"
#include "math/hash.h"
#include "trace/direct.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { most_bakes = 64 };

typedef struct entry {
    const char *exr;  // NULL: a bake
    double scale;     // of the picture
    lx_bake_desc desc;
    uint32_t salt;
    float *sum;       // [texel of all pages][channel]
    lx_bake_summary best; // of all rounds
    double total_seconds;
    uint32_t runs;
} entry;

typedef struct bench {
    lx_context *context;
    lx_scene *scene;
    lx_atlas *atlas;
    entry entries[most_bakes];
    uint32_t entry_count, repeat;
    const char *save; // prefix of EXR files of the sums; NULL: none
    size_t texel_count;
    uint8_t *counts;  // [texel] it is compared
    bool borders;     // compare all valid texels
} bench;

// ---- what the linker puts between ------------------------------------------------------------------------------------------

static uint32_t salt;           // of the bake at work
static uint8_t *valid_now;      // [texel of all pages] of the bake at work
static size_t page_texels_now;

void __real_lx_path_trace(lx_path_batch *batch, const lx_path_settings *settings, const lx_path_start *starts, size_t count, double *sums,
                          uint32_t *back_hits);
void __wrap_lx_path_trace(lx_path_batch *batch, const lx_path_settings *settings, const lx_path_start *starts, size_t count, double *sums,
                          uint32_t *back_hits);
lx_result __real_lx_gather_trace(lx_gather_batch *batch, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count,
                                 const lx_gather_output *output, lx_error *error);
lx_result __wrap_lx_gather_trace(lx_gather_batch *batch, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count,
                                 const lx_gather_output *output, lx_error *error);
bool __real_lx_direct_light(lx_direct_batch *batch, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                            float *variance);
bool __wrap_lx_direct_light(lx_direct_batch *batch, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                            float *variance);
void __real_lx_luxels_release(lx_luxel_page *page);
void __wrap_lx_luxels_release(lx_luxel_page *page);

void __wrap_lx_path_trace(lx_path_batch *batch, const lx_path_settings *settings, const lx_path_start *starts, size_t count, double *sums,
                          uint32_t *back_hits)
{
    if (!salt) {
        __real_lx_path_trace(batch, settings, starts, count, sums, back_hits);
        return;
    }
    lx_path_start salted[lx_path_batch_size];
    for (size_t i = 0; i < count; ++i) {
        salted[i] = starts[i];
        salted[i].stream = lx_hash_combine(starts[i].stream, salt);
    }
    __real_lx_path_trace(batch, settings, salted, count, sums, back_hits);
}

lx_result __wrap_lx_gather_trace(lx_gather_batch *batch, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count,
                                 const lx_gather_output *output, lx_error *error)
{
    if (!salt) return __real_lx_gather_trace(batch, settings, starts, count, output, error);
    lx_gather_start *salted = malloc((count + 1) * sizeof *salted);
    if (!salted) abort();
    for (size_t i = 0; i < count; ++i) {
        salted[i] = starts[i];
        salted[i].stream = lx_hash_combine(starts[i].stream, salt);
    }
    const lx_result result = __real_lx_gather_trace(batch, settings, salted, count, output, error);
    free(salted);
    return result;
}

bool __wrap_lx_direct_light(lx_direct_batch *batch, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                            float *variance)
{
    if (!salt) return __real_lx_direct_light(batch, settings, tile, source, mean, variance);
    uint32_t streams[lx_luxel_tile_edge * lx_luxel_tile_edge];
    for (uint32_t i = 0; i < tile->count; ++i) streams[i] = lx_hash_combine(tile->stream[i], salt);
    lx_direct_tile salted = *tile;
    salted.stream = streams;
    return __real_lx_direct_light(batch, settings, &salted, source, mean, variance);
}

// The last moment at which a bake knows which texels lie inside solid geometry.
void __wrap_lx_luxels_release(lx_luxel_page *page)
{
    if (valid_now && page->state)
        for (size_t i = 0; i < page_texels_now; ++i)
            if (!lx_luxel_is_valid(page, (uint32_t)i)) valid_now[page->number * page_texels_now + i] = 0;
    __real_lx_luxels_release(page);
}

// ---- the command line ------------------------------------------------------------------------------------------------------

static void give_up(const char *format, const char *text)
{
    fprintf(stderr, "bench_bakes: ");
    fprintf(stderr, format, text);
    fputc('\n', stderr);
    exit(2);
}

static bool is_setting(const char *item, const char *name, const char **value)
{
    const size_t length = strlen(name);
    if (strncmp(item, name, length) != 0 || item[length] != '=') return false;
    *value = item + length + 1;
    return true;
}

static void apply_setting(entry *e, const char *item)
{
    const char *value = "";
    lx_bake_desc *d = &e->desc;
    if (is_setting(item, "integrator", &value))
        d->integrator = strcmp(value, "path") == 0 ? LX_INTEGRATOR_PATH : LX_INTEGRATOR_GATHER;
    else if (is_setting(item, "samples", &value))
        d->samples = (uint32_t)strtoul(value, NULL, 10);
    else if (is_setting(item, "noise", &value))
        d->noise = strtof(value, NULL);
    else if (is_setting(item, "interpolation", &value))
        d->interpolation = strtof(value, NULL);
    else if (is_setting(item, "bounces", &value))
        d->transport.bounces = strcmp(value, "inf") == 0 ? LX_BOUNCES_INF : (uint32_t)strtoul(value, NULL, 10);
    else if (is_setting(item, "seed", &value))
        d->transport.seed = (uint32_t)strtoul(value, NULL, 10);
    else if (is_setting(item, "denoise", &value))
        d->denoise = strcmp(value, "none") == 0 ? LX_DENOISE_NONE : strcmp(value, "oidn") == 0 ? LX_DENOISE_OIDN : LX_DENOISE_BUILTIN;
    else if (is_setting(item, "combined", &value))
        d->combined = value[0] == '1';
    else if (is_setting(item, "max_layers", &value))
        d->max_layers = (uint32_t)strtoul(value, NULL, 10);
    else if (is_setting(item, "direct_only", &value))
        d->direct_only = value[0] == '1';
    else if (is_setting(item, "indirect_only", &value))
        d->indirect_only = value[0] == '1';
    else if (is_setting(item, "time", &value))
        d->time_s = strtod(value, NULL);
    else if (is_setting(item, "salt", &value))
        e->salt = (uint32_t)strtoul(value, NULL, 10);
    else if (is_setting(item, "scale", &value))
        e->scale = strtod(value, NULL);
    else
        give_up("there is no setting '%s'", item);
}

static void parse_entry(entry *e, char *text, const lx_bake_desc *base)
{
    e->desc = *base;
    e->scale = 1;
    const bool is_exr = strncmp(text, "exr:", 4) == 0;
    char *item = strtok(text + (is_exr ? 4 : 5), ",");
    if (is_exr) {
        e->exr = item;
        item = strtok(NULL, ",");
    }
    for (; item; item = strtok(NULL, ",")) apply_setting(e, item);
}

// ---- baking ----------------------------------------------------------------------------------------------------------------

static void add_layers(const bench *b, const lx_bake *bake, float *sum)
{
    const size_t page_texels = b->texel_count / b->atlas->page_count;
    float *image = lx_malloc_array(page_texels, 3 * sizeof *image);
    if (!image) abort();
    for (uint32_t page = 0; page < b->atlas->page_count; ++page)
        for (uint32_t layer = 0; layer < bake->layer_count; ++layer) {
            const lx_layer *l = &bake->layers[layer];
            if (lx_finished_image(bake->finished, page, layer, image, NULL) != LX_OK) abort();
            float *out = sum + 3 * page * page_texels;
            for (size_t i = 0; i < page_texels; ++i)
                for (size_t c = 0; c < 3; ++c) out[3 * i + c] += l->color[c] * l->intensity * image[3 * i + c];
        }
    lx_free(image);
}

// Covered, valid, and (unless borders count as well) so are its eight neighbours, all of the same chart.
static void mark_interior(const bench *b, const lx_bake *bake, const uint8_t *valid, uint8_t *counts)
{
    const int64_t size = b->atlas->page_size;
    for (int64_t page = 0; page < b->atlas->page_count; ++page)
        for (int64_t y = 0; y < size; ++y)
            for (int64_t x = 0; x < size; ++x) {
                const int64_t i = (page * size + y) * size + x;
                bool inside = x > 0 && y > 0 && x < size - 1 && y < size - 1;
                if (b->borders) {
                    counts[i] &= bake->texel_coverage[i] && valid[i];
                    continue;
                }
                for (int64_t k = 0; inside && k < 9; ++k) {
                    const int64_t j = i + (k / 3 - 1) * size + k % 3 - 1;
                    inside = bake->texel_coverage[j] && valid[j] && bake->texel_chart[j] == bake->texel_chart[i];
                }
                counts[i] &= inside;
            }
}

static lx_result bake_once(bench *b, entry *e, lx_error *error)
{
    lx_bake *bake = NULL;
    uint8_t *valid = NULL;
    salt = e->salt;
    lx_result result = lx_bake_create(b->scene, b->atlas, &e->desc, &bake, error);
    if (result != LX_OK) return result;
    valid = malloc(b->texel_count);
    if (!valid) abort();
    memset(valid, 1, b->texel_count);
    valid_now = valid;
    page_texels_now = b->texel_count / b->atlas->page_count;
    LX_TRY(lx_bake_run(bake, NULL, error));
    lx_bake_summary summary;
    lx_bake_get_summary(bake, &summary);
    if (e->runs == 0) {
        e->sum = calloc(3 * b->texel_count, sizeof *e->sum);
        if (!e->sum) abort();
        add_layers(b, bake, e->sum);
        mark_interior(b, bake, valid, b->counts);
    }
    if (e->runs == 0 || summary.seconds < e->best.seconds) e->best = summary;
    e->total_seconds += summary.seconds;
    ++e->runs;
cleanup:
    valid_now = NULL;
    free(valid);
    lx_bake_destroy(bake);
    return result;
}

static lx_result load_exr(bench *b, entry *e, lx_error *error)
{
    lx_image image = {0};
    lx_result result = lx_image_load(e->exr, &image, error);
    if (result != LX_OK) return result;
    e->sum = calloc(3 * b->texel_count, sizeof *e->sum);
    if (!e->sum) abort();
    if (image.type != LX_PIXEL_F32 || image.channels < 3 || (size_t)image.width * image.height != b->texel_count)
        return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "%s is no float picture of the atlas's size", e->exr);
    for (size_t i = 0; i < b->texel_count; ++i) {
        for (size_t c = 0; c < 3; ++c) e->sum[3 * i + c] = (float)(e->scale * image.f32[i * image.channels + c]);
        if (image.channels == 4 && !(image.f32[4 * i + 3] > 0)) b->counts[i] = 0;
    }
    lx_image_release(&image);
    return LX_OK;
}

// ---- what comes out --------------------------------------------------------------------------------------------------------

static lx_result save_sum(const bench *b, uint32_t index, lx_error *error)
{
    char path[4096];
    snprintf(path, sizeof path, "%s%u.exr", b->save, index);
    const uint32_t size = b->atlas->page_size;
    lx_image image;
    lx_result result = lx_image_create(size, size * b->atlas->page_count, 4, LX_PIXEL_F32, &image, error);
    if (result != LX_OK) return result;
    for (size_t i = 0; i < b->texel_count; ++i) {
        memcpy(image.f32 + 4 * i, b->entries[index].sum + 3 * i, 3 * sizeof(float));
        image.f32[4 * i + 3] = b->counts[i];
    }
    result = lx_image_save(&image, path, error);
    lx_image_release(&image);
    return result;
}

static double product(const bench *b, const float *x, const float *y, const float *origin, size_t count)
{
    double sum = 0;
    for (size_t i = 0; i < b->texel_count; ++i)
        for (size_t c = 0; b->counts[i] && c < 3; ++c)
            sum += ((double)x[3 * i + c] - (double)origin[3 * i + c]) * ((double)y[3 * i + c] - (double)origin[3 * i + c]);
    return sum / (3 * (double)count);
}

static double grey_at(const float *sum, size_t texel)
{
    return ((double)sum[3 * texel] + (double)sum[3 * texel + 1] + (double)sum[3 * texel + 2]) / 3;
}

static double off_by(const bench *b, const float *sum, const float *reference, size_t count)
{
    double mean = 0, squares = 0;
    for (size_t i = 0; i < b->texel_count; ++i) mean += b->counts[i] ? grey_at(reference, i) / (double)count : 0;
    for (size_t i = 0; i < b->texel_count; ++i) {
        const double truth = grey_at(reference, i), error = (grey_at(sum, i) - truth) / fmax(truth, 0.01 * mean);
        if (b->counts[i] && mean > 0) squares += error * error;
    }
    return sqrt(squares / (double)count);
}

static void print(const bench *b)
{
    size_t count = 0;
    for (size_t i = 0; i < b->texel_count; ++i) count += b->counts[i];
    printf("{\"page_size\": %u, \"pages\": %u, \"compared_texels\": %zu, \"bakes\": [", b->atlas->page_size, b->atlas->page_count, count);
    for (uint32_t k = 0; k < b->entry_count; ++k) {
        const entry *e = &b->entries[k];
        const lx_stage_seconds *t = &e->best.stages;
        double mean = 0;
        for (size_t i = 0; i < 3 * b->texel_count; ++i) mean += b->counts[i / 3] ? (double)e->sum[i] : 0;
        printf("%s\n  {\"mean\": %.9g, \"off_by\": %.6g", k ? "," : "", mean / (3 * (double)(count ? count : 1)),
               off_by(b, e->sum, b->entries[b->entry_count - 1].sum, count ? count : 1));
        if (!e->exr)
            printf(", \"seconds\": %.4f, \"mean_seconds\": %.4f, \"layers\": %u, "
                   "\"texels\": %llu, \"invalid\": %llu, \"rays\": %llu, \"noise\": %.6g, \"luxels_s\": %.4f, \"bake_s\": %.4f, \"post_s\": %.4f, "
                   "\"direct_s\": %.4f, \"cache_s\": %.4f, \"gather_s\": %.4f, \"denoise_s\": %.4f",
                   e->best.seconds, e->total_seconds / e->runs, e->best.layer_count,
                   (unsigned long long)e->best.texel_count, (unsigned long long)e->best.invalid_count, (unsigned long long)e->best.ray_count,
                   (double)e->best.noise, t->luxels, t->bake, t->post, t->direct, t->cache, t->gather, t->denoise);
        printf("}");
    }
    printf("],\n \"products\": [");
    for (uint32_t i = 0; i < b->entry_count; ++i) {
        printf("%s\n  [", i ? "," : "");
        for (uint32_t j = 0; j < b->entry_count; ++j)
            printf("%s%.9g", j ? ", " : "", product(b, b->entries[i].sum, b->entries[j].sum, b->entries[0].sum, count ? count : 1));
        printf("]");
    }
    printf("]}\n");
}

static void silent(void *user, lx_log_level level, const char *message)
{
    (void)user;
    (void)level;
    (void)message;
}

int main(int argc, char **argv)
{
    if (argc < 3) {
        fprintf(stderr, "usage: bench_bakes SCENE [page_size=N] [max_pages=N] [threads=N] [sky=R,G,B] [repeat=N] [unwrap=1] [borders=1] [save=PREFIX] "
                        "bake:SETTING=VALUE,... | exr:PATH[,scale=X]...\n");
        return 2;
    }
    lx_result result = LX_OK;
    lx_error error = {0};
    bench *b = calloc(1, sizeof *b);
    if (!b) return 1;
    b->repeat = 1;
    lx_context_desc context_desc = lx_context_desc_default();
    context_desc.logger.func = silent;
    lx_atlas_desc atlas_desc = lx_atlas_desc_default();
    atlas_desc.page_size = 128;
    lx_bake_desc base = lx_bake_desc_default();
    base.transport.bounces = LX_BOUNCES_INF;
    base.integrator = LX_INTEGRATOR_GATHER;
    base.noise = 0;
    base.denoise = LX_DENOISE_NONE;
    for (int i = 2; i < argc; ++i) {
        const char *value = "";
        if (is_setting(argv[i], "page_size", &value))
            atlas_desc.page_size = (uint32_t)strtoul(value, NULL, 10);
        else if (is_setting(argv[i], "max_pages", &value))
            atlas_desc.max_pages = (uint32_t)strtoul(value, NULL, 10);
        else if (is_setting(argv[i], "unwrap", &value))
            atlas_desc.force_unwrap = value[0] == '1';
        else if (is_setting(argv[i], "threads", &value))
            context_desc.thread_count = (uint32_t)strtoul(value, NULL, 10);
        else if (is_setting(argv[i], "repeat", &value))
            b->repeat = (uint32_t)strtoul(value, NULL, 10);
        else if (is_setting(argv[i], "borders", &value))
            b->borders = atoi(value) != 0;
        else if (is_setting(argv[i], "save", &value))
            b->save = value;
        else if (is_setting(argv[i], "sky", &value)) {
            if (sscanf(value, "%f,%f,%f", &base.transport.sky.color[0], &base.transport.sky.color[1], &base.transport.sky.color[2]) != 3)
                base.transport.sky = (lx_sky_desc){.color = {1, 1, 1}, .file = value, .intensity = 1};
        } else if (strncmp(argv[i], "bake:", 5) == 0 || strncmp(argv[i], "exr:", 4) == 0) {
            if (b->entry_count == most_bakes) give_up("too many bakes: '%s'", argv[i]);
            parse_entry(&b->entries[b->entry_count++], argv[i], &base);
        } else
            give_up("there is no option '%s'", argv[i]);
    }
    if (!b->entry_count) give_up("%s", "nothing to bake");
    LX_TRY(lx_context_create(&context_desc, &b->context, &error));
    LX_TRY(lx_scene_load(b->context, argv[1], NULL, &b->scene, &error));
    LX_TRY(lx_atlas_build(b->scene, &atlas_desc, NULL, &b->atlas, &error));
    b->texel_count = (size_t)b->atlas->page_size * b->atlas->page_size * b->atlas->page_count;
    b->counts = malloc(b->texel_count);
    if (!b->counts) abort();
    memset(b->counts, 1, b->texel_count);
    for (uint32_t round = 0; round < b->repeat; ++round)
        for (uint32_t k = 0; k < b->entry_count; ++k)
            if (!b->entries[k].exr) LX_TRY(bake_once(b, &b->entries[k], &error));
    for (uint32_t k = 0; k < b->entry_count; ++k)
        if (b->entries[k].exr) LX_TRY(load_exr(b, &b->entries[k], &error));
    for (uint32_t k = 0; b->save && k < b->entry_count; ++k) LX_TRY(save_sum(b, k, &error));
    print(b);
cleanup:
    if (result != LX_OK) fprintf(stderr, "bench_bakes: %s\n", error.message);
    for (uint32_t k = 0; k < b->entry_count; ++k) free(b->entries[k].sum);
    free(b->counts);
    lx_atlas_destroy(b->atlas);
    lx_scene_destroy(b->scene);
    lx_context_destroy(b->context);
    free(b);
    return result == LX_OK ? 0 : 1;
}
