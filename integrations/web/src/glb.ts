/** Containers of glTF: taken apart, and put together without what visibility does not need. */

/** A world file taken apart. */
export interface Glb {
  json: GltfJson;
  /** The JSON as it was. */
  text: string;
  /** The binary chunk. */
  bin: Uint8Array;
}

/** What this package reads of a glTF file. */
export interface GltfJson {
  bufferViews?: { buffer: number; byteOffset?: number; byteLength: number; byteStride?: number; target?: number }[];
  buffers?: { byteLength: number }[];
  images?: { bufferView?: number; mimeType?: string; name?: string }[];
  extensions?: Record<string, unknown>;
  [key: string]: unknown;
}

/** The extension of a world file, as far as engines need it; docs/format.md describes all of it. */
export interface WorldExtension {
  version: number;
  cells: { name: string; node: number }[];
  batches: { mesh?: number; primitive?: number; cells: number[]; seal?: boolean }[];
  details: { node: number; mesh: number; cells: number[] }[];
  detailMeshes: (number | null)[];
}

/** Name of the extension. */
export const EXTENSION = 'ENFILADE_cell_portal_graph';

/** Returns the extension of a file; throws if it is a scene that was not baked. */
export function extensionOf(json: GltfJson): WorldExtension {
  const found = json.extensions?.[EXTENSION] as WorldExtension | undefined;
  if (!found) throw new Error(`this file has no rooms and doorways (${EXTENSION}): run \`enfilade bake\` first`);
  return found;
}

const JSON_CHUNK = 0x4e4f534a;
const BIN_CHUNK = 0x004e4942;
const MAGIC = 0x46546c67;

/** Takes a GLB apart; the binary chunk is not copied. */
export function takeApart(bytes: Uint8Array): Glb {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < 20 || view.getUint32(0, true) !== MAGIC) throw new Error('this is not a GLB file');
  const n = view.getUint32(12, true);
  if (view.getUint32(16, true) !== JSON_CHUNK || 20 + n > bytes.length) throw new Error('the GLB file is damaged');
  const text = new TextDecoder().decode(bytes.subarray(20, 20 + n));
  const json = JSON.parse(text) as GltfJson;
  const at = 20 + n;
  if (at + 8 > bytes.length) return { json, text, bin: new Uint8Array() };
  const size = view.getUint32(at, true);
  if (view.getUint32(at + 4, true) !== BIN_CHUNK || at + 8 + size > bytes.length) {
    throw new Error('the GLB file is damaged');
  }
  return { json, text, bin: bytes.subarray(at + 8, at + 8 + size) };
}

/** Finds the values of some keys of the outermost object of a JSON text, as ranges of the text. */
function valuesOf(text: string, keys: string[]): Map<string, [begin: number, end: number]> {
  const found = new Map<string, [number, number]>();
  let [depth, key, begin] = [0, '', -1];
  const end = (at: number): void => {
    if (begin >= 0 && keys.includes(key)) found.set(key, [begin, at]);
    begin = -1;
  };
  for (let i = 0; i < text.length; i++) {
    const c = text[i]!;
    if (c === '"') {
      const first = i;
      for (i++; text[i] !== '"' && i < text.length; i++) if (text[i] === '\\') i++;
      if (depth === 1 && begin < 0) key = JSON.parse(text.slice(first, i + 1)) as string;
    } else if (c === '{' || c === '[') depth++;
    else if (c === '}' || c === ']') {
      depth--;
      if (depth === 0) end(i);
    } else if (depth === 1 && c === ':') begin = i + 1;
    else if (depth === 1 && c === ',') end(i);
  }
  return found;
}

/**
 * Puts a GLB together without its pictures, which visibility does not need. All other text stays as it is: a JSON value
 * that is read and written again loses the sign of -0, and with it the order of answers.
 */
export function withoutPictures(text: string, bin: Uint8Array): Uint8Array {
  const json = JSON.parse(text) as GltfJson;
  const pictures = new Set((json.images ?? []).map((image) => image.bufferView));
  let size = 0;
  const kept: { from: number; to: number; n: number }[] = [];
  const bufferViews = (json.bufferViews ?? []).map((view, i) => {
    const n = pictures.has(i) ? 0 : view.byteLength;
    const to = size;
    if (n > 0) kept.push({ from: view.byteOffset ?? 0, to, n });
    size += (n + 7) & ~7;
    return { ...view, byteOffset: to, byteLength: n };
  });
  const values: Record<string, unknown> = { bufferViews, buffers: [{ byteLength: size }] };
  const places = [...valuesOf(text, Object.keys(values))].sort((a, b) => b[1][0] - a[1][0]);
  let changed = text;
  for (const [key, [begin, end]] of places) {
    changed = changed.slice(0, begin) + JSON.stringify(values[key]) + changed.slice(end);
  }
  return glbOf(changed, size, (data) => {
    for (const { from, to, n } of kept) data.set(bin.subarray(from, from + n), to);
  });
}

/** Makes a GLB of a JSON text and a binary chunk of `size` bytes. */
function glbOf(text: string, size: number, fill: (data: Uint8Array) => void): Uint8Array {
  const bytes = new TextEncoder().encode(text);
  const padded = (bytes.length + 3) & ~3;
  const out = new Uint8Array(28 + padded + size);
  const head = new DataView(out.buffer);
  [MAGIC, 2, out.length, padded, JSON_CHUNK].forEach((word, i) => head.setUint32(4 * i, word, true));
  out.fill(0x20, 20, 20 + padded);
  out.set(bytes, 20);
  head.setUint32(20 + padded, size, true);
  head.setUint32(24 + padded, BIN_CHUNK, true);
  fill(out.subarray(28 + padded));
  return out;
}
