/** The whole bake without a server: files in, a world, its plan and its rooms out. */
import { bytesOf, type WasmSource } from './bytes.js';
import { convertIfc, type IfcReader } from './ifc-files.js';
import { needsSecond } from './second-module.js';
import { defect, isThreaded, runModule, type ModuleAnswer, type ModuleFile, type ModuleThread, type Question, type Refusal } from './bake-module.js';

export type { Question, Refusal } from './bake-module.js';
export type { IfcReader } from './ifc-files.js';

/** A file: one of a page, or a name and bytes. Names have folders, with `/`, if scenes refer to files by them. */
export type BakeInput = File | { name: string; bytes: Uint8Array | ArrayBuffer | Blob };

/** A step of a bake. */
export interface BakeStep {
  /** Name of the step, as `enfilade bake -v` prints it; `reading` is the first and `plan` the last. */
  stage: string;
  index: number;
  count: number;
  /** Seconds since the bake began. */
  seconds: number;
}

/** Settings of a bake. */
export interface BakeOptions {
  /** Files all of whose objects are detail, such as furniture. */
  detail?: Iterable<BakeInput>;
  /** Settings by their names in the settings file. */
  settings?: Record<string, unknown>;
  /** A settings file. */
  toml?: string;
  method?: 'auto' | 'watershed' | 'bsp' | 'delaunay';
  /** Most memory, in bytes; 2 GiB if it is not given. */
  maxMemory?: number;
  /** Most time, in seconds. */
  maxTime?: number;
  /** Returns worlds without a room. */
  allowEmpty?: boolean;
  /** Returns worlds of maps that leak. */
  allowLeak?: boolean;
  /** Reads IFC files: `ifcReader` of `enfilade/ifc`. */
  ifc?: IfcReader;
  onProgress?: (step: BakeStep) => void;
  /** Ends the bake at once: its thread ends. */
  signal?: AbortSignal;
  /** Where the module is, if it moved. */
  wasm?: WasmSource;
  /** Where the second module is, if it moved: for E57, LAS, gbXML, HBJSON, TIFF, and glTF compressed by Draco. */
  wasmAll?: WasmSource;
  /** Makes a thread, if its script moved; `false` bakes on the thread that calls, which waits. */
  worker?: false | (() => Worker);
  /** Most threads; as many as the machine has cores, 8 at most, where pages may share memory, and else 1. */
  threads?: number;
}

/** A room, or a cell of another kind. Lengths are in meters. */
export interface BakedRoom {
  cell: number;
  name: string;
  kind: 'room' | 'void' | 'land';
  /** Names of the storeys on which it stands. */
  storeys: string[];
  floorArea: number;
  height: number;
  volume: number;
  doors: number;
  windows: number;
  aabb: [[number, number, number], [number, number, number]];
  /** Why it is a cell of its own, each reason a sentence. */
  why: string[];
}

/** An opening between two cells. Lengths are in meters. */
export interface BakedOpening {
  cells: [number, number];
  kind: 'open' | 'door' | 'window';
  at: [number, number, number];
  width: number;
  height: number;
  /** A person asked for it. */
  asked: boolean;
}

/** A storey. */
export interface BakedStorey {
  name: string;
  floor: number;
  top: number;
  area: number;
  cells: number[];
}

/** A decision that the bake nearly made otherwise. */
export interface CloseDecision {
  position: [number, number, number];
  /** Chance that it is wrong, 0.5 at most. */
  chance: number;
  /** What the bake made of the place; `space` is a whole cell, or none. */
  is: 'one room' | 'two rooms' | 'space';
  text: string;
}

/** How far to trust a world. */
export interface Verdict {
  trust: 'good' | 'fair' | 'low' | 'none';
  summary: string;
  /** Share of the rooms that are expected to be wrong. */
  doubt: number;
  /** The places most in doubt. */
  close: CloseDecision[];
  /** Reasons for less trust, with options of the command. */
  reasons: { text: string; options: string[] }[];
}

/** A finished bake. */
export interface Baked {
  /** The world, one GLB: the bytes that `enfilade bake` writes. */
  world: Uint8Array<ArrayBuffer>;
  /** The plans of all storeys, as SVG. */
  plan: string;
  rooms: BakedRoom[];
  storeys: BakedStorey[];
  /** All openings but cracks. */
  openings: BakedOpening[];
  verdict: Verdict;
  /** The verdict as the command prints it. */
  text: string;
  warnings: string[];
  /** What is in doubt about unit and axis. */
  questions: Question[];
  method: string;
  triangles: number;
  /** Seconds of each stage. */
  seconds: [string, number][];
  /** Memory of the module at the end, the most that it took. */
  memory: number;
}

/** The reason why there is no world. */
export class BakeFailure extends Error {
  readonly kind: Refusal['kind'];
  /** What to ask the person for, if that would help. */
  readonly questions: Question[];

  constructor({ kind, text, questions }: Refusal) {
    super(text);
    this.name = 'BakeFailure';
    this.kind = kind;
    this.questions = questions;
  }
}

/** Most threads unless more are asked for: the rest of a bake works alone. */
const MOST_THREADS = 8;

/** Returns the number of threads that a bake can have here: 1 in a page that is not isolated from others. */
export function possibleThreads(most = MOST_THREADS): number {
  const isShared = typeof SharedArrayBuffer !== 'undefined' && (globalThis.crossOriginIsolated ?? true);
  const cores = globalThis.process?.getBuiltinModule?.('os').availableParallelism() ?? globalThis.navigator?.hardwareConcurrency ?? 1;
  return isShared ? Math.max(1, Math.min(most, cores)) : 1;
}

const modules = new Map<string, Promise<WebAssembly.Module>>();

/** Loads the module that bakes, once from each address, so that a page can do so before it is needed: that with threads if there can be several. */
export function loadBake(source?: WasmSource, threads = possibleThreads()): Promise<WebAssembly.Module> {
  if (!source && threads > 1) return loadBake(new URL('./enfilade-bake-threads.wasm', import.meta.url)).catch(() => loadBake(undefined, 1));
  const from = source ?? new URL('./enfilade-bake.wasm', import.meta.url);
  if (from instanceof WebAssembly.Module) return Promise.resolve(from);
  if (typeof from !== 'string' && !(from instanceof URL)) return WebAssembly.compile(from);
  const address = String(from);
  const known = modules.get(address) ?? compiled(address);
  modules.set(address, known);
  // An address that failed is tried again by the next who asks.
  known.catch(() => modules.delete(address));
  return known;
}

async function compiled(address: string): Promise<WebAssembly.Module> {
  try {
    return await WebAssembly.compile(await bytesOf(address));
  } catch (why) {
    throw new Error(
      `${address.split('/').pop()} did not load (${(why as Error).message}). Copy it there from the package's folder dist, ` +
        `or give its address or its bytes as \`wasm\` or \`wasmAll\``,
    );
  }
}

/** Steps of a bake by the usual method. */
const STEPS = 12;

/** Bakes files into a world. Throws a `BakeFailure` if there is none, and the signal's reason if that ended it. */
export async function bake(files: Iterable<BakeInput>, options: BakeOptions = {}): Promise<Baked> {
  const { settings, toml, method, maxMemory, maxTime, allowEmpty, allowLeak, signal } = options;
  signal?.throwIfAborted();
  const isInline = options.worker === false;
  const threads = isInline ? 1 : possibleThreads(options.threads);
  const request = JSON.stringify({ settings, toml, method, maxMemory, maxTime, allowEmpty, allowLeak });
  const [own, detail] = await Promise.all([held(files, false), held(options.detail ?? [], true)]);
  const isSecond = [...own, ...detail].some(needsSecond);
  const second = (): WasmSource => options.wasmAll ?? new URL('./enfilade-bake-all.wasm', import.meta.url);
  const module = await loadBake(isSecond ? second() : options.wasm, threads);
  signal?.throwIfAborted();
  const began = performance.now();
  const onStep = (stage: string, index: number, count: number): void => {
    signal?.throwIfAborted();
    options.onProgress?.({ stage, index, count, seconds: (performance.now() - began) / 1000 });
  };
  const task = { module, files: [...own, ...detail], request, helpers: isThreaded(module) ? threads : 0 };
  const fail = (text: string): never => {
    throw new BakeFailure({ kind: 'files', text, questions: [] });
  };
  await convertIfc(task.files, options.ifc, signal, () => onStep('reading', 0, STEPS), fail);
  const answer = isInline ? await runModule(module, task.files, request, onStep) : await onThread(task, onStep, options);
  if ('refusal' in answer) throw new BakeFailure(answer.refusal);
  const { world, plan, facts, memory } = answer;
  return { world, plan, memory, ...(JSON.parse(facts) as Omit<Baked, 'world' | 'plan' | 'memory'>) };
}

async function held(inputs: Iterable<BakeInput>, isDetail: boolean): Promise<ModuleFile[]> {
  return Promise.all(
    [...inputs].map(async (input) => {
      const isFile = typeof Blob !== 'undefined' && input instanceof Blob;
      // A dropped folder's files have their path below it.
      const name = (isFile && (input as File).webkitRelativePath) || input.name;
      const from = isFile ? (input as File) : (input as { bytes: Uint8Array | ArrayBuffer | Blob }).bytes;
      const bytes = typeof Blob !== 'undefined' && from instanceof Blob ? await from.arrayBuffer() : from;
      return { name, bytes: bytes instanceof Uint8Array ? bytes : new Uint8Array(bytes as ArrayBuffer), isDetail };
    }),
  );
}

interface Thread {
  post(message: unknown): void;
  end(): void;
}

interface Told {
  /** A thread that is to help. */
  thread?: ModuleThread;
  /** The defect that ended a helping thread. */
  panic?: string;
  step?: { name: string; at: number; of: number };
  answer?: ModuleAnswer;
  failed?: string;
}

/** Starts a thread, in a page or in node. */
function started(make: BakeOptions['worker'], hear: (told: Told) => void, fail: (why: string) => void): Thread {
  const threads = make || typeof Worker !== 'undefined' ? undefined : globalThis.process?.getBuiltinModule?.('worker_threads');
  if (threads) {
    const worker = new threads.Worker(new URL('./bake-worker.js', import.meta.url));
    worker.on('message', hear);
    worker.on('error', (why) => fail((why as Error).message));
    worker.on('exit', () => fail('its thread ended'));
    return { post: (message) => worker.postMessage(message), end: () => void worker.terminate() };
  }
  const worker = make ? make() : new Worker(new URL('./bake-worker.js', import.meta.url), { type: 'module' });
  worker.addEventListener('message', (event: MessageEvent<Told>) => hear(event.data));
  worker.addEventListener('error', (event) => fail(event.message || 'its script did not load'));
  return { post: (message) => worker.postMessage(message), end: () => worker.terminate() };
}

function onThread(
  task: { module: WebAssembly.Module; files: ModuleFile[]; request: string; helpers: number },
  onStep: (stage: string, index: number, count: number) => void,
  { signal, worker }: BakeOptions,
): Promise<ModuleAnswer> {
  return new Promise((resolve, reject) => {
    let isOver = false;
    let last = '';
    const finish = (then: () => void): void => {
      if (isOver) return;
      isOver = true;
      signal?.removeEventListener('abort', abort);
      for (const thread of all) thread.end();
      then();
    };
    const abort = (): void => finish(() => reject(signal!.reason as Error));
    const hear = ({ step, answer, failed, thread, panic }: Told): void => {
      if (isOver) return;
      if (thread) begin({ thread });
      else if (panic !== undefined) finish(() => reject(new BakeFailure(defect(panic, last))));
      else if (step) {
        last = step.name;
        try {
          onStep(step.name, step.at, step.of);
        } catch (why) {
          finish(() => reject(why as Error));
        }
      } else if (answer) finish(() => resolve(answer));
      else finish(() => reject(new Error(failed)));
    };
    const fail = (why: string): void => {
      const where = last ? ` in the step '${last}'` : '';
      const text = `the bake stopped${where}: ${why}; perhaps its memory did not suffice`;
      finish(() => reject(new BakeFailure({ kind: 'memory', text, questions: [] })));
    };
    const all: Thread[] = [];
    const begin = (what: unknown): void => {
      const thread = started(worker, hear, fail);
      all.push(thread);
      thread.post(what);
    };
    signal?.addEventListener('abort', abort);
    begin(task);
  });
}
