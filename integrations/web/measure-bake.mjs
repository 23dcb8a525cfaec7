// Figures of the page that bakes, as JSON lines: sizes; from drop to rooms, the first picture, the longest time that the page
// did not answer; cancelling; and large scenes in node. ENFILADE_SHARED is the folder of scenes; arguments choose rows by name.
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { bake, loadBake } from './dist/bake.js';
import { IFC, PAGE, WALK, brotli } from './scripts/sizes.mjs';
import { at, browser } from './test/browser.mjs';
import { bakeMutants } from './test/mutants.mjs';
import { serve } from './test/server.mjs';

const shared = process.env.ENFILADE_SHARED ?? fileURLToPath(new URL('../../../shared', import.meta.url));
const chosen = process.argv.slice(2);
const isChosen = (row) => chosen.length === 0 || chosen.some((name) => row.startsWith(name));
const tell = (row, scene, value, bar, unit, more = {}) => console.log(JSON.stringify({ row, scene, value, bar, unit, ok: value <= bar, ...more }));
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
const scene = (name) => join(shared, name, 'scene.glb');

if (isChosen('size')) {
  tell('size', 'module, brotli', brotli(['enfilade-bake.wasm']) / 1e6, 1.6, 'MB');
  tell('size', 'page, brotli', brotli(PAGE) / 1e3, 250, 'kB');
  // Fetched later: no bar.
  tell('size', 'second module, brotli', brotli(['enfilade-bake-all.wasm']) / 1e6, Infinity, 'MB');
  tell('size', 'the walk, brotli', brotli(WALK) / 1e3, Infinity, 'kB');
  tell('size', 'IFC, brotli', brotli(IFC) / 1e3, Infinity, 'kB');
}

if (isChosen('mutants')) {
  const n = Number(process.env.BAKE_MUTANTS ?? 2000);
  const { wrong, unsound, ...more } = await bakeMutants(n);
  tell('mutants without a sentence', `${n} mutants`, wrong.length, 0, '', more);
  tell('sound files after them that were not baked', `${n / 100}`, unsound, 0, '');
  for (const why of wrong) console.error(why);
}

const SCENES = [['scenes/duplex', 2], ['scenes/institute', 4]].filter(([name]) => existsSync(scene(name)));
const LARGE = ['scenes2/clinic', 30];

/** Bakes a scene in the page, as soon as it can be given or after the page has baked an example unasked; returns seconds, and the longest task of the page's thread: on the clock, and on the processor. */
async function inPage(own, server, name, isWarm = true) {
  const tab = await own.newPage({ viewport: { width: 1280, height: 900 } });
  await tab.goto(`${server.address}/app/`);
  await tab.waitForFunction((name) => document.documentElement.dataset[name], isWarm ? 'warm' : 'ready');
  await tab.evaluate(() => {
    globalThis.longest = 0;
    new PerformanceObserver((list) => {
      for (const { duration } of list.getEntries()) globalThis.longest = Math.max(globalThis.longest, duration);
    }).observe({ type: 'longtask' });
    const seen = (id, attribute, key) => {
      const element = document.getElementById(id);
      const is = () => (attribute === 'hidden' ? !element.hidden : element.dataset.drawn);
      const observer = new MutationObserver(() => is() && (globalThis[key] ??= performance.now()));
      observer.observe(element, { attributes: true });
    };
    seen('work', 'hidden', 'begun');
    seen('canvas', 'drawn', 'pictured');
    seen('done', 'hidden', 'ended');
  });
  const tracing = await own.newBrowserCDPSession();
  const events = [];
  tracing.on('Tracing.dataCollected', ({ value }) => events.push(...value));
  await tracing.send('Tracing.start', { transferMode: 'ReportEvents', traceConfig: { includedCategories: ['toplevel', '__metadata'] } });
  await tab.setInputFiles('#files', scene(name));
  await tab.waitForFunction(() => globalThis.ended, undefined, { timeout: 600_000 });
  // The world is drawn after the rooms are there.
  await tab.waitForTimeout(3000);
  const ending = new Promise((done) => tracing.once('Tracing.tracingComplete', done));
  await tracing.send('Tracing.end');
  await ending;
  const found = await tab.evaluate(() => ({ all: (ended - begun) / 1000, picture: (pictured - begun) / 1000, longest }));
  await tab.close();
  const at = ({ pid, tid }) => `${pid}/${tid}`;
  const mains = new Set(events.filter((e) => e.name === 'thread_name' && e.args.name === 'CrRendererMain').map(at));
  const times = events.filter((e) => e.ph === 'X' && e.tdur && mains.has(at(e))).map((e) => e.tdur / 1000);
  return { ...found, processor: times.reduce((a, b) => Math.max(a, b), 0) };
}

if (isChosen('page')) {
  const own = await browser();
  const server = await serve({ app: at('dist/app') });
  for (const [name, bar] of [...SCENES, LARGE]) {
    if (!existsSync(scene(name))) continue;
    const all = [];
    for (let i = 0; i < (name === LARGE[0] ? 1 : 3); i++) all.push(await inPage(own, server, name));
    const middle = (key) => median(all.map((one) => one[key]));
    tell('page: from drop to rooms', name, middle('all'), bar, 's');
    tell('page: first picture', name, middle('picture'), 1, 's');
    tell('page: longest task', name, middle('longest'), 50, 'ms', { processor: middle('processor') });
  }
  for (const [name, bar] of SCENES) tell('page: from drop to rooms, at once', name, (await inPage(own, server, name, false)).all, bar, 's');
  await own.close();
  server.close();
}

/** Decides about six openings of a building, that each is one room, two again, and a door; returns what the worlds do not follow. */
async function decisions(name) {
  const files = [{ name: 'scene.glb', bytes: readFileSync(scene(name)) }];
  const before = await bake(files);
  const isRoom = (cell) => before.rooms.some((room) => room.cell === cell && room.kind === 'room');
  const inner = before.openings.filter(({ cells, kind }) => cells.every(isRoom) && kind !== 'window');
  const wrong = [];
  for (const { at, cells, width, height } of inner.slice(0, 6)) {
    const list = (...all) => all.map((is) => `[[decisions]]\nat = [${at}]\nis = "${is}"\n`).join('');
    const of = (...all) => bake(files, { toml: list(...all) });
    const [one, two, door] = [await of('one room'), await of('one room', 'two rooms'), await of('one room', 'a door')];
    const n = ({ rooms }) => rooms.filter(({ kind }) => kind !== 'land').length;
    const near = (found) => found.openings.find((o) => Math.hypot(...o.at.map((x, i) => x - at[i])) < 0.35);
    const is = (found) => near(found) && Math.abs(near(found).width - width) < 0.1 && Math.abs(near(found).height - height) < 0.1;
    if (n(one) !== n(before) - 1) wrong.push(`${at}: ${n(one)} cells for one room of ${cells}`);
    if (n(two) !== n(before) || !is(two)) wrong.push(`${at}: two rooms: ${JSON.stringify(near(two))}`);
    if (n(door) !== n(before) || near(door)?.kind !== 'door') wrong.push(`${at}: a door: ${JSON.stringify(near(door))}`);
  }
  return { wrong, n: Math.min(6, inner.length) };
}

if (isChosen('decisions')) {
  for (const name of ['scenes/duplex', 'scenes/fzk-haus', 'scenes/institute']) {
    if (!existsSync(scene(name))) continue;
    const { wrong, n } = await decisions(name);
    tell('decisions that the world does not follow', `${name}, ${3 * n}`, wrong.length, 0, '');
    for (const why of wrong) console.error(why);
  }
}

if (isChosen('cancel')) {
  const times = [];
  for (const share of [0.2, 0.5, 0.8]) {
    const ending = new AbortController();
    let asked = 0;
    const files = [{ name: 'scene.glb', bytes: readFileSync(scene('scenes/institute')) }];
    const onProgress = ({ index, count }) => {
      if (index < share * count || asked) return;
      setTimeout(() => {
        asked = performance.now();
        ending.abort();
      }, 50);
    };
    await bake(files, { signal: ending.signal, onProgress }).catch(() => undefined);
    times.push(performance.now() - asked);
  }
  tell('cancel', 'scenes/institute', Math.max(...times), 200, 'ms');
}

if (isChosen('node')) {
  await loadBake();
  for (const [name, bar] of [...SCENES, LARGE]) {
    if (!existsSync(scene(name))) continue;
    const files = [{ name: 'scene.glb', bytes: readFileSync(scene(name)) }];
    const [began, before] = [performance.now(), process.cpuUsage()];
    const { memory, rooms } = await bake(files);
    const { user, system } = process.cpuUsage(before);
    // Beside other work, the time on processors says more than that on the clock.
    tell('node', name, (performance.now() - began) / 1000, bar, 's', { processors: (user + system) / 1e6 });
    tell('node: memory', `${name}, ${rooms.length} cells`, memory / 2 ** 20, 700, 'MiB');
  }
}
