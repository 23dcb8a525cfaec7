// The walker: stays out of walls by rooms and doorways, so that it needs no triangles.
import type { World } from '../src/world.js';

/** Height of the eye, in meters. */
export const EYE = 1.6;
const RADIUS = 0.25;
const STEP = 0.45;

/** A walker with a position of its eye. */
export class Walker {
  flies = false;

  constructor(
    private readonly world: World,
    readonly eye: [number, number, number],
  ) {}

  /** Returns true if a body passes from one point to another. */
  private passes(from: number[], to: number[]): boolean {
    const { world } = this;
    const { cell, crossed, isRelocated } = world.step(from, to);
    if (isRelocated || cell < 0 || world.locate(to) < 0) return false;
    return crossed.every((id) => {
      const { kind } = world.portals[id]!;
      return world.isOpen(id) && kind !== 'window' && kind !== 'crack';
    });
  }

  /** Finds the floor below a point, at most `depth` down; undefined if there is none. */
  private floor(p: number[], depth: number): number | undefined {
    for (let down = 0.05; down <= depth; down += 0.05) {
      const at = [p[0]!, p[1]! - down, p[2]!];
      const { isRelocated } = this.world.step(p, at);
      if (isRelocated || this.world.locate(at) < 0) return p[1]! - down + 0.025;
    }
    return undefined;
  }

  /** Moves in a horizontal direction, and along walls; `up` only in flight. */
  move(x: number, up: number, z: number): void {
    const { eye } = this;
    const length = Math.hypot(x, z);
    if (length > 1e-9) {
      if (!this.tryMove(x, z)) void (this.tryMove(x, 0) || this.tryMove(0, z));
    }
    if (!this.flies) return;
    const to = [eye[0], eye[1] + up, eye[2]];
    if (this.passes(eye, to)) eye[1] += up;
  }

  private tryMove(x: number, z: number): boolean {
    const { eye } = this;
    const length = Math.hypot(x, z);
    if (length < 1e-9) return false;
    const reach = 1 + RADIUS / length;
    for (const low of this.flies ? [0] : [0, EYE - STEP]) {
      const from = [eye[0], eye[1] - low, eye[2]];
      if (low > 0 && !this.passes(eye, from)) continue;
      if (!this.passes(from, [from[0]! + reach * x, from[1]!, from[2]! + reach * z])) return false;
    }
    eye[0] += x;
    eye[2] += z;
    return true;
  }

  /** Settles on the floor: up stairs, and down. */
  fall(seconds: number): void {
    if (this.flies) return;
    const { eye } = this;
    const floor = this.floor(eye, EYE + 3);
    if (floor === undefined) return;
    const goal = floor + EYE;
    const step = Math.max(-6 * seconds, Math.min(4 * seconds, goal - eye[1]));
    if (this.passes(eye, [eye[0], eye[1] + step, eye[2]])) eye[1] += step;
  }
}
