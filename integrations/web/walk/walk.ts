// A walk through a world in the browser: first person, with keyboard and mouse or by touch.
import { Vector3, type Scene } from 'three';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import { StreamedWorld } from '../src/stream.js';
import { cullerOf, enfilade, type PortalCuller } from '../src/three.js';
import { EYE, Walker } from './body.js';
import { Controls } from './controls.js';
import { removeFirst, showFirst, type FirstPicture } from './first.js';
import { glazeAll } from './glass.js';
import { made, moduleOfWalk } from './made.js';
import { RoomMap } from './map.js';
import { Obstacles } from './obstacles.js';
import { Stage } from './stage.js';
import { StoreyButtons } from './storeys.js';

const element = (id: string): HTMLElement => document.getElementById(id)!;

interface Opened {
  culler: PortalCuller;
  streamed: StreamedWorld | undefined;
  name: string;
}

/** Opens what the page was made for, what its address says, or a world beside it. */
async function open(scene: Scene): Promise<Opened> {
  const failures: string[] = [];
  const wasm = moduleOfWalk();
  for (const name of made.world ? [made.world] : ['world.enf', 'world.glb']) {
    try {
      if (/\.glb($|\?)/.test(name)) {
        const plugin = enfilade({ wasm: await wasm });
        const gltf = await new GLTFLoader().register(plugin).loadAsync(name);
        scene.add(gltf.scene);
        return { culler: cullerOf(gltf), streamed: undefined, name };
      }
      const streamed = await StreamedWorld.open(name, { wasm });
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

/** Draws the first picture until the world has come: one may look around in it. */
async function begin(stage: Stage, controls: Controls): Promise<FirstPicture | undefined> {
  const first = await showFirst(stage, made.first);
  if (!first) return undefined;
  controls.yaw = first.yaw;
  await new Promise<void>((shown) => {
    let isDrawn = false;
    stage.renderer.setAnimationLoop(() => {
      if (isDrawn) shown();
      stage.aim(first.eye, controls.yaw, controls.pitch);
      stage.drawIfMoved();
      isDrawn = true;
    });
  });
  performance.mark('first room');
  document.querySelector('h1')!.hidden = true;
  return first;
}

/** Connects keys and taps. */
function listen(stage: Stage, controls: Controls, culler: PortalCuller, walker: Walker): void {
  const { camera } = stage;
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
}

async function main(): Promise<void> {
  const stage = new Stage();
  const { scene, camera, renderer } = stage;
  const controls = new Controls(renderer.domElement);
  let first = await begin(stage, controls);
  const { culler, streamed, name } = await open(scene);
  const { world } = culler;
  glazeAll(culler);
  // Doors that are shut in the model hide what is behind them, until they are opened.
  for (const portal of world.portals) {
    if (portal.leaves.length > 0) culler.setOpenness(portal.id, world.openness(portal.id));
  }
  const start = first ?? world.start() ?? { eye: [0, EYE, 0] as [number, number, number], yaw: 0 };
  const walker = new Walker(world, [...start.eye], new Obstacles(culler));
  if (!first) controls.yaw = start.yaw;
  const map = new RoomMap(element('map') as HTMLCanvasElement, world);
  const storeys = new StoreyButtons(element('storeys'), made.storeys ?? [], (storey) => {
    storey.eye.forEach((v, k) => (walker.eye[k] = v));
    controls.yaw = storey.yaw;
  });
  for (const id of ['map', 'room']) element(id).hidden = false;
  document.querySelector('h1')!.hidden = true;
  element('help').textContent = controls.isTouch
    ? 'left thumb walks · right thumb looks · tap a door'
    : 'click to look · W A S D walk · E door · F fly · M map · I counters';
  listen(stage, controls, culler, walker);
  const bar = document.querySelector('progress')!;

  /** Shows the world in place of the first picture once all in view is there. */
  const follow = (isSettled: boolean, share: number): void => {
    bar.value = Math.max(bar.value, 0.5 + 0.5 * share);
    bar.hidden ||= isSettled;
    if (!isSettled && first) return;
    if (streamed && !streamed.scene.parent) scene.add(streamed.scene);
    if (first) removeFirst(first);
    first = undefined;
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
      walker.move(x, up, z, seconds / steps);
      walker.fall(seconds / steps);
    }
    culler.animate(seconds);
    stage.aim(walker.eye, controls.yaw, controls.pitch);
    const counts = streamed ? streamed.update(camera, now) : undefined;
    if (!streamed) culler.update(camera);
    follow(streamed?.streamer.settled ?? true, counts ? 1 - counts.late / Math.max(1, counts.wanted) : 1);
    if (first) stage.drawIfMoved();
    else renderer.render(scene, camera);
    sinceText += seconds;
    if (sinceText < 0.15) return;
    sinceText = 0;
    const { seen } = culler;
    const visible = new Set(seen!.cells.subarray(0, seen!.cellCount));
    map.draw(walker.eye, controls.yaw, visible, (cell) => !streamed || streamed.streamer.isComplete(cell));
    storeys.mark(walker.eye[1]);
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
  if (!document.title) document.title = `A walk: ${name}`;
  const hooks = { world, culler, walker, controls, streamed, camera, renderer, eyeHeight: EYE };
  (globalThis as Record<string, unknown>)['walk'] = hooks;
}

main().catch(made.tell);
