// A world in three.js, with functions that the tests call.
import { AmbientLight, DirectionalLight, HemisphereLight, PerspectiveCamera, PointLight, Raycaster, Scene, Vector2, WebGLRenderer } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { cullerOf, enfilade } from '../../dist/three.js';
import { World } from '../../dist/index.js';

const WASM = '/web/dist/enfilade.wasm';
const SIZE = [320, 200];

/** Random numbers: mulberry32. */
function random(seed) {
  let state = seed >>> 0;
  return () => {
    state = (state + 0x6d2b79f5) >>> 0;
    let t = Math.imul(state ^ (state >>> 15), state | 1);
    t ^= t + Math.imul(t ^ (t >>> 7), t | 61);
    return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
  };
}

/** Opens a world with lights in it. */
async function open(address) {
  const gltf = await new GLTFLoader().register(enfilade({ wasm: WASM })).loadAsync(address);
  const culler = cullerOf(gltf);
  const scene = new Scene();
  scene.add(gltf.scene, new HemisphereLight(0xffffff, 0x887766, 1.2), new AmbientLight(0xffffff, 0.2));
  const sun = new DirectionalLight(0xffffff, 1.5);
  sun.position.set(3, 7, 5);
  scene.add(sun);
  // A lamp in each of eight rooms, which reaches as far as the next rooms.
  const rooms = culler.world.cells.filter((cell) => cell.kind === 'room');
  for (let i = 0; i < 8 && rooms.length > 0; i++) {
    const { aabb } = rooms[Math.floor((i * rooms.length) / 8)];
    const lamp = new PointLight(0xffddaa, 6, 5);
    lamp.position.set(...[0, 1, 2].map((k) => (aabb[k] + aabb[k + 3]) / 2));
    gltf.scene.add(lamp);
    culler.parts.lights.push(lamp);
  }
  const camera = new PerspectiveCamera(70, SIZE[0] / SIZE[1], 0.02, 300);
  const renderer = new WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
  renderer.setSize(...SIZE, false);
  document.body.append(renderer.domElement);
  return { gltf, culler, world: culler.world, scene, camera, renderer };
}

/** Returns true if a surface is so near that the camera's near plane, 0.02 m away and 0.035 m at its vertices, may cut it. */
function isAtSurface(world, p) {
  for (let i = 0; i < 27; i++) {
    const d = [(i % 3) - 1, (Math.floor(i / 3) % 3) - 1, Math.floor(i / 9) - 1];
    if (i !== 13 && world.pick(p, p.map((v, k) => v + (0.1 * d[k]) / Math.hypot(...d)))) return true;
  }
  return false;
}

/** Places the camera in a random room. */
function place({ world, camera }, next) {
  for (;;) {
    const cell = world.cells[Math.floor(next() * world.cells.length)];
    const p = [0, 1, 2].map((k) => cell.aabb[k] + next() * (cell.aabb[k + 3] - cell.aabb[k]));
    if (world.locate(p) < 0 || isAtSurface(world, p)) continue;
    camera.position.set(...p);
    camera.rotation.set((next() - 0.5) * 1.2, next() * 2 * Math.PI, 0, 'YXZ');
    return;
  }
}

/** Places the camera at a shut door, 0.8 m before one of its sides, as high as its middle; false if that is in a wall. */
function placeAt({ world, camera }, { outline, normal }, side) {
  const middle = [0, 1, 2].map((k) => outline.filter((_, i) => i % 3 === k).reduce((a, b) => a + b) / (outline.length / 3));
  const p = middle.map((v, k) => v + 0.8 * side * normal[k]);
  if (world.locate(p) < 0 || isAtSurface(world, p)) return false;
  camera.position.set(...p);
  camera.lookAt(...middle);
  return true;
}

function picture({ renderer, scene, camera }) {
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  const pixels = new Uint8Array(4 * SIZE[0] * SIZE[1]);
  gl.readPixels(0, 0, ...SIZE, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return new Uint32Array(pixels.buffer);
}

/**
 * Returns true if a pixel that differs is right in both pictures: some ray through its middle, or within a 32nd of a pixel
 * of it, meets something first that the culled picture has. Then the pixel lies on an edge, or looks through a crack of
 * the drawing alone. The rays are three's own, against all triangles.
 */
function isOnEdge(stage, visible, x, y) {
  const caster = new Raycaster();
  for (const [dx, dy] of [[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]]) {
    const at = new Vector2(((x + 0.5 + dx / 32) / SIZE[0]) * 2 - 1, ((y + 0.5 + dy / 32) / SIZE[1]) * 2 - 1);
    caster.setFromCamera(at, stage.camera);
    const hit = caster.intersectObject(stage.gltf.scene, true).find(({ object }) => !stage.absent.has(object));
    if (hit && visible.has(hit.object)) return true;
  }
  return false;
}

/** Lists the objects that are drawn, with all above them. */
function drawn(root) {
  const out = new Set();
  root.traverseVisible((object) => out.add(object));
  return out;
}

/** Moves doors and places the camera for view `i`: one in three at a door, all doors shut, where gaps around leaves show. */
function arrange(stage, doors, i, next) {
  const { culler } = stage;
  place(stage, next);
  if (doors.length === 0) return;
  if (i % 3 > 0) {
    culler.setOpenness(doors[Math.floor(next() * doors.length)].id, [0, 0.4, 1][Math.floor(next() * 3)]);
    return;
  }
  for (const { id } of doors) culler.setOpenness(id, 0);
  const door = doors[Math.floor(i / 3) % doors.length];
  void (placeAt(stage, door, 1) || placeAt(stage, door, -1));
}

/** Draws `n` views with and without culling; counts the views and pixels that differ, and what was drawn. */
globalThis.compare = async (address, n, seed) => {
  const stage = await open(address);
  const next = random(seed);
  const { culler, renderer, world } = stage;
  const out = { views: 0, differing: 0, pixels: 0, edges: 0, lost: 0, colors: 0, callsOn: 0, callsOff: 0, hiddenLights: 0, worst: [] };
  const doors = world.portals.filter((portal) => portal.leaves.length > 0);
  for (let i = 0; i < n; i++) {
    arrange(stage, doors, i, next);
    culler.enabled = true;
    culler.update(stage.camera);
    const on = picture(stage);
    const visible = drawn(stage.gltf.scene);
    out.callsOn += renderer.info.render.calls;
    out.hiddenLights += culler.parts.lights.filter((light) => !light.visible).length;
    culler.enabled = false;
    const off = picture(stage);
    out.callsOff += renderer.info.render.calls;
    stage.absent = new Set();
    const all = drawn(stage.gltf.scene);
    stage.gltf.scene.traverse((object) => all.has(object) || stage.absent.add(object));
    let [differing, lost] = [0, 0];
    for (let k = 0; k < on.length; k++) {
      if (on[k] === off[k]) continue;
      differing++;
      if (lost < 50 && !isOnEdge(stage, visible, k % SIZE[0], Math.floor(k / SIZE[0]))) lost++;
    }
    out.lost += lost;
    out.edges += differing - lost;
    out.views++;
    out.pixels += differing;
    out.differing += differing > 0;
    out.colors += new Set(on).size;
    if (lost > 0) out.worst.push({ view: i, lost, at: stage.camera.position.toArray(), rotation: stage.camera.rotation.toArray() });
  }
  out.worst.sort((a, b) => b.lost - a.lost).splice(5);
  return out;
};

/** Measures the time of `see` and of a whole update, and the garbage of a frame. */
globalThis.cost = async (address, views) => {
  const stage = await open(address);
  const { culler, camera, world } = stage;
  const next = random(7);
  const times = { see: [], update: [] };
  const eye = new Float32Array(3);
  const measure = (list, body) => {
    const repeats = 20;
    const begin = performance.now();
    for (let k = 0; k < repeats; k++) body();
    list.push((1000 * (performance.now() - begin)) / repeats);
  };
  for (let i = 0; i < views; i++) {
    place(stage, next);
    camera.updateMatrixWorld();
    camera.position.toArray(eye);
    const matrix = camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements;
    measure(times.see, () => world.see(eye, matrix));
    measure(times.update, () => culler.update(camera));
  }
  const median = (list) => list.sort((a, b) => a - b)[list.length >> 1];
  // Bytes a frame that the collector would have to collect, once everything is compiled.
  const garbageOf = (body) => {
    const frames = 20_000;
    for (let i = 0; i < frames; i++) body(i);
    globalThis.gc?.();
    const before = performance.memory.usedJSHeapSize;
    for (let i = 0; i < frames; i++) body(i);
    return Math.max(0, performance.memory.usedJSHeapSize - before) / frames;
  };
  const matrices = Array.from({ length: 64 }, () => {
    place(stage, next);
    camera.updateMatrixWorld();
    return { eye: camera.position.toArray(), matrix: camera.projectionMatrix.clone().multiply(camera.matrixWorldInverse).elements };
  });
  const garbage = {
    nothing: garbageOf(() => undefined),
    see: garbageOf((i) => world.see(matrices[i % 64].eye, matrices[i % 64].matrix)),
    update: garbageOf(() => culler.update(camera)),
  };
  return { see: median(times.see), update: median(times.update), garbage };
};

globalThis.World = World;
globalThis.ready = true;

/** Returns view number `view` of `compare` with and without culling, as addresses of pictures. */
globalThis.pictures = async (address, view, seed) => {
  const stage = await open(address);
  const next = random(seed);
  const { culler, renderer, world } = stage;
  const doors = world.portals.filter((portal) => portal.leaves.length > 0);
  for (let i = 0; i <= view; i++) {
    arrange(stage, doors, i, next);
  }
  const out = [];
  for (const isOn of [true, false]) {
    culler.enabled = isOn;
    culler.update(stage.camera);
    renderer.render(stage.scene, stage.camera);
    out.push(renderer.domElement.toDataURL());
  }
  return [...out, { counts: culler.counts, cell: world.cells[culler.counts.cell]?.name }];
};
