/** Packed worlds: the head, and pieces by ranges over HTTP. docs/packed.md describes the format. */
import { decompress } from 'fzstd';
import { takeApart, type GltfJson } from './glb.js';

/** Place of a piece: offset, packed size and unpacked size, in bytes. */
export type PiecePlace = readonly [offset: number, packed: number, unpacked: number];

/** The head of a packed world. */
export interface Head {
  pieces: PiecePlace[];
  /** For each cell, the pieces that it needs. */
  cells: number[][];
  /** A world file whose batches, meshes and pictures are empty, but for leaves of doors. */
  hollow: Uint8Array;
  /** What visibility needs of the triangles. */
  skeleton: Uint8Array;
  /** Size of the head as it came, in bytes. */
  bytes: number;
}

/** The head of a piece: what its bytes are. */
export interface PieceJson {
  ranges: [number, number][];
  batches?: number[];
  mesh?: number;
  image?: number;
  primitives?: { attributes: Record<string, number>; indices?: number; material?: number }[];
  accessors?: {
    bufferView: number;
    byteOffset?: number;
    componentType: number;
    count: number;
    type: string;
    normalized?: boolean;
  }[];
  bufferViews?: { byteOffset?: number; byteLength: number; byteStride?: number }[];
}

/** An unpacked piece. */
export interface Piece {
  json: PieceJson;
  data: Uint8Array;
}

const MAGIC = 'enfpack\0';
const HEAD = 44;

/** Decodes the head of a packed world. */
export function decodeHead(bytes: Uint8Array): Head {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  const n = headSize(bytes);
  const sections: Uint8Array[] = [];
  const unpacked = decompress(bytes.subarray(HEAD, n), new Uint8Array(Number(view.getBigUint64(20, true))));
  const inner = new DataView(unpacked.buffer, unpacked.byteOffset, unpacked.byteLength);
  for (let at = 0; at + 8 <= unpacked.length; ) {
    const size = Number(inner.getBigUint64(at, true));
    if (at + 8 + size > unpacked.length) throw new Error('the head of the packed world is damaged');
    sections.push(unpacked.subarray(at + 8, at + 8 + size));
    at += 8 + size;
  }
  const [list, hollow, skeleton] = sections;
  if (!list || !hollow || !skeleton) throw new Error('the head of the packed world is damaged');
  const { pieces, cells } = JSON.parse(new TextDecoder().decode(list)) as { pieces: PiecePlace[]; cells: number[][] };
  return { pieces, cells, hollow, skeleton, bytes: n };
}

/** Returns the size of a head with its first bytes; throws if they are not those of a packed world. */
export function headSize(bytes: Uint8Array): number {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.length < HEAD || new TextDecoder().decode(bytes.subarray(0, 8)) !== MAGIC) {
    throw new Error('this is not a packed world: make one with `enfilade pack`');
  }
  const version = view.getUint32(8, true);
  if (version !== 1 && version !== 2) throw new Error(`this packed world has version ${version}, this package reads 1 and 2`);
  return HEAD + Number(view.getBigUint64(12, true));
}

/** Decodes a piece as it came. */
export function decodePiece(packed: Uint8Array, unpackedSize: number): Piece {
  const bytes = decompress(packed, new Uint8Array(unpackedSize));
  const n = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength).getUint32(0, true);
  const json = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + n))) as PieceJson;
  return { json, data: bytes.subarray(4 + n) };
}

/** A packed world at an address: a folder with `head.enfp` and `pieces.enfp`, or one file. */
export class PackedPlace {
  /** All bytes that came, of head and pieces. */
  received = 0;
  readonly head: Head;
  readonly json: GltfJson;
  /** The body, where a server gives no ranges. */
  private whole: Uint8Array | undefined;
  /** The first request of a piece, until it is known whether the server gives ranges. */
  private probe: Promise<unknown> | undefined;

  private constructor(
    head: Head,
    private readonly address: string,
    private readonly begin: number,
    private givesRanges: boolean,
  ) {
    this.head = head;
    this.received = head.bytes;
    this.json = takeApart(head.hollow).json;
  }

  /** Reads the head. What follows a `?` in the address is kept for all requests. */
  static async open(address: string | URL): Promise<PackedPlace> {
    const base = typeof location === 'undefined' ? undefined : location.href;
    const url = new URL(address, base);
    const file = (name: string): string => {
      const inner = new URL(url);
      inner.pathname = `${url.pathname.replace(/\/$/, '')}/${name}`;
      return String(inner);
    };
    const answer = await fetch(file('head.enfp'));
    if (answer.ok) {
      const head = decodeHead(new Uint8Array(await answer.arrayBuffer()));
      return new PackedPlace(head, file('pieces.enfp'), 0, answer.headers.get('Accept-Ranges') === 'bytes');
    }
    const first = await ranged(String(url), 0, 1 << 16);
    const n = headSize(first.bytes);
    const bytes = first.bytes.length >= n ? first.bytes : (await ranged(String(url), 0, n)).bytes;
    const place = new PackedPlace(decodeHead(bytes.subarray(0, n)), String(url), n, !first.isWhole);
    if (first.isWhole) place.whole = first.bytes;
    place.received = first.bytes.length;
    return place;
  }

  /** Fetches pieces in one request, with what lies between them; returns the bytes of each. */
  async fetch(wanted: readonly number[], signal?: AbortSignal): Promise<Uint8Array[]> {
    const places = wanted.map((piece) => this.head.pieces[piece]!);
    const from = Math.min(...places.map(([offset]) => offset));
    const to = Math.max(...places.map(([offset, packed]) => offset + packed));
    const bytes = await this.bytes(this.begin + from, to - from, signal);
    return places.map(([offset, packed]) => bytes.subarray(offset - from, offset - from + packed));
  }

  private async bytes(from: number, n: number, signal?: AbortSignal): Promise<Uint8Array> {
    // Each request to a server without ranges would bring the whole file: the first answer tells.
    while (!this.whole && !this.givesRanges && this.probe) await this.probe.catch(() => undefined);
    if (this.whole) return this.whole.subarray(from, from + n);
    const request = ranged(this.address, from, n, signal);
    if (!this.givesRanges) this.probe = request;
    try {
      const { bytes, isWhole } = await request;
      this.received += bytes.length;
      this.givesRanges ||= !isWhole;
      if (!isWhole) return bytes;
      this.whole = bytes;
      return bytes.subarray(from, from + n);
    } finally {
      if (this.probe === request) this.probe = undefined;
    }
  }
}

/** Fetches a range; `isWhole` if the server gave the whole file instead. */
async function ranged(
  address: string,
  from: number,
  n: number,
  signal?: AbortSignal,
): Promise<{ bytes: Uint8Array; isWhole: boolean }> {
  const headers = { Range: `bytes=${from}-${from + n - 1}` };
  const answer = await fetch(address, signal ? { headers, signal } : { headers });
  if (!answer.ok) throw new Error(`${address}: ${answer.status} ${answer.statusText}`);
  const bytes = new Uint8Array(await answer.arrayBuffer());
  return { bytes, isWhole: answer.status === 200 };
}
