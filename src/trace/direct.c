// Direct light by tile: where to spare shadow rays.
//
// Sample i of a luxel starts from site i mod 16: any 16 samples in a row look at every site, the first 4 at sites that lie well apart.
//
// Every luxel sends the rays of its first four samples. Where they all met the same (all clear, all dark, the same pane of glass), in the luxel
// and in its neighbours, the luxel is taken to see the source so altogether, and its light is that of its samples without further rays. Else it sends the
// rays of 16 samples, and so do neighbours that turn out to differ from it, until no neighbours differ unlooked-at: the outline of a shadow is followed around.
// Luxels whose 16 rays differ lie in a penumbra or on an edge and send the rays of all samples. So do those whose looks, with their neighbours', are too few
// to tell, in narrow charts and where a few samples carry most of the light, and those beside a penumbra.
//
// Where `noise` is given, the number of samples grows fourfold at a time, and a luxel that is sure enough of its light needs no more; where the source gives
// next to nothing, little is enough.
//
// A uniform sky is no lamp: nearly all luxels see a part of it, and in a room its last hundredth may be all the light there is. No looks are taken; which directions of a luxel
// samples look into is for others to say (lx_direct_tile.sky_cells).
//
// A luxel's samples are cut into four runs. Each is a well-spread set in itself, and what they disagree by tells the variance of their mean; but together they are spread still
// better, so it tells too much. How much is seen from pairs of runs that disagree less than runs do, over all luxels of the tile (see gain_of).
#include "trace/direct.h"

#include "base/memory.h"
#include "math/sobol.h"
#include "trace/light_sample.h"
#include "trace/sampling.h"
#include "trace/source_view.h"
#include "trace/tracer_data.h"

#include <string.h>

enum {
    tile_edge = 32, most_luxels = tile_edge * tile_edge,
    grid_edge = tile_edge + 2, // a border of nobody
    probes = 4,
    ray_batch = 4096,
    chunk_luxels = 64, // that sum up together
    runs = 4,
    most_monitor_share = 16, cells_per_share = 4,
};

// Unshadowed light whose mean varies by more, of itself, is looked at in four times as many samples, from 16 on.
static const float fine_deviation = 0.004f;

// Shares of the noise that is wanted which light straight from one source may have, where shadows fall and where none do.
static const float shadowed_share = 0.5f, unshadowed_share = 0.25f;
static const float darkest = 0.01f; // of the mean light of the source: what is darker need not be surer

// Looks of equal weight that must agree in a luxel and its neighbours: what they miss is a share of the source below its inverse, mostly.
static const float enough_looks = 20, enough_own_looks = 6; // the latter of the 16 that a luxel with doubts takes

// One of a luxel's first samples: what would arrive, from where, and what share of it does.
typedef struct look {
    lx_rgb light, transmittance;
    lx_vec3 direction;
    uint32_t cell;
    bool arrives; // else the receiver or the source turns away
} look;

typedef enum verdict { sees_nothing, sees_same, sees_both } verdict;

typedef struct luxel_state {
    verdict verdict;
    lx_rgb transmittance; // sees_same: of all rays
    float light, squares; // of the looks: sums of their unshadowed light and its squares
    uint8_t looked;       // looks taken: probes or lx_direct_sites
    bool possible;        // the source is not behind all sites' horizons
    bool listed;
    bool doubtful;        // sees_same, by too few looks, or beside what sees otherwise
} luxel_state;

struct lx_direct_batch {
    look looks[most_luxels][lx_direct_sites];
    luxel_state luxels[most_luxels];
    uint16_t grid[grid_edge * grid_edge]; // luxel + 1, 0: none
    uint16_t list[most_luxels], next[most_luxels];
    lx_ray rays[ray_batch];
    lx_rgb light[ray_batch], transmittance[ray_batch];
    uint32_t owner[ray_batch]; // a look, or a sum
    uint8_t run[ray_batch];
    uint64_t ray_count;
    lx_source_view view;
    lx_view_samples samples;
    // Per luxel of a chunk and cell.
    lx_rgb *sums;
    float (*run_sums)[runs]; // mean of the channels
};

// How far runs are apart within their pairs, and the pairs from each other; squares over the light's, in terms of the variance either shows of the mean of both.
typedef struct spread {
    double within, between;
    uint32_t count;
} spread;

// What stays the same for one source in one tile.
typedef struct job {
    lx_direct_batch *b;
    const lx_tracer *tracer;
    const lx_direct_tile *tile;
    uint32_t source, key, cells, weight;
    uint32_t samples; // of a luxel, at most
    uint32_t first_samples; // of which so many come first, then four times as many, and so on
    bool is_sharp;
    bool is_beside; // efforts may be more than 1
    uint32_t viewed; // luxel that the view is of; most_luxels: none yet
    spread even, shadowed; // of luxels whose shadows are known, and of others
    float noise, least; // standard error wanted, of the light or of `least`
} job;

lx_direct_batch *lx_direct_batch_create(const lx_tracer *tracer)
{
    uint32_t sums = chunk_luxels;
    for (uint32_t s = 0; s < tracer->source_count; ++s) {
        const uint32_t cells = lx_tracer_cell_count(tracer, s);
        sums = cells > sums ? cells : sums;
    }
    lx_direct_batch *b = lx_calloc_array(1, sizeof *b);
    if (!b) return NULL;
    b->sums = lx_calloc_array(sums, sizeof *b->sums);
    b->run_sums = lx_calloc_array(sums, sizeof *b->run_sums);
    if (!b->sums || !b->run_sums) {
        lx_direct_batch_destroy(b);
        return NULL;
    }
    return b;
}

void lx_direct_batch_destroy(lx_direct_batch *b)
{
    if (!b) return;
    lx_free(b->sums);
    lx_free(b->run_sums);
    lx_free(b);
}

uint64_t lx_direct_batch_rays(const lx_direct_batch *b)
{
    return b->ray_count;
}

static bool is_uniform_sky(const lx_tracer *tracer, uint32_t source)
{
    return lx_tracer_source(tracer, source)->kind == LX_SOURCE_SKY && lx_sky_is_uniform(&tracer->sky);
}

uint32_t lx_direct_sample_weight(const lx_tracer *tracer, uint32_t source)
{
    const uint32_t wanted = (lx_tracer_cell_count(tracer, source) + cells_per_share - 1) / cells_per_share;
    return wanted < most_monitor_share ? wanted : most_monitor_share;
}

// ---- tiles and sources --------------------------------------------------------------------------------------------------------

void lx_direct_find_bounds(const lx_direct_tile *tile, lx_direct_bounds *out)
{
    const size_t count = (size_t)tile->count * lx_direct_sites;
    lx_bounds box = lx_bounds_empty();
    lx_vec3 sum = {0, 0, 0};
    for (size_t i = 0; i < count; ++i) {
        lx_bounds_add(&box, tile->sites[i].position);
        sum = lx_add(sum, tile->sites[i].geometric_normal);
    }
    *out = (lx_direct_bounds){.centre = lx_scale(lx_add(box.low, box.high), 0.5f), .axis = lx_normalize(sum), .half_angle = LX_PI};
    float cosine = 1;
    for (size_t i = 0; i < count; ++i) {
        out->radius = lx_max(out->radius, lx_distance(out->centre, tile->sites[i].position));
        cosine = lx_min(cosine, lx_dot(out->axis, tile->sites[i].geometric_normal));
    }
    out->radius *= 1.0001f;
    if (lx_dot(sum, sum) > 0) out->half_angle = acosf(lx_clamp(cosine, -1, 1)) + 1e-3f;
}

// Angle by which directions to a ball differ from that to its centre; pi from within.
static float spread_angle(float radius, float distance)
{
    return distance > radius ? asinf(radius / distance) + 1e-3f : LX_PI;
}

static float angle_between(lx_vec3 unit, lx_vec3 v, float length)
{
    return length > 0 ? acosf(lx_clamp(lx_dot(unit, v) / length, -1, 1)) : 0;
}

// False if the source certainly gives no site of the tile anything.
static bool may_reach(const lx_tracer *tracer, uint32_t source, const lx_direct_bounds *bounds)
{
    const lx_source_sphere *s = &tracer->source_spheres[source];
    const lx_source *described = lx_tracer_source(tracer, source);
    const lx_light *light = described->light >= 0 ? &tracer->scene->lights[described->light] : NULL;
    if (light && light->kind == LX_LIGHT_DIRECTIONAL)
        return angle_between(bounds->axis, lx_neg(light->direction), 1) < bounds->half_angle + LX_PI / 2 + light->radius / 2;
    if (!(s->power < INFINITY)) return true;
    const lx_vec3 to_centre = lx_sub(s->centre, bounds->centre);
    const float distance = lx_length(to_centre);
    if (angle_between(bounds->axis, to_centre, distance) >
        bounds->half_angle + LX_PI / 2 + spread_angle(bounds->radius + s->radius, distance))
        return false;
    if (!light) return true;
    if (light->range > 0 && distance - bounds->radius >= light->range) return false;
    const float facing = -lx_dot(light->direction, to_centre);
    if (light->kind == LX_LIGHT_RECT || light->kind == LX_LIGHT_DISK) return facing + bounds->radius > 0;
    if (light->kind != LX_LIGHT_SPOT) return true;
    return angle_between(light->direction, lx_neg(to_centre), distance) < light->outer_angle + spread_angle(bounds->radius, distance);
}

// Sources whose light does not depend on the random numbers: their samples differ by site alone.
static bool is_sharp(const lx_tracer *tracer, uint32_t source)
{
    const int32_t index = lx_tracer_source(tracer, source)->light;
    if (index < 0) return false;
    const lx_light *light = &tracer->scene->lights[index];
    return light->kind != LX_LIGHT_RECT && light->kind != LX_LIGHT_DISK && light->radius == 0;
}

// ---- samples ------------------------------------------------------------------------------------------------------------------

// Of all sites the one nearest to the source decides.
static uint32_t effort_at(const job *j, uint32_t luxel)
{
    if (!j->is_beside) return 1;
    const lx_receiver *sites = &j->tile->sites[(size_t)luxel * lx_direct_sites];
    uint32_t most = 1;
    for (int k = 0; k < lx_direct_sites; ++k) {
        const uint32_t effort = lx_source_effort(j->tracer, j->source, sites[k].position);
        if (effort > most) most = effort;
    }
    return most;
}

// May any of the tile's luxels have more than the usual samples?
static bool may_be_beside(const job *j)
{
    const lx_direct_bounds *bounds = j->tile->bounds;
    if (j->is_sharp || j->cells > 1) return false;
    if (!bounds) return true;
    const lx_vec3 lamp = j->tracer->source_spheres[j->source].centre;
    const float distance = lx_distance(bounds->centre, lamp), nearest = lx_max(0, distance - bounds->radius);
    return lx_source_effort(j->tracer, j->source, lx_mad(lamp, lx_sub(bounds->centre, lamp), distance > 0 ? nearest / distance : 0)) > 1;
}

static uint32_t most_samples(const job *j, uint32_t luxel)
{
    return j->samples * effort_at(j, luxel);
}

static void see(job *j, uint32_t luxel)
{
    if (j->viewed == luxel) return;
    lx_source_view_fill(&j->b->view, j->tracer, j->source, &j->tile->sites[(size_t)luxel * lx_direct_sites]);
    j->viewed = luxel;
}

static uint32_t key_at(const job *j, uint32_t luxel)
{
    return lx_hash_combine(j->tile->stream[luxel], j->key);
}

// Against a luxel's gather rays.
static uint32_t count_at(const job *j, uint32_t luxel)
{
    return j->tile->alone && j->tile->alone[luxel] ? 0 : j->weight;
}

// Sixteen of a luxel's samples, from number `first` on, a multiple of 16. False: nothing arrives.
static bool take_samples(job *j, uint32_t luxel, uint32_t first)
{
    see(j, luxel);
    if (j->b->view.reaches) lx_source_view_sample(&j->b->view, key_at(j, luxel), first, count_at(j, luxel), &j->b->samples);
    return j->b->view.reaches;
}

// Of the latest samples.
static lx_ray ray_of(const lx_direct_batch *b, uint32_t k)
{
    const lx_view_vectors *origin = &b->view.origin, *direction = &b->samples.direction;
    return (lx_ray){.origin = {origin->x[k], origin->y[k], origin->z[k]}, .direction = {direction->x[k], direction->y[k], direction->z[k]},
                    .t_max = b->view.t_max};
}

static void trace_rays(const job *j, size_t count)
{
    lx_trace_transmittance(j->tracer, j->b->rays, j->b->transmittance, count);
    j->b->ray_count += count;
}

static void finish_looks(const job *j, size_t count)
{
    trace_rays(j, count);
    for (size_t k = 0; k < count; ++k) j->b->looks[j->b->owner[k] / lx_direct_sites][j->b->owner[k] % lx_direct_sites].transmittance = j->b->transmittance[k];
}

static bool same_rgb(lx_rgb a, lx_rgb b)
{
    return a.r == b.r && a.g == b.g && a.b == b.b;
}

static void judge(lx_direct_batch *b, uint32_t luxel)
{
    luxel_state *s = &b->luxels[luxel];
    s->verdict = sees_nothing;
    s->light = s->squares = 0;
    for (uint32_t i = 0; i < s->looked; ++i) {
        const look *l = &b->looks[luxel][i];
        if (!l->arrives) continue;
        const float light = lx_rgb_max(l->light);
        s->light += light;
        s->squares += light * light;
        if (s->verdict == sees_nothing) {
            s->verdict = sees_same;
            s->transmittance = l->transmittance;
        } else if (!same_rgb(s->transmittance, l->transmittance)) {
            s->verdict = sees_both;
            return;
        }
    }
}

// All luxels' first samples, their rays not yet sent.
static void prepare_looks(job *j)
{
    lx_direct_batch *b = j->b;
    for (uint32_t luxel = 0; luxel < j->tile->count; ++luxel) {
        look *looks = b->looks[luxel];
        b->luxels[luxel].possible = take_samples(j, luxel, 0);
        for (uint32_t i = 0; i < lx_direct_sites; ++i) {
            looks[i].arrives = b->luxels[luxel].possible && !lx_rgb_is_black(b->samples.light[i]);
            if (!looks[i].arrives) continue;
            const lx_ray ray = ray_of(b, i);
            looks[i].light = b->samples.light[i];
            looks[i].direction = ray.direction;
            looks[i].cell = b->samples.cell[i];
        }
    }
}

// Sends the rays of the listed luxels' looks up to number `end` and judges them.
static void look_at(job *j, const uint16_t *list, uint32_t list_count, uint32_t end)
{
    lx_direct_batch *b = j->b;
    size_t count = 0;
    for (uint32_t k = 0; k < list_count; ++k) {
        luxel_state *s = &b->luxels[list[k]];
        const lx_receiver *sites = &j->tile->sites[(size_t)list[k] * lx_direct_sites];
        for (uint32_t i = s->looked; i < end; ++i) {
            const look *l = &b->looks[list[k]][i];
            if (!l->arrives) continue;
            b->rays[count] = (lx_ray){.origin = lx_offset_origin(sites[i].position, sites[i].geometric_normal), .direction = l->direction, .t_max = b->view.t_max};
            b->owner[count++] = (uint32_t)list[k] * lx_direct_sites + i;
            if (count < ray_batch) continue;
            finish_looks(j, count);
            count = 0;
        }
        s->looked = (uint8_t)end;
    }
    finish_looks(j, count);
    for (uint32_t k = 0; k < list_count; ++k) judge(b, list[k]);
}

// ---- outlines of shadows -------------------------------------------------------------------------------------------------------

static void place_on_grid(lx_direct_batch *b, const lx_direct_tile *tile)
{
    memset(b->grid, 0, sizeof b->grid);
    for (uint32_t i = 0; i < tile->count; ++i)
        b->grid[(tile->place[i] / tile_edge + 1) * grid_edge + tile->place[i] % tile_edge + 1] = (uint16_t)(i + 1);
}

// Up to 8 luxels of the same chart around one.
static uint32_t find_neighbours(const job *j, uint32_t luxel, uint16_t out[8])
{
    const uint16_t *centre = &j->b->grid[(j->tile->place[luxel] / tile_edge + 1) * grid_edge + j->tile->place[luxel] % tile_edge + 1];
    uint32_t count = 0;
    for (int y = -1; y <= 1; ++y)
        for (int x = -1; x <= 1; ++x) {
            const uint16_t other = centre[y * grid_edge + x];
            if (other && other - 1u != luxel && j->tile->chart[other - 1] == j->tile->chart[luxel]) out[count++] = (uint16_t)(other - 1);
        }
    return count;
}

// Does what `b` sees cast doubt on what few rays of `a` tell?
static bool differ(const luxel_state *a, const luxel_state *b)
{
    return b->verdict == sees_both || (a->verdict == sees_same && b->verdict == sees_same && !same_rgb(a->transmittance, b->transmittance));
}

// Looks of a luxel and its neighbours, counted by weight: (sum of w)² / sum of w², Kish's effective sample size.
static float count_looks(const job *j, uint32_t luxel, const uint16_t *around, uint32_t count)
{
    const luxel_state *luxels = j->b->luxels;
    float light = luxels[luxel].light, squares = luxels[luxel].squares;
    for (uint32_t k = 0; k < count; ++k) {
        light += luxels[around[k]].light;
        squares += luxels[around[k]].squares;
    }
    return squares > 0 ? light * light / squares : 0;
}

static void look_where_it_matters(job *j)
{
    lx_direct_batch *b = j->b;
    uint16_t around[8];
    uint32_t count = 0;
    for (uint32_t i = 0; i < j->tile->count; ++i) b->list[count++] = (uint16_t)i;
    prepare_looks(j);
    look_at(j, b->list, count, probes);
    count = 0;
    for (uint32_t i = 0; i < j->tile->count; ++i) {
        luxel_state *s = &b->luxels[i];
        const uint32_t n = find_neighbours(j, i, around);
        s->listed = s->verdict != sees_same || count_looks(j, i, around, n) < enough_looks;
        for (uint32_t k = 0; k < n && !s->listed; ++k) s->listed = differ(s, &b->luxels[around[k]]);
        if (s->listed) b->list[count++] = (uint16_t)i;
    }
    while (count > 0) {
        look_at(j, b->list, count, lx_direct_sites);
        uint32_t next = 0;
        for (uint32_t i = 0; i < count; ++i) {
            const uint32_t n = find_neighbours(j, b->list[i], around);
            for (uint32_t k = 0; k < n; ++k) {
                luxel_state *s = &b->luxels[around[k]];
                if (s->listed || !differ(s, &b->luxels[b->list[i]])) continue;
                s->listed = true;
                b->next[next++] = around[k];
            }
        }
        memcpy(b->list, b->next, next * sizeof *b->list);
        count = next;
    }
    for (uint32_t i = 0; i < j->tile->count; ++i) {
        luxel_state *s = &b->luxels[i];
        if (!s->listed || s->verdict != sees_same) continue;
        // Beside a penumbra its last tenth goes unseen by 16 rays as often as not.
        const uint32_t n = find_neighbours(j, i, around);
        s->doubtful = count_looks(j, i, around, 0) < enough_own_looks || count_looks(j, i, around, n) < enough_looks;
        for (uint32_t k = 0; k < n && !s->doubtful; ++k) s->doubtful = differ(s, &b->luxels[around[k]]);
    }
}

// ---- sums -----------------------------------------------------------------------------------------------------------------------

static void add_to(lx_direct_batch *b, uint32_t sum, uint32_t run, lx_rgb arrives)
{
    b->sums[sum] = lx_rgb_add(b->sums[sum], arrives);
    b->run_sums[sum][run] += (arrives.r + arrives.g + arrives.b) * (1.0f / 3);
}

static float variance_of_mean(const float sums[runs], float scale)
{
    float mean = 0, squares = 0;
    for (int r = 0; r < runs; ++r) mean += sums[r] / runs;
    for (int r = 0; r < runs; ++r) squares += (sums[r] - mean) * (sums[r] - mean);
    return squares * scale * scale / (runs * (runs - 1));
}

static void add_spread(spread *to, const float sums[runs])
{
    const double a = (double)sums[0] - (double)sums[1], b = (double)sums[2] - (double)sums[3];
    const double mean = ((double)sums[0] + (double)sums[1] + (double)sums[2] + (double)sums[3]) / runs;
    const double c = ((double)sums[0] + (double)sums[1] - (double)sums[2] - (double)sums[3]) / 2;
    if (!(mean > 0) || (a == 0 && b == 0 && c == 0)) return;
    to->within += (a * a + b * b) / 8 / (mean * mean);
    to->between += c * c / 4 / (mean * mean);
    ++to->count;
}

// Variance of a mean over what the disagreement of its four runs shows. With d(n) as the variance that the difference of the halves of n samples shows, and V(n) the true one,
// V(n) = d(2n) + V(2n) = d(2n) + d(4n) + …, where each d is q times the one before: d(n) q / (1 - q). Four runs show (d(n / 2) + d(n)) / 3. Plain random numbers have q = 1/2.
static float gain_of(const spread *s)
{
    static const double least_q = 0.25;
    enum { doubts = 8 }; // as many luxels of plain random numbers are put beside the tile's
    if (!(s->within > 0)) return 1;
    const double usual = s->within / s->count, q = fmin(fmax((s->between + 0.5 * doubts * usual) / (s->within + doubts * usual), least_q), 0.5);
    return (float)(3 * q * q / (1 - q * q));
}

static void store(job *j, spread *of, uint32_t luxel, uint32_t slot, uint32_t samples, lx_rgb factor, lx_rgb *mean, float *variance)
{
    const float grey = (factor.r + factor.g + factor.b) * (1.0f / 3);
    for (uint32_t cell = 0; cell < j->cells; ++cell) {
        const size_t at = (size_t)cell * j->tile->count + luxel;
        mean[at] = lx_rgb_mul(lx_rgb_scale(j->b->sums[slot * j->cells + cell], 1 / (float)samples), factor);
        const float *sums = j->b->run_sums[slot * j->cells + cell];
        variance[at] = grey * grey * variance_of_mean(sums, runs / (float)samples);
        add_spread(of, sums);
    }
}

static void clear_sums(const job *j, uint32_t slots)
{
    memset(j->b->sums, 0, slots * j->cells * sizeof *j->b->sums);
    memset(j->b->run_sums, 0, slots * j->cells * sizeof *j->b->run_sums);
}

// Adds samples first … end of a luxel without asking what is in their way. The first were prepared.
static void add_unshadowed(job *j, uint32_t luxel, uint32_t first, uint32_t end, uint32_t samples)
{
    lx_direct_batch *b = j->b;
    for (uint32_t i = first; i < end;) {
        const uint32_t block = i / lx_direct_sites * lx_direct_sites, block_end = block + lx_direct_sites < end ? block + lx_direct_sites : end;
        if (block > 0) take_samples(j, luxel, block);
        for (; i < block_end; ++i) {
            const uint32_t k = i - block;
            const look *l = &b->looks[luxel][k];
            if (block == 0 && l->arrives) add_to(b, l->cell, i * runs / samples, l->light);
            if (block > 0 && !lx_rgb_is_black(b->samples.light[k])) add_to(b, b->samples.cell[k], i * runs / samples, b->samples.light[k]);
        }
    }
}

// How many samples come first, so that growing fourfold leads to `most`.
static uint32_t first_step(uint32_t most)
{
    while (most % runs == 0 && most / runs >= lx_direct_sites) most /= runs;
    return most;
}

// What were four runs is the first of the next four.
static void join_runs(float sums[runs])
{
    sums[0] += sums[1] + sums[2] + sums[3];
    sums[1] = sums[2] = sums[3] = 0;
}

// Is the unshadowed mean of so many samples fine enough?
static bool is_fine(const job *j, uint32_t samples)
{
    const lx_rgb sum = j->b->sums[0];
    const float all = (sum.r + sum.g + sum.b) * (1.0f / 3) / (float)samples;
    const float fine = lx_max(fine_deviation, unshadowed_share * j->noise), bright = lx_max(all, j->least);
    return variance_of_mean(j->b->run_sums[0], runs / (float)samples) <= fine * fine * bright * bright;
}

static void sum_evenly_lit(job *j, uint32_t luxel, lx_rgb *mean, float *variance)
{
    const uint32_t most = most_samples(j, luxel);
    uint32_t samples = most, done = 0;
    clear_sums(j, 1);
    if (j->cells == 1) samples = first_step(samples);
    for (;; samples *= runs) {
        add_unshadowed(j, luxel, done, samples, samples);
        if (samples == most || is_fine(j, samples)) break;
        join_runs(j->b->run_sums[0]);
        done = samples;
    }
    store(j, &j->even, luxel, 0, samples, j->b->luxels[luxel].transmittance, mean, variance);
}

static void finish_sums(const job *j, size_t count)
{
    trace_rays(j, count);
    for (size_t k = 0; k < count; ++k)
        add_to(j->b, j->b->owner[k], j->b->run[k], lx_rgb_mul(j->b->light[k], j->b->transmittance[k]));
}

typedef struct queue {
    size_t count; // of rays
    uint32_t slot, end; // of the samples that are added
} queue;

static void send(job *j, queue *q, const lx_ray *ray, lx_rgb light, uint32_t cell, uint32_t i)
{
    lx_direct_batch *b = j->b;
    b->rays[q->count] = *ray;
    b->light[q->count] = light;
    b->owner[q->count] = q->slot * j->cells + cell;
    b->run[q->count] = (uint8_t)(i * runs / q->end);
    if (++q->count < ray_batch) return;
    finish_sums(j, q->count);
    q->count = 0;
}

// Rays of a luxel's samples first … end.
static void send_samples(job *j, queue *q, uint32_t luxel, uint32_t first, uint32_t end)
{
    lx_direct_batch *b = j->b;
    for (uint32_t i = first; i < end;) {
        const uint32_t block = i / lx_direct_sites * lx_direct_sites, block_end = block + lx_direct_sites < end ? block + lx_direct_sites : end;
        if (!take_samples(j, luxel, block)) return;
        for (; i < block_end; ++i) {
            const uint32_t k = i - block;
            if (lx_rgb_is_black(b->samples.light[k])) continue;
            const lx_ray ray = ray_of(b, k);
            send(j, q, &ray, b->samples.light[k], b->samples.cell[k], i);
        }
    }
}

// Rays of the listed slots' samples up to number `end`; the first `done` were taken before, or looked at.
static void sum_samples(job *j, const uint16_t *list, const uint8_t *slots, uint32_t slot_count, uint32_t done, uint32_t end)
{
    lx_direct_batch *b = j->b;
    queue q = {.end = end};
    for (uint32_t s = 0; s < slot_count; ++s) {
        const uint32_t luxel = list[slots[s]];
        uint32_t first = done;
        q.slot = slots[s];
        for (; first < b->luxels[luxel].looked; ++first) {
            const look *l = &b->looks[luxel][first];
            if (l->arrives) add_to(b, q.slot * j->cells + l->cell, first * runs / end, lx_rgb_mul(l->light, l->transmittance));
        }
        send_samples(j, &q, luxel, first, end);
    }
    finish_sums(j, q.count);
}

static bool is_sure(const job *j, uint32_t slot, uint32_t samples)
{
    const lx_rgb sum = j->b->sums[slot];
    const float mean = (sum.r + sum.g + sum.b) * (1.0f / 3) / (float)samples, allowed = shadowed_share * j->noise * lx_max(mean, j->least);
    const float variance = variance_of_mean(j->b->run_sums[slot], runs / (float)samples);
    return variance <= allowed * allowed;
}

// The listed luxels by rays of their samples: all of them, or as many as make them sure enough.
static void sum_shadowed(job *j, const uint16_t *list, uint32_t list_count, lx_rgb *mean, float *variance)
{
    lx_direct_batch *b = j->b;
    uint8_t slots[chunk_luxels];
    uint32_t count = list_count, done = 0;
    clear_sums(j, list_count);
    for (uint32_t s = 0; s < list_count; ++s) slots[s] = (uint8_t)s;
    for (uint32_t end = j->first_samples; count > 0; done = end, end *= runs) {
        sum_samples(j, list, slots, count, done, end);
        uint32_t left = 0;
        for (uint32_t s = 0; s < count; ++s) {
            const uint32_t slot = slots[s];
            if (end == most_samples(j, list[slot]) || is_sure(j, slot, end)) {
                store(j, &j->shadowed, list[slot], slot, end, (lx_rgb){1, 1, 1}, mean, variance);
                continue;
            }
            join_runs(b->run_sums[slot]);
            slots[left++] = (uint8_t)slot;
        }
        count = left;
    }
}

// ---- a sky of one colour ---------------------------------------------------------------------------------------------------------

// Looks into a cell of a luxel, if samples are to do so, after `count` rays that are still to be traced; returns how many are after it.
static size_t look_into_cell(const job *j, uint32_t luxel, uint32_t slot, uint32_t cell, size_t count)
{
    lx_direct_batch *b = j->b;
    const lx_direct_tile *tile = j->tile;
    const bool alone = tile->alone && tile->alone[luxel];
    const float per_ray = lx_sky_per_ray(&tile->sky_cells[luxel], cell), rays = (float)(lx_rays_per_sample * j->samples) / (float)tile->sky_cell_count;
    if (per_ray == 0 && !alone) return count; // gather rays tell enough
    const uint32_t wanted = (uint32_t)(rays * (per_ray > 0 ? per_ray : 1.0f / lx_rays_per_sample)), samples = wanted > 1 ? wanted : 1;
    const uint32_t stream = lx_hash_combine(tile->stream[luxel], j->key), key = lx_hash_combine(stream, cell);
    const float share = alone ? 1 : lx_sky_samples_share(per_ray);
    for (uint32_t i = 0; i < samples; ++i) {
        const lx_receiver *site = &tile->sites[(size_t)luxel * lx_direct_sites + (4 * (cell + stream) + i) % lx_direct_sites];
        const lx_vec2 u = lx_sky_point_in(cell, lx_sobol_pair(i, key), tile->sky_cell_count);
        const lx_vec3 direction = lx_to_world(site->normal, lx_sample_polar_hemisphere(u));
        if (!(lx_dot(direction, site->geometric_normal) > 0)) continue;
        b->rays[count] = (lx_ray){.origin = lx_offset_origin(site->position, site->geometric_normal), .direction = direction, .t_max = INFINITY};
        b->light[count] = lx_rgb_grey(share * LX_PI / (float)(tile->sky_cell_count * samples));
        b->owner[count] = slot;
        b->run[count] = (uint8_t)((i * runs / samples + cell) % runs);
        if (++count < ray_batch) continue;
        finish_sums(j, count);
        count = 0;
    }
    return count;
}

static bool light_from_sky(job *j, lx_rgb *mean, float *variance)
{
    const lx_direct_tile *tile = j->tile;
    const uint64_t before = j->b->ray_count;
    for (uint32_t first = 0; first < tile->count; first += chunk_luxels) {
        const uint32_t end = first + chunk_luxels < tile->count ? first + chunk_luxels : tile->count;
        size_t count = 0;
        clear_sums(j, chunk_luxels);
        for (uint32_t i = first; i < end; ++i)
            for (uint32_t cell = 0; cell < tile->sky_cell_count; ++cell)
                count = look_into_cell(j, i, i - first, cell, count);
        finish_sums(j, count);
        for (uint32_t i = first; i < end; ++i) store(j, &j->shadowed, i, i - first, 1, (lx_rgb){1, 1, 1}, mean, variance);
    }
    const float gain = gain_of(&j->shadowed);
    for (uint32_t i = 0; i < tile->count; ++i) variance[i] *= gain;
    return j->b->ray_count > before;
}

bool lx_direct_light(lx_direct_batch *b, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean,
                     float *variance)
{
    const lx_tracer *tracer = settings->tracer;
    if (tile->bounds && !may_reach(tracer, source, tile->bounds)) return false;
    // Random numbers as the path integrator takes them for the light samples at the start of a path: vertex 0.
    job j = {.b = b, .tracer = tracer, .tile = tile, .source = source, .key = lx_hash_combine(tracer->source_keys[source], 0),
             .cells = lx_tracer_cell_count(tracer, source), .weight = lx_direct_sample_weight(tracer, source)};
    if (is_uniform_sky(tracer, source)) {
        j.samples = settings->samples;
        return light_from_sky(&j, mean, variance);
    }
    j.is_sharp = is_sharp(tracer, source);
    j.samples = j.is_sharp ? (uint32_t)lx_direct_sites : settings->samples * j.weight;
    j.first_samples = j.samples;
    j.is_beside = may_be_beside(&j);
    j.viewed = most_luxels;
    j.noise = settings->noise;
    j.least = darkest * lx_source_mean(tracer, source);
    // A monitor's cells must each be sure; and without a bound nothing ends early.
    if (j.cells == 1 && j.noise > 0) j.first_samples = first_step(j.first_samples);
    memset(b->luxels, 0, tile->count * sizeof *b->luxels);
    if (!settings->all_rays) {
        place_on_grid(b, tile);
        look_where_it_matters(&j);
    }
    const size_t zeros = (size_t)j.cells * tile->count;
    memset(mean, 0, zeros * sizeof *mean);
    memset(variance, 0, zeros * sizeof *variance);
    const uint32_t chunk = j.cells == 1 ? (uint32_t)chunk_luxels : 1;
    uint32_t count = 0;
    bool any = false;
    for (uint32_t i = 0; i < tile->count; ++i) {
        const luxel_state *s = &b->luxels[i];
        if (s->verdict == sees_same && !s->doubtful) {
            if (lx_rgb_is_black(s->transmittance)) continue;
            sum_evenly_lit(&j, i, mean, variance);
            any = true;
            continue;
        }
        if (!s->possible && s->looked == lx_direct_sites) continue; // behind every site's horizon
        b->list[count++] = (uint16_t)i;
    }
    for (uint32_t first = 0; first < count; first += chunk)
        sum_shadowed(&j, b->list + first, count - first < chunk ? count - first : chunk, mean, variance);
    // What sites of a sharp source disagree by is the shadow's outline, no noise: other random numbers would give the same.
    const float gains[2] = {j.is_sharp ? 0 : gain_of(&j.shadowed), j.is_sharp ? 0 : gain_of(&j.even)};
    for (uint32_t i = 0; i < tile->count; ++i) {
        const luxel_state *s = &b->luxels[i];
        const float gain = gains[s->verdict == sees_same && !s->doubtful];
        for (uint32_t cell = 0; cell < j.cells; ++cell) variance[(size_t)cell * tile->count + i] *= gain;
    }
    return any || count > 0;
}
