// How much of the proposal the certified region keeps, over time.
import { duration } from "./outcomes";
import type { Point } from "./store";

const WIDTH = 600, HEIGHT = 150, PAD = 10;

export function Growth({ points }: { points: Point[] }) {
  const known = points.filter((point): point is Point & { share: number } => point.share !== null);
  if (known.length === 0) return null;
  const end = Math.max(...known.map(({ seconds }) => seconds)) || 1, top = Math.max(...known.map(({ share }) => share)) || 1;
  const x = (seconds: number): number => PAD + ((WIDTH - 2 * PAD) * seconds) / end;
  const y = (share: number): number => HEIGHT - PAD - ((HEIGHT - 2 * PAD) * share) / top;
  const steps = known.map(({ seconds, share }, i) => (i === 0 ? `M${x(seconds)},${y(share)}` : `H${x(seconds)}V${y(share)}`)).join("");
  const last = known.at(-1)!;
  return (
    <section aria-labelledby="h-share">
      <h2 id="h-share">Share kept over time</h2>
      <figure>
        <svg class="chart" viewBox={`0 0 ${WIDTH} ${HEIGHT}`} role="img" aria-label={`Share of the proposal that is certified, over time: ${(100 * last.share).toPrecision(3)} % after ${duration(last.seconds)}. The table below has the numbers.`}>
          <path d={steps} />
          {known.map((point) => <circle key={point.region} cx={x(point.seconds)} cy={y(point.share)} r="4"><title>{`iteration ${point.iteration}: ${(100 * point.share).toPrecision(3)} % after ${duration(point.seconds)}`}</title></circle>)}
        </svg>
        <figcaption>From 0 to {(100 * top).toPrecision(3)} % of the proposal, over {duration(end)}. Shares are estimated from samples.</figcaption>
      </figure>
      <details id="share-table">
        <summary>As a table</summary>
        <table>
          <thead><tr><th class="number">Iteration</th><th class="number">After</th><th class="number">Share</th><th>Region</th></tr></thead>
          <tbody>{known.map((point) => (
            <tr key={point.region}><td class="number">{point.iteration}</td><td class="number">{duration(point.seconds)}</td><td class="number">{(100 * point.share).toPrecision(3)} %</td>
              <td><a href={`/regions/${point.region}`}><code>{point.region.slice(0, 8)}</code></a></td></tr>
          ))}</tbody>
        </table>
      </details>
    </section>
  );
}
