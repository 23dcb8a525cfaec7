// Prints the figures of the walk that `pack --walk` writes, over a simulated link, as lines of JSON: row, world, value, bar, ok.
// Arguments are packed worlds, folders with an index.html; without any, the demo house.
import { execFileSync, spawn } from 'node:child_process';
import { basename, dirname, resolve } from 'node:path';
import { command, folder, worlds } from './scripts/worlds.mjs';
import { browser } from './test/browser.mjs';

/** Link: 10 Mbit/s, and milliseconds from a request to its answer. */
const [PACE, LATENCY] = [10e6 / 8, 50];
/** Times that each page is opened; the median counts. */
const TIMES = 5;

let failures = 0;
function row(name, world, value, bar, more = {}) {
  const ok = bar === undefined || value <= bar;
  failures += !ok;
  console.log(JSON.stringify({ row: name, world, value, bar, ok, ...more }));
}

/** Serves a folder with the command; returns the address and a way to end it. */
export async function serving(path) {
  const server = spawn(command, ['serve', path, '--address', '127.0.0.1:0'], { stdio: ['ignore', 'pipe', 'inherit'] });
  const address = await new Promise((done, fail) => {
    let said = '';
    server.stdout.on('data', (text) => {
      said += text;
      const found = /http:\/\/[\d.:]+/.exec(said);
      if (found) done(found[0]);
    });
    server.on('exit', () => fail(new Error(`enfilade serve ended: ${said}`)));
  });
  return { address, close: () => server.kill() };
}

/** Runs in the page from its beginning: notes when the first room is drawn, and when all that is seen is there. */
function watch() {
  const times = (globalThis.times = {});
  const note = (name, is) => is && (times[name] ??= performance.now());
  const look = () => {
    const first = performance.getEntriesByName('first room')[0];
    if (first) times.room ??= first.startTime;
    const { walk } = globalThis;
    const streamer = walk?.streamed?.streamer;
    if (streamer) {
      note('walks', walk.culler.counts.cells > 0);
      note('room', walk.culler.counts.cell >= 0 && streamer.isComplete(walk.culler.counts.cell));
      note('view', streamer.settled);
    }
    if (times.view === undefined) requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}

/** Opens a page; returns, for each point in time, milliseconds, bytes and requests until then. */
export async function opened(own, address, link) {
  const context = await own.newContext({ viewport: { width: 1280, height: 720 } });
  const tab = await context.newPage();
  const devtools = await context.newCDPSession(tab);
  await devtools.send('Network.enable');
  if (link) await devtools.send('Network.emulateNetworkConditions', { offline: false, latency: LATENCY, downloadThroughput: PACE, uploadThroughput: PACE });
  const events = [];
  // Times of the network and of the page begin at different moments.
  let origin;
  const note = (timestamp, bytes, requests) => events.push({ at: timestamp, bytes, requests });
  // What of an answer has come so far; its end tells the exact size, with headers.
  const soFar = new Map();
  const came = (id, timestamp, bytes) => {
    note(timestamp, bytes, 0);
    soFar.set(id, (soFar.get(id) ?? 0) + bytes);
  };
  devtools.on('Network.requestWillBeSent', ({ requestId, timestamp, wallTime, request }) => {
    if (!request.url.startsWith('http') || request.url.endsWith('/favicon.ico')) return;
    origin ??= 1000 * (wallTime - timestamp);
    soFar.set(requestId, 0);
    note(timestamp, 0, 1);
  });
  devtools.on('Network.dataReceived', ({ requestId, timestamp, encodedDataLength }) => soFar.has(requestId) && came(requestId, timestamp, encodedDataLength));
  devtools.on('Network.loadingFinished', ({ requestId, timestamp, encodedDataLength }) => {
    if (soFar.has(requestId)) came(requestId, timestamp, encodedDataLength - soFar.get(requestId));
  });
  await tab.addInitScript(watch);
  await tab.goto(address);
  await tab.waitForFunction(() => globalThis.times.view !== undefined, undefined, { timeout: 120_000 });
  const { times, began } = await tab.evaluate(() => ({ times: globalThis.times, began: performance.timeOrigin }));
  const until = Object.fromEntries(Object.entries(times).map(([name, ms]) => {
    const before = events.filter(({ at }) => 1000 * at + origin - began <= ms);
    const sum = (key) => before.reduce((total, event) => total + event[key], 0);
    return [name, { ms, bytes: sum('bytes'), requests: sum('requests') }];
  }));
  return { tab, until, close: () => context.close() };
}

/** Runs in the page: the cost of `see` over a turn of the head, and the free way ahead. */
function looks() {
  const { culler, camera, walker, controls, world } = globalThis.walk;
  const costs = [];
  for (let i = 0; i < 256; i++) {
    camera.position.set(...walker.eye);
    camera.rotation.set(0, (i / 128) * Math.PI, 0, 'YXZ');
    camera.updateMatrixWorld();
    const begin = performance.now();
    for (let k = 0; k < 8; k++) culler.update(camera);
    costs.push((performance.now() - begin) / 8);
  }
  const [x, y, z] = walker.eye;
  const ahead = (far) => [x - far * Math.sin(controls.yaw), y, z - far * Math.cos(controls.yaw)];
  const isFree = (from, to) => {
    const { crossed, isRelocated } = world.step(from, to);
    return !isRelocated && world.locate(to) >= 0 && crossed.every((id) => world.isOpen(id) && world.portals[id].kind !== 'window');
  };
  let free = 0;
  while (free < 20 && isFree(ahead(free), ahead(free + 0.25))) free += 0.25;
  costs.sort((a, b) => a - b);
  return { median: costs[128], most: costs[255], free };
}

async function measure(own, path) {
  const world = basename(path, '.enf');
  const server = await serving(dirname(resolve(path)));
  const address = `${server.address}/${basename(path)}/`;
  const runs = [];
  let last;
  for (let i = 0; i < TIMES; i++) {
    await last?.close();
    last = await opened(own, address, true);
    runs.push(last.until);
  }
  const median = (name, key) => runs.map((until) => until[name][key]).sort((a, b) => a - b)[TIMES >> 1];
  row('walk: first room, ms', world, Math.round(median('room', 'ms')), 1000);
  row('walk: bytes until then', world, median('room', 'bytes'), 300e3);
  row('walk: requests until then', world, median('room', 'requests'), 20);
  for (const [name, text] of [['walks', 'one can walk'], ['view', 'all in view streamed']]) {
    row(`walk: ${text}, ms`, world, Math.round(median(name, 'ms')), undefined, { bytes: median(name, 'bytes'), requests: median(name, 'requests') });
  }
  const { median: see, most, free } = await last.tab.evaluate(looks);
  row('walk: see and show, ms a frame', world, see, 1000 / 60, { most });
  row('walk: free view lacks of 3 m', world, Math.max(0, 3 - free), 0, { free });
  await last.close();
  server.close();
}

if (process.argv[1] === import.meta.filename) {
  const paths = process.argv.slice(2);
  if (paths.length === 0) {
    worlds();
    const path = `${folder}/demo-walk.enf`;
    execFileSync(command, ['-q', 'pack', `${folder}/demo.glb`, '-o', path, '--walk']);
    paths.push(path);
  }
  const own = await browser();
  try {
    for (const path of paths) await measure(own, path);
  } finally {
    await own.close();
  }
  process.exitCode = failures > 0 ? 1 : 0;
}
