// What a page shows stands in its address, so that whoever opens the address sees the same.
import { useEffect } from "preact/hooks";
import { leaving, withUnits } from "./units";

/** A value, several of them under one name, or null for one that the address does not have. */
export type Stated = Record<string, string | string[] | null>;

/** Browsers refuse an address that changes with every frame of a motion. */
const SETTLED_MS = 300;

/** Reads a value from the address; null where it has none. */
export function inAddress(name: string): string | null {
  return new URLSearchParams(location.search).get(name);
}

/** Keeps these values in the address, once they have stayed for a moment. Others stay as they are. */
export function useAddress(stated: Stated): void {
  useEffect(() => {
    const timer = setTimeout(() => {
      if (leaving) return;
      const query = new URLSearchParams(location.search);
      for (const [name, value] of Object.entries(stated)) {
        query.delete(name);
        for (const one of value === null ? [] : [value].flat()) query.append(name, one);
      }
      const text = withUnits(query);
      history.replaceState(history.state, "", (text === "?" ? location.pathname : text) + location.hash);
    }, SETTLED_MS);
    return () => clearTimeout(timer);
  }, [JSON.stringify(stated)]);
}

/** A configuration in the address: radians or metres, with commas between. */
export function written(q: number[]): string {
  return q.map((value) => Number(value.toFixed(4))).join(",");
}

/** Reads a configuration from the address; null where it is not one number for each joint. */
export function readQ(text: string | null, joints: number): number[] | null {
  const numbers = text?.split(",").map(Number) ?? [];
  return numbers.length === joints && numbers.every(Number.isFinite) ? numbers : null;
}

/** The same, or null where it is the usual one, which an address leaves out. */
export function unlessUsual(q: number[], usual: number[]): string | null {
  const text = written(q);
  return text === written(usual) ? null : text;
}

/** The nearest configuration within the limits. */
export function within({ q_lower, q_upper }: { q_lower: number[]; q_upper: number[] }, q: number[]): number[] {
  return q.map((value, i) => Math.min(Math.max(value, q_lower[i]!), q_upper[i]!));
}
