// Walked lengths by Recast and Detour, for the row "paths: length" of `bench living`.
//
//   npm install recast-navigation          # in a folder of your own
//   enfilade bake scene.glb -o world.glb
//   NODE_PATH=… node scripts/recast_lengths.mjs world.glb 200 > crates/enfilade-bench/peers/recast-SCENE.csv
//
// Takes the structure of the world (no furniture), as `enfilade path` does, and the same walker: 0.3 m around, 1.8 m high, steps of
// 0.4 m, slopes of 45°, in voxels of a quarter of the radius. Prints pairs of points by chance on Recast's mesh, with the length of
// its straight path in plan and in space; without lengths, pairs that it finds no way between.

import { readFileSync } from 'node:fs';
import { createRequire } from 'node:module';
import { pathToFileURL } from 'node:url';

const require = createRequire(process.env.NODE_PATH ? `${process.env.NODE_PATH}/` : import.meta.url);
const load = (name) => import(pathToFileURL(require.resolve(name)).href);
const { init, NavMeshQuery, setRandomSeed } = await load('recast-navigation');
const { generateSoloNavMesh } = await load('recast-navigation/generators');

/** Positions and indices of all meshes below nodes that are structure. */
function structure(file) {
  const bytes = readFileSync(file);
  const jsonLength = bytes.readUInt32LE(12);
  const gltf = JSON.parse(bytes.subarray(20, 20 + jsonLength).toString());
  const bin = bytes.subarray(20 + jsonLength + 8);
  const read = (index) => {
    const a = gltf.accessors[index];
    const view = gltf.bufferViews[a.bufferView];
    const at = bin.byteOffset + (view.byteOffset ?? 0) + (a.byteOffset ?? 0);
    const n = a.count * (a.type === 'VEC3' ? 3 : 1);
    const Kind = { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array, 5126: Float32Array }[a.componentType];
    return new Kind(bin.buffer.slice(at, at + n * Kind.BYTES_PER_ELEMENT));
  };
  const positions = [];
  const indices = [];
  const visit = (index) => {
    const node = gltf.nodes[index];
    if (['details', 'fixtures', 'enfilade leak path'].includes(node.name)) return;
    for (const primitive of node.mesh === undefined ? [] : gltf.meshes[node.mesh].primitives) {
      const first = positions.length / 3;
      for (const x of read(primitive.attributes.POSITION)) positions.push(x);
      for (const i of read(primitive.indices)) indices.push(first + i);
    }
    (node.children ?? []).forEach(visit);
  };
  gltf.scenes[gltf.scene ?? 0].nodes.forEach(visit);
  return [positions, indices];
}

const [file, count] = process.argv.slice(2);
await init();
setRandomSeed(1);
const [positions, indices] = structure(file);
const [radius, cell] = [0.3, 0.075];
const { success, navMesh, error } = generateSoloNavMesh(positions, indices, {
  cs: cell,
  ch: 0.05,
  walkableSlopeAngle: 45,
  walkableHeight: Math.ceil(1.8 / 0.05),
  walkableClimb: Math.floor(0.4 / 0.05),
  walkableRadius: Math.ceil(radius / cell),
  maxEdgeLen: Math.ceil(12 / cell),
});
if (!success) throw new Error(error);
const query = new NavMeshQuery(navMesh, { maxNodes: 16384 });
const inPlan = (a, b) => Math.hypot(a.x - b.x, a.z - b.z);
const sum = (path, leg) => path.slice(1).reduce((s, p, i) => s + leg(path[i], p), 0);
console.log('x,y,z,x,y,z,length in plan,length');
for (let n = 0, tries = 0; n < Number(count) && tries < 20 * Number(count); tries++) {
  const [a, b] = [0, 1].map(() => query.findRandomPoint().randomPoint);
  const found = query.computePath(a, b, { maxPathPolys: 4096, maxStraightPathPoints: 4096 });
  const path = found.path ?? [];
  const last = path.at(-1);
  const ends = [a.x, a.y, a.z, b.x, b.y, b.z].map((x) => x.toFixed(4)).join();
  // Where it cannot reach the end, Detour goes as near as it can.
  if (!found.success || path.length < 2 || inPlan(last, b) > 0.01 || Math.abs(last.y - b.y) > 0.5) {
    console.log(`${ends},,`);
    continue;
  }
  const plan = sum(path, inPlan);
  if (plan < 2) continue;
  const space = sum(path, (p, q) => Math.hypot(p.x - q.x, p.y - q.y, p.z - q.z));
  console.log(`${ends},${plan.toFixed(4)},${space.toFixed(4)}`);
  n++;
}
