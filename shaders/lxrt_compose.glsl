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
