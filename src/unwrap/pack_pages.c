// Packs rectangles onto pages: skyline, in several orders and with two rules for the place; the first that
// needs no more pages than allowed is taken.
//
// Based on: [Jylanki2010] Jukka Jylänki, "A Thousand Ways to Pack the Bin", 2010, section 3 (Skyline Bottom-Left and
// Minimum Waste Fit). A full page stays open: later, smaller rectangles still go there.
#include "base/memory.h"
#include "unwrap/unwrap.h"

#include <stdlib.h>
#include <string.h>

typedef struct step { uint32_t x, y, width; } step; // the skyline: height y over [x, x + width)

typedef struct page {
    step *steps;
    size_t count, capacity;
    uint32_t failed_width, failed_height; // the last rectangle that found no room; as large or larger ones need not try
} page;

static bool page_open(page *p, uint32_t size)
{
    if (!lx_array_reserve(&p->steps, &p->capacity, 1, sizeof *p->steps)) return false;
    p->steps[0] = (step){0, 0, size};
    p->count = 1;
    p->failed_width = p->failed_height = UINT32_MAX;
    return true;
}

// Height at which a width fits when its left side is that of step `first`, and the area lost below it.
static uint32_t rest_height(const page *p, size_t first, uint32_t width, uint64_t *waste)
{
    uint32_t y = 0, covered = 0;
    uint64_t below = 0;
    for (size_t i = first; i < p->count && covered < width; ++i) {
        const uint32_t rest = width - covered, part = p->steps[i].width < rest ? p->steps[i].width : rest;
        if (p->steps[i].y > y) y = p->steps[i].y;
        below += (uint64_t)part * p->steps[i].y;
        covered += part;
    }
    *waste = (uint64_t)width * y - below;
    return y;
}

static bool page_find(const page *p, uint32_t size, uint32_t width, uint32_t height, bool least_waste, size_t *out_step,
                      uint32_t *out_y)
{
    uint64_t best_first = UINT64_MAX, best_second = UINT64_MAX;
    for (size_t i = 0; i < p->count; ++i) {
        if (p->steps[i].x + width > size) break;
        uint64_t waste = 0;
        const uint32_t y = rest_height(p, i, width, &waste);
        if (y + height > size) continue;
        const uint64_t top = y + height, first = least_waste ? waste : top, second = least_waste ? top : p->steps[i].width;
        if (first > best_first || (first == best_first && second >= best_second)) continue;
        best_first = first;
        best_second = second;
        *out_step = i;
        *out_y = y;
    }
    return best_first != UINT64_MAX;
}

static bool page_place(page *p, size_t at, uint32_t y, uint32_t width, uint32_t height)
{
    if (!lx_array_reserve(&p->steps, &p->capacity, p->count + 1, sizeof *p->steps)) return false;
    const uint32_t x = p->steps[at].x, end = x + width;
    memmove(&p->steps[at + 1], &p->steps[at], (p->count - at) * sizeof *p->steps);
    ++p->count;
    p->steps[at] = (step){x, y + height, width};
    size_t keep = at + 1, next = at + 1; // drop what lies under the new step, shorten the one it ends in
    for (; next < p->count; ++next) {
        step s = p->steps[next];
        if (s.x + s.width <= end) continue;
        if (s.x < end) {
            s.width -= end - s.x;
            s.x = end;
        }
        p->steps[keep++] = s;
    }
    p->count = keep;
    if (at + 1 < p->count && p->steps[at + 1].y == p->steps[at].y) {
        p->steps[at].width += p->steps[at + 1].width;
        memmove(&p->steps[at + 1], &p->steps[at + 2], (p->count - at - 2) * sizeof *p->steps);
        --p->count;
    }
    if (at > 0 && p->steps[at - 1].y == p->steps[at].y) {
        p->steps[at - 1].width += p->steps[at].width;
        memmove(&p->steps[at], &p->steps[at + 1], (p->count - at - 1) * sizeof *p->steps);
        --p->count;
    }
    return true;
}

typedef enum order { BY_HEIGHT, BY_AREA, BY_LONGEST, BY_WIDTH, order_count } order;

typedef struct sort_key { uint64_t first; uint32_t second, box; } sort_key;

static int compare_keys(const void *pa, const void *pb)
{
    const sort_key *a = pa, *b = pb;
    if (a->first != b->first) return a->first > b->first ? -1 : 1;
    if (a->second != b->second) return a->second > b->second ? -1 : 1;
    return a->box < b->box ? -1 : a->box > b->box;
}

static sort_key key_of(const lx_box *box, uint32_t index, order by)
{
    const uint32_t w = box->width, h = box->height;
    switch (by) {
    case BY_AREA: return (sort_key){(uint64_t)w * h, h, index};
    case BY_LONGEST: return (sort_key){w > h ? w : h, w > h ? h : w, index};
    case BY_WIDTH: return (sort_key){w, h, index};
    default: return (sort_key){h, w, index};
    }
}

typedef struct packer {
    page *pages;
    sort_key *keys;
    uint32_t page_size, max_pages;
} packer;

// One attempt. *out_pages is max_pages + 1 if it fails.
static lx_result pack(packer *p, lx_box *boxes, uint32_t count, order by, bool least_waste, uint32_t *out_pages, lx_error *error)
{
    uint32_t open = 0;
    for (uint32_t i = 0; i < count; ++i) p->keys[i] = key_of(&boxes[i], i, by);
    qsort(p->keys, count, sizeof *p->keys, compare_keys);
    *out_pages = p->max_pages + 1;
    for (uint32_t i = 0; i < count; ++i) {
        lx_box *box = &boxes[p->keys[i].box];
        bool placed = false;
        if (box->width > p->page_size || box->height > p->page_size) return LX_OK;
        for (uint32_t k = 0; k < p->max_pages && !placed; ++k) {
            page *to = &p->pages[k];
            if (k == open) {
                if (!page_open(to, p->page_size)) return lx_fail_memory(error, "packing pages");
                ++open;
            }
            if (box->width >= to->failed_width && box->height >= to->failed_height) continue;
            size_t at = 0;
            if (!page_find(to, p->page_size, box->width, box->height, least_waste, &at, &box->y)) {
                to->failed_width = box->width;
                to->failed_height = box->height;
                continue;
            }
            box->page = k;
            box->x = to->steps[at].x;
            if (!page_place(to, at, box->y, box->width, box->height)) return lx_fail_memory(error, "packing pages");
            placed = true;
        }
        if (!placed) return LX_OK;
    }
    *out_pages = open;
    return LX_OK;
}

lx_result lx_pack_pages(lx_box *boxes, uint32_t count, uint32_t page_size, uint32_t max_pages, uint32_t *out_pages,
                        lx_error *error)
{
    lx_result result = LX_OK;
    uint64_t area = 0;
    packer p = {.page_size = page_size, .max_pages = max_pages};
    *out_pages = max_pages + 1;
    p.pages = lx_calloc_array(max_pages, sizeof *p.pages);
    p.keys = lx_malloc_array(count, sizeof *p.keys);
    if (!p.pages || !p.keys) LX_TRY(lx_fail_memory(error, "packing pages"));
    for (uint32_t i = 0; i < count; ++i) area += (uint64_t)boxes[i].width * boxes[i].height;
    if (area > (uint64_t)page_size * page_size * max_pages) goto cleanup;
    for (int by = 0; by < order_count && *out_pages > max_pages; ++by)
        for (int waste = 0; waste < 2 && *out_pages > max_pages; ++waste)
            LX_TRY(pack(&p, boxes, count, (order)by, waste == 1, out_pages, error));
cleanup:
    for (uint32_t k = 0; p.pages && k < max_pages; ++k) lx_free(p.pages[k].steps);
    lx_free(p.pages);
    lx_free(p.keys);
    return result;
}
