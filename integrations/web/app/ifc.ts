// IFC files, read on a thread of their own. Its script and the module of web-ifc are loaded when the first such file comes.
import type { IfcReader } from '../src/bake.js';
import type { IfcAnswer, IfcTask } from './ifc-worker.js';

// Its type lets the browser compile it while it reads it.
const addressOf = (wasm: Blob): string => URL.createObjectURL(new Blob([wasm], { type: 'application/wasm' }));

let parts: Promise<[code: string, wasm: string]> | undefined;

/** Returns the reader of the page; `script` and `fetched` load a script, as an address, and a file. */
export const readIfc =
  (script: (name: string) => Promise<string>, fetched: (name: string) => Promise<Blob>): IfcReader =>
  async (bytes, signal) => {
    // Kept: the next file needs no network.
    parts ??= Promise.all([script('ifc-worker.js'), fetched('web-ifc.wasm').then(addressOf)]);
    parts.catch(() => (parts = undefined));
    const [code, wasm] = await parts;
    signal?.throwIfAborted();
    const worker = new Worker(code);
    try {
      return await new Promise((resolve, reject) => {
        signal?.addEventListener('abort', () => reject(signal.reason as Error));
        worker.addEventListener('error', (event) => reject(new Error(event.message || 'its thread ended; perhaps its memory did not suffice')));
        worker.addEventListener('message', ({ data }: MessageEvent<IfcAnswer>) => {
          if ('failed' in data) reject(new Error(data.failed));
          else resolve(data);
        });
        worker.postMessage({ bytes, wasm } satisfies IfcTask);
      });
    } finally {
      worker.terminate();
    }
  };
