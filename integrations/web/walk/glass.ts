// Panes that the file has as opaque: converters of building models name materials by the class of the object, and lose the rest.
import { Mesh, MeshStandardMaterial, type Object3D } from 'three';
import type { PortalCuller } from '../src/culler.js';

const PANES = ['ifcwindow', 'window', 'glass', 'glazing', 'pane'];

/** Returns true if a material's name means a pane: one word, or one beside a number, since "glass wool" is no glass. */
export function isPane(name: string): boolean {
  const words = name.toLowerCase().split(/[^\p{L}\p{N}]+/u);
  const named = words.filter((word) => word !== '' && !/^\d+$/.test(word));
  return named.length === 1 && PANES.includes(named[0]!);
}

function materialsOf(object: Object3D): MeshStandardMaterial[] {
  const out: MeshStandardMaterial[] = [];
  object.traverse((part) => {
    if (!(part instanceof Mesh)) return;
    const own = Array.isArray(part.material) ? part.material : [part.material];
    out.push(...own.filter((material) => material instanceof MeshStandardMaterial));
  });
  return out;
}

/** Makes panes of an object clear, except those of materials named in `opaque`. */
export function glaze(object: Object3D, opaque: ReadonlySet<string> = new Set()): void {
  for (const material of materialsOf(object)) {
    const { name, transparent, alphaTest, map } = material;
    if (transparent || alphaTest > 0 || map || opaque.has(name) || !isPane(name)) continue;
    material.transparent = true;
    // The frame is drawn the same way, and a pane has several faces in depth.
    material.opacity = Math.min(material.opacity, 0.12);
    material.depthWrite = false;
    material.needsUpdate = true;
  }
}

/** Makes the panes of a world's objects clear, those that come later, too. Walls of the same material stay: nothing behind is drawn. */
export function glazeAll(culler: PortalCuller): void {
  const walls = new Set<string>();
  const isWall = (object: Object3D): void => materialsOf(object).forEach(({ name }) => walls.add(name));
  culler.parts.batches.forEach((object) => object && isWall(object));
  culler.parts.details.forEach((object) => object && glaze(object, walls));
  const put = culler.put.bind(culler);
  culler.put = (kind, id, object) => {
    if (object && kind === 'batches') isWall(object);
    if (object && kind === 'details') glaze(object, walls);
    put(kind, id, object);
  };
}
