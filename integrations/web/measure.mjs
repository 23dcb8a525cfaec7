// Prints the figures of this package as lines of JSON: row, scene, value, bar, ok. `--quick` takes fewer views.
import { gzipSync } from 'node:zlib';
import { readFileSync, statSync } from 'node:fs';
import { World } from './dist/index.js';
import { folder, worlds } from './scripts/worlds.mjs';
import { at, browser, page, visit } from './test/browser.mjs';
import { difference, nativeAnswers } from './test/native.mjs';
import { serve } from './test/server.mjs';

const isQuick = process.argv.includes('--quick');
const VIEWS = 10_000;
const names = worlds(VIEWS);
let failures = 0;

/** Prints a row; `bar` is the most that is allowed. */
function row(name, scene, value, bar, more = {}) {
  const ok = bar === undefined || value <= bar;
  failures += !ok;
  console.log(JSON.stringify({ row: name, scene, value, bar, ok, ...more }));
}

const wasm = readFileSync(at('dist/enfilade.wasm'));
row('web module, kB gzipped', 'enfilade.wasm', gzipSync(wasm, { level: 9 }).length / 1000, undefined, { kB: wasm.length / 1000 });
for (const name of ['code', 'module']) row(`web walk, kB of its ${name}`, 'demo', statSync(at(`dist/walk/walk-${name}.bin`)).size / 1000);

for (const name of names) {
  const world = await World.open(readFileSync(`${folder}/${name}.glb`));
  let differing = 0;
  for (const native of nativeAnswers(`${folder}/${name}.${VIEWS}.answers`)) differing += difference(world, native) !== undefined;
  row(`web answers: views of ${VIEWS} that differ from native ones`, name, differing, 0);
  world.close();
}

const [fast, slow] = [await serve({ web: at(''), worlds: folder }), await serve({ web: at(''), worlds: folder }, { pace: 1e6, latency: 50 })];
const own = await browser();
const open = async (server, name) => (await visit(own, `${server.address}/${await page(name)}`)).tab;
try {
  let tab = await open(fast, 'views');
  for (const name of names) {
    const cost = await tab.evaluate((file) => globalThis.cost(file, 500), `/worlds/${name}.glb`);
    row('web cost: see, median, µs', name, cost.see, 50, { update: cost.update });
    row('web cost: garbage of see, bytes a frame', name, Math.max(0, Math.round(cost.garbage.see - cost.garbage.nothing)), 0, { update: cost.garbage.update });
  }
  for (const name of names) {
    const out = await tab.evaluate(([file, n]) => globalThis.compare(file, n, 2), [`/worlds/${name}.glb`, isQuick ? 20 : 200]);
    const more = { views: out.views, onEdges: out.edges, of: out.views * 64_000, drawCalls: [out.callsOn, out.callsOff] };
    row('web pictures: pixels that culling loses', name, out.lost, 0, more);
  }
  await tab.close();
  if (names.includes('institute')) {
    tab = await open(fast, 'stream');
    const same = await tab.evaluate(([n]) => globalThis.same('/worlds/furnished.enf', '/worlds/furnished.glb', n), [isQuick ? 10 : 60]);
    row('web pictures: pixels of streamed views that differ from the whole file', 'furnished institute', same.differing, 0, { views: same.views });
    const walk = await tab.evaluate(() => globalThis.walk('/worlds/furnished.enf', 0.25, 60));
    row('web bytes: resident on a walk, of all', 'furnished institute', walk.share, 0.25, { MB: walk.megabytes, incompleteViews: walk.stuck });
    row('web bytes: views of that walk that stay incomplete', 'furnished institute', walk.stuck, 0);
    await tab.close();
    tab = await open(slow, 'stream');
    const whole = await tab.evaluate(() => globalThis.whole('/worlds/furnished.glb'));
    let [bytes, seconds] = [0, 0];
    const of = isQuick ? 4 : 16;
    for (let i = 0; i < of; i++) {
      const { room } = await tab.evaluate(([i, of]) => globalThis.first('/worlds/furnished.enf', i, of), [i, of]);
      [bytes, seconds] = [Math.max(bytes, room.bytes), Math.max(seconds, room.seconds)];
    }
    row('web bytes: until the first room is complete, of the whole file', 'furnished institute', bytes / whole.bytes, 0.1, { MB: bytes / 1e6, starts: of });
    row('web bytes: time until the first room is complete at 1 MB/s, of the whole file', 'furnished institute', seconds / whole.seconds, 0.1, { seconds, whole: whole.seconds });
  }
} finally {
  await own.close();
  fast.close();
  slow.close();
}
process.exitCode = failures > 0 ? 1 : 0;
