// A static server on loopback for tests: folders by prefix, longest first. No more than tests need.
import { createReadStream } from 'node:fs';
import { stat } from 'node:fs/promises';
import { createServer } from 'node:http';
import { join } from 'node:path';

const TYPES = {
  html: 'text/html', js: 'text/javascript', mjs: 'text/javascript', json: 'application/json', wasm: 'application/wasm', css: 'text/css',
  png: 'image/png', svg: 'image/svg+xml', webm: 'video/webm', glb: 'model/gltf-binary',
};

/** `routes`: { '/prefix/': folder or (path, response) => … }. Returns { url, close }. */
export async function serve(routes) {
  const prefixes = Object.keys(routes).sort((a, b) => b.length - a.length);
  const server = createServer(async (request, response) => {
    const path = decodeURIComponent(new URL(request.url, 'http://localhost').pathname);
    const prefix = prefixes.find((candidate) => path.startsWith(candidate));
    const route = routes[prefix];
    if (typeof route === 'function') return route(path, response);
    const rest = path.slice(prefix?.length ?? 0) || 'index.html';
    const file = route && !rest.split('/').includes('..') ? join(route, rest) : null;
    const found = file && (await stat(file).catch(() => null));
    if (!found?.isFile()) {
      response.writeHead(404).end();
      return;
    }
    response.writeHead(200, {
      'Content-Type': TYPES[file.split('.').pop()] ?? 'application/octet-stream',
      'Content-Length': found.size,
      'Cache-Control': 'no-store',
    });
    createReadStream(file).pipe(response);
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  return {
    url: `http://127.0.0.1:${server.address().port}/`,
    close: () => {
      server.closeAllConnections?.();
      return new Promise((done) => server.close(done));
    },
  };
}
