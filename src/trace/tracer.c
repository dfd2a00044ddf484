// A scene made ready for rays: world-space triangles, the acceleration structure, sampling tables; shading of hits.
#include "trace/tracer.h"

#include "base/error.h"
#include "base/memory.h"
#include "math/hash.h"
#include "trace/tracer_data.h"

#include <string.h>

static const float largest_albedo = 0.99f; // keeps light finite in closed white rooms

static void shade_even_surfaces(lx_tracer *tracer);

// ---- surfaces --------------------------------------------------------------------------------------------------------

typedef struct surface_point {
    const lx_primitive *primitive;
    const uint32_t *corner;
    float w0, u, v;
} surface_point;

static surface_point point_of(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v)
{
    const lx_primitive *primitive = &tracer->scene->primitives[tracer->scene->surfaces[surface].primitive];
    return (surface_point){primitive, primitive->indices + 3 * (size_t)triangle, 1 - u - v, u, v};
}

static lx_vec2 texcoord_at(const surface_point *p, const lx_texture_slot *slot)
{
    const lx_vec2 *uvs = p->primitive->texcoords[slot->texcoord];
    if (!uvs) return (lx_vec2){0, 0};
    const lx_vec2 a = uvs[p->corner[0]], b = uvs[p->corner[1]], c = uvs[p->corner[2]];
    return (lx_vec2){p->w0 * a.x + p->u * b.x + p->v * c.x, p->w0 * a.y + p->u * b.y + p->v * c.y};
}

static lx_vec4 sample_slot(const lx_tracer *tracer, const surface_point *p, const lx_texture_slot *slot, bool srgb)
{
    if (slot->texture < 0) return (lx_vec4){1, 1, 1, 1};
    return lx_texture_sample(tracer->scene, slot, texcoord_at(p, slot), srgb);
}

// Base colour and alpha: factor × texture × vertex colour.
static lx_vec4 base_color_at(const lx_tracer *tracer, const lx_material *m, const surface_point *p)
{
    const lx_vec4 t = sample_slot(tracer, p, &m->base_color_texture, true);
    lx_vec4 c = {t.x * m->base_color.r, t.y * m->base_color.g, t.z * m->base_color.b, t.w * m->base_alpha};
    if (p->primitive->colors) {
        const lx_vec4 *colors = p->primitive->colors;
        const lx_vec4 a = colors[p->corner[0]], b = colors[p->corner[1]], d = colors[p->corner[2]];
        c.x *= p->w0 * a.x + p->u * b.x + p->v * d.x;
        c.y *= p->w0 * a.y + p->u * b.y + p->v * d.y;
        c.z *= p->w0 * a.z + p->u * b.z + p->v * d.z;
        c.w *= p->w0 * a.w + p->u * b.w + p->v * d.w;
    }
    return (lx_vec4){lx_clamp(c.x, 0, 1), lx_clamp(c.y, 0, 1), lx_clamp(c.z, 0, 1), lx_clamp(c.w, 0, 1)};
}

static const lx_material *material_of(const lx_tracer *tracer, uint32_t surface)
{
    return tracer->surfaces[surface].material;
}

// How much a surface hides: alpha as its mode says, 0 in a hole.
static float alpha_at(const lx_tracer *tracer, uint32_t surface, const lx_material *m, float alpha)
{
    if (m->alpha_mode == LX_ALPHA_BLEND || tracer->scene->surfaces[surface].transparent) return alpha;
    if (m->alpha_mode == LX_ALPHA_MASK) return alpha >= m->alpha_cutoff ? 1 : 0;
    return 1;
}

// Splits light that meets a surface into a diffuse share (opacity) and what passes straight on.
static void split_light(const lx_tracer *tracer, uint32_t surface, const lx_material *m, const surface_point *p, lx_vec4 base,
                        float *opacity, lx_rgb *transmittance)
{
    const float alpha = alpha_at(tracer, surface, m, base.w);
    float transmission = m->transmission;
    if (transmission > 0) transmission *= sample_slot(tracer, p, &m->transmission_texture, false).x;
    *opacity = alpha * (1 - transmission);
    const lx_rgb tint = {base.x, base.y, base.z};
    // What passes beside the pigment is white, or tinted on request; what passes through glass is tinted by the glass.
    lx_rgb beside = lx_rgb_grey(1 - alpha);
    if (tracer->coloured_shadows && alpha > 0) beside = lx_rgb_scale(tint, 1 - alpha);
    *transmittance = lx_rgb_add(beside, lx_rgb_scale(tint, alpha * transmission));
}

// base_color_at's alpha alone.
static float base_alpha_at(const lx_tracer *tracer, const lx_material *m, const surface_point *p)
{
    const lx_texture_slot *slot = &m->base_color_texture;
    float alpha = m->base_alpha;
    if (slot->texture >= 0) alpha *= lx_texture_sample_alpha(tracer->scene, slot, texcoord_at(p, slot));
    if (p->primitive->colors) {
        const lx_vec4 *colors = p->primitive->colors;
        alpha *= p->w0 * colors[p->corner[0]].w + p->u * colors[p->corner[1]].w + p->v * colors[p->corner[2]].w;
    }
    return lx_clamp(alpha, 0, 1);
}

// Rays ask this of every cutout triangle they meet.
static bool is_hole(void *user, uint32_t surface, uint32_t triangle, float u, float v)
{
    const lx_tracer *tracer = user;
    const lx_material *m = material_of(tracer, surface);
    const surface_point p = point_of(tracer, surface, triangle, u, v);
    return alpha_at(tracer, surface, m, base_alpha_at(tracer, m, &p)) == 0;
}

static lx_rgb transmittance_at(void *user, uint32_t surface, uint32_t triangle, float u, float v)
{
    const lx_tracer *tracer = user;
    if (tracer->surfaces[surface].kind == LX_SURFACE_OPAQUE) return (lx_rgb){0, 0, 0};
    if (tracer->surfaces[surface].kind == LX_SURFACE_CUTOUT) return lx_rgb_grey(is_hole(user, surface, triangle, u, v) ? 1 : 0);
    if (tracer->surfaces[surface].even) return tracer->surfaces[surface].transmittance;
    const lx_material *m = material_of(tracer, surface);
    const surface_point p = point_of(tracer, surface, triangle, u, v);
    float opacity;
    lx_rgb transmittance;
    split_light(tracer, surface, m, &p, base_color_at(tracer, m, &p), &opacity, &transmittance);
    return transmittance;
}

lx_rgb lx_surface_emission(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v)
{
    const lx_material *m = material_of(tracer, surface);
    const surface_point p = point_of(tracer, surface, triangle, u, v);
    lx_rgb emission = {1, 1, 1};
    if (!lx_surface_is_told_by_cell(tracer, surface)) {
        const lx_vec4 t = sample_slot(tracer, &p, &m->emissive_texture, true);
        emission = (lx_rgb){t.x, t.y, t.z};
    }
    if (tracer->surfaces[surface].kind != LX_SURFACE_OPAQUE) // a hole does not shine
        emission = lx_rgb_scale(emission, alpha_at(tracer, surface, m, base_color_at(tracer, m, &p).w));
    return emission;
}

void lx_triangle_corners(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, lx_vec3 corners[3])
{
    const lx_primitive *primitive = &tracer->scene->primitives[tracer->scene->surfaces[surface].primitive];
    const lx_vec3 *positions = tracer->surfaces[surface].positions;
    for (int i = 0; i < 3; ++i) corners[i] = positions[primitive->indices[3 * (size_t)triangle + (size_t)i]];
}

// ---- construction ------------------------------------------------------------------------------------------------------

static lx_surface_kind classify(const lx_scene *scene, const lx_surface *surface)
{
    const lx_material *m = &scene->materials[surface->material];
    const bool uses_alpha = m->alpha_mode != LX_ALPHA_OPAQUE || surface->transparent;
    const bool has_alpha = m->base_alpha < 1 || lx_texture_has_alpha(scene, &m->base_color_texture) ||
                           scene->primitives[surface->primitive].colors != NULL;
    if (m->transmission > 0) return LX_SURFACE_TRANSLUCENT;
    if (!uses_alpha || !has_alpha) return LX_SURFACE_OPAQUE;
    return m->alpha_mode == LX_ALPHA_MASK && !surface->transparent ? LX_SURFACE_CUTOUT : LX_SURFACE_TRANSLUCENT;
}

static lx_result build_surfaces(lx_tracer *tracer, bool include_dynamic, lx_error *error)
{
    const lx_scene *scene = tracer->scene;
    size_t vertex_count = 0;
    for (uint32_t i = 0; i < scene->surface_count; ++i) {
        const lx_surface *s = &scene->surfaces[i];
        if (scene->instances[s->instance].is_static || include_dynamic)
            vertex_count += scene->primitives[s->primitive].vertex_count;
    }
    tracer->surfaces = lx_calloc_array(scene->surface_count, sizeof *tracer->surfaces);
    tracer->positions = lx_calloc_array(vertex_count + 2, sizeof *tracer->positions); // Embree reads 16 bytes past the end
    if (!tracer->surfaces || !tracer->positions) return lx_fail_memory(error, "world triangles");
    lx_vec3 *next = tracer->positions;
    for (uint32_t i = 0; i < scene->surface_count; ++i) {
        const lx_surface *s = &scene->surfaces[i];
        const lx_instance *instance = &scene->instances[s->instance];
        const lx_primitive *primitive = &scene->primitives[s->primitive];
        lx_traced_surface *out = &tracer->surfaces[i];
        out->kind = classify(scene, s);
        out->orientation = lx_mat4_determinant3(instance->transform) < 0 ? -1.0f : 1.0f;
        out->material = &scene->materials[s->material];
        out->indices = primitive->indices;
        out->normals = primitive->normals;
        for (int k = 0; k < 3; ++k) {
            const lx_vec3 axis = {k == 0, k == 1, k == 2};
            out->normal_axes[k] = lx_scale(lx_mat4_normal(instance->transform, axis), out->orientation);
        }
        if (!instance->is_static && !include_dynamic) continue;
        out->positions = next;
        for (uint32_t v = 0; v < primitive->vertex_count; ++v)
            *next++ = lx_mat4_point(instance->transform, primitive->positions[v]);
    }
    return LX_OK;
}

static lx_result build_accel(lx_tracer *tracer, lx_error *error)
{
    const lx_scene *scene = tracer->scene;
    lx_accel_mesh *meshes = lx_calloc_array(scene->surface_count, sizeof *meshes);
    if (!meshes) return lx_fail_memory(error, "ray tracing structure");
    for (uint32_t i = 0; i < scene->surface_count; ++i) {
        const lx_primitive *primitive = &scene->primitives[scene->surfaces[i].primitive];
        if (!tracer->surfaces[i].positions) continue;
        meshes[i] = (lx_accel_mesh){.vertices = tracer->surfaces[i].positions, .indices = primitive->indices,
                                    .vertex_count = primitive->vertex_count, .triangle_count = primitive->triangle_count,
                                    .mirrored = tracer->surfaces[i].orientation < 0,
                                    .has_holes = tracer->surfaces[i].kind == LX_SURFACE_CUTOUT,
                                    .transmits = tracer->surfaces[i].kind == LX_SURFACE_TRANSLUCENT,
                                    .front = lx_surface_is_solid(tracer, i) ? tracer->surfaces[i].orientation : 0};
    }
    const lx_accel_surface_queries queries = {tracer, is_hole, transmittance_at};
    const lx_result result =
        lx_accel_create(meshes, scene->surface_count, queries, scene->context->isa, &tracer->accel, error);
    lx_free(meshes);
    return result;
}

// Surface area of everything traced, m².
static double total_area(const lx_tracer *tracer)
{
    double sum = 0;
    for (uint32_t s = 0; s < tracer->scene->surface_count; ++s) {
        if (!tracer->surfaces[s].positions) continue;
        const uint32_t count = tracer->scene->primitives[tracer->scene->surfaces[s].primitive].triangle_count;
        for (uint32_t t = 0; t < count; ++t) {
            lx_vec3 p[3];
            lx_triangle_corners(tracer, s, t, p);
            sum += 0.5 * (double)lx_length(lx_cross(lx_sub(p[1], p[0]), lx_sub(p[2], p[0])));
        }
    }
    return sum;
}

// Luminous flux per unit of strength: what a source sends out altogether.
static double unit_flux(const lx_tracer *tracer, uint32_t index)
{
    const double pi = 3.14159265358979323846;
    const lx_source *source = lx_tracer_source(tracer, index);
    if (source->kind == LX_SOURCE_EMISSIVE) return pi * (double)tracer->emitters.source_power[index];
    if (source->light < 0) return 0;
    const lx_light *light = &tracer->scene->lights[source->light];
    switch (light->kind) {
    case LX_LIGHT_POINT: return 4 * pi;
    case LX_LIGHT_SPOT: return 2 * pi * (1 - cos((double)light->outer_angle));
    case LX_LIGHT_RECT: return pi * 4 * (double)(lx_length(light->axis_x) * lx_length(light->axis_y));
    case LX_LIGHT_DISK: return pi * pi * (double)(lx_length(light->axis_x) * lx_length(light->axis_y));
    case LX_LIGHT_DIRECTIONAL: break;
    }
    return 0;
}

static lx_result build_scales(lx_tracer *tracer, lx_error *error)
{
    tracer->source_scales = lx_calloc_array(tracer->source_count, sizeof(float));
    if (!tracer->source_scales) return lx_fail_memory(error, "sources");
    // A share of the mean: small enough that the roulette it decides adds no noise that shows even where nothing but one lamp lights the
    // scene (docs/accuracy.md, two plates), large enough to spare the far lamps of a hall.
    const double share = 0.05, area = total_area(tracer);
    for (uint32_t i = 0; i < tracer->source_count; ++i) {
        const lx_source_kind kind = lx_tracer_source(tracer, i)->kind;
        double mean = area > 0 ? unit_flux(tracer, i) / area : 0;
        // Sun and sky have no flux of their own; a tenth of what they give in the open stands for it.
        if (kind == LX_SOURCE_DIRECTIONAL) mean = 0.1;
        if (kind == LX_SOURCE_SKY) mean = 0.1 * (double)LX_PI;
        tracer->source_scales[i] = (float)(share * mean);
    }
    return LX_OK;
}

static lx_source_sphere sphere_of_emissive(const lx_tracer *tracer, uint32_t source)
{
    const lx_emitters *e = &tracer->emitters;
    lx_bounds bounds = lx_bounds_empty();
    lx_vec3 p[3];
    for (uint32_t i = e->first_triangle[source]; i < e->first_triangle[source + 1]; ++i) {
        lx_triangle_corners(tracer, e->places[i].surface, e->places[i].triangle, p);
        for (int k = 0; k < 3; ++k) lx_bounds_add(&bounds, p[k]);
    }
    lx_source_sphere s = {.centre = lx_scale(lx_add(bounds.low, bounds.high), 0.5f), .power = e->source_power[source]};
    for (uint32_t i = e->first_triangle[source]; i < e->first_triangle[source + 1]; ++i) {
        lx_triangle_corners(tracer, e->places[i].surface, e->places[i].triangle, p);
        for (int k = 0; k < 3; ++k) s.radius = lx_max(s.radius, lx_distance(s.centre, p[k]));
    }
    s.radius *= 1.0001f;
    return s;
}

static lx_source_sphere sphere_of_light(const lx_light *light)
{
    lx_source_sphere s = {.centre = light->position, .radius = light->radius, .power = 1, .cos_outer = -1};
    const float width = lx_length(light->axis_x), depth = lx_length(light->axis_y);
    switch (light->kind) {
    case LX_LIGHT_DIRECTIONAL: s.power = INFINITY; break;
    case LX_LIGHT_SPOT: s.cos_outer = cosf(light->outer_angle); break;
    case LX_LIGHT_RECT:
    case LX_LIGHT_DISK:
        s.radius = sqrtf(width * width + depth * depth);
        s.power = 4 * width * depth;
        break;
    case LX_LIGHT_POINT: break;
    }
    return s;
}

static lx_result build_spheres(lx_tracer *tracer, lx_error *error)
{
    tracer->source_spheres = lx_calloc_array(tracer->source_count, sizeof *tracer->source_spheres);
    if (!tracer->source_spheres) return lx_fail_memory(error, "sources");
    for (uint32_t i = 0; i < tracer->source_count; ++i) {
        const lx_source *source = lx_tracer_source(tracer, i);
        lx_source_sphere *s = &tracer->source_spheres[i];
        if (source->kind == LX_SOURCE_EMISSIVE)
            *s = sphere_of_emissive(tracer, i);
        else if (source->light >= 0)
            *s = sphere_of_light(&tracer->scene->lights[source->light]);
        else
            s->power = INFINITY;
    }
    return LX_OK;
}

static lx_result build_sources(lx_tracer *tracer, const lx_sky_desc *sky, const bool *cells, lx_error *error)
{
    const lx_scene *scene = tracer->scene;
    const lx_result result = lx_sky_load(sky, &tracer->sky, error);
    if (result != LX_OK) return result;
    tracer->sky_source = (lx_source){.kind = LX_SOURCE_SKY, .name = "sky", .mode = LX_MODE_BAKED, .light = -1, .file_light = -1,
                                     .parent_node = -1, .color_scale = 1, .intensity_scale = 1,
                                     .material = -1, .color = {sky->color[0], sky->color[1], sky->color[2]},
                                     .intensity = sky->intensity};
    const bool untinted = sky->color[0] == 0 && sky->color[1] == 0 && sky->color[2] == 0;
    if (sky->file && untinted) tracer->sky_source.color = (lx_rgb){1, 1, 1};
    tracer->source_count = scene->source_count + (tracer->sky.present ? 1 : 0);
    tracer->source_keys = lx_calloc_array(tracer->source_count, sizeof(uint32_t));
    if (!tracer->source_keys) return lx_fail_memory(error, "sources");
    tracer->source_cells = lx_calloc_array(tracer->source_count, sizeof(uint32_t));
    if (!tracer->source_cells) return lx_fail_memory(error, "sources");
    for (uint32_t i = 0; cells && i < scene->source_count; ++i)
        if (cells[i]) tracer->source_cells[i] = lx_source_cell_count(&scene->sources[i]);
    // Keyed by name, so that a source keeps its random numbers when others come and go.
    for (uint32_t i = 0; i < tracer->source_count; ++i) {
        const char *name = lx_tracer_source(tracer, i)->name;
        const uint64_t hash = lx_hash64(lx_hash_bytes(0xcbf29ce484222325u, name, strlen(name)));
        tracer->source_keys[i] = (uint32_t)(hash >> 32);
    }
    return LX_OK;
}

lx_result lx_tracer_create(const lx_scene *scene, const lx_transport_desc *transport, bool include_dynamic, const bool *cells,
                           lx_tracer **out_tracer, lx_error *error)
{
    lx_result result = LX_OK;
    lx_tracer *tracer = lx_calloc_array(1, sizeof *tracer);
    if (!tracer) return lx_fail_memory(error, "tracer");
    tracer->scene = scene;
    tracer->coloured_shadows = transport->coloured_shadows;
    LX_TRY(build_surfaces(tracer, include_dynamic, error));
    LX_TRY(build_accel(tracer, error));
    LX_TRY(build_sources(tracer, &transport->sky, cells, error));
    LX_TRY(lx_emitters_build(tracer, error));
    LX_TRY(build_scales(tracer, error));
    LX_TRY(build_spheres(tracer, error));
    shade_even_surfaces(tracer);
    *out_tracer = tracer;
    tracer = NULL;
cleanup:
    lx_tracer_destroy(tracer);
    return result;
}

void lx_tracer_destroy(lx_tracer *tracer)
{
    if (!tracer) return;
    lx_accel_destroy(tracer->accel);
    lx_emitters_release(&tracer->emitters);
    lx_sky_release(&tracer->sky);
    lx_free(tracer->source_keys);
    lx_free(tracer->source_cells);
    lx_free(tracer->source_scales);
    lx_free(tracer->source_spheres);
    lx_free(tracer->surfaces);
    lx_free(tracer->positions);
    lx_free(tracer);
}

const lx_scene *lx_tracer_scene(const lx_tracer *tracer)
{
    return tracer->scene;
}

uint32_t lx_tracer_source_count(const lx_tracer *tracer)
{
    return tracer->source_count;
}

const lx_source *lx_tracer_source(const lx_tracer *tracer, uint32_t index)
{
    return index < tracer->scene->source_count ? &tracer->scene->sources[index] : &tracer->sky_source;
}

uint32_t lx_tracer_cell_count(const lx_tracer *tracer, uint32_t source)
{
    return tracer->source_cells[source] > 0 ? tracer->source_cells[source] : 1;
}

bool lx_tracer_is_told_by_cell(const lx_tracer *tracer, uint32_t source)
{
    return tracer->source_cells[source] > 0;
}

uint32_t lx_tracer_cell_at(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v)
{
    if (!lx_surface_is_told_by_cell(tracer, surface)) return 0;
    const surface_point p = point_of(tracer, surface, triangle, u, v);
    const lx_texture_slot plain = {.texture = -1, .texcoord = 0};
    return lx_monitor_cell(&tracer->scene->sources[tracer->scene->surfaces[surface].source], texcoord_at(&p, &plain));
}

lx_rgb lx_tracer_sky_radiance(const lx_tracer *tracer, lx_vec3 direction)
{
    return lx_sky_radiance(&tracer->sky, direction);
}

const char *lx_tracer_isa(const lx_tracer *tracer)
{
    return lx_accel_isa(tracer->accel);
}

// ---- rays ------------------------------------------------------------------------------------------------------------------

void lx_trace_closest(const lx_tracer *tracer, const lx_ray *rays, lx_hit *hits, size_t count)
{
    lx_accel_closest(tracer->accel, rays, hits, count);
}

void lx_trace_transmittance(const lx_tracer *tracer, const lx_ray *rays, lx_rgb *transmittance, size_t count)
{
    lx_accel_transmittance(tracer->accel, rays, transmittance, count);
}

bool lx_trace_crowded(const lx_tracer *tracer, const lx_patch *patches, size_t count)
{
    return lx_accel_crowded(tracer->accel, patches, count);
}

void lx_ray_step_past(lx_ray *ray, const lx_hit *hit)
{
    const float next = hit->t * (1 + 0x1p-20f);
    ray->t_min = next > hit->t ? next : nextafterf(hit->t, INFINITY);
}

lx_vec3 lx_triangle_normal(const lx_tracer *tracer, uint32_t surface, const lx_vec3 corners[3])
{
    const lx_vec3 cross = lx_cross(lx_sub(corners[1], corners[0]), lx_sub(corners[2], corners[0]));
    return lx_scale(lx_normalize_or(cross, (lx_vec3){0, 1, 0}), tracer->surfaces[surface].orientation);
}

static lx_vec3 world_normal(const lx_traced_surface *surface, lx_vec3 local)
{
    const lx_vec3 *axes = surface->normal_axes;
    return lx_add(lx_add(lx_scale(axes[0], local.x), lx_scale(axes[1], local.y)), lx_scale(axes[2], local.z));
}

static lx_vec3 interpolated_normal(const lx_traced_surface *surface, uint32_t triangle, float u, float v, lx_vec3 geometric)
{
    if (!surface->normals) return geometric;
    const uint32_t *corner = surface->indices + 3 * (size_t)triangle;
    const lx_vec3 local = lx_add(lx_add(lx_scale(surface->normals[corner[0]], 1 - u - v), lx_scale(surface->normals[corner[1]], u)),
                                 lx_scale(surface->normals[corner[2]], v));
    const lx_vec3 n = lx_normalize_or(world_normal(surface, local), geometric);
    // A vertex normal that points behind the triangle can't tell which way is up; the triangle can.
    return lx_dot(n, geometric) > 0 ? n : geometric;
}

void lx_hit_geometry(const lx_tracer *tracer, const lx_hit *hit, lx_vec3 *position, lx_vec3 *normal)
{
    lx_vec3 c[3];
    lx_triangle_corners(tracer, hit->surface, hit->triangle, c);
    *position = lx_add(lx_add(lx_scale(c[0], 1 - hit->u - hit->v), lx_scale(c[1], hit->u)), lx_scale(c[2], hit->v));
    *normal = lx_triangle_normal(tracer, hit->surface, c);
}

bool lx_triangle_normals(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, lx_vec3 normals[3])
{
    const surface_point p = point_of(tracer, surface, triangle, 0, 0);
    if (!p.primitive->normals) return false;
    for (int i = 0; i < 3; ++i)
        normals[i] = lx_normalize_or(world_normal(&tracer->surfaces[surface], p.primitive->normals[p.corner[i]]), (lx_vec3){0, 0, 0});
    return true;
}

bool lx_surface_is_plain(const lx_tracer *tracer, uint32_t surface)
{
    return tracer->surfaces[surface].kind != LX_SURFACE_TRANSLUCENT && tracer->scene->surfaces[surface].source < 0;
}

bool lx_surface_is_double_sided(const lx_tracer *tracer, uint32_t surface)
{
    return material_of(tracer, surface)->double_sided;
}

bool lx_surface_is_solid(const lx_tracer *tracer, uint32_t surface)
{
    return tracer->surfaces[surface].kind == LX_SURFACE_OPAQUE && !lx_surface_is_double_sided(tracer, surface);
}

// Diffuse reflectance of what has base colour `base` and is not unlit.
static lx_rgb albedo_at(const lx_tracer *tracer, const lx_material *m, const surface_point *p, lx_vec4 base)
{
    float scale = 1;
    if (m->metallic > 0) {
        const lx_vec4 mr = sample_slot(tracer, p, &m->metallic_roughness_texture, false);
        const float metallic = lx_clamp(m->metallic * mr.z, 0, 1), roughness = lx_clamp(m->roughness * mr.y, 0, 1);
        scale = (1 - metallic) + metallic * roughness * roughness * 0.5f;
    }
    return (lx_rgb){lx_min(base.x * scale, largest_albedo), lx_min(base.y * scale, largest_albedo), lx_min(base.z * scale, largest_albedo)};
}

// What the material says of a point: opacity, albedo, transmittance, emission of `s`, for which `lit` is set.
static void shade_material(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, float u, float v, lx_shading *s)
{
    const lx_material *m = material_of(tracer, surface);
    const surface_point p = point_of(tracer, surface, triangle, u, v);
    const lx_vec4 base = base_color_at(tracer, m, &p);
    s->opacity = 1;
    s->transmittance = (lx_rgb){0, 0, 0};
    if (tracer->surfaces[surface].kind != LX_SURFACE_OPAQUE) split_light(tracer, surface, m, &p, base, &s->opacity, &s->transmittance);
    s->albedo = s->emission = (lx_rgb){0, 0, 0};
    if (!m->unlit) s->albedo = albedo_at(tracer, m, &p, base);
    if (m->unlit)
        s->emission = (lx_rgb){base.x, base.y, base.z};
    else if (s->lit && (lx_material_emits(m) || lx_surface_is_told_by_cell(tracer, surface)))
        s->emission = lx_surface_emission(tracer, surface, triangle, u, v);
}

static bool is_even(const lx_tracer *tracer, uint32_t surface)
{
    const lx_material *m = material_of(tracer, surface);
    return m->base_color_texture.texture < 0 && !tracer->scene->primitives[tracer->scene->surfaces[surface].primitive].colors &&
           (m->transmission_texture.texture < 0 || m->transmission == 0) && (m->metallic_roughness_texture.texture < 0 || m->metallic == 0) &&
           (m->emissive_texture.texture < 0 || !lx_material_emits(m) || lx_surface_is_told_by_cell(tracer, surface));
}

// Shades even surfaces once for all hits.
static void shade_even_surfaces(lx_tracer *tracer)
{
    for (uint32_t i = 0; i < tracer->scene->surface_count; ++i) {
        lx_traced_surface *surface = &tracer->surfaces[i];
        surface->even = surface->positions && is_even(tracer, i);
        if (!surface->even) continue;
        lx_shading s = {.lit = true};
        shade_material(tracer, i, 0, 0, 0, &s);
        surface->opacity = s.opacity;
        surface->albedo = s.albedo;
        surface->transmittance = s.transmittance;
        surface->emission = s.emission;
    }
}

// What the material says of a hit.
static void shade(const lx_tracer *tracer, const lx_hit *hit, lx_shading *s)
{
    const lx_traced_surface *surface = &tracer->surfaces[hit->surface];
    s->front = !hit->back;
    s->lit = s->front || surface->material->double_sided;
    if (!surface->even) {
        shade_material(tracer, hit->surface, hit->triangle, hit->u, hit->v, s);
        return;
    }
    s->opacity = surface->opacity;
    s->albedo = surface->albedo;
    s->transmittance = surface->transmittance;
    s->emission = s->lit || surface->material->unlit ? surface->emission : (lx_rgb){0, 0, 0};
}

// Hits lie anywhere in memory: corners' numbers are asked for some hits ahead, then the corners by their numbers.
static void prefetch_indices(const lx_tracer *tracer, const lx_hit *hit)
{
    if (hit->surface != LX_MISS) LX_PREFETCH(tracer->surfaces[hit->surface].indices + 3 * (size_t)hit->triangle);
}

static void prefetch_corners(const lx_tracer *tracer, const lx_hit *hit)
{
    if (hit->surface == LX_MISS) return;
    const lx_traced_surface *surface = &tracer->surfaces[hit->surface];
    const uint32_t *indices = surface->indices + 3 * (size_t)hit->triangle;
    for (int k = 0; k < 3; ++k) {
        LX_PREFETCH(surface->positions + indices[k]);
        if (surface->normals) LX_PREFETCH(surface->normals + indices[k]);
    }
}

enum { indices_ahead = 32, corners_ahead = 12 };

static void prefetch_first(const lx_tracer *tracer, const lx_hit *hits, size_t count)
{
    for (size_t i = 0; i < count && i < indices_ahead; ++i) prefetch_indices(tracer, &hits[i]);
    for (size_t i = 0; i < count && i < corners_ahead; ++i) prefetch_corners(tracer, &hits[i]);
}

static void prefetch_next(const lx_tracer *tracer, const lx_hit *hits, size_t i, size_t count)
{
    if (i + indices_ahead < count) prefetch_indices(tracer, &hits[i + indices_ahead]);
    if (i + corners_ahead < count) prefetch_corners(tracer, &hits[i + corners_ahead]);
}

static void find_place(const lx_tracer *tracer, const lx_hit *hit, lx_vec3 *position, lx_vec3 *geometric, lx_vec3 *normal)
{
    lx_hit_geometry(tracer, hit, position, geometric);
    *normal = interpolated_normal(&tracer->surfaces[hit->surface], hit->triangle, hit->u, hit->v, *geometric);
}

void lx_shade_hits(const lx_tracer *tracer, const lx_hit *hits, lx_shading *shading, size_t count)
{
    prefetch_first(tracer, hits, count);
    for (size_t i = 0; i < count; ++i) {
        prefetch_next(tracer, hits, i, count);
        if (hits[i].surface == LX_MISS) continue;
        lx_shading *s = &shading[i];
        find_place(tracer, &hits[i], &s->position, &s->geometric_normal, &s->normal);
        shade(tracer, &hits[i], s);
    }
}

void lx_shade_materials(const lx_tracer *tracer, const lx_hit *hits, lx_shading *shading, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        if (i + indices_ahead < count) prefetch_indices(tracer, &hits[i + indices_ahead]);
        if (hits[i].surface != LX_MISS) shade(tracer, &hits[i], &shading[i]);
    }
}

void lx_hit_receivers(const lx_tracer *tracer, const lx_hit *hits, lx_receiver *receivers, size_t count)
{
    prefetch_first(tracer, hits, count);
    for (size_t i = 0; i < count; ++i) {
        const lx_hit *hit = &hits[i];
        lx_receiver *r = &receivers[i];
        prefetch_next(tracer, hits, i, count);
        find_place(tracer, hit, &r->position, &r->geometric_normal, &r->normal);
        if (!hit->back) continue;
        r->normal = lx_neg(r->normal);
        r->geometric_normal = lx_neg(r->geometric_normal);
    }
}
