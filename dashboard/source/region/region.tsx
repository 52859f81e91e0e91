// A region to walk about in: the robot swept through it, sliders that stay inside, the ends of each joint, slices, cells.
import { useEffect, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { inAddress, readQ, unlessUsual, useAddress, within } from "../common/address";
import { get, said } from "../common/api";
import { InClaim } from "../common/claim";
import { shortNames } from "../common/kinematics";
import { contains, rooms, toQ, toS, type Faces, type Space } from "../common/polytope";
import { Robot } from "../common/drawn";
import type { Partition, RegionConfigurations, RegionDetail, RegionPair, RegionPairs, SceneModel } from "../common/schema";
import { ofCondition } from "../common/kinematics";
import { Slice } from "../common/slice";
import { Sliders } from "../common/sliders";
import { plural } from "../common/words";
import { PlaneText, usePlane } from "./plane";
import { SaveAsHtml } from "./save";

/** The keys of a manifest that the page needs. */
interface Manifest {
  space: Space;
  halfspace_normals: number[][];
  halfspace_offsets: number[];
}

interface Loaded {
  region: RegionDetail;
  model: SceneModel;
  configurations: RegionConfigurations;
  pairs: RegionPair[];
}

const SAMPLES = 150;
const GHOSTS = 40;
const SECONDS_EACH = 0.9;

/** The pair that the page's fragment names, as in #pair=3; null where it names none. */
function named(pairs: RegionPair[]): number | null {
  const name = new URLSearchParams(location.hash.slice(1)).get("pair");
  return pairs.find(({ index }) => String(index) === name)?.index ?? null;
}

async function load(id: string): Promise<Loaded> {
  const [region, configurations, { pairs }] = await Promise.all([
    get<RegionDetail>(`/v1/regions/${id}`),
    get<RegionConfigurations>(`/v1/regions/${id}/configurations?samples=${SAMPLES}`),
    get<RegionPairs>(`/v1/regions/${id}/pairs`),
  ]);
  return { region, configurations, pairs, model: await get<SceneModel>(`/v1/scenes/${region.scene}/model`) };
}

export function RegionIsland({ region }: { region: string }) {
  const [loaded, setLoaded] = useState<Loaded | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    load(region).then(setLoaded, (reason: unknown) => setProblem(said(reason)));
  }, [region]);
  if (problem) return <p class="notice bad">The region cannot be drawn: {problem}</p>;
  if (!loaded) return <p class="empty">Loading the robot …</p>;
  return <Explorer id={region} {...loaded} />;
}

function Explorer({ id, region, model, configurations, pairs }: Loaded & { id: string }) {
  const { space, halfspace_normals: C, halfspace_offsets: d } = region.manifest as unknown as Manifest;
  const faces: Faces = useMemo(() => ({ C, d }), [region]);
  const usual = configurations.seed ?? configurations.center;
  const [q, setQ] = useState(() => {
    const given = readQ(inAddress("q"), space.joints.length);
    return given ? within(space, given) : usual;
  });
  const [swept, setSwept] = useState(true);
  const section = useRef<HTMLElement>(null);
  const [pair, setPair] = useState(() => named(pairs));
  const [cells, setCells] = useState<Partition | null>(null);
  const [cellsProblem, setCellsProblem] = useState<string | null>(null);
  const [playing, setPlaying] = usePlay(space, configurations.samples, q, setQ);
  const only = useMemo(() => [id], [id]);
  useAddress({ q: unlessUsual(q, usual) });
  useEffect(() => history.replaceState(history.state, "", `${location.pathname}${location.search}${pair === null ? "" : `#pair=${pair}`}`), [pair]);
  const ghosts = useMemo(() => (swept ? configurations.samples.slice(0, GHOSTS) : []), [swept, configurations]);
  const names = shortNames(space.joints);
  const inside = contains(space, faces, q);
  const plane = usePlane(id, model, space, pair, q, inside);
  const bodies = pairs.filter(({ a, b }) => !ofCondition(a) && !ofCondition(b)).length;
  const kept = bodies < pairs.length ? ", and the conditions hold" : "";
  const proved = `The robot is inside the region: no collision of the ${bodies === 1 ? "covered pair" : `${bodies} covered pairs`}${kept}, as proved.`;

  useLayoutEffect(() => {
    if (pair !== null) section.current!.scrollIntoView();
  }, []);
  useEffect(() => {
    setCells(null);
    setCellsProblem(null);
    if (pair === null) return;
    const stop = new AbortController();
    get<Partition>(`/v1/regions/${id}/pairs/${pair}/cells`, stop.signal).then(setCells, (reason: unknown) => {
      if (!stop.signal.aborted) setCellsProblem(said(reason));
    });
    return () => stop.abort();
  }, [id, pair]);

  const go = (to: number[]): void => {
    setPlaying(false);
    setQ(to);
  };
  const most = useMemo(() => [...pairs].sort((a, b) => b.cells - a.cells), [pairs]);
  return (
    <section aria-labelledby="h-explore" class="explore" ref={section}>
      <h2 id="h-explore">Look inside</h2>
      <InClaim place="now">
        <p role="status" class={inside ? "proved" : "inside not"}>{inside ? proved : "The robot is outside the region: nothing is proved here."}</p>
      </InClaim>
      <div class="toolbar">
        <button type="button" aria-pressed={playing} onClick={() => setPlaying(!playing)}>{playing ? "Pause" : "Sweep through the region"}</button>
        <button type="button" onClick={() => go(configurations.center)}>Centre</button>
        {configurations.seed && <button type="button" onClick={() => go(configurations.seed!)}>Seed</button>}
        <label><input type="checkbox" checked={swept} onChange={(event) => setSwept(event.currentTarget.checked)} /> show {GHOSTS} samples</label>
        <SaveAsHtml region={id} saved={{ model, space, faces, q, proved }} />
      </div>
      <div class="views">
        <div class="stay">
          <Robot model={model} q={q} ghosts={ghosts} plane={plane.drawn} label={`The robot of ${model.name} inside the region${swept ? `, with ${GHOSTS} samples of it` : ""}`} />
          <div class="joints">
            <Sliders names={space.joints} units={model.units} lower={space.q_lower} upper={space.q_upper} allowed={inside ? rooms(space, faces, q) : undefined} q={q} onChange={go} />
            <div class="ends" role="group" aria-label="Ends of each joint within the region">
              {configurations.extremes.map((extreme, i) => (
                <p key={extreme.joint}>
                  <span class="sr">{names[i]}: </span>
                  <button type="button" onClick={() => go(extreme.lower)} aria-label={`${extreme.joint} min`}>min</button>{" "}
                  <button type="button" onClick={() => go(extreme.upper)} aria-label={`${extreme.joint} max`}>max</button>
                </p>
              ))}
            </div>
          </div>
        </div>
        <div>
          <Slice scene={region.scene} space={space} units={model.units} q={q} onPick={go} regions={only} strongest={id} cells={cells} />
          <label class="pair-choice">
            Cells of the pair{" "}
            <select value={pair ?? ""} onChange={(event) => setPair(event.currentTarget.value === "" ? null : Number(event.currentTarget.value))}>
              <option value="">none</option>
              {most.map((proof) => (
                <option value={proof.index} key={proof.index}>{`${proof.a} – ${proof.b}: ${plural(proof.cells, "cell")}`}</option>
              ))}
            </select>
          </label>
          <PlaneText shown={plane} pair={pair} inside={inside} />
          {cellsProblem && <p class="notice bad">{cellsProblem}</p>}
        </div>
      </div>
    </section>
  );
}

/**
 * Moves q from sample to sample while it plays, straight in s, in which the region is convex. Who prefers less motion sees it go in steps.
 * It is a layout effect because its cleanup then runs with the render that says that the robot is paused: no frame moves the robot after that.
 */
function usePlay(space: Space, samples: number[][], q: number[], setQ: (q: number[]) => void): [boolean, (play: boolean) => void] {
  const [playing, setPlaying] = useState(false);
  const from = useRef(q);
  from.current = q;
  useLayoutEffect(() => {
    if (!playing || samples.length === 0) return;
    const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    let [begin, began, next, frame] = [toS(space, from.current), performance.now(), 0, 0];
    const step = (now: number): void => {
      const part = Math.min((now - began) / 1000 / SECONDS_EACH, 1);
      const target = toS(space, samples[next % samples.length]!);
      const eased = still ? Math.floor(part) : part * part * (3 - 2 * part);
      if (!still || part === 1) setQ(begin.map((value, i) => toQ(space, i, value + (target[i]! - value) * eased)));
      if (part === 1) [begin, began, next] = [target, now, next + 1];
      frame = requestAnimationFrame(step);
    };
    frame = requestAnimationFrame(step);
    return () => cancelAnimationFrame(frame);
  }, [playing, samples, space]);
  return [playing, setPlaying];
}
