// Compiled, never run: that index.d.ts says what people need.
import { Color, PerspectiveCamera, PointLight, WebGLRenderer } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { loadLuxel, type LayerLight, type LoadOptions, type Monitor, type Program, type Room } from 'luxel-three';

const options: LoadOptions = {
  method: 'auto', filter: 'bicubic', gpuMemoryLimit: 2 ** 28, wasmUrl: new URL('/luxel_rt.wasm', location.href), gltfLoader: new GLTFLoader(),
  onProgress: (fraction, loaded, total) => console.log(fraction.toFixed(2), loaded, total),
  signal: AbortSignal.timeout(10000),
};
const blink: Program = { kind: 'blink', color: 'red', intensity: 40, period: 2, duty: 0.25 };

export async function start(renderer: WebGLRenderer, video: HTMLVideoElement): Promise<void> {
  const room: Room = await loadLuxel(renderer, 'room.baked/', options);
  const camera = room.cameras[0] ?? new PerspectiveCamera();
  room.setLight('neon', '#ff2040', 80);
  room.setLight(0, new Color(1, 0.5, 0));
  const lamp: LayerLight | undefined = room.lights.find(({ kind, unit, monitor }) => kind === 'spot' && unit === 'cd' && !monitor);
  if (lamp) {
    lamp.solo = true;
    lamp.intensity *= 2;
    room.resetLight(lamp.index);
  }
  const unbind: () => void = room.bind(new PointLight(), 'lamp');
  unbind();
  room.setProgram('sign', blink);
  room.setProgram('sign', null);
  const screen: Monitor | undefined = room.monitors[0];
  screen?.setVideo(video);
  screen?.strength.setScalar(30);
  room.play();
  room.stop('fly');
  const page: Float32Array = room.readPage(0);
  console.log(page.length, room.method, room.methodReason.composeMs, room.budget.gpuLayers);
  renderer.toneMappingExposure = 2 ** room.ev;
  room.setView('lightmap');
  renderer.setAnimationLoop(() => {
    const changed: boolean = room.update();
    if (changed) renderer.render(room.scene, camera);
  });
  // @ts-expect-error: there is no such view
  room.setView('wireframe');
  // @ts-expect-error: layers are set by setLight
  room.lights = [];
  room.dispose();
}
