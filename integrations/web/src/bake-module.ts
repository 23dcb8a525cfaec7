/** One run of the module that bakes, on the thread that calls it. */

/** Functions that the module exports; `bake/src/ffi.rs` describes each. */
interface Exports {
  memory: WebAssembly.Memory;
  enf_bake_version(): number;
  enf_bake_alloc(n: number): number;
  enf_bake_file(name: number, nName: number, bytes: number, n: number, isDetail: number): void;
  enf_bake_ifc(name: number, nName: number, glb: number, n: number, notes: number, nNotes: number): void;
  enf_bake_run(request: number, n: number): number;
  enf_bake_answer(which: number): number;
  enf_bake_answer_size(which: number): number;
  /** Only of the module with threads, as those that follow. */
  enf_bake_threads(n: number): number;
  enf_bake_thread(): void;
  __wasm_init_tls(at: number): void;
  __stack_pointer: WebAssembly.Global;
  __tls_size: WebAssembly.Global;
  __tls_align: WebAssembly.Global;
}

/** Version of the functions that this package is written for. */
const VERSION = 1;

/** A file for the module. */
export interface ModuleFile {
  name: string;
  bytes: Uint8Array;
  isDetail: boolean;
  /** What web-ifc made of it. */
  converted?: { glb: Uint8Array; notes: string[] };
}

/** A property of the input that only a person knows. */
export interface Question {
  about: 'unit' | 'up';
  /** The evidence, and the option of the command. */
  text: string;
  /** The value of the setting that the evidence speaks for, if there is one. */
  proposed: string | null;
}

/** The reason why there is no world. */
export interface Refusal {
  kind: 'settings' | 'files' | 'refused' | 'leak' | 'bake' | 'memory' | 'empty' | 'defect';
  text: string;
  questions: Question[];
}

/** What a run returns: bytes, a drawing and facts in JSON, or why there are none; and the memory that it took. */
export type ModuleAnswer =
  | { world: Uint8Array<ArrayBuffer>; plan: string; facts: string; memory: number }
  | { refusal: Refusal; memory: number };

/** Hears of a step: its name, its number from 0, the number of all. What it throws ends the run. */
export type OnStep = (name: string, at: number, of: number) => void;

/** A thread of a bake, in the memory of its first instance. */
export interface ModuleThread {
  module: WebAssembly.Module;
  memory: WebAssembly.Memory;
  /** End of its stack, from where it grows down. */
  stack: number;
  /** Its thread-local storage. */
  local: number;
}

/** Stack of a thread. [Units: bytes] */
const STACK = 4 << 20;
/** Pages of memory at first and at most, as the module is linked. */
const PAGES = { initial: 1024, maximum: 65_536 };

/** Returns `true` for a module that works on several threads. */
export const isThreaded = (module: WebAssembly.Module): boolean => WebAssembly.Module.imports(module).some(({ kind }) => kind === 'memory');

function imports(instance: () => WebAssembly.Memory, onStep: OnStep, onPanic: (text: string) => void): Record<string, WebAssembly.ImportValue> {
  // Texts in shared memory are not decoded in place.
  const text = (at: number, n: number): string => new TextDecoder().decode(new Uint8Array(instance().buffer).slice(at, at + n));
  return {
    // Workers begin to count when they are made.
    now: (): number => performance.timeOrigin + performance.now(),
    step: (name: number, n: number, at: number, of: number): void => onStep(text(name, n), at, of),
    panicked: (at: number, n: number): void => onPanic(text(at, n)),
  };
}

/** Works for a bake that another instance began; returns when its thread is ended. */
export async function runThread({ module, memory, stack, local }: ModuleThread, onStep: OnStep, onPanic: (text: string) => void): Promise<void> {
  const page = imports(() => memory, onStep, onPanic);
  const { exports } = await WebAssembly.instantiate(module, importsOf(module, page, memory));
  const own = exports as unknown as Exports;
  own.__stack_pointer.value = stack;
  own.__wasm_init_tls(local);
  own.enf_bake_thread();
}

/** Returns what the module imports: functions of the page, the memory of all threads, and some functions of a library that are never called (a calendar's clock). */
function importsOf(module: WebAssembly.Module, page: WebAssembly.ModuleImports, memory?: WebAssembly.Memory): WebAssembly.Imports {
  const imports: Record<string, WebAssembly.ModuleImports> = { page };
  for (const { module: from, name, kind } of WebAssembly.Module.imports(module)) {
    if (from === 'page') continue;
    const missing = (): never => {
      throw new WebAssembly.RuntimeError(`${name} is not there`);
    };
    (imports[from] ??= {})[name] = kind === 'memory' ? memory! : missing;
  }
  return imports;
}

/** Memory from which a run that stopped without a word is taken to have had too little. */
const MUCH = 1 << 30;

/** Makes the threads of a bake. */
export interface Threads {
  n: number;
  start(thread: ModuleThread): void;
}

/** Bakes files in a new instance, whose memory goes with it; a module with threads needs `threads`. */
export async function runModule(
  module: WebAssembly.Module,
  files: ModuleFile[],
  request: string,
  onStep: OnStep,
  threads?: Threads,
): Promise<ModuleAnswer> {
  const decoder = new TextDecoder();
  let [stage, panic] = ['', ''];
  let thrown: unknown;
  let memory: WebAssembly.Memory | undefined;
  const hear: OnStep = (name, at, of) => {
    stage = name;
    try {
      onStep(name, at, of);
    } catch (why) {
      thrown = why;
      throw why;
    }
  };
  const size = (): number => memory?.buffer.byteLength ?? 0;
  try {
    const shared = threads && isThreaded(module) ? new WebAssembly.Memory({ ...PAGES, shared: true }) : undefined;
    memory = shared;
    const page = imports(() => memory!, hear, (text) => (panic = text));
    const instance = await WebAssembly.instantiate(module, importsOf(module, page, shared));
    const own = instance.exports as unknown as Exports;
    memory ??= own.memory;
    const held = memory;
    if (own.enf_bake_version() !== VERSION) {
      throw new Error(`enfilade-bake.wasm has version ${own.enf_bake_version()} of its functions, this package needs ${VERSION}`);
    }
    const room = (n: number): number => {
      const at = own.enf_bake_alloc(n);
      if (at === 0 && n > 0) throw new RangeError(`no memory for ${n} bytes`);
      return at;
    };
    const put = (bytes: Uint8Array): [number, number] => {
      const at = room(bytes.length);
      new Uint8Array(held.buffer, at, bytes.length).set(bytes);
      return [at, bytes.length];
    };
    if (shared && threads) startThreads(own, module, shared, threads, room);
    const encoder = new TextEncoder();
    for (const { name, bytes, isDetail, converted } of files) {
      own.enf_bake_file(...put(encoder.encode(name)), ...put(bytes), isDetail ? 1 : 0);
      if (!converted) continue;
      const notes = encoder.encode(converted.notes.join('\n'));
      own.enf_bake_ifc(...put(encoder.encode(name)), ...put(converted.glb), ...put(notes));
    }
    const isDone = own.enf_bake_run(...put(encoder.encode(request))) === 1;
    const answer = (which: number): Uint8Array<ArrayBuffer> =>
      new Uint8Array(held.buffer, own.enf_bake_answer(which), own.enf_bake_answer_size(which)).slice() as Uint8Array<ArrayBuffer>;
    const facts = decoder.decode(answer(2));
    if (!isDone) return { refusal: JSON.parse(facts) as Refusal, memory: size() };
    return { world: answer(0), plan: decoder.decode(answer(1)), facts, memory: size() };
  } catch (why) {
    if (thrown !== undefined) throw thrown;
    if (!(why instanceof WebAssembly.RuntimeError) && !(why instanceof RangeError)) throw why;
    return { refusal: refusalOf(why, stage, panic, size()), memory: size() };
  }
}

/** Gives each thread its part of the memory, and waits until all are there. */
function startThreads(own: Exports, module: WebAssembly.Module, memory: WebAssembly.Memory, threads: Threads, room: (n: number) => number): void {
  const [size, align] = [own.__tls_size.value as number, Math.max(16, own.__tls_align.value as number)];
  const up = (at: number): number => Math.ceil(at / align) * align;
  for (let i = 0; i < threads.n; i++) {
    const at = room(STACK + size + 2 * align);
    threads.start({ module, memory, local: up(at), stack: Math.floor((at + STACK + size + 2 * align) / 16) * 16 });
  }
  own.enf_bake_threads(threads.n);
}

/** Says why an instance stopped. */
function refusalOf(why: Error, stage: string, panic: string, memory: number): Refusal {
  const where = stage ? ` in the step '${stage}'` : '';
  const mebibytes = Math.round(memory / 2 ** 20);
  if (!panic && (why instanceof RangeError || memory >= MUCH)) {
    const text = `the memory does not suffice${where}: ${mebibytes} MiB were taken, and no more was to be had; the command has more`;
    return { kind: 'memory', text, questions: [] };
  }
  return defect(panic || why.message, stage);
}

/** Returns the refusal for a defect in a step. */
export function defect(what: string, stage: string): Refusal {
  const where = stage ? ` in the step '${stage}'` : '';
  const text = `a defect of the bake${where}: ${what}; the file was not baked, the next one can be`;
  return { kind: 'defect', text, questions: [] };
}
