// A slice through configuration space: two joints move, the others stay. It shows what collides, what is free, and the regions over it.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { inAddress, useAddress } from "./address";
import { post, said } from "./api";
import { EMPTY, leavesInSlice, OPEN } from "./cells";
import { onScheme, token } from "./colours";
import { shortNames } from "./kinematics";
import { toQ, toS, type Space } from "./polytope";
import type { Partition, SliceAxis, SliceResponse } from "./schema";
import { RADIANS, SHOWN, shown } from "./units";
import { plural } from "./words";

interface Props {
  scene: string;
  space: Space;
  units: ("rad" | "m")[];
  q: number[];
  onPick: (q: number[]) => void;
  /** Ids of the regions to draw; all of the scene where it is left out. */
  regions?: string[];
  /** The region that is drawn strongest. */
  strongest?: string | null;
  /** Cells of a pair to draw over the slice. */
  cells?: Partition | null;
  /** A way through configuration space, drawn as a line. */
  way?: number[][];
  /** Whether the scene has a map, whose cells are not drawn. */
  mapped?: boolean;
}

type Axes = [number, number];

const SIZE = 90;
const PAUSE_MS = 180;
const STEP = 1 / 60; // of an axis, a key press
const PAD = { left: 52, right: 10, top: 10, bottom: 34 };

/** A slice with the choice of its joints. */
export function Slice(props: Props) {
  const { joints } = props.space;
  const [axes, setAxes] = useState(() => axesIn(joints, inAddress("across"), inAddress("up")));
  useAddress({ across: axes[0] === 0 && axes[1] === 1 ? null : joints[axes[0]]!, up: axes[0] === 0 && axes[1] === 1 ? null : joints[axes[1]]! });
  if (joints.length < 2) return <p class="empty">A slice needs two joints; this scene has one.</p>;
  return (
    <div class="slice">
      <AxesChoice joints={joints} axes={axes} onChange={setAxes} />
      <SliceOf {...props} axes={axes} />
    </div>
  );
}

/** The places of two joints by their names; the first two where these are not two of the joints. */
export function axesIn(joints: string[], across: string | null, up: string | null): Axes {
  const places = [across, up].map((name) => joints.indexOf(name ?? "")) as Axes;
  return places.includes(-1) || places[0] === places[1] ? [0, 1] : places;
}

/** Two different ones of at least two joints. */
export function AxesChoice({ joints, axes, onChange }: { joints: string[]; axes: Axes; onChange: (axes: Axes) => void }) {
  const names = shortNames(joints);
  const choose = (place: 0 | 1, value: number): void => {
    const next: Axes = [...axes];
    // Whoever names the joint of the other axis swaps the two.
    if (next[1 - place] === value) next[1 - place] = next[place]!;
    next[place] = value;
    onChange(next);
  };
  return (
    <div class="axes">
      {(["across", "up"] as const).map((word, place) => (
        <label key={word}>
          {word}{" "}
          <select value={axes[place]} onChange={(event) => choose(place as 0 | 1, Number(event.currentTarget.value))}>
            {names.map((name, i) => (
              <option value={i} key={name}>{name}</option>
            ))}
          </select>
        </label>
      ))}
    </div>
  );
}

/** The slice along two joints, given by their places among those of the space. */
export function SliceOf(props: Props & { axes: Axes }) {
  const { scene, space, units, q, onPick, regions, strongest = null, cells = null, way, mapped = false, axes } = props;
  const [known, setKnown] = useState<{ asked: string; answer: SliceResponse } | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [scheme, setScheme] = useState(0);
  const canvas = useRef<HTMLCanvasElement>(null);
  const [x, y] = axes;
  const names = shortNames(space.joints);

  // The two joints of the slice change nothing about it, so it is asked for again only when another one moves.
  const fixed = q.map((value, i) => (i === x || i === y ? null : value)).join();
  const asked = `${scene} ${x} ${y} ${fixed} ${regions?.join()}`;
  useEffect(() => {
    const stop = new AbortController();
    const timer = setTimeout(() => {
      const body = { scene, q, x: space.joints[x], y: space.joints[y], size: SIZE, ...(regions && { regions }) };
      post<SliceResponse>("/v1/planning/slice", body, stop.signal).then(
        (found) => {
          setKnown({ asked, answer: found });
          setProblem(null);
        },
        (reason: unknown) => {
          if (stop.signal.aborted) return;
          setKnown(null);
          setProblem(said(reason));
        },
      );
    }, PAUSE_MS);
    return () => {
      clearTimeout(timer);
      stop.abort();
    };
  }, [asked]);
  useEffect(() => onScheme(() => setScheme((old) => old + 1)), []);
  // While the next slice is computed, the one before stays, faintly, and nothing is said of it.
  const answer = known?.answer ?? null;
  const current = known?.asked === asked;

  const leaves = useMemo(
    () => (cells ? leavesInSlice(cells, toS(space, q), x, y).map(({ kind, lower, upper }) => ({ kind, lower: inQ(space, axes, lower), upper: inQ(space, axes, upper) })) : []),
    [cells, fixed, x, y],
  );
  useEffect(() => {
    if (canvas.current && answer && answer.x.joint === space.joints[x] && answer.y.joint === space.joints[y]) draw(canvas.current, answer, [q[x]!, q[y]!], strongest, leaves, way?.map((at) => [at[x]!, at[y]!]));
  }, [answer, q[x], q[y], strongest, leaves, way, scheme]);

  const move = (dx: number, dy: number): void => {
    if (!answer) return;
    const next = [...q];
    next[x] = clamp(q[x]! + dx * (answer.x.upper - answer.x.lower), answer.x);
    next[y] = clamp(q[y]! + dy * (answer.y.upper - answer.y.lower), answer.y);
    onPick(next);
  };
  const onKeyDown = (event: KeyboardEvent): void => {
    const by: Record<string, [number, number]> = { ArrowLeft: [-STEP, 0], ArrowRight: [STEP, 0], ArrowUp: [0, STEP], ArrowDown: [0, -STEP] };
    const found = by[event.key];
    if (!found || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    move(...found);
  };
  const onPointer = (event: PointerEvent): void => {
    if (!answer || (event.type === "pointermove" && event.buttons !== 1)) return;
    const { left, top, width, height } = canvas.current!.getBoundingClientRect();
    const along = (event.clientX - left - PAD.left) / (width - PAD.left - PAD.right);
    const up = 1 - (event.clientY - top - PAD.top) / (height - PAD.top - PAD.bottom);
    const next = [...q];
    next[x] = clamp(answer.x.lower + along * (answer.x.upper - answer.x.lower), answer.x);
    next[y] = clamp(answer.y.lower + up * (answer.y.upper - answer.y.lower), answer.y);
    onPick(next);
  };
  const at = (i: number): string => `${names[i]} ${shown(q[i]!, units[i]!)}`;
  return (
    <figure>
      <canvas
        ref={canvas}
        class={current ? "" : "stale"}
        tabIndex={0}
        role="application"
        aria-label={`Slice through configuration space: ${at(x)} across, ${at(y)} up. ${answer && current ? summary(answer) : "It is being computed."} Arrow keys move the robot.`}
        onKeyDown={onKeyDown}
        onPointerDown={onPointer}
        onPointerMove={onPointer}
      />
      <figcaption>
        <span class="key-map certified"><span class="proved">in a certified region</span></span> <span class="key-map free"><span class="computed">no collision at the sample</span></span> <span class="key-map taken"><span class="computed">in collision</span></span>
        {cells && <> <span class="key-map cells">cells</span></>}
        <br />
        {problem ? <strong class="bad">{problem}</strong> : answer && current ? <><span class="computed">{summary(answer)}</span>{mapped && " What the map proves is not drawn here."}</> : "Computing …"}
      </figcaption>
    </figure>
  );
}

function inQ(space: Space, [x, y]: [number, number], corner: [number, number]): [number, number] {
  return [toQ(space, x, corner[0]), toQ(space, y, corner[1])];
}

function clamp(value: number, { lower, upper }: SliceAxis): number {
  return Math.min(Math.max(value, lower), upper);
}

/** A share in whole percent; what is there is never said to be nothing, and what is not all never to be all. */
function rounded(share: number): string {
  const percent = Math.round(100 * share);
  if (percent === 0 && share > 0) return "less than 1 %";
  return percent === 100 && share < 1 ? "more than 99 %" : `${percent} %`;
}

function summary({ rows, regions }: SliceResponse): string {
  const signs = rows.join("");
  const percent = (sign: string): string => rounded((signs.split(sign).length - 1) / signs.length);
  const many = `${plural(regions.length, "region")} ${regions.length === 1 ? "is" : "are"}`;
  return `${percent("o")} of this slice is in certified regions, ${percent("#")} in collision, by samples; ${many} in it.`;
}

interface DrawnLeaf {
  kind: number;
  lower: [number, number];
  upper: [number, number];
}

function draw(canvas: HTMLCanvasElement, answer: SliceResponse, at: [number, number], strongest: string | null, leaves: DrawnLeaf[], way: [number, number][] | undefined): void {
  const ratio = Math.min(devicePixelRatio, 2);
  const { clientWidth, clientHeight } = canvas;
  canvas.width = clientWidth * ratio;
  canvas.height = clientHeight * ratio;
  const c = canvas.getContext("2d")!;
  c.scale(ratio, ratio);
  const width = clientWidth - PAD.left - PAD.right;
  const height = clientHeight - PAD.top - PAD.bottom;
  const px = (value: number): number => PAD.left + (width * (value - answer.x.lower)) / (answer.x.upper - answer.x.lower);
  const py = (value: number): number => PAD.top + height - (height * (value - answer.y.lower)) / (answer.y.upper - answer.y.lower);
  c.clearRect(0, 0, clientWidth, clientHeight);
  c.save();
  c.beginPath();
  c.rect(PAD.left, PAD.top, width, height);
  c.clip();
  drawMap(c, answer, width, height);
  for (const leaf of leaves) {
    const [left, top] = [px(leaf.lower[0]), py(leaf.upper[1])];
    if (leaf.kind === OPEN || leaf.kind === EMPTY) {
      c.fillStyle = token(leaf.kind === OPEN ? "--fill-inconclusive" : "--fill-open");
      c.globalAlpha = 0.55;
      c.fillRect(left, top, px(leaf.upper[0]) - left, py(leaf.lower[1]) - top);
      c.globalAlpha = 1;
    }
    c.strokeStyle = token("--ink");
    c.lineWidth = 0.6;
    c.strokeRect(left, top, px(leaf.upper[0]) - left, py(leaf.lower[1]) - top);
  }
  for (const { region, polygon } of answer.regions) {
    c.beginPath();
    polygon.forEach(([qx, qy], i) => (i ? c.lineTo(px(qx), py(qy)) : c.moveTo(px(qx), py(qy))));
    c.closePath();
    c.strokeStyle = token("--good");
    c.lineWidth = region === strongest ? 3 : 1.4;
    c.stroke();
  }
  if (way && way.length > 1) {
    c.beginPath();
    way.forEach(([qx, qy], i) => (i ? c.lineTo(px(qx), py(qy)) : c.moveTo(px(qx), py(qy))));
    c.strokeStyle = token("--busy");
    c.lineWidth = 2.5;
    c.stroke();
  }
  c.strokeStyle = token("--ink");
  c.lineWidth = 1;
  c.setLineDash([4, 4]);
  c.beginPath();
  c.moveTo(px(at[0]), PAD.top);
  c.lineTo(px(at[0]), PAD.top + height);
  c.moveTo(PAD.left, py(at[1]));
  c.lineTo(PAD.left + width, py(at[1]));
  c.stroke();
  c.setLineDash([]);
  c.beginPath();
  c.arc(px(at[0]), py(at[1]), 5, 0, 2 * Math.PI);
  c.fillStyle = token("--card");
  c.fill();
  c.lineWidth = 2;
  c.stroke();
  c.restore();
  drawScale(c, answer, px, py, width, height);
}

/** What collides is grey with strokes through it, so that nobody needs colour to tell it from what is free. */
function drawMap(c: CanvasRenderingContext2D, answer: SliceResponse, width: number, height: number): void {
  c.fillStyle = token("--card");
  c.fillRect(PAD.left, PAD.top, width, height);
  const side = [width / answer.size, height / answer.size] as const;
  const fill = (sign: string, style: string | CanvasPattern): void => {
    c.fillStyle = style;
    answer.rows.forEach((row, up) => {
      for (let begin = row.indexOf(sign); begin >= 0; ) {
        let end = begin;
        while (row[end] === sign) end++;
        c.fillRect(PAD.left + begin * side[0], PAD.top + height - (up + 1) * side[1] - 0.3, (end - begin) * side[0] + 0.3, side[1] + 0.6);
        begin = row.indexOf(sign, end);
      }
    });
  };
  fill("o", token("--map-certified"));
  fill("#", token("--map-taken"));
  const tile = document.createElement("canvas");
  tile.width = tile.height = 8;
  const t = tile.getContext("2d")!;
  t.strokeStyle = token("--map-stroke");
  t.lineWidth = 1;
  t.beginPath();
  t.moveTo(-1, 9);
  t.lineTo(9, -1);
  t.stroke();
  fill("#", c.createPattern(tile, "repeat")!);
}

function drawScale(c: CanvasRenderingContext2D, { x, y }: SliceResponse, px: (v: number) => number, py: (v: number) => number, width: number, height: number): void {
  c.strokeStyle = token("--line");
  c.strokeRect(PAD.left, PAD.top, width, height);
  c.fillStyle = token("--quiet");
  c.font = "11px system-ui, sans-serif";
  c.textAlign = "center";
  for (const value of ticks(x)) c.fillText(tick(value, x.unit), px(value), PAD.top + height + 15);
  c.fillText(x.joint.slice(x.joint.lastIndexOf("/") + 1), PAD.left + width / 2, PAD.top + height + 30);
  c.textAlign = "right";
  for (const value of ticks(y)) c.fillText(tick(value, y.unit), PAD.left - 6, py(value) + 4);
  c.save();
  c.translate(11, PAD.top + height / 2);
  c.rotate(-Math.PI / 2);
  c.textAlign = "center";
  c.fillText(y.joint.slice(y.joint.lastIndexOf("/") + 1), 0, 0);
  c.restore();
}

function ticks({ unit, lower, upper }: SliceAxis): number[] {
  const { scale } = SHOWN[unit];
  const span = (upper - lower) / scale;
  const steps = unit === "rad" && !RADIANS ? [1, 2, 5, 10, 15, 30, 45, 60, 90, 180] : [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5];
  const step = steps.find((candidate) => span / candidate <= 6) ?? steps.at(-1)!;
  const found: number[] = [];
  for (let value = Math.ceil(lower / scale / step); value * step * scale <= upper; value++) found.push(value * step * scale);
  return found;
}

function tick(value: number, unit: "rad" | "m"): string {
  const text = String(Number((value / SHOWN[unit].scale).toPrecision(4)));
  return unit === "rad" && !RADIANS ? `${text}°` : text;
}
