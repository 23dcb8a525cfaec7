/** A thin adapter for Babylon.js: shows, of the meshes of a loaded world, what the camera may see; turns doors. */
import { Matrix, Quaternion, Vector3 } from '@babylonjs/core/Maths/math.vector.js';
import type { Camera } from '@babylonjs/core/Cameras/camera.js';
import type { AbstractMesh } from '@babylonjs/core/Meshes/abstractMesh.js';
import type { TransformNode } from '@babylonjs/core/Meshes/transformNode.js';
import type { Node } from '@babylonjs/core/node.js';
import { extensionOf, takeApart } from './glb.js';
import { Runtime, bytesOf, type WasmSource } from './wasm.js';
import { World, type Seen } from './world.js';

/** What Babylon's loader returns, as far as the adapter needs it: an `AssetContainer`, or the result of an import. */
export interface Loaded {
  meshes: AbstractMesh[];
  transformNodes: TransformNode[];
}

/** Returns the places of glTF that an object was made of, such as `/nodes/3`. */
function pointersOf(node: Node): string[] {
  const { _internalMetadata: own } = node as unknown as { _internalMetadata?: { gltf?: { pointers?: string[] } } };
  return own?.gltf?.pointers ?? [];
}

/** Culls a world in Babylon.js. */
export class BabylonCuller {
  /** The last answer; its lists are valid until the next update. */
  seen: Seen | undefined;
  private readonly root: TransformNode | undefined;
  private readonly batches: (AbstractMesh | undefined)[];
  private readonly details: (TransformNode | undefined)[];
  private readonly rest = new Map<number, Matrix>();
  private readonly toClip = new Matrix();
  private readonly inverse = new Matrix();
  private readonly eye = new Vector3();

  private constructor(
    readonly world: World,
    glb: Uint8Array,
    loaded: Loaded,
  ) {
    const extension = extensionOf(takeApart(glb).json);
    const byPlace = new Map<string, Node>();
    for (const node of [...loaded.meshes, ...loaded.transformNodes]) {
      for (const place of pointersOf(node)) byPlace.set(place, node);
    }
    this.root = [...loaded.meshes, ...loaded.transformNodes].find((node) => node.name === '__root__');
    this.batches = extension.batches.map(
      ({ mesh, primitive }) => byPlace.get(`/meshes/${mesh}/primitives/${primitive}`) as AbstractMesh | undefined,
    );
    this.details = extension.details.map(({ node }) => byPlace.get(`/nodes/${node}`) as TransformNode | undefined);
  }

  /** Makes the culler of a world that Babylon has loaded; `source` is the same file, or where it is. */
  static async of(source: BufferSource | URL | string, loaded: Loaded, wasm?: WasmSource): Promise<BabylonCuller> {
    const [runtime, glb] = await Promise.all([Runtime.load(wasm), bytesOf(source)]);
    const { text, bin } = takeApart(glb);
    return new BabylonCuller(World.ofParts(runtime, text, bin), glb, loaded);
  }

  /** Asks what `camera` sees, and shows exactly that. Call it before every frame, in `onBeforeRenderObservable`. */
  update(camera: Camera): Seen {
    const space = this.root?.computeWorldMatrix(true) ?? Matrix.IdentityReadOnly;
    camera.computeWorldMatrix();
    space.multiplyToRef(camera.getViewMatrix(true).multiply(camera.getProjectionMatrix(true)), this.toClip);
    space.invertToRef(this.inverse);
    Vector3.TransformCoordinatesToRef(camera.globalPosition, this.inverse, this.eye);
    const seen = this.world.see(this.eye.asArray(), this.toClip.m);
    this.seen = seen;
    for (const mesh of this.batches) if (mesh) mesh.isVisible = false;
    for (const node of this.details) node?.setEnabled(false);
    for (let i = 0; i < seen.batchCount; i++) {
      const mesh = this.batches[seen.batches[i]!];
      if (mesh) mesh.isVisible = true;
    }
    for (let i = 0; i < seen.detailCount; i++) this.details[seen.details[i]!]?.setEnabled(true);
    return seen;
  }

  /** Moves the leaves of a portal, from 0 for shut to 1 for open. */
  setOpenness(portal: number, share: number): void {
    this.world.setOpenness(portal, share);
    for (const { detail } of this.world.portals[portal]?.leaves ?? []) this.turn(detail);
  }

  private turn(detail: number): void {
    const node = this.details[detail];
    const pose = new Array<number>(16).fill(0);
    if (!node || !this.world.pose(detail, pose)) return;
    const space = this.root?.computeWorldMatrix(true) ?? Matrix.IdentityReadOnly;
    const parent = node.parent?.computeWorldMatrix(true) ?? Matrix.IdentityReadOnly;
    // From the node's parent to the world's own space, where poses are.
    const up = parent.multiply(Matrix.Invert(space));
    let rest = this.rest.get(detail);
    if (!rest) {
      rest = Matrix.Compose(node.scaling, node.rotationQuaternion ?? Quaternion.FromEulerVector(node.rotation), node.position);
      this.rest.set(detail, rest);
    }
    const turned = rest.multiply(up).multiply(Matrix.FromArray(pose)).multiply(Matrix.Invert(up));
    node.rotationQuaternion ??= new Quaternion();
    turned.decompose(node.scaling, node.rotationQuaternion, node.position);
  }

  /** Finds the first thing from `origin` along `direction`, both of Babylon's world. */
  pick(origin: Vector3, direction: Vector3, far = 100): ReturnType<World['pick']> {
    const space = this.root?.computeWorldMatrix(true) ?? Matrix.IdentityReadOnly;
    const inverse = Matrix.Invert(space);
    const from = Vector3.TransformCoordinates(origin, inverse);
    const to = Vector3.TransformCoordinates(direction.normalizeToNew().scale(far).add(origin), inverse);
    return this.world.pick(from.asArray(), to.asArray());
  }
}
