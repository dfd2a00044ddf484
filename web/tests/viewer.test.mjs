// The viewer as people meet it: through `luxel view` and `luxel export-web`, in headless Chromium, compared with `luxel render`.
import assert from "node:assert/strict";
import { mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { join } from "node:path";
import test, { after, before } from "node:test";
import { launch } from "./browser.mjs";
import { serve } from "./server.mjs";
import { bakedFolder, decodePng, luxel, luxelView, meanColor, meanDifference, needsViewer, openViewer, readPixels, viewerFolder } from "./viewer_page.mjs";

const width = 480, height = 270;
// Of viewer_room.py through its first camera at this size: what each lamp has for itself.
const insideLeft = [152, 165, 40, 36], insideRight = [290, 165, 40, 36];
const leftWall = [108, 60, 30, 110], rightWall = [342, 60, 30, 110]; // beside the screen
const ceiling = [190, 40, 100, 20], floor = [190, 235, 100, 30];

let folder, browser, view;
before(async () => {
  if (needsViewer.skip) return;
  folder = await mkdtemp(join(tmpdir(), "luxel-viewer-"));
  browser = await launch();
  view = await luxelView(bakedFolder);
});
after(async () => {
  await browser?.close();
  if (view) assert.equal(await view.stop(), 0, "luxel view ends with exit code 0 on Ctrl-C");
  if (folder) await rm(folder, { recursive: true, force: true });
});

async function rendered(page, ...options) {
  const file = join(folder, "render.png");
  await luxel("render", bakedFolder, "-o", file, "--size", `${width}x${height}`, "--samples", "16", "--quiet", ...options);
  return decodePng(page, await readFile(file));
}

const row = (page, name) => page.locator("li.row", { has: page.locator(".row-name", { hasText: new RegExp(`^${name}$`) }) });

test("the viewer shows a room through luxel view, asks nobody else and complains about nothing", needsViewer, async () => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`);
  assert.equal(await page.title(), "Luxel");
  assert.equal(await page.locator("#curtain").isVisible(), false);
  for (const name of ["left", "right", "ceiling", "tv"]) assert.equal(await row(page, name).count(), 1, name);
  const picture = await readPixels(page, width, height);
  assert.ok(Math.min(...meanColor(picture, ...insideLeft)) > 40, "the room is lit");
  assert.equal(await page.evaluate(() => luxelViewer.stage.frame), 0, "no frame is due when nothing moves");

  await page.getByRole("tab", { name: "About" }).click();
  const report = await page.getByRole("link", { name: "Report of the bake" }).getAttribute("href");
  assert.equal((await page.request.get(report)).status(), 200);
  await page.getByRole("tab", { name: "Picture" }).click();
  await page.getByRole("button", { name: "Atlas pages" }).click();
  await page.getByLabel("Layer", { exact: true }).selectOption("left");
  await page.getByRole("button", { name: "1:1" }).click();
  await page.getByRole("button", { name: "Close", exact: true }).click();
  assertClean();
  await context.close();
});

test("a colour that is picked and a slider that is dragged change the pixels of their lamp at once", needsViewer, async () => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`, { width: 900, height: 500 });
  const before = await readPixels(page, width, height);
  await row(page, "left").locator("input[type=color]").fill("#ff0000");
  const red = await readPixels(page, width, height);
  const inside = meanColor(red, ...insideLeft);
  assert.ok(inside[0] > 3 * inside[1] && inside[0] > 3 * inside[2], `the left box is red: ${inside}`);
  const change = meanColor(red, ...insideRight).map((value, c) => Math.abs(value - meanColor(before, ...insideRight)[c]));
  assert.ok(Math.max(...change) < 6, `the right box stays as it was: ${change}`);

  // What people see, not only what a test asks for.
  const box = await page.locator("#canvas").boundingBox();
  const shot = await decodePng(page, await page.screenshot());
  const x = Math.round(box.x + box.width / 2), y = Math.round(box.y + box.height / 2);
  const seen = await page.evaluate(() => {
    const { canvas, camera } = luxelViewer.stage;
    const point = camera.position.clone().set(-1, 0.4, -1.9).project(camera);
    return [(0.5 + point.x / 2) * canvas.clientWidth, (0.5 - point.y / 2) * canvas.clientHeight];
  });
  assert.ok(Math.abs(seen[0] - x) < box.width / 2 && Math.abs(seen[1] - y) < box.height / 2, "the left box is in the picture");
  const [r, g] = meanColor(shot, Math.round(box.x + seen[0]) - 6, Math.round(box.y + seen[1]) - 6, 12, 12);
  assert.ok(r > 3 * g, `the left box is red on the screen: ${r}, ${g}`);

  const slider = row(page, "left").locator("input[type=range]");
  const track = await slider.boundingBox();
  await page.mouse.move(track.x + track.width / 2, track.y + track.height / 2);
  await page.mouse.down();
  await page.mouse.move(track.x + track.width / 4, track.y + track.height / 2, { steps: 3 });
  const dimmed = meanColor(await readPixels(page, width, height), ...insideLeft);
  await page.mouse.move(track.x - 20, track.y + track.height / 2, { steps: 3 });
  await page.mouse.up();
  const off = meanColor(await readPixels(page, width, height), ...insideLeft);
  assert.ok(dimmed[0] < 0.75 * inside[0] && off[0] < 0.75 * dimmed[0], `dimmer, then off: ${inside[0]}, ${dimmed[0]}, ${off[0]}`);
  assert.equal(await row(page, "left").locator("input[type=number]").first().inputValue(), "0");

  await row(page, "left").getByRole("button", { name: "Reset left" }).click();
  assert.ok(meanDifference(before, await readPixels(page, width, height)) < 0.1, "reset brings the authored light back");
  assertClean();
  await context.close();
});

test("solo, mute and all off darken what they should; the address keeps it", needsViewer, async () => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`, { width: 900, height: 500 });
  const lit = await readPixels(page, width, height);
  await row(page, "right").getByRole("button", { name: "Solo right" }).click();
  const solo = await readPixels(page, width, height);
  assert.ok(meanColor(solo, ...insideLeft)[1] < 0.6 * meanColor(lit, ...insideLeft)[1], "the left lamp is silent");
  assert.ok(meanColor(solo, ...insideRight)[1] > 0.8 * meanColor(lit, ...insideRight)[1], "the right lamp is not");
  await page.waitForFunction(() => location.hash.includes("light=right"));
  const address = page.url();

  const again = await openViewer(browser, address);
  assert.ok(meanDifference(solo, await readPixels(again.page, width, height)) < 0.1, "the same address shows the same light");
  await again.context.close();

  await row(page, "right").getByRole("button", { name: "Solo right" }).click();
  await page.getByRole("button", { name: "All off" }).click();
  assert.ok(Math.max(...meanColor(await readPixels(page, width, height), 0, 0, width, height)) < 1, "all off is dark");
  await page.getByRole("button", { name: "Authored", exact: true }).click();
  assert.ok(meanDifference(lit, await readPixels(page, width, height)) < 0.1, "authored is as it was");
  assertClean();
  await context.close();
});

test("the lightmap-only picture is that of luxel render", needsViewer, async (t) => {
  for (const method of ["cpu", "gpu"]) {
    const { page, context, assertClean } = await openViewer(browser, `${view.url}?test&method=${method}`);
    assert.equal(await page.evaluate(() => luxelViewer.room.method), method);
    for (const [camera, ev] of [["view", -2], ["corner", -3.5]]) {
      await page.evaluate(([name, exposure]) => {
        luxelViewer.setView("lightmap");
        luxelViewer.setCamera(name);
        luxelViewer.setExposure(exposure);
      }, [camera, ev]);
      const ours = await readPixels(page, width, height);
      const theirs = await rendered(page, "--view", "lightmap", "--camera", camera, "--exposure", String(ev));
      const mean = meanColor(theirs, 0, 0, width, height);
      assert.ok(mean[1] > 40 && mean[1] < 220, `a picture that shows something: ${mean}`);
      const difference = meanDifference(ours, theirs);
      t.diagnostic(`${method}, camera ${camera}: mean difference ${difference.toFixed(3)}/255`);
      assert.ok(difference < 2, `${method}, camera ${camera}: ${difference}/255`);
    }
    assertClean();
    await context.close();
  }
});

test("a picture dropped on the screen lights the sides of the room that it should", needsViewer, async (t) => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`, { width: 900, height: 500 });
  for (const name of ["left", "right", "ceiling"]) await row(page, name).getByRole("button", { name: `Mute ${name}` }).click();
  // Letters: A on red and B on blue above, C and D below with green besides. What cells should shine with is measured here, by hand.
  const cells = await page.evaluate(async () => {
    const canvas = new OffscreenCanvas(320, 180);
    const paint = canvas.getContext("2d");
    paint.font = "bold 80px sans-serif";
    [["A", "#f00", 0, 0], ["B", "#00f", 160, 0], ["C", "#ff0", 0, 90], ["D", "#0ff", 160, 90]].forEach(([letter, color, x, y]) => {
      paint.fillStyle = color;
      paint.fillRect(x, y, 160, 90);
      paint.fillStyle = "#fff";
      paint.fillText(letter, x + 50, y + 75);
    });
    const { data } = paint.getImageData(0, 0, 320, 180);
    const linear = (byte) => (byte <= 10.31475 ? byte / 255 / 12.92 : ((byte / 255 + 0.055) / 1.055) ** 2.4);
    const means = [];
    for (let j = 0; j < 2; j++)
      for (let i = 0; i < 4; i++) {
        const sum = [0, 0, 0];
        for (let y = 90 * j; y < 90 * (j + 1); y++) for (let x = 80 * i; x < 80 * (i + 1); x++) for (let c = 0; c < 3; c++) sum[c] += linear(data[4 * (320 * y + x) + c]);
        means.push(sum.map((value) => value / (80 * 90)));
      }
    const file = new File([await canvas.convertToBlob({ type: "image/png" })], "letters.png", { type: "image/png" });
    const { canvas: target, camera } = luxelViewer.stage;
    const centre = camera.position.clone().set(0, 1.75, -2.48).project(camera);
    const box = target.getBoundingClientRect();
    const dataTransfer = new DataTransfer();
    dataTransfer.items.add(file);
    const at = { clientX: box.left + (0.5 + centre.x / 2) * box.width, clientY: box.top + (0.5 - centre.y / 2) * box.height };
    for (const type of ["dragenter", "dragover", "drop"]) target.dispatchEvent(new DragEvent(type, { dataTransfer, bubbles: true, cancelable: true, ...at }));
    return means;
  });
  await page.locator(".monitor-status", { hasText: "letters.png" }).waitFor();

  await page.evaluate(() => {
    luxelViewer.setView("lightmap");
    luxelViewer.setExposure(-0.5);
  });
  const ours = await readPixels(page, width, height);
  const [left, right, above, below] = [leftWall, rightWall, ceiling, floor].map((part) => meanColor(ours, ...part));
  assert.ok(left[0] > 1.2 * left[2], `A and C light the left wall: ${left}`);
  assert.ok(right[2] > 1.2 * right[0], `B and D light the right wall: ${right}`);
  assert.ok(below[1] / below[0] > 1.01 * above[1] / above[0], `C and D light the floor more than the ceiling: ${below}, ${above}`);
  const cellColors = cells.map((rgb, k) => ["--set", `tv/${k}=${rgb.map((value) => (10 * value).toFixed(6)).join(",")}*1`]).flat();
  const lampsOff = ["left", "right", "ceiling"].flatMap((name) => ["--set", `${name}=off`]);
  const theirs = await rendered(page, "--view", "lightmap", "--exposure", "-0.5", ...lampsOff, ...cellColors);
  const difference = meanDifference(ours, theirs);
  t.diagnostic(`mean difference to luxel render with the cells' means set by hand: ${difference.toFixed(3)}/255`);
  assert.ok(difference < 2, `${difference}/255`);

  // The screen shows it the right way up: corners of the picture, away from the letters.
  await page.evaluate(() => {
    luxelViewer.setView("lit");
    luxelViewer.setToneMapped(false);
    luxelViewer.setExposure(-3.4);
  });
  const shown = await readPixels(page, width, height);
  const place = await page.evaluate(([w, h]) => {
    const { camera } = luxelViewer.stage;
    camera.aspect = w / h;
    camera.updateProjectionMatrix();
    const corners = [[-1.15, 2.2], [1.15, 2.2], [-1.15, 1.3], [1.15, 1.3]].map(([x, y]) => camera.position.clone().set(x, y, -2.48).project(camera));
    luxelViewer.stage.resize();
    return corners.map(({ x, y }) => [Math.round((0.5 + x / 2) * w), Math.round((0.5 - y / 2) * h)]);
  }, [width, height]);
  const [a, b, c, d] = place.map(([x, y]) => meanColor(shown, x - 1, y - 1, 3, 3).map((value) => value > 128));
  assert.deepEqual([a, b, c, d], [[true, false, false], [false, false, true], [true, true, false], [false, true, true]]);

  await page.getByRole("button", { name: "Authored", exact: true }).first().click();
  assertClean();
  await context.close();
});

test("a video on the screen plays and lights the room", needsViewer, async () => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`, { width: 900, height: 500 });
  for (const name of ["left", "right", "ceiling"]) await row(page, name).getByRole("button", { name: `Mute ${name}` }).click();
  await page.evaluate(async () => {
    const canvas = document.createElement("canvas");
    canvas.width = 64;
    canvas.height = 36;
    const paint = canvas.getContext("2d");
    const recorder = new MediaRecorder(canvas.captureStream(20), { mimeType: "video/webm;codecs=vp8" });
    const chunks = [];
    recorder.ondataavailable = ({ data }) => chunks.push(data);
    const ended = new Promise((resolve) => (recorder.onstop = resolve));
    recorder.start(100);
    // A busy machine records late: until there is more than a header, twice.
    const recorded = () => chunks.filter(({ size }) => size > 0).length;
    for (let k = 0; k < 20 || (recorded() < 3 && k < 1000); k++) {
      paint.fillStyle = `rgb(${230 + (k % 20)}, 0, 0)`;
      paint.fillRect(0, 0, 64, 36);
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    recorder.stop();
    await ended;
    await luxelViewer.groups[0].show(new File(chunks, "red.webm", { type: "video/webm" }));
  });
  assert.equal(await page.locator(".monitor-status").textContent(), "Shows red.webm");
  await page.waitForFunction(() => luxelViewer.room.lights[3].intensity > 0 && luxelViewer.room.lights[3].color.g < 0.1 * luxelViewer.room.lights[3].color.r, null, { timeout: 60000 });
  await page.evaluate(() => luxelViewer.setView("lightmap"));
  const wall = meanColor(await readPixels(page, width, height), ...leftWall);
  assert.ok(wall[0] > 3 * wall[1] && wall[0] > 3 * wall[2], `the walls are red: ${wall}`);
  const state = await page.evaluate(() => {
    const { video } = luxelViewer.groups[0];
    return [video.loop, video.muted];
  });
  assert.deepEqual(state, [true, true]);
  await page.getByRole("button", { name: "Pause" }).click();
  assert.equal(await page.evaluate(() => luxelViewer.groups[0].video.paused), true);
  assertClean();
  await context.close();
});

test("an exported site works below a path of any static server", needsViewer, async () => {
  const site = join(folder, "site");
  await luxel("export-web", bakedFolder, "-o", site);
  const server = await serve({ "/some/where/": site });
  const { page, context, assertClean } = await openViewer(browser, `${server.url}some/where/?test`);
  const picture = await readPixels(page, width, height);
  assert.ok(Math.min(...meanColor(picture, ...insideRight)) > 40, "the room is lit");
  assertClean();
  await context.close();
  await server.close();
});

test("a page without a baked folder says what is missing", needsViewer, async () => {
  const server = await serve({ "/": viewerFolder });
  const page = await browser.newPage();
  await page.goto(server.url);
  const alert = page.getByRole("alert");
  await alert.waitFor();
  assert.match(await alert.textContent(), /no baked room here.*luxel\.json.*luxel view OUT/);
  await page.goto(`${server.url}?baked=https://example.com/`);
  await alert.waitFor();
  assert.match(await alert.textContent(), /Only baked folders of this site/);
  await page.close();
  await server.close();
});

test("on a phone the panel opens from below, sliders follow the finger and nothing sticks out", needsViewer, async () => {
  const { page, context, assertClean } = await openViewer(browser, `${view.url}?test`, { width: 390, height: 844, phone: true });
  const outside = () =>
    page.evaluate(() => {
      const wide = [...document.querySelectorAll("body *")].filter((element) => {
        const { left, right, width: w } = element.getBoundingClientRect();
        return w > 0 && (left < -0.5 || right > innerWidth + 0.5) && getComputedStyle(element).visibility !== "hidden";
      });
      return [document.documentElement.scrollWidth - innerWidth, ...wide.map((element) => element.outerHTML.slice(0, 80))];
    });
  assert.deepEqual(await outside(), [0]);
  const slider = row(page, "left").locator("input[type=range]");
  await page.waitForFunction(() => document.getElementById("panel").getBoundingClientRect().top > 740); // the sheet is down at first
  await page.locator(".grip").tap();
  await page.waitForFunction(() => document.getElementById("panel").getBoundingClientRect().top < 480);
  assert.deepEqual(await outside(), [0]);
  await slider.scrollIntoViewIfNeeded();
  const track = await slider.boundingBox();
  await page.touchscreen.tap(track.x + track.width * 0.75, track.y + track.height / 2);
  const intensity = await page.evaluate(() => luxelViewer.model.layers[0].intensity);
  assert.ok(intensity > 16 && intensity < 64, `an eighth of six stops above 4 cd: ${intensity}`);
  for (const tab of ["Picture", "About"]) {
    await page.getByRole("tab", { name: tab }).tap();
    assert.deepEqual(await outside(), [0], tab);
  }
  for (const target of await page.locator(".tools button:visible, .tab").all()) {
    const { width: w, height: h } = await target.boundingBox();
    assert.ok(w >= 44 && h >= 44, `a finger finds it: ${w} × ${h}`);
  }
  assertClean();
  await context.close();
});

// Takes minutes: bakes nothing, but draws a room of 100 000 triangles without a GPU. LUXEL_TEST_BAR names the baked bar.
const bar = process.env.LUXEL_TEST_BAR;
test("the lightmap-only picture of the bar is that of luxel render", { skip: needsViewer.skip ?? (bar ? false : "LUXEL_TEST_BAR does not name the baked bar") }, async (t) => {
  const server = await luxelView(bar);
  const { page, context, assertClean } = await openViewer(browser, `${server.url}?test`);
  const ev = await page.evaluate(() => luxelViewer.room.ev - 2);
  for (const camera of ["main", "window"]) {
    await page.evaluate(([name, exposure]) => {
      luxelViewer.setView("lightmap");
      luxelViewer.setCamera(name);
      luxelViewer.setExposure(exposure);
    }, [camera, ev]);
    const ours = await readPixels(page, 640, 360);
    const file = join(folder, "bar.png");
    await luxel("render", bar, "-o", file, "--size", "640x360", "--quiet", "--view", "lightmap", "--camera", camera, "--exposure", String(ev));
    const difference = meanDifference(ours, await decodePng(page, await readFile(file)));
    t.diagnostic(`camera ${camera}: mean difference ${difference.toFixed(3)}/255`);
    assert.ok(difference < 2, `camera ${camera}: ${difference}/255`);
  }
  assertClean();
  await context.close();
  await server.stop();
});
