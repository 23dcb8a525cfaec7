// The walker: stays out of walls by rooms and doorways, so that it needs no triangles.
import type { Cell, World } from '../src/world.js';

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

  /** Places a walker in the middle of the room with the most ways out. */
  static inMiddle(world: World): Walker {
    const ways = (cell: Cell): number =>
      cell.portals.filter((id) => ['door', 'open'].includes(world.portals[id]!.kind)).length;
    const rooms = world.cells.filter((cell) => cell.kind === 'room');
    rooms.sort((a, b) => ways(b) - ways(a) || b.volume - a.volume);
    const cell = rooms[0] ?? world.cells[0]!;
    const { aabb } = cell;
    let best: [number, number, number] = [0, 1, 2].map((k) => (aabb[k]! + aabb[k + 3]!) / 2) as [number, number, number];
    let nearest = Infinity;
    const middle = [...best];
    for (let i = 0; i < 4000; i++) {
      // A low-discrepancy sequence: the same place each time.
      const share = [0.7548776662, 0.5698402910, 0.1] as const;
      const p = [0, 2, 1].map((axis, k) => aabb[axis]! + ((i * share[k]!) % 1) * (aabb[axis + 3]! - aabb[axis]!));
      const eye: [number, number, number] = [p[0]!, aabb[1]! + EYE, p[1]!];
      const away = Math.hypot(eye[0] - middle[0]!, eye[2] - middle[2]!);
      if (away < nearest && world.locate(eye) === cell.id) [best, nearest] = [eye, away];
    }
    const walker = new Walker(world, best);
    walker.fall(1);
    return walker;
  }

  /** Returns the yaw of the direction, of 32, in which the way is free farthest at the height of the eye, up to 20 m. */
  widestView(): number {
    const { eye } = this;
    let [best, farthest] = [0, 0];
    for (let i = 0; i < 32; i++) {
      const yaw = (i / 16) * Math.PI;
      const at = (far: number): number[] => [eye[0] - far * Math.sin(yaw), eye[1], eye[2] - far * Math.cos(yaw)];
      let far = 0;
      while (far < 20 && this.passes(at(far), at(far + 0.5))) far += 0.5;
      if (far > farthest) [best, farthest] = [yaw, far];
    }
    return best;
  }

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
