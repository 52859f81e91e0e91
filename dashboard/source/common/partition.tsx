// The cells of a pair: a treemap to look at, and everything that it shows also as a table.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import type { Partition } from "./schema";
import { onScheme } from "./colours";
import { draw, leafAt, rectangleOf, type Rectangle } from "./treemap";
import { Tree } from "./tree";
import { shown } from "./units";
import { plural } from "./words";

const IN_TABLE = 40;
const ABOUT = "The table has those that are open, and the largest. Arrow keys go from cell to cell, plus and minus zoom.";
const STEP = 3; // cuts that a step of zooming goes down or up

const LEGEND = [
  ["fine", "a plane between the bodies"],
  ["coarse", "a plane between simple volumes about them"],
  ["empty", "misses the polytope"],
  ["open", "open"],
] as const;

interface Props {
  partition: Partition;
  /** Names of all joint positions, in order. */
  joints: string[];
  /** Number of the node that fills the view. */
  root: number;
  cell: number | null;
  onZoom: (root: number) => void;
  onCell: (cell: number) => void;
}

function percent(share: number): string {
  return share === 0 ? "0 %" : share < 1e-6 ? "less than 0.0001 %" : `${(100 * share).toPrecision(3)} %`;
}

export function Cells({ partition, joints, root: asked, cell: chosen, onZoom, onCell }: Props) {
  const tree = useMemo(() => new Tree(partition), [partition]);
  const root = asked < tree.size ? asked : 0;
  const cell = chosen !== null && chosen < tree.size ? chosen : null;
  const listed = useMemo(() => tree.foremost(root, IN_TABLE), [tree, root]);
  const { counts } = partition;
  const deeper = cell === null ? -1 : tree.path(cell).indexOf(root);
  const zoomIn = (): void => {
    const path = tree.path(cell ?? listed[0]!),
      at = path.indexOf(root);
    onZoom(path[Math.min(at + STEP, path.length - 1)]!);
  };
  const zoomOut = (): void => onZoom(tree.path(root).at(-1 - STEP) ?? 0);
  return (
    <div class="cells">
      <dl class="facts">
        <div>
          <dt>Cells</dt>
          <dd>{(counts.plane + counts.empty + counts.open).toLocaleString("en")}</dd>
        </div>
        <div>
          <dt>With a plane</dt>
          <dd>{counts.plane.toLocaleString("en")}</dd>
        </div>
        <div>
          <dt>Miss the polytope</dt>
          <dd>{counts.empty.toLocaleString("en")}</dd>
        </div>
        <div>
          <dt>Open</dt>
          <dd class={counts.open ? "is-open" : ""}>{counts.open.toLocaleString("en")}</dd>
        </div>
      </dl>
      <div class="tools">
        <button type="button" onClick={zoomIn} disabled={tree.isCut(root) === false || (cell !== null && deeper < 0)}>
          Zoom in
        </button>
        <button type="button" onClick={zoomOut} disabled={root === 0}>
          Zoom out
        </button>
        <button type="button" onClick={() => onZoom(0)} disabled={root === 0}>
          Whole partition
        </button>
        <span class="quiet" role="status">
          {root === 0 ? "The whole partition" : `A part ${tree.depth[root]} cuts deep, ${percent(tree.volume[root]!)} of the volume`}
        </span>
      </div>
      <div class="halves">
        <div>
          <Treemap tree={tree} root={root} cell={cell} onCell={onCell} onIn={zoomIn} onOut={zoomOut} />
          <p class="legend">
            {LEGEND.map(([name, words]) => (
              <span key={name}>
                <span class={`swatch is-${name}`} />
                {words}
              </span>
            ))}
            {partition.folded.length > 0 && (
              <span>
                <span class="swatch is-folded" />
                divided further, not shown
              </span>
            )}
          </p>
        </div>
        <div class="scroll listed" tabIndex={0} role="region" aria-label="Cells">
          <table>
            <caption>
              {tree.open[root]! > 0 ? "Open cells, then the largest" : "The largest cells"}
              {root === 0 ? "" : " of this part"}
            </caption>
            <thead>
              <tr>
                <th>Cell</th>
                <th class="number">Volume</th>
                <th class="number">Depth</th>
                <th>What it is</th>
              </tr>
            </thead>
            <tbody>
              {listed.map((node) => (
                <tr key={node} class={node === cell ? "chosen" : ""}>
                  <td>
                    <button type="button" class="plain" onClick={() => onCell(node)} aria-pressed={node === cell}>
                      cell {node}
                    </button>
                  </td>
                  <td class="number">{percent(tree.volume[node]!)}</td>
                  <td class="number">{tree.depth[node]}</td>
                  <td>{tree.said(node)}</td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      </div>
      {cell === null ? (
        <p class="empty">Choose a cell in the drawing or in the table to see its bounds.</p>
      ) : (
        <Cell tree={tree} cell={cell} joints={joints} />
      )}
      <p class="small">
        A rectangle is as large as its cell's volume in joint space, over the joints that are cut; its place says nothing. Cells too small
        to see are drawn together, as open if one is.
      </p>
    </div>
  );
}

function Treemap({
  tree,
  root,
  cell,
  onCell,
  onIn,
  onOut,
}: {
  tree: Tree;
  root: number;
  cell: number | null;
  onCell: (cell: number) => void;
  onIn: () => void;
  onOut: () => void;
}) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const [size, setSize] = useState({ width: 0, height: 0 });
  const cells = tree.of.counts.plane + tree.of.counts.empty + tree.of.counts.open;
  const view: Rectangle = { x: 0, y: 0, ...size };
  useEffect(() => {
    const element = canvas.current!;
    const again = (): void => {
      setSize({ width: element.clientWidth, height: element.clientHeight });
      draw(element, tree, root);
    };
    const observer = new ResizeObserver(again);
    observer.observe(element);
    const forget = onScheme(again);
    return () => {
      observer.disconnect();
      forget();
    };
  }, [tree, root]);
  const mark = cell === null || size.width === 0 ? null : rectangleOf(tree, root, view, cell);
  const beside = (dx: number, dy: number): void => {
    const from = mark ?? { x: 0, y: 0, width: 1, height: 1 };
    const x = from.x + from.width / 2 + dx * (from.width / 2 + 1),
      y = from.y + from.height / 2 + dy * (from.height / 2 + 1);
    if (x >= 0 && y >= 0 && x < size.width && y < size.height) onCell(leafAt(tree, root, view, x, y));
  };
  const onKeyDown = (event: KeyboardEvent): void => {
    const moves: Record<string, [number, number]> = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (moves[event.key]) beside(...moves[event.key]!);
    else if (event.key === "+" || event.key === "Enter") onIn();
    else if (event.key === "-") onOut();
    else return;
    event.preventDefault();
  };
  return (
    <div class="treemap">
      <canvas
        ref={canvas}
        tabIndex={0}
        role="img"
        onKeyDown={onKeyDown}
        aria-label={`Treemap of ${plural(cells, "cell")}. ${ABOUT}`}
        onClick={(event) => onCell(leafAt(tree, root, view, event.offsetX, event.offsetY))}
        onDblClick={onIn}
      />
      {mark && (
        <div
          class="mark"
          style={{
            left: `${mark.x}px`,
            top: `${mark.y}px`,
            width: `${Math.max(mark.width, 4)}px`,
            height: `${Math.max(mark.height, 4)}px`,
          }}
        />
      )}
    </div>
  );
}

function Cell({ tree, cell, joints }: { tree: Tree; cell: number; joints: string[] }) {
  const volumes = tree.volumes(cell),
    folded = tree.foldedBelow(cell);
  return (
    <section class="card" aria-live="polite" aria-labelledby="h-cell">
      <h3 id="h-cell">
        Cell {cell}: {tree.said(cell)}
      </h3>
      <p>
        It is {tree.depth[cell]} cuts deep, and has {percent(tree.volume[cell]!)} of the partition's volume.{" "}
        {volumes && (
          <>
            Its plane separates <strong>{volumes[0]}</strong> from <strong>{volumes[1]}</strong>.
          </>
        )}
        {folded && `Cells below it: ${folded.plane} with a plane, ${folded.empty} outside of the polytope, ${folded.open} open.`}
      </p>
      <div class="scroll" tabIndex={0} role="region" aria-label="Bounds of the cell">
        <table>
          <thead>
            <tr>
              <th>Joint</th>
              <th class="number">From</th>
              <th class="number">To</th>
            </tr>
          </thead>
          <tbody>
            {tree.bounds(cell).map(({ joint, lower, upper }) => {
              const unit = tree.of.revolute[joint] ? "rad" : "m";
              return (
                <tr key={joint}>
                  <td>{joints[joint] ?? `joint ${joint}`}</td>
                  <td class="number">{shown(lower, unit)}</td>
                  <td class="number">{shown(upper, unit)}</td>
                </tr>
              );
            })}
          </tbody>
        </table>
      </div>
      {tree.of.joints.length < tree.of.q_star.length && (
        <p class="small">The other joints do not move the bodies of this pair against each other, and are not cut.</p>
      )}
    </section>
  );
}
