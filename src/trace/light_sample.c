// Next-event estimation, one function per kind of source.
//
// Lamps (point, spot, directional, rectangle, disk) are invisible to rays, so their samples carry the whole weight. Emissive surfaces
// and sky pictures can also be hit; samples and hits share the weight by the power heuristic of Veach 1997, section 9.2.4. What a source's place tells to be
// small and far gets samples alone: its samples may then be chosen by tables, whose densities need not be found again at hits.
// Rectangles are sampled by solid angle ([Urena2013]); disks through their bounding square, points outside it count 0, which keeps the
// density bounded right up to the disk. From far away both are sampled by area. Spheres by their visible cap ([PBR4] 6.2.4).
#include "trace/light_sample.h"

#include "math/hash.h"
#include "trace/sampling.h"
#include "trace/tracer_data.h"

float lx_range_factor(float distance, float range)
{
    if (!(range > 0)) return 1;
    const float ratio = distance / range, ratio2 = ratio * ratio;
    return lx_clamp(1 - ratio2 * ratio2, 0, 1);
}

float lx_spot_factor(const lx_light *light, float cosine)
{
    const float cos_inner = cosf(light->inner_angle), cos_outer = cosf(light->outer_angle);
    const float scale = 1 / lx_max(1e-3f, cos_inner - cos_outer); // the extension's own least width
    const float attenuation = lx_clamp((cosine - cos_outer) * scale, 0, 1);
    return attenuation * attenuation;
}

// Half diagonals from which a rectangle is sampled by area: cosine and distance differ by less than a sixth over it.
static const float areas_do_from = 12;

static float power_heuristic(float pdf_a, float pdf_b)
{
    if (!(pdf_a < INFINITY)) return 1;
    const float a = pdf_a * pdf_a, b = pdf_b * pdf_b;
    return a + b > 0 && a < INFINITY ? a / (a + b) : 1;
}

// Cosine at the receiver; 0 from below either normal.
static float receiver_cosine(const lx_receiver *r, lx_vec3 direction)
{
    const float cosine = lx_dot(r->normal, direction);
    return cosine > 0 && lx_dot(r->geometric_normal, direction) > 0 ? cosine : 0;
}

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

// Factors that depend on the receiver's place as seen from the lamp's centre.
static float lamp_factor(const lx_light *light, lx_vec3 to_lamp, float distance)
{
    float factor = lx_range_factor(distance, light->range);
    if (light->kind == LX_LIGHT_SPOT) factor *= lx_spot_factor(light, -lx_dot(light->direction, to_lamp) / distance);
    return factor;
}

// Point and spot. E = I cos(theta) / d² for a point; a sphere of radiance I / (pi r²) else.
static bool sample_point(const lx_light *light, const lx_receiver *r, lx_vec2 u, lx_ray *ray, float *irradiance)
{
    const lx_vec3 to_centre = lx_sub(light->position, r->position);
    const float distance2 = lx_dot(to_centre, to_centre), distance = sqrtf(distance2);
    if (!(distance > light->radius)) return false;
    const float factor = lamp_factor(light, to_centre, distance);
    if (factor == 0) return false;
    const lx_vec3 axis = lx_scale(to_centre, 1 / distance);
    if (light->radius == 0) {
        *irradiance = factor * receiver_cosine(r, axis) / distance2;
        if (*irradiance == 0) return false;
        *ray = ray_to_point(r, light->position);
        return true;
    }
    const float sine2 = light->radius * light->radius / distance2; // of the cap's half angle
    const float one_minus_cos = sine2 / (1 + sqrtf(1 - sine2));
    const lx_vec3 local = lx_sample_cone(u, one_minus_cos);
    const lx_vec3 direction = lx_to_world(axis, local);
    const float cosine = receiver_cosine(r, direction);
    if (cosine == 0) return false;
    const float radiance = 1 / (LX_PI * light->radius * light->radius);
    *irradiance = factor * radiance * cosine * 2 * LX_PI * one_minus_cos;
    // The near side of the sphere along the direction.
    const float across2 = distance2 * lx_max(0, 1 - local.z * local.z);
    const float near = distance * local.z - sqrtf(lx_max(0, light->radius * light->radius - across2));
    *ray = ray_to_point(r, lx_mad(r->position, direction, near));
    return true;
}

// E = illuminance · cos; with an angular diameter a disk of radiance E / (pi sin²(angle / 2)).
static bool sample_directional(const lx_light *light, const lx_receiver *r, lx_vec2 u, lx_ray *ray, float *irradiance)
{
    lx_vec3 direction = lx_neg(light->direction);
    if (light->radius == 0) {
        *irradiance = receiver_cosine(r, direction);
    } else {
        const float half = light->radius / 2, sine = sinf(half);
        const float one_minus_cos = 2 * sinf(half / 2) * sinf(half / 2);
        direction = lx_to_world(direction, lx_sample_cone(u, one_minus_cos));
        *irradiance = receiver_cosine(r, direction) * 2 * one_minus_cos / (sine * sine);
    }
    if (*irradiance == 0) return false;
    *ray = ray_to_infinity(r, direction);
    return true;
}

// One-sided rectangle or disk of unit radiance.
static bool sample_area(const lx_light *light, const lx_receiver *r, lx_vec2 u, lx_ray *ray, float *irradiance)
{
    const lx_vec3 to_centre = lx_sub(light->position, r->position);
    const float height = -lx_dot(to_centre, light->direction); // of the receiver above the lamp's plane
    if (!(height > 0)) return false;
    const float factor = lx_range_factor(lx_length(to_centre), light->range);
    if (factor == 0) return false;
    const float half_width = lx_length(light->axis_x), half_depth = lx_length(light->axis_y);
    if (!(half_width > 0) || !(half_depth > 0)) return false;
    const lx_vec3 x = lx_scale(light->axis_x, 1 / half_width), y = lx_scale(light->axis_y, 1 / half_depth);
    const lx_vec3 corner = {lx_dot(to_centre, x) - half_width, lx_dot(to_centre, y) - half_depth, height};
    lx_vec2 place; // on the lamp, from its centre, in half edges
    float density; // 1 / pdf_solid_angle, without the cosine at the lamp when sampled by area
    lx_spherical_rectangle rectangle = {.solid_angle = 0};
    const float near2 = areas_do_from * areas_do_from * (half_width * half_width + half_depth * half_depth);
    if (lx_dot(to_centre, to_centre) < near2) rectangle = lx_spherical_rectangle_of(corner, 2 * half_width, 2 * half_depth);
    if (rectangle.solid_angle > 1e-4f) {
        const lx_vec3 p = lx_sample_spherical_rectangle(&rectangle, u);
        place = (lx_vec2){(p.x - corner.x) / half_width - 1, (p.y - corner.y) / half_depth - 1};
        density = rectangle.solid_angle;
    } else { // far enough for areas to do as well, or too small for the angles' precision
        place = light->kind == LX_LIGHT_DISK ? lx_sample_disk(u) : (lx_vec2){2 * u.x - 1, 2 * u.y - 1};
        density = 0;
    }
    if (light->kind == LX_LIGHT_DISK && density > 0 && lx_dot2(place, place) > 1) return false;
    const lx_vec3 target =
        lx_add(light->position, lx_add(lx_scale(light->axis_x, place.x), lx_scale(light->axis_y, place.y)));
    const lx_vec3 to_target = lx_sub(target, r->position);
    const float distance = lx_length(to_target);
    const lx_vec3 direction = lx_scale(to_target, 1 / distance);
    const float unit_area = light->kind == LX_LIGHT_DISK ? LX_PI : 4; // of half edges 1
    if (density == 0) density = unit_area * half_width * half_depth * (height / distance) / (distance * distance);
    *irradiance = factor * receiver_cosine(r, direction) * density;
    if (*irradiance == 0) return false;
    *ray = ray_to_point(r, target);
    return true;
}

// Solid angles (of even brightness, facing the place) below which cosine-weighted rays have no say: they find such a source so seldom that their share of
// the weight would be below a hundredth.
static const float small_solid_angle = 0.05f;

static bool is_small(const lx_source_sphere *s, float nearest)
{
    return nearest > 0 && s->power < small_solid_angle * nearest * nearest;
}

// Is the source so small, seen from where rays start, that samples alone bring its light? A matter of the source and the place.
static bool has_samples_alone(const lx_tracer *tracer, uint32_t source, lx_vec3 origin)
{
    if (!lx_emitters_has_tree(&tracer->emitters, source)) return false;
    const lx_source_sphere *s = &tracer->source_spheres[source];
    if (is_small(s, lx_distance(s->centre, origin) - s->radius)) return true;
    return lx_light_tree_sum(&tracer->emitters.tree, &tracer->emitters.roots[source], origin) * s->power < small_solid_angle;
}

static bool sample_emissive(const lx_tracer *tracer, uint32_t source, const lx_source_view *view, bool by_power, const lx_receiver *r, lx_vec2 u, uint32_t count,
                            lx_ray *ray, lx_rgb *irradiance, uint32_t *cell)
{
    // Seen from where rays start, so that hits are weighed by the same densities.
    const lx_vec3 origin = ray_origin(r);
    const bool alone = view ? view->alone[r - view->receivers] : has_samples_alone(tracer, source, origin);
    lx_emitter_sample s;
    const lx_light_table *table = view && alone && !view->table.rough ? &view->table : NULL;
    if (!lx_emitters_sample(&tracer->emitters, source, table, by_power && alone, origin, u, &s)) return false;
    const lx_emitter_triangle *t = s.triangle;
    const lx_vec3 point = lx_mad(lx_mad(t->origin, t->edge1, s.u), t->edge2, s.v);
    const lx_vec3 to_point = lx_sub(point, origin);
    lx_vec3 normal = t->normal;
    if (t->double_sided && lx_dot(normal, to_point) > 0) normal = lx_neg(normal);
    const float facing = -lx_dot(normal, to_point);
    if (!(facing > 0)) return false;
    const float distance2 = lx_dot(to_point, to_point), distance = sqrtf(distance2);
    const lx_vec3 direction = lx_scale(to_point, 1 / distance);
    const float emitter_cosine = facing / distance, cosine = receiver_cosine(r, direction);
    if (cosine == 0 || !(emitter_cosine > 0)) return false;
    lx_rgb emission = {1, 1, 1};
    if (!t->plain) emission = lx_surface_emission(tracer, t->surface, t->triangle, s.u, s.v);
    if (lx_rgb_is_black(emission)) return false;
    const float pdf = s.pdf_area * distance2 / emitter_cosine; // solid angle
    const float weight = alone || count == 0 ? 1 : power_heuristic((float)count * pdf, cosine / LX_PI);
    *irradiance = lx_rgb_scale(emission, weight * cosine / pdf);
    *ray = ray_to_point(r, lx_offset_origin(point, normal));
    *cell = lx_tracer_cell_at(tracer, t->surface, t->triangle, s.u, s.v);
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

static bool sample_sky(const lx_tracer *tracer, const lx_receiver *r, lx_vec2 u, uint32_t count, lx_ray *ray, lx_rgb *irradiance)
{
    if (!lx_sky_has_samples(&tracer->sky)) return false;
    float pdf;
    const lx_vec3 direction = lx_sky_sample(&tracer->sky, u, &pdf);
    const float cosine = receiver_cosine(r, direction);
    if (!(pdf > 0) || cosine == 0) return false;
    const float weight = count == 0 ? 1 : power_heuristic(pdf, cosine / LX_PI);
    *irradiance = lx_rgb_scale(lx_sky_radiance(&tracer->sky, direction), weight * cosine / pdf);
    if (lx_rgb_is_black(*irradiance)) return false;
    *ray = ray_to_infinity(r, direction);
    return true;
}

static bool sample_source(const lx_tracer *tracer, uint32_t source, const lx_source_view *view, bool by_power, const lx_receiver *receiver, lx_vec2 u,
                          uint32_t count, lx_ray *out_ray, lx_rgb *out_irradiance, uint32_t *out_cell)
{
    *out_cell = 0;
    const lx_source *s = lx_tracer_source(tracer, source);
    if (s->kind == LX_SOURCE_SKY) return sample_sky(tracer, receiver, u, count, out_ray, out_irradiance);
    if (s->kind == LX_SOURCE_EMISSIVE) return sample_emissive(tracer, source, view, by_power, receiver, u, count, out_ray, out_irradiance, out_cell);
    const lx_light *light = &tracer->scene->lights[s->light];
    float irradiance = 0;
    bool arrives = false;
    switch (light->kind) {
    case LX_LIGHT_POINT:
    case LX_LIGHT_SPOT: arrives = sample_point(light, receiver, u, out_ray, &irradiance); break;
    case LX_LIGHT_DIRECTIONAL: arrives = sample_directional(light, receiver, u, out_ray, &irradiance); break;
    case LX_LIGHT_RECT:
    case LX_LIGHT_DISK: arrives = sample_area(light, receiver, u, out_ray, &irradiance); break;
    }
    *out_irradiance = lx_rgb_grey(irradiance);
    return arrives;
}

bool lx_sample_source(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                      lx_rgb *out_irradiance, uint32_t *out_cell)
{
    return sample_source(tracer, source, NULL, false, receiver, u, count, out_ray, out_irradiance, out_cell);
}

bool lx_sample_source_by_power(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                               lx_rgb *out_irradiance, uint32_t *out_cell)
{
    return sample_source(tracer, source, NULL, true, receiver, u, count, out_ray, out_irradiance, out_cell);
}

static lx_light_view view_of(const lx_receiver *receivers, uint32_t count)
{
    lx_light_view v = {.normal = {0, 0, 0}};
    lx_bounds box = lx_bounds_empty();
    for (uint32_t i = 0; i < count; ++i) {
        lx_bounds_add(&box, receivers[i].position);
        v.normal = lx_add(v.normal, receivers[i].normal);
    }
    v.centre = lx_scale(lx_add(box.low, box.high), 0.5f);
    v.normal = lx_normalize_or(v.normal, receivers[0].normal);
    float radius2 = 0, spread2 = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const lx_vec3 d = lx_sub(receivers[i].position, v.centre), e = lx_sub(receivers[i].normal, v.normal);
        radius2 = lx_max(radius2, lx_dot(d, d));
        spread2 = lx_max(spread2, lx_dot(e, e));
    }
    v.radius = sqrtf(radius2) * 1.001f + 1e-5f * lx_max_abs(v.centre); // rays start a little off their receivers
    v.spread = sqrtf(spread2) + 1e-4f;
    return v;
}

bool lx_source_has_views(const lx_tracer *tracer, uint32_t source)
{
    return lx_tracer_source(tracer, source)->kind == LX_SOURCE_EMISSIVE && lx_emitters_has_tree(&tracer->emitters, source);
}

void lx_source_view_fill(lx_source_view *view, const lx_tracer *tracer, uint32_t source, const lx_receiver *receivers, uint32_t count)
{
    const lx_emitters *emitters = &tracer->emitters;
    view->tracer = tracer;
    view->source = source;
    view->receivers = receivers;
    view->dark = view->has_table = false;
    if (!lx_source_has_views(tracer, source)) return;
    const lx_light_view place = view_of(receivers, count);
    view->has_table = lx_light_table_fill(&view->table, &emitters->tree, &emitters->roots[source], &place);
    view->dark = !view->has_table;
    if (view->dark) return;
    const lx_source_sphere *s = &tracer->source_spheres[source];
    const bool all_far = is_small(s, lx_distance(s->centre, place.centre) - s->radius - place.radius);
    for (uint32_t i = 0; i < count; ++i) view->alone[i] = all_far || has_samples_alone(tracer, source, ray_origin(&receivers[i]));
}

bool lx_source_view_sample(const lx_source_view *view, uint32_t receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray, lx_rgb *out_irradiance,
                           uint32_t *out_cell)
{
    return !view->dark && sample_source(view->tracer, view->source, view->has_table ? view : NULL, false, &view->receivers[receiver], u, count, out_ray,
                                        out_irradiance, out_cell);
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
    if (has_samples_alone(tracer, source, ray->origin)) return 0;
    const float emitter_cosine = fabsf(lx_dot(hit_normal, ray->direction)); // directions of such rays are unit
    const float pdf = emitter_cosine > 0 ? pdf_area * hit->t * hit->t / emitter_cosine : 0;
    return power_heuristic(cosine / LX_PI, (float)count * pdf);
}

float lx_sky_weight(const lx_tracer *tracer, lx_vec3 direction, float cosine)
{
    if (!lx_sky_has_samples(&tracer->sky)) return 1;
    return power_heuristic(cosine / LX_PI, lx_sky_pdf(&tracer->sky, direction));
}
