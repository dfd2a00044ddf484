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

// The four texels around a place and how far it lies between them; nearest sampling has one, four times over.
typedef struct taps {
    size_t at[4]; // top left, top right, bottom left, bottom right; texels of the image
    float s, t;
} taps;

static taps find_taps(const lx_image *image, const lx_texture *texture, const lx_texture_slot *slot, lx_vec2 uv)
{
    float x = (slot->m[0] * uv.x + slot->m[1] * uv.y + slot->m[2]) * (float)image->width;
    float y = (slot->m[3] * uv.x + slot->m[4] * uv.y + slot->m[5]) * (float)image->height;
    if (!isfinite(x)) x = 0; // coordinates are finite in a scene, but interpolated and transformed ones may overflow
    if (!isfinite(y)) y = 0;
    if (!texture->nearest) { // texel centres lie at halves
        x -= 0.5f;
        y -= 0.5f;
    }
    const float left = floorf(x), top = floorf(y), right = texture->nearest ? left : left + 1, bottom = texture->nearest ? top : top + 1;
    const size_t x0 = wrap_texel(left, image->width, texture->wrap_s), x1 = wrap_texel(right, image->width, texture->wrap_s);
    const size_t y0 = image->width * (size_t)wrap_texel(top, image->height, texture->wrap_t),
                 y1 = image->width * (size_t)wrap_texel(bottom, image->height, texture->wrap_t);
    taps k = {.at = {y0 + x0, y0 + x1, y1 + x0, y1 + x1}};
    if (texture->nearest) return k;
    k.s = lx_clamp(x - left, 0, 1);
    k.t = lx_clamp(y - top, 0, 1);
    return k;
}

static float fetch_alpha(const lx_image *image, size_t at)
{
    if (image->channels % 2 != 0) return 1;
    const uint8_t alpha = image->u8[at * image->channels + image->channels - 1];
    return alpha == 255 ? 1 : alpha / 255.0f;
}

static lx_vec4 fetch(const lx_image *image, size_t at, bool srgb)
{
    const uint8_t *p = image->u8 + at * image->channels;
    const uint8_t r = p[0], g = image->channels >= 3 ? p[1] : r, b = image->channels >= 3 ? p[2] : r;
    const float alpha = fetch_alpha(image, at);
    if (srgb) return (lx_vec4){lx_srgb_byte_to_linear[r], lx_srgb_byte_to_linear[g], lx_srgb_byte_to_linear[b], alpha};
    return (lx_vec4){r / 255.0f, g / 255.0f, b / 255.0f, alpha};
}

static float mix_one(float a, float b, float t)
{
    return a * (1 - t) + b * t;
}

static lx_vec4 mix(lx_vec4 a, lx_vec4 b, float t)
{
    return (lx_vec4){mix_one(a.x, b.x, t), mix_one(a.y, b.y, t), mix_one(a.z, b.z, t), mix_one(a.w, b.w, t)};
}

lx_vec4 lx_texture_sample(const lx_scene *scene, const lx_texture_slot *slot, lx_vec2 uv, bool srgb)
{
    const lx_image *image = image_of(scene, slot);
    if (!image) return white;
    const taps k = find_taps(image, &scene->textures[slot->texture], slot, uv);
    return mix(mix(fetch(image, k.at[0], srgb), fetch(image, k.at[1], srgb), k.s), mix(fetch(image, k.at[2], srgb), fetch(image, k.at[3], srgb), k.s), k.t);
}

float lx_texture_sample_alpha(const lx_scene *scene, const lx_texture_slot *slot, lx_vec2 uv)
{
    const lx_image *image = image_of(scene, slot);
    if (!image || image->channels % 2 != 0) return 1;
    const taps k = find_taps(image, &scene->textures[slot->texture], slot, uv);
    return mix_one(mix_one(fetch_alpha(image, k.at[0]), fetch_alpha(image, k.at[1]), k.s), mix_one(fetch_alpha(image, k.at[2]), fetch_alpha(image, k.at[3]), k.s), k.t);
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
