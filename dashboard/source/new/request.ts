// What somebody wishes for in the form, and the request that asks for it.

export type Kind = "grow" | "cover" | "map";

/** An option as the service describes it (api/pages/form.py). A group has options of its own. */
export interface Option {
  name: string;
  takes: "whole" | "real" | "flag" | "choice" | "group";
  text: string;
  unit: string;
  default: number | string | boolean | null;
  least: number | null;
  greatest: number | null;
  choices: string[];
  options: Option[];
}

/** The options at a place of the request, such as `seed`. */
export interface Part {
  place: string;
  title: string;
  options: Option[];
}

export type Parts = Record<Kind, Part[]>;

/** Values by path, such as `options.cells`, as they were typed. Where there is none, the default holds. */
export type Given = Record<string, string>;

export interface Wish {
  kind: Kind;
  goal: "coverage" | "connect";
  given: Given;
  minutes: string;
  priority: string;
  /** More configurations: to contain, to begin with, to connect, or to prove first. */
  marks: number[][];
}

export const FIRST: Wish = { kind: "grow", goal: "coverage", given: {}, minutes: "", priority: "0", marks: [] };

/** The body of POST /v1/jobs. */
export function request(scene: string, q: number[], wish: Wish, parts: Parts): Record<string, unknown> {
  const { kind, goal, marks } = wish;
  const common = { kind, scene, ...(wish.minutes.trim() && { deadline_seconds: Number((60 * Number(wish.minutes)).toPrecision(12)) }), ...(wish.priority !== "0" && { priority: Number(wish.priority) }) };
  const { seed, options } = Object.fromEntries(parts[kind].map((part) => [part.place, values(part.options, part.place, wish.given)]));
  const named = marks.length > 0 && { [kind === "grow" ? "contain" : kind === "map" ? "at" : goal === "connect" ? "connect" : "seeds"]: marks };
  if (kind !== "grow") return { ...common, options: { ...named, ...options } };
  return { ...common, seed: { q, ...named, ...seed }, ...(Object.keys(options!).length && { options }) };
}

/** The options at a place that somebody has set. */
function values(options: Option[], place: string, given: Given): Record<string, unknown> {
  const found: Record<string, unknown> = {};
  for (const { name, takes, options: own } of options) {
    const path = `${place}.${name}`;
    const text = given[path]?.trim();
    if (text) found[name] = takes === "group" ? values(own, path, given) : takes === "flag" ? text === "true" : takes === "choice" ? text : Number(text);
  }
  return found;
}
