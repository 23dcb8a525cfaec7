/** A world in a browser or in node: rooms, doorways, and what is visible through them. */
import { extensionOf, takeApart, withoutPictures } from './glb.js';
import { Runtime, bytesOf, type WasmSource } from './wasm.js';

/** Kind of a cell. */
export type CellKind = 'room' | 'outdoors' | 'void';
/** Kind of a portal. */
export type PortalKind = 'open' | 'door' | 'window' | 'crack';

/** Facts of a room. */
export interface Room {
  /** Names of the storeys that it stands on, from below. */
  readonly storeys: readonly string[];
  /** Area of its floors as seen from above, without the recesses of doors and windows, in square meters. */
  readonly floorArea: number;
  /** The part of that area where the room is 1.5 m high or more: less than all of it under sloped ceilings. */
  readonly areaAbove1_5: number;
  /** The part where it is 2.3 m high or more. */
  readonly areaAbove2_3: number;
  /** Clear height over most of that area, in meters. */
  readonly height: number;
  readonly doors: number;
  readonly windows: number;
}

/** A cell: a room, the outdoors, or a space that nobody can stand in. */
export interface Cell {
  readonly id: number;
  readonly name: string;
  readonly kind: CellKind;
  /** Minimum and maximum, six numbers. */
  readonly aabb: Float32Array;
  /** Volume of its air, in cubic meters. */
  readonly volume: number;
  /** Its portals, ascending. */
  readonly portals: readonly number[];
  /** What is measured of a room; undefined for other cells, and in files without facts. */
  readonly room: Room | undefined;
}

/** A leaf of a door and its motion, measured from its pose in the file. */
export interface Leaf {
  readonly detail: number;
  readonly motion: 'turn' | 'slide';
  /** Motion to shut and to fully open: radians of a turn, meters of a slide. */
  readonly shut: number;
  readonly open: number;
  /** A point of the hinge. */
  readonly through: Float32Array;
  /** Direction of the hinge or the slide. */
  readonly axis: Float32Array;
}

/** A portal: an opening between two cells. */
export interface Portal {
  readonly id: number;
  /** The normal points from the first to the second. */
  readonly cells: readonly [number, number];
  readonly kind: PortalKind;
  /** Vertices of the convex outline, three numbers each. */
  readonly outline: Float32Array;
  readonly normal: Float32Array;
  /** In square meters. */
  readonly area: number;
  /** Distance of the middle of its shut leaves from its plane, along the normal, in meters. */
  readonly leafDepth: number;
  readonly leaves: readonly Leaf[];
}

/**
 * The answer to a view, near to far. One object per world, filled anew by each query; its arrays lead into the memory of
 * the module, and only the first `…Count` entries of each count.
 */
export interface Seen {
  cells: Uint32Array;
  cellCount: number;
  /** Share of the screen of each of `cells`, 0 to 1. */
  shares: Float32Array;
  portals: Uint32Array;
  portalCount: number;
  chunks: Uint32Array;
  chunkCount: number;
  batches: Uint32Array;
  batchCount: number;
  details: Uint32Array;
  detailCount: number;
  specials: Uint32Array;
  specialCount: number;
  /** Triangles of the chunks and details. */
  triangles: number;
  /** The eye's cell, or -1 in solid matter, where everything in the view counts as visible. */
  eyeCell: number;
}

/** The first thing on a segment. */
export interface Hit {
  /** Parameter along the segment, 0 to 1. */
  t: number;
  position: [number, number, number];
  normal: [number, number, number];
  target: 'wall' | 'detail' | 'portal';
  /** The batch, detail or portal. */
  index: number;
  primitive: number;
  triangle: number;
  /** The cell from which the segment hit, or -1. */
  cell: number;
  /** The portal that the hit leaf shuts, or the closed portal itself; otherwise -1. */
  portal: number;
}

const CELL_KINDS: CellKind[] = ['room', 'outdoors', 'void'];
const PORTAL_KINDS: PortalKind[] = ['open', 'door', 'window', 'crack'];
const TARGETS = ['wall', 'detail', 'portal'] as const;
const NO_ID = 0xffffffff;
/** Bytes for arguments and answers; the largest answer has 80. */
const SCRATCH = 512;
/** Where the answer begins, behind the arguments: an eye and a matrix take 76 bytes. */
const ANSWER = 128;

const id = (word: number): number => (word === NO_ID ? -1 : word);

/** An open world. */
export class World {
  readonly cells: readonly Cell[];
  readonly portals: readonly Portal[];
  readonly batchCount: number;
  readonly detailCount: number;
  readonly chunkCount: number;
  readonly specialCount: number;
  private readonly scratch: number;
  private readonly seen: Seen;
  private closed = false;

  private constructor(
    readonly runtime: Runtime,
    private readonly handle: number,
  ) {
    if (handle === 0) throw runtime.error();
    this.scratch = runtime.exports.enf_alloc(SCRATCH);
    runtime.refresh();
    const count = (what: number): number => runtime.checked(runtime.exports.enf_count(handle, what));
    const cells = count(0);
    const portals = count(1);
    this.batchCount = count(2);
    this.detailCount = count(3);
    this.chunkCount = count(4);
    this.specialCount = count(5);
    this.cells = Array.from({ length: cells }, (_, i) => this.readCell(i));
    this.portals = Array.from({ length: portals }, (_, i) => this.readPortal(i));
    const none = new Uint32Array();
    const lists = { cells: none, portals: none, chunks: none, batches: none, details: none, specials: none };
    const counts = { cellCount: 0, portalCount: 0, chunkCount: 0, batchCount: 0, detailCount: 0, specialCount: 0 };
    this.seen = { ...lists, ...counts, shares: new Float32Array(), triangles: 0, eyeCell: -1 };
  }

  /** Opens a world from the bytes of its file, or from where it lies. `wasm` is where the module is if it moved. */
  static async open(source: BufferSource | URL | string, wasm?: WasmSource): Promise<World> {
    const [runtime, bytes] = await Promise.all([Runtime.load(wasm), bytesOf(source)]);
    const { json, text, bin } = takeApart(bytes);
    extensionOf(json);
    return World.ofParts(runtime, text, bin);
  }

  /** Opens a world from the parts of its file, the text of its JSON and its binary chunk, as loaders of glTF have them. */
  static ofParts(runtime: Runtime, text: string, bin: Uint8Array): World {
    const lean = withoutPictures(text, bin);
    return new World(runtime, runtime.with(lean, (at, n) => runtime.exports.enf_open(at, n)));
  }

  /** Opens a world whose triangles come later: from the sections of the head of a packed world. */
  static hollow(runtime: Runtime, glb: Uint8Array, skeleton: Uint8Array): World {
    const handle = runtime.with(glb, (at, n) =>
      runtime.with(skeleton, (bones, m) => runtime.exports.enf_open_hollow(at, n, bones, m)),
    );
    return new World(runtime, handle);
  }

  /** Frees the world's memory. */
  close(): void {
    if (this.closed) return;
    this.closed = true;
    this.runtime.exports.enf_free(this.scratch, SCRATCH);
    this.runtime.exports.enf_close(this.handle);
  }

  /** Index of the first word of the answer. */
  private get answer(): number {
    return (this.scratch + ANSWER) >>> 2;
  }

  private copyOf(word: number, n: number): Float32Array {
    return this.runtime.f32.slice(word, word + n);
  }

  private readCell(cell: number): Cell {
    const { runtime } = this;
    runtime.checked(runtime.exports.enf_cell(this.handle, cell, this.scratch + ANSWER));
    runtime.refresh();
    const at = this.answer;
    const { u32, f32 } = runtime;
    const portals = u32[at + 1]! >>> 2;
    const found = {
      id: cell,
      name: runtime.string(u32[at]!, u32[at + 2]!),
      kind: CELL_KINDS[u32[at + 4]!]!,
      aabb: this.copyOf(at + 5, 6),
      volume: f32[at + 11]!,
      portals: [...u32.subarray(portals, portals + u32[at + 3]!)],
    };
    return { ...found, room: this.readRoom(cell) };
  }

  private readRoom(cell: number): Room | undefined {
    const { runtime } = this;
    if (runtime.checked(runtime.exports.enf_room(this.handle, cell, this.scratch + ANSWER)) < 0) return undefined;
    runtime.refresh();
    const at = this.answer;
    const { u32, f32 } = runtime;
    return {
      storeys: runtime.string(u32[at]!, u32[at + 1]!).split(' ').filter(Boolean),
      floorArea: f32[at + 2]!,
      areaAbove1_5: f32[at + 3]!,
      areaAbove2_3: f32[at + 4]!,
      height: f32[at + 5]!,
      doors: u32[at + 6]!,
      windows: u32[at + 7]!,
    };
  }

  private readPortal(portal: number): Portal {
    const { runtime } = this;
    runtime.checked(runtime.exports.enf_portal(this.handle, portal, this.scratch + ANSWER));
    const at = this.answer;
    const { u32, f32 } = runtime;
    const leaves = u32[at + 7]!;
    const found = {
      id: portal,
      outline: this.copyOf(u32[at]! >>> 2, 3 * u32[at + 1]!),
      cells: [u32[at + 2]!, u32[at + 3]!] as const,
      kind: PORTAL_KINDS[u32[at + 4]!]!,
      normal: this.copyOf(at + 8, 3),
      area: f32[at + 11]!,
      leafDepth: f32[at + 12]!,
    };
    return { ...found, leaves: Array.from({ length: leaves }, (_, i) => this.readLeaf(portal, i)) };
  }

  private readLeaf(portal: number, leaf: number): Leaf {
    const { runtime } = this;
    runtime.checked(runtime.exports.enf_leaf(this.handle, portal, leaf, this.scratch + ANSWER));
    const at = this.answer;
    const { u32, f32 } = runtime;
    return {
      detail: u32[at]!,
      motion: u32[at + 1] === 0 ? 'turn' : 'slide',
      shut: f32[at + 2]!,
      open: f32[at + 3]!,
      through: this.copyOf(at + 4, 3),
      axis: this.copyOf(at + 7, 3),
    };
  }

  /** Writes arguments to the scratch, from its word `first` on. */
  private put(numbers: ArrayLike<number>, first: number, n: number): number {
    // The last call may have made the memory grow, which leaves old views without it.
    this.runtime.refresh();
    const { f32 } = this.runtime;
    const at = (this.scratch >>> 2) + first;
    for (let i = 0; i < n; i++) f32[at + i] = numbers[i]!;
    return at << 2;
  }

  /**
   * Answers a view by the camera's position and its matrix from world to clip space (16 numbers, column by column), both in
   * the world's coordinates. Makes no garbage.
   */
  see(eye: ArrayLike<number>, viewProjection: ArrayLike<number>): Seen {
    const { runtime, scratch } = this;
    const at = this.put(eye, 0, 3);
    const matrix = this.put(viewProjection, 3, 16);
    runtime.checked(runtime.exports.enf_see(this.handle, at, matrix, scratch + ANSWER));
    return this.fill();
  }

  /** Answers what is seen in all directions. */
  seeAround(eye: ArrayLike<number>): Seen {
    const { runtime, scratch } = this;
    const at = this.put(eye, 0, 3);
    runtime.checked(runtime.exports.enf_see_around(this.handle, at, scratch + ANSWER));
    return this.fill();
  }

  private list(view: Uint32Array, at: number, capacity: number): Uint32Array {
    const { buffer } = this.runtime.u32;
    return view.byteOffset === at && view.buffer === buffer ? view : new Uint32Array(buffer, at, capacity);
  }

  private fill(): Seen {
    const { runtime, seen } = this;
    runtime.refresh();
    const { u32 } = runtime;
    const at = this.answer;
    seen.cells = this.list(seen.cells, u32[at]!, this.cells.length);
    if (seen.shares.byteOffset !== u32[at + 1] || seen.shares.buffer !== u32.buffer) {
      seen.shares = new Float32Array(u32.buffer, u32[at + 1], this.cells.length);
    }
    seen.portals = this.list(seen.portals, u32[at + 2]!, this.portals.length);
    seen.chunks = this.list(seen.chunks, u32[at + 3]!, this.chunkCount);
    seen.batches = this.list(seen.batches, u32[at + 4]!, this.batchCount);
    seen.details = this.list(seen.details, u32[at + 5]!, this.detailCount);
    seen.specials = this.list(seen.specials, u32[at + 6]!, this.specialCount);
    seen.cellCount = u32[at + 9]!;
    seen.portalCount = u32[at + 10]!;
    seen.chunkCount = u32[at + 11]!;
    seen.batchCount = u32[at + 12]!;
    seen.detailCount = u32[at + 13]!;
    seen.specialCount = u32[at + 14]!;
    seen.triangles = u32[at + 17]!;
    seen.eyeCell = id(u32[at + 18]!);
    return seen;
  }

  /** Returns true if a box (minimum and maximum, six numbers) in `cells` may be visible in the last view. */
  seesBox(cells: ArrayLike<number>, aabb: ArrayLike<number>): boolean {
    const { runtime } = this;
    const n = Math.min(cells.length, 64);
    const box = this.put(aabb, 0, 6);
    const at = this.answer;
    for (let i = 0; i < n; i++) runtime.u32[at + i] = cells[i]!;
    return runtime.checked(runtime.exports.enf_sees_box(this.handle, at << 2, n, box)) === 1;
  }

  /** Finds the cell of a point; -1 in solid matter. */
  locate(point: ArrayLike<number>): number {
    return this.runtime.checked(this.runtime.exports.enf_locate(this.handle, this.put(point, 0, 3)));
  }

  /** Finds the cell of a point with all that is known of it. */
  cellOf(point: ArrayLike<number>): Cell | undefined {
    return this.cells[this.locate(point)];
  }

  /** Finds a place to begin a walk, and the direction in which the way is free farthest: 0 along -z, counter-clockwise. */
  start(): { eye: [number, number, number]; yaw: number } | undefined {
    const { runtime, scratch } = this;
    if (runtime.checked(runtime.exports.enf_start(this.handle, scratch + ANSWER)) !== 1) return undefined;
    runtime.refresh();
    const [x, y, z, yaw] = runtime.f32.subarray(this.answer, this.answer + 4) as unknown as [number, number, number, number];
    return { eye: [x, y, z], yaw };
  }

  /**
   * Lists the portals that a step in a straight line crosses, in order, at most 16; and the cell at its end, or -1.
   * `isRelocated` if the way does not lead to the end through portals, but through matter.
   */
  step(from: ArrayLike<number>, to: ArrayLike<number>): { cell: number; crossed: number[]; isRelocated: boolean } {
    const { runtime, scratch } = this;
    const status = runtime.exports.enf_step(this.handle, this.put(from, 0, 3), this.put(to, 3, 3), scratch + ANSWER);
    runtime.checked(status);
    runtime.refresh();
    const [at, { u32 }] = [this.answer, runtime];
    const first = u32[at]! >>> 2;
    const crossed = [...u32.subarray(first, first + u32[at + 1]!)];
    return { cell: id(u32[at + 2]!), crossed, isRelocated: u32[at + 3] === 1 };
  }

  /** Returns true if neither wall nor closed portal is between two points; objects do not count. */
  lineOfSight(from: ArrayLike<number>, to: ArrayLike<number>): boolean {
    const { runtime } = this;
    const clear = runtime.exports.enf_is_clear(this.handle, this.put(from, 0, 3), this.put(to, 3, 3));
    return runtime.checked(clear) === 1;
  }

  /** Finds the first wall, object or closed portal from one point to another. */
  pick(from: ArrayLike<number>, to: ArrayLike<number>): Hit | undefined {
    const { runtime, scratch } = this;
    const status = runtime.exports.enf_pick(this.handle, this.put(from, 0, 3), this.put(to, 3, 3), scratch + ANSWER);
    if (runtime.checked(status) !== 1) return undefined;
    runtime.refresh();
    const [at, { u32, f32 }] = [this.answer, runtime];
    return {
      t: f32[at]!,
      position: [f32[at + 1]!, f32[at + 2]!, f32[at + 3]!],
      normal: [f32[at + 4]!, f32[at + 5]!, f32[at + 6]!],
      target: TARGETS[u32[at + 7]!]!,
      index: u32[at + 8]!,
      primitive: u32[at + 9]!,
      triangle: u32[at + 10]!,
      cell: id(u32[at + 11]!),
      portal: id(u32[at + 12]!),
    };
  }

  /** Moves the leaves of a portal, from 0 for shut to 1 for fully open; a portal without leaves closes at 0. */
  setOpenness(portal: number, share: number): void {
    this.runtime.checked(this.runtime.exports.enf_set_openness(this.handle, portal, share));
  }

  /** Returns the position of the leaves of a portal; without leaves, 1 if it is open. */
  openness(portal: number): number {
    this.runtime.checked(this.runtime.exports.enf_portal(this.handle, portal, this.scratch + ANSWER));
    this.runtime.refresh();
    return this.runtime.f32[this.answer + 6]!;
  }

  /** Returns true if anything passes a portal. */
  isOpen(portal: number): boolean {
    this.runtime.checked(this.runtime.exports.enf_portal(this.handle, portal, this.scratch + ANSWER));
    this.runtime.refresh();
    return this.runtime.u32[this.answer + 5] === 1;
  }

  /** Closes a portal for sight whatever its leaves are made of, or opens it fully. */
  setClosed(portal: number, isClosed: boolean): void {
    this.runtime.checked(this.runtime.exports.enf_set_closed(this.handle, portal, isClosed ? 1 : 0));
  }

  /** Locks a cell, which is then never seen from others, or unlocks it. */
  lock(cell: number, isLocked: boolean): void {
    this.runtime.checked(this.runtime.exports.enf_lock(this.handle, cell, isLocked ? 1 : 0));
  }

  /** Writes the transform from an object's pose in the file to its present one to `out`; false if it was not moved. */
  pose(detail: number, out: Float32Array | number[]): boolean {
    const status = this.runtime.exports.enf_pose(this.handle, detail, this.scratch + ANSWER);
    if (this.runtime.checked(status) !== 1) return false;
    this.runtime.refresh();
    const at = this.answer;
    for (let i = 0; i < 16; i++) out[i] = this.runtime.f32[at + i]!;
    return true;
  }

  private ids(status: number): number[] | undefined {
    if (this.runtime.checked(status) < 0) return undefined;
    this.runtime.refresh();
    const { u32 } = this.runtime;
    const first = u32[this.answer]! >>> 2;
    return [...u32.subarray(first, first + u32[this.answer + 1]!)];
  }

  /** Lists the cells that may be visible from a cell; undefined if the file does not say. */
  pvs(cell: number): number[] | undefined {
    return this.ids(this.runtime.exports.enf_pvs_row(this.handle, cell, this.scratch + ANSWER));
  }

  /** Lists the portals of which an object is a leaf. */
  portalsOfDetail(detail: number): number[] {
    return this.ids(this.runtime.exports.enf_portals_of_detail(this.handle, detail, this.scratch + ANSWER)) ?? [];
  }

  /** Lists the cells that an object touches; for a leaf, all that it sweeps. */
  cellsOfDetail(detail: number): number[] {
    return this.ids(this.runtime.exports.enf_cells_of_detail(this.handle, detail, this.scratch + ANSWER)) ?? [];
  }

  /** Lists the cells that see a batch. */
  cellsOfBatch(batch: number): number[] {
    return this.ids(this.runtime.exports.enf_cells_of_batch(this.handle, batch, this.scratch + ANSWER)) ?? [];
  }
}
