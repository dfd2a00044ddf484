// Which way of summing layers suits a scene on this machine: the rule of docs/web.md.

// Composing may take half a frame at 60 Hz; beyond that summing per pixel pays…
const MOST_COMPOSE_MS = 8;
// … for so few layers that fetching all of them for every pixel takes no longer than that on a small GPU.
const MOST_GPU_LAYERS = 16;

/** `composeMs`: all layers of all pages, as measured. `slices`: of the array texture with all layers of all pages. */
export function autoMethod({ composeMs, layers, gpuLayersBytes, slices, slicesLimit, gpuMemoryLimit = 256 * 1048576 }) {
  const fits = slices <= slicesLimit && gpuLayersBytes <= gpuMemoryLimit;
  return fits && layers <= MOST_GPU_LAYERS && composeMs > MOST_COMPOSE_MS ? 'gpu' : 'cpu';
}
