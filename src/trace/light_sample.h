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

/// Is the source so small, seen from where rays start, that samples alone bring its light? A matter of the source and the place.
bool lx_has_samples_alone(const lx_tracer *tracer, uint32_t source, lx_vec3 origin);
/// Certainly so, whatever lies at least `nearest` metres from its sphere.
bool lx_source_is_small(const lx_tracer *tracer, uint32_t source, float nearest);

/// A cheap upper estimate of the irradiance that a source of strength 1 can give a receiver: 0 if it certainly gives none (below the horizon, outside
/// the cone or the range, behind a one-sided lamp), infinity if nothing is known. Within the source's own bounds it is infinity too.
float lx_source_bound(const lx_tracer *tracer, uint32_t source, const lx_receiver *receiver);

enum { lx_source_most_effort = 64 };
/// How many times the usual samples a place deserves: more than 1, up to lx_source_most_effort, beside a small lamp, where its light is hundreds of times its mean in the scene
/// and a few luxels hold most of a picture's error. A power of 4. A matter of the source and the place.
uint32_t lx_source_effort(const lx_tracer *tracer, uint32_t source, lx_vec3 place);

/// Roulette on light samples: what brings less than `scale` is looked at with that probability and weighs accordingly more, so the expectation stays.
/// Depends on the path (stream, sample) and its source (key) alone, never on other sources. 1 / probability; 0: skipped.
float lx_light_roulette(uint32_t stream, uint32_t sample, uint32_t key, float brings, float scale);

/// Weight of an emissive hit found by a cosine-weighted ray from `receiver`, against `count` samples of lx_sample_source. `cosine`: of the
/// ray at the receiver.
float lx_hit_weight(const lx_tracer *tracer, const lx_ray *ray, const lx_hit *hit, lx_vec3 hit_normal, float cosine, uint32_t count);
/// The same for a ray that left the scene, against one sample. `direction` is unit. A uniform sky: 1.
float lx_sky_weight(const lx_tracer *tracer, lx_vec3 direction, float cosine);

/// The power heuristic of Veach 1997, section 9.2.4.
LX_INLINED float lx_power_heuristic(float pdf_a, float pdf_b)
{
    const float a = pdf_a * pdf_a, b = pdf_b * pdf_b;
    return ((a + b > 0) & (a < INFINITY)) ? a / (a + b) : 1;
}

#endif
