// Two loops. The first takes the many: rays whose hit is looked up without shading it. What it cannot decide goes, with its hit, to the second, which
// shades, follows paths from vertex to vertex, and is as general as the path integrator (trace/path.c), whose estimators it shares.
#include "bake/gather_rays.h"

#include "base/error.h"
#include "math/sobol.h"
#include "trace/direct.h"
#include "trace/sampling.h"
#include "trace/tracer_data.h"

#include <string.h>

enum {
    batch_size = lx_gather_batch_size,
    block_size = 128,      // hits whose places are fetched before they are read
    look_ahead = 48,       // rows that are fetched before they are added
    triangles_ahead = 16,  // of the lookup, before they are read
    near_until = 4,        // vertices; paths caught in a corner are looked up all the same
    most_passes = 256,     // surfaces one ray may pass through
};

// Random dimensions of a vertex. Light samples take theirs from the source's key.
enum { dimension_bounce = 1, dimension_roulette = 2, dimension_pass = 3 };
enum { gather_key = 0x67617468 }; // keeps the streams of gather rays apart from those of light samples

typedef struct flight {
    lx_rgb throughput;
    float cosine; // at the receiver
    uint32_t stream, sample, target;
    uint32_t vertex, passes;
    uint32_t last_surface, last_triangle;
    uint32_t from; // luxel whose direct light was taken where the ray came from: what it meets of sources is counted already, but for near ones. LX_NO_LUXEL: none was
} flight;

typedef struct vertex_record {
    lx_receiver receiver;
    flight flight; // that got there
} vertex_record;

typedef struct pending {
    lx_taps taps;
    uint32_t index; // of the ray in the batch
    bool near;
} pending;

typedef struct slow_row {
    const uint16_t *row;
    uint32_t target;
    lx_rgb weight;
} slow_row;

// Whose directions are wanted: of sample `samples` of the stream, from vertex `vertices`.
typedef struct direction_keys {
    uint32_t streams[2 * batch_size], samples[2 * batch_size], vertices[2 * batch_size];
} direction_keys;

struct lx_gather_batch {
    lx_ray rays[batch_size];
    lx_hit hits[batch_size];
    float cosines[batch_size];
    direction_keys keys;
    float x[2 * batch_size], y[2 * batch_size], z[2 * batch_size]; // local directions
    uint32_t found[batch_size], found_target[batch_size];
    // The second loop; what arrives while it is full waits for its turn.
    lx_ray slow_rays[2 * batch_size];
    lx_hit slow_hits[2 * batch_size];
    flight flights[2 * batch_size];
    lx_shading shading[2 * batch_size];
    size_t slow_count;
    // Rays of the second loop that are still to be traced.
    lx_hit leaving_hits[2 * batch_size]; // they leave from here,
    flight leaving[2 * batch_size];
    lx_receiver leaving_receivers[2 * batch_size];
    size_t leaving_count;
    lx_ray onward_rays[2 * batch_size]; // and these are on their way
    flight onward[2 * batch_size];
    size_t onward_count;
    slow_row slow_rows[2 * batch_size];
    size_t slow_row_count;
    vertex_record vertices[2 * batch_size]; // that take light samples
    lx_ray shadow_rays[batch_size];
    lx_rgb light[batch_size], transmittance[batch_size];
    uint32_t owner[batch_size], cell[batch_size];
    uint64_t ray_count;
};

lx_gather_batch *lx_gather_batch_create(void)
{
    return lx_calloc_array(1, sizeof(lx_gather_batch));
}

void lx_gather_batch_destroy(lx_gather_batch *batch)
{
    lx_free(batch);
}

uint64_t lx_gather_batch_rays(const lx_gather_batch *batch)
{
    return batch->ray_count;
}

static uint32_t dimension_key(uint32_t stream, uint32_t vertex, uint32_t dimension)
{
    return lx_hash_combine(stream, gather_key + vertex * 4096 + dimension);
}

// ---- what arrives ---------------------------------------------------------------------------------------------------------------

// The sums that take light met by a ray from vertex `vertex`.
static float *sums_for(const lx_gather_output *out, uint32_t vertex)
{
    return vertex == 0 && out->met ? out->met : out->sums;
}

static void add_light(const lx_gather_settings *settings, float *sums, uint32_t target, const lx_source_use *use, uint32_t cell, lx_rgb value)
{
    const size_t layer = (size_t)use->layer + (use->cells ? 0 : cell), layers = settings->row_layers;
    if (use->cells) value = lx_rgb_mul(value, use->cells[cell]);
    const float unit = settings->scales[layer] * (1 / LX_ROW_UNIT);
    float *sum = sums + 3 * layers * target + layer;
    sum[0] += value.r * use->weight.r * unit;
    sum[layers] += value.g * use->weight.g * unit;
    sum[2 * layers] += value.b * use->weight.b * unit;
}

// Does light that reaches vertex `vertex` straight from a source count?
static bool counts(const lx_gather_settings *settings, const lx_source_use *use, uint32_t vertex)
{
    if (use->layer < 0) return false;
    return vertex > 0 || settings->everything || (settings->direct && use->direct);
}

bool lx_gather_is_near(const lx_tracer *tracer, const lx_gather_luxel *luxel, uint32_t source)
{
    const lx_source_sphere *s = &tracer->source_spheres[source];
    const lx_vec3 d = lx_sub(s->centre, luxel->centre);
    const float reach = luxel->reach + s->radius;
    return s->power < INFINITY && lx_dot(d, d) < reach * reach;
}

// Does the flight bring light straight from the source to where it came from?
static bool brings(const lx_gather_settings *settings, const flight *f, uint32_t source)
{
    if (f->from == LX_NO_LUXEL) return true;
    const lx_gather_luxel *luxel = &settings->luxels[f->from];
    return (luxel->near_sources >> source % 64 & 1) && lx_gather_is_near(settings->tracer, luxel, source);
}

static lx_vec2 direction_point(uint32_t stream, uint32_t sample, uint32_t vertex)
{
    return lx_sobol_pair(sample, dimension_key(stream, vertex, dimension_bounce));
}

static void add_sky(const lx_gather_settings *settings, const lx_gather_output *out, const flight *f, lx_vec3 direction)
{
    const lx_tracer *tracer = settings->tracer;
    if (!tracer->sky.present) return;
    const lx_source_use *use = &settings->uses[tracer->source_count - 1]; // the sky comes last
    if (!counts(settings, use, f->vertex)) return;
    lx_rgb light = lx_rgb_scale(lx_rgb_mul(f->throughput, lx_sky_radiance(&tracer->sky, direction)), LX_PI * lx_sky_weight(tracer, direction, f->cosine));
    if (f->vertex == 0 && (settings->sky_cells || out->sky_seen)) {
        const uint32_t cell = lx_sky_cell_of(direction_point(f->stream, f->sample, 0), settings->sky_cell_count);
        const bool looks = out->sky_seen && f->sample < settings->sky_cell_count; // one ray a cell
        if (looks) out->sky_seen[f->target] |= (uint64_t)1 << cell;
        if (looks && f->passes > 0) out->sky_through[f->target] |= (uint64_t)1 << cell;
        if (settings->sky_cells) light = lx_rgb_scale(light, 1 - lx_sky_samples_share(lx_sky_per_ray(&settings->sky_cells[f->target], cell)));
    }
    add_light(settings, sums_for(out, f->vertex), f->target, use, 0, light);
}

static void add_emission(const lx_gather_settings *settings, const lx_gather_output *out, const flight *f, const lx_ray *ray, const lx_hit *hit,
                         lx_rgb emission)
{
    const int32_t source = settings->tracer->scene->surfaces[hit->surface].source;
    if (source < 0 || lx_rgb_is_black(emission)) return;
    const lx_source_use *use = &settings->uses[source];
    if (!counts(settings, use, f->vertex) || !brings(settings, f, (uint32_t)source)) return;
    const lx_tracer *tracer = settings->tracer;
    const uint32_t samples = f->vertex == 0 ? lx_direct_sample_weight(tracer, (uint32_t)source) : 1;
    lx_vec3 position, normal;
    lx_hit_geometry(tracer, hit, &position, &normal);
    const float weight = lx_hit_weight(tracer, ray, hit, normal, f->cosine, samples);
    const uint32_t cell = lx_tracer_cell_at(tracer, hit->surface, hit->triangle, hit->u, hit->v);
    const bool near = f->vertex == 0 && out->near_met && lx_gather_is_near(tracer, &settings->luxels[out->targets[f->target]], (uint32_t)source);
    add_light(settings, near ? out->near_met : sums_for(out, f->vertex), f->target, use, cell,
              lx_rgb_scale(lx_rgb_mul(f->throughput, emission), LX_PI * weight));
}

// ---- directions -------------------------------------------------------------------------------------------------------------------

// Local directions of rays: [PBR4]'s cosine-weighted ones of a Sobol point each, in plain loops that compilers turn into vectors.
static inline __attribute__((always_inline)) void make_directions(const direction_keys *restrict keys, size_t count, float *restrict x, float *restrict y,
                                                                  float *restrict z)
{
    for (size_t i = 0; i < count; ++i) {
        const lx_vec3 d = lx_sample_polar_hemisphere(direction_point(keys->streams[i], keys->samples[i], keys->vertices[i]));
        x[i] = d.x;
        y[i] = d.y;
        z[i] = d.z;
    }
}

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void make_directions_avx2(const direction_keys *keys, size_t count, float *x, float *y, float *z)
{
    make_directions(keys, count, x, y, z);
}
#endif

static void find_directions(lx_gather_batch *b, size_t count)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        make_directions_avx2(&b->keys, count, b->x, b->y, b->z);
        return;
    }
#endif
    make_directions(&b->keys, count, b->x, b->y, b->z);
}

// Random bits of the tap at a hit: the same whichever loop looks it up.
static uint32_t tap_bits(uint32_t stream, uint32_t vertex, uint32_t sample)
{
    return lx_hash32((vertex == 0 ? stream : dimension_key(stream, vertex, 0)) ^ (sample * 0x9e3779b9u));
}

// ---- light samples -----------------------------------------------------------------------------------------------------------------

// The light of a vertex is but one of a luxel's many rays: roulette skips more of it than the path integrator does.
static bool sample_light(const lx_gather_settings *settings, uint32_t source, const vertex_record *v, lx_ray *ray, lx_rgb *light, uint32_t *cell)
{
    // source_scales are a twentieth of the mean. Few samples come near their bound.
    enum { scale_factor = 400, bound_excess = 2 };
    const lx_tracer *tracer = settings->tracer;
    const flight *f = &v->flight;
    const uint32_t key = lx_hash_combine(tracer->source_keys[source], gather_key + f->vertex + 1);
    const float scale = scale_factor * tracer->source_scales[source];
    float bound = lx_source_bound(tracer, source, &v->receiver);
    if (bound == 0) return false;
    // Within the sphere around a long tube or a string of bulbs: nothing is certain, but few places are much brighter than this.
    const lx_source_sphere *sphere = &tracer->source_spheres[source];
    if (!(bound < INFINITY) && sphere->power < INFINITY && sphere->radius > 0) bound = 4 * sphere->power / (sphere->radius * sphere->radius);
    const float brightness = lx_rgb_max(f->throughput);
    const float chance = lx_light_roulette(f->stream, f->sample, key ^ 0x68bc21ebu, brightness * bound / bound_excess, scale);
    if (chance == 0) return false;
    const lx_vec2 u = lx_sobol_pair(f->sample, lx_hash_combine(f->stream, key));
    if (!lx_sample_source_by_power(tracer, source, &v->receiver, u, 1, ray, light, cell)) return false;
    *light = lx_rgb_scale(*light, chance);
    const float again = lx_light_roulette(f->stream, f->sample, key ^ 0x02e5be93u, brightness * lx_rgb_max(*light), scale);
    *light = lx_rgb_scale(*light, again);
    return again > 0;
}

static void flush_shadow_rays(lx_gather_batch *b, const lx_gather_settings *settings, const lx_source_use *use, size_t count,
                              const lx_gather_output *out)
{
    if (count == 0) return;
    lx_trace_transmittance(settings->tracer, b->shadow_rays, b->transmittance, count);
    b->ray_count += count;
    for (size_t k = 0; k < count; ++k) {
        const flight *f = &b->vertices[b->owner[k]].flight;
        const lx_rgb arrives = lx_rgb_mul(b->light[k], b->transmittance[k]);
        if (!lx_rgb_is_black(arrives)) add_light(settings, out->sums, f->target, use, b->cell[k], lx_rgb_mul(f->throughput, arrives));
    }
}

static void next_events(lx_gather_batch *b, const lx_gather_settings *settings, size_t vertex_count, const lx_gather_output *out)
{
    for (uint32_t s = 0; s < settings->tracer->source_count; ++s) {
        const lx_source_use *use = &settings->uses[s];
        if (use->layer < 0) continue;
        size_t count = 0;
        for (size_t i = 0; i < vertex_count; ++i) {
            if (!brings(settings, &b->vertices[i].flight, s)) continue;
            if (!sample_light(settings, s, &b->vertices[i], &b->shadow_rays[count], &b->light[count], &b->cell[count])) continue;
            b->owner[count++] = (uint32_t)i;
            if (count < batch_size) continue;
            flush_shadow_rays(b, settings, use, count, out);
            count = 0;
        }
        flush_shadow_rays(b, settings, use, count, out);
    }
}

// ---- paths that go on -------------------------------------------------------------------------------------------------------------

// A ray goes on from `receiver` in a local direction, if not below its geometric surface; the flight is what it was when it got there.
static void go_on(lx_gather_batch *b, const lx_receiver *receiver, flight f, lx_vec3 local)
{
    const lx_vec3 direction = lx_to_world(receiver->normal, local);
    if (!(lx_dot(direction, receiver->geometric_normal) > 0)) return;
    ++f.vertex;
    f.cosine = local.z;
    f.passes = 0;
    f.last_surface = LX_MISS;
    b->onward_rays[b->onward_count] = (lx_ray){.origin = lx_offset_origin(receiver->position, receiver->geometric_normal), .direction = direction,
                                               .t_max = INFINITY};
    b->onward[b->onward_count++] = f;
}

// The path is but one of a luxel's many rays: it goes on as often as what it would bring counts, beside rays that are looked up at once.
static bool survives(flight *f, lx_rgb albedo)
{
    const lx_rgb throughput = lx_rgb_mul(f->throughput, albedo);
    const float survival = lx_min(1, lx_rgb_max(throughput));
    if (!(lx_sobol_one(f->sample, dimension_key(f->stream, f->vertex, dimension_roulette)) < survival)) return false;
    f->throughput = lx_rgb_scale(throughput, 1 / survival);
    return true;
}

static void note_row(lx_gather_batch *b, const uint16_t *rows, const lx_gather_settings *settings, const flight *f, uint32_t luxel)
{
    b->slow_rows[b->slow_row_count++] = (slow_row){rows + lx_row_stride(settings->row_layers) * luxel, f->target, f->throughput};
}

static void add_slow_rows(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_output *out)
{
    const size_t count = 3 * (size_t)settings->row_layers;
    for (size_t i = 0; i < b->slow_row_count; ++i) {
        if (i + look_ahead < b->slow_row_count) lx_row_fetch(b->slow_rows[i + look_ahead].row, count);
        const slow_row *r = &b->slow_rows[i];
        const float factor[3] = {r->weight.r, r->weight.g, r->weight.b};
        lx_row_add_scaled(out->sums + count * r->target, r->row, settings->row_layers, factor);
    }
    b->slow_row_count = 0;
}

// The path goes on from a hit, if it does. `from`: the luxel that light straight from the sources was taken of.
static void leave(lx_gather_batch *b, flight f, const lx_hit *hit, lx_rgb albedo, uint32_t from)
{
    if (!survives(&f, albedo)) return;
    f.from = from;
    b->leaving_hits[b->leaving_count] = *hit;
    b->leaving[b->leaving_count++] = f;
}

// A plain hit that is too near for all light to be looked up, or on a silent luxel: its albedo is known. Too near, light straight from the sources is as well, and a ray goes
// on for the rest. False: nothing is known.
static bool leave_unshaded(lx_gather_batch *b, const lx_gather_settings *settings, const flight *f, const lx_hit *hit, uint32_t luxel)
{
    if (luxel == LX_NO_LUXEL || !settings->rows_direct) return false;
    const bool is_silent = luxel >= LX_SILENT;
    if (!is_silent) note_row(b, settings->rows_direct, settings, f, luxel);
    leave(b, *f, hit, settings->luxels[luxel & ~LX_SILENT].albedo, is_silent ? LX_NO_LUXEL : luxel);
    return true;
}

static void leave_all(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_output *out)
{
    size_t vertex_count = 0;
    lx_hit_receivers(settings->tracer, b->leaving_hits, b->leaving_receivers, b->leaving_count);
    for (size_t i = 0; i < b->leaving_count; ++i) {
        b->keys.streams[i] = b->leaving[i].stream;
        b->keys.samples[i] = b->leaving[i].sample;
        b->keys.vertices[i] = b->leaving[i].vertex + 1;
    }
    find_directions(b, b->leaving_count);
    for (size_t i = 0; i < b->leaving_count; ++i) {
        const uint32_t from = b->leaving[i].from;
        if (from == LX_NO_LUXEL || settings->luxels[from].near_sources) b->vertices[vertex_count++] = (vertex_record){b->leaving_receivers[i], b->leaving[i]};
        go_on(b, &b->leaving_receivers[i], b->leaving[i], (lx_vec3){b->x[i], b->y[i], b->z[i]});
    }
    next_events(b, settings, vertex_count, out);
    b->leaving_count = 0;
}

// ---- the first loop ----------------------------------------------------------------------------------------------------------------

static void send(lx_gather_batch *b, const lx_ray *ray, const lx_hit *hit, const flight *f)
{
    b->slow_rays[b->slow_count] = *ray;
    b->slow_hits[b->slow_count] = *hit;
    b->flights[b->slow_count++] = *f;
}

// Rays from the starts; those below the geometric surface are dropped. Returns how many are left; b->found is the start of each.
static size_t make_rays(lx_gather_batch *b, const lx_gather_start *starts, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        b->keys.streams[i] = starts[i].stream;
        b->keys.samples[i] = starts[i].sample;
        b->keys.vertices[i] = 0;
    }
    find_directions(b, count);
    size_t made = 0;
    const lx_receiver *last = NULL;
    lx_vec3 tangent = {0, 0, 0}, bitangent = {0, 0, 0}, origin = {0, 0, 0};
    for (size_t i = 0; i < count; ++i) {
        const lx_receiver *r = starts[i].receiver;
        if (r != last) { // several rays leave one site
            lx_tangent_frame(r->normal, &tangent, &bitangent);
            origin = lx_offset_origin(r->position, r->geometric_normal);
            last = r;
        }
        const lx_vec3 direction = lx_add(lx_add(lx_scale(tangent, b->x[i]), lx_scale(bitangent, b->y[i])), lx_scale(r->normal, b->z[i]));
        b->rays[made] = (lx_ray){.origin = origin, .direction = direction, .t_max = INFINITY};
        b->cosines[made] = b->z[i];
        b->found[made] = (uint32_t)i;
        made += lx_dot(direction, r->geometric_normal) > 0;
    }
    return made;
}

static void add_rows(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_output *out, size_t count)
{
    const size_t values = 3 * (size_t)settings->row_layers, stride = lx_row_stride(settings->row_layers);
    for (size_t i = 0; i < count; ++i) {
        if (i + look_ahead < count) lx_row_fetch(settings->rows + stride * b->found[i + look_ahead], values);
        lx_row_add(out->sums + values * b->found_target[i], settings->rows + stride * b->found[i], values);
    }
}

static flight first_flight(const lx_gather_start *start, float cosine)
{
    return (flight){.throughput = {1, 1, 1}, .cosine = cosine, .stream = start->stream, .sample = start->sample, .target = start->target,
                    .last_surface = LX_MISS, .from = LX_NO_LUXEL};
}

static void fetch_luxel(const lx_gather_settings *settings, uint32_t luxel)
{
    if (luxel != LX_NO_LUXEL && settings->rows_direct) LX_PREFETCH(&settings->luxels[luxel & ~LX_SILENT]);
}

static void fetch_triangle(const lx_lookup *lookup, const lx_hit *hit)
{
    if (hit->surface == LX_MISS) return;
    const lx_lookup_triangle *triangles = lookup->surfaces[hit->surface].triangles;
    if (triangles) LX_PREFETCH(triangles + hit->triangle);
}

// What is done with hits first … end - 1 of the first rays: `b->found` tells the start of each. Adds to the luxels that were found (at or before the hits in b->found).
static size_t look_up(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_start *starts, size_t first, size_t end, size_t made, size_t found_count,
                      uint32_t first_start, const lx_gather_output *out)
{
    pending pending_hits[block_size];
    uint32_t luxels[block_size];
    size_t pending_count = 0;
    for (size_t i = first; i < end; ++i) {
        const lx_hit *hit = &b->hits[i];
        const lx_gather_start *start = &starts[b->found[i]];
        if (i + triangles_ahead < made) fetch_triangle(settings->lookup, hit + triangles_ahead);
        if (hit->surface == LX_MISS) {
            const flight f = first_flight(start, b->cosines[i]);
            add_sky(settings, out, &f, b->rays[i].direction);
            continue;
        }
        const lx_lookup_surface *surface = &settings->lookup->surfaces[hit->surface];
        if (surface->plain && ((hit->back && !surface->double_sided) || settings->bounces == 0)) continue; // black
        const bool near = hit->t < settings->near_texels * surface->texel_m;
        const bool may_look_up = surface->plain && surface->triangles && !hit->back && (!near || settings->rows_direct) &&
                                 surface->triangles[hit->triangle].chart != LX_NO_CHART;
        if (may_look_up) {
            const lx_taps taps = lx_lookup_taps(settings->lookup, hit, tap_bits(start->stream, 0, start->sample));
            lx_lookup_fetch(settings->lookup, taps);
            pending_hits[pending_count++] = (pending){taps, (uint32_t)i, near};
            continue;
        }
        const flight f = first_flight(start, b->cosines[i]);
        send(b, &b->rays[i], hit, &f);
    }
    for (size_t k = 0; k < pending_count; ++k) {
        luxels[k] = lx_lookup_luxel(settings->lookup, pending_hits[k].taps);
        if (luxels[k] >= LX_SILENT || pending_hits[k].near) fetch_luxel(settings, luxels[k]);
    }
    for (size_t k = 0; k < pending_count; ++k) {
        const uint32_t i = pending_hits[k].index, luxel = luxels[k];
        const lx_gather_start *start = &starts[b->found[i]];
        if (luxel >= LX_SILENT || pending_hits[k].near) {
            const flight f = first_flight(start, b->cosines[i]);
            if (!leave_unshaded(b, settings, &f, &b->hits[i], luxel)) send(b, &b->rays[i], &b->hits[i], &f);
        } else if (out->luxels) {
            out->luxels[first_start + b->found[i]] = luxel;
        } else { // in place: found_count <= i
            const uint32_t target = start->target;
            b->found[found_count] = luxel;
            b->found_target[found_count++] = target;
        }
    }
    return found_count;
}

static void first_hits(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count, uint32_t first_start,
                       const lx_gather_output *out)
{
    const size_t made = make_rays(b, starts, count);
    lx_trace_closest(settings->tracer, b->rays, b->hits, made);
    b->ray_count += made;
    for (size_t i = 0; out->distances && i < made; ++i)
        if (b->hits[i].surface != LX_MISS) out->distances[first_start + b->found[i]] = b->hits[i].t;
    size_t found_count = 0;
    for (size_t i = 0; i < made; i += block_size)
        found_count = look_up(b, settings, starts, i, i + block_size < made ? i + block_size : made, made, found_count, first_start, out);
    if (settings->rows && !out->luxels) add_rows(b, settings, out, found_count);
    add_slow_rows(b, settings, out);
    leave_all(b, settings, out);
}

// ---- the second loop -----------------------------------------------------------------------------------------------------------------

// Decides at a surface that lets light through: true if the ray goes straight on. The flight's throughput pays for the choice.
static bool passes_on(flight *f, const lx_shading *m)
{
    const float straight = lx_rgb_max(m->transmittance);
    if (straight == 0) return false;
    const float probability = straight / (straight + m->opacity);
    const uint32_t key = dimension_key(f->stream, f->vertex, dimension_pass + 8 * (f->passes + 1));
    const bool pass = lx_sobol_one(f->sample, key) < probability;
    f->throughput = pass ? lx_rgb_mul(f->throughput, lx_rgb_scale(m->transmittance, 1 / probability))
                         : lx_rgb_scale(f->throughput, m->opacity / (1 - probability));
    return pass;
}

// What is known of a hit of the second loop.
typedef struct answer {
    uint32_t luxel; // that lies there, a silent one perhaps; LX_NO_LUXEL: none
    bool is_near;   // so near that it tells of direct light at most: the path goes on
} answer;

// Where a hit of the second loop may be looked up, asked for: chart LX_NO_CHART if nowhere.
static lx_taps slow_taps(const lx_gather_settings *settings, const flight *f, const lx_hit *hit)
{
    static const lx_taps none = {.chart = LX_NO_CHART};
    const lx_lookup_surface *surface = &settings->lookup->surfaces[hit->surface];
    if (hit->back || !surface->triangles || surface->triangles[hit->triangle].chart == LX_NO_CHART) return none;
    const lx_taps taps = lx_lookup_taps(settings->lookup, hit, tap_bits(f->stream, f->vertex, f->sample));
    lx_lookup_fetch(settings->lookup, taps);
    return taps;
}

static answer slow_lookup(const lx_gather_settings *settings, const flight *f, const lx_hit *hit, lx_taps taps)
{
    if (taps.chart == LX_NO_CHART) return (answer){LX_NO_LUXEL, false};
    const bool is_near = hit->t < settings->near_texels * settings->lookup->surfaces[hit->surface].texel_m && f->vertex < near_until;
    if (is_near && !settings->rows_direct) return (answer){LX_NO_LUXEL, true};
    return (answer){lx_lookup_luxel(settings->lookup, taps), is_near};
}

// Takes note of a look-up; add_slow_rows adds what was noted, fetching ahead.
static lx_result find_slow_row(lx_gather_batch *b, const lx_gather_settings *settings, const flight *f, uint32_t luxel, const lx_gather_output *out,
                               lx_error *error)
{
    if (out->luxels) {
        lx_gather_extras *extras = out->extras;
        if (!lx_array_reserve(&extras->items, &extras->capacity, extras->count + 1, sizeof *extras->items))
            return lx_fail_memory(error, "irradiance cache");
        extras->items[extras->count++] = (lx_gather_extra){f->target, luxel, f->throughput};
        return LX_OK;
    }
    const uint16_t *rows = f->vertex == 0 ? settings->rows : settings->rows_later;
    if (rows) note_row(b, rows, settings, f, luxel);
    return LX_OK;
}

// Asks for the places of a block of hits.
static void ask_block(const lx_gather_batch *b, const lx_gather_settings *settings, size_t first, size_t count, lx_taps taps[block_size])
{
    for (size_t i = first; i < first + block_size && i < count; ++i)
        if (b->slow_hits[i].surface != LX_MISS) taps[i - first] = slow_taps(settings, &b->flights[i], &b->slow_hits[i]);
}

// What needs no shading: rays that left the scene, hits that are black or looked up. Others stay, in order; *count is how many.
static lx_result finish_simple(lx_gather_batch *b, const lx_gather_settings *settings, size_t *count, const lx_gather_output *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_taps taps[block_size];
    size_t kept = 0;
    for (size_t i = 0; i < *count && result == LX_OK; ++i) {
        const flight *f = &b->flights[i];
        const lx_hit *hit = &b->slow_hits[i];
        if (i % block_size == 0) ask_block(b, settings, i, *count, taps);
        if (hit->surface == LX_MISS) {
            if (brings(settings, f, settings->tracer->source_count - 1)) // the sky, if there is one
                add_sky(settings, out, f, b->slow_rays[i].direction);
            continue;
        }
        const lx_lookup_surface *surface = &settings->lookup->surfaces[hit->surface];
        if (surface->plain) {
            if ((hit->back && !surface->double_sided) || f->vertex >= settings->bounces) continue; // black
            const answer known = slow_lookup(settings, f, hit, taps[i % block_size]);
            if (known.luxel < LX_SILENT && !known.is_near) {
                result = find_slow_row(b, settings, f, known.luxel, out, error);
                continue;
            }
            if (leave_unshaded(b, settings, f, hit, known.luxel)) continue;
        }
        b->flights[kept] = *f;
        b->slow_hits[kept] = *hit;
        b->slow_rays[kept++] = b->slow_rays[i];
    }
    *count = kept;
    return result;
}

// One step of all slow flights: from their hits to the hits of what follows.
static lx_result step(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_output *out, lx_error *error)
{
    size_t count = b->slow_count, kept = 0;
    lx_result result = finish_simple(b, settings, &count, out, error);
    if (result != LX_OK) return result;
    lx_shade_materials(settings->tracer, b->slow_hits, b->shading, count);
    for (size_t i = 0; i < count; ++i) {
        flight f = b->flights[i];
        lx_ray ray = b->slow_rays[i];
        const lx_hit *hit = &b->slow_hits[i];
        const lx_shading *m = &b->shading[i];
        const lx_lookup_surface *surface = &settings->lookup->surfaces[hit->surface];
        if (!surface->plain) {
            const bool again = hit->surface == f.last_surface && hit->triangle == f.last_triangle;
            if (!again) add_emission(settings, out, &f, &ray, hit, m->emission);
            if (again || passes_on(&f, m)) {
                if (++f.passes > most_passes) continue;
                f.last_surface = hit->surface;
                f.last_triangle = hit->triangle;
                lx_ray_step_past(&ray, hit);
                b->flights[kept] = f;
                b->slow_rays[kept++] = ray;
                continue;
            }
            if (!m->lit || f.vertex >= settings->bounces) continue;
            const answer known = slow_lookup(settings, &f, hit, slow_taps(settings, &f, hit));
            if (known.luxel < LX_SILENT && !known.is_near) {
                result = find_slow_row(b, settings, &f, known.luxel, out, error);
                if (result != LX_OK) return result;
                continue;
            }
        }
        leave(b, f, hit, m->albedo, LX_NO_LUXEL);
    }
    add_slow_rows(b, settings, out);
    leave_all(b, settings, out);
    memcpy(b->slow_rays + kept, b->onward_rays, b->onward_count * sizeof *b->slow_rays);
    memcpy(b->flights + kept, b->onward, b->onward_count * sizeof *b->flights);
    kept += b->onward_count;
    b->onward_count = 0;
    lx_trace_closest(settings->tracer, b->slow_rays, b->slow_hits, kept);
    b->ray_count += kept;
    b->slow_count = kept;
    return LX_OK;
}

lx_result lx_gather_trace(lx_gather_batch *b, const lx_gather_settings *settings, const lx_gather_start *starts, size_t count,
                          const lx_gather_output *out, lx_error *error)
{
    lx_result result = LX_OK;
    b->slow_count = b->leaving_count = b->onward_count = b->slow_row_count = 0;
    if (out->luxels)
        for (size_t i = 0; i < count; ++i) out->luxels[i] = LX_NO_LUXEL;
    for (size_t i = 0; out->distances && i < count; ++i) out->distances[i] = INFINITY;
    for (size_t first = 0; first < count && result == LX_OK; first += batch_size) {
        const size_t n = count - first < batch_size ? count - first : (size_t)batch_size;
        first_hits(b, settings, starts + first, n, (uint32_t)first, out);
        while (b->slow_count + b->onward_count >= batch_size && result == LX_OK) result = step(b, settings, out, error); // each step leaves at most as many
    }
    while (b->slow_count + b->onward_count > 0 && result == LX_OK) result = step(b, settings, out, error);
    return result;
}
