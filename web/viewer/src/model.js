// What the panel changes: per layer its colour, intensity, mute, solo and what animates it. The room does as it is told here; links
// are written from here.
import { Color } from "three";

/** Periods that suit, seconds. */
export const animationKinds = [
  ["none", "Still"],
  ["blink", "Blink"],
  ["flicker", "Flicker"],
  ["pulse", "Pulse"],
  ["wheel", "Colour wheel"],
];
const periods = { blink: 1, flicker: 0.12, pulse: 3, wheel: 6 };

export class Model {
  constructor(room) {
    this.room = room;
    this.animated = new Set(room.animations.map((animation) => animation.layer));
    this.layers = room.lights.map((light) => ({
      light,
      color: light.authored.color.clone(),
      intensity: light.authored.intensity,
      animation: this.animated.has(light.index) ? "file" : "none",
      period: 1,
      media: false, // a picture or a video says what this cell shows
    }));
    this.playing = false;
    this.listeners = new Set();
  }

  onchange(listener) {
    this.listeners.add(listener);
  }

  /** Something about a layer changed; null: about all. */
  changed(layer = null) {
    for (const listener of this.listeners) listener(layer);
  }

  /** Middle of the intensity slider: as authored; a layer that was off gets what others of its unit have. */
  middle(layer) {
    const { authored, unit } = layer.light;
    if (authored.intensity > 0) return authored.intensity;
    const others = this.room.lights.filter((light) => light.unit === unit && light.authored.intensity > 0);
    const sorted = others.map((light) => light.authored.intensity).sort((a, b) => a - b);
    return sorted.length ? sorted[sorted.length >> 1] : 1;
  }

  isChanged(layer) {
    const { light } = layer;
    return (
      !layer.color.equals(light.authored.color) || layer.intensity !== light.authored.intensity || light.muted || light.solo ||
      layer.animation !== this.ownAnimation(layer)
    );
  }

  ownAnimation(layer) {
    return this.animated.has(layer.light.index) ? "file" : "none";
  }

  setColor(layer, color) {
    layer.color.copy(color);
    if (layer.animation === "file") layer.animation = "none"; // who picks a colour wants to see it
    this.#apply(layer);
    this.changed(layer);
  }

  setIntensity(layer, intensity) {
    layer.intensity = Math.min(1e12, Math.max(0, intensity));
    if (layer.animation === "file") layer.animation = "none";
    this.#apply(layer);
    this.changed(layer);
  }

  setAnimation(layer, kind, period = periods[kind] ?? 1) {
    layer.animation = kind;
    layer.period = period;
    this.#apply(layer);
    this.changed(layer);
  }

  setMuted(layers, muted) {
    for (const layer of layers) layer.light.muted = muted;
    this.changed(layers.length === 1 ? layers[0] : null);
  }

  setSolo(layers, solo) {
    for (const layer of layers) layer.light.solo = solo;
    this.changed(layers.length === 1 ? layers[0] : null);
  }

  reset(layer) {
    layer.color.copy(layer.light.authored.color);
    layer.intensity = layer.light.authored.intensity;
    layer.light.muted = layer.light.solo = false;
    layer.animation = this.ownAnimation(layer);
    this.#apply(layer);
    this.changed(layer);
  }

  resetAll() {
    const listeners = this.listeners;
    this.listeners = new Set();
    for (const layer of this.layers) if (!layer.media && this.isChanged(layer)) this.reset(layer);
    this.listeners = listeners;
    this.changed();
  }

  /** Mutes every layer: colours are kept. */
  allOff() {
    for (const { light } of this.layers) {
      light.muted = true;
      light.solo = false;
    }
    this.changed();
  }

  /** Lets the animations of the file run, or shows what they drive as authored. */
  play(on) {
    this.playing = on;
    if (on) this.room.play();
    else this.room.stop();
    for (const layer of this.layers) if (layer.animation === "file" && !layer.media) this.#apply(layer);
    this.changed();
  }

  /** True while frames have to follow each other. */
  isMoving() {
    if (this.playing && this.room.animations.length > 0) return true;
    return this.layers.some((layer) => layer.animation !== "none" && layer.animation !== "file");
  }

  #apply(layer) {
    const { room } = this;
    const { index, authored } = layer.light;
    const still = layer.animation === "none";
    const asAuthored = still && this.ownAnimation(layer) === "none" && layer.color.equals(authored.color) && layer.intensity === authored.intensity;
    if (layer.animation === "file" || asAuthored) {
      room.resetLight(index); // to the file's animation where there is one
      return;
    }
    if (still) {
      room.setProgram(index, null);
      room.setLight(index, layer.color, layer.intensity);
      return;
    }
    room.setProgram(index, {
      kind: layer.animation,
      color: layer.animation === "wheel" ? vivid(layer.color) : layer.color,
      intensity: layer.intensity,
      period: layer.period,
      low: layer.animation === "flicker" ? 0.35 : 0,
      high: 1,
      seed: index,
    });
  }
}

// A wheel turns the hue, and white has none.
function vivid(color) {
  const hsl = color.getHSL({});
  return hsl.s > 0.3 ? color : new Color(1, 0.04, 0.04);
}
