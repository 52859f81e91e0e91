// The form filled in: with what an earlier job was asked for, and with what the address gives.
import type { Job } from "../common/schema";
import { readQ, written, type Stated } from "../common/address";
import { FIRST, markName, pathOf, PRIORITIES, type Fields, type Given, type Kind, type Option, type Part, type Parts, type Wish } from "./request";

export interface Start {
  scene: string | null;
  q: string | null;
  /** What gives the configuration. */
  by: string;
  wish: Wish;
  /** The earlier job that fills the form in. */
  from: string | null;
}

/** What the address asks for: `scene`, `q`, `kind`, `goal`, `region`, `minutes`, `priority`, each `mark`, and any option by its path, as
 *  `options.cells`. A mark that is empty says that there are none. */
export function asked(query: URLSearchParams, parts: Parts, from: Job | null): Start {
  const before = from ? wishOf(from, parts) : { q: null, wish: FIRST };
  const kind = query.get("kind") as Kind | null;
  const wish = { ...before.wish, ...(kind && kind in parts && { kind }) };
  const given = { ...wish.given };
  const marks = query.getAll("mark");
  for (const path of pathsOf(parts[wish.kind])) given[path] = query.get(path) ?? given[path] ?? "";
  return {
    scene: query.get("scene") ?? from?.scene ?? null,
    q: query.get("q") ?? before.q?.join(",") ?? null,
    by: query.has("q") ? "The address" : "The earlier job",
    wish: {
      ...wish,
      given,
      goal: query.get("goal") === "connect" ? "connect" : query.has("goal") ? "coverage" : wish.goal,
      minutes: query.get("minutes") ?? wish.minutes,
      priority: PRIORITIES.includes(query.get("priority") ?? "") ? query.get("priority")! : wish.priority,
      region: query.get("region") ?? wish.region,
      marks: marks.length ? marks.flatMap((text) => (text ? [readQ(text, text.split(",").length)] : [])).filter((mark) => mark !== null) : wish.marks,
    },
    from: from?.id ?? null,
  };
}

/** What the address says of a wish, so that it asks for the same. A file is not in it. */
export function stated(wish: Wish, parts: Parts, { from }: Start): Stated {
  // An earlier job may have what is empty now.
  const said = (text: string, usual = ""): string | null => (text !== usual || from ? text : null);
  return {
    kind: said(wish.kind, FIRST.kind),
    goal: wish.kind === "cover" ? said(wish.goal, FIRST.goal) : null,
    minutes: said(wish.minutes),
    priority: said(wish.priority, FIRST.priority),
    region: wish.kind === "recertify" ? said(wish.region) : null,
    mark: !markName(wish) ? null : wish.marks.length ? wish.marks.map(written) : from ? "" : null,
    ...Object.fromEntries(pathsOf(parts[wish.kind]).map((path) => [path, said(wish.given[path] ?? "")])),
  };
}

/** The paths of all options, those of groups' members too. */
function pathsOf(parts: Pick<Part, "place" | "options">[]): string[] {
  return parts.flatMap(({ place, options }) => options.flatMap((one) => [pathOf(place, one.name), ...pathsOf([{ place: pathOf(place, one.name), options: one.options }])]));
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
