// IFC by web-ifc: the bytes of the command, with its reader of node; in the page, too, and there without a network.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { BakeFailure, bake } from '../dist/bake.js';
import { ifcReader } from '../dist/ifc.js';
import { command } from '../scripts/worlds.mjs';
import { at, browser } from './browser.mjs';
import { ifcOf } from './ifc-file.mjs';
import { serve } from './server.mjs';

/** Buildings written anew as IFC; the gate has time for one, ENFILADE_BAKES=6 for all. */
const SCENES = ['scenes/samplehouse4', 'scenes/fzk-haus', 'scenes3/revit-demo2', 'scenes/duplex', 'scenes/institute'];
const N_SCENES = Number(process.env.ENFILADE_BAKES ?? 1);

const shared = process.env.ENFILADE_SHARED ?? fileURLToPath(new URL('../../../../shared', import.meta.url));
const house = readFileSync(new URL('../../../crates/enfilade-import/tests/two-rooms.ifc', import.meta.url));
const ifc = ifcReader(createRequire(import.meta.url)('web-ifc'));

const files = { 'two-rooms.ifc': house };
for (const name of SCENES.slice(0, N_SCENES)) {
  const part = (file) => readFileSync(join(shared, name, file));
  if (!existsSync(join(shared, name, 'truth.json'))) continue;
  files[`${name.split('/')[1]}.ifc`] = Buffer.from(ifcOf([part('scene.glb'), part('detail.glb')], JSON.parse(part('truth.json'))));
}
const tall = join(shared, 'scenes/foreign/TallBuilding.ifc');
if (N_SCENES > 1 && existsSync(tall)) files['TallBuilding.ifc'] = readFileSync(tall);

const folder = mkdtempSync(join(tmpdir(), 'enfilade-'));
after(() => rmSync(folder, { recursive: true }));

/** Bakes a file by the command, with web-ifc, which it looks for in the current folder. */
function native(name, bytes) {
  const [file, world] = [join(folder, name), join(folder, 'world.glb')];
  writeFileSync(file, bytes);
  const args = ['-q', 'bake', '--threads', '1', '--allow-empty', '--ifc-convert', process.execPath, file, '-o', world];
  execFileSync(command, args, { cwd: at('.'), stdio: ['ignore', 'ignore', 'pipe'] });
  return readFileSync(world);
}

for (const [name, bytes] of Object.entries(files)) {
  test(`${name}: the world has the bytes of the command`, async () => {
    const { world, rooms } = await bake([{ name, bytes }], { ifc, allowEmpty: true });
    assert.ok(Buffer.from(world).equals(native(name, bytes)), 'the world has other bytes');
    const named = rooms.filter((room) => room.kind === 'room' && !/^cell-\d+$/.test(room.name));
    console.log(`${name}: ${rooms.length} cells, ${named.length} with names of the file`);
    if (name !== 'TallBuilding.ifc') assert.ok(named.length > 0);
  });
}

test('what is wrong with an IFC file is a sentence', async () => {
  const failed = (bytes, options) => bake([{ name: 'a.ifc', bytes }], options).then(() => assert.fail('it was baked'), (error) => error);
  const missing = await failed(house, {});
  assert.ok(missing instanceof BakeFailure && /web-ifc/.test(missing.message), missing.message);
  assert.match((await failed(house.subarray(0, 5000), { ifc })).message, /cut off/);
  const junk = Buffer.from("ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;\n#1=IFCWALL(;\nENDSEC;\nEND-ISO-10303-21;\n");
  const why = await failed(junk, { ifc });
  assert.ok(why instanceof BakeFailure && why.message.length > 10, why.message);
});

test('npx enfilade bake reads IFC', () => {
  writeFileSync(join(folder, 'house.ifc'), house);
  const args = [at('dist/cli.js'), 'bake', join(folder, 'house.ifc'), '-o', join(folder, 'own.glb'), '-q'];
  execFileSync(process.execPath, args, { cwd: folder, stdio: 'pipe' });
  assert.ok(readFileSync(join(folder, 'own.glb')).equals(native('house.ifc', house)));
});

test('the page reads IFC, from the second file on without a network', async () => {
  const own = await browser();
  const server = await serve({ app: at('dist/app') });
  const context = await own.newContext();
  const tab = await context.newPage();
  const [errors, requests] = [[], []];
  tab.on('pageerror', (error) => errors.push(error.message));
  tab.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  tab.on('request', (request) => requests.push(request.url()));
  await tab.goto(`${server.address}/app/`);
  await tab.waitForSelector('html[data-ready]', { timeout: 60_000, state: 'attached' });
  await tab.waitForLoadState('networkidle');
  assert.ok(!requests.some((url) => /web-ifc|ifc-worker/.test(url)), 'it is loaded before it is needed');
  for (const isOffline of [false, true]) {
    await context.setOffline(isOffline);
    const before = requests.length;
    await tab.setInputFiles('#files', { name: 'house.ifc', mimeType: 'application/octet-stream', buffer: house });
    await tab.waitForSelector('#done:not([hidden]), #failed:not([hidden])', { timeout: 60_000 });
    assert.match(await tab.textContent('#title'), /house\.ifc: \d+ rooms/, await tab.textContent('#why'));
    assert.match(await tab.textContent('#rooms'), /Küche/);
    const asked = requests.slice(before).filter((url) => !url.startsWith('blob:'));
    assert.ok(asked.every((url) => url.startsWith(server.address)), asked.join());
    assert.equal(asked.length > 0, !isOffline, asked.join());
    const saved = tab.waitForEvent('download');
    await tab.click('[data-save=world]');
    const world = readFileSync(await (await saved).path());
    assert.ok(world.equals(native('house.ifc', house)), 'the world has other bytes');
    await tab.click('#done [data-again]');
  }
  assert.deepEqual(errors, []);
  await own.close();
  server.close();
});
