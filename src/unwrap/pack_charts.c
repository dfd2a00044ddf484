// Packs the charts of a mesh into a rectangle of texels, by their true outlines: a chart may lie in a hole or a notch of another.
//
// Every chart is drawn as a bitmap of the texels it touches. The largest goes first; each takes the lowest, then leftmost
// place where it fits, in whichever quarter turn ends lowest. "Where does it fit in this row" is answered for all columns at
// once: with level k of the occupancy holding the OR of 2^k texels to the right, a run of any length is two shifted reads.
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <stdlib.h>
#include <string.h>

static const double rim_texels = 1e-3; // what a chart may reach into a texel without being counted there
enum {
    max_levels = 13,
    chunk_words = 16,   // columns that are looked at together: a place at the left spares looking at the right
    hint_size = 24,     // charts up to this size remember how far up others of their size had to go,
    many_charts = 1500, // where there are as many as this; and only two of the four turns are tried
};

// ---- Bitmaps ---------------------------------------------------------------------------------------------------------------

typedef struct bitmap {
    uint32_t width, height, words; // words per row
    uint64_t *bits;
    size_t capacity;
} bitmap;

static bool bitmap_reset(bitmap *b, uint32_t width, uint32_t height)
{
    b->width = width;
    b->height = height;
    b->words = (width + 63) / 64;
    const size_t count = (size_t)b->words * height;
    if (!lx_array_reserve(&b->bits, &b->capacity, count, sizeof *b->bits)) return false;
    memset(b->bits, 0, count * sizeof *b->bits);
    return true;
}

static uint64_t *bitmap_row(const bitmap *b, uint32_t y)
{
    return &b->bits[(size_t)y * b->words];
}

static void set_run(uint64_t *row, uint32_t x0, uint32_t x1)
{
    for (uint32_t w = x0 / 64; x0 < x1; ++w) {
        const uint32_t end = (w + 1) * 64 < x1 ? (w + 1) * 64 : x1;
        const uint64_t high = end % 64 ? (UINT64_C(1) << (end % 64)) - 1 : ~UINT64_C(0);
        row[w] |= high & (~UINT64_C(0) << (x0 % 64));
        x0 = end;
    }
}

/// out |= row moved right by `shift` places (towards higher x); out has room.
static void or_moved(uint64_t *out, uint32_t out_words, const uint64_t *row, uint32_t words, uint32_t shift)
{
    const uint32_t whole = shift / 64, bits = shift % 64;
    for (uint32_t i = 0; i < words; ++i) {
        if (i + whole < out_words) out[i + whole] |= row[i] << bits;
        if (bits && i + whole + 1 < out_words) out[i + whole + 1] |= row[i] >> (64 - bits);
    }
}

static uint64_t prefix_parity(uint64_t v)
{
    for (int shift = 1; shift < 64; shift *= 2) v ^= v << shift;
    return v;
}

static uint32_t cell(double v, uint32_t count)
{
    return !(v > 0) ? 0 : v >= (double)count ? count - 1 : (uint32_t)v;
}

// Texels of a border segment, touched. `a` and `b` in texels.
static void draw_segment(bitmap *out, lx_dvec2 a, lx_dvec2 b)
{
    if (a.y > b.y) {
        const lx_dvec2 swap = a;
        a = b;
        b = swap;
    }
    const uint32_t y0 = cell(a.y + rim_texels, out->height), y1 = cell(b.y - rim_texels, out->height);
    const double slope = b.y > a.y ? (b.x - a.x) / (b.y - a.y) : 0;
    for (uint32_t y = y0; y <= y1 || y == y0; ++y) {
        const double xa = y == y0 ? a.x : a.x + ((double)y - a.y) * slope;
        const double xb = y >= y1 ? b.x : a.x + ((double)y + 1 - a.y) * slope;
        const uint32_t x0 = cell(fmin(xa, xb) + rim_texels, out->width), x1 = cell(fmax(xa, xb) - rim_texels, out->width);
        set_run(bitmap_row(out, y), x0, (x1 > x0 ? x1 : x0) + 1);
    }
}

// Flips the parity of all texel centres to the right of a border segment.
static void toggle_segment(bitmap *out, lx_dvec2 a, lx_dvec2 b)
{
    if (a.y > b.y) {
        const lx_dvec2 swap = a;
        a = b;
        b = swap;
    }
    const double slope = b.y > a.y ? (b.x - a.x) / (b.y - a.y) : 0;
    const double first = fmax(0, ceil(a.y - 0.5)), end = fmin((double)out->height, ceil(b.y - 0.5));
    for (double y = first; y < end; ++y) {
        const double x = ceil(a.x + (y + 0.5 - a.y) * slope - 0.5);
        if (x >= (double)out->width) continue;
        const uint32_t i = x > 0 ? (uint32_t)x : 0;
        bitmap_row(out, (uint32_t)y)[i / 64] ^= UINT64_C(1) << (i % 64);
    }
}

lx_dvec2 lx_placement_apply(const lx_placement *placement, const lx_chart *chart, lx_vec2 xy)
{
    const double s = (double)placement->scale, x = (double)xy.x * s, y = (double)xy.y * s;
    const double w = (double)chart->width * s, h = (double)chart->height * s;
    const double px = (double)placement->x, py = (double)placement->y;
    switch (placement->turns) {
    case 0: return (lx_dvec2){px + x, py + y};
    case 1: return (lx_dvec2){px + h - y, py + x};
    case 2: return (lx_dvec2){px + w - x, py + h - y};
    default: return (lx_dvec2){px + y, py + w - x};
    }
}

static uint32_t texel_count(double extent)
{
    const double n = ceil(extent - 2 * rim_texels);
    return !(n > 1) ? 1 : n < 1e6 ? (uint32_t)n : 1000000;
}

// All texels that the chart touches.
static bool draw_chart(const lx_chart_set *set, const lx_chart *chart, double scale, uint32_t turns, bitmap *out)
{
    const lx_placement at = {.turns = turns, .scale = (float)scale};
    const double ew = (double)chart->width * (double)at.scale, eh = (double)chart->height * (double)at.scale;
    if (!bitmap_reset(out, texel_count(turns % 2 ? eh : ew), texel_count(turns % 2 ? ew : eh))) return false;
    const lx_segment2 *segments = &set->segments[chart->first_segment];
    for (uint32_t i = 0; i < chart->segment_count; ++i)
        toggle_segment(out, lx_placement_apply(&at, chart, segments[i].a), lx_placement_apply(&at, chart, segments[i].b));
    for (uint32_t y = 0; y < out->height; ++y) {
        uint64_t *row = bitmap_row(out, y), carry = 0;
        for (uint32_t w = 0; w < out->words; ++w) {
            row[w] = prefix_parity(row[w]) ^ carry;
            carry = row[w] >> 63 ? ~UINT64_C(0) : 0;
        }
        if (out->width % 64) row[out->words - 1] &= (UINT64_C(1) << (out->width % 64)) - 1;
    }
    for (uint32_t i = 0; i < chart->segment_count; ++i)
        draw_segment(out, lx_placement_apply(&at, chart, segments[i].a), lx_placement_apply(&at, chart, segments[i].b));
    return true;
}

// `out` is larger by `by` on every side and holds all texels within `by` of one of `in`.
static bool dilate(const bitmap *in, uint32_t by, bitmap *wide, bitmap *out)
{
    if (!bitmap_reset(wide, in->width + 2 * by, in->height) ||
        !bitmap_reset(out, in->width + 2 * by, in->height + 2 * by))
        return false;
    for (uint32_t y = 0; y < in->height; ++y) {
        for (uint32_t d = 0; d <= 2 * by; ++d)
            or_moved(bitmap_row(wide, y), wide->words, bitmap_row(in, y), in->words, d);
        for (uint32_t d = 0; d <= 2 * by; ++d) {
            const uint64_t *from = bitmap_row(wide, y);
            uint64_t *to = bitmap_row(out, y + d);
            for (uint32_t w = 0; w < out->words; ++w) to[w] |= from[w];
        }
    }
    return true;
}

// ---- Runs of a chart -------------------------------------------------------------------------------------------------------

typedef struct run { uint32_t y, x, length; } run;

typedef struct shape {
    bitmap bits;
    run *runs;          // the longest first, then spread over the rows: neighbouring rows would be turned away alike
    run *sorted;
    size_t run_count, run_capacity, sorted_capacity;
} shape;

static size_t greatest_divisor(size_t a, size_t b)
{
    while (b) {
        const size_t rest = a % b;
        a = b;
        b = rest;
    }
    return a;
}

// Steps through the runs by about the golden section of their number, starting at the longest.
static void spread_runs(shape *s)
{
    size_t longest = 0, step = (size_t)((double)s->run_count * 0.618) | 1;
    for (size_t i = 0; i < s->run_count; ++i)
        if (s->sorted[i].length > s->sorted[longest].length) longest = i;
    while (greatest_divisor(s->run_count, step) != 1) ++step;
    for (size_t i = 0, at = longest; i < s->run_count; ++i, at = (at + step) % s->run_count) s->runs[i] = s->sorted[at];
}

static bool find_runs(shape *s)
{
    s->run_count = 0;
    for (uint32_t y = 0; y < s->bits.height; ++y) {
        const uint64_t *row = bitmap_row(&s->bits, y);
        for (uint32_t x = 0; x < s->bits.width;) {
            const uint64_t rest = row[x / 64] >> (x % 64);
            if (rest == 0) {
                x = (x / 64 + 1) * 64;
                continue;
            }
            x += (uint32_t)__builtin_ctzll(rest);
            uint32_t end = x;
            while (end < s->bits.width) {
                const uint64_t holes = ~row[end / 64] >> (end % 64);
                if (holes) {
                    end += (uint32_t)__builtin_ctzll(holes);
                    break;
                }
                end = (end / 64 + 1) * 64;
            }
            if (end > s->bits.width) end = s->bits.width;
            if (!lx_array_reserve(&s->sorted, &s->sorted_capacity, s->run_count + 1, sizeof *s->sorted)) return false;
            s->sorted[s->run_count++] = (run){y, x, end - x};
            x = end;
        }
    }
    if (s->run_count == 0) { // nothing drawn: a chart still owns a texel
        if (!lx_array_reserve(&s->sorted, &s->sorted_capacity, 1, sizeof *s->sorted)) return false;
        set_run(bitmap_row(&s->bits, 0), 0, 1);
        s->sorted[s->run_count++] = (run){0, 0, 1};
    }
    if (!lx_array_reserve(&s->runs, &s->run_capacity, s->run_count, sizeof *s->runs)) return false;
    spread_runs(s);
    return true;
}

// ---- The sheet -------------------------------------------------------------------------------------------------------------

typedef struct sheet {
    uint32_t width, height, words, levels;
    uint64_t *bits;      // [levels][height][words]; beyond the width all is taken
    uint32_t *free_run;  // [height] upper bound of the longest free run
    bool *stale;         // [height] the row has changed since its bound was found
    uint64_t *blocked;   // [words]
} sheet;

static uint64_t *sheet_row(const sheet *s, uint32_t level, uint32_t y)
{
    return &s->bits[((size_t)level * s->height + y) * s->words];
}

static void sheet_release(sheet *s)
{
    lx_free(s->bits);
    lx_free(s->free_run);
    lx_free(s->stale);
    lx_free(s->blocked);
    *s = (sheet){0};
}

// Rebuilds the upper levels after a change of columns [x0, x1).
static void update_row(sheet *s, uint32_t y, uint32_t x0, uint32_t x1)
{
    const uint32_t end = (x1 + 63) / 64 < s->words ? (x1 + 63) / 64 : s->words;
    s->stale[y] = true;
    for (uint32_t level = 1; level < s->levels; ++level) {
        uint64_t *row = sheet_row(s, level, y);
        const uint64_t *below = sheet_row(s, level - 1, y);
        const uint32_t shift = 1u << (level - 1), whole = shift / 64, bits = shift % 64;
        for (uint32_t w = x0 > 1u << level ? (x0 - (1u << level)) / 64 : 0; w < end; ++w) {
            const uint64_t low = w + whole < s->words ? below[w + whole] : ~UINT64_C(0);
            const uint64_t high = w + whole + 1 < s->words ? below[w + whole + 1] : ~UINT64_C(0);
            row[w] = below[w] | (bits ? low >> bits | high << (64 - bits) : low);
        }
    }
}

static uint32_t free_run(sheet *s, uint32_t y)
{
    if (!s->stale[y]) return s->free_run[y];
    s->stale[y] = false;
    s->free_run[y] = 0;
    for (uint32_t level = s->levels; level-- > 0;) {
        const uint64_t *row = sheet_row(s, level, y);
        uint32_t w = 0;
        while (w < s->words && row[w] == ~UINT64_C(0)) ++w;
        if (w == s->words) continue;
        s->free_run[y] = level + 1 < s->levels ? (2u << level) - 1 : s->width;
        break;
    }
    return s->free_run[y];
}

static bool sheet_init(sheet *s, uint32_t width, uint32_t height, uint32_t longest_run)
{
    *s = (sheet){.width = width, .height = height, .words = (width + 63) / 64, .levels = 1};
    while (s->levels < max_levels && (2u << (s->levels - 1)) <= longest_run) ++s->levels;
    s->bits = lx_calloc_array((size_t)s->words * height * s->levels, sizeof *s->bits);
    s->free_run = lx_malloc_array(height, sizeof *s->free_run);
    s->stale = lx_malloc_array(height, sizeof *s->stale);
    s->blocked = lx_malloc_array(s->words, sizeof *s->blocked);
    if (!s->bits || !s->free_run || !s->stale || !s->blocked) {
        sheet_release(s);
        return false;
    }
    for (uint32_t y = 0; y < height; ++y) {
        if (width % 64) sheet_row(s, 0, y)[s->words - 1] = ~UINT64_C(0) << (width % 64);
        update_row(s, y, 0, width);
    }
    return true;
}

// The words of `blocked` that still have a free column.
typedef struct range { uint32_t first, end; } range;

static range shrink(const uint64_t *blocked, range r)
{
    while (r.first < r.end && blocked[r.first] == ~UINT64_C(0)) ++r.first;
    while (r.end > r.first && blocked[r.end - 1] == ~UINT64_C(0)) --r.end;
    return r;
}

// blocked |= row moved left by `shift`, within the range; what comes in from beyond the row is taken.
static range block(uint64_t *blocked, range r, const uint64_t *row, uint32_t words, uint32_t shift)
{
    const uint32_t whole = shift / 64, bits = shift % 64, kept = whole < words ? words - whole : 0;
    if (r.end > kept) r.end = kept > r.first ? kept : r.first; // beyond: nothing free
    const uint32_t inner = r.end + whole < words ? r.end : r.end > r.first ? r.end - 1 : r.end;
    const uint64_t *from = row + whole;
    if (bits == 0) {
        for (uint32_t w = r.first; w < r.end; ++w) blocked[w] |= from[w];
    } else {
        for (uint32_t w = r.first; w < inner; ++w) blocked[w] |= from[w] >> bits | from[w + 1] << (64 - bits);
        if (inner < r.end) blocked[inner] |= from[inner] >> bits | ~UINT64_C(0) << (64 - bits);
    }
    return shrink(blocked, r);
}

// The lowest, then leftmost place for `s`, from row `y` on, at least `border` from the sheet's rim, with its top not above
// max_top.
static bool find_place(sheet *on, const shape *s, uint32_t border, uint32_t y, uint32_t max_top, uint32_t *out_x,
                       uint32_t *out_y)
{
    const uint32_t width = s->bits.width, height = s->bits.height;
    if (width + 2 * border > on->width || height + 2 * border > on->height) return false;
    const uint32_t last_x = on->width - border - width, words = on->words;
    uint32_t last_y = on->height - border - height;
    if (max_top < height) return false;
    if (max_top - height < last_y) last_y = max_top - height;
    for (; y <= last_y; ++y) {
        if (free_run(on, y + s->runs[0].y) < s->runs[0].length) continue;
        memset(on->blocked, 0, words * sizeof *on->blocked);
        set_run(on->blocked, 0, border);
        set_run(on->blocked, last_x + 1, words * 64);
        for (uint32_t chunk = 0; chunk < words; chunk += chunk_words) {
            range open = shrink(on->blocked, (range){chunk, chunk + chunk_words < words ? chunk + chunk_words : words});
            for (size_t i = 0; i < s->run_count && open.first < open.end; ++i) {
                const run r = s->runs[i];
                uint32_t level = 31u - (uint32_t)__builtin_clz(r.length);
                if (level >= on->levels) level = on->levels - 1;
                const uint64_t *row = sheet_row(on, level, y + r.y);
                open = block(on->blocked, open, row, words, r.x);
                if (r.length > 1u << level) open = block(on->blocked, open, row, words, r.x + r.length - (1u << level));
            }
            if (open.first == open.end) continue;
            *out_x = open.first * 64 + (uint32_t)__builtin_ctzll(~on->blocked[open.first]); // shrink() left a free column in it
            *out_y = y;
            return true;
        }
    }
    return false;
}

// Marks a dilated chart whose own lower left texel is at (x, y).
static void occupy(sheet *on, const bitmap *dilated, uint32_t by, uint32_t x, uint32_t y)
{
    for (uint32_t r = 0; r < dilated->height; ++r) {
        if (y + r < by || y + r - by >= on->height) continue;
        const uint32_t row = y + r - by;
        const uint64_t *from = bitmap_row(dilated, r);
        uint64_t *to = sheet_row(on, 0, row);
        if (x >= by) {
            or_moved(to, on->words, from, dilated->words, x - by);
        } else { // cut on the left by less than a word: padding is at most 32
            const uint32_t cut = by - x;
            for (uint32_t w = 0; w < dilated->words && w < on->words; ++w)
                to[w] |= from[w] >> cut | (w + 1 < dilated->words ? from[w + 1] << (64 - cut) : 0);
        }
        update_row(on, row, x >= by ? x - by : 0, x - by + dilated->width);
    }
}

// ---- Packing ---------------------------------------------------------------------------------------------------------------

typedef struct packer {
    const lx_chart_set *set;
    uint32_t padding;
    const uint32_t *order;
    const double *scales;  // [chart_count] texels per metre
    const atomic_bool *stop;
    shape shapes[2];
    bitmap wide, dilated;
    uint32_t longest;
} packer;

typedef struct sort_key { uint64_t texels; float area; uint32_t chart; } sort_key; // of its rectangle, padding included

static int compare_keys(const void *pa, const void *pb)
{
    const sort_key *a = pa, *b = pb;
    if (a->texels != b->texels) return a->texels > b->texels ? -1 : 1;
    if (a->area != b->area) return a->area > b->area ? -1 : 1;
    return a->chart < b->chart ? -1 : a->chart > b->chart;
}

// Packs into a sheet of the given size. *fits false: no room. Width and height are what was used, rims included.
static lx_result pack_sheet(packer *p, uint32_t width, uint32_t height, lx_placement *placements, uint32_t *out_width,
                            uint32_t *out_height, bool *fits, lx_error *error)
{
    lx_result result = LX_OK;
    const lx_chart_set *set = p->set;
    const uint32_t border = (p->padding + 1) / 2, turns = set->chart_count > many_charts ? 2 : 4;
    uint32_t hints[hint_size][hint_size] = {{0}};
    sheet page = {0};
    *out_width = *out_height = 0;
    *fits = false;
    if (!sheet_init(&page, width, height, p->longest)) LX_TRY(lx_fail_memory(error, "packing charts"));
    for (uint32_t i = 0; i < set->chart_count; ++i) {
        const uint32_t c = p->order[i];
        if (i % 64 == 0 && p->stop && atomic_load(p->stop)) LX_TRY(lx_fail(error, LX_ERROR_CANCELLED, "cancelled"));
        lx_placement best = {0};
        uint32_t best_top = UINT32_MAX, best_shape = 0, next = 0;
        for (uint32_t turn = 0; turn < turns; ++turn) {
            shape *s = &p->shapes[next];
            if (!draw_chart(set, &set->charts[c], p->scales[c], turn, &s->bits) || !find_runs(s))
                LX_TRY(lx_fail_memory(error, "packing charts"));
            const uint32_t w = s->bits.width, h = s->bits.height;
            if (turn > 0 && w == 1 && h == 1) break;
            uint32_t *hint = w < hint_size && h < hint_size && turns == 2 ? &hints[w][h] : NULL;
            uint32_t x = 0, y = hint && *hint > border ? *hint : border;
            // A later turn must end lower than the best so far.
            if (!find_place(&page, s, border, y, best_top == UINT32_MAX ? UINT32_MAX : best_top - 1, &x, &y)) continue;
            if (hint) *hint = y;
            best = (lx_placement){x, y, turn, (float)p->scales[c]};
            best_top = y + h;
            best_shape = next;
            next = 1 - next;
        }
        if (best_top == UINT32_MAX) goto cleanup;
        placements[c] = best;
        const bitmap *bits = &p->shapes[best_shape].bits;
        if (!dilate(bits, p->padding, &p->wide, &p->dilated)) LX_TRY(lx_fail_memory(error, "packing charts"));
        occupy(&page, &p->dilated, p->padding, best.x, best.y);
        if (best.x + bits->width + border > *out_width) *out_width = best.x + bits->width + border;
        if (best.y + bits->height + border > *out_height) *out_height = best.y + bits->height + border;
    }
    *fits = true;
cleanup:
    sheet_release(&page);
    return result;
}

// Texels that a chart takes with its padding, as far as outlines can nest into each other.
static double chart_texels(const lx_chart *chart, double scale, uint32_t padding)
{
    const double fill = chart->width > 0 && chart->height > 0
                            ? fmin(1, (double)chart->area / ((double)chart->width * (double)chart->height))
                            : 1;
    const uint32_t w = texel_count((double)chart->width * scale), h = texel_count((double)chart->height * scale);
    return (double)(w + padding) * (double)(h + padding) * (0.35 + 0.65 * fill);
}

// A chart smaller than a texel has the texel to itself: it may as well fill it.
static double chart_scale(const lx_chart *chart, double texels_per_m)
{
    const double extent = fmax((double)chart->width, (double)chart->height);
    return extent > 0 && extent * texels_per_m < 0.75 ? 0.75 / extent : texels_per_m;
}

double lx_estimate_texels(const lx_chart_set *set, double texels_per_m, uint32_t padding)
{
    double texels = 0;
    for (uint32_t c = 0; c < set->chart_count; ++c)
        texels += chart_texels(&set->charts[c], chart_scale(&set->charts[c], texels_per_m), padding);
    return texels;
}

lx_result lx_pack_charts(const lx_chart_set *set, double texels_per_m, uint32_t padding, uint32_t limit, bool alone,
                         const atomic_bool *stop, lx_placement *placements, uint32_t *out_width, uint32_t *out_height,
                         bool *out_fits, lx_error *error)
{
    lx_result result = LX_OK;
    packer p = {.set = set, .padding = padding, .stop = stop};
    const uint32_t count = set->chart_count, border = (padding + 1) / 2;
    lx_placement *trial = lx_malloc_array(count, sizeof *trial);
    sort_key *keys = lx_malloc_array(count, sizeof *keys);
    uint32_t *order = lx_malloc_array(count, sizeof *order);
    double *scales = lx_malloc_array(count, sizeof *scales);
    double cells = 0;
    *out_fits = false;
    if (!trial || !keys || !order || !scales) LX_TRY(lx_fail_memory(error, "packing charts"));

    uint32_t longest = 1, narrowest = 1;
    for (uint32_t c = 0; c < count; ++c) {
        const lx_chart *chart = &set->charts[c];
        scales[c] = chart_scale(chart, texels_per_m);
        const uint32_t w = texel_count((double)chart->width * scales[c]), h = texel_count((double)chart->height * scales[c]);
        const uint32_t large = w > h ? w : h, small = w > h ? h : w;
        if (large + 2 * border > limit) goto cleanup;
        if (large > longest) longest = large;
        if (small > narrowest) narrowest = small;
        cells += chart_texels(chart, scales[c], padding);
        keys[c] = (sort_key){(uint64_t)(w + padding) * (h + padding), chart->area, c};
    }
    if (cells * 0.6 > (double)limit * limit) goto cleanup; // hopeless; the search does not need to know how hopeless
    qsort(keys, count, sizeof *keys, compare_keys);
    for (uint32_t i = 0; i < count; ++i) order[i] = keys[i].chart;
    p.order = order;
    p.scales = scales;
    p.longest = longest;

    // Large meshes become columns of a whole, a half, a third … of the page, so that they stand side by side without gaps;
    // small ones try several shapes and keep the smallest area.
    static const double shapes[] = {1.0, 1.3, 0.8, 1.7, 1.15, 2.2, 0.9};
    const double columns = alone ? 1 : fmax(1, floor(limit / sqrt(cells)));
    const bool large = columns <= 8;
    const uint32_t tries = large ? 1 : count <= 64 ? 7 : count <= 512 ? 3 : 1;
    double best_area = INFINITY;
    for (uint32_t i = 0; i < tries; ++i) {
        double wish = large ? floor(limit / columns) : ceil(sqrt(cells) * shapes[i]) + border;
        wish = fmin(fmax(wish, narrowest + 2 * border), limit);
        uint32_t width = (uint32_t)wish, w = 0, h = 0;
        bool fits = false;
        // A first sheet of modest height; if that is not enough, one as high as the page.
        const double guess = 1.5 * cells / wish + 2 * (double)longest + 4 * border + 8;
        LX_TRY(pack_sheet(&p, width, (uint32_t)fmin(guess, limit), trial, &w, &h, &fits, error));
        if (!fits && guess < limit) LX_TRY(pack_sheet(&p, width, limit, trial, &w, &h, &fits, error));
        if (!fits && width < limit && i + 1 == tries && best_area == (double)INFINITY)
            LX_TRY(pack_sheet(&p, limit, limit, trial, &w, &h, &fits, error));
        const double area = (double)w * h;
        if (!fits || area >= best_area) continue;
        best_area = area;
        *out_width = w;
        *out_height = h;
        *out_fits = true;
        memcpy(placements, trial, count * sizeof *trial);
    }
cleanup:
    lx_free(trial);
    lx_free(keys);
    lx_free(order);
    lx_free(scales);
    for (int i = 0; i < 2; ++i) {
        lx_free(p.shapes[i].bits.bits);
        lx_free(p.shapes[i].runs);
        lx_free(p.shapes[i].sorted);
    }
    lx_free(p.wide.bits);
    lx_free(p.dilated.bits);
    return result;
}
