// A pair of a job: what has become of it, and its cells.
import { useEffect, useRef, useState } from "preact/hooks";
import { get, said } from "../shared/api";
import { Cells } from "../shared/cells/cells";
import type { Partition } from "../shared/cells/tree";
import { positions, type SceneModel } from "../shared/kinematics";
import { OUTCOMES, facts } from "./outcomes";
import { go, type Route } from "./route";
import type { JobStore } from "./store";

interface Props {
  store: JobStore;
  version: number;
  model: SceneModel | null;
  route: Route & { pair: number };
}

export function Pair({ store, version, model, route }: Props) {
  const heading = useRef<HTMLHeadingElement>(null);
  const [partition, setPartition] = useState<Partition | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const pair = store.pairs[route.pair];
  const iteration = store.iterations.find((one) => one.index === route.iteration) ?? store.last;
  const letter = iteration?.states[route.pair] ?? "-";
  const cell = iteration && store.cell(iteration.index, route.pair);
  void version; // the store has changed: it is drawn again

  useEffect(() => heading.current?.focus(), [route.pair]);
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
        setProblem(said(reason));
      },
    );
    return () => abort.abort();
    // It is asked again when the pair has got a result.
  }, [store.job, route.pair, route.iteration, letter, cell?.open_cells]);

  if (!pair) return <p class="notice bad">There is no pair {route.pair} in this scene. <a href="#">All pairs</a></p>;
  const here = { pair: route.pair, iteration: route.iteration };
  return (
    <section aria-labelledby="h-pair">
      <p class="path"><a href="#">← All pairs</a></p>
      <h2 id="h-pair" tabIndex={-1} ref={heading}>{pair.a} <span class="quiet">–</span> {pair.b}{" "}
        <span class={`badge ${OUTCOMES[letter]!.name}`}>{OUTCOMES[letter]!.glyph} {OUTCOMES[letter]!.words}</span></h2>
      {iteration && <p class="said">{facts(letter, iteration, cell).join("; ")}.</p>}
      {problem && <p class="empty">{problem}</p>}
      {!problem && !partition && <p class="empty">Loading the cells …</p>}
      {partition && (
        <>
          <p>{partition.certified
            ? "A verified proof says that the two bodies are apart in every cell, on all of the polytope."
            : "The pair is not certified. What the search has found in cells with a plane counts only once all cells have one and the proof is verified."}
            {partition.kind === "program" && " One plane, which moves with the joints, separates them everywhere: there is one cell."}</p>
          <Cells partition={partition} joints={model ? positions(model) : []} root={route.root} cell={route.cell}
            onZoom={(root) => go({ ...here, root, cell: route.cell })} onCell={(chosen) => go({ ...here, root: route.root, cell: chosen }, route.cell !== null)} />
        </>
      )}
    </section>
  );
}
