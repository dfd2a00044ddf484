// Who neighbours whom on the surface, for the denoiser.
//
// A luxel's nearest neighbours are the eight around it in its chart; where the chart ends, the luxel of another chart (or of the same one, once
// around a column) that lies where the neighbour would. Steps of 2, 4 and 8 texels are walks of two steps of half the length, so that a
// walk is possible only where every single step is: whatever stands on a continuous floor splits it. Charts are turned against each other; a
// walk that enters one goes on in the grid direction that is closest to the one it came in.
#include "post/denoise_graph.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

enum {
    direction_count = lx_denoise_direction_count,
    level_count = lx_denoise_level_count,
    part_size = 4096, // luxels of one task
    step_batch = 512,
    no_direction = 0xff,
};

static const int direction_x[direction_count] = {1, 1, 0, -1, -1, -1, 0, 1};
static const int direction_y[direction_count] = {0, 1, 1, 1, 0, -1, -1, -1};

// Normals this far apart (cosine) have nothing to tell each other: 45 degrees.
static const float least_cosine = 0.7f;
// A neighbour may lie this far above or below the tangent plane, as a share of its distance: more is a step, not a slope.
static const float most_slope = 0.35f;
// Farther than this many texels is no neighbour, whatever the atlas says.
static const float most_stretch = 2.5f;
// Luxels of unlike size are neighbours up to this ratio; a step would change its meaning beyond.
static const float most_size_ratio = 3;

typedef struct frame {
    lx_vec3 x, y; // one texel to the right, one texel down, in metres of world space
} frame;

// Luxels at the edge of their charts by their place: those of a cell are order[end[cell - 1]] … order[end[cell] - 1].
typedef struct border_grid {
    uint32_t *order, *end;
    uint32_t cell_count; // a power of two; cells are hashed
    float cell_edge;
    lx_vec3 origin;
} border_grid;

typedef struct build {
    const lx_luxel_map *map;
    lx_step_test can_step;
    void *user;
    uint32_t *links;      // of the graph
    uint8_t *exits;       // [level parity][luxel][direction] which way a walk goes on
    frame *frames;        // [luxel]
    uint8_t *is_border;   // [luxel]
    border_grid borders;
    uint32_t level;       // being built
} build;

static uint32_t pack_link(uint32_t luxel, uint32_t weight) { return luxel << lx_denoise_weight_bits | weight; }

static uint32_t *links_of(const build *b, uint32_t level, uint32_t luxel)
{
    return b->links + ((size_t)level * b->map->count + luxel) * direction_count;
}

static uint8_t *exits_of(const build *b, uint32_t level, uint32_t luxel)
{
    return b->exits + ((size_t)(level & 1) * b->map->count + luxel) * direction_count;
}

// ---- in the chart -----------------------------------------------------------------------------------------------------------

// The luxel beside `luxel` in its chart and on its page; LX_NO_LUXEL if there is none.
static uint32_t beside(const lx_luxel_map *map, uint32_t luxel, int direction)
{
    const uint32_t size = map->page_size, texel = map->texel[luxel];
    const size_t page_texels = (size_t)size * size, page = texel / page_texels, on_page = texel % page_texels;
    const int64_t x = (int64_t)(on_page % size) + direction_x[direction], y = (int64_t)(on_page / size) + direction_y[direction];
    if (x < 0 || y < 0 || x >= size || y >= size) return LX_NO_LUXEL;
    const uint32_t other = map->index[page * page_texels + (size_t)y * size + (size_t)x];
    return other != LX_NO_LUXEL && map->chart[other] == map->chart[luxel] ? other : LX_NO_LUXEL;
}

static float texel_length(int direction) { return direction & 1 ? 1.41421356f : 1; }

// Of 15: how much the light of two normals can have in common.
static uint32_t weight_of_normals(lx_vec3 a, lx_vec3 b)
{
    const float share = (lx_dot(a, b) - least_cosine) / (1 - least_cosine);
    return share > 0 ? (uint32_t)(lx_min(share, 1) * lx_denoise_most_weight + 0.5f) : 0;
}

// Do the two lie on one surface, as far as their places and normals tell?
static bool is_one_surface(const lx_luxel_map *map, uint32_t a, uint32_t b)
{
    const lx_vec3 between = lx_sub(map->position[b], map->position[a]);
    const float limit = most_slope * lx_max(lx_length(between), 0.25f * lx_min(map->size_m[a], map->size_m[b]));
    return lx_dot(map->normal[a], map->normal[b]) > least_cosine && fabsf(lx_dot(between, map->normal[a])) <= limit &&
           fabsf(lx_dot(between, map->normal[b])) <= limit;
}

static bool is_step(const lx_luxel_map *map, uint32_t from, uint32_t to, int direction)
{
    const float reach = most_stretch * texel_length(direction) * lx_max(map->size_m[from], map->size_m[to]);
    return map->valid[from] && map->valid[to] && lx_distance(map->position[from], map->position[to]) <= reach && is_one_surface(map, from, to);
}

// One axis of a luxel's frame, from its neighbours on both sides or one; false if it has none.
static bool measure_axis(const lx_luxel_map *map, uint32_t luxel, int direction, lx_vec3 *out)
{
    const uint32_t ahead = beside(map, luxel, direction), behind = beside(map, luxel, direction ^ 4);
    if (ahead == LX_NO_LUXEL && behind == LX_NO_LUXEL) return false;
    const lx_vec3 to = map->position[ahead == LX_NO_LUXEL ? luxel : ahead], from = map->position[behind == LX_NO_LUXEL ? luxel : behind];
    // Places are means of what is covered, so distances vary at the chart's edge: the direction counts, the length is the texel's.
    const lx_vec3 n = map->normal[luxel], along = lx_sub(to, from);
    const lx_vec3 axis = lx_normalize_or(lx_mad(along, n, -lx_dot(along, n)), (lx_vec3){0, 0, 0});
    *out = lx_scale(axis, map->size_m[luxel]);
    return lx_dot(axis, axis) > 0;
}

static frame measure_frame(const lx_luxel_map *map, uint32_t luxel)
{
    frame f;
    const lx_vec3 n = map->normal[luxel];
    const bool has_x = measure_axis(map, luxel, 0, &f.x), has_y = measure_axis(map, luxel, 2, &f.y);
    if (!has_x && !has_y) { // a chart of one texel: any frame serves
        lx_tangent_frame(n, &f.x, &f.y);
        f.x = lx_scale(f.x, map->size_m[luxel]);
        f.y = lx_scale(f.y, map->size_m[luxel]);
    } else if (!has_x) {
        f.x = lx_cross(f.y, n);
    } else if (!has_y) {
        f.y = lx_cross(n, f.x);
    }
    return f;
}

static lx_vec3 frame_step(const frame *f, int direction)
{
    return lx_add(lx_scale(f->x, (float)direction_x[direction]), lx_scale(f->y, (float)direction_y[direction]));
}

static lx_result measure_part(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    build *b = user;
    const uint32_t end = task * part_size + part_size < b->map->count ? (uint32_t)(task + 1) * part_size : b->map->count;
    for (uint32_t i = (uint32_t)task * part_size; i < end; ++i) {
        b->frames[i] = measure_frame(b->map, i);
        b->is_border[i] = false;
        for (int d = 0; d < direction_count; ++d) b->is_border[i] |= beside(b->map, i, d) == LX_NO_LUXEL;
    }
    return LX_OK;
}

// ---- across seams -----------------------------------------------------------------------------------------------------------

static uint32_t hash_cell(const border_grid *grid, int64_t x, int64_t y, int64_t z)
{
    const uint64_t h = (uint64_t)x * 0x9e3779b97f4a7c15u ^ (uint64_t)y * 0xc2b2ae3d27d4eb4fu ^ (uint64_t)z * 0x165667b19e3779f9u;
    return (uint32_t)((h ^ h >> 29) * 0xbf58476d1ce4e5b9u >> 32) & (grid->cell_count - 1);
}

static void cell_of(const border_grid *grid, lx_vec3 p, int64_t out[3])
{
    const lx_vec3 q = lx_sub(p, grid->origin);
    out[0] = (int64_t)floorf(q.x / grid->cell_edge);
    out[1] = (int64_t)floorf(q.y / grid->cell_edge);
    out[2] = (int64_t)floorf(q.z / grid->cell_edge);
}

static uint32_t cell_hash_of(const border_grid *grid, lx_vec3 p)
{
    int64_t cell[3];
    cell_of(grid, p, cell);
    return hash_cell(grid, cell[0], cell[1], cell[2]);
}

// A counting sort by cell, stable: luxels of a cell are in ascending order.
static lx_result sort_borders(build *b, lx_error *error)
{
    const lx_luxel_map *map = b->map;
    border_grid *grid = &b->borders;
    uint32_t count = 0;
    double size_sum = 0;
    for (uint32_t i = 0; i < map->count; ++i) {
        if (!b->is_border[i] || !map->valid[i]) continue;
        if (count++ == 0) grid->origin = map->position[i];
        size_sum += (double)map->size_m[i];
    }
    grid->cell_edge = count ? (float)(2 * size_sum / count) : 1;
    if (!(grid->cell_edge > 0)) grid->cell_edge = 1;
    for (grid->cell_count = 1; grid->cell_count < count;) grid->cell_count *= 2;
    grid->end = lx_calloc_array((size_t)grid->cell_count + 1, sizeof *grid->end);
    grid->order = lx_malloc_array(count, sizeof *grid->order);
    if (!grid->end || !grid->order) return lx_fail_memory(error, "denoising");
    for (uint32_t i = 0; i < map->count; ++i)
        if (b->is_border[i] && map->valid[i]) ++grid->end[cell_hash_of(grid, map->position[i]) + 1];
    for (uint32_t c = 0; c < grid->cell_count; ++c) grid->end[c + 1] += grid->end[c];
    for (uint32_t i = 0; i < map->count; ++i) // end[c] starts as where cell c begins
        if (b->is_border[i] && map->valid[i]) grid->order[grid->end[cell_hash_of(grid, map->position[i])]++] = i;
    return LX_OK;
}

// Are two luxels near each other on one chart anyway? Then no seam is between them.
static bool is_same_patch(const lx_luxel_map *map, uint32_t a, uint32_t b)
{
    if (map->chart[a] != map->chart[b]) return false;
    const uint32_t size = map->page_size;
    const int64_t dx = (int64_t)(map->texel[a] % size) - map->texel[b] % size;
    const int64_t dy = (int64_t)(map->texel[a] / size) - map->texel[b] / size;
    return dx * dx + dy * dy <= 8;
}

static bool is_seam_step(const lx_luxel_map *map, uint32_t from, uint32_t to)
{
    const float a = map->size_m[from], b = map->size_m[to];
    return from != to && a <= most_size_ratio * b && b <= most_size_ratio * a && !is_same_patch(map, from, to) && is_one_surface(map, from, to);
}

// The luxel beyond the chart's edge that lies nearest to where the neighbour in `direction` would; LX_NO_LUXEL if none is near enough.
static uint32_t across(const build *b, uint32_t luxel, int direction)
{
    enum { most_cells = 6 }; // along an axis: luxels far larger than the rest look around themselves less widely
    const lx_luxel_map *map = b->map;
    const border_grid *grid = &b->borders;
    const lx_vec3 target = lx_add(map->position[luxel], frame_step(&b->frames[luxel], direction));
    const float reach = 0.75f * map->size_m[luxel];
    int64_t low[3], high[3];
    cell_of(grid, lx_sub(target, lx_v3(reach, reach, reach)), low);
    cell_of(grid, lx_add(target, lx_v3(reach, reach, reach)), high);
    uint32_t best = LX_NO_LUXEL;
    float best_distance = reach;
    for (int axis = 0; axis < 3; ++axis)
        if (high[axis] - low[axis] >= most_cells) high[axis] = low[axis] + most_cells - 1;
    for (int64_t z = low[2]; z <= high[2]; ++z)
        for (int64_t y = low[1]; y <= high[1]; ++y)
            for (int64_t x = low[0]; x <= high[0]; ++x) {
                const uint32_t cell = hash_cell(grid, x, y, z);
                for (uint32_t k = cell ? grid->end[cell - 1] : 0; k < grid->end[cell]; ++k) {
                    const uint32_t other = grid->order[k];
                    const float distance = lx_distance(map->position[other], target);
                    if (distance > best_distance || (distance == best_distance && other >= best) || !is_seam_step(map, luxel, other)) continue;
                    best = other;
                    best_distance = distance;
                }
            }
    return best;
}

// The direction in which a walk goes on that came into `to`'s chart along `along`.
static uint8_t direction_after(const build *b, uint32_t to, lx_vec3 along)
{
    uint8_t best = 0;
    float best_cosine = -INFINITY;
    for (uint8_t d = 0; d < direction_count; ++d) {
        const lx_vec3 step = frame_step(&b->frames[to], d);
        const float cosine = lx_dot(along, step) / lx_max(lx_length(step), 1e-30f);
        if (cosine > best_cosine) {
            best = d;
            best_cosine = cosine;
        }
    }
    return best;
}

// ---- levels -----------------------------------------------------------------------------------------------------------------

typedef struct step_list {
    lx_luxel_step steps[step_batch];
    uint32_t *links[step_batch]; // where each came from
    size_t count;
} step_list;

// Closes the steps of a list that something stands in the way of.
static void test_steps(const build *b, step_list *list)
{
    bool open[step_batch];
    if (list->count == 0) return;
    b->can_step(b->user, list->steps, list->count, open);
    for (size_t i = 0; i < list->count; ++i)
        if (!open[i]) *list->links[i] = pack_link(list->steps[i].from, 0);
    list->count = 0;
}

static void start_links(const build *b, uint32_t luxel)
{
    uint32_t *links = links_of(b, 0, luxel);
    uint8_t *exits = exits_of(b, 0, luxel);
    for (int d = 0; d < direction_count; ++d) {
        links[d] = pack_link(luxel, 0);
        exits[d] = (uint8_t)d;
    }
}

// Steps of one texel: in the chart, and where it ends across its edge. In a chart each pair is looked at from one of its ends (the other takes it
// over in mirror_part); across seams both do, since the one's best partner may have a better one.
static lx_result link_part(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const build *b = user;
    const lx_luxel_map *map = b->map;
    step_list list;
    list.count = 0;
    const uint32_t end = task * part_size + part_size < map->count ? (uint32_t)(task + 1) * part_size : map->count;
    for (uint32_t i = (uint32_t)task * part_size; i < end; ++i) {
        start_links(b, i);
        for (int d = 0; d < direction_count && map->valid[i]; ++d) {
            uint32_t other = beside(map, i, d);
            if (other == LX_NO_LUXEL) {
                other = across(b, i, d);
                if (other == LX_NO_LUXEL) continue;
                exits_of(b, 0, i)[d] = direction_after(b, other, frame_step(&b->frames[i], d));
            } else if (d >= direction_count / 2 || !is_step(map, i, other, d)) {
                continue;
            }
            const uint32_t weight = weight_of_normals(map->normal[i], map->normal[other]);
            if (weight == 0) continue;
            uint32_t *link = &links_of(b, 0, i)[d];
            *link = pack_link(other, weight);
            if (!b->can_step) continue;
            list.links[list.count] = link;
            list.steps[list.count++] = (lx_luxel_step){i, other};
            if (list.count == step_batch) test_steps(b, &list);
        }
    }
    test_steps(b, &list);
    return LX_OK;
}

static lx_result mirror_part(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const build *b = user;
    const uint32_t end = task * part_size + part_size < b->map->count ? (uint32_t)(task + 1) * part_size : b->map->count;
    for (uint32_t i = (uint32_t)task * part_size; i < end; ++i)
        for (int d = direction_count / 2; d < direction_count; ++d) {
            const uint32_t other = beside(b->map, i, d);
            if (other == LX_NO_LUXEL) continue;
            const uint32_t back = links_of(b, 0, other)[d ^ (direction_count / 2)];
            if (back >> lx_denoise_weight_bits == i) links_of(b, 0, i)[d] = pack_link(other, back & lx_denoise_most_weight);
        }
    return LX_OK;
}

// Steps of 2^level texels: two walks of the level below.
static lx_result widen_part(void *user, size_t task, uint32_t worker, lx_error *error)
{
    (void)worker;
    (void)error;
    const build *b = user;
    const lx_luxel_map *map = b->map;
    const uint32_t end = task * part_size + part_size < map->count ? (uint32_t)(task + 1) * part_size : map->count;
    for (uint32_t i = (uint32_t)task * part_size; i < end; ++i) {
        const uint32_t *near = links_of(b, b->level - 1, i);
        const uint8_t *near_exits = exits_of(b, b->level - 1, i);
        uint32_t *links = links_of(b, b->level, i);
        uint8_t *exits = exits_of(b, b->level, i);
        for (int d = 0; d < direction_count; ++d) {
            links[d] = pack_link(i, 0);
            exits[d] = no_direction;
            const uint32_t middle = near[d] >> lx_denoise_weight_bits;
            if (middle == i) continue;
            const uint8_t onward = near_exits[d];
            const uint32_t other = links_of(b, b->level - 1, middle)[onward] >> lx_denoise_weight_bits;
            if (other == middle || other == i) continue;
            const uint32_t weight = weight_of_normals(map->normal[i], map->normal[other]);
            if (weight == 0) continue;
            links[d] = pack_link(other, weight);
            exits[d] = exits_of(b, b->level - 1, middle)[onward];
        }
    }
    return LX_OK;
}

lx_result lx_denoise_graph_create(const lx_luxel_map *map, lx_step_test can_step, void *user, lx_pool *pool, lx_denoise_graph **out_graph,
                                  lx_error *error)
{
    lx_result result = LX_OK;
    lx_denoise_graph *graph = NULL;
    build b = {.map = map, .can_step = can_step, .user = user};
    const size_t per_level = (size_t)map->count * direction_count, part_count = ((size_t)map->count + part_size - 1) / part_size;
    if (map->count >> (32 - lx_denoise_weight_bits))
        return lx_fail(error, LX_ERROR_LIMIT, "%u texels are too many to denoise; fewer or smaller pages do", map->count);
    graph = lx_calloc_array(1, sizeof *graph);
    if (graph) graph->links = lx_malloc_array(per_level, level_count * sizeof *graph->links);
    b.exits = lx_malloc_array(per_level, 2);
    b.frames = lx_malloc_array(map->count, sizeof *b.frames);
    b.is_border = lx_malloc_array(map->count, sizeof *b.is_border);
    if (!graph || !graph->links || !b.exits || !b.frames || !b.is_border) {
        result = lx_fail_memory(error, "denoising");
        goto cleanup;
    }
    graph->luxel_count = map->count;
    b.links = graph->links;
    LX_TRY(lx_pool_run(pool, part_count, measure_part, &b, NULL, NULL, error));
    LX_TRY(sort_borders(&b, error));
    LX_TRY(lx_pool_run(pool, part_count, link_part, &b, NULL, NULL, error));
    LX_TRY(lx_pool_run(pool, part_count, mirror_part, &b, NULL, NULL, error));
    for (b.level = 1; b.level < level_count; ++b.level) LX_TRY(lx_pool_run(pool, part_count, widen_part, &b, NULL, NULL, error));
    *out_graph = graph;
    graph = NULL;
cleanup:
    lx_free(b.exits);
    lx_free(b.frames);
    lx_free(b.is_border);
    lx_free(b.borders.order);
    lx_free(b.borders.end);
    lx_denoise_graph_destroy(graph);
    return result;
}

void lx_denoise_graph_destroy(lx_denoise_graph *graph)
{
    if (!graph) return;
    lx_free(graph->links);
    lx_free(graph);
}

size_t lx_denoise_graph_bytes(uint32_t luxel_count)
{
    return sizeof(lx_denoise_graph) + (size_t)luxel_count * direction_count * level_count * sizeof(uint32_t);
}

size_t lx_denoise_graph_build_bytes(uint32_t luxel_count)
{
    // Borders at most all luxels: an order, and cells up to twice as many.
    return lx_denoise_graph_bytes(luxel_count) + (size_t)luxel_count * (2 * direction_count + sizeof(frame) + 1 + 3 * sizeof(uint32_t));
}
