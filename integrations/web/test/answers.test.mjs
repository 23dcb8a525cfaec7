// Covers R1, R3 and P6 in WebAssembly: the same answers in the same order as the native library.
import assert from 'node:assert/strict';
import { execFileSync } from 'node:child_process';
import { readFileSync } from 'node:fs';
import { test } from 'node:test';
import { Runtime, World } from '../dist/index.js';
import { takeApart, withoutPictures } from '../dist/glb.js';
import { command, folder, worlds } from '../scripts/worlds.mjs';
import { difference, nativeAnswers } from './native.mjs';

const VIEWS = 10_000;
const names = worlds(VIEWS);
const file = (name) => readFileSync(`${folder}/${name}.glb`);

for (const name of names) {
  test(`${name}: cells, portals, chunks, batches, details, lines of sight and picks are the native ones`, async () => {
    const world = await World.open(file(name));
    let views = 0;
    for (const native of nativeAnswers(`${folder}/${name}.${VIEWS}.answers`)) {
      assert.equal(difference(world, native), undefined, `view ${native.view}`);
      views++;
    }
    assert.equal(views, VIEWS);
    world.close();
  });

  test(`${name}: a hollow world, as a packed one has it, sees the same`, async () => {
    const { decodeHead } = await import('../dist/packed.js');
    const head = decodeHead(new Uint8Array(readFileSync(`${folder}/${name}.enf/head.enfp`)));
    const [whole, hollow] = [await World.open(file(name)), World.hollow(await Runtime.load(), head.hollow, head.skeleton)];
    let views = 0;
    for (const { eye, matrix } of nativeAnswers(`${folder}/${name}.${VIEWS}.answers`)) {
      const a = whole.see(eye, matrix);
      const own = [[...a.chunks.subarray(0, a.chunkCount)], [...a.details.subarray(0, a.detailCount)]];
      const b = hollow.see(eye, matrix);
      assert.deepEqual([[...b.chunks.subarray(0, b.chunkCount)], [...b.details.subarray(0, b.detailCount)]], own);
      if (++views === 500) break;
    }
    whole.close();
    hollow.close();
  });
}

test('graph: each cell knows its portals, each portal its cells and leaves; a pvs row holds the cell itself', async () => {
  const world = await World.open(file('demo'));
  assert.equal(world.cells.length, 13);
  for (const cell of world.cells) {
    for (const id of cell.portals) assert.ok(world.portals[id].cells.includes(cell.id));
    assert.ok(world.pvs(cell.id).includes(cell.id));
  }
  const doors = world.portals.filter((portal) => portal.kind === 'door');
  assert.equal(doors.length, 9);
  for (const { id, leaves } of doors) for (const { detail } of leaves) assert.ok(world.portalsOfDetail(detail).includes(id));
  world.close();
});

test('rooms have the facts that the command tells', async () => {
  const said = JSON.parse(execFileSync(command, ['inspect', `${folder}/demo.glb`, '--json'], { maxBuffer: 1 << 28 }));
  const world = await World.open(file('demo'));
  const near = (a, b) => assert.ok(Math.abs(a - b) < 1e-3, `${a} for ${b}`);
  let rooms = 0;
  for (const { id, room } of world.cells) {
    const told = said.cells[id];
    assert.equal(room === undefined, told.floor_area === undefined);
    if (!room) continue;
    rooms++;
    assert.deepEqual(room.storeys, told.storeys);
    near(room.floorArea, told.floor_area);
    near(room.areaAbove1_5, told.area_above_1_5);
    near(room.areaAbove2_3, told.area_above_2_3);
    near(room.height, told.height);
    assert.deepEqual([room.doors, room.windows], [told.doors, told.windows]);
  }
  assert.equal(rooms, 12);
  world.close();
});

test('a shut door hides the room behind it, and its leaf moves', async () => {
  const world = await World.open(file('demo'));
  const pose = new Float32Array(16);
  const doors = world.portals.filter(({ kind, leaves }) => kind === 'door' && leaves.length > 0);
  assert.equal(world.pose(doors[0].leaves[0].detail, pose), false);
  for (const { id } of doors) world.setOpenness(id, 0);
  // One sees through those with leaves of glass.
  const door = doors.find(({ id }) => !world.isOpen(id));
  const middle = [0, 1, 2].map((k) => (door.outline[k] + door.outline[k + 6]) / 2 - 0.3 * door.normal[k]);
  const cellsOf = () => [...world.seeAround(middle).cells.subarray(0, world.seeAround(middle).cellCount)];
  assert.ok(!cellsOf().includes(door.cells[1]));
  world.setOpenness(door.id, 0.5);
  assert.equal(world.isOpen(door.id), true);
  assert.ok(cellsOf().includes(door.cells[1]));
  assert.ok(Math.abs(world.openness(door.id) - 0.5) < 1e-6);
  assert.equal(world.pose(door.leaves[0].detail, pose), true);
  assert.notDeepEqual([...pose], [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]);
  world.close();
});

test('what is not a world, and what does not exist, are errors that say why', async () => {
  await assert.rejects(World.open(new Uint8Array([1, 2, 3])), /not a GLB/);
  const whole = new Uint8Array(file('demo'));
  const { text, bin } = takeApart(whole);
  const runtime = await Runtime.load();
  assert.throws(() => World.ofParts(runtime, text.replace('"portals":[', '"portals":[{},'), bin), /JSON is damaged/);
  assert.throws(() => World.ofParts(runtime, text, bin.subarray(0, 1000)));
  const world = await World.open(whole);
  assert.throws(() => world.setOpenness(9999, 1), /no portal 9999; there are 29/);
  assert.throws(() => world.see([0, 0, 0], new Float32Array(16)), /not a perspective/);
  assert.throws(() => world.locate([NaN, 0, 0]), /not finite/);
  world.close();
});

test('a file without its pictures keeps every other byte of its numbers, and the sign of -0', () => {
  const json = { 'a"b': '}{', bufferViews: [{ buffer: 0, byteLength: 3 }, { buffer: 0, byteOffset: 4, byteLength: 4 }], images: [{ bufferView: 0 }] };
  const text = JSON.stringify({ ...json, buffers: [{ byteLength: 8 }] }).replace('}{', '}{\\"bufferViews\\":[-0.0]');
  const lean = takeApart(withoutPictures(`{"x":[-0.0,{"buffers":1}],${text.slice(1)}`, new Uint8Array([1, 2, 3, 0, 5, 6, 7, 8])));
  assert.ok(lean.text.startsWith('{"x":[-0.0,{"buffers":1}],'));
  assert.ok(lean.text.includes('}{\\"bufferViews\\":[-0.0]'));
  assert.deepEqual(lean.json.bufferViews.map((view) => view.byteLength), [0, 4]);
  assert.deepEqual([...lean.bin.subarray(0, 4)], [5, 6, 7, 8]);
});
