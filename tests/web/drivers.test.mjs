// Programs, animations and monitors in luxel_rt.wasm against the native runtime, bit by bit: driven_pack has taken the same steps.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";

const wasm = process.env.LUXEL_WASM, folder = process.env.LUXEL_DRIVEN;
const options = wasm && folder ? {} : { skip: "LUXEL_WASM and LUXEL_DRIVEN are not set" };
const LAYERS = 51, WIDTH = 101, HEIGHT = 67, STEPS = 400; // as driven_pack.c has them

test("colours of programs and monitors are the native runtime's to the last bit", options, () => {
  const rt = new WebAssembly.Instance(new WebAssembly.Module(readFileSync(wasm))).exports;
  const put = (name) => {
    const bytes = readFileSync(join(folder, name)), at = rt.malloc(bytes.length);
    new Uint8Array(rt.memory.buffer, at, bytes.length).set(bytes);
    return { at, size: bytes.length };
  };
  const word = (at) => new DataView(rt.memory.buffer).getUint32(at, true);
  const fine = (result) => assert.equal(result, 0);

  const data = put("drivers.pack"), frame = put("frame.rgba"), floats = put("frame.float"), out = rt.malloc(12);
  fine(rt.lxrt_memory_bytes(data.at, data.size, out));
  const bytes = word(out);
  fine(rt.lxrt_open(data.at, data.size, rt.malloc(bytes), bytes, out));
  const pack = word(out);
  const steps = [
    ...Array.from({ length: STEPS }, (_, step) => () => rt.lxrt_update(pack, step * 0.171 - 20)),
    () => fine(rt.lxrt_monitor_update(pack, 0, frame.at, WIDTH, HEIGHT, 0, 0)),
    () => fine(rt.lxrt_monitor_update(pack, 0, frame.at, WIDTH, HEIGHT, 0, 1)),
    () => fine(rt.lxrt_monitor_update(pack, 1, floats.at, WIDTH, HEIGHT, 0, 2)),
    () => {
      fine(rt.lxrt_monitor_configure(pack, 0, 0, Math.fround(0.7)));
      fine(rt.lxrt_monitor_update(pack, 0, floats.at, WIDTH, HEIGHT, 0, 2));
    },
  ];
  const want = readFileSync(join(folder, "colors.bin"));
  assert.equal(want.length, steps.length * LAYERS * 12);
  const distinct = new Set();
  steps.forEach((take, step) => {
    take();
    for (let layer = 0; layer < LAYERS; layer++) {
      fine(rt.lxrt_get_layer(pack, layer, out));
      for (let channel = 0; channel < 3; channel++) {
        const bits = word(out + 4 * channel);
        distinct.add(bits);
        assert.equal(bits, want.readUInt32LE(12 * (step * LAYERS + layer) + 4 * channel), `step ${step}, layer ${layer}, channel ${channel}`);
      }
    }
  });
  assert.ok(distinct.size > 5000, `only ${distinct.size} different numbers were compared`);
});
