/** A plugin for three.js' GLTFLoader: worlds come with a culler. */
import { DoubleSide, Light, Mesh, type Material, type Object3D } from 'three';
import type { GLTF, GLTFLoaderPlugin, GLTFParser } from 'three/addons/loaders/GLTFLoader.js';
import { PortalCuller, type Parts } from './culler.js';
import { EXTENSION, extensionOf, type GltfJson, type WorldExtension } from './glb.js';
import { Runtime, type WasmSource } from './wasm.js';
import { World } from './world.js';

export { PortalCuller, type Counts, type Parts, type PickResult } from './culler.js';

/** Options of the plugin. */
export interface PluginOptions {
  /** Where the module is, if it does not lie beside this package's code. */
  wasm?: WasmSource;
  /**
   * True to keep materials one-sided as in the file. Visibility counts every surface as opaque from both sides; an eye
   * that gets behind a one-sided wall or into a cupboard then sees holes. By default all are drawn from both sides.
   */
  oneSided?: boolean;
}

/**
 * Makes the plugin: `loader.register(enfilade())`. After loading a world, `gltf.userData.enfilade` is its `PortalCuller`;
 * other files load as ever.
 */
export function enfilade(options: PluginOptions = {}): (parser: GLTFParser) => GLTFLoaderPlugin {
  return (parser) => new WorldPlugin(parser, options);
}

/** Returns the culler of a loaded world; throws if the file was not one. */
export function cullerOf(gltf: GLTF): PortalCuller {
  const culler = gltf.userData['enfilade'] as PortalCuller | undefined;
  if (!culler) throw new Error(`this file has no rooms and doorways (${EXTENSION}): run \`enfilade bake\` first`);
  return culler;
}

/** Makes all materials below an object two-sided, as visibility counts them. */
export function drawBothSides(root: Object3D): void {
  root.traverse((object) => {
    if (!(object instanceof Mesh)) return;
    const own = object.material as Material | Material[];
    for (const material of Array.isArray(own) ? own : [own]) material.side = DoubleSide;
  });
}

/** Parts of a GLB, as the loader keeps them. */
interface BinaryChunks {
  content: string;
  body: ArrayBuffer;
}

class WorldPlugin implements GLTFLoaderPlugin {
  readonly name = EXTENSION;

  constructor(
    private readonly parser: GLTFParser,
    private readonly options: PluginOptions,
  ) {}

  async afterRoot(gltf: GLTF): Promise<void> {
    const json = this.parser.json as GltfJson;
    if (!json.extensions?.[EXTENSION]) return;
    const runtime = await Runtime.load(this.options.wasm);
    const { extensions } = this.parser as unknown as { extensions: Record<string, BinaryChunks | undefined> };
    const chunks = extensions['KHR_binary_glTF'];
    if (!chunks) throw new Error('a world is one .glb file');
    const world = World.ofParts(runtime, chunks.content, new Uint8Array(chunks.body));
    if (!this.options.oneSided) drawBothSides(gltf.scene);
    gltf.userData['enfilade'] = new PortalCuller(world, partsOf(gltf, extensionOf(json)));
  }
}

/** Finds the objects of batches and details among those that the loader made. */
export function partsOf(gltf: GLTF, extension: WorldExtension): Parts {
  const batchOf = new Map<string, number>();
  extension.batches.forEach((b, i) => {
    if (b.mesh !== undefined) batchOf.set(`${b.mesh}/${b.primitive}`, i);
  });
  const detailOf = new Map(extension.details.map((d, i) => [d.node, i]));
  const parts: Parts = {
    root: gltf.scene,
    batches: extension.batches.map(() => undefined),
    details: extension.details.map(() => undefined),
    lights: [],
  };
  const visit = (object: Object3D): void => {
    const at = gltf.parser.associations.get(object) as { nodes?: number; meshes?: number; primitives?: number } | undefined;
    const detail = at?.nodes === undefined ? undefined : detailOf.get(at.nodes);
    if (detail !== undefined) {
      parts.details[detail] = object;
      return;
    }
    if (object instanceof Light) parts.lights.push(object);
    if (object instanceof Mesh) {
      const batch = batchOf.get(`${at?.meshes}/${at?.primitives ?? 0}`);
      if (batch !== undefined) parts.batches[batch] = object;
    }
    object.children.forEach(visit);
  };
  visit(gltf.scene);
  return parts;
}
