#include "trace/source_view.h"

#include "base/memory.h"
#include "math/sobol.h"
#include "trace/light_sample.h"
#include "trace/tracer_data.h"

#include <string.h>

enum { size = lx_view_size, few_triangles = 16 };

LX_INLINED lx_vec3 vector_at(const lx_view_vectors *v, int k)
{
    return (lx_vec3){v->x[k], v->y[k], v->z[k]};
}

LX_INLINED void set_vector(lx_view_vectors *v, int k, lx_vec3 to)
{
    v->x[k] = to.x;
    v->y[k] = to.y;
    v->z[k] = to.z;
}

LX_INLINED lx_receiver receiver_at(const lx_source_view *v, int k)
{
    return (lx_receiver){vector_at(&v->position, k), vector_at(&v->normal, k), vector_at(&v->geometric_normal, k)};
}

// ---- what can be reached --------------------------------------------------------------------------------------------------------

LX_INLINED void find_origins(lx_source_view *v)
{
    for (int k = 0; k < size; ++k) set_vector(&v->origin, k, lx_offset_origin(vector_at(&v->position, k), vector_at(&v->geometric_normal, k)));
}

// lx_source_bound without its value.
LX_INLINED void find_reached(lx_source_view *v, const lx_source_sphere *s)
{
    const lx_light *light = v->lamp.light;
    // Limits that nothing reaches where they do not count.
    const bool is_spot = light && light->kind == LX_LIGHT_SPOT, is_area = light && (light->kind == LX_LIGHT_RECT || light->kind == LX_LIGHT_DISK);
    const float range = light && light->range > 0 ? light->range : INFINITY, cos_outer = is_spot ? s->cos_outer : -2, least = is_area ? 0 : -INFINITY;
    const lx_vec3 axis = light ? light->direction : (lx_vec3){0, 0, 0};
    const float centre_x = s->centre.x, centre_y = s->centre.y, centre_z = s->centre.z, radius = s->radius;
    for (int k = 0; k < size; ++k) {
        const lx_receiver r = receiver_at(v, k);
        const lx_vec3 to_centre = lx_sub((lx_vec3){centre_x, centre_y, centre_z}, r.position);
        const float distance = lx_length(to_centre), facing = -lx_dot(axis, to_centre);
        const float along = lx_dot(to_centre, r.normal), upright = lx_dot(to_centre, r.geometric_normal);
        const bool above = (along > -radius) & (upright > -radius);
        const bool turned = (distance >= range) | (facing < cos_outer * distance) | !(facing > least);
        v->reached[k] = (above & ((distance <= radius) | !turned)) ? 1 : 0;
    }
}

// Does any of a few triangles shine on the receiver, with any of its corners above the horizon? What rounding could hide is next to nothing, but kept.
LX_INLINED void find_lit(lx_source_view *v, const lx_emitter_triangle *triangles, uint32_t count)
{
    int32_t lit[size] = {0};
    for (uint32_t i = 0; i < count; ++i) {
        const lx_emitter_triangle *t = &triangles[i];
        const lx_vec3 corner[3] = {t->origin, lx_add(t->origin, t->edge1), lx_add(t->origin, t->edge2)}, facing = t->normal;
        const bool both = t->double_sided;
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(v, k);
            const lx_vec3 a = lx_sub(corner[0], r.position), b = lx_sub(corner[1], r.position), c = lx_sub(corner[2], r.position);
            const float slack = 1e-5f * (lx_max_abs(r.position) + lx_max_abs(a));
            const float along = lx_max(lx_dot(a, r.normal), lx_max(lx_dot(b, r.normal), lx_dot(c, r.normal)));
            const float upright = lx_max(lx_dot(a, r.geometric_normal), lx_max(lx_dot(b, r.geometric_normal), lx_dot(c, r.geometric_normal))), turned = lx_dot(facing, a);
            lit[k] |= ((both | (turned < slack)) & (along > -slack) & (upright > -slack)) ? 1 : 0;
        }
    }
    for (int k = 0; k < size; ++k) v->reached[k] &= lit[k];
}

static lx_light_view place_of(const lx_source_view *v)
{
    lx_light_view place = {.normal = {0, 0, 0}};
    lx_bounds box = lx_bounds_empty();
    for (int k = 0; k < size; ++k) {
        lx_bounds_add(&box, vector_at(&v->position, k));
        place.normal = lx_add(place.normal, vector_at(&v->normal, k));
    }
    place.centre = lx_scale(lx_add(box.low, box.high), 0.5f);
    place.normal = lx_normalize_or(place.normal, vector_at(&v->normal, 0));
    float radius2 = 0, spread2 = 0;
    for (int k = 0; k < size; ++k) {
        const lx_vec3 d = lx_sub(vector_at(&v->position, k), place.centre), e = lx_sub(vector_at(&v->normal, k), place.normal);
        radius2 = lx_max(radius2, lx_dot(d, d));
        spread2 = lx_max(spread2, lx_dot(e, e));
    }
    place.radius = sqrtf(radius2) * 1.001f + 1e-5f * lx_max_abs(place.centre); // rays start a little off their receivers
    place.spread = sqrtf(spread2) + 1e-4f;
    return place;
}

// False: certainly nothing of a mesh with a tree arrives.
static bool fill_table(lx_source_view *v)
{
    const lx_emitters *emitters = &v->tracer->emitters;
    const lx_light_view place = place_of(v);
    if (!lx_light_table_fill(&v->table, &emitters->tree, &emitters->roots[v->source], &place)) return false;
    const lx_source_sphere *s = &v->tracer->source_spheres[v->source];
    const bool all_far = lx_source_is_small(v->tracer, v->source, lx_distance(s->centre, place.centre) - s->radius - place.radius);
    bool any_alone = false;
    for (int k = 0; k < size; ++k) {
        v->alone[k] = all_far || (v->reached[k] && lx_has_samples_alone(v->tracer, v->source, vector_at(&v->origin, k)));
        any_alone |= v->alone[k];
    }
    v->has_table = any_alone && !v->table.rough;
    return true;
}

LX_INLINED void look(lx_source_view *v)
{
    const lx_source_sphere *s = &v->tracer->source_spheres[v->source];
    find_origins(v);
    if (s->power < INFINITY)
        find_reached(v, s);
    else
        for (int k = 0; k < size; ++k) v->reached[k] = 1;
    const lx_emitters *e = &v->tracer->emitters;
    if (lx_tracer_source(v->tracer, v->source)->kind == LX_SOURCE_EMISSIVE && !lx_emitters_has_tree(e, v->source)) {
        const uint32_t first = e->first_triangle[v->source], count = e->first_triangle[v->source + 1] - first;
        if (count <= few_triangles) find_lit(v, e->triangles + first, count);
    }
    v->reaches = false;
    for (int k = 0; k < size; ++k) v->reaches |= v->reached[k] != 0;
}

// ---- samples --------------------------------------------------------------------------------------------------------------------

// What the loops have ready for one another.
typedef struct lanes {
    float u[size], v[size]; // Sobol points
    float light[size];
    // Of emissive meshes.
    uint32_t triangle[size]; // or LX_NO_EMITTER
    float probability[size], pdf_area[size];
    float a[size], b[size]; // barycentrics
} lanes;

LX_INLINED void find_points(lanes *l, uint32_t key, uint32_t first)
{
    for (int k = 0; k < size; ++k) {
        const lx_vec2 u = lx_sobol_pair(first + (uint32_t)k, key);
        l->u[k] = u.x;
        l->v[k] = u.y;
    }
}

// Shadow rays end a little short: what carries the lamp (the emitter itself, or the ceiling that a lamp lies flush with) must not shadow it, and the error of a hit's distance
// grows with the distance.
static const float nearly_there = 1 - 0x1p-18f;

LX_INLINED void sample_lamp(const lx_source_view *v, lanes *l, lx_view_samples *out)
{
    const lx_lamp lamp = v->lamp;
    const lx_light_kind kind = lamp.light->kind;
    const bool is_sphere = lamp.light->radius > 0;
    lx_vec3 target;
    if (kind == LX_LIGHT_DIRECTIONAL) {
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(v, k);
            l->light[k] = lx_sample_sun(&lamp, &r, (lx_vec2){l->u[k], l->v[k]}, &target);
            set_vector(&out->direction, k, target);
        }
    } else if (kind == LX_LIGHT_RECT || kind == LX_LIGHT_DISK) {
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(v, k);
            l->light[k] = lx_sample_area_lamp(&lamp, &v->areas[k], &r, (lx_vec2){l->u[k], l->v[k]}, &target);
            set_vector(&out->direction, k, lx_sub(target, vector_at(&v->origin, k)));
        }
    } else if (is_sphere) {
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(v, k);
            l->light[k] = lx_sample_sphere_lamp(&lamp, &r, (lx_vec2){l->u[k], l->v[k]}, &target);
            set_vector(&out->direction, k, lx_sub(target, vector_at(&v->origin, k)));
        }
    } else {
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(v, k);
            l->light[k] = lx_sample_point_lamp(&lamp, &r, &target);
            set_vector(&out->direction, k, lx_sub(target, vector_at(&v->origin, k)));
        }
    }
    for (int k = 0; k < size; ++k) {
        out->light[k] = lx_rgb_grey(v->reached[k] ? l->light[k] : 0);
        out->cell[k] = 0;
    }
}

// Step by step for all receivers, so that what is waited for arrives together.
static void choose_triangles(const lx_source_view *v, lanes *l)
{
    const lx_emitters *emitters = &v->tracer->emitters;
    lx_light_choice choices[size];
    bool has_choice[size];
    for (int k = 0; k < size; ++k) {
        has_choice[k] = v->has_table && v->alone[k] && v->reached[k];
        if (has_choice[k]) choices[k] = lx_light_table_choose(&v->table, &emitters->tree, l->u[k]);
    }
    for (int k = 0; k < size; ++k) {
        const lx_vec3 origin = vector_at(&v->origin, k);
        l->triangle[k] = LX_NO_EMITTER;
        l->probability[k] = 1;
        if (has_choice[k] && !lx_light_tree_finish(&emitters->tree, &choices[k], origin, &l->u[k], &l->triangle[k], &l->probability[k]))
            l->triangle[k] = LX_NO_EMITTER;
        else if (!has_choice[k] && v->reached[k])
            l->triangle[k] = lx_emitters_choose(emitters, v->source, false, origin, &l->u[k], &l->probability[k]);
        if (l->triangle[k] != LX_NO_EMITTER) LX_PREFETCH(&emitters->triangles[l->triangle[k]]);
    }
}

// The chosen triangles, field by field.
typedef struct triangles {
    lx_view_vectors origin, edge1, edge2, normal;
    float area[size];
    float both[size];    // 1: shines from both sides
    float uneven[size];  // 1: a texture decides where
    float weighed[size]; // count of samples against a hit; 0: samples alone
} triangles;

static void fetch_triangles(const lx_source_view *v, const lanes *l, uint32_t count, triangles *out)
{
    for (int k = 0; k < size; ++k) {
        const lx_emitter_triangle *t = &v->tracer->emitters.triangles[l->triangle[k] == LX_NO_EMITTER ? 0 : l->triangle[k]];
        set_vector(&out->origin, k, t->origin);
        set_vector(&out->edge1, k, t->edge1);
        set_vector(&out->edge2, k, t->edge2);
        set_vector(&out->normal, k, t->normal);
        out->area[k] = t->area;
        out->both[k] = t->double_sided ? 1 : 0;
        out->uneven[k] = t->grid != 1 ? 1 : 0;
        out->weighed[k] = v->alone[k] ? 0 : (float)count;
        if (l->triangle[k] != LX_NO_EMITTER) lx_emitters_prefetch(&v->tracer->emitters, l->triangle[k], l->u[k]);
    }
}

// Points on triangles by area. `special`: those that ask for more.
LX_INLINED void locate(const lx_source_view *v, lanes *l, const triangles *t, float special[size])
{
    for (int k = 0; k < size; ++k) {
        const lx_vec3 corner = lx_sub(vector_at(&t->origin, k), vector_at(&v->origin, k));
        special[k] = lx_emitter_is_near(corner, vector_at(&t->edge1, k), vector_at(&t->edge2, k), t->area[k]) ? 1 : t->uneven[k];
        const lx_vec2 b = lx_sample_triangle((lx_vec2){l->u[k], l->v[k]});
        l->pdf_area[k] = l->probability[k] / t->area[k];
        l->a[k] = b.x;
        l->b[k] = b.y;
    }
}

static void locate_special(const lx_source_view *v, lanes *l, const float special[size])
{
    for (int k = 0; k < size; ++k) {
        lx_emitter_sample s;
        if (special[k] == 0 || l->triangle[k] == LX_NO_EMITTER) continue;
        if (!lx_emitters_locate(&v->tracer->emitters, l->triangle[k], l->probability[k], vector_at(&v->origin, k), (lx_vec2){l->u[k], l->v[k]}, &s)) {
            l->triangle[k] = LX_NO_EMITTER;
            continue;
        }
        l->a[k] = s.u;
        l->b[k] = s.v;
        l->pdf_area[k] = s.pdf_area;
    }
}

// Their light, were they plain.
LX_INLINED void shine(const lx_source_view *v, lanes *l, const triangles *t, lx_view_samples *out)
{
    for (int k = 0; k < size; ++k) {
        const lx_receiver r = receiver_at(v, k);
        const lx_vec3 origin = vector_at(&v->origin, k), towards = vector_at(&t->normal, k);
        const lx_vec3 point = lx_mad(lx_mad(vector_at(&t->origin, k), vector_at(&t->edge1, k), l->a[k]), vector_at(&t->edge2, k), l->b[k]);
        const lx_vec3 to_point = lx_sub(point, origin);
        const float along = lx_dot(towards, to_point), side = t->both[k] * along > 0 ? -1 : 1, facing = -side * along;
        const float distance2 = lx_dot(to_point, to_point), distance = sqrtf(distance2);
        const lx_vec3 normal = lx_scale(towards, side);
        const float emitter_cosine = facing / distance, cosine = lx_receiver_cosine(&r, lx_scale(to_point, 1 / distance));
        const float pdf = l->pdf_area[k] * distance2 / emitter_cosine; // solid angle
        const float shared = lx_power_heuristic(t->weighed[k] * pdf, cosine / LX_PI), weight = t->weighed[k] > 0 ? shared : 1;
        set_vector(&out->direction, k, lx_sub(lx_offset_origin(point, normal), origin));
        l->light[k] = emitter_cosine > 0 ? weight * cosine / pdf : 0;
    }
}

// Emission and cells, of what arrives.
static void paint(const lx_source_view *v, const lanes *l, lx_view_samples *out)
{
    for (int k = 0; k < size; ++k) {
        out->light[k] = (lx_rgb){0, 0, 0};
        out->cell[k] = 0;
        if (l->triangle[k] == LX_NO_EMITTER || !(l->light[k] > 0)) continue;
        out->light[k] = lx_rgb_grey(l->light[k]);
        const lx_emitter_place place = v->tracer->emitters.places[l->triangle[k]];
        if (!v->tracer->emitters.triangles[l->triangle[k]].plain)
            out->light[k] = lx_rgb_scale(lx_surface_emission(v->tracer, place.surface, place.triangle, l->a[k], l->b[k]), l->light[k]);
        if (v->has_cells) out->cell[k] = lx_tracer_cell_at(v->tracer, place.surface, place.triangle, l->a[k], l->b[k]);
    }
}

// A sky's picture is looked up one by one.
static void sample_sky(const lx_source_view *v, const lanes *l, uint32_t count, lx_view_samples *out)
{
    for (int k = 0; k < size; ++k) {
        const lx_receiver r = receiver_at(v, k);
        lx_ray ray;
        out->light[k] = (lx_rgb){0, 0, 0};
        if (lx_sample_source(v->tracer, v->source, &r, (lx_vec2){l->u[k], l->v[k]}, count, &ray, &out->light[k], &out->cell[k]))
            set_vector(&out->direction, k, ray.direction);
    }
}

LX_INLINED void sample(const lx_source_view *v, uint32_t key, uint32_t first, uint32_t count, lx_view_samples *out)
{
    lanes l;
    find_points(&l, key, first);
    if (v->lamp.light) {
        sample_lamp(v, &l, out);
        return;
    }
    if (lx_tracer_source(v->tracer, v->source)->kind == LX_SOURCE_SKY) {
        sample_sky(v, &l, count, out);
        return;
    }
    triangles t;
    float special[size];
    choose_triangles(v, &l);
    fetch_triangles(v, &l, count, &t);
    locate(v, &l, &t, special);
    locate_special(v, &l, special);
    shine(v, &l, &t, out);
    paint(v, &l, out);
}

// ---- by instruction set -----------------------------------------------------------------------------------------------------------

#if defined(__x86_64__)
__attribute__((target("avx2"))) static void look_avx2(lx_source_view *view)
{
    look(view);
}

__attribute__((target("avx2"))) static void sample_avx2(const lx_source_view *view, uint32_t key, uint32_t first, uint32_t count, lx_view_samples *out)
{
    sample(view, key, first, count, out);
}
#endif

static void look_by_best(lx_source_view *view)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        look_avx2(view);
        return;
    }
#endif
    look(view);
}

void lx_source_view_fill(lx_source_view *view, const lx_tracer *tracer, uint32_t source, const lx_receiver *receivers)
{
    view->tracer = tracer;
    view->source = source;
    for (int k = 0; k < size; ++k) {
        set_vector(&view->position, k, receivers[k].position);
        set_vector(&view->normal, k, receivers[k].normal);
        set_vector(&view->geometric_normal, k, receivers[k].geometric_normal);
    }
    const lx_source *described = lx_tracer_source(tracer, source);
    view->t_max = described->kind == LX_SOURCE_SKY || described->kind == LX_SOURCE_DIRECTIONAL ? INFINITY : nearly_there;
    view->lamp.light = described->light >= 0 ? &tracer->scene->lights[described->light] : NULL;
    look_by_best(view);
    if (!view->reaches) return;
    view->has_table = false;
    view->has_cells = lx_tracer_is_told_by_cell(tracer, source);
    memset(view->alone, false, sizeof view->alone);
    if (described->kind == LX_SOURCE_EMISSIVE && lx_emitters_has_tree(&tracer->emitters, source)) view->reaches = fill_table(view);
    if (!view->lamp.light) return;
    view->lamp = lx_lamp_of(view->lamp.light);
    if (described->kind == LX_SOURCE_RECT || described->kind == LX_SOURCE_DISK)
        for (int k = 0; k < size; ++k) {
            const lx_receiver r = receiver_at(view, k);
            view->areas[k] = lx_area_view_of(&view->lamp, &r);
        }
}

void lx_source_view_sample(const lx_source_view *view, uint32_t key, uint32_t first, uint32_t count, lx_view_samples *out)
{
#if defined(__x86_64__)
    if (__builtin_cpu_supports("avx2")) {
        sample_avx2(view, key, first, count, out);
        return;
    }
#endif
    sample(view, key, first, count, out);
}
