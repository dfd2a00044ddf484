// Direct light of a tile against brute force: every kind of source, half of the tile under a shade.
#include "trace/direct.h"
#include "trace/light_sample.h"
#include "trace/sampling.h"
#include "trace/source_view.h"
#include "trace/tracer_data.h"
#include "math/sobol.h"
#include "unit/scene_fixture.h"

enum { edge = 10, luxels = edge * edge, samples = 64, brute_samples = 16 * 200, most_cells = 6, sky_cell_count = 16 };

// Two squares, one of them with texture coordinates (a monitor needs them); a lamp of every kind above or beside the tile.
static const char members[] =
    "'bufferViews':[{'buffer':0,'byteLength':48},{'buffer':0,'byteOffset':48,'byteLength':32},{'buffer':0,'byteOffset':80,'byteLength':60}],"
    "'accessors':[{'bufferView':0,'componentType':5126,'count':4,'type':'VEC3'},{'bufferView':1,'componentType':5126,'count':4,'type':'VEC2'},"
    "{'bufferView':2,'componentType':5123,'count':6,'type':'SCALAR'},"
    "{'bufferView':2,'componentType':5123,'count':30,'type':'SCALAR'}],"
    "'meshes':[{'primitives':[{'attributes':{'POSITION':0},'indices':2,'material':0}]},"
    "{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_0':1},'indices':2,'material':1}]},"
    "{'primitives':[{'attributes':{'POSITION':0,'TEXCOORD_0':1},'indices':2,'material':2}]},"
    "{'primitives':[{'attributes':{'POSITION':0},'indices':2,'material':3}]},"
    "{'primitives':[{'attributes':{'POSITION':0},'indices':3,'material':1}]}],"
    "'materials':[{'doubleSided':true},{'emissiveFactor':[1,1,1]},{'emissiveFactor':[1,1,1],'extras':{'luxel_monitor':'3x2'}},"
    "{'alphaMode':'BLEND','doubleSided':true,'pbrMetallicRoughness':{'baseColorFactor':[1,1,1,0.25]}}],"
    "'extensionsUsed':['KHR_lights_punctual'],'extensions':{'KHR_lights_punctual':{'lights':[{'type':'point'},{'type':'directional'}]}},"
    "'nodes':[{'name':'shade','mesh':0,'rotation':[0.70710678,0,0,0.70710678],'translation':[1,1,-1.5],'scale':[1,1.5,1]},"
    "{'name':'veil','mesh':3,'rotation':[0.70710678,0,0,0.70710678],'translation':[1,1.2,1.5],'scale':[1,1.5,1]},"
    "{'name':'bulb','extensions':{'KHR_lights_punctual':{'light':0}},'translation':[-0.4,2,0]},"
    "{'name':'globe','extensions':{'KHR_lights_punctual':{'light':0}},'translation':[0.3,2,0],'extras':{'luxel_radius':0.3}},"
    "{'name':'sun','extensions':{'KHR_lights_punctual':{'light':1}},'rotation':[-0.65,0.1,0,0.75]},"
    "{'name':'panel','translation':[0,2,0],'rotation':[-0.70710678,0,0,0.70710678],'extras':{'luxel_area':'rect 1 0.5'}},"
    "{'name':'dish','translation':[0,1.5,0],'rotation':[-0.70710678,0,0,0.70710678],'extras':{'luxel_area':'disk 0.4'}},"
    "{'name':'glow','mesh':1,'rotation':[0.70710678,0,0,0.70710678],'translation':[0,2.5,0],'scale':[0.5,0.25,1]},"
    "{'name':'swarm','mesh':4,'rotation':[0.70710678,0,0,0.70710678],'translation':[0.2,2.1,0],'scale':[0.08,0.08,1]},"
    "{'name':'screen','mesh':2,'rotation':[0,0.70710678,0,0.70710678],'translation':[-2,1,0]},"
    "{'name':'below','translation':[0,-1,0],'extensions':{'KHR_lights_punctual':{'light':0}}}]";

typedef struct fixture {
    lx_scene *scene;
    lx_tracer *tracer;
    lx_direct_batch *batch;
    lx_receiver sites[luxels * lx_direct_sites];
    uint16_t place[luxels];
    uint32_t chart[luxels], stream[luxels];
    lx_sky_cells sky_cells[luxels];
    lx_direct_tile tile;
} fixture;

static void begin(fixture *f, uint32_t seed)
{
    bin_clear();
    BIN_FLOATS(-1, -1, 0, 1, -1, 0, 1, 1, 0, -1, 1, 0);
    BIN_FLOATS(0, 1, 1, 1, 1, 0, 0, 0);
    for (int k = 0; k < 5; ++k) BIN_U16(0, 1, 2, 0, 2, 3);
    *f = (fixture){.scene = import_members(members)};
    bool *cells = calloc(f->scene->source_count, sizeof *cells);
    for (uint32_t i = 0; i < f->scene->source_count; ++i) cells[i] = f->scene->sources[i].columns > 0;
    const lx_transport_desc transport = {.bounces = 0, .seed = 1, .sky = {.color = {1, 1, 1}, .intensity = 1}};
    assert_int_equal(lx_tracer_create(f->scene, &transport, false, cells, &f->tracer, NULL), LX_OK);
    free(cells);
    f->batch = lx_direct_batch_create(f->tracer);
    assert_non_null(f->batch);
    for (uint32_t i = 0; i < luxels; ++i) {
        f->place[i] = (uint16_t)(i / edge * 32 + i % edge);
        f->stream[i] = lx_hash_combine(seed, i);
        f->sky_cells[i] = (lx_sky_cells){lx_hash32(i), lx_hash32(i + 1000)}; // some of each kind, some of none
        for (uint32_t s = 0; s < lx_direct_sites; ++s) { // 4 × 4 in luxels of 0.4 m
            const float x = ((float)(i % edge) + ((float)(s % 4) + 0.5f) / 4) * 0.4f - 2;
            const float z = ((float)(i / edge) + ((float)(s / 4) + 0.5f) / 4) * 0.4f - 2;
            f->sites[i * lx_direct_sites + s] = (lx_receiver){.position = {x, 0, z}, .normal = {0, 1, 0}, .geometric_normal = {0, 1, 0}};
        }
    }
    f->tile = (lx_direct_tile){.count = luxels, .place = f->place, .chart = f->chart, .stream = f->stream, .sites = f->sites,
                             .sky_cells = f->sky_cells, .sky_cell_count = sky_cell_count};
}

static void end(fixture *f)
{
    lx_direct_batch_destroy(f->batch);
    lx_tracer_destroy(f->tracer);
    lx_scene_destroy(f->scene);
}

static uint32_t source_number(const fixture *f, const char *name)
{
    if (strcmp(name, "sky") == 0) return f->scene->source_count;
    return (uint32_t)(source_named(f->scene, name) - f->scene->sources);
}

// One cosine-weighted look at a uniform sky: samples have their share of it, gather rays the rest.
static lx_ray look_at_sky(const fixture *f, uint32_t luxel, const lx_receiver *site, lx_vec2 u, float *light)
{
    *light = LX_PI * lx_sky_samples_share(lx_sky_per_ray(&f->sky_cells[luxel], lx_sky_cell_of(u, sky_cell_count)));
    return (lx_ray){.origin = lx_offset_origin(site->position, site->geometric_normal), .direction = lx_to_world(site->normal, lx_sample_polar_hemisphere(u)), .t_max = INFINITY};
}

// Independent samples of one luxel: mean and variance of one sample, per cell.
static void brute_force(const fixture *f, uint32_t source, uint32_t luxel, double mean[most_cells], double variance[most_cells])
{
    double sum[most_cells] = {0}, squares[most_cells] = {0};
    const uint32_t count = lx_direct_sample_weight(f->tracer, source);
    for (uint32_t i = 0; i < brute_samples; ++i) {
        const uint32_t bits = lx_hash_combine(0xb1a5, luxel * brute_samples + i);
        const lx_vec2 u = {lx_unit_float(bits), lx_unit_float(lx_hash32(bits + 77))};
        lx_ray ray;
        lx_rgb light, transmittance;
        uint32_t cell;
        const lx_receiver *site = &f->sites[luxel * lx_direct_sites + i % lx_direct_sites];
        if (source == f->scene->source_count) {
            float share;
            ray = look_at_sky(f, luxel, site, u, &share);
            light = lx_rgb_grey(share);
            cell = 0;
        } else if (!lx_sample_source(f->tracer, source, site, u, count, &ray, &light, &cell)) {
            continue;
        }
        lx_trace_transmittance(f->tracer, &ray, &transmittance, 1);
        const double value = (double)(light.g * transmittance.g);
        sum[cell] += value;
        squares[cell] += value * value;
    }
    for (int c = 0; c < most_cells; ++c) {
        mean[c] = sum[c] / brute_samples;
        variance[c] = fmax(0, squares[c] / brute_samples - mean[c] * mean[c]);
    }
}

// Well-spread samples vary less than independent ones, so the latter's variance bounds both sides; 5 standard deviations.
static void check_source(const char *name)
{
    fixture f;
    begin(&f, 1);
    const uint32_t source = source_number(&f, name), cells = lx_tracer_cell_count(f.tracer, source);
    lx_rgb mean[most_cells * luxels];
    float variance[most_cells * luxels];
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, mean, variance));
    const double taken = (double)samples * lx_direct_sample_weight(f.tracer, source);
    double total = 0, difference = 0, total_variance = 0;
    for (uint32_t i = 0; i < luxels; ++i) {
        double expected[most_cells], spread[most_cells];
        brute_force(&f, source, i, expected, spread);
        for (uint32_t c = 0; c < cells; ++c) {
            const double v = spread[c] * (1 / taken + 1.0 / brute_samples);
            assert_near((double)mean[c * luxels + i].g, expected[c], 5 * sqrt(v) + 1e-5);
            total += expected[c];
            difference += (double)mean[c * luxels + i].g - expected[c];
            total_variance += v;
        }
    }
    assert_true(total > 0.1);
    assert_near(difference, 0, 4 * sqrt(total_variance) + 1e-5 * total);
    end(&f);
}

static void points_give_what_brute_force_does(void **state) { (void)state; check_source("bulb"); }
static void spheres_give_what_brute_force_does(void **state) { (void)state; check_source("globe"); }
static void suns_give_what_brute_force_does(void **state) { (void)state; check_source("sun"); }
static void rectangles_give_what_brute_force_does(void **state) { (void)state; check_source("panel"); }
static void disks_give_what_brute_force_does(void **state) { (void)state; check_source("dish"); }
static void emissive_surfaces_give_what_brute_force_does(void **state) { (void)state; check_source("glow"); }
// Ten triangles, in a tree: some luxels see them as small, some don't.
static void emissive_meshes_give_what_brute_force_does(void **state) { (void)state; check_source("swarm"); }
static void cells_of_monitors_give_what_brute_force_does(void **state) { (void)state; check_source("screen"); }

static void source_below_the_horizon_gives_nothing_without_a_ray(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    lx_rgb mean[luxels];
    float variance[luxels];
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    assert_false(lx_direct_light(f.batch, &settings, &f.tile, source_number(&f, "below"), mean, variance));
    assert_true(lx_direct_batch_rays(f.batch) == 0);
    end(&f);
}

static void uniform_skies_give_what_brute_force_does(void **state) { (void)state; check_source("sky"); }

// In the open all looks agree, so the light is exact: samples bring their share of their cells, gather rays the rest, and where none leave samples bring all.
static void samples_and_rays_share_all_light_of_a_uniform_sky(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    const uint32_t source = source_number(&f, "sky");
    for (uint32_t i = 0; i < luxels * lx_direct_sites; ++i) f.sites[i].position.y += 10; // above everything
    uint8_t alone[luxels];
    uint32_t wanted = 0;
    f.sky_cells[0] = f.sky_cells[1] = (lx_sky_cells){0, 0};
    for (uint32_t i = 0; i < luxels; ++i) {
        alone[i] = i % 2;
        for (uint32_t k = 0; k < sky_cell_count; ++k) {
            const float per_ray = lx_sky_per_ray(&f.sky_cells[i], k);
            wanted += samples / sky_cell_count * (uint32_t)(alone[i] && per_ray == 0 ? 1 : lx_rays_per_sample * per_ray);
        }
    }
    f.tile.alone = alone;
    lx_rgb mean[luxels];
    float variance[luxels];
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, mean, variance));
    for (uint32_t i = 0; i < luxels; ++i) {
        float rays_bring = 0;
        for (uint32_t k = 0; k < sky_cell_count && !alone[i]; ++k) rays_bring += (1 - lx_sky_samples_share(lx_sky_per_ray(&f.sky_cells[i], k))) / sky_cell_count;
        assert_near((double)(mean[i].g + rays_bring * LX_PI), (double)LX_PI, 3e-5);
        assert_true(variance[i] < 1e-9f);
    }
    assert_int_equal(lx_direct_batch_rays(f.batch), wanted);
    end(&f);
}

// Points drawn in a cell lie in it, and cells are all of the square, in equal parts.
static void cells_of_the_sky_are_equal_parts(void **state)
{
    (void)state;
    for (uint32_t count = 1; count <= lx_sky_most_cells; count *= 2) {
        uint32_t found[lx_sky_most_cells] = {0};
        enum { grid = 64 };
        for (uint32_t i = 0; i < grid * grid; ++i) {
            const lx_vec2 u = {((float)(i % grid) + 0.5f) / grid, ((float)(i / grid) + 0.5f) / grid};
            ++found[lx_sky_cell_of(u, count)];
            assert_int_equal(lx_sky_cell_of(lx_sky_point_in(i % count, u, count), count), i % count);
        }
        for (uint32_t k = 0; k < count; ++k) assert_int_equal(found[k], grid * grid / count);
    }
    assert_int_equal(lx_sky_cell_of((lx_vec2){0x1.fffffep-1f, 0x1.fffffep-1f}, 64), 63);
}

// Samples by power bring what samples by the tree bring, seen from near, where hits have a share, and from far, where they have none.
static void samples_by_power_bring_the_same_light(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    const uint32_t source = source_number(&f, "swarm");
    static const lx_receiver receivers[] = {{.position = {0.2f, 1.95f, 0}, .normal = {0, 1, 0}, .geometric_normal = {0, 1, 0}},
                                            {.position = {0.5f, 0.2f, 0.3f}, .normal = {0, 1, 0}, .geometric_normal = {0, 1, 0}}};
    for (int r = 0; r < 2; ++r) {
        double sums[2] = {0}, squares[2] = {0};
        for (uint32_t i = 0; i < brute_samples; ++i) {
            const uint32_t bits = lx_hash_combine(0x70e5, i);
            const lx_vec2 u = {lx_unit_float(bits), lx_unit_float(lx_hash32(bits + 77))};
            for (int by_power = 0; by_power < 2; ++by_power) {
                lx_ray ray;
                lx_rgb light;
                uint32_t cell;
                const bool arrives = (by_power ? lx_sample_source_by_power : lx_sample_source)(f.tracer, source, &receivers[r], u, 1, &ray, &light, &cell);
                const double value = arrives ? (double)light.g : 0;
                sums[by_power] += value / brute_samples;
                squares[by_power] += value * value / brute_samples;
            }
        }
        const double variance = squares[0] - sums[0] * sums[0] + squares[1] - sums[1] * sums[1];
        assert_true(sums[0] > 0);
        assert_near(sums[1], sums[0], 4 * sqrt(variance / brute_samples) + 1e-6);
    }
    end(&f);
}

// Sixteen at a time or one by one, samples are the same; from below, behind and beside as well.
static void views_give_the_samples_of_the_source(void **state)
{
    (void)state;
    static const char *const names[] = {"bulb", "globe", "sun", "panel", "dish", "glow", "screen"};
    fixture f;
    begin(&f, 1);
    for (size_t n = 0; n < sizeof names / sizeof *names; ++n) {
        const uint32_t source = source_number(&f, names[n]);
        uint32_t arrived = 0;
        for (uint32_t i = 0; i < 200; ++i) {
            lx_receiver receivers[lx_view_size];
            for (uint32_t k = 0; k < lx_view_size; ++k) {
                const uint32_t bits = lx_hash_combine(i, k);
                const float x = lx_unit_float(bits), y = lx_unit_float(lx_hash32(bits)), tilt = lx_unit_float(lx_hash32(i)) * 8;
                const lx_vec3 up = {sinf(tilt), cosf(tilt), 0};
                receivers[k] = (lx_receiver){.position = {4 * x - 2, i % 3 == 0 ? 2.3f : 0, 4 * y - 2}, .normal = lx_normalize((lx_vec3){up.x, up.y, x / 4}),
                                             .geometric_normal = up};
            }
            static lx_source_view view;
            lx_view_samples samples_of_view;
            lx_source_view_fill(&view, f.tracer, source, receivers);
            if (view.reaches) lx_source_view_sample(&view, i, 16 * (i % 4), i % 2, &samples_of_view);
            for (uint32_t k = 0; k < lx_view_size; ++k) {
                lx_ray ray;
                lx_rgb light;
                uint32_t cell;
                if (!lx_sample_source(f.tracer, source, &receivers[k], lx_sobol_pair(16 * (i % 4) + k, i), i % 2, &ray, &light, &cell)) light = (lx_rgb){0, 0, 0};
                assert_near(view.reaches ? (double)samples_of_view.light[k].g : 0, (double)light.g, 1e-5 * (double)light.g + 1e-6);
                if (lx_rgb_is_black(light)) continue;
                ++arrived;
                const lx_vec3 direction = {samples_of_view.direction.x[k], samples_of_view.direction.y[k], samples_of_view.direction.z[k]};
                assert_true(lx_distance(direction, ray.direction) < 1e-5f);
                assert_true(view.origin.x[k] == ray.origin.x && view.t_max == ray.t_max && samples_of_view.cell[k] == cell);
            }
        }
        assert_true(arrived > 100);
    }
    end(&f);
}

// At later vertices of a path the ray that goes on has it all.
static void paths_take_no_samples_of_a_uniform_sky(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    lx_ray ray;
    lx_rgb light;
    uint32_t cell;
    assert_false(lx_sample_source(f.tracer, source_number(&f, "sky"), &f.sites[0], (lx_vec2){0.3f, 0.6f}, 1, &ray, &light, &cell));
    assert_true(lx_sky_weight(f.tracer, (lx_vec3){0, 1, 0}, 1) == 1);
    end(&f);
}

// Four times the samples for each time that a lamp is twice as near, from where its light is hundreds of times the mean.
static void places_beside_a_lamp_deserve_more_samples(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    const uint32_t bulb = source_number(&f, "bulb"), globe = source_number(&f, "globe"), sky = source_number(&f, "sky"), sun = source_number(&f, "sun");
    const lx_vec3 place = f.tracer->source_spheres[bulb].centre;
    const float mean = 20 * f.tracer->source_scales[bulb], reach = sqrtf(1 / (256 * mean)); // of one candela
    static const struct {
        float distance; // over the reach
        uint32_t effort;
    } expected[] = {{100, 1}, {1.01f, 1}, {0.99f, 4}, {0.51f, 4}, {0.49f, 16}, {0.26f, 16}, {0.24f, 64}, {0, lx_source_most_effort}};
    for (size_t i = 0; i < sizeof expected / sizeof *expected; ++i)
        assert_int_equal(lx_source_effort(f.tracer, bulb, lx_add(place, lx_v3(0, expected[i].distance * reach, 0))), expected[i].effort);
    assert_true(lx_source_effort(f.tracer, globe, f.tracer->source_spheres[globe].centre) <= lx_source_most_effort);
    assert_int_equal(lx_source_effort(f.tracer, sky, place), 1);
    assert_int_equal(lx_source_effort(f.tracer, sun, place), 1);
    end(&f);
}

// A chink that few rays find: its light must not be taken for none.
static void a_sliver_of_sky_is_not_lost(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    for (uint32_t i = 0; i < luxels * lx_direct_sites; ++i) { // close below the shade, which is 2 × 3 m
        lx_vec3 *p = &f.sites[i].position;
        *p = (lx_vec3){1 + 0.1f * p->x, 0.9f, -1.5f + 0.1f * p->z};
    }
    const uint32_t source = source_number(&f, "sky");
    lx_rgb mean[luxels];
    float variance[luxels];
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, mean, variance));
    double sum = 0, expected_sum = 0, sum_variance = 0;
    for (uint32_t i = 0; i < luxels; ++i) {
        double expected[most_cells], spread[most_cells];
        brute_force(&f, source, i, expected, spread);
        sum += (double)mean[i].g;
        expected_sum += expected[0];
        sum_variance += spread[0] * (1.0 / samples + 1.0 / brute_samples);
    }
    assert_true(expected_sum > 0.001 * luxels && expected_sum < 0.05 * luxels);
    assert_near(sum, expected_sum, 4 * sqrt(sum_variance));
    end(&f);
}

// Half of the tile is in the open: there the first looks do. The sharp lamp needs no more than one ray from each site anywhere.
static void rays_are_spared_where_neighbours_agree(void **state)
{
    (void)state;
    static const char *const names[] = {"bulb", "globe", "sun", "panel", "dish", "glow", "swarm"};
    fixture f;
    begin(&f, 1);
    for (size_t k = 0; k < sizeof names / sizeof *names; ++k) {
        const uint32_t source = source_number(&f, names[k]);
        lx_rgb mean[luxels], full[luxels];
        float variance[luxels];
        lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
        const uint64_t before = lx_direct_batch_rays(f.batch);
        assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, mean, variance));
        const uint64_t between = lx_direct_batch_rays(f.batch);
        settings.all_rays = true;
        assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, full, variance));
        const uint64_t after = lx_direct_batch_rays(f.batch);
        assert_true(between - before < (after - between) * 9 / 10);
        // The same samples, so what differs is what was spared: of open luxels' light its own noise, at most 0.4 %; where a penumbra runs out, the last
        // ray or two that few looks missed.
        double difference = 0, squares = 0;
        for (uint32_t i = 0; i < luxels; ++i) {
            difference += ((double)mean[i].g - (double)full[i].g) * ((double)mean[i].g - (double)full[i].g);
            squares += (double)full[i].g * (double)full[i].g;
        }
        if (!(difference < 0.01 * 0.01 * squares)) fail_msg("%s: %.2f %% off", names[k], 100 * sqrt(difference / squares));
    }
    end(&f);
}

// Bounds only ever leave out what gives nothing.
static void bounds_of_the_tile_change_nothing(void **state)
{
    (void)state;
    fixture f;
    begin(&f, 1);
    lx_direct_bounds bounds;
    lx_direct_find_bounds(&f.tile, &bounds);
    for (uint32_t i = 0; i < luxels * lx_direct_sites; ++i) assert_true(lx_distance(bounds.centre, f.sites[i].position) <= bounds.radius);
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    for (uint32_t source = 0; source < f.scene->source_count; ++source) {
        lx_rgb without[most_cells * luxels], with[most_cells * luxels];
        float variance[most_cells * luxels];
        f.tile.bounds = NULL;
        const bool reaches = lx_direct_light(f.batch, &settings, &f.tile, source, without, variance);
        f.tile.bounds = &bounds;
        assert_int_equal(lx_direct_light(f.batch, &settings, &f.tile, source, with, variance), reaches);
        if (reaches) assert_memory_equal(with, without, luxels * lx_tracer_cell_count(f.tracer, source) * sizeof *with);
    }
    end(&f);
}

// Over many streams: what the means scatter by is what their stated variances say, within the half of a tile where the panel's penumbra lies. A variance of
// four runs overstates that of their union, which is spread better than the runs are for themselves; by no more than a factor of 4 here.
static void stated_variance_is_that_of_the_mean(void **state)
{
    (void)state;
    enum { trials = 60 };
    fixture f;
    begin(&f, 1);
    const uint32_t source = source_number(&f, "panel");
    const lx_direct_settings settings = {.tracer = f.tracer, .samples = samples};
    static double sum[luxels], squares[luxels];
    double stated = 0, found = 0;
    for (uint32_t t = 0; t < trials; ++t) {
        lx_rgb mean[luxels];
        float variance[luxels];
        for (uint32_t i = 0; i < luxels; ++i) f.stream[i] = lx_hash_combine(t + 100, i);
        assert_true(lx_direct_light(f.batch, &settings, &f.tile, source, mean, variance));
        for (uint32_t i = 0; i < luxels; ++i) {
            sum[i] += (double)mean[i].g;
            squares[i] += (double)mean[i].g * (double)mean[i].g;
            stated += (double)variance[i] / trials;
        }
    }
    for (uint32_t i = 0; i < luxels; ++i) found += (squares[i] - sum[i] * sum[i] / trials) / (trials - 1);
    if (!(stated > 0.7 * found && stated < 4 * found)) fail_msg("stated %g, found %g", stated, found);
    end(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(points_give_what_brute_force_does),
        cmocka_unit_test(spheres_give_what_brute_force_does),
        cmocka_unit_test(suns_give_what_brute_force_does),
        cmocka_unit_test(rectangles_give_what_brute_force_does),
        cmocka_unit_test(disks_give_what_brute_force_does),
        cmocka_unit_test(emissive_surfaces_give_what_brute_force_does),
        cmocka_unit_test(emissive_meshes_give_what_brute_force_does),
        cmocka_unit_test(cells_of_monitors_give_what_brute_force_does),
        cmocka_unit_test(uniform_skies_give_what_brute_force_does),
        cmocka_unit_test(samples_by_power_bring_the_same_light),
        cmocka_unit_test(views_give_the_samples_of_the_source),
        cmocka_unit_test(samples_and_rays_share_all_light_of_a_uniform_sky),
        cmocka_unit_test(cells_of_the_sky_are_equal_parts),
        cmocka_unit_test(paths_take_no_samples_of_a_uniform_sky),
        cmocka_unit_test(a_sliver_of_sky_is_not_lost),
        cmocka_unit_test(places_beside_a_lamp_deserve_more_samples),
        cmocka_unit_test(source_below_the_horizon_gives_nothing_without_a_ray),
        cmocka_unit_test(rays_are_spared_where_neighbours_agree),
        cmocka_unit_test(bounds_of_the_tile_change_nothing),
        cmocka_unit_test(stated_variance_is_that_of_the_mean),
    };
    return cmocka_run_group_tests(tests, fixture_setup, fixture_teardown);
}
