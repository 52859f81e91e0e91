// What the page knows of the job. At first it asks for one letter per pair and iteration and for the last iteration's results; after that
// it follows the events, and asks only for the pairs that they name.
import { refresh, connected } from "../live";
import { follow, get, said } from "../common/api";
import type { Event, EventList, HeldWork, IterationStates, JobWorkers, Obstacle, Obstacles, PairCell, PairInfo, PairMatrix, PairStates, SceneModel } from "../common/schema";
import type { Measure, Point } from "./curve";
import type { Unit } from "../common/units";

/** The robot as it is drawn, once it is there, or why it is not. */
export interface Drawable {
  model: SceneModel | null;
  problem: string | null;
}

const SYNC_MS = 500;
const SLOW_MS = 4000;
const AGAIN_MS = 5000;
/** No event tells that a worker has begun with a job that waited. */
const QUEUED_MS = 1000;
const EVENTS = 100;
const MOST_EVENTS = 2000;
/** So many iterations are asked for before anything is shown; those before them follow. */
const AT_FIRST = 8;
const AT_ONCE = 150;
const MOST_DETAILED = 8;

/** Returns a function that has `call` done after a while, once however often it is asked for. */
function soon(call: () => void, after: number): () => void {
  let timer: ReturnType<typeof setTimeout> | undefined;
  return () => {
    timer ??= setTimeout(() => {
      timer = undefined;
      call();
    }, after);
  };
}

export class JobStore {
  pairs: PairInfo[] = [];
  iterations: IterationStates[] = [];
  /** IterationStates -> pair -> its result, for the iterations that somebody has looked at. */
  readonly details = new Map<number, Map<number, PairCell>>();
  events: Event[] = [];
  /** What the job has reached over time. */
  reached: Point[] = [];
  workers: HeldWork[] = [];
  obstacles: Obstacle[] | null = null;
  loaded = false;
  problem: string | null = null;

  private readonly path: string;
  private readonly asked = new Set<number>();
  private changed = new Map<number, Set<number>>();
  private stop: () => void = () => {};
  private syncing = false;
  private readonly syncSoon = soon(() => void this.attempt(() => this.sync()), SYNC_MS);
  private readonly slowSoon = soon(() => void this.attempt(() => this.around()), SLOW_MS);
  private readonly headSoon = soon(() => void this.head(), SYNC_MS);
  private readonly told = soon(() => this.tell(), 16);

  constructor(
    readonly job: string,
    readonly measure: Measure,
    public ended: boolean,
    /** How many iterations had begun when the page was made. */
    private readonly begun: number,
    /** Of the scene's joint positions. */
    readonly units: Unit[],
    private readonly tell: () => void,
  ) {
    this.path = `/v1/jobs/${job}`;
  }

  async start(): Promise<void> {
    await this.attempt(async () => {
      // The events come first: what happens while the rest is asked for is seen twice, and nothing is missed.
      this.events = (await get<EventList>(`${this.path}/events?before=${2 ** 31 - 1}&limit=${EVENTS}`)).events;
      const last = Math.max(this.begun - 1, 0),
        first = Math.max(this.begun - AT_FIRST, 0);
      const [{ iterations }, { pairs, cells }] = await Promise.all([
        this.states(first),
        this.matrix(last),
      ]);
      this.iterations = iterations;
      this.pairs = pairs;
      this.keep(last, cells);
      this.loaded = true;
      this.told();
      if (!this.ended) this.listen();
      // The job may have gone on since the page was made.
      if (this.last) this.want(this.last.index);
      if (!this.ended) this.headSoon();
      await this.around();
      if (first > 0) this.iterations = [...(await this.states(0)).iterations.filter((one) => one.index < first), ...this.iterations];
    });
    if (this.loaded) return;
    const again = setTimeout(() => void this.start(), AGAIN_MS);
    this.stop = () => clearTimeout(again);
  }

  close(): void {
    this.stop();
  }

  get last(): IterationStates | undefined {
    return this.iterations.at(-1);
  }

  cell(iteration: number, pair: number): PairCell | undefined {
    return this.details.get(iteration)?.get(pair);
  }

  /** Asks for the results of an iteration, unless they are there. */
  want(iteration: number): void {
    if (this.details.has(iteration) || this.asked.has(iteration)) return;
    this.asked.add(iteration);
    void this.attempt(async () => {
      this.keep(iteration, (await this.matrix(iteration)).cells);
      this.asked.delete(iteration);
    });
  }

  async earlier(): Promise<void> {
    await this.attempt(async () => {
      const { events } = await get<EventList>(`${this.path}/events?before=${this.events[0]?.seq ?? 1}&limit=${EVENTS}`);
      this.events = [...events, ...this.events];
    });
  }

  private async states(since: number): Promise<PairStates> {
    return get<PairStates>(`${this.path}/pairs/states?since=${since}`);
  }

  private keep(iteration: number, cells: PairCell[]): void {
    this.details.set(iteration, new Map(cells.map((cell) => [cell.pair, cell])));
    for (const known of [...this.details.keys()]) {
      if (this.details.size > MOST_DETAILED && known !== this.last?.index && known !== iteration) this.details.delete(known);
    }
  }

  /** Follows the events. Between them a step may begin, and a worker come or go, so the rest is asked for again now and then. */
  private listen(): void {
    let again: ReturnType<typeof setTimeout>;
    const later = (): void => void (again = setTimeout(ask, document.querySelector(".title .badge.queued") ? QUEUED_MS : AGAIN_MS));
    const ask = (): void => {
      later();
      if (document.hidden) return;
      this.headSoon();
      void this.attempt(() => this.who());
    };
    later();
    const unfollow = follow(
      this.job,
      this.events.at(-1)?.seq ?? 0,
      (event) => this.take(event),
      connected,
      () => this.end(),
    );
    this.stop = () => {
      clearTimeout(again);
      unfollow();
    };
  }

  private end(): void {
    this.ended = true;
    this.stop();
    void this.head();
    this.syncSoon();
    void this.attempt(() => this.around());
  }

  private take(event: Event): void {
    this.events.push(event);
    if (this.events.length > MOST_EVENTS) this.events = this.events.slice(-MOST_EVENTS);
    const { iteration, pairs } = event.data as { iteration?: number; pairs?: ({ index: number } | number)[] };
    if ((event.kind === "pairs" || event.kind === "lost") && iteration !== undefined && pairs) {
      const known = this.changed.get(iteration) ?? new Set();
      for (const pair of pairs) known.add(typeof pair === "number" ? pair : pair.index);
      this.changed.set(iteration, known);
    }
    this.syncSoon();
    this.headSoon();
    if (event.kind !== "note") this.slowSoon();
  }

  /** Brings what the events have named up to date. */
  private async sync(): Promise<void> {
    if (this.syncing) return this.syncSoon();
    this.syncing = true;
    const changed = this.changed;
    this.changed = new Map();
    try {
      const since = Math.min(this.last?.index ?? 0, ...changed.keys());
      const [{ iterations }, { workers }] = await Promise.all([this.states(since), get<JobWorkers>(`${this.path}/workers`)]);
      this.iterations = [...this.iterations.filter((one) => one.index < since), ...iterations];
      this.workers = workers;
      // Of an iteration that has just begun nothing is known but what the events will name.
      for (const one of iterations) if (one.index > since && !this.details.has(one.index)) this.keep(one.index, []);
      for (const [iteration, pairs] of changed) await this.results(iteration, [...pairs]);
    } catch (reason) {
      // What was not answered is asked for again.
      for (const [iteration, pairs] of changed) this.changed.set(iteration, new Set([...pairs, ...(this.changed.get(iteration) ?? [])]));
      setTimeout(this.syncSoon, AGAIN_MS);
      throw reason;
    } finally {
      this.syncing = false;
    }
  }

  /** The results of an iteration, from all pages. */
  private async matrix(iteration: number): Promise<PairMatrix> {
    const path = `${this.path}/pairs?iteration=${iteration}`,
      first = await get<PairMatrix>(path);
    for (let next = first.next; next !== null; ) {
      const page = await get<PairMatrix>(`${path}&after=${next}`);
      first.cells.push(...page.cells);
      next = page.next;
    }
    return first;
  }

  private async results(iteration: number, pairs: number[]): Promise<void> {
    const known = this.details.get(iteration);
    if (!known) return;
    for (let i = 0; i < pairs.length; i += AT_ONCE) {
      const which = pairs
        .slice(i, i + AT_ONCE)
        .map((pair) => `&pair=${pair}`)
        .join("");
      for (const cell of (await get<PairMatrix>(`${this.path}/pairs?iteration=${iteration}${which}`)).cells) known.set(cell.pair, cell);
    }
  }

  /** What is around the matrix, and changes more seldom. */
  private async around(): Promise<void> {
    const [reached, { obstacles }, { workers }] = await Promise.all([
      this.measure.points(this.job),
      get<Obstacles>(`${this.path}/obstacles`),
      get<JobWorkers>(`${this.path}/workers`),
    ]);
    this.reached = reached;
    this.obstacles = obstacles;
    this.workers = workers;
  }

  private async who(): Promise<void> {
    this.workers = (await get<JobWorkers>(`${this.path}/workers`)).workers;
  }

  private async head(): Promise<void> {
    await refresh(document.getElementById("live")!.dataset.refresh!);
  }

  private async attempt(work: () => Promise<void>): Promise<void> {
    try {
      await work();
      this.problem = null;
    } catch (reason) {
      this.problem = said(reason);
    }
    this.told();
  }
}
