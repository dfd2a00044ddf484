// A baked scene in three.js: what it is made of, and what happens once a frame.
import { AnimationMixer, Color, InstancedBufferAttribute, InstancedBufferGeometry, BufferGeometry, Scene } from 'three';
import { ComposedPages, LayeredPages, measureCompose } from './lightmap.js';
import { createUniforms, Materials, VIEWS } from './materials.js';
import { autoMethod } from './method.js';
import { Monitor, Screen } from './monitors.js';
import { KINDS, NONE } from './runtime.js';

const PROGRAM_KINDS = ['constant', 'keys', 'blink', 'flicker', 'pulse', 'wheel', 'schedule'];
const UNITS = { point: 'cd', spot: 'cd', directional: 'lx' };

function chooseMethod({ method = 'auto', gpuMemoryLimit }, runtime, renderer) {
  const { layerCount, pageCount, pageSize } = runtime.info;
  const gl = renderer.getContext();
  const slicesLimit = gl.getParameter(gl.MAX_ARRAY_TEXTURE_LAYERS);
  const methodReason = { composeMs: measureCompose(runtime), layers: layerCount, gpuLayersBytes: runtime.budget().gpuLayers };
  const sizeLimit = gl.getParameter(gl.MAX_TEXTURE_SIZE);
  if (!['auto', 'cpu', 'gpu'].includes(method)) throw new Error(`luxel: "${method}" is no method`);
  if (pageSize > sizeLimit)
    throw new Error(`luxel: pages of ${pageSize} x ${pageSize} texels are more than the ${sizeLimit} x ${sizeLimit} this GPU takes: bake with a smaller --page-size`);
  if (pageCount > slicesLimit)
    throw new Error(`luxel: ${pageCount} pages are more than the ${slicesLimit} this GPU takes: bake with a larger --page-size or fewer --max-pages`);
  if (method === 'gpu' && layerCount * pageCount > slicesLimit)
    throw new Error(`luxel: method gpu: ${layerCount} layers of ${pageCount} pages are more than the ${slicesLimit} slices this GPU takes`);
  if (method === 'auto') method = autoMethod({ ...methodReason, slices: layerCount * pageCount, slicesLimit, gpuMemoryLimit });
  return { method, methodReason };
}

// A geometry with the same buffers.
function shareGeometry(source, target) {
  target.name = source.name;
  target.index = source.index;
  for (const name in source.attributes)
    if (!name.startsWith('_LUXEL_')) target.setAttribute(name, source.attributes[name]);
  for (const name in source.morphAttributes) target.morphAttributes[name] = source.morphAttributes[name];
  target.morphTargetsRelative = source.morphTargetsRelative;
  for (const group of source.groups) target.addGroup(group.start, group.count, group.materialIndex);
  target.setDrawRange(source.drawRange.start, source.drawRange.count);
  target.boundingBox = source.boundingBox?.clone() ?? null;
  target.boundingSphere = source.boundingSphere?.clone() ?? null;
  target.userData = source.userData;
  return target;
}

// Where a mesh keeps its light, as attributes: one rectangle per instance, of InstancedMesh and of plain meshes alike, so that one
// shader serves both. three.js may share a geometry between nodes, so every mesh gets one of its own; buffers stay shared.
function litGeometry(mesh, rects) {
  const geometry = shareGeometry(mesh.geometry, mesh.isInstancedMesh ? new BufferGeometry() : new InstancedBufferGeometry());
  if (!mesh.isInstancedMesh) geometry.instanceCount = 1;
  const count = mesh.isInstancedMesh ? mesh.count : 1;
  const places = new Float32Array(4 * count);
  const pages = new Float32Array(count);
  for (const { gpuInstance, page, scale, offset } of rects) {
    const i = Math.max(gpuInstance, 0);
    if (i >= count) continue;
    places.set([...scale, ...offset], 4 * i);
    pages[i] = page;
  }
  geometry.setAttribute('luxelRect', new InstancedBufferAttribute(places, 4));
  geometry.setAttribute('luxelPage', new InstancedBufferAttribute(pages, 1));
  geometry.setAttribute('luxelUv', lightmapCoordinates(mesh.geometry, rects));
  return geometry;
}

function lightmapCoordinates(geometry, rects) {
  const set = rects[0].texcoord;
  return geometry.getAttribute(set === 0 ? 'uv' : `uv${set}`) ?? geometry.getAttribute(`texcoord_${set}`);
}

class LayerLight {
  constructor(index, { name, kind, mixed, color, intensity, scale }) {
    this.name = name;
    this.index = index;
    this.kind = KINDS[kind];
    this.unit = UNITS[this.kind] ?? 'nt';
    this.mixed = mixed === 1;
    this.authored = { color: new Color(...color), intensity };
    this.color = this.authored.color.clone();
    this.intensity = intensity;
    this.muted = false;
    this.solo = false;
    this.monitor = null;
    this.scale = scale;
  }
}

export class Room {
  #renderer;
  #runtime;
  #materials;
  #lightmap;
  #uniforms = createUniforms();
  #sky;
  #gltf;
  #mixer = null;
  #actions = new Map(); // name -> actions of moving nodes
  #stopped = new Map(); // action -> time of its clip where it was stopped
  #emitters = []; // { material, layer, weight }
  #realtime = []; // { light, layer, weight }: mixed lights
  #skySource = null;
  #bindings = new Map(); // layer -> three light
  #logical; // c of each layer, whether it is muted or not
  #inPack; // c that the runtime has now
  #fields; // color and intensity of each LayerLight as we last knew them
  #screens = new Map(); // first layer of monitors -> { mode: 'authored', 'cells' or 'picture', monitor that was touched last }
  #ownCells = new Set(); // layers of monitors that do not shine as authored
  #started = performance.now();
  #owned = { geometries: new Set(), materials: new Set(), textures: new Set(), objects: new Set() };
  #dirty = true; // c changed since emitters, sky and lights were last set
  #disposed = false;

  constructor(renderer, runtime, gltf, sky, manifest, options) {
    this.#renderer = renderer;
    this.#runtime = runtime;
    this.#gltf = gltf;
    this.#sky = sky;
    this.manifest = manifest;
    this.ev = manifest.view?.ev ?? 0;
    this.cameras = gltf.cameras;
    this.budget = runtime.budget();
    this.pageCount = runtime.info.pageCount;
    this.pageSize = runtime.info.pageSize;
    Object.assign(this, chooseMethod(options, runtime, renderer));

    this.lights = Array.from({ length: runtime.info.layerCount }, (_, i) => new LayerLight(i, runtime.layer(i)));
    this.lights.forEach((light, i) => (light.unit = manifest.layers?.[i]?.unit ?? light.unit));
    this.#logical = new Float32Array(3 * this.lights.length);
    this.#inPack = new Float32Array(3 * this.lights.length);
    this.#fields = new Float64Array(4 * this.lights.length);
    this.lights.forEach((light) => this.#adopt(light, runtime.color(light.index, [0, 0, 0]), false));

    this.scene = new Scene();
    this.scene.name = gltf.scene.name;
    this.scene.add(gltf.scene);
    this.#own();
    this.#materials = new Materials(this.#uniforms, this.method, options.filter ?? 'bilinear');
    const meshes = this.#light();
    this.#findSources(meshes);
    this.monitors = this.#findMonitors(meshes);
    this.animations = this.#findAnimations();
    sky?.addTo(this.scene);

    this.#lightmap = this.method === 'cpu' ? new ComposedPages(renderer, runtime, this.#uniforms) : new LayeredPages(renderer, runtime, this.#uniforms);
    renderer.domElement.addEventListener('webglcontextrestored', this.#restore);
    this.update(0);
  }

  #restore = () => this.#lightmap.restore();

  // What the loader made, so that dispose() can undo it whatever is put into the scene later.
  #own() {
    const { geometries, materials, textures, objects } = this.#owned;
    this.#gltf.scene.traverse((object) => {
      if (object.isInstancedMesh || object.isLight) objects.add(object);
      if (object.isSkinnedMesh) objects.add(object.skeleton); // its bones are a texture
      if (object.geometry) geometries.add(object.geometry);
      for (const material of [object.material ?? []].flat()) materials.add(material);
    });
    for (const material of materials)
      for (const value of Object.values(material)) if (value?.isTexture) textures.add(value);
  }

  #nodeOf(object) {
    const { associations } = this.#gltf.parser;
    for (let at = object; at; at = at.parent) {
      const node = associations.get(at)?.nodes;
      if (node !== undefined) return node;
    }
    return -1;
  }

  // Gives every mesh its material. Returns the meshes with their node and material numbers.
  #light() {
    const rects = new Map();
    for (let i = 0; i < this.#runtime.info.rectCount; i++) {
      const rect = this.#runtime.rect(i);
      if (!rects.has(rect.node)) rects.set(rect.node, []);
      rects.get(rect.node).push(rect);
    }
    const meshes = [];
    this.#gltf.scene.traverse((object) => {
      if (object.isLight) this.#hideBaked(object);
      if (!object.isMesh || Array.isArray(object.material)) return;
      const node = this.#nodeOf(object);
      const original = object.material;
      const material = this.#gltf.parser.associations.get(original)?.materials ?? -1;
      const own = rects.get(node);
      if (own && lightmapCoordinates(object.geometry, own) && !object.isSkinnedMesh && original.isMeshStandardMaterial) {
        object.geometry = litGeometry(object, own);
        this.#owned.geometries.add(object.geometry);
        object.material = this.#materials.lit(original);
      } else {
        object.material = this.#materials.plain(original);
      }
      meshes.push({ mesh: object, node, material });
    });
    return meshes;
  }

  // Lights that are in the lightmap do not shine again. What hangs below one stays to be seen.
  #hideBaked(light) {
    const isNode = this.#gltf.parser.associations.get(light)?.nodes !== undefined;
    const baked = light.userData.luxel_baked === true || (!isNode && light.parent?.userData.luxel_baked === true);
    if (!baked) return;
    light.layers.disableAll();
    let bearing = false;
    light.traverse((below) => (bearing ||= below.isMesh || below.isLine || below.isPoints || (below.isLight && below !== light)));
    if (!bearing) light.visible = false;
  }

  #findSources(meshes) {
    const monitorLayers = new Set();
    for (let i = 0; i < this.#runtime.info.monitorCount; i++) {
      const { firstLayer, columns, rows } = this.#runtime.monitor(i);
      for (let k = 0; k < columns * rows; k++) monitorLayers.add(firstLayer + k);
    }
    const lightsOfNodes = new Map();
    this.#gltf.scene.traverse((object) => object.isLight && lightsOfNodes.set(this.#nodeOf(object), object));
    const variants = new Map(); // material that shines alike
    for (let i = 0; i < this.#runtime.info.sourceCount; i++) {
      const { layer, kind, weight, node, material } = this.#runtime.source(i);
      if (monitorLayers.has(layer)) continue;
      if (KINDS[kind] === 'sky') {
        this.#skySource = { layer, weight };
      } else if (material >= 0) {
        for (const { mesh } of meshes.filter((entry) => entry.node === node && entry.material === material)) {
          if (!mesh.material.emissive) continue;
          const key = `${mesh.material.uuid} ${layer} ${weight}`;
          if (!variants.has(key)) {
            const variant = this.#materials.variant(mesh.material);
            variant.emissiveIntensity = 1;
            variants.set(key, variant);
            this.#emitters.push({ material: variant, layer, weight });
          }
          mesh.material = variants.get(key);
        }
      } else if (node !== NONE && this.lights[layer].mixed && lightsOfNodes.has(node)) {
        this.#realtime.push({ light: lightsOfNodes.get(node), layer, weight });
      }
    }
  }

  #findMonitors(meshes) {
    const monitors = [];
    const screens = new Map(); // first layer and material -> Screen, one for all meshes
    for (let i = 0; i < this.#runtime.info.monitorCount; i++) {
      const record = this.#runtime.monitor(i);
      const own = [];
      const shown = meshes.filter(({ node, material }) => node === record.node && (record.material < 0 || material === record.material));
      for (const { mesh } of shown) {
        if (!mesh.material.emissive) continue;
        const key = `${record.firstLayer} ${mesh.material.uuid}`;
        if (!screens.has(key)) {
          screens.set(key, new Screen(this.#materials.variant(mesh.material)));
          own.push(screens.get(key));
        }
        mesh.material = screens.get(key).material;
      }
      const touched = (monitor, mode) => this.#monitorTouched(monitor, mode);
      monitors.push(new Monitor(this.#runtime, i, record, shown.map(({ mesh }) => mesh), own, touched));
    }
    for (const monitor of monitors) {
      monitor.shareWith(monitors.filter((other) => other.firstLayer === monitor.firstLayer));
      for (let k = 0; k < monitor.layerCount; k++) this.lights[monitor.firstLayer + k].monitor ??= monitor;
      if (!this.#screens.has(monitor.firstLayer)) this.#screens.set(monitor.firstLayer, { mode: 'authored', monitor });
    }
    return monitors;
  }

  #cellsOf({ firstLayer, layerCount }) {
    return this.lights.slice(firstLayer, firstLayer + layerCount);
  }

  #monitorTouched(monitor, mode) {
    this.#screens.set(monitor.firstLayer, { mode, monitor });
    for (const light of this.#cellsOf(monitor)) {
      if (mode === 'authored') {
        this.#ownCells.delete(light.index);
        this.#setAuthored(light);
      } else {
        this.#ownCells.add(light.index);
        this.#adopt(light, this.#runtime.color(light.index, [0, 0, 0]), true);
      }
    }
  }

  // Something of a layer's own gives it its colour: a screen that has such cells shows them.
  #ownColor(light) {
    if (!light.monitor) return;
    this.#ownCells.add(light.index);
    const screen = this.#screens.get(light.monitor.firstLayer);
    if (screen.mode === 'authored') screen.mode = 'cells';
    this.#dirty = true;
  }

  #findAnimations() {
    const { animationCount } = this.#runtime.info;
    const list = Array.from({ length: animationCount }, (_, i) => {
      const { name, layer, kind, duration } = this.#runtime.animation(i);
      const runtime = this.#runtime;
      return {
        name, layer, kind: PROGRAM_KINDS[kind], duration,
        get playing() {
          return runtime.animation(i).playing === 1;
        },
      };
    });
    for (const clip of this.#gltf.animations) {
      if (clip.tracks.length === 0) continue; // colours alone: these are in the pack
      this.#mixer ??= new AnimationMixer(this.#gltf.scene);
      const action = this.#mixer.clipAction(clip);
      action.play();
      if (!this.#actions.has(clip.name)) this.#actions.set(clip.name, []);
      this.#actions.get(clip.name).push(action);
      list.push({
        name: clip.name, layer: -1, kind: 'nodes', duration: clip.duration,
        get playing() {
          return !action.paused;
        },
      });
    }
    return list;
  }

  // ---- colours

  #index(layer) {
    const light = typeof layer === 'number' ? this.lights[layer] : this.lights.find(({ name }) => name === layer);
    if (!light) throw new Error(`luxel: no layer "${layer}"; there are ${this.lights.map(({ name }) => name).join(', ')}`);
    return light.index;
  }

  // c of a layer came from the runtime: it is what the light's fields say from now on. The brightest channel of the colour stays what
  // the author made it, so that what flickers is the intensity.
  #adopt(light, rgb, split) {
    const { index } = light;
    this.#logical.set(rgb, 3 * index);
    this.#inPack.set(rgb, 3 * index);
    if (split) {
      const { color } = light.authored;
      const most = Math.max(color.r, color.g, color.b) || 1;
      const strongest = Math.max(...rgb);
      light.intensity = strongest / most;
      if (strongest > 0) light.color.setRGB(...rgb.map((value) => (value * most) / strongest));
    }
    this.#noteFields(light);
    this.#dirty = true;
  }

  #noteFields({ index, color, intensity }) {
    this.#fields.set([color.r, color.g, color.b, intensity], 4 * index);
  }

  #toPack(index, r, g, b) {
    const at = 3 * index;
    if (this.#inPack[at] === Math.fround(r) && this.#inPack[at + 1] === Math.fround(g) && this.#inPack[at + 2] === Math.fround(b)) return;
    this.#runtime.setColor(index, r, g, b);
    this.#inPack.set([r, g, b], at);
    this.#dirty = true;
  }

  // Fields that somebody set since we last looked.
  #takeFields() {
    for (const light of this.lights) {
      const { index, color, intensity } = light;
      const at = 4 * index;
      const known = this.#fields;
      if (color.r === known[at] && color.g === known[at + 1] && color.b === known[at + 2] && intensity === known[at + 3]) continue;
      this.#takeOver(light);
    }
  }

  // The fields become the layer's colour; what cannot be summed leaves all as it was, the fields too.
  #takeOver(light) {
    const { index, color, intensity } = light;
    const { r, g, b } = color;
    try {
      this.#runtime.setColor(index, r, g, b, intensity);
    } catch (cause) {
      const known = this.#fields.subarray(4 * index, 4 * index + 4);
      color.setRGB(known[0], known[1], known[2]);
      light.intensity = known[3];
      throw new Error(`luxel: layer "${light.name}": a colour of ${r}, ${g}, ${b} at ${intensity} ${light.unit} is not finite or too large`, { cause });
    }
    this.#runtime.setProgram(index, null);
    this.#runtime.color(index, this.#inPack.subarray(3 * index, 3 * index + 3));
    this.#logical.set(this.#inPack.subarray(3 * index, 3 * index + 3), 3 * index);
    this.#noteFields(light);
    this.#dirty = true;
    this.#ownColor(light);
  }

  #setAuthored(light) {
    this.#runtime.resetDriver(light.index);
    light.color.copy(light.authored.color);
    light.intensity = light.authored.intensity;
    const { r, g, b } = light.color;
    const gain = light.monitor ? this.#screens.get(light.monitor.firstLayer).monitor.gain : [1, 1, 1];
    this.#runtime.setColor(light.index, r * gain[0], g * gain[1], b * gain[2], light.intensity);
    this.#adopt(light, this.#runtime.color(light.index, [0, 0, 0]), gain.some((value) => value !== 1));
  }

  #isSilent(light, anySolo) {
    return light.muted || (anySolo && !light.solo);
  }

  #silence() {
    const anySolo = this.lights.some(({ solo }) => solo);
    for (const light of this.lights) {
      const at = 3 * light.index;
      if (this.#isSilent(light, anySolo)) this.#toPack(light.index, 0, 0, 0);
      else this.#toPack(light.index, this.#logical[at], this.#logical[at + 1], this.#logical[at + 2]);
    }
  }

  setLight(layer, color, intensity) {
    const light = this.lights[this.#index(layer)];
    const before = { color: light.color.clone(), intensity: light.intensity };
    light.color.set(color);
    if (intensity !== undefined) light.intensity = intensity;
    try {
      this.#takeOver(light);
    } catch (error) {
      light.color.copy(before.color);
      light.intensity = before.intensity;
      throw error;
    }
    this.#bindings.delete(light.index);
  }

  resetLight(layer) {
    const light = this.lights[this.#index(layer)];
    this.#bindings.delete(light.index);
    this.#setAuthored(light);
    if (!light.monitor) return;
    this.#ownCells.delete(light.index);
    const { mode, monitor } = this.#screens.get(light.monitor.firstLayer);
    if (mode === 'cells' && !this.#cellsOf(monitor).some(({ index }) => this.#ownCells.has(index))) this.#monitorTouched(monitor, 'authored');
  }

  bind(object, layer) {
    const index = this.#index(layer);
    if (!object?.isLight) throw new Error(`luxel: what is bound to layer "${this.lights[index].name}" is no light`);
    this.#runtime.setProgram(index, null);
    this.#bindings.set(index, object);
    this.#ownColor(this.lights[index]);
    return () => {
      if (this.#bindings.get(index) === object) this.#bindings.delete(index);
    };
  }

  setProgram(layer, program) {
    const index = this.#index(layer);
    if (program === null) {
      this.#runtime.setProgram(index, null);
    } else {
      const { r, g, b } = new Color(program.color ?? 0xffffff);
      this.#runtime.setProgram(index, { ...program, color: [r, g, b] });
      this.#ownColor(this.lights[index]);
    }
    this.#bindings.delete(index);
  }

  play(name) {
    this.#playing(name, true);
  }
  stop(name) {
    this.#playing(name, false);
  }

  #playing(name, playing) {
    const chosen = this.animations.filter((animation) => name === undefined || animation.name === name);
    if (chosen.length === 0 && name !== undefined) throw new Error(`luxel: no animation "${name}"`);
    if (chosen.some(({ layer }) => layer >= 0)) this.#runtime.play(name, playing);
    for (const [clip, actions] of this.#actions)
      if (name === undefined || clip === name)
        for (const action of actions) {
          if (playing) this.#stopped.delete(action);
          else if (!action.paused) this.#stopped.set(action, action.time);
          action.paused = !playing;
        }
  }

  // AnimationMixer.setTime(), but that what was stopped stays where it was and not where its clip begins.
  #move(time) {
    this.#mixer.time = 0;
    for (const actions of this.#actions.values()) for (const action of actions) action.time = this.#stopped.get(action) ?? 0;
    this.#mixer.update(time);
  }

  // ---- once a frame

  update(time = (performance.now() - this.#started) / 1000) {
    if (this.#disposed || this.#renderer.getContext().isContextLost()) return false;
    this.#takeFields();
    // Drivers and monitors have to find the colours there would be if nothing were muted.
    for (const { index } of this.lights) {
      const at = 3 * index;
      this.#toPack(index, this.#logical[at], this.#logical[at + 1], this.#logical[at + 2]);
    }
    for (const [index, { color, intensity }] of this.#bindings) {
      const light = this.lights[index];
      light.color.copy(color);
      light.intensity = intensity;
      this.#takeFields();
    }
    for (const monitor of this.monitors)
      if (monitor.update() && this.#screens.get(monitor.firstLayer).mode === 'authored') this.#monitorTouched(monitor, 'authored');
    if (this.#runtime.update(time) > 0) {
      const rgb = [0, 0, 0];
      for (const light of this.lights) {
        const at = 3 * light.index;
        this.#runtime.color(light.index, rgb);
        if (rgb[0] !== this.#logical[at] || rgb[1] !== this.#logical[at + 1] || rgb[2] !== this.#logical[at + 2]) this.#adopt(light, rgb, true);
      }
    }
    this.#silence();
    if (this.#mixer) this.#move(time);

    this.#uniforms.luxelExposure.value = this.#renderer.toneMappingExposure;
    const changed = this.#lightmap.update(this.#brightest());
    if (this.#dirty) this.#shine();
    this.#dirty = false;
    return changed;
  }

  // A bound on E: a layer's brightest texel is stored as 2^14…2^15. Layers that take light away do not lower it: they are dark elsewhere.
  #brightest() {
    let sum = 0;
    for (const { index, scale } of this.lights)
      sum += Math.max(0, this.#inPack[3 * index], this.#inPack[3 * index + 1], this.#inPack[3 * index + 2]) * scale * 32768;
    return sum;
  }

  // What one sees of the sources themselves.
  #shine() {
    const radiance = (layer, weight) => weight.map((value, i) => value * this.#inPack[3 * layer + i]);
    for (const { material, layer, weight } of this.#emitters) material.emissive.setRGB(...radiance(layer, weight));
    for (const { light, layer, weight } of this.#realtime) {
      const rgb = radiance(layer, weight);
      light.intensity = Math.max(...rgb);
      if (light.intensity > 0) light.color.setRGB(...rgb.map((value) => value / light.intensity));
    }
    if (this.#sky && this.#skySource) this.#sky.setColor(this.scene, radiance(this.#skySource.layer, this.#skySource.weight), this.#uniforms);
    const anySolo = this.lights.some(({ solo }) => solo);
    for (const monitor of this.monitors) {
      const screen = this.#screens.get(monitor.firstLayer);
      const pictured = this.monitors.find((other) => other.firstLayer === monitor.firstLayer && other.showsPicture);
      if (this.#cellsOf(monitor).every((light) => this.#isSilent(light, anySolo))) {
        monitor.darken();
      } else if (monitor === (pictured ?? screen.monitor)) {
        monitor.display(screen.mode, (layer, rgb) => {
          for (let i = 0; i < 3; i++) rgb[i] = this.#inPack[3 * layer + i];
        });
      }
    }
  }

  readPage(page, level = 0) {
    this.#takeFields();
    this.#silence();
    return this.#runtime.readPage(page, level);
  }

  readLayer(page, layer, level = 0) {
    const index = this.#index(layer);
    this.#takeFields();
    try {
      for (const light of this.lights) this.#runtime.setColor(light.index, 0, 0, 0);
      this.#runtime.setColor(index, ...this.#logical.subarray(3 * index, 3 * index + 3));
      return this.#runtime.readPage(page, level);
    } finally {
      for (const light of this.lights) this.#runtime.setColor(light.index, ...this.#inPack.subarray(3 * light.index, 3 * light.index + 3));
    }
  }

  setView(view) {
    if (!(view in VIEWS)) throw new Error(`luxel: "${view}" is no view; there are ${Object.keys(VIEWS).join(', ')}`);
    this.#uniforms.luxelView.value = VIEWS[view];
    if (this.#sky) this.#sky.dome.visible = view === 'lit';
  }

  dispose() {
    if (this.#disposed) return;
    this.#disposed = true;
    this.#renderer.domElement.removeEventListener('webglcontextrestored', this.#restore);
    for (const monitor of this.monitors) monitor.dispose();
    this.#mixer?.stopAllAction();
    this.#mixer?.uncacheRoot(this.#gltf.scene);
    this.#gltf.scene.removeFromParent();
    const { geometries, materials, textures, objects } = this.#owned;
    for (const set of [objects, geometries, materials, textures]) for (const thing of set) thing.dispose?.();
    for (const texture of textures) texture.image?.close?.(); // pictures outside the JavaScript heap
    this.#materials.dispose();
    this.#lightmap.dispose();
    if (this.#sky && this.scene.environment === this.#sky.texture) this.scene.environment = null;
    this.#sky?.dispose();
    this.#runtime = null;
  }
}
