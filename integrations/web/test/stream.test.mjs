// Covers W1, W2 and W6 in the browser: a packed world over HTTP, piece by piece.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { folder, worlds } from '../scripts/worlds.mjs';
import { at, browser, page, visit } from './browser.mjs';
import { serve } from './server.mjs';

const names = worlds();
let [server, own, tab] = [];

before(async () => {
  server = await serve({ web: at(''), worlds: folder });
  own = await browser();
  ({ tab } = await visit(own, `${server.address}/${await page('stream')}`));
});

after(async () => {
  await own?.close();
  server?.close();
});

for (const name of names.includes('institute') ? ['demo', 'furnished'] : ['demo']) {
  test(`${name}: a streamed view that is complete is the picture of the whole file`, async () => {
    const out = await tab.evaluate(([name]) => globalThis.same(`/worlds/${name}.enf`, `/worlds/${name}.glb`, 10), [name]);
    assert.equal(out.views, 10);
    assert.equal(out.differing, 0);
    assert.ok(out.colors > 300);
  });
}

// From one room of the demo house one sees most of it through the windows.
const [world, budget] = names.includes('institute') ? ['furnished', 0.25] : ['demo', 0.95];

test(`${world}: within ${budget} of the memory, every view of a walk is complete, and the budget is kept`, async () => {
  const out = await tab.evaluate(([world, budget]) => globalThis.walk(`/worlds/${world}.enf`, budget, 20), [world, budget]);
  assert.equal(out.stuck, 0);
  assert.ok(out.share > 0 && out.share <= budget, JSON.stringify(out));
});

test('the walk opens the packed world and the whole one beside it, walks, and opens a door', async () => {
  for (const name of ['demo.enf', 'demo.glb']) {
    const walk = await own.newPage({ viewport: { width: 640, height: 400 } });
    const errors = [];
    walk.on('pageerror', (error) => errors.push(error.message));
    await walk.goto(`${server.address}/web/dist/walk.html?world=/worlds/${name}`);
    await walk.waitForFunction(() => globalThis.walk?.culler.counts.cells > 0, undefined, { timeout: 60_000 });
    const at = () => walk.evaluate(() => [...globalThis.walk.walker.eye]);
    const begin = await at();
    // It begins with three meters or more ahead, and without counters, which a key shows.
    const free = () => {
      const { world, walker, controls } = globalThis.walk;
      const [x, y, z] = walker.eye;
      const ahead = (far) => [x - far * Math.sin(controls.yaw), y, z - far * Math.cos(controls.yaw)];
      return [1, 2, 3].every((far) => !world.step(ahead(far - 1), ahead(far)).isRelocated);
    };
    assert.ok(await walk.evaluate(free));
    const hasCounters = () => walk.evaluate(() => !document.getElementById('panel').hidden);
    assert.equal(await hasCounters(), false);
    await walk.keyboard.press('KeyI');
    assert.equal(await hasCounters(), true);
    await walk.keyboard.down('KeyW');
    await walk.waitForTimeout(700);
    await walk.keyboard.up('KeyW');
    const end = await at();
    assert.ok(Math.hypot(...end.map((v, k) => v - begin[k])) > 0.05, `from ${begin} to ${end}`);
    await walk.evaluate(async () => {
      const { world, walker, controls } = globalThis.walk;
      const door = world.portals.find(({ leaves, normal }) => leaves.length > 0 && Math.abs(normal[1]) < 0.1);
      const middle = [0, 1, 2].map((k) => door.outline.filter((_, i) => i % 3 === k).reduce((a, b) => a + b) / (door.outline.length / 3));
      middle.forEach((v, k) => (walker.eye[k] = v - 1.2 * door.normal[k]));
      walker.flies = true;
      controls.yaw = Math.atan2(-door.normal[0], -door.normal[2]);
      globalThis.door = { id: door.id, was: world.openness(door.id) };
      await new Promise((done) => setTimeout(done, 400));
      globalThis.dispatchEvent(new KeyboardEvent('keydown', { code: 'KeyE' }));
    });
    const hasMoved = () => Math.abs(globalThis.walk.world.openness(globalThis.door.id) - globalThis.door.was) > 0.5;
    await walk.waitForFunction(hasMoved, undefined, { timeout: 30_000 });
    assert.deepEqual(errors, []);
    await walk.close();
  }
});

test('two thumbs walk and look, and a tap opens a door', async () => {
  const phone = await own.newContext({ viewport: { width: 400, height: 640 }, hasTouch: true, isMobile: true });
  const walk = await phone.newPage();
  await walk.goto(`${server.address}/web/dist/walk.html?world=/worlds/demo.glb`);
  await walk.waitForFunction(() => globalThis.walk?.culler.counts.cells > 0, undefined, { timeout: 60_000 });
  const link = await phone.newCDPSession(walk);
  const touch = (type, x, y) => link.send('Input.dispatchTouchEvent', { type, touchPoints: type === 'touchEnd' ? [] : [{ x, y }] });
  const state = () => walk.evaluate(() => ({ eye: [...globalThis.walk.walker.eye], yaw: globalThis.walk.controls.yaw }));
  const drag = async (x, dx, dy) => {
    await touch('touchStart', x, 400);
    await touch('touchMove', x + dx, 400 + dy);
    await walk.waitForTimeout(900);
    await touch('touchEnd');
  };
  const begin = await state();
  await drag(100, 0, -60);
  const walked = await state();
  assert.ok(Math.hypot(...walked.eye.map((v, k) => v - begin.eye[k])) > 0.05, 'the left thumb does not walk');
  await drag(300, 60, 0);
  assert.ok(Math.abs((await state()).yaw - walked.yaw) > 0.1, 'the right thumb does not look');
  await walk.evaluate(() => {
    const { walker, controls, world } = globalThis.walk;
    walker.flies = true;
    [5.2, 4.5, 4].forEach((v, k) => (walker.eye[k] = v));
    [controls.yaw, controls.pitch] = [0, 0];
    globalThis.before = world.portals.map(({ id }) => world.openness(id));
  });
  await walk.waitForTimeout(400);
  // Not one after the other: a slow frame between them would make a long press of the tap.
  await Promise.all([touch('touchStart', 200, 320), touch('touchEnd')]);
  const hasMoved = () => globalThis.before.some((was, id) => Math.abs(globalThis.walk.world.openness(id) - was) > 0.5);
  await walk.waitForFunction(hasMoved, undefined, { timeout: 30_000 });
  await phone.close();
});
