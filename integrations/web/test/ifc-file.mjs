// IFC files of the buildings in the shared scenes, written anew: their models are GLB whose nodes are named by class and id,
// their truths have the rooms.

/** Takes a GLB apart into meshes: name, positions and corners. */
function* meshesOf(glb) {
  const n = glb.readUInt32LE(12);
  const json = JSON.parse(glb.subarray(20, 20 + n).toString());
  const bin = glb.subarray(28 + n);
  const numbers = (index, Kind) => {
    const { bufferView, byteOffset = 0, count, type, componentType } = json.accessors[index];
    const view = json.bufferViews[bufferView];
    const at = (view.byteOffset ?? 0) + byteOffset;
    const kind = Kind ?? { 5121: Uint8Array, 5123: Uint16Array, 5125: Uint32Array }[componentType];
    const size = count * { SCALAR: 1, VEC3: 3 }[type];
    return new kind(bin.buffer.slice(bin.byteOffset + at, bin.byteOffset + at + size * kind.BYTES_PER_ELEMENT));
  };
  for (const { name, mesh } of json.nodes) {
    for (const { attributes, indices } of json.meshes[mesh].primitives) {
      yield { name, positions: [...numbers(attributes.POSITION, Float32Array)], corners: [...numbers(indices)] };
    }
  }
}

const real = (x) => (Number.isInteger(x) ? `${x}.` : x.toFixed(6));
const text = (said) => `'${String(said ?? '').replaceAll("'", "''")}'`;

/** Writes IFC4; `glbs` are files with nodes called `IfcWall/ID`, `rooms` and `storeys` are those of a truth file. */
export function ifcOf(glbs, { rooms, storeys }) {
  const lines = [];
  const add = (entity) => `#${lines.push(entity)}`;
  const list = (items) => `(${items.join(',')})`;
  const at = (x, y, z) => add(`IFCCARTESIANPOINT((${real(x)},${real(y)},${real(z)}))`);
  const axes = add(`IFCAXIS2PLACEMENT3D(${at(0, 0, 0)},$,$)`);
  const place = (above) => add(`IFCLOCALPLACEMENT(${above},${axes})`);
  const context = add(`IFCGEOMETRICREPRESENTATIONCONTEXT($,'Model',3,1.E-5,${axes},$)`);
  const unit = add('IFCSIUNIT(*,.LENGTHUNIT.,$,.METRE.)');
  const units = add(`IFCUNITASSIGNMENT((${unit}))`);
  const project = add(`IFCPROJECT('0000000000000000000001',$,'P',$,$,$,$,(${context}),${units})`);
  const ground = place('$');
  const building = add(`IFCBUILDING('0000000000000000000002',$,'B',$,$,${ground},$,$,.ELEMENT.,$,$,$)`);
  add(`IFCRELAGGREGATES('0000000000000000000003',$,$,$,${project},(${building}))`);
  const body = (positions, corners) => {
    const points = [];
    // Up is z here, and y there.
    for (let i = 0; i < positions.length; i += 3) points.push(list([positions[i], -positions[i + 2], positions[i + 1]].map(real)));
    const triangles = [];
    for (let i = 0; i < corners.length; i += 3) triangles.push(list([corners[i] + 1, corners[i + 1] + 1, corners[i + 2] + 1]));
    const set = add(`IFCTRIANGULATEDFACESET(${add(`IFCCARTESIANPOINTLIST3D(${list(points)})`)},$,$,${list(triangles)},$)`);
    return add(`IFCPRODUCTDEFINITIONSHAPE($,$,(${add(`IFCSHAPEREPRESENTATION(${context},'Body','Tessellation',(${set}))`)}))`);
  };
  const floors = storeys.map(({ name, elevation }, i) => {
    const id = `00000000000000000001${String(i).padStart(2, '0')}`;
    return { elevation, name, inside: [], rooms: [], line: add(`IFCBUILDINGSTOREY('${id}',$,${text(name)},$,$,${ground},$,$,.ELEMENT.,${real(elevation)})`) };
  });
  add(`IFCRELAGGREGATES('0000000000000000000004',$,$,$,${building},${list(floors.map(({ line }) => line))})`);
  for (const glb of glbs) {
    for (const { name, positions, corners } of meshesOf(glb)) {
      const [kind, id] = name.split('/');
      const low = positions.filter((_, i) => i % 3 === 1).reduce((a, b) => Math.min(a, b), Infinity);
      const floor = floors.findLast(({ elevation }) => elevation <= low + 0.5) ?? floors[0];
      const shape = body(positions, corners);
      const rest = { IfcDoor: ',$,$,.DOOR.,$,$', IfcWindow: ',$,$,.WINDOW.,$,$', IfcFurnishingElement: '' }[kind] ?? ',$';
      floor.inside.push(add(`${kind.toUpperCase()}('${id}',$,${text(kind)},$,$,${place(ground)},${shape},$${rest})`));
    }
  }
  for (const { id, name, long_name: long, storey, mesh } of rooms) {
    if (!mesh) continue;
    const shape = body(mesh.vertices.flat(), mesh.triangles.flat());
    const floor = floors.find((other) => other.name === storey) ?? floors[0];
    floor.rooms.push(add(`IFCSPACE('${id}',$,${text(name)},$,$,${place(ground)},${shape},${text(long)},.ELEMENT.,.INTERNAL.,$)`));
  }
  floors.forEach(({ inside, rooms: own, line }, i) => {
    const id = (kind) => `00000000000000000${kind}0${String(i).padStart(3, '0')}`;
    if (inside.length > 0) add(`IFCRELCONTAINEDINSPATIALSTRUCTURE('${id(2)}',$,$,$,${list(inside)},${line})`);
    if (own.length > 0) add(`IFCRELAGGREGATES('${id(3)}',$,$,$,${line},${list(own)})`);
  });
  const head = "ISO-10303-21;\nHEADER;\nFILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\nFILE_SCHEMA(('IFC4'));\nENDSEC;\nDATA;";
  return `${head}\n${lines.map((line, i) => `#${i + 1}=${line};`).join('\n')}\nENDSEC;\nEND-ISO-10303-21;\n`;
}
