#include "render/view.h"

#include "base/error.h"

#include <stdlib.h>
#include <string.h>

// A camera at `eye` whose -Z points along -back; +Y up, or -Z up when looking straight down or up.
static lx_camera camera_at(lx_vec3 eye, lx_vec3 back, float yfov)
{
    const lx_vec3 up_hint = fabsf(back.y) > 0.9999f ? (lx_vec3){0, 0, -1} : (lx_vec3){0, 1, 0};
    const lx_vec3 right = lx_normalize(lx_cross(up_hint, back)), up = lx_cross(back, right);
    return (lx_camera){.name = "", .perspective = true, .yfov = yfov,
                       .transform = {{right.x, right.y, right.z, 0, up.x, up.y, up.z, 0, back.x, back.y, back.z, 0, eye.x,
                                      eye.y, eye.z, 1}}};
}

// From outside, looking down a little; the sphere around the scene just fits the narrower side of the picture.
static lx_camera framing_camera(const lx_scene *scene, float aspect, float yaw)
{
    const lx_vec3 centre = lx_scale(lx_add(scene->bounds.low, scene->bounds.high), 0.5f);
    const float radius = lx_max(0.5f * lx_distance(scene->bounds.low, scene->bounds.high), 1e-6f);
    const lx_vec3 back = lx_normalize((lx_vec3){sinf(yaw), 0.4f, cosf(yaw)});
    const float yfov = 40 * LX_PI / 180;
    const float half = aspect < 1 ? atanf(tanf(yfov / 2) * aspect) : yfov / 2;
    return camera_at(lx_mad(centre, back, radius / sinf(half)), back, yfov);
}

static lx_view_rays rays_of(const lx_camera *camera, float aspect)
{
    const lx_vec3 x = lx_normalize(lx_mat4_direction(camera->transform, (lx_vec3){1, 0, 0}));
    const lx_vec3 y = lx_normalize(lx_mat4_direction(camera->transform, (lx_vec3){0, 1, 0}));
    const lx_vec3 z = lx_normalize(lx_mat4_direction(camera->transform, (lx_vec3){0, 0, 1}));
    const float half_height = camera->perspective ? tanf(camera->yfov / 2) : camera->ymag;
    const float half_width = half_height * aspect;
    lx_view_rays view = {.perspective = camera->perspective,
                         .origin = lx_mat4_point(camera->transform, (lx_vec3){0, 0, 0}),
                         .forward = lx_neg(z),
                         .right = lx_scale(x, 2 * half_width),
                         .down = lx_scale(y, -2 * half_height),
                         .corner = lx_add(lx_scale(x, -half_width), lx_scale(y, half_height))};
    view.corner = lx_add(view.corner, camera->perspective ? view.forward : view.origin);
    return view;
}

// How many of a grid of rays meet a front: from the wrong side of an open room one sees its backs, which are not drawn.
static uint32_t fronts_seen(const lx_tracer *tracer, const lx_view_rays *view)
{
    enum { edge = 24 };
    uint32_t seen = 0;
    for (int y = 0; y < edge; ++y)
        for (int x = 0; x < edge; ++x) {
            lx_ray ray = lx_view_ray(view, ((float)x + 0.5f) / edge, ((float)y + 0.5f) / edge);
            for (int sheet = 0; sheet < 8; ++sheet) {
                lx_hit hit;
                lx_vec3 position, normal;
                lx_trace_closest(tracer, &ray, &hit, 1);
                if (hit.surface == LX_MISS) break;
                lx_hit_geometry(tracer, &hit, &position, &normal);
                if (lx_dot(normal, ray.direction) < 0 || lx_surface_is_double_sided(tracer, hit.surface)) {
                    ++seen;
                    break;
                }
                lx_ray_step_past(&ray, &hit);
            }
        }
    return seen;
}

static lx_camera best_framing_camera(const lx_tracer *tracer, float aspect)
{
    enum { yaw_count = 8 };
    const lx_scene *scene = lx_tracer_scene(tracer);
    lx_camera best = framing_camera(scene, aspect, 0.5f);
    uint32_t most = 0;
    for (int i = 0; i < yaw_count; ++i) {
        const lx_camera camera = framing_camera(scene, aspect, 0.5f + 2 * LX_PI * (float)i / yaw_count);
        const lx_view_rays view = rays_of(&camera, aspect);
        const uint32_t seen = fronts_seen(tracer, &view);
        if (seen <= most) continue;
        most = seen;
        best = camera;
    }
    return best;
}

static lx_camera looking_camera(const lx_render_desc *desc)
{
    const lx_vec3 eye = {desc->eye[0], desc->eye[1], desc->eye[2]};
    const lx_vec3 target = {desc->target[0], desc->target[1], desc->target[2]};
    return camera_at(eye, lx_normalize(lx_sub(eye, target)), desc->yfov_deg * LX_PI / 180);
}

static lx_result fail_camera(const lx_scene *scene, const char *name, lx_error *error)
{
    char list[256] = "";
    for (uint32_t i = 0; i < scene->camera_count; ++i) {
        const size_t used = strlen(list), wanted = strlen(scene->cameras[i].name) + 3;
        if (used + wanted + 4 > sizeof list) {
            strcat(list, " …");
            break;
        }
        strcat(list, i ? ", " : "");
        strcat(list, scene->cameras[i].name);
    }
    if (scene->camera_count == 0) return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "no camera '%s': the scene has none", name);
    return lx_fail(error, LX_ERROR_INVALID_ARGUMENT, "no camera '%s'; there are: %s", name, list);
}

static lx_result find_camera(const lx_scene *scene, const char *name, lx_camera *out, lx_error *error)
{
    for (uint32_t i = 0; i < scene->camera_count; ++i)
        if (strcmp(scene->cameras[i].name, name) == 0) {
            *out = scene->cameras[i];
            return LX_OK;
        }
    char *end;
    const unsigned long index = strtoul(name, &end, 10);
    if (end == name || *end || index >= scene->camera_count) return fail_camera(scene, name, error);
    *out = scene->cameras[index];
    return LX_OK;
}

lx_result lx_view_choose(const lx_tracer *tracer, const lx_render_desc *desc, lx_view_rays *out, lx_error *error)
{
    const lx_scene *scene = lx_tracer_scene(tracer);
    const float aspect = (float)desc->width / (float)desc->height;
    lx_camera camera;
    if (desc->look) {
        camera = looking_camera(desc);
    } else if (desc->camera) {
        const lx_result result = find_camera(scene, desc->camera, &camera, error);
        if (result != LX_OK) return result;
    } else {
        camera = scene->camera_count ? scene->cameras[0] : best_framing_camera(tracer, aspect);
    }
    *out = rays_of(&camera, aspect);
    return LX_OK;
}

lx_ray lx_view_ray(const lx_view_rays *view, float x, float y)
{
    const lx_vec3 p = lx_add(view->corner, lx_add(lx_scale(view->right, x), lx_scale(view->down, y)));
    if (!view->perspective) return (lx_ray){.origin = p, .direction = view->forward, .t_max = INFINITY};
    return (lx_ray){.origin = view->origin, .direction = lx_normalize(p), .t_max = INFINITY};
}
