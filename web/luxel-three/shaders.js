// Written by make-shaders.mjs from shaders/*.glsl: change those.

export const lx_range_factor = /* glsl */ `
// KHR_lights_punctual: a lamp's light ends smoothly at its range. The window is not squared: three.js squares it. 1/d² is not in it.
// Mirrors lx_range_factor in src/trace/light_sample.c.
float lx_range_factor(float lightDistance, float range) {
  if (!(range > 0.0)) return 1.0;
  float ratio = lightDistance / range, ratio2 = ratio * ratio;
  return clamp(1.0 - ratio2 * ratio2, 0.0, 1.0);
}
`;

export const lx_spot_factor = /* glsl */ `
// KHR_lights_punctual: how a spot's light falls off between its inner and its outer cone; the cosine is of the angle off its axis.
// Mirrors lx_spot_factor in src/trace/light_sample.c.
float lx_spot_factor(float cosInner, float cosOuter, float cosine) {
  float scale = 1.0 / max(1e-3, cosInner - cosOuter); // the extension's own least width
  float attenuation = clamp((cosine - cosOuter) * scale, 0.0, 1.0);
  return attenuation * attenuation;
}
`;

export const lxrt_compose = /* glsl */ `
// E = Σ c T per pixel, over any number of layers. Mirrors lxrt_compose in runtime/src. Needs lxrt_lightmap_sample.glsl.
//
// layers   every page of every layer: slice = page × layers + layer, texels as the pack stores them
// factors  one texel a layer that shines, 256 to a row: rgb = c × scale of the layer, alpha = its number. Black layers are left out
//          and cost nothing.
const int LXRT_FACTORS_PER_ROW = 256;

vec4 lxrt_factor(sampler2D factors, int index) {
  return texelFetch(factors, ivec2(index % LXRT_FACTORS_PER_ROW, index / LXRT_FACTORS_PER_ROW), 0);
}

// One texel of a level.
vec3 lxrt_compose(sampler2DArray layers, sampler2D factors, int factorCount, int firstSlice, ivec2 texel, int level) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < factorCount; i++) {
    vec4 factor = lxrt_factor(factors, i);
    sum += factor.rgb * texelFetch(layers, ivec3(texel, firstSlice + int(factor.a)), level).rgb;
  }
  return sum;
}

// The same at any point, filtered.
vec3 lxrt_compose_bilinear(sampler2DArray layers, sampler2D factors, int factorCount, int firstSlice, vec2 uv) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < factorCount; i++) {
    vec4 factor = lxrt_factor(factors, i);
    sum += factor.rgb * lxrt_lightmap_sample_bilinear(layers, float(firstSlice) + factor.a, uv);
  }
  return sum;
}

vec3 lxrt_compose_bicubic(sampler2DArray layers, sampler2D factors, int factorCount, int firstSlice, vec2 uv) {
  vec3 sum = vec3(0.0);
  for (int i = 0; i < factorCount; i++) {
    vec4 factor = lxrt_factor(factors, i);
    sum += factor.rgb * lxrt_lightmap_sample_bicubic(layers, float(firstSlice) + factor.a, uv);
  }
  return sum;
}
`;

export const lxrt_lightmap_sample = /* glsl */ `
// One point of a page, of an array texture of pages that are composed already. (0, 0) is the corner where row 0 begins; edges are
// clamped by the sampler. Mirrors lxrt_lightmap_sample in runtime/src: bilinear is what texture units do, and mip levels come with it.
vec3 lxrt_lightmap_sample_bilinear(sampler2DArray pages, float slice, vec2 uv) {
  return texture(pages, vec3(uv, slice)).rgb;
}

// Cubic B-spline on one axis: the four texels around a place (in texels) as two bilinear taps, and what each is worth.
// The weights are w0…w3 of Sigg and Hadwiger, GPU Gems 2, chapter 20; a tap between texels a and b at wb / (wa + wb) is (wa + wb) times
// their mean by weight.
void lxrt_bicubic_taps(float at, out vec2 taps, out vec2 weights) {
  float first = floor(at - 0.5), x = at - 0.5 - first;
  float x2 = x * x, x3 = x2 * x;
  float w0 = (1.0 - 3.0 * x + 3.0 * x2 - x3) / 6.0;
  float w1 = (4.0 - 6.0 * x2 + 3.0 * x3) / 6.0;
  float w2 = (1.0 + 3.0 * x + 3.0 * x2 - 3.0 * x3) / 6.0;
  float w3 = x3 / 6.0;
  weights = vec2(w0 + w1, w2 + w3);
  taps = first + vec2(-0.5 + w1 / weights.x, 1.5 + w3 / weights.y);
}

// Level 0 alone: for magnified lightmaps, where one sees texels. Smooth, slightly blurred; wants a padding of 2 texels or more.
vec3 lxrt_lightmap_sample_bicubic(sampler2DArray pages, float slice, vec2 uv) {
  vec2 size = vec2(textureSize(pages, 0).xy);
  vec2 x, y, weightsX, weightsY;
  uv = clamp(uv, 0.0, 1.0);
  lxrt_bicubic_taps(uv.x * size.x, x, weightsX);
  lxrt_bicubic_taps(uv.y * size.y, y, weightsY);
  x /= size.x;
  y /= size.y;
  vec3 top = textureLod(pages, vec3(x.x, y.x, slice), 0.0).rgb * weightsX.x + textureLod(pages, vec3(x.y, y.x, slice), 0.0).rgb * weightsX.y;
  vec3 bottom = textureLod(pages, vec3(x.x, y.y, slice), 0.0).rgb * weightsX.x + textureLod(pages, vec3(x.y, y.y, slice), 0.0).rgb * weightsX.y;
  return top * weightsY.x + bottom * weightsY.y;
}
`;
