// A configuration at which a pair touches, or is nearest, in 3D.
import type { ComponentType } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { positions, shortNames } from "../common/kinematics";
import type { SceneModel } from "../common/schema";
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

type Drawing = ComponentType<{ model: SceneModel; q: number[]; label: string; touching: number[] }>;

function whenIdle(call: () => void): void {
  if ("requestIdleCallback" in window) requestIdleCallback(call, { timeout: 1000 });
  else setTimeout(call, 100);
}

/** The robot is fetched and drawn once it is to be seen: three.js is large. */
export function Contact({ pair, a, b, q, robot: { model, problem } }: Props) {
  const place = useRef<HTMLDivElement>(null);
  const [Robot, setRobot] = useState<Drawing | null>(null);
  const [failed, setFailed] = useState<string | null>(null);
  useEffect(() => {
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      // What there is to read is drawn before it.
      whenIdle(
        () =>
          void import("../common/robot").then(
            (module) => setRobot(() => module.Robot),
            () => setFailed("The script that draws it could not be fetched. Load the page again."),
          ),
      );
    });
    observer.observe(place.current!);
    return () => observer.disconnect();
  }, []);
  const why = problem ?? failed;
  const names = model ? shortNames(positions(model)) : [];
  const where = q.map((value, i) => `${names[i] ?? `joint ${i}`} ${shown(value, model?.units[i] ?? "rad")}`).join(", ");
  const words = a && b ? `${a} and ${b} are painted` : "The configuration";
  return (
    <div ref={place}>
      {why && <p class="notice bad">The robot cannot be drawn. {why}</p>}
      {Robot && model ? (
        <Robot model={model} q={q} touching={pair === null ? [] : model.pairs[pair]!} label={`The robot at ${where}. ${words}`} />
      ) : (
        !why && <p class="drawing">Loading the robot …</p>
      )}
      <p class="small">
        {words}, at {where}.
      </p>
    </div>
  );
}
