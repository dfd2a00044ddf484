// Rays against a soup of triangles and its mirror image: batches of any size find the same, bit for bit; sides are told right.
#include "trace/tracer.h"
#include "math/hash.h"
#include "unit/scene_fixture.h"

enum { triangles = 200, rays = 1000 };

// Three numbers in [0, 1), one place after the other.
static lx_vec3 next_three(uint32_t *n)
{
    float v[3];
    for (int k = 0; k < 3; ++k) v[k] = lx_unit_float(lx_hash32(++*n * 2 + 1));
    return (lx_vec3){v[0], v[1], v[2]};
}

static lx_tracer *make_soup(lx_scene **scene)
{
    bin_clear();
    for (uint32_t t = 0, n = 0; t < triangles; ++t) {
        const lx_vec3 centre = next_three(&n);
        for (int k = 0; k < 3; ++k) {
            const lx_vec3 d = lx_sub(next_three(&n), (lx_vec3){0.5f, 0.5f, 0.5f});
            BIN_FLOATS(centre.x + 0.3f * d.x, centre.y + 0.3f * d.y, centre.z + 0.3f * d.z);
        }
    }
    *scene = import_members("'bufferViews':[{'buffer':0,'byteLength':7200}],'accessors':[{'bufferView':0,'componentType':5126,'count':600,'type':'VEC3'}],"
                            "'meshes':[{'primitives':[{'attributes':{'POSITION':0}}]}],'nodes':[{'mesh':0},{'mesh':0,'scale':[-1,1,1]}]");
    const lx_transport_desc transport = {.seed = 1};
    lx_tracer *tracer;
    assert_int_equal(lx_tracer_create(*scene, &transport, false, NULL, &tracer, NULL), LX_OK);
    return tracer;
}

static void make_rays(lx_ray *out)
{
    for (uint32_t i = 0, n = 1u << 20; i < rays; ++i) {
        const lx_vec3 a = next_three(&n), b = next_three(&n);
        const lx_vec3 from = {3 * a.x - 1.5f, 2 * a.y - 0.5f, 2 * a.z - 0.5f}, to = {2 * b.x - 1, b.y, b.z};
        out[i] = (lx_ray){.origin = from, .direction = lx_sub(to, from), .t_max = INFINITY};
    }
}

static void batches_of_any_size_find_the_same_hits(void **state)
{
    (void)state;
    lx_scene *scene;
    lx_tracer *tracer = make_soup(&scene);
    static lx_ray all[rays];
    static lx_hit whole[rays], parts[rays];
    make_rays(all);
    lx_trace_closest(tracer, all, whole, rays);
    static const size_t sizes[] = {1, 3, 8, 13, 500};
    for (size_t k = 0; k < sizeof sizes / sizeof *sizes; ++k) {
        for (size_t i = 0; i < rays; i += sizes[k]) lx_trace_closest(tracer, all + i, parts + i, rays - i < sizes[k] ? rays - i : sizes[k]);
        for (size_t i = 0; i < rays; ++i) {
            assert_int_equal(parts[i].surface, whole[i].surface);
            if (whole[i].surface == LX_MISS) continue;
            assert_int_equal(parts[i].triangle, whole[i].triangle);
            assert_true(parts[i].t == whole[i].t && parts[i].u == whole[i].u && parts[i].v == whole[i].v);
            assert_int_equal(parts[i].back, whole[i].back);
        }
    }
    lx_tracer_destroy(tracer);
    lx_scene_destroy(scene);
}

static void hits_tell_the_back_side_in_mirrored_instances_too(void **state)
{
    (void)state;
    lx_scene *scene;
    lx_tracer *tracer = make_soup(&scene);
    static lx_ray all[rays];
    static lx_hit hits[rays];
    make_rays(all);
    lx_trace_closest(tracer, all, hits, rays);
    uint32_t seen[2][2] = {{0}};
    for (size_t i = 0; i < rays; ++i) {
        if (hits[i].surface == LX_MISS) continue;
        lx_vec3 position, normal;
        lx_hit_geometry(tracer, &hits[i], &position, &normal);
        const float along = lx_dot(normal, all[i].direction);
        if (fabsf(along) < 1e-4f) continue; // grazing: rounding decides
        assert_int_equal(hits[i].back, along > 0);
        ++seen[hits[i].surface][hits[i].back];
    }
    for (int k = 0; k < 4; ++k) assert_true(seen[k / 2][k % 2] > 50);
    lx_tracer_destroy(tracer);
    lx_scene_destroy(scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(batches_of_any_size_find_the_same_hits),
        cmocka_unit_test(hits_tell_the_back_side_in_mirrored_instances_too),
    };
    return cmocka_run_group_tests(tests, fixture_setup, fixture_teardown);
}
