/** Decides which pieces of a packed world to fetch and which to free: what is needed first comes first. */
import type { PackedPlace, Piece } from './packed.js';
import { decodePiece } from './packed.js';
import type { Seen, World } from './world.js';

/** Options of a streamer. */
export interface StreamOptions {
  /** Most bytes of unpacked pieces in memory; a view that needs more is incomplete. 256 MB. */
  maxResident?: number;
  /** Most requests on their way. 4. */
  maxInFlight?: number;
  /** Most bytes of one request: pieces near each other come together. 256 kB. */
  maxRequest?: number;
  /** Most bytes between two pieces of one request that are not wanted themselves. 16 kB: the time of an answer brings more. */
  maxGap?: number;
  /** Distance on foot, in meters, within which what may be seen is fetched before it is in view; 0 for none. 12. */
  ahead?: number;
  /** Milliseconds a frame for unpacking, the most needed first; a quarter of slow frames, and one piece at least. 4. */
  unpackTime?: number;
}

/** What a streamer shows. */
export interface StreamCounts {
  /** Bytes of pieces in memory, unpacked. */
  resident: number;
  /** Pieces in memory. */
  residentPieces: number;
  /** Requests on their way, and their packed bytes. */
  inFlight: number;
  inFlightBytes: number;
  /** Pieces of cells in view, and those of them that are absent. */
  wanted: number;
  late: number;
  /** All bytes received, head included. */
  received: number;
}

/** Receives pieces and gives them up. */
export interface Receiver {
  add(piece: number, content: Piece): void;
  remove(piece: number): void;
}

const ABSENT = 0;
const ASKED = 1;
const ARRIVED = 2;
const RESIDENT = 3;

interface Request {
  pieces: number[];
  bytes: number;
  stop: AbortController;
}

/** Fetches pieces in the order in which they are needed, and frees those that are needed last. */
export class Streamer {
  readonly counts: StreamCounts;
  private readonly options: Required<StreamOptions>;
  private readonly state: Uint8Array;
  /** Rank of each piece in the last plan; the number of pieces if it is in none. */
  private readonly rank: Uint32Array;
  private order: number[] = [];
  private inView = 0;
  /** Number of pieces at the beginning of `order` that the eye's own cell needs. */
  private ownRoom = 0;
  private readonly requests = new Set<Request>();
  private arrived: { piece: number; packed: Uint8Array }[] = [];
  /** Packed bytes that have arrived and wait to be unpacked. */
  private waiting = 0;
  private plannedAt = -Infinity;
  private plannedCell = -2;
  /** Time before which nothing is asked for, after a failure. */
  private pauseUntil = 0;
  private pause = 0;
  private readonly aheadOf = new Map<number, number[]>();
  /** Pieces as they lie in the file, and the place of each in this list. */
  private readonly laid: number[];
  private readonly placeOf: Uint32Array;
  private before = 0;

  constructor(
    readonly place: PackedPlace,
    readonly world: World,
    readonly receiver: Receiver,
    options: StreamOptions = {},
  ) {
    this.options = {
      maxResident: options.maxResident ?? 256e6,
      maxInFlight: options.maxInFlight ?? 4,
      maxRequest: options.maxRequest ?? 256e3,
      maxGap: options.maxGap ?? 16e3,
      ahead: options.ahead ?? 12,
      unpackTime: options.unpackTime ?? 4,
    };
    const { pieces } = place.head;
    const n = pieces.length;
    this.laid = Array.from(pieces.keys()).sort((a, b) => pieces[a]![0] - pieces[b]![0] || a - b);
    this.placeOf = new Uint32Array(n);
    this.laid.forEach((piece, i) => (this.placeOf[piece] = i));
    this.state = new Uint8Array(n);
    this.rank = new Uint32Array(n).fill(n);
    const none = { resident: 0, residentPieces: 0, inFlight: 0, inFlightBytes: 0, wanted: 0, late: 0 };
    this.counts = { ...none, received: place.received };
  }

  /** Returns true if all pieces of a cell are in memory. */
  isComplete(cell: number): boolean {
    return (this.place.head.cells[cell] ?? []).every((piece) => this.state[piece] === RESIDENT);
  }

  /** Returns true if all pieces of the view are in memory. */
  get settled(): boolean {
    return this.counts.late === 0 && this.counts.wanted > 0;
  }

  /** Follows the view; call it every frame. `now` is in milliseconds. */
  update(seen: Seen, now: number): StreamCounts {
    if (now - this.plannedAt > 100 || seen.eyeCell !== this.plannedCell) {
      this.plannedAt = now;
      this.plannedCell = seen.eyeCell;
      this.plan(seen);
    }
    this.integrate(Math.max(this.options.unpackTime, (now - this.before) / 4));
    this.before = now;
    this.ask(now);
    const { counts } = this;
    counts.late = 0;
    for (let i = 0; i < this.inView; i++) if (this.state[this.order[i]!] !== RESIDENT) counts.late++;
    counts.wanted = this.inView;
    counts.received = this.place.received;
    return counts;
  }

  /** Orders pieces by need: the view by its share of the screen, then what may be seen soon. */
  private plan(seen: Seen): void {
    const { cells, pieces } = this.place.head;
    for (const piece of this.order) this.rank[piece] = pieces.length;
    const order: number[] = [];
    let bytes = 0;
    const want = (cell: number): void => {
      for (const piece of cells[cell] ?? []) {
        const size = pieces[piece]![2];
        if (this.rank[piece]! < pieces.length || bytes + size > this.options.maxResident) continue;
        this.rank[piece] = order.length;
        order.push(piece);
        bytes += size;
      }
    };
    const shares = Array.from({ length: seen.cellCount }, (_, i) => ({ cell: seen.cells[i]!, share: seen.shares[i]! }));
    shares.sort((a, b) => Number(b.cell === seen.eyeCell) - Number(a.cell === seen.eyeCell) || b.share - a.share);
    this.ownRoom = 0;
    for (const { cell } of shares) {
      want(cell);
      if (cell === seen.eyeCell) this.ownRoom = order.length;
    }
    this.inView = order.length;
    if (seen.eyeCell >= 0 && this.options.ahead > 0) for (const cell of this.soon(seen.eyeCell)) want(cell);
    this.order = order;
  }

  /** Lists cells that may be seen soon from a cell: those seen from cells near it, nearest first. */
  private soon(from: number): number[] {
    const known = this.aheadOf.get(from);
    if (known) return known;
    const out = new Set<number>();
    for (const cell of this.near(from)) {
      for (const seen of this.world.pvs(cell) ?? [cell]) out.add(seen);
    }
    const list = [...out];
    this.aheadOf.set(from, list);
    return list;
  }

  /** Lists cells by the least way on foot to them, in straight lines between the middles of openings. */
  private near(from: number): number[] {
    const { portals, cells } = this.world;
    const best = new Map<number, number>([[from, 0]]);
    const open: { cell: number; at: number[] | undefined; way: number }[] = [{ cell: from, at: undefined, way: 0 }];
    const out: number[] = [];
    while (open.length > 0) {
      open.sort((a, b) => b.way - a.way);
      const { cell, at, way } = open.pop()!;
      if (out.includes(cell)) continue;
      out.push(cell);
      for (const id of cells[cell]!.portals) {
        const portal = portals[id]!;
        if (portal.kind === 'window' || portal.kind === 'crack') continue;
        const middle = middleOf(portal.outline);
        const next = way + (at ? Math.hypot(...middle.map((v, k) => v - at[k]!)) : 0);
        const to = portal.cells[0] === cell ? portal.cells[1] : portal.cells[0];
        if (next > this.options.ahead || next >= (best.get(to) ?? Infinity)) continue;
        best.set(to, next);
        open.push({ cell: to, at: middle, way: next });
      }
    }
    return out;
  }

  /** Unpacks what has arrived, and makes room for it. */
  private integrate(most: number): void {
    const begin = performance.now();
    while (this.arrived.length > 0) {
      let first = 0;
      for (let i = 1; i < this.arrived.length; i++) {
        if (this.rank[this.arrived[i]!.piece]! < this.rank[this.arrived[first]!.piece]!) first = i;
      }
      const [{ piece, packed }] = this.arrived.splice(first, 1) as [{ piece: number; packed: Uint8Array }];
      this.waiting -= packed.length;
      this.state[piece] = ABSENT;
      const size = this.place.head.pieces[piece]![2];
      if (!this.makeRoom(size, this.rank[piece]!)) continue;
      this.receiver.add(piece, decodePiece(packed, size));
      this.state[piece] = RESIDENT;
      this.counts.resident += size;
      this.counts.residentPieces++;
      if (performance.now() - begin > most) break;
    }
  }

  /** Frees pieces that are needed later than `rank`, the last first; false if there is not enough room. */
  private makeRoom(size: number, rank: number): boolean {
    const { counts, options, state } = this;
    while (counts.resident + size > options.maxResident) {
      let worst = -1;
      for (let i = 0; i < state.length; i++) {
        if (state[i] === RESIDENT && (worst < 0 || this.rank[i]! > this.rank[worst]!)) worst = i;
      }
      if (worst < 0 || this.rank[worst]! <= rank) return false;
      this.receiver.remove(worst);
      state[worst] = ABSENT;
      counts.resident -= this.place.head.pieces[worst]![2];
      counts.residentPieces--;
    }
    return true;
  }

  private ask(now: number): void {
    const n = this.state.length;
    for (const request of this.requests) {
      if (request.pieces.every((piece) => this.rank[piece] === n)) request.stop.abort();
    }
    // What has come is put to use before more is asked for.
    if (now < this.pauseUntil || this.waiting > 16 * this.options.maxRequest) return;
    // What is on its way shares the link: the own room comes alone, then the view, then what may be seen soon. Where little is
    // on its way, the link would wait for the next request.
    let isWaiting = false;
    for (let i = 0; i < this.order.length; i++) {
      const isNext = i === this.ownRoom || i === this.inView;
      if (isWaiting && isNext && this.counts.inFlightBytes > this.options.maxGap) return;
      if (this.requests.size >= this.options.maxInFlight) return;
      const piece = this.order[i]!;
      if (this.state[piece] === ABSENT) this.request(piece);
      isWaiting ||= this.state[piece] === ASKED;
    }
  }

  /** Returns 0 for pieces of the own room, 1 for the rest of the view, 2 for what may be seen soon. */
  private tier(piece: number): number {
    const rank = this.rank[piece]!;
    return rank < this.ownRoom ? 0 : rank < this.inView ? 1 : 2;
  }

  /** Lists a piece and those near it that are wanted as soon, with what is wanted later between them. */
  private together(piece: number): number[] {
    const { laid, options, rank, state } = this;
    const { pieces } = this.place.head;
    // What is needed sooner does not wait for what is needed later.
    const tier = this.tier(piece);
    const isWanted = (i: number): boolean => state[i] === ABSENT && rank[i]! < state.length;
    let [first, last] = [this.placeOf[piece]!, this.placeOf[piece]!];
    let [begin, end] = [pieces[piece]![0], pieces[piece]![0] + pieces[piece]![1]];
    for (const step of [1, -1]) {
      for (let at = this.placeOf[piece]! + step; at >= 0 && at < laid.length; at += step) {
        const next = laid[at]!;
        const [from, to] = [pieces[next]![0], pieces[next]![0] + pieces[next]![1]];
        const isFar = step > 0 ? from - end > options.maxGap : begin - to > options.maxGap;
        const [low, high] = [Math.min(begin, from), Math.max(end, to)];
        if (isFar || high - low > options.maxRequest) break;
        if (!isWanted(next) || this.tier(next) > tier) continue;
        [begin, end] = [low, high];
        if (step > 0) last = at;
        else first = at;
      }
    }
    return laid.slice(first, last + 1).filter(isWanted);
  }

  /** Asks for a piece together with those near it. */
  private request(piece: number): void {
    const { pieces } = this.place.head;
    const own = this.together(piece);
    const bytes = own.reduce((sum, i) => sum + pieces[i]![1], 0);
    const request: Request = { pieces: own, bytes, stop: new AbortController() };
    for (const i of own) this.state[i] = ASKED;
    this.requests.add(request);
    this.count();
    const end = (): void => {
      this.requests.delete(request);
      this.count();
    };
    this.place.fetch(own, request.stop.signal).then(
      (parts) => {
        end();
        this.pause = 0;
        own.forEach((i, k) => {
          this.state[i] = ARRIVED;
          this.arrived.push({ piece: i, packed: parts[k]! });
          this.waiting += parts[k]!.length;
        });
      },
      () => {
        end();
        for (const i of own) this.state[i] = ABSENT;
        if (request.stop.signal.aborted) return;
        // A server that fails is asked again after a quarter of a second, then after twice the time, up to eight.
        this.pause = Math.min(8000, Math.max(250, 2 * this.pause));
        this.pauseUntil = performance.now() + this.pause;
      },
    );
  }

  private count(): void {
    this.counts.inFlight = this.requests.size;
    this.counts.inFlightBytes = 0;
    for (const request of this.requests) this.counts.inFlightBytes += request.bytes;
  }
}

function middleOf(outline: Float32Array): number[] {
  const sum = [0, 0, 0];
  for (let i = 0; i < outline.length; i++) sum[i % 3]! += (outline[i]! * 3) / outline.length;
  return sum;
}
