// Rays per second of the path integrator over Embree's raw throughput on the same rays.
//
// The linker wraps the two entry points of the accelerator (--wrap), so that one pass of the integrator records every ray it asks for, in order
// and with its batches; nothing in the product knows of it. The raw side replays them against a scene of bare triangles without filters,
// shadow rays by rtcOccluded1M and closest hits by rtcIntersect1, and keeps nothing but the hits. One thread on both sides.
#include "bake/bake.h"
#include "base/clock.h"
#include "base/error.h"
#include "trace/accel.h"

#include <embree3/rtcore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct recording {
    struct RTCRay *rays;
    size_t count, capacity;
} recording;

static recording closest, shadow;
static bool is_recording;

static void record(recording *r, const lx_ray *rays, size_t count)
{
    if (!is_recording) return;
    if (!lx_array_reserve(&r->rays, &r->capacity, r->count + count, sizeof *r->rays)) abort();
    for (size_t i = 0; i < count; ++i)
        r->rays[r->count++] = (struct RTCRay){.org_x = rays[i].origin.x, .org_y = rays[i].origin.y, .org_z = rays[i].origin.z,
                                              .tnear = rays[i].t_min, .dir_x = rays[i].direction.x, .dir_y = rays[i].direction.y,
                                              .dir_z = rays[i].direction.z, .tfar = rays[i].t_max, .mask = 0xffffffffu};
}

void __real_lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count);
void __real_lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count);
void __wrap_lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count);
void __wrap_lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count);

void __wrap_lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count)
{
    record(&closest, rays, count);
    __real_lx_accel_closest(accel, rays, hits, count);
}

void __wrap_lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count)
{
    record(&shadow, rays, count);
    __real_lx_accel_transmittance(accel, rays, transmittance, count);
}

static RTCScene bare_scene(RTCDevice device, const lx_scene *scene)
{
    RTCScene out = rtcNewScene(device);
    rtcSetSceneFlags(out, RTC_SCENE_FLAG_ROBUST);
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const lx_primitive *p = &scene->primitives[scene->surfaces[s].primitive];
        if (!scene->instances[scene->surfaces[s].instance].is_static || p->triangle_count == 0) continue;
        RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
        float *vertices = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, p->vertex_count);
        uint32_t *indices = rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, p->triangle_count);
        const lx_mat4 transform = scene->instances[scene->surfaces[s].instance].transform;
        for (uint32_t v = 0; v < p->vertex_count; ++v) {
            const lx_vec3 world = lx_mat4_point(transform, p->positions[v]);
            memcpy(vertices + 3 * (size_t)v, &world, sizeof world);
        }
        memcpy(indices, p->indices, 12 * (size_t)p->triangle_count);
        rtcCommitGeometry(g);
        rtcAttachGeometry(out, g);
        rtcReleaseGeometry(g);
    }
    rtcCommitScene(out);
    return out;
}

// Best of three.
static double replay(RTCScene scene)
{
    double best = INFINITY;
    enum { batch = 256 };
    for (int run = 0; run < 3; ++run) {
        struct RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        const double start = lx_seconds();
        for (size_t i = 0; i < closest.count; ++i) {
            struct RTCRayHit query = {.ray = closest.rays[i]};
            query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
            rtcIntersect1(scene, &context, &query);
        }
        for (size_t i = 0; i < shadow.count; i += batch) {
            const size_t n = shadow.count - i < batch ? shadow.count - i : batch;
            struct RTCRay rays[batch];
            memcpy(rays, shadow.rays + i, n * sizeof *rays);
            rtcOccluded1M(scene, &context, rays, (unsigned)n, sizeof *rays);
        }
        const double seconds = lx_seconds() - start;
        if (seconds < best) best = seconds;
    }
    return best;
}

static lx_result bake_once(lx_scene *scene, lx_atlas *atlas, const lx_bake_desc *desc, lx_bake_summary *out, lx_error *error)
{
    lx_bake *bake = NULL;
    lx_result result = lx_bake_create(scene, atlas, desc, &bake, error);
    if (result == LX_OK) result = lx_bake_run(bake, NULL, error);
    if (result == LX_OK) lx_bake_get_summary(bake, out);
    lx_bake_destroy(bake);
    return result;
}

static void silent(void *user, lx_log_level level, const char *message)
{
    (void)user;
    (void)level;
    (void)message;
}

int main(int argc, char **argv)
{
    if (argc < 2) {
        fprintf(stderr, "usage: path_rays SCENE [PAGE_SIZE [SAMPLES]]\n");
        return 2;
    }
    lx_result result = LX_OK;
    lx_error error = {0};
    lx_context *context = NULL;
    lx_scene *scene = NULL;
    lx_atlas *atlas = NULL;
    lx_context_desc context_desc = lx_context_desc_default();
    context_desc.thread_count = 1;
    context_desc.logger.func = silent;
    lx_atlas_desc atlas_desc = lx_atlas_desc_default();
    atlas_desc.page_size = argc > 2 ? (uint32_t)atoi(argv[2]) : 128;
    lx_bake_desc desc = lx_bake_desc_default();
    desc.samples = argc > 3 ? (uint32_t)atoi(argv[3]) : 16;
    LX_TRY(lx_context_create(&context_desc, &context, &error));
    LX_TRY(lx_scene_load(context, argv[1], NULL, &scene, &error));
    LX_TRY(lx_atlas_build(scene, &atlas_desc, NULL, &atlas, &error));
    lx_flush_denormals();
    lx_bake_summary best = {.seconds = INFINITY};
    for (int run = 0; run < 3; ++run) {
        lx_bake_summary s;
        LX_TRY(bake_once(scene, atlas, &desc, &s, &error));
        if (s.seconds < best.seconds) best = s;
    }
    is_recording = true;
    lx_bake_summary recorded;
    LX_TRY(bake_once(scene, atlas, &desc, &recorded, &error));
    is_recording = false;
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene bare = bare_scene(device, scene);
    const double raw = replay(bare);
    const double rays = (double)(closest.count + shadow.count);
    printf("{\"rays\": %.0f, \"closest\": %zu, \"shadow\": %zu, \"integrator_s\": %.4f, \"embree_s\": %.4f, "
           "\"integrator_mrays_per_s\": %.3f, \"embree_mrays_per_s\": %.3f, \"ratio\": %.4f}\n",
           rays, closest.count, shadow.count, best.seconds, raw, rays / best.seconds * 1e-6, rays / raw * 1e-6, raw / best.seconds);
    rtcReleaseScene(bare);
    rtcReleaseDevice(device);
cleanup:
    if (result != LX_OK) fprintf(stderr, "path_rays: %s\n", error.message);
    free(closest.rays);
    free(shadow.rays);
    lx_atlas_destroy(atlas);
    lx_scene_destroy(scene);
    lx_context_destroy(context);
    return result == LX_OK ? 0 : 1;
}
