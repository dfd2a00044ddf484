import assert from "node:assert/strict";
import test from "node:test";
import { bakedPath, manifest, needsBaked } from "./baked.mjs";
import { validate } from "./validate.mjs";

test("the khronos validator finds no error in scene.glb", needsBaked, async () => {
  const { errors, report } = await validate(bakedPath(manifest().scene));
  assert.deepEqual(errors, []);
  assert.ok(report.info.totalTriangleCount > 0);
});
