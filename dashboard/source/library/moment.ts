// What is known of one configuration: what touches there, which regions hold it, and which is nearest. The latest answer counts.
import { useEffect, useState } from "preact/hooks";
import { post, said } from "../shared/api";

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
