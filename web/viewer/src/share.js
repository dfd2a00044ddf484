// The state in the address: what is behind the # brings back camera, picture and every light that was changed.
import { Color } from "three";
import { hexOf } from "./units.js";

const round = (x) => Number(x.toPrecision(6));

/** "cam=…&ev=…&light=name~hex~intensity~flags~animation~period". Empty when all is as authored. */
export function writeState(stage, model) {
  const state = new URLSearchParams();
  const { controls, room } = stage;
  if (controls.taken) state.set("cam", controls.pose().map(round).join(","));
  if (controls.mode !== "orbit") state.set("move", controls.mode);
  if (stage.view !== "lit") state.set("view", stage.view);
  if (stage.ev !== room.ev) state.set("ev", round(stage.ev));
  if (!stage.toneMapped) state.set("tone", "0");
  for (const layer of model.layers) {
    if (layer.media || !model.isChanged(layer)) continue;
    const { name, muted, solo } = layer.light;
    const flags = `${muted ? "m" : ""}${solo ? "s" : ""}` || "-";
    state.append("light", [name, hexOf(layer.color).slice(1), round(layer.intensity), flags, layer.animation, round(layer.period)].join("~"));
  }
  return state.toString();
}

/** Does as a link says, as far as it makes sense for this room. */
export function readState(text, stage, model) {
  const state = new URLSearchParams(text.replace(/^#/, ""));
  const numbers = (state.get("cam") ?? "").split(",").map(Number);
  if (state.get("move") === "walk") stage.controls.setMode("walk");
  if (numbers.length === 5 && numbers.every(Number.isFinite)) {
    stage.controls.setPose(numbers);
    stage.controls.taken = true;
  }
  if (["lit", "lightmap", "albedo"].includes(state.get("view"))) stage.setView(state.get("view"));
  const ev = Number(state.get("ev") ?? NaN);
  if (Number.isFinite(ev)) stage.setExposure(Math.min(60, Math.max(-60, ev)));
  if (state.get("tone") === "0") stage.setToneMapped(false);
  for (const entry of state.getAll("light")) {
    const parts = entry.split("~");
    if (parts.length < 6) continue;
    const [hex, intensity, flags, animation, period] = parts.slice(-5);
    const name = parts.slice(0, -5).join("~"); // names may hold anything
    const layer = model.layers.find(({ light }) => light.name === name);
    if (!layer || !/^[0-9a-f]{6}$/i.test(hex) || !(Number(intensity) >= 0 && Number(intensity) < 1e9)) continue;
    // A colour that was not changed keeps the digits that six hexadecimal ones can't hold.
    if (hexOf(layer.color).slice(1) !== hex) model.setColor(layer, new Color(`#${hex}`));
    if (round(layer.intensity) !== Number(intensity)) model.setIntensity(layer, Number(intensity));
    if (flags.includes("m")) model.setMuted([layer], true);
    if (flags.includes("s")) model.setSolo([layer], true);
    const kinds = ["none", "blink", "flicker", "pulse", "wheel"];
    if (kinds.includes(animation) && animation !== layer.animation) model.setAnimation(layer, animation, Number(period) > 0 ? Math.min(3600, Math.max(0.02, Number(period))) : undefined);
  }
}
