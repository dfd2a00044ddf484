// Lightmaps on the GPU: either composed pages, uploaded where they changed, or all layers of all pages, summed per pixel.
// Both are one 2D array texture in RGB9E5 with all mip levels, so one shader serves every object of the scene.
import { DataTexture, ExternalTexture, FloatType, NearestFilter, RGBAFormat } from 'three';
import { FORMAT } from './runtime.js';

const FACTORS_PER_ROW = 256; // as in shaders/lxrt_compose.glsl
const LARGEST = 65408; // of RGB9E5
const LARGEST_EXPONENT = 100; // of the scale, which the runtime and shaders take as a float

// three.js cannot update a part of a level of a slice, so the texture is ours and three only binds it.
class ArrayTexture {
  #renderer;

  constructor(renderer, size, slices, levels) {
    this.#renderer = renderer;
    this.size = size;
    this.slices = slices;
    this.levels = levels;
    this.texture = new ExternalTexture(null);
    this.create();
  }

  /** Anew, empty: at first, and when the context was lost. */
  create() {
    const gl = this.#renderer.getContext();
    this.texture.sourceTexture = gl.createTexture();
    this.#bind(gl);
    gl.texStorage3D(gl.TEXTURE_2D_ARRAY, this.levels, gl.RGB9_E5, this.size, this.size, this.slices);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MIN_FILTER, this.levels > 1 ? gl.LINEAR_MIPMAP_LINEAR : gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_MAG_FILTER, gl.LINEAR);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_S, gl.CLAMP_TO_EDGE);
    gl.texParameteri(gl.TEXTURE_2D_ARRAY, gl.TEXTURE_WRAP_T, gl.CLAMP_TO_EDGE);
  }

  // three remembers what is bound and how pixels are unpacked: both are set through it.
  #bind(gl) {
    const { state } = this.#renderer;
    state.activeTexture(gl.TEXTURE0); // uploads go to the active unit, and bindTexture() leaves that alone when it remembers our texture
    state.bindTexture(gl.TEXTURE_2D_ARRAY, this.texture.sourceTexture, gl.TEXTURE0);
  }

  /** A rectangle of a level; `words` begins at its first texel and has `rowLength` texels from row to row. */
  upload(level, slice, { x, y, width, height }, words, rowLength) {
    const gl = this.#renderer.getContext();
    const { state } = this.#renderer;
    this.#bind(gl);
    state.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, false);
    state.pixelStorei(gl.UNPACK_PREMULTIPLY_ALPHA_WEBGL, false);
    state.pixelStorei(gl.UNPACK_ALIGNMENT, 4);
    state.pixelStorei(gl.UNPACK_ROW_LENGTH, rowLength);
    gl.texSubImage3D(gl.TEXTURE_2D_ARRAY, level, x, y, slice, width, height, 1, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, words);
    state.pixelStorei(gl.UNPACK_ROW_LENGTH, 0);
  }

  dispose() {
    const gl = this.#renderer.getContext();
    this.#renderer.state.unbindTexture();
    gl.deleteTexture(this.texture.sourceTexture);
    this.texture.sourceTexture = null;
    this.texture.dispose();
  }
}

/** Method `cpu`: sums in WebAssembly, changed blocks to the GPU. */
export class ComposedPages {
  #runtime;
  #pages = []; // accumulator, and per level where its texels are
  #scale = 1; // stored = E × scale

  constructor(renderer, runtime, uniforms) {
    const { pageSize, pageCount, levelCount } = runtime.info;
    this.#runtime = runtime;
    this.uniforms = uniforms;
    this.array = new ArrayTexture(renderer, pageSize, Math.max(1, pageCount), levelCount);
    for (let page = 0; page < pageCount; page++) {
      const levels = [];
      for (let level = 0; level < levelCount; level++) levels.push(runtime.allocate(4 * (pageSize >> level) ** 2));
      this.#pages.push({ accumulator: runtime.createAccumulator(page), levels });
    }
    uniforms.luxelPages.value = this.array.texture;
  }

  // Texels end at 65408: `brightest` is at least the largest sum there can be. The scale moves rarely, and by much, for everything has
  // to be composed again.
  #chooseScale(brightest) {
    const stored = brightest * this.#scale;
    if (!(brightest > 0) || (stored <= LARGEST && stored >= 16)) return;
    const exponent = 12 - Math.ceil(Math.log2(brightest));
    const scale = 2 ** Math.min(Math.max(exponent, -LARGEST_EXPONENT), LARGEST_EXPONENT);
    if (scale === this.#scale) return; // darker than that, texels are black
    this.#scale = scale;
    this.reset();
  }

  /** Composes what changed. `brightest`: a bound on E. Returns whether anything did. */
  update(brightest) {
    this.#chooseScale(brightest);
    const { pageSize, levelCount } = this.#runtime.info;
    let changed = false;
    for (const [page, { accumulator, levels }] of this.#pages.entries()) {
      if (this.#runtime.accumulatorBegin(accumulator) === 0) continue;
      changed = true;
      for (let level = 0; level < levelCount; level++) {
        const size = pageSize >> level;
        const region = this.#runtime.accumulatorBounds(accumulator, level);
        if (region.width === 0 || region.height === 0) continue;
        const first = levels[level] + 4 * (region.y * size + region.x);
        this.#runtime.accumulatorUpdate(accumulator, region, first, 4 * size, FORMAT.rgb9e5, this.#scale);
        const words = (region.height - 1) * size + region.width;
        this.array.upload(level, page, region, this.#runtime.words(first, words), size);
      }
    }
    this.uniforms.luxelScale.value = 1 / this.#scale;
    return changed;
  }

  reset() {
    for (const { accumulator } of this.#pages) this.#runtime.accumulatorReset(accumulator);
  }

  restore() {
    this.array.create();
    this.reset();
  }

  dispose() {
    this.array.dispose();
  }
}

/** Method `gpu`: all layers on the GPU, and a texture with their colours. */
export class LayeredPages {
  #runtime;
  #units; // what one stored texel is worth, by layer, as it was uploaded
  #shown = null; // factors of the last update

  constructor(renderer, runtime, uniforms) {
    const { pageSize, pageCount, levelCount, layerCount } = runtime.info;
    this.#runtime = runtime;
    this.uniforms = uniforms;
    this.array = new ArrayTexture(renderer, pageSize, Math.max(1, pageCount * layerCount), levelCount);
    this.staging = runtime.allocate(4 * pageSize * pageSize);
    const rows = Math.max(1, Math.ceil(layerCount / FACTORS_PER_ROW));
    this.factors = new DataTexture(new Float32Array(4 * FACTORS_PER_ROW * rows), FACTORS_PER_ROW, rows, RGBAFormat, FloatType);
    this.factors.minFilter = this.factors.magFilter = NearestFilter;
    this.fill();
    uniforms.luxelPages.value = this.array.texture;
    uniforms.luxelFactors.value = this.factors;
    uniforms.luxelLayerCount.value = layerCount;
  }

  /** Uploads every layer, each alone at the strength that gives back the pack's own texels. */
  fill() {
    const { pageSize, pageCount, levelCount, layerCount } = this.#runtime.info;
    const kept = Array.from({ length: layerCount }, (_, layer) => this.#runtime.color(layer, [0, 0, 0]));
    this.#units = kept.map((_, layer) => Math.max(this.#runtime.layer(layer).scale, 2 ** -80)); // 2^80 is a colour that can be set
    for (let layer = 0; layer < layerCount; layer++) this.#runtime.setColor(layer, 0, 0, 0);
    for (let layer = 0; layer < layerCount; layer++) {
      this.#runtime.setColor(layer, 1, 1, 1, 1 / this.#units[layer]);
      for (let page = 0; page < pageCount; page++) {
        for (let level = 0; level < levelCount; level++) {
          const size = pageSize >> level;
          this.#runtime.compose(page, level, 0, 0, size, size, FORMAT.rgb9e5, this.staging);
          const whole = { x: 0, y: 0, width: size, height: size };
          this.array.upload(level, page * layerCount + layer, whole, this.#runtime.words(this.staging, size * size), size);
        }
      }
      this.#runtime.setColor(layer, 0, 0, 0);
    }
    kept.forEach((rgb, layer) => this.#runtime.setColor(layer, ...rgb));
    this.#shown = null;
  }

  update() {
    const { layerCount } = this.#runtime.info;
    const factors = new Float32Array(4 * layerCount);
    const rgb = [0, 0, 0];
    let count = 0;
    for (let layer = 0; layer < layerCount; layer++) {
      this.#runtime.color(layer, rgb);
      if (rgb[0] === 0 && rgb[1] === 0 && rgb[2] === 0) continue;
      for (let i = 0; i < 3; i++) factors[4 * count + i] = rgb[i] * this.#units[layer];
      factors[4 * count + 3] = layer;
      count++;
    }
    const used = factors.subarray(0, 4 * count);
    if (this.#shown?.length === used.length && used.every((value, i) => value === this.#shown[i])) return false;
    this.#shown = used;
    this.factors.image.data.set(used);
    this.factors.needsUpdate = true;
    this.uniforms.luxelFactorCount.value = count;
    return true;
  }

  restore() {
    this.array.create();
    this.fill();
  }

  dispose() {
    this.array.dispose();
    this.factors.dispose();
  }
}

/** Milliseconds that composing all layers of all pages takes, by a sample of strips; every layer shines. */
export function measureCompose(runtime) {
  const { pageSize, pageCount, layerCount } = runtime.info;
  if (pageCount === 0 || layerCount === 0) return 0;
  const kept = Array.from({ length: layerCount }, (_, layer) => runtime.color(layer, [0, 0, 0]));
  for (let layer = 0; layer < layerCount; layer++) runtime.setColor(layer, 1, 1, 1);
  const strip = Math.min(pageSize, 64);
  const texels = runtime.allocate(4 * pageSize * strip);
  const strips = pageCount * Math.floor(pageSize / strip);
  // Clocks of browsers are coarse, and compilers get better while we look: at least 4 ms, at most 50 or all there is, after a first go.
  const compose = (index) => {
    const perPage = Math.floor(pageSize / strip);
    runtime.compose(Math.floor(index / perPage), 0, 0, (index % perPage) * strip, pageSize, strip, FORMAT.rgb9e5, texels);
  };
  compose(0);
  const start = performance.now();
  let done = 0;
  let spent = 0;
  while (spent < 4 || (done < strips && spent < 50)) {
    compose((done * 7) % strips); // from all over
    done++;
    spent = performance.now() - start;
  }
  kept.forEach((rgb, layer) => runtime.setColor(layer, ...rgb));
  return ((spent / done) * strips * 4) / 3; // with mips
}
