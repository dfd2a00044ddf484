// Luxel's viewer: loads a baked folder and lets people change its light.
//
// Address: ?baked=URL (a folder of the same origin; default: baked/ beside this page), ?method=cpu|gpu, ?still (animations of the file
// wait), ?test (window.luxelViewer for tests). What is behind the # is the state (share.js).
import { loadLuxel } from "luxel-three";
import { AtlasView } from "./atlas.js";
import { isTyping } from "./controls.js";
import { el, iconButton } from "./dom.js";
import { LayerList } from "./layers.js";
import { Model } from "./model.js";
import { MonitorGroup, acceptDrops } from "./monitors.js";
import { Panel } from "./panel.js";
import { readState, writeState } from "./share.js";
import { Stage } from "./stage.js";
import { bytes } from "./units.js";

const query = new URLSearchParams(location.search);
const curtain = document.getElementById("curtain");

class Problem extends Error {
  constructor(title, advice) {
    super(title);
    this.advice = advice;
  }
}

function bakedUrl() {
  const url = new URL(query.get("baked") ?? "baked/", document.baseURI);
  if (url.origin !== location.origin)
    throw new Problem("Only baked folders of this site are shown", ["The address asks for another site.", "Put the folder beside this page, as baked/."]);
  if (!url.pathname.endsWith("/") && !url.pathname.endsWith(".json")) url.pathname += "/";
  return url;
}

function checkBrowser() {
  if (typeof WebAssembly !== "object") throw new Problem("This browser has no WebAssembly", ["Any browser from 2021 on has it.", "Some switch it off in a protected mode: allow it for this page."]);
  if (!document.createElement("canvas").getContext("webgl2"))
    throw new Problem("This browser has no WebGL 2", ["Any browser from 2021 on has it.", "It may be switched off: look for hardware acceleration in its settings, or for a blocked graphics driver."]);
}

function showProgress(fraction, loaded, total) {
  document.getElementById("loading-bar").value = fraction;
  const text = total > 0 ? `${bytes(loaded)} of ${bytes(total)}` : `${Math.round(100 * fraction)} %`;
  document.getElementById("loading-text").textContent = text;
}

async function findManifest(folder) {
  const url = folder.pathname.endsWith(".json") ? folder : new URL("luxel.json", folder);
  const missing = (reason) =>
    new Problem("There is no baked room here", [`${url.pathname}: ${reason}.`, "Show a folder that luxel bake wrote: luxel view OUT", "On a web server: luxel export-web OUT -o DIR writes all that it needs."]);
  let response;
  try {
    response = await fetch(url);
  } catch {
    throw missing("the server does not answer");
  }
  if (!response.ok) throw missing(response.status === 404 ? "not found" : `the server says ${response.status}`);
  try {
    return [url, await response.json()];
  } catch {
    throw missing("not a luxel.json");
  }
}

function showProblem(error) {
  console.error(error);
  const advice = error.advice ?? ["The folder may come from another version of Luxel, or be damaged: bake it again.", "If the graphics memory is small, try ?method=cpu."];
  const box = el("div.curtain-box.problem", { role: "alert" },
    el("h1.brand", {}, "Luxel"),
    el("h2", {}, error.advice ? error.message : "The room could not be shown"),
    el("ul", {}, ...advice.map((line) => el("li", {}, line))),
    error.advice ? null : el("pre", {}, error.message),
    el("button.button", { type: "button", onclick: () => location.reload() }, "Try again"));
  curtain.hidden = false;
  curtain.replaceChildren(box);
  curtain.classList.add("started");
}

// A stick for the thumb, shown where there is no keyboard.
function joystick(controls) {
  const knob = el("span.knob");
  const stick = el("div.joystick", { "aria-hidden": "true" }, knob);
  const move = (event) => {
    const box = stick.getBoundingClientRect();
    let x = ((event.clientX - box.left) / box.width) * 2 - 1, y = ((event.clientY - box.top) / box.height) * 2 - 1;
    const length = Math.max(1, Math.hypot(x, y));
    x /= length;
    y /= length;
    knob.style.transform = `translate(${x * 28}px, ${y * 28}px)`;
    controls.push(x, y);
  };
  const release = () => {
    knob.style.transform = "";
    controls.push(0, 0);
  };
  stick.addEventListener("pointerdown", (event) => {
    stick.setPointerCapture(event.pointerId);
    move(event);
  });
  stick.addEventListener("pointermove", (event) => stick.hasPointerCapture(event.pointerId) && move(event));
  for (const type of ["pointerup", "pointercancel"]) stick.addEventListener(type, release);
  return stick;
}

function bindKeys(panel) {
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || isTyping(event.target)) return;
    const act = {
      c: () => panel.nextCamera(),
      g: () => panel.setMode(panel.stage.controls.mode === "walk" ? "orbit" : "walk"),
      v: () => panel.nextView(),
      t: () => panel.setToneMapped(!panel.stage.toneMapped),
      p: () => panel.toggle(),
      "+": () => panel.expose(0.25),
      "=": () => panel.expose(0.25),
      "-": () => panel.expose(-0.25),
    }[event.key.toLowerCase()];
    if (act) act();
  });
}

function keepState(stage, model, panel) {
  let timer = 0, own = location.hash;
  const save = () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      const state = writeState(stage, model);
      own = state ? `#${state}` : "";
      history.replaceState(null, "", own || location.pathname + location.search);
    }, 300);
  };
  model.onchange(save);
  stage.controls.onmove = save;
  panel.onchange = save;
  addEventListener("hashchange", () => location.hash !== own && location.reload());
}

async function start() {
  curtain.classList.add("started");
  checkBrowser();
  const folder = bakedUrl();
  const [manifestUrl, manifest] = await findManifest(folder);
  const method = ["cpu", "gpu"].includes(query.get("method")) ? query.get("method") : "auto";
  const stage = new Stage(document.getElementById("canvas"));
  stage.canvas.addEventListener("webglcontextlost", () =>
    showProblem(new Problem("The graphics card gave up", ["It may be out of memory, or its driver was restarted.", "Try again; ?method=cpu needs less of its memory."])));
  stage.canvas.addEventListener("webglcontextrestored", () => {
    curtain.hidden = true;
    stage.invalidate();
  });
  const room = await loadLuxel(stage.renderer, manifestUrl, {
    method,
    wasmUrl: new URL("luxel_rt.wasm", document.baseURI),
    onProgress: showProgress,
  });
  stage.setRoom(room);

  const model = new Model(room);
  const groups = room.monitors.map((monitor) => new MonitorGroup(stage, model, monitor));
  const list = new LayerList(model, groups);
  const atlas = new AtlasView(stage);
  const panel = new Panel(document.getElementById("panel"), stage, model, list, atlas, {
    method,
    reload: (choice) => {
      query.set("method", choice);
      location.search = query.toString();
    },
    report: manifest.report ? new URL(manifest.report, manifestUrl).href : null,
  });
  const overlay = document.getElementById("overlay");
  overlay.append(
    el("div.tools", {},
      iconButton("camera", "Next camera (C)", () => panel.nextCamera()),
      iconButton("orbit", "Orbit (G)", () => panel.setMode("orbit"), ".when-walking"),
      iconButton("walk", "Walk (G)", () => panel.setMode("walk"), ".when-orbiting"),
      panel.opener),
    joystick(stage.controls));
  document.body.append(atlas.root);
  acceptDrops(stage, groups, overlay);

  stage.canvas.addEventListener("dblclick", (event) => {
    const box = stage.canvas.getBoundingClientRect();
    const hit = stage.pick(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2);
    if (hit) stage.controls.focus(hit.point);
    panel.update();
  });
  model.onchange(() => stage.invalidate());
  stage.animated = () => model.isMoving();
  let glowed = 0, listed = 0;
  stage.onframe = () => {
    panel.measure();
    if (!stage.changed) return;
    const now = performance.now();
    if (now - glowed > 66) {
      list.glow();
      for (const group of groups) group.glow();
      glowed = now;
    }
    if (now - listed > 500) {
      atlas.refresh();
      listed = now;
    }
  };
  bindKeys(panel);
  readState(location.hash, stage, model);
  keepState(stage, model, panel);
  const still = query.has("still") || query.has("test") || matchMedia("(prefers-reduced-motion: reduce)").matches;
  model.play(!still);
  list.update();
  panel.update();
  stage.draw();
  curtain.hidden = true;
  stage.invalidate();
  return { stage, model, room, panel, groups };
}

const started = start();
started.catch(showProblem);

if (query.has("test")) {
  window.luxelViewer = {
    ready: started.then(({ stage, room, model, groups }) => {
      Object.assign(window.luxelViewer, {
        room, model, groups, stage,
        renderer: stage.renderer,
        camera: stage.camera,
        setCamera: (which, yfov) => stage.setCamera(which, yfov),
        setView: (view) => stage.setView(view),
        setExposure: (ev) => stage.setExposure(ev),
        setToneMapped: (on) => stage.setToneMapped(on),
        readPixels: (width, height) => stage.readPixels(width, height),
      });
    }),
  };
}
