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
