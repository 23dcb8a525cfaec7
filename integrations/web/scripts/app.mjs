// Builds dist/app: the page that bakes, static files for any host. Its examples are made by the command, ENFILADE.
import { build } from 'esbuild';
import { createHash } from 'node:crypto';
import { copyFileSync, cpSync, existsSync, mkdirSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { execFileSync } from 'node:child_process';
import { fileURLToPath } from 'node:url';
import { PAGE, brotli } from './sizes.mjs';
import { command } from './worlds.mjs';

const at = (path) => fileURLToPath(new URL(`../${path}`, import.meta.url));
const shared = { bundle: true, minify: true, target: 'es2022', legalComments: 'none', logLevel: 'error' };
mkdirSync(at('dist/app/examples'), { recursive: true });
await build({ ...shared, entryPoints: [at('app/app.ts')], format: 'esm', outfile: at('dist/app/app.js') });
for (const worker of ['src/bake-worker.ts', 'app/model-worker.ts', 'app/ifc-worker.ts']) {
  await build({ ...shared, entryPoints: [at(worker)], format: 'iife', outdir: at('dist/app') });
}
copyFileSync(at('app/app.css'), at('dist/app/app.css'));
// The page allows the one script that the walk has inside, by its hash.
const walkFolder = at('../../crates/enfilade-report/src/walk');
const walk = readFileSync(`${walkFolder}/index.html`, 'utf8');
const inside = /<script>([^]*?)<\/script>/.exec(walk)[1];
const hash = createHash('sha256').update(inside).digest('base64');
const hasThreads = existsSync(at('dist/enfilade-bake-threads.wasm'));
const page = readFileSync(at('app/index.html'), 'utf8').replace('sha256-WALK', `sha256-${hash}`).replace('THREADS', `${hasThreads}`);
writeFileSync(at('dist/app/index.html'), page);
cpSync(walkFolder, at('dist/app/walk'), { recursive: true });
for (const name of ['enfilade-bake.wasm', 'enfilade-bake-threads.wasm', 'enfilade-bake-all.wasm']) {
  if (existsSync(at(`dist/${name}`))) copyFileSync(at(`dist/${name}`), at(`dist/app/${name}`));
}
// Loaded when an IFC file comes.
copyFileSync(at('node_modules/web-ifc/web-ifc.wasm'), at('dist/app/web-ifc.wasm'));
copyFileSync(at('node_modules/web-ifc/LICENSE.md'), at('dist/app/web-ifc-license.md'));
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
console.log(`app: ${brotli(PAGE)} bytes in brotli, without the module`);
