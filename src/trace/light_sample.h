/// Light from one source at one point: next-event estimation.
#ifndef LX_TRACE_LIGHT_SAMPLE_H
#define LX_TRACE_LIGHT_SAMPLE_H

#include "trace/light_tree.h"
#include "trace/tracer.h"

/// One sample of the irradiance that source `source` (of strength 1 and white colour) would give without occluders, and the shadow ray
/// that decides. Range, spot cone, receiver's cosine, 1/pdf and, for sources that rays can hit (emissive surfaces, pictures of
/// skies), the power-heuristic weight against cosine-weighted rays are in it; `count`: how many such samples share the work against one ray
/// (the caller averages them); 0: no ray meets the source, samples bring all its light. `out_cell`: of the sampled point, see lx_tracer_cell_at. False: nothing arrives, no ray.
/// A uniform sky has no samples here: the ray that goes on from a vertex meets it just as well.
bool lx_sample_source(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                      lx_rgb *out_irradiance, uint32_t *out_cell);

/// The same estimate, cheaper and noisier: where samples bring all light of an emissive source, its triangles are chosen by their power, wherever they face. For
/// receivers that count little.
bool lx_sample_source_by_power(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray,
                               lx_rgb *out_irradiance, uint32_t *out_cell);

enum { lx_view_receivers = 16 };

/// What many samples of one source from receivers close together share.
typedef struct lx_source_view {
    const lx_tracer *tracer;
    uint32_t source;
    const lx_receiver *receivers;
    bool dark;      ///< Certainly nothing reaches any of them.
    bool has_table; ///< `table` and `alone` hold.
    bool alone[lx_view_receivers]; ///< Samples bring all light; else hits have a share of it.
    lx_light_table table;
} lx_source_view;

/// Does a view of the source differ from asking it each time?
bool lx_source_has_views(const lx_tracer *tracer, uint32_t source);
/// Looks at a source from `count` receivers, at most lx_view_receivers. Worth it for a dozen samples or more.
void lx_source_view_fill(lx_source_view *view, const lx_tracer *tracer, uint32_t source, const lx_receiver *receivers, uint32_t count);
/// The same estimate as lx_sample_source by other samples, of a receiver that the view was filled with.
bool lx_source_view_sample(const lx_source_view *view, uint32_t receiver, lx_vec2 u, uint32_t count, lx_ray *out_ray, lx_rgb *out_irradiance,
                           uint32_t *out_cell);

/// A cheap upper estimate of the irradiance that a source of strength 1 can give a receiver: 0 if it certainly gives none (below the horizon, outside
/// the cone or the range, behind a one-sided lamp), infinity if nothing is known. Within the source's own bounds it is infinity too.
float lx_source_bound(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver);

/// Roulette on light samples: what brings less than `scale` is looked at with that probability and weighs accordingly more, so the expectation stays.
/// Depends on the path (stream, sample) and its source (key) alone, never on other sources. 1 / probability; 0: skipped.
float lx_light_roulette(uint32_t stream, uint32_t sample, uint32_t key, float brings, float scale);

/// Weight of an emissive hit found by a cosine-weighted ray from `receiver`, against `count` samples of lx_sample_source. `cosine`: of the
/// ray at the receiver.
float lx_hit_weight(const lx_tracer *tracer, const lx_ray *ray, const lx_hit *hit, lx_vec3 hit_normal, float cosine, uint32_t count);
/// The same for a ray that left the scene, against one sample. `direction` is unit. A uniform sky: 1.
float lx_sky_weight(const lx_tracer *tracer, lx_vec3 direction, float cosine);

/// Smooth cut-off at a light's range (KHR_lights_punctual): clamp(1 - (d / range)^4, 0, 1); range 0: 1.
float lx_range_factor(float distance, float range);
/// KHR_lights_punctual's angular attenuation of a spot, squared. `cosine`: between the spot's axis and the direction to the receiver.
float lx_spot_factor(const lx_light *light, float cosine);

#endif
