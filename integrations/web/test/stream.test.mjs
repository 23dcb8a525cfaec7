// Covers W1, W2 and W6 in the browser: a packed world over HTTP, piece by piece.
import assert from 'node:assert/strict';
import { after, before, test } from 'node:test';
import { execFileSync } from 'node:child_process';
import { opened, serving } from '../measure-walk.mjs';
import { command, folder, worlds } from '../scripts/worlds.mjs';
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
    await walk.goto(`${server.address}/web/dist/walk/?world=/worlds/${name}`);
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

/** Packs the demo house with its walk; returns the address of the page. */
async function packedWalk(t, name, ...args) {
  execFileSync(command, ['-q', 'pack', `${folder}/demo.glb`, '-o', `${folder}/${name}`, '--walk', ...args]);
  const server = await serving(folder);
  t.after(() => server.close());
  return server.address;
}

test('the first picture of a packed walk comes in three requests, all that is in view in few more', async (t) => {
  const address = await packedWalk(t, 'walk.enf');
  const { tab, until, close } = await opened(own, `${address}/walk.enf/`, false);
  // The page, its script, and the picture; then the module, the head, the own room, the view, and what may be seen soon.
  assert.equal(until.room.requests, 3);
  assert.ok(until.room.bytes < 300e3, JSON.stringify(until));
  assert.ok(until.view.requests <= 10, JSON.stringify(until));
  const [wanted, pieces] = await tab.evaluate(() => [globalThis.walk.streamed.streamer.counts.wanted, globalThis.walk.streamed.place.head.pieces.length]);
  assert.ok(wanted > 10 && pieces > 20, `${wanted} pieces in view of ${pieces}`);
  assert.equal(await tab.title(), 'Demo');
  await close();
});

test('the first picture is that of the world without its textures, to the rounding of coordinates', async (t) => {
  const address = await packedWalk(t, 'walk.enf');
  const tab = await own.newPage({ viewport: { width: 320, height: 200 } });
  // Without its head, the world does not come.
  await tab.route('**/head.enfp', (route) => route.abort());
  const shot = async () => {
    await tab.addStyleTag({ content: 'body > :not(canvas:first-child) { display: none }' });
    await tab.waitForTimeout(300);
    return [...(await tab.screenshot())];
  };
  await tab.goto(`${address}/walk.enf/`);
  await tab.waitForFunction(() => performance.getEntriesByName('first room').length > 0, undefined, { timeout: 60_000 });
  const first = await shot();
  await tab.unroute('**/head.enfp');
  await tab.reload();
  // What comes later may bring variants of materials.
  const hasAll = () => globalThis.walk?.streamed.streamer.settled && globalThis.walk.streamed.streamer.counts.residentPieces > 0.9 * globalThis.walk.streamed.place.head.pieces.length;
  await tab.waitForFunction(hasAll, undefined, { timeout: 60_000 });
  await tab.evaluate(() => {
    const { streamed, walker, world } = globalThis.walk;
    streamed.scene.traverse(({ material }) => {
      if (material?.map) [material.map, material.needsUpdate] = [null, true];
    });
    // A walker settles on the floor by a few centimeters.
    walker.flies = true;
    world.start().eye.forEach((v, k) => (walker.eye[k] = v));
  });
  const whole = await shot();
  const shares = await tab.evaluate(async (pictures) => {
    const pixels = await Promise.all(pictures.map(async (bytes) => {
      const bitmap = await createImageBitmap(new Blob([new Uint8Array(bytes)], { type: 'image/png' }));
      const context = new OffscreenCanvas(bitmap.width, bitmap.height).getContext('2d');
      context.drawImage(bitmap, 0, 0);
      return context.getImageData(0, 0, bitmap.width, bitmap.height).data;
    }));
    let [differing, colors] = [0, new Set()];
    for (let i = 0; i < pixels[0].length; i += 4) {
      colors.add(pixels[0].subarray(i, i + 3).join());
      differing += [0, 1, 2].some((k) => Math.abs(pixels[0][i + k] - pixels[1][i + k]) > 8);
    }
    return { differing: (4 * differing) / pixels[0].length, colors: colors.size };
  }, [first, whole]);
  assert.ok(shares.differing < 0.01 && shares.colors > 20, JSON.stringify(shares));
  await tab.close();
});

test('a walk in one page opens the packed file beside it, and its buttons lead to storeys', async (t) => {
  const address = await packedWalk(t, 'one.enf', '--one-file');
  const walk = await own.newPage({ viewport: { width: 640, height: 400 } });
  await walk.goto(`${address}/one-walk.html`);
  await walk.waitForFunction(() => globalThis.walk?.culler.counts.cells > 0, undefined, { timeout: 60_000 });
  const buttons = await walk.locator('#storeys button').allTextContents();
  assert.deepEqual(buttons.slice(0, 2), ['1', '2']);
  const height = () => walk.evaluate(() => globalThis.walk.walker.eye[1]);
  const heights = [];
  for (const name of buttons.slice(0, 2)) {
    await walk.getByRole('button', { name, exact: true }).click();
    const isMarked = (name) => document.querySelector('[aria-pressed=true]')?.textContent === name;
    await walk.waitForFunction(isMarked, name, { timeout: 30_000 });
    heights.push(await height());
  }
  assert.ok(heights[1] > heights[0] + 2, heights.join());
  await walk.close();
});

test('furniture stops a walker, and not one who flies', async (t) => {
  const address = await packedWalk(t, 'walk.enf');
  const { tab, close } = await opened(own, `${address}/walk.enf/`, false);
  await tab.waitForFunction(() => globalThis.walk?.streamed.streamer.settled, undefined, { timeout: 60_000 });
  const reached = await tab.evaluate(() => {
    const { culler, controls, walker, world } = globalThis.walk;
    // What is in view has come: objects on the floor, higher than a step, with free floor on one side.
    const boxes = culler.parts.details.flatMap((object, id) => {
      if (!object || world.portals.some(({ leaves }) => leaves.some(({ detail }) => detail === id))) return [];
      const [low, high] = [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]];
      object.updateWorldMatrix(true, true);
      object.traverse(({ geometry, matrixWorld }) => {
        if (!geometry) return;
        geometry.computeBoundingBox();
        const { min, max } = geometry.boundingBox.clone().applyMatrix4(matrixWorld);
        [min, max].forEach((p) => p.toArray().forEach((v, k) => ([low[k], high[k]] = [Math.min(low[k], v), Math.max(high[k], v)])));
      });
      return high[1] - low[1] > 0.6 && high[0] - low[0] > 0.5 && high[2] - low[2] > 0.5 ? [{ low, high }] : [];
    });
    const walks = [];
    for (const { low, high } of boxes) {
      const z = (low[2] + high[2]) / 2;
      for (const [from, way] of [[low[0] - 0.9, 1], [high[0] + 0.9, -1]]) {
        const eye = [from, low[1] + 1.6, z];
        if (world.locate(eye) < 0 || world.locate([eye[0] - 0.3 * way, eye[1], z]) < 0) continue;
        const ends = [false, true].map((flies) => {
          eye.forEach((v, k) => (walker.eye[k] = v));
          walker.flies = flies;
          // Less than the time after which one gets out of furniture.
          for (let step = 0; step < 28; step++) walker.move(0.05 * way, 0, 0, 1 / 30);
          return way * (walker.eye[0] - (way > 0 ? low[0] : high[0]));
        });
        walks.push(ends);
      }
    }
    controls.yaw = 0;
    return walks;
  });
  const stopped = reached.filter(([walked, flown]) => walked < -0.1 && flown > 0.2);
  assert.ok(stopped.length > 0, JSON.stringify(reached));
  // Lamps and plants are thinner than their boxes.
  const through = reached.filter(([walked, flown]) => walked > 0.4 && flown > 0.4);
  assert.ok(through.length <= stopped.length, JSON.stringify(reached));
  await close();
});

test('two thumbs walk and look, and a tap opens a door', async () => {
  const phone = await own.newContext({ viewport: { width: 400, height: 640 }, hasTouch: true, isMobile: true });
  const walk = await phone.newPage();
  await walk.goto(`${server.address}/web/dist/walk/?world=/worlds/demo.glb`);
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
