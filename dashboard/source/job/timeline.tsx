// What each process did for the job over time, how fast the work went, and how long the iteration will last. The server tells many pieces
// of work together, and one by one where the reader comes closer.
import { useEffect, useRef, useState } from "preact/hooks";
import { inAddress, useAddress } from "../common/address";
import { get, said } from "../common/api";
import type { Bar, Timeline as Told } from "../common/schema";
import { plural } from "../common/words";
import { duration } from "./outcomes";
import { go } from "./route";
import type { JobStore } from "./store";
import { stepOf } from "./steps";

const WIDTH = 1000;
const ROW = 18;
const GRID = 4;
const RATE = 60;
/** Part of the width that a bar has at least, so that it is seen. */
const LEAST = 1.5;
const AGAIN_MS = 5000;
/** It is not asked more often than this many times as long as the answer takes. */
const CALM = 10;
/** A drag over less than this part of the width is a click. */
const DRAG = 0.01;

/** Seconds since the job's start; null for the whole time. */
type Range = { since: number; until: number } | null;

/** Reads a part of the time from the address; null where it is none. */
function rangeIn(since: string | null, until: string | null): Range {
  const [from, to] = [Number(since ?? NaN), Number(until ?? NaN)];
  return 0 <= from && from < to && to < Infinity ? { since: from, until: to } : null;
}

/** The class that the style sheet colours. */
function looks({ work, state }: Bar): string {
  if (state === "failed" || work === "lost") return "error";
  return work === "pairs" ? state : "step";
}

function what(bar: Bar, store: JobStore, subject: string): string {
  const named = bar.work === "pairs" ? "pairs" : stepOf(bar.work, subject).toLowerCase();
  const pair = bar.pair === null ? undefined : store.pairs[bar.pair];
  if (bar.work === "lost") return "its work was lost, and is open again";
  if (bar.pieces !== 1) return bar.pieces === 0 ? "works on" : `${plural(bar.pieces, "piece")} of work; most time: ${named}, ${bar.state.replaceAll("_", " ")}`;
  if (bar.work !== "pairs") return `${named}: ${bar.state.replaceAll("_", " ")}`;
  return `${pair ? `${pair.a} – ${pair.b}` : bar.pair === null ? "a pair" : `pair ${bar.pair}`}${bar.iteration === null ? "" : ` in iteration ${bar.iteration}`}: ${bar.state.replaceAll("_", " ")}`;
}

/** The name of a process, without when it began. */
function short(process: string): string {
  return process ? process.split(":").slice(0, 2).join(":") : "not kept";
}

export function Timeline({ store, subject }: { store: JobStore; subject: string }) {
  const place = useRef<HTMLElement>(null);
  const [seen, setSeen] = useState(false);
  const [told, setTold] = useState<Told | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [range, setRange] = useState(() => rangeIn(inAddress("since"), inAddress("until")));
  useAddress({ since: range && String(range.since), until: range && String(range.until) });
  const [tick, setTick] = useState(0);
  useEffect(() => {
    const observer = new IntersectionObserver((entries) => {
      if (entries.some((entry) => entry.isIntersecting)) setSeen(true);
    });
    observer.observe(place.current!);
    return () => observer.disconnect();
  }, []);
  useEffect(() => {
    if (!seen) return;
    const abort = new AbortController();
    const began = performance.now();
    let timer: ReturnType<typeof setTimeout> | undefined;
    const again = (): void => {
      if (!store.ended) timer = setTimeout(() => setTick(tick + 1), Math.max(AGAIN_MS, CALM * (performance.now() - began)));
    };
    get<Told>(`/v1/jobs/${store.job}/timeline${range ? `?since=${range.since}&until=${range.until}` : ""}`, abort.signal).then(
      (found) => {
        setTold(found);
        setProblem(null);
        again();
      },
      (reason: unknown) => {
        if (abort.signal.aborted) return;
        setProblem(said(reason));
        again();
      },
    );
    return () => {
      abort.abort();
      clearTimeout(timer);
    };
  }, [seen, range?.since, range?.until, tick, store.ended]);
  const empty = told !== null && told.bars.length === 0 && range === null;
  return (
    <section aria-labelledby="h-timeline" ref={place}>
      <h2 id="h-timeline">Work over time</h2>
      {problem && (
        <p class="notice bad" role="alert">
          {problem}
        </p>
      )}
      {!told && !problem && <p class="empty">Loading …</p>}
      {empty && <p class="empty">{store.ended ? "Nothing is kept of what processes did for this job." : "No process has finished any work for this job yet."}</p>}
      {told?.left && (
        <p class="left">
          <span class="computed">
            About {duration(told.left.seconds)} ± {duration(told.left.error)}
          </span>{" "}
          until iteration {told.left.iteration} is settled, at the pace of its first {plural(told.left.settled, "piece")} of work. A failure may end it
          earlier. What comes after it is not known.
        </p>
      )}
      {told && !empty && (
        <>
          <Tools told={told} range={range} setRange={setRange} />
          <Chart told={told} store={store} subject={subject} setRange={setRange} />
          <Table told={told} />
        </>
      )}
    </section>
  );
}

function Tools({ told, range, setRange }: { told: Told; range: Range; setRange: (range: Range) => void }) {
  const wide = told.end - told.begin;
  /** Shows `width` seconds of the job around `middle`, which is in seconds since its start. */
  const show = (middle: number, width: number): void => {
    const until = Math.min(Math.max(middle + width / 2, width), told.seconds);
    setRange(width >= told.seconds ? null : { since: Math.max(until - width, 0), until });
  };
  const middle = (told.begin + told.end) / 2;
  return (
    <div class="tools" role="group" aria-label="Part of the time">
      <button type="button" onClick={() => show(middle, wide / 2)}>
        Closer
      </button>
      <button type="button" disabled={range === null} onClick={() => show(middle, wide * 2)}>
        Farther
      </button>
      <button type="button" disabled={told.begin <= 0} onClick={() => show(middle - wide / 2, wide)}>
        Earlier
      </button>
      <button type="button" disabled={told.end >= told.seconds} onClick={() => show(middle + wide / 2, wide)}>
        Later
      </button>
      <button type="button" disabled={range === null} onClick={() => setRange(null)}>
        All of it
      </button>
      <span class="quiet" role="status">
        {duration(told.begin)} to {duration(told.end)}
        {told.together && "; each bar tells of several pieces of work"}
      </span>
    </div>
  );
}

function Chart({ told, store, subject, setRange }: { told: Told; store: JobStore; subject: string; setRange: (range: Range) => void }) {
  const [dragged, setDragged] = useState<{ from: number; to: number } | null>(null);
  const span = told.end - told.begin || 1;
  const x = (seconds: number): number => (WIDTH * (seconds - told.begin)) / span;
  const high = told.processes.length * ROW;
  const there = [...new Map(told.bars.map((bar) => [looks(bar), bar])).keys()];
  const at = (event: PointerEvent): number => {
    const box = (event.currentTarget as Element).getBoundingClientRect();
    return Math.min(Math.max((event.clientX - box.left) / box.width, 0), 1);
  };
  const end = (): void => {
    if (dragged && Math.abs(dragged.to - dragged.from) > DRAG) {
      const [from, to] = [dragged.from, dragged.to].sort((a, b) => a - b) as [number, number];
      setRange({ since: told.begin + from * span, until: told.begin + to * span });
    }
    setDragged(null);
  };
  return (
    <figure class="timeline">
      <p class="legend">
        {there.map((name) => (
          <span class={`key ${name}`} key={name}>
            <svg class="bar" viewBox="0 0 1 1" aria-hidden="true">
              <rect class={name} width="1" height="1" />
            </svg>{" "}
            {name === "step" ? `${there.length > 1 ? "other work" : "work"} for ${subject}` : name === "error" ? "error, or lost work" : name.replaceAll("_", " ")}
          </span>
        ))}
      </p>
      <div class="scroll rows" tabIndex={0} role="region" aria-label="Processes and their work">
        <div class="names" style={{ gridAutoRows: `${ROW}px` }}>
          {told.processes.map((process) => (
            <code key={process} title={process}>
              {short(process)}
            </code>
          ))}
        </div>
        <svg
          class="bar work"
          viewBox={`0 0 ${WIDTH} ${high || ROW}`}
          style={{ height: `${high || ROW}px` }}
          preserveAspectRatio="none"
          role="img"
          aria-label={`What ${plural(told.processes.length, "process", "processes")} did from ${duration(told.begin)} to ${duration(told.end)}. The table below has the numbers.`}
          onPointerDown={(event) => setDragged({ from: at(event), to: at(event) })}
          onPointerMove={(event) => dragged && setDragged({ ...dragged, to: at(event) })}
          onPointerUp={end}
          onPointerLeave={() => setDragged(null)}
        >
          {told.bars.map((bar, i) => {
            const wide = Math.max(x(bar.end) - x(bar.begin), LEAST);
            const full = bar.end > bar.begin ? Math.min(bar.seconds / (bar.end - bar.begin), 1) : 1;
            const size = Math.max((ROW - 3) * full, 2);
            return (
              <rect
                key={i}
                class={looks(bar)}
                x={x(bar.begin)}
                y={bar.process * ROW + ROW - 1 - size}
                width={wide}
                height={size}
                onClick={() => bar.pair !== null && go({ pair: bar.pair, iteration: bar.iteration })}
              >
                <title>{`${duration(bar.begin)}, for ${duration(bar.seconds)}: ${what(bar, store, subject)}`}</title>
              </rect>
            );
          })}
          {dragged && (
            <rect class="chosen" x={WIDTH * Math.min(dragged.from, dragged.to)} y={0} width={WIDTH * Math.abs(dragged.to - dragged.from)} height={high} />
          )}
        </svg>
      </div>
      <p class="axis" aria-hidden="true">
        {Array.from({ length: GRID + 1 }, (_, i) => (
          <span key={i}>{duration(told.begin + (span * i) / GRID)}</span>
        ))}
      </p>
      {told.others > 0 && (
        <p class="quiet small">
          {plural(told.others, "more process", "more processes")}, which worked less, {told.others === 1 ? "is" : "are"} left out.
        </p>
      )}
      {told.rates.some(({ pieces }) => pieces > 0) && <Rates told={told} x={x} words="Pairs and parts of pairs settled" of={(rate) => rate.pieces} />}
      {told.rates.some(({ cells }) => cells !== null) && <Rates told={told} x={x} words="Cells looked at" of={(rate) => rate.cells ?? 0} />}
    </figure>
  );
}

function Rates({ told, x, words: what, of }: { told: Told; x: (seconds: number) => number; words: string; of: (rate: Told["rates"][number]) => number }) {
  const values = told.rates.map(of);
  const most = Math.max(...values) || 1;
  const y = (value: number): number => RATE * (1 - (0.94 * value) / most);
  const line = told.rates.map((rate, i) => `${i ? "L" : "M"}${x(rate.begin)},${y(values[i]!)}H${x(rate.end)}`).join("");
  const words = `${what} per second; at most ${Number(most.toPrecision(2)).toLocaleString("en")}`;
  return (
    <>
      <svg class="chart rates" viewBox={`0 0 ${WIDTH} ${RATE}`} preserveAspectRatio="none" role="img" aria-label={words}>
        <path d={line} />
      </svg>
      <p class="small">{words}.</p>
    </>
  );
}

function Table({ told }: { told: Told }) {
  const span = told.end - told.begin || 1;
  return (
    <details id="timeline-table">
      <summary>As a table</summary>
      <div class="scroll" tabIndex={0} role="region" aria-label="What each process did">
        <table>
          <thead>
            <tr>
              <th>Process</th>
              <th class="number">Pieces of work</th>
              <th class="number">Worked</th>
              <th class="number">Of the time</th>
            </tr>
          </thead>
          <tbody>
            {told.processes.map((process, i) => {
              const own = told.bars.filter((bar) => bar.process === i);
              const seconds = own.reduce((sum, bar) => sum + bar.seconds, 0);
              return (
                <tr key={process}>
                  <td>
                    <code title={process}>{short(process)}</code>
                  </td>
                  <td class="number">{own.reduce((sum, bar) => sum + bar.pieces, 0).toLocaleString("en")}</td>
                  <td class="number">{duration(seconds)}</td>
                  <td class="number">{Math.round((100 * seconds) / span)} %</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
    </details>
  );
}
