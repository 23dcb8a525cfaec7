// The program of the README, with the package from its tarball, in an empty project for each bundler: built, served, and run.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { cpSync, mkdirSync, mkdtempSync, readFileSync, readdirSync, rmSync, symlinkSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { delimiter, join } from 'node:path';
import { after, before, test } from 'node:test';
import webpack from 'webpack';
import { folder, worlds } from '../scripts/worlds.mjs';
import { at, browser } from './browser.mjs';
import { serve } from './server.mjs';

const readme = readFileSync(at('README.md'), 'utf8');
const find = (pattern) => pattern.exec(readme)[1];
const program = `${find(/```js\n(\/\/ example[^]*?)```/)}\nglobalThis.culler = culler;\n`;
// The same place, but streamed.
const streams = `${program.split('const gltf')[0]}${find(/```js\n([^`]*enfilade\/stream[^]*?)```/)}globalThis.culler = streamed.culler;\n`;
const html = find(/```html\n([^]*?)```/);
// Without the map, for what has put the program together.
const page = (script) => `<!doctype html>\n<script type="module" src="${script}"></script>\n`;

const top = mkdtempSync(join(tmpdir(), 'enfilade-'));
const env = { ...process.env, PATH: `${at('node_modules/.bin')}${delimiter}${process.env.PATH}` };
const run = (cwd, ...command) => execFileSync(command[0], command.slice(1), { cwd, env, encoding: 'utf8', stdio: 'pipe' });
let own;

before(async () => {
  worlds();
  const first = join(top, 'first');
  mkdirSync(first);
  writeFileSync(join(first, 'package.json'), '{}');
  const [{ filename }] = JSON.parse(run(at(''), 'npm', 'pack', '--json', '--pack-destination', top));
  run(first, 'npm', 'install', '--offline', '--no-audit', '--no-fund', `../${filename}`);
  for (const name of ['three', 'fzstd']) symlinkSync(at(`node_modules/${name}`), join(first, 'node_modules', name));
  own = await browser();
});

after(async () => {
  await own?.close();
  rmSync(top, { recursive: true });
});

/** Makes a project with the package and these files. */
function project(name, files) {
  const dir = join(top, name);
  cpSync(join(top, 'first'), dir, { recursive: true, verbatimSymlinks: true });
  for (const [path, text] of Object.entries(files)) {
    mkdirSync(join(dir, path, '..'), { recursive: true });
    writeFileSync(join(dir, path), text);
  }
  return dir;
}

/** Serves a folder and opens its page, with `wasm` for an answer to who asks for the module; tells `use` what happens. */
async function open(dir, wasm, use) {
  cpSync(`${folder}/demo.glb`, join(dir, 'world.glb'));
  cpSync(`${folder}/demo.enf`, join(dir, 'world.enf'), { recursive: true });
  const server = await serve(Object.fromEntries(readdirSync(dir).map((name) => [name, join(dir, name)])));
  const tab = await own.newPage();
  const [modules, errors, said] = [[], [], []];
  tab.on('response', (answer) => /\.wasm$/.test(answer.url()) && modules.push(answer.status()));
  tab.on('pageerror', (error) => errors.push(error.message));
  tab.on('console', (message) => said.push(message.text()));
  if (wasm) await tab.route('**/*.wasm', (route) => route.fulfill(wasm));
  try {
    await tab.goto(`${server.address}/index.html`);
    await use({ tab, modules, errors, said, address: server.address });
  } finally {
    await tab.close();
    server.close();
  }
}

/** Checks that a page shows a room of the demo, and fetched the module once. */
const works = (dir, wasm) =>
  open(dir, wasm, async ({ tab, modules, errors, said }) => {
    await tab.waitForFunction(() => globalThis.culler?.seen, undefined, { timeout: 30_000 }).catch((error) => {
      throw new Error([...errors, ...said, error.message].join('; '));
    });
    const { world, cells, triangles } = await tab.evaluate(() => {
      const { world, counts } = globalThis.culler;
      return { world: world.cells.length, ...counts };
    });
    assert.equal(world, 13);
    assert.ok(cells >= 1 && cells < 13 && triangles > 0, `${cells} cells, ${triangles} triangles`);
    assert.deepEqual([modules, errors], [[200], []]);
  });

/** Checks that code of a bundle asks for no modules of node. */
function isForBrowsers(dir) {
  const names = readdirSync(dir).filter((name) => name.endsWith('.js'));
  assert.ok(names.length > 0);
  for (const name of names) assert.doesNotMatch(readFileSync(join(dir, name), 'utf8'), /["'`](node:|fs\/promises)/);
}

test('esbuild, with the command of the README', async () => {
  const dir = project('esbuild', { 'main.js': program });
  run(dir, 'sh', '-c', find(/`(esbuild .*?)`/));
  writeFileSync(join(dir, 'dist/index.html'), page('main.js'));
  isForBrowsers(join(dir, 'dist'));
  await works(join(dir, 'dist'));
  writeFileSync(join(dir, 'main.js'), streams);
  run(dir, 'sh', '-c', find(/`(esbuild .*?)`/));
  await works(join(dir, 'dist'));
});

test('Vite', async () => {
  const dir = project('vite', { 'main.js': program, 'index.html': page('/main.js') });
  assert.doesNotMatch(run(dir, 'sh', '-c', 'vite build 2>&1'), /externalized/);
  isForBrowsers(join(dir, 'dist/assets'));
  await works(join(dir, 'dist'));
});

test('webpack', async () => {
  const dir = project('webpack', { 'src/index.js': program, 'dist/index.html': page('main.js') });
  const settings = { mode: 'production', context: dir, output: { path: join(dir, 'dist') }, performance: { hints: false } };
  const { errors, warnings } = await new Promise((done, fail) => {
    webpack(settings, (error, stats) => (error ? fail(error) : done(stats.toJson())));
  });
  assert.deepEqual([errors, warnings], [[], []]);
  isForBrowsers(join(dir, 'dist'));
  await works(join(dir, 'dist'));
});

test('no bundler; a server without types; and where the module is missing, the page says what to do', async () => {
  const dir = project('page', { 'main.js': program, 'index.html': html });
  const body = readFileSync(join(dir, 'node_modules/enfilade/dist/enfilade.wasm'));
  await works(dir);
  await works(dir, { contentType: 'text/plain', body });
  await works(project('streams', { 'main.js': streams, 'index.html': html }));
  for (const [wasm, why] of [
    [{ status: 404 }, '404 Not Found'],
    [{ contentType: 'text/html', body: page('main.js') }, 'no WebAssembly, it begins with "<!doctype html>'],
  ]) {
    await open(dir, wasm, async ({ tab, errors, address }) => {
      if (errors.length === 0) await tab.waitForEvent('pageerror', { timeout: 30_000 });
      const asked = `${address}/node_modules/enfilade/dist/enfilade.wasm`;
      assert.ok(errors.length === 1 && errors[0].includes(`enfilade.wasm did not load (${asked}: ${why}`), errors.join('\n'));
      assert.match(errors[0], /Copy it there .* or give its address or its bytes as `wasm`/);
    });
  }
});
