// Builds dist/walk: the page of the walk, and beside it its script with three.js, and the module, both compressed.
import { build } from 'esbuild';
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from 'node:fs';
import { fileURLToPath } from 'node:url';
import { gzipSync } from 'node:zlib';

const at = (path) => fileURLToPath(new URL(`../${path}`, import.meta.url));
const { outputFiles } = await build({
  entryPoints: [at('walk/walk.ts')],
  bundle: true,
  format: 'esm',
  minify: true,
  write: false,
  target: 'es2022',
  legalComments: 'none',
});
mkdirSync(at('dist/walk'), { recursive: true });
copyFileSync(at('walk/walk.html'), at('dist/walk/index.html'));
for (const [name, bytes] of [
  ['walk-code.bin', outputFiles[0].contents],
  ['walk-module.bin', readFileSync(at('dist/enfilade.wasm'))],
]) {
  const packed = gzipSync(bytes, { level: 9 });
  writeFileSync(at(`dist/walk/${name}`), packed);
  console.log(`${name}: ${packed.length} bytes`);
}
