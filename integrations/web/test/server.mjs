// A static server for tests: files of named folders, ranges, and a limited pace.
import { createServer } from 'node:http';
import { existsSync, readFileSync, statSync } from 'node:fs';
import { gzipSync } from 'node:zlib';
import { extname, join, normalize } from 'node:path';

const TYPES = {
  '.html': 'text/html',
  '.css': 'text/css',
  '.js': 'text/javascript',
  '.mjs': 'text/javascript',
  '.wasm': 'application/wasm',
  '.glb': 'model/gltf-binary',
};

const known = new Map();

/** Packs a file, once. */
function packed(path, body) {
  const key = `${path} ${statSync(path).mtimeMs}`;
  if (!known.has(key)) known.set(key, gzipSync(body, { level: body.length > 1e6 ? 1 : 9 }));
  return known.get(key);
}

/** Serves `folders` (by first name of the path); `pace` is in bytes a second, `latency` in milliseconds; with or without ranges. */
export async function serve(folders, { pace = Infinity, latency = 0, ranges = true } = {}) {
  let busyUntil = 0;
  const wait = (ms) => new Promise((done) => setTimeout(done, ms));
  const counts = { bytes: 0, requests: 0 };
  const server = createServer(async (request, response) => {
    const url = new URL(request.url, 'http://x');
    const [, first, ...rest] = normalize(decodeURIComponent(url.pathname)).split('/');
    const named = folders[first] && join(folders[first], ...rest);
    const path = named && url.pathname.endsWith('/') ? join(named, 'index.html') : named;
    // Precise clocks, which measurements need, are given to isolated pages only.
    const headers = { 'Cross-Origin-Opener-Policy': 'same-origin', 'Cross-Origin-Embedder-Policy': 'require-corp' };
    if (!path || !existsSync(path) || !statSync(path).isFile()) return response.writeHead(404, headers).end();
    let body = readFileSync(path);
    headers['Content-Type'] = TYPES[extname(path)] ?? 'application/octet-stream';
    headers['Cache-Control'] = 'no-store';
    if (ranges) headers['Accept-Ranges'] = 'bytes';
    const range = ranges && /bytes=(\d+)-(\d+)/.exec(request.headers.range ?? '');
    if (range) {
      const [from, to] = [Number(range[1]), Math.min(Number(range[2]), body.length - 1)];
      headers['Content-Range'] = `bytes ${from}-${to}/${body.length}`;
      body = body.subarray(from, to + 1);
    }
    // As static hosts do for code.
    if (/\.(js|html|wasm)$/.test(path) && /gzip/.test(request.headers['accept-encoding'] ?? '')) {
      headers['Content-Encoding'] = 'gzip';
      body = packed(path, body);
    }
    headers['Content-Length'] = body.length;
    counts.requests++;
    await wait(latency);
    response.writeHead(range ? 206 : 200, headers);
    for (let at = 0; at < body.length; at += 8192) {
      const part = body.subarray(at, at + 8192);
      if (pace < Infinity) {
        // One link for all connections.
        busyUntil = Math.max(busyUntil, performance.now()) + (1000 * part.length) / pace;
        await wait(busyUntil - performance.now());
        if (response.destroyed) return;
      }
      counts.bytes += part.length;
      response.write(part);
    }
    response.end();
  });
  await new Promise((done) => server.listen(0, '127.0.0.1', done));
  const { port } = server.address();
  return { counts, address: `http://127.0.0.1:${port}`, close: () => server.close() };
}
