// A treemap of cells: each cut divides its rectangle as it divides the cell's volume, across the longer side.
import { EMPTY, FOLDED, OPEN } from "./cells";
import { token } from "./colours";
import type { Tree } from "./tree";

export interface Rectangle {
  x: number;
  y: number;
  width: number;
  height: number;
}

/** Cells narrower than this are drawn together, as open if one of them is. */
const LEAST = 3;
/** Cells narrower than this have no hatching, which nobody would see. */
const HATCHED = 8;

function halves(tree: Tree, node: number, { x, y, width, height }: Rectangle): [Rectangle, Rectangle] {
  const part = tree.volume[node]! > 0 ? tree.volume[node + 1]! / tree.volume[node]! : 0.5;
  if (width >= height) {
    const left = width * part;
    return [{ x, y, width: left, height }, { x: x + left, y, width: width - left, height }];
  }
  const top = height * part;
  return [{ x, y, width, height: top }, { x, y: y + top, width, height: height - top }];
}

/** The leaf at a point of the view, which `root` fills. */
export function leafAt(tree: Tree, root: number, view: Rectangle, x: number, y: number): number {
  let node = root, place = view;
  while (tree.isCut(node)) {
    const [first, second] = halves(tree, node, place);
    const isFirst = x < first.x + first.width && y < first.y + first.height;
    [node, place] = isFirst ? [node + 1, first] : [tree.end[node + 1]!, second];
  }
  return node;
}

/** Where a node is in the view, which `root` fills; null where it is outside. */
export function rectangleOf(tree: Tree, root: number, view: Rectangle, wanted: number): Rectangle | null {
  if (wanted < root || wanted >= tree.end[root]!) return null;
  let node = root, place = view;
  while (node !== wanted) {
    const [first, second] = halves(tree, node, place), other = tree.end[node + 1]!;
    [node, place] = wanted < other ? [node + 1, first] : [other, second];
  }
  return place;
}

function hatched(context: CanvasRenderingContext2D, ground: string, ink: string): CanvasPattern {
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const pen = tile.getContext("2d")!;
  pen.fillStyle = ground;
  pen.fillRect(0, 0, 8, 8);
  pen.strokeStyle = ink;
  pen.lineWidth = 1.2;
  for (const shift of [-8, 0, 8]) {
    pen.moveTo(shift, 8);
    pen.lineTo(shift + 8, 0);
  }
  pen.stroke();
  return context.createPattern(tile, "repeat")!;
}

/** Draws the cells below a node. */
export function draw(canvas: HTMLCanvasElement, tree: Tree, root: number): void {
  const scale = Math.min(devicePixelRatio, 2), width = canvas.clientWidth, height = canvas.clientHeight;
  canvas.width = Math.round(width * scale);
  canvas.height = Math.round(height * scale);
  const context = canvas.getContext("2d")!;
  context.scale(scale, scale);
  const fine: Rectangle[] = [], coarse: Rectangle[] = [], small: Rectangle[] = [], open: Rectangle[] = [], empty: Rectangle[] = [], folded: Rectangle[] = [];
  const listOf = (node: number): Rectangle[] => {
    const kind = tree.of.nodes[node]!;
    if (tree.isCut(node)) return tree.open[node]! > 0 ? open : coarse;
    if (kind === FOLDED) return tree.open[node]! > 0 ? open : folded;
    return kind === OPEN ? open : kind === EMPTY ? empty : tree.isCoarse(node) ? coarse : fine;
  };
  const visit = (node: number, place: Rectangle): void => {
    if (tree.isCut(node) && Math.min(place.width, place.height) > LEAST) {
      const [first, second] = halves(tree, node, place);
      visit(node + 1, first);
      visit(tree.end[node + 1]!, second);
      return;
    }
    const list = listOf(node);
    (list === coarse && Math.min(place.width, place.height) < HATCHED ? small : list).push(place);
  };
  visit(root, { x: 0, y: 0, width, height });
  const fills: [Rectangle[], string | CanvasPattern][] = [
    [empty, token("--fill-open")],
    [small, token("--fill-reused")],
    [coarse, hatched(context, token("--fill-reused"), token("--fill-certified"))],
    [fine, token("--fill-certified")],
    [folded, token("--fill-running")],
    [open, token("--fill-inconclusive")],
  ];
  for (const [places, style] of fills) {
    context.fillStyle = style;
    for (const { x, y, width: w, height: h } of places) {
      const gap = Math.min(w, h) > 5 ? 0.5 : 0;
      context.fillRect(x + gap, y + gap, Math.max(w - 2 * gap, 0.6), Math.max(h - 2 * gap, 0.6));
    }
  }
}
