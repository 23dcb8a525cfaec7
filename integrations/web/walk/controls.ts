// Keyboard, mouse and touch as a direction of view and a motion.

/** Speed of walking, in meters a second. */
const SPEED = 1.8;

/** Follows the input of one element. */
export class Controls {
  yaw = 0;
  pitch = 0;
  readonly isTouch = matchMedia('(pointer: coarse)').matches;
  onKey: (code: string) => void = () => undefined;
  /** Called with a place of the screen, -1 to 1, upwards. */
  onTap: (x: number, y: number) => void = () => undefined;
  private readonly down = new Set<string>();
  private readonly touches = new Map<number, { x: number; y: number; dx: number; dy: number; since: number; walks: boolean }>();

  constructor(private readonly element: HTMLElement) {
    addEventListener('keydown', (event) => {
      if (!event.repeat) this.onKey(event.code);
      this.down.add(event.code);
    });
    addEventListener('keyup', (event) => this.down.delete(event.code));
    addEventListener('blur', () => this.down.clear());
    element.addEventListener('click', () => {
      if (this.isTouch) return;
      if (document.pointerLockElement === element) this.onTap(0, 0);
      else void element.requestPointerLock();
    });
    addEventListener('mousemove', (event) => {
      if (document.pointerLockElement === element) this.look(event.movementX, event.movementY, 0.0023);
    });
    element.addEventListener('pointerdown', (event) => this.begin(event));
    element.addEventListener('pointermove', (event) => this.drag(event));
    element.addEventListener('pointerup', (event) => this.end(event));
    element.addEventListener('pointercancel', (event) => this.touches.delete(event.pointerId));
  }

  private look(dx: number, dy: number, pace: number): void {
    this.yaw -= dx * pace;
    this.pitch = Math.max(-1.5, Math.min(1.5, this.pitch - dy * pace));
  }

  private begin(event: PointerEvent): void {
    if (event.pointerType === 'mouse') return;
    const walks = event.clientX < innerWidth / 2;
    const { clientX: x, clientY: y } = event;
    this.touches.set(event.pointerId, { x, y, dx: 0, dy: 0, since: event.timeStamp, walks });
  }

  private drag(event: PointerEvent): void {
    const touch = this.touches.get(event.pointerId);
    if (!touch) return;
    if (touch.walks) {
      touch.dx = event.clientX - touch.x;
      touch.dy = event.clientY - touch.y;
      return;
    }
    const [dx, dy] = [event.clientX - touch.x - touch.dx, event.clientY - touch.y - touch.dy];
    touch.dx += dx;
    touch.dy += dy;
    this.look(dx, dy, 0.005);
  }

  private end(event: PointerEvent): void {
    const touch = this.touches.get(event.pointerId);
    this.touches.delete(event.pointerId);
    if (!touch || Math.hypot(touch.dx, touch.dy) > 12 || event.timeStamp - touch.since > 400) return;
    this.onTap((2 * event.clientX) / innerWidth - 1, 1 - (2 * event.clientY) / innerHeight);
  }

  /** Returns the motion of a time in the world's axes, in meters. */
  motion(seconds: number): [number, number, number] {
    const is = (...codes: string[]): number => (codes.some((code) => this.down.has(code)) ? 1 : 0);
    let ahead = is('KeyW', 'ArrowUp') - is('KeyS', 'ArrowDown');
    let right = is('KeyD') - is('KeyA');
    const up = is('Space', 'KeyR') - is('KeyV');
    this.yaw += (is('ArrowLeft') - is('ArrowRight')) * 1.8 * seconds;
    for (const touch of this.touches.values()) {
      if (!touch.walks) continue;
      ahead -= touch.dy / 60;
      right += touch.dx / 60;
    }
    const length = Math.max(1, Math.hypot(ahead, right));
    const way = ((SPEED * (1 + is('ShiftLeft', 'ShiftRight'))) / length) * seconds;
    const [sin, cos] = [Math.sin(this.yaw), Math.cos(this.yaw)];
    return [way * (right * cos - ahead * sin), up * SPEED * seconds, way * (-ahead * cos - right * sin)];
  }
}
