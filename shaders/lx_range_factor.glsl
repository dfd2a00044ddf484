// KHR_lights_punctual: a lamp's light ends smoothly at its range. The window is not squared: three.js squares it. 1/d² is not in it.
// Mirrors lx_range_factor in src/trace/light_sample.c.
float lx_range_factor(float lightDistance, float range) {
  if (!(range > 0.0)) return 1.0;
  float ratio = lightDistance / range, ratio2 = ratio * ratio;
  return clamp(1.0 - ratio2 * ratio2, 0.0, 1.0);
}
