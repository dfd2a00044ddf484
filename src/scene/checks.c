// Advice on what is legal but probably not meant.
#include "scene/checks.h"

#include <math.h>

#define MAX_MEASURED (100ull << 20) // triangles in a scene beyond which advice is not worth the time it takes

static double length_of_extent(const lx_scene *scene)
{
    const lx_bounds *b = &scene->bounds;
    const double x = (double)b->high.x - b->low.x, y = (double)b->high.y - b->low.y, z = (double)b->high.z - b->low.z;
    return sqrt(x * x + y * y + z * z);
}

static void advise_on_size(const lx_scene *scene)
{
    if (scene->triangle_count == 0) {
        lx_log_warning(scene->context->log, "scene: nothing in it is static, so there is nothing to bake");
        return;
    }
    const double extent = length_of_extent(scene);
    if (extent < 1e-3)
        lx_log_warning(scene->context->log, "scene: only %.3g m wide; glTF's unit is the metre", extent);
    else if (extent > 1e5)
        lx_log_warning(scene->context->log, "scene: %.3g m wide; glTF's unit is the metre", extent);
}

static double surface_area(const lx_scene *scene, const lx_surface *surface)
{
    const lx_primitive *p = &scene->primitives[surface->primitive];
    const lx_mat4 m = scene->instances[surface->instance].transform;
    double area = 0;
    for (uint32_t t = 0; t < p->triangle_count; ++t) {
        const uint32_t *v = &p->indices[3 * (size_t)t];
        const lx_vec3 a = lx_mat4_point(m, p->positions[v[0]]), b = lx_mat4_point(m, p->positions[v[1]]),
                      c = lx_mat4_point(m, p->positions[v[2]]);
        area += 0.5 * (double)lx_length(lx_cross(lx_sub(b, a), lx_sub(c, a)));
    }
    return area;
}

// Lumen, textures taken as white: area · π · radiance, from both sides if the material has two.
static double power_of_emitters(const lx_scene *scene)
{
    double power = 0;
    for (uint32_t i = 0; i < scene->surface_count; ++i) {
        const lx_surface *surface = &scene->surfaces[i];
        const lx_material *material = &scene->materials[surface->material];
        if (surface->source < 0) continue;
        power += surface_area(scene, surface) * (double)LX_PI * (double)lx_luminance(material->emissive_factor) *
                 (double)material->emissive_strength * (material->double_sided ? 2 : 1);
    }
    return power;
}

// Lumen into the scene: of a directional light, what falls on the scene's bounding sphere.
static double power_of_light(const lx_scene *scene, const lx_light *light)
{
    const double strength = (double)lx_luminance(light->color) * (double)light->intensity, pi = (double)LX_PI;
    const double radius = length_of_extent(scene) / 2;
    const double axes = (double)lx_length(lx_cross(light->axis_x, light->axis_y));
    switch (light->kind) {
    case LX_LIGHT_POINT:
        return 4 * pi * strength;
    case LX_LIGHT_SPOT:
        return 2 * pi * (1 - cos((double)light->outer_angle)) * strength;
    case LX_LIGHT_DIRECTIONAL:
        return pi * radius * radius * strength;
    case LX_LIGHT_RECT:
        return pi * 4 * axes * strength;
    case LX_LIGHT_DISK:
        return pi * pi * axes * strength;
    }
    return 0;
}

static void advise_on_emitters(const lx_scene *scene, lx_light_units units)
{
    double lamps = 0;
    if (scene->triangle_count > MAX_MEASURED) return;
    for (uint32_t i = 0; i < scene->light_count; ++i) lamps += power_of_light(scene, &scene->lights[i]);
    const double emitters = lamps > 0 ? power_of_emitters(scene) : 0;
    if (!(emitters > 0) || emitters >= 0.01 * lamps) return;
    lx_log_warning(scene->context->log, "scene: emissive materials give %.2g %% as much light as the lamps%s",
                   100 * emitters / lamps,
                   units == LX_LIGHT_UNITS_GLTF ? "; Blender's exporter scales lamps only: see --light-units blender"
                                                : "");
}

static void advise_on_lights(const lx_scene *scene)
{
    if (scene->source_count > 0) return;
    lx_log_note(scene->context->log, "scene: no lights and no emissive materials; without a sky all will be black");
}

static void advise_blender_user(const lx_scene *scene, bool file_has_lights, bool has_extras)
{
    if (!scene->from_blender) return;
    if (!file_has_lights && scene->light_count == 0)
        lx_log_note(scene->context->log,
                    "exported by Blender without lights: if there are lamps in the scene, tick Punctual Lights "
                    "in the export dialog (Include > Data, or Data > Lighting); it is off by default");
    if (!has_extras)
        lx_log_note(scene->context->log,
                    "exported by Blender without any extras: if objects have luxel_ properties, tick Custom Properties "
                    "in the export dialog (Include); it is off by default");
}

void lx_scene_advise(const lx_scene *scene, lx_light_units units, bool file_has_lights, bool has_extras)
{
    advise_on_size(scene);
    advise_on_lights(scene);
    advise_on_emitters(scene, units);
    advise_blender_user(scene, file_has_lights, has_extras);
}
