// Numbers as people read them, and the scale of the intensity sliders.

/** Stops up and down from the middle of an intensity slider. */
export const sliderStops = 6;
const sliderZero = 0.03; // the left end of the slider is off, not 2^-6

/** Slider position 0…1 of an intensity: `middle` in the middle, doubling every 1/12 of the way, 0 at the left end. */
export function sliderOf(intensity, middle) {
  if (!(intensity > 0)) return 0;
  const position = 0.5 + Math.log2(intensity / middle) / (2 * sliderStops);
  return Math.min(1, Math.max(sliderZero, position));
}

export function intensityOf(position, middle) {
  if (position < sliderZero) return 0;
  const stops = (position - 0.5) * 2 * sliderStops;
  return middle * 2 ** stops;
}

/** Three significant digits, no exponent where it can be avoided. */
export function shortNumber(x) {
  if (x === 0) return "0";
  if (Math.abs(x) >= 1e6 || Math.abs(x) < 1e-3) return x.toExponential(2);
  return String(Number(x.toPrecision(3)));
}

export function unitName(unit) {
  return unit === "nt" ? "nit" : unit;
}

export function bytes(n) {
  if (n < 1000) return `${n} B`;
  const units = ["kB", "MB", "GB", "TB"];
  let k = -1;
  do {
    n /= 1000;
    k++;
  } while (n >= 999.5 && k < units.length - 1);
  return `${n < 10 ? n.toFixed(1) : n.toFixed(0)} ${units[k]}`;
}

/** Linear 0…1 to an sRGB byte. */
export function srgbByte(linear) {
  const x = Math.min(1, Math.max(0, linear));
  return Math.round(255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * x ** (1 / 2.4) - 0.055));
}

/** "#rrggbb" of a three.js colour; brighter than 1 is scaled to fit, so that the hue stays. */
export function hexOf(color) {
  const largest = Math.max(1, color.r, color.g, color.b);
  const byte = (x) => srgbByte(x / largest).toString(16).padStart(2, "0");
  return `#${byte(color.r)}${byte(color.g)}${byte(color.b)}`;
}
