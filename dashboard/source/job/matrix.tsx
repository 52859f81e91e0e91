// The pair matrix: a row for each pair, a column for each iteration, the newest first. Only what is to be seen is in the page, however
// many pairs there are; the grid tells assistive technology how many rows and columns it has.
import { Component } from "preact";
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import type { IterationStates, PairInfo } from "../common/schema";
import { inAddress, useAddress } from "../common/address";
import { plural } from "../common/words";
import { address, go } from "./route";
import { CERTIFIED, OUTCOMES, atLeast, badness, duration, facts } from "./outcomes";
import { stageOf } from "./steps";
import type { JobStore } from "./store";

const HEAD = 32;
const SPARE = 6;
/** Pixels. Narrow screens have the two names of a pair one below the other. */
const NARROW = 560;
const ROW = { narrow: 44, wide: 30 };
const COLUMN = { least: 36, most: 72 };
/** Where names have this much room, the newest iteration's time and proved distance stand beside them. */
const ROOMY = 620;
const NAME = { narrow: 190, least: 260, most: 470 };

type Order = "scene" | "outcome" | "time" | "open";

interface Place {
  row: number;
  column: number;
}

/** What the reader has chosen and where he was, kept while a pair is open instead of the matrix. */
export class Memory {
  outcome = inAddress("show") ?? "";
  order = (inAddress("sort") ?? "scene") as Order;
  search = inAddress("name") ?? "";
  active: Place = { row: 0, column: 0 };
  top = 0;
  left = 0;
  /** Whether a pair was opened from the matrix, which then gets the focus again. */
  opened = false;
}

function short(name: string): string {
  return name.split("/").slice(1).join("/") || name;
}

export function Matrix({ store, version, memory }: { store: JobStore; version: number; memory: Memory }) {
  const [outcome, setOutcome] = useState(memory.outcome);
  const [order, setOrder] = useState(memory.order);
  const [search, setSearch] = useState(memory.search);
  Object.assign(memory, { outcome, order, search });
  useAddress({ show: outcome || null, sort: order === "scene" ? null : order, name: search || null });
  const rows = useMemo(() => chosen(store, outcome, order, search), [version, outcome, order, search]);
  return (
    <section aria-labelledby="h-pairs">
      <h2 id="h-pairs">Pairs</h2>
      <div class="tools">
        <label>
          Show{" "}
          <select aria-label="Show pairs" value={outcome} onChange={(event) => setOutcome(event.currentTarget.value)}>
            <option value="">all pairs</option>
            <option value="not">not certified</option>
            {Object.entries(OUTCOMES).map(([letter, one]) => (
              <option value={letter} key={letter}>
                {one.words}
              </option>
            ))}
          </select>
        </label>
        <label>
          Sort by{" "}
          <select aria-label="Sort by" value={order} onChange={(event) => setOrder(event.currentTarget.value as Order)}>
            <option value="scene">order in the scene</option>
            <option value="outcome">outcome, worst first</option>
            <option value="time">time, longest first</option>
            <option value="open">open cells, most first</option>
          </select>
        </label>
        <label>
          Name <input type="search" value={search} placeholder="part of a name" onInput={(event) => setSearch(event.currentTarget.value)} />
        </label>
        <span class="quiet" role="status">
          {rows.length === store.pairs.length ? plural(rows.length, "pair") : `${rows.length} of ${plural(store.pairs.length, "pair")}`}
        </span>
      </div>
      <Legend iterations={store.iterations} />
      {rows.length > 0 ? (
        <Grid store={store} version={version} rows={rows} memory={memory} />
      ) : (
        <p class="empty">{store.pairs.length === 0 ? "The scene has no pairs." : "No pair is like this in the last iteration."}</p>
      )}
    </section>
  );
}

function Legend({ iterations }: { iterations: IterationStates[] }) {
  const there = Object.entries(OUTCOMES).filter(([letter, { glyph }]) => glyph && iterations.some(({ states }) => states.includes(letter)));
  return (
    <p class="legend">
      {there.map(([, { name, glyph, words }]) => (
        <span class={`key ${name}`} key={name}>
          {glyph} {words}
        </span>
      ))}
    </p>
  );
}

/** The pairs that are to be seen, in order. Outcomes, times and open cells are those of the last iteration. */
function chosen(store: JobStore, outcome: string, order: Order, search: string): PairInfo[] {
  const last = store.last;
  const letter = (pair: PairInfo): string => last?.states[pair.index] ?? "-";
  const text = search.trim().toLowerCase();
  const fits = (pair: PairInfo): boolean =>
    (outcome === "" || (outcome === "not" ? !CERTIFIED.includes(letter(pair)) : letter(pair) === outcome)) &&
    `${pair.a} ${pair.b}`.toLowerCase().includes(text);
  const found = store.pairs.filter(fits);
  const value = (pair: PairInfo): number => {
    const cell = last && store.cell(last.index, pair.index);
    if (order === "outcome") return badness(letter(pair));
    return -((order === "time" ? cell?.seconds : cell?.open_cells) ?? -1);
  };
  if (order === "scene") return found;
  const values = new Map(found.map((pair) => [pair.index, value(pair)]));
  return found.sort((a, b) => values.get(a.index)! - values.get(b.index)! || a.index - b.index);
}

function Grid({ store, version, rows, memory }: { store: JobStore; version: number; rows: PairInfo[]; memory: Memory }) {
  const box = useRef<HTMLDivElement>(null);
  const [seen, setSeen] = useState({ top: memory.top, left: memory.left, width: 800, height: 500 });
  const [last, setActive] = useState(memory.active);
  const [shown, setShown] = useState<Place | null>(null);
  const columns = useMemo(() => [...store.iterations].reverse(), [store.iterations]);
  // There may be fewer rows than there were.
  const active = { row: Math.min(last.row, rows.length - 1), column: Math.min(last.column, columns.length - 1) };
  memory.active = active;
  const narrow = seen.width < NARROW,
    high = narrow ? ROW.narrow : ROW.wide;
  const least = narrow ? NAME.narrow : Math.min(NAME.most, Math.max(NAME.least, 0.4 * seen.width));
  const wide = Math.floor(Math.min(COLUMN.most, Math.max(COLUMN.least, (seen.width - least) / Math.max(columns.length, 1))));
  const named = Math.max(Math.round(least), seen.width - columns.length * wide);
  const width = named + columns.length * wide;

  useLayoutEffect(() => {
    const element = box.current!;
    const look = (): void => {
      [memory.top, memory.left] = [element.scrollTop, element.scrollLeft];
      setSeen({ top: memory.top, left: memory.left, width: element.clientWidth, height: element.clientHeight });
    };
    element.scrollTo(memory.left, memory.top);
    look();
    if (memory.opened) element.focus();
    memory.opened = false;
    const observer = new ResizeObserver(look);
    observer.observe(element);
    element.addEventListener("scroll", look, { passive: true });
    return () => {
      observer.disconnect();
      element.removeEventListener("scroll", look);
    };
  }, []);

  const at = (place: Place): { pair: PairInfo; iteration: (typeof columns)[number] } | null => {
    const pair = rows[place.row],
      iteration = columns[place.column];
    return pair && iteration ? { pair, iteration } : null;
  };
  const shownAt = shown && at(shown);
  useEffect(() => {
    if (shownAt) store.want(shownAt.iteration.index);
  }, [shownAt?.iteration.index]);

  const move = (row: number, column: number): void => {
    const place = {
      row: Math.min(Math.max(row, 0), rows.length - 1),
      column: Math.min(Math.max(column, 0), Math.max(columns.length - 1, 0)),
    };
    setActive(place);
    setShown(place);
    const element = box.current!,
      y = place.row * high,
      x = place.column * wide;
    if (y < element.scrollTop) element.scrollTop = y;
    else if (y + high > element.scrollTop + element.clientHeight - HEAD) element.scrollTop = y + high + HEAD - element.clientHeight;
    if (x < element.scrollLeft) element.scrollLeft = x;
    else if (x + wide > element.scrollLeft + element.clientWidth - named) element.scrollLeft = x + wide + named - element.clientWidth;
  };
  const page = Math.max(1, Math.floor((seen.height - HEAD) / high) - 1);
  const onKeyDown = (event: KeyboardEvent): void => {
    if (event.altKey || event.metaKey) return;
    if (event.ctrlKey && event.key !== "Home" && event.key !== "End") return;
    const { row, column } = active;
    const moves: Record<string, [number, number]> = {
      ArrowUp: [row - 1, column],
      ArrowDown: [row + 1, column],
      ArrowLeft: [row, column - 1],
      ArrowRight: [row, column + 1],
      PageUp: [row - page, column],
      PageDown: [row + page, column],
      Home: [event.ctrlKey ? 0 : row, 0],
      End: [event.ctrlKey ? rows.length - 1 : row, columns.length - 1],
    };
    if (moves[event.key]) move(...moves[event.key]!);
    else if (event.key === "Enter" || event.key === " ") open(active);
    else if (event.key === "Escape") setShown(null);
    else return;
    event.preventDefault();
  };
  const open = (place: Place): void => {
    const found = at(place);
    memory.opened = found !== null;
    if (found) go({ pair: found.pair.index, iteration: place.column === 0 ? null : found.iteration.index });
  };
  const place = (event: Event): Place | null => {
    const cell = (event.target as Element).closest<HTMLElement>("[data-column]");
    return cell && { row: Number(cell.dataset.row), column: Number(cell.dataset.column) };
  };

  const first = Math.max(0, Math.floor(seen.top / high) - SPARE);
  const after = Math.min(rows.length, Math.ceil((seen.top + seen.height) / high) + SPARE);
  const from = Math.max(0, Math.floor(seen.left / wide) - SPARE);
  const to = Math.min(columns.length, Math.ceil((seen.left + seen.width - named) / wide) + SPARE);
  const inView = active.row >= first && active.row < after && active.column >= from && active.column < to;
  const tip = shown && {
    top: `${HEAD + (shown.row + 1) * high - seen.top + 4}px`,
    left: `${Math.max(0, Math.min(named + shown.column * wide - seen.left, seen.width - 300))}px`,
  };
  return (
    <div class="matrix-box">
      <div
        class={`scroll pairs ${narrow ? "narrow" : ""}`}
        ref={box}
        id="matrix"
        role="grid"
        tabIndex={0}
        aria-label="Pair matrix"
        aria-rowcount={rows.length + 1}
        aria-colcount={columns.length + 1}
        aria-activedescendant={inView ? `cell-${active.row}-${active.column}` : undefined}
        aria-describedby="matrix-help"
        onKeyDown={onKeyDown}
        onFocus={() => setShown(active)}
        onBlur={() => setShown(null)}
        onMouseOver={(event) => {
          const found = place(event);
          if (found) setShown(found);
        }}
        onMouseLeave={() => setShown(null)}
        onClick={(event) => {
          const found = place(event);
          if (found) {
            setActive(found);
            open(found);
          }
        }}
        style={{ height: `min(70vh, ${rows.length * high + HEAD + 2 + (width > seen.width ? 16 : 0)}px)` }}
      >
        <div role="row" class="head" aria-rowindex={1} style={{ width: `${width}px`, height: `${HEAD}px` }}>
          <div role="columnheader" class="name" style={{ width: `${named}px` }}>
            <span>Pair</span>
            <span aria-hidden="true">{named >= ROOMY ? "time and proved distance, " : ""}iteration</span>
          </div>
          {columns.slice(from, to).map((one, i) => (
            <div
              role="columnheader"
              class="cell"
              key={one.index}
              aria-colindex={from + i + 2}
              title={`${stageOf(one.label)}, ${plural(one.faces, "face")}, ${one.state}`}
              style={{ left: `${named + (from + i) * wide}px`, width: `${wide}px` }}
            >
              <span class="sr">iteration </span>
              {one.index}
            </div>
          ))}
        </div>
        <div role="rowgroup" class="rows" style={{ width: `${width}px`, height: `${rows.length * high}px` }}>
          {rows.slice(first, after).map((pair, i) => {
            const row = first + i;
            return (
              <Row
                key={pair.index}
                pair={pair}
                row={row}
                top={row * high}
                columns={columns}
                from={from}
                to={to}
                named={named}
                wide={wide}
                narrow={narrow}
                active={row === active.row ? active.column : -1}
                store={store}
                version={version}
              />
            );
          })}
        </div>
      </div>
      {tip && shownAt && (
        <div role="tooltip" class="tip" style={tip}>
          <strong>
            {shownAt.pair.a} – {shownAt.pair.b}
          </strong>
          {facts(
            shownAt.iteration.states[shownAt.pair.index] ?? "-",
            shownAt.iteration,
            store.cell(shownAt.iteration.index, shownAt.pair.index),
            store.units,
          ).map((fact) => (
            <div key={fact}>{fact}</div>
          ))}
        </div>
      )}
      <p class="small" id="matrix-help">
        The newest iteration is on the left. Arrow keys move, Enter opens the pair.
      </p>
    </div>
  );
}

interface RowProps {
  pair: PairInfo;
  row: number;
  top: number;
  columns: IterationStates[];
  /** The columns that are drawn: from this one to before that one. */
  from: number;
  to: number;
  named: number;
  wide: number;
  narrow: boolean;
  /** The column that has the focus; -1 where the focus is in another row. */
  active: number;
  store: JobStore;
  version: number;
}

/** A row is drawn again only when something of it has changed, and not at each step of scrolling. */
class Row extends Component<RowProps> {
  override shouldComponentUpdate(next: RowProps): boolean {
    return (Object.keys(next) as (keyof RowProps)[]).some((name) => next[name] !== this.props[name]);
  }

  override render({ pair, row, top, columns, from, to, named, wide, narrow, active, store }: RowProps) {
    const newest = named >= ROOMY && columns[0] ? store.cell(columns[0].index, pair.index) : undefined;
    return (
      <div role="row" class="row" aria-rowindex={row + 2} style={{ top: `${top}px`, width: `${named + columns.length * wide}px` }}>
        <div role="rowheader" class="name" style={{ width: `${named}px` }}>
          <a href={address({ pair: pair.index })} tabIndex={-1} title={`${pair.a} – ${pair.b}`}>
            {short(pair.a)}
            {narrow ? <br /> : <span class="quiet"> – </span>}
            {short(pair.b)}
          </a>
          {newest && (
            <span class="newest">
              {newest.seconds !== null && duration(newest.seconds)}
              <span>{newest.proved_distance !== null && `≥ ${atLeast(newest.proved_distance)}`}</span>
            </span>
          )}
        </div>
        {columns.slice(from, to).map((one, i) => {
          const letter = one.states[pair.index] ?? "-",
            column = from + i,
            { name, glyph, words } = OUTCOMES[letter]!;
          return (
            <div
              role="gridcell"
              class={`cell ${name}${column === active ? " active" : ""}`}
              key={one.index}
              id={`cell-${row}-${column}`}
              aria-colindex={column + 2}
              data-row={row}
              data-column={column}
              aria-label={column === active ? facts(letter, one, store.cell(one.index, pair.index), store.units).join("; ") : words}
              style={{ left: `${named + column * wide}px`, width: `${wide}px` }}
            >
              {glyph}
            </div>
          );
        })}
      </div>
    );
  }
}
