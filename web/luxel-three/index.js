// luxel-three: baked light for three.js. What it offers is in index.d.ts.
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { Room } from './room.js';
import { Runtime } from './runtime.js';
import { Sky } from './sky.js';

async function get(url, signal) {
  const response = await fetch(url, { signal });
  if (!response.ok) throw new Error(`luxel: ${url}: ${response.status} ${response.statusText}`);
  return response;
}

// Paths in the manifest stay inside its folder.
function inside(folder, path, what) {
  if (typeof path !== 'string' || path === '' || /(^|\/)\.{0,2}(\/|$)|\\|:/.test(path)) throw new Error(`luxel: luxel.json: bad path of ${what}`);
  return new URL(path.split('/').map(encodeURIComponent).join('/'), folder).href;
}

function extensionsOf(glb) {
  const view = new DataView(glb);
  if (glb.byteLength < 20 || view.getUint32(0, true) !== 0x46546c67) throw new Error('luxel: scene.glb: not a GLB file');
  const json = JSON.parse(new TextDecoder().decode(new Uint8Array(glb, 20, view.getUint32(12, true))));
  return json.extensionsUsed ?? [];
}

async function parseScene(glb, folder, options) {
  const loader = options.gltfLoader ?? new GLTFLoader();
  if (!loader.meshoptDecoder && extensionsOf(glb).some((name) => /_meshopt_compression$/.test(name))) {
    const { MeshoptDecoder } = await import('three/addons/libs/meshopt_decoder.module.js');
    loader.setMeshoptDecoder(MeshoptDecoder);
  }
  // Known, so that three does not warn: these colours move in the pack.
  loader.register(() => ({ name: 'KHR_animation_pointer' }));
  return loader.parseAsync(glb, folder.href);
}

export async function loadLuxel(renderer, url, options = {}) {
  const { signal, onProgress } = options;
  let manifestUrl = new URL(url, globalThis.location?.href);
  if (!manifestUrl.pathname.endsWith('.json')) manifestUrl = new URL('luxel.json', manifestUrl);
  const manifest = await (await get(manifestUrl, signal)).json();
  if (manifest.version !== 1) throw new Error(`luxel: luxel.json: version ${manifest.version} is not 1`);

  const files = { pack: inside(manifestUrl, manifest.pack, 'pack'), scene: inside(manifestUrl, manifest.scene ?? 'scene.glb', 'scene') };
  if (manifest.sky) files.sky = inside(manifestUrl, manifest.sky.file, 'sky');
  const responses = {};
  await Promise.all(Object.entries(files).map(async ([name, file]) => (responses[name] = await get(file, signal))));

  const total = Object.values(responses).reduce((sum, { headers }) => sum + (Number(headers.get('content-length')) || 0), 0);
  const arrived = {};
  const report = (name, bytes) => {
    arrived[name] = bytes;
    const loaded = Object.values(arrived).reduce((sum, value) => sum + value, 0);
    if (total > 0) onProgress?.(Math.min(1, loaded / total), loaded, total);
  };
  const whole = async (name) => {
    const bytes = await responses[name].arrayBuffer();
    report(name, bytes.byteLength);
    return bytes;
  };
  const loadPack = async () => {
    const runtime = await Runtime.load(options.wasmUrl ?? new URL('./luxel_rt.wasm', import.meta.url), signal);
    runtime.open(await runtime.receive(responses.pack, (bytes) => report('pack', bytes)));
    return runtime;
  };
  const loadScene = async () => parseScene(await whole('scene'), manifestUrl, options);
  const loadSky = async () => (manifest.sky ? Sky.load(manifest.sky.file, await whole('sky'), manifest.sky.rotation ?? 0) : null);
  const [runtime, gltf, sky] = await Promise.all([loadPack(), loadScene(), loadSky()]);
  signal?.throwIfAborted();
  onProgress?.(1, total, total);
  return new Room(renderer, runtime, gltf, sky, manifest, options);
}
