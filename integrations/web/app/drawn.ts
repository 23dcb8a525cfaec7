// What is drawn of a model, on the thread that draws.
import {
  BufferAttribute, BufferGeometry, DoubleSide, Group, Mesh, MeshBasicMaterial, MeshLambertMaterial, RepeatWrapping, ShapeGeometry, SRGBColorSpace,
  Texture, type Material,
} from 'three';
import type { Look, Piece, Pieces } from './model-reader.js';

/** Returns what triangles of a look are drawn with. Normals are those of the triangles. */
function materialOf({ alpha }: Look, map: Texture | null = null): MeshLambertMaterial {
  const material = new MeshLambertMaterial({ vertexColors: true, flatShading: true, side: DoubleSide, map });
  if (alpha === 'MASK') material.alphaTest = 0.5;
  if (alpha === 'BLEND') Object.assign(material, { transparent: true, depthWrite: false });
  return material;
}

function meshOf({ positions, colors, uvs, indices }: Omit<Piece, 'look'>, material: Material): Mesh {
  const geometry = new BufferGeometry();
  geometry.setAttribute('position', new BufferAttribute(positions, 3));
  geometry.setAttribute('color', new BufferAttribute(colors, 4, true));
  if (uvs) geometry.setAttribute('uv', new BufferAttribute(uvs, 2));
  geometry.setIndex(new BufferAttribute(indices, 1));
  return new Mesh(geometry, material);
}

/** Returns one triangle of each usual look, to make the shaders with. */
export function samples(): Group {
  const group = new Group();
  const piece = { positions: new Float32Array(9), colors: new Uint8Array(12), indices: new Uint16Array(3) };
  for (const alpha of ['OPAQUE', 'BLEND'] as const) group.add(meshOf(piece, materialOf({ image: -1, alpha })));
  const textured = { ...piece, uvs: new Float32Array(6) };
  for (const alpha of ['OPAQUE', 'MASK'] as const) group.add(meshOf(textured, materialOf({ image: 0, alpha }, new Texture())));
  group.add(new Mesh(new ShapeGeometry(), floorMaterial('#ffffff')));
  return group;
}

/** Returns what draws the floor of a room. */
export const floorMaterial = (color: string): MeshBasicMaterial =>
  new MeshBasicMaterial({ color, side: DoubleSide, polygonOffset: true, polygonOffsetFactor: -2, polygonOffsetUnits: -2 });

/** Makes the meshes of a model; `paint` gets the picture of an image once it is there. */
export function meshesOf({ pieces }: Pieces): { group: Group; paint: (image: number, picture: ImageBitmap) => void } {
  const group = new Group();
  const textured = new Map<number, MeshLambertMaterial[]>();
  for (const piece of pieces) {
    const material = materialOf(piece.look);
    const { image } = piece.look;
    if (image >= 0) textured.set(image, [...(textured.get(image) ?? []), material]);
    group.add(meshOf(piece, material));
  }
  const paint = (image: number, picture: ImageBitmap): void => {
    const map = new Texture(picture);
    Object.assign(map, { wrapS: RepeatWrapping, wrapT: RepeatWrapping, flipY: false, colorSpace: SRGBColorSpace, needsUpdate: true });
    for (const material of textured.get(image) ?? []) Object.assign(material, { map, needsUpdate: true });
  };
  return { group, paint };
}

/** Gives back the memory of meshes. */
export function dispose(group: Group): void {
  for (const { geometry, material } of group.children as Mesh<BufferGeometry, MeshBasicMaterial>[]) {
    geometry.dispose();
    material.map?.dispose();
    material.dispose();
  }
}
