// Monitors: pictures and videos that people drop on the page or choose, and a test card.
import { el, icon, iconButton } from "./dom.js";
import { intensityOf, shortNumber, sliderOf } from "./units.js";
import { LayerRow } from "./layers.js";

/** A monitor in the list of lights. */
export class MonitorGroup {
  constructor(stage, model, monitor) {
    this.stage = stage;
    this.model = model;
    this.monitor = monitor;
    const count = monitor.columns * monitor.rows;
    this.cells = model.layers.slice(monitor.firstLayer, monitor.firstLayer + count);
    this.authored = monitor.strength.clone();
    this.factor = 1;
    this.video = null;
    this.image = null;
    this.url = null;
    const { name } = monitor;

    this.file = el("input", { type: "file", accept: "image/*,video/*", hidden: true, onchange: () => this.file.files[0] && this.show(this.file.files[0]) });
    this.status = el("p.monitor-status", { "aria-live": "polite" });
    this.preview = el("canvas.cells", { width: monitor.columns, height: monitor.rows, "aria-hidden": "true" });
    this.solo = el("button.toggle", { type: "button", title: "Solo: only this", "aria-label": `Solo ${name}`, onclick: () => model.setSolo(this.cells, !this.#all("solo")) }, "S");
    this.mute = el("button.toggle.mute", { type: "button", title: "Mute: off", "aria-label": `Mute ${name}`, onclick: () => model.setMuted(this.cells, !this.#all("muted")) }, "M");
    this.more = iconButton("more", `Cells of ${name}`, () => this.#open(this.cellList.hidden), ".chevron");
    this.more.setAttribute("aria-expanded", false);
    this.slider = el("input.slider", {
      type: "range", min: 0, max: 1000, step: 1, "aria-label": `Brightness of ${name}`, title: "Brightness; double click: as authored",
      oninput: () => this.setFactor(Math.abs(this.slider.value - 500) < 6 ? 1 : intensityOf(this.slider.value / 1000, 1)),
      ondblclick: () => this.setFactor(1),
    });
    this.white = el("span.value.white", { title: "Radiance of a white pixel" });
    this.pause = el("button.button", { type: "button", hidden: true, onclick: () => this.#pause() }, "Pause");
    this.stop = el("button.button", { type: "button", hidden: true, onclick: () => this.clear() }, "Authored");
    this.cellList = el("ul.rows.cell-rows", { hidden: true, "aria-label": `Cells of ${name}` });
    this.root = el("li.row.monitor", {},
      el("div.row-head", {}, el("span.kind", { title: "Monitor" }, icon("monitor")), el("span.row-name", { title: name }, name),
        el("span.grid-size", { title: `${count} layers` }, `${monitor.columns} × ${monitor.rows}`), this.solo, this.mute, this.more),
      el("div.row-body", {}, this.preview, this.slider, this.white),
      el("div.bar.monitor-bar", {},
        el("button.button", { type: "button", title: "Or drop one onto the screen", onclick: () => this.file.click() }, "Picture or video…"),
        el("button.button", { type: "button", onclick: () => this.testCard() }, "Test card"), this.pause, this.stop),
      this.status, this.file, this.cellList);
    this.update();
  }

  #all(flag) {
    return this.cells.every((cell) => cell.light[flag]);
  }

  #open(open) {
    if (open && !this.cellRows) {
      this.cellRows = this.cells.map((cell) => new LayerRow(this.model, cell));
      this.cellList.append(...this.cellRows.map((row) => row.root));
    }
    this.cellList.hidden = !open;
    this.more.setAttribute("aria-expanded", open);
  }

  matches(words) {
    const text = `${this.monitor.name} monitor`.toLowerCase();
    return words.every((word) => text.includes(word));
  }

  /** Brightness as a share of the authored one. */
  setFactor(factor) {
    this.factor = factor;
    const own = this.#ownPicture();
    if (!this.video && !this.image && factor !== 1 && own) {
      // The picture of the file, as a picture: so its cells and the screen itself follow the strength.
      this.image = own;
      this.own = true;
      this.#own(true);
      this.monitor.setImage(own);
    } else if (this.own && factor === 1) {
      this.clear();
      return;
    }
    this.monitor.strength = this.authored.clone().multiplyScalar(factor);
    this.update();
    this.stage.invalidate();
  }

  // What the screen shows as authored; a white screen has no picture.
  #ownPicture() {
    if (this.authoredPicture) return this.authoredPicture;
    const image = this.monitor.meshes[0]?.material.emissiveMap?.image;
    if (!image) {
      const canvas = el("canvas", { width: 1, height: 1 });
      const paint = canvas.getContext("2d");
      paint.fillStyle = "#fff";
      paint.fillRect(0, 0, 1, 1);
      this.authoredPicture = canvas;
    }
    return (this.authoredPicture ??= image);
  }

  /** Plays a file: a picture or a video. */
  async show(file) {
    this.#release();
    const url = (this.url = URL.createObjectURL(file));
    const name = file.name || "what was dropped";
    const show = file.type.startsWith("video/") ? this.#playVideo : this.#showPicture;
    try {
      if (!(await show.call(this, url))) return;
      this.#say(`Shows ${name}`);
    } catch (error) {
      if (this.url !== url) return;
      this.#release();
      this.#say(`This browser can't show ${name}: ${error.message}`, true);
    }
    this.update();
    this.stage.invalidate();
  }

  // These two show what is behind a URL; false if something else was chosen while it was read.
  async #showPicture(url) {
    const image = new Image();
    image.src = url;
    await image.decode().catch(() => {
      throw new Error("not a picture it knows");
    });
    if (this.url !== url) return false;
    this.#setImage(image);
    return true;
  }

  #setImage(image) {
    this.image = image;
    this.#own(true);
    this.monitor.setImage(image);
  }

  async #playVideo(url) {
    const video = el("video", { muted: true, loop: true, playsInline: true, src: url });
    await new Promise((resolve, reject) => {
      video.onloadeddata = resolve;
      video.onerror = () => reject(new Error(video.error?.message || "not a video it knows"));
    });
    if (this.url !== url) return false;
    this.video = video;
    this.#own(true);
    this.monitor.setVideo(video);
    await video.play().catch(() => {}); // the pause button starts it
    const follow = () => {
      if (this.video !== video) return;
      this.stage.invalidate();
      if (video.requestVideoFrameCallback) video.requestVideoFrameCallback(follow);
      else setTimeout(follow, 33);
    };
    follow();
    return this.url === url;
  }

  #pause() {
    if (this.video.paused) this.video.play();
    else this.video.pause();
    this.update();
    this.stage.invalidate();
  }

  /** Letters and colours that show which way is up, and which is left. */
  testCard() {
    this.#release();
    const canvas = el("canvas", { width: 320, height: 180 });
    const paint = canvas.getContext("2d");
    const corners = [["A", "#e03030", 0, 0], ["B", "#30c040", 1, 0], ["C", "#3060f0", 0, 1], ["D", "#f0c020", 1, 1]];
    paint.textAlign = "center";
    paint.textBaseline = "middle";
    paint.font = "bold 76px sans-serif";
    for (const [letter, color, x, y] of corners) {
      paint.fillStyle = color;
      paint.fillRect(160 * x, 90 * y, 160, 90);
      paint.fillStyle = "#fff";
      paint.fillText(letter, 160 * x + 80, 90 * y + 49);
    }
    this.#setImage(canvas);
    this.#say("Shows the test card");
    this.update();
    this.stage.invalidate();
  }

  /** Back to the authored picture. */
  clear() {
    this.#release();
    this.#say("");
    this.factor = 1;
    this.monitor.strength = this.authored.clone();
    for (const cell of this.cells) this.model.reset(cell);
    this.monitor.setVideo(null);
    this.update();
    this.stage.invalidate();
  }

  #own(media) {
    for (const cell of this.cells) {
      cell.media = media;
      if (media) this.model.room.setProgram(cell.light.index, null);
    }
  }

  #release() {
    if (this.video) {
      this.monitor.setVideo(null);
      this.video.pause();
      this.video.removeAttribute("src");
      this.video.load();
    }
    this.#own(false);
    this.video = this.image = null;
    this.own = false;
    if (this.url) URL.revokeObjectURL(this.url);
    this.url = null;
    this.file.value = "";
  }

  #say(text, failed = false) {
    this.status.textContent = text;
    this.status.classList.toggle("failed", failed);
  }

  update() {
    const media = Boolean(this.video || this.image) && !this.own;
    this.solo.setAttribute("aria-pressed", this.#all("solo"));
    this.mute.setAttribute("aria-pressed", this.#all("muted"));
    this.slider.value = Math.round(sliderOf(this.factor, 1) * 1000);
    const { r, g, b } = this.authored;
    this.white.textContent = `${shortNumber(Math.max(r, g, b) * this.factor)} nit`;
    this.stop.hidden = !media && this.factor === 1;
    this.pause.hidden = !this.video;
    if (this.video) this.pause.textContent = this.video.paused ? "Play" : "Pause";
    const solo = this.model.room.lights.some((light) => light.solo);
    this.root.classList.toggle("dark", this.#all("muted") || (solo && !this.cells.some((cell) => cell.light.solo)));
    if (this.cellRows) for (const row of this.cellRows) row.update();
    this.glow();
  }

  /** What the cells shine with now, as a small picture. */
  glow() {
    const { columns, rows } = this.monitor;
    const paint = this.preview.getContext("2d");
    const picture = paint.createImageData(columns, rows);
    const white = Math.max(this.authored.r, this.authored.g, this.authored.b, 1e-6) * Math.max(this.factor, 1e-6);
    this.cells.forEach(({ light }, k) => {
      const scale = light.muted ? 0 : light.intensity / white;
      picture.data.set([light.color.r, light.color.g, light.color.b].map((x) => 255 * Math.min(1, Math.max(0, x * scale)) ** (1 / 2.2)), 4 * k);
      picture.data[4 * k + 3] = 255;
    });
    paint.putImageData(picture, 0, 0);
  }
}

/** Lets people drop pictures and videos on the page: onto the screen they hit, else onto the first. */
export function acceptDrops(stage, groups, overlay) {
  const hint = el("div.drop-hint", { hidden: true }, el("p", {}, groups.length ? "Drop a picture or a video onto a screen" : "This room has no screen to show it"));
  overlay.append(hint);
  let depth = 0;
  const isFile = (event) => [...(event.dataTransfer?.types ?? [])].includes("Files");
  addEventListener("dragenter", (event) => {
    if (!isFile(event)) return;
    depth++;
    hint.hidden = false;
  });
  addEventListener("dragleave", (event) => {
    if (isFile(event) && --depth <= 0) hint.hidden = true;
  });
  addEventListener("dragover", (event) => isFile(event) && event.preventDefault());
  addEventListener("drop", (event) => {
    if (!isFile(event)) return;
    event.preventDefault();
    depth = 0;
    hint.hidden = true;
    const file = event.dataTransfer.files[0];
    if (file && groups.length) (groupAt(stage, groups, event) ?? groups[0]).show(file);
  });
}

function groupAt(stage, groups, event) {
  const box = stage.canvas.getBoundingClientRect();
  const x = ((event.clientX - box.left) / box.width) * 2 - 1, y = 1 - ((event.clientY - box.top) / box.height) * 2;
  const hit = stage.pick(x, y, groups.flatMap((group) => [...group.monitor.meshes]));
  return hit ? groups.find((group) => group.monitor.meshes.some((mesh) => mesh === hit.object || mesh.children.includes(hit.object))) : null;
}
