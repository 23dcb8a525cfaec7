// Figures of the page that bakes, as JSON lines: sizes; from drop to rooms, the first picture, the longest time that the page
// did not answer; cancelling; and large scenes in node. ENFILADE_SHARED is the folder of scenes; arguments choose rows by name.
import { existsSync, readFileSync } from 'node:fs';
import { join } from 'node:path';
import { fileURLToPath } from 'node:url';
import { brotliCompressSync } from 'node:zlib';
import { bake, loadBake } from './dist/bake.js';
import { at, browser } from './test/browser.mjs';
import { serve } from './test/server.mjs';

const shared = process.env.ENFILADE_SHARED ?? fileURLToPath(new URL('../../../shared', import.meta.url));
const chosen = process.argv.slice(2);
const isChosen = (row) => chosen.length === 0 || chosen.some((name) => row.startsWith(name));
const tell = (row, scene, value, bar, unit, more = {}) => console.log(JSON.stringify({ row, scene, value, bar, unit, ok: value <= bar, ...more }));
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
const scene = (name) => join(shared, name, 'scene.glb');

if (isChosen('size')) {
  const brotli = (names) => names.reduce((sum, name) => sum + brotliCompressSync(readFileSync(at(`dist/app/${name}`))).length, 0);
  tell('size', 'module, brotli', brotli(['enfilade-bake.wasm']) / 1e6, 1.6, 'MB');
  tell('size', 'page, brotli', brotli(['index.html', 'app.css', 'app.js', 'bake-worker.js']) / 1e3, 250, 'kB');
}

const SCENES = [['scenes/duplex', 2], ['scenes/institute', 4]].filter(([name]) => existsSync(scene(name)));
if (isChosen('page')) {
  const own = await browser();
  const server = await serve({ app: at('dist/app') });
  for (const [name, bar] of SCENES) {
    const [rooms, picture, blocked] = [[], [], []];
    for (let i = 0; i < 3; i++) {
      const tab = await own.newPage({ viewport: { width: 1280, height: 900 } });
      await tab.goto(`${server.address}/app/`);
      await tab.waitForFunction(() => document.documentElement.dataset.ready);
      await tab.evaluate(() => {
        globalThis.longest = 0;
        new PerformanceObserver((list) => {
          for (const { duration } of list.getEntries()) globalThis.longest = Math.max(globalThis.longest, duration);
        }).observe({ type: 'longtask' });
        const seen = (id, key) => {
          const observer = new MutationObserver(() => {
            if (document.getElementById(id).hidden) return;
            globalThis[key] ??= performance.now();
          });
          observer.observe(document.getElementById(id), { attributes: true });
        };
        seen('work', 'begun');
        seen('model', 'pictured');
        seen('done', 'ended');
      });
      await tab.setInputFiles('#files', scene(name));
      await tab.waitForFunction(() => globalThis.ended, undefined, { timeout: 120_000 });
      const found = await tab.evaluate(() => ({ all: ended - begun, picture: pictured - begun, longest }));
      rooms.push(found.all / 1000);
      picture.push(found.picture / 1000);
      blocked.push(found.longest);
      await tab.close();
    }
    tell('page: from drop to rooms', name, median(rooms), bar, 's');
    tell('page: first picture', name, median(picture), 1, 's');
    tell('page: longest task', name, median(blocked), 50, 'ms');
  }
  await own.close();
  server.close();
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
  for (const [name, bar] of [...SCENES, ['scenes2/clinic', 30]]) {
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
