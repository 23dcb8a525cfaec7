// A walk through a world in the browser: first person, with keyboard and mouse or by touch.
import {
  AmbientLight,
  Color,
  DirectionalLight,
  HemisphereLight,
  PerspectiveCamera,
  Scene,
  Vector3,
  WebGLRenderer,
} from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import wasm from '../dist/enfilade.wasm';
import { StreamedWorld } from '../src/stream.js';
import { cullerOf, enfilade, type PortalCuller } from '../src/three.js';
import { EYE, Walker } from './body.js';
import { Controls } from './controls.js';
import { RoomMap } from './map.js';

const element = (id: string): HTMLElement => document.getElementById(id)!;

interface Opened {
  culler: PortalCuller;
  streamed: StreamedWorld | undefined;
  name: string;
}

/** Opens what the page was made for, what its address says, or a world beside it. */
async function open(scene: Scene): Promise<Opened> {
  const asked = new URLSearchParams(location.search).get('world') ?? document.documentElement.dataset['world'];
  const failures: string[] = [];
  for (const name of asked ? [asked] : ['world.enf', 'world.glb']) {
    try {
      const bytes = wasm as Uint8Array<ArrayBuffer>;
      if (/\.glb($|\?)/.test(name)) {
        const gltf = await new GLTFLoader().register(enfilade({ wasm: bytes })).loadAsync(name);
        scene.add(gltf.scene);
        return { culler: cullerOf(gltf), streamed: undefined, name };
      }
      const streamed = await StreamedWorld.open(name, { wasm: bytes });
      scene.add(streamed.scene);
      return { culler: streamed.culler, streamed, name };
    } catch (error) {
      failures.push(`${name}: ${(error as Error).message}`);
    }
  }
  throw new Error(failures.join('\n'));
}

const megabytes = (bytes: number): string => `${(bytes / 1e6).toFixed(2)} MB`;

/** Longest time that a frame makes up for, and the longest step of a walker, who must not jump through a wall. [s] */
const [LONGEST, STEP] = [1, 1 / 30];

async function main(): Promise<void> {
  element('help').textContent = 'loading …';
  const scene = new Scene();
  scene.background = new Color(0xcfd6dd);
  const { culler, streamed, name } = await open(scene);
  const { world } = culler;
  // Doors that are shut in the model hide what is behind them, until they are opened.
  for (const portal of world.portals) {
    if (portal.leaves.length > 0) culler.setOpenness(portal.id, world.openness(portal.id));
  }
  scene.add(new HemisphereLight(0xffffff, 0x8a7f72, 1.6), new AmbientLight(0xffffff, 0.4));
  const camera = new PerspectiveCamera(70, 1, 0.05, 500);
  const lamp = new DirectionalLight(0xffffff, 1.1);
  camera.add(lamp);
  lamp.position.set(0.3, 0.6, 1);
  scene.add(camera);
  const renderer = new WebGLRenderer({ antialias: true });
  document.body.prepend(renderer.domElement);
  const resize = (): void => {
    renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    renderer.setSize(innerWidth, innerHeight);
    camera.aspect = innerWidth / innerHeight;
    camera.updateProjectionMatrix();
  };
  addEventListener('resize', resize);
  resize();

  const walker = Walker.inMiddle(world);
  const controls = new Controls(renderer.domElement);
  controls.yaw = walker.widestView();
  const map = new RoomMap(element('map') as HTMLCanvasElement, world);
  element('help').textContent = controls.isTouch
    ? 'left thumb walks · right thumb looks · tap a door'
    : 'click to look · W A S D walk · E door · F fly · M map · I counters';
  const direction = new Vector3();
  const openDoor = (x: number, y: number): void => {
    direction.set(x, y, 0.5).unproject(camera).sub(camera.position).normalize();
    const hit = culler.pick(camera.position, direction, 4);
    if (hit && hit.portal >= 0) culler.toggle(hit.portal);
  };
  controls.onTap = openDoor;
  controls.onKey = (key) => {
    if (key === 'KeyE') openDoor(0, 0);
    if (key === 'KeyF') walker.flies = !walker.flies;
    if (key === 'KeyC') culler.enabled = !culler.enabled;
    if (key === 'KeyI') element('panel').hidden = !element('panel').hidden;
    if (key === 'KeyM') element('map').hidden = !element('map').hidden;
  };

  let before = performance.now();
  let sinceText = 1;
  const frame = (now: number): void => {
    const seconds = Math.min(LONGEST, (now - before) / 1000);
    before = now;
    // As fast on slow machines: more steps a frame.
    const steps = Math.ceil(seconds / STEP);
    for (let i = 0; i < steps; i++) {
      const [x, up, z] = controls.motion(seconds / steps);
      walker.move(x, up, z);
      walker.fall(seconds / steps);
    }
    culler.animate(seconds);
    camera.position.set(...walker.eye);
    camera.rotation.set(controls.pitch, controls.yaw, 0, 'YXZ');
    const counts = streamed ? streamed.update(camera, now) : undefined;
    if (!streamed) culler.update(camera);
    renderer.render(scene, camera);
    sinceText += seconds;
    if (sinceText < 0.15) return;
    sinceText = 0;
    const { seen } = culler;
    const visible = new Set(seen!.cells.subarray(0, seen!.cellCount));
    map.draw(walker.eye, controls.yaw, visible, (cell) => !streamed || streamed.streamer.isComplete(cell));
    const cell = world.cells[culler.counts.cell];
    element('room').textContent = cell ? cell.name : 'in a wall';
    const lines = [
      `${culler.enabled ? 'visible' : 'culling off'}  ${culler.counts.cells} of ${world.cells.length} rooms`,
      `triangles  ${renderer.info.render.triangles}`,
      `draw calls  ${renderer.info.render.calls}`,
    ];
    if (counts) {
      lines.push(
        `resident  ${megabytes(counts.resident)}, ${counts.residentPieces} of ${streamed!.place.head.pieces.length} pieces`,
        `in flight  ${counts.inFlight}, ${megabytes(counts.inFlightBytes)}`,
        `late  ${counts.late} of ${counts.wanted}`,
        `received  ${megabytes(counts.received)}`,
      );
    }
    element('panel').textContent = lines.join('\n');
  };
  renderer.setAnimationLoop(frame);
  document.title = `A walk: ${name}`;
  const hooks = { world, culler, walker, controls, streamed, camera, renderer, eyeHeight: EYE };
  (globalThis as Record<string, unknown>)['walk'] = hooks;
}

main().catch((error: Error) => {
  element('help').textContent = `${error.message}. A page cannot read files beside it without a server: try python3 -m http.server.`;
});
