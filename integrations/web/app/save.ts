// What can be taken along.
import type { BakedRoom } from '../src/bake.js';

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

/** Returns settings as the command's settings file. */
export function tomlOf(settings: Record<string, unknown>, before = ''): string {
  const lines = Object.entries(settings).map(([name, value]) => `${name} = ${JSON.stringify(value)}`);
  return `# Settings of enfilade bake: enfilade bake FILE --config settings.toml -o world.glb\n${lines.join('\n')}\n${before}`;
}
