// A scene and its library of regions: the robot, which regions hold it, how they are connected, slices, and motions.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { inAddress, readQ, unlessUsual, useAddress, within } from "../common/address";
import { get, MAY_START, post, said } from "../common/api";
import { InClaim } from "../common/claim";
import { positions } from "../common/kinematics";
import { MomentText, touchingOf, useMoment } from "../common/moment";
import { nearby } from "../common/nearby";
import type { Space } from "../common/polytope";
import { Robot } from "../common/drawn";
import type { Approach, ContactsResponse, GraphResponse, RegionConfigurations, SceneModel } from "../common/schema";
import { Slice } from "../common/slice";
import { Sliders } from "../common/sliders";
import { plural } from "../common/words";
import { coverage, type Coverage } from "./coverage";
import { Graph } from "./graph";
import { Player, type Shown } from "./player";
import { Planning, type Free } from "./plan";
import { Upload } from "./upload";

const ASK_AGAIN_MS = 1500;

/** `known` and `mapped`: how many regions the scene had when the page was made, and whether it had a map. */
export function LibraryIsland({ scene, known, mapped }: { scene: string; known: number; mapped: boolean }) {
  const [model, setModel] = useState<SceneModel | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    get<SceneModel>(`/v1/scenes/${scene}/model`).then(setModel, (reason: unknown) => setProblem(said(reason)));
  }, [scene]);
  if (problem) return <p class="notice bad">The scene cannot be drawn: {problem}</p>;
  if (!model) return <p class="empty">Loading the robot …</p>;
  return <Library model={model} known={known} mapped={mapped} />;
}

function Library({ model, known, mapped }: { model: SceneModel; known: number; mapped: boolean }) {
  const names = useMemo(() => positions(model), [model]);
  const space: Space = useMemo(() => ({ joints: names, revolute: model.units.map((unit) => unit === "rad"), q_star: model.q_star, q_lower: model.q_lower, q_upper: model.q_upper }), [model]);
  const usual = useMemo(() => within(model, model.q_star), [model]);
  const [q, setQ] = useState(() => within(model, readQ(inAddress("q"), names.length) ?? usual));
  const [graph, setGraph] = useState<GraphResponse | null>(null);
  const [graphProblem, setGraphProblem] = useState<string | null>(null);
  const [covered, setCovered] = useState<Coverage | null>(null);
  const [chosen, setChosen] = useState<string | null>(null);
  const [motion, setMotion] = useState<Shown | null>(null);
  const stay = useRef<HTMLDivElement>(null);
  const [pair, setPair] = useState<Approach | null>(null);
  const moment = useMoment(model.scene, q);
  /** Where the robot and motions begin in place of q*, where that is not free. */
  const [free, setFree] = useState<Free | null>(null);
  const [left, setLeft] = useState(false);
  const latest = useRef(q);
  latest.current = q;
  const untouched = useMemo(() => (inAddress("q") === null ? q : null), []);
  const looked = useRef(false);
  useAddress({ q: unlessUsual(q, usual) });

  // Nobody has asked for q*. Where it is not free, the robot and motions begin in a region, or beside q*.
  useEffect(() => {
    if (!graph || looked.current) return;
    looked.current = true;
    // Without an answer they stay, and what is wrong there is said.
    void insteadOf(model, usual, graph.nodes[0]?.region).catch(() => null).then((found) => {
      setFree(found);
      if (!found || latest.current !== untouched) return;
      setQ(found.q);
      setLeft(true);
    });
  }, [graph]);
  useEffect(() => {
    let timer: ReturnType<typeof setTimeout> | undefined;
    const ask = (): void => {
      get<GraphResponse>(`/v1/planning/graph?scene=${model.scene}`).then(
        (found) => {
          setGraph(found);
          if (!found.complete) timer = setTimeout(ask, ASK_AGAIN_MS);
        },
        (reason: unknown) => setGraphProblem(said(reason)),
      );
    };
    ask();
    return () => clearTimeout(timer);
  }, [model]);
  const regions = graph?.nodes.length ?? 0;
  const some = regions > 0;
  useEffect(() => {
    if (some) void coverage(model).then(setCovered, () => setCovered(null));
  }, [model, regions]);

  const choose = (region: string): void => {
    setChosen(region);
    void centre(region).then(setQ, (reason: unknown) => setGraphProblem(said(reason)));
  };
  const showPair = (found: Approach): void => {
    setPair(found);
    setQ(found.q);
  };
  // A pair that was asked for is painted as long as the robot is there.
  const touching = useMemo(
    () => (pair?.q === q ? [model.geometries.flatMap(({ name }, i) => (name === pair.a || name === pair.b ? i : []))] : touchingOf(model, moment)),
    [moment, model, pair, q],
  );
  const way = motion?.way ?? [];
  // On a narrow screen the robot is above what asked for the motion.
  useEffect(() => {
    if (motion) stay.current!.firstElementChild!.scrollIntoView();
  }, [motion]);
  const holding = useMemo(() => new Set(moment.regions), [moment]);
  return (
    <div class="library">
      <InClaim place="now"><MomentText moment={moment} /></InClaim>
      <InClaim place="motion">{motion && <p>{motion.claim}</p>}</InClaim>
      <div class="views">
        <div class="stay" ref={stay}>
          <Robot model={model} q={q} onDrag={setQ} touching={touching} label={`The robot of ${model.name}${pair?.q === q ? `, with ${pair.a} and ${pair.b} painted` : touching.length ? ", not free" : ""}`} />
          {free && left && <p class="quiet small">At q*, {free.why}. The robot began at {free.where}.</p>}
          {motion && <Player motion={motion} names={names} units={model.units} onMove={setQ} />}
          <Sliders names={names} units={model.units} lower={model.q_lower} upper={model.q_upper} q={q} onChange={setQ} />
        </div>
        <div>
          <Slice scene={model.scene} space={space} units={model.units} q={q} onPick={setQ} strongest={chosen} way={motion?.q} mapped={mapped} />
        <section aria-labelledby="h-graph">
          <h2 id="h-graph">Connected regions</h2>
          {graphProblem && <p class="notice bad">{graphProblem}</p>}
          {!graph ? !graphProblem && <p class={known ? "empty graph" : "empty"}>Comparing the regions …</p> : !some ? (
            <p class="empty">This scene has no region yet.{MAY_START && <> <a href={`/new?scene=${model.scene}`}>Start a job</a> that grows one.</>}</p>
          ) : (
            <>
              <p class="counts">
                <strong>{graph.nodes.length}</strong> {graph.nodes.length === 1 ? "region" : "regions"}, {plural(graph.edges.length, "overlap")}, <strong>{graph.components}</strong> <abbr title="Regions are in one component where overlaps lead from each to every other one">{graph.components === 1 ? "component" : "components"}</abbr>{!graph.complete && ", so far"}.{" "}
                {covered && <><span class="computed">They cover <strong>{(100 * covered.value).toFixed(0)} ± {Number((100 * covered.stderr).toPrecision(1))} %</strong> of the free configurations</span>, by a sample of {covered.free}.</>}
              </p>
              <Graph graph={graph} holding={holding} way={way} chosen={chosen} onChoose={choose} />
              <p class="quiet small">Choose a region to go to its centre. A ring around a region: it holds the configuration of the robot.{way.some(Boolean) && " A blue edge: the planned motion goes through it."}</p>
              <details>
                <summary>Overlaps as a table</summary>
                <div class="scroll tall" tabIndex={0} role="region" aria-label="Overlaps">
                  <table>
                    <thead><tr><th>Region</th><th>Region</th><th class="number">Depth in <InS /></th></tr></thead>
                    <tbody>
                      {graph.edges.map(({ a, b, depth, q: witness }) => (
                        <tr key={`${a} ${b}`}>
                          <td><a href={`/regions/${a}`}><code>{a.slice(0, 8)}</code></a></td>
                          <td><a href={`/regions/${b}`}><code>{b.slice(0, 8)}</code></a></td>
                          <td class="number"><button type="button" class="plain" onClick={() => setQ(witness)} aria-label={`${depth.toPrecision(3)}, go to the overlap of ${a.slice(0, 8)} and ${b.slice(0, 8)}`}>{depth.toPrecision(3)}</button></td>
                        </tr>
                      ))}
                    </tbody>
                  </table>
                </div>
              </details>
              {graph.gaps.length > 0 && (
                <details>
                  <summary>{plural(graph.gaps.length, "gap")} between components</summary>
                  <ul>
                    {graph.gaps.map((gap) => (
                      <li key={`${gap.a} ${gap.b}`}>{gap.distance.toPrecision(3)} in <InS /> between {gap.a.slice(0, 8)} and {gap.b.slice(0, 8)}: {gap.map ? "the map proves the straight motion across it" : <Advice scene={model.scene} q={gap.q} onLook={setQ} />}</li>
                    ))}
                  </ul>
                </details>
              )}
            </>
          )}
        </section>
          <section aria-labelledby="h-plan">
            <h2 id="h-plan">Plan a motion</h2>
            <Planning model={model} names={names} usual={usual} free={free} q={q} onMove={setQ} onShow={setMotion} />
          </section>
          {MAY_START && (
            <section aria-labelledby="h-upload">
              <h2 id="h-upload">Certify a motion</h2>
              <Upload model={model} onMove={setQ} onPair={showPair} onShow={setMotion} />
            </section>
          )}
        </div>
      </div>
    </div>
  );
}

/** A free configuration in place of this one, where something is wrong at it; null where nothing is, or where none was found. */
async function insteadOf(model: SceneModel, q: number[], region: string | undefined): Promise<Free | null> {
  const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene: model.scene, q: [q] });
  const why = contacts[0]!.trouble[0];
  const found = why && (await (region ? centre(region) : nearby(model, q)));
  return found ? { q: found, why, where: region ? `the centre of region ${region.slice(0, 8)}` : "a free configuration near it" } : null;
}

async function centre(region: string): Promise<number[]> {
  return (await get<RegionConfigurations>(`/v1/regions/${region}/configurations?samples=0`)).center;
}

/** The coordinates of regions, which not everybody knows. */
function InS() {
  return <abbr title="s = tan((q − q*) / 2) for a joint that turns, and q − q* for one that slides">s</abbr>;
}

/** What people can do about a gap between two components. */
function Advice({ scene, q, onLook }: { scene: string; q: number[] | null; onLook: (q: number[]) => void }) {
  if (!q) return <>no free configuration was found near its middle</>;
  return <><button type="button" class="plain" onClick={() => onLook(q)}>look there</button>{MAY_START && <> <a href={`/new?scene=${scene}&q=${q.join(",")}`}>grow a region there</a></>}</>;
}
