// One slider for each joint, with a field for the number: degrees where the joint turns, metres where it slides.
import { shortNames } from "./kinematics";

interface Props {
  names: string[];
  units: ("rad" | "m")[];
  lower: number[];
  upper: number[];
  /** Joint positions, radians or metres. */
  q: number[];
  onChange: (q: number[]) => void;
  /** Joints, by index, whose slider is marked. */
  marked?: number[];
}

const DEGREE = Math.PI / 180;

export function Sliders({ names, units, lower, upper, q, onChange, marked = [] }: Props) {
  const short = shortNames(names);
  const set = (index: number, text: string): void => {
    const value = Number(text) * (units[index] === "rad" ? DEGREE : 1);
    if (text !== "" && Number.isFinite(value)) onChange(q.map((old, i) => (i === index ? Math.min(Math.max(value, lower[i]!), upper[i]!) : old)));
  };
  return (
    <div class="sliders">
      {names.map((name, i) => {
        const scale = units[i] === "rad" ? DEGREE : 1;
        const digits = units[i] === "rad" ? 1 : 3;
        const unit = units[i] === "rad" ? "degrees" : "metres";
        const range = { min: lower[i]! / scale, max: upper[i]! / scale, step: "any" };
        return (
          <div class={marked.includes(i) ? "slider marked" : "slider"} key={name}>
            <span class="name" title={name}>{short[i]}</span>
            <input type="range" {...range} value={q[i]! / scale} aria-label={`${name}, ${unit}`} onInput={(event) => set(i, event.currentTarget.value)} />
            <input type="number" {...range} value={(q[i]! / scale).toFixed(digits)} aria-label={`${name}, ${unit}, as a number`} onChange={(event) => set(i, event.currentTarget.value)} />
            <span class="unit" aria-hidden="true">{units[i] === "rad" ? "°" : "m"}</span>
          </div>
        );
      })}
    </div>
  );
}
