// What limits the region, in words, and the configuration in contact in 3D.
import { useState } from "preact/hooks";
import type { Obstacle } from "../common/schema";
import { Contact } from "./contact";
import { plural } from "./outcomes";
import { address } from "./route";
import type { Drawable } from "./store";

const AT_FIRST = 5;

export function Obstacles({ obstacles, robot, whom }: { obstacles: Obstacle[] | null; robot: Drawable; whom: string }) {
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
                  <p>{one.text}</p>
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
