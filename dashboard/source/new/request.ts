// What somebody wishes for in the form, and the request that asks for it.

export type Kind = "grow" | "cover";
export const METHODS = {
  iris_np2: "IRIS (Drake's IrisNp2)",
  iris_zo: "IRIS, sampling only (Drake's IrisZo)",
} as const;
export type Method = keyof typeof METHODS;

/** Numbers are as they were typed; an empty text leaves the choice to the service. */
export interface Wish {
  kind: Kind;
  method: Method;
  goal: "coverage" | "connect";
  coverage: string;
  regions: string;
  cells: string;
  stages: string;
  minutes: string;
  priority: string;
  /** More configurations: to contain, to begin with, or to connect. */
  marks: number[][];
}

export const FIRST: Wish = { kind: "grow", method: "iris_np2", goal: "coverage", coverage: "95", regions: "", cells: "", stages: "", minutes: "", priority: "0", marks: [] };

/** The body of POST /v1/jobs. */
export function request(scene: string, q: number[], wish: Wish): Record<string, unknown> {
  const common = { scene, ...given("deadline_seconds", wish.minutes, 60), ...(wish.priority !== "0" && { priority: Number(wish.priority) }) };
  const effort = { ...given("cells", wish.cells), ...given("stages", wish.stages) };
  if (wish.kind === "grow") {
    const seed = { q, ...(wish.method !== "iris_np2" && { method: wish.method }), ...(wish.marks.length && { contain: wish.marks }) };
    return { kind: "grow", ...common, seed, ...(Object.keys(effort).length && { options: effort }) };
  }
  const goal = wish.goal === "coverage" ? { ...given("coverage", wish.coverage, 0.01), ...(wish.marks.length && { seeds: wish.marks }) } : { connect: wish.marks };
  return { kind: "cover", ...common, options: { ...goal, ...given("regions", wish.regions), ...effort } };
}

function given(name: string, text: string, scale = 1): Record<string, number> {
  return text.trim() === "" ? {} : { [name]: Number((Number(text) * scale).toPrecision(12)) };
}
