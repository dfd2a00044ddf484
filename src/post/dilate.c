// Fills padding and untrustworthy texels from the nearest valid texel of the same chart.
//
// One exact distance transform over the page tells which chart is nearest to every empty texel; where a chart has invalid texels, a
// second one over its bounding box finds their sources. Both are linear in the area they cover, and integer throughout.
//
// Based on: [Meijster2000] A. Meijster, J. Roerdink, W. Hesselink, "A General Algorithm for Computing Distance Transforms in Linear
// Time", Mathematical Morphology and its Applications to Image and Signal Processing. We pass rows first and keep sites instead of
// distances, so that ties go to the lowest index.
#include "post/dilate.h"

#include "base/error.h"
#include "base/memory.h"

#include <string.h>

enum { no_site = 0xffff }; // columns are 16 bits wide

typedef struct chart_box {
    uint32_t x0, y0, x1, y1; // inclusive; x0 > x1: not on this page
    bool has_invalid;
} chart_box;

// Scratch of the transforms: for each texel of an area the column of the nearest site in its row, and one column's lower envelope.
typedef struct workspace {
    uint16_t *site_x;   // [size * size]
    uint32_t *envelope; // [size] rows whose parabolas make up the envelope,
    uint32_t *start;    // [size] and where each begins to rule
} workspace;

static lx_result workspace_create(uint32_t size, workspace *out, lx_error *error)
{
    *out = (workspace){
        .site_x = lx_malloc_array((size_t)size * size, sizeof *out->site_x),
        .envelope = lx_malloc_array(size, sizeof *out->envelope),
        .start = lx_malloc_array(size, sizeof *out->start),
    };
    return out->site_x && out->envelope && out->start ? LX_OK : lx_fail_memory(error, "dilation");
}

static void workspace_release(workspace *work)
{
    lx_free(work->site_x);
    lx_free(work->envelope);
    lx_free(work->start);
}

// site_x[x] becomes the column of the nearest site of the row (ties: the left one), starting from its own column or no_site.
static void nearest_in_row(uint16_t *site_x, uint32_t width)
{
    uint32_t last = no_site;
    for (uint32_t x = width; x-- > 0;) { // nearest at or right of x
        if (site_x[x] != no_site) last = x;
        site_x[x] = (uint16_t)last;
    }
    last = no_site;
    for (uint32_t x = 0; x < width; ++x) {
        if (site_x[x] == x) last = x;
        if (last == no_site) continue;
        if (site_x[x] == no_site || x - last <= site_x[x] - x) site_x[x] = (uint16_t)last;
    }
}

static int64_t row_distance(const workspace *work, uint32_t width, uint32_t x, uint32_t row)
{
    return (int64_t)x - work->site_x[(size_t)row * width + x];
}

// Squared distance from (x, y) to the nearest site of `row`.
static int64_t distance(const workspace *work, uint32_t width, uint32_t x, uint32_t y, uint32_t row)
{
    const int64_t dx = row_distance(work, width, x, row), dy = (int64_t)y - row;
    return dx * dx + dy * dy;
}

// Lower envelope of one column's parabolas, [Meijster2000] fig. 3; returns how many rows it has. Row r rules from its start on, up to
// the next one's; at equal distance the upper row keeps the texel.
static uint32_t build_envelope(workspace *work, uint32_t width, uint32_t height, uint32_t x)
{
    uint32_t count = 0;
    for (uint32_t row = 0; row < height; ++row) {
        if (work->site_x[(size_t)row * width + x] == no_site) continue;
        while (count > 0) {
            const uint32_t top = work->envelope[count - 1], at = work->start[count - 1];
            if (distance(work, width, x, at, top) <= distance(work, width, x, at, row)) break;
            --count;
        }
        uint32_t begin = 0;
        if (count > 0) {
            // `row` is strictly nearer than `top` where 2 y (row - top) > row² - top² + dx(row)² - dx(top)².
            const uint32_t top = work->envelope[count - 1];
            const int64_t dx_row = row_distance(work, width, x, row), dx_top = row_distance(work, width, x, top);
            const int64_t sum = (int64_t)row * row - (int64_t)top * top + dx_row * dx_row - dx_top * dx_top;
            begin = (uint32_t)(sum / (2 * ((int64_t)row - top))) + 1; // sum >= 0: `top` is no farther at its start
            if (begin >= height) continue;
        }
        work->envelope[count] = row;
        work->start[count++] = begin;
    }
    return count;
}

// Boxes of all charts with their claims. Chart `number` is in (*out_boxes)[number - *out_first].
static lx_result find_boxes(uint32_t size, const uint32_t *chart, const uint32_t *source, const uint8_t *valid, chart_box **out_boxes,
                            uint32_t *out_first, uint32_t *out_count, lx_error *error)
{
    const size_t texel_count = (size_t)size * size;
    uint32_t first = LX_NO_CHART, last = 0;
    for (size_t i = 0; i < texel_count; ++i) {
        if (chart[i] == LX_NO_CHART) continue;
        if (chart[i] < first) first = chart[i];
        if (chart[i] > last) last = chart[i];
    }
    const uint32_t count = first == LX_NO_CHART ? 0 : last - first + 1;
    chart_box *boxes = lx_malloc_array(count, sizeof *boxes);
    if (!boxes) return lx_fail_memory(error, "dilation");
    for (uint32_t c = 0; c < count; ++c) boxes[c] = (chart_box){size, size, 0, 0, false};
    for (uint32_t y = 0; y < size; ++y) {
        for (uint32_t x = 0; x < size; ++x) {
            const size_t i = (size_t)y * size + x;
            if (chart[i] == LX_NO_CHART) continue;
            chart_box *box = &boxes[chart[i] - first];
            if (x < box->x0) box->x0 = x;
            if (x > box->x1) box->x1 = x;
            if (y < box->y0) box->y0 = y;
            if (y > box->y1) box->y1 = y;
            if (source[i] == i && !valid[i]) box->has_invalid = true;
        }
    }
    *out_boxes = boxes;
    *out_first = first;
    *out_count = count;
    return LX_OK;
}

// Texels that no chart owns and that are within `radius` king's moves of one are claimed by the nearest.
static void claim_padding(uint32_t size, uint32_t radius, workspace *work, uint32_t *chart, uint32_t *source)
{
    for (uint32_t y = 0; y < size; ++y) {
        uint16_t *site_x = work->site_x + (size_t)y * size;
        for (uint32_t x = 0; x < size; ++x) site_x[x] = chart[(size_t)y * size + x] == LX_NO_CHART ? no_site : (uint16_t)x;
        nearest_in_row(site_x, size);
    }
    for (uint32_t x = 0; x < size; ++x) {
        const uint32_t count = build_envelope(work, size, size, x);
        if (count == 0) continue;
        // `last_near`: the last row up to y + radius that has a site within `radius` columns.
        uint32_t ruler = 0, next_row = 0;
        int64_t last_near = -(int64_t)radius - 1;
        for (uint32_t y = 0; y < size; ++y) {
            while (ruler + 1 < count && work->start[ruler + 1] <= y) ++ruler;
            for (; next_row < size && next_row <= (uint64_t)y + radius; ++next_row) {
                const uint16_t site = work->site_x[(size_t)next_row * size + x];
                if (site != no_site && (site > x ? site - x : x - site) <= radius) last_near = next_row;
            }
            const size_t i = (size_t)y * size + x;
            if (source[i] != UINT32_MAX || last_near < (int64_t)y - radius) continue;
            const uint32_t row = work->envelope[ruler];
            source[i] = row * size + work->site_x[(size_t)row * size + x];
        }
    }
    for (size_t i = 0; i < (size_t)size * size; ++i)
        if (source[i] != UINT32_MAX) chart[i] = chart[source[i]];
}

// All texels of a chart take the nearest of its valid ones. On entry source[i] == i marks the texels that were its own from the start.
static void fill_chart(uint32_t size, uint32_t number, const chart_box *box, workspace *work, const uint32_t *chart,
                       const uint8_t *valid, uint32_t *source)
{
    const uint32_t width = box->x1 - box->x0 + 1, height = box->y1 - box->y0 + 1;
    for (uint32_t y = 0; y < height; ++y) {
        uint16_t *site_x = work->site_x + (size_t)y * width;
        const size_t row = (size_t)(box->y0 + y) * size + box->x0;
        for (uint32_t x = 0; x < width; ++x)
            site_x[x] = chart[row + x] == number && source[row + x] == row + x && valid[row + x] ? (uint16_t)x : no_site;
        nearest_in_row(site_x, width);
    }
    for (uint32_t x = 0; x < width; ++x) {
        const uint32_t count = build_envelope(work, width, height, x);
        uint32_t ruler = 0;
        for (uint32_t y = 0; y < height; ++y) {
            while (ruler + 1 < count && work->start[ruler + 1] <= y) ++ruler;
            const size_t i = (size_t)(box->y0 + y) * size + box->x0 + x;
            if (chart[i] != number) continue;
            if (count == 0) {
                source[i] = UINT32_MAX;
            } else {
                const uint32_t row = work->envelope[ruler];
                source[i] = (box->y0 + row) * size + box->x0 + work->site_x[(size_t)row * width + x];
            }
        }
    }
}

lx_result lx_dilate_map(uint32_t size, uint32_t radius, uint32_t *chart, const uint8_t *valid, uint32_t *out_source, lx_error *error)
{
    lx_result result = LX_OK;
    chart_box *boxes = NULL;
    workspace work = {0};
    uint32_t first = 0, count = 0;
    if (size == 0 || size >= no_site) return lx_fail(error, LX_ERROR_LIMIT, "a page of %u texels cannot be dilated", size);

    LX_TRY(workspace_create(size, &work, error));
    for (size_t i = 0; i < (size_t)size * size; ++i) out_source[i] = chart[i] == LX_NO_CHART ? UINT32_MAX : (uint32_t)i;
    claim_padding(size, radius, &work, chart, out_source);
    // Where every texel of a chart is valid, the nearest texel of the chart is what we want; other charts are searched again.
    LX_TRY(find_boxes(size, chart, out_source, valid, &boxes, &first, &count, error));
    for (uint32_t c = 0; c < count; ++c)
        if (boxes[c].has_invalid) fill_chart(size, first + c, &boxes[c], &work, chart, valid, out_source);
cleanup:
    workspace_release(&work);
    lx_free(boxes);
    return result;
}

void lx_dilate_apply(uint32_t size, const uint32_t *source, float *rgb)
{
    // In place: sources are valid texels, and those are their own sources.
    for (size_t i = 0; i < (size_t)size * size; ++i) {
        if (source[i] == i) continue;
        if (source[i] == UINT32_MAX)
            memset(rgb + 3 * i, 0, 3 * sizeof *rgb);
        else
            memcpy(rgb + 3 * i, rgb + 3 * (size_t)source[i], 3 * sizeof *rgb);
    }
}
