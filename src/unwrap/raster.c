// Which cells of a grid a triangle covers: by centres (a partition: neighbours never share a cell) or by touch (a cover).
#include "unwrap/unwrap.h"

// Centres are decided on coordinates rounded to 1/4096 of a cell, with integers, so that two triangles with a common edge
// decide alike: left of an edge is in, right of it is out, whoever asks.
enum { raster_bits = 12 };

static int64_t to_fixed(double v)
{
    const double limit = 65536; // far outside of any grid
    v = v < -limit ? -limit : v > limit ? limit : v;
    return (int64_t)floor(v * (1 << raster_bits) + 0.5);
}

static int64_t floor_divide(int64_t a, int64_t b) // b > 0
{
    return a >= 0 ? a / b : -((-a + b - 1) / b);
}

// First cell whose centre is at or right of the edge (low → high, low.y < high.y) on the centre line of row y.
static int64_t first_right_of(const int64_t low[2], const int64_t high[2], int64_t y)
{
    const int64_t half = 1 << (raster_bits - 1), one = 1 << raster_bits;
    const int64_t dy = high[1] - low[1], yc = y * one + half;
    // x = low.x + (yc - low.y) dx / dy; the smallest i with i·one + half >= x is ceil((x - half) / one).
    const int64_t numerator = (yc - low[1]) * (high[0] - low[0]) + (low[0] - half) * dy;
    return -floor_divide(-numerator, dy * one);
}

static int64_t clamp_cell(int64_t i, uint32_t size)
{
    return i < 0 ? 0 : i > (int64_t)size ? (int64_t)size : i;
}

void lx_raster_centers(const lx_dvec2 triangle[3], uint32_t size, lx_span span, void *user)
{
    int64_t p[3][2];
    for (int i = 0; i < 3; ++i) {
        p[i][0] = to_fixed(triangle[i].x);
        p[i][1] = to_fixed(triangle[i].y);
    }
    int order[3] = {0, 1, 2};
    for (int i = 0; i < 2; ++i)
        for (int k = 0; k < 2; ++k)
            if (p[order[k]][1] > p[order[k + 1]][1]) {
                const int swap = order[k];
                order[k] = order[k + 1];
                order[k + 1] = swap;
            }
    const int64_t *low = p[order[0]], *middle = p[order[1]], *high = p[order[2]];
    const int64_t half = 1 << (raster_bits - 1), one = 1 << raster_bits;
    // Rows with low.y <= centre < high.y.
    const int64_t y0 = clamp_cell(-floor_divide(half - low[1], one), size);
    const int64_t y1 = clamp_cell(-floor_divide(half - high[1], one), size);
    for (int64_t y = y0; y < y1; ++y) {
        const int64_t a = first_right_of(low, high, y);
        const int64_t b = y * one + half < middle[1] ? first_right_of(low, middle, y) : first_right_of(middle, high, y);
        const int64_t x0 = clamp_cell(a < b ? a : b, size), x1 = clamp_cell(a < b ? b : a, size);
        if (x0 < x1) span(user, (uint32_t)y, (uint32_t)x0, (uint32_t)x1);
    }
}

static uint32_t cell_of(double v, uint32_t size)
{
    return !(v > 0) ? 0 : v >= (double)size ? size - 1 : (uint32_t)v;
}

void lx_raster_touched(const lx_dvec2 triangle[3], uint32_t size, lx_span span, void *user)
{
    const double rim = 1e-3; // of a cell
    double low = INFINITY, high = -INFINITY;
    for (int i = 0; i < 3; ++i) {
        low = fmin(low, triangle[i].y);
        high = fmax(high, triangle[i].y);
    }
    const uint32_t y0 = cell_of(low + rim, size), y1 = cell_of(high - rim, size);
    for (uint32_t y = y0; y <= y1 || y == y0; ++y) {
        // Extent of the part of the triangle in this row.
        double left = INFINITY, right = -INFINITY;
        const double bottom = y == y0 ? low : (double)y, top = y >= y1 ? high : (double)y + 1;
        for (int i = 0; i < 3; ++i) {
            lx_dvec2 a = triangle[i], b = triangle[i == 2 ? 0 : i + 1];
            if (a.y > b.y) {
                const lx_dvec2 swap = a;
                a = b;
                b = swap;
            }
            if (b.y < bottom || a.y > top) continue;
            const double slope = b.y > a.y ? (b.x - a.x) / (b.y - a.y) : 0;
            const double xa = a.y < bottom ? a.x + (bottom - a.y) * slope : a.x;
            const double xb = b.y > top ? a.x + (top - a.y) * slope : b.x;
            left = fmin(left, fmin(xa, xb));
            right = fmax(right, fmax(xa, xb));
        }
        if (left > right) continue;
        const uint32_t x0 = cell_of(left + rim, size), x1 = cell_of(right - rim, size);
        span(user, y, x0, (x1 > x0 ? x1 : x0) + 1);
    }
}
