// The plan of one storey, of which rooms can be pointed at.
import type { Baked } from '../src/bake.js';
import { PLAN_SCALE } from './shapes.js';

const SVG = 'http://www.w3.org/2000/svg';
/** Space around a plan. [Units: cm] */
const MARGIN = 60;

/** What a plan and a model tell of the pointer. */
export interface Pointing {
  hover(cell: number | undefined): void;
  /** Hears of a click, with x and z where it was, if that is known. [Units: m] */
  choose(cell: number | undefined, at?: [number, number]): void;
  name(cell: number): string;
}

/** The drawn plan. */
export class PlanView {
  private readonly whole: SVGSVGElement;
  private readonly isRoom: Set<number>;

  constructor(
    private readonly place: HTMLElement,
    baked: Baked,
    private readonly pointing: Pointing,
  ) {
    const read = new DOMParser().parseFromString(baked.plan, 'image/svg+xml');
    this.whole = document.importNode(read.documentElement, true) as unknown as SVGSVGElement;
    this.isRoom = new Set(baked.rooms.filter((room) => room.kind === 'room').map((room) => room.cell));
    const places = ['mouseover', 'mouseout', 'click', 'keydown', 'focusin'] as const;
    const signal = (this.ended = new AbortController()).signal;
    for (const name of places) place.addEventListener(name, (event) => this.hear(event), { signal });
  }

  private readonly ended: AbortController;

  /** Ends listening. */
  close(): void {
    this.ended.abort();
    this.place.replaceChildren();
  }

  /** Returns the paths of rooms of a storey with their colors. */
  rooms(storey: string): { cell: number; color: string; data: string }[] {
    const paths = this.whole.querySelectorAll(`g.storey[data-storey="${CSS.escape(storey)}"] > .cell[data-cell]`);
    return [...paths].map((path) => ({
      cell: Number((path as SVGElement).dataset.cell),
      color: path.getAttribute('fill') ?? '#cccccc',
      data: path.getAttribute('d') ?? '',
    }));
  }

  /** Shows a storey. */
  show(storey: string): void {
    this.draw(storey, this.place);
  }

  /** Draws a storey as all of a place, which is part of the page: only then has a drawing a size. */
  draw(storey: string, place: HTMLElement): void {
    const svg = document.createElementNS(SVG, 'svg');
    const style = this.whole.querySelector('style');
    const group = this.whole.querySelector(`g.storey[data-storey="${CSS.escape(storey)}"]`)?.cloneNode(true) as SVGGElement | undefined;
    if (style) svg.append(style.cloneNode(true));
    if (!group) return;
    group.removeAttribute('transform');
    // The title of the plan, which the page has above it.
    for (const words of group.querySelectorAll('text:not([data-cell])')) words.remove();
    for (const words of group.querySelectorAll<SVGTextElement>('text[data-cell]')) {
      const said = words.textContent ?? '';
      if (/^cell-\d+$/.test(said)) words.textContent = this.pointing.name(Number(words.dataset.cell));
    }
    for (const path of group.querySelectorAll<SVGPathElement>('.cell[data-cell]')) {
      const cell = Number(path.dataset.cell);
      if (!this.isRoom.has(cell)) continue;
      path.setAttribute('tabindex', '0');
      path.setAttribute('role', 'button');
      path.setAttribute('aria-label', this.pointing.name(cell));
    }
    svg.setAttribute('font-family', 'sans-serif');
    svg.append(group);
    place.replaceChildren(svg);
    const { x, y, width, height } = group.getBBox();
    svg.setAttribute('viewBox', [x - MARGIN, y - MARGIN, width + 2 * MARGIN, height + 2 * MARGIN].join(' '));
  }

  /** Marks rooms. */
  mark(kind: 'hover' | 'chosen', cell: number | undefined): void {
    for (const path of this.place.querySelectorAll<SVGElement>('.cell[data-cell]')) {
      path.classList.toggle(kind, cell !== undefined && path.dataset.cell === String(cell));
    }
  }

  /** Draws a ring around a point of the world. */
  ring(x: number, z: number): void {
    this.place.querySelector('.mark')?.remove();
    const ring = document.createElementNS(SVG, 'circle');
    ring.setAttribute('class', 'mark');
    ring.setAttribute('cx', String(x * PLAN_SCALE));
    ring.setAttribute('cy', String(z * PLAN_SCALE));
    ring.setAttribute('r', '45');
    this.place.querySelector('svg g')?.append(ring);
  }

  private placeOf({ clientX, clientY }: MouseEvent): [number, number] | undefined {
    const group = this.place.querySelector<SVGGElement>('svg g.storey');
    const point = group?.getScreenCTM() && new DOMPoint(clientX, clientY).matrixTransform(group.getScreenCTM()!.inverse());
    return point ? [point.x / PLAN_SCALE, point.y / PLAN_SCALE] : undefined;
  }

  private hear(event: Event): void {
    const path = (event.target as Element).closest?.<SVGElement>('.cell[data-cell]');
    const cell = path && this.isRoom.has(Number(path.dataset.cell)) ? Number(path.dataset.cell) : undefined;
    if (event.type === 'mouseover' || event.type === 'focusin') this.pointing.hover(cell);
    else if (event.type === 'mouseout') this.pointing.hover(undefined);
    else if (event.type === 'click') this.pointing.choose(cell, this.placeOf(event as MouseEvent));
    else if (cell !== undefined && ['Enter', ' '].includes((event as KeyboardEvent).key)) {
      event.preventDefault();
      this.pointing.choose(cell);
    }
  }
}
