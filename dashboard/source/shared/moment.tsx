// What is known of one configuration: what touches there, which regions hold it, and which is nearest. The latest answer counts.
import { useEffect, useState } from "preact/hooks";
import { post, said } from "./api";
import type { SceneModel } from "./kinematics";

export interface Moment {
  /** Indices of the pairs that touch; undefined while nobody knows; empty where a joint is outside the window. */
  pairs?: number[];
  regions: string[];
  nearest: { region: string; distance: number } | null;
  problem: string | null;
}

const PAUSE_MS = 60;
const NOTHING: Moment = { regions: [], nearest: null, problem: null };

export function useMoment(scene: string, q: number[]): Moment {
  const [moment, setMoment] = useState<Moment>(NOTHING);
  useEffect(() => {
    const stop = new AbortController();
    const body = { scene, q: [q] };
    const ask = async (): Promise<void> => {
      const [touching, containing] = await Promise.all([
        post<{ contacts: { pairs: number[] | null }[] }>("/v1/planning/contacts", body, stop.signal),
        post<{ regions: number; points: { regions: { region: string }[] }[] }>("/v1/planning/contains", body, stop.signal),
      ]);
      const regions = containing.points[0]!.regions.map(({ region }) => region);
      let nearest: Moment["nearest"] = null;
      if (regions.length === 0 && containing.regions > 0) {
        const near = await post<{ points: { nearest: Moment["nearest"] }[] }>("/v1/planning/nearest", body, stop.signal);
        nearest = near.points[0]!.nearest;
      }
      setMoment({ pairs: touching.contacts[0]!.pairs ?? [], regions, nearest, problem: null });
    };
    const timer = setTimeout(() => {
      ask().catch((reason: unknown) => {
        if (!stop.signal.aborted) setMoment({ ...NOTHING, problem: said(reason) });
      });
    }, PAUSE_MS);
    return () => {
      clearTimeout(timer);
      stop.abort();
    };
  }, [scene, q.join()]);
  return moment;
}

/** The geometries that touch, by index. */
export function touchingOf(model: SceneModel, moment: Moment): number[] {
  return [...new Set((moment.pairs ?? []).flatMap((pair) => model.pairs[pair] ?? []))];
}

/** Says in words what is known of the configuration, and how surely. */
export function MomentText({ model, moment }: { model: SceneModel; moment: Moment }) {
  const { pairs, regions, nearest, problem } = moment;
  const names = (pairs ?? []).map((pair) => model.pairs[pair]!.map((i) => model.geometries[i]!.name).join(" and "));
  return (
    <p class="said" role="status">
      {problem ? <span class="bad">{problem}</span> : pairs === undefined ? "…" : names.length ? (
        <span class="bad">In collision: {names.slice(0, 3).join("; ")}{names.length > 3 && `; and ${names.length - 3} more pairs`}.</span>
      ) : regions.length ? (
        <span class="good">In {regions.length === 1 ? "a certified region" : `${regions.length} certified regions`}: {regions.slice(0, 4).map((region, i) => <>{i > 0 && ", "}<a href={`/regions/${region}`} key={region}>{region.slice(0, 8)}</a></>)}. No collision, as proved.</span>
      ) : (
        <span>Free here, by floating point, and in no certified region{nearest && <>; the nearest is <a href={`/regions/${nearest.region}`}>{nearest.region.slice(0, 8)}</a>, {nearest.distance.toPrecision(3)} away in s</>}.</span>
      )}
    </p>
  );
}
