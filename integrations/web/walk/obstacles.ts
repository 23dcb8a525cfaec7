// Furniture as an obstacle: the objects that are drawn, met by lines at the height of shins, hips and chest, and aslant from
// chest to shins, since a table is thinner than the space between these.
import { Box3, Mesh, Raycaster, Vector3, type Object3D } from 'three';
import type { PortalCuller } from '../src/culler.js';

/** Heights at which something is in the way, above the feet: over a step, below the head. [m] */
const HEIGHTS = [0.5, 0.95, 1.4];
/** Distance of the outer lines from the middle one: a little less than the walker's radius. [m] */
const BESIDE = 0.18;

/** The objects of a world that stand in the way. */
export class Obstacles {
  private readonly boxes = new Map<Object3D, Box3>();
  private readonly leaves: Set<number>;
  private readonly caster = new Raycaster();
  private readonly swept = new Box3();
  private readonly from = new Vector3();
  private readonly way = new Vector3();

  constructor(private readonly culler: PortalCuller) {
    // Doors open for walkers: only their portals stop one.
    this.leaves = new Set(culler.world.portals.flatMap(({ leaves }) => leaves.map(({ detail }) => detail)));
  }

  /** Returns true if nothing stands within `reach` of the feet in a level direction of length 1. */
  isFree(feet: readonly number[], x: number, z: number, reach: number): boolean {
    const { swept, from, way, caster } = this;
    const [fx, fy, fz] = feet as [number, number, number];
    swept.min.set(Math.min(fx, fx + reach * x) - BESIDE, fy + HEIGHTS[0]!, Math.min(fz, fz + reach * z) - BESIDE);
    swept.max.set(Math.max(fx, fx + reach * x) + BESIDE, fy + HEIGHTS.at(-1)!, Math.max(fz, fz + reach * z) + BESIDE);
    const near = this.near();
    if (near.length === 0) return true;
    const [low, high] = [HEIGHTS[0]!, HEIGHTS.at(-1)!];
    const lines = [...HEIGHTS.map((height) => [height, height]), [high, low]] as [number, number][];
    return lines.every(([start, end]) =>
      [-BESIDE, 0, BESIDE].every((side) => {
        from.set(fx - side * z, fy + start, fz + side * x);
        way.set(reach * x, end - start, reach * z);
        caster.far = way.length();
        caster.set(from, way.normalize());
        return caster.intersectObjects(near, false).length === 0;
      }),
    );
  }

  /** Returns the meshes of objects whose boxes meet the swept one. */
  private near(): Object3D[] {
    const out: Object3D[] = [];
    this.culler.parts.details.forEach((object, id) => {
      if (!object || this.leaves.has(id)) return;
      let box = this.boxes.get(object);
      if (!box) {
        object.updateWorldMatrix(true, true);
        box = new Box3().setFromObject(object);
        this.boxes.set(object, box);
      }
      if (!box.intersectsBox(this.swept)) return;
      object.traverse((part) => {
        if (part instanceof Mesh) out.push(part);
      });
    });
    return out;
  }
}
