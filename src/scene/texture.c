// Texture lookups as glTF's samplers define them, without mip levels.
#include "scene/scene.h"

#include "math/color.h"

#include <math.h>

static const lx_vec4 white = {1, 1, 1, 1};

// The decoded image behind a slot, always of bytes: glTF has PNG, JPEG and WebP. NULL: none, reads as white.
static const lx_image *image_of(const lx_scene *scene, const lx_texture_slot *slot)
{
    if (slot->texture < 0) return NULL;
    const int32_t index = scene->textures[slot->texture].image;
    if (index < 0) return NULL;
    const lx_image *image = &scene->images[index];
    return image->width > 0 && image->data ? image : NULL;
}

// Texel index for the coordinate `t` in texels, already floored, of any size.
static uint32_t wrap_texel(float t, uint32_t size, lx_wrap wrap)
{
    const float n = (float)size;
    if (t >= 0 && t < n) return (uint32_t)t;
    if (wrap == LX_WRAP_CLAMP) return t < 0 ? 0 : t >= n ? size - 1 : (uint32_t)t;
    const float period = wrap == LX_WRAP_MIRROR ? 2 * n : n;
    float r = t - period * floorf(t / period);
    if (!(r >= 0 && r < period)) r = 0; // rounding at the ends, and what is left of huge values
    uint32_t texel = (uint32_t)r;
    if (wrap == LX_WRAP_MIRROR && texel >= size) texel = 2 * size - 1 - texel;
    return texel < size ? texel : size - 1;
}

static lx_vec4 fetch(const lx_image *image, uint32_t x, uint32_t y, bool srgb)
{
    const uint8_t *p = image->u8 + ((size_t)y * image->width + x) * image->channels;
    const uint8_t r = p[0], g = image->channels >= 3 ? p[1] : r, b = image->channels >= 3 ? p[2] : r;
    const float alpha = image->channels == 4 ? (p[3] == 255 ? 1 : p[3] / 255.0f) : image->channels == 2 ? p[1] / 255.0f : 1;
    if (srgb) return (lx_vec4){lx_srgb_byte_to_linear[r], lx_srgb_byte_to_linear[g], lx_srgb_byte_to_linear[b], alpha};
    return (lx_vec4){r / 255.0f, g / 255.0f, b / 255.0f, alpha};
}

static lx_vec4 mix(lx_vec4 a, lx_vec4 b, float t)
{
    const float s = 1 - t;
    return (lx_vec4){a.x * s + b.x * t, a.y * s + b.y * t, a.z * s + b.z * t, a.w * s + b.w * t};
}

lx_vec4 lx_texture_sample(const lx_scene *scene, const lx_texture_slot *slot, lx_vec2 uv, bool srgb)
{
    const lx_image *image = image_of(scene, slot);
    if (!image) return white;
    const lx_texture *texture = &scene->textures[slot->texture];
    float x = (slot->m[0] * uv.x + slot->m[1] * uv.y + slot->m[2]) * (float)image->width;
    float y = (slot->m[3] * uv.x + slot->m[4] * uv.y + slot->m[5]) * (float)image->height;
    if (!isfinite(x)) x = 0; // coordinates are finite in a scene, but interpolated and transformed ones may overflow
    if (!isfinite(y)) y = 0;
    if (texture->nearest)
        return fetch(image, wrap_texel(floorf(x), image->width, texture->wrap_s),
                     wrap_texel(floorf(y), image->height, texture->wrap_t), srgb);
    const float left = floorf(x - 0.5f), top = floorf(y - 0.5f); // texel centres lie at halves
    const uint32_t x0 = wrap_texel(left, image->width, texture->wrap_s),
                   x1 = wrap_texel(left + 1, image->width, texture->wrap_s);
    const uint32_t y0 = wrap_texel(top, image->height, texture->wrap_t),
                   y1 = wrap_texel(top + 1, image->height, texture->wrap_t);
    const float s = lx_clamp(x - 0.5f - left, 0, 1), t = lx_clamp(y - 0.5f - top, 0, 1);
    return mix(mix(fetch(image, x0, y0, srgb), fetch(image, x1, y0, srgb), s),
               mix(fetch(image, x0, y1, srgb), fetch(image, x1, y1, srgb), s), t);
}

bool lx_texture_has_alpha(const lx_scene *scene, const lx_texture_slot *slot)
{
    const lx_image *image = image_of(scene, slot);
    if (!image || image->channels % 2 != 0) return false;
    const size_t texels = (size_t)image->width * image->height, step = image->channels;
    for (size_t i = 0; i < texels; ++i)
        if (image->u8[i * step + step - 1] < 255) return true;
    return false;
}
