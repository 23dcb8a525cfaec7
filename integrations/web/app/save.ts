// What can be taken along.
import type { BakedRoom } from '../src/bake.js';
import type { Decision } from './decide.js';

/** Lets the person save bytes or text. */
export function save(name: string, type: string, content: BlobPart): void {
  const address = URL.createObjectURL(new Blob([content], { type }));
  const link = Object.assign(document.createElement('a'), { href: address, download: name });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 10_000);
}

/** Returns the rooms as a table in text; the first line has the names of columns. */
export function csvOf(rooms: BakedRoom[]): string {
  const quoted = (value: string): string => {
    // A table must not take a name for a formula.
    const safe = /^[=+\-@\t\r]/.test(value) ? `'${value}` : value;
    return /[",\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  const lines = rooms.map((room) => {
    const { cell, name, kind, storeys, floorArea, height, volume, doors, windows } = room;
    const numbers = [floorArea, height, volume].map((value) => value.toFixed(2));
    return [cell, quoted(name), kind, quoted(storeys.join(' ')), ...numbers, doors, windows].join(',');
  });
  return ['cell,name,kind,storeys,floor_area_m2,height_m,volume_m3,doors,windows', ...lines, ''].join('\r\n');
}

/** Returns settings as the command's settings file: those of a file `before`, with the page's own in their place. */
export function tomlOf(settings: Record<string, unknown>, before = ''): string {
  const { decisions, ...values } = settings as { decisions?: Decision[] };
  const isOwn = (line: string): boolean => Object.keys(values).some((name) => line.startsWith(`${name} =`));
  const lines = Object.entries(values).map(([name, value]) => `${name} = ${JSON.stringify(value)}`);
  const kept = before.split('\n').filter((line) => !isOwn(line) && line !== HEAD);
  const own = decisions?.map(({ at, is }) => `\n[[decisions]]\nat = ${JSON.stringify(at)}\nis = ${JSON.stringify(is)}\n`) ?? [];
  return `${[HEAD, ...lines, ...kept].join('\n').trimEnd()}\n${own.join('')}`;
}

const HEAD = '# Settings of enfilade bake: enfilade bake FILE --config settings.toml -o world.glb';
