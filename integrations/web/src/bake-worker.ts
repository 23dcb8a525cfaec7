/** The thread on which `bake` works: a worker of a page, or of node. */
import { runModule, runThread, type ModuleFile, type ModuleThread } from './bake-module.js';

/** What the worker is sent, once: a bake, with the number of threads that help it, or the part of one. */
export type WorkerTask = { module: WebAssembly.Module; files: ModuleFile[]; request: string; helpers: number } | { thread: ModuleThread };

interface Port {
  postMessage(message: unknown, transfer?: ArrayBuffer[]): void;
}

const threads = globalThis.process?.getBuiltinModule?.('worker_threads');
const port = (threads?.parentPort ?? globalThis) as unknown as Port;

async function work(task: WorkerTask): Promise<void> {
  const step = (name: string, at: number, of: number): void => port.postMessage({ step: { name, at, of } });
  try {
    if ('thread' in task) {
      await runThread(task.thread, step, (panic) => port.postMessage({ panic }));
      return;
    }
    const { module, files, request, helpers } = task;
    const others = { n: helpers, start: (thread: ModuleThread): void => port.postMessage({ thread }) };
    const answer = await runModule(module, files, request, step, helpers > 0 ? others : undefined);
    const transfer = 'world' in answer ? [answer.world.buffer] : [];
    port.postMessage({ answer }, transfer);
  } catch (why) {
    port.postMessage({ failed: (why as Error).message });
  }
}

if (threads?.parentPort) threads.parentPort.on('message', (task: WorkerTask) => void work(task));
else globalThis.addEventListener('message', (event) => void work((event as MessageEvent<WorkerTask>).data));
