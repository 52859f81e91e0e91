// A configuration at which a pair touches, or is nearest, in 3D.
import { useEffect, useRef, useState } from "preact/hooks";
import { Robot, Waiting } from "../common/drawn";
import { positions, shortNames } from "../common/kinematics";
import type { Drawable } from "./store";
import { shown } from "../common/units";

interface Props {
  /** The pair's index in the scene, and its bodies. */
  pair: number | null;
  a: string | null;
  b: string | null;
  q: number[];
  robot: Drawable;
}

function whenIdle(call: () => void): void {
  if ("requestIdleCallback" in window) requestIdleCallback(call, { timeout: 1000 });
  else setTimeout(call, 100);
}

/** The robot is fetched and drawn once it is to be seen. */
export function Contact({ pair, a, b, q, robot: { model, problem } }: Props) {
  const place = useRef<HTMLDivElement>(null);
  const [seen, setSeen] = useState(false);
  useEffect(() => {
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      whenIdle(() => setSeen(true)); // What there is to read is drawn before it.
    });
    observer.observe(place.current!);
    return () => observer.disconnect();
  }, []);
  const names = model ? shortNames(positions(model)) : [];
  const where = q.map((value, i) => `${names[i] ?? `joint ${i}`} ${shown(value, model?.units[i] ?? "rad")}`).join(", ");
  const words = a && b ? `${a} and ${b} are painted` : "The configuration";
  return (
    <div ref={place}>
      {problem ? (
        <p class="notice bad">The robot cannot be drawn. {problem}</p>
      ) : seen && model ? (
        <Robot model={model} q={q} touching={pair === null ? [] : [model.pairs[pair]!]} framed label={`The robot at ${where}. ${words}`} />
      ) : (
        <Waiting>Loading the robot …</Waiting>
      )}
      <p class="small">
        {words}, at {where}.
      </p>
    </div>
  );
}
