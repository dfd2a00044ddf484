// Emissive triangles: tables for choosing points by area × brightness.
//
// A source's triangles are chosen by a light tree, or if they are few by their power. A textured triangle is cut by a regular grid of its barycentrics, fine enough that a
// piece covers some two texels across; each piece is chosen by its mean brightness, but never by less than a small share of the
// triangle's, because the estimate of a piece may miss what lies between its lookups. A plain triangle is sampled by solid angle where it is near, else by area.
#include "trace/emitters.h"

#include "base/error.h"
#include "base/memory.h"
#include "trace/sampling.h"
#include "trace/tracer_data.h"

enum { most_without_tree = 8 };
enum { max_grid = 64, least_lookups = 3, most_lookups = 16 }; // lookups: per edge of a piece
static const float lookup_budget = 1 << 24; // for a surface, beyond the least: some tenths of a second
static const float least_share = 0.02f; // of a triangle's mean brightness, for every piece
static const float piece_budget = 1 << 15; // for a surface: more would not stay in a processor's cache, and what has many triangles needs less of each

static float brightness_of(lx_rgb c)
{
    return (c.r + c.g + c.b) * (1.0f / 3);
}

// Barycentrics of a piece: cell (i, j) of the grid, lower (k = 0) or upper (k = 1) half, at local coordinates (a, b), a + b <= 1.
static lx_vec2 piece_point(uint32_t grid, uint32_t i, uint32_t j, uint32_t k, float a, float b)
{
    const float n = (float)grid;
    return k == 0 ? (lx_vec2){((float)i + a) / n, ((float)j + b) / n}
                  : (lx_vec2){((float)(i + 1) - a) / n, ((float)(j + 1) - b) / n};
}

// Pieces are numbered row by row. Row i has n - i lower halves and, between them, n - i - 1 upper ones; it and all after it have (n - i)².
static uint32_t piece_number(uint32_t grid, uint32_t i, uint32_t j, uint32_t k)
{
    return grid * grid - (grid - i) * (grid - i) + 2 * j + k;
}

static void piece_of_number(uint32_t grid, uint32_t number, uint32_t *i, uint32_t *j, uint32_t *k)
{
    const uint32_t rest = grid * grid - number, edge = (uint32_t)ceilf(sqrtf((float)rest)); // exact: grid² is small
    *i = grid - edge;
    *j = (edge * edge - rest) / 2;
    *k = (edge * edge - rest) % 2;
}

static float mean_brightness(const lx_tracer *tracer, uint32_t surface, uint32_t triangle, uint32_t grid, uint32_t i,
                             uint32_t j, uint32_t k, uint32_t lookups)
{
    // Centres of a small grid folded into the triangle.
    float sum = 0;
    for (uint32_t y = 0; y < lookups; ++y)
        for (uint32_t x = 0; x < lookups; ++x) {
            float a = ((float)x + 0.5f) / (float)lookups, b = ((float)y + 0.5f) / (float)lookups;
            if (a + b > 1) {
                a = 1 - a;
                b = 1 - b;
            }
            const lx_vec2 uv = piece_point(grid, i, j, k, a, b);
            sum += brightness_of(lx_surface_emission(tracer, surface, triangle, uv.x, uv.y));
        }
    return sum / (float)(lookups * lookups);
}

// Texels along the longest edge of the triangle in its emissive texture.
static float texels_across(const lx_tracer *tracer, uint32_t surface, uint32_t triangle)
{
    const lx_scene *scene = tracer->scene;
    const lx_surface *s = &scene->surfaces[surface];
    const lx_texture_slot *slot = &scene->materials[s->material].emissive_texture;
    if (slot->texture < 0 || scene->textures[slot->texture].image < 0 || lx_surface_is_told_by_cell(tracer, surface)) return 0;
    const lx_image *image = &scene->images[scene->textures[slot->texture].image];
    const lx_primitive *primitive = &scene->primitives[s->primitive];
    const lx_vec2 *uvs = primitive->texcoords[slot->texcoord];
    if (!uvs) return 0;
    const uint32_t *corner = primitive->indices + 3 * (size_t)triangle;
    float longest = 0;
    for (int e = 0; e < 3; ++e) {
        const lx_vec2 d = lx_sub2(uvs[corner[(e + 1) % 3]], uvs[corner[e]]);
        const float du = (slot->m[0] * d.x + slot->m[1] * d.y) * (float)image->width;
        const float dv = (slot->m[3] * d.x + slot->m[4] * d.y) * (float)image->height;
        longest = lx_max(longest, sqrtf(du * du + dv * dv));
    }
    return longest;
}

// Pieces of two texels across, as far as the budget goes.
static uint32_t choose_grid(float texels, uint32_t triangle_count)
{
    return (uint32_t)lx_clamp(lx_min(ceilf(texels * 0.5f), sqrtf(piece_budget / (float)triangle_count)), 1, max_grid);
}

// So many that no texel of a large picture is overlooked, as far as the budget goes.
static uint32_t choose_lookups(float texels, uint32_t grid, uint32_t triangle_count)
{
    const float affordable = sqrtf(lookup_budget / ((float)triangle_count * (float)(grid * grid)));
    return (uint32_t)lx_clamp(lx_min(ceilf(texels / (float)grid), affordable), least_lookups, most_lookups);
}

// Where the search for u in [k / count, (k + 1) / count) begins: almost always at the right step or the one before it, so that a choice costs
// two look-ups instead of a binary search's dozen.
static void build_guide(const float *cdf, uint32_t count, uint32_t *guide)
{
    for (uint32_t k = 0, step = 0; k < count; ++k) {
        const float u = (float)k / (float)count;
        while (step + 1 < count && cdf[step + 1] <= u) ++step;
        guide[k] = step;
    }
}

static void build_piece_guide(const float *cdf, uint32_t count, uint16_t *guide)
{
    uint32_t wide[max_grid * max_grid];
    build_guide(cdf, count, wide);
    for (uint32_t k = 0; k < count; ++k) guide[k] = (uint16_t)wide[k];
}

// Fills the piece table of one triangle; returns its mean brightness.
static lx_result build_pieces(const lx_tracer *tracer, lx_emitters *emitters, size_t *capacity, lx_emitter_triangle *t,
                              lx_emitter_place place, uint32_t lookups, float *out_mean, lx_error *error)
{
    const uint32_t n = t->grid;
    if (n == 1) {
        *out_mean = mean_brightness(tracer, place.surface, place.triangle, 1, 0, 0, 0, lookups);
        return LX_OK;
    }
    const uint32_t entries = n * n;
    if (emitters->piece_count + entries + 1 > UINT32_MAX ||
        !lx_array_reserve(&emitters->piece_cdf, &capacity[0], emitters->piece_count + entries + 1, sizeof *emitters->piece_cdf) ||
        !lx_array_reserve(&emitters->piece_guide, &capacity[1], emitters->piece_count + entries + 1, sizeof *emitters->piece_guide))
        return lx_fail_memory(error, "emitters");
    t->first_cdf = (uint32_t)emitters->piece_count;
    float *cdf = emitters->piece_cdf + t->first_cdf;
    emitters->piece_count += entries + 1;
    double sum = 0;
    for (uint32_t e = 0; e < entries; ++e) {
        uint32_t i, j, k;
        piece_of_number(n, e, &i, &j, &k);
        cdf[e + 1] = mean_brightness(tracer, place.surface, place.triangle, n, i, j, k, lookups);
        sum += (double)cdf[e + 1];
    }
    const double mean = sum / (double)entries;
    double running = 0;
    const double floor_value = mean * (double)least_share;
    cdf[0] = 0;
    for (uint32_t e = 0; e < entries; ++e) {
        running += fmax((double)cdf[e + 1], floor_value);
        cdf[e + 1] = (float)running;
    }
    if (running > 0)
        for (uint32_t e = 1; e <= entries; ++e) cdf[e] = (float)((double)cdf[e] / running);
    build_piece_guide(cdf, entries, emitters->piece_guide + t->first_cdf);
    *out_mean = (float)mean;
    return LX_OK;
}

static lx_result add_surface(lx_tracer *tracer, lx_emitters *emitters, size_t piece_capacity[2], uint32_t surface, lx_error *error)
{
    const lx_primitive *primitive = &tracer->scene->primitives[tracer->scene->surfaces[surface].primitive];
    const lx_material *material = &tracer->scene->materials[tracer->scene->surfaces[surface].material];
    const bool white = material->emissive_texture.texture < 0 || lx_surface_is_told_by_cell(tracer, surface);
    const bool plain = white && tracer->surfaces[surface].kind == LX_SURFACE_OPAQUE;
    const size_t first = emitters->triangle_count;
    tracer->surfaces[surface].first_emitter_triangle = (uint32_t)first;
    emitters->triangle_count += primitive->triangle_count;
    for (uint32_t i = 0; i < primitive->triangle_count; ++i) {
        lx_emitter_triangle *t = &emitters->triangles[first + i];
        lx_vec3 p[3];
        lx_triangle_corners(tracer, surface, i, p);
        *t = (lx_emitter_triangle){.origin = p[0], .edge1 = lx_sub(p[1], p[0]), .edge2 = lx_sub(p[2], p[0]), .plain = plain,
                                   .double_sided = lx_surface_is_double_sided(tracer, surface)};
        emitters->places[first + i] = (lx_emitter_place){surface, i};
        const lx_vec3 cross = lx_scale(lx_cross(t->edge1, t->edge2), tracer->surfaces[surface].orientation);
        t->normal = lx_normalize_or(cross, (lx_vec3){0, 0, 0});
        t->area = 0.5f * lx_length(cross);
        const float texels = t->area > 0 ? texels_across(tracer, surface, i) : 0;
        t->grid = (uint8_t)choose_grid(texels, primitive->triangle_count);
        const uint32_t lookups = choose_lookups(texels, t->grid, primitive->triangle_count);
        float mean = 0;
        const lx_result result = build_pieces(tracer, emitters, piece_capacity, t, emitters->places[first + i], lookups, &mean, error);
        if (result != LX_OK) return result;
        t->probability = mean * t->area; // power for now; divided by the source's below
    }
    return LX_OK;
}

// A tree over the bright triangles of a source, if there are many. Not where light is told by cell: every cell is a layer of its own, and those that
// are far or turned away want their samples as well.
static lx_result build_tree(const lx_tracer *tracer, lx_emitters *emitters, uint32_t source, lx_light_leaf *leaves, lx_error *error)
{
    uint32_t count = 0;
    emitters->roots[source].root = LX_NO_LIGHT_NODE;
    if (tracer->source_cells[source] > 0) return LX_OK;
    for (uint32_t i = emitters->first_triangle[source]; i < emitters->first_triangle[source + 1]; ++i) {
        const lx_emitter_triangle *t = &emitters->triangles[i];
        if (!(t->probability > 0)) continue;
        lx_light_leaf *leaf = &leaves[count++];
        *leaf = (lx_light_leaf){.normal = t->normal, .power = t->probability, .both_sides = t->double_sided, .triangle = i};
        lx_triangle_corners(tracer, emitters->places[i].surface, emitters->places[i].triangle, leaf->corner);
    }
    if (count <= most_without_tree) return LX_OK;
    return lx_light_tree_add(&emitters->tree, leaves, count, &emitters->roots[source], error);
}

static lx_result build_trees(const lx_tracer *tracer, lx_emitters *emitters, lx_error *error)
{
    emitters->tree.place = lx_calloc_array(emitters->triangle_count, sizeof *emitters->tree.place);
    emitters->tree.share_of = lx_calloc_array(emitters->triangle_count, sizeof *emitters->tree.share_of);
    emitters->roots = lx_calloc_array(tracer->scene->source_count, sizeof *emitters->roots);
    lx_light_leaf *leaves = lx_malloc_array(emitters->triangle_count, sizeof *leaves);
    lx_result result = LX_OK;
    if (!emitters->tree.place || !emitters->tree.share_of || !emitters->roots || !leaves) result = lx_fail_memory(error, "light tree");
    for (uint32_t source = 0; result == LX_OK && source < tracer->scene->source_count; ++source)
        result = build_tree(tracer, emitters, source, leaves, error);
    lx_free(leaves);
    return result;
}

// The source's surfaces that are traced shine.
static bool shines(const lx_tracer *tracer, uint32_t surface, uint32_t source)
{
    return tracer->scene->surfaces[surface].source == (int32_t)source && tracer->surfaces[surface].positions;
}

static lx_result make_room(const lx_tracer *tracer, lx_emitters *emitters, lx_error *error)
{
    const lx_scene *scene = tracer->scene;
    size_t count = 0;
    for (uint32_t s = 0; s < scene->surface_count; ++s) {
        const int32_t source = scene->surfaces[s].source;
        if (source >= 0 && shines(tracer, s, (uint32_t)source)) count += scene->primitives[scene->surfaces[s].primitive].triangle_count;
    }
    if (count <= UINT32_MAX) emitters->triangles = lx_malloc_array(count, sizeof *emitters->triangles);
    if (count <= UINT32_MAX) emitters->places = lx_malloc_array(count, sizeof *emitters->places);
    return emitters->triangles && emitters->places ? LX_OK : lx_fail_memory(error, "emitters");
}

lx_result lx_emitters_build(lx_tracer *tracer, lx_error *error)
{
    const lx_scene *scene = tracer->scene;
    lx_emitters *emitters = &tracer->emitters;
    size_t piece_capacity[2] = {0, 0};
    lx_result result = make_room(tracer, emitters, error);
    if (result != LX_OK) return result;
    emitters->first_triangle = lx_calloc_array((size_t)scene->source_count + 1, sizeof(uint32_t));
    emitters->source_power = lx_calloc_array(scene->source_count, sizeof(float));
    if (!emitters->first_triangle || !emitters->source_power) return lx_fail_memory(error, "emitters");
    for (uint32_t source = 0; source < scene->source_count; ++source) {
        emitters->first_triangle[source] = (uint32_t)emitters->triangle_count;
        if (scene->sources[source].kind != LX_SOURCE_EMISSIVE) continue;
        for (uint32_t s = 0; s < scene->surface_count; ++s) {
            if (!shines(tracer, s, source)) continue;
            result = add_surface(tracer, emitters, piece_capacity, s, error);
            if (result != LX_OK) return result;
        }
    }
    emitters->first_triangle[scene->source_count] = (uint32_t)emitters->triangle_count;
    emitters->triangle_cdf = lx_calloc_array(emitters->triangle_count + scene->source_count, sizeof(float));
    emitters->triangle_guide = lx_calloc_array(emitters->triangle_count + scene->source_count, sizeof(uint32_t));
    if (!emitters->triangle_cdf || !emitters->triangle_guide) return lx_fail_memory(error, "emitters");
    for (uint32_t source = 0; source < scene->source_count; ++source) {
        const uint32_t first = emitters->first_triangle[source], end = emitters->first_triangle[source + 1];
        double total = 0;
        for (uint32_t i = first; i < end; ++i) total += (double)emitters->triangles[i].probability;
        emitters->source_power[source] = (float)total;
        float *cdf = emitters->triangle_cdf + first + source;
        double running = 0;
        for (uint32_t i = first; i < end; ++i) {
            lx_emitter_triangle *t = &emitters->triangles[i];
            running += (double)t->probability;
            t->probability = total > 0 ? (float)((double)t->probability / total) : 0;
            cdf[i - first + 1] = total > 0 ? (float)(running / total) : 0;
        }
        build_guide(cdf, end - first, emitters->triangle_guide + first + source);
    }
    return build_trees(tracer, emitters, error);
}

void lx_emitters_release(lx_emitters *emitters)
{
    lx_free(emitters->triangles);
    lx_free(emitters->places);
    lx_free(emitters->triangle_cdf);
    lx_free(emitters->piece_cdf);
    lx_free(emitters->triangle_guide);
    lx_free(emitters->piece_guide);
    lx_free(emitters->first_triangle);
    lx_free(emitters->source_power);
    lx_free(emitters->roots);
    lx_light_tree_release(&emitters->tree);
    *emitters = (lx_emitters){0};
}

// Step of a running sum that u falls into, no earlier than `low`; u becomes its place within the step.
static uint32_t find_step(const float *cdf, uint32_t low, uint32_t count, float *u)
{
    while (low + 1 < count && cdf[low + 1] <= *u) ++low;
    const float width = cdf[low + 1] - cdf[low];
    *u = width > 0 ? lx_clamp((*u - cdf[low]) / width, 0, 0x1.fffffep-1f) : 0.5f;
    return low;
}

uint32_t lx_emitters_choose(const lx_emitters *emitters, uint32_t source, bool by_power, lx_vec3 viewer, float *u, float *probability)
{
    uint32_t index;
    if (!by_power && lx_emitters_has_tree(emitters, source))
        return lx_light_tree_sample(&emitters->tree, emitters->roots[source].root, viewer, u, &index, probability) ? index : LX_NO_EMITTER;
    const uint32_t first = emitters->first_triangle[source], count = emitters->first_triangle[source + 1] - first;
    const float *cdf = emitters->triangle_cdf + first + source;
    if (count == 0 || !(cdf[count] > 0)) return LX_NO_EMITTER;
    const uint32_t *guide = emitters->triangle_guide + first + source;
    index = first + find_step(cdf, guide[(uint32_t)(*u * (float)count)], count, u);
    *probability = emitters->triangles[index].probability;
    return *probability > 0 ? index : LX_NO_EMITTER;
}

// A plain triangle that is near. False: by area.
static bool see_triangle(const lx_emitter_triangle *t, lx_vec3 viewer, lx_spherical_triangle *out)
{
    static const float least_angle = 1e-3f, most_angle = 3; // below, precision ends; above, cosine-weighted rays do better
    const lx_vec3 a = lx_sub(t->origin, viewer), corner[3] = {a, lx_add(a, t->edge1), lx_add(a, t->edge2)};
    if (t->grid != 1 || !lx_emitter_is_near(a, t->edge1, t->edge2, t->area)) return false;
    *out = lx_spherical_triangle_of(corner);
    return out->solid_angle > least_angle && out->solid_angle < most_angle;
}

// Barycentrics of the point of the triangle's plane in a direction, kept within the triangle ([PBR4] 6.5.4).
static lx_vec2 meet_triangle(const lx_emitter_triangle *t, lx_vec3 viewer, lx_vec3 direction)
{
    const lx_vec3 s1 = lx_cross(direction, t->edge2), s = lx_sub(viewer, t->origin);
    const float divisor = lx_dot(s1, t->edge1);
    if (divisor == 0) return (lx_vec2){1.0f / 3, 1.0f / 3};
    const float u = lx_clamp(lx_dot(s, s1) / divisor, 0, 1), v = lx_clamp(lx_dot(direction, lx_cross(s, t->edge1)) / divisor, 0, 1);
    const float sum = lx_max(1, u + v);
    return (lx_vec2){u / sum, v / sum};
}

// Solid angle per m² at a point of the triangle.
static float angle_per_area(const lx_emitter_triangle *t, lx_vec3 viewer, float u, float v)
{
    const lx_vec3 to_point = lx_sub(lx_mad(lx_mad(t->origin, t->edge1, u), t->edge2, v), viewer);
    const float distance2 = lx_dot(to_point, to_point);
    return distance2 > 0 ? fabsf(lx_dot(t->normal, to_point)) / (distance2 * sqrtf(distance2)) : 0;
}

bool lx_emitters_sample(const lx_emitters *emitters, uint32_t source, bool by_power, lx_vec3 viewer, lx_vec2 u, lx_emitter_sample *out)
{
    float probability;
    const uint32_t index = lx_emitters_choose(emitters, source, by_power, viewer, &u.x, &probability);
    return index != LX_NO_EMITTER && lx_emitters_locate(emitters, index, probability, viewer, u, out);
}

void lx_emitters_prefetch(const lx_emitters *emitters, uint32_t index, float u)
{
    const lx_emitter_triangle *t = &emitters->triangles[index];
    const uint32_t entries = (uint32_t)t->grid * t->grid, guess = t->first_cdf + (uint32_t)(u * (float)entries);
    if (t->grid == 1) return;
    LX_PREFETCH(&emitters->piece_guide[guess]);
    LX_PREFETCH(&emitters->piece_cdf[guess]); // where brightness is even, the step is close by
}

bool lx_emitters_locate(const lx_emitters *emitters, uint32_t index, float probability, lx_vec3 viewer, lx_vec2 u, lx_emitter_sample *out)
{
    const lx_emitter_triangle *t = &emitters->triangles[index];
    *out = (lx_emitter_sample){.index = index, .pdf_area = probability / t->area};
    lx_spherical_triangle seen;
    if (see_triangle(t, viewer, &seen)) {
        const lx_vec2 b = meet_triangle(t, viewer, lx_sample_spherical_triangle(&seen, u));
        out->u = b.x;
        out->v = b.y;
        out->pdf_area = probability * angle_per_area(t, viewer, b.x, b.y) / seen.solid_angle;
        return out->pdf_area > 0;
    }
    if (t->grid == 1) {
        const lx_vec2 b = lx_sample_triangle(u);
        out->u = b.x;
        out->v = b.y;
        return true;
    }
    const uint32_t n = t->grid, entries = n * n;
    const float *pieces = emitters->piece_cdf + t->first_cdf;
    const uint16_t *guide = emitters->piece_guide + t->first_cdf;
    const uint32_t e = find_step(pieces, guide[(uint32_t)(u.x * (float)entries)], entries, &u.x);
    uint32_t i, j, k;
    piece_of_number(n, e, &i, &j, &k);
    const lx_vec2 local = lx_sample_triangle(u), b = piece_point(n, i, j, k, local.x, local.y);
    out->u = b.x;
    out->v = b.y;
    out->pdf_area *= (pieces[e + 1] - pieces[e]) * (float)entries;
    return out->pdf_area > 0;
}

float lx_emitters_pdf_area(const lx_emitters *emitters, uint32_t source, uint32_t index, lx_vec3 viewer, float u, float v)
{
    const lx_emitter_triangle *t = &emitters->triangles[index];
    if (!(t->probability > 0)) return 0;
    const bool by_tree = lx_emitters_has_tree(emitters, source);
    const float probability = by_tree ? lx_light_tree_probability(&emitters->tree, index, viewer) : t->probability;
    const float uniform = probability / t->area;
    lx_spherical_triangle seen;
    if (see_triangle(t, viewer, &seen)) return probability * angle_per_area(t, viewer, u, v) / seen.solid_angle;
    if (t->grid == 1) return uniform;
    const uint32_t n = t->grid;
    const float x = lx_clamp(u, 0, 1) * (float)n, y = lx_clamp(v, 0, 1) * (float)n;
    uint32_t i = (uint32_t)x, j = (uint32_t)y;
    if (i >= n) i = n - 1;
    if (j >= n) j = n - 1;
    uint32_t k = (x - (float)i) + (y - (float)j) > 1 ? 1 : 0;
    if (i + j + k >= n) k = 0; // a hit on the long edge, rounded outwards
    if (i + j >= n) return 0;
    const uint32_t e = piece_number(n, i, j, k);
    const float *pieces = emitters->piece_cdf + t->first_cdf;
    return uniform * (pieces[e + 1] - pieces[e]) * (float)(n * n);
}
