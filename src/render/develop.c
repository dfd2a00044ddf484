#include "render/develop.h"

#include "math/color.h"

lx_rgb lx_tonemap_pbr_neutral(lx_rgb color)
{
    static const float start_compression = 0.8f - 0.04f, desaturation = 0.15f;
    const float x = lx_min(color.r, lx_min(color.g, color.b));
    const float offset = x < 0.08f ? x - 6.25f * x * x : 0.04f;
    color = (lx_rgb){color.r - offset, color.g - offset, color.b - offset};
    const float peak = lx_rgb_max(color);
    if (peak < start_compression) return color;
    const float d = 1 - start_compression;
    const float new_peak = 1 - d * d / (peak + d - start_compression);
    color = lx_rgb_scale(color, new_peak / peak);
    const float g = 1 - 1 / (desaturation * (peak - new_peak) + 1);
    return lx_rgb_add(lx_rgb_scale(color, 1 - g), lx_rgb_grey(new_peak * g));
}

float lx_auto_exposure(const float *rgb, size_t pixel_count)
{
    double sum = 0;
    size_t count = 0;
    for (size_t i = 0; i < pixel_count; ++i) {
        const float luminance = lx_luminance((lx_rgb){rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]});
        if (!(luminance > 1e-20f) || !(luminance < INFINITY)) continue;
        sum += log2((double)luminance);
        ++count;
    }
    return count ? (float)(log2(0.18) - sum / (double)count) : 0;
}

static uint8_t to_byte(float linear)
{
    const float v = lx_linear_to_srgb(lx_clamp(linear, 0, 1));
    return (uint8_t)(v * 255 + 0.5f);
}

void lx_render_develop(const lx_render_desc *desc, float ev, const float *rgb, uint8_t *out_srgb)
{
    const bool plain = desc->view != LX_VIEW_LIT; // lightmap and albedo are shown as they are
    const float exposure = plain && desc->view == LX_VIEW_ALBEDO ? 1 : exp2f(ev);
    const size_t count = (size_t)desc->width * desc->height;
    for (size_t i = 0; i < count; ++i) {
        lx_rgb c = lx_rgb_scale((lx_rgb){rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]}, exposure);
        if (!plain && desc->tonemap == LX_TONEMAP_PBR_NEUTRAL) c = lx_tonemap_pbr_neutral(c);
        out_srgb[3 * i] = to_byte(c.r);
        out_srgb[3 * i + 1] = to_byte(c.g);
        out_srgb[3 * i + 2] = to_byte(c.b);
    }
}
