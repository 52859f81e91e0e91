// What somebody wishes for in the form, and the request that asks for it.

/** An option as the service describes it (api/pages/form.py). A group has options of its own. */
export interface Option {
  name: string;
  label: string;
  takes: "whole" | "real" | "flag" | "choice" | "group";
  text: string;
  unit: string;
  default: number | string | boolean | null;
  least: number | null;
  greatest: number | null;
  choices: string[];
  options: Option[];
  /** What the command calls it. */
  argument: string;
}

/** The options at a place of the request, such as `seed`; "" is the request itself. */
export interface Part {
  place: string;
  title: string;
  options: Option[];
}

export type Kind = "grow" | "cover" | "map" | "certify" | "certify-path" | "recertify";
export type Parts = Record<Kind, Part[]>;

/** Values by path, such as `options.cells`, as they were typed. Where there is none, the default holds. */
export type Given = Record<string, string>;
export type Fields = Record<string, unknown>;

/** Fields of the request from a file; without a name they are those of an earlier job. */
export interface File {
  name: string;
  fields: Fields;
}

export interface Wish {
  kind: Kind;
  goal: "coverage" | "connect";
  given: Given;
  minutes: string;
  priority: string;
  /** More configurations: to contain, to begin with, to connect, to prove first, or waypoints. */
  marks: number[][];
  /** The polytope or the motion to certify. */
  file: File | null;
  /** The region to certify again. */
  region: string;
  /** Options of an earlier job for which the form has no fields. */
  kept: Fields;
  labels: Record<string, string>;
}

export const PRIORITIES = ["3", "2", "1", "0", "-1", "-2", "-3"];

export const FIRST: Wish = { kind: "grow", goal: "coverage", given: {}, minutes: "", priority: "0", marks: [], file: null, region: "", kept: {}, labels: {} };

/** The name of the marks in the request. */
export function markName({ kind, goal }: Wish): string {
  return { grow: "contain", map: "at", cover: goal === "connect" ? "connect" : "seeds", "certify-path": "q", certify: "", recertify: "" }[kind];
}

/** Whether a configuration is marked already. A motion may come back to one, but does not stay there. */
export function isMarked({ kind, marks }: Wish, q: number[]): boolean {
  return (kind === "certify-path" ? marks.slice(-1) : marks).some((mark) => mark.join() === q.join());
}

export function deadline({ minutes }: Wish): number | null {
  return minutes.trim() ? Number((60 * Number(minutes)).toPrecision(12)) : null;
}

/** The path of an option in the request. */
export function pathOf(place: string, name: string): string {
  return place ? `${place}.${name}` : name;
}

/** The body of POST /v1/jobs. */
export function request(scene: string, q: number[], wish: Wish, parts: Parts): Fields {
  const { kind, marks, labels, file, region, kept } = wish;
  const seconds = deadline(wish);
  const common = { kind, scene, ...(seconds !== null && { deadline_seconds: seconds }), ...(wish.priority !== "0" && { priority: Number(wish.priority) }), ...(Object.keys(labels).length > 0 && { labels }) };
  const { seed, options, "": own } = Object.fromEntries(parts[kind].map((part) => [part.place, values(part.options, part.place, wish.given)]));
  const named = marks.length > 0 && { [markName(wish)]: marks };
  switch (kind) {
    case "grow":
      return { ...common, seed: { q, ...named, ...seed }, ...(Object.keys(options!).length && { options }) };
    case "cover":
    case "map":
      return { ...common, options: { ...named, ...kept, ...options } };
    case "certify":
      return { ...common, polytope: file?.fields ?? { C: [], d: [] }, ...own };
    case "certify-path":
      return { ...common, ...(file?.fields ?? { q: marks }), ...own };
    case "recertify":
      return { ...common, region: region.trim(), ...own };
  }
}

/** What is missing before the request can be sent, in words. */
export function missing(wish: Wish): string | null {
  if (wish.kind === "cover" && wish.goal === "connect" && wish.marks.length < 2) return "Add at least two configurations to connect.";
  if (wish.kind === "certify" && !wish.file) return "Choose the file with the polytope.";
  if (wish.kind === "certify-path" && !wish.file && wish.marks.length < 2) return "Choose the file with the motion, or add at least two waypoints.";
  return wish.kind === "recertify" && !wish.region.trim() ? "Name the region to certify again." : null;
}

/** The options at a place that somebody has set. */
function values(options: Option[], place: string, given: Given): Fields {
  const found: Fields = {};
  for (const { name, takes, options: own } of options) {
    const path = pathOf(place, name);
    const text = given[path]?.trim();
    if (text) found[name] = takes === "group" ? values(own, path, given) : takes === "flag" ? text === "true" : takes === "choice" ? text : Number(text);
  }
  return found;
}
