// shaders/*.glsl in Chromium against the C they mirror: the same runtime in WebAssembly, or the formula itself.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { after, before, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { needsBaked, openStage } from './setting.mjs';

// Half a unit in the last place of a half float: what a target of halves would round away.
const HALF_ROUNDING = 2 ** -11;

test('shaders.js is what shaders/*.glsl say', () => {
  execFileSync(process.execPath, [fileURLToPath(new URL('../luxel-three/make-shaders.mjs', import.meta.url)), '--check']);
});

let stage;
before(async () => {
  if (needsBaked.skip) return;
  stage = await openStage();
  await stage.page.evaluate(async () => {
    const { Runtime } = await import('/luxel-three/runtime.js');
    const { LayeredPages } = await import('/luxel-three/lightmap.js');
    const { createUniforms } = await import('/luxel-three/materials.js');
    const shaders = await import('/luxel-three/shaders.js');
    const runtime = await Runtime.load('/luxel_rt.wasm');
    runtime.open(await runtime.receive(await fetch('/baked/luxel.pack')));
    // Colours that differ in every channel and by orders of magnitude, and a black one.
    for (let layer = 0; layer < runtime.info.layerCount; layer++)
      runtime.setColor(layer, 1 + layer, 0.5 * (layer % 3), 7 / (1 + layer), layer === 1 ? 0 : 10 ** ((layer % 4) - 1));
    const uniforms = createUniforms();
    const pages = new LayeredPages(window.stage.renderer, runtime, uniforms);
    pages.update();
    Object.assign(window, { runtime, uniforms, shaders });
    window.sums = (expression, width, height, extra = {}) =>
      window.stage.evaluate(
        `uniform sampler2DArray layers; uniform highp sampler2D factors; uniform int factorCount; uniform int firstSlice;
         ${shaders.lxrt_lightmap_sample} ${shaders.lxrt_compose} vec4 value(vec2 pixel) { ${expression} }`,
        { layers: uniforms.luxelPages.value, factors: uniforms.luxelFactors.value, factorCount: uniforms.luxelFactorCount.value, firstSlice: 0, ...extra },
        width, height,
      );
    /** Largest difference of RGBA from RGB, as a share of the texel's largest channel. */
    window.worst = (rgba, rgb) => {
      let most = 0;
      let lit = 0;
      for (let i = 0; i < rgb.length / 3; i++) {
        const largest = Math.max(rgb[3 * i], rgb[3 * i + 1], rgb[3 * i + 2]);
        if (largest === 0) continue;
        lit++;
        for (let c = 0; c < 3; c++) most = Math.max(most, Math.abs(rgba[4 * i + c] - rgb[3 * i + c]) / largest);
      }
      return { most, lit };
    };
  });
});
after(() => stage?.close());

test('lxrt_compose in GLSL gives the sums of lxrt_compose in C, on every page and level', needsBaked, async () => {
  const results = await stage.page.evaluate(() => {
    const { pageSize, pageCount, levelCount, layerCount } = window.runtime.info;
    const list = [];
    for (let page = 0; page < pageCount; page++) {
      for (let level = 0; level < levelCount; level++) {
        const size = pageSize >> level;
        const code = `return vec4(lxrt_compose(layers, factors, factorCount, firstSlice, ivec2(pixel), ${level}), 1.0);`;
        list.push(window.worst(window.sums(code, size, size, { firstSlice: page * layerCount }), window.runtime.readPage(page, level)));
      }
    }
    return list;
  });
  assert.ok(results.length >= 4, `${results.length} levels`);
  for (const { most, lit } of results) {
    assert.ok(lit > 100, `${lit} texels are lit`);
    assert.ok(most <= HALF_ROUNDING, `differs by ${most}`);
  }
});

test('the array of colours may be longer than a row of its texture', needsBaked, async () => {
  const { most, lit } = await stage.page.evaluate(() => {
    const { THREE } = window.stage;
    const used = window.uniforms.luxelFactors.value.image.data.subarray(0, 4 * window.uniforms.luxelFactorCount.value);
    const times = 32; // each colour in 32 parts: more than 256 in all
    const data = new Float32Array(4 * 256 * Math.ceil((times * used.length) / 1024));
    for (let i = 0; i < times; i++) data.set(used.map((value, at) => (at % 4 === 3 ? value : value / times)), i * used.length);
    const factors = new THREE.DataTexture(data, 256, data.length / 1024, THREE.RGBAFormat, THREE.FloatType);
    factors.needsUpdate = true;
    const code = 'return vec4(lxrt_compose(layers, factors, factorCount, firstSlice, ivec2(pixel), 0), 1.0);';
    const size = window.runtime.info.pageSize;
    const rgba = window.sums(code, size, size, { factors, factorCount: (times * used.length) / 4 });
    return window.worst(rgba, window.runtime.readPage(0, 0));
  });
  assert.ok(lit > 100);
  assert.ok(most <= HALF_ROUNDING, `differs by ${most}`);
});

for (const kind of ['bilinear', 'bicubic']) {
  test(`lxrt_compose_${kind} gives what lxrt_lightmap_sample gives in C`, needsBaked, async () => {
    const { most, lit } = await stage.page.evaluate((filter) => {
      const size = window.runtime.info.pageSize;
      // Points between texels, at the edges and beyond them; more than one to a texel, for with less the GPU goes to mip levels.
      const points = 2 * size;
      const uv = (pixel) => (pixel + 0.5) * (1.1 / points) - 0.05;
      const code = `vec2 uv = pixel * (1.1 / float(${points})) - 0.05;
        return vec4(lxrt_compose_${filter}(layers, factors, factorCount, firstSlice, uv), 1.0);`;
      const rgba = window.sums(code, points, points);
      const page = window.runtime.readPage(0, 0);
      const clamp = (texel) => Math.min(Math.max(texel, 0), size - 1);
      // Texture units weigh texels with few bits, so the error is a share of the brightest texel that is weighed.
      const brightest = (u, v) => {
        let largest = 0;
        for (let y = -2; y <= 2; y++)
          for (let x = -2; x <= 2; x++)
            for (let c = 0; c < 3; c++)
              largest = Math.max(largest, page[3 * (clamp(Math.floor(v * size) + y) * size + clamp(Math.floor(u * size) + x)) + c]);
        return largest;
      };
      const rgb = [0, 0, 0];
      let most = 0;
      let lit = 0;
      for (let y = 0; y < points; y++) {
        for (let x = 0; x < points; x++) {
          window.runtime.sample(0, uv(x), uv(y), filter === 'bicubic' ? 1 : 0, rgb);
          const largest = brightest(uv(x), uv(y));
          if (largest === 0) continue;
          lit++;
          for (let c = 0; c < 3; c++) most = Math.max(most, Math.abs(rgba[4 * (y * points + x) + c] - rgb[c]) / largest);
        }
      }
      return { most, lit };
    }, kind);
    assert.ok(lit > 100);
    assert.ok(most <= HALF_ROUNDING, `differs by ${most}`);
  });
}

test('lx_range_factor is the window of KHR_lights_punctual', needsBaked, async () => {
  const distances = [0, 0.5, 1, 3.9, 4, 5];
  const values = await stage.page.evaluate(
    ({ count }) => {
      const code = `${window.shaders.lx_range_factor}
        uniform float distances[${count}];
        vec4 value(vec2 pixel) { float d = distances[int(pixel.x)]; return vec4(lx_range_factor(d, 4.0), lx_range_factor(d, 0.0), 0.0, 1.0); }`;
      return Array.from(window.stage.evaluate(code, { distances: [0, 0.5, 1, 3.9, 4, 5] }, count, 1));
    },
    { count: distances.length },
  );
  distances.forEach((distance, i) => {
    assert.ok(Math.abs(values[4 * i] - Math.max(Math.min(1 - (distance / 4) ** 4, 1), 0)) < 1e-6, `at ${distance}: ${values[4 * i]}`);
    assert.equal(values[4 * i + 1], 1, 'a lamp without range reaches anywhere');
  });
});

test('lx_spot_factor is the angular attenuation of KHR_lights_punctual', needsBaked, async () => {
  const inner = Math.cos(0.3);
  const outer = Math.cos(0.6);
  const angles = [0, 0.2, 0.3, 0.4, 0.5, 0.6, 1];
  const values = await stage.page.evaluate(
    ({ cosines, inner, outer }) => {
      const code = `${window.shaders.lx_spot_factor}
        uniform float cosines[${cosines.length}]; uniform vec2 cone;
        vec4 value(vec2 pixel) { return vec4(lx_spot_factor(cone.x, cone.y, cosines[int(pixel.x)]), lx_spot_factor(cone.x, cone.x, cosines[int(pixel.x)]), 0.0, 1.0); }`;
      return Array.from(window.stage.evaluate(code, { cosines, cone: [inner, outer] }, cosines.length, 1));
    },
    { cosines: angles.map(Math.cos), inner, outer },
  );
  angles.forEach((angle, i) => {
    const attenuation = Math.min(Math.max((Math.cos(angle) - outer) / Math.max(0.001, inner - outer), 0), 1);
    assert.ok(Math.abs(values[4 * i] - attenuation ** 2) < 1e-5, `at ${angle}: ${values[4 * i]} and not ${attenuation ** 2}`);
    const sharp = Math.min(Math.max((Math.cos(angle) - inner) / 0.001, 0), 1);
    assert.ok(Math.abs(values[4 * i + 1] - sharp ** 2) < 1e-3, `a hard cone at ${angle}: ${values[4 * i + 1]}`);
  });
});

test('no complaint, nothing asked of others', needsBaked, () => stage.assertClean());
