/** The thread on which `bake` works: a worker of a page, or of node. */
import { runModule, type ModuleFile } from './bake-module.js';

/** What the worker is sent, once. */
export interface WorkerTask {
  module: WebAssembly.Module;
  files: ModuleFile[];
  request: string;
}

interface Port {
  postMessage(message: unknown, transfer?: ArrayBuffer[]): void;
}

const threads = globalThis.process?.getBuiltinModule?.('worker_threads');
const port = (threads?.parentPort ?? globalThis) as unknown as Port;

async function work({ module, files, request }: WorkerTask): Promise<void> {
  try {
    const answer = await runModule(module, files, request, (name, at, of) => port.postMessage({ step: { name, at, of } }));
    const transfer = 'world' in answer ? [answer.world.buffer] : [];
    port.postMessage({ answer }, transfer);
  } catch (why) {
    port.postMessage({ failed: (why as Error).message });
  }
}

if (threads?.parentPort) threads.parentPort.on('message', (task: WorkerTask) => void work(task));
else globalThis.addEventListener('message', (event) => void work((event as MessageEvent<WorkerTask>).data));
