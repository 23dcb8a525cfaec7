// Sizes of what the page loads.
import { readFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { brotliCompressSync } from 'node:zlib';

/** Files of the page itself. */
export const PAGE = ['index.html', 'app.css', 'app.js', 'bake-worker.js', 'model-worker.js'];
/** Files of the walk, which are fetched when the page is ready. */
export const WALK = ['walk/index.html', 'walk/walk-code.bin', 'walk/walk-module.bin'];
/** Files that are fetched when an IFC file comes. */
export const IFC = ['ifc-worker.js', 'web-ifc.wasm'];

/** Returns the size of files of dist/app in brotli. [Units: bytes] */
export function brotli(names) {
  const at = (name) => fileURLToPath(new URL(`../dist/app/${name}`, import.meta.url));
  return names.reduce((sum, name) => sum + brotliCompressSync(readFileSync(at(name))).length, 0);
}
