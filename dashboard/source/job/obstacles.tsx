// What limits the region, in words, and the configuration in contact in 3D.
import { useState } from "preact/hooks";
import type { Obstacle } from "../common/schema";
import { inText, type Unit } from "../common/units";
import { plural } from "../common/words";
import { Contact } from "./contact";
import { address } from "./route";
import type { Drawable } from "./store";

const AT_FIRST = 5;

interface Words {
  about: Obstacle;
  /** Whose page the configuration leads to. Null for none: a motion ends where bodies begin to touch, and rounding may see no contact there. */
  scene: string | null;
  units: Unit[];
}

/** What stands in the way, in words. The configuration in them leads to the page of the scene, where the robot stands there. */
export function Said({ about: { text, at, q }, scene, units }: Words) {
  if (!at || !q) return <>{text}</>;
  const [before, after] = text.split(at);
  const named = `q = (${inText(q, units)})`;
  if (!scene) return <>{before}{named}{after}</>;
  return (
    <>
      {before}
      <a href={`/scenes/${scene}?q=${q.join(",")}`} title="The robot at this configuration">{named}</a>
      {after}
    </>
  );
}

interface Props {
  obstacles: Obstacle[] | null;
  robot: Drawable;
  whom: string;
  scene: string;
  units: Unit[];
}

export function Obstacles({ obstacles, robot, whom, scene, units }: Props) {
  const [all, setAll] = useState(false);
  const [chosen, setChosen] = useState<string | null>(null);
  if (obstacles === null) return null;
  const key = ({ pair, text }: Obstacle): string => `${pair} ${text}`;
  const inView = all ? obstacles : obstacles.slice(0, AT_FIRST);
  const drawn = obstacles.find((one) => key(one) === chosen) ?? obstacles.find(({ q }) => q !== null);
  return (
    <section aria-labelledby="h-obstacles">
      <h2 id="h-obstacles">What limits {whom}</h2>
      {obstacles.length === 0 ? (
        <p class="empty">Nothing is known to limit it.</p>
      ) : (
        <div class={drawn?.q ? "stage" : ""}>
          {drawn?.q && <Contact {...drawn} q={drawn.q} robot={robot} />}
          <div>
            <ol class="obstacles">
              {inView.map((one) => (
                <li key={key(one)} class={one === drawn ? "chosen" : ""}>
                  <p><Said about={one} scene={whom === "the motion" ? null : scene} units={units} /></p>
                  <p class="links">
                    {one.q && (
                      <button type="button" class="plain" aria-pressed={one === drawn} onClick={() => setChosen(key(one))}>
                        Show in 3D
                      </button>
                    )}{" "}
                    {one.pair !== null && <a href={address({ pair: one.pair })}>Open the pair</a>}
                  </p>
                </li>
              ))}
            </ol>
            {obstacles.length > inView.length && (
              <button type="button" onClick={() => setAll(true)}>
                Show all {plural(obstacles.length, "obstacle")}
              </button>
            )}
          </div>
        </div>
      )}
    </section>
  );
}
