// What the page was made with, and its parts: the script of the page says so.
import type { WasmSource } from '../src/wasm.js';

/** A storey, and a place on it. */
export interface Storey {
  name: string;
  eye: [number, number, number];
  yaw: number;
}

/** What the page was made with. */
export interface Made {
  /** Address of the world; a world beside the page if there is none. */
  world?: string;
  title?: string;
  storeys?: Storey[];
  /** The packed model of the first picture, on its way. */
  first?: Promise<Uint8Array>;
  /** Gets a part of the walk. */
  part(name: string): Promise<Uint8Array>;
  /** Tells why there is nothing to see. */
  tell(error: Error): void;
}

export const { made } = globalThis as unknown as { made: Made };

/** Gets the module of the run-time. */
export const moduleOfWalk = (): Promise<WasmSource> => made.part('walk-module.bin') as Promise<WasmSource>;
