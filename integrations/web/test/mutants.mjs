// Damaged files: mutants of small models, the same ones in each run.
import { BakeFailure, bake } from '../dist/bake.js';
import { formats } from './rooms.mjs';

/** Numbers that break what counts on sane ones. */
const NUMBERS = ['1e39', '-1', 'nan', '0', '4294967296', '1e-40', '99999999999', '-inf', ''];

/** Returns a source of numbers below n, always the same. */
function source(seed) {
  let random = seed + 1;
  return (n) => (random = (random * 48271) % 2147483647) % Math.max(1, n);
}

/** Damages bytes: single ones, words, a cut, a part twice, a part gone, numbers in text. */
const DAMAGES = [
  (bytes, next) => {
    for (let k = next(8); k >= 0; k--) bytes[next(bytes.length)] = next(256);
    return bytes;
  },
  (bytes, next) => {
    const view = new DataView(bytes.buffer);
    for (let k = next(4); k >= 0; k--) view.setUint32(next(bytes.length - 4), [0, 0xffffffff, 0x7f800000, 0x7fc00000, 0x80000000][next(5)], true);
    return bytes;
  },
  (bytes, next) => bytes.slice(0, next(bytes.length)),
  (bytes, next) => {
    const [from, n] = [next(bytes.length), next(400)];
    return Uint8Array.from([...bytes.subarray(0, from + n), ...bytes.subarray(from)]);
  },
  (bytes, next) => {
    const from = next(bytes.length);
    return Uint8Array.from([...bytes.subarray(0, from), ...bytes.subarray(from + next(400))]);
  },
  (bytes, next) => {
    const text = new TextDecoder('latin1').decode(bytes);
    const all = [...text.matchAll(/-?\d+(\.\d+)?/g)];
    const found = all[next(all.length)];
    if (!found) return bytes;
    return new TextEncoder().encode(text.slice(0, found.index) + NUMBERS[next(NUMBERS.length)] + text.slice(found.index + found[0].length));
  },
];

/** Returns the files of mutant `i`. */
function mutant(i) {
  const next = source(i * 7919);
  const all = Object.values(formats);
  const files = structuredClone(all[i % all.length]);
  const file = files[next(files.length)];
  file.bytes = DAMAGES[next(DAMAGES.length)](file.bytes.slice(), next);
  return files;
}

/**
 * Bakes `n` mutants, from number `from` on. Returns how many became worlds, how many ended in a sentence of which kind, and
 * those that ended in another way; and of every hundredth file after them, which is sound, whether it was baked.
 */
export async function bakeMutants(n, from = 0, options = {}) {
  const out = { worlds: 0, kinds: {}, wrong: [], sound: 0, unsound: 0, slowest: 0 };
  for (let i = from; i < from + n; i++) {
    const began = performance.now();
    try {
      await bake(mutant(i), { maxTime: 20, ...options });
      out.worlds++;
    } catch (why) {
      const isSentence = why instanceof BakeFailure && why.kind !== 'defect' && why.message.length > 10;
      if (!isSentence) out.wrong.push(`${i}: ${why.stack}`);
      else out.kinds[why.kind] = (out.kinds[why.kind] ?? 0) + 1;
    }
    out.slowest = Math.max(out.slowest, performance.now() - began);
    if (i % 100 !== 99) continue;
    const { rooms } = await bake(formats.stl, options);
    if (rooms.filter(({ kind }) => kind === 'room').length === 2) out.sound++;
    else out.unsound++;
  }
  return out;
}
