// A pair of a job: what has become of it in each iteration, where it touches, and its cells.
import { useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { ServiceError, get, said } from "../common/api";
import { ofCondition, positions } from "../common/kinematics";
import { Cells } from "../common/partition";
import type { Partition } from "../common/schema";
import { Contact } from "./contact";
import { Said } from "./obstacles";
import { OUTCOMES, facts } from "./outcomes";
import { address, go, type Route } from "./route";
import type { JobStore, Drawable } from "./store";

interface Props {
  store: JobStore;
  version: number;
  robot: Drawable;
  scene: string;
  route: Route & { pair: number };
}

export function Pair({ store, version, robot, scene, route }: Props) {
  const heading = useRef<HTMLHeadingElement>(null);
  const [partition, setPartition] = useState<Partition | null>(null);
  const [problem, setProblem] = useState<{ text: string; again: boolean } | null>(null);
  const [attempt, setAttempt] = useState(0);
  const pair = store.pairs[route.pair];
  const iteration = store.iterations.find((one) => one.index === route.iteration) ?? store.last;
  const letter = iteration?.states[route.pair] ?? "-";
  const cell = iteration && store.cell(iteration.index, route.pair);
  void version; // the store has changed: it is drawn again

  useLayoutEffect(() => {
    heading.current?.focus({ preventScroll: true });
    heading.current?.closest("section")?.scrollIntoView({ block: "start" });
  }, [route.pair]);
  useEffect(() => {
    if (iteration) store.want(iteration.index);
  }, [iteration?.index]);
  useEffect(() => {
    const abort = new AbortController();
    const which = route.iteration === null ? "" : `?iteration=${route.iteration}`;
    get<Partition>(`/v1/jobs/${store.job}/pairs/${route.pair}/cells${which}`, abort.signal).then(
      (found) => {
        setPartition(found);
        setProblem(null);
      },
      (reason: unknown) => {
        if (abort.signal.aborted) return;
        setPartition(null);
        const without = reason instanceof ServiceError && reason.code === "cells_not_found";
        setProblem({ text: without ? `${sentence(reason.message)}.` : said(reason), again: !without });
      },
    );
    return () => abort.abort();
    // It is asked again when the pair has got a result.
  }, [store.job, route.pair, route.iteration, letter, cell?.open_cells, attempt]);

  if (!pair)
    return (
      <p class="notice bad">
        There is no pair {route.pair} in this scene. <a href="#">All pairs</a>
      </p>
    );
  const here = { pair: route.pair, iteration: route.iteration };
  const about = store.obstacles?.find((one) => one.pair === route.pair);
  const where = cell?.witness_q ?? (letter === "c" || letter === "u" ? null : about?.q);
  // What stands below the robot, or in the sentences about the pair, is not said twice.
  const rest = cell && { ...cell, witness_q: where ? null : cell.witness_q, detail: cell.detail && about?.text.includes(cell.detail) ? null : cell.detail };
  return (
    <section aria-labelledby="h-pair" class="pair">
      <p class="path">
        <a href="#">← All pairs</a>
      </p>
      <h2 id="h-pair" tabIndex={-1} ref={heading}>
        {pair.a} <span class="quiet">–</span> {pair.b}{" "}
        <span class={`badge ${OUTCOMES[letter]!.name}`}>
          {OUTCOMES[letter]!.glyph} {OUTCOMES[letter]!.words}
        </span>
      </h2>
      <Iterations store={store} pair={route.pair} current={iteration?.index} />
      <div class={where ? "stage" : ""}>
        {where && <Contact pair={route.pair} a={pair.a} b={pair.b} q={where} robot={robot} />}
        <div>
          {iteration && <p class="said">{sentence(facts(letter, iteration, rest, store.units).join("; "))}.</p>}
          {about && <p class="said"><Said about={about} scene={iteration ? scene : null} units={store.units} /></p>}
        </div>
      </div>
      {problem &&
        (problem.again ? (
          <p class="notice bad" role="alert">
            The cells could not be fetched. {problem.text}{" "}
            <button type="button" onClick={() => setAttempt(attempt + 1)}>
              Try again
            </button>
          </p>
        ) : (
          <p class="empty">{problem.text}</p>
        ))}
      {!problem && !partition && (
        <p class="empty" role="status">
          Loading the cells …
        </p>
      )}
      {partition && (
        <>
          <h3>Cells</h3>
          <p>{words(partition, iteration?.index)}</p>
          <Planes store={store} pair={route.pair} iteration={iteration?.index} />
          <Cells
            partition={partition}
            joints={robot.model ? positions(robot.model) : []}
            root={route.root}
            cell={route.cell}
            onZoom={(root) => go({ ...here, root, cell: route.cell })}
            onCell={(chosen) => go({ ...here, root: route.root, cell: chosen }, route.cell !== null)}
          />
        </>
      )}
    </section>
  );
}

/** The pair's outcome in each iteration, the newest first; each leads to what the pair was there. */
function Iterations({ store, pair, current }: { store: JobStore; pair: number; current: number | undefined }) {
  const there = store.iterations.filter(({ states }) => states[pair] !== "-").reverse();
  if (there.length < 2) return null;
  return (
    <nav class="strip" aria-label="Iterations of the pair">
      <span class="quiet" aria-hidden="true">
        Iteration
      </span>
      {there.map(({ index, states }) => {
        const { name, glyph, words: outcome } = OUTCOMES[states[pair]!]!;
        return (
          <a
            key={index}
            class={`cell ${name}`}
            href={address({ pair, iteration: index === store.last?.index ? null : index })}
            title={`${outcome} in iteration ${index}`}
            aria-current={index === current ? "true" : undefined}
          >
            <span aria-hidden="true">
              {index} {glyph}
            </span>
            <span class="sr">
              iteration {index}: {outcome}
            </span>
          </a>
        );
      })}
    </nav>
  );
}

/** Leads to the region of the iteration, or to the job's last one, whose page draws the pair's plane at each configuration. */
function Planes({ store, pair, iteration }: { store: JobStore; pair: number; iteration: number | undefined }) {
  const point = store.reached.find((one) => one.number === iteration) ?? store.reached.at(-1);
  if (!point?.region) return null;
  return (
    <p>
      The page of{" "}
      <a href={`/regions/${point.region}#pair=${pair}`}>
        region <code>{point.region.slice(0, 8)}</code>
      </a>
      , of iteration {point.number}, draws the plane between the two at each configuration.
    </p>
  );
}

function sentence(text: string): string {
  return text.charAt(0).toUpperCase() + text.slice(1);
}

function words({ pair, certified, kind, iteration }: Partition, asked: number | undefined): string {
  const condition = [pair.a, pair.b].find(ofCondition)?.split("/")[1];
  const held = condition === undefined ? "the two bodies are apart" : `the condition '${condition}' holds with room`;
  const parts = [
    certified
      ? `A verified proof says that ${held} in every cell, on all of the polytope.`
      : "The pair is not certified. Cells with a plane count only once all cells have one, and the proof is verified.",
  ];
  if (kind === "program") parts.push("One plane, which moves with the joints, separates them everywhere: there is one cell.");
  if (iteration !== null && iteration !== asked) parts.push(`The cells are those of iteration ${iteration}, whose proof still holds.`);
  return parts.join(" ");
}
