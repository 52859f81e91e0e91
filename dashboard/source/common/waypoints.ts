// Reads a path from a file, as `ciris certify-path --path` does: JSON, or CSV with a row for each waypoint. It takes waypoints q only.
import { plural } from "./words";

export interface Path {
  /** (k, n), radians or metres. */
  q: number[][];
  /** When the robot is at each waypoint, ascending; null where the file does not say. */
  t: number[] | null;
}

const Q_ONLY = "This page takes waypoints q. `ciris certify-path --path` takes waypoints s and curves as well.";

/** Returns the path, or what is wrong with the file. */
export function readPath(name: string, text: string): Path | string {
  const kind = name.toLowerCase().split(".").at(-1);
  const path = kind === "json" ? ofJson(text) : kind === "csv" ? ofCsv(text) : "It is neither .json nor .csv.";
  if (typeof path === "string" || path.t === null) return path;
  const ascending = path.t.length === path.q.length && path.t.every((time, i) => i === 0 || time > path.t![i - 1]!);
  return ascending ? path : "Its t must be ascending numbers, one for each waypoint.";
}

/** Returns the object in a text of JSON, or what is wrong with it. */
export function objectOf(text: string, members: string): Record<string, unknown> | string {
  try {
    const document: unknown = JSON.parse(text);
    return typeof document === "object" && document !== null ? (document as Record<string, unknown>) : `It must be an object with ${members}.`;
  } catch {
    return "It is no JSON.";
  }
}

function ofJson(text: string): Path | string {
  const document = objectOf(text, "q, and perhaps t");
  if (typeof document === "string") return document;
  const { q, t = null, ...others } = document;
  if (["s", "bezier", "knots", "control_points"].some((other) => other in others)) return Q_ONLY;
  if (!Array.isArray(q) || !q.every(areNumbers)) return "Its q must be a list of waypoints, each of them a list of numbers.";
  if (t !== null && !areNumbers(t)) return "Its t must be a list of numbers.";
  return { q, t };
}

function ofCsv(text: string): Path | string {
  const rows = text.split(/\r\n|\r|\n/).filter((line) => line.trim() !== "").map((line) => line.split(",").map((cell) => cell.trim().replace(/^"(.*)"$/, "$1").trim()));
  if (rows.length === 0) return "It is empty.";
  const names = isNumber(rows[0]![0]!) ? [] : rows.shift()!;
  const columns = names.length || rows[0]!.length;
  const time = names.indexOf("t");
  const others = names.filter((name) => name !== "t");
  if (others.length > 0 && areNumbered("s", others)) return `Its columns are s. ${Q_ONLY}`;
  if (others.length > 0 && !areNumbered("q", others))
    return `Columns are in the scene's order of joints, and their names ${others.join(", ").slice(0, 200)} are not looked up. Name them q1, q2, ... in that order, and t; or leave the first row out.`;
  for (const [i, row] of rows.entries()) {
    const wrong = row.find((cell) => !isNumber(cell));
    if (wrong !== undefined) return `In waypoint ${i}, "${wrong}" is no number. Waypoints count from 0.`;
    if (row.length !== columns) return `Waypoint ${i} has ${plural(row.length, "number")}, and the first row has ${columns}. Waypoints count from 0.`;
  }
  const numbers = rows.map((row) => row.map(Number));
  return { q: numbers.map((row) => row.filter((_, i) => i !== time)), t: time < 0 ? null : numbers.map((row) => row[time]!) };
}

/** Whether columns are called q1, q2, ... or q0, q1, ..., where the letter is q. */
function areNumbered(letter: string, names: string[]): boolean {
  return [0, 1].some((first) => names.every((name, i) => name === `${letter}${first + i}`));
}

function isNumber(text: string): boolean {
  return text !== "" && Number.isFinite(Number(text));
}

function areNumbers(value: unknown): value is number[] {
  return Array.isArray(value) && value.every((one) => typeof one === "number");
}
