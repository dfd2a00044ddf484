// luxel_rt.wasm against the native runtime, byte by byte: one list of steps, taken by both on the same pack of noise.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import test from "node:test";

const wasm = process.env.LUXEL_WASM, native = process.env.LUXEL_COMPOSE_STEPS;
const options = wasm && native ? {} : { skip: "LUXEL_WASM and LUXEL_COMPOSE_STEPS are not set" };
const SIZE = 100, PAGES = 2, LEVELS = 3, LAYERS = 13; // as compose_steps.c has them
const BYTES = [12, 8, 4]; // a texel of each format

let state = 7;
const random = (limit) => {
  state = (Math.imul(state, 1664525) + 1013904223) >>> 0;
  return Math.floor((state / 2 ** 32) * limit);
};
const bits = (value) => new Uint32Array(new Float32Array([value]).buffer)[0];

function steps() {
  const list = [];
  const layer = () => list.push(["layer", random(LAYERS), bits(random(1000) / 100), bits(random(3)), bits(random(1000) / 1000 - 0.1)]);
  for (let round = 0; round < 6; round++) {
    if (round === 3) for (let i = 0; i < LAYERS; i++) list.push(["layer", i, 0, 0, 0]);
    if (round === 4) for (let i = 0; i < LAYERS; i++) list.push(["layer", i, bits(1e24), bits(-1e24), bits(1e-38)]);
    if (round !== 3) for (let i = 0; i < round; i++) layer();
    for (let format = 0; format < 3; format++) {
      for (let page = 0; page < PAGES; page++) {
        for (let level = 0; level < LEVELS; level++) {
          const edge = SIZE >> level, x = random(edge), y = random(edge);
          list.push(["compose", page, level, 0, 0, edge, edge, format, bits(1)]);
          list.push(["compose", page, level, x, y, 1 + random(edge - x), 1 + random(edge - y), format, bits(2 ** -random(9) * 1.7)]);
        }
      }
    }
    for (let i = 0; i < 200; i++) list.push(["sample", random(PAGES), bits(random(1200) / 1000 - 0.1), bits(random(1200) / 1000 - 0.1), i % 2]);
  }
  for (let frame = 0; frame < 140; frame++) { // two rounds of 64 and some
    if (frame % 7) layer();
    list.push(["begin"]);
    for (let level = 0; level < LEVELS; level++) list.push(["update", level, frame % 3]);
  }
  return list;
}

function take(list, pack, want) {
  const rt = new WebAssembly.Instance(new WebAssembly.Module(readFileSync(wasm))).exports;
  const words = (at, count) => new Uint32Array(rt.memory.buffer, at, count);
  const fine = (result) => assert.equal(result, 0);
  const data = rt.malloc(pack.length), out = rt.malloc(64), region = rt.malloc(24), target = rt.malloc(16), texels = rt.malloc(12 * SIZE * SIZE);
  new Uint8Array(rt.memory.buffer, data, pack.length).set(pack);
  fine(rt.lxrt_memory_bytes(data, pack.length, out));
  const needed = words(out, 1)[0];
  fine(rt.lxrt_open(data, pack.length, rt.malloc(needed), needed, out));
  const handle = words(out, 1)[0];
  const accumulatorBytes = rt.lxrt_accumulator_bytes(handle);
  fine(rt.lxrt_accumulator_create(handle, 1, rt.malloc(accumulatorBytes), accumulatorBytes, out));
  const accumulator = words(out, 1)[0];

  let at = 0;
  const compare = (address, length, step) => {
    const got = Buffer.from(rt.memory.buffer, address, length);
    if (got.compare(want, at, at + length) !== 0) {
      const byte = got.findIndex((value, i) => value !== want[at + i]);
      assert.fail(`${step.join(" ")}: byte ${byte} of ${length} is ${got[byte]}, natively ${want[at + byte]}`);
    }
    at += length;
  };
  const aim = (format, scale) => words(target, 4).set([texels, 0, format, scale]);
  for (const step of list) {
    const [name, ...n] = step;
    if (name === "layer") {
      words(out, 3).set(n.slice(1));
      fine(rt.lxrt_set_layer(handle, n[0], out, 1));
    } else if (name === "compose") {
      words(region, 6).set(n.slice(0, 6));
      aim(n[6], n[7]);
      fine(rt.lxrt_compose(handle, region, target));
      compare(texels, n[4] * n[5] * BYTES[n[6]], step);
    } else if (name === "begin") {
      words(out, 1)[0] = rt.lxrt_accumulator_begin(accumulator);
      compare(out, 4, step);
    } else if (name === "update") {
      fine(rt.lxrt_accumulator_bounds(accumulator, n[0], region));
      compare(region, 24, step);
      aim(n[1], bits(1));
      const length = words(region, 6)[4] * words(region, 6)[5] * BYTES[n[1]];
      new Uint8Array(rt.memory.buffer, texels, length).fill(0); // what is skipped is black on both sides
      fine(rt.lxrt_accumulator_update(accumulator, region, target));
      compare(texels, length, step);
    } else {
      const [u, v] = new Float32Array(new Uint32Array([n[1], n[2]]).buffer);
      fine(rt.lxrt_lightmap_sample(handle, n[0], u, v, n[3], out));
      compare(out, 12, step);
    }
  }
  assert.equal(at, want.length, "both wrote as much");
}

test("compose, accumulators and samples are the native runtime's to the last bit", options, () => {
  const folder = mkdtempSync(join(tmpdir(), "luxel-"));
  try {
    const list = steps(), pack = join(folder, "noise.pack"), out = join(folder, "out.bin");
    execFileSync(native, [pack, out], { input: list.map((step) => step.join(" ") + "\n").join("") });
    const want = readFileSync(out);
    assert.ok(want.length > 5e6, `only ${want.length} bytes to compare`);
    assert.ok(want.some((byte) => byte !== 0));
    take(list, readFileSync(pack), want);
  } finally {
    rmSync(folder, { recursive: true });
  }
});
