// Direct light by tile.
//
// Sample i of a luxel starts from site 5 i mod 16: any 16 samples in a row look at every site, any 4 at sites that lie well apart (sites are
// stratified by their number, so four that differ in both digits to the base 4 are). The luxel's samples are cut into four runs; each is a
// well-spread set in itself, so what they disagree by tells the variance of their mean.
#include "trace/direct.h"

#include "base/memory.h"
#include "math/sobol.h"
#include "trace/tracer_data.h"

#include <string.h>

enum {
    ray_batch = 4096,
    runs = 4,
    most_monitor_share = 16, cells_per_share = 4,
};

struct lx_direct_batch {
    float (*run_sums)[runs]; // [cell] of the luxel in hand: mean of the channels
    lx_rgb *sums;            // [cell]
    lx_ray rays[ray_batch];
    lx_rgb light[ray_batch], transmittance[ray_batch];
    uint32_t cell[ray_batch];
    uint8_t run[ray_batch];
    uint64_t ray_count;
};

lx_direct_batch *lx_direct_batch_create(const lx_tracer *tracer)
{
    uint32_t cells = 1;
    for (uint32_t s = 0; s < tracer->source_count; ++s) {
        const uint32_t count = lx_tracer_cell_count(tracer, s);
        cells = count > cells ? count : cells;
    }
    lx_direct_batch *b = lx_calloc_array(1, sizeof *b);
    if (!b) return NULL;
    b->run_sums = lx_calloc_array(cells, sizeof *b->run_sums);
    b->sums = lx_calloc_array(cells, sizeof *b->sums);
    if (!b->run_sums || !b->sums) {
        lx_direct_batch_destroy(b);
        return NULL;
    }
    return b;
}

void lx_direct_batch_destroy(lx_direct_batch *b)
{
    if (!b) return;
    lx_free(b->run_sums);
    lx_free(b->sums);
    lx_free(b);
}

uint64_t lx_direct_batch_rays(const lx_direct_batch *b)
{
    return b->ray_count;
}

uint32_t lx_direct_sample_weight(const lx_tracer *tracer, uint32_t source)
{
    const uint32_t wanted = (lx_tracer_cell_count(tracer, source) + cells_per_share - 1) / cells_per_share;
    return wanted < most_monitor_share ? wanted : most_monitor_share;
}

static void flush(lx_direct_batch *b, const lx_tracer *tracer, size_t count)
{
    lx_trace_transmittance(tracer, b->rays, b->transmittance, count);
    b->ray_count += count;
    for (size_t i = 0; i < count; ++i) {
        const lx_rgb arrives = lx_rgb_mul(b->light[i], b->transmittance[i]);
        b->sums[b->cell[i]] = lx_rgb_add(b->sums[b->cell[i]], arrives);
        b->run_sums[b->cell[i]][b->run[i]] += (arrives.r + arrives.g + arrives.b) * (1.0f / 3);
    }
}

// Sums of all samples of one luxel. False: nothing arrives.
static bool sum_luxel(lx_direct_batch *b, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t luxel, uint32_t source)
{
    const lx_tracer *tracer = settings->tracer;
    const uint32_t weight = lx_direct_sample_weight(tracer, source), samples = settings->samples * weight;
    // As the path integrator's light samples at the start of a path: vertex 0.
    const uint32_t key = lx_hash_combine(tile->stream[luxel], lx_hash_combine(tracer->source_keys[source], 0));
    const lx_receiver *sites = tile->sites + (size_t)luxel * lx_direct_sites;
    size_t count = 0;
    bool arrives = false;
    for (uint32_t i = 0; i < samples; ++i) {
        const lx_receiver *site = &sites[5 * i % lx_direct_sites];
        if (lx_source_bound(tracer, source, site) == 0) continue;
        if (!lx_sample_source(tracer, source, site, lx_sobol_pair(i, key), weight, &b->rays[count], &b->light[count], &b->cell[count])) continue;
        b->run[count] = (uint8_t)((uint64_t)i * runs / samples);
        arrives = true;
        if (++count < ray_batch) continue;
        flush(b, tracer, count);
        count = 0;
    }
    flush(b, tracer, count);
    return arrives;
}

static float variance_of_mean(const float sums[runs], float scale)
{
    float mean = 0, squares = 0;
    for (int r = 0; r < runs; ++r) mean += sums[r] / runs;
    for (int r = 0; r < runs; ++r) squares += (sums[r] - mean) * (sums[r] - mean);
    return squares * scale * scale / (runs * (runs - 1));
}

bool lx_direct_light(lx_direct_batch *b, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                     float *variance)
{
    const uint32_t cells = lx_tracer_cell_count(settings->tracer, source);
    const uint32_t samples = settings->samples * lx_direct_sample_weight(settings->tracer, source);
    bool any = false;
    for (uint32_t luxel = 0; luxel < tile->count; ++luxel) {
        memset(b->sums, 0, cells * sizeof *b->sums);
        memset(b->run_sums, 0, cells * sizeof *b->run_sums);
        const bool arrives = sum_luxel(b, settings, tile, luxel, source);
        if (!arrives && !any) continue;
        for (uint32_t cell = 0; cell < cells; ++cell) {
            const size_t at = (size_t)cell * tile->count;
            for (uint32_t i = any ? luxel : 0; i <= luxel; ++i) {
                mean[at + i] = (lx_rgb){0, 0, 0};
                variance[at + i] = 0;
            }
            mean[at + luxel] = lx_rgb_scale(b->sums[cell], 1 / (float)samples);
            variance[at + luxel] = variance_of_mean(b->run_sums[cell], runs / (float)samples);
        }
        any = true;
    }
    return any;
}
