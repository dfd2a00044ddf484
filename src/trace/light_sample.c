// Next-event estimation, one function per kind of source.
//
// Lamps (point, spot, directional, rectangle, disk) are invisible to rays, so their samples carry the whole weight. Emissive surfaces
// and sky pictures can also be hit; samples and hits share the weight by the power heuristic of Veach 1997, section 9.2.4. What a source's place tells to be
// small and far gets samples alone: its samples may then be chosen by tables, whose densities need not be found again at hits.
#include "trace/light_sample.h"

#include "math/hash.h"
#include "trace/lamp_sample.h"
#include "trace/sampling.h"
#include "trace/tracer_data.h"

static lx_vec3 ray_origin(const lx_receiver *r)
{
    return lx_offset_origin(r->position, r->geometric_normal);
}

// From the receiver to a point in space. It ends a little short: what carries the lamp (the emitter itself, or the ceiling that a lamp
// lies flush with) must not shadow it, and the error of a hit's distance grows with the distance.
static lx_ray ray_to_point(const lx_receiver *r, lx_vec3 target)
{
    const lx_vec3 origin = ray_origin(r);
    return (lx_ray){.origin = origin, .t_min = 0, .direction = lx_sub(target, origin), .t_max = 1 - 0x1p-18f};
}

static lx_ray ray_to_infinity(const lx_receiver *r, lx_vec3 direction)
{
    return (lx_ray){.origin = ray_origin(r), .t_min = 0, .direction = direction, .t_max = INFINITY};
}

// Solid angles (of even brightness, facing the place) below which cosine-weighted rays have no say: they find such a source so seldom that their share of
// the weight would be below a hundredth.
static const float small_solid_angle = 0.05f;

bool lx_source_is_small(const lx_tracer *tracer, uint32_t source, float nearest)
{
    const lx_source_sphere *s = &tracer->source_spheres[source];
    return nearest > 0 && s->power < small_solid_angle * nearest * nearest;
}

bool lx_has_samples_alone(const lx_tracer *tracer, uint32_t source, lx_vec3 origin)
{
    if (!lx_emitters_has_tree(&tracer->emitters, source)) return false;
    const lx_source_sphere *s = &tracer->source_spheres[source];
    if (lx_source_is_small(tracer, source, lx_distance(s->centre, origin) - s->radius)) return true;
    return lx_light_tree_sum(&tracer->emitters.tree, &tracer->emitters.roots[source], origin) * s->power < small_solid_angle;
}

static bool sample_emissive(const lx_tracer *tracer, uint32_t source, bool by_power, const lx_receiver *r, lx_vec2 u, uint32_t count, lx_ray *ray,
                            lx_rgb *irradiance, uint32_t *cell)
{
    // Seen from where rays start, so that hits are weighed by the same densities.
    const lx_vec3 origin = ray_origin(r);
    const bool alone = lx_has_samples_alone(tracer, source, origin);
    lx_emitter_sample s;
    if (!lx_emitters_sample(&tracer->emitters, source, by_power && alone, origin, u, &s)) return false;
    const lx_emitter_triangle *t = &tracer->emitters.triangles[s.index];
    const lx_emitter_place place = tracer->emitters.places[s.index];
    const lx_vec3 point = lx_mad(lx_mad(t->origin, t->edge1, s.u), t->edge2, s.v);
    const lx_vec3 to_point = lx_sub(point, origin);
    lx_vec3 normal = t->normal;
    if (t->double_sided && lx_dot(normal, to_point) > 0) normal = lx_neg(normal);
    const float facing = -lx_dot(normal, to_point);
    if (!(facing > 0)) return false;
    const float distance2 = lx_dot(to_point, to_point), distance = sqrtf(distance2);
    const lx_vec3 direction = lx_scale(to_point, 1 / distance);
    const float emitter_cosine = facing / distance, cosine = lx_receiver_cosine(r, direction);
    if (cosine == 0 || !(emitter_cosine > 0)) return false;
    lx_rgb emission = {1, 1, 1};
    if (!t->plain) emission = lx_surface_emission(tracer, place.surface, place.triangle, s.u, s.v);
    if (lx_rgb_is_black(emission)) return false;
    const float pdf = s.pdf_area * distance2 / emitter_cosine; // solid angle
    const float weight = alone || count == 0 ? 1 : lx_power_heuristic((float)count * pdf, cosine / LX_PI);
    *irradiance = lx_rgb_scale(emission, weight * cosine / pdf);
    *ray = ray_to_point(r, lx_offset_origin(point, normal));
    *cell = lx_tracer_cell_at(tracer, place.surface, place.triangle, s.u, s.v);
    return true;
}

// The sphere around a source against the receiver's horizons and the source's reach.
float lx_source_bound(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver)
{
    const lx_source_sphere *s = &tracer->source_spheres[source];
    if (!(s->power < INFINITY)) return INFINITY;
    const lx_vec3 to_centre = lx_sub(s->centre, receiver->position);
    const float along = lx_dot(to_centre, receiver->normal), upright = lx_dot(to_centre, receiver->geometric_normal);
    if (along <= -s->radius || upright <= -s->radius) return 0;
    const float distance = lx_length(to_centre), nearest = distance - s->radius;
    if (!(nearest > 0)) return INFINITY;
    const lx_source *described = lx_tracer_source(tracer, source);
    if (described->light >= 0) {
        const lx_light *light = &tracer->scene->lights[described->light];
        if (light->range > 0 && distance >= light->range) return 0;
        const float facing = -lx_dot(light->direction, to_centre);
        if (light->kind == LX_LIGHT_SPOT && facing < s->cos_outer * distance) return 0;
        if ((light->kind == LX_LIGHT_RECT || light->kind == LX_LIGHT_DISK) && !(facing > 0)) return 0;
    }
    const float cosine = lx_min(1, (along + s->radius) / nearest); // of no place on the sphere is it larger
    return s->power * cosine / (nearest * nearest);
}

uint32_t lx_source_effort(const lx_tracer *tracer, uint32_t source, lx_vec3 place)
{
    static const float least_brightness = 256; // unshadowed light over the mean of all surfaces
    const lx_source_sphere *s = &tracer->source_spheres[source];
    const float mean = lx_source_mean(tracer, source);
    if (!(s->power < INFINITY) || !(mean > 0)) return 1;
    const lx_vec3 d = lx_sub(s->centre, place);
    const float squared = lx_dot(d, d) + s->radius * s->radius; // a bulb among many in one source is no small lamp
    uint32_t effort = 1;
    for (float bright = least_brightness * mean; effort < lx_source_most_effort && s->power > bright * squared; bright *= 4) effort *= 4;
    return effort;
}

static bool sample_sky(const lx_tracer *tracer, const lx_receiver *r, lx_vec2 u, uint32_t count, lx_ray *ray, lx_rgb *irradiance)
{
    if (!lx_sky_has_samples(&tracer->sky)) return false;
    float pdf;
    const lx_vec3 direction = lx_sky_sample(&tracer->sky, u, &pdf);
    const float cosine = lx_receiver_cosine(r, direction);
    if (!(pdf > 0) || cosine == 0) return false;
    const float weight = count == 0 ? 1 : lx_power_heuristic(pdf, cosine / LX_PI);
    *irradiance = lx_rgb_scale(lx_sky_radiance(&tracer->sky, direction), weight * cosine / pdf);
    if (lx_rgb_is_black(*irradiance)) return false;
    *ray = ray_to_infinity(r, direction);
    return true;
}

static bool sample_lamp(const lx_light *light, const lx_receiver *r, lx_vec2 u, lx_ray *ray, float *irradiance)
{
    const lx_lamp lamp = lx_lamp_of(light);
    lx_vec3 target;
    *irradiance = 0;
    switch (light->kind) {
    case LX_LIGHT_POINT:
    case LX_LIGHT_SPOT:
        *irradiance = light->radius > 0 ? lx_sample_sphere_lamp(&lamp, r, u, &target) : lx_sample_point_lamp(&lamp, r, &target);
        break;
    case LX_LIGHT_DIRECTIONAL: *irradiance = lx_sample_sun(&lamp, r, u, &target); break;
    case LX_LIGHT_RECT:
    case LX_LIGHT_DISK: {
        const lx_area_view view = lx_area_view_of(&lamp, r);
        *irradiance = lx_sample_area_lamp(&lamp, &view, r, u, &target);
        break;
    }
    }
    if (*irradiance == 0) return false;
    *ray = light->kind == LX_LIGHT_DIRECTIONAL ? ray_to_infinity(r, target) : ray_to_point(r, target);
    return true;
}

static bool sample_source(const lx_tracer *tracer, uint32_t source, bool by_power, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                          lx_rgb *out_irradiance, uint32_t *out_cell)
{
    *out_cell = 0;
    const lx_source *s = lx_tracer_source(tracer, source);
    if (s->kind == LX_SOURCE_SKY) return sample_sky(tracer, receiver, u, count, out_ray, out_irradiance);
    if (s->kind == LX_SOURCE_EMISSIVE) return sample_emissive(tracer, source, by_power, receiver, u, count, out_ray, out_irradiance, out_cell);
    float irradiance;
    const bool arrives = sample_lamp(&tracer->scene->lights[s->light], receiver, u, out_ray, &irradiance);
    *out_irradiance = lx_rgb_grey(irradiance);
    return arrives;
}

bool lx_sample_source(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                      lx_rgb *out_irradiance, uint32_t *out_cell)
{
    return sample_source(tracer, source, false, receiver, u, count, out_ray, out_irradiance, out_cell);
}

bool lx_sample_source_by_power(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                               lx_rgb *out_irradiance, uint32_t *out_cell)
{
    return sample_source(tracer, source, true, receiver, u, count, out_ray, out_irradiance, out_cell);
}

float lx_light_roulette(uint32_t stream, uint32_t sample, uint32_t key, float brings, float scale)
{
    if (!(brings < scale)) return 1;
    const float probability = brings / scale;
    const uint32_t bits = lx_hash_combine(lx_hash_combine(stream, key), sample);
    return lx_unit_float(bits) < probability ? 1 / probability : 0;
}

float lx_hit_weight(const lx_tracer *tracer, const lx_ray *ray, const lx_hit *hit, lx_vec3 hit_normal, float cosine, uint32_t count)
{
    const uint32_t source = (uint32_t)tracer->scene->surfaces[hit->surface].source;
    const uint32_t index = tracer->surfaces[hit->surface].first_emitter_triangle + hit->triangle;
    const float pdf_area = lx_emitters_pdf_area(&tracer->emitters, source, index, ray->origin, hit->u, hit->v);
    if (!(pdf_area > 0)) return 1;
    if (lx_has_samples_alone(tracer, source, ray->origin)) return 0;
    const float emitter_cosine = fabsf(lx_dot(hit_normal, ray->direction)); // directions of such rays are unit
    const float pdf = emitter_cosine > 0 ? pdf_area * hit->t * hit->t / emitter_cosine : 0;
    return lx_power_heuristic(cosine / LX_PI, (float)count * pdf);
}

float lx_sky_weight(const lx_tracer *tracer, lx_vec3 direction, float cosine)
{
    if (!lx_sky_has_samples(&tracer->sky)) return 1;
    return lx_power_heuristic(cosine / LX_PI, lx_sky_pdf(&tracer->sky, direction));
}
