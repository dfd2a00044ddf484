// The picture: renderer, camera, exposure, frames. Frames are drawn when something changed, never for their own sake.
import {
  Box3, HalfFloatType, LinearToneMapping, MathUtils, Matrix4, NeutralToneMapping, PerspectiveCamera, Raycaster,
  SRGBColorSpace, Sphere, Vector2, Vector3, WebGLRenderTarget, WebGLRenderer,
} from "three";
import { Controls } from "./controls.js";

const phonePixelRatio = 2, deskPixelRatio = 2;

export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.renderer.outputColorSpace = SRGBColorSpace;
    this.camera = new PerspectiveCamera(50, 1, 0.05, 200);
    this.camera.matrixWorldAutoUpdate = true;
    this.room = null;
    this.radius = 1;
    this.view = "lit";
    this.ev = 0;
    this.toneMapped = true;
    this.continuous = false;
    this.animated = () => false;
    this.onframe = () => {};
    this.yfov = 50; // of the camera chosen; on narrow screens the picture shows more than that
    this.frameAspect = 1; // what the camera chosen was framed for
    this.timing = { update: 0, render: 0, interval: 0 };
    this.frame = 0;
    this.last = 0;
    this.controls = new Controls(this);
    this.size = { width: 1, height: 1 };
    new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
  }

  setRoom(room) {
    this.room = room;
    room.scene.updateMatrixWorld(true);
    const sphere = boundsOf(room.scene).getBoundingSphere(new Sphere());
    this.centre = sphere.center;
    this.radius = Math.max(sphere.radius, 1e-3);
    this.ev = room.ev;
    this.resize();
    this.setCamera(0);
  }

  /** A camera of the file by number or name, or the world matrix of one: 16 numbers, column by column. False if there is none. */
  setCamera(which, yfov) {
    if (typeof which === "object") {
      this.yfov = yfov ?? this.yfov;
      this.frameAspect = 1;
      this.#place(new Matrix4().fromArray(which.elements ?? which));
      return true;
    }
    const cameras = this.room.cameras.filter((camera) => camera.isPerspectiveCamera);
    const camera = typeof which === "number" ? cameras[which] : cameras.find((each) => cameraName(each) === which);
    if (!camera) {
      if (which !== 0) return false;
      this.yfov = 40;
      this.frameAspect = 1;
      this.#place(this.#framing());
      return true;
    }
    camera.updateWorldMatrix(true, false);
    this.yfov = camera.fov;
    this.frameAspect = camera.aspect; // the file's aspectRatio; 1 where it has none
    this.#place(camera.matrixWorld);
    return true;
  }

  #place(matrix) {
    this.#project(this.canvas.clientWidth / Math.max(1, this.canvas.clientHeight));
    this.controls.place(matrix);
    this.invalidate();
  }

  // From outside, looking down a little, the whole room in the picture; of eight sides the one that shows most fronts.
  #framing() {
    const aspect = this.size.width / this.size.height;
    const half = MathUtils.degToRad(40) / 2;
    const distance = this.radius / Math.sin(aspect < 1 ? Math.atan(Math.tan(half) * aspect) : half);
    const target = new WebGLRenderTarget(64, 64);
    const camera = new PerspectiveCamera(40, 1, distance * 0.01, distance * 4);
    const pixels = new Uint8Array(64 * 64 * 4);
    const { background } = this.room.scene;
    const dome = this.room.scene.getObjectByName("luxel sky"); // is behind all of them
    const clear = this.renderer.getClearAlpha();
    let best = null, most = -1;
    this.room.scene.background = null;
    if (dome) dome.visible = false;
    this.renderer.setClearAlpha(0);
    this.renderer.setRenderTarget(target);
    for (let k = 0; k < 8; k++) {
      const yaw = 0.5 + (2 * Math.PI * k) / 8;
      const back = new Vector3(Math.sin(yaw), 0.4, Math.cos(yaw)).normalize();
      camera.position.copy(this.centre).addScaledVector(back, distance);
      camera.lookAt(this.centre);
      camera.updateMatrixWorld();
      this.renderer.render(this.room.scene, camera);
      this.renderer.readRenderTargetPixels(target, 0, 0, 64, 64, pixels);
      let seen = 0;
      for (let i = 3; i < pixels.length; i += 4) seen += pixels[i] > 0;
      if (seen > most) {
        most = seen;
        best = camera.matrixWorld.clone();
      }
    }
    this.renderer.setRenderTarget(null);
    this.renderer.setClearAlpha(clear);
    this.room.scene.background = background;
    if (dome) dome.visible = true;
    target.dispose();
    return best;
  }

  /** Metres to what is in the middle of the picture; a good part of the scene when there is nothing. */
  distanceAhead() {
    if (!this.room) return 1;
    const hit = this.pick(0, 0);
    return hit ? Math.max(hit.distance, this.radius * 0.01) : this.radius * 0.7;
  }

  /** The nearest surface at a point of the picture, −1…1, y upwards; null if there is none. */
  pick(x, y, objects = null) {
    const ray = new Raycaster();
    ray.setFromCamera(new Vector2(x, y), this.camera);
    const hits = objects ? ray.intersectObjects(objects, true) : ray.intersectObject(this.room.scene, true);
    return hits.find((hit) => hit.object.visible) ?? null;
  }

  setView(view) {
    this.view = view;
    this.room.setView(view);
    this.invalidate();
  }

  setExposure(ev) {
    this.ev = ev;
    this.invalidate();
  }

  setToneMapped(on) {
    this.toneMapped = on;
    this.invalidate();
  }

  // As `luxel render`: lit is exposed and tone mapped, the lightmap exposed alone, albedo shown as it is.
  #develop() {
    const { renderer } = this;
    const neutral = this.view === "lit" && this.toneMapped;
    renderer.toneMapping = neutral ? NeutralToneMapping : LinearToneMapping;
    renderer.toneMappingExposure = this.view === "albedo" ? 1 : 2 ** this.ev;
  }

  #project(aspect) {
    const { camera } = this;
    const half = Math.tan(MathUtils.degToRad(this.yfov) / 2);
    // A screen narrower than what the camera was framed for shows all of its width, and more above and below.
    const narrow = Math.max(1, this.frameAspect / aspect);
    camera.fov = MathUtils.radToDeg(2 * Math.atan(Math.max(half, Math.min(half * narrow, Math.tan(MathUtils.degToRad(50))))));
    camera.aspect = aspect;
    camera.near = Math.min(0.05, this.radius * 0.01);
    camera.far = Math.max(100, this.radius * 40);
    camera.updateProjectionMatrix();
  }

  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
    if (width < 1 || height < 1) return;
    this.size = { width, height };
    const ratio = Math.min(devicePixelRatio, matchMedia("(pointer: coarse)").matches ? phonePixelRatio : deskPixelRatio);
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.#project(width / height);
    if (this.room) this.draw(); // at once: a resized canvas is blank until drawn
  }

  /** Asks for a frame. */
  invalidate() {
    this.dirty = true;
    if (!this.frame && this.room) this.frame = requestAnimationFrame((time) => this.#tick(time));
  }

  #tick(time) {
    this.frame = 0;
    const gap = time - this.last;
    this.last = time;
    const running = gap < 250;
    this.timing.interval = running ? gap : 0;
    const moving = this.controls.update(running ? gap / 1000 : 1 / 60);
    const animated = this.animated() || this.continuous;
    this.draw();
    this.onframe();
    if (moving || animated) this.invalidate();
  }

  /** Draws now. */
  draw() {
    this.dirty = false;
    this.#develop(); // before the update, which takes the exposure along
    const start = performance.now();
    this.changed = this.room.update();
    const middle = performance.now();
    this.renderer.render(this.room.scene, this.camera);
    const end = performance.now();
    this.timing.update = middle - start;
    this.timing.render = end - middle;
    if (this.changed) this.timing.compose = middle - start;
  }

  /** Draws the picture at a size of its own and reads it: RGBA bytes, top row first. */
  readPixels(width = this.size.width, height = this.size.height) {
    const { renderer } = this;
    renderer.setPixelRatio(1);
    renderer.setSize(width, height, false);
    this.#project(width / height);
    this.draw();
    const gl = renderer.getContext();
    const flipped = new Uint8Array(width * height * 4);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, flipped);
    const data = new Uint8ClampedArray(flipped.length);
    for (let y = 0; y < height; y++) data.set(flipped.subarray(4 * width * (height - 1 - y), 4 * width * (height - y)), 4 * width * y);
    this.resize();
    return { width, height, data };
  }

  /** The exposure that `luxel render --exposure auto` would choose for what is in the picture now. */
  autoExposure() {
    const width = 160, height = 90;
    const target = new WebGLRenderTarget(width, height, { type: HalfFloatType });
    const { renderer, view } = this;
    if (view !== "lit") this.room.setView("lit"); // the others are not radiance
    this.#develop();
    renderer.setRenderTarget(target);
    renderer.render(this.room.scene, this.camera);
    renderer.setRenderTarget(null);
    if (view !== "lit") this.room.setView(view);
    const halves = new Uint16Array(width * height * 4);
    renderer.readRenderTargetPixels(target, 0, 0, width, height, halves);
    target.dispose();
    let sum = 0, count = 0;
    for (let i = 0; i < halves.length; i += 4) {
      const luminance = 0.2126 * half(halves[i]) + 0.7152 * half(halves[i + 1]) + 0.0722 * half(halves[i + 2]);
      if (!(luminance > 1e-20) || !Number.isFinite(luminance)) continue;
      sum += Math.log2(luminance);
      count++;
    }
    return count ? Math.log2(0.18) - sum / count : 0;
  }
}

export function cameraName(camera) {
  return camera.userData?.name ?? camera.name;
}

function boundsOf(scene) {
  const box = new Box3();
  scene.traverse((object) => object.isMesh && box.expandByObject(object));
  if (box.isEmpty()) box.set(new Vector3(-1, -1, -1), new Vector3(1, 1, 1));
  return box;
}

function half(bits) {
  const exponent = (bits >> 10) & 31, mantissa = bits & 1023;
  const magnitude = exponent === 0 ? mantissa * 2 ** -24 : exponent === 31 ? Infinity : (1 + mantissa / 1024) * 2 ** (exponent - 15);
  return bits & 0x8000 ? -magnitude : magnitude;
}
