// Whether something stands between the configurations that a region shall hold, which ends the job at once (certifier/seeding/lines.py).
import { useEffect, useState } from "preact/hooks";
import { post } from "../common/api";
import { toQ, toS, type Space } from "../common/polytope";
import type { ContactsResponse, SceneModel } from "../common/schema";
import { inText } from "../common/units";

/** The service answers about this many configurations at a time. */
const MOST = 100;
const SETTLED_MS = 300;

/** Says what blocks a region that holds all of these configurations; null where nothing was found at samples, which is no proof.
 *  The first is the seed. A region is convex in s, so it holds the straight lines in s between its points. */
export async function blocked(model: SceneModel, points: number[][], signal?: AbortSignal): Promise<string | null> {
  if (points.length < 2) return null;
  const space: Space = { joints: [], revolute: model.units.map((unit) => unit === "rad"), q_star: model.q_star, q_lower: model.q_lower, q_upper: model.q_upper };
  const s = points.map((q) => toS(space, q));
  const between = (a: number, b: number, part: number): number[] => s[a]!.map((from, i) => toQ(space, i, from + part * (s[b]![i]! - from)));
  const ends = points.map((q, i) => ({ q, where: i === 0 ? "this configuration" : `configuration ${i}` }));
  const pairs = points.flatMap((_, b) => points.slice(0, b).map((_, a) => [a, b] as const));
  const each = Math.max(1, Math.floor((MOST - ends.length) / pairs.length));
  const lines = pairs.flatMap(([a, b]) =>
    Array.from({ length: each }, (_, k) => ({ q: between(a, b, (k + 1) / (each + 1)), where: `the straight line in s from ${ends[a]!.where} to ${ends[b]!.where}` })),
  );
  const samples = [...ends, ...lines].slice(0, MOST);
  const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene: model.scene, q: samples.map(({ q }) => q) }, signal);
  const first = contacts.findIndex(({ pairs }) => pairs !== null && pairs.length > 0);
  if (first < 0) return null;
  const { q, where } = samples[first]!;
  const at = `${contacts[first]!.trouble[0]}, at ${inText(q, model.units)}`;
  if (first < ends.length) return `No region can contain ${where}: ${at} (computed).${first ? " Remove it from the list." : ""}`;
  return `One region cannot contain both ends of ${where}: ${at} (computed). It would hold all of that line. Remove one of them, or connect them with several regions.`;
}

/** The same about configurations that change, once they have stayed for a moment. */
export function useBlocked(model: SceneModel, points: number[][]): string | null {
  const key = JSON.stringify(points);
  const [known, setKnown] = useState<{ key: string; text: string | null }>({ key: "", text: null });
  useEffect(() => {
    const stop = new AbortController();
    const timer = setTimeout(() => {
      // Whether the service answers is said beside the robot, and asked again when the job begins.
      blocked(model, points, stop.signal).then((text) => setKnown({ key, text }), () => undefined);
    }, SETTLED_MS);
    return () => {
      clearTimeout(timer);
      stop.abort();
    };
  }, [model, key]);
  return known.key === key ? known.text : null;
}
