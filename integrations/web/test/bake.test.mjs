// The bake in WebAssembly: the bytes of the native command, in every format; what is wrong is said; what is cancelled ends.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from 'node:fs';
import { tmpdir } from 'node:os';
import { join } from 'node:path';
import { after, test } from 'node:test';
import { fileURLToPath } from 'node:url';
import { BakeFailure, bake } from '../dist/bake.js';
import { command } from '../scripts/worlds.mjs';
import { bakeMutants } from './mutants.mjs';
import { formats, scaled, turned } from './rooms.mjs';

/** Scenes, the quickest first: the gate compares as many as it has time for; ENFILADE_BAKES=10 compares ten. */
const SCENES = [
  'scenes/samplehouse4', 'scenes/aws-small-house', 'scenes/jasmin-sun', 'scenes/duplex', 'scenes/fzk-haus', 'scenes/clearpath-office',
  'scenes3/revit-demo2', 'scenes3/edu-school', 'scenes2/procthor4', 'scenes2/smiley-west', 'scenes/institute', 'scenes/kit-edc',
];
const N_SCENES = Number(process.env.ENFILADE_BAKES ?? 4);

const shared = process.env.ENFILADE_SHARED ?? fileURLToPath(new URL('../../../../shared', import.meta.url));
const folder = mkdtempSync(join(tmpdir(), 'enfilade-'));
after(() => rmSync(folder, { recursive: true }));

/** Bakes files by the command; returns the world and the plan. */
function native(files, detail = []) {
  const path = ({ name, bytes }) => {
    writeFileSync(join(folder, name), bytes);
    return join(folder, name);
  };
  const paths = files.map(path).filter((name) => /\.(glb|gltf|obj|ply|stl|map)$/.test(name));
  const [world, plan] = [join(folder, 'world.glb'), join(folder, 'plan.svg')];
  const run = (...args) => execFileSync(command, ['-q', ...args], { stdio: ['ignore', 'ignore', 'pipe'] });
  run('bake', '--threads', '1', '--allow-empty', ...paths, ...detail.flatMap((file) => ['--detail', path(file)]), '-o', world);
  run('plan', world, '-o', plan);
  return { world: readFileSync(world), plan: readFileSync(plan, 'utf8') };
}

async function compare(files, detail = []) {
  const steps = [];
  const baked = await bake(files, { detail, allowEmpty: true, onProgress: (step) => steps.push(step) });
  const own = native(files, detail);
  assert.ok(Buffer.from(baked.world).equals(own.world), 'the world has other bytes');
  assert.equal(baked.plan, own.plan);
  assert.equal(steps[0].stage, 'reading');
  assert.equal(steps.at(-1).stage, 'plan');
  assert.ok(steps.every(({ index, count }) => index < count));
  return baked;
}

for (const name of SCENES.slice(0, N_SCENES)) {
  const at = (part) => join(shared, name, `${part}.glb`);
  if (!existsSync(at('scene'))) continue;
  test(`${name}: world and plan have the bytes of the command`, async () => {
    const file = (part) => (existsSync(at(part)) ? [{ name: `${part}.glb`, bytes: readFileSync(at(part)) }] : []);
    const { rooms, text } = await compare(file('scene'), file('detail'));
    assert.ok(rooms.some(({ kind, floorArea }) => kind === 'room' && floorArea > 1), text);
  });
}

// Walls askew are found by lengths and angles, of which each system has its own last bit.
const buildings = { ...formats, 'turned by 7°': turned(7), 'turned by 17°': turned(17) };
for (const [name, files] of Object.entries(buildings)) {
  test(`${name}: world and plan have the bytes of the command`, async () => {
    const { rooms, storeys, verdict } = await compare(files);
    const areas = rooms.filter(({ kind }) => kind === 'room').map(({ floorArea }) => floorArea);
    assert.equal(areas.length, 2);
    for (const area of areas) assert.ok(Math.abs(area - 15.6) < 0.3, `${areas}`);
    assert.equal(storeys.length, 1);
    assert.ok(['good', 'fair', 'low'].includes(verdict.trust));
  });
}

const failed = async (files, options) => {
  const why = await bake(files, options).then(() => assert.fail('it was baked'), (error) => error);
  assert.ok(why instanceof BakeFailure, String(why.stack));
  return why;
};

test('what is wrong is a sentence with its kind, and the next file is baked', async () => {
  const junk = await failed([{ name: 'a.glb', bytes: Buffer.from('glTF and no more') }]);
  assert.equal(junk.kind, 'files');
  assert.equal((await failed([])).kind, 'files');
  const bin = await failed([formats.gltf[0]]);
  assert.match(bin.message, /my%20rooms\.bin.*give it, too/);
  const setting = await failed(formats.stl, { settings: { voxell: 1 } });
  assert.deepEqual([setting.kind, /voxell/.test(setting.message)], ['settings', true]);
  const toml = await failed(formats.stl, { toml: 'voxel = -1' });
  assert.match(toml.message, /line 1/);
  const memory = await failed(formats.stl, { maxMemory: 1000 });
  assert.match(memory.message, /memory/);
  const time = await failed(formats.stl, { maxTime: 0 });
  assert.match(time.message, /allowed/);
  assert.equal((await bake(formats.stl)).rooms.filter(({ kind }) => kind === 'room').length, 2);
});

test('a wrong unit is a question, and its answer bakes', async () => {
  const why = await failed(scaled(1000));
  assert.deepEqual(why.questions.map(({ about, proposed }) => [about, proposed]), [['unit', 'mm']], why.message);
  const baked = await bake(scaled(1000), { settings: { unit: 'mm' } });
  assert.equal(baked.rooms.filter(({ kind }) => kind === 'room').length, 2);
});

test('a bake is cancelled in the middle of a stage, at once', async () => {
  const ending = new AbortController();
  let at = 0;
  const onProgress = ({ stage }) => {
    if (stage !== 'voxelize') return;
    setTimeout(() => {
      at = performance.now();
      ending.abort(new Error('enough'));
    }, 20);
  };
  await assert.rejects(bake(formats.stl, { settings: { voxel: 0.0125 }, signal: ending.signal, onProgress }), /enough/);
  // 200 ms are the bar of the measurement; here other programs may run.
  assert.ok(at > 0 && performance.now() - at < 2000);
  await assert.rejects(bake(formats.stl, { signal: AbortSignal.abort(new Error('never')) }), /never/);
});

test('the thread that calls can bake, too', async () => {
  const [inline, threaded] = [await bake(formats.ply, { worker: false }), await bake(formats.ply)];
  assert.ok(Buffer.from(inline.world).equals(Buffer.from(threaded.world)));
  const stop = () => {
    throw new Error('stopped by progress');
  };
  await assert.rejects(bake(formats.ply, { worker: false, onProgress: stop }), /stopped by progress/);
});

test('damaged files end in a sentence, each, and the next file is baked', async () => {
  const n = Number(process.env.BAKE_MUTANTS ?? 100);
  const { wrong, worlds, kinds, sound, unsound } = await bakeMutants(n);
  assert.deepEqual(wrong, []);
  assert.equal(worlds + Object.values(kinds).reduce((a, b) => a + b, 0), n);
  assert.deepEqual([sound, unsound], [Math.floor(n / 100), 0]);
});
