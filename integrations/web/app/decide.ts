// What the person decides about rooms: entries of the settings' list `decisions`, and the buttons that make them.
import type { Baked, BakedOpening, CloseDecision } from '../src/bake.js';
import { make } from './page.js';
import { meters, text, type Key } from './texts.js';

/** A decision, as the settings file has it. */
export interface Decision {
  at: [number, number, number];
  is: 'one room' | 'two rooms' | 'a door';
}

/** Hears of a decision. */
export type Decide = (decision: Decision) => void;

const WORDS: Record<Decision['is'], Key> = { 'one room': 'oneRoom', 'two rooms': 'twoRooms', 'a door': 'aDoor' };

const rounded = (at: readonly number[]): Decision['at'] => at.map((value) => Math.round(value * 100) / 100) as Decision['at'];

function answer(at: readonly number[], is: Decision['is'], decide: Decide): HTMLButtonElement {
  const button = make('button', { type: 'button' }, text(WORDS[is]));
  button.dataset.decide = is;
  button.addEventListener('click', () => decide({ at: rounded(at), is }));
  return button;
}

/** Returns buttons for what a close decision of the bake may be instead, or is. */
export function answers({ position, is }: CloseDecision, decide: Decide): HTMLElement[] {
  return is === 'space' ? [] : (['one room', 'two rooms', 'a door'] as const).map((name) => answer(position, name, decide));
}

/** Returns the openings of a room, each with what else it may be. */
export function openingsOf(baked: Baked, cell: number, name: (cell: number) => string, decide: Decide): HTMLElement {
  const list = make('ul');
  const isPlace = (other: number): boolean => baked.rooms.some((room) => room.cell === other);
  for (const opening of baked.openings.filter((o) => o.cells.includes(cell))) {
    const other = opening.cells[opening.cells[0] === cell ? 1 : 0]!;
    const to = isPlace(other) ? name(other) : text('outdoors');
    list.append(make('li', {}, words(opening, to), ...choices(opening, isPlace(other), decide)));
  }
  return list;
}

function words({ kind, width, height }: BakedOpening, to: string): string {
  return `${text(kind)}: ${text('leads', { to, width: meters(width), height: meters(height) })} `;
}

function choices({ at, kind }: BakedOpening, isIndoors: boolean, decide: Decide): HTMLElement[] {
  const buttons = isIndoors ? [answer(at, 'one room', decide)] : [];
  return kind === 'door' ? buttons : [...buttons, answer(at, 'a door', decide)];
}

/** Returns the decisions so far, each with a button that takes it back. */
export function decided(all: Decision[], show: (at: Decision['at']) => void, takeBack: (index: number) => void): HTMLElement {
  const list = make('ul');
  all.forEach((decision, index) => {
    const place = make('button', { type: 'button' }, text('show'));
    place.addEventListener('click', () => show(decision.at));
    const back = make('button', { type: 'button' }, text('takeBack'));
    back.dataset.back = String(index);
    back.addEventListener('click', () => takeBack(index));
    list.append(make('li', {}, `${text(WORDS[decision.is])} `, place, ' ', back));
  });
  return list;
}

/** Returns a decision that parts a room at a point of its plan. [Units: m] */
export function partedAt(baked: Baked, cell: number, x: number, z: number): Decision | undefined {
  const room = baked.rooms.find((other) => other.cell === cell);
  if (!room) return undefined;
  const [low, high] = [room.aabb[0][1], room.aabb[1][1]];
  // As high as hands are, but in every room between floor and ceiling.
  return { at: rounded([x, Math.min(low + 1, (low + high) / 2), z]), is: 'two rooms' };
}
