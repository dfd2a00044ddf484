// The list of layers: one row each, cells of a monitor below their monitor.
import { Color } from "three";
import { el, icon, iconButton } from "./dom.js";
import { animationKinds } from "./model.js";
import { hexOf, intensityOf, shortNumber, sliderOf, unitName } from "./units.js";

const steps = 1000;
const kindNames = {
  point: "Point lamp", spot: "Spot lamp", directional: "Directional light", rect: "Rectangular area light", disk: "Disk area light",
  emissive: "Emissive material", sky: "Sky", combined: "All light in one",
};

/** Row of one layer. `update()` shows what the model holds. */
class LayerRow {
  constructor(model, layer) {
    this.model = model;
    this.layer = layer;
    const { light } = layer;
    const { name } = light;
    const id = `layer-${light.index}`;
    this.middle = model.middle(layer);

    this.kind = el("span.kind", { title: (kindNames[light.kind] ?? light.kind) + (light.mixed ? ", direct part in real time" : "") }, icon(light.kind));
    this.solo = el("button.toggle", { type: "button", title: "Solo: only this", "aria-label": `Solo ${name}`, onclick: () => model.setSolo([layer], !light.solo) }, "S");
    this.mute = el("button.toggle.mute", { type: "button", title: "Mute: off", "aria-label": `Mute ${name}`, onclick: () => model.setMuted([layer], !light.muted) }, "M");
    this.more = iconButton("more", `Animation of ${name}`, () => this.open(this.extra.hidden), ".chevron");
    this.more.setAttribute("aria-controls", `${id}-extra`);
    this.color = el("input.swatch", {
      type: "color", "aria-label": `Colour of ${name}`, title: "Colour",
      oninput: () => model.setColor(layer, new Color(this.color.value)),
    });
    this.slider = el("input.slider", {
      type: "range", min: 0, max: steps, step: 1, "aria-label": `Intensity of ${name}`, title: "Intensity; double click: as authored",
      oninput: () => model.setIntensity(layer, this.#snapped(this.slider.value / steps)),
      ondblclick: () => model.setIntensity(layer, light.authored.intensity),
    });
    this.number = el("input.number", {
      type: "number", min: 0, step: "any", inputMode: "decimal", "aria-label": `Intensity of ${name} in ${unitName(light.unit)}`,
      onchange: () => this.number.value !== "" && model.setIntensity(layer, Number(this.number.value)),
    });
    this.reset = iconButton("reset", `Reset ${name} to as authored`, () => model.reset(layer), ".reset");

    const kinds = animationKinds.map(([value, text]) => el("option", { value }, text));
    if (model.animated.has(light.index)) kinds.splice(1, 0, el("option", { value: "file" }, "As in the file"));
    this.animation = el("select", { "aria-label": `Animation of ${name}`, onchange: () => model.setAnimation(layer, this.animation.value) }, ...kinds);
    this.period = el("input.number", {
      type: "number", min: 0.02, max: 3600, step: "any", "aria-label": "Period in seconds",
      onchange: () => this.period.value > 0 && model.setAnimation(layer, layer.animation, Math.min(3600, Math.max(0.02, Number(this.period.value)))),
    });
    this.periodBox = el("label.period", {}, "every", this.period, "s");
    this.extra = el("div.row-extra", { id: `${id}-extra`, hidden: true }, this.animation, this.periodBox);

    this.root = el("li.row", { id },
      el("div.row-head", {}, this.kind, el("span.row-name", { title: name }, name), this.reset, this.solo, this.mute, this.more),
      el("div.row-body", {}, this.color, this.slider, el("span.value", {}, this.number, el("span.unit", {}, unitName(light.unit)))),
      this.extra);
    this.open(layer.animation !== "none" && layer.animation !== "file");
    this.update();
  }

  // The middle of the slider is the authored value exactly.
  #snapped(position) {
    const { authored } = this.layer.light;
    return Math.abs(position - 0.5) < 0.006 && authored.intensity > 0 ? authored.intensity : intensityOf(position, this.middle);
  }

  open(open) {
    this.extra.hidden = !open;
    this.more.setAttribute("aria-expanded", open);
  }

  update() {
    const { model, layer } = this;
    const { light } = layer;
    const program = layer.animation !== "none" && layer.animation !== "file";
    const text = shortNumber(layer.intensity);
    this.color.value = hexOf(layer.color);
    this.slider.value = Math.round(sliderOf(layer.intensity, this.middle) * steps);
    this.slider.setAttribute("aria-valuetext", `${text} ${unitName(light.unit)}`);
    if (document.activeElement !== this.number) this.number.value = text;
    this.solo.setAttribute("aria-pressed", light.solo);
    this.mute.setAttribute("aria-pressed", light.muted);
    this.animation.value = layer.animation;
    this.periodBox.hidden = !program;
    if (document.activeElement !== this.period) this.period.value = layer.period;
    this.reset.classList.toggle("idle", !model.isChanged(layer));
    this.reset.disabled = !model.isChanged(layer);
    this.root.classList.toggle("dark", light.muted || (model.room.lights.some((each) => each.solo) && !light.solo));
    this.glow();
  }

  /** The icon shines in the colour of now. */
  glow() {
    const { color, intensity } = this.layer.light;
    const share = intensity > 0 ? Math.min(1, 0.35 + (0.65 * intensity) / this.middle) : 0.15;
    const hex = `${hexOf(color)}${Math.round(share * 255).toString(16).padStart(2, "0")}`;
    if (hex === this.shown) return;
    this.shown = hex;
    this.kind.style.color = hex;
  }

  matches(words) {
    const text = `${this.layer.light.name} ${this.layer.light.kind}`.toLowerCase();
    return words.every((word) => text.includes(word));
  }
}

export class LayerList {
  constructor(model, monitors) {
    this.model = model;
    this.rows = [];
    this.list = el("ul.rows", { "aria-label": "Layers" });
    this.none = el("p.none", { hidden: true }, "No layer has that name.");
    this.groups = monitors;
    for (const group of monitors) this.list.append(group.root);
    for (const layer of model.layers) {
      if (layer.light.monitor) continue;
      const row = new LayerRow(model, layer);
      this.rows.push(row);
      this.list.append(row.root);
    }
    this.filter = el("input.filter", {
      type: "search", placeholder: `Filter ${this.rows.length + monitors.length} lights`, "aria-label": "Filter lights by name", oninput: () => this.#filter(),
    });
    this.play = el("button.button", { type: "button", onclick: () => model.play(!model.playing) });
    this.root = el("div.layers", {},
      el("div.bar", {}, this.filter),
      el("div.bar", {},
        el("button.button", { type: "button", title: "Mute every light; colours are kept", onclick: () => model.allOff() }, "All off"),
        el("button.button", { type: "button", title: "Every light as authored", onclick: () => {
          for (const group of monitors) group.clear();
          model.resetAll();
        } }, "Authored"),
        model.room.animations.length ? this.play : null),
      this.list, this.none);
    model.onchange((layer) => this.update(layer));
    this.update();
  }

  update(layer = null) {
    // Solo of one darkens the others.
    const solo = this.model.room.lights.filter((light) => light.solo).length;
    const all = layer === null || solo !== this.solo;
    this.solo = solo;
    for (const row of this.rows) if (all || row.layer === layer) row.update();
    for (const group of this.groups) group.update();
    this.play.textContent = this.model.playing ? "Stop" : "Play";
    this.play.title = this.model.playing ? "Stop the animations of the file: lights as authored" : "Run the animations of the file";
    this.play.setAttribute("aria-pressed", this.model.playing);
  }

  glow() {
    for (const row of this.rows) row.glow();
  }

  #filter() {
    const words = this.filter.value.toLowerCase().split(/\s+/).filter(Boolean);
    let shown = 0;
    for (const item of [...this.rows, ...this.groups]) {
      const match = item.matches(words);
      item.root.hidden = !match;
      shown += match;
    }
    this.none.hidden = shown > 0;
  }
}

export { LayerRow };
