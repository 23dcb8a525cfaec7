// A packed world that streams into three.js, beside the same world loaded whole.
import { DirectionalLight, HemisphereLight, PerspectiveCamera, Scene, WebGLRenderer } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { StreamedWorld } from '../../dist/stream.js';
import { cullerOf, enfilade } from '../../dist/three.js';

const WASM = '/web/dist/enfilade.wasm';
const SIZE = [240, 160];
const soon = () => new Promise((done) => setTimeout(done, 8));

const renderer = new WebGLRenderer({ antialias: false, preserveDrawingBuffer: true });
renderer.setSize(...SIZE, false);
document.body.append(renderer.domElement);

function stage(object) {
  const scene = new Scene();
  const sun = new DirectionalLight(0xffffff, 1.5);
  sun.position.set(3, 7, 5);
  scene.add(object, new HemisphereLight(0xffffff, 0x887766, 1.2), sun);
  return scene;
}

function picture(scene, camera) {
  renderer.render(scene, camera);
  const gl = renderer.getContext();
  const pixels = new Uint8Array(4 * SIZE[0] * SIZE[1]);
  gl.readPixels(0, 0, ...SIZE, gl.RGBA, gl.UNSIGNED_BYTE, pixels);
  return new Uint32Array(pixels.buffer);
}

/** Places to stand: the middles of rooms, in an order in which each is next to an earlier one where possible. */
function stands(world) {
  const [order, done] = [[], new Set()];
  const visit = (cell) => {
    if (done.has(cell)) return;
    done.add(cell);
    const { aabb, kind, portals } = world.cells[cell];
    if (kind === 'room') {
      for (let i = 0; i < 200; i++) {
        const shares = [0.5, 0.5, 0.5].map((v, k) => v + ((i * [0.7548, 0.5698, 0.3267][k]) % 1) - (i ? 0.5 : 0));
        const p = shares.map((v, k) => aabb[k] + (((v % 1) + 1) % 1) * (aabb[k + 3] - aabb[k]));
        if (world.locate(p) !== cell) continue;
        order.push({ cell, p, yaw: i + order.length });
        break;
      }
    }
    for (const id of portals) {
      const { cells, kind: way } = world.portals[id];
      if (way === 'open' || way === 'door') visit(cells[0] === cell ? cells[1] : cells[0]);
    }
  };
  world.cells.forEach((cell) => cell.kind === 'room' && visit(cell.id));
  return order;
}

const camera = new PerspectiveCamera(75, SIZE[0] / SIZE[1], 0.02, 300);

function stand({ p, yaw }) {
  camera.position.set(...p);
  camera.rotation.set(0, yaw, 0, 'YXZ');
}

/** Opens a packed world and waits until the room is complete in which number `i` of `of` stands is. */
globalThis.first = async (address, i, of) => {
  const begin = performance.now();
  const streamed = await StreamedWorld.open(address, { wasm: WASM });
  const places = stands(streamed.world);
  const place = places[Math.floor((i * places.length) / of)];
  stand(place);
  streamed.update(camera);
  while (!streamed.streamer.isComplete(place.cell)) {
    await soon();
    streamed.update(camera);
  }
  const room = { seconds: (performance.now() - begin) / 1000, bytes: streamed.place.received };
  while (!streamed.streamer.settled) {
    await soon();
    streamed.update(camera);
  }
  const view = { seconds: (performance.now() - begin) / 1000, bytes: streamed.place.received };
  streamed.dispose();
  return { room, view };
};

/** Walks from room to room within a budget, and waits in each until all in view is there; returns the most memory. */
globalThis.walk = async (address, share, of) => {
  const options = { wasm: WASM, ahead: 6 };
  const probe = await StreamedWorld.open(address, options);
  const pieces = probe.place.head.pieces.reduce((sum, piece) => sum + piece[2], 0);
  const head = probe.place.head.hollow.length + probe.place.head.skeleton.length;
  probe.dispose();
  const maxResident = share * (pieces + head) - head;
  const streamed = await StreamedWorld.open(address, { ...options, maxResident });
  const places = stands(streamed.world);
  let [most, stuck] = [0, 0];
  for (let i = 0; i < of; i++) {
    stand(places[Math.floor((i * places.length) / of)]);
    streamed.update(camera);
    const end = performance.now() + 20_000;
    let isWaiting = true;
    while (isWaiting && performance.now() < end) {
      await soon();
      streamed.update(camera);
      most = Math.max(most, streamed.streamer.counts.resident);
      const { seen } = streamed.culler;
      isWaiting = ![...seen.cells.subarray(0, seen.cellCount)].every((cell) => streamed.streamer.isComplete(cell));
    }
    stuck += isWaiting;
  }
  const { received } = streamed.place;
  streamed.dispose();
  return { share: (most + head) / (pieces + head), megabytes: (most + head) / 1e6, whole: (pieces + head) / 1e6, stuck, received, stands: of };
};

/** Compares pictures of the streamed world, once all in view has come, with those of the whole file. */
globalThis.same = async (packed, whole, of) => {
  const gltf = await new GLTFLoader().register(enfilade({ wasm: WASM })).loadAsync(whole);
  const culler = cullerOf(gltf);
  const streamed = await StreamedWorld.open(packed, { wasm: WASM });
  const scenes = [stage(gltf.scene), stage(streamed.scene)];
  const places = stands(culler.world);
  // Where two surfaces touch, the one drawn last shows: both scenes draw in the order of the file.
  const order = new Map();
  const number = ({ parts }) => {
    parts.batches.forEach((object, i) => object && order.set(object, i));
    parts.details.forEach((object, i) => object?.traverse((own) => order.set(own, parts.batches.length + i)));
  };
  renderer.setOpaqueSort((a, b) => (order.get(a.object) ?? 0) - (order.get(b.object) ?? 0));
  const out = { views: 0, differing: 0, colors: 0 };
  for (let i = 0; i < of; i++) {
    stand(places[Math.floor((i * places.length) / of)]);
    do {
      await soon();
      streamed.update(camera);
    } while (!streamed.streamer.settled);
    // Pictures are decoded beside the frames.
    await new Promise((done) => setTimeout(done, 60));
    culler.update(camera);
    [culler, streamed.culler].forEach(number);
    const [a, b] = scenes.map((scene) => picture(scene, camera));
    out.views++;
    let differing = 0;
    for (let k = 0; k < a.length; k++) differing += a[k] !== b[k];
    out.differing += differing;
    if (differing > 0) {
      out.pictures = scenes.map((scene) => (picture(scene, camera), renderer.domElement.toDataURL()));
      out.where = { differing, cell: culler.counts.cell, own: { ...culler.counts }, streamed: { ...streamed.culler.counts } };
    }
    out.colors += new Set(a).size;
  }
  return out;
};



/** Loads the whole file, and returns the time until it could be drawn. */
globalThis.whole = async (address) => {
  const begin = performance.now();
  const gltf = await new GLTFLoader().register(enfilade({ wasm: WASM })).loadAsync(address);
  cullerOf(gltf);
  const { transferSize, encodedBodySize } = performance.getEntriesByType('resource').find(({ name }) => name.endsWith('.glb'));
  return { seconds: (performance.now() - begin) / 1000, bytes: encodedBodySize || transferSize };
};
globalThis.ready = true;
