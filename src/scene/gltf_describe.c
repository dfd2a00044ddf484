// What is in a scene, as JSON text for people and tools.
#include "scene/scene.h"

#include "base/error.h"

#include <jansson.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

static const char *const source_kinds[] = {"point", "spot", "directional", "rect", "disk", "emissive", "sky"};
static const char *const source_units[] = {"cd", "cd", "lx", "nit", "nit", "nit", "nit"};
static const char *const mode_names[] = {"baked", "mixed", "realtime"};
static const char *const alpha_names[] = {"OPAQUE", "MASK", "BLEND"};

// json_pack and friends take over what they are given and pass NULL on, so lack of memory shows at the end.

// The shortest decimal that reads back as the same float: 0.1, not 0.10000000149. json_dumps prints 9 digits.
static json_t *number(float value)
{
    char text[32];
    for (int digits = 6; digits <= 9; ++digits) {
        snprintf(text, sizeof text, "%.*g", digits, (double)value);
        if (strtof(text, NULL) == value) break;
    }
    return json_real(isfinite(value) ? strtod(text, NULL) : 0);
}

static json_t *vector(lx_vec3 v) { return json_pack("[o,o,o]", number(v.x), number(v.y), number(v.z)); }

static json_t *color(lx_rgb c) { return json_pack("[o,o,o]", number(c.r), number(c.g), number(c.b)); }

static json_t *describe_counts(const lx_scene *scene)
{
    uint32_t used_images = 0, dynamic = 0;
    for (uint32_t i = 0; i < scene->image_count; ++i) used_images += scene->images[i].width > 0;
    for (uint32_t i = 0; i < scene->instance_count; ++i) dynamic += !scene->instances[i].is_static;
    return json_pack("{s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I,s:I}", "triangles", (json_int_t)scene->triangle_count,
                     "instances", (json_int_t)scene->instance_count, "dynamic_instances", (json_int_t)dynamic, "meshes",
                     (json_int_t)scene->mesh_count, "materials", (json_int_t)scene->material_count, "textures",
                     (json_int_t)scene->texture_count, "images", (json_int_t)used_images, "lights",
                     (json_int_t)scene->light_count, "sources", (json_int_t)scene->source_count, "cameras",
                     (json_int_t)scene->camera_count);
}

static json_t *describe_source(const lx_source *source)
{
    char grid[32];
    snprintf(grid, sizeof grid, "%ux%u", source->columns, source->rows);
    return json_pack("{s:s,s:s,s:s,s:s,s:o,s:o,s:s,s:I,s:o,s:o,s:o}", "name", source->name, "kind", source_kinds[source->kind],
                     "layer", source->layer ? source->layer : source->name, "mode", mode_names[source->mode], "color",
                     color(source->color), "intensity", number(source->intensity), "unit", source_units[source->kind],
                     "node", (json_int_t)source->node, "material",
                     source->material >= 0 ? json_integer(source->material) : json_null(), "monitor",
                     source->columns > 0 ? json_string(grid) : json_null(), "animate",
                     source->animate ? json_string(lx_program_name(source->animate->kind)) : json_null());
}

static json_t *describe_light(const lx_light *light)
{
    json_t *json = json_pack(
        "{s:s,s:s,s:I,s:o,s:o,s:o,s:o,s:s}", "name", light->name, "kind", source_kinds[light->kind], "node",
        (json_int_t)light->node, "position", vector(light->position), "direction", vector(light->direction), "color",
        color(light->color), "intensity", number(light->intensity), "unit", source_units[light->kind]);
    if (!json) return NULL;
    if (light->range > 0) json_object_set_new(json, "range", number(light->range));
    if (light->radius > 0) json_object_set_new(json, "radius", number(light->radius));
    if (light->kind == LX_LIGHT_SPOT) {
        json_object_set_new(json, "inner_angle", number(light->inner_angle));
        json_object_set_new(json, "outer_angle", number(light->outer_angle));
    }
    if (light->kind >= LX_LIGHT_RECT) {
        json_object_set_new(json, "axis_x", vector(light->axis_x));
        json_object_set_new(json, "axis_y", vector(light->axis_y));
    }
    return json;
}

static json_t *describe_camera(const lx_camera *camera)
{
    const float *m = camera->transform.m;
    return json_pack("{s:s,s:s,s:o,s:o,s:o}", "name", camera->name, "kind",
                     camera->perspective ? "perspective" : "orthographic", "position",
                     vector(lx_v3(m[12], m[13], m[14])), "direction", vector(lx_v3(-m[8], -m[9], -m[10])),
                     camera->perspective ? "yfov" : "ymag", number(camera->perspective ? camera->yfov : camera->ymag));
}

static json_t *describe_material(const lx_material *material)
{
    json_t *json = json_pack("{s:s,s:o,s:o,s:o,s:s,s:b,s:b,s:b}", "name", material->name, "base_color",
                             color(material->base_color), "metallic", number(material->metallic), "roughness",
                             number(material->roughness), "alpha_mode", alpha_names[material->alpha_mode],
                             "double_sided", (int)material->double_sided, "unlit", (int)material->unlit, "emissive",
                             (int)lx_material_emits(material));
    if (!json) return NULL;
    if (lx_material_emits(material)) {
        json_object_set_new(json, "emissive_factor", color(material->emissive_factor));
        json_object_set_new(json, "emissive_strength", number(material->emissive_strength));
    }
    if (material->transmission > 0) json_object_set_new(json, "transmission", number(material->transmission));
    return json;
}

static json_t *describe_track(const lx_track *track)
{
    static const char *const interpolations[] = {"STEP", "LINEAR", "CUBICSPLINE"};
    static const char *const properties[2][2] = {{"color", "intensity"}, {"emissiveFactor", "emissiveStrength"}};
    return json_pack("{s:s,s:s,s:I,s:s,s:s,s:I,s:o}", "name", track->name, "object", track->object == LX_TRACK_LIGHT ? "light" : "material",
                     "index", (json_int_t)track->index, "property", properties[track->object][track->channel], "interpolation",
                     interpolations[track->interpolation], "keys", (json_int_t)track->key_count, "duration",
                     number(track->keys[lx_track_stride(track) * (track->key_count - 1)]));
}

static json_t *describe_warnings(const lx_scene *scene)
{
    json_t *list = json_array();
    const size_t count = lx_log_warning_count(scene->context->log);
    for (size_t i = 0; list && i < count; ++i) {
        // A log line may be cut within a character, or repeat bytes of a path that are not UTF-8.
        json_t *text = json_string(lx_log_warning_text(scene->context->log, i));
        json_array_append_new(list, text ? text : json_string("(a warning with unprintable characters)"));
    }
    return list;
}

#define DESCRIBE_ALL(root, key, count, elements, function)                                                             \
    do {                                                                                                               \
        json_t *list = json_array();                                                                                   \
        for (uint32_t i = 0; i < (count); ++i) failed |= json_array_append_new(list, function(&(elements)[i])) != 0;   \
        failed |= json_object_set_new(root, key, list) != 0;                                                           \
    } while (0)

lx_result lx_scene_describe(const lx_scene *scene, char **out_json, lx_error *error)
{
    bool failed = false;
    json_t *root = json_object();
    json_t *path = json_string(scene->path);
    failed |= json_object_set_new(root, "scene", path ? path : json_string("")) != 0;
    failed |= json_object_set_new(root, "from_blender", json_boolean(scene->from_blender)) != 0;
    failed |= json_object_set_new(root, "counts", describe_counts(scene)) != 0;
    if (scene->triangle_count > 0)
        failed |= json_object_set_new(
                      root, "bounds",
                      json_pack("{s:o,s:o}", "min", vector(scene->bounds.low), "max", vector(scene->bounds.high))) != 0;
    DESCRIBE_ALL(root, "sources", scene->source_count, scene->sources, describe_source);
    DESCRIBE_ALL(root, "lights", scene->light_count, scene->lights, describe_light);
    DESCRIBE_ALL(root, "animations", scene->track_count, scene->tracks, describe_track);
    DESCRIBE_ALL(root, "cameras", scene->camera_count, scene->cameras, describe_camera);
    DESCRIBE_ALL(root, "materials", scene->material_count, scene->materials, describe_material);
    failed |= json_object_set_new(root, "warnings", describe_warnings(scene)) != 0;
    char *text = failed ? NULL : json_dumps(root, JSON_INDENT(2) | JSON_REAL_PRECISION(9));
    json_decref(root);
    // Copied, so that lx_text_free need not know where texts come from.
    *out_json = text ? lx_strdup(text) : NULL;
    free(text);
    return *out_json ? LX_OK : lx_fail_memory(error, "description");
}
