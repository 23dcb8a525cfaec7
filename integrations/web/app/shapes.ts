// Outlines of rooms, from the plan.
import { Path, Shape, Vector2 } from 'three';

/** Drawing units of a plan in a meter. */
export const PLAN_SCALE = 100;

/** Returns the outlines of a path's data, in meters. */
export function outlines(data: string): Vector2[][] {
  return data
    .split('M')
    .slice(1)
    .map((line) =>
      line
        .replace('Z', '')
        .split('L')
        .map((point) => {
          const [x, y] = point.trim().split(/[ ,]+/).map(Number);
          return new Vector2(x! / PLAN_SCALE, y! / PLAN_SCALE);
        }),
    )
    .filter((line) => line.length > 2);
}

function isInside(point: Vector2, line: Vector2[]): boolean {
  let inside = false;
  for (let i = 0, j = line.length - 1; i < line.length; j = i++) {
    const [a, b] = [line[i]!, line[j]!];
    if (a.y > point.y !== b.y > point.y && point.x < ((b.x - a.x) * (point.y - a.y)) / (b.y - a.y) + a.x) inside = !inside;
  }
  return inside;
}

/** Returns shapes with holes: a point inside an odd number of outlines is inside. */
export function shapesOf(data: string): Shape[] {
  const lines = outlines(data);
  const middle = (line: Vector2[]): Vector2 => line[0]!.clone().lerp(line[1]!, 0.5);
  const around = lines.map((line, i) => lines.map((other, k) => (k !== i && isInside(middle(line), other) ? k : -1)).filter((k) => k >= 0));
  const shapes = new Map<number, Shape>();
  lines.forEach((line, i) => {
    if (around[i]!.length % 2 === 0) shapes.set(i, new Shape(line));
  });
  lines.forEach((line, i) => {
    if (around[i]!.length % 2 === 0) return;
    // The innermost of those around it.
    const owner = around[i]!.reduce((best, k) => (around[k]!.length > around[best]!.length ? k : best));
    shapes.get(owner)?.holes.push(new Path(line));
  });
  return [...shapes.values()];
}
