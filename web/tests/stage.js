// Helpers inside of the page; tests call them through `stage`.
import * as THREE from 'three';
import { loadLuxel } from 'luxel-three';

const canvas = document.getElementById('canvas');
const renderer = new THREE.WebGLRenderer({ canvas, antialias: false, preserveDrawingBuffer: true });
renderer.setPixelRatio(1);
renderer.setSize(canvas.width, canvas.height, false);

const stage = {
  THREE,
  renderer,
  loadLuxel,
  room: null,
  camera: null,

  async load(url, options = {}) {
    stage.room = await loadLuxel(renderer, new URL(url, location.href), { wasmUrl: '/luxel_rt.wasm', ...options });
    stage.camera = stage.room.cameras[0] ?? new THREE.PerspectiveCamera(50, 1, 0.05, 100);
    stage.camera.aspect = canvas.width / canvas.height;
    stage.camera.updateProjectionMatrix();
    renderer.toneMapping = THREE.NeutralToneMapping;
    renderer.toneMappingExposure = 2 ** stage.room.ev;
    return stage.room;
  },

  look(eye, target, fov = 50) {
    stage.camera = new THREE.PerspectiveCamera(fov, canvas.width / canvas.height, 0.05, 100);
    stage.camera.position.set(...eye);
    stage.camera.lookAt(...target);
    stage.camera.updateMatrixWorld();
  },

  /** Updates, draws, and returns RGBA bytes with row 0 at the top. */
  draw(time = 0) {
    stage.room.update(time);
    renderer.render(stage.room.scene, stage.camera);
    const gl = renderer.getContext();
    const { width, height } = canvas;
    const upsideDown = new Uint8Array(4 * width * height);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, upsideDown);
    const pixels = new Uint8Array(upsideDown.length);
    for (let y = 0; y < height; y++) pixels.set(upsideDown.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
    return pixels;
  },

  /** Mean of a rectangle of the picture, in fractions of it. */
  mean(pixels, [x0, y0, x1, y1] = [0, 0, 1, 1]) {
    const { width, height } = canvas;
    const sum = [0, 0, 0];
    let count = 0;
    for (let y = Math.floor(y0 * height); y < y1 * height; y++)
      for (let x = Math.floor(x0 * width); x < x1 * width; x++, count++) for (let i = 0; i < 3; i++) sum[i] += pixels[4 * (y * width + x) + i];
    return sum.map((value) => value / count);
  },
};

/** Runs `vec4 value(vec2 pixel)` for every pixel of a float target; returns RGBA floats, row 0 first. */
stage.evaluate = (glsl, uniforms, width, height) => {
  const material = new THREE.ShaderMaterial({
    glslVersion: THREE.GLSL3,
    uniforms: Object.fromEntries(Object.entries(uniforms).map(([name, value]) => [name, { value }])),
    vertexShader: 'void main() { gl_Position = vec4(position.xy, 0.0, 1.0); }',
    fragmentShader: `precision highp sampler2DArray;\nout vec4 outValue;\n${glsl}\nvoid main() { outValue = value(gl_FragCoord.xy); }`,
    depthTest: false,
  });
  const triangle = new THREE.BufferGeometry();
  triangle.setAttribute('position', new THREE.Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
  const target = new THREE.WebGLRenderTarget(width, height, { type: THREE.FloatType, depthBuffer: false });
  const mesh = new THREE.Mesh(triangle, material);
  mesh.frustumCulled = false;
  renderer.setRenderTarget(target);
  renderer.render(mesh, new THREE.Camera());
  const values = new Float32Array(4 * width * height);
  renderer.readRenderTargetPixels(target, 0, 0, width, height, values);
  renderer.setRenderTarget(null);
  target.dispose();
  material.dispose();
  triangle.dispose();
  return values;
};

globalThis.stage = stage;
document.body.dataset.ready = 'yes';
