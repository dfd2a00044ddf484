// Monitors: the mean colour of each cell of a picture becomes the colour of that cell's layer.
//
// Areas are whole numbers: a pixel is `columns` units wide and `rows` high, so that a cell is as many units wide as the picture has pixels.
// A cell is at most nine rectangles of pixels, which lie in it with equal shares. 8-bit pixels are summed in whole numbers, exactly.
#include "rt_monitor.h"

#include "rt_drive.h"
#include "rt_pixels.h"

#include <math.h>

void lxrt_begin_monitors(lxrt_pack *pack)
{
    lxrt_pixel_sum sum;
    for (uint32_t i = 0; (sum = lxrt_get_pixel_sum(i, NULL)) != NULL; ++i) pack->pixel_sum = sum;
    for (uint32_t i = 0; i < pack->monitors.count; ++i) {
        lxrt_monitor_state *state = &pack->monitor_states[i];
        *state = (lxrt_monitor_state){.smoothing = 0};
        for (int k = 0; k < 3; ++k) state->strength[k] = lxrt_load_f32(lxrt_element(&pack->monitors, i) + 28 + 4 * k);
    }
}

lxrt_result lxrt_get_monitor(const lxrt_pack *pack, uint32_t index, lxrt_monitor *out)
{
    if (!pack || !out) return LXRT_ERROR_INVALID_ARGUMENT;
    if (index >= pack->monitors.count) return LXRT_ERROR_NOT_FOUND;
    const unsigned char *data = lxrt_element(&pack->monitors, index);
    *out = (lxrt_monitor){
        .name = lxrt_name(pack, data),
        .node = lxrt_load_u32(data + 8),
        .material = (int32_t)lxrt_load_u32(data + 12),
        .columns = lxrt_load_u32(data + 16),
        .rows = lxrt_load_u32(data + 20),
        .first_layer = lxrt_load_u32(data + 24),
    };
    memcpy(out->strength, pack->monitor_states[index].strength, sizeof out->strength);
    return LXRT_OK;
}

lxrt_result lxrt_monitor_configure(lxrt_pack *pack, uint32_t monitor, const float strength[3], float smoothing)
{
    if (!pack) return LXRT_ERROR_INVALID_ARGUMENT;
    if (monitor >= pack->monitors.count) return LXRT_ERROR_NOT_FOUND;
    if (!(smoothing >= 0 && smoothing < 1)) return LXRT_ERROR_INVALID_ARGUMENT;
    lxrt_monitor_state *state = &pack->monitor_states[monitor];
    if (strength) {
        for (int i = 0; i < 3; ++i)
            if (!(strength[i] >= 0 && strength[i] <= LXRT_MAX_FACTOR)) return LXRT_ERROR_INVALID_ARGUMENT;
        memcpy(state->strength, strength, sizeof state->strength);
    }
    state->smoothing = smoothing;
    return LXRT_OK;
}

// A run of pixels of which equal shares lie in a cell.
typedef struct part {
    uint32_t begin, end;
    uint32_t share; // of each, in units
} part;

// What of `pixels` pixels along an axis lies in cell `index` of `count`; returns the number of parts.
static int cut_cell(uint32_t index, uint32_t count, uint32_t pixels, part parts[3])
{
    const uint64_t begin = (uint64_t)index * pixels, end = begin + pixels; // in units
    const uint32_t first = (uint32_t)(begin / count), last = (uint32_t)(end / count);
    const uint32_t before = (uint32_t)(begin % count), behind = (uint32_t)(end % count); // of those pixels, outside and inside
    int used = 0;
    if (first == last) {
        parts[used++] = (part){first, first + 1, pixels};
        return used;
    }
    if (before > 0) parts[used++] = (part){first, first + 1, count - before};
    if (first + (before > 0) < last) parts[used++] = (part){first + (before > 0), last, count};
    if (behind > 0) parts[used++] = (part){last, last + 1, behind};
    return used;
}

typedef struct picture {
    const unsigned char *pixels;
    size_t stride;
    uint32_t width, height, pixel_bytes;
    lxrt_pixels format;
} picture;

static uint32_t least(uint32_t a, uint32_t b)
{
    return a < b ? a : b;
}

static void sum_bytes(const lxrt_pack *pack, const picture *from, const uint32_t *table, const part *x, const part *y, uint64_t sums[3])
{
    lxrt_pixel_block block = {.stride = from->stride, .pixel_bytes = from->pixel_bytes, .table = table};
    for (uint32_t row = y->begin; row < y->end; row += block.rows) {
        block.rows = least(y->end - row, lxrt_max_sum_rows);
        for (uint32_t column = x->begin; column < x->end; column += block.width) {
            block.width = least(x->end - column, lxrt_max_sum_width);
            block.pixels = from->pixels + row * from->stride + (size_t)column * from->pixel_bytes;
            pack->pixel_sum(&block, sums);
        }
    }
}

// Mean of the linear pixels in a cell.
static void average_cell(const lxrt_pack *pack, const picture *from, const uint32_t *table, const part *x, int x_count, const part *y,
                         int y_count, double mean[3])
{
    uint64_t whole[3] = {0, 0, 0}; // below 2^62: the picture's units are below 2^40, a value below 2^22
    double real[3] = {0, 0, 0};
    for (int j = 0; j < y_count; ++j) {
        for (int i = 0; i < x_count; ++i) {
            const uint64_t share = (uint64_t)x[i].share * y[j].share;
            uint64_t part_whole[3] = {0, 0, 0};
            double part_real[4] = {0, 0, 0, 0};
            if (from->format == LXRT_PIXELS_RGBA32F)
                lxrt_sum_floats(from->pixels + y[j].begin * from->stride + (size_t)x[i].begin * from->pixel_bytes, from->stride,
                                x[i].end - x[i].begin, y[j].end - y[j].begin, part_real);
            else
                sum_bytes(pack, from, table, &x[i], &y[j], part_whole);
            for (int k = 0; k < 3; ++k) {
                whole[k] += share * part_whole[k];
                real[k] += (double)share * part_real[k];
            }
        }
    }
    const uint64_t area = (uint64_t)from->width * from->height;
    for (int k = 0; k < 3; ++k)
        mean[k] = from->format == LXRT_PIXELS_RGBA32F ? real[k] / (double)area : (double)whole[k] / (double)(area * lxrt_white);
}

// What an update leaves of the old colour gets ever smaller; below 2^-16 of white it is nothing, so that a still picture comes to rest.
static double smooth(double old, double now, double smoothing, double white)
{
    const double kept = smoothing * (old - now);
    return fabs(kept) <= white * 0x1p-16 ? now : now + kept;
}

lxrt_result lxrt_monitor_update(lxrt_pack *pack, uint32_t monitor, const void *pixels, uint32_t width, uint32_t height, size_t stride,
                                lxrt_pixels format)
{
    static const uint32_t sizes[] = {[LXRT_PIXELS_RGBA8_SRGB] = 4, [LXRT_PIXELS_RGB8_SRGB] = 3, [LXRT_PIXELS_RGBA32F] = 16};
    if (!pack || !pixels || width == 0 || height == 0 || (uint64_t)width * height > (uint64_t)1 << 40 ||
        (uint32_t)format >= sizeof sizes / sizeof *sizes || width > SIZE_MAX / sizes[format])
        return LXRT_ERROR_INVALID_ARGUMENT;
    const size_t row_bytes = (size_t)width * sizes[format];
    if (stride == 0) stride = row_bytes;
    if (stride < row_bytes || stride > SIZE_MAX / height) return LXRT_ERROR_INVALID_ARGUMENT;
    lxrt_monitor cells;
    const lxrt_result result = lxrt_get_monitor(pack, monitor, &cells);
    if (result != LXRT_OK) return result;

    const picture from = {pixels, stride, width, height, sizes[format], format};
    const lxrt_monitor_state *state = &pack->monitor_states[monitor];
    uint32_t table[256];
    lxrt_fill_srgb_table(table);
    uint32_t layer = cells.first_layer;
    for (uint32_t row = 0; row < cells.rows; ++row) {
        part y[3];
        const int y_count = cut_cell(row, cells.rows, height, y);
        for (uint32_t column = 0; column < cells.columns; ++column, ++layer) {
            part x[3];
            double color[3];
            const int x_count = cut_cell(column, cells.columns, width, x);
            average_cell(pack, &from, table, x, x_count, y, y_count, color);
            for (int k = 0; k < 3; ++k)
                color[k] = smooth(pack->colors[layer].color[k], state->strength[k] * color[k], state->smoothing, state->strength[k]);
            lxrt_drive_layer(pack, layer, color);
        }
    }
    return LXRT_OK;
}
