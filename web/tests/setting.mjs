// What tests of one file share: a server, a browser and a page with the stage. Environment: LUXEL_WEB_BAKED, the folder that CTest baked
// from scene.py, and LUXEL_WASM, the runtime of the build. By hand:
//   LUXEL_WEB_BAKED=stage.baked LUXEL_WASM=build/release/luxel_rt.wasm node --test web/tests
import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { launch, openPage } from './browser.mjs';
import { serve } from './server.mjs';

const here = dirname(fileURLToPath(import.meta.url));
const three = dirname(dirname(createRequire(import.meta.url).resolve('three')));
const { LUXEL_WEB_BAKED: baked, LUXEL_WASM: wasm } = process.env;

/** Goes into the options of test(): skips with a reason when there is nothing to look at. */
export const needsBaked = baked && wasm ? {} : { skip: 'LUXEL_WEB_BAKED and LUXEL_WASM do not name a baked folder and the runtime' };

/** A page with the stage on it, or another one of `routes`. `close()` it. */
export async function openStage(routes = {}, name = 'stage.html') {
  const runtime = (path, response) => response.writeHead(200, { 'Content-Type': 'application/wasm' }).end(readFileSync(wasm));
  const server = await serve({
    '/': here,
    '/three/': three,
    '/luxel-three/': join(here, '..', 'luxel-three'),
    '/baked/': baked,
    '/room.baked/': baked,
    '/luxel_rt.wasm': runtime,
    '/luxel-three/luxel_rt.wasm': runtime,
    ...routes,
  });
  const browser = await launch();
  const stage = await openPage(browser, server.url + name);
  if (name === 'stage.html') await stage.page.waitForFunction(() => document.body.dataset.ready === 'yes');
  return {
    ...stage,
    url: server.url,
    browser,
    async close() {
      await browser.close();
      await server.close();
    },
  };
}
