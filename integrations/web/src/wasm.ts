/** The WebAssembly module: its functions, and access to its memory. */
import { bytesOf, type WasmSource } from './bytes.js';

export { bytesOf, type WasmSource } from './bytes.js';

/** Functions that the module exports; `integrations/abi` describes each. */
export interface Exports {
  memory: WebAssembly.Memory;
  enf_abi_version(): number;
  enf_version(): number;
  enf_last_error(): number;
  enf_alloc(n: number): number;
  enf_free(bytes: number, n: number): void;
  enf_open(glb: number, n: number): number;
  enf_open_hollow(glb: number, n: number, skeleton: number, nSkeleton: number): number;
  enf_close(world: number): void;
  enf_count(world: number, what: number): number;
  enf_cell(world: number, cell: number, out: number): number;
  enf_room(world: number, cell: number, out: number): number;
  enf_portal(world: number, portal: number, out: number): number;
  enf_leaf(world: number, portal: number, leaf: number, out: number): number;
  enf_detail(world: number, detail: number, out: number): number;
  enf_chunk(world: number, chunk: number, out: number): number;
  enf_cells_of_batch(world: number, batch: number, out: number): number;
  enf_cells_of_detail(world: number, detail: number, out: number): number;
  enf_portals_of_detail(world: number, detail: number, out: number): number;
  enf_pvs_row(world: number, cell: number, out: number): number;
  enf_locate(world: number, point: number): number;
  enf_start(world: number, out: number): number;
  enf_step(world: number, from: number, to: number, out: number): number;
  enf_set_openness(world: number, portal: number, share: number): number;
  enf_set_closed(world: number, portal: number, isClosed: number): number;
  enf_lock(world: number, cell: number, isLocked: number): number;
  enf_pose(world: number, detail: number, out: number): number;
  enf_see(world: number, eye: number, viewProjection: number, out: number): number;
  enf_see_around(world: number, eye: number, out: number): number;
  enf_sees_box(world: number, cells: number, n: number, aabb: number): number;
  enf_is_clear(world: number, from: number, to: number): number;
  enf_pick(world: number, from: number, to: number, out: number): number;
}

/** Version of the C interface that this package is written for. */
const ABI_VERSION = 1;

/** An instance of the module. Worlds of one instance share its memory. */
export class Runtime {
  /** Words of the memory; made anew when the memory has grown. */
  u32: Uint32Array;
  /** Numbers of the memory. */
  f32: Float32Array;

  private constructor(readonly exports: Exports) {
    this.u32 = new Uint32Array(exports.memory.buffer);
    this.f32 = new Float32Array(exports.memory.buffer);
  }

  private static readonly shared = new Map<string, Promise<Runtime>>();

  /** Loads the module, once from each address; its worlds share the instance. */
  static load(source?: WasmSource): Promise<Runtime> {
    const from = source ?? new URL('./enfilade.wasm', import.meta.url);
    if (typeof from !== 'string' && !(from instanceof URL)) return Runtime.start(from);
    const address = String(from);
    const known = Runtime.shared.get(address) ?? moduleAt(address).then((module) => Runtime.start(module));
    Runtime.shared.set(address, known);
    // An address that failed is tried again by the next who asks.
    known.catch(() => Runtime.shared.delete(address));
    return known;
  }

  private static async start(source: BufferSource | WebAssembly.Module): Promise<Runtime> {
    const module = source instanceof WebAssembly.Module ? source : await WebAssembly.compile(source);
    const instance = await WebAssembly.instantiate(module, {});
    const exports = instance.exports as unknown as Exports;
    const found = exports.enf_abi_version();
    if (found !== ABI_VERSION) {
      throw new Error(`enfilade.wasm has version ${found} of the interface, this package needs ${ABI_VERSION}`);
    }
    return new Runtime(exports);
  }

  /** Renews the views of the memory if it has grown; returns true if so. */
  refresh(): boolean {
    if (this.u32.buffer === this.exports.memory.buffer) return false;
    this.u32 = new Uint32Array(this.exports.memory.buffer);
    this.f32 = new Float32Array(this.exports.memory.buffer);
    return true;
  }

  /** Reads a text that ends in a zero byte. */
  private text(at: number): string {
    const bytes = new Uint8Array(this.exports.memory.buffer);
    return this.string(at, bytes.indexOf(0, at) - at);
  }

  /** Reads a text of `n` bytes. */
  string(at: number, n: number): string {
    return new TextDecoder().decode(new Uint8Array(this.exports.memory.buffer, at, n));
  }

  /** Returns the version of the library. */
  get version(): string {
    return this.text(this.exports.enf_version());
  }

  /** Returns the reason of the last failure, as an error to throw. */
  error(): Error {
    return new Error(this.text(this.exports.enf_last_error()));
  }

  /** Returns a status that is no failure; throws otherwise. -1 stands for nothing. */
  checked(status: number): number {
    if (status < -1) throw this.error();
    return status;
  }

  /** Copies bytes into the memory for the time of `use`. */
  with<T>(bytes: Uint8Array, use: (at: number, n: number) => T): T {
    const at = this.exports.enf_alloc(bytes.length);
    if (at === 0 && bytes.length > 0) throw new Error(`no memory for ${bytes.length} bytes`);
    try {
      new Uint8Array(this.exports.memory.buffer, at, bytes.length).set(bytes);
      return use(at, bytes.length);
    } finally {
      this.exports.enf_free(at, bytes.length);
      this.refresh();
    }
  }
}

/** Compiles the module that lies at an address; says what to do if there is none. */
async function moduleAt(address: string): Promise<WebAssembly.Module> {
  try {
    const bytes = await bytesOf(address);
    // Servers answer with a page for what they do not have. Types do not matter: some know none for modules.
    const head = new TextDecoder().decode(bytes.subarray(0, 16));
    if (!head.startsWith('\0asm')) throw new Error(`${address}: no WebAssembly, it begins with ${JSON.stringify(head)}`);
    return await WebAssembly.compile(bytes);
  } catch (why) {
    throw new Error(
      `enfilade.wasm did not load (${(why as Error).message}). Copy it there from the package's folder dist, ` +
        `or give its address or its bytes as \`wasm\` (README, "Bundlers")`,
    );
  }
}
