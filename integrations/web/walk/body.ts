// The walker: stays out of walls by rooms and doorways, and out of furniture by its triangles.
import type { World } from '../src/world.js';
import type { Obstacles } from './obstacles.js';

/** Height of the eye, in meters. */
export const EYE = 1.6;
const RADIUS = 0.25;
const STEP = 0.45;
/** Time after which one who cannot move at all gets out through furniture. [s] */
const STUCK = 1;

/** A walker with a position of its eye. */
export class Walker {
  flies = false;
  /** Time without a move, or of moves through furniture. [s] */
  private stuck = 0;

  constructor(
    private readonly world: World,
    readonly eye: [number, number, number],
    private readonly obstacles?: Obstacles,
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
  move(x: number, up: number, z: number, seconds: number): void {
    const { eye } = this;
    const length = Math.hypot(x, z);
    if (length > 1e-9) {
      const hasMoved = this.tryMove(x, z) || this.tryMove(x, 0) || this.tryMove(0, z);
      if (!hasMoved) this.stuck += seconds;
    }
    if (!this.flies) return;
    const to = [eye[0], eye[1] + up, eye[2]];
    if (this.passes(eye, to)) eye[1] += up;
  }

  private tryMove(x: number, z: number): boolean {
    const { eye } = this;
    const length = Math.hypot(x, z);
    if (length < 1e-9) return false;
    const feet = [eye[0], eye[1] - EYE, eye[2]];
    const isFree = this.flies || (this.obstacles?.isFree(feet, x / length, z / length, length + RADIUS) ?? true);
    if (!isFree && this.stuck < STUCK) return false;
    const reach = 1 + RADIUS / length;
    for (const low of this.flies ? [0] : [0, EYE - STEP]) {
      const from = [eye[0], eye[1] - low, eye[2]];
      if (low > 0 && !this.passes(eye, from)) continue;
      if (!this.passes(from, [from[0]! + reach * x, from[1]!, from[2]! + reach * z])) return false;
    }
    if (isFree) this.stuck = 0;
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
