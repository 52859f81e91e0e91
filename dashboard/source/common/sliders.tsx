// One slider for each joint, with a field for the number: angles where the joint turns, metres where it slides.
import { useRef, useState } from "preact/hooks";
import { shortNames } from "./kinematics";
import { bare, SHOWN, shown } from "./units";

interface Props {
  names: string[];
  units: ("rad" | "m")[];
  lower: number[];
  upper: number[];
  /** Joint positions, radians or metres. */
  q: number[];
  onChange: (q: number[]) => void;
  /** Between which positions each joint may be now; the limits where it is left out. */
  allowed?: [number, number][];
  /** Joints, by index, whose slider is marked. */
  marked?: number[];
}

export function Sliders({ names, units, lower, upper, q, onChange, allowed, marked = [] }: Props) {
  const short = shortNames(names);
  const latest = useRef(q);
  latest.current = q;
  /** Why a number that was typed was not taken as it is. */
  const [held, setHeld] = useState<string | null>(null);
  const range = (index: number): [number, number] => allowed?.[index] ?? [lower[index]!, upper[index]!];
  const inWords = (index: number): string => `${names[index]} may be between ${range(index).map((end) => shown(end, units[index]!)).join(" and ")}`;
  const set = (index: number, text: string): void => {
    const value = Number(text) * SHOWN[units[index]!].scale;
    setHeld(null);
    if (text === "" || !Number.isFinite(value)) return;
    const [low, high] = range(index);
    latest.current = latest.current.map((old, i) => (i === index ? Math.min(Math.max(value, low), high) : old));
    onChange(latest.current);
  };
  const enter = (index: number, text: string): void => {
    set(index, text);
    if (text === "") return;
    // An end is typed as it is shown, which is rounded.
    const wanted = shown(Number(text) * SHOWN[units[index]!].scale, units[index]!);
    const now = shown(latest.current[index]!, units[index]!);
    if (wanted !== now) setHeld(`${inWords(index)}${allowed ? " here" : ""}, so it is at ${now} and not at ${wanted}.`);
  };
  return (
    <div class="sliders">
      {names.map((name, i) => {
        const { scale, sign, word: unit } = SHOWN[units[i]!];
        const limits = { min: lower[i]! / scale, max: upper[i]! / scale, step: "any" };
        return (
          <div class={marked.includes(i) ? "slider marked" : "slider"} key={name} title={allowed && inWords(i)}>
            <span class="name" title={name}>{short[i]}</span>
            <span class="track">
              {allowed && <span class="allowed" aria-hidden="true" style={band(allowed[i]!, lower[i]!, upper[i]!)} />}
              <input type="range" {...limits} value={q[i]! / scale} aria-label={`${name}, ${unit}`} onInput={(event) => set(i, event.currentTarget.value)} />
            </span>
            <NumberField range={limits} text={bare(q[i]!, units[i]!)} label={`${name}, ${unit}, as a number`} onEnter={(text) => enter(i, text)} />
            <span class="unit" aria-hidden="true">{sign.trim()}</span>
          </div>
        );
      })}
      <p class="small" role="status">{held}</p>
    </div>
  );
}

/** A field for a number. What is being typed stays until it is entered, whatever is drawn meanwhile. */
function NumberField({ range, text, label, onEnter }: { range: { min: number; max: number; step: string }; text: string; label: string; onEnter: (text: string) => void }) {
  const [draft, setDraft] = useState<string | null>(null);
  const enter = (typed: string): void => {
    setDraft(null);
    onEnter(typed);
  };
  return <input type="number" {...range} value={draft ?? text} aria-label={label} onInput={(event) => setDraft(event.currentTarget.value)} onChange={(event) => enter(event.currentTarget.value)} />;
}

/** Where the allowed part of a slider's track is drawn. */
function band([low, high]: [number, number], lower: number, upper: number): { left: string; width: string } {
  const span = upper - lower || 1;
  return { left: `${(100 * (low - lower)) / span}%`, width: `${Math.max((100 * (high - low)) / span, 0.5)}%` };
}
