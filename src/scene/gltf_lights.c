// Lights: KHR_lights_punctual and area lights by `luxel_area`.
//
// Based on: KHR_lights_punctual (Khronos extension). Lights shine along -Z of their node; its scale is ignored, except
// that an area light's edges are as long as the node makes them.
#include "scene/gltf_reader.h"

#include "base/error.h"

#include <math.h>
#include <string.h>

// A light of the file, before it has a place.
typedef struct lamp {
    lx_gltf_object object; ///< json NULL: made by luxel_area alone.
    int32_t file_index;    ///< -1: likewise.
    lx_light_kind kind;
    lx_rgb color;
    float intensity, range, inner_angle, outer_angle;
    lx_gltf_extras extras;
} lamp;

static lx_result read_kind(const lx_gltf_object *object, lx_light_kind *out, lx_error *error)
{
    const char *type = "";
    const lx_result result = lx_gltf_get_string(object, "type", &type, error);
    if (result != LX_OK) return result;
    if (strcmp(type, "point") == 0)
        *out = LX_LIGHT_POINT;
    else if (strcmp(type, "spot") == 0)
        *out = LX_LIGHT_SPOT;
    else if (strcmp(type, "directional") == 0)
        *out = LX_LIGHT_DIRECTIONAL;
    else
        return lx_fail(error, LX_ERROR_FORMAT, "%s: unknown type '%.20s'", object->label, type);
    return LX_OK;
}

static lx_result read_cone(const lx_gltf_object *object, lamp *out, lx_error *error)
{
    lx_result result = LX_OK;
    lx_gltf_object spot;
    const float right_angle = LX_PI / 2;
    out->inner_angle = 0;
    out->outer_angle = LX_PI / 4;
    LX_TRY(lx_gltf_get_object(object, "spot", &spot, error));
    LX_TRY(lx_gltf_get_float(&spot, "innerConeAngle", &out->inner_angle, error));
    LX_TRY(lx_gltf_get_float(&spot, "outerConeAngle", &out->outer_angle, error));
    if (out->inner_angle < 0 || out->inner_angle >= out->outer_angle)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: innerConeAngle %g is not from 0 to below outerConeAngle %g",
                       object->label, (double)out->inner_angle, (double)out->outer_angle);
    if (out->outer_angle > right_angle + 1e-4f) // rounding of an exporter is no error
        return lx_fail(error, LX_ERROR_FORMAT, "%s: outerConeAngle %g is more than pi/2", object->label,
                       (double)out->outer_angle);
    out->outer_angle = fminf(out->outer_angle, right_angle);
cleanup:
    return result;
}

static lx_result read_strength(const lx_gltf_reader *reader, const lx_gltf_object *object, lamp *out, lx_error *error)
{
    lx_result result = LX_OK;
    float color[3] = {1, 1, 1};
    out->intensity = 1;
    LX_TRY(lx_gltf_get_floats(object, "color", color, 3, NULL, error));
    LX_TRY(lx_gltf_get_float(object, "intensity", &out->intensity, error));
    LX_TRY(lx_gltf_get_float(object, "range", &out->range, error));
    if (out->range < 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: range %g is negative", object->label, (double)out->range);
    if (out->intensity < 0 || color[0] < 0 || color[1] < 0 || color[2] < 0)
        lx_log_warning(reader->log, "%s: negative intensity or colour is taken as 0", object->label);
    out->intensity = fmaxf(out->intensity, 0);
    out->color = lx_rgb_of(fmaxf(color[0], 0), fmaxf(color[1], 0), fmaxf(color[2], 0));
cleanup:
    return result;
}

static lx_result read_lamp(lx_gltf_reader *reader, uint32_t index, lamp *out, lx_error *error)
{
    lx_result result = LX_OK;
    *out = (lamp){.file_index = (int32_t)index};
    LX_TRY(lx_gltf_element(reader, LX_GLTF_LIGHT, index, &out->object, error));
    LX_TRY(read_kind(&out->object, &out->kind, error));
    LX_TRY(read_strength(reader, &out->object, out, error));
    if (out->kind == LX_LIGHT_SPOT) LX_TRY(read_cone(&out->object, out, error));
    LX_TRY(lx_gltf_extras_read(reader, &out->object, LX_EXTRAS_LIGHT, &out->extras, error));
cleanup:
    return result;
}

static lx_vec3 column(const lx_mat4 *m, int index)
{
    return (lx_vec3){m->m[4 * index], m->m[4 * index + 1], m->m[4 * index + 2]};
}

// A scaled and sheared disk is an ellipse; its axes are the principal ones of the two half axes: rotated by
// ½ atan2(2 x·y, x·x - y·y) they are perpendicular.
static void make_perpendicular(lx_vec3 *x, lx_vec3 *y)
{
    const float angle = 0.5f * atan2f(2 * lx_dot(*x, *y), lx_dot(*x, *x) - lx_dot(*y, *y));
    const float c = cosf(angle), s = sinf(angle);
    const lx_vec3 u = lx_mad(lx_scale(*x, c), *y, s), v = lx_mad(lx_scale(*y, c), *x, -s);
    *x = u;
    *y = v;
}

static float area_of(const lx_light *light)
{
    return lx_length(lx_cross(light->axis_x, light->axis_y)) * (light->kind == LX_LIGHT_RECT ? 4 : LX_PI);
}

// Gives `light` the shape and the radiance of an area light. False: it has no area.
static bool make_area(const lx_mat4 *world, const lx_gltf_extras *extras, bool from_lamp, lx_light *light)
{
    const bool rect = extras->area == LX_AREA_RECT;
    const float half = rect ? 0.5f : 1;
    light->kind = rect ? LX_LIGHT_RECT : LX_LIGHT_DISK;
    light->axis_x = lx_scale(column(world, 0), half * extras->area_width);
    light->axis_y = lx_scale(column(world, 1), half * extras->area_height);
    if (!rect) make_perpendicular(&light->axis_x, &light->axis_y);
    const lx_vec3 normal = lx_normalize_or(lx_cross(light->axis_x, light->axis_y), light->direction);
    light->direction = lx_dot(normal, light->direction) < 0 ? lx_neg(normal) : normal;
    const float area = area_of(light);
    if (!(area > 0) || !isfinite(area)) return false;
    if (from_lamp) {
        light->intensity_scale = 1 / area; // on-axis intensity I = L · area
        light->intensity /= area;
    } else {
        light->color = extras->has_color ? extras->color : lx_rgb_grey(1);
        light->intensity = extras->has_intensity ? extras->intensity : 1;
    }
    light->radius = 0;
    return isfinite(light->intensity);
}

static lx_result add_light(lx_gltf_reader *reader, const lx_light *light, const lx_gltf_light_use *use, lx_error *error)
{
    lx_scene *scene = reader->scene;
    if (!lx_array_reserve(&scene->lights, &reader->light_capacity, (size_t)scene->light_count + 1,
                          sizeof *scene->lights) ||
        !lx_array_reserve(&reader->light_uses, &reader->light_use_capacity, (size_t)scene->light_count + 1,
                          sizeof *reader->light_uses))
        return lx_fail_memory(error, "lights");
    reader->light_uses[scene->light_count] = *use;
    scene->lights[scene->light_count++] = *light;
    return LX_OK;
}

static void tell_area_limits(const lx_gltf_reader *reader, const lx_gltf_object *node, lx_light_kind kind)
{
    if (kind == LX_LIGHT_SPOT)
        lx_log_note(reader->log, "%s: with luxel_area the spot's cone angles are ignored", node->label);
    if (kind == LX_LIGHT_DIRECTIONAL)
        lx_log_warning(reader->log, "%s: luxel_area makes no sense for a directional light; ignored", node->label);
}

// Puts `source` (a light of the file, or none) at the node.
static lx_result place_lamp(lx_gltf_reader *reader, uint32_t index, const lx_gltf_object *node_object,
                            const lamp *source, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_gltf_node *node = &reader->nodes[index];
    lx_gltf_light_use use = {.extras = lx_gltf_extras_merge(node->extras, &source->extras)};
    const bool from_lamp = source->object.json != NULL;
    lx_light light = {
        .kind = source->kind,
        .node = index,
        .position = column(&node->world, 3),
        .direction = lx_normalize_or(lx_neg(column(&node->world, 2)), (lx_vec3){0, 0, -1}),
        .color = source->color,
        .intensity = source->intensity,
        .intensity_scale = 1,
        .file_index = source->file_index,
        .range = source->range,
        .inner_angle = source->inner_angle,
        .outer_angle = source->outer_angle,
        .radius = fmaxf(use.extras.radius, 0) * (source->kind == LX_LIGHT_DIRECTIONAL ? LX_PI / 180 : 1),
    };
    use.realtime =
        node->moves || use.extras.mode == LX_MODE_REALTIME || (use.extras.mode < 0 && use.extras.is_static == 0);
    const bool wants_area = use.extras.area != LX_AREA_NONE;
    if (wants_area && from_lamp) tell_area_limits(reader, node_object, source->kind);
    if (wants_area && (!from_lamp || source->kind != LX_LIGHT_DIRECTIONAL)) {
        lx_light area = light;
        if (make_area(&node->world, &use.extras, from_lamp, &area))
            light = area;
        else
            lx_log_warning(reader->log, "%s: luxel_area has no area in the world; ignored", node_object->label);
        if (light.kind == source->kind && !from_lamp) return LX_OK;
    }
    LX_TRY(lx_gltf_name(reader, node_object, from_lamp ? &source->object : NULL, "light", reader->scene->light_count,
                        &light.name, error));
    LX_TRY(add_light(reader, &light, &use, error));
cleanup:
    return result;
}

// The light that the node names; -1: none.
static lx_result light_of_node(const lx_gltf_reader *reader, const lx_gltf_object *node, int32_t *out, lx_error *error)
{
    const lx_gltf_object extension = lx_gltf_extension(node, "KHR_lights_punctual");
    const lx_result result = lx_gltf_get_index(&extension, "light", reader->counts[LX_GLTF_LIGHT], out, error);
    if (result == LX_OK && extension.json && *out < 0)
        return lx_fail(error, LX_ERROR_FORMAT, "%s: no light", extension.label);
    return result;
}

// A luxel_area on a node shapes the lamps below it (Blender used to put lamps on a child node). Where there are none,
// the node itself shines.
static lx_result find_area_takers(lx_gltf_reader *reader, const lamp *lamps, lx_error *error)
{
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i) {
        const lx_gltf_node *node = &reader->nodes[i];
        lx_gltf_object object;
        int32_t light;
        lx_result result = lx_gltf_element(reader, LX_GLTF_NODE, i, &object, error);
        if (result == LX_OK) result = light_of_node(reader, &object, &light, error);
        if (result != LX_OK) return result;
        if (node->in_scene && light >= 0 && node->area_owner >= 0 && lamps[light].kind != LX_LIGHT_DIRECTIONAL)
            reader->nodes[node->area_owner].area_taken = true;
    }
    return LX_OK;
}

static lx_result load_node_light(lx_gltf_reader *reader, uint32_t index, const lamp *lamps, lx_error *error)
{
    static const lamp no_lamp = {.kind = LX_LIGHT_POINT,
                                 .file_index = -1,
                                 .extras = {.mode = -1, .is_static = -1, .transparent = -1, .radius = -1}};
    lx_gltf_object object;
    int32_t light;
    const lx_gltf_node *node = &reader->nodes[index];
    lx_result result = lx_gltf_element(reader, LX_GLTF_NODE, index, &object, error);
    if (result == LX_OK) result = light_of_node(reader, &object, &light, error);
    if (result != LX_OK || !node->in_scene || node->holds_no_lamps) return result;
    if (light >= 0) return place_lamp(reader, index, &object, &lamps[light], error);
    if (node->area_owner == (int32_t)index && !node->area_taken)
        return place_lamp(reader, index, &object, &no_lamp, error);
    return LX_OK;
}

lx_result lx_gltf_load_lights(lx_gltf_reader *reader, lx_error *error)
{
    lx_result result = LX_OK;
    const uint32_t count = reader->counts[LX_GLTF_LIGHT];
    lamp *lamps = lx_calloc_array(count, sizeof *lamps);
    if (!lamps) return lx_fail_memory(error, "lights");
    for (uint32_t i = 0; i < count; ++i) LX_TRY(read_lamp(reader, i, &lamps[i], error));
    LX_TRY(find_area_takers(reader, lamps, error));
    for (uint32_t i = 0; i < reader->counts[LX_GLTF_NODE]; ++i) LX_TRY(load_node_light(reader, i, lamps, error));
cleanup:
    lx_free(lamps);
    return result;
}
