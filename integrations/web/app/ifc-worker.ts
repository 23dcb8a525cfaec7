// The thread that reads one IFC file, by means of web-ifc (MPL-2.0, unchanged: web-ifc-license.md; sources on npm).
import * as webIfc from 'web-ifc';
import { ifcReader } from '../dist/ifc.js';

/** What the thread is asked: the file, and the address of the package's module. */
export interface IfcTask {
  bytes: Uint8Array;
  wasm: string;
}

/** What it answers. */
export type IfcAnswer = { glb: Uint8Array; notes: string[] } | { failed: string };

addEventListener('message', (event: MessageEvent<IfcTask>) => {
  const { bytes, wasm } = event.data;
  ifcReader(webIfc, { wasm })(bytes).then(
    (answer) => postMessage(answer satisfies IfcAnswer, { transfer: [answer.glb.buffer] }),
    (why: Error) => postMessage({ failed: why.message } satisfies IfcAnswer),
  );
});
