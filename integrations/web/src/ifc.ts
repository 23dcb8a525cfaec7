/** IFC by means of the package web-ifc, as the command reads it with node. */
import type { IfcReader } from './bake.js';
import { glbOfIfc } from './ifc-model.js';

/** Where IFC comes from. */
export interface IfcOptions {
  /** Address of the package's module, `web-ifc.wasm`, if it is not beside its script. */
  wasm?: string | URL;
}

/**
 * Returns a reader for `bake(files, { ifc })`. `webIfc` is the package: `import * as webIfc from 'web-ifc'`. It works on the
 * thread that calls.
 */
export function ifcReader(webIfc: object, { wasm }: IfcOptions = {}): IfcReader {
  return async (bytes) => {
    const notes: string[] = [];
    const tell = (note: string): void => void notes.push(note);
    const made = glbOfIfc(webIfc, bytes, tell, wasm ? () => String(wasm) : undefined);
    const chunks = await made.catch((why: Error) => {
      throw new Error(`web-ifc cannot read it: ${why.message}`);
    });
    const glb = new Uint8Array(chunks.reduce((sum, chunk) => sum + chunk.length, 0));
    let at = 0;
    for (const chunk of chunks) {
      glb.set(chunk, at);
      at += chunk.length;
    }
    return { glb, notes };
  };
}
