// Orbit and walk with one state: a pivot, two angles and a distance. Walking is orbiting at distance 0, so that changing the mode
// moves nothing. Every motion goes to a goal that the camera follows; when it has arrived, frames end.
import { MathUtils, Matrix4, Vector3 } from "three";

const followPerSecond = 16;
const pitchLimit = Math.PI / 2 - 0.01;
const moveKeys = new Set(["KeyW", "KeyA", "KeyS", "KeyD", "KeyQ", "KeyE"]);
const turnKeys = new Set(["ArrowUp", "ArrowDown", "ArrowLeft", "ArrowRight"]);
const turnsPerSecond = 0.2; // by keys

export class Controls {
  /** `stage` gives camera, canvas, invalidate(), radius (of the scene, metres) and distanceAhead(). */
  constructor(stage) {
    this.stage = stage;
    this.camera = stage.camera;
    this.mode = "orbit";
    this.taken = false; // the camera is still exactly where it was put
    this.goal = { pivot: new Vector3(), yaw: 0, pitch: 0, distance: 1 };
    this.now = { pivot: new Vector3(), yaw: 0, pitch: 0, distance: 1 };
    this.keys = new Set();
    this.stick = { x: 0, y: 0 };
    this.pointers = new Map();
    this.onmove = () => {};
    this.calm = matchMedia("(prefers-reduced-motion: reduce)").matches;

    const canvas = stage.canvas;
    canvas.addEventListener("pointerdown", (event) => this.#down(event));
    canvas.addEventListener("pointermove", (event) => this.#move(event));
    for (const type of ["pointerup", "pointercancel"]) canvas.addEventListener(type, (event) => this.#up(event));
    canvas.addEventListener("wheel", (event) => this.#wheel(event), { passive: false });
    canvas.addEventListener("contextmenu", (event) => event.preventDefault());
    addEventListener("keydown", (event) => this.#key(event, true));
    addEventListener("keyup", (event) => this.#key(event, false));
    addEventListener("blur", () => this.keys.clear());
  }

  /** Puts the camera there; a roll or a slanted axis stays until somebody moves. */
  place(matrixWorld) {
    matrixWorld.decompose(this.camera.position, this.camera.quaternion, new Vector3());
    this.camera.updateMatrixWorld();
    this.taken = false;
    this.keys.clear();
    this.#fromCamera();
  }

  setMode(mode) {
    if (mode === this.mode) return;
    this.#arrive();
    this.mode = mode;
    this.#fromCamera();
  }

  /** Looks at a point from where it is, and orbits around it from now on. */
  focus(point) {
    this.taken = true;
    this.mode = "orbit";
    const eye = this.camera.position;
    const back = new Vector3().subVectors(eye, point);
    const distance = Math.max(back.length(), 1e-4);
    this.goal.pivot.copy(point);
    this.goal.distance = this.now.distance = distance;
    // The pivot glides from straight ahead to the point.
    this.now.pivot.copy(eye).addScaledVector(direction(this.now), distance);
    this.goal.yaw = nearTurn(Math.atan2(back.x, back.z), this.now.yaw);
    this.goal.pitch = MathUtils.clamp(Math.asin(back.y / distance), -pitchLimit, pitchLimit);
    this.stage.invalidate();
  }

  /** Where the camera is, for links: eye, yaw, pitch. */
  pose() {
    const { x, y, z } = this.camera.position;
    return [x, y, z, this.goal.yaw, this.goal.pitch];
  }

  setPose([x, y, z, yaw, pitch]) {
    const matrix = new Matrix4().makeRotationFromQuaternion(this.camera.quaternion.setFromEuler(euler(this.camera, yaw, pitch)));
    this.place(matrix.setPosition(x, y, z));
  }

  /** Advances by dt seconds; true while there is more to come. */
  update(dt) {
    this.#walkBy(dt);
    if (!this.taken) return false;
    const share = this.calm ? 1 : 1 - Math.exp(-followPerSecond * dt);
    const { now, goal } = this;
    now.pivot.lerp(goal.pivot, share);
    now.yaw += (goal.yaw - now.yaw) * share;
    now.pitch += (goal.pitch - now.pitch) * share;
    now.distance += (goal.distance - now.distance) * share;
    const rest =
      Math.abs(goal.yaw - now.yaw) + Math.abs(goal.pitch - now.pitch) +
      (now.pivot.distanceTo(goal.pivot) + Math.abs(goal.distance - now.distance)) / this.stage.radius;
    const moving = rest > 2e-4;
    if (!moving) this.#arrive();
    this.#toCamera();
    if (!moving) this.onmove();
    return moving || this.#pushed();
  }

  #arrive() {
    const { now, goal } = this;
    now.pivot.copy(goal.pivot);
    Object.assign(now, { yaw: goal.yaw, pitch: goal.pitch, distance: goal.distance });
  }

  #fromCamera() {
    const back = new Vector3(0, 0, 1).applyQuaternion(this.camera.quaternion);
    const distance = this.mode === "walk" ? 0 : this.stage.distanceAhead();
    for (const state of [this.now, this.goal]) {
      state.yaw = Math.atan2(back.x, back.z);
      state.pitch = Math.asin(MathUtils.clamp(back.y, -1, 1));
      state.distance = distance;
      state.pivot.copy(this.camera.position).addScaledVector(back, -distance);
    }
  }

  #toCamera() {
    const { now, camera } = this;
    camera.quaternion.setFromEuler(euler(camera, now.yaw, now.pitch));
    camera.position.copy(now.pivot).addScaledVector(direction(now), -now.distance);
    camera.updateMatrixWorld();
  }

  #take() {
    this.taken = true;
    this.stage.invalidate();
  }

  #turn(dx, dy) {
    // A drag over the height of the picture is half a turn when orbiting, and follows the picture when looking.
    const speed = this.mode === "walk" ? MathUtils.degToRad(this.camera.fov) : Math.PI;
    const perPixel = speed / this.stage.canvas.clientHeight;
    // Orbiting drags the room, looking drags the view: in both what is under the pointer goes with it.
    const sign = this.mode === "walk" ? 1 : -1;
    this.goal.yaw += sign * dx * perPixel;
    this.goal.pitch = MathUtils.clamp(this.goal.pitch - sign * dy * perPixel, -pitchLimit, pitchLimit);
    this.#take();
  }

  #pan(dx, dy) {
    const reach = this.mode === "walk" ? Math.min(2, this.stage.radius) : this.goal.distance;
    const perPixel = (2 * Math.tan(MathUtils.degToRad(this.camera.fov) / 2) * reach) / this.stage.canvas.clientHeight;
    const right = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 0);
    const up = new Vector3().setFromMatrixColumn(this.camera.matrixWorld, 1);
    this.goal.pivot.addScaledVector(right, -dx * perPixel).addScaledVector(up, dy * perPixel);
    this.#take();
  }

  #dolly(factor) {
    const { radius } = this.stage;
    if (this.mode === "walk") this.goal.pivot.addScaledVector(direction(this.goal), -Math.log(factor) * Math.min(1, radius));
    else this.goal.distance = MathUtils.clamp(this.goal.distance * factor, radius * 1e-3, radius * 20);
    this.#take();
  }

  #pushed() {
    for (const code of this.keys) if (code !== "ShiftLeft") return true; // which only makes the others faster
    return this.stick.x !== 0 || this.stick.y !== 0;
  }

  #walkBy(dt) {
    if (!this.#pushed()) return;
    const down = (...codes) => (codes.some((code) => this.keys.has(code)) ? 1 : 0);
    const ahead = down("KeyW") - down("KeyS") - this.stick.y;
    const right = down("KeyD") - down("KeyA") + this.stick.x;
    const up = down("KeyE") - down("KeyQ");
    const { radius } = this.stage;
    const speed = Math.max(Math.min(2.2, radius), radius / 20) * (this.keys.has("ShiftLeft") ? 3 : 1);
    const { sin, cos } = Math;
    const yaw = this.goal.yaw;
    this.goal.pivot.x += (-sin(yaw) * ahead + cos(yaw) * right) * speed * dt;
    this.goal.pivot.z += (-cos(yaw) * ahead - sin(yaw) * right) * speed * dt;
    this.goal.pivot.y += up * speed * dt;
    // Both ways of turning show what lies on that side: walking looks there, orbiting goes there.
    const turn = 2 * Math.PI * turnsPerSecond * dt, sign = this.mode === "walk" ? -1 : 1;
    this.goal.yaw += sign * (down("ArrowRight") - down("ArrowLeft")) * turn;
    const pitch = this.goal.pitch - sign * (down("ArrowDown") - down("ArrowUp")) * turn;
    this.goal.pitch = MathUtils.clamp(pitch, -pitchLimit, pitchLimit);
    this.#take();
  }

  /** A virtual joystick, each axis −1…1, y downwards. */
  push(x, y) {
    this.stick = { x, y };
    this.stage.invalidate();
  }

  #key(event, down) {
    if (!down) {
      this.keys.delete(event.code);
      return;
    }
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    if (event.code.startsWith("Arrow") && event.target !== this.stage.canvas && event.target !== document.body) return;
    const moves = moveKeys.has(event.code) || turnKeys.has(event.code);
    if (!moves && event.code !== "ShiftLeft") return;
    if (moves) event.preventDefault();
    this.keys.add(event.code);
    this.stage.invalidate();
  }

  #down(event) {
    this.stage.canvas.setPointerCapture(event.pointerId);
    this.stage.canvas.focus({ preventScroll: true });
    this.pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  }

  #move(event) {
    const last = this.pointers.get(event.pointerId);
    if (!last) return;
    const dx = event.clientX - last.x, dy = event.clientY - last.y;
    if (this.pointers.size === 1) {
      if (event.buttons & 6 || event.shiftKey) this.#pan(dx, dy);
      else this.#turn(dx, dy);
    } else if (this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
      const before = Math.hypot(last.x - other.x, last.y - other.y);
      const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
      if (before > 10 && after > 10) this.#dolly(before / after);
      this.#pan(dx / 2, dy / 2);
    }
    last.x = event.clientX;
    last.y = event.clientY;
  }

  #up(event) {
    this.pointers.delete(event.pointerId);
  }

  #wheel(event) {
    event.preventDefault();
    const pixels = event.deltaMode === 1 ? event.deltaY * 16 : event.deltaY;
    this.#dolly(Math.exp(MathUtils.clamp(pixels, -300, 300) * 0.0012));
  }
}

// Where the camera looks: yaw and pitch say where its back points.
function direction({ yaw, pitch }) {
  return new Vector3(-Math.sin(yaw) * Math.cos(pitch), -Math.sin(pitch), -Math.cos(yaw) * Math.cos(pitch));
}

function euler(camera, yaw, pitch) {
  return camera.rotation.clone().set(-pitch, yaw, 0, "YXZ");
}

function nearTurn(angle, reference) {
  return angle + Math.round((reference - angle) / (2 * Math.PI)) * 2 * Math.PI;
}

/** True where keys are text or belong to a control. */
export function isTyping(target) {
  return target instanceof HTMLElement && target.matches("input:not([type=checkbox]):not([type=radio]):not([type=range]), select, textarea, dialog, dialog *");
}
