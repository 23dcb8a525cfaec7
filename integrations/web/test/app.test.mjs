// The page that bakes, in a browser: files in, rooms out, without a network, by keyboard, in two languages, on a phone.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync, writeFileSync } from 'node:fs';
import { after, test } from 'node:test';
import { command } from '../scripts/worlds.mjs';
import { at, browser } from './browser.mjs';
import { formats, scaled } from './rooms.mjs';
import { serve } from './server.mjs';

const own = await browser();
const server = await serve({ app: at('dist/app') });
after(async () => {
  await own.close();
  server.close();
});

const WAIT = { timeout: 60_000 };
const upload = (files) => files.map(({ name, bytes }) => ({ name, mimeType: 'application/octet-stream', buffer: Buffer.from(bytes) }));

/** Opens the page; what it asks of the network and what it says is wrong is kept. */
async function open(settings = {}) {
  const context = await own.newContext({ viewport: { width: 1280, height: 900 }, locale: 'en-US', ...settings });
  const tab = await context.newPage();
  const [errors, requests] = [[], []];
  tab.on('pageerror', (error) => errors.push(error.message));
  tab.on('console', (message) => message.type() === 'error' && errors.push(message.text()));
  tab.on('request', (request) => requests.push(request.url()));
  await tab.goto(`${server.address}/app/`);
  await tab.waitForSelector('html[data-ready], #failed:not([hidden])', { ...WAIT, state: 'attached' });
  assert.equal(await tab.textContent('#why'), '');
  await tab.waitForLoadState('networkidle');
  const done = () => tab.waitForSelector('#done:not([hidden]), #failed:not([hidden])', WAIT);
  return { context, tab, errors, requests, done };
}

test('a house becomes rooms without a network, and they are the rooms of the command', async () => {
  const { context, tab, errors, requests, done } = await open({ acceptDownloads: true });
  const before = requests.length;
  await context.setOffline(true);
  await tab.click('[data-example=house]');
  await tab.waitForSelector('#model:not([hidden])', WAIT);
  await done();
  assert.match(await tab.textContent('#title'), /house\.glb: 12 rooms/);
  assert.equal(await tab.locator('#rooms tbody tr').count(), 12);
  // Pointing at a room of the plan shows it in the list, and the other way round.
  const path = tab.locator('#plan .cell[tabindex]').first();
  const cell = await path.getAttribute('data-cell');
  await path.focus();
  await tab.keyboard.press('Enter');
  assert.equal(await tab.getAttribute('#rooms tr.chosen', 'data-cell'), cell);
  const upstairs = tab.locator('#rooms tbody tr', { has: tab.locator('td:nth-child(2):text-is("2")') }).first();
  await upstairs.locator('button').click();
  assert.equal(await tab.getAttribute('#storeys [aria-pressed=true]', 'data-storey'), '2');
  assert.equal(await tab.getAttribute('#plan .cell.chosen', 'data-cell'), await upstairs.getAttribute('data-cell'));
  assert.match(await tab.textContent('#told'), /m², .* high, storey 2/);
  const saved = async (key) => {
    const [download] = await Promise.all([tab.waitForEvent('download'), tab.click(`[data-save=${key}]`)]);
    return readFileSync(await download.path());
  };
  const options = { maxBuffer: 1e8, stdio: ['ignore', 'pipe', 'ignore'] };
  const native = execFileSync(command, ['-q', 'bake', at('dist/app/examples/house.glb'), '-o', '-'], options);
  assert.ok((await saved('world')).equals(native), 'the world has other bytes');
  assert.equal((await saved('csv')).toString().trim().split('\r\n').length, 13);
  assert.match((await saved('planSvg')).toString(), /^<\?xml/);
  // On paper: each storey with rooms, the table whole, no controls; then the page is as it was.
  await tab.evaluate(() => {
    addEventListener('beforeprint', () => {
      globalThis.sheets = [...document.querySelectorAll('#sheets svg')].map((svg) => svg.viewBox.baseVal.width);
    });
  });
  const paper = await tab.pdf();
  assert.match(paper.subarray(0, 8).toString(), /^%PDF-/);
  if (process.env.PAPER) writeFileSync(process.env.PAPER, paper);
  const sheets = await tab.evaluate(() => globalThis.sheets);
  assert.equal(sheets.length, await tab.locator('#storeys button').count());
  assert.ok(sheets.every((width) => width > 500), `${sheets}`);
  assert.equal(await tab.locator('#sheets svg').count(), 0);
  // The walk through it, in a frame, from what is in memory.
  await tab.click('#walk');
  const frame = tab.frameLocator('dialog.walk iframe');
  await frame.locator('#room').waitFor(WAIT);
  await frame.locator('#room:not(:empty)').waitFor(WAIT);
  assert.match(await frame.locator('#help').textContent(), /W A S D/);
  if (process.env.SHOT) await tab.screenshot({ path: process.env.SHOT });
  await tab.click('dialog.walk > button');
  await tab.locator('dialog').waitFor({ state: 'detached' });
  await tab.click('[data-language=de]');
  assert.match(await tab.textContent('#title'), /12 Räume/);
  assert.deepEqual(requests.slice(before).filter((url) => !url.startsWith('blob:')), []);
  assert.deepEqual(errors, []);
  await context.close();
});

test('a person decides where rooms end, and the command bakes the same by the settings', async () => {
  const { context, tab, errors, done } = await open({ acceptDownloads: true });
  const rooms = async () => Number(/(\d+) rooms/.exec(await tab.textContent('#title'))[1]);
  const decided = async (press) => {
    const began = tab.waitForSelector('#work:not([hidden])', WAIT);
    await press();
    await began;
    await done();
    assert.equal(await tab.textContent('#why'), '');
  };
  await tab.click('[data-example=house]');
  await done();
  const before = await rooms();
  await tab.locator('#rooms tbody button').first().click();
  assert.match(await tab.textContent('#chosen'), /wide, .* high/);
  await decided(() => tab.locator('#chosen [data-decide="one room"]').first().click());
  assert.equal(await rooms(), before - 1);
  // The largest room is parted across its middle.
  await tab.locator('#rooms tbody button').first().click();
  await tab.click('#part');
  assert.match(await tab.textContent('#told'), /Click in the plan/);
  const box = await tab.locator('#plan .cell.chosen').boundingBox();
  await decided(() => tab.mouse.click(box.x + box.width * 0.4, box.y + box.height * 0.4));
  assert.equal(await rooms(), before);
  assert.equal(await tab.locator('#decisions li').count(), 2);
  const saved = async (key) => {
    const [download] = await Promise.all([tab.waitForEvent('download'), tab.click(`[data-save=${key}]`)]);
    return { path: await download.path(), bytes: readFileSync(await download.path()) };
  };
  const [world, settings] = [await saved('world'), await saved('settings')];
  assert.match(settings.bytes.toString(), /\[\[decisions\]\]\nat = \[.*\]\nis = "two rooms"/);
  const args = ['-q', 'bake', at('dist/app/examples/house.glb'), '--config', settings.path, '-o', '-'];
  const native = execFileSync(command, args, { maxBuffer: 1e8, stdio: ['ignore', 'pipe', 'ignore'] });
  assert.ok(world.bytes.equals(native), 'the world has other bytes');
  await decided(() => tab.click('[data-back="1"]'));
  await decided(() => tab.click('[data-back="0"]'));
  assert.equal(await rooms(), before);
  assert.deepEqual(errors, []);
  await context.close();
});

test('the page can connect to nobody else', async () => {
  const { context, tab, requests } = await open();
  const other = await serve({});
  const tries = await tab.evaluate(async (address) => {
    const blocked = [];
    document.addEventListener('securitypolicyviolation', (event) => blocked.push(event.effectiveDirective));
    const fetched = await fetch(address).then(() => 'open', () => 'blocked');
    const beacon = navigator.sendBeacon(address, 'x');
    const picture = await new Promise((end) => {
      const image = new Image();
      image.onload = () => end('open');
      image.onerror = () => end('blocked');
      image.src = `${address}/x.png`;
    });
    await new Promise((end) => setTimeout(end, 100));
    return { fetched, beacon, picture, blocked };
  }, other.address);
  assert.deepEqual([tries.fetched, tries.picture], ['blocked', 'blocked']);
  assert.ok(tries.blocked.includes('connect-src') && tries.blocked.includes('img-src'), tries.blocked.join());
  assert.equal(other.counts.requests, 0);
  assert.ok(requests.every((url) => url.startsWith(server.address) || url.startsWith('blob:') || url.startsWith('data:') || url.startsWith(other.address)));
  other.close();
  await context.close();
});

test('what is wrong is said, a question is answered, and a bake is cancelled', async () => {
  const { context, tab, errors, done } = await open();
  await tab.setInputFiles('#files', upload([{ name: 'a.ifczip', bytes: new Uint8Array(4) }]));
  await done();
  assert.match(await tab.textContent('#why'), /Unpack/);
  await tab.click('#failed [data-again]');
  await tab.setInputFiles('#files', upload([{ name: 'a.glb', bytes: new TextEncoder().encode('glTF and no more') }]));
  await done();
  assert.ok((await tab.textContent('#why')).length > 20);
  await tab.click('#failed [data-again]');
  await tab.setInputFiles('#files', upload(scaled(1000)));
  await done();
  await tab.selectOption('#ask select', 'mm');
  await tab.click('#ask button');
  await tab.waitForSelector('#done:not([hidden])', WAIT);
  assert.match(await tab.textContent('#title'), /rooms\.stl: 2 rooms/);
  await tab.click('#done [data-again]');
  await tab.click('[data-example=tower]');
  await tab.waitForSelector('#work:not([hidden])');
  await tab.click('#cancel');
  await tab.waitForSelector('#start:not([hidden])');
  await tab.setInputFiles('#files', upload(formats.gltf));
  await done();
  assert.match(await tab.textContent('#title'), /rooms\.gltf: 2 rooms/);
  // A damaged model has no picture, which is no error of the page.
  assert.deepEqual(errors, []);
  await context.close();
});

test('on a phone nothing is cut off, and all that can be pressed has a name', async () => {
  const { context, tab, errors, done } = await open({ viewport: { width: 390, height: 844 }, locale: 'de-DE', colorScheme: 'dark' });
  assert.match(await tab.textContent('#choose'), /wählen/);
  const isCutOff = () => tab.evaluate(() => document.documentElement.scrollWidth > innerWidth);
  assert.equal(await isCutOff(), false);
  await tab.setInputFiles('#files', upload(formats.obj));
  await done();
  assert.equal(await isCutOff(), false);
  const nameless = await tab.evaluate(() =>
    [...document.querySelectorAll('button, select, input:not([hidden]), [tabindex="0"], progress')]
      .filter((e) => !(e.textContent.trim() || e.getAttribute('aria-label') || e.labels?.length))
      .map((e) => e.outerHTML.slice(0, 80)),
  );
  assert.deepEqual(nameless, []);
  assert.deepEqual(errors, []);
  await context.close();
});
