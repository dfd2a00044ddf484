// What the tests share: the baked folder to look at, its manifest and its files.
// LUXEL_BAKED names the folder; CTest sets it to one it has just baked. By hand:
//   LUXEL_BAKED=room.baked node --test
import { readFileSync } from "node:fs";
import { join } from "node:path";

const folder = process.env.LUXEL_BAKED;

/** Goes into the options of test(): skips with a reason when there is no folder to look at. */
export const needsBaked = folder ? {} : { skip: "LUXEL_BAKED does not name a baked folder" };

export function bakedPath(name) {
  return join(folder, name);
}

export function bakedFile(name) {
  return new Uint8Array(readFileSync(bakedPath(name)));
}

export function manifest() {
  return JSON.parse(readFileSync(bakedPath("luxel.json"), "utf8"));
}

/** The manifest's files of one format; fails if there are none, so that a test cannot pass by looking at nothing. */
export function filesOf(format) {
  const files = manifest().files.filter((file) => file.format === format);
  if (files.length === 0) throw new Error(`the manifest names no ${format} file`);
  return files;
}

/** One layer of a KTX2 level 0, decoded by hand: 3 numbers a texel. */
export function decodeRgb9e5(words) {
  const rgb = new Float32Array(words.length * 3);
  words.forEach((word, texel) => {
    const scale = 2 ** ((word >>> 27) - 15 - 9);
    for (let channel = 0; channel < 3; channel++) rgb[3 * texel + channel] = ((word >>> (9 * channel)) & 511) * scale;
  });
  return rgb;
}
