// scene.glb in three.js. Node has no pictures and no DOM: what GLTFLoader asks for of these is replaced by the least that works.
import assert from "node:assert/strict";
import test from "node:test";
import { bakedFile, manifest, needsBaked } from "./baked.mjs";

globalThis.self ??= globalThis;
globalThis.createImageBitmap ??= async () => ({ width: 1, height: 1, close() {} });

async function load(bytes) {
  const { GLTFLoader } = await import("three/examples/jsm/loaders/GLTFLoader.js");
  return new GLTFLoader().parseAsync(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength), "");
}

function objectsOf(gltf, condition) {
  const found = [];
  gltf.scene.traverse((object) => condition(object) && found.push(object));
  return found;
}

// Mesh primitives are children of their node when there are several.
function meshesOf(node) {
  const meshes = [];
  node.traverse((object) => object.isMesh && meshes.push(object));
  return meshes;
}

// three.js calls TEXCOORD_0 `uv` and TEXCOORD_n `uvN`.
function coordinatesOf(mesh, texCoord) {
  return mesh.geometry.getAttribute(texCoord === 0 ? "uv" : `uv${texCoord}`);
}

test("three loads scene.glb with a lightmap rectangle on every lit node", needsBaked, async () => {
  const gltf = await load(bakedFile(manifest().scene));
  const lit = objectsOf(gltf, (object) => object.userData.luxel_lightmap && "page" in object.userData.luxel_lightmap);
  assert.ok(lit.length > 0, "no node has userData.luxel_lightmap");
  for (const node of lit) {
    const { page, texCoord, scale, offset } = node.userData.luxel_lightmap;
    assert.ok(Number.isInteger(page) && page >= 0 && page < manifest().atlas.pages.length, `${node.name}: page ${page}`);
    assert.ok(Number.isInteger(texCoord) && texCoord >= 0, `${node.name}: texCoord ${texCoord}`);
    for (const numbers of [scale, offset]) {
      assert.equal(numbers.length, 2);
      assert.ok(numbers.every((n) => Number.isFinite(n) && n >= 0 && n <= 1), `${node.name}: ${numbers}`);
    }
  }
});

test("lightmap coordinates stay inside of their rectangles", needsBaked, async () => {
  const gltf = await load(bakedFile(manifest().scene));
  let checked = 0;
  for (const node of objectsOf(gltf, (object) => object.userData.luxel_lightmap)) {
    for (const mesh of meshesOf(node)) {
      const uv = coordinatesOf(mesh, node.userData.luxel_lightmap.texCoord);
      if (!uv) continue; // a primitive that takes no light
      for (let i = 0; i < uv.count; i++) {
        assert.ok(uv.getX(i) >= 0 && uv.getX(i) <= 1 && uv.getY(i) >= 0 && uv.getY(i) <= 1, `${mesh.name} vertex ${i}`);
      }
      checked += uv.count;
    }
  }
  assert.ok(checked > 0);
});

test("instances carry a rectangle and a page each", needsBaked, async () => {
  const gltf = await load(bakedFile(manifest().scene));
  const instanced = objectsOf(gltf, (object) => object.isInstancedMesh);
  assert.ok(instanced.length > 0, "the test scene has instances");
  for (const mesh of instanced) {
    const rects = mesh.geometry.getAttribute("_luxel_rect") ?? mesh.geometry.getAttribute("_LUXEL_RECT");
    const pages = mesh.geometry.getAttribute("_luxel_page") ?? mesh.geometry.getAttribute("_LUXEL_PAGE");
    assert.equal(rects.count, mesh.count);
    assert.equal(rects.itemSize, 4);
    assert.equal(pages.count, mesh.count);
    for (let i = 0; i < mesh.count; i++) {
      assert.ok(pages.getX(i) >= 0 && pages.getX(i) < manifest().atlas.pages.length, `page ${pages.getX(i)}`);
      assert.ok(rects.getX(i) > 0 && rects.getZ(i) >= 0 && rects.getX(i) + rects.getZ(i) <= 1, `instance ${i}`);
    }
    assert.ok(Number.isInteger(mesh.userData.luxel_lightmap.texCoord));
  }
});

test("lights and materials that were baked say so", needsBaked, async () => {
  const gltf = await load(bakedFile(manifest().scene));
  const marked = objectsOf(gltf, (object) => object.userData.luxel_baked === true);
  assert.ok(marked.some((node) => node.isLight || node.children.some((child) => child.isLight)), "no light is marked");
  const materials = new Set(objectsOf(gltf, (object) => object.isMesh).map((mesh) => mesh.material));
  const glowing = [...materials].filter((material) => material.userData.luxel_baked === true);
  assert.ok(glowing.length > 0, "no emissive material is marked");
  assert.ok(glowing.every((material) => material.emissive.r + material.emissive.g + material.emissive.b > 0));
});
