// Packs rectangles onto pages: skyline, bottom-left, tallest first.
//
// Based on: [Jylanki2010] Jukka Jylänki, "A Thousand Ways to Pack the Bin", 2010, section 3 (Skyline Bottom-Left). A full
// page stays open: later, smaller rectangles still go there.
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

// Height at which a width fits when its left side is that of step `first`.
static uint32_t rest_height(const page *p, size_t first, uint32_t width)
{
    uint32_t y = 0, covered = 0;
    for (size_t i = first; i < p->count && covered < width; ++i) {
        if (p->steps[i].y > y) y = p->steps[i].y;
        covered += p->steps[i].width;
    }
    return y;
}

static bool page_find(const page *p, uint32_t size, uint32_t width, uint32_t height, size_t *out_step, uint32_t *out_y)
{
    uint32_t best_top = UINT32_MAX, best_step_width = UINT32_MAX;
    for (size_t i = 0; i < p->count; ++i) {
        if (p->steps[i].x + width > size) break;
        const uint32_t y = rest_height(p, i, width);
        if (y + height > size) continue;
        if (y + height > best_top || (y + height == best_top && p->steps[i].width >= best_step_width)) continue;
        best_top = y + height;
        best_step_width = p->steps[i].width;
        *out_step = i;
        *out_y = y;
    }
    return best_top != UINT32_MAX;
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

typedef struct sort_key { uint32_t height, width, box; } sort_key;

static int compare_keys(const void *pa, const void *pb)
{
    const sort_key *a = pa, *b = pb;
    if (a->height != b->height) return a->height > b->height ? -1 : 1;
    if (a->width != b->width) return a->width > b->width ? -1 : 1;
    return a->box < b->box ? -1 : a->box > b->box;
}

lx_result lx_pack_pages(lx_box *boxes, uint32_t count, uint32_t page_size, uint32_t max_pages, uint32_t *out_pages,
                        lx_error *error)
{
    lx_result result = LX_OK;
    uint32_t open = 0;
    page *pages = lx_calloc_array(max_pages, sizeof *pages);
    sort_key *keys = lx_malloc_array(count, sizeof *keys);
    if (!pages || !keys) LX_TRY(lx_fail_memory(error, "packing pages"));
    for (uint32_t i = 0; i < count; ++i) keys[i] = (sort_key){boxes[i].height, boxes[i].width, i};
    qsort(keys, count, sizeof *keys, compare_keys);
    for (uint32_t i = 0; i < count; ++i) {
        lx_box *box = &boxes[keys[i].box];
        bool placed = false;
        if (box->width > page_size || box->height > page_size) open = max_pages + 1;
        for (uint32_t k = 0; k <= open && k <= max_pages && !placed && open <= max_pages; ++k) {
            if (k == open) {
                if (++open > max_pages) break;
                if (!page_open(&pages[k], page_size)) LX_TRY(lx_fail_memory(error, "packing pages"));
            }
            page *p = &pages[k];
            if (box->width >= p->failed_width && box->height >= p->failed_height) continue;
            size_t at = 0;
            if (!page_find(p, page_size, box->width, box->height, &at, &box->y)) {
                p->failed_width = box->width;
                p->failed_height = box->height;
                continue;
            }
            box->page = k;
            box->x = p->steps[at].x;
            if (!page_place(p, at, box->y, box->width, box->height)) LX_TRY(lx_fail_memory(error, "packing pages"));
            placed = true;
        }
        if (!placed) {
            open = max_pages + 1;
            break;
        }
    }
    *out_pages = open;
cleanup:
    for (uint32_t k = 0; pages && k < max_pages; ++k) lx_free(pages[k].steps);
    lx_free(pages);
    lx_free(keys);
    return result;
}
