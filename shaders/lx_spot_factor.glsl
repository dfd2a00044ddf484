// KHR_lights_punctual: how a spot's light falls off between its inner and its outer cone; the cosine is of the angle off its axis.
// Mirrors lx_spot_factor in src/trace/light_sample.c.
float lx_spot_factor(float cosInner, float cosOuter, float cosine) {
  float scale = 1.0 / max(1e-3, cosInner - cosOuter); // the extension's own least width
  float attenuation = clamp((cosine - cosOuter) * scale, 0.0, 1.0);
  return attenuation * attenuation;
}
