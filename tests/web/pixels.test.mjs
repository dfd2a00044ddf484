// The same texels in three formats, each read by somebody else's code: EXR and Radiance HDR by three.js, KTX2 by ktx-parse
// and zstddec.
import assert from "node:assert/strict";
import { execFileSync, spawnSync } from "node:child_process";
import test from "node:test";
import { read } from "ktx-parse";
import { bakedFile, bakedPath, decodeRgb9e5, filesOf, manifest, needsBaked } from "./baked.mjs";

function arrayBuffer(bytes) {
  return bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength);
}

// RGB from the top row on. three.js hands EXR out from the bottom row on, with alpha added.
async function readExr(file) {
  const { EXRLoader } = await import("three/examples/jsm/loaders/EXRLoader.js");
  const { FloatType } = await import("three");
  const { width, height, data } = new EXRLoader().setDataType(FloatType).parse(arrayBuffer(bakedFile(file)));
  const rgb = new Float32Array(width * height * 3);
  for (let y = 0; y < height; y++)
    for (let x = 0; x < width; x++)
      for (let c = 0; c < 3; c++) rgb[3 * (y * width + x) + c] = data[4 * ((height - 1 - y) * width + x) + c];
  return { width, height, rgb };
}

// three.js takes a mantissa for 255ths where the format, after Ward, has 256ths.
async function readHdr(file) {
  const { RGBELoader } = await import("three/examples/jsm/loaders/RGBELoader.js");
  const { FloatType } = await import("three");
  const { width, height, data } = new RGBELoader().setDataType(FloatType).parse(arrayBuffer(bakedFile(file)));
  return { width, height, rgb: data.filter((_, i) => i % 4 !== 3).map((value) => (value * 255) / 256) };
}

async function readKtx2(file) {
  const { ZSTDDecoder } = await import("three/examples/jsm/libs/zstddec.module.js");
  const decoder = new ZSTDDecoder();
  await decoder.init();
  const texture = read(bakedFile(file));
  const { levelData, uncompressedByteLength } = texture.levels[0];
  const bytes = decoder.decode(levelData, uncompressedByteLength);
  const texels = texture.pixelWidth * texture.pixelHeight;
  return Array.from({ length: texture.layerCount }, (_, slice) => ({
    width: texture.pixelWidth,
    height: texture.pixelHeight,
    rgb: decodeRgb9e5(new Uint32Array(bytes.buffer, bytes.byteOffset + slice * texels * 4, texels)),
  }));
}

// Every format shares one exponent between the channels of a texel: the error is relative to the largest channel.
function assertSame(a, b, relative, scale, what) {
  assert.equal(a.width, b.width, what);
  assert.equal(a.height, b.height, what);
  for (let i = 0; i < a.rgb.length; i += 3) {
    const largest = Math.max(a.rgb[i], a.rgb[i + 1], a.rgb[i + 2]);
    const tolerance = relative * largest + 2 ** -24 * scale;
    for (let c = 0; c < 3; c++) {
      const difference = Math.abs(a.rgb[i + c] - b.rgb[i + c] * scale);
      assert.ok(difference <= tolerance, `${what}: texel ${i / 3}: ${a.rgb[i + c]} and ${b.rgb[i + c] * scale}`);
    }
  }
}

test("the pages hold light", needsBaked, async () => {
  for (const { file } of filesOf("exr")) {
    const { rgb } = await readExr(file);
    assert.ok(rgb.every((value) => Number.isFinite(value) && value >= 0), file);
    assert.ok(rgb.some((value) => value > 0), `${file} is black`);
  }
});

// Eight bits of mantissa, rounded: half of one of at least 128 steps, or of 127.75 where the largest was rounded up to the next power.
test("exr and hdr hold the same texels", needsBaked, async () => {
  const hdr = filesOf("hdr");
  for (const { page, layer, file } of filesOf("exr")) {
    const other = hdr.find((candidate) => candidate.page === page && candidate.layer === layer);
    assertSame(await readExr(file), await readHdr(other.file), 1 / 255, 1, `${file} and ${other.file}`);
  }
});

// Nine bits of mantissa, rounded.
test("exr and ktx2 hold the same texels, layer by layer", needsBaked, async () => {
  const { layers } = manifest();
  const exr = filesOf("exr");
  for (const { page, layer, file } of filesOf("ktx2")) {
    const slices = await readKtx2(file);
    for (const [slice, texels] of slices.entries()) {
      const other = exr.find((candidate) => candidate.page === page && candidate.layer === layer + slice);
      const scale = layers[layer + slice].scale ?? 1;
      assertSame(await readExr(other.file), texels, 2 ** -8, scale, `${other.file} and ${file} slice ${slice}`);
    }
  }
});

// What exrinfo says in strict mode. Its exit code is of no use: that of OpenEXR 3.1.5 is a random number for good files too.
function exrinfo(path) {
  const { stdout, stderr, error, signal } = spawnSync("exrinfo", ["-s", path], { encoding: "utf8" });
  assert.ifError(error);
  assert.equal(signal, null);
  assert.equal(stderr, "");
  return stdout;
}

test("openexr's own tools read the pages", needsBaked, () => {
  const { atlas } = manifest();
  for (const { page, file } of filesOf("exr")) {
    const edge = atlas.pages[page].width;
    const info = exrinfo(bakedPath(file));
    assert.match(info, /compression: 'zip'/, file);
    const header = execFileSync("exrheader", [bakedPath(file)], { encoding: "utf8" });
    assert.match(header, new RegExp(`dataWindow.*\\(0 0\\) - \\(${edge - 1} ${edge - 1}\\)`), file);
    for (const channel of ["R", "G", "B"]) assert.match(header, new RegExp(`^ +${channel}, 32-bit floating-point`, "m"), file);
  }
});
