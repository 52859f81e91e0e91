// Two jobs side by side: what each has reached over time, in one picture where both are measured by the same.
import { useEffect, useState } from "preact/hooks";
import { said } from "../common/api";
import { Chart, type Curve } from "../job/chart";
import { known, measureOf, type Measure } from "../job/curve";
import { Numbers } from "../job/growth";

interface Compared {
  id: string;
  kind: string;
}

type Measured = Curve & { measure: Measure };

async function load(jobs: Compared[]): Promise<Measured[]> {
  return Promise.all(
    jobs.map(async ({ id, kind }) => {
      const measure = measureOf(kind);
      return { name: id, measure, points: known(await measure.points(id)) };
    }),
  );
}

export function CompareJobsIsland({ jobs }: { jobs: Compared[] }) {
  const [loaded, setLoaded] = useState<Measured[] | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    load(jobs).then(setLoaded, (reason: unknown) => setProblem(said(reason)));
  }, [jobs]);
  if (problem) return <p class="notice bad">What the jobs have reached over time is not known: {problem}</p>;
  if (!loaded) return <p class="empty">Loading what the jobs have reached …</p>;
  const measures = [...new Set(loaded.map(({ measure }) => measure))];
  return (
    <>
      {measures.map((measure) => (
        <Over measure={measure} jobs={loaded.filter((one) => one.measure === measure)} key={measure.title} />
      ))}
    </>
  );
}

function Over({ measure, jobs }: { measure: Measure; jobs: Measured[] }) {
  const drawn = jobs.filter(({ points }) => points.length > 0);
  if (drawn.length === 0) return null;
  return (
    <section aria-label={measure.title}>
      <h2>{measure.title}</h2>
      <p class="small quiet">Each share is {measure.whole}. Shares are estimated from samples; {measure.proved}.</p>
      <Chart curves={drawn} what={measure.title} />
      <div class="halves">
        {jobs.map(({ name, points }) => (
          <Numbers measure={measure} points={points} label={`${measure.title}, by job ${name.slice(0, 8)}`} caption={name.slice(0, 8)} key={name} />
        ))}
      </div>
    </section>
  );
}
