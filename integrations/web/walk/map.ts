// The map: rooms at the height of the eye, doorways, what is visible, and where one is.
import type { World } from '../src/world.js';

const SIDE = 200;

/** Draws the storey around a height as the locator has it. */
export class RoomMap {
  private readonly context: CanvasRenderingContext2D;
  private readonly low: [number, number];
  private readonly scale: number;
  private readonly ids = new Int32Array(SIDE * SIDE);
  private height = NaN;

  constructor(
    canvas: HTMLCanvasElement,
    private readonly world: World,
  ) {
    canvas.width = SIDE;
    canvas.height = SIDE;
    this.context = canvas.getContext('2d')!;
    const rooms = world.cells.filter((cell) => cell.kind !== 'outdoors');
    const all = rooms.length > 0 ? rooms : world.cells;
    const [x0, z0] = [0, 2].map((k) => Math.min(...all.map((c) => c.aabb[k]!)) - 1) as [number, number];
    const [x1, z1] = [3, 5].map((k) => Math.max(...all.map((c) => c.aabb[k]!)) + 1) as [number, number];
    this.scale = SIDE / Math.max(x1 - x0, z1 - z0);
    const margin = SIDE / this.scale;
    this.low = [(x0 + x1 - margin) / 2, (z0 + z1 - margin) / 2];
  }

  private locateAll(y: number): void {
    this.height = y;
    for (let i = 0; i < SIDE * SIDE; i++) {
      const x = this.low[0] + ((i % SIDE) + 0.5) / this.scale;
      const z = this.low[1] + (Math.floor(i / SIDE) + 0.5) / this.scale;
      this.ids[i] = this.world.locate([x, y, z]);
    }
  }

  /** Draws the map for an eye that looks along `yaw`. `visible` are cells in view, `ready` those that are there. */
  draw(eye: number[], yaw: number, visible: Set<number>, ready: (cell: number) => boolean): void {
    if (!(Math.abs(eye[1]! - this.height) < 0.6)) this.locateAll(eye[1]!);
    const { context, world } = this;
    const own = world.locate(eye);
    const picture = context.createImageData(SIDE, SIDE);
    const pixels = new Uint32Array(picture.data.buffer);
    const shade = world.cells.map((cell) => {
      if (cell.kind === 'outdoors') return visible.has(cell.id) ? 0xfff4f0e8 : 0xffffffff;
      if (cell.id === own) return 0xff5fb0ff;
      if (visible.has(cell.id)) return 0xffa8d8ff;
      return ready(cell.id) ? 0xffd6d2ce : 0xfff0eeec;
    });
    for (let i = 0; i < pixels.length; i++) pixels[i] = this.ids[i]! < 0 ? 0xff706860 : shade[this.ids[i]!]!;
    context.putImageData(picture, 0, 0);
    this.drawPortals();
    this.drawEye(eye, yaw);
  }

  private at(x: number, z: number): [number, number] {
    return [(x - this.low[0]) * this.scale, (z - this.low[1]) * this.scale];
  }

  private drawPortals(): void {
    const { context, world } = this;
    context.lineWidth = 1.5;
    for (const portal of world.portals) {
      const { outline } = portal;
      let [low, high, a, b] = [Infinity, -Infinity, 0, 0];
      for (let i = 0; i < outline.length; i += 3) {
        low = Math.min(low, outline[i + 1]!);
        high = Math.max(high, outline[i + 1]!);
        const along = (k: number): number => outline[k]! * portal.normal[2]! - outline[k + 2]! * portal.normal[0]!;
        if (along(i) < along(a)) a = i;
        if (along(i) > along(b)) b = i;
      }
      if (low > this.height || high < this.height - 1.2) continue;
      const door = world.isOpen(portal.id) ? '#2a8f3c' : '#c22';
      context.strokeStyle = portal.kind === 'window' ? '#3a7bd5' : door;
      context.beginPath();
      context.moveTo(...this.at(outline[a]!, outline[a + 2]!));
      context.lineTo(...this.at(outline[b]!, outline[b + 2]!));
      context.stroke();
    }
  }

  private drawEye(eye: number[], yaw: number): void {
    const { context } = this;
    const [x, y] = this.at(eye[0]!, eye[2]!);
    context.fillStyle = '#d22';
    context.beginPath();
    // Yaw 0 looks along -z, which is upwards on the map.
    const toward = -yaw - Math.PI / 2;
    context.moveTo(x + 9 * Math.cos(toward), y + 9 * Math.sin(toward));
    context.arc(x, y, 4, toward + 0.9, toward - 0.9);
    context.fill();
  }
}
