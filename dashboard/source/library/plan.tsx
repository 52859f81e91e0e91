// A trajectory between two configurations: asked for, said why there is none, or played.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { post, said } from "../common/api";
import { LINKS } from "../common/colours";
import { asText, shortNames, shown } from "../common/kinematics";
import type { PlanResponse } from "../common/schema";

interface Props {
  scene: string;
  names: string[];
  units: ("rad" | "m")[];
  lower: number[];
  upper: number[];
  q: number[];
  onMove: (q: number[]) => void;
  plan: PlanResponse | null;
  onPlan: (plan: PlanResponse | null) => void;
}

const DEGREE = Math.PI / 180;

/** Reads numbers in degrees and metres; null where they are not one for each joint. */
function read(text: string, units: ("rad" | "m")[]): number[] | null {
  const numbers = text.split(/[\s,;]+/).filter(Boolean).map(Number);
  return numbers.length === units.length && numbers.every(Number.isFinite) ? numbers.map((value, i) => (units[i] === "rad" ? value * DEGREE : value)) : null;
}

export function Planning({ scene, names, units, lower, upper, q, onMove, plan, onPlan }: Props) {
  const [ends, setEnds] = useState({ start: asText(q, units), goal: asText(q, units) });
  const [problem, setProblem] = useState<string | null>(null);
  const [asking, setAsking] = useState(false);
  const words = units.every((unit) => unit === "rad") ? "degrees" : units.every((unit) => unit === "m") ? "metres" : "degrees and metres";
  const ask = async (event: Event): Promise<void> => {
    event.preventDefault();
    const [start, goal] = [read(ends.start, units), read(ends.goal, units)];
    if (!start || !goal) return setProblem(`Give ${units.length} numbers for ${start ? "the goal" : "the start"}, one for each joint, in ${words}.`);
    for (const [end, at] of [["start", start], ["goal", goal]] as const) {
      const beyond = at.findIndex((value, i) => value < lower[i]! || value > upper[i]!);
      if (beyond >= 0) return setProblem(`${names[beyond]} of the ${end} is beyond its limits, ${shown(lower[beyond]!, units[beyond]!)} to ${shown(upper[beyond]!, units[beyond]!)}.`);
    }
    setProblem(null);
    setAsking(true);
    try {
      const found = await post<PlanResponse>("/v1/planning/plan", { scene, start, goal });
      onPlan(found);
      if (found.found) onMove(found.q[0]!);
    } catch (reason) {
      setProblem(said(reason));
    }
    setAsking(false);
  };
  const set = (end: "start" | "goal", value: string): void => {
    setEnds((old) => ({ ...old, [end]: value }));
    onPlan(null);
  };
  return (
    <div class="planning">
      <form onSubmit={(event) => void ask(event)}>
        {(["start", "goal"] as const).map((end) => (
          <p key={end}>
            <label for={`plan-${end}`}>{end === "start" ? "From" : "To"}</label>
            <input id={`plan-${end}`} value={ends[end]} onInput={(event) => set(end, event.currentTarget.value)} aria-describedby="plan-units" spellcheck={false} autocomplete="off" />
            <button type="button" onClick={() => set(end, asText(q, units))} aria-label={`Take this configuration of the robot as the ${end}`}>take this</button>
          </p>
        ))}
        <p class="quiet small" id="plan-units">One number for each joint, in {words}. Move the robot and take its configuration, or type.</p>
        <button type="submit" class="primary" disabled={asking}>{asking ? "Planning …" : "Plan a trajectory"}</button>
      </form>
      <div role="status">
        {problem && <p class="notice bad">{problem}</p>}
        {plan && !plan.found && <p class="notice">{why(plan, units)}</p>}
      </div>
      {plan?.found && <Player plan={plan} names={names} units={units} onMove={onMove} />}
    </div>
  );
}

function why(plan: PlanResponse, units: ("rad" | "m")[]): string {
  const { reason, nearest, gap, limit, collision } = plan;
  if (limit) {
    return `There is no motion: joint ${limit.joint} is outside its limits at the ${limit.where}.`;
  }
  if (collision) {
    const free = collision.free ? ` It is free near by, at ${asText(collision.free, units)}.` : "";
    return `There is no motion: ${collision.a} and ${collision.b} touch at the ${collision.where}.${free}`;
  }
  if (reason === "no_motion") return "No motion was found in time. There may be one.";
  if (reason === "not_certified") return "A motion was found, but none that could be certified.";
  if (reason === "start_uncovered" || reason === "goal_uncovered") {
    const end = reason === "start_uncovered" ? "start" : "goal";
    return nearest
      ? `There is no trajectory: no region contains the ${end}. The nearest is ${nearest.region.slice(0, 8)}, ${nearest.distance.toPrecision(3)} away in s, at ${asText(nearest.q, units)}.`
      : `There is no trajectory: no region contains the ${end}.`;
  }
  if (reason === "disconnected" && gap) {
    return `There is no trajectory: the ${gap.start_regions} regions that are connected with the start do not overlap the ${gap.goal_regions} that are connected with the goal. The gap is ${gap.distance.toPrecision(3)} in s; ${gap.q ? `a region that is grown at ${asText(gap.q, units)} may join them` : "no free configuration was found near its middle"}.`;
  }
  return "There is no trajectory: regions lead from the start to the goal, but none was found that is proved to be covered.";
}

/** The configuration at a time, on the straight line in q between two of the plan's. */
export function at(plan: PlanResponse, time: number): number[] {
  const next = plan.t.findIndex((t) => t >= time);
  if (next <= 0) return plan.q[next < 0 ? plan.q.length - 1 : 0]!;
  const part = (time - plan.t[next - 1]!) / (plan.t[next]! - plan.t[next - 1]!);
  return plan.q[next - 1]!.map((value, i) => value + part * (plan.q[next]![i]! - value));
}

function Player({ plan, names, units, onMove }: { plan: PlanResponse; names: string[]; units: ("rad" | "m")[]; onMove: (q: number[]) => void }) {
  const end = plan.t.at(-1)!;
  const [time, setTime] = useState(0);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(1);
  const now = useRef(0);
  const go = (to: number): void => {
    now.current = to;
    setTime(to);
    onMove(at(plan, to));
  };
  useEffect(() => go(0), [plan]);
  useEffect(() => {
    if (!playing) return;
    if (now.current >= end) go(0);
    let before = performance.now();
    let frame = requestAnimationFrame(function step(stamp: number) {
      go(Math.min(now.current + (speed * Math.max(stamp - before, 0)) / 1000, end));
      before = stamp;
      if (now.current >= end) setPlaying(false);
      else frame = requestAnimationFrame(step);
    });
    return () => cancelAnimationFrame(frame);
  }, [playing, speed, plan]);
  const piece = plan.pieces.find((candidate) => time <= candidate.end) ?? plan.pieces.at(-1)!;
  const file = useMemo(() => URL.createObjectURL(new Blob([JSON.stringify(plan)], { type: "application/json" })), [plan]);
  useEffect(() => () => URL.revokeObjectURL(file), [file]);
  return (
    <div class="player">
      <p>
        <strong>{plan.duration!.toFixed(2)} s</strong>, {plan.length!.toPrecision(3)} long in q, {plan.pieces.length} {plan.pieces.length === 1 ? "piece" : "pieces"}; guarantee <span class={`badge ${plan.guarantee}`}>{plan.guarantee}</span>:
        every point of it is proved to be free of collision, by what the pieces name.
      </p>
      <div class="toolbar">
        <button type="button" onClick={() => setPlaying(!playing)}>{playing ? "Pause" : "Play"}</button>
        <input type="range" min={0} max={end} step="any" value={time} aria-label="Time, seconds" aria-valuetext={`${time.toFixed(2)} s`} onInput={(event) => { setPlaying(false); go(Number(event.currentTarget.value)); }} />
        <output>{time.toFixed(2)} s</output>
        <label>speed <select value={speed} onChange={(event) => setSpeed(Number(event.currentTarget.value))}>{[0.25, 0.5, 1, 2].map((factor) => <option value={factor} key={factor}>{factor}×</option>)}</select></label>
        <a href={file} download="plan.json">Download</a>
      </div>
      <p class="moment">Now {piece.region ? <>in region <a href={`/regions/${piece.region}`}>{piece.region.slice(0, 8)}</a></> : <>on the proved motion {piece.motion?.slice(0, 8)}</>}, {piece.begin.toFixed(2)} to {piece.end.toFixed(2)} s, <span class={`badge ${piece.guarantee}`}>{piece.guarantee}</span></p>
      <Curves plan={plan} names={names} units={units} time={time} />
    </div>
  );
}

const CHART = { width: 560, height: 130, pad: 6 };
const DASHES = ["", "6 3", "2 3", "8 3 2 3", "1 4", "10 4", "4 2"];

function Curves({ plan, names, units, time }: { plan: PlanResponse; names: string[]; units: ("rad" | "m")[]; time: number }) {
  const end = Math.max(plan.t.at(-1)!, 1e-9);
  const short = shortNames(names);
  const x = (t: number): number => CHART.pad + ((CHART.width - 2 * CHART.pad) * t) / end;
  const lines = names.map((_, joint) => {
    const values = plan.q.map((q) => q[joint]!);
    const [low, high] = [Math.min(...values), Math.max(...values)];
    const y = (value: number): number => CHART.height - CHART.pad - (CHART.height - 2 * CHART.pad) * (high - low > 1e-9 ? (value - low) / (high - low) : 0.5);
    return { d: plan.t.map((t, i) => `${i ? "L" : "M"}${x(t).toFixed(1)},${y(values[i]!).toFixed(1)}`).join(""), from: values[0]!, to: values.at(-1)! };
  });
  return (
    <figure>
      <svg class="chart" viewBox={`0 0 ${CHART.width} ${CHART.height}`} role="img" aria-label="Every joint over time, each between its own least and greatest position; the list below says from where to where.">
        {plan.pieces.slice(1).map(({ begin }) => <line key={begin} class="between" x1={x(begin)} x2={x(begin)} y1={0} y2={CHART.height} />)}
        {lines.map(({ d }, joint) => <path key={names[joint]} d={d} style={{ stroke: LINKS[joint % LINKS.length], strokeDasharray: DASHES[joint % DASHES.length] }} />)}
        <line class="now" x1={x(time)} x2={x(time)} y1={0} y2={CHART.height} />
      </svg>
      <figcaption>
        {lines.map(({ from, to }, joint) => (
          <span class="joint-key" key={names[joint]}><svg width="22" height="8" aria-hidden="true"><line x1="0" x2="22" y1="4" y2="4" style={{ stroke: LINKS[joint % LINKS.length], strokeDasharray: DASHES[joint % DASHES.length] }} /></svg> {short[joint]} {shown(from, units[joint]!)} → {shown(to, units[joint]!)}</span>
        ))}
      </figcaption>
    </figure>
  );
}
