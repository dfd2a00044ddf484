#include "bake/advice.h"

static lx_log *log_of(const lx_bake *bake)
{
    return bake->scene->context->log;
}

// Light from a sphere does not reach what is inside it. Looked for with a few rays from the centre.
static void advise_on_radius(const lx_bake *bake, const lx_light *light)
{
    enum { ray_count = 64 };
    if (!(light->radius > 0) || (light->kind != LX_LIGHT_POINT && light->kind != LX_LIGHT_SPOT)) return;
    lx_ray rays[ray_count];
    lx_hit hits[ray_count];
    for (int i = 0; i < ray_count; ++i) { // spherical Fibonacci points
        const float z = 1 - (2 * (float)i + 1) / ray_count, phi = 2.399963f * (float)i, r = sqrtf(lx_max(0, 1 - z * z));
        rays[i] = (lx_ray){.origin = light->position, .direction = {r * cosf(phi), r * sinf(phi), z}, .t_max = light->radius};
    }
    lx_trace_closest(bake->tracer, rays, hits, ray_count);
    for (int i = 0; i < ray_count; ++i)
        if (hits[i].surface != LX_MISS) {
            const uint32_t instance = bake->scene->surfaces[hits[i].surface].instance;
            lx_log_warning(log_of(bake), "light '%s': '%s' reaches into its luxel_radius of %g m and gets no light from it there",
                           light->name, bake->scene->instances[instance].name, (double)light->radius);
            return;
        }
}

static bool is_unlit(const lx_scene *scene, const lx_instance *instance)
{
    const lx_mesh *mesh = &scene->meshes[instance->mesh];
    for (uint32_t i = 0; i < mesh->primitive_count; ++i)
        if (!scene->materials[scene->primitives[mesh->first_primitive + i].material].unlit) return false;
    return mesh->primitive_count > 0;
}

static lx_bounds bounds_of(const lx_scene *scene, const lx_instance *instance)
{
    lx_bounds bounds = lx_bounds_empty();
    const lx_mesh *mesh = &scene->meshes[instance->mesh];
    for (uint32_t i = 0; i < mesh->primitive_count; ++i) {
        const lx_primitive *p = &scene->primitives[mesh->first_primitive + i];
        for (uint32_t v = 0; v < p->vertex_count; ++v) lx_bounds_add(&bounds, lx_mat4_point(instance->transform, p->positions[v]));
    }
    return bounds;
}

// A painted sky dome is a wall to rays.
static void advise_on_domes(const lx_bake *bake)
{
    const lx_scene *scene = bake->scene;
    const uint32_t count = lx_tracer_source_count(bake->tracer);
    if (count == 0 || lx_tracer_source(bake->tracer, count - 1)->kind != LX_SOURCE_SKY) return;
    const lx_vec3 low = scene->bounds.low, high = scene->bounds.high;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        if (!scene->instances[i].is_static || !is_unlit(scene, &scene->instances[i])) continue;
        const lx_bounds b = bounds_of(scene, &scene->instances[i]);
        const bool encloses = b.low.x <= low.x && b.low.z <= low.z && b.high.x >= high.x && b.high.y >= high.y && b.high.z >= high.z;
        if (encloses)
            lx_log_warning(log_of(bake), "'%s' is unlit and encloses the scene: it blocks the sky (luxel_static: false leaves it out)",
                           scene->instances[i].name);
    }
}

void lx_advise_on_scene(const lx_bake *bake)
{
    for (uint32_t i = 0; i < bake->source_count; ++i) {
        const lx_source *source = lx_tracer_source(bake->tracer, i);
        if (source->light >= 0) advise_on_radius(bake, &bake->scene->lights[source->light]);
    }
    advise_on_domes(bake);
}

lx_result lx_advise_on_layers(const lx_bake *bake, lx_error *error)
{
    for (uint32_t i = 0; i < bake->layer_count; ++i) {
        lx_layer_range range;
        const lx_result result = lx_finished_range(bake->finished, i, &range, error);
        if (result != LX_OK) return result;
        if (range.largest > 0) continue;
        lx_log_warning(log_of(bake), "layer '%s' (%s) lights nothing: is it enclosed, facing away or outside the scene?", bake->layers[i].name,
                       bake->layers[i].node[0] ? bake->layers[i].node : "sky");
    }
    return LX_OK;
}
