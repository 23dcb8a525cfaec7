// The page: files in, rooms out. What happens in which order is in `start`.
import { BakeFailure, bake, loadBake, type BakeOptions, type Baked, type Question } from '../src/bake.js';
import { areOfCommand, dropped, listed, sorted, type Given } from './files.js';
import { fillDoubts, fillRooms, markRow, roomsOf, sentence } from './lists.js';
import { ModelView } from './model.js';
import { $, make, show } from './page.js';
import { PlanView, type Pointing } from './plan.js';
import { csvOf, save, tomlOf } from './save.js';
import { currentLanguage, meters, number, reason, speak, squareMeters, step, text, type Language } from './texts.js';

/** What the person gave. */
interface Job {
  files: Given[];
  name: string;
  settings: Record<string, string>;
  toml?: string;
}

let job: Job | undefined;
let baked: Baked | undefined;
let plan: PlanView | undefined;
let storey = '';
let chosen: number | undefined;
let hovered: number | undefined;
let ending: AbortController | undefined;
let failure: Error | undefined;

// All that is needed later is fetched now: the page then works without a network.
const module = loadBake(new URL('enfilade-bake.wasm', document.baseURI));
const fetched = async (name: string): Promise<Blob> => {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name}: ${answer.status} ${answer.statusText}`);
  return answer.blob();
};
const workerCode = fetched('bake-worker.js').then((code) => URL.createObjectURL(new Blob([code], { type: 'text/javascript' })));
const examples = new Map<string, Promise<Blob>>();
const example = (name: string): Promise<Blob> => {
  const known = examples.get(name) ?? fetched(`examples/${name}.glb`);
  examples.set(name, known);
  known.catch(() => examples.delete(name));
  return known;
};

const model = new ModelView($<HTMLCanvasElement>('canvas'));

const pointing: Pointing = {
  name: (cell) => {
    const name = baked?.rooms.find((room) => room.cell === cell)?.name ?? '';
    const n = /^cell-(\d+)$/.exec(name)?.[1];
    return n === undefined ? name : text('roomNumber', { n });
  },
  hover: (cell) => {
    if (cell === hovered) return;
    hovered = cell;
    mark();
  },
  choose: (cell) => {
    chosen = cell === chosen ? undefined : cell;
    const room = baked?.rooms.find((other) => other.cell === chosen);
    if (room && !room.storeys.includes(storey) && room.storeys[0]) showStorey(room.storeys[0]);
    mark();
  },
};
model.pointing = pointing;

function mark(): void {
  plan?.mark('hover', hovered);
  plan?.mark('chosen', chosen);
  model.mark(hovered, chosen);
  markRow('hover', hovered);
  markRow('chosen', chosen);
  const room = baked?.rooms.find((other) => other.cell === (hovered ?? chosen));
  $('told').textContent = room
    ? text('chosen', {
        name: pointing.name(room.cell),
        area: squareMeters(room.floorArea),
        height: meters(room.height),
        storey: room.storeys.join(', '),
      })
    : '';
}

function showStorey(name: string): void {
  if (!baked || !plan) return;
  storey = name;
  for (const button of $('storeys').querySelectorAll<HTMLElement>('button')) {
    button.setAttribute('aria-pressed', String(button.dataset.storey === name));
  }
  plan.show(name);
  model.showStorey(baked, name, plan.rooms(name));
  mark();
}

/** Bakes: the model at once, then progress, then rooms or the reason why there are none. */
async function start(next: Job): Promise<void> {
  ending?.abort();
  const own = (ending = new AbortController());
  job = next;
  [baked, chosen, hovered, failure] = [undefined, undefined, undefined, undefined];
  plan?.close();
  plan = undefined;
  model.clear();
  $('name').textContent = next.name;
  show('work');
  const began = performance.now();
  const clock = setInterval(() => tellTime(began), 200);
  tellStep('reading', 0);
  tellTime(began);
  const glb = next.files.length === 1 && /\.glb$/i.test(next.name) ? next.files[0]!.bytes : undefined;
  const picture = glb ? glb.arrayBuffer().then((bytes) => model.load(bytes)) : Promise.resolve(false);
  picture.then((isShown) => isShown && !own.signal.aborted && !baked && !failure && show('work', 'model'), () => undefined);
  try {
    const code = await workerCode;
    const options: BakeOptions = {
      settings: next.settings,
      toml: next.toml,
      allowLeak: $<HTMLInputElement>('leaks').checked,
      signal: own.signal,
      wasm: await module,
      worker: () => new Worker(code),
      onProgress: ({ stage, index, count }) => tellStep(stage, (index + 0.5) / count),
    };
    const found = await bake(next.files, options);
    if (own.signal.aborted) return;
    await finish(found, (performance.now() - began) / 1000);
  } catch (why) {
    if (own.signal.aborted) return;
    fail(why as Error);
  } finally {
    clearInterval(clock);
  }
}

function tellStep(stage: string, share: number): void {
  $('step').textContent = step(stage);
  $<HTMLProgressElement>('bar').value = share;
}

const tellTime = (began: number): void => {
  $('time').textContent = text('seconds', { n: number((performance.now() - began) / 1000, 0) });
};

async function finish(found: Baked, seconds: number): Promise<void> {
  baked = found;
  $('title').dataset.seconds = String(seconds);
  show('done', 'plan', 'model', 'told', 'results');
  plan = new PlanView($('plan'), found, pointing);
  fillResults();
  showStorey(mainStorey(found));
  $('title').focus();
  // The world has all triangles of the model, whatever its format was.
  await model.load(found.world.slice().buffer);
  model.aimAt(roomsOf(found));
  showStorey(storey);
}

/** The storey with most of the floor. */
const mainStorey = (found: Baked): string => found.storeys.reduce((a, b) => (b.area > a.area ? b : a), found.storeys[0]!)?.name ?? '';

/** Fills in all that has words. */
function fillResults(): void {
  if (!baked || !job || !plan) return;
  const n = roomsOf(baked).length;
  $('title').textContent = `${job.name}: ${n === 1 ? text('roomFound') : text('roomsFound', { n })}`;
  const { trust } = baked.verdict;
  const why = { good: 'goodWhy', fair: 'fairWhy', low: 'lowWhy', none: 'noneWhy' } as const;
  const seconds = number(Number($('title').dataset.seconds), 1);
  const metrics = text('metrics', { seconds, triangles: number(baked.triangles, 0) });
  $('trust').replaceChildren(make('b', { className: trust }, text(trust)), `${text(why[trust])} `, make('span', { className: 'quiet' }, metrics));
  $('storeys').replaceChildren();
  for (const { name } of baked.storeys) {
    const button = make('button', { type: 'button' }, text('storey', { name }));
    button.dataset.storey = name;
    button.addEventListener('click', () => showStorey(name));
    $('storeys').append(button);
  }
  const colors = new Map<number, string>();
  for (const { name } of baked.storeys) for (const { cell, color } of plan.rooms(name)) colors.set(cell, color);
  fillRooms(baked, colors, pointing);
  fillDoubts(baked, showPlace);
  const questions = $('doubts');
  for (const question of baked.questions) questions.append(ask(question));
  fillDownloads(baked, job);
}

function showPlace([x, y, z]: [number, number, number]): void {
  const below = baked?.storeys.filter(({ floor, top }) => floor - 0.5 <= y && y <= top + 0.5);
  if (below?.length && !below.some(({ name }) => name === storey)) showStorey(below[0]!.name);
  plan?.ring(x, z);
  model.lookAt([x, y, z]);
  $('plan').scrollIntoView({ block: 'nearest' });
}

function fillDownloads(found: Baked, of: Job): void {
  const base = of.name.replace(/\.\w+( \+ \d+)?$/, '') || 'building';
  const entries = [
    ['world', () => save(`${base}-world.glb`, 'model/gltf-binary', found.world)],
    ['planSvg', () => save(`${base}-plan.svg`, 'image/svg+xml', found.plan)],
    ['csv', () => save(`${base}-rooms.csv`, 'text/csv', csvOf(roomsOf(found)))],
    ['settings', () => save('settings.toml', 'text/plain', tomlOf(of.settings, of.toml))],
  ] as const;
  $('downloads').replaceChildren(
    ...entries.map(([key, get]) => {
      const button = make('button', { type: 'button' }, text(key));
      button.dataset.save = key;
      button.addEventListener('click', get);
      return button;
    }),
  );
}

/** Makes the controls that answer a question of the bake, and bake again. */
function ask({ about, proposed }: Question): HTMLElement {
  const values = about === 'unit' ? ['mm', 'cm', 'm', 'in', 'ft'] : ['y', 'z'];
  const select = make('select', {}, ...values.map((value) => make('option', { value }, about === 'up' ? value.toUpperCase() : value)));
  if (proposed && !values.includes(proposed)) select.append(make('option', { value: proposed }, proposed));
  select.value = proposed ?? values[0]!;
  const button = make('button', { type: 'button' }, text('retry'));
  button.addEventListener('click', () => {
    if (!job) return;
    void start({ ...job, settings: { ...job.settings, [about]: select.value } });
  });
  return make('label', {}, text(about === 'unit' ? 'askUnit' : 'askUp'), select, button);
}

function fail(why: Error): void {
  failure = why;
  show('failed');
  const told = reason(why.message);
  $('why').replaceChildren(sentence(told.in === currentLanguage() ? told.said : why.message));
  const questions = why instanceof BakeFailure ? why.questions : [];
  const about = new Set<string>();
  const controls = questions.filter((question) => !about.has(question.about) && about.add(question.about)).map(ask);
  $('ask').replaceChildren(...controls);
}

function given(files: Given[]): void {
  const found = sorted(files);
  if (!found) {
    fail(new Error(text(areOfCommand(files) ? 'ifc' : 'noFiles')));
    return;
  }
  const settings = Object.fromEntries(
    (['unit', 'up'] as const).map((name) => [name, $<HTMLSelectElement>(name).value]).filter(([, value]) => value),
  ) as Record<string, string>;
  const begin = async (): Promise<void> => start({ files: found.scenes, name: found.name, settings, toml: await found.settings?.text() });
  void begin();
}

function again(): void {
  ending?.abort();
  model.clear();
  plan?.close();
  [plan, baked, failure] = [undefined, undefined, undefined];
  show('start');
  $('choose').focus();
}

function listen(): void {
  const input = $<HTMLInputElement>('files');
  $('choose').addEventListener('click', () => input.click());
  input.addEventListener('change', () => {
    if (input.files?.length) given(listed(input.files));
    input.value = '';
  });
  const drop = $('drop');
  addEventListener('dragover', (event) => {
    event.preventDefault();
    drop.classList.add('over');
  });
  addEventListener('dragleave', (event) => event.relatedTarget === null && drop.classList.remove('over'));
  addEventListener('drop', (event) => {
    event.preventDefault();
    drop.classList.remove('over');
    if (event.dataTransfer) void dropped(event.dataTransfer).then(given);
  });
  for (const button of document.querySelectorAll<HTMLElement>('[data-example]')) {
    button.addEventListener('click', () => {
      const name = button.dataset.example!;
      example(name).then(
        (bytes) => start({ files: [{ name: `${name}.glb`, bytes }], name: `${name}.glb`, settings: {} }),
        fail,
      );
    });
  }
  $('cancel').addEventListener('click', again);
  for (const button of document.querySelectorAll('[data-again]')) button.addEventListener('click', again);
  $<HTMLInputElement>('whole').addEventListener('change', (event) => model.showWhole((event.target as HTMLInputElement).checked));
  for (const button of document.querySelectorAll<HTMLElement>('[data-language]')) {
    button.addEventListener('click', () => {
      speak(button.dataset.language as Language);
      fillResults();
      if (baked) showStorey(storey);
      if (failure) fail(failure);
    });
  }
}

speak(currentLanguage());
listen();
module.catch(fail);
module.then(() => {
  for (const name of ['house', 'tower', 'office']) example(name).catch(() => undefined);
  document.documentElement.dataset.ready = 'true';
}, () => undefined);
