// How the regions of a scene are connected: a node for each region, a line where two overlap.
import { useMemo } from "preact/hooks";
import { LINKS } from "../common/colours";
import type { GraphResponse } from "../common/schema";
import { plural } from "../common/words";
import { layout } from "./layout";

interface Props {
  graph: GraphResponse;
  /** Regions that hold what is looked at, by id. */
  holding: Set<string>;
  /** What proves each piece of a plan, in order: a region by its id, or null for a motion. */
  way: (string | null)[];
  chosen: string | null;
  onChoose: (region: string) => void;
}

const SHEET = 100;
const PAD = 8;
/** Shapes tell components apart for who does not see their colours: circles, squares, diamonds in turn. */
const SHAPES = ["circle", "square", "diamond"] as const;

export function Graph({ graph, holding, way, chosen, onChoose }: Props) {
  const index = useMemo(() => new Map(graph.nodes.map(({ region }, i) => [region, i])), [graph]);
  const places = useMemo(
    () =>
      layout(graph.nodes.length, graph.edges.map(({ a, b }) => [index.get(a)!, index.get(b)!])).map(({ x, y }) => ({
        x: PAD + (SHEET - 2 * PAD) * x,
        y: PAD + (SHEET - 2 * PAD) * y,
      })),
    [graph],
  );
  const planned = new Set(way);
  /** The overlaps that the plan goes through, from one piece to the next. */
  const crossed = new Set(way.slice(1).flatMap((region, i) => [`${way[i]} ${region}`, `${region} ${way[i]}`]));
  const radius = Math.max(1.1, Math.min(3.2, 14 / Math.sqrt(graph.nodes.length)));
  const deepest = Math.max(...graph.edges.map(({ depth }) => depth), 1e-9);
  const text = `${plural(graph.nodes.length, "region")}, ${plural(graph.edges.length, "overlap")}, ${plural(graph.components, "component")}`;
  return (
    <svg class="graph" viewBox={`0 0 ${SHEET} ${SHEET}`} role="group" aria-label={text}>
      {graph.edges.map(({ a, b, depth }) => {
        const [from, to] = [places[index.get(a)!]!, places[index.get(b)!]!];
        const on = crossed.has(`${a} ${b}`);
        return (
          <line class={on ? "edge planned" : "edge"} key={`${a} ${b}`} x1={from.x} y1={from.y} x2={to.x} y2={to.y} stroke-width={0.25 + 0.7 * Math.sqrt(depth / deepest)}>
            <title>{`${a.slice(0, 8)} and ${b.slice(0, 8)} overlap by a ball of radius ${depth.toPrecision(2)} in s`}</title>
          </line>
        );
      })}
      {graph.nodes.map(({ region, component }, i) => {
        const { x, y } = places[i]!;
        const marks = [holding.has(region) && "holds the configuration", planned.has(region) && "on the planned way"].filter(Boolean).join(", ");
        const shape = SHAPES[component % SHAPES.length]!;
        const common = { fill: LINKS[component % LINKS.length], class: `node${planned.has(region) ? " planned" : ""}${chosen === region ? " chosen" : ""}` };
        const label = `region ${region.slice(0, 8)}, component ${component + 1}${marks && `, ${marks}`}`;
        return (
          <g
            key={region}
            class="place"
            tabindex={0}
            role="button"
            aria-label={label}
            aria-pressed={chosen === region}
            onClick={() => onChoose(region)}
            onKeyDown={(event) => {
              if (event.key !== "Enter" && event.key !== " ") return;
              event.preventDefault();
              onChoose(region);
            }}
          >
            <title>{label}</title>
            {holding.has(region) && <circle class="halo" cx={x} cy={y} r={1.7 * radius} />}
            {shape === "circle" ? <circle cx={x} cy={y} r={radius} {...common} /> : <rect x={x - radius} y={y - radius} width={2 * radius} height={2 * radius} transform={shape === "diamond" ? `rotate(45 ${x} ${y})` : undefined} {...common} />}
          </g>
        );
      })}
    </svg>
  );
}
