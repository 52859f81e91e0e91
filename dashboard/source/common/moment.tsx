// What is known of one configuration: what touches there, which regions, motions and map prove it, and what is proved nearest. An
// answer counts for the configuration that it was asked for, and for no other.
import { useEffect, useRef, useState } from "preact/hooks";
import { post, said } from "./api";
import type { ContactsResponse, ContainsResponse, Near, NearestResponse, SceneModel } from "./schema";

export interface Moment {
  /** Indices of the pairs that touch; null where that is not known, undefined before the answer. */
  pairs?: number[] | null;
  /** All that is wrong, in words. */
  trouble: string[];
  regions: string[];
  /** The proved motions whose tubes hold it. */
  motions: string[];
  /** The job whose map proves it; null where none does. */
  map: string | null;
  nearest: Near | null;
  problem: string | null;
}

const AGAIN_MS = 2000;
const NOTHING: Moment = { trouble: [], regions: [], motions: [], map: null, nearest: null, problem: null };

async function ask(scene: string, q: number[]): Promise<Moment> {
  const body = { scene, q: [q] };
  const [touching, containing] = await Promise.all([
    post<ContactsResponse>("/v1/planning/contacts", body),
    post<ContainsResponse>("/v1/planning/contains", body),
  ]);
  const { pairs, outside, trouble } = touching.contacts[0]!;
  const { inside, motions, map } = containing.points[0]!;
  const regions = containing.points[0]!.regions.map(({ region }) => region);
  let nearest: Moment["nearest"] = null;
  if (!inside && (containing.regions > 0 || containing.map) && outside.length === 0) {
    nearest = (await post<NearestResponse>("/v1/planning/nearest", body)).points[0]!.nearest;
  }
  return { pairs, trouble, regions, motions, map: map ? containing.map : null, nearest, problem: null };
}

/** Asks about one configuration at a time, then about the latest; where the service does not answer, again. */
export function useMoment(scene: string, q: number[]): Moment {
  const key = `${scene} ${q.join()}`;
  const [known, setKnown] = useState<{ key: string; moment: Moment }>({ key: "", moment: NOTHING });
  const latest = useRef({ key, scene, q });
  const asking = useRef({ busy: false, over: false, timer: 0 });
  latest.current = { key, scene, q };
  const next = async (): Promise<void> => {
    const state = asking.current;
    if (state.busy || state.over) return;
    clearTimeout(state.timer);
    state.busy = true;
    const asked = latest.current;
    let moment: Moment;
    try {
      moment = await ask(asked.scene, asked.q);
    } catch (reason) {
      moment = { ...NOTHING, problem: said(reason) };
      state.timer = window.setTimeout(() => void next(), AGAIN_MS);
    }
    state.busy = false;
    if (state.over) return clearTimeout(state.timer);
    setKnown({ key: asked.key, moment });
    if (latest.current.key !== asked.key) void next();
  };
  useEffect(() => void next(), [key]);
  useEffect(
    () => () => {
      asking.current.over = true;
      clearTimeout(asking.current.timer);
    },
    [],
  );
  return known.key === key ? known.moment : NOTHING;
}

/** The pairs of geometries that touch, by index. */
export function touchingOf(model: SceneModel, moment: Moment): number[][] {
  return (moment.pairs ?? []).flatMap((pair) => (model.pairs[pair] ? [model.pairs[pair]] : []));
}

/** Says in words what is known of the configuration, and how surely. */
export function MomentText({ moment }: { moment: Moment }) {
  const { pairs, trouble, regions, motions, map, nearest, problem } = moment;
  return (
    <p class="said" role="status">
      {problem ? <span class="bad">{problem}</span> : pairs === undefined ? "…" : trouble.length ? (
        <span class="bad computed">Not free: {trouble.slice(0, 3).join("; ")}{trouble.length > 3 && `; and ${trouble.length - 3} more`}.</span>
      ) : pairs === null ? "Not known here: a joint is half a turn away from q*." : regions.length ? (
        <span class="proved">In {regions.length === 1 ? "a certified region" : `${regions.length} certified regions`}: {regions.slice(0, 4).map((region, i) => <>{i > 0 && ", "}<a href={`/regions/${region}`} key={region}>{region.slice(0, 8)}</a></>)}. No collision of the scene's pairs, as proved.</span>
      ) : motions.length ? (
        <span class="proved">In the tube of the proved motion {motions[0]!.slice(0, 8)}. No collision of the scene's pairs, as proved.</span>
      ) : map ? (
        <span class="proved">In proved cells of the <a href={`/jobs/${map}`}>map</a>. No collision of the scene's pairs, as proved.</span>
      ) : (
        <span><span class="computed">No collision (computed, not proved)</span>, and in no certified region{nearest && <>; the nearest is {nearest.region ? <a href={`/regions/${nearest.region}`}>{nearest.region.slice(0, 8)}</a> : <>in the <a href={`/jobs/${nearest.map}`}>map</a></>}</>}.</span>
      )}
    </p>
  );
}
