import assert from "node:assert/strict";
import test from "node:test";
import { KHR_SUPERCOMPRESSION_ZSTD, VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, read } from "ktx-parse";
import { bakedFile, filesOf, manifest, needsBaked } from "./baked.mjs";

test("ktx-parse reads the lightmap arrays", needsBaked, () => {
  const { atlas, layers } = manifest();
  const files = filesOf("ktx2");
  for (const { page, layer, file } of files) {
    const texture = read(bakedFile(file));
    const size = atlas.pages[page].width;
    const next = files.filter((other) => other.page === page && other.layer > layer).map((other) => other.layer);
    const slices = Math.min(...next, layers.length) - layer;
    assert.equal(texture.vkFormat, VK_FORMAT_E5B9G9R9_UFLOAT_PACK32, file);
    assert.equal(texture.supercompressionScheme, KHR_SUPERCOMPRESSION_ZSTD, file);
    assert.equal(texture.pixelWidth, size, file);
    assert.equal(texture.pixelHeight, size, file);
    assert.equal(texture.pixelDepth, 0, file);
    assert.equal(texture.faceCount, 1, file);
    assert.equal(texture.layerCount, slices, file);
    assert.ok(slices <= 64, `${file} has ${slices} slices`);
    assert.match(String(texture.keyValue.KTXwriter), /^luxel \d+\.\d+\.\d+/);
  }
});

test("the levels of a lightmap array have the sizes that mip levels have", needsBaked, () => {
  for (const { file } of filesOf("ktx2")) {
    const texture = read(bakedFile(file));
    assert.ok(texture.levels.length >= 1);
    texture.levels.forEach((level, k) => {
      const edge = Math.max(1, texture.pixelWidth >> k);
      assert.equal(level.uncompressedByteLength, edge * edge * 4 * texture.layerCount, `${file} level ${k}`);
      assert.equal(level.levelData.byteLength > 0, true);
    });
  }
});

test("a lightmap array's data format descriptor speaks of shared exponents", needsBaked, () => {
  for (const { file } of filesOf("ktx2")) {
    const [descriptor] = read(bakedFile(file)).dataFormatDescriptor;
    assert.equal(descriptor.transferFunction, 1, `${file}: linear`);
    assert.equal(descriptor.colorPrimaries, 1, `${file}: BT.709`);
    assert.equal(descriptor.samples.length, 6, `${file}: three mantissas, each with the exponent`);
  }
});
