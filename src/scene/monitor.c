// Monitors: what the cells of a screen show as the file has it.
#include "scene/monitor.h"

#include "base/error.h"

#include <math.h>

enum { most_lookups = 1 << 20 }; // of one picture

typedef struct sum {
    double r, g, b, weight;
} sum;

static void add(sum *s, lx_vec4 texel, double weight)
{
    s->r += weight * (double)texel.x;
    s->g += weight * (double)texel.y;
    s->b += weight * (double)texel.z;
    s->weight += weight;
}

static lx_rgb mean(const sum *s)
{
    if (!(s->weight > 0)) return (lx_rgb){0, 0, 0};
    return lx_rgb_of((float)(s->r / s->weight), (float)(s->g / s->weight), (float)(s->b / s->weight));
}

// An interval of texture coordinates in texels, low <= high.
typedef struct span {
    double low, high;
} span;

// Where `step` of `count` equal parts of 0…1 goes by scale · t + offset.
static span span_of(uint32_t step, uint32_t count, double scale, double offset, uint32_t texels)
{
    const double a = (scale * step / count + offset) * texels, b = (scale * (step + 1) / count + offset) * texels;
    return a < b ? (span){a, b} : (span){b, a};
}

static double overlap(span s, int64_t texel)
{
    const double low = fmax(s.low, (double)texel), high = fmin(s.high, (double)texel + 1);
    return fmax(high - low, 0);
}

// Whole texels and shares of texels in the span; texels beyond the border are those the sampler would take.
static void add_rectangle(const lx_scene *scene, const lx_texture_slot *slot, const lx_image *image, span x, span y, sum *out)
{
    // Texel centres through an identity slot: with nothing between texels the lookup is the texel itself.
    const lx_texture_slot plain = {.texture = slot->texture, .m = {1, 0, 0, 0, 1, 0}};
    for (int64_t j = (int64_t)floor(y.low); (double)j < y.high; ++j)
        for (int64_t i = (int64_t)floor(x.low); (double)i < x.high; ++i) {
            const lx_vec2 uv = {(float)(((double)i + 0.5) / image->width), (float)(((double)j + 0.5) / image->height)};
            add(out, lx_texture_sample(scene, &plain, uv, true), overlap(x, i) * overlap(y, j));
        }
}

static bool is_upright(const lx_texture_slot *slot)
{
    return slot->m[1] == 0 && slot->m[3] == 0 && fabsf(slot->m[0]) <= 1 && fabsf(slot->m[4]) <= 1 && slot->m[0] != 0 && slot->m[4] != 0 &&
           fabsf(slot->m[2]) <= 16 && fabsf(slot->m[5]) <= 16;
}

static void average_upright(const lx_scene *scene, const lx_source *source, const lx_texture_slot *slot, const lx_image *image, lx_rgb *out)
{
    for (uint32_t row = 0; row < source->rows; ++row)
        for (uint32_t column = 0; column < source->columns; ++column) {
            sum s = {0};
            add_rectangle(scene, slot, image, span_of(column, source->columns, (double)slot->m[0], (double)slot->m[2], image->width),
                          span_of(row, source->rows, (double)slot->m[4], (double)slot->m[5], image->height), &s);
            out[row * source->columns + column] = mean(&s);
        }
}

// Turned or repeated pictures: centres of a fine grid in each cell.
static void average_by_lookups(const lx_scene *scene, const lx_source *source, const lx_texture_slot *slot, lx_rgb *out)
{
    const uint32_t cells = lx_source_cell_count(source);
    const uint32_t edge = (uint32_t)lx_clamp(sqrtf((float)most_lookups / (float)cells), 4, 256);
    for (uint32_t cell = 0; cell < cells; ++cell) {
        sum s = {0};
        for (uint32_t j = 0; j < edge; ++j)
            for (uint32_t i = 0; i < edge; ++i) {
                const lx_vec2 uv = {((float)(cell % source->columns) + ((float)i + 0.5f) / (float)edge) / (float)source->columns,
                                    ((float)(cell / source->columns) + ((float)j + 0.5f) / (float)edge) / (float)source->rows};
                add(&s, lx_texture_sample(scene, slot, uv, true), 1);
            }
        out[cell] = mean(&s);
    }
}

static lx_vec2 mix_corners(const lx_vec2 *uv, const uint32_t *corner, float u, float v)
{
    const lx_vec2 a = uv[corner[0]], b = uv[corner[1]], c = uv[corner[2]];
    const float w = 1 - u - v;
    return (lx_vec2){w * a.x + u * b.x + v * c.x, w * a.y + u * b.y + v * c.y};
}

// Pictures mapped by another set: what part of them lies in a cell is known to the triangles alone. Their points count by area on
// the screen (in the mesh's space).
static void add_triangles(const lx_scene *scene, const lx_source *source, const lx_surface *surface, const lx_texture_slot *slot, sum *sums)
{
    const lx_primitive *p = &scene->primitives[surface->primitive];
    const lx_vec2 *cells = p->texcoords[0], *picture = p->texcoords[slot->texcoord];
    const float edge_limit = sqrtf((float)most_lookups / (float)(p->triangle_count ? p->triangle_count : 1));
    const uint32_t edge = (uint32_t)lx_clamp(edge_limit, 2, 512);
    for (uint32_t t = 0; cells && picture && t < p->triangle_count; ++t) {
        const uint32_t *corner = &p->indices[3 * (size_t)t];
        const lx_vec3 a = p->positions[corner[0]];
        const lx_vec3 cross = lx_cross(lx_sub(p->positions[corner[1]], a), lx_sub(p->positions[corner[2]], a));
        const double weight = (double)lx_length(cross) / ((double)edge * edge);
        for (uint32_t j = 0; j < edge && weight > 0; ++j)
            for (uint32_t i = 0; i < edge; ++i) {
                float u = ((float)i + 0.5f) / (float)edge, v = ((float)j + 0.5f) / (float)edge;
                if (u + v > 1) {
                    u = 1 - u;
                    v = 1 - v;
                }
                add(&sums[lx_monitor_cell(source, mix_corners(cells, corner, u, v))],
                    lx_texture_sample(scene, slot, mix_corners(picture, corner, u, v), true), weight);
            }
    }
}

static lx_result average_by_triangles(const lx_scene *scene, uint32_t index, const lx_texture_slot *slot, lx_rgb *out, lx_error *error)
{
    const lx_source *source = &scene->sources[index];
    const uint32_t cells = lx_source_cell_count(source);
    sum *sums = lx_calloc_array(cells, sizeof *sums);
    if (!sums) return lx_fail_memory(error, "monitor");
    for (uint32_t s = 0; s < scene->surface_count; ++s)
        if (scene->surfaces[s].source == (int32_t)index) add_triangles(scene, source, &scene->surfaces[s], slot, sums);
    for (uint32_t i = 0; i < cells; ++i) out[i] = mean(&sums[i]);
    lx_free(sums);
    return LX_OK;
}

lx_result lx_monitor_average(const lx_scene *scene, uint32_t index, lx_rgb *out, lx_error *error)
{
    const lx_source *source = &scene->sources[index];
    const lx_texture_slot *slot = &scene->materials[source->material].emissive_texture;
    const int32_t image_index = slot->texture < 0 ? -1 : scene->textures[slot->texture].image;
    const lx_image *image = image_index < 0 ? NULL : &scene->images[image_index];
    if (!image || image->width == 0) {
        for (uint32_t i = 0; i < lx_source_cell_count(source); ++i) out[i] = lx_rgb_grey(1);
        return LX_OK;
    }
    if (slot->texcoord != 0) return average_by_triangles(scene, index, slot, out, error);
    if (is_upright(slot))
        average_upright(scene, source, slot, image, out);
    else
        average_by_lookups(scene, source, slot, out);
    return LX_OK;
}
