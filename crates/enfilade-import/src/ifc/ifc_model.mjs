// The products of an IFC file as GLB, by means of web-ifc: in node (read_ifc.mjs) and in web pages (integrations/web), so
// nothing here is of node alone.
//
// docs/import.md ("IFC") describes the result; read_ifc.py makes the same by means of ifcopenshell.

// Nothing that one could touch, or parts of other products' bodies.
const BODILESS =
  /^Ifc(Opening|Projection|Voiding|SurfaceFeature|Virtual|SpatialZone|Annotation|Grid|Structural|(.*)Port$)/;
// Groups of products that are called by their name.
const SPATIAL = /^Ifc(Site|Building|BuildingStorey|Facility|FacilityPart.*|Bridge.*|Road.*|Railway.*|MarineFacility)$/;
// Properties that tell how a thing parts rooms.
const KEPT = /external|fire|acoust|sound|absor|glaz|glass|transmi|transpar|loadbearing/i;
const BODIES = ['Body', 'Facetation', 'Tessellation', 'Body-FallBack'];

function linear(c) {
  c = Math.min(Math.max(c, 0), 1);
  return Number((c <= 0.04045 ? c / 12.92 : ((c + 0.055) / 1.055) ** 2.4).toFixed(6));
}

function listOf(value) {
  return value === null || value === undefined ? [] : Array.isArray(value) ? value : [value];
}

/** Returns text, truth values and numbers that JSON can hold. */
function plain(attribute) {
  const value = attribute?.value ?? attribute;
  // IfcBoolean and IfcLogical may be written as letters.
  if (attribute?.type === 3 && (value === 'T' || value === 'F')) return value === 'T';
  const isNumber = typeof value === 'number' && Number.isFinite(value);
  return isNumber || typeof value === 'boolean' || (typeof value === 'string' && value !== '') ? value : undefined;
}

/** Returns the same with its keys in order: equal files give equal text by either script. */
function sorted(value) {
  if (value === null || typeof value !== 'object') return value;
  const keys = Object.keys(value).sort();
  return Object.fromEntries(keys.map((key) => [key, sorted(value[key])]));
}

// Matrices are column-major, as in glTF.
function product(a, b) {
  const out = new Array(16).fill(0);
  for (let c = 0; c < 4; c++)
    for (let r = 0; r < 4; r++) for (let k = 0; k < 4; k++) out[4 * c + r] += a[4 * k + r] * b[4 * c + k];
  return out;
}

/** Returns the inverse of an affine matrix; undefined if it flattens. */
function inverse(m) {
  const [a, b, c, d, e, f, g, h, i] = [m[0], m[4], m[8], m[1], m[5], m[9], m[2], m[6], m[10]];
  const det = a * (e * i - f * h) - b * (d * i - f * g) + c * (d * h - e * g);
  if (!Number.isFinite(1 / det)) return undefined;
  const rows = [
    [e * i - f * h, c * h - b * i, b * f - c * e],
    [f * g - d * i, a * i - c * g, c * d - a * f],
    [d * h - e * g, b * g - a * h, a * e - b * d],
  ].map((row) => row.map((x) => x / det));
  const out = [0, 1, 2].flatMap((k) => [rows[0][k], rows[1][k], rows[2][k], 0]);
  return [...out, ...rows.map((row) => -(row[0] * m[12] + row[1] * m[13] + row[2] * m[14])), 1];
}

const IDENTITY = [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1];

class Glb {
  constructor() {
    this.parts = [];
    this.length = 0;
    this.json = { asset: { version: '2.0', generator: 'enfilade, web-ifc' } };
    for (const key of ['nodes', 'meshes', 'materials', 'accessors', 'bufferViews']) this.json[key] = [];
    this.root = this.add('nodes', {});
    this.materialOf = new Map();
  }

  add(key, item) {
    return this.json[key].push(item) - 1;
  }

  addNode(parent, node) {
    const i = this.add('nodes', node);
    (this.json.nodes[parent].children ??= []).push(i);
    return i;
  }

  addMaterial(name, rgb, alpha) {
    const color = [...rgb.map(linear), Number(Math.min(Math.max(alpha, 0), 1).toFixed(6))];
    const key = JSON.stringify([name, color]);
    if (!this.materialOf.has(key)) {
      const look = { baseColorFactor: color, metallicFactor: 0, roughnessFactor: 0.9 };
      const material = { name, pbrMetallicRoughness: look, doubleSided: true };
      if (color[3] < 1) material.alphaMode = 'BLEND';
      this.materialOf.set(key, this.add('materials', material));
    }
    return this.materialOf.get(key);
  }

  addAccessor(numbers, target, accessor) {
    // Typed arrays have the order of bytes of the machine; all that this runs well on are little-endian.
    const raw = new Uint8Array(numbers.buffer, numbers.byteOffset, numbers.byteLength);
    const view = { buffer: 0, byteOffset: this.length, byteLength: raw.length, target };
    this.parts.push(raw);
    this.length += raw.length;
    return this.add('accessors', { ...accessor, bufferView: this.add('bufferViews', view) });
  }

  addPositions(values) {
    const [min, max] = [new Array(3).fill(Infinity), new Array(3).fill(-Infinity)];
    values.forEach((v, i) => {
      min[i % 3] = Math.min(min[i % 3], v);
      max[i % 3] = Math.max(max[i % 3], v);
    });
    return this.addAccessor(values, 34962, { min, max, componentType: 5126, count: values.length / 3, type: 'VEC3' });
  }

  addIndices(values) {
    return this.addAccessor(values, 34963, { componentType: 5125, count: values.length, type: 'SCALAR' });
  }

  /** Returns the file in parts. */
  chunks() {
    this.json.scene = 0;
    this.json.scenes = [{ nodes: [this.root] }];
    this.json.buffers = this.length > 0 ? [{ byteLength: this.length }] : [];
    for (const [key, value] of Object.entries(this.json)) if (value?.length === 0) delete this.json[key];
    const bare = new TextEncoder().encode(JSON.stringify(this.json));
    const text = new Uint8Array((bare.length + 3) & ~3).fill(0x20);
    text.set(bare);
    const words = (...numbers) => new Uint8Array(Uint32Array.from(numbers).buffer);
    const chunks = [words(text.length, 0x4e4f534a), text];
    if (this.length > 0) chunks.push(words(this.length, 0x004e4942), ...this.parts);
    const n = chunks.reduce((sum, c) => sum + c.length, 12);
    return [words(0x46546c67, 2, n), ...chunks];
  }
}

class Reader {
  /** `tell` hears of what is left out. */
  constructor(webIfc, api, model, tell) {
    [this.webIfc, this.api, this.model, this.tell] = [webIfc, api, model, tell];
    this.glb = new Glb();
    this.lines = new Map();
    [this.groups, this.meshes, this.parentOf] = [new Map(), new Map(), new Map()];
    [this.setsOf, this.typeOf, this.substanceOf] = [new Map(), new Map(), new Map()];
    [this.styles, this.styleOf] = [new Map(), new Map()];
    this.relate('IFCRELAGGREGATES', 'RelatedObjects', 'RelatingObject', this.parentOf);
    this.relate('IFCRELCONTAINEDINSPATIALSTRUCTURE', 'RelatedElements', 'RelatingStructure', this.parentOf);
    this.relate('IFCRELDEFINESBYTYPE', 'RelatedObjects', 'RelatingType', this.typeOf);
    this.relate('IFCRELASSOCIATESMATERIAL', 'RelatedObjects', 'RelatingMaterial', this.substanceOf);
    for (const line of this.all('IFCRELDEFINESBYPROPERTIES'))
      for (const child of listOf(line.RelatedObjects))
        for (const set of listOf(line.RelatingPropertyDefinition)) this.append(this.setsOf, child.value, set.value);
    this.readStyles();
  }

  append(map, key, value) {
    map.set(key, [...(map.get(key) ?? []), value]);
  }

  line(id) {
    try {
      return id === undefined ? undefined : this.api.GetLine(this.model, id);
    } catch {
      // A damaged line is no reason to lose the building.
      return undefined;
    }
  }

  *all(kind) {
    if (this.webIfc[kind] === undefined) return;
    const ids = this.api.GetLineIDsWithType(this.model, this.webIfc[kind], true);
    for (let i = 0; i < ids.size(); i++) {
      const line = this.line(ids.get(i));
      if (line) yield line;
    }
  }

  relate(kind, children, parent, map) {
    for (const line of this.all(kind))
      for (const child of listOf(line[children])) map.set(child.value, line[parent]?.value);
  }

  classOf(id) {
    return this.api.GetNameFromTypeCode(this.api.GetLineType(this.model, id));
  }

  colorKey(r, g, b, alpha) {
    return [r, g, b, alpha].map((x) => x.toFixed(4)).join();
  }

  /** Lists the surface styles by color, and by the item that has them. */
  readStyles() {
    for (const style of this.all('IFCSURFACESTYLE')) {
      const name = plain(style.Name);
      for (const look of listOf(style.Styles).map((s) => this.line(s.value))) {
        const color = this.line(look?.SurfaceColour?.value);
        if (!color || !name) continue;
        const [r, g, b] = [color.Red, color.Green, color.Blue].map((c) => plain(c) ?? 0);
        this.append(this.styles, this.colorKey(r, g, b, 1 - (plain(look.Transparency) ?? 0)), [style.expressID, name]);
      }
    }
    for (const item of this.all('IFCSTYLEDITEM')) {
      const styles = listOf(item.Styles).map((s) => s.value);
      for (const id of styles) {
        const inner = this.line(id);
        const nested = listOf(inner?.Styles).map((s) => s?.value);
        if (item.Item) this.append(this.styleOf, item.Item.value, [id, ...nested]);
      }
    }
  }

  material(placed, id) {
    const { x, y, z, w } = placed.color;
    const known = this.styles.get(this.colorKey(x, y, z, w)) ?? [];
    const own = (this.styleOf.get(placed.geometryExpressID) ?? []).flat();
    const style = known.find((s) => own.includes(s[0])) ?? known[0];
    if (style) return this.glb.addMaterial(style[1], [x, y, z], w);
    // White is web-ifc's color for what has none.
    const isPlain = x === 1 && y === 1 && z === 1;
    return this.glb.addMaterial(this.substance(id), isPlain ? [0.8, 0.8, 0.8] : [x, y, z], w);
  }

  /** Returns the name of a product's first material, or its class. */
  substance(id) {
    const first = (start, depth) => {
      const line = depth < 8 ? this.line(start) : undefined;
      if (!line) return undefined;
      if (this.classOf(start) === 'IfcMaterial') return plain(line.Name);
      const below = ['ForLayerSet', 'ForProfileSet', 'MaterialLayers', 'MaterialProfiles', 'MaterialConstituents', 'Materials', 'Material'];
      for (const next of below.flatMap((key) => listOf(line[key])))
        if (first(next.value, depth + 1)) return first(next.value, depth + 1);
      return undefined;
    };
    const start = this.substanceOf.get(id) ?? this.substanceOf.get(this.typeOf.get(id));
    return first(start, 0) ?? this.classOf(id);
  }

  /** Returns the extras of a product's node. */
  facts(line) {
    const facts = {};
    for (const key of ['Name', 'LongName', 'ObjectType', 'Elevation']) {
      const value = plain(line[key]);
      if (value !== undefined) facts[key] = value;
    }
    const type = this.line(this.typeOf.get(line.expressID));
    const sets = listOf(type?.HasPropertySets).map((s) => s.value);
    for (const id of [...sets, ...(this.setsOf.get(line.expressID) ?? [])]) {
      const set = this.line(id);
      const name = plain(set?.Name);
      for (const property of listOf(set?.HasProperties).map((p) => this.line(p.value))) {
        const [key, value] = [plain(property?.Name), plain(property?.NominalValue)];
        if (name && key && KEPT.test(key) && value !== undefined) (facts[name] ??= {})[key] = value;
      }
    }
    return Object.keys(facts).length > 0 ? { ifc: sorted(facts) } : {};
  }

  /** Returns the node of a storey or an assembly, made on first use. */
  group(id) {
    const line = this.line(id);
    if (!line?.GlobalId || this.classOf(id) === 'IfcProject') return this.glb.root;
    if (!this.groups.has(id)) {
      // A cycle of parents ends at the root.
      this.groups.set(id, this.glb.root);
      const above = this.group(this.parentOf.get(id));
      const own = SPATIAL.test(this.classOf(id)) ? plain(line.Name) : undefined;
      const name = own ?? `${this.classOf(id)}/${line.GlobalId.value}`;
      this.groups.set(id, this.glb.addNode(above, { name, extras: this.facts(line) }));
    }
    return this.groups.get(id);
  }

  /** Returns a mesh of all parts, placed by `inner`. */
  mesh(parts) {
    const key = JSON.stringify(parts.map((p) => [p.geometry, p.material, p.inner.map((x) => x.toPrecision(9))]));
    if (!this.meshes.has(key)) {
      const primitives = parts.map((p) => this.primitive(p)).filter((p) => p !== undefined);
      this.meshes.set(key, primitives.length > 0 ? this.glb.add('meshes', { primitives }) : undefined);
    }
    return this.meshes.get(key);
  }

  primitive({ geometry, material, inner: m }) {
    const found = this.api.GetGeometry(this.model, geometry);
    const values = this.api.GetVertexArray(found.GetVertexData(), found.GetVertexDataSize());
    const indices = this.api.GetIndexArray(found.GetIndexData(), found.GetIndexDataSize()).slice();
    const n = values.length / 6;
    const positions = new Float32Array(3 * n);
    for (let i = 0; i < n; i++) {
      const [x, y, z] = values.subarray(6 * i, 6 * i + 3);
      for (let r = 0; r < 3; r++) positions[3 * i + r] = m[r] * x + m[4 + r] * y + m[8 + r] * z + m[12 + r];
    }
    found.delete();
    if (indices.length === 0) return undefined;
    return { attributes: { POSITION: this.glb.addPositions(positions) }, indices: this.glb.addIndices(indices), material };
  }

  place(flat) {
    const id = flat.expressID;
    const line = this.line(id);
    if (!line?.GlobalId || BODILESS.test(this.classOf(id))) return;
    const placed = Array.from({ length: flat.geometries.size() }, (_, i) => flat.geometries.get(i));
    if (placed.length === 0) return;
    // The first part's own axes: relative to them, parts of equal products are equal, and numbers are small.
    let matrix = [...placed[0].flatTransformation];
    const back = inverse(matrix);
    if (!back) matrix = IDENTITY;
    const parts = placed.map((p) => ({
      geometry: p.geometryExpressID,
      material: this.material(p, id),
      inner: product(back ?? IDENTITY, [...p.flatTransformation]),
    }));
    parts[0].inner = back ? IDENTITY : parts[0].inner;
    const mesh = this.mesh(parts);
    if (mesh === undefined) return;
    const name = `${this.classOf(id)}/${line.GlobalId.value}`;
    this.glb.addNode(this.group(this.parentOf.get(id)), { name, mesh, matrix, extras: this.facts(line) });
    this.placed.add(id);
  }

  read() {
    this.placed = new Set();
    const place = (flat) => this.place(flat);
    this.api.StreamAllMeshes(this.model, place);
    this.api.StreamAllMeshesWithTypes(this.model, [this.webIfc.IFCSPACE], place);
    this.tellLost();
  }

  /** Names products whose body was not made. */
  tellLost() {
    const lost = [];
    for (const shape of this.all('IFCPRODUCTDEFINITIONSHAPE')) this.noteShape(shape);
    for (const { typeID } of this.api.GetAllTypesOfModel(this.model)) {
      if (!this.api.IsIfcElement(typeID)) continue;
      const ids = this.api.GetLineIDsWithType(this.model, typeID);
      for (let i = 0; i < ids.size(); i++) {
        const [id, line] = [ids.get(i), this.line(ids.get(i))];
        const isLost = this.bodies.has(line?.Representation?.value) && !this.placed.has(id);
        if (isLost && !BODILESS.test(this.classOf(id))) lost.push(`${this.classOf(id)}/${line.GlobalId?.value}`);
      }
    }
    for (const name of lost.slice(0, 8)) this.tell(`${name}: its body cannot be made; left out`);
    if (lost.length > 8) this.tell(`${lost.length - 8} more bodies cannot be made; left out`);
  }

  noteShape(shape) {
    this.bodies ??= new Set();
    const shapes = listOf(shape.Representations).map((r) => this.line(r.value));
    if (shapes.some((r) => BODIES.includes(plain(r?.RepresentationIdentifier)))) this.bodies.add(shape.expressID);
  }
}

/**
 * Returns the GLB of an IFC file, in parts; `tell` hears notes for the user. `locate` says where the package's module is, if it
 * is not beside its script. Throws if the file cannot be read.
 */
export async function glbOfIfc(webIfc, bytes, tell, locate) {
  const api = new webIfc.IfcAPI();
  await api.Init(locate, true);
  api.SetLogLevel(webIfc.LogLevel?.LOG_LEVEL_OFF ?? 6);
  const model = api.OpenModel(bytes, { COORDINATE_TO_ORIGIN: false });
  if (model < 0) throw new Error('the schema is unknown, or the file is damaged');
  const reader = new Reader(webIfc, api, model, tell);
  reader.read();
  return reader.glb.chunks();
}
