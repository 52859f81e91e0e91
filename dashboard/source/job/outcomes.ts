// What becomes of a pair: the letter of the service, and how people see it. Every outcome has a glyph, so that nobody needs colours.
import type { IterationStates, PairCell } from "../common/schema";
import { inText, type Unit } from "../common/units";
import { plural } from "../common/words";

export interface Outcome {
  /** The class that ciris.css colours. */
  name: string;
  glyph: string;
  words: string;
}

/** The worst first. */
export const OUTCOMES: Record<string, Outcome> = {
  r: { name: "refuted", glyph: "✗", words: "refuted" },
  e: { name: "error", glyph: "!", words: "error" },
  n: { name: "not_certifiable", glyph: "⊘", words: "not certifiable" },
  t: { name: "too_close", glyph: "‖", words: "too close" },
  i: { name: "inconclusive", glyph: "?", words: "inconclusive" },
  w: { name: "running", glyph: "◌", words: "running" },
  o: { name: "open", glyph: "·", words: "open" },
  s: { name: "skipped", glyph: "−", words: "skipped" },
  "-": { name: "absent", glyph: "", words: "not reached" },
  c: { name: "certified", glyph: "✓", words: "certified" },
  u: { name: "reused", glyph: "↺", words: "still proved" },
};

const ORDER = Object.keys(OUTCOMES).join("");
export const CERTIFIED = "cu";

/** How bad a letter is: 0 for the worst. */
export function badness(letter: string): number {
  return ORDER.indexOf(letter);
}

export function duration(seconds: number): string {
  if (seconds === 0) return "0 s";
  if (seconds < 0.1) return `${(1000 * seconds).toFixed(1)} ms`;
  if (seconds < 100) return `${seconds.toFixed(1)} s`;
  if (seconds < 6000) return `${Math.floor(seconds / 60)} min ${Math.floor(seconds % 60)} s`;
  return `${Math.floor(seconds / 3600)} h ${Math.floor((seconds % 3600) / 60)} min`;
}

/** A certified lower bound in millimetres, to three digits and rounded down: what is said is never more than what is proved. */
export function atLeast(metres: number): string {
  const [whole, parts] = metres.toFixed(100).split(".") as [string, string]; // All decimals that it has, so that nothing is rounded.
  const mm = `${whole}${parts.slice(0, 3)}.${parts.slice(3)}`.replace(/^0+(?=\d)/, "");
  const first = mm.search(/[1-9]/),
    point = mm.indexOf(".");
  if (first < 0) return "0 mm";
  return `${Number(mm.slice(0, Math.max(point, first + (first < point ? 4 : 3))))} mm`;
}

/** Says of a cell of the matrix all that is known: outcome, how, how long, what distance is proved, and where it fails. */
export function facts(letter: string, iteration: IterationStates, cell: PairCell | undefined, units: Unit[]): string[] {
  const found = [`${OUTCOMES[letter]!.words} in iteration ${iteration.index}`];
  if (!cell) return found;
  if (cell.stage) found.push(`by ${cell.stage.replaceAll("_", " ")}`);
  if (cell.seconds !== null) found.push(duration(cell.seconds));
  if (cell.proved_distance !== null) found.push(`at least ${atLeast(cell.proved_distance)} apart`);
  if (cell.parts > 1) found.push(`in ${cell.parts} parts`);
  // Of parts that have not ended, nothing is counted.
  if (cell.open_cells) found.push(`${plural(cell.open_cells, "open cell")}${cell.parts > 1 && "wos".includes(letter) ? " in those that have ended" : ""}`);
  if (cell.worker && letter === "w") found.push(`on ${cell.worker}`);
  if (cell.witness_q) found.push(`${letter === "r" ? "in collision" : "nearest"} at q = ${inText(cell.witness_q, units)}`);
  if (cell.detail) found.push(cell.detail);
  return found;
}
