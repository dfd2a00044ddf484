// Headless Chromium for tests: pages that may ask nobody but loopback, and whose every complaint fails the test.
import assert from 'node:assert/strict';
import { existsSync } from 'node:fs';
import { chromium } from 'playwright-core';

const candidates = [process.env.LUXEL_CHROMIUM, '/usr/bin/chromium', '/usr/bin/chromium-browser', '/usr/bin/google-chrome'];
export const chromiumPath = candidates.find((path) => path && existsSync(path));

// SwiftShader draws: no GPU is needed, and every machine draws alike.
const FLAGS = [
  '--headless', '--no-sandbox', '--disable-quic', '--no-first-run', '--disable-background-networking', '--disable-component-update',
  '--disable-sync', '--use-angle=swiftshader', '--enable-unsafe-swiftshader', '--autoplay-policy=no-user-gesture-required',
];

export async function launch() {
  assert.ok(chromiumPath, 'there is no Chromium: script/setup installs it');
  return chromium.launch({ executablePath: chromiumPath, args: FLAGS });
}

// What Chromium says about its own drawing in software, not about our pages: reading pixels back makes it wait.
const OWN_REMARKS = [/GPU stall due to ReadPixels/, /GL Driver Message/];

/** A page that notes what it should not do; `assertClean()` fails if it did. */
export async function openPage(browser, url, options = {}) {
  const context = await browser.newContext(options);
  const page = await context.newPage();
  const complaints = [];
  const said = []; // everything, complaints too
  const foreign = [];
  page.on('console', (message) => {
    const text = message.text();
    said.push(text);
    if (['error', 'warning'].includes(message.type()) && !OWN_REMARKS.some((remark) => remark.test(text))) complaints.push(`${message.type()}: ${text}`);
  });
  page.on('pageerror', (error) => complaints.push(`exception: ${error.stack ?? error.message}`));
  await context.route('**', (route) => {
    const { hostname, protocol } = new URL(route.request().url());
    if (hostname === '127.0.0.1' || ['blob:', 'data:'].includes(protocol)) return route.continue();
    foreign.push(route.request().url());
    return route.abort();
  });
  await page.goto(url);
  return {
    page,
    context,
    complaints,
    said,
    assertClean() {
      assert.deepEqual(complaints, []);
      assert.deepEqual(foreign, []);
    },
  };
}
