// A motion to be played: the robot moves along it, and the page says what proves each part of it.
import type { ComponentChildren } from "preact";
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { LINKS } from "../common/colours";
import { shortNames } from "../common/kinematics";
import { toQ, toS, type Charts } from "../common/polytope";
import { shown } from "../common/units";

/** A motion, straight between its configurations, in q or, where it has charts, in their s. The first time is 0. */
export interface Motion {
  q: number[][];
  t: number[];
  charts?: Charts;
}

/** A part of a motion, and what proves it. */
export interface Part {
  begin: number;
  end: number;
  by: "region" | "map" | "motion" | "nothing";
  said: ComponentChildren;
}

/** A motion to be shown, what proves each part of it, and what is claimed of it. */
export interface Shown extends Motion {
  parts: Part[];
  /** The regions that prove it, one for each part; null for a part that something else proves. */
  way: (string | null)[];
  claim: ComponentChildren;
  /** What to download, as JSON; null where the reader has it. */
  file: object | null;
}

interface Props {
  motion: Shown;
  names: string[];
  units: ("rad" | "m")[];
  onMove: (q: number[]) => void;
}

/** The configuration at a time, on the straight line between two of the motion's. */
function at({ q, t, charts }: Motion, time: number): number[] {
  const next = t.findIndex((moment) => moment >= time);
  if (next <= 0) return q[next < 0 ? q.length - 1 : 0]!;
  const share = (time - t[next - 1]!) / (t[next]! - t[next - 1]!);
  const between = (from: number[], to: number[]): number[] => from.map((value, i) => value + share * (to[i]! - value));
  const [from, to] = [q[next - 1]!, q[next]!];
  return charts ? between(toS(charts, from), toS(charts, to)).map((value, i) => toQ(charts, i, value)) : between(from, to);
}

export function Player({ motion, names, units, onMove }: Props) {
  const { parts } = motion;
  const end = motion.t.at(-1)!;
  const [time, setTime] = useState(0);
  const [playing, setPlaying] = useState(false);
  const [speed, setSpeed] = useState(1);
  const now = useRef(0);
  const go = (to: number): void => {
    now.current = to;
    setTime(to);
    onMove(at(motion, to));
  };
  useEffect(() => {
    now.current = 0;
    setTime(0);
    setPlaying(false);
  }, [motion]);
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
  }, [playing, speed, motion]);
  const part = parts.find((candidate) => time <= candidate.end) ?? parts.at(-1)!;
  return (
    <div class="player">
      <div class="toolbar">
        <button type="button" onClick={() => setPlaying(!playing)}>{playing ? "Pause" : "Play"}</button>
        <input type="range" min={0} max={end} step="any" value={time} aria-label="Time, seconds" aria-valuetext={`${time.toFixed(2)} s`} onInput={(event) => { setPlaying(false); go(Number(event.currentTarget.value)); }} />
        <output>{time.toFixed(2)} s</output>
        <label>speed <select value={speed} onChange={(event) => setSpeed(Number(event.currentTarget.value))}>{[0.25, 0.5, 1, 2].map((factor) => <option value={factor} key={factor}>{factor}×</option>)}</select></label>
        {motion.file && <Download file={motion.file} />}
      </div>
      <p class="moment">At {time.toFixed(2)} s: {part.said}</p>
      <Curves motion={motion} parts={parts} names={names} units={units} time={time} />
      <ol class="parts">
        {parts.map(({ begin, end, by, said }) => (
          <li key={begin} class={by}>{begin.toFixed(2)} to {end.toFixed(2)} s: {said}</li>
        ))}
      </ol>
    </div>
  );
}

function Download({ file }: { file: object }) {
  const address = useMemo(() => URL.createObjectURL(new Blob([JSON.stringify(file)], { type: "application/json" })), [file]);
  useEffect(() => () => URL.revokeObjectURL(address), [address]);
  return <a href={address} download="plan.json">Download</a>;
}

const CHART = { width: 560, height: 140, pad: 6, band: 8 };
const STEPS = 24; // of the curves of a piece that is not straight in q
const DASHES = ["", "6 3", "2 3", "8 3 2 3", "1 4", "10 4", "4 2"];

function finer(t: number[]): number[] {
  return t.flatMap((end, i) => (i === 0 ? [end] : Array.from({ length: STEPS }, (_, step) => t[i - 1]! + ((step + 1) / STEPS) * (end - t[i - 1]!))));
}

function Curves({ motion, parts, names, units, time }: { motion: Motion; parts: Part[]; names: string[]; units: ("rad" | "m")[]; time: number }) {
  const end = Math.max(motion.t.at(-1)!, 1e-9);
  const short = shortNames(names);
  const x = (t: number): number => CHART.pad + ((CHART.width - 2 * CHART.pad) * t) / end;
  const times = useMemo(() => (motion.charts ? finer(motion.t) : motion.t), [motion]);
  const places = useMemo(() => times.map((moment) => at(motion, moment)), [motion, times]);
  const lines = names.map((_, joint) => {
    const values = places.map((q) => q[joint]!);
    const [low, high] = values.reduce(([least, most], value) => [Math.min(least, value), Math.max(most, value)], [Infinity, -Infinity]);
    const bottom = CHART.height - CHART.band - CHART.pad;
    const y = (value: number): number => bottom - (bottom - CHART.pad) * (high - low > 1e-9 ? (value - low) / (high - low) : 0.5);
    return { d: times.map((t, i) => `${i ? "L" : "M"}${x(t).toFixed(1)},${y(values[i]!).toFixed(1)}`).join(""), from: values[0]!, to: values.at(-1)! };
  });
  return (
    <figure>
      <svg class="chart" viewBox={`0 0 ${CHART.width} ${CHART.height}`} role="img" aria-label="Every joint over time, each between its own least and greatest position; the list below says from where to where. The band shows what proves each part.">
        {parts.map(({ begin, end: until, by }) => <rect key={begin} class={`part ${by}`} x={x(begin)} width={x(until) - x(begin)} y={CHART.height - CHART.band} height={CHART.band} />)}
        {parts.slice(1).map(({ begin }) => <line key={begin} class="between" x1={x(begin)} x2={x(begin)} y1={0} y2={CHART.height} />)}
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
