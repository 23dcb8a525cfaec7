// A small building, two rooms with a doorway between them, as files of each format that the bake reads.

/** A box by two corners, in meters with +Y up. */
const BOXES = [
  [[0, -0.2, 0], [8.4, 0, 4.4]],
  [[0, 2.6, 0], [8.4, 2.8, 4.4]],
  [[0, 0, 0], [0.2, 2.6, 4.4]],
  [[8.2, 0, 0], [8.4, 2.6, 4.4]],
  [[0.2, 0, 0], [8.2, 2.6, 0.2]],
  [[0.2, 0, 4.2], [8.2, 2.6, 4.4]],
  // The wall between, around a doorway.
  [[4.1, 0, 0.2], [4.3, 2.6, 1.6]],
  [[4.1, 0, 2.5], [4.3, 2.6, 4.2]],
  [[4.1, 2.1, 1.6], [4.3, 2.6, 2.5]],
];

/** Corners of a box's faces, counter-clockwise from outside. */
const FACES = [
  [0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5],
];

const corners = ([low, high]) =>
  Array.from({ length: 8 }, (_, k) => [0, 1, 2].map((axis) => ((k >> axis) & 1 ? high : low)[axis]));

const triangles = BOXES.flatMap((box) => {
  const points = corners(box);
  return FACES.flatMap(([a, b, c, d]) => [[a, b, c], [a, c, d]].map((face) => face.map((k) => points[k])));
});

const utf8 = (text) => new TextEncoder().encode(text);

function obj() {
  const lines = ['mtllib rooms.mtl', 'usemtl plaster', 'o Walls'];
  for (const triangle of triangles) for (const point of triangle) lines.push(`v ${point.join(' ')}`);
  triangles.forEach((_, i) => lines.push(`f ${3 * i + 1} ${3 * i + 2} ${3 * i + 3}`));
  return [
    { name: 'rooms.obj', bytes: utf8(`${lines.join('\n')}\n`) },
    { name: 'rooms.mtl', bytes: utf8('newmtl plaster\nKd 0.9 0.8 0.7\n') },
  ];
}

function ply() {
  const head = ['ply', 'format ascii 1.0', `element vertex ${3 * triangles.length}`, 'property float x', 'property float y', 'property float z'];
  head.push(`element face ${triangles.length}`, 'property list uchar int vertex_indices', 'end_header');
  const points = triangles.flat().map((point) => point.join(' '));
  const faces = triangles.map((_, i) => `3 ${3 * i} ${3 * i + 1} ${3 * i + 2}`);
  return [{ name: 'rooms.ply', bytes: utf8(`${[...head, ...points, ...faces].join('\n')}\n`) }];
}

function stl() {
  const bytes = new Uint8Array(84 + 50 * triangles.length);
  const view = new DataView(bytes.buffer);
  view.setUint32(80, triangles.length, true);
  triangles.forEach((triangle, i) =>
    triangle.flat().forEach((value, k) => view.setFloat32(84 + 50 * i + 12 + 4 * k, value, true)),
  );
  return [{ name: 'rooms.stl', bytes }];
}

function gltf() {
  const positions = new Float32Array(triangles.flat(2));
  const [min, max] = [Math.min, Math.max].map((of) => [0, 1, 2].map((k) => of(...triangles.flat().map((p) => Math.fround(p[k])))));
  const json = {
    asset: { version: '2.0' },
    scenes: [{ nodes: [0] }],
    nodes: [{ mesh: 0, name: 'walls' }],
    meshes: [{ primitives: [{ attributes: { POSITION: 0 } }] }],
    accessors: [{ bufferView: 0, componentType: 5126, count: positions.length / 3, type: 'VEC3', min, max }],
    bufferViews: [{ buffer: 0, byteLength: positions.byteLength }],
    buffers: [{ byteLength: positions.byteLength, uri: 'my%20rooms.bin' }],
  };
  return [
    { name: 'rooms.gltf', bytes: utf8(JSON.stringify(json)) },
    { name: 'my rooms.bin', bytes: new Uint8Array(positions.buffer) },
  ];
}

/** As brushes, with +Z up and 32 units to the meter. */
function map() {
  const point = ([x, y, z]) => `( ${[x, -z, y].map((v) => Math.round(v * 320) / 10).join(' ')} )`;
  const brush = (box) => {
    const points = corners(box);
    const planes = FACES.map(([a, b, c]) => `${[points[a], points[c], points[b]].map(point).join(' ')} wall 0 0 0 1 1`);
    return `{\n${planes.join('\n')}\n}`;
  };
  const start = '{\n"classname" "info_player_start"\n"origin" "64 -64 32"\n}';
  return [{ name: 'rooms.map', bytes: utf8(`{\n"classname" "worldspawn"\n${BOXES.map(brush).join('\n')}\n}\n${start}\n`) }];
}

/** The building in each format: the files of each. */
export const formats = { gltf: gltf(), obj: obj(), ply: ply(), stl: stl(), map: map() };

/** The building as an STL with each point moved. */
function moved(move) {
  const [{ name, bytes }] = stl();
  const own = bytes.slice();
  const view = new DataView(own.buffer);
  for (let k = 0; k < 3 * triangles.length; k++) {
    const at = 84 + 50 * Math.floor(k / 3) + 12 + 12 * (k % 3);
    const point = [0, 4, 8].map((axis) => view.getFloat32(at + axis, true));
    move(point).forEach((value, axis) => view.setFloat32(at + 4 * axis, value, true));
  }
  return [{ name, bytes: own }];
}

/** The building in another unit: its numbers are `factor` times meters. */
export const scaled = (factor) => moved((point) => point.map((value) => factor * value));

/** The building turned by an angle. [Units: degrees] */
export function turned(degrees) {
  const [sin, cos] = [Math.sin, Math.cos].map((of) => of((degrees * Math.PI) / 180));
  return moved(([x, y, z]) => [cos * x - sin * z, y, sin * x + cos * z]);
}
