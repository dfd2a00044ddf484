/// What lamps give one receiver, without occluders: one sample each. No branches that differ from sample to sample and no calls, so that loops over these
/// functions become vectors.
///
/// Every function returns the irradiance of a lamp of strength 1 with range, spot cone, receiver's cosine and 1/pdf in it, 0: nothing arrives; and where its
/// shadow ray goes: to a point, but of directional lamps in a direction.
#ifndef LX_TRACE_LAMP_SAMPLE_H
#define LX_TRACE_LAMP_SAMPLE_H

#include "trace/sampling.h"
#include "trace/tracer.h"

/// A light as its samples want it.
typedef struct lx_lamp {
    const lx_light *light;
    lx_vec3 x, y;                  ///< RECT, DISK: unit axes,
    float half_width, half_depth;  ///< and their lengths in metres.
    float near2;                   ///< Squared distance within which they are sampled by solid angle.
    float cos_outer, spot_scale;   ///< 1 / (cos inner - cos outer); where there is no cone, the factor comes out as 1.
    float one_minus_cos, factor;   ///< DIRECTIONAL: of half the angular diameter; what the mean over its cone is multiplied by.
} lx_lamp;

lx_lamp lx_lamp_of(const lx_light *light);

/// Cosine at the receiver; 0 from below either normal.
LX_INLINED float lx_receiver_cosine(const lx_receiver *r, lx_vec3 direction)
{
    const float cosine = lx_dot(r->normal, direction), upright = lx_dot(r->geometric_normal, direction);
    return ((cosine > 0) & (upright > 0)) ? cosine : 0;
}

/// Smooth cut-off at a light's range (KHR_lights_punctual): clamp(1 - (d / range)^4, 0, 1); range 0: 1.
LX_INLINED float lx_range_factor(float distance, float range)
{
    const float ratio = distance / range, ratio2 = ratio * ratio;
    return range > 0 ? lx_clamp(1 - ratio2 * ratio2, 0, 1) : 1;
}

/// KHR_lights_punctual's angular attenuation of a spot, squared. `cosine`: between the spot's axis and the direction to the receiver.
LX_INLINED float lx_spot_factor(const lx_lamp *lamp, float cosine)
{
    const float attenuation = lx_clamp((cosine - lamp->cos_outer) * lamp->spot_scale, 0, 1);
    return attenuation * attenuation;
}

/// Factors that depend on the receiver's place as seen from a point or spot lamp's centre.
LX_INLINED float lx_lamp_factor(const lx_lamp *lamp, lx_vec3 to_lamp, float distance)
{
    return lx_range_factor(distance, lamp->light->range) * lx_spot_factor(lamp, -lx_dot(lamp->light->direction, to_lamp) / distance);
}

/// Point and spot without a radius. E = I cos(theta) / d².
LX_INLINED float lx_sample_point_lamp(const lx_lamp *lamp, const lx_receiver *r, lx_vec3 *target)
{
    const lx_vec3 to_lamp = lx_sub(lamp->light->position, r->position);
    const float distance2 = lx_dot(to_lamp, to_lamp), distance = sqrtf(distance2);
    const float irradiance = lx_lamp_factor(lamp, to_lamp, distance) * lx_receiver_cosine(r, lx_scale(to_lamp, 1 / distance)) / distance2;
    *target = lamp->light->position;
    return distance > 0 ? irradiance : 0;
}

/// Point and spot with one: a sphere of radiance I / (pi r²), sampled by its visible cap ([PBR4] 6.2.4).
LX_INLINED float lx_sample_sphere_lamp(const lx_lamp *lamp, const lx_receiver *r, lx_vec2 u, lx_vec3 *target)
{
    const lx_vec3 to_centre = lx_sub(lamp->light->position, r->position);
    const float distance2 = lx_dot(to_centre, to_centre), distance = sqrtf(distance2), radius = lamp->light->radius, radius2 = radius * radius;
    const float sine2 = radius2 / distance2; // of the cap's half angle
    const float one_minus_cos = sine2 / (1 + sqrtf(lx_max(0, 1 - sine2)));
    const lx_vec3 local = lx_sample_cone(u, one_minus_cos);
    const lx_vec3 direction = lx_to_world(lx_scale(to_centre, 1 / distance), local);
    // The near side of the sphere along the direction.
    const float across2 = distance2 * lx_max(0, 1 - local.z * local.z);
    *target = lx_mad(r->position, direction, distance * local.z - sqrtf(lx_max(0, radius2 - across2)));
    const float irradiance = lx_lamp_factor(lamp, to_centre, distance) * lx_receiver_cosine(r, direction) * (2 * one_minus_cos / radius2);
    return distance > radius ? irradiance : 0;
}

/// E = illuminance · cos; with an angular diameter a disk of radiance E / (pi sin²(angle / 2)).
LX_INLINED float lx_sample_sun(const lx_lamp *lamp, const lx_receiver *r, lx_vec2 u, lx_vec3 *direction)
{
    *direction = lx_to_world(lx_neg(lamp->light->direction), lx_sample_cone(u, lamp->one_minus_cos));
    return lx_receiver_cosine(r, *direction) * lamp->factor;
}

/// How a rectangle or disk is seen from a receiver.
typedef struct lx_area_view {
    lx_vec3 corner;      ///< Relative to the receiver, along the lamp's axes and its front's normal.
    float factor;        ///< Range; 0: nothing arrives.
    lx_spherical_rectangle rectangle; ///< solid_angle 0: sampled by area.
} lx_area_view;

lx_area_view lx_area_view_of(const lx_lamp *lamp, const lx_receiver *r);

/// One-sided rectangle or disk of unit radiance.
LX_INLINED float lx_sample_area_lamp(const lx_lamp *lamp, const lx_area_view *view, const lx_receiver *r, lx_vec2 u, lx_vec3 *target)
{
    const bool is_disk = lamp->light->kind == LX_LIGHT_DISK, by_area = view->rectangle.solid_angle == 0;
    lx_vec2 place; // on the lamp, from its centre, in half edges
    if (by_area) {
        place = is_disk ? lx_sample_disk(u) : (lx_vec2){2 * u.x - 1, 2 * u.y - 1};
    } else {
        const lx_vec3 p = lx_sample_spherical_rectangle(&view->rectangle, u);
        place = (lx_vec2){(p.x - view->corner.x) / lamp->half_width - 1, (p.y - view->corner.y) / lamp->half_depth - 1};
    }
    *target = lx_add(lamp->light->position, lx_add(lx_scale(lamp->light->axis_x, place.x), lx_scale(lamp->light->axis_y, place.y)));
    const lx_vec3 to_target = lx_sub(*target, r->position);
    const float distance = lx_length(to_target);
    const float area = (is_disk ? LX_PI : 4) * lamp->half_width * lamp->half_depth;
    // 1 / pdf_solid_angle, or by area with the cosine at the lamp.
    const float density = by_area ? area * (view->corner.z / distance) / (distance * distance) : view->rectangle.solid_angle;
    const float irradiance = view->factor * lx_receiver_cosine(r, lx_scale(to_target, 1 / distance)) * density;
    return view->factor == 0 || (is_disk && !by_area && lx_dot2(place, place) > 1) ? 0 : irradiance;
}

#endif
