// The table of rooms, and what is in doubt.
import type { Baked, BakedRoom, CloseDecision } from '../src/bake.js';
import { $, make } from './page.js';
import type { Pointing } from './plan.js';
import { meters, number, reason, squareMeters, text } from './texts.js';

/** Returns the rooms, those of lower storeys first. */
export function roomsOf(baked: Baked): BakedRoom[] {
  const rank = (room: BakedRoom): number => baked.storeys.findIndex(({ name }) => name === room.storeys[0]);
  return baked.rooms.filter((room) => room.kind === 'room').sort((a, b) => rank(a) - rank(b) || b.floorArea - a.floorArea);
}

/** Fills the table of rooms. */
export function fillRooms(baked: Baked, colors: Map<number, string>, pointing: Pointing): void {
  const table = $<HTMLTableElement>('rooms');
  const head = make('tr');
  const heads = [['room', ''], ['storeyHead', ''], ['area', ''], ['height', ''], ['doors', 'wide'], ['windows', 'wide']] as const;
  for (const [key, className] of heads) head.append(make('th', { scope: 'col', className }, text(key)));
  const body = make('tbody');
  const rooms = roomsOf(baked);
  for (const room of rooms) {
    const swatch = make('span', { className: 'swatch' });
    swatch.style.background = colors.get(room.cell) ?? 'transparent';
    const button = make('button', { type: 'button' }, pointing.name(room.cell));
    const row = make('tr', {}, make('td', {}, swatch, button));
    row.dataset.cell = String(room.cell);
    for (const value of [room.storeys.join(', '), squareMeters(room.floorArea), meters(room.height)]) row.append(make('td', {}, value));
    for (const value of [room.doors, room.windows]) row.append(make('td', { className: 'wide' }, String(value)));
    row.addEventListener('mouseenter', () => pointing.hover(room.cell));
    row.addEventListener('mouseleave', () => pointing.hover(undefined));
    button.addEventListener('click', () => pointing.choose(room.cell));
    body.append(row);
  }
  const area = rooms.reduce((sum, room) => sum + room.floorArea, 0);
  const foot = make('tr', {}, make('td', {}, text('sum')), make('td'), make('td', {}, squareMeters(area)), make('td'));
  foot.append(make('td', { className: 'wide' }), make('td', { className: 'wide' }));
  table.replaceChildren(make('thead', {}, head), body, make('tfoot', {}, foot));
}

/** Marks a row. */
export function markRow(kind: 'hover' | 'chosen', cell: number | undefined): void {
  for (const row of $('rooms').querySelectorAll<HTMLElement>('tbody tr')) {
    const isIt = cell !== undefined && row.dataset.cell === String(cell);
    row.classList.toggle(kind, isIt);
    if (kind === 'chosen' && isIt) row.scrollIntoView({ block: 'nearest' });
  }
}

/** Returns a sentence of the bake. */
export function sentence(said: string): HTMLElement {
  const told = reason(said);
  return make('span', { lang: told.in }, told.said);
}

/** Fills in what is in doubt. */
export function fillDoubts(
  baked: Baked,
  show: (position: [number, number, number]) => void,
  answers: (close: CloseDecision) => HTMLElement[],
): void {
  const { reasons, close } = baked.verdict;
  const place = $('doubts');
  place.replaceChildren();
  const list = make('ul');
  for (const { text: said } of reasons) list.append(make('li', {}, sentence(said)));
  for (const said of baked.warnings) list.append(make('li', {}, sentence(said)));
  const voids = baked.rooms.filter((room) => room.kind === 'void').length;
  if (voids > 0) list.append(make('li', {}, text('voids', { n: voids })));
  place.append(list.childElementCount > 0 ? list : make('p', {}, text('noDoubt')));
  if (close.length === 0) return;
  const closest = make('ul');
  for (const decision of close) {
    const { position, chance, text: said } = decision;
    const button = make('button', { type: 'button' }, text('show'));
    button.addEventListener('click', () => show(position));
    const percent = number(100 * chance, 0);
    closest.append(make('li', {}, sentence(said), ` (${text('chance', { percent })}) `, button, ...answers(decision)));
  }
  place.append(make('p', {}, text('closest')), closest);
}
