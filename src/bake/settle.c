// Which sites of a texel tell of its light.
//
// Most texels have nothing near: one look from one site serves all. Only where a surface reaches into a texel is each site looked at, and only where
// nearly all of them are covered are they moved.
#include "bake/texel_sites.h"

#include "base/error.h"
#include "math/sobol.h"
#include "trace/sampling.h"

#include <string.h>

enum {
    first_looks = 4,     // rays that tell most places, in the open or inside,
    all_looks = 16,      // and those that decide for the rest:
    most_backs = 4,      // one in so many. More: the place is inside something
    enough_sites = 4,    // good ones that lie where they fell: no need to move others
    most_failures = 3,   // to move a site: the others would not fare better
    most_pieces = 6,     // texels of more triangles are looked at site by site
    direction_count = 8, // of moves; diagonals reach the inner corner of a room from under it
    most_crossings = 8,  // along one of them
    most_moves = 3,      // out of one solid, then out of the next
};

typedef struct exit_point {
    float distance; // from the site
    lx_vec3 position;
} exit_point;

// What is known of a texel's sites while they settle.
typedef struct company {
    const lx_tracer *tracer;
    uint32_t stream;
    lx_receiver sites[lx_site_count];
    float texel_m[lx_site_count];
    uint32_t surface[lx_site_count];
    uint32_t good, moved; // bit k: site k
    bool split;           // the good ones lie in more than one room, or some of them under something low
} company;

// ---- what a place sees ------------------------------------------------------------------------------------------------------

// Does the ray meet the inside of something solid?
static bool is_back(const lx_tracer *tracer, const lx_ray *ray, const lx_hit *hit)
{
    if (hit->surface == LX_MISS || !lx_surface_is_solid(tracer, hit->surface)) return false;
    lx_vec3 position, normal;
    lx_hit_geometry(tracer, hit, &position, &normal);
    return lx_dot(normal, ray->direction) > 0;
}

static lx_ray look(const lx_receiver *r, uint32_t stream, uint32_t number)
{
    const lx_vec3 local = lx_sample_cosine_hemisphere(lx_sobol_pair(number, stream));
    return (lx_ray){.origin = lx_offset_origin(r->position, r->geometric_normal), .direction = lx_to_world(r->geometric_normal, local), .t_max = INFINITY};
}

typedef struct view {
    uint32_t looks, backs;
} view;

// What is touched rather than seen does not count: in the corner of two walls it would hide what the place is inside of. Ends early where so many backs were seen that no
// further look makes the place open.
static void look_around(const company *c, const lx_receiver *r, uint32_t site, uint32_t first, uint32_t end, view *out)
{
    const uint32_t stream = lx_hash_combine(c->stream, 0x51e30000u + site);
    const float touch = 0.01f * c->texel_m[site];
    for (uint32_t i = first; i < end && most_backs * out->backs <= all_looks; ++i) {
        const lx_ray ray = look(r, stream, i);
        lx_hit hit;
        lx_trace_closest(c->tracer, &ray, &hit, 1);
        if (hit.surface != LX_MISS && hit.t < touch) continue;
        ++out->looks;
        out->backs += is_back(c->tracer, &ray, &hit);
    }
}

static bool is_open(const view *v)
{
    return v->looks > 0 && most_backs * v->backs <= v->looks;
}

static bool is_surely_good(const company *c, const lx_receiver *r, uint32_t site)
{
    view v = {0};
    look_around(c, r, site, 0, all_looks, &v);
    return is_open(&v);
}

// Quicker; one place in twenty that looks at backs half around passes.
static bool is_good(const company *c, const lx_receiver *r, uint32_t site)
{
    view v = {0};
    look_around(c, r, site, 0, first_looks / 2, &v);
    if (v.backs == first_looks / 2) return false;
    look_around(c, r, site, first_looks / 2, first_looks, &v);
    if (v.looks == first_looks && v.backs == 0) return true;
    look_around(c, r, site, first_looks, all_looks, &v);
    return is_open(&v);
}

// One look from each site. True if none of them sees a back: then all are good.
static bool all_look_free(const company *c)
{
    lx_ray rays[lx_site_count];
    lx_hit hits[lx_site_count];
    for (uint32_t k = 0; k < lx_site_count; ++k) rays[k] = look(&c->sites[k], lx_hash_combine(c->stream, 0x51e4u), k);
    lx_trace_closest(c->tracer, rays, hits, lx_site_count);
    for (uint32_t k = 0; k < lx_site_count; ++k)
        if (is_back(c->tracer, &rays[k], &hits[k])) return false;
    return true;
}

// Does something hang so low over any of the good sites that little of what they send out is seen but from below it? It may be far brighter (a lamp under a ceiling lights
// what it hides) or darker than what is beside it.
static bool is_covered(const company *c)
{
    lx_ray rays[lx_site_count];
    lx_rgb passes[lx_site_count];
    uint32_t count = 0;
    for (uint32_t k = 0; k < lx_site_count; ++k) {
        if (!(c->good >> k & 1)) continue;
        const lx_receiver *r = &c->sites[k];
        rays[count++] = (lx_ray){.origin = lx_offset_origin(r->position, r->geometric_normal), .direction = r->geometric_normal, .t_max = 0.5f * c->texel_m[k]};
    }
    lx_trace_transmittance(c->tracer, rays, passes, count);
    for (uint32_t i = 0; i < count; ++i)
        if (lx_rgb_is_black(passes[i])) return true;
    return false;
}

// ---- moving out -------------------------------------------------------------------------------------------------------------

static void tangent_directions(lx_vec3 normal, lx_vec3 out[direction_count])
{
    lx_vec3 t, b;
    lx_tangent_frame(normal, &t, &b);
    const lx_vec3 all[direction_count] = {t, lx_neg(t), b, lx_neg(b), lx_add(t, b), lx_sub(t, b), lx_sub(b, t), lx_neg(lx_add(t, b))};
    memcpy(out, all, sizeof all);
}

// From within a solid along `ray` to where its surface is left, counting those that are entered on the way. False: not within the ray.
static bool find_exit(const lx_tracer *tracer, lx_ray ray, exit_point *out)
{
    int depth = 1;
    lx_hit hit, last = {.surface = LX_MISS};
    for (int i = 0; i < most_crossings; ++i) {
        lx_trace_closest(tracer, &ray, &hit, 1);
        if (hit.surface == LX_MISS) return false;
        lx_ray_step_past(&ray, &hit);
        if ((hit.surface == last.surface && hit.triangle == last.triangle) || !lx_surface_is_solid(tracer, hit.surface)) continue;
        last = hit;
        depth += is_back(tracer, &ray, &hit) ? -1 : 1;
        if (depth > 0) continue;
        lx_vec3 position, normal;
        lx_hit_geometry(tracer, &hit, &position, &normal);
        *out = (exit_point){hit.t * lx_length(ray.direction), lx_offset_origin(position, normal)};
        return true;
    }
    return false;
}

// All ways out of the solid around a place, nearest first.
static int find_exits(const lx_tracer *tracer, const lx_receiver *r, float reach, exit_point out[direction_count])
{
    lx_vec3 directions[direction_count];
    tangent_directions(r->geometric_normal, directions);
    const lx_vec3 origin = lx_offset_origin(r->position, r->geometric_normal);
    int count = 0;
    for (int i = 0; i < direction_count; ++i) {
        exit_point found;
        if (!find_exit(tracer, (lx_ray){.origin = origin, .direction = directions[i], .t_max = reach}, &found)) continue;
        int at = count++;
        for (; at > 0 && out[at - 1].distance > found.distance; --at) out[at] = out[at - 1];
        out[at] = found;
    }
    return count;
}

// A place must stay over the texel's own surface, by a margin: beyond its edge, or on it, light is that of another room or of the open air.
static bool is_over(const lx_tracer *tracer, uint32_t surface, float texel_m, const lx_receiver *from, const lx_receiver *to)
{
    const float height = 0.05f * texel_m, margin = 0.02f * texel_m;
    const lx_vec3 way = lx_normalize_or(lx_sub(to->position, from->position), (lx_vec3){0, 0, 0});
    const lx_vec3 n = to->geometric_normal, place = lx_mad(to->position, way, margin);
    const lx_ray ray = {.origin = lx_mad(place, n, height), .direction = lx_neg(n), .t_max = 2 * height};
    lx_hit hit;
    lx_trace_closest(tracer, &ray, &hit, 1);
    if (hit.surface != surface) return false;
    lx_vec3 position, normal;
    lx_hit_geometry(tracer, &hit, &position, &normal);
    return lx_dot(normal, n) > 0.5f;
}

static bool move_out(const company *c, uint32_t site, lx_receiver *r)
{
    for (int move = 0; move < most_moves; ++move) {
        exit_point exits[direction_count];
        const int count = find_exits(c->tracer, r, c->texel_m[site], exits);
        lx_receiver next = *r;
        bool found = false;
        for (int i = 0; i < count; ++i) {
            lx_receiver there = *r;
            there.position = exits[i].position;
            if (!is_over(c->tracer, c->surface[site], c->texel_m[site], r, &there)) continue;
            if (is_surely_good(c, &there, site)) {
                *r = there;
                return true;
            }
            if (!found) next = there;
            found = true;
        }
        if (!found) return false;
        *r = next;
    }
    return false;
}

// ---- rooms ------------------------------------------------------------------------------------------------------------------

static lx_ray between(lx_vec3 a, lx_vec3 b)
{
    return (lx_ray){.origin = a, .direction = lx_sub(b, a), .t_max = 1};
}

static lx_vec3 above(const company *c, uint32_t site, float height)
{
    const lx_receiver *r = &c->sites[site];
    return lx_mad(lx_offset_origin(r->position, r->geometric_normal), r->geometric_normal, height);
}

// Sites among `others` that `from` sees: along the surface, or over something as low as a kerb.
static uint32_t seen_from(const company *c, uint32_t from, uint32_t others)
{
    lx_ray rays[3 * lx_site_count];
    lx_rgb passes[3 * lx_site_count];
    uint32_t count = 0, seen = 0;
    for (uint32_t k = 0; k < lx_site_count; ++k)
        if (others >> k & 1) rays[count++] = between(above(c, from, 0), above(c, k, 0));
    lx_trace_transmittance(c->tracer, rays, passes, count);
    for (uint32_t k = 0, i = 0; k < lx_site_count; ++k)
        if (others >> k & 1 && !lx_rgb_is_black(passes[i++])) seen |= 1u << k;
    const uint32_t hidden = others & ~seen;
    if (!hidden) return seen;
    const float height = 0.25f * c->texel_m[from];
    count = 0;
    for (uint32_t k = 0; k < lx_site_count; ++k) {
        if (!(hidden >> k & 1)) continue;
        rays[count++] = between(above(c, from, 0), above(c, from, height));
        rays[count++] = between(above(c, from, height), above(c, k, height));
        rays[count++] = between(above(c, k, height), above(c, k, 0));
    }
    lx_trace_transmittance(c->tracer, rays, passes, count);
    for (uint32_t k = 0, i = 0; k < lx_site_count; ++k) {
        if (!(hidden >> k & 1)) continue;
        if (!lx_rgb_is_black(passes[i]) && !lx_rgb_is_black(passes[i + 1]) && !lx_rgb_is_black(passes[i + 2])) seen |= 1u << k;
        i += 3;
    }
    return seen;
}

static uint32_t bit_count(uint32_t bits)
{
    uint32_t count = 0;
    for (; bits; bits &= bits - 1) ++count;
    return count;
}

// All sites of `members` that can be reached from the lowest of them, from one to the next.
static uint32_t room_of(const company *c, uint32_t members)
{
    uint32_t room = members & (~members + 1), pending = room, rest = members & ~room;
    while (pending && rest) {
        uint32_t from = 0;
        while (!(pending >> from & 1)) ++from;
        const uint32_t seen = seen_from(c, from, rest);
        pending = (pending & ~(1u << from)) | seen;
        room |= seen;
        rest &= ~seen;
    }
    return room;
}

// The room that most good sites lie in; of those that were not moved, if there are enough to tell.
static uint32_t largest_room(const company *c, uint32_t *out_count)
{
    const bool fallen_alone = bit_count(c->good & ~c->moved) >= enough_sites;
    uint32_t best = 0, best_votes = 0;
    *out_count = 0;
    for (uint32_t rest = fallen_alone ? c->good & ~c->moved : c->good; rest; ++*out_count) {
        const uint32_t room = room_of(c, rest), votes = bit_count(room);
        if (votes > best_votes) {
            best = room;
            best_votes = votes;
        }
        rest &= ~room;
    }
    return best;
}

// ---- a texel ----------------------------------------------------------------------------------------------------------------

static bool is_crowded(lx_texel *t)
{
    if (t->fragment_count > most_pieces) return true;
    lx_patch patches[most_pieces];
    for (uint32_t i = 0; i < t->fragment_count; ++i) {
        const lx_piece *piece = lx_texel_piece(t, i);
        lx_patch *patch = &patches[i];
        const lx_polygon *part = lx_texel_part(t, piece);
        *patch = (lx_patch){.normal = piece->normal, .corner_count = (uint32_t)part->count};
        for (int k = 0; k < part->count; ++k) {
            patch->corners[k] = lx_piece_point(piece, part->p[k]);
            patch->centre = lx_mad(patch->centre, patch->corners[k], 1.0f / (float)part->count);
        }
    }
    return lx_trace_crowded(t->bake->tracer, patches, t->fragment_count);
}

// Moves sites until there are enough good ones.
static void move_sites(company *c, uint32_t enough)
{
    uint32_t failures = 0;
    for (uint32_t k = 0; k < lx_site_count && failures < most_failures && bit_count(c->good) < enough; ++k) {
        if (c->good >> k & 1) continue;
        if (!move_out(c, k, &c->sites[k])) {
            ++failures;
            continue;
        }
        c->good |= 1u << k;
        c->moved |= 1u << k;
    }
}

// What the sites of a crowded or covered texel come to: those that its light is taken from. 0: none.
static uint32_t choose_sites(company *c)
{
    uint32_t rooms;
    if (all_look_free(c)) {
        c->good = (1u << lx_site_count) - 1;
        const uint32_t room = largest_room(c, &rooms);
        c->split = rooms > 1 || is_covered(c);
        return room;
    }
    for (uint32_t k = 0; k < lx_site_count; ++k)
        if (is_good(c, &c->sites[k], k)) c->good |= 1u << k;
    for (uint32_t k = 0; k < lx_site_count && bit_count(c->good) < enough_sites; ++k) // each of a few weighs much
        if (c->good >> k & 1 && !is_surely_good(c, &c->sites[k], k)) c->good &= ~(1u << k);
    move_sites(c, enough_sites);
    uint32_t room = largest_room(c, &rooms);
    if (rooms > 1 && c->moved) { // too close a vote for so few: neighbours along a wall must come to the same side of it
        move_sites(c, lx_site_count);
        room = largest_room(c, &rooms);
    }
    c->split = rooms > 1 || is_covered(c);
    return room;
}

// Every site becomes one of the chosen ones, in turn.
static void replace_others(const company *c, uint32_t chosen, lx_settled *out)
{
    uint8_t list[lx_site_count];
    uint32_t count = 0;
    for (uint32_t k = 0; k < lx_site_count; ++k)
        if (chosen >> k & 1) list[count++] = (uint8_t)k;
    for (uint32_t k = 0; k < lx_site_count; ++k) {
        out->number[k] = chosen >> k & 1 ? (uint8_t)k : list[k % count];
        out->position[k] = c->sites[out->number[k]].position;
    }
}

// Returns LX_SITES_PLAIN, LX_SITES_INVALID, or 0 with *out filled.
static uint32_t settle_texel(lx_texel *t, lx_settled *out)
{
    const bool crowded = is_crowded(t);
    company c = {.tracer = t->bake->tracer, .stream = t->stream};
    for (uint32_t k = 0; k < lx_site_count; ++k) {
        const lx_piece *piece = lx_texel_site(t, k, &c.sites[k]);
        c.texel_m[k] = piece->texel_m;
        c.surface[k] = t->fragments[piece->fragment].surface;
        if (crowded || k > 0) continue;
        if (is_good(&c, &c.sites[0], 0)) return LX_SITES_PLAIN;
        // All of the texel is inside something. Is a way out near?
        exit_point exits[direction_count];
        if (find_exits(c.tracer, &c.sites[0], 2 * c.texel_m[0], exits) == 0) return LX_SITES_INVALID;
    }
    const uint32_t chosen = choose_sites(&c);
    if (chosen == 0) return LX_SITES_INVALID;
    if (chosen == (1u << lx_site_count) - 1 && !c.moved && !c.split) return LX_SITES_PLAIN;
    replace_others(&c, chosen, out);
    out->split = c.split;
    return 0;
}

lx_result lx_luxels_settle(const lx_bake *bake, lx_luxel_page *page, uint32_t x, uint32_t y, lx_error *error)
{
    const uint32_t size = bake->atlas->page_size, edge = (size + lx_site_block - 1) / lx_site_block;
    lx_settled *list = NULL;
    size_t count = 0, capacity = 0;
    lx_texel t = {0};
    for (uint32_t row = y; row < y + lx_site_block && row < size; ++row)
        for (uint32_t column = x; column < x + lx_site_block && column < size; ++column) {
            const uint32_t texel = row * size + column;
            if (page->first[texel] == page->first[texel + 1]) continue;
            if (!lx_array_reserve(&list, &capacity, count + 1, sizeof *list)) {
                lx_free(list);
                return lx_fail_memory(error, "luxels");
            }
            lx_texel_open(&t, bake, page, texel);
            const uint32_t state = settle_texel(&t, &list[count]);
            page->state[texel] = (uint16_t)(state == 0 ? count++ : state);
        }
    page->settled[y / lx_site_block * edge + x / lx_site_block] = list;
    return LX_OK;
}
