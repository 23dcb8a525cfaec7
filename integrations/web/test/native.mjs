// Native answers, as `oracle` of integrations/abi writes them.
import { readFileSync } from 'node:fs';

const NO_ID = 0xffffffff;

/** Iterates over the views of a file of answers. */
export function* nativeAnswers(path) {
  const bytes = readFileSync(path);
  const words = new Uint32Array(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength));
  const numbers = new Float32Array(words.buffer);
  let at = 0;
  const word = () => words[at++];
  const some = (n) => numbers.subarray(at, (at += n));
  const list = () => {
    const n = word();
    return words.subarray(at, (at += n));
  };
  const id = () => {
    const value = word();
    return value === NO_ID ? -1 : value;
  };
  const n = word();
  for (let view = 0; view < n; view++) {
    const door = id();
    const [share] = some(1);
    const [eye, matrix] = [some(3), some(16)];
    const [cells, portals, chunks, batches, details] = [list(), list(), list(), list(), list()];
    const cell = id();
    const end = some(3);
    const isClear = word() === 1;
    const [t] = some(1);
    const [kind, index] = [id(), id()];
    yield { view, door, share, eye, matrix, cells, portals, chunks, batches, details, cell, end, isClear, t, kind, index };
  }
}

const TARGETS = ['wall', 'detail', 'portal'];

function differs(name, native, own, count) {
  const is = native.length === count && native.every((v, i) => v === own[i]);
  return is ? undefined : `${name}: native ${[...native]}, here ${[...own.subarray(0, count)]}`;
}

/** Compares a view of `world` with the native answer; returns the first difference as text, or undefined. */
export function difference(world, native) {
  if (native.door >= 0) world.setOpenness(native.door, native.share);
  const seen = world.see(native.eye, native.matrix);
  const lists = { cells: 'cellCount', portals: 'portalCount', chunks: 'chunkCount', batches: 'batchCount', details: 'detailCount' };
  const found = Object.entries(lists).map(([name, count]) => differs(name, native[name], seen[name], seen[count]));
  const wrong = found.find((text) => text !== undefined);
  if (wrong) return wrong;
  const cell = world.locate(native.eye);
  if (cell !== native.cell || seen.eyeCell !== native.cell) return `cell ${native.cell}, here ${cell}`;
  if (world.lineOfSight(native.eye, native.end) !== native.isClear) return `line of sight: native ${native.isClear}`;
  const hit = world.pick(native.eye, native.end);
  const [t, kind, index] = hit ? [hit.t, TARGETS.indexOf(hit.target), hit.index] : [0, -1, -1];
  if (t !== native.t || kind !== native.kind || index !== native.index) {
    return `hit: native ${[native.t, native.kind, native.index]}, here ${[t, kind, index]}`;
  }
  return undefined;
}


