// What a job has reached over time: a share that its regions or cells keep, cover or prove.
import { get } from "../common/api";
import type { Cover, GrowthCurve, JobMap } from "../common/schema";

export interface Point {
  seconds: number;
  /** Null where a region is of a job that has no starting region. */
  share: number | null;
  /** The iteration, or how many regions there were, as the measure says; null where nothing is counted. */
  number: number | null;
  region: string | null;
}

export type Known = Point & { share: number };

/** The points whose share is known: those of a curve. */
export function known(points: Point[]): Known[] {
  return points.filter((point): point is Known => point.share !== null);
}

/** A share that jobs of some kinds are about. Every share is estimated from samples. */
export interface Measure {
  title: string;
  /** What follows the last share in a sentence. */
  reached: string;
  /** What each share is a part of, where several jobs are compared. */
  whole: string;
  /** What is proved, although the share is estimated. */
  proved: string;
  /** What the points' numbers are; null where they have none. */
  number: string | null;
  points: (job: string) => Promise<Point[]>;
}

const KEPT: Measure = {
  title: "Kept of the starting region, over time",
  reached: "of the starting region is kept",
  whole: "of the job's own starting region",
  proved: "each region is certified by its own proof",
  number: "Iteration",
  points: async (job) => {
    const { points } = await get<GrowthCurve>(`/v1/jobs/${job}/growth`);
    return points.map(({ seconds, share, iteration, region }) => ({ seconds, share, number: iteration, region }));
  },
};

const COVERED: Measure = {
  title: "Covered, over time",
  reached: "of the free configurations are in regions of the scene",
  whole: "of the free configurations",
  proved: "each region is certified by its own proof",
  number: "Regions",
  points: async (job) => (await get<Cover>(`/v1/jobs/${job}/cover`)).curve.map(([seconds, share, regions]) => ({ seconds, share, number: regions, region: null })),
};

const PROVED: Measure = {
  title: "Proved, over time",
  reached: "of the free configurations are proved",
  whole: "of the free configurations",
  proved: "the cells are proved",
  number: null,
  points: async (job) => (await get<JobMap>(`/v1/jobs/${job}/map`)).curve.map(([seconds, share]) => ({ seconds, share, number: null, region: null })),
};

/** What jobs of a kind are measured by. */
export function measureOf(kind: string): Measure {
  return { cover: COVERED, map: PROVED }[kind] ?? KEPT;
}
