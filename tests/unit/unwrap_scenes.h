/// Scenes made by hand for the unwrap tests, and a checker that proves an atlas right without the library's own means.
#ifndef TEST_UNWRAP_SCENES_H
#define TEST_UNWRAP_SCENES_H

#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>

#include <cmocka.h>

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/context.h"
#include "math/hash.h"
#include "scene/atlas.h"

// ---- Building ----------------------------------------------------------------------------------------------------------------

typedef struct warnings { char text[8192]; int count; } warnings;

typedef struct builder {
    lx_context *context;
    lx_scene scene;
    warnings warnings;
} builder;

static inline void keep_warning(void *user, lx_log_level level, const char *message)
{
    warnings *w = user;
    if (level != LX_LOG_WARNING) return;
    ++w->count;
    strncat(w->text, message, sizeof w->text - strlen(w->text) - 2);
    strcat(w->text, "\n");
}

static inline void *grown(void *array, uint32_t count, size_t size)
{
    void *bigger = realloc(array, (count + (size_t)1) * size);
    assert_non_null(bigger);
    memset((char *)bigger + count * size, 0, size);
    return bigger;
}

static inline uint32_t add_material(builder *b, bool unlit, float density)
{
    lx_scene *s = &b->scene;
    s->materials = grown(s->materials, s->material_count, sizeof *s->materials);
    lx_material *m = &s->materials[s->material_count];
    m->name = "material";
    m->unlit = unlit;
    m->density = density;
    m->base_color_texture.texture = m->metallic_roughness_texture.texture = -1;
    m->emissive_texture.texture = m->transmission_texture.texture = -1;
    return s->material_count++;
}

static inline builder *begin(uint32_t threads)
{
    builder *b = calloc(1, sizeof *b);
    assert_non_null(b);
    lx_context_desc desc = lx_context_desc_default();
    desc.thread_count = threads;
    desc.logger = (lx_logger){keep_warning, &b->warnings};
    assert_int_equal(lx_context_create(&desc, &b->context, NULL), LX_OK);
    b->scene.context = b->context;
    add_material(b, false, 1);
    return b;
}

static inline void end(builder *b)
{
    lx_scene *s = &b->scene;
    for (uint32_t i = 0; i < s->primitive_count; ++i) {
        free(s->primitives[i].positions);
        free(s->primitives[i].indices);
        for (int k = 0; k < lx_texcoord_sets; ++k) free(s->primitives[i].texcoords[k]);
    }
    free(s->primitives);
    free(s->meshes);
    free(s->instances);
    free(s->materials);
    lx_context_destroy(b->context);
    free(b);
}

static inline uint32_t add_mesh(builder *b, const char *name)
{
    lx_scene *s = &b->scene;
    s->meshes = grown(s->meshes, s->mesh_count, sizeof *s->meshes);
    s->meshes[s->mesh_count].name = name;
    s->meshes[s->mesh_count].first_primitive = s->primitive_count;
    return s->mesh_count++;
}

/// Adds a primitive to the newest mesh. Copies.
static inline lx_primitive *add_primitive(builder *b, const lx_vec3 *positions, uint32_t vertex_count, const uint32_t *indices,
                                          uint32_t triangle_count, uint32_t material)
{
    lx_scene *s = &b->scene;
    s->primitives = grown(s->primitives, s->primitive_count, sizeof *s->primitives);
    lx_primitive *p = &s->primitives[s->primitive_count++];
    ++s->meshes[s->mesh_count - 1].primitive_count;
    p->vertex_count = vertex_count;
    p->triangle_count = triangle_count;
    p->material = material;
    p->positions = malloc(vertex_count * sizeof *positions + 1);
    p->indices = malloc(3 * (size_t)triangle_count * sizeof *indices + 1);
    assert_true(p->positions && p->indices);
    memcpy(p->positions, positions, vertex_count * sizeof *positions);
    memcpy(p->indices, indices, 3 * (size_t)triangle_count * sizeof *indices);
    return p;
}

static inline uint32_t add_instance(builder *b, uint32_t mesh, lx_mat4 transform)
{
    lx_scene *s = &b->scene;
    s->instances = grown(s->instances, s->instance_count, sizeof *s->instances);
    lx_instance *i = &s->instances[s->instance_count];
    i->name = "node";
    i->mesh = mesh;
    i->gpu_instance = -1;
    i->transform = transform;
    i->is_static = true;
    i->density = 1;
    return s->instance_count++;
}

static inline lx_mat4 scaling(float x, float y, float z)
{
    return lx_mat4_trs(lx_v3(0, 0, 0), (lx_vec4){0, 0, 0, 1}, lx_v3(x, y, z));
}

static inline void place(builder *b, uint32_t mesh)
{
    add_instance(b, mesh, lx_mat4_identity());
}

/// A (u, v) surface of columns × rows quads; wraps: welds by equal positions because f is periodic.
typedef lx_vec3 (*surface_function)(float u, float v);

static inline uint32_t add_surface(builder *b, const char *name, surface_function f, uint32_t columns, uint32_t rows, bool wrap_u,
                                   bool wrap_v)
{
    const uint32_t count = (columns + 1) * (rows + 1);
    lx_vec3 *p = malloc(count * sizeof *p);
    uint32_t *indices = malloc(6 * (size_t)columns * rows * sizeof *indices), n = 0;
    assert_true(p && indices);
    for (uint32_t j = 0; j <= rows; ++j)
        for (uint32_t i = 0; i <= columns; ++i)
            p[j * (columns + 1) + i] = f((float)(wrap_u ? i % columns : i) / (float)columns,
                                         (float)(wrap_v ? j % rows : j) / (float)rows);
    for (uint32_t j = 0; j < rows; ++j)
        for (uint32_t i = 0; i < columns; ++i) {
            const uint32_t a = j * (columns + 1) + i, c = a + columns + 1;
            const uint32_t quad[6] = {a, a + 1, c + 1, a, c + 1, c};
            memcpy(&indices[n], quad, sizeof quad);
            n += 6;
        }
    const uint32_t mesh = add_mesh(b, name);
    add_primitive(b, p, count, indices, n / 3, 0);
    free(p);
    free(indices);
    return mesh;
}

static inline lx_vec3 sphere_point(float u, float v)
{
    const float a = 2 * LX_PI * u, t = LX_PI * v;
    if (v <= 0) return lx_v3(0, 1, 0);
    if (v >= 1) return lx_v3(0, -1, 0);
    return lx_v3(sinf(t) * cosf(a), cosf(t), sinf(t) * sinf(a));
}
static inline lx_vec3 torus_point(float u, float v)
{
    const float a = 2 * LX_PI * u, t = 2 * LX_PI * v, r = 1 + 0.35f * cosf(t);
    return lx_v3(r * cosf(a), 0.35f * sinf(t), r * sinf(a));
}
static inline lx_vec3 cylinder_point(float u, float v)
{
    return lx_v3(cosf(2 * LX_PI * u), 3 * v, sinf(2 * LX_PI * u));
}
/// A tube bent to a spiral of three turns: its charts lie over each other unless they are cut.
static inline lx_vec3 spring_point(float u, float v)
{
    const float a = 6 * LX_PI * v, t = 2 * LX_PI * u, r = 1 + 0.12f * cosf(t);
    return lx_v3(r * cosf(a), 0.15f * a + 0.12f * sinf(t), r * sinf(a));
}
/// A spiral ramp of four turns: faces up everywhere, covers itself.
static inline lx_vec3 ramp_point(float u, float v)
{
    const float a = 8 * LX_PI * v, r = 0.5f + u;
    return lx_v3(r * sinf(a), 0.1f * a, r * cosf(a));
}
static inline lx_vec3 moebius_point(float u, float v)
{
    const float a = 2 * LX_PI * u, w = v - 0.5f;
    return lx_v3((1 + w * cosf(a / 2)) * cosf(a), (1 + w * cosf(a / 2)) * sinf(a), w * sinf(a / 2));
}
static inline lx_vec3 wave_point(float u, float v)
{
    return lx_v3(10 * u, 0.6f * sinf(9 * u) * cosf(7 * v), 10 * v);
}

static inline uint32_t add_box(builder *b, const char *name, float x, float y, float z)
{
    lx_vec3 p[8];
    for (int i = 0; i < 8; ++i) p[i] = lx_v3(i & 1 ? x : 0, i & 2 ? y : 0, i & 4 ? z : 0);
    static const uint32_t indices[36] = {0, 2, 3, 0, 3, 1, 4, 5, 7, 4, 7, 6, 0, 1, 5, 0, 5, 4,
                                         2, 6, 7, 2, 7, 3, 0, 4, 6, 0, 6, 2, 1, 3, 7, 1, 7, 5};
    const uint32_t mesh = add_mesh(b, name);
    add_primitive(b, p, 8, indices, 12, 0);
    return mesh;
}

static inline uint32_t add_quad(builder *b, const char *name, float x, float z)
{
    const lx_vec3 p[4] = {{0, 0, 0}, {x, 0, 0}, {x, 0, z}, {0, 0, z}};
    static const uint32_t indices[6] = {0, 2, 1, 0, 3, 2};
    const uint32_t mesh = add_mesh(b, name);
    add_primitive(b, p, 4, indices, 2, 0);
    return mesh;
}

// ---- Checking ----------------------------------------------------------------------------------------------------------------

typedef struct placed { double x[3], y[3]; uint32_t chart; } placed; // on a page, in texels

static inline double cross_at(const placed *t, int i, double x, double y)
{
    const int k = i == 2 ? 0 : i + 1;
    return (t->x[k] - t->x[i]) * (y - t->y[i]) - (t->y[k] - t->y[i]) * (x - t->x[i]);
}

static inline double placed_area(const placed *t) { return 0.5 * cross_at(t, 0, t->x[2], t->y[2]); }

/// Depth by which two triangles overlap, by separating axes (edges' normals suffice for triangles).
static inline double overlap_depth(const placed *a, const placed *b)
{
    double depth = INFINITY;
    for (int which = 0; which < 2; ++which) {
        const placed *s = which ? b : a, *o = which ? a : b;
        const double sign = placed_area(s) > 0 ? 1 : -1;
        for (int i = 0; i < 3; ++i) {
            const int k = i == 2 ? 0 : i + 1;
            const double length = hypot(s->x[k] - s->x[i], s->y[k] - s->y[i]);
            double deepest = -INFINITY;
            for (int j = 0; j < 3; ++j) deepest = fmax(deepest, sign * cross_at(s, i, o->x[j], o->y[j]) / length);
            depth = fmin(depth, deepest);
        }
    }
    return depth;
}

static inline double world_area(const lx_instance *instance, const lx_primitive *p, uint32_t t)
{
    double q[3][3];
    for (int k = 0; k < 3; ++k) {
        const lx_vec3 v = p->positions[p->indices[3 * t + (uint32_t)k]];
        const float *m = instance->transform.m;
        for (int i = 0; i < 3; ++i) q[k][i] = (double)m[i] * (double)v.x + (double)m[4 + i] * (double)v.y + (double)m[8 + i] * (double)v.z;
    }
    double e[2][3], n[3];
    for (int k = 0; k < 2; ++k)
        for (int i = 0; i < 3; ++i) e[k][i] = q[k + 1][i] - q[0][i];
    for (int i = 0; i < 3; ++i) n[i] = e[0][(i + 1) % 3] * e[1][(i + 2) % 3] - e[0][(i + 2) % 3] * e[1][(i + 1) % 3];
    return 0.5 * sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
}

typedef struct atlas_facts {
    double coverage;           // covered texel centres / texels of all pages
    uint32_t charts, triangles, uncharted;
    double lowest_density, highest_density; // of charts larger than two texels, relative to what was asked
} atlas_facts;

typedef struct page_map { uint32_t *owner; uint32_t cells, per_texel; } page_map;

/// Marks cells that the triangle touches; fails where its inside meets a cell centre that another triangle has claimed.
static inline void draw_triangle(page_map *touched, uint32_t *claims, const placed *t, uint32_t gid, uint32_t triangle)
{
    const double k = touched->per_texel, area2 = 2 * placed_area(t) * k * k, sign = area2 > 0 ? 1 : -1;
    double lx = INFINITY, ly = INFINITY, hx = -INFINITY, hy = -INFINITY, nx[3], ny[3];
    for (int i = 0; i < 3; ++i) {
        const int n = i == 2 ? 0 : i + 1;
        const double length = hypot(t->x[n] - t->x[i], t->y[n] - t->y[i]);
        nx[i] = -sign * (t->y[n] - t->y[i]) / length;
        ny[i] = sign * (t->x[n] - t->x[i]) / length;
        lx = fmin(lx, t->x[i] * k);
        hx = fmax(hx, t->x[i] * k);
        ly = fmin(ly, t->y[i] * k);
        hy = fmax(hy, t->y[i] * k);
    }
    for (int64_t y = (int64_t)floor(ly); y <= (int64_t)floor(hy); ++y)
        for (int64_t x = (int64_t)floor(lx); x <= (int64_t)floor(hx); ++x) {
            if (x < 0 || y < 0 || x >= touched->cells || y >= touched->cells) continue;
            bool center = true, touch = true;
            for (int i = 0; i < 3; ++i) {
                const double d = nx[i] * ((double)x + 0.5 - t->x[i] * k) + ny[i] * ((double)y + 0.5 - t->y[i] * k);
                center &= d > 1e-3;
                touch &= d > -0.5 * (fabs(nx[i]) + fabs(ny[i])) + 2e-2;
            }
            const size_t c = (size_t)y * touched->cells + (size_t)x;
            if (touch) touched->owner[c] = gid + 1;
            if (!center) continue;
            if (claims[c] != 0) fail_msg("triangles %u and %u (chart %u) overlap at texel %.2f %.2f", claims[c] - 1, triangle, gid,
                                         (double)x / k, (double)y / k);
            claims[c] = triangle + 1;
        }
}

static inline void check_distances(const page_map *map, double padding)
{
    // Triangles `padding` apart touch cells with at least padding·k - 2 whole cells between them.
    const int64_t radius = (int64_t)(padding * map->per_texel) - 2, cells = map->cells;
    for (int64_t y = 0; y < cells; ++y)
        for (int64_t x = 0; x < cells; ++x) {
            const uint32_t own = map->owner[y * cells + x];
            if (own == 0) continue;
            const bool inside = x > 0 && y > 0 && x + 1 < cells && y + 1 < cells && map->owner[y * cells + x - 1] == own &&
                                map->owner[y * cells + x + 1] == own && map->owner[(y - 1) * cells + x] == own &&
                                map->owner[(y + 1) * cells + x] == own;
            if (inside) continue;
            for (int64_t j = y > radius ? y - radius : 0; j <= y + radius && j < cells; ++j)
                for (int64_t i = x > radius ? x - radius : 0; i <= x + radius && i < cells; ++i) {
                    const uint32_t other = map->owner[j * cells + i];
                    if (other != 0 && other != own)
                        fail_msg("charts %u and %u are %.2f texels apart, not %g, at %.1f %.1f", own - 1, other - 1,
                                 (double)(llabs(i - x) > llabs(j - y) ? llabs(i - x) : llabs(j - y)) / map->per_texel, padding,
                                 (double)x / map->per_texel, (double)y / map->per_texel);
                }
        }
}

static inline void check_rects(const lx_atlas *atlas)
{
    for (uint32_t page = 0; page < atlas->page_count && !atlas->scene_atlas; ++page) {
        uint8_t *taken = calloc((size_t)atlas->page_size * atlas->page_size, 1);
        assert_non_null(taken);
        for (uint32_t i = 0; i < atlas->scene->instance_count; ++i) {
            const lx_atlas_rect *r = &atlas->rects[i];
            if (!r->used) continue;
            assert_true(r->page < atlas->page_count);
            assert_true(r->width > 0 && r->height > 0);
            assert_true(r->x + r->width <= atlas->page_size && r->y + r->height <= atlas->page_size);
            if (r->page != page) continue;
            for (uint32_t y = r->y; y < r->y + r->height; ++y)
                for (uint32_t x = r->x; x < r->x + r->width; ++x)
                    if (taken[(size_t)y * atlas->page_size + x]++) fail_msg("rectangles overlap at %u %u", x, y);
        }
        free(taken);
    }
}

/// Everything that must hold of any atlas; `new_charts`: nothing was taken from the file, so orientation and density hold too.
static inline atlas_facts check_atlas(const lx_atlas *atlas, bool new_charts)
{
    const lx_scene *scene = atlas->scene;
    atlas_facts facts = {.lowest_density = INFINITY};
    const uint32_t per_texel = atlas->page_size <= 512 ? 4 : 2, cells = atlas->page_size * per_texel;
    uint32_t gid = 0, triangle_id = 0;
    size_t covered = 0;
    page_map touched = {calloc((size_t)cells * cells, sizeof(uint32_t)), cells, per_texel};
    uint32_t *claims = calloc((size_t)cells * cells, sizeof *claims);
    assert_true(touched.owner && claims);
    check_rects(atlas);
    for (uint32_t page = 0; page < atlas->page_count; ++page) {
        memset(touched.owner, 0, (size_t)cells * cells * sizeof *touched.owner);
        memset(claims, 0, (size_t)cells * cells * sizeof *claims);
        double padding = atlas->padding;
        for (uint32_t i = 0; i < scene->instance_count; ++i) {
            const lx_instance *instance = &scene->instances[i];
            const lx_mesh *mesh = &scene->meshes[instance->mesh];
            const lx_atlas_rect *rect = &atlas->rects[i];
            if (!rect->used || rect->page != page) continue;
            const uint32_t chart_count = atlas->meshes[instance->mesh].chart_count;
            double *flat = calloc(chart_count, sizeof *flat), *world = calloc(chart_count, sizeof *world);
            double *extents = calloc(chart_count, sizeof *extents), *asked = calloc(chart_count, sizeof *asked);
            placed *list = NULL;
            uint32_t listed = 0;
            assert_true(flat && world && extents && asked);
            for (uint32_t k = 0; k < mesh->primitive_count; ++k) {
                const lx_primitive *p = &scene->primitives[mesh->first_primitive + k];
                const lx_atlas_primitive *a = &atlas->primitives[mesh->first_primitive + k];
                if (scene->materials[p->material].unlit) {
                    assert_null(a->corner_uv);
                    continue;
                }
                assert_non_null(a->corner_uv);
                assert_non_null(a->triangle_chart);
                list = realloc(list, (listed + (size_t)p->triangle_count) * sizeof *list);
                for (uint32_t t = 0; t < p->triangle_count; ++t) {
                    placed q = {.chart = a->triangle_chart[t]};
                    ++facts.triangles;
                    for (int c = 0; c < 3; ++c) {
                        const lx_vec2 uv = a->corner_uv[3 * (size_t)t + (size_t)c];
                        assert_true(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
                        q.x[c] = ((double)uv.x * (double)rect->scale[0] + (double)rect->offset[0]) * atlas->page_size;
                        q.y[c] = ((double)uv.y * (double)rect->scale[1] + (double)rect->offset[1]) * atlas->page_size;
                        if (atlas->scene_atlas) continue;
                        const double rim = new_charts ? 0.9 : 0; // half the smallest padding, less rounding
                        if (q.chart != LX_NO_CHART)
                            assert_true(q.x[c] >= rect->x + rim && q.x[c] <= rect->x + rect->width - rim &&
                                        q.y[c] >= rect->y + rim && q.y[c] <= rect->y + rect->height - rim);
                    }
                    const double area = world_area(instance, p, t);
                    if (q.chart == LX_NO_CHART) {
                        ++facts.uncharted;
                        continue;
                    }
                    assert_true(q.chart < chart_count);
                    if (new_charts && !(placed_area(&q) > 0)) fail_msg("triangle %u is turned over", t);
                    flat[q.chart] += fabs(placed_area(&q));
                    world[q.chart] += area;
                    asked[q.chart] = (double)atlas->texels_per_m * (double)instance->density *
                                     (double)scene->materials[p->material].density;
                    for (int c = 0; c < 3; ++c)
                        extents[q.chart] = fmax(extents[q.chart], fmax(fabs(q.x[c] - q.x[0]), fabs(q.y[c] - q.y[0])));
                    list[listed++] = q;
                    draw_triangle(&touched, claims, &q, gid + q.chart, triangle_id++);
                }
            }
            if (listed <= 1200)
                for (uint32_t m = 0; m < listed; ++m)
                    for (uint32_t n = m + 1; n < listed; ++n) {
                        const double depth = overlap_depth(&list[m], &list[n]);
                        if (depth > 2e-3) fail_msg("triangles %u and %u overlap by %g texels", m, n, depth);
                    }
            for (uint32_t c = 0; c < chart_count && new_charts; ++c) {
                // Smaller ones are enlarged to a texel; the area of needles is mostly rounding of their coordinates.
                if (!(extents[c] > 2) || !(flat[c] > 0.01)) continue;
                const double relative = sqrt(flat[c] / world[c]) / asked[c];
                facts.lowest_density = fmin(facts.lowest_density, relative);
                facts.highest_density = fmax(facts.highest_density, relative);
            }
            facts.charts += chart_count;
            gid += chart_count;
            // A smaller copy has its padding shrunk with it, never below two texels.
            for (uint32_t k = 0; k < scene->instance_count; ++k)
                if (k != i && atlas->rects[k].used && scene->instances[k].mesh == instance->mesh && !atlas->scene_atlas &&
                    (atlas->rects[k].width != rect->width || atlas->rects[k].height != rect->height))
                    padding = 2;
            free(flat);
            free(world);
            free(extents);
            free(asked);
            free(list);
        }
        if (!new_charts) padding = 2;
        check_distances(&touched, padding);
        for (size_t c = 0; c < (size_t)cells * cells; ++c) covered += claims[c] != 0;
    }
    free(touched.owner);
    free(claims);
    if (atlas->page_count) facts.coverage = (double)covered / ((double)cells * cells * atlas->page_count);
    return facts;
}

/// True if two atlases of equal scenes are the same, bit by bit.
static inline bool same_atlas(const lx_atlas *a, const lx_atlas *b)
{
    const lx_scene *scene = a->scene;
    if (a->page_count != b->page_count || a->scene_atlas != b->scene_atlas ||
        memcmp(&a->texels_per_m, &b->texels_per_m, sizeof a->texels_per_m) != 0)
        return false;
    for (uint32_t i = 0; i < scene->instance_count; ++i) {
        const lx_atlas_rect *r = &a->rects[i], *s = &b->rects[i];
        if (r->used != s->used || r->page != s->page || r->x != s->x || r->y != s->y || r->width != s->width ||
            r->height != s->height || memcmp(r->scale, s->scale, sizeof r->scale) != 0 ||
            memcmp(r->offset, s->offset, sizeof r->offset) != 0)
            return false;
    }
    for (uint32_t i = 0; i < scene->primitive_count; ++i) {
        const lx_atlas_primitive *p = &a->primitives[i], *q = &b->primitives[i];
        const size_t count = scene->primitives[i].triangle_count;
        if (!p->corner_uv != !q->corner_uv) return false;
        if (p->corner_uv && (memcmp(p->corner_uv, q->corner_uv, count * 3 * sizeof *p->corner_uv) != 0 ||
                             memcmp(p->triangle_chart, q->triangle_chart, count * sizeof *p->triangle_chart) != 0))
            return false;
    }
    return true;
}

static inline lx_atlas *build_atlas(builder *b, const lx_atlas_desc *desc)
{
    lx_atlas *atlas = NULL;
    lx_error error = {0};
    if (lx_atlas_build(&b->scene, desc, NULL, &atlas, &error) != LX_OK) fail_msg("%s", error.message);
    return atlas;
}

#endif
