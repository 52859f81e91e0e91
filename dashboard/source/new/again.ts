// The form filled in: with what an earlier job was asked for, and with what the address gives.
import type { Job } from "../common/schema";
import { FIRST, pathOf, type Fields, type Given, type Kind, type Option, type Part, type Parts, type Wish } from "./request";

export interface Start {
  scene: string | null;
  q: string | null;
  wish: Wish;
}

/** What the address asks for: `scene`, `q`, `kind`, `region`, `minutes`, and any option by its path, as `options.cells`. */
export function asked(query: URLSearchParams, parts: Parts, from: Job | null): Start {
  const before = from ? wishOf(from, parts) : { q: null, wish: FIRST };
  const kind = query.get("kind") as Kind | null;
  const wish = { ...before.wish, ...(kind && kind in parts && { kind }) };
  const given = { ...wish.given };
  for (const path of parts[wish.kind].flatMap(({ place, options }) => options.map(({ name }) => pathOf(place, name)))) given[path] = query.get(path) ?? given[path] ?? "";
  return {
    scene: query.get("scene") ?? from?.scene ?? null,
    q: query.get("q") ?? before.q?.join(",") ?? null,
    wish: { ...wish, given, minutes: query.get("minutes") ?? wish.minutes, region: query.get("region") ?? wish.region },
  };
}

function wishOf(job: Job, parts: Parts): { q: number[] | null; wish: Wish } {
  const options = job.options as Fields;
  const seed = (options.seed ?? {}) as Fields;
  const kind = job.kind as Kind;
  const wish = {
    ...FIRST,
    kind,
    given: Object.assign({}, ...parts[kind].map((part) => givenOf(part, part.place === "seed" ? seed : options))) as Given,
    minutes: job.deadline_at ? String(Number(((Date.parse(job.deadline_at) - Date.parse(job.created_at)) / 60_000).toPrecision(6))) : "",
    priority: String(job.priority),
    labels: job.labels,
  };
  switch (kind) {
    case "grow":
      return { q: seed.q as number[], wish: { ...wish, marks: (seed.contain ?? []) as number[][] } };
    case "cover":
    case "map": {
      const connect = (options.connect ?? []) as number[][];
      const kept = Object.fromEntries(["paths", "former"].filter((name) => (options[name] as unknown[] | null)?.length).map((name) => [name, options[name]]));
      const first = (options.seeds ?? options.at ?? []) as number[][];
      // A cover may begin at configurations and connect others. The form has one list.
      if (connect.length && first.length) kept.seeds = first;
      return { q: null, wish: { ...wish, kept, goal: connect.length ? "connect" : "coverage", marks: connect.length ? connect : first } };
    }
    case "certify":
      return { q: null, wish: { ...wish, file: { name: "", fields: seed } } };
    case "certify-path": {
      const motion = Object.fromEntries(Object.entries(options).filter(([name]) => !parts[kind].some((part) => part.options.some((one) => one.name === name))));
      return { q: null, wish: { ...wish, file: { name: "", fields: motion } } };
    }
    case "recertify":
      return { q: null, wish: { ...wish, region: seed.region as string } };
  }
}

/** The options of a part that a job has otherwise than by default. */
function givenOf({ place, options }: Pick<Part, "place" | "options">, from: Fields): Given {
  const given: Given = {};
  for (const one of options) {
    const value = from[one.name];
    if (value === null || value === undefined || value === one.default || isOff(one, value)) continue;
    const path = pathOf(place, one.name);
    if (one.takes === "group") Object.assign(given, { [path]: "true" }, givenOf({ place: path, options: one.options }, value as Fields));
    else given[path] = String(value);
  }
  return given;
}

function isOff({ takes, default: usual }: Option, value: unknown): boolean {
  return takes === "flag" && !value && !usual;
}
