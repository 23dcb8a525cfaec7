// Covers R1, R5, W4 and W5 in three.js: pictures with and without culling in headless Chromium.
import assert from 'node:assert/strict';
import { copyFileSync, readFileSync } from 'node:fs';
import { after, before, test } from 'node:test';
import { folder, worlds } from '../scripts/worlds.mjs';
import { at, browser, bundle, page, visit } from './browser.mjs';
import { serve } from './server.mjs';

const VIEWS = Number(process.env.VIEWS ?? 25);
const names = worlds();
let [server, own, tab] = [];

before(async () => {
  server = await serve({ web: at(''), worlds: folder });
  own = await browser();
  ({ tab } = await visit(own, `${server.address}/${await page('views')}`));
});

after(async () => {
  await own?.close();
  server?.close();
});

for (const name of names) {
  test(`${name}: culling loses no pixel, and draws less`, async () => {
    const out = await tab.evaluate(([file, n]) => globalThis.compare(file, n, 1), [`/worlds/${name}.glb`, VIEWS]);
    assert.equal(out.views, VIEWS);
    assert.equal(out.lost, 0, JSON.stringify(out.worst));
    // Pixels whose middle lies on an edge, to a 32nd of a pixel: at most one in ten thousand.
    assert.ok(out.edges < (VIEWS * 64_000) / 10_000, `${out.edges} pixels on edges`);
    assert.ok(out.colors > 50 * VIEWS, `pictures of ${out.colors / VIEWS} colors`);
    assert.ok(out.callsOn * 3 < out.callsOff, `${out.callsOn} of ${out.callsOff} draw calls`);
  });
}

test('the example of the README shows a room, opens a door on a click, and culls', async () => {
  const [, code] = /```js\n(\/\/ example[^]*?)```/.exec(readFileSync(at('README.md'), 'utf8'));
  const lines = code.split('\n').filter((line) => line.trim() && !line.startsWith('//'));
  assert.ok(lines.length <= 20, `${lines.length} lines`);
  const path = await bundle('example', `${code}\nglobalThis.culler = culler;`);
  copyFileSync(at('dist/enfilade.wasm'), at('dist/test/enfilade.wasm'));
  copyFileSync(`${folder}/demo.glb`, at('dist/test/world.glb'));
  const { tab, errors } = await visit(own, `${server.address}/${path}`, false);
  await tab.waitForFunction(() => globalThis.culler?.seen, undefined, { timeout: 60_000 });
  const before = await tab.evaluate(() => ({ ...globalThis.culler.counts }));
  assert.ok(before.cells >= 1 && before.cells < 13 && before.triangles > 0, JSON.stringify(before));
  await tab.evaluate(() => {
    globalThis.before = globalThis.culler.world.portals.map((portal) => globalThis.culler.world.openness(portal.id));
    globalThis.dispatchEvent(new MouseEvent('click'));
  });
  const hasMoved = () => globalThis.before.some((was, id) => Math.abs(globalThis.culler.world.openness(id) - was) > 0.5);
  await tab.waitForFunction(hasMoved, undefined, { timeout: 30_000 });
  assert.deepEqual(errors.filter((text) => !text.includes('404')), []);
  await tab.close();
});

test('React Three Fiber: a component shows the world and tells the cell', async () => {
  const { tab } = await visit(own, `${server.address}/${await page('fiber')}`, false);
  await tab.waitForFunction(() => globalThis.entered !== undefined && globalThis.culler?.counts.batches > 0, undefined, { timeout: 60_000 });
  const { cell, calls } = await tab.evaluate(() => ({ cell: globalThis.entered, calls: globalThis.culler.counts.batches }));
  assert.ok(cell >= 0 && calls > 0);
  await tab.close();
});
