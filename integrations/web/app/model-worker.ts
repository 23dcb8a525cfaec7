// The thread that reads models and draws them, so that the page answers meanwhile: whoever draws waits for the graphics card.
import {
  AmbientLight, Color, DirectionalLight, Group, HemisphereLight, Mesh, MeshBasicMaterial, PerspectiveCamera, Plane, Raycaster, Scene,
  ShapeGeometry, Vector2, Vector3, WebGLRenderer,
} from 'three';
import { dispose, floorMaterial, meshesOf, samples } from './drawn.js';
import { readModel } from './model-reader.js';
import { shapesOf } from './shapes.js';

type Point = [number, number, number];

/** The floor of a room: its outline as on the plan, and its height. [Units: m] */
export interface Floor {
  cell: number;
  color: string;
  data: string;
  y: number;
}

/** What the thread is asked. */
export type Asked =
  | { ask: 'canvas'; canvas: OffscreenCanvas }
  | { ask: 'size'; width: number; height: number; ratio: number }
  | { ask: 'load'; id: number; model: Blob }
  | { ask: 'clear'; id: number }
  | { ask: 'camera'; position: Point; target: Point; near: number; far: number }
  | { ask: 'floors'; floors: Floor[] }
  | { ask: 'cut'; height: number }
  | { ask: 'mark'; hovered: number | undefined; chosen: number | undefined }
  | { ask: 'pick'; id: number; x: number; y: number };

/** What it answers. */
export type Told =
  | { tell: 'ready' }
  | { tell: 'box'; id: number; box: [number[], number[]] }
  | { tell: 'drawn'; id: number; pieces: number }
  | { tell: 'failed'; id: number; text: string }
  | { tell: 'picked'; id: number; cell: number | undefined; at?: [number, number] };

/** Height of the color above the floor. [Units: m] */
const ABOVE = 0.03;
/** Longest side of a picture: rooms are seen from afar. [Units: pixels] */
const SIDE = 1024;

const tell = (told: Told): void => (globalThis as unknown as { postMessage(told: Told): void }).postMessage(told);

async function pictureOf(bytes: Blob): Promise<ImageBitmap> {
  const options: ImageBitmapOptions = { premultiplyAlpha: 'none', colorSpaceConversion: 'none' };
  const whole = await createImageBitmap(bytes, options);
  const share = SIDE / Math.max(whole.width, whole.height);
  if (share >= 1) return whole;
  const side = (n: number): number => Math.max(1, Math.round(n * share));
  return createImageBitmap(whole, { ...options, resizeWidth: side(whole.width), resizeHeight: side(whole.height), resizeQuality: 'medium' });
}

class Drawer {
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(45, 1, 0.1, 5000);
  private readonly renderer: WebGLRenderer;
  private readonly cut = new Plane(new Vector3(0, -1, 0), 1e9);
  private readonly floors = new Group();
  private model = new Group();
  private loading = 0;
  private isAsked = false;
  private size: [width: number, height: number, ratio: number] | undefined;

  constructor(canvas: OffscreenCanvas) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    // Of all that is drawn: shaders are made before there is a model. Floors lie below it.
    this.renderer.clippingPlanes = [this.cut];
    this.scene.background = new Color(0xdfe4ea);
    const lamp = new DirectionalLight(0xffffff, 1.4);
    lamp.position.set(0.4, 1, 0.6);
    this.scene.add(new HemisphereLight(0xffffff, 0x9a9086, 1.5), new AmbientLight(0xffffff, 0.4), lamp, this.floors, this.model);
  }

  /** Makes the shaders, and draws with them: the first time takes long. */
  async prepare(): Promise<void> {
    const all = samples();
    await this.renderer.compileAsync(all, this.camera, this.scene);
    this.scene.add(all);
    this.renderer.setSize(1, 1, false);
    this.renderer.render(this.scene, this.camera);
    this.scene.remove(all);
    tell({ tell: 'ready' });
  }

  hear(asked: Asked): void {
    if (asked.ask === 'size') this.size = [asked.width, asked.height, asked.ratio];
    else if (asked.ask === 'load') void this.load(asked.id, asked.model);
    else if (asked.ask === 'clear') this.clear(asked.id);
    else if (asked.ask === 'floors') this.showFloors(asked.floors);
    else if (asked.ask === 'cut') this.cut.constant = asked.height;
    else if (asked.ask === 'mark') this.mark(asked.hovered, asked.chosen);
    else if (asked.ask === 'pick') tell({ tell: 'picked', id: asked.id, ...this.pick(asked.x, asked.y) });
    else if (asked.ask === 'camera') {
      Object.assign(this.camera, { near: asked.near, far: asked.far });
      this.camera.position.set(...asked.position);
      this.camera.lookAt(...asked.target);
      this.camera.updateProjectionMatrix();
    }
    if (asked.ask !== 'pick') this.draw();
  }

  private clear(id: number): void {
    this.loading = id;
    this.replace(new Group());
    this.showFloors([]);
    this.cut.constant = 1e9;
  }

  private replace(group: Group): void {
    this.scene.remove(this.model);
    dispose(this.model);
    this.model = group;
    this.scene.add(group);
  }

  private async load(id: number, model: Blob): Promise<void> {
    this.loading = id;
    try {
      const bytes = new Uint8Array(await model.arrayBuffer());
      if (id !== this.loading) return;
      const read = readModel(bytes);
      const { group, paint } = meshesOf(read);
      this.replace(group);
      tell({ tell: 'box', id, box: read.box });
      this.draw(() => tell({ tell: 'drawn', id, pieces: read.pieces.length }));
      for (const [image, file] of read.images) {
        // A picture that cannot be read is left out.
        const picture = await pictureOf(file).catch(() => undefined);
        if (id !== this.loading) return;
        if (!picture) continue;
        paint(image, picture);
        this.draw();
      }
    } catch (why) {
      tell({ tell: 'failed', id, text: (why as Error).message });
    }
  }

  private showFloors(floors: Floor[]): void {
    dispose(this.floors);
    this.floors.clear();
    for (const { cell, color, data, y } of floors) {
      const geometry = new ShapeGeometry(shapesOf(data)).rotateX(Math.PI / 2);
      const mesh = new Mesh(geometry, floorMaterial(color));
      mesh.position.y = y + ABOVE;
      mesh.userData = { cell, color };
      this.floors.add(mesh);
    }
  }

  private mark(hovered: number | undefined, chosen: number | undefined): void {
    for (const mesh of this.floors.children as Mesh[]) {
      const { cell, color } = mesh.userData as { cell: number; color: string };
      const own = (mesh.material as MeshBasicMaterial).color.set(color);
      if (cell === chosen) own.set(0x7db8f0);
      else if (cell === hovered) own.multiplyScalar(0.85);
    }
  }

  /** Returns the room at a point of the picture, and x and z there; coordinates are from -1 to 1. */
  private pick(x: number, y: number): { cell: number | undefined; at?: [number, number] } {
    const ray = new Raycaster();
    this.camera.updateMatrixWorld();
    ray.setFromCamera(new Vector2(x, y), this.camera);
    const found = ray.intersectObject(this.floors)[0];
    return found ? { cell: found.object.userData.cell as number, at: [found.point.x, found.point.z] } : { cell: undefined };
  }

  /** Draws soon, once. */
  private draw(done: () => void = () => undefined): void {
    this.after.push(done);
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      if (this.size) {
        const [width, height, ratio] = this.size;
        this.size = undefined;
        this.renderer.setPixelRatio(ratio);
        this.renderer.setSize(width, height, false);
        this.camera.aspect = width / height;
        this.camera.updateProjectionMatrix();
      }
      this.renderer.render(this.scene, this.camera);
      for (const then of this.after.splice(0)) then();
    });
  }

  private readonly after: (() => void)[] = [];
}

let drawer: Drawer | undefined;
addEventListener('message', ({ data }: MessageEvent<Asked>) => {
  if (data.ask !== 'canvas') drawer?.hear(data);
  else {
    drawer = new Drawer(data.canvas);
    void drawer.prepare();
  }
});
