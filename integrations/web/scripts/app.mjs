// Builds dist/app: the page that bakes, static files for any host. Its examples are made by the command, ENFILADE.
import { build } from 'esbuild';
import { copyFileSync, existsSync, mkdirSync, readFileSync, rmSync } from 'node:fs';
import { execFileSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';
import { brotliCompressSync } from 'node:zlib';
import { command } from './worlds.mjs';

const at = (path) => fileURLToPath(new URL(`../${path}`, import.meta.url));
const shared = { bundle: true, minify: true, target: 'es2022', legalComments: 'none', logLevel: 'error' };
mkdirSync(at('dist/app/examples'), { recursive: true });
await build({ ...shared, entryPoints: [at('app/app.ts')], format: 'esm', outfile: at('dist/app/app.js') });
await build({ ...shared, entryPoints: [at('src/bake-worker.ts')], format: 'iife', outfile: at('dist/app/bake-worker.js') });
for (const name of ['index.html', 'app.css']) copyFileSync(at(`app/${name}`), at(`dist/app/${name}`));
if (existsSync(at('dist/enfilade-bake.wasm'))) copyFileSync(at('dist/enfilade-bake.wasm'), at('dist/app/enfilade-bake.wasm'));
if (existsSync(command)) {
  const run = (...args) => execFileSync(command, ['-q', ...args], { stdio: ['ignore', 'ignore', 'inherit'] });
  const example = (name) => at(`dist/app/examples/${name}.glb`);
  const folder = at('dist/examples');
  rmSync(folder, { recursive: true, force: true });
  run('demo', '-o', `${folder}/house`);
  run('demo', '--living', '-o', `${folder}/tower`);
  copyFileSync(`${folder}/house/house.glb`, example('house'));
  copyFileSync(`${folder}/tower/tower.glb`, example('tower'));
  run('generate', 'office', '--rooms', '14', '--seed', '3', '-o', example('office'));
  rmSync(folder, { recursive: true, force: true });
} else console.log(`no examples: ${command} is missing`);
const parts = ['index.html', 'app.css', 'app.js', 'bake-worker.js'].map((name) => readFileSync(at(`dist/app/${name}`)));
const sizes = parts.map((bytes) => brotliCompressSync(bytes).length);
console.log(`app: ${sizes.reduce((a, b) => a + b)} bytes in brotli, without the module`);
