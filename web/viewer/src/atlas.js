// The atlas pages as pictures: all layers or one, with zoom and the numbers under the pointer.
import { el, iconButton } from "./dom.js";
import { shortNumber, srgbByte } from "./units.js";

export class AtlasView {
  constructor(stage) {
    this.stage = stage;
    const { room } = stage;
    this.page = 0;
    this.layer = -1;
    this.texels = null;
    this.scale = 1; // screen pixels per texel
    this.offset = { x: 0, y: 0 };
    this.pointers = new Map();

    const option = (value, text) => el("option", { value }, text);
    this.pages = el("select", { "aria-label": "Page", onchange: () => this.#choose(Number(this.pages.value), this.layer) },
      ...Array.from({ length: room.pageCount }, (_, k) => option(k, `Page ${k + 1} of ${room.pageCount}`)));
    this.layers = el("select", { "aria-label": "Layer", onchange: () => this.#choose(this.page, Number(this.layers.value)) },
      option(-1, "All layers"), ...room.lights.map((light) => option(light.index, light.name)));
    this.canvas = el("canvas.atlas-canvas", { tabindex: 0, "aria-label": "Atlas page. Wheel or pinch to zoom, drag to move." });
    this.readout = el("p.readout", {}, "");
    this.coverage = el("span.coverage");
    this.root = el("dialog.atlas", { "aria-label": "Atlas pages" },
      el("div.atlas-bar", {}, this.pages, this.layers, this.coverage,
        el("span.spring"),
        el("button.button", { type: "button", onclick: () => this.#fit() }, "Fit"),
        el("button.button", { type: "button", onclick: () => this.#zoomTo(1) }, "1:1"),
        iconButton("close", "Close", () => this.root.close())),
      this.canvas, this.readout);
    this.root.addEventListener("close", () => this.stage.canvas.focus());
    new ResizeObserver(() => this.root.open && this.#paint()).observe(this.root);

    this.canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.#zoomBy(Math.exp(-Math.max(-300, Math.min(300, event.deltaY)) * 0.002), event.offsetX, event.offsetY);
    }, { passive: false });
    this.canvas.addEventListener("pointerdown", (event) => {
      this.canvas.setPointerCapture(event.pointerId);
      this.pointers.set(event.pointerId, { x: event.offsetX, y: event.offsetY });
    });
    for (const type of ["pointerup", "pointercancel"]) this.canvas.addEventListener(type, (event) => this.pointers.delete(event.pointerId));
    this.canvas.addEventListener("pointermove", (event) => this.#move(event));
    this.canvas.addEventListener("keydown", (event) => {
      const factor = { "+": 1.25, "=": 1.25, "-": 0.8 }[event.key];
      if (factor) this.#zoomBy(factor, this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
    });
  }

  open() {
    this.root.showModal();
    this.#choose(this.page, this.layer);
    this.#fit();
  }

  /** Shows what has changed, if it is on show. */
  refresh() {
    if (this.root.open) this.#choose(this.page, this.layer);
  }

  #choose(page, layer) {
    this.page = page;
    this.layer = layer;
    const { room, ev } = this.stage;
    const { coverage } = room.manifest.atlas?.pages?.[page] ?? {};
    this.coverage.textContent = `${room.pageSize} × ${room.pageSize}${coverage ? `, ${(100 * coverage).toFixed(0)} % covered` : ""}`;
    this.texels = layer < 0 ? room.readPage(page) : room.readLayer(page, layer);
    const n = room.pageSize;
    const exposure = 2 ** ev / Math.PI;
    const picture = new ImageData(n, n);
    for (let i = 0, o = 0; i < this.texels.length; i += 3, o += 4) {
      picture.data[o] = srgbByte(this.texels[i] * exposure);
      picture.data[o + 1] = srgbByte(this.texels[i + 1] * exposure);
      picture.data[o + 2] = srgbByte(this.texels[i + 2] * exposure);
      picture.data[o + 3] = 255;
    }
    this.picture = el("canvas", { width: n, height: n });
    this.picture.getContext("2d").putImageData(picture, 0, 0);
    this.#paint();
  }

  #fit() {
    const { clientWidth, clientHeight } = this.canvas;
    const n = this.stage.room.pageSize;
    this.scale = Math.min(clientWidth, clientHeight) / n;
    this.offset = { x: (clientWidth - n * this.scale) / 2, y: (clientHeight - n * this.scale) / 2 };
    this.#paint();
  }

  #zoomTo(scale) {
    this.#zoomBy(scale / devicePixelRatio / this.scale, this.canvas.clientWidth / 2, this.canvas.clientHeight / 2);
  }

  #zoomBy(factor, x, y) {
    const scale = Math.min(64, Math.max(0.05, this.scale * factor));
    this.offset.x = x - ((x - this.offset.x) * scale) / this.scale;
    this.offset.y = y - ((y - this.offset.y) * scale) / this.scale;
    this.scale = scale;
    this.#paint();
  }

  #move(event) {
    const last = this.pointers.get(event.pointerId);
    const [x, y] = [event.offsetX, event.offsetY];
    if (last && this.pointers.size === 1) {
      this.offset.x += x - last.x;
      this.offset.y += y - last.y;
      this.#paint();
    } else if (last && this.pointers.size === 2) {
      const [other] = [...this.pointers].filter(([id]) => id !== event.pointerId).map(([, point]) => point);
      const before = Math.hypot(last.x - other.x, last.y - other.y), after = Math.hypot(x - other.x, y - other.y);
      if (before > 10) this.#zoomBy(after / before, (x + other.x) / 2, (y + other.y) / 2);
    }
    if (last) Object.assign(last, { x, y });
    this.#read(x, y);
  }

  #read(x, y) {
    const n = this.stage.room.pageSize;
    const i = Math.floor((x - this.offset.x) / this.scale), j = Math.floor((y - this.offset.y) / this.scale);
    if (!this.texels || i < 0 || j < 0 || i >= n || j >= n) {
      this.readout.textContent = "";
      return;
    }
    const rgb = [0, 1, 2].map((c) => shortNumber(this.texels[3 * (j * n + i) + c]));
    this.readout.textContent = `(${i}, ${j})   E = ${rgb.join(", ")} lx`;
  }

  #paint() {
    const { canvas, picture } = this;
    if (!picture) return;
    const ratio = devicePixelRatio;
    const width = Math.round(canvas.clientWidth * ratio), height = Math.round(canvas.clientHeight * ratio);
    if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
    const paint = canvas.getContext("2d");
    paint.setTransform(1, 0, 0, 1, 0, 0);
    paint.clearRect(0, 0, width, height);
    paint.imageSmoothingEnabled = this.scale * ratio < 1;
    paint.setTransform(this.scale * ratio, 0, 0, this.scale * ratio, this.offset.x * ratio, this.offset.y * ratio);
    paint.drawImage(picture, 0, 0);
  }
}
