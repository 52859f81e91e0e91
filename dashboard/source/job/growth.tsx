// How much of the starting region the certified region keeps, over time.
import type { GrowthPoint } from "../common/schema";
import { duration } from "./outcomes";

const WIDTH = 600,
  HEIGHT = 170;
const LEFT = 52,
  RIGHT = 14,
  TOP = 12,
  BOTTOM = 26;
const GRID = 4;

type Known = GrowthPoint & { share: number };

function percent(share: number): string {
  return `${Number((100 * share).toPrecision(3))} %`;
}

/** The next number above that people like to read on an axis. */
function round(value: number): number {
  const power = 10 ** Math.floor(Math.log10(value));
  return [1, 2, 4, 5, 6, 8, 10].map((step) => step * power).find((step) => step >= value * (1 - 1e-9)) ?? value;
}

export function Growth({ points }: { points: GrowthPoint[] }) {
  const known = points.filter((point): point is Known => point.share !== null);
  if (known.length === 0) return null;
  const last = known.at(-1)!;
  return (
    <section aria-labelledby="h-share">
      <h2 id="h-share">Kept of the starting region, over time</h2>
      {known.length > 1 && <Curve known={known} />}
      <p class="small">
        {percent(last.share)} of the starting region is certified after {duration(last.seconds)}. Shares are estimated from samples; each region is
        certified by its own proof.
      </p>
      <details id="share-table">
        <summary>As a table</summary>
        <div class="scroll" tabIndex={0} role="region" aria-label="Kept of the starting region, over time">
          <table>
            <thead>
              <tr>
                <th class="number">Iteration</th>
                <th class="number">After</th>
                <th class="number">Share</th>
                <th>Region</th>
              </tr>
            </thead>
            <tbody>
              {known.map((point) => (
                <tr key={point.region}>
                  <td class="number">{point.iteration}</td>
                  <td class="number">{duration(point.seconds)}</td>
                  <td class="number">{percent(point.share)}</td>
                  <td>
                    <a href={`/regions/${point.region}`}>
                      <code>{point.region.slice(0, 8)}</code>
                    </a>
                  </td>
                </tr>
              ))}
            </tbody>
          </table>
        </div>
      </details>
    </section>
  );
}

function Curve({ known }: { known: Known[] }) {
  const end = Math.max(...known.map(({ seconds }) => seconds)) || 1,
    top = Math.min(1, round(Math.max(...known.map(({ share }) => share)) || 1));
  const x = (seconds: number): number => LEFT + ((WIDTH - LEFT - RIGHT) * seconds) / end;
  const y = (share: number): number => HEIGHT - BOTTOM - ((HEIGHT - TOP - BOTTOM) * share) / top;
  const steps = known.map(({ seconds, share }, i) => (i === 0 ? `M${x(seconds)},${y(share)}` : `H${x(seconds)}V${y(share)}`)).join("");
  const parts = Array.from({ length: GRID + 1 }, (_, i) => i / GRID);
  return (
    <figure class="share">
      <svg
        class="chart"
        viewBox={`0 0 ${WIDTH} ${HEIGHT}`}
        role="img"
        aria-label="Share of the starting region that is certified, over time. The table below has the numbers."
      >
        {parts.map((part) => (
          <g key={part}>
            <line x1={LEFT} x2={WIDTH - RIGHT} y1={y(part * top)} y2={y(part * top)} />
            {(part * GRID) % 2 === 0 && (
              <text x={LEFT - 8} y={y(part * top) + 4} text-anchor="end">
                {percent(part * top)}
              </text>
            )}
            {(part * GRID) % 2 === 0 && (
              <text x={x(part * end)} y={HEIGHT - 7} text-anchor={part === 0 ? "start" : part === 1 ? "end" : "middle"}>
                {part === 0 ? "0 s" : duration(part * end)}
              </text>
            )}
          </g>
        ))}
        <path class="under" d={`${steps}V${y(0)}H${x(known[0]!.seconds)}Z`} />
        <path d={steps} />
        {known.map((point) => (
          <circle key={point.region} cx={x(point.seconds)} cy={y(point.share)} r="4">
            <title>{`iteration ${point.iteration}: ${percent(point.share)} after ${duration(point.seconds)}`}</title>
          </circle>
        ))}
      </svg>
    </figure>
  );
}
