#include "bake/steps.h"

void lx_steps_are_clear(void *user, const lx_luxel_step *steps, size_t count, bool *open)
{
    enum { batch = 256 };
    static const float height_texels = 0.25f; // above folds that normals within 45 degrees of each other allow, below most of what parts rooms
    const lx_step_rays *s = user;
    const lx_luxel_map *map = s->map;
    for (size_t first = 0; first < count; first += batch) {
        lx_ray rays[batch];
        lx_rgb light[batch];
        const size_t n = count - first < batch ? count - first : batch;
        for (size_t i = 0; i < n; ++i) {
            const lx_luxel_step step = steps[first + i];
            const float height = height_texels * lx_min(map->size_m[step.from], map->size_m[step.to]);
            const lx_vec3 from = lx_mad(map->position[step.from], map->normal[step.from], height);
            const lx_vec3 to = lx_mad(map->position[step.to], map->normal[step.to], height);
            rays[i] = (lx_ray){.origin = from, .direction = lx_sub(to, from), .t_max = 1};
        }
        lx_trace_transmittance(s->tracer, rays, light, n);
        // Glass parts nothing: the light on both its sides is much the same.
        for (size_t i = 0; i < n; ++i) open[first + i] = lx_rgb_max(light[i]) > 0.5f;
    }
}
