// The page: files in, rooms out. What happens in which order is in `start`.
import { BakeFailure, bake, loadBake, possibleThreads, type BakeOptions, type Baked, type Question } from '../src/bake.js';
import { answers, decided, openingsOf, partedAt, type Decision } from './decide.js';
import { readIfc } from './ifc.js';
import { arePacked, dropped, listed, sorted, type Given } from './files.js';
import { Left } from './left.js';
import { fillDoubts, fillRooms, markRow, roomsOf, sentence } from './lists.js';
import { ModelView } from './model.js';
import { $, make, pause, show } from './page.js';
import { PlanView, type Pointing } from './plan.js';
import { csvOf, save, tomlOf } from './save.js';
import { Reserve } from './threads.js';
import { Walk } from './walking.js';
import { currentLanguage, meters, number, reason, speak, squareMeters, step, text, type Language } from './texts.js';

/** What the person gave. */
interface Job {
  files: Given[];
  name: string;
  settings: Record<string, string>;
  decisions: Decision[];
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
let isParting = false;
let warming: AbortController | undefined;

// All that is needed later is fetched now: the page then works without a network.
const moduleNamed = (name: string): Promise<WebAssembly.Module> => loadBake(new URL(name, document.baseURI));
const alone = (): Promise<WebAssembly.Module> => moduleNamed('enfilade-bake.wasm');
// A page without the module with threads does not ask for it.
const hasThreads = possibleThreads() > 1 && document.documentElement.dataset.threads === 'true';
const module = hasThreads ? moduleNamed('enfilade-bake-threads.wasm').catch(alone) : alone();
const fetched = async (name: string): Promise<Blob> => {
  const answer = await fetch(name);
  if (!answer.ok) throw new Error(`${name}: ${answer.status} ${answer.statusText}`);
  return answer.blob();
};
const script = (name: string): Promise<string> =>
  fetched(name).then((code) => URL.createObjectURL(new Blob([code], { type: 'text/javascript' })));
// With threads, one more waits for the others.
const nThreads = hasThreads ? possibleThreads() + 1 : 1;
const threads = script('bake-worker.js').then((code) => new Reserve(code, nThreads));
let walk: Walk | undefined;
const examples = new Map<string, Promise<Blob>>();
const example = (name: string): Promise<Blob> => {
  const known = examples.get(name) ?? fetched(`examples/${name}.glb`);
  examples.set(name, known);
  known.catch(() => examples.delete(name));
  return known;
};

const model = new ModelView($<HTMLCanvasElement>('canvas'));
const drawing = script('model-worker.js').then((code) => model.start(code));

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
  choose: (cell, at) => {
    const decision = isParting && baked && cell !== undefined && at ? partedAt(baked, cell, at[0], at[1]) : undefined;
    if (decision) {
      add(decision);
      return;
    }
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
  fillChosen();
  $('told').textContent = room
    ? text('chosen', {
        name: pointing.name(room.cell),
        area: squareMeters(room.floorArea),
        height: meters(room.height),
        storey: room.storeys.join(', '),
      })
    : '';
}

/** Bakes again with other decisions; a room that is there then stays chosen. */
function decide(decisions: Decision[]): void {
  if (job) void start({ ...job, decisions });
}

const add = (decision: Decision): void => decide([...(job?.decisions ?? []), decision]);

/** Fills in what the chosen room can become. */
function fillChosen(): void {
  const place = $('chosen');
  const isShown = baked !== undefined && chosen !== undefined;
  place.hidden = !isShown;
  if (!isShown || place.dataset.cell === String(chosen)) return;
  place.dataset.cell = String(chosen);
  isParting = false;
  const part = make('button', { type: 'button', id: 'part' }, text('part'));
  part.addEventListener('click', () => {
    isParting = !isParting;
    part.setAttribute('aria-pressed', String(isParting));
    $('told').textContent = isParting ? text('partHint') : '';
    if (isParting) $('plan').scrollIntoView({ block: 'center' });
  });
  const head = make('h2', {}, text('openings', { name: pointing.name(chosen!) }));
  place.replaceChildren(head, openingsOf(baked!, chosen!, pointing.name, add), part);
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
  warming?.abort();
  const own = (ending = new AbortController());
  job = next;
  [baked, chosen, hovered, failure] = [undefined, undefined, undefined, undefined];
  plan?.close();
  plan = undefined;
  model.clear();
  $('name').textContent = next.name;
  show('work');
  const began = performance.now();
  const left = new Left();
  const clock = setInterval(() => tellTime(began, left), 200);
  tellStep('reading', 0);
  tellTime(began, left);
  const glb = next.files.length === 1 && /\.glb$/i.test(next.name) ? next.files[0]!.bytes : undefined;
  if (glb) model.load(glb, () => !own.signal.aborted && !baked && !failure && show('work', 'model')).catch(() => undefined);
  try {
    const reserve = await threads;
    const options: BakeOptions = {
      settings: { ...next.settings, decisions: next.decisions },
      toml: next.toml,
      allowLeak: $<HTMLInputElement>('leaks').checked,
      signal: own.signal,
      wasm: await module,
      worker: () => reserve.take(),
      wasmAll: new URL('enfilade-bake-all.wasm', document.baseURI),
      ifc: readIfc(script, fetched),
      onProgress: ({ stage, index, count }) => {
        left.begin(stage);
        tellStep(stage, (index + 0.5) / count);
      },
    };
    const found = await bake(next.files, options);
    if (own.signal.aborted) return;
    await finish(found, (performance.now() - began) / 1000);
  } catch (why) {
    if (own.signal.aborted) return;
    fail(why as Error);
  } finally {
    clearInterval(clock);
    void threads.then((reserve) => reserve.fill());
  }
}

/** Bakes an example while nobody waits: browsers make the code fast that has been used, for all threads that use it later. */
async function warm(): Promise<void> {
  const [bytes, wasm, reserve] = await Promise.all([example('house'), module, threads]);
  if (job) return;
  warming = new AbortController();
  const options = { wasm, worker: () => reserve.take(), signal: warming.signal };
  await bake([{ name: 'house.glb', bytes }], options).catch(() => undefined);
  document.documentElement.dataset.warm = 'true';
  reserve.fill();
}

function tellStep(stage: string, share: number): void {
  $('step').textContent = step(stage);
  $<HTMLProgressElement>('bar').value = share;
}

const tellTime = (began: number, left: Left): void => {
  const more = left.seconds();
  const n = number((performance.now() - began) / 1000, 0);
  $('time').textContent = more === undefined ? text('seconds', { n }) : text('secondsLeft', { n, left: number(Math.ceil(more), 0) });
};

async function finish(found: Baked, seconds: number): Promise<void> {
  baked = found;
  $('title').dataset.seconds = String(seconds);
  // Who decides about one storey goes on there.
  const isKept = job?.decisions.length && found.storeys.some(({ name }) => name === storey);
  // Each step is a task of its own: the page answers between them.
  const steps = [
    () => (plan = new PlanView($('plan'), found, pointing)),
    ...results,
    () => show('done', 'plan', 'model', 'told', 'results'),
    () => showStorey(isKept ? storey : mainStorey(found)),
    () => $('title').focus(),
  ];
  for (const step of steps) {
    await pause();
    if (baked !== found) return;
    step();
  }
  // The world has all triangles of the model, whatever its format was.
  await model.load(new Blob([found.world]));
  model.aimAt(roomsOf(found));
  showStorey(storey);
}

/** The storey with most of the floor. */
const mainStorey = (found: Baked): string => found.storeys.reduce((a, b) => (b.area > a.area ? b : a), found.storeys[0]!)?.name ?? '';

/** Fills in all that has words. */
function fillResults(): void {
  for (const step of results) step();
}

/** The steps that fill in all that has words. */
const results = [fillHead, fillTable, fillRest];

function fillHead(): void {
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
}

function fillTable(): void {
  if (!baked || !plan) return;
  const colors = new Map<number, string>();
  for (const { name } of baked.storeys) for (const { cell, color } of plan.rooms(name)) colors.set(cell, color);
  fillRooms(baked, colors, pointing);
}

function fillRest(): void {
  if (!baked || !job) return;
  fillDoubts(baked, showPlace, (close) => answers(close, add));
  const questions = $('doubts');
  for (const question of baked.questions) questions.append(ask(question));
  const { decisions } = job;
  $('decisions').hidden = decisions.length === 0;
  $('decisions').replaceChildren(
    make('h2', {}, text('decisions')),
    decided(decisions, showPlace, (index) => decide(decisions.filter((_, i) => i !== index))),
  );
  delete $('chosen').dataset.cell;
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
    ['report', () => print()],
    ['settings', () => save('settings.toml', 'text/plain', tomlOf({ ...of.settings, decisions: of.decisions }, of.toml))],
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

/** Draws the plans of all storeys, which only paper shows. */
function fillSheets(): void {
  for (const { name } of baked?.storeys ?? []) {
    const sheet = make('div', {});
    $('sheets').append(make('h2', {}, text('storey', { name })), sheet);
    plan?.draw(name, sheet);
  }
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
    fail(new Error(text(arePacked(files) ? 'packed' : 'noFiles')));
    return;
  }
  const settings = Object.fromEntries(
    (['unit', 'up'] as const).map((name) => [name, $<HTMLSelectElement>(name).value]).filter(([, value]) => value),
  ) as Record<string, string>;
  const begin = async (): Promise<void> => start({ files: found.scenes, name: found.name, settings, decisions: [], toml: await found.settings?.text() });
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
        (bytes) => start({ files: [{ name: `${name}.glb`, bytes }], name: `${name}.glb`, settings: {}, decisions: [] }),
        fail,
      );
    });
  }
  addEventListener('beforeprint', fillSheets);
  addEventListener('afterprint', () => $('sheets').replaceChildren());
  $('cancel').addEventListener('click', again);
  $('walk').addEventListener('click', () => baked && job && void (walk ??= new Walk(fetched)).open(baked.world, job.name));
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
Promise.all([module, drawing, threads]).then(() => {
  for (const name of ['house', 'tower', 'office']) example(name).catch(() => undefined);
  walk ??= new Walk(fetched);
  setTimeout(() => void warm(), 500);
  document.documentElement.dataset.ready = 'true';
}, () => undefined);
