/** Shows, of the objects of a three.js scene, what a camera may see; turns doors; picks. */
import {
  BufferAttribute,
  BufferGeometry,
  DoubleSide,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  Object3D,
  Vector3,
  type Camera,
  type Light,
  type Material,
} from 'three';
import type { Hit, Portal, Seen, World } from './world.js';

/** The objects of a scene that show the parts of a world. */
export interface Parts {
  /** Root of the scene: its space is that of the world. */
  root: Object3D;
  /** The object of each batch; absent for those without triangles, or not loaded. */
  batches: (Object3D | undefined)[];
  /** The object of each detail. */
  details: (Object3D | undefined)[];
  /** Lights that reach as far as their `distance`. */
  lights: Light[];
}

/** What a pick hits, in the coordinates of the three.js world. */
export interface PickResult extends Hit {
  point: Vector3;
  object: Object3D | undefined;
}

/** Numbers of the last update. */
export interface Counts {
  cells: number;
  batches: number;
  details: number;
  triangles: number;
  /** The camera's cell, or -1. */
  cell: number;
}

/** Distance by which things of a cell may lie beyond its box, in meters. */
const MARGIN = 0.25;

/** Objects of one kind, each shown exactly if it was seen last. */
class Shown {
  private readonly shown: Uint32Array;
  private count = 0;

  constructor(readonly objects: (Object3D | undefined)[]) {
    this.shown = new Uint32Array(objects.length);
  }

  hideAll(): void {
    for (const object of this.objects) if (object) object.visible = false;
    this.count = 0;
  }

  showAll(): void {
    for (const object of this.objects) if (object) object.visible = true;
  }

  show(ids: Uint32Array, n: number): void {
    for (let i = 0; i < this.count; i++) {
      const object = this.objects[this.shown[i]!];
      if (object) object.visible = false;
    }
    for (let i = 0; i < n; i++) {
      const id = ids[i]!;
      this.shown[i] = id;
      const object = this.objects[id];
      if (object) object.visible = true;
    }
    this.count = n;
  }
}

/** Culls a scene by rooms and doorways. Call `update` every frame, before rendering. */
export class PortalCuller {
  /** The last answer; its lists are valid until the next update. */
  seen: Seen | undefined;
  readonly counts: Counts = { cells: 0, batches: 0, details: 0, triangles: 0, cell: -1 };
  private readonly batches: Shown;
  private readonly details: Shown;
  private isOn = true;
  private readonly matrix = new Matrix4();
  private readonly inverse = new Matrix4();
  private readonly eye = new Vector3();
  private readonly lightAt = new Vector3();
  /** Pose of each moved detail in the file, relative to the root. */
  private readonly rest = new Map<number, Matrix4>();
  /** Panels in the gaps around shut leaves, through which the hidden rooms would be missing. */
  private readonly plugs = new Map<number, Mesh>();
  /** Openness that doors turn to. */
  private readonly goals = new Map<number, number>();

  constructor(
    readonly world: World,
    readonly parts: Parts,
  ) {
    this.batches = new Shown(parts.batches);
    this.details = new Shown(parts.details);
    this.batches.hideAll();
    this.details.hideAll();
  }

  /** True if things out of sight are hidden; when set to false, everything is shown. */
  get enabled(): boolean {
    return this.isOn;
  }

  set enabled(isOn: boolean) {
    if (isOn === this.isOn) return;
    this.isOn = isOn;
    for (const shown of [this.batches, this.details]) {
      if (isOn) shown.hideAll();
      else shown.showAll();
    }
    if (!isOn) for (const light of this.parts.lights) light.visible = true;
  }

  /** Puts the object of a batch or a detail that came later under the culler, hidden until it is seen. */
  put(kind: 'batches' | 'details', id: number, object: Object3D | undefined): void {
    const before = this.parts[kind][id];
    if (object) object.visible = !this.isOn || this.isSeen(kind, id);
    else if (before) before.visible = false;
    this.parts[kind][id] = object;
    if (object && kind === 'details') {
      this.rest.delete(id);
      this.turn(id);
    }
  }

  private isSeen(kind: 'batches' | 'details', id: number): boolean {
    const { seen } = this;
    if (!seen) return false;
    const n = kind === 'batches' ? seen.batchCount : seen.detailCount;
    for (let i = 0; i < n; i++) if (seen[kind][i] === id) return true;
    return false;
  }

  /** Asks what `camera` sees, and shows exactly that. Makes no garbage. */
  update(camera: Camera): Counts {
    const { root } = this.parts;
    root.updateWorldMatrix(true, false);
    camera.updateWorldMatrix(true, false);
    this.inverse.copy(camera.matrixWorld).invert();
    this.matrix.multiplyMatrices(camera.projectionMatrix, this.inverse).multiply(root.matrixWorld);
    this.eye.setFromMatrixPosition(camera.matrixWorld).applyMatrix4(this.inverse.copy(root.matrixWorld).invert());
    this.eye.toArray(EYE);
    const seen = this.world.see(EYE, this.matrix.elements);
    this.seen = seen;
    if (this.isOn) {
      this.batches.show(seen.batches, seen.batchCount);
      this.details.show(seen.details, seen.detailCount);
      for (const light of this.parts.lights) light.visible = this.reaches(light, seen);
    }
    const { counts } = this;
    counts.cells = seen.cellCount;
    counts.batches = seen.batchCount;
    counts.details = seen.detailCount;
    counts.triangles = seen.triangles;
    counts.cell = seen.eyeCell;
    return counts;
  }

  /** Returns true if the sphere of a light meets the box of a visible cell. */
  private reaches(light: Light, seen: Seen): boolean {
    const distance = (light as Light & { distance?: number }).distance ?? 0;
    if (distance === 0) return true;
    light.updateWorldMatrix(true, false);
    const at = this.lightAt.setFromMatrixPosition(light.matrixWorld).applyMatrix4(this.inverse);
    const reach = distance * this.inverse.getMaxScaleOnAxis() + MARGIN;
    for (let i = 0; i < seen.cellCount; i++) {
      const { aabb } = this.world.cells[seen.cells[i]!]!;
      const x = Math.max(aabb[0]! - at.x, 0, at.x - aabb[3]!);
      const y = Math.max(aabb[1]! - at.y, 0, at.y - aabb[4]!);
      const z = Math.max(aabb[2]! - at.z, 0, at.z - aabb[5]!);
      if (x * x + y * y + z * z <= reach * reach) return true;
    }
    // Outside of all cells, everything in view is visible.
    return seen.eyeCell < 0;
  }

  /** Moves the leaves of a portal at once, from 0 for shut to 1 for open. */
  setOpenness(portal: number, share: number): void {
    this.world.setOpenness(portal, share);
    for (const leaf of this.world.portals[portal]?.leaves ?? []) {
      this.turn(leaf.detail);
      for (const other of this.world.portalsOfDetail(leaf.detail)) this.plug(other);
    }
    this.plug(portal);
  }

  /** Puts a panel into a portal that is shut, where its leaves are, and takes it out when it opens. */
  private plug(id: number): void {
    const isShut = !this.world.isOpen(id);
    let plug = this.plugs.get(id);
    if (!plug && isShut) {
      const portal = this.world.portals[id]!;
      plug = new Mesh(panelOf(portal), this.leafMaterial(portal));
      this.plugs.set(id, plug);
      this.parts.root.add(plug);
    }
    if (plug) plug.visible = isShut;
  }

  private leafMaterial(portal: Portal): Material {
    let found: Material | undefined;
    for (const { detail } of portal.leaves) {
      this.parts.details[detail]?.traverse((object) => {
        if (object instanceof Mesh) found ??= Array.isArray(object.material) ? object.material[0] : object.material;
      });
    }
    return found ?? SHUT;
  }

  /** Starts to open a door that is shut, or to shut it; `animate` moves it. */
  toggle(portal: number): void {
    const now = this.goals.get(portal) ?? this.world.openness(portal);
    this.goals.set(portal, now > 0.5 ? 0 : 1);
  }

  /** Moves the doors that were toggled, by `seconds`; a whole way takes 0.8 s. */
  animate(seconds: number): void {
    for (const [portal, goal] of this.goals) {
      const hasLeaves = this.world.portals[portal]!.leaves.length > 0;
      const now = this.world.openness(portal);
      const step = seconds / 0.8;
      const next = !hasLeaves || Math.abs(goal - now) <= step ? goal : now + Math.sign(goal - now) * step;
      this.setOpenness(portal, next);
      if (next === goal) this.goals.delete(portal);
    }
  }

  /** Puts a leaf where the world's state has it. */
  private turn(detail: number): void {
    const object = this.parts.details[detail];
    if (!object || !this.world.pose(detail, POSE)) return;
    const { root } = this.parts;
    root.updateWorldMatrix(true, false);
    object.parent?.updateWorldMatrix(true, false);
    this.inverse.copy(root.matrixWorld).invert();
    let rest = this.rest.get(detail);
    if (!rest) {
      object.updateWorldMatrix(false, false);
      rest = new Matrix4().multiplyMatrices(this.inverse, object.matrixWorld);
      this.rest.set(detail, rest);
    }
    const parent = new Matrix4();
    if (object.parent) parent.multiplyMatrices(this.inverse, object.parent.matrixWorld).invert();
    object.matrixAutoUpdate = false;
    object.matrix.copy(parent).multiply(this.matrix.fromArray(POSE)).multiply(rest);
    object.matrixWorldNeedsUpdate = true;
  }

  /** Finds the first thing from `origin` along `direction`, in the coordinates of the three.js world. */
  pick(origin: Vector3, direction: Vector3, far = 100): PickResult | undefined {
    const { root } = this.parts;
    root.updateWorldMatrix(true, false);
    this.inverse.copy(root.matrixWorld).invert();
    const from = origin.clone().applyMatrix4(this.inverse);
    const to = direction.clone().setLength(far).add(origin).applyMatrix4(this.inverse);
    const hit = this.world.pick(from.toArray(), to.toArray());
    if (!hit) return undefined;
    const kind = hit.target === 'wall' ? 'batches' : 'details';
    const object = hit.target === 'portal' ? undefined : this.parts[kind][hit.index];
    return { ...hit, point: new Vector3(...hit.position).applyMatrix4(root.matrixWorld), object };
  }

  /** Finds the cell of a point of the three.js world; -1 in solid matter. */
  locate(point: Vector3): number {
    const { root } = this.parts;
    root.updateWorldMatrix(true, false);
    return this.world.locate(point.clone().applyMatrix4(this.inverse.copy(root.matrixWorld).invert()).toArray());
  }
}

/** Material of a portal that is closed without a leaf. */
const SHUT = new MeshBasicMaterial({ color: 0x222222, side: DoubleSide });

/** Makes the panel that fills a portal's outline at the depth of its leaves. */
function panelOf({ outline, normal, leafDepth }: Portal): BufferGeometry {
  const n = outline.length / 3;
  const positions = outline.map((v, i) => v + leafDepth * normal[i % 3]!);
  const normals = outline.map((_, i) => normal[i % 3]!);
  const indices = Array.from({ length: n - 2 }, (_, i) => [0, i + 1, i + 2]).flat();
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  geometry.setAttribute('normal', new BufferAttribute(normals, 3));
  geometry.setAttribute('uv', new BufferAttribute(new Float32Array(2 * n), 2));
  geometry.setIndex(indices);
  return geometry;
}

const EYE = new Float32Array(3);
const POSE = new Array<number>(16).fill(0);
