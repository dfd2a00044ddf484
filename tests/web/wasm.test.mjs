// luxel_rt.wasm as a page sees it, before any pack: what it asks for and what it offers.
import assert from "node:assert/strict";
import { readFileSync } from "node:fs";
import test from "node:test";

const wasm = process.env.LUXEL_WASM;
const header = new URL("../../runtime/include/luxel_rt.h", import.meta.url);
const options = wasm ? {} : { skip: "LUXEL_WASM is not set" };

const load = () => new WebAssembly.Module(readFileSync(wasm));

test("the module imports nothing", options, () => {
  assert.deepEqual(WebAssembly.Module.imports(load()), []);
});

test("what it exports beside the interface is memory, its heap, malloc and free", options, () => {
  const others = WebAssembly.Module.exports(load()).filter(({ name }) => !name.startsWith("lxrt_"));
  assert.deepEqual(others.map(({ kind, name }) => `${kind} ${name}`).sort(),
                   ["function free", "function malloc", "global __heap_base", "memory memory"]);
});

test("no export is missing from the header", options, () => {
  const declared = new Set([...readFileSync(header, "utf8").matchAll(/^LXRT_API [^(]*?\*?(lxrt_\w+)\(/gm)].map((m) => m[1]));
  for (const { name } of WebAssembly.Module.exports(load()))
    if (name.startsWith("lxrt_")) assert.ok(declared.has(name), name);
});

test("memory grows, and bytes that are no pack are refused", options, () => {
  const { memory, malloc, free, lxrt_memory_bytes } = new WebAssembly.Instance(load()).exports;
  const data = malloc(1 << 20), out = malloc(4);
  assert.ok(memory.buffer.byteLength > 1 << 20);
  new Uint8Array(memory.buffer).fill(0, data, data + 100);
  assert.equal(lxrt_memory_bytes(data, 100, out), 3, "LXRT_ERROR_NOT_A_PACK");
  free(out);
  free(data);
});
