// The model in three dimensions, cut open above the floor of a storey, with its rooms in color. Another thread draws it
// (model-worker.ts): here are the camera and what the person does.
import { Box3, PerspectiveCamera, Vector3 } from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import type { Baked, BakedRoom } from '../src/bake.js';
import type { Asked, Told } from './model-worker.js';
import type { Pointing } from './plan.js';

/** Height above a floor at which walls are cut. [Units: m] */
const CUT = 1.4;
/** Height of a cut that cuts nothing. [Units: m] */
const NO_CUT = 1e9;
/** Pointers that move less between down and up have clicked. [Units: pixels] */
const STILL = 5;

type Paths = { cell: number; color: string; data: string }[];

interface Loading {
  id: number;
  begin: () => void;
  end: (isShown: boolean) => void;
  fail: (why: Error) => void;
}

/** The drawn model. */
export class ModelView {
  private readonly camera = new PerspectiveCamera(45, 1, 0.1, 5000);
  private readonly controls: OrbitControls;
  private readonly box = new Box3();
  private worker: Worker | undefined;
  private loading: Loading | undefined;
  private asked = 0;
  private readonly picking = new Map<number, (cell: number | undefined, at?: [number, number]) => void>();
  private down: [x: number, y: number] | undefined;
  private isWhole = false;
  private height = Infinity;
  private ready = (): void => undefined;
  /** Who hears of the pointer. */
  pointing: Pointing | undefined;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.tellCamera());
    this.controls.maxPolarAngle = Math.PI / 2;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener('pointermove', (event) => event.buttons === 0 && this.pick(event, (cell) => this.pointing?.hover(cell)));
    canvas.addEventListener('pointerleave', () => {
      this.picking.clear();
      this.pointing?.hover(undefined);
    });
    canvas.addEventListener('pointerdown', ({ clientX, clientY }) => (this.down = [clientX, clientY]));
    canvas.addEventListener('pointerup', (event) => {
      const [x, y] = this.down ?? [Infinity, 0];
      if (Math.hypot(event.clientX - x, event.clientY - y) < STILL) this.pick(event, (cell, at) => this.pointing?.choose(cell, at));
    });
    canvas.addEventListener('keydown', (event) => this.hear(event));
  }

  /** Starts the thread that draws, by the address of its script; resolves when the next model can be drawn. */
  async start(code: string): Promise<void> {
    // A browser that cannot draw on another thread shows plan and rooms alone.
    if (!('transferControlToOffscreen' in this.canvas)) return;
    this.worker = new Worker(code);
    this.worker.addEventListener('message', (event: MessageEvent<Told>) => this.heed(event.data));
    const isReady = new Promise<void>((done) => {
      this.ready = done;
      // Without a graphics card there is no picture, which is no reason to wait.
      this.worker!.addEventListener('error', () => done());
    });
    const canvas = this.canvas.transferControlToOffscreen();
    this.worker.postMessage({ ask: 'canvas', canvas } satisfies Asked, [canvas]);
    await isReady;
  }

  /**
   * Shows a GLB, from above at a slant; a later one takes its place. `begin` is called before it is drawn. Returns `false` if
   * another was asked for meanwhile. Throws if it cannot be read.
   */
  load(model: Blob, begin: () => void = () => undefined): Promise<boolean> {
    if (!this.worker) return Promise.resolve(false);
    this.loading?.end(false);
    const id = ++this.asked;
    return new Promise((end, fail) => {
      this.loading = { id, begin, end, fail };
      this.post({ ask: 'load', id, model });
    });
  }

  /** Takes the model away, and one that is on its way. */
  clear(): void {
    this.loading?.end(false);
    this.loading = undefined;
    this.height = Infinity;
    this.post({ ask: 'clear', id: ++this.asked });
  }

  private post(asked: Asked): void {
    this.worker?.postMessage(asked);
  }

  private heed(told: Told): void {
    if (told.tell === 'ready') this.ready();
    else if (told.tell === 'picked') {
      this.picking.get(told.id)?.(told.cell, told.at);
      this.picking.delete(told.id);
    } else if (told.id === this.loading?.id) {
      if (told.tell === 'box') {
        const [low, high] = told.box;
        this.box.set(new Vector3(...low), new Vector3(...high));
        this.aim();
        this.loading.begin();
      } else if (told.tell === 'drawn') {
        this.canvas.dataset.drawn = String(told.pieces);
        this.loading.end(true);
      } else this.loading.fail(new Error(told.text));
    }
  }

  /** Looks at all of it, or at all rooms if some are known: a building may stand in a wide country. */
  private aim(): void {
    if (this.box.isEmpty()) return;
    const [middle, size] = [this.box.getCenter(new Vector3()), this.box.getSize(new Vector3())];
    const far = 0.5 * size.length() + 1;
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(1, this.camera.aspect || 1);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new Vector3(0.35, 0.95, 0.75).normalize().multiplyScalar((1.05 * far) / half));
    this.camera.near = far / 500;
    this.camera.far = far * 20;
    this.controls.update();
    this.tellCamera();
  }

  private tellCamera(): void {
    const { near, far, position } = this.camera;
    this.post({ ask: 'camera', position: position.toArray(), target: this.controls.target.toArray(), near, far });
  }

  /** Looks at all rooms of a world. */
  aimAt(rooms: BakedRoom[]): void {
    if (rooms.length === 0) return;
    this.box.makeEmpty();
    for (const { aabb } of rooms) for (const point of aabb) this.box.expandByPoint(new Vector3(...point));
    this.aim();
  }

  /** Shows the rooms of a storey of a world, and cuts the model above its floor. */
  showStorey(baked: Baked, storey: string, paths: Paths): void {
    const of = baked.storeys.find(({ name }) => name === storey);
    this.height = of ? Math.min(of.floor + CUT, of.top) : Infinity;
    const floor = of?.floor ?? 0;
    const floors = paths.map((path) => {
      const low = baked.rooms.find((room) => room.cell === path.cell)?.aabb[0][1];
      // Split levels lie beside the floor of the storey; the lowest floor of a stair does not count.
      return { ...path, y: low !== undefined && Math.abs(low - floor) < 1.2 ? low : floor };
    });
    this.post({ ask: 'floors', floors });
    this.recut();
  }

  /** Shows the whole building, or the cut. */
  showWhole(isWhole: boolean): void {
    this.isWhole = isWhole;
    this.recut();
  }

  private recut(): void {
    this.post({ ask: 'cut', height: this.isWhole || this.height === Infinity ? NO_CUT : this.height });
  }

  /** Marks rooms. */
  mark(hovered: number | undefined, chosen: number | undefined): void {
    this.post({ ask: 'mark', hovered, chosen });
  }

  /** Turns to a point. */
  lookAt(point: readonly [number, number, number]): void {
    const move = new Vector3(...point).sub(this.controls.target);
    this.controls.target.add(move);
    this.camera.position.add(move);
    this.controls.update();
    this.tellCamera();
  }

  /** Finds the room below a pointer; of several questions on their way, the last is answered. */
  private pick({ clientX, clientY }: PointerEvent, hear: (cell: number | undefined, at?: [number, number]) => void): void {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const id = ++this.asked;
    this.picking.clear();
    this.picking.set(id, hear);
    this.post({ ask: 'pick', id, x: (2 * (clientX - left)) / width - 1, y: 1 - (2 * (clientY - top)) / height });
  }

  private hear(event: KeyboardEvent): void {
    const around = { ArrowLeft: [-0.12, 0], ArrowRight: [0.12, 0], ArrowUp: [0, -0.1], ArrowDown: [0, 0.1] }[event.key];
    const zoom = { '+': 0.87, '=': 0.87, '-': 1.15 }[event.key];
    if (!around && !zoom) return;
    event.preventDefault();
    const offset = this.camera.position.clone().sub(this.controls.target).multiplyScalar(zoom ?? 1);
    if (around) {
      offset.applyAxisAngle(new Vector3(0, 1, 0), around[0]!);
      const side = new Vector3(0, 1, 0).cross(offset).normalize();
      const tipped = offset.clone().applyAxisAngle(side, around[1]!);
      const height = tipped.y / tipped.length();
      if (height > 0.05 && height < 0.99) offset.copy(tipped);
    }
    this.camera.position.copy(this.controls.target).add(offset);
    this.controls.update();
    this.tellCamera();
  }

  private resize(): void {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (width === 0 || height === 0) return;
    const isFirst = this.camera.aspect === 1;
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.post({ ask: 'size', width, height, ratio: Math.min(2, devicePixelRatio) });
    if (isFirst) this.aim();
  }
}
