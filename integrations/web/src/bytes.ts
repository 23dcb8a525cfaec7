/** Bytes from wherever they lie. */

/** Something to make a module of: its bytes, an address, or the compiled module. */
export type WasmSource = BufferSource | URL | string | WebAssembly.Module;

/** Reads bytes from an address; also from files, in node. */
export async function bytesOf(source: BufferSource | URL | string): Promise<Uint8Array<ArrayBuffer>> {
  if (source instanceof ArrayBuffer) return new Uint8Array(source);
  if (ArrayBuffer.isView(source)) {
    return new Uint8Array(source.buffer as ArrayBuffer, source.byteOffset, source.byteLength);
  }
  const address = String(source);
  // Not imported: browsers have no such module, and bundlers would look for it.
  const fs = address.startsWith('file:') ? globalThis.process?.getBuiltinModule?.('fs') : undefined;
  if (fs) return new Uint8Array(await fs.promises.readFile(new URL(address)));
  const answer = await fetch(address).catch((why: Error) => {
    throw new Error(`${address}: ${why.message}`);
  });
  if (!answer.ok) throw new Error(`${address}: ${answer.status} ${answer.statusText}`);
  return new Uint8Array(await answer.arrayBuffer());
}
