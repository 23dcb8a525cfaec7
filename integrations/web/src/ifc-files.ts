/** IFC files among the files of a bake, which another package reads first. */
import type { ModuleFile } from './bake-module.js';

/** Makes a GLB of an IFC file, as the command does, with notes for the user. Throws if it cannot, or the signal ends it. */
export type IfcReader = (bytes: Uint8Array, signal?: AbortSignal) => Promise<{ glb: Uint8Array; notes: string[] }>;

/** Bytes in which a file's head and its last line are. */
const [HEAD, TAIL] = [1 << 16, 1 << 12];
const latin = new TextDecoder('latin1');

const isIfc = (bytes: Uint8Array): boolean => {
  const head = latin.decode(bytes.subarray(0, HEAD)).trimStart().toUpperCase();
  return head.startsWith('ISO-10303-21') && head.includes('IFC');
};

/** The module says what is wrong with a file that was cut off. */
const isWhole = (bytes: Uint8Array): boolean => /END-ISO-10303-21/i.test(latin.decode(bytes.subarray(-TAIL)));

/** Returns the file with the schema that web-ifc knows, if it has that of a draft, which has the same entities. */
function withKnownSchema(bytes: Uint8Array): Uint8Array {
  const found = /'IFC2X_FINAL'/i.exec(latin.decode(bytes.subarray(0, HEAD)));
  if (!found) return bytes;
  const known = bytes.slice();
  known.set(new TextEncoder().encode("'IFC2X3'     "), found.index);
  return known;
}

/** Has all IFC files read, one after another; `begin` is called before the first. Fails with a text for the user. */
export async function convertIfc(
  files: ModuleFile[],
  read: IfcReader | undefined,
  signal: AbortSignal | undefined,
  begin: () => void,
  fail: (text: string) => never,
): Promise<void> {
  const all = files.filter(({ bytes }) => isIfc(bytes) && isWhole(bytes));
  if (all.length > 0) begin();
  for (const file of all) {
    if (!read) fail(`${file.name}: IFC is read by the package web-ifc: install it, and give \`ifc: ifcReader(webIfc)\` of enfilade/ifc`);
    try {
      file.converted = await read(withKnownSchema(file.bytes), signal);
    } catch (why) {
      signal?.throwIfAborted();
      fail(`${file.name}: ${(why as Error).message}`);
    }
    signal?.throwIfAborted();
  }
}
