// The example of the package's README, as it stands there.
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import test from 'node:test';
import { needsBaked, openStage } from './setting.mjs';

test("the README's example shows the room", needsBaked, async () => {
  const readme = readFileSync(new URL('../luxel-three/README.md', import.meta.url), 'utf8');
  const [, code] = readme.match(/```js\n(import[^]*?)```/);
  const page = `<!doctype html><title>example</title><link rel="icon" href="data:,"><body><script type="importmap">{ "imports": {
    "three": "/three/build/three.module.js", "three/addons/": "/three/examples/jsm/", "luxel-three": "/luxel-three/index.js" } }</script>
    <script type="module">${code}</script>`;
  const stage = await openStage({
    '/example.html': (path, response) => response.writeHead(200, { 'Content-Type': 'text/html' }).end(page),
  }, 'example.html');
  try {
    await stage.page.setViewportSize({ width: 320, height: 240 });
    await stage.page.waitForSelector('canvas');
    // What is on the screen, not what WebGL keeps: the example does not keep it.
    let size = 0;
    for (let i = 0; i < 120 && size < 5000; i++) {
      await new Promise((resolve) => setTimeout(resolve, 500));
      size = (await stage.page.locator('canvas').screenshot({ timeout: 60000 })).length; // an empty canvas packs into less
    }
    assert.ok(size >= 5000, `the picture has ${size} bytes`);
    assert.ok(stage.said.some((text) => /left lamp: point, 6 cd/.test(text)), `${stage.said}`);
    stage.assertClean();
  } finally {
    await stage.close();
  }
});
