/** A packed world in three.js: what comes into view is fetched, the rest stays on the server. */
import {
  BufferAttribute,
  BufferGeometry,
  Mesh,
  MeshStandardMaterial,
  Texture,
  type Camera,
  type Group,
  type Material,
  type Object3D,
  type TypedArray,
} from 'three';
import { GLTFLoader, type GLTF } from 'three/addons/loaders/GLTFLoader.js';
import { PortalCuller } from './culler.js';
import { extensionOf, type WorldExtension } from './glb.js';
import { PackedPlace, type Piece, type PieceJson } from './packed.js';
import { Streamer, type Receiver, type StreamCounts, type StreamOptions } from './streamer.js';
import { drawBothSides, partsOf } from './three.js';
import { Runtime, type WasmSource } from './wasm.js';
import { World } from './world.js';

export { PackedPlace, decodeHead, decodePiece, type Head, type Piece } from './packed.js';
export { Streamer, type StreamCounts, type StreamOptions } from './streamer.js';

/** Material of primitives without one, as glTF defines it. */
const DEFAULT = new MeshStandardMaterial({ color: 0xffffff, metalness: 1, roughness: 1 });

/** Names of attributes in three.js. */
const ATTRIBUTES: Record<string, string> = {
  POSITION: 'position',
  NORMAL: 'normal',
  TANGENT: 'tangent',
  TEXCOORD_0: 'uv',
  TEXCOORD_1: 'uv1',
  TEXCOORD_2: 'uv2',
  TEXCOORD_3: 'uv3',
  COLOR_0: 'color',
};

const WIDTHS: Record<string, number> = { SCALAR: 1, VEC2: 2, VEC3: 3, VEC4: 4 };

const ARRAYS: Record<number, { new (buffer: ArrayBuffer): TypedArray; BYTES_PER_ELEMENT: number }> = {
  5120: Int8Array,
  5121: Uint8Array,
  5122: Int16Array,
  5123: Uint16Array,
  5125: Uint32Array,
  5126: Float32Array,
};

/** Makes the attribute of an accessor, with memory of its own. */
function attribute(piece: Piece, index: number): BufferAttribute {
  const accessor = piece.json.accessors![index]!;
  const view = piece.json.bufferViews![accessor.bufferView]!;
  const Numbers = ARRAYS[accessor.componentType]!;
  const width = WIDTHS[accessor.type]!;
  const row = width * Numbers.BYTES_PER_ELEMENT;
  const step = view.byteStride ?? row;
  const begin = (view.byteOffset ?? 0) + (accessor.byteOffset ?? 0);
  const bytes = new Uint8Array(row * accessor.count);
  if (step === row) bytes.set(piece.data.subarray(begin, begin + bytes.length));
  else {
    for (let i = 0; i < accessor.count; i++) {
      bytes.set(piece.data.subarray(begin + i * step, begin + i * step + row), i * row);
    }
  }
  return new BufferAttribute(new Numbers(bytes.buffer), width, accessor.normalized ?? false);
}

function geometryOf(piece: Piece, primitive: NonNullable<PieceJson['primitives']>[number]): BufferGeometry {
  const geometry = new BufferGeometry();
  for (const [name, accessor] of Object.entries(primitive.attributes)) {
    geometry.setAttribute(ATTRIBUTES[name] ?? name.toLowerCase(), attribute(piece, accessor));
  }
  if (primitive.indices !== undefined) geometry.setIndex(attribute(piece, primitive.indices));
  return geometry;
}

/** Options of a streamed world. */
export interface StreamedOptions extends StreamOptions {
  /** Where the module is, if it does not lie beside this package's code; it may be on its way. */
  wasm?: WasmSource | Promise<WasmSource>;
}

/** A packed world in a scene. Add `scene`, and call `update` every frame before rendering. */
export class StreamedWorld implements Receiver {
  readonly culler: PortalCuller;
  readonly streamer: Streamer;
  /** Objects of the world; materials, doors and graph are there from the beginning. */
  readonly scene: Group;
  private readonly detailsOf = new Map<number, number[]>();
  private readonly made = new Map<number, (() => void)[]>();
  private readonly materials: Material[];

  private constructor(
    readonly place: PackedPlace,
    readonly world: World,
    private readonly gltf: GLTF,
    materials: Material[],
    private readonly extension: WorldExtension,
    options: StreamOptions,
  ) {
    this.materials = materials;
    this.scene = gltf.scene;
    extension.details.forEach((detail, i) => {
      const known = this.detailsOf.get(detail.mesh);
      if (known) known.push(i);
      else this.detailsOf.set(detail.mesh, [i]);
    });
    drawBothSides(gltf.scene);
    this.culler = new PortalCuller(world, partsOf(gltf, extension));
    this.streamer = new Streamer(place, world, this, options);
  }

  /** Opens a packed world at an address; only its head is read. */
  static async open(address: string | URL, options: StreamedOptions = {}): Promise<StreamedWorld> {
    const load = async (): Promise<Runtime> => Runtime.load(await options.wasm);
    const [runtime, place] = await Promise.all([load(), PackedPlace.open(address)]);
    const { hollow, skeleton } = place.head;
    const world = World.hollow(runtime, hollow, skeleton);
    const bytes = hollow.slice().buffer as ArrayBuffer;
    const gltf = await new GLTFLoader().parseAsync(bytes, '');
    const names = (place.json['materials'] as unknown[] | undefined) ?? [];
    const materials = await Promise.all(names.map((_, i) => gltf.parser.getDependency('material', i) as Promise<Material>));
    return new StreamedWorld(place, world, gltf, materials, extensionOf(place.json), options);
  }

  /** Fetches what `camera` sees and may see soon, and shows what is there. */
  update(camera: Camera, now = performance.now()): StreamCounts {
    this.culler.update(camera);
    return this.streamer.update(this.culler.seen!, now);
  }

  /** Frees everything. */
  dispose(): void {
    for (const piece of [...this.made.keys()]) this.remove(piece);
    this.scene.removeFromParent();
    this.world.close();
  }

  private mesh(piece: Piece, primitive: NonNullable<PieceJson['primitives']>[number]): Mesh {
    const mesh = new Mesh(geometryOf(piece, primitive));
    mesh.material = primitive.material === undefined ? DEFAULT : this.materials[primitive.material]!;
    // Chooses the variant of the material for the attributes that there are, as for whole files.
    this.gltf.parser.assignFinalMaterial(mesh);
    drawBothSides(mesh);
    return mesh;
  }

  /** Puts the contents of a piece into the scene. */
  add(index: number, piece: Piece): void {
    const undo: (() => void)[] = [];
    this.made.set(index, undo);
    const { batches, mesh, image, primitives = [] } = piece.json;
    batches?.forEach((batch, i) => {
      const object = this.mesh(piece, primitives[i]!);
      this.scene.add(object);
      this.culler.put('batches', batch, object);
      undo.push(() => {
        this.culler.put('batches', batch, undefined);
        object.removeFromParent();
        object.geometry.dispose();
      });
    });
    if (mesh !== undefined) this.addMesh(piece, mesh, undo);
    if (image !== undefined) this.addImage(piece, image, undo);
  }

  private addMesh(piece: Piece, mesh: number, undo: (() => void)[]): void {
    const originals = (piece.json.primitives ?? []).map((primitive) => this.mesh(piece, primitive));
    for (const detail of this.detailsOf.get(mesh) ?? []) {
      const node: Object3D | undefined = this.culler.parts.details[detail];
      // Leaves of doors are there from the beginning.
      if (!node || node.children.length > 0 || node instanceof Mesh) continue;
      const own = originals.map((original) => new Mesh(original.geometry, original.material));
      for (const object of own) node.add(object);
      undo.push(() => {
        for (const object of own) object.removeFromParent();
      });
    }
    undo.push(() => {
      for (const { geometry } of originals) geometry.dispose();
    });
  }

  /** Exchanges the white picture of the head for the real one. */
  private addImage(piece: Piece, image: number, undo: (() => void)[]): void {
    const own = (this.place.json.images ?? [])[image];
    const blob = new Blob([piece.data as Uint8Array<ArrayBuffer>], { type: own?.mimeType ?? '' });
    let isGone = false;
    undo.push(() => {
      isGone = true;
    });
    const set = (texture: Texture, picture: unknown): void => {
      // Frees the memory of the old size.
      texture.dispose();
      texture.image = picture as TexImageSource;
      texture.needsUpdate = true;
    };
    void createImageBitmap(blob, { colorSpaceConversion: 'none', premultiplyAlpha: 'none' }).then((bitmap) => {
      if (isGone) return;
      for (const texture of this.texturesOf(image)) {
        const before: unknown = texture.image;
        set(texture, bitmap);
        undo.push(() => set(texture, before));
      }
    });
  }

  private texturesOf(image: number): Set<Texture> {
    const textures = (this.place.json['textures'] as { source?: number }[] | undefined) ?? [];
    const out = new Set<Texture>();
    for (const material of this.allMaterials()) {
      for (const value of Object.values(material)) {
        if (!(value instanceof Texture)) continue;
        const at = this.gltf.parser.associations.get(value) as { textures?: number } | undefined;
        if (at?.textures !== undefined && textures[at.textures]?.source === image) out.add(value);
      }
    }
    return out;
  }

  /** Materials of the file, and their variants in the scene. */
  private allMaterials(): Set<Material> {
    const out = new Set<Material>(this.materials);
    this.scene.traverse((object) => {
      if (!(object instanceof Mesh)) return;
      const own = object.material as Material | Material[];
      for (const material of Array.isArray(own) ? own : [own]) out.add(material);
    });
    return out;
  }

  /** Takes the contents of a piece out of the scene. */
  remove(index: number): void {
    for (const undo of this.made.get(index) ?? []) undo();
    this.made.delete(index);
  }

  /** Returns the extension of the world, without triangles. */
  get graph(): WorldExtension {
    return this.extension;
  }
}
