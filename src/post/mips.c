// Mip levels of lightmap pages that keep charts apart.
//
// An ordinary box filter would mix light of neighbouring charts, which lie on unrelated surfaces. Here a coarse texel belongs to one
// chart and averages that chart's texels alone.
#include "post/dilate.h"

#include <string.h>

static void fine_quad(uint32_t size, uint32_t x, uint32_t y, size_t quad[4])
{
    const size_t corner = (size_t)(2 * y) * size + 2 * x;
    quad[0] = corner;
    quad[1] = corner + 1;
    quad[2] = corner + size;
    quad[3] = corner + size + 1;
}

void lx_mip_halve_chart(uint32_t size, const uint32_t *fine_chart, uint32_t *coarse_chart)
{
    const uint32_t coarse_size = size / 2;
    for (uint32_t y = 0; y < coarse_size; ++y) {
        for (uint32_t x = 0; x < coarse_size; ++x) {
            size_t quad[4];
            fine_quad(size, x, y, quad);
            uint32_t best = LX_NO_CHART, best_count = 0;
            for (int i = 0; i < 4; ++i) {
                const uint32_t chart = fine_chart[quad[i]];
                uint32_t count = 0;
                for (int k = 0; k < 4; ++k) count += fine_chart[quad[k]] == chart;
                if (chart == LX_NO_CHART) continue; // one covered texel is enough: emptiness wins no vote
                if (count > best_count || (count == best_count && chart < best)) {
                    best = chart;
                    best_count = count;
                }
            }
            coarse_chart[(size_t)y * coarse_size + x] = best;
        }
    }
}

void lx_mip_halve(uint32_t size, const uint32_t *fine_chart, const uint32_t *coarse_chart, const float *fine_rgb, float *coarse_rgb)
{
    const uint32_t coarse_size = size / 2;
    for (uint32_t y = 0; y < coarse_size; ++y) {
        for (uint32_t x = 0; x < coarse_size; ++x) {
            const size_t coarse = (size_t)y * coarse_size + x;
            size_t quad[4];
            fine_quad(size, x, y, quad);
            float sum[3] = {0}, count = 0;
            for (int i = 0; i < 4 && coarse_chart[coarse] != LX_NO_CHART; ++i) {
                if (fine_chart[quad[i]] != coarse_chart[coarse]) continue;
                for (int k = 0; k < 3; ++k) sum[k] += fine_rgb[3 * quad[i] + k];
                ++count;
            }
            for (int k = 0; k < 3; ++k) coarse_rgb[3 * coarse + k] = count > 0 ? sum[k] / count : 0;
        }
    }
}
