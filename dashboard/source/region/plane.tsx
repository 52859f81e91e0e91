// The plane of a pair's proof at the configuration that is shown: of the cell that holds it, which is asked for when the robot leaves the last.
import { useEffect, useMemo, useState } from "preact/hooks";
import { get, said } from "../common/api";
import { toS, type Space } from "../common/polytope";
import type { SceneModel, SeparatingPlane } from "../common/schema";
import type { PlaneDrawn } from "../common/square";

export interface PlaneShown {
  cell: SeparatingPlane | null;
  drawn: PlaneDrawn | null;
  problem: string | null;
}

function holds({ lower, upper }: SeparatingPlane, s: number[]): boolean {
  return s.every((value, i) => lower[i]! <= value && value <= upper[i]!);
}

/** The plane of a pair, or of none, at q, which must be inside the region; where it is not, nothing is proved and nothing shown. */
export function usePlane(region: string, model: SceneModel, space: Space, pair: number | null, q: number[], inside: boolean): PlaneShown {
  const [found, setFound] = useState<SeparatingPlane | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const s = toS(space, q);
  const cell = found && found.pair.index === pair && inside && holds(found, s) ? found : null;
  const asks = pair !== null && inside && !cell;
  useEffect(() => {
    setProblem(null);
    if (!asks) return;
    const stop = new AbortController();
    get<SeparatingPlane>(`/v1/regions/${region}/pairs/${pair}/plane?${q.map((value) => `q=${value}`).join("&")}`, stop.signal).then(setFound, (reason: unknown) => {
      if (!stop.signal.aborted) setProblem(said(reason));
    });
    return () => stop.abort();
  }, [region, pair, asks, asks && q.join()]);
  const drawn = useMemo(() => {
    if (!cell) return null;
    const at = [1, ...cell.joints.map((joint) => s[joint]!)];
    const [x, y, z, b] = cell.Z.map((row) => row.reduce((sum, value, i) => sum + value * at[i]!, 0)) as [number, number, number, number];
    const bodies = [cell.pair.a, cell.pair.b].map((name) => model.geometries.findIndex((geometry) => geometry.name === name)) as [number, number];
    // What stands for a condition has no body to be drawn.
    if (bodies.some((i) => model.geometries[i]!.vertices.length === 0)) return null;
    return { plane: { frame: cell.frame, a: [x, y, z], b }, pair: bodies };
  }, [model, cell, q.join()]);
  return { cell, drawn, problem };
}

/** Which plane is drawn, and what proves it. */
export function PlaneText({ shown: { cell, drawn, problem }, pair, inside }: { shown: PlaneShown; pair: number | null; inside: boolean }) {
  if (pair === null) return null;
  return (
    <p class="small plane-said" role="status">
      {problem ? `The plane cannot be drawn: ${problem}` : cell ? <><span class="proved">Proved:</span> the plane of cell {cell.cell} is between {cell.volumes[0]} and {cell.volumes[1]}. {drawn ? `It moves in the frame of ${cell.frame}.` : "It is not drawn, because one of the two stands for a condition."}</> : inside ? "Looking for the plane …" : "The robot is outside the region: no plane is proved here."}
    </p>
  );
}
