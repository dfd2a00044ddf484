// What the tests of the viewer share: a static server, a browser, and a page that remembers what it asked for and complained about.
import { execFile, spawn } from "node:child_process";
import { createReadStream, statSync } from "node:fs";
import { createServer } from "node:http";
import { extname, join, normalize } from "node:path";
import { promisify } from "node:util";
import { chromium } from "playwright-core";

export const luxelProgram = process.env.LUXEL;
export const viewerFolder = process.env.LUXEL_VIEWER;
export const bakedFolder = process.env.LUXEL_BAKED;

/** Goes into the options of test(): skips with a reason where a piece is missing. */
export const needsViewer = luxelProgram && viewerFolder && bakedFolder ? {} : { skip: "LUXEL, LUXEL_VIEWER and LUXEL_BAKED do not name program, viewer and baked folder" };

const types = {
  ".html": "text/html; charset=utf-8", ".js": "text/javascript", ".css": "text/css", ".svg": "image/svg+xml", ".json": "application/json",
  ".wasm": "application/wasm", ".glb": "model/gltf-binary", ".png": "image/png", ".pack": "application/octet-stream",
};

/** The plainest of web servers. `mounts`: { "/path/": folder }, the longest that fits wins. Resolves to { url, close }. */
export function serveFolders(mounts) {
  const prefixes = Object.keys(mounts).sort((a, b) => b.length - a.length);
  const server = createServer((request, response) => {
    let path = decodeURIComponent(new URL(request.url, "http://localhost").pathname);
    if (path.endsWith("/")) path += "index.html";
    const prefix = prefixes.find((each) => path.startsWith(each));
    const file = prefix && join(mounts[prefix], normalize(`/${path.slice(prefix.length)}`));
    let stat = null;
    try {
      stat = file && statSync(file);
    } catch {
      // not there
    }
    if (!stat?.isFile()) {
      response.writeHead(404).end("not found");
      return;
    }
    response.writeHead(200, { "content-type": types[extname(file)] ?? "application/octet-stream", "content-length": stat.size });
    if (request.method === "HEAD") response.end();
    else createReadStream(file).pipe(response);
  });
  return new Promise((resolve) =>
    server.listen(0, "127.0.0.1", () =>
      resolve({ url: `http://127.0.0.1:${server.address().port}`, close: () => new Promise((done) => (server.closeAllConnections(), server.close(done))) }),
    ),
  );
}

/** `luxel view` on a free port. Resolves to { url, stop }; stop() presses Ctrl-C and resolves to the exit code. */
export function luxelView(folder) {
  const child = spawn(luxelProgram, ["view", folder, "--no-browser", "--port", "0"], { env: { ...process.env, LUXEL_VIEWER: viewerFolder } });
  let text = "";
  const exit = new Promise((resolve) => child.on("exit", (code, signal) => resolve(code ?? signal)));
  return new Promise((resolve, reject) => {
    const look = (data) => {
      text += data;
      const [url] = text.match(/http:\/\/(127\.0\.0\.1|localhost|\[::1\]):\d+\S*/) ?? [];
      if (url) resolve({ url, stop: () => (child.kill("SIGINT"), exit) });
    };
    child.stdout.on("data", look);
    child.stderr.on("data", look);
    exit.then((code) => reject(new Error(`luxel view ended with ${code}: ${text}`)));
  });
}

export async function luxel(...parameters) {
  return promisify(execFile)(luxelProgram, parameters);
}

export function launchBrowser() {
  return chromium.launch({
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    headless: true,
    args: ["--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--disable-background-networking", "--disable-component-update",
      "--disable-sync", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"],
  });
}

/** Opens the viewer and waits until the room is drawn. The page gets { complaints, requests } that go on being filled. */
export async function openViewer(browser, url, { width = 640, height = 360, phone = false, ready = true } = {}) {
  const context = await browser.newContext({ viewport: { width, height }, hasTouch: phone, isMobile: phone, deviceScaleFactor: 1 });
  const page = await context.newPage();
  page.complaints = [];
  page.requests = [];
  page.on("console", (message) => ["error", "warning"].includes(message.type()) && page.complaints.push(message.text()));
  page.on("pageerror", (error) => page.complaints.push(String(error)));
  page.on("request", (request) => page.requests.push(request.url()));
  await page.goto(url);
  if (ready) await page.evaluate(() => window.luxelViewer.ready);
  return page;
}

/** The picture of the viewer at a size: { width, height, data } with RGBA bytes, top row first. */
export async function readPixels(page, width, height) {
  const picture = await page.evaluate(
    ([w, h]) => {
      const { data } = window.luxelViewer.readPixels(w, h);
      let text = "";
      for (let i = 0; i < data.length; i += 32768) text += String.fromCharCode(...data.subarray(i, i + 32768));
      return btoa(text);
    },
    [width, height],
  );
  return { width, height, data: new Uint8Array(Buffer.from(picture, "base64")) };
}

/** Mean of red, green and blue over a rectangle. */
export function meanColor({ width, data }, x0, y0, w, h) {
  const sum = [0, 0, 0];
  for (let y = y0; y < y0 + h; y++) for (let x = x0; x < x0 + w; x++) for (let c = 0; c < 3; c++) sum[c] += data[4 * (y * width + x) + c];
  return sum.map((value) => value / (w * h));
}
