// A region {s : C s <= d} in the browser, for drawing and for sliders that stay inside. Nothing is certified with it.

export interface Space {
  joints: string[];
  revolute: boolean[];
  q_star: number[];
  q_lower: number[];
  q_upper: number[];
}

/** What it takes to go from q to s and back. */
export type Charts = Pick<Space, "revolute" | "q_star">;

export interface Faces {
  C: number[][];
  d: number[];
}

/** A slider that stops exactly on a face may lie beyond it by rounding, so sliders stop this much earlier, in s. */
const INSIDE = 1e-9;

export function toS(space: Charts, q: number[]): number[] {
  return q.map((value, i) => (space.revolute[i] ? Math.tan((value - space.q_star[i]!) / 2) : value - space.q_star[i]!));
}

export function toQ(space: Charts, i: number, s: number): number {
  return space.q_star[i]! + (space.revolute[i] ? 2 * Math.atan(s) : s);
}

/** Between which positions each joint may move within the region while the others stay at q. */
export function rooms(space: Space, { C, d }: Faces, q: number[]): [number, number][] {
  const s = toS(space, q);
  const low = s.map(() => -Infinity);
  const high = s.map(() => Infinity);
  C.forEach((row, face) => {
    const slack = d[face]! - row.reduce((sum, c, i) => sum + c * s[i]!, 0);
    row.forEach((c, i) => {
      if (c > 0) high[i] = Math.min(high[i]!, s[i]! + slack / c - INSIDE);
      else if (c < 0) low[i] = Math.max(low[i]!, s[i]! + slack / c + INSIDE);
    });
  });
  return s.map((_, i) => [toQ(space, i, low[i]!), toQ(space, i, high[i]!)]);
}

export function contains(space: Space, { C, d }: Faces, q: number[]): boolean {
  const s = toS(space, q);
  return C.every((row, face) => row.reduce((sum, c, i) => sum + c * s[i]!, 0) <= d[face]!);
}
