/** One run of the module that bakes, on the thread that calls it. */

/** Functions that the module exports; `bake/src/ffi.rs` describes each. */
interface Exports {
  memory: WebAssembly.Memory;
  enf_bake_version(): number;
  enf_bake_alloc(n: number): number;
  enf_bake_file(name: number, nName: number, bytes: number, n: number, isDetail: number): void;
  enf_bake_run(request: number, n: number): number;
  enf_bake_answer(which: number): number;
  enf_bake_answer_size(which: number): number;
}

/** Version of the functions that this package is written for. */
const VERSION = 1;

/** A file for the module. */
export interface ModuleFile {
  name: string;
  bytes: Uint8Array;
  isDetail: boolean;
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

/** Memory from which a run that stopped without a word is taken to have had too little. */
const MUCH = 1 << 30;

/** Bakes files in a new instance, whose memory goes with it. */
export async function runModule(module: WebAssembly.Module, files: ModuleFile[], request: string, onStep: OnStep): Promise<ModuleAnswer> {
  const decoder = new TextDecoder();
  let [stage, panic] = ['', ''];
  let thrown: unknown;
  let exports: Exports | undefined;
  const text = (at: number, n: number): string => decoder.decode(new Uint8Array(exports!.memory.buffer, at, n));
  const page = {
    now: (): number => performance.now(),
    step: (name: number, n: number, at: number, of: number): void => {
      stage = text(name, n);
      try {
        onStep(stage, at, of);
      } catch (why) {
        thrown = why;
        throw why;
      }
    },
    panicked: (at: number, n: number): void => {
      panic = text(at, n);
    },
  };
  const size = (): number => exports?.memory.buffer.byteLength ?? 0;
  try {
    const instance = await WebAssembly.instantiate(module, { page });
    exports = instance.exports as unknown as Exports;
    const own = exports;
    if (own.enf_bake_version() !== VERSION) {
      throw new Error(`enfilade-bake.wasm has version ${own.enf_bake_version()} of its functions, this package needs ${VERSION}`);
    }
    const put = (bytes: Uint8Array): [number, number] => {
      const at = own.enf_bake_alloc(bytes.length);
      if (at === 0 && bytes.length > 0) throw new RangeError(`no memory for ${bytes.length} bytes`);
      new Uint8Array(own.memory.buffer, at, bytes.length).set(bytes);
      return [at, bytes.length];
    };
    const encoder = new TextEncoder();
    for (const { name, bytes, isDetail } of files) own.enf_bake_file(...put(encoder.encode(name)), ...put(bytes), isDetail ? 1 : 0);
    const isDone = own.enf_bake_run(...put(encoder.encode(request))) === 1;
    const answer = (which: number): Uint8Array<ArrayBuffer> =>
      new Uint8Array(own.memory.buffer, own.enf_bake_answer(which), own.enf_bake_answer_size(which)).slice() as Uint8Array<ArrayBuffer>;
    const facts = decoder.decode(answer(2));
    if (!isDone) return { refusal: JSON.parse(facts) as Refusal, memory: size() };
    return { world: answer(0), plan: decoder.decode(answer(1)), facts, memory: size() };
  } catch (why) {
    if (thrown !== undefined) throw thrown;
    if (!(why instanceof WebAssembly.RuntimeError) && !(why instanceof RangeError)) throw why;
    return { refusal: refusalOf(why, stage, panic, size()), memory: size() };
  }
}

/** Says why an instance stopped. */
function refusalOf(why: Error, stage: string, panic: string, memory: number): Refusal {
  const where = stage ? ` in the step '${stage}'` : '';
  const mebibytes = Math.round(memory / 2 ** 20);
  if (!panic && (why instanceof RangeError || memory >= MUCH)) {
    const text = `the memory does not suffice${where}: ${mebibytes} MiB were taken, and no more was to be had; the command has more`;
    return { kind: 'memory', text, questions: [] };
  }
  const text = `a defect of the bake${where}: ${panic || why.message}; the file was not baked, the next one can be`;
  return { kind: 'defect', text, questions: [] };
}
