// The cells of a pair's proof: a tree of cuts that comes as a stream in preorder, the lower part of each cut first.

import type { Partition } from "./schema";

export const PLANE = -1;
export const EMPTY = -2;
export const OPEN = -3;
export const FOLDED = -4;

export interface Leaf {
  kind: number;
  lower: [number, number];
  upper: [number, number];
}

/** The leaves that a slice through the axes x and y meets at s, as boxes in these two coordinates. */
export function leavesInSlice(partition: Partition, s: number[], x: number, y: number): Leaf[] {
  const found: Leaf[] = [];
  let node = 0;
  let cut = 0;
  const skip = (): void => {
    // Passes over a subtree: as many leaves as cuts, and one more.
    for (let open = 1; open > 0; ) {
      if (partition.nodes[node++]! >= 0) {
        cut++;
        open++;
      } else open--;
    }
  };
  const walk = (lower: [number, number], upper: [number, number]): void => {
    const kind = partition.nodes[node++]!;
    if (kind < 0) {
      found.push({ kind, lower, upper });
      return;
    }
    const at = partition.cuts[cut++]!;
    const axis = kind === x ? 0 : kind === y ? 1 : null;
    if (axis === null) {
      if (s[kind]! <= at) {
        walk(lower, upper);
        skip();
      } else {
        skip();
        walk(lower, upper);
      }
      return;
    }
    const middleUpper: [number, number] = [...upper];
    const middleLower: [number, number] = [...lower];
    middleUpper[axis] = middleLower[axis] = at;
    walk(lower, middleUpper);
    walk(middleLower, upper);
  };
  walk([partition.lower[x]!, partition.lower[y]!], [partition.upper[x]!, partition.upper[y]!]);
  return found;
}

/** What a leaf is, in words. */
export function kindInWords(kind: number): string {
  return { [PLANE]: "separated by a plane", [EMPTY]: "misses the region", [OPEN]: "open", [FOLDED]: "cut further" }[kind] ?? "cut";
}
