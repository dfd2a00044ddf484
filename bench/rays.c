// Rays per second of an integrator over Embree's raw throughput on the same rays.
//
// Of the gather integrator its whole final gather counts (all rounds, with everything that is done with the rays), of the path integrator all of tracing.
// The linker wraps the two entry points of the accelerator and the runs of the thread pool (--wrap), so that one bake records every ray its stage asks for, in order,
// and the others are timed; nothing in the product knows of it. The raw side replays the rays against a scene of bare triangles without filters and keeps nothing
// but the hits, by each entry point that Embree has; the fastest counts. One thread on both sides, in turn; the ratio is the median of rounds.
#include "bake/bake.h"
#include "base/clock.h"
#include "base/error.h"
#include "base/thread.h"
#include "trace/accel.h"
#include "trace/direct.h"

#include <embree3/rtcore.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct recording {
    struct RTCRay *rays;
    size_t count, capacity;
} recording;

static recording closest, shadow;
static bool is_recording, in_stage;
static const char *stage_name;
static double stage_seconds, tracing_seconds; // the latter: of the stage, within the accelerator

static void record(recording *r, const lx_ray *rays, size_t count)
{
    if (!is_recording || !in_stage) return;
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
bool __wrap_lx_direct_light(lx_direct_batch *b, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean, float *variance);
lx_result __real_lx_pool_run(lx_pool *pool, size_t count, lx_task task, void *user, const char *stage, const lx_progress_sink *sink, lx_error *error);
lx_result __wrap_lx_pool_run(lx_pool *pool, size_t count, lx_task task, void *user, const char *stage, const lx_progress_sink *sink, lx_error *error);
lx_result __real_lx_pool_run_weighted(lx_pool *pool, size_t count, const float *weights, lx_task task, void *user, const char *stage,
                                      const lx_progress_sink *sink, lx_error *error);
lx_result __wrap_lx_pool_run_weighted(lx_pool *pool, size_t count, const float *weights, lx_task task, void *user, const char *stage,
                                      const lx_progress_sink *sink, lx_error *error);

void __wrap_lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count)
{
    record(&closest, rays, count);
    const double start = lx_seconds();
    __real_lx_accel_closest(accel, rays, hits, count);
    if (in_stage) tracing_seconds += lx_seconds() - start;
}

void __wrap_lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count)
{
    record(&shadow, rays, count);
    const double start = lx_seconds();
    __real_lx_accel_transmittance(accel, rays, transmittance, count);
    if (in_stage) tracing_seconds += lx_seconds() - start;
}

// Direct light is most of a bake, and no gather ray depends on how bright anything is: none is found, and the rows that rays read are dark.
bool __wrap_lx_direct_light(lx_direct_batch *b, const lx_direct_settings *settings, const lx_direct_tile *tile, uint32_t source, lx_rgb *mean, float *variance)
{
    (void)b;
    (void)settings;
    (void)tile;
    (void)source;
    (void)mean;
    (void)variance;
    return false;
}

static double enter(const char *stage)
{
    in_stage = stage && strcmp(stage, stage_name) == 0;
    return lx_seconds();
}

static void leave(double start)
{
    if (in_stage) stage_seconds += lx_seconds() - start;
    in_stage = false;
}

lx_result __wrap_lx_pool_run(lx_pool *pool, size_t count, lx_task task, void *user, const char *stage, const lx_progress_sink *sink, lx_error *error)
{
    const double start = enter(stage);
    const lx_result result = __real_lx_pool_run(pool, count, task, user, stage, sink, error);
    leave(start);
    return result;
}

lx_result __wrap_lx_pool_run_weighted(lx_pool *pool, size_t count, const float *weights, lx_task task, void *user, const char *stage,
                                      const lx_progress_sink *sink, lx_error *error)
{
    const double start = enter(stage);
    const lx_result result = __real_lx_pool_run_weighted(pool, count, weights, task, user, stage, sink, error);
    leave(start);
    return result;
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

// ---- Embree's entry points ----------------------------------------------------------------------------------------------------

enum { batch = 256 };

static void closest_1(RTCScene scene, struct RTCIntersectContext *context)
{
    for (size_t i = 0; i < closest.count; ++i) {
        struct RTCRayHit query = {.ray = closest.rays[i]};
        query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(scene, context, &query);
    }
}

static void closest_1m(RTCScene scene, struct RTCIntersectContext *context)
{
    struct RTCRayHit queries[batch];
    for (size_t i = 0; i < closest.count; i += batch) {
        const size_t n = closest.count - i < batch ? closest.count - i : (size_t)batch;
        for (size_t k = 0; k < n; ++k) {
            queries[k].ray = closest.rays[i + k];
            queries[k].hit.geomID = RTC_INVALID_GEOMETRY_ID;
        }
        rtcIntersect1M(scene, context, queries, (unsigned)n, sizeof *queries);
    }
}

// Packets of 8 and 16: the rays are turned into arrays of fields as they are needed; leaves out the last few.
#define PACKET(width)                                                                                                            \
    static void closest_##width(RTCScene scene, struct RTCIntersectContext *context)                                              \
    {                                                                                                                            \
        _Alignas(64) int valid[width];                                                                                            \
        for (int k = 0; k < width; ++k) valid[k] = -1;                                                                            \
        for (size_t i = 0; i + width <= closest.count; i += width) {                                                              \
            struct RTCRayHit##width query;                                                                                        \
            for (int k = 0; k < width; ++k) {                                                                                     \
                const struct RTCRay *ray = &closest.rays[i + (size_t)k];                                                          \
                query.ray.org_x[k] = ray->org_x;                                                                                  \
                query.ray.org_y[k] = ray->org_y;                                                                                  \
                query.ray.org_z[k] = ray->org_z;                                                                                  \
                query.ray.tnear[k] = ray->tnear;                                                                                  \
                query.ray.dir_x[k] = ray->dir_x;                                                                                  \
                query.ray.dir_y[k] = ray->dir_y;                                                                                  \
                query.ray.dir_z[k] = ray->dir_z;                                                                                  \
                query.ray.time[k] = 0;                                                                                            \
                query.ray.tfar[k] = ray->tfar;                                                                                    \
                query.ray.mask[k] = ray->mask;                                                                                    \
                query.ray.id[k] = 0;                                                                                              \
                query.ray.flags[k] = 0;                                                                                           \
                query.hit.geomID[k] = RTC_INVALID_GEOMETRY_ID;                                                                    \
            }                                                                                                                    \
            rtcIntersect##width(valid, scene, context, &query);                                                                   \
        }                                                                                                                        \
    }
PACKET(8)
PACKET(16)

static void shadow_1(RTCScene scene, struct RTCIntersectContext *context)
{
    for (size_t i = 0; i < shadow.count; ++i) {
        struct RTCRay ray = shadow.rays[i];
        rtcOccluded1(scene, context, &ray);
    }
}

static void shadow_1m(RTCScene scene, struct RTCIntersectContext *context)
{
    for (size_t i = 0; i < shadow.count; i += batch) {
        const size_t n = shadow.count - i < batch ? shadow.count - i : (size_t)batch;
        struct RTCRay rays[batch];
        memcpy(rays, shadow.rays + i, n * sizeof *rays);
        rtcOccluded1M(scene, context, rays, (unsigned)n, sizeof *rays);
    }
}

typedef struct entry_point {
    const char *name;
    void (*trace)(RTCScene scene, struct RTCIntersectContext *context);
    double best;
} entry_point;

static entry_point closest_points[] = {{"rtcIntersect1", closest_1, INFINITY}, {"rtcIntersect1M", closest_1m, INFINITY},
                                       {"rtcIntersect8", closest_8, INFINITY}, {"rtcIntersect16", closest_16, INFINITY}};
static entry_point shadow_points[] = {{"rtcOccluded1", shadow_1, INFINITY}, {"rtcOccluded1M", shadow_1m, INFINITY}};

// Returns the seconds of the last of them.
static double replay(RTCScene scene, entry_point *points, size_t count)
{
    double seconds = 0;
    for (size_t k = 0; k < count; ++k) {
        struct RTCIntersectContext context;
        rtcInitIntersectContext(&context);
        const double start = lx_seconds();
        points[k].trace(scene, &context);
        seconds = lx_seconds() - start;
        if (seconds < points[k].best) points[k].best = seconds;
    }
    return seconds;
}

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;
    return x < y ? -1 : x > y;
}

static entry_point *fastest(entry_point *points, size_t count)
{
    entry_point *best = points;
    for (size_t k = 1; k < count; ++k)
        if (points[k].best < best->best) best = &points[k];
    return best;
}

static lx_result bake_once(lx_scene *scene, lx_atlas *atlas, const lx_bake_desc *desc, lx_error *error)
{
    lx_bake *bake = NULL;
    stage_seconds = tracing_seconds = 0;
    lx_result result = lx_bake_create(scene, atlas, desc, &bake, error);
    if (result == LX_OK) result = lx_bake_run(bake, NULL, error);
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
    if (argc < 3) {
        fprintf(stderr, "usage: bench_rays gather|path SCENE [PAGE_SIZE [SAMPLES [SKY_R SKY_G SKY_B]]]\n");
        return 2;
    }
    enum { rounds = 5, closest_count = sizeof closest_points / sizeof *closest_points, shadow_count = sizeof shadow_points / sizeof *shadow_points };
    lx_result result = LX_OK;
    lx_error error = {0};
    lx_context *context = NULL;
    lx_scene *scene = NULL;
    lx_atlas *atlas = NULL;
    RTCDevice device = NULL;
    RTCScene bare = NULL;
    lx_context_desc context_desc = lx_context_desc_default();
    context_desc.thread_count = 1;
    context_desc.logger.func = silent;
    lx_atlas_desc atlas_desc = lx_atlas_desc_default();
    atlas_desc.page_size = argc > 3 ? (uint32_t)atoi(argv[3]) : 128;
    lx_bake_desc desc = lx_bake_desc_default();
    desc.integrator = strcmp(argv[1], "path") == 0 ? LX_INTEGRATOR_PATH : LX_INTEGRATOR_GATHER;
    desc.noise = 0;
    desc.denoise = LX_DENOISE_NONE;
    if (desc.integrator == LX_INTEGRATOR_GATHER) desc.transport.bounces = LX_BOUNCES_INF;
    stage_name = desc.integrator == LX_INTEGRATOR_PATH ? "bake" : "gather";
    desc.samples = argc > 4 ? (uint32_t)atoi(argv[4]) : 16;
    for (int c = 0; c < 3 && argc > 7; ++c) desc.transport.sky.color[c] = strtof(argv[5 + c], NULL);
    LX_TRY(lx_context_create(&context_desc, &context, &error));
    LX_TRY(lx_scene_load(context, argv[2], NULL, &scene, &error));
    LX_TRY(lx_atlas_build(scene, &atlas_desc, NULL, &atlas, &error));
    lx_flush_denormals();
    is_recording = true;
    LX_TRY(bake_once(scene, atlas, &desc, &error));
    is_recording = false;
    device = rtcNewDevice("threads=1");
    bare = bare_scene(device, scene);
    replay(bare, closest_points, closest_count);
    if (shadow.count) replay(bare, shadow_points, shadow_count);
    entry_point *c = fastest(closest_points, closest_count), *s = fastest(shadow_points, shadow_count);
    double best = INFINITY, best_tracing = INFINITY, ratios[rounds];
    for (int round = 0; round < rounds; ++round) { // both sides in turn: machines are faster at times than at others
        LX_TRY(bake_once(scene, atlas, &desc, &error));
        if (stage_seconds < best) {
            best = stage_seconds;
            best_tracing = tracing_seconds;
        }
        ratios[round] = (replay(bare, c, 1) + (shadow.count ? replay(bare, s, 1) : 0)) / stage_seconds;
    }
    qsort(ratios, rounds, sizeof *ratios, compare);
    const double rays = (double)(closest.count + shadow.count), raw = c->best + (shadow.count ? s->best : 0);
    printf("{\"rays\": %.0f, \"closest\": %zu, \"shadow\": %zu, \"stage_s\": %.4f, \"tracing_s\": %.4f, \"embree_s\": %.4f, \"closest_by\": \"%s\", \"shadow_by\": \"%s\", "
           "\"stage_mrays_per_s\": %.3f, \"embree_mrays_per_s\": %.3f, \"ratio\": %.4f, \"ratios\": [%.4f, %.4f], \"embree\": {",
           rays, closest.count, shadow.count, best, best_tracing, raw, c->name, s->name, rays / best * 1e-6, rays / raw * 1e-6, ratios[rounds / 2], ratios[0], ratios[rounds - 1]);
    for (size_t k = 0; k < closest_count; ++k)
        printf("\"%s\": %.3f, ", closest_points[k].name, (double)closest.count / closest_points[k].best * 1e-6);
    for (size_t k = 0; k < shadow_count; ++k)
        printf("\"%s\": %.3f%s", shadow_points[k].name, shadow.count ? (double)shadow.count / shadow_points[k].best * 1e-6 : 0, k + 1 < shadow_count ? ", " : "}}\n");
cleanup:
    if (result != LX_OK) fprintf(stderr, "bench_rays: %s\n", error.message);
    if (bare) rtcReleaseScene(bare);
    if (device) rtcReleaseDevice(device);
    free(closest.rays);
    free(shadow.rays);
    lx_atlas_destroy(atlas);
    lx_scene_destroy(scene);
    lx_context_destroy(context);
    return result == LX_OK ? 0 : 1;
}
