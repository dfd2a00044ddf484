// Embree 3 behind accel.h.
//
// Shadow rays go through Embree's stream entry point in batches, which runs about twice as fast as ray by ray. Closest hits go in packets of
// eight, which takes 5 to 15 % less than one by one whatever the order (longer streams gain less, sorting by direction costs more than it gains) and
// computes the same t, u and v for the same ray and triangle; the COHERENT flag does not, and is slower. The BVH has medium quality (the
// high-quality one hurts any-hit queries) and is built by one thread: its topology decides ties between triangles at equal
// distance, and the same input must give the same bits.
#include "trace/accel.h"

#include "base/error.h"
#include "base/memory.h"

#include <embree3/rtcore.h>
#include <string.h>

struct lx_accel {
    RTCDevice device;
    RTCScene scene;
    lx_accel_surface_queries queries;
    lx_accel_mesh *meshes; // for queries about what is near
    float *orientation; // [mesh] -1: mirrored
    bool any_filter;
    char isa[16];
};

enum { batch_size = 256, packet_size = 8, remembered_triangles = 12 };

// A triangle that a shadow ray has crossed.
typedef struct crossed {
    uint32_t mesh, triangle;
    float edge_t; // -1 away from edges
} crossed;

// What a shadow ray has crossed so far. Embree may report one triangle to a filter more than once (a BVH with spatial splits
// or a stream that is replayed), so triangles that were counted are remembered: apart, since most rays cross none.
typedef struct crossing {
    lx_rgb transmittance;
    uint16_t count;
    bool overflow; // more surfaces than the list holds: the ray is walked again, one closest hit at a time
} crossing;

typedef struct ray_context {
    struct RTCIntersectContext embree; // first: Embree hands a pointer to it to the filters
    const lx_accel *accel;
    crossing *crossings; // by ray id
    crossed (*seen)[remembered_triangles];
} ray_context;

// Embree hands hits and rays to filters as arrays of fields; its accessors exist for C++ only.
static unsigned hit_mesh(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const unsigned *)a->hit)[6 * a->N + i];
}

static unsigned hit_triangle(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const unsigned *)a->hit)[5 * a->N + i];
}

static float hit_u(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const float *)a->hit)[3 * a->N + i];
}

static float hit_v(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const float *)a->hit)[4 * a->N + i];
}

static float hit_t(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const float *)a->ray)[8 * a->N + i];
}

static unsigned ray_id(const struct RTCFilterFunctionNArguments *a, unsigned i)
{
    return ((const unsigned *)a->ray)[10 * a->N + i];
}

// Closest hits: lets rays through the holes of cutouts.
static void filter_closest(const struct RTCFilterFunctionNArguments *arguments)
{
    const ray_context *context = (const ray_context *)arguments->context;
    const lx_accel_surface_queries *queries = &context->accel->queries;
    for (unsigned i = 0; i < arguments->N; ++i) {
        if (arguments->valid[i] != -1) continue;
        if (queries->is_hole(queries->user, hit_mesh(arguments, i), hit_triangle(arguments, i), hit_u(arguments, i),
                             hit_v(arguments, i)))
            arguments->valid[i] = 0;
    }
}

// Returns true if the crossed triangle lets some light pass, and accounts for it. A ray through the edge that two triangles share hits
// both: within one mesh, hits on edges at the same distance are one crossing.
static bool cross(const lx_accel *accel, crossing *state, crossed seen[remembered_triangles], unsigned mesh, unsigned triangle, float u, float v, float t)
{
    const bool on_edge = lx_min(lx_min(u, v), 1 - u - v) < 0x1p-16f;
    for (uint32_t k = 0; k < state->count; ++k) {
        if (seen[k].mesh != mesh) continue;
        if (seen[k].triangle == triangle) return true;
        if (on_edge && seen[k].edge_t >= 0 && fabsf(seen[k].edge_t - t) <= 0x1p-20f * t) return true;
    }
    const lx_rgb passed = accel->queries.transmittance(accel->queries.user, mesh, triangle, u, v);
    if (lx_rgb_is_black(passed)) return false;
    if (state->count == remembered_triangles) {
        state->overflow = true;
        return true;
    }
    seen[state->count++] = (crossed){mesh, triangle, on_edge ? t : -1};
    state->transmittance = lx_rgb_mul(state->transmittance, passed);
    return true;
}

static void filter_occluded(const struct RTCFilterFunctionNArguments *arguments)
{
    const ray_context *context = (const ray_context *)arguments->context;
    for (unsigned i = 0; i < arguments->N; ++i) {
        if (arguments->valid[i] != -1) continue;
        const unsigned ray = ray_id(arguments, i);
        if (cross(context->accel, &context->crossings[ray], context->seen[ray], hit_mesh(arguments, i),
                  hit_triangle(arguments, i), hit_u(arguments, i), hit_v(arguments, i), hit_t(arguments, i)))
            arguments->valid[i] = 0;
    }
}

static lx_result fail_embree(const lx_accel *accel, lx_error *error)
{
    const enum RTCError code = rtcGetDeviceError(accel->device);
    if (code == RTC_ERROR_OUT_OF_MEMORY) return lx_fail_memory(error, "ray tracing structure");
    return lx_fail(error, LX_ERROR_BACKEND, "Embree failed with error %d", (int)code);
}

static lx_result attach_mesh(lx_accel *accel, uint32_t index, const lx_accel_mesh *mesh, lx_error *error)
{
    if (mesh->triangle_count == 0) return LX_OK;
    RTCGeometry geometry = rtcNewGeometry(accel->device, RTC_GEOMETRY_TYPE_TRIANGLE);
    if (!geometry) return fail_embree(accel, error);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, mesh->vertices, 0, sizeof(lx_vec3),
                               mesh->vertex_count);
    rtcSetSharedGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, mesh->indices, 0,
                               3 * sizeof(uint32_t), mesh->triangle_count);
    if (mesh->has_holes) rtcSetGeometryIntersectFilterFunction(geometry, filter_closest);
    if (mesh->has_holes || mesh->transmits) {
        rtcSetGeometryOccludedFilterFunction(geometry, filter_occluded);
        accel->any_filter = true;
    }
    rtcSetGeometryBuildQuality(geometry, RTC_BUILD_QUALITY_MEDIUM);
    rtcCommitGeometry(geometry);
    rtcAttachGeometryByID(accel->scene, geometry, index);
    rtcReleaseGeometry(geometry);
    return rtcGetDeviceError(accel->device) == RTC_ERROR_NONE ? LX_OK : fail_embree(accel, error);
}

static void record_isa(lx_accel *accel)
{
    // Embree tells widths, not names: 16-wide native packets mean AVX-512, 8-wide AVX or AVX2.
    const char *name = rtcGetDeviceProperty(accel->device, RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? "avx512"
                       : rtcGetDeviceProperty(accel->device, RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? "avx2"
                                                                                                      : "sse2";
    strcpy(accel->isa, name);
}

lx_result lx_accel_create(const lx_accel_mesh *meshes, uint32_t mesh_count, lx_accel_surface_queries queries,
                          const char *isa, lx_accel **out_accel, lx_error *error)
{
    lx_result result = LX_OK;
    lx_accel *accel = lx_calloc_array(1, sizeof *accel);
    if (!accel) return lx_fail_memory(error, "ray tracing structure");
    accel->queries = queries;
    accel->meshes = lx_malloc_array(mesh_count, sizeof *meshes);
    if (!accel->meshes) {
        result = lx_fail_memory(error, "ray tracing structure");
        goto cleanup;
    }
    if (mesh_count > 0) memcpy(accel->meshes, meshes, mesh_count * sizeof *meshes);
    accel->orientation = lx_calloc_array(mesh_count, sizeof *accel->orientation);
    if (!accel->orientation) {
        result = lx_fail_memory(error, "ray tracing structure");
        goto cleanup;
    }
    for (uint32_t i = 0; i < mesh_count; ++i) accel->orientation[i] = meshes[i].mirrored ? -1.0f : 1.0f;
    char config[64] = "threads=1,set_affinity=0";
    if (isa[0]) {
        strcat(config, ",isa=");
        strcat(config, isa);
    }
    accel->device = rtcNewDevice(config);
    if (!accel->device) {
        result = lx_fail(error, LX_ERROR_BACKEND, "Embree cannot start%s%s", isa[0] ? " with instruction set " : "", isa);
        goto cleanup;
    }
    record_isa(accel);
    if (isa[0]) strcpy(accel->isa, isa);
    accel->scene = rtcNewScene(accel->device);
    rtcSetSceneFlags(accel->scene, RTC_SCENE_FLAG_ROBUST); // watertight: no light through shared edges
    rtcSetSceneBuildQuality(accel->scene, RTC_BUILD_QUALITY_MEDIUM);
    for (uint32_t i = 0; i < mesh_count; ++i) LX_TRY(attach_mesh(accel, i, &meshes[i], error));
    rtcCommitScene(accel->scene);
    if (rtcGetDeviceError(accel->device) != RTC_ERROR_NONE) {
        result = fail_embree(accel, error);
        goto cleanup;
    }
    *out_accel = accel;
    accel = NULL;
cleanup:
    lx_accel_destroy(accel);
    return result;
}

void lx_accel_destroy(lx_accel *accel)
{
    if (!accel) return;
    if (accel->scene) rtcReleaseScene(accel->scene);
    if (accel->device) rtcReleaseDevice(accel->device);
    lx_free(accel->meshes);
    lx_free(accel->orientation);
    lx_free(accel);
}

const char *lx_accel_isa(const lx_accel *accel)
{
    return accel->isa;
}

static ray_context make_context(const lx_accel *accel)
{
    ray_context context = {.accel = accel};
    rtcInitIntersectContext(&context.embree);
    return context;
}

// Field by field into its place: a ray that is copied as a whole right after waits until all its fields are written.
static void set_ray(struct RTCRay *to, const lx_ray *ray, unsigned id)
{
    to->org_x = ray->origin.x;
    to->org_y = ray->origin.y;
    to->org_z = ray->origin.z;
    to->tnear = ray->t_min;
    to->dir_x = ray->direction.x;
    to->dir_y = ray->direction.y;
    to->dir_z = ray->direction.z;
    to->time = 0;
    to->tfar = ray->t_max;
    to->mask = 0xffffffffu;
    to->id = id;
    to->flags = 0;
}

// Embree's Ng follows the corners' order by the right hand, as glTF's front side does, but for mirrored instances.
static bool is_back(const lx_accel *accel, unsigned mesh, float along_normal)
{
    return along_normal * accel->orientation[mesh] >= 0;
}

static lx_hit intersect_one(const lx_accel *accel, ray_context *context, const lx_ray *ray)
{
    struct RTCRayHit query;
    set_ray(&query.ray, ray, 0);
    query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(accel->scene, &context->embree, &query);
    lx_hit hit = {.surface = query.hit.geomID, .triangle = query.hit.primID, .t = query.ray.tfar, .u = query.hit.u, .v = query.hit.v};
    if (hit.surface == LX_MISS) return hit;
    const lx_vec3 normal = {query.hit.Ng_x, query.hit.Ng_y, query.hit.Ng_z};
    hit.back = is_back(accel, hit.surface, lx_dot(normal, ray->direction));
    return hit;
}

// `count` <= packet_size rays. What is not there repeats the last ray, masked out.
static void intersect_packet(const lx_accel *accel, ray_context *context, const lx_ray *rays, lx_hit *hits, unsigned count)
{
    struct RTCRayHit8 q;
    _Alignas(32) int valid[packet_size];
    for (unsigned i = 0; i < packet_size; ++i) {
        const lx_ray *ray = &rays[i < count ? i : count - 1];
        valid[i] = i < count ? -1 : 0;
        q.ray.org_x[i] = ray->origin.x;
        q.ray.org_y[i] = ray->origin.y;
        q.ray.org_z[i] = ray->origin.z;
        q.ray.tnear[i] = ray->t_min;
        q.ray.dir_x[i] = ray->direction.x;
        q.ray.dir_y[i] = ray->direction.y;
        q.ray.dir_z[i] = ray->direction.z;
        q.ray.tfar[i] = ray->t_max;
        q.ray.time[i] = 0;
        q.ray.mask[i] = 0xffffffffu;
        q.ray.id[i] = i;
        q.ray.flags[i] = 0;
        q.hit.geomID[i] = RTC_INVALID_GEOMETRY_ID;
        q.hit.instID[0][i] = RTC_INVALID_GEOMETRY_ID;
    }
    rtcIntersect8(valid, accel->scene, &context->embree, &q);
    for (unsigned i = 0; i < count; ++i) {
        hits[i] = (lx_hit){.surface = q.hit.geomID[i], .triangle = q.hit.primID[i], .t = q.ray.tfar[i], .u = q.hit.u[i], .v = q.hit.v[i]};
        if (hits[i].surface == LX_MISS) continue;
        const lx_vec3 normal = {q.hit.Ng_x[i], q.hit.Ng_y[i], q.hit.Ng_z[i]};
        hits[i].back = is_back(accel, hits[i].surface, lx_dot(normal, rays[i].direction));
    }
}

void lx_accel_closest(const lx_accel *accel, const lx_ray *rays, lx_hit *hits, size_t count)
{
    ray_context context = make_context(accel);
    for (size_t i = 0; i < count; i += packet_size) {
        const size_t left = count - i;
        if (left == 1)
            hits[i] = intersect_one(accel, &context, &rays[i]);
        else
            intersect_packet(accel, &context, rays + i, hits + i, left < packet_size ? (unsigned)left : packet_size);
    }
}

// Exact for any number of surfaces: one closest hit after the other.
static lx_rgb walk_transmittance(const lx_accel *accel, lx_ray ray)
{
    ray_context context = make_context(accel);
    lx_rgb product = {1, 1, 1};
    lx_hit last = {.surface = LX_MISS};
    for (;;) {
        const lx_hit hit = intersect_one(accel, &context, &ray);
        if (hit.surface == LX_MISS) return product;
        if (hit.surface != last.surface || hit.triangle != last.triangle) {
            product = lx_rgb_mul(product, accel->queries.transmittance(accel->queries.user, hit.surface, hit.triangle, hit.u, hit.v));
            if (lx_rgb_is_black(product)) return product;
        }
        last = hit;
        lx_ray_step_past(&ray, &hit);
    }
}

void lx_accel_transmittance(const lx_accel *accel, const lx_ray *rays, lx_rgb *transmittance, size_t count)
{
    crossing crossings[batch_size];
    crossed seen[batch_size][remembered_triangles];
    struct RTCRay queries[batch_size];
    for (size_t first = 0; first < count; first += batch_size) {
        const size_t batch = count - first < batch_size ? count - first : (size_t)batch_size;
        for (size_t i = 0; i < batch; ++i) set_ray(&queries[i], &rays[first + i], (unsigned)i);
        for (size_t i = 0; accel->any_filter && i < batch; ++i) crossings[i] = (crossing){.transmittance = {1, 1, 1}};
        ray_context context = make_context(accel);
        context.crossings = crossings;
        context.seen = seen;
        rtcOccluded1M(accel->scene, &context.embree, queries, (unsigned)batch, sizeof(struct RTCRay));
        for (size_t i = 0; i < batch; ++i) {
            if (queries[i].tfar < 0)
                transmittance[first + i] = (lx_rgb){0, 0, 0};
            else if (!accel->any_filter)
                transmittance[first + i] = (lx_rgb){1, 1, 1};
            else if (crossings[i].overflow)
                transmittance[first + i] = walk_transmittance(accel, rays[first + i]);
            else
                transmittance[first + i] = crossings[i].transmittance;
        }
    }
}

// ---- what is near -----------------------------------------------------------------------------------------------------------

// Closest point of a triangle. Based on: [Ericson2005] Christer Ericson, "Real-Time Collision Detection", 5.1.5.
static lx_vec3 closest_point(lx_vec3 p, const lx_vec3 corner[3])
{
    const lx_vec3 a = corner[0], b = corner[1], c = corner[2], ab = lx_sub(b, a), ac = lx_sub(c, a);
    const lx_vec3 ap = lx_sub(p, a), bp = lx_sub(p, b), cp = lx_sub(p, c);
    const float d1 = lx_dot(ab, ap), d2 = lx_dot(ac, ap), d3 = lx_dot(ab, bp), d4 = lx_dot(ac, bp), d5 = lx_dot(ab, cp), d6 = lx_dot(ac, cp);
    if (d1 <= 0 && d2 <= 0) return a;
    if (d3 >= 0 && d4 <= d3) return b;
    if (d6 >= 0 && d5 <= d6) return c;
    const float va = d3 * d6 - d5 * d4, vb = d5 * d2 - d1 * d6, vc = d1 * d4 - d3 * d2;
    if (vc <= 0 && d1 >= 0 && d3 <= 0) return lx_mad(a, ab, d1 / (d1 - d3));
    if (vb <= 0 && d2 >= 0 && d6 <= 0) return lx_mad(a, ac, d2 / (d2 - d6));
    if (va <= 0 && d4 >= d3 && d5 >= d6) return lx_mad(b, lx_sub(c, b), (d4 - d3) / ((d4 - d3) + (d5 - d6)));
    const float sum = va + vb + vc;
    return lx_mad(lx_mad(a, ab, vb / sum), ac, vc / sum);
}

typedef struct near_query {
    const lx_accel *accel;
    const lx_patch *patch;
    float radius, slack; // slack: what still counts as touching
    bool crowded;
} near_query;

// Does the triangle rise over the patch, close to it, with a part of the patch behind it (a solid's), or if it has two fronts on both of its sides? Of such sheets those that
// hang over the patch do as well: where they end nothing else tells, as the sides of a solid do.
static bool crowds(const near_query *q, const lx_accel_mesh *mesh, unsigned triangle)
{
    const lx_patch *patch = q->patch;
    lx_vec3 corner[3];
    float rise = -INFINITY, low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        corner[i] = mesh->vertices[mesh->indices[3 * (size_t)triangle + (size_t)i]];
        rise = lx_max(rise, lx_dot(lx_sub(corner[i], patch->centre), patch->normal));
    }
    if (rise <= q->slack) return false;
    const lx_vec3 normal = lx_normalize_or(lx_cross(lx_sub(corner[1], corner[0]), lx_sub(corner[2], corner[0])), (lx_vec3){0, 0, 0});
    for (uint32_t i = 0; i < patch->corner_count; ++i) {
        const float d = lx_dot(lx_sub(patch->corners[i], corner[0]), normal) * (mesh->front == 0 ? 1 : mesh->front);
        low = lx_min(low, d);
        high = lx_max(high, d);
    }
    const bool sheet = mesh->front == 0, hangs = sheet && fabsf(lx_dot(normal, patch->normal)) > 0.5f;
    if (!hangs && (!(low < -q->slack) || (sheet && !(high > q->slack)))) return false;
    return lx_distance(closest_point(patch->centre, corner), patch->centre) <= q->radius;
}

static bool visit_near(struct RTCPointQueryFunctionArguments *arguments)
{
    near_query *q = arguments->userPtr;
    if (q->crowded || !crowds(q, &q->accel->meshes[arguments->geomID], arguments->primID)) return false;
    q->crowded = true;
    arguments->query->radius = 0; // nothing more to find
    return true;
}

bool lx_accel_crowded(const lx_accel *accel, const lx_patch *patches, size_t count)
{
    for (size_t i = 0; i < count; ++i) {
        const lx_patch *patch = &patches[i];
        near_query q = {.accel = accel, .patch = patch};
        for (uint32_t k = 0; k < patch->corner_count; ++k) q.radius = lx_max(q.radius, lx_distance(patch->corners[k], patch->centre));
        q.slack = 1e-3f * q.radius + 1e-6f * lx_max_abs(patch->centre);
        q.radius += q.slack;
        struct RTCPointQuery query = {.x = patch->centre.x, .y = patch->centre.y, .z = patch->centre.z, .radius = q.radius};
        struct RTCPointQueryContext context;
        rtcInitPointQueryContext(&context);
        rtcPointQuery(accel->scene, &query, &context, visit_near, &q);
        if (q.crowded) return true;
    }
    return false;
}
