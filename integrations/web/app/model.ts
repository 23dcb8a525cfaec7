// The model in three dimensions, cut open above the floor of a storey, with its rooms in color.
import {
  AmbientLight, Box3, Color, DirectionalLight, DoubleSide, Group, HemisphereLight, Mesh, MeshBasicMaterial, PerspectiveCamera, Plane,
  Raycaster, Scene, ShaderChunk, ShapeGeometry, Vector2, Vector3, WebGLRenderer, type Material, type Object3D,
} from 'three';
import { OrbitControls } from 'three/addons/controls/OrbitControls.js';
import { GLTFLoader } from 'three/addons/loaders/GLTFLoader.js';
import type { Baked, BakedRoom } from '../src/bake.js';
import type { Pointing } from './plan.js';
import { shapesOf } from './shapes.js';

// There is nothing for metals to mirror: they would be black, as would all that an exporter left at glTF's default, a metal.
ShaderChunk.metalnessmap_fragment += '\nmetalnessFactor = 0.0;';

/** Height above a floor at which walls are cut. [Units: m] */
const CUT = 1.4;
/** Height of the color above the floor. [Units: m] */
const ABOVE = 0.03;
/** Pointers that move less between down and up have clicked. [Units: pixels] */
const STILL = 5;

type Paths = { cell: number; color: string; data: string }[];

/** The drawn model. */
export class ModelView {
  private readonly scene = new Scene();
  private readonly camera = new PerspectiveCamera(45, 1, 0.1, 5000);
  private readonly renderer: WebGLRenderer;
  private readonly controls: OrbitControls;
  private readonly cut = new Plane(new Vector3(0, -1, 0), Infinity);
  private readonly floors = new Group();
  private readonly box = new Box3();
  private model: Object3D | undefined;
  private isAsked = false;
  private loading = 0;
  private down: Vector2 | undefined;
  private isWhole = false;
  private height = Infinity;
  /** Who hears of the pointer. */
  pointing: Pointing | undefined;

  constructor(private readonly canvas: HTMLCanvasElement) {
    this.renderer = new WebGLRenderer({ canvas, antialias: true });
    this.renderer.localClippingEnabled = true;
    this.scene.background = new Color(0xdfe4ea);
    const lamp = new DirectionalLight(0xffffff, 1.4);
    lamp.position.set(0.4, 1, 0.6);
    this.scene.add(new HemisphereLight(0xffffff, 0x9a9086, 1.5), new AmbientLight(0xffffff, 0.4), lamp, this.floors);
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.addEventListener('change', () => this.ask());
    this.controls.maxPolarAngle = Math.PI / 2;
    new ResizeObserver(() => this.resize()).observe(canvas);
    canvas.addEventListener('pointermove', (event) => event.buttons === 0 && this.pointing?.hover(this.cellAt(event)));
    canvas.addEventListener('pointerleave', () => this.pointing?.hover(undefined));
    canvas.addEventListener('pointerdown', (event) => (this.down = new Vector2(event.clientX, event.clientY)));
    canvas.addEventListener('pointerup', (event) => {
      const isStill = this.down && this.down.distanceTo(new Vector2(event.clientX, event.clientY)) < STILL;
      if (isStill) this.pointing?.choose(this.cellAt(event));
    });
    canvas.addEventListener('keydown', (event) => this.hear(event));
  }

  /** Shows a GLB, from above at a slant; a later one takes its place. Returns `false` if another was asked for meanwhile. */
  async load(bytes: ArrayBuffer): Promise<boolean> {
    const own = ++this.loading;
    const { scene } = await new GLTFLoader().parseAsync(bytes, '');
    if (own !== this.loading) return false;
    this.clear();
    this.model = scene;
    scene.traverse((object) => {
      if (!(object instanceof Mesh)) return;
      for (const material of [object.material].flat() as Material[]) {
        material.side = DoubleSide;
        material.clippingPlanes = [this.cut];
      }
    });
    this.scene.add(scene);
    this.box.setFromObject(scene);
    this.aim();
    return true;
  }

  /** Takes the model away. */
  clear(): void {
    if (this.model) this.scene.remove(this.model);
    this.model?.traverse((object) => {
      if (!(object instanceof Mesh)) return;
      object.geometry.dispose();
      for (const material of [object.material].flat() as Material[]) material.dispose();
    });
    this.model = undefined;
    this.showRooms([], undefined);
    this.height = Infinity;
    this.recut();
  }

  /** Looks at all of it, or at all rooms if some are known: a building may stand in a wide country. */
  private aim(): void {
    const [middle, size] = [this.box.getCenter(new Vector3()), this.box.getSize(new Vector3())];
    const far = 0.5 * size.length() + 1;
    const half = Math.tan((this.camera.fov * Math.PI) / 360) * Math.min(1, this.camera.aspect || 1);
    this.controls.target.copy(middle);
    this.camera.position.copy(middle).add(new Vector3(0.35, 0.95, 0.75).normalize().multiplyScalar((1.05 * far) / half));
    this.camera.near = far / 500;
    this.camera.far = far * 20;
    this.camera.updateProjectionMatrix();
    this.controls.update();
    this.ask();
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
    this.showRooms(paths, (cell) => {
      const low = baked.rooms.find((room) => room.cell === cell)?.aabb[0][1];
      const floor = of?.floor ?? 0;
      // Split levels lie beside the floor of the storey; the lowest floor of a stair does not count.
      return low !== undefined && Math.abs(low - floor) < 1.2 ? low : floor;
    });
    this.recut();
  }

  private showRooms(paths: Paths, floor: ((cell: number) => number) | undefined): void {
    for (const mesh of this.floors.children as Mesh[]) {
      mesh.geometry.dispose();
      (mesh.material as Material).dispose();
    }
    this.floors.clear();
    for (const { cell, color, data } of paths) {
      const geometry = new ShapeGeometry(shapesOf(data)).rotateX(Math.PI / 2);
      const material = new MeshBasicMaterial({ color, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 });
      const mesh = new Mesh(geometry, material);
      mesh.position.y = (floor?.(cell) ?? 0) + ABOVE;
      mesh.userData = { cell, color };
      this.floors.add(mesh);
    }
    this.ask();
  }

  /** Shows the whole building, or the cut. */
  showWhole(isWhole: boolean): void {
    this.isWhole = isWhole;
    this.recut();
  }

  private recut(): void {
    this.cut.constant = this.isWhole || this.height === Infinity ? 1e9 : this.height;
    this.ask();
  }

  /** Marks rooms. */
  mark(hovered: number | undefined, chosen: number | undefined): void {
    for (const mesh of this.floors.children as Mesh[]) {
      const { cell, color } = mesh.userData as { cell: number; color: string };
      const own = (mesh.material as MeshBasicMaterial).color.set(color);
      if (cell === chosen) own.set(0x7db8f0);
      else if (cell === hovered) own.multiplyScalar(0.85);
    }
    this.ask();
  }

  /** Turns to a point. */
  lookAt(point: readonly [number, number, number]): void {
    const move = new Vector3(...point).sub(this.controls.target);
    this.controls.target.add(move);
    this.camera.position.add(move);
    this.controls.update();
    this.ask();
  }

  private cellAt(event: PointerEvent): number | undefined {
    const { left, top, width, height } = this.canvas.getBoundingClientRect();
    const at = new Vector2((2 * (event.clientX - left)) / width - 1, 1 - (2 * (event.clientY - top)) / height);
    const ray = new Raycaster();
    ray.setFromCamera(at, this.camera);
    return ray.intersectObject(this.floors)[0]?.object.userData.cell as number | undefined;
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
    this.ask();
  }

  private resize(): void {
    const { clientWidth, clientHeight } = this.canvas;
    if (clientWidth === 0 || clientHeight === 0) return;
    const isFirst = this.camera.aspect === 1;
    this.renderer.setPixelRatio(Math.min(2, devicePixelRatio));
    this.renderer.setSize(clientWidth, clientHeight, false);
    this.camera.aspect = clientWidth / clientHeight;
    this.camera.updateProjectionMatrix();
    if (isFirst && this.model) this.aim();
    this.ask();
  }

  /** Draws soon, once. */
  private ask(): void {
    if (this.isAsked) return;
    this.isAsked = true;
    requestAnimationFrame(() => {
      this.isAsked = false;
      this.renderer.render(this.scene, this.camera);
    });
  }
}
