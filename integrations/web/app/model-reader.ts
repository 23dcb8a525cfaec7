// A GLB as pieces that can be drawn at once: triangles of many objects together, by material, in meters of the world.
import { takeApart } from '../src/glb.js';

/** Triangles of one look. All colors are linear. */
export interface Piece {
  /** Three numbers a vertex. */
  positions: Float32Array<ArrayBuffer>;
  /** Red, green, blue and opacity of each vertex. */
  colors: Uint8Array<ArrayBuffer>;
  /** Two numbers a vertex, if there is a picture. */
  uvs?: Float32Array<ArrayBuffer>;
  indices: Uint16Array<ArrayBuffer>;
  look: Look;
}

/** How triangles are drawn. */
export interface Look {
  /** Number of the image, or -1. */
  image: number;
  alpha: 'OPAQUE' | 'MASK' | 'BLEND';
}

/** A model. */
export interface Pieces {
  pieces: Piece[];
  /** Lowest and highest coordinates; nothing of finite size has `Infinity`. */
  box: [number[], number[]];
  /** Bytes of the pictures that pieces have, by number of the image. */
  images: Map<number, Blob>;
}

interface Json {
  scene?: number;
  scenes?: { nodes?: number[] }[];
  nodes?: { children?: number[]; mesh?: number; matrix?: number[]; translation?: number[]; rotation?: number[]; scale?: number[] }[];
  meshes?: { primitives?: Primitive[] }[];
  accessors?: Accessor[];
  bufferViews?: { byteOffset?: number; byteLength: number; byteStride?: number }[];
  materials?: Material[];
  textures?: { source?: number; extensions?: Record<string, { source?: number }> }[];
  images?: { bufferView?: number; mimeType?: string }[];
  extensionsRequired?: string[];
}

interface Primitive {
  attributes: Record<string, number>;
  indices?: number;
  material?: number;
  mode?: number;
}

interface Accessor {
  bufferView?: number;
  byteOffset?: number;
  componentType: number;
  count: number;
  type: string;
  normalized?: boolean;
}

interface Turned {
  offset?: number[];
  scale?: number[];
  rotation?: number;
  texCoord?: number;
}

interface Material {
  pbrMetallicRoughness?: {
    baseColorFactor?: number[];
    baseColorTexture?: { index: number; texCoord?: number; extensions?: { KHR_texture_transform?: Turned } };
  };
  alphaMode?: Look['alpha'];
}

/** Extensions without which the triangles are not where they seem to be. */
const HARD = /^(KHR_draco_mesh_compression|EXT_meshopt_compression|KHR_meshopt_compression)$/;
/** Most vertices of a piece. */
const MOST = 1 << 16;
/** Most corners of a piece: a frame must not wait for one. */
const MOST_CORNERS = 180_000;
const SIZES: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

type Numbers = Float32Array | Uint32Array | Uint16Array | Uint8Array | Int16Array | Int8Array;
const KINDS: Record<number, [new (b: ArrayBuffer, at: number, n: number) => Numbers, number, number]> = {
  5120: [Int8Array, 1, 127],
  5121: [Uint8Array, 1, 255],
  5122: [Int16Array, 2, 32767],
  5123: [Uint16Array, 2, 65535],
  5125: [Uint32Array, 4, 1],
  5126: [Float32Array, 4, 1],
};

/** Returns the numbers of an accessor, one after another. */
function numbersOf(json: Json, bin: Uint8Array, index: number | undefined): { values: Numbers; count: number; size: number } | undefined {
  const accessor = index === undefined ? undefined : json.accessors?.[index];
  if (!accessor) return undefined;
  const size = SIZES[accessor.type];
  const kind = KINDS[accessor.componentType];
  if (!size || !kind) throw new Error('an accessor has no numbers of a known kind');
  const [Kind, bytes, unit] = kind;
  const { count } = accessor;
  const view = accessor.bufferView === undefined ? undefined : json.bufferViews?.[accessor.bufferView];
  if (!view) return { values: new Float32Array(count * size), count, size };
  const stride = view.byteStride ?? bytes * size;
  const from = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
  if (!(count >= 0) || from + (count - 1) * stride + bytes * size > bin.length) throw new Error('an accessor is larger than the file');
  const packed = new Uint8Array(count * size * bytes);
  if (stride === bytes * size) packed.set(bin.subarray(from, from + packed.length));
  else for (let i = 0; i < count; i++) packed.set(bin.subarray(from + i * stride, from + i * stride + size * bytes), i * size * bytes);
  const values = new Kind(packed.buffer, 0, count * size);
  if (!accessor.normalized || unit === 1) return { values, count, size };
  return { values: Float32Array.from(values, (v) => Math.max(-1, v / unit)), count, size };
}

/** Column-major, as in glTF. */
function product(a: readonly number[], b: readonly number[]): number[] {
  const out = new Array<number>(16).fill(0);
  for (let c = 0; c < 4; c++) for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r]! += a[4 * k + r]! * b[4 * c + k]!;
  return out;
}

function matrixOf({ matrix, translation: t = [0, 0, 0], rotation: q = [0, 0, 0, 1], scale: s = [1, 1, 1] }: NonNullable<Json['nodes']>[number]): number[] {
  if (matrix) return matrix;
  const [x, y, z, w] = q as [number, number, number, number];
  const [sx, sy, sz] = s as [number, number, number];
  return [
    (1 - 2 * (y * y + z * z)) * sx, 2 * (x * y + z * w) * sx, 2 * (x * z - y * w) * sx, 0,
    2 * (x * y - z * w) * sy, (1 - 2 * (x * x + z * z)) * sy, 2 * (y * z + x * w) * sy, 0,
    2 * (x * z + y * w) * sz, 2 * (y * z - x * w) * sz, (1 - 2 * (x * x + y * y)) * sz, 0,
    t[0]!, t[1]!, t[2]!, 1,
  ];
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

/** Iterates over the meshes of the scene with their places; a node counts once. */
function* placed(json: Json): Generator<[mesh: number, place: number[]]> {
  const { nodes = [] } = json;
  const roots = json.scenes?.[json.scene ?? 0]?.nodes ?? nodes.keys();
  const seen = new Set<number>();
  const left = [...roots].map((i): [number, readonly number[]] => [i, IDENTITY]).reverse();
  for (let next = left.pop(); next; next = left.pop()) {
    const [i, above] = next;
    const node = nodes[i];
    if (!node || seen.has(i)) continue;
    seen.add(i);
    const place = product(above, matrixOf(node));
    if (node.mesh !== undefined) yield [node.mesh, place];
    for (const child of [...(node.children ?? [])].reverse()) left.push([child, place]);
  }
}

/** Returns the corners of triangles; `undefined` for points and lines. */
function cornersOf(values: ArrayLike<number> | undefined, count: number, mode = 4): ArrayLike<number> | undefined {
  const n = values?.length ?? count;
  const at = (i: number): number => values?.[i] ?? i;
  if (mode === 4) return values ?? Uint32Array.from({ length: n }, (_, i) => i);
  if (mode !== 5 && mode !== 6) return undefined;
  const out = new Uint32Array(3 * Math.max(0, n - 2));
  for (let i = 0; i + 2 < n; i++) {
    const first = mode === 6 ? 0 : i;
    out.set([at(first), at(i + 1), at(i + 2)], 3 * i);
  }
  return out;
}

/** Pieces in the making. */
class Heap {
  positions: number[] = [];
  colors: number[] = [];
  uvs: number[] = [];
  indices: number[] = [];
}

const byte = (share: number): number => Math.round(255 * Math.min(1, Math.max(0, share)));

class Reader {
  readonly out: Pieces = { pieces: [], box: [[Infinity, Infinity, Infinity], [-Infinity, -Infinity, -Infinity]], images: new Map() };
  private readonly heaps = new Map<string, { heap: Heap; look: Look }>();

  constructor(
    private readonly json: Json,
    private readonly bin: Uint8Array,
  ) {}

  private numbers(index: number | undefined): { values: Numbers; count: number; size: number } | undefined {
    return numbersOf(this.json, this.bin, index);
  }

  private imageOf(texture: number | undefined): number {
    const found = texture === undefined ? undefined : this.json.textures?.[texture];
    const webp = found?.extensions?.EXT_texture_webp?.source;
    const i = webp ?? found?.source ?? -1;
    const image = this.json.images?.[i];
    const view = image?.bufferView === undefined ? undefined : this.json.bufferViews?.[image.bufferView];
    if (!image || !view) return -1;
    const from = view.byteOffset ?? 0;
    const bytes = this.bin.slice(from, from + view.byteLength);
    if (!this.out.images.has(i)) this.out.images.set(i, new Blob([bytes], { type: image.mimeType ?? '' }));
    return i;
  }

  private finish(key: string): Heap {
    const { heap, look } = this.heaps.get(key)!;
    this.out.pieces.push({
      positions: new Float32Array(heap.positions),
      colors: new Uint8Array(heap.colors),
      uvs: look.image >= 0 ? new Float32Array(heap.uvs) : undefined,
      indices: new Uint16Array(heap.indices),
      look,
    });
    const next = new Heap();
    this.heaps.set(key, { heap: next, look });
    return next;
  }

  add(primitive: Primitive, m: readonly number[]): void {
    const positions = this.numbers(primitive.attributes.POSITION);
    if (!positions || positions.size !== 3) return;
    const corners = cornersOf(this.numbers(primitive.indices)?.values, positions.count, primitive.mode);
    if (!corners) return;
    const material = this.json.materials?.[primitive.material ?? -1] ?? {};
    const { baseColorFactor = [1, 1, 1, 1], baseColorTexture } = material.pbrMetallicRoughness ?? {};
    const turned = baseColorTexture?.extensions?.KHR_texture_transform ?? {};
    const set = turned.texCoord ?? baseColorTexture?.texCoord ?? 0;
    const uvs = baseColorTexture ? this.numbers(primitive.attributes[`TEXCOORD_${set}`]) : undefined;
    const image = uvs ? this.imageOf(baseColorTexture!.index) : -1;
    const look: Look = { image, alpha: material.alphaMode ?? 'OPAQUE' };
    const key = `${image} ${look.alpha}`;
    if (!this.heaps.has(key)) this.heaps.set(key, { heap: new Heap(), look });
    const colors = this.numbers(primitive.attributes.COLOR_0);
    const flat = baseColorFactor.map(byte);
    const uvOf = turning(turned);
    const [low, high] = this.out.box;
    let { heap } = this.heaps.get(key)!;
    const known = new Map<number, number>();
    const vertex = (v: number): number => {
      const i = known.get(v);
      if (i !== undefined) return i;
      const [x, y, z] = [positions.values[3 * v]!, positions.values[3 * v + 1]!, positions.values[3 * v + 2]!];
      for (let r = 0; r < 3; r++) {
        const value = m[r]! * x + m[4 + r]! * y + m[8 + r]! * z + m[12 + r]!;
        heap.positions.push(value);
        if (value < low[r]!) low[r] = value;
        if (value > high[r]!) high[r] = value;
      }
      if (colors) {
        for (let k = 0; k < 4; k++) heap.colors.push(byte((k < colors.size ? colors.values[colors.size * v + k]! : 1) * baseColorFactor[k]!));
      } else heap.colors.push(flat[0]!, flat[1]!, flat[2]!, flat[3]!);
      if (image >= 0) heap.uvs.push(...uvOf(uvs!.values[2 * v]!, uvs!.values[2 * v + 1]!));
      const own = heap.positions.length / 3 - 1;
      known.set(v, own);
      return own;
    };
    for (let i = 0; i + 2 < corners.length; i += 3) {
      if (heap.positions.length / 3 + 3 > MOST || heap.indices.length >= MOST_CORNERS) {
        heap = this.finish(key);
        known.clear();
      }
      const [a, b, c] = [corners[i]!, corners[i + 1]!, corners[i + 2]!];
      if (Math.max(a, b, c) >= positions.count) continue;
      heap.indices.push(vertex(a), vertex(b), vertex(c));
    }
  }

  end(): Pieces {
    for (const [key, { heap }] of [...this.heaps]) if (heap.indices.length > 0) this.finish(key);
    // What can be seen through comes last.
    const rank = { OPAQUE: 0, MASK: 1, BLEND: 2 };
    this.out.pieces.sort((a, b) => rank[a.look.alpha] - rank[b.look.alpha]);
    return this.out;
  }
}

/** Returns the turning of coordinates of pictures that a material asks for. */
function turning({ offset = [0, 0], scale = [1, 1], rotation = 0 }: Turned): (u: number, v: number) => [number, number] {
  const [c, s] = [Math.cos(rotation), Math.sin(rotation)];
  const [su, sv] = scale as [number, number];
  const [ou, ov] = offset as [number, number];
  return (u, v) => [c * u * su + s * v * sv + ou, -s * u * su + c * v * sv + ov];
}

/** Reads a GLB. Throws if it is damaged, or compressed in a way that is not read here. */
export function readModel(bytes: Uint8Array): Pieces {
  const taken = takeApart(bytes);
  const json = taken.json as unknown as Json;
  const hard = json.extensionsRequired?.find((name) => HARD.test(name));
  if (hard) throw new Error(`${hard} is not read here`);
  const reader = new Reader(json, taken.bin);
  for (const [mesh, place] of placed(json)) for (const primitive of json.meshes?.[mesh]?.primitives ?? []) reader.add(primitive, place);
  return reader.end();
}
