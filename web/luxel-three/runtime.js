// luxel_rt compiled to WebAssembly: memory, struct layouts, one method per call. Knows nothing of three.js or of the page.
//
// Everything lies in the module's own memory, behind what the linker put there, one piece after the other; nothing is freed before
// the whole instance goes. The pack is streamed to its place, so it is in memory once.

export const NONE = 0xffffffff;

export const KINDS = ['point', 'spot', 'directional', 'rect', 'disk', 'emissive', 'sky', 'combined'];
const PROGRAM_KINDS = ['constant', 'keys', 'blink', 'flicker', 'pulse', 'wheel', 'schedule'];
const INTERPOLATIONS = ['step', 'linear', 'cubic'];
export const FORMAT = { rgb32f: 0, rgba16f: 1, rgb9e5: 2 };
const FORMAT_BYTES = [12, 8, 4];
export const FILTER = { bilinear: 0, bicubic: 1 };
export const PIXELS = { rgba8: 0, rgb8: 1, rgba32f: 2 };

// Structs of luxel_rt.h as wasm32 lays them out: [field, type, count] in order; every member has four bytes or is a u64.
const LAYOUTS = {
  info: [
    ['pageSize', 'u32'], ['pageCount', 'u32'], ['layerCount', 'u32'], ['levelCount', 'u32'], ['rectCount', 'u32'],
    ['sourceCount', 'u32'], ['animationCount', 'u32'], ['monitorCount', 'u32'], ['blockCount', 'u32'],
  ],
  layer: [['name', 'text'], ['kind', 'u32'], ['mixed', 'u32'], ['color', 'f32', 3], ['intensity', 'f32'], ['scale', 'f32']],
  rect: [
    ['node', 'u32'], ['gpuInstance', 'i32'], ['page', 'u32'], ['texcoord', 'u32'], ['x', 'u32'], ['y', 'u32'],
    ['width', 'u32'], ['height', 'u32'], ['scale', 'f32', 2], ['offset', 'f32', 2],
  ],
  source: [['name', 'text'], ['layer', 'u32'], ['kind', 'u32'], ['weight', 'f32', 3], ['node', 'u32'], ['material', 'i32']],
  animation: [['name', 'text'], ['layer', 'u32'], ['kind', 'u32'], ['duration', 'f32'], ['playing', 'u32']],
  monitor: [
    ['name', 'text'], ['node', 'u32'], ['material', 'i32'], ['columns', 'u32'], ['rows', 'u32'], ['firstLayer', 'u32'],
    ['strength', 'f32', 3],
  ],
  budget: [
    ['pack', 'u64'], ['handle', 'u64'], ['accumulator', 'u64'], ['gpuComposed', 'u64'], ['gpuLayers', 'u64'], ['dense', 'u64'],
  ],
  region: [['page', 'u32'], ['level', 'u32'], ['x', 'u32'], ['y', 'u32'], ['width', 'u32'], ['height', 'u32']],
  target: [['texels', 'u32'], ['rowBytes', 'u32'], ['format', 'u32'], ['scale', 'f32']],
  program: [
    ['kind', 'u32'], ['color', 'f32', 3], ['intensity', 'f32'], ['period', 'f32'], ['phase', 'f32'], ['duty', 'f32'],
    ['low', 'f32'], ['high', 'f32'], ['fade', 'f32'], ['seed', 'u32'], ['keys', 'u32'], ['keyCount', 'u32'],
    ['interpolation', 'u32'], ['loop', 'i32'],
  ],
};
const SCRATCH_BYTES = 1024; // larger than any of them, and than two

const modules = new Map(); // URL -> Promise<WebAssembly.Module>: compiled once for all rooms of a page

async function compile(url) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`luxel: ${url}: ${response.status} ${response.statusText}`);
  return WebAssembly.compile(await response.arrayBuffer());
}

function compiled(url) {
  let module = modules.get(url);
  if (!module) {
    module = compile(url); // nobody's to abort: others may wait for it
    modules.set(url, module);
    module.catch(() => modules.delete(url)); // a failure is not for keeps
  }
  return module;
}

/** An open pack. */
export class Runtime {
  #exports;
  #memory;
  #used; // bytes of memory
  #scratch;
  #text = new Map(); // strings of ours in the module's memory
  #pixels = { at: 0, bytes: 0 };
  #keys = new Map(); // layer -> memory for its program's keys, and for those of the next program
  #reader = new TextDecoder();

  /** The bytes of luxel_rt.wasm or a compiled module. */
  static async instantiate(module) {
    const runtime = new Runtime();
    const instance = await WebAssembly.instantiate(module instanceof WebAssembly.Module ? module : await WebAssembly.compile(module), {});
    runtime.#exports = instance.exports;
    runtime.#memory = instance.exports.memory;
    runtime.#used = runtime.#memory.buffer.byteLength; // static data and stack end before
    runtime.#scratch = runtime.allocate(SCRATCH_BYTES);
    return runtime;
  }

  static async load(wasmUrl, signal) {
    const module = await compiled(String(wasmUrl));
    signal?.throwIfAborted();
    return Runtime.instantiate(module);
  }

  /** `bytes` of memory for as long as the runtime lives, aligned to 64. */
  allocate(bytes) {
    const at = Math.ceil(this.#used / 64) * 64;
    const short = at + bytes - this.#memory.buffer.byteLength;
    if (short > 0) {
      try {
        this.#memory.grow(Math.ceil(short / 65536));
      } catch {
        throw new Error(`luxel: no memory for ${Math.ceil(bytes / 1048576)} MiB`);
      }
    }
    this.#used = at + bytes;
    return at;
  }

  /** A view of memory. Growing detaches views: do not keep them. */
  bytes(at, length) {
    return new Uint8Array(this.#memory.buffer, at, length);
  }
  words(at, length) {
    return new Uint32Array(this.#memory.buffer, at, length);
  }
  floats(at, length) {
    return new Float32Array(this.#memory.buffer, at, length);
  }
  get memoryBytes() {
    return this.#memory.buffer.byteLength;
  }

  /** Reads a response's body into memory; a wrong or missing length costs a copy. */
  async receive(response, onBytes) {
    let room = Number(response.headers.get('content-length')) || 0;
    if (response.headers.get('content-encoding')) room = 0; // then it counts compressed bytes
    if (!response.body || !room) {
      const all = new Uint8Array(await response.arrayBuffer());
      const at = this.allocate(all.length);
      this.bytes(at, all.length).set(all);
      onBytes?.(all.length);
      return { at, size: all.length };
    }
    const at = this.allocate(room);
    const reader = response.body.getReader();
    const rest = []; // other sites hide their content-encoding: what they said is the compressed size then
    let stored = 0;
    let size = 0;
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      if (rest.length > 0 || size + value.length > room) {
        rest.push(value);
      } else {
        this.bytes(at + size, value.length).set(value);
        stored += value.length;
      }
      size += value.length;
      onBytes?.(size);
    }
    if (rest.length === 0) return { at, size };
    if (this.#used === at + room) this.#used = at; // nothing came behind: the place grows
    const whole = this.allocate(size);
    this.bytes(0, this.memoryBytes).copyWithin(whole, at, at + stored);
    for (const part of rest) {
      this.bytes(whole + stored, part.length).set(part);
      stored += part.length;
    }
    return { at: whole, size };
  }

  open({ at, size }) {
    this.#check(this.#exports.lxrt_memory_bytes(at, size, this.#scratch), 'luxel.pack');
    const bytes = this.words(this.#scratch, 1)[0];
    const memory = this.allocate(bytes);
    this.#check(this.#exports.lxrt_open(at, size, memory, bytes, this.#scratch), 'luxel.pack');
    this.pack = this.words(this.#scratch, 1)[0];
    this.#exports.lxrt_get_info(this.pack, this.#scratch);
    this.info = this.#read('info', this.#scratch);
  }

  #check(result, what) {
    if (result !== 0) throw new Error(`luxel: ${what}: ${this.#string(this.#exports.lxrt_result_name(result) >>> 0)}`);
  }

  #string(at) {
    const memory = new Uint8Array(this.#memory.buffer);
    return this.#reader.decode(memory.subarray(at, memory.indexOf(0, at)));
  }

  // A 0-terminated copy of a string, kept: there are few different ones.
  #cString(string) {
    let at = this.#text.get(string);
    if (at === undefined) {
      const bytes = new TextEncoder().encode(string);
      at = this.allocate(bytes.length + 1);
      const memory = this.bytes(at, bytes.length + 1);
      memory.set(bytes);
      memory[bytes.length] = 0;
      this.#text.set(string, at);
    }
    return at;
  }

  #read(layout, at) {
    const view = new DataView(this.#memory.buffer);
    const values = {};
    for (const [field, type, count] of LAYOUTS[layout]) {
      const next = () => {
        const here = at;
        at += type === 'u64' ? 8 : 4;
        if (type === 'f32') return view.getFloat32(here, true);
        if (type === 'i32') return view.getInt32(here, true);
        if (type === 'u64') return Number(view.getBigUint64(here, true));
        const word = view.getUint32(here, true);
        return type === 'text' ? this.#string(word) : word;
      };
      values[field] = count ? Array.from({ length: count }, next) : next();
    }
    return values;
  }

  #write(layout, at, values) {
    const view = new DataView(this.#memory.buffer);
    for (const [field, type, count] of LAYOUTS[layout]) {
      for (let i = 0; i < (count ?? 1); i++, at += 4) {
        const value = count ? values[field][i] : values[field];
        if (type === 'f32') view.setFloat32(at, value, true);
        else view.setUint32(at, value >>> 0, true);
      }
    }
  }

  #get(layout, call, index) {
    this.#check(call(this.pack, index, this.#scratch), `${layout} ${index}`);
    return this.#read(layout, this.#scratch);
  }

  pageCoverage(page) {
    return this.#exports.lxrt_page_coverage(this.pack, page);
  }
  layer(index) {
    return this.#get('layer', this.#exports.lxrt_get_layer_info, index);
  }
  rect(index) {
    return this.#get('rect', this.#exports.lxrt_get_rect, index);
  }
  source(index) {
    return this.#get('source', this.#exports.lxrt_get_source, index);
  }
  animation(index) {
    return this.#get('animation', this.#exports.lxrt_get_animation, index);
  }
  monitor(index) {
    return this.#get('monitor', this.#exports.lxrt_get_monitor, index);
  }
  budget() {
    this.#exports.lxrt_get_budget(this.pack, this.#scratch);
    return this.#read('budget', this.#scratch);
  }

  /** c of a layer into rgb. */
  color(layer, rgb) {
    this.#check(this.#exports.lxrt_get_layer(this.pack, layer, this.#scratch), `layer ${layer}`);
    const values = this.floats(this.#scratch, 3);
    for (let i = 0; i < 3; i++) rgb[i] = values[i];
    return rgb;
  }

  /** Sets c = rgb × intensity. */
  setColor(layer, r, g, b, intensity = 1) {
    const rgb = this.floats(this.#scratch, 3);
    rgb[0] = r;
    rgb[1] = g;
    rgb[2] = b;
    this.#check(this.#exports.lxrt_set_layer(this.pack, layer, this.#scratch, intensity), `layer ${layer}: colour`);
  }

  compose(page, level, x, y, width, height, format, texels, scale = 1, rowBytes = 0) {
    this.#check(this.#exports.lxrt_compose(this.pack, this.#region({ page, level, x, y, width, height }),
                                           this.#target({ texels, rowBytes, format, scale })), `page ${page}`);
  }

  // Both lie in scratch memory, side by side.
  #region(region) {
    this.#write('region', this.#scratch, region);
    return this.#scratch;
  }
  #target(target) {
    this.#write('target', this.#scratch + SCRATCH_BYTES / 2, target);
    return this.#scratch + SCRATCH_BYTES / 2;
  }

  /** Irradiance of a page's level: RGB floats. */
  readPage(page, level) {
    const size = this.info.pageSize >> level;
    const at = this.#borrowed(size * size * FORMAT_BYTES[FORMAT.rgb32f]);
    this.compose(page, level, 0, 0, size, size, FORMAT.rgb32f, at);
    return this.floats(at, 3 * size * size).slice();
  }

  sample(page, u, v, filter, rgb) {
    this.#check(this.#exports.lxrt_lightmap_sample(this.pack, page, u, v, filter, this.#scratch), `page ${page}`);
    const values = this.floats(this.#scratch, 3);
    for (let i = 0; i < 3; i++) rgb[i] = values[i];
    return rgb;
  }

  // Memory that the next call may overwrite.
  #borrowed(bytes) {
    if (bytes > this.#pixels.bytes) this.#pixels = { at: this.allocate(bytes), bytes };
    return this.#pixels.at;
  }

  createAccumulator(page) {
    const bytes = this.#exports.lxrt_accumulator_bytes(this.pack) >>> 0;
    const memory = this.allocate(bytes);
    this.#check(this.#exports.lxrt_accumulator_create(this.pack, page, memory, bytes, this.#scratch), `page ${page}`);
    return this.words(this.#scratch, 1)[0];
  }
  accumulatorBegin(accumulator) {
    return this.#exports.lxrt_accumulator_begin(accumulator) >>> 0;
  }
  accumulatorReset(accumulator) {
    this.#exports.lxrt_accumulator_reset(accumulator);
  }
  accumulatorBounds(accumulator, level) {
    this.#check(this.#exports.lxrt_accumulator_bounds(accumulator, level, this.#scratch), `level ${level}`);
    return this.#read('region', this.#scratch);
  }
  accumulatorUpdate(accumulator, region, texels, rowBytes, format, scale) {
    this.#check(this.#exports.lxrt_accumulator_update(accumulator, this.#region(region),
                                                      this.#target({ texels, rowBytes, format, scale })), `page ${region.page}`);
  }

  /** Runs every layer's driver. Returns how many layers changed. */
  update(time) {
    return this.#exports.lxrt_update(this.pack, time) >>> 0;
  }

  play(name, playing) {
    const result = this.#exports.lxrt_play(this.pack, name === undefined ? 0 : this.#cString(name), playing ? 1 : 0);
    this.#check(result, name === undefined ? 'animations' : `animation "${name}"`);
  }

  /** A program as index.d.ts says; its colour already three linear numbers. Null: nothing drives the layer. */
  setProgram(layer, program) {
    if (program === null) {
      this.#check(this.#exports.lxrt_set_program(this.pack, layer, 0), `layer ${layer}`);
      return;
    }
    const kind = PROGRAM_KINDS.indexOf(program.kind);
    if (kind < 0) throw new Error(`luxel: "${program.kind}" is no program`);
    const interpolation = INTERPOLATIONS.indexOf(program.interpolation ?? 'linear');
    if (interpolation < 0) throw new Error(`luxel: "${program.interpolation}" is no interpolation`);
    this.#exports.lxrt_program_default(this.#scratch); // returned by value: the caller says where
    const values = this.#read('program', this.#scratch);
    for (const field of ['color', 'intensity', 'period', 'phase', 'duty', 'low', 'high', 'fade', 'seed'])
      if (program[field] !== undefined) values[field] = program[field];
    Object.assign(values, { kind, interpolation });
    if (program.loop !== undefined) values.loop = program.loop ? 1 : 0;
    const keys = program.keys ?? [];
    const keyFloats = interpolation === 2 && kind === 1 ? 10 : 4;
    if (keys.length % keyFloats !== 0) throw new Error(`luxel: ${keys.length} numbers are no keys of ${keyFloats}`);
    if (keys.length > 0) {
      // The runtime borrows keys: those of a layer's program stay while the next one's, which it may refuse, lie beside them.
      let [used, spare] = this.#keys.get(layer) ?? [];
      if (!spare || spare.bytes < 4 * keys.length) spare = { at: this.allocate(4 * keys.length), bytes: 4 * keys.length };
      this.#keys.set(layer, [used, spare]);
      this.floats(spare.at, keys.length).set(keys);
      values.keys = spare.at;
      values.keyCount = keys.length / keyFloats;
    }
    this.#write('program', this.#scratch, values);
    this.#check(this.#exports.lxrt_set_program(this.pack, layer, this.#scratch), `program of layer ${layer}`);
    if (keys.length > 0) this.#keys.get(layer).reverse();
  }

  resetDriver(layer) {
    this.#check(this.#exports.lxrt_reset_driver(this.pack, layer), `layer ${layer}`);
  }

  monitorUpdate(monitor, pixels, width, height, format = PIXELS.rgba8) {
    const at = this.#borrowed(pixels.byteLength);
    this.bytes(at, pixels.byteLength).set(new Uint8Array(pixels.buffer, pixels.byteOffset, pixels.byteLength));
    this.#check(this.#exports.lxrt_monitor_update(this.pack, monitor, at, width, height, 0, format), `monitor ${monitor}`);
  }

  monitorConfigure(monitor, strength, smoothing) {
    this.floats(this.#scratch, 3).set(strength);
    this.#check(this.#exports.lxrt_monitor_configure(this.pack, monitor, this.#scratch, smoothing), `monitor ${monitor}`);
  }
}
