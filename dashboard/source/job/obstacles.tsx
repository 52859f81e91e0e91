// What holds the region back, in words, and the configuration in contact in 3D.
import type { ComponentType } from "preact";
import { useEffect, useRef, useState } from "preact/hooks";
import { positions, shortNames, shown, type SceneModel } from "../shared/kinematics";
import { plural } from "./outcomes";
import { address } from "./route";
import type { Obstacle } from "./store";

const AT_FIRST = 5;

export function Obstacles({ obstacles, model }: { obstacles: Obstacle[] | null; model: SceneModel | null }) {
  const [all, setAll] = useState(false);
  const [chosen, setChosen] = useState<string | null>(null);
  if (obstacles === null) return null;
  const key = ({ pair, text }: Obstacle): string => `${pair} ${text}`;
  const inView = all ? obstacles : obstacles.slice(0, AT_FIRST);
  const drawn = obstacles.find((one) => key(one) === chosen) ?? obstacles.find(({ q }) => q !== null);
  return (
    <section aria-labelledby="h-obstacles">
      <h2 id="h-obstacles">What holds the region back</h2>
      {obstacles.length === 0 ? <p class="empty">Nothing that is known.</p> : (
        <div class={drawn?.q ? "stage" : ""}>
          {drawn?.q && <Contact obstacle={drawn} q={drawn.q} model={model} />}
          <div>
            <ol class="obstacles">
              {inView.map((one) => (
                <li key={key(one)} class={one === drawn ? "chosen" : ""}>
                  <p>{one.text}</p>
                  <p class="links">
                    {one.q && <button type="button" class="link" aria-pressed={one === drawn} onClick={() => setChosen(key(one))}>Show in 3D</button>}{" "}
                    {one.pair !== null && <a href={address({ pair: one.pair })}>Open the pair</a>}
                  </p>
                </li>
              ))}
            </ol>
            {obstacles.length > inView.length && <button type="button" onClick={() => setAll(true)}>Show all {plural(obstacles.length, "obstacle")}</button>}
          </div>
        </div>
      )}
    </section>
  );
}

type Drawing = ComponentType<{ model: SceneModel; q: number[]; label: string; touching: number[] }>;

/** The robot is fetched and drawn once it is to be seen: three.js is large. */
function Contact({ obstacle, q, model }: { obstacle: Obstacle; q: number[]; model: SceneModel | null }) {
  const place = useRef<HTMLDivElement>(null);
  const [Robot, setRobot] = useState<Drawing | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    const observer = new IntersectionObserver((entries) => {
      if (!entries.some((entry) => entry.isIntersecting)) return;
      observer.disconnect();
      import("../shared/robot").then((module) => setRobot(() => module.Robot), () => setFailed(true));
    });
    observer.observe(place.current!);
    return () => observer.disconnect();
  }, []);
  const names = model ? shortNames(positions(model)) : [];
  const where = q.map((value, i) => `${names[i] ?? `joint ${i}`} ${shown(value, model?.units[i] ?? "rad")}`).join(", ");
  const words = obstacle.a && obstacle.b ? `${obstacle.a} and ${obstacle.b} are painted` : "The configuration";
  return (
    <div ref={place}>
      {failed && <p class="notice bad">The drawing could not be fetched.</p>}
      {Robot && model ? <Robot model={model} q={q} touching={obstacle.pair === null ? [] : model.pairs[obstacle.pair]!} label={`The robot at ${where}. ${words}`} /> : !failed && <p class="empty drawing">Loading the robot …</p>}
      <p class="small">{words}, at {where}.</p>
    </div>
  );
}
