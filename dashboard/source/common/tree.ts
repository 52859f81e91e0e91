// Where each cell of a partition is, how large, and what it is.
import { EMPTY, FOLDED, OPEN, PLANE } from "./cells";
import type { CellCounts, Partition } from "./schema";

export interface Bounds {
  joint: number;
  /** Radians or metres. */
  lower: number;
  upper: number;
}

/** The nodes in preorder, the lower part of each cut first: the first child of node i is i + 1, the second `end[i + 1]`. */
export class Tree {
  readonly size: number;
  /** One past the last node below each node. */
  readonly end: Int32Array;
  readonly parent: Int32Array;
  readonly depth: Uint16Array;
  /** Share of the root cell, measured in q over the joints in play. */
  readonly volume: Float64Array;
  /** How many nodes at or below are open. */
  readonly open: Int32Array;
  /** For a cut its number among the cuts, for a plane among the choices, for a folded cell among the folded ones. */
  private readonly place: Int32Array;

  constructor(readonly of: Partition) {
    const count = of.nodes.length;
    this.size = count;
    this.end = new Int32Array(count);
    this.parent = new Int32Array(count).fill(-1);
    this.depth = new Uint16Array(count);
    this.volume = new Float64Array(count);
    this.open = new Int32Array(count);
    this.place = new Int32Array(count);
    this.read();
  }

  private read(): void {
    const { nodes, cuts, folded } = this.of;
    const lower = [...this.of.lower], upper = [...this.of.upper];
    let next = 0, cut = 0, plane = 0, fold = 0;
    const visit = (parent: number, depth: number, volume: number): void => {
      const node = next++, kind = nodes[node]!;
      this.parent[node] = parent;
      this.depth[node] = depth;
      this.volume[node] = volume;
      if (kind >= 0) {
        const low = lower[kind]!, high = upper[kind]!, at = cuts[cut]!;
        this.place[node] = cut++;
        const width = this.q(kind, high) - this.q(kind, low);
        const part = width > 0 ? (this.q(kind, at) - this.q(kind, low)) / width : 0.5;
        upper[kind] = at;
        visit(node, depth + 1, volume * part);
        upper[kind] = high;
        lower[kind] = at;
        visit(node, depth + 1, volume * (1 - part));
        lower[kind] = low;
        this.open[node] = this.open[node + 1]! + this.open[this.end[node + 1]!]!;
      } else {
        if (kind === PLANE) this.place[node] = plane++;
        if (kind === FOLDED) this.place[node] = fold++;
        this.open[node] = kind === OPEN ? 1 : kind === FOLDED ? folded[this.place[node]!]!.open : 0;
      }
      this.end[node] = next;
    };
    visit(-1, 0, 1);
  }

  /** The joint's position at s, radians or metres. */
  q(joint: number, s: number): number {
    return this.of.q_star[joint]! + (this.of.revolute[joint] ? 2 * Math.atan(s) : s);
  }

  isCut(node: number): boolean {
    return this.of.nodes[node]! >= 0;
  }

  /** Whether a plane separates simple volumes about the bodies, and not the bodies themselves. */
  isCoarse(node: number): boolean {
    const [a, b] = this.volumes(node)!;
    return a !== this.of.pair.a || b !== this.of.pair.b;
  }

  /** In words what the plane of this cell separates; null for a cell without a plane. */
  volumes(node: number): [string, string] | null {
    return this.of.nodes[node] === PLANE ? this.of.volumes[this.of.choices[this.place[node]!]!]! : null;
  }

  foldedBelow(node: number): CellCounts | null {
    return this.of.nodes[node] === FOLDED ? this.of.folded[this.place[node]!]! : null;
  }

  /** From the root to the node, both included. */
  path(node: number): number[] {
    const found = [];
    for (let at = node; at >= 0; at = this.parent[at]!) found.push(at);
    return found.reverse();
  }

  /** The bounds of a cell in the joints in play. */
  bounds(node: number): Bounds[] {
    const lower = [...this.of.lower], upper = [...this.of.upper], path = this.path(node);
    for (let i = 1; i < path.length; i++) {
      const above = path[i - 1]!, joint = this.of.nodes[above]!, at = this.of.cuts[this.place[above]!]!;
      if (path[i] === above + 1) upper[joint] = at;
      else lower[joint] = at;
    }
    return this.of.joints.map((joint) => ({ joint, lower: this.q(joint, lower[joint]!), upper: this.q(joint, upper[joint]!) }));
  }

  /** At most `most` cells below a node: those that are open before the others, and the largest first. */
  foremost(root: number, most: number): number[] {
    const open = this.largest(root, most / 2, (node) => this.open[node]! > 0);
    return [...open, ...this.largest(root, most - open.length, (node) => this.open[node] === 0)];
  }

  private largest(root: number, most: number, counts: (node: number) => boolean): number[] {
    const before = (a: number, b: number): number => this.volume[b]! - this.volume[a]! || a - b;
    let found: number[] = [], least = -1;
    for (let node = root; node < this.end[root]!; node++) {
      if (this.isCut(node) || this.volume[node]! <= least || !counts(node)) continue;
      found.push(node);
      // The list is cut now and then: to sort all of a hundred thousand cells takes too long for a frame.
      if (found.length >= 8 * most) {
        found = found.sort(before).slice(0, most);
        least = this.volume[found.at(-1)!]!;
      }
    }
    return found.sort(before).slice(0, most);
  }

  /** What a cell is, in words. */
  said(node: number): string {
    const kind = this.of.nodes[node]!;
    if (kind === PLANE) return this.isCoarse(node) ? "a plane between simple volumes" : "a plane between the bodies";
    return kind === EMPTY ? "misses the polytope" : kind === OPEN ? "open" : kind === FOLDED ? "divided further, not shown" : "divided";
  }
}
