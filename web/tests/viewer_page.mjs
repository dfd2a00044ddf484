// What the tests of the viewer share: the program, pages that show a room, their pixels.
import assert from "node:assert/strict";
import { execFile, spawn } from "node:child_process";
import { promisify } from "node:util";
import { openPage } from "./browser.mjs";

export const luxelProgram = process.env.LUXEL;
export const viewerFolder = process.env.LUXEL_VIEWER;
export const bakedFolder = process.env.LUXEL_BAKED;

/** Goes into the options of test(): skips with a reason where a piece is missing. */
export const needsViewer =
  luxelProgram && viewerFolder && bakedFolder ? {} : { skip: "LUXEL, LUXEL_VIEWER and LUXEL_BAKED do not name program, viewer and baked folder" };

export async function luxel(...parameters) {
  return promisify(execFile)(luxelProgram, parameters, { env: { ...process.env, LUXEL_VIEWER: viewerFolder } });
}

/** `luxel view` on a free port. Resolves to { url, stop }; stop() presses Ctrl-C and resolves to the exit code. */
export function luxelView(folder) {
  const child = spawn(luxelProgram, ["view", folder, "--no-browser", "--port", "0"], { env: { ...process.env, LUXEL_VIEWER: viewerFolder } });
  const exit = new Promise((resolve) => child.on("exit", (code, signal) => resolve(code ?? signal)));
  return new Promise((resolve, reject) => {
    let text = "";
    const look = (data) => {
      text += data;
      const [url] = text.match(/http:\/\/127\.0\.0\.1:\d+\//) ?? [];
      if (url) resolve({ url, stop: () => (child.kill("SIGINT"), exit) });
    };
    child.stdout.on("data", look);
    child.stderr.on("data", look);
    exit.then((code) => reject(new Error(`luxel view ended with ${code}: ${text}`)));
  });
}

/** Opens the viewer and waits until the room is drawn. As openPage() of browser.mjs. */
export async function openViewer(browser, url, { width = 640, height = 360, phone = false } = {}) {
  const opened = await openPage(browser, url, { viewport: { width, height }, hasTouch: phone, isMobile: phone });
  await opened.page.evaluate(() => window.luxelViewer.ready);
  return opened;
}

/** The picture of the viewer at a size: { width, height, data } with RGBA bytes, top row first. */
export async function readPixels(page, width, height) {
  const text = await page.evaluate(
    ([w, h]) => {
      const { data } = window.luxelViewer.readPixels(w, h);
      let bytes = "";
      for (let i = 0; i < data.length; i += 32768) bytes += String.fromCharCode(...data.subarray(i, i + 32768));
      return btoa(bytes);
    },
    [width, height],
  );
  return { width, height, data: new Uint8Array(Buffer.from(text, "base64")) };
}

/** Reads a picture that the program wrote, with the browser's decoder. */
export async function decodePng(page, png) {
  const { width, height, text } = await page.evaluate(async (base64) => {
    const bytes = Uint8Array.from(atob(base64), (c) => c.charCodeAt(0));
    const bitmap = await createImageBitmap(new Blob([bytes], { type: "image/png" }), { colorSpaceConversion: "none", premultiplyAlpha: "none" });
    const canvas = new OffscreenCanvas(bitmap.width, bitmap.height);
    const paint = canvas.getContext("2d");
    paint.drawImage(bitmap, 0, 0);
    const { data } = paint.getImageData(0, 0, bitmap.width, bitmap.height);
    let out = "";
    for (let i = 0; i < data.length; i += 32768) out += String.fromCharCode(...data.subarray(i, i + 32768));
    return { width: bitmap.width, height: bitmap.height, text: btoa(out) };
  }, png.toString("base64"));
  return { width, height, data: new Uint8Array(Buffer.from(text, "base64")) };
}

/** Mean of red, green and blue over a rectangle of pixels. */
export function meanColor({ width, data }, x0, y0, w, h) {
  const sum = [0, 0, 0];
  for (let y = y0; y < y0 + h; y++) for (let x = x0; x < x0 + w; x++) for (let c = 0; c < 3; c++) sum[c] += data[4 * (y * width + x) + c];
  return sum.map((value) => value / (w * h));
}

/** Mean absolute difference of two pictures over all pixels and channels, in 255ths. */
export function meanDifference(a, b) {
  assert.deepEqual([a.width, a.height], [b.width, b.height]);
  let sum = 0;
  for (let i = 0; i < a.data.length; i++) if (i % 4 !== 3) sum += Math.abs(a.data[i] - b.data[i]);
  return sum / (3 * a.width * a.height);
}
