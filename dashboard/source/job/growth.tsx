// How far a job has come, over time: the curve, the last share in a sentence, and the numbers as a table.
import { Chart, percent } from "./chart";
import { known, type Known, type Measure, type Point } from "./curve";
import { duration } from "./outcomes";

export function Growth({ job, measure, points: all }: { job: string; measure: Measure; points: Point[] }) {
  const points = known(all);
  if (points.length === 0) return null;
  return (
    <section aria-labelledby="h-share">
      <h2 id="h-share">{measure.title}</h2>
      {points.length > 1 && <Chart curves={[{ name: job, points }]} what={measure.title} />}
      <Reached measure={measure} points={points} />
      <details id="share-table">
        <summary>As a table</summary>
        <Numbers measure={measure} points={points} label={measure.title} />
      </details>
    </section>
  );
}

function Reached({ measure, points }: { measure: Measure; points: Known[] }) {
  const last = points.at(-1)!;
  return (
    <p class="small">
      <span class="computed">{percent(last.share)}</span> {measure.reached} after {duration(last.seconds)}. Shares are estimated from samples; {measure.proved}.
    </p>
  );
}

/** The points as a table, with a caption where there are several such tables. */
export function Numbers({ measure, points, label, caption }: { measure: Measure; points: Known[]; label: string; caption?: string }) {
  const regions = points.some(({ region }) => region !== null);
  return (
    <div class={caption ? "scroll tall" : "scroll"} tabIndex={0} role="region" aria-label={label}>
      <table>
        {caption && <caption><code>{caption}</code></caption>}
        <thead>
          <tr>
            {measure.number && <th class="number">{measure.number}</th>}
            <th class="number">After</th>
            <th class="number">Share</th>
            {regions && <th>Region</th>}
          </tr>
        </thead>
        <tbody>
          {points.length === 0 && <tr><td colSpan={3} class="quiet">nothing yet</td></tr>}
          {points.map(({ seconds, share, number, region }) => (
            <tr key={region ?? seconds}>
              {measure.number && <td class="number">{number}</td>}
              <td class="number">{duration(seconds)}</td>
              <td class="number"><span class="computed">{percent(share)}</span></td>
              {regions && <td>{region && <a href={`/regions/${region}`}><code>{region.slice(0, 8)}</code></a>}</td>}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
