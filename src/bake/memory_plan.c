// Sums of what is allocated where. The numbers repeat what other files allocate; a test holds them against the peak that the system counts.
#include "bake/memory_plan.h"

#include "bake/gather_rays.h"
#include "base/clock.h"
#include "base/error.h"
#include "base/memory.h"
#include "trace/tracer_data.h"

// What gathering keeps, in bytes.
static const struct {
    // Per luxel:
    uint32_t luxel;           // what near hits take of it
    uint32_t pass_ray;        // and ray of the passes: the luxel it hit,
    uint32_t extra;           // and what paths that went on found, on average
    uint32_t sum;             // estimate of the sum of all layers, how close what is around is, and by what knots the luxel is interpolated
    uint32_t sky_cells;       // where a sky of one colour is sampled
    uint32_t estimate;        // and layer: direct light; indirect light as well, where before it
    uint32_t radiosity;       // and layer, layers padded, was what passes added up to
    uint32_t met;             // and layer whose light gather rays meet: a part of its direct light
    uint32_t rows, pass_rows; // rows of the cache: what two passes add, and light straight from sources; and where bounces are counted one more pass
    // Per texel of the pages:
    uint32_t place;
    // Per tile and layer:
    uint32_t tile;
    // Per worker:
    uint32_t batches;
    uint32_t worker_row; // and layer, padded: sums of a tile, what is met of them, and what comes from near
    uint32_t worker_cell; // and cell of the largest monitor: light of a tile
} cost = {
    .luxel = sizeof(lx_gather_luxel),
    .pass_ray = sizeof(uint32_t),
    .extra = 40,
    .sum = 6 * sizeof(float) + sizeof(uint8_t),
    .sky_cells = sizeof(lx_sky_cells),
    .estimate = sizeof(lx_estimate),
    .radiosity = 3 * sizeof(float),
    .met = sizeof(lx_estimate),
    .rows = 3,
    .pass_rows = 1,
    .place = 2 * sizeof(uint32_t),
    .tile = 4 * sizeof(double) + 1,
    .batches = 6 << 20,
    .worker_row = 3 * lx_luxel_tile_edge * lx_luxel_tile_edge * 3 * sizeof(float),
    .worker_cell = lx_luxel_tile_edge * lx_luxel_tile_edge * (sizeof(lx_rgb) + sizeof(float)),
};

enum { block_texels = lx_luxel_tile_edge * lx_luxel_tile_edge, bare_process_bytes = 12 << 20 }; // libraries and what they set up at once

static uint64_t texel_count(const lx_bake *bake)
{
    return (uint64_t)bake->atlas->page_size * bake->atlas->page_size * bake->atlas->page_count;
}

static uint64_t lookup_bytes(const lx_bake *bake)
{
    uint64_t triangles = 0;
    for (uint32_t i = 0; i < bake->scene->primitive_count; ++i) triangles += bake->scene->primitives[i].triangle_count;
    return texel_count(bake) * cost.place + triangles * sizeof(lx_lookup_triangle) + bake->scene->surface_count * sizeof(lx_lookup_surface);
}

static uint32_t largest_cell_count(const lx_bake *bake)
{
    uint32_t largest = 1;
    for (uint32_t s = 0; s < bake->source_count; ++s) {
        const uint32_t cells = lx_tracer_cell_count(bake->tracer, s);
        if (cells > largest) largest = cells;
    }
    return largest;
}

// Layers of the bake whose light gather rays meet, at most.
static uint32_t met_layer_count(const lx_bake *bake)
{
    uint32_t count = 0;
    for (uint32_t s = 0; s < bake->source_count; ++s) {
        if (bake->uses[s].layer < 0 || !lx_bake_meets(bake, s)) continue;
        count += lx_source_use_layers(&bake->uses[s], bake->tracer, s);
    }
    return count < bake->layer_count ? count : bake->layer_count;
}

// What baking a group of `layers` adds to what is there.
static uint64_t group_bytes(const lx_bake_job *job, const lx_finish *finish, uint32_t layers)
{
    const lx_bake *bake = job->bake;
    const uint64_t luxels = job->map.view.count, padded = lx_row_layers(layers);
    const uint32_t workers = lx_pool_worker_count(bake->scene->context->pool);
    const bool bounces = !bake->desc.direct_only && bake->desc.transport.bounces > 0, truncated = bake->desc.transport.bounces != LX_BOUNCES_INF;
    const uint64_t radiosity = bounces ? cost.radiosity * padded : 0, indirect = (uint64_t)cost.estimate * layers;
    const uint64_t estimates = luxels * (cost.sum + (uint64_t)cost.estimate * layers + (radiosity > indirect ? radiosity : indirect)) + (uint64_t)job->map.tile_count * cost.tile * layers;
    const uint64_t met = met_layer_count(bake) < layers ? met_layer_count(bake) : layers;
    uint64_t cache = lookup_bytes(bake) + workers * (cost.batches + cost.worker_row * padded + (uint64_t)cost.worker_cell * largest_cell_count(bake));
    cache += luxels * cost.met * met;
    if (lx_sky_is_uniform(&bake->tracer->sky)) cache += luxels * cost.sky_cells;
    if (bounces) cache += luxels * (cost.luxel + cost.pass_ray * lx_gather_pass_rays(lx_gather_rays(bake->desc.samples), job->map.view.count) + cost.extra + (cost.rows + (truncated ? cost.pass_rows : 0)) * lx_row_stride((uint32_t)padded) * sizeof(uint16_t));
    const uint64_t finishing = lx_finish_worker_bytes(finish) * (layers < workers ? layers : workers); // the cache is gone by then
    return estimates + (cache > finishing ? cache : finishing);
}

// The whole process while it saves: what the bake leaves, a page at a time, and the scene as it is read back for preview and report.
static uint64_t save_bytes(const lx_bake *bake, uint64_t resident, uint64_t finished)
{
    const uint64_t page = (uint64_t)bake->atlas->page_size * bake->atlas->page_size;
    const uint64_t again = bake->created_bytes > bare_process_bytes ? bake->created_bytes - bare_process_bytes : 0;
    const uint64_t images = page * 3 * sizeof(float) + page * (3 * sizeof(float) + sizeof(uint32_t)) / 3;
    // Of the pack: its index, and a row of blocks of all layers, for which it is read back.
    const uint64_t rows = (uint64_t)bake->layer_count * sizeof(uint32_t);
    const uint64_t pack = rows * (texel_count(bake) * 4 / 3 / block_texels + (uint64_t)bake->atlas->page_size * lx_luxel_tile_edge);
    const uint64_t pages = texel_count(bake) * 3 * sizeof(float);
    return resident + finished + images + pack + again + pages;
}

lx_result lx_memory_plan_make(const lx_bake_job *job, const lx_finish *finish, lx_memory_plan *out, lx_error *error)
{
    const lx_bake *bake = job->bake;
    const uint64_t limit = bake->desc.memory_bytes, kept = limit - limit / 16; // what the allocator loses between blocks is not counted
    lx_trim_memory();
    const uint64_t resident = lx_resident_memory(), before = lx_peak_memory();
    const uint64_t finished = limit ? 0 : (uint64_t)lx_finished_count(bake->finished) * bake->layer_count * sizeof(lx_rgb);
    lx_memory_plan plan = {.resident_bytes = resident, .save_bytes = save_bytes(bake, resident, finished), .group_layers = bake->layer_count};
    uint32_t least = bake->layer_count > 0 ? 1 : 0;
    for (uint32_t i = 0; i < bake->layer_count; ++i) // cells follow one another
        if (bake->layers[i].monitor && bake->layers[i].cell + 1 > least) least = bake->layers[i].cell + 1;
    while (limit && plan.group_layers > least && resident + group_bytes(job, finish, plan.group_layers) > kept) --plan.group_layers;
    plan.group_bytes = group_bytes(job, finish, plan.group_layers);
    const uint64_t baking = resident + plan.group_bytes + finished;
    plan.peak_bytes = baking > plan.save_bytes ? baking : plan.save_bytes;
    if (before > plan.peak_bytes) plan.peak_bytes = before;
    *out = plan;
    if (!limit || (plan.peak_bytes <= limit && baking <= kept)) return LX_OK;
    const double mib = 1.0 / (1 << 20);
    if (plan.peak_bytes == baking || plan.peak_bytes <= limit)
        return lx_fail(error, LX_ERROR_LIMIT, "%.0f MiB of memory are not enough: %u texels and %u layer%s at once need %.0f MiB; fewer or smaller pages need less",
                       (double)limit * mib, job->map.view.count, least, least == 1 ? "" : "s, the cells of a monitor,", ceil((double)baking * 1.09 * mib)); // with room for the next run to differ a little
    return lx_fail(error, LX_ERROR_LIMIT, "%.0f MiB of memory are not enough: %s needs %.0f MiB", (double)limit * mib,
                   plan.peak_bytes == before ? "preparing" : "saving", (double)plan.peak_bytes * mib);
}

uint32_t lx_memory_group(const lx_bake *bake, const lx_memory_plan *plan, uint32_t first)
{
    const uint32_t left = bake->layer_count - first;
    if (left <= plan->group_layers) return left;
    uint32_t count = plan->group_layers;
    while (count > 1 && bake->layers[first + count].monitor && bake->layers[first + count].cell > 0) --count;
    return count;
}
