// The path integrator, breadth first: all paths of a batch take each step together, so that rays come in batches too.
//
// At each vertex every source gets its light sample (all layers share the path's geometry), then one cosine-weighted ray goes on.
// A path's estimate of irradiance, with throughput t (1 at the start, multiplied by the albedo of each surface met):
//     at a vertex, from source s:       t · E_s            (next event; E_s carries its multiple importance weight)
//     at emission L met by the ray:     t · pi · L · w     (E = ∫ L cos dω, sampled with cos / pi)
// because outgoing radiance is albedo · E / pi and the ray's estimate multiplies it by pi again.
//
// A monitor is one source, sampled as a whole; which cell a sample or a hit lies in decides where its light goes. Where the path starts it gets
// several samples, well spread over the screen, or its cells would be far noisier than other layers: each gets but its share of them.
#include "trace/path.h"

#include "base/memory.h"
#include "math/sobol.h"
#include "trace/sampling.h"
#include "trace/tracer_data.h"

enum {
    roulette_from_bounce = 3,
    most_light_samples = 16, cells_per_light_sample = 4,
    most_passes = 256, // surfaces that one ray may pass through; roulette by alpha ends it long before
};

// Random dimensions of a vertex. Light samples take theirs from the source's key instead.
enum { dimension_bounce = 1, dimension_roulette = 2, dimension_pass = 3 };

typedef struct path {
    lx_receiver receiver;
    lx_rgb throughput, weight;
    uint32_t stream, sample, target;
} path;

// A ray on its way to the next vertex.
typedef struct flight {
    lx_rgb throughput; // of the path times what the ray passed through
    float cosine;      // at the receiver
    uint32_t path, passes;
    uint32_t last_surface, last_triangle;
} flight;

struct lx_path_batch {
    path paths[lx_path_batch_size], next[lx_path_batch_size];
    flight flights[lx_path_batch_size];
    lx_ray rays[lx_path_batch_size];
    lx_hit hits[lx_path_batch_size];
    lx_shading shading[lx_path_batch_size];
    lx_rgb light[lx_path_batch_size], transmittance[lx_path_batch_size];
    uint32_t owner[lx_path_batch_size], cell[lx_path_batch_size];
    uint64_t ray_count;
};

lx_path_batch *lx_path_batch_create(void)
{
    return lx_calloc_array(1, sizeof(lx_path_batch));
}

void lx_path_batch_destroy(lx_path_batch *batch)
{
    lx_free(batch);
}

uint64_t lx_path_batch_rays(const lx_path_batch *batch)
{
    return batch->ray_count;
}

uint32_t lx_stream_key(uint32_t seed, uint32_t a, uint32_t b)
{
    return lx_hash_combine(lx_hash_combine(lx_hash32(seed), a), b);
}

static uint32_t dimension_key(const path *p, uint32_t vertex, uint32_t dimension)
{
    return lx_hash_combine(p->stream, vertex * 4096 + dimension);
}

static void add(double *sums, const lx_path_settings *settings, const path *p, const lx_source_use *use, uint32_t cell, lx_rgb value)
{
    const size_t layer = (size_t)use->layer + (use->cells ? 0 : cell);
    if (use->cells) value = lx_rgb_mul(value, use->cells[cell]);
    double *sum = sums + 3 * ((size_t)p->target * settings->layer_count + layer);
    sum[0] += (double)(value.r * p->weight.r * use->weight.r);
    sum[1] += (double)(value.g * p->weight.g * use->weight.g);
    sum[2] += (double)(value.b * p->weight.b * use->weight.b);
}

// Does light that reaches vertex `vertex` straight from a source count?
static bool counts(const lx_path_settings *settings, const lx_source_use *use, uint32_t vertex)
{
    if (use->layer < 0) return false;
    return vertex == 0 ? settings->direct && use->direct : settings->indirect;
}

// How many light samples a source gets at a vertex. A matter of the source alone: what its cells are used for changes nothing.
static uint32_t light_sample_count(const lx_tracer *tracer, uint32_t source, uint32_t vertex)
{
    const uint32_t wanted = (lx_tracer_cell_count(tracer, source) + cells_per_light_sample - 1) / cells_per_light_sample;
    return vertex > 0 ? 1 : wanted < most_light_samples ? wanted : most_light_samples;
}

// After the first bounce roulette decides: in a room of many lamps most of them are far away from any one vertex, and what a sample could bring is far
// below the noise of the path itself.
// One light sample (number `turn` of `count`) for one path. First by what the source could bring at most, before anything is sampled; then by what the sample does bring.
static bool sample_light(const lx_tracer *tracer, uint32_t source, const path *p, uint32_t vertex, uint32_t turn, uint32_t count,
                         lx_ray *ray, lx_rgb *light, uint32_t *cell)
{
    const uint32_t key = lx_hash_combine(tracer->source_keys[source], vertex);
    const float bound = lx_source_bound(tracer, source, &p->receiver), scale = tracer->source_scales[source];
    if (bound == 0) return false;
    const float brightness = lx_rgb_max(p->throughput);
    const float chance = vertex > 0 ? lx_light_roulette(p->stream, p->sample, key ^ 0x68bc21ebu, brightness * bound, scale) : 1;
    if (chance == 0) return false;
    const lx_vec2 u = lx_sobol_pair(p->sample * count + turn, lx_hash_combine(p->stream, key));
    if (!lx_sample_source(tracer, source, &p->receiver, u, count, ray, light, cell)) return false;
    *light = lx_rgb_scale(*light, chance / (float)count);
    if (vertex == 0) return true;
    const float again = lx_light_roulette(p->stream, p->sample, key ^ 0x02e5be93u, brightness * lx_rgb_max(*light), scale);
    *light = lx_rgb_scale(*light, again);
    return again > 0;
}

static void add_light_samples(lx_path_batch *b, const lx_path_settings *settings, size_t path_count, uint32_t vertex, double *sums)
{
    const lx_tracer *tracer = settings->tracer;
    for (uint32_t s = 0; s < tracer->source_count; ++s) {
        const lx_source_use *use = &settings->uses[s];
        if (!counts(settings, use, vertex)) continue;
        const uint32_t turns = light_sample_count(tracer, s, vertex);
        for (uint32_t turn = 0; turn < turns; ++turn) {
            size_t count = 0;
            for (size_t i = 0; i < path_count; ++i) {
                if (!sample_light(tracer, s, &b->paths[i], vertex, turn, turns, &b->rays[count], &b->light[count], &b->cell[count])) continue;
                b->owner[count++] = (uint32_t)i;
            }
            lx_trace_transmittance(tracer, b->rays, b->transmittance, count);
            b->ray_count += count;
            for (size_t k = 0; k < count; ++k) {
                const path *p = &b->paths[b->owner[k]];
                const lx_rgb arrives = lx_rgb_mul(b->light[k], b->transmittance[k]);
                if (!lx_rgb_is_black(arrives)) add(sums, settings, p, use, b->cell[k], lx_rgb_mul(p->throughput, arrives));
            }
        }
    }
}

// Cosine-weighted rays from all paths; directions below the geometric surface end theirs.
static size_t start_flights(lx_path_batch *b, size_t path_count, uint32_t vertex)
{
    size_t count = 0;
    for (size_t i = 0; i < path_count; ++i) {
        const path *p = &b->paths[i];
        const lx_vec2 u = lx_sobol_pair(p->sample, dimension_key(p, vertex, dimension_bounce));
        const lx_vec3 local = lx_sample_cosine_hemisphere(u);
        const lx_vec3 direction = lx_to_world(p->receiver.normal, local);
        if (!(lx_dot(direction, p->receiver.geometric_normal) > 0)) continue;
        b->rays[count] = (lx_ray){.origin = lx_offset_origin(p->receiver.position, p->receiver.geometric_normal),
                                  .direction = direction, .t_max = INFINITY};
        b->flights[count++] = (flight){.throughput = p->throughput, .cosine = local.z, .path = (uint32_t)i,
                                       .last_surface = LX_MISS};
    }
    return count;
}

static void add_sky(const lx_path_settings *settings, const path *p, const flight *f, lx_vec3 direction, uint32_t vertex,
                    double *sums)
{
    const lx_tracer *tracer = settings->tracer;
    if (!tracer->sky.present) return;
    const lx_source_use *use = &settings->uses[tracer->source_count - 1]; // the sky comes last
    if (!counts(settings, use, vertex)) return;
    const float weight = lx_sky_weight(tracer, direction, f->cosine);
    const lx_rgb radiance = lx_sky_radiance(&tracer->sky, direction);
    add(sums, settings, p, use, 0, lx_rgb_scale(lx_rgb_mul(f->throughput, radiance), LX_PI * weight));
}

static void add_emission(const lx_path_settings *settings, const path *p, const flight *f, const lx_ray *ray, const lx_hit *hit,
                         const lx_shading *shading, uint32_t vertex, double *sums)
{
    const int32_t source = settings->tracer->scene->surfaces[hit->surface].source;
    if (source < 0 || lx_rgb_is_black(shading->emission)) return;
    const lx_source_use *use = &settings->uses[source];
    if (!counts(settings, use, vertex)) return;
    const lx_tracer *tracer = settings->tracer;
    const uint32_t samples = light_sample_count(tracer, (uint32_t)source, vertex);
    const float weight = lx_hit_weight(tracer, ray, hit, shading->geometric_normal, f->cosine, samples);
    const uint32_t cell = lx_tracer_cell_at(tracer, hit->surface, hit->triangle, hit->u, hit->v);
    add(sums, settings, p, use, cell, lx_rgb_scale(lx_rgb_mul(f->throughput, shading->emission), LX_PI * weight));
}

// Decides at a surface that lets light through: true if the ray goes straight on. The flight's throughput pays for the choice.
static bool passes_on(const path *p, flight *f, const lx_shading *s, uint32_t vertex)
{
    const float straight = lx_rgb_max(s->transmittance);
    if (straight == 0) return false;
    const float probability = straight / (straight + s->opacity);
    const uint32_t dimension = dimension_pass + 8 * (f->passes + 1);
    const bool pass = lx_sobol_one(p->sample, dimension_key(p, vertex, dimension)) < probability;
    f->throughput = pass ? lx_rgb_mul(f->throughput, lx_rgb_scale(s->transmittance, 1 / probability))
                         : lx_rgb_scale(f->throughput, s->opacity / (1 - probability));
    return pass;
}

// The path's next vertex at a hit that scatters. False: the path ends here.
static bool make_vertex(const path *p, const flight *f, const lx_shading *s, uint32_t vertex, path *out)
{
    lx_rgb throughput = lx_rgb_mul(f->throughput, s->albedo);
    float survival = 1;
    if (vertex + 1 >= roulette_from_bounce) {
        survival = lx_min(1, lx_rgb_max(throughput));
        if (!(lx_sobol_one(p->sample, dimension_key(p, vertex, dimension_roulette)) < survival)) return false;
    }
    if (!(lx_rgb_max(throughput) > 0)) return false;
    throughput = lx_rgb_scale(throughput, 1 / survival);
    const float side = s->front ? 1.0f : -1.0f;
    *out = (path){.receiver = {s->position, lx_scale(s->normal, side), lx_scale(s->geometric_normal, side)},
                  .throughput = throughput, .weight = p->weight, .stream = p->stream, .sample = p->sample, .target = p->target};
    return true;
}

// Follows all flights to where they scatter or end. Returns the number of paths that go on, in b->next.
static size_t land_flights(lx_path_batch *b, const lx_path_settings *settings, size_t count, uint32_t vertex, double *sums,
                           uint32_t *back_hits)
{
    size_t next_count = 0;
    while (count > 0) {
        lx_trace_closest(settings->tracer, b->rays, b->hits, count);
        lx_shade_hits(settings->tracer, b->hits, b->shading, count);
        b->ray_count += count;
        size_t in_flight = 0;
        for (size_t i = 0; i < count; ++i) {
            flight f = b->flights[i];
            lx_ray ray = b->rays[i];
            const lx_hit *hit = &b->hits[i];
            const lx_shading *s = &b->shading[i];
            const path *p = &b->paths[f.path];
            if (hit->surface == LX_MISS) {
                add_sky(settings, p, &f, ray.direction, vertex, sums);
                continue;
            }
            const bool again = hit->surface == f.last_surface && hit->triangle == f.last_triangle;
            if (!again) add_emission(settings, p, &f, &ray, hit, s, vertex, sums);
            if (again || passes_on(p, &f, s, vertex)) {
                if (++f.passes > most_passes) continue;
                f.last_surface = hit->surface;
                f.last_triangle = hit->triangle;
                lx_ray_step_past(&ray, hit);
                b->flights[in_flight] = f;
                b->rays[in_flight++] = ray;
                continue;
            }
            if (!s->lit) {
                if (vertex == 0 && back_hits) ++back_hits[p->target];
                continue;
            }
            if (vertex >= settings->bounces || !settings->indirect) continue;
            if (make_vertex(p, &f, s, vertex, &b->next[next_count])) ++next_count;
        }
        count = in_flight;
    }
    return next_count;
}

void lx_path_trace(lx_path_batch *b, const lx_path_settings *settings, const lx_path_start *starts, size_t count, double *sums,
                   uint32_t *back_hits)
{
    for (size_t i = 0; i < count; ++i)
        b->paths[i] = (path){.receiver = starts[i].receiver, .throughput = {1, 1, 1}, .weight = starts[i].weight,
                             .stream = starts[i].stream, .sample = starts[i].sample, .target = starts[i].target};
    for (uint32_t vertex = 0; count > 0; ++vertex) {
        add_light_samples(b, settings, count, vertex, sums);
        const size_t flights = start_flights(b, count, vertex);
        count = land_flights(b, settings, flights, vertex, sums, back_hits);
        for (size_t i = 0; i < count; ++i) b->paths[i] = b->next[i];
    }
}
