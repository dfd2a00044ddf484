// Rectangles are sampled by solid angle ([Urena2013]); disks through their bounding square, points outside it count 0, which keeps the
// density bounded right up to the disk. From far away both are sampled by area.
#include "trace/lamp_sample.h"

// Half diagonals from which a rectangle is sampled by area: cosine and distance differ by less than a sixth over it.
static const float areas_do_from = 12;
static const float least_solid_angle = 1e-4f; // for the angles' precision

lx_lamp lx_lamp_of(const lx_light *light)
{
    lx_lamp lamp = {.light = light, .cos_outer = -3, .spot_scale = 1}; // cos - -3 is above 1
    switch (light->kind) {
    case LX_LIGHT_POINT: break;
    case LX_LIGHT_SPOT:
        lamp.cos_outer = cosf(light->outer_angle);
        lamp.spot_scale = 1 / lx_max(1e-3f, cosf(light->inner_angle) - lamp.cos_outer); // the extension's own least width
        break;
    case LX_LIGHT_DIRECTIONAL:
        lamp.one_minus_cos = 2 * sinf(light->radius / 4) * sinf(light->radius / 4);
        lamp.factor = light->radius > 0 ? 2 * lamp.one_minus_cos / (sinf(light->radius / 2) * sinf(light->radius / 2)) : 1;
        break;
    case LX_LIGHT_RECT:
    case LX_LIGHT_DISK:
        lamp.half_width = lx_length(light->axis_x);
        lamp.half_depth = lx_length(light->axis_y);
        lamp.near2 = areas_do_from * areas_do_from * (lamp.half_width * lamp.half_width + lamp.half_depth * lamp.half_depth);
        lamp.x = lx_scale(light->axis_x, 1 / lamp.half_width);
        lamp.y = lx_scale(light->axis_y, 1 / lamp.half_depth);
        break;
    }
    return lamp;
}

lx_area_view lx_area_view_of(const lx_lamp *lamp, const lx_receiver *r)
{
    const lx_vec3 to_centre = lx_sub(lamp->light->position, r->position);
    const float height = -lx_dot(to_centre, lamp->light->direction), distance2 = lx_dot(to_centre, to_centre); // height: of the receiver above the lamp's plane
    lx_area_view view = {.rectangle = {.solid_angle = 0}};
    if (!(height > 0) || !(lamp->half_width > 0) || !(lamp->half_depth > 0)) return view;
    view.factor = lx_range_factor(sqrtf(distance2), lamp->light->range);
    view.corner = (lx_vec3){lx_dot(to_centre, lamp->x) - lamp->half_width, lx_dot(to_centre, lamp->y) - lamp->half_depth, height};
    if (distance2 < lamp->near2) view.rectangle = lx_spherical_rectangle_of(view.corner, 2 * lamp->half_width, 2 * lamp->half_depth);
    if (!(view.rectangle.solid_angle > least_solid_angle)) view.rectangle.solid_angle = 0;
    return view;
}
