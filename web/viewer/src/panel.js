// The panel: lights, picture, about. A column at the right of a desk's screen, a sheet at the bottom of a phone's.
import { el, iconButton, segmented } from "./dom.js";
import { cameraName } from "./stage.js";
import { bytes, shortNumber } from "./units.js";

export class Panel {
  constructor(root, stage, model, list, atlas, links) {
    this.root = root;
    this.stage = stage;
    this.model = model;
    this.list = list;
    this.atlas = atlas;
    this.tabs = new Map();
    this.dragged = -1000;
    this.nav = el("div.tabs", { role: "tablist", "aria-label": "Panel" });
    this.grip = el("button.grip", { type: "button", "aria-label": "Open or close the panel", onclick: () => performance.now() - this.dragged > 300 && this.toggle() }, el("span"));
    const close = iconButton("close", "Close the panel (P)", () => this.setOpen(false), ".panel-close");
    const bodies = [
      this.#tab("lights", "Lights", list.root),
      this.#tab("picture", "Picture", this.#picture()),
      this.#tab("about", "About", this.#about(links)),
    ];
    this.body = el("div.panel-body", {}, ...bodies);
    root.append(this.grip, el("div.panel-head", {}, this.nav, close), this.body);
    this.opener = iconButton("panel", "Open the panel (P)", () => this.setOpen(true), ".opener");
    this.#dragSheet();
    this.select("lights");
    this.setOpen(!matchMedia("(max-width: 700px)").matches);
    this.update();
  }

  #tab(key, text, content) {
    const button = el("button.tab", {
      type: "button", id: `tab-${key}`, role: "tab", "aria-controls": `pane-${key}`,
      onclick: () => {
        this.select(key);
        this.setOpen(true);
      },
      onkeydown: (event) => {
        const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
        if (!step) return;
        const keys = [...this.tabs.keys()];
        this.select(keys[(keys.indexOf(key) + step + keys.length) % keys.length], true);
      },
    }, text);
    const pane = el("section.pane", { id: `pane-${key}`, role: "tabpanel", "aria-labelledby": `tab-${key}` }, content);
    this.tabs.set(key, { button, pane });
    this.nav.append(button);
    return pane;
  }

  select(key, focus = false) {
    for (const [each, { button, pane }] of this.tabs) {
      const chosen = each === key;
      button.setAttribute("aria-selected", chosen);
      button.tabIndex = chosen ? 0 : -1;
      pane.hidden = !chosen;
      if (chosen && focus) button.focus();
    }
    if (this.body) this.body.scrollTop = 0;
    if (key === "about") this.measure(true);
  }

  get isOpen() {
    return !this.root.classList.contains("closed");
  }

  setOpen(open) {
    this.root.classList.toggle("closed", !open);
    document.body.classList.toggle("panel-closed", !open);
    this.body.inert = !open;
    this.opener.hidden = open;
    this.grip.setAttribute("aria-expanded", open);
  }

  toggle() {
    this.setOpen(!this.isOpen);
  }

  // The sheet follows the finger up or down.
  #dragSheet() {
    let start = null;
    this.grip.addEventListener("pointerdown", (event) => {
      start = event.clientY;
      this.grip.setPointerCapture(event.pointerId);
    });
    this.grip.addEventListener("pointerup", (event) => {
      const way = start === null ? 0 : event.clientY - start;
      start = null;
      if (Math.abs(way) < 24) return;
      this.dragged = performance.now(); // the click that may follow is not meant
      this.setOpen(way < 0);
    });
  }

  #picture() {
    const { stage } = this;
    const cameras = stage.room.cameras.filter((camera) => camera.isPerspectiveCamera);
    this.camera = el("select", { "aria-label": "Camera", onchange: () => this.chooseCamera(Number(this.camera.value)) },
      ...(cameras.length ? cameras.map((camera, k) => el("option", { value: k }, cameraName(camera) || `Camera ${k + 1}`)) : [el("option", { value: 0 }, "Whole room")]));
    this.move = segmented("How to move", [["orbit", "Orbit"], ["walk", "Walk"]], "orbit", (mode) => this.setMode(mode));
    this.view = segmented("What is shown", [
      ["lit", "Lit", "The room as it looks"],
      ["lightmap", "Lightmap", "Light alone, as if everything were painted white, without tone mapping"],
      ["albedo", "Albedo", "Base colours, without light"],
    ], "lit", (view) => this.setView(view));
    this.ev = el("input.slider", { type: "range", min: -6, max: 6, step: 0.05, "aria-label": "Exposure in stops around as authored", oninput: () => this.#expose(stage.room.ev + Number(this.ev.value)) });
    this.evNumber = el("input.number", { type: "number", step: 0.1, "aria-label": "Exposure in EV", onchange: () => this.evNumber.value !== "" && this.#expose(Number(this.evNumber.value)) });
    this.tone = el("input", { type: "checkbox", role: "switch", onchange: () => this.setToneMapped(this.tone.checked) });
    const field = (label, ...content) => el("div.field", {}, el("span.field-label", {}, label), ...content);
    return el("div.fields", {},
      field("Camera", this.camera),
      field("Move", this.move.root),
      field("Show", this.view.root),
      field("Exposure", el("div.row-body", {}, this.ev, el("span.value", {}, this.evNumber, el("span.unit", {}, "EV"))),
        el("div.bar", {},
          el("button.button", { type: "button", title: "As the bake chose it", onclick: () => this.#expose(stage.room.ev) }, "Authored"),
          el("button.button", { type: "button", title: "From the picture as it is now", onclick: () => this.#expose(stage.autoExposure()) }, "Auto"))),
      el("label.check", {}, this.tone, el("span", {}, "Tone mapping", el("small", {}, "Khronos PBR Neutral"))),
      el("button.button.wide", { type: "button", onclick: () => this.atlas.open() }, "Atlas pages…"));
  }

  #about(links) {
    const { stage } = this;
    const { room } = stage;
    const { manifest, budget, methodReason: reason } = room;
    this.meters = { fps: el("dd"), frame: el("dd"), compose: el("dd") };
    const list = (pairs) => el("dl.facts", {}, ...pairs.filter(Boolean).flatMap(([term, value]) => [el("dt", {}, term), value instanceof Node ? value : el("dd", {}, value)]));
    const gpu = room.method === "gpu";
    this.run = el("input", { type: "checkbox", role: "switch", onchange: () => {
      stage.continuous = this.run.checked;
      stage.invalidate();
    } });
    const method = segmented("How layers are summed", [
      ["auto", "Auto", "Chosen by measuring"], ["cpu", "CPU", "WebAssembly sums the layers when colours change"], ["gpu", "GPU", "The shader sums the layers in every pixel"],
    ], links.method, links.reload);
    const bake = manifest.bake ?? {};
    const cost = [
      ["Pack in memory", bytes(budget.pack)],
      budget.dense > 1.02 * budget.pack && ["without sparseness", bytes(budget.dense)],
      ["Accumulators", gpu ? "not used" : bytes(budget.accumulator)],
      ["On the GPU", bytes(gpu ? budget.gpuLayers : budget.gpuComposed)],
      [gpu ? "if summed by the CPU" : "if summed by the GPU", bytes(gpu ? budget.gpuComposed : budget.gpuLayers)],
    ];
    const keys = [
      ["W A S D", "move (Q, E: down, up; Shift: faster)"], ["Arrows", "turn"], ["Drag", "orbit, or look when walking"], ["Right drag, two fingers", "shift"],
      ["Wheel, pinch", "nearer, farther"], ["Double click", "orbit around that point"], ["C", "next camera"], ["G", "orbit or walk"], ["V", "next view"], ["T", "tone mapping"],
      ["+ −", "exposure"], ["P", "panel"],
    ];
    return el("div.fields", {},
      el("h2", {}, "This frame"),
      list([["Frames per second", this.meters.fps], ["CPU time of a frame", this.meters.frame], ["Last sum of layers", this.meters.compose]]),
      el("label.check", {}, this.run, el("span", {}, "Draw all the time", el("small", {}, "to measure; else only what changes is drawn"))),
      el("h2", {}, "Sum of layers"),
      method.root,
      el("p.note", {}, `${gpu ? "In the shader, per pixel" : "In WebAssembly, on change"}. Measured: ${shortNumber(reason.composeMs)} ms for ${reason.layers} layers; all layers on the GPU: ${bytes(reason.gpuLayersBytes)}.`),
      el("h2", {}, "Memory"),
      list(cost),
      el("h2", {}, "The bake"),
      list([
        ["Layers", String(room.lights.length)],
        room.monitors.length && ["Monitors", room.monitors.map((each) => `${each.name} ${each.columns} × ${each.rows}`).join(", ")],
        ["Pages", `${room.pageCount} of ${room.pageSize} × ${room.pageSize}`],
        manifest.atlas?.texels_per_m && ["Texels per metre", shortNumber(manifest.atlas.texels_per_m)],
        bake.samples && ["Samples per texel", String(bake.samples)],
        bake.seconds && ["Took", `${shortNumber(bake.seconds)} s`],
        manifest.generator && ["Written by", manifest.generator],
      ]),
      links.report ? el("a.button.wide", { href: links.report, target: "_blank", rel: "noopener" }, "Report of the bake") : null,
      el("h2", {}, "Keys"),
      list(keys));
  }

  #expose(ev) {
    this.stage.setExposure(Math.min(60, Math.max(-60, ev)));
    this.atlas.refresh();
    this.changed();
  }

  /** By a step, in stops. */
  expose(step) {
    this.#expose(this.stage.ev + step);
  }

  chooseCamera(index) {
    this.stage.setCamera(index);
    this.changed();
  }

  nextCamera() {
    const count = this.camera.options.length;
    this.camera.value = (Number(this.camera.value) + 1) % count;
    this.chooseCamera(Number(this.camera.value));
  }

  setMode(mode) {
    this.stage.controls.setMode(mode);
    this.changed();
  }

  setView(view) {
    this.stage.setView(view);
    this.changed();
  }

  nextView() {
    const views = ["lit", "lightmap", "albedo"];
    this.setView(views[(views.indexOf(this.stage.view) + 1) % views.length]);
  }

  setToneMapped(on) {
    this.stage.setToneMapped(on);
    this.changed();
  }

  changed() {
    this.update();
    this.onchange?.();
  }

  update() {
    const { stage } = this;
    this.move.set(stage.controls.mode);
    this.view.set(stage.view);
    this.ev.value = stage.ev - stage.room.ev;
    this.ev.setAttribute("aria-valuetext", `${stage.ev.toFixed(2)} EV`);
    if (document.activeElement !== this.evNumber) this.evNumber.value = Number(stage.ev.toFixed(2));
    this.tone.checked = stage.toneMapped;
    document.body.classList.toggle("walking", stage.controls.mode === "walk");
  }

  /** Numbers about the last frame, at most four times a second. */
  measure(atOnce = false) {
    const now = performance.now();
    const { timing } = this.stage;
    if (timing.interval > 0) this.interval = this.interval ? 0.9 * this.interval + 0.1 * timing.interval : timing.interval;
    if (!atOnce && now - (this.measured ?? 0) < 250) return;
    this.measured = now;
    if (this.tabs.get("about").pane.hidden) return;
    this.meters.fps.textContent = timing.interval > 0 ? shortNumber(1000 / this.interval) : "at rest";
    this.meters.frame.textContent = `${(timing.update + timing.render).toFixed(1)} ms`;
    this.meters.compose.textContent = timing.compose === undefined ? "–" : `${timing.compose.toFixed(1)} ms`;
  }
}
