// The motion of a job that has ended: the robot moves along it, as far as it is proved and beyond.
import { useEffect, useState } from "preact/hooks";
import { get, said } from "../common/api";
import { positions } from "../common/kinematics";
import { Robot } from "../common/drawn";
import { toQ } from "../common/polytope";
import type { Job, JobMotion, SceneModel } from "../common/schema";
import { Player, type Shown } from "../library/player";
import { shownOf } from "../library/upload";

/** The reason of a job whose deadline came first begins so. */
const LATE = "the deadline was reached";

interface Loaded {
  model: SceneModel;
  motion: Shown;
}

async function load(id: string, scene: string): Promise<Loaded | null> {
  const { options, outcome, reason } = await get<Job>(`/v1/jobs/${id}`);
  const { q, s } = options as { q?: number[][]; s?: number[][] };
  // A job that was cancelled, has failed or was too late has no verdict.
  if (!(q ?? s) || !outcome || outcome === "error" || reason?.startsWith(LATE)) return null;
  const [verdict, model] = await Promise.all([get<JobMotion>(`/v1/jobs/${id}/motion`), get<SceneModel>(`/v1/scenes/${scene}/model`)]);
  const charts = { revolute: model.units.map((unit) => unit === "rad"), q_star: model.q_star };
  const waypoints = q ?? s!.map((row) => row.map((value, i) => toQ(charts, i, value)));
  const motion = shownOf({ q: waypoints, t: null }, verdict);
  return { model, motion: verdict.space === "s" ? { ...motion, charts } : motion };
}

export function Motion({ job, scene }: { job: string; scene: string }) {
  const [loaded, setLoaded] = useState<Loaded | null | undefined>(undefined);
  const [problem, setProblem] = useState<string | null>(null);
  const [q, setQ] = useState<number[] | null>(null);
  useEffect(() => {
    load(job, scene).then(setLoaded, (reason: unknown) => setProblem(said(reason)));
  }, [job, scene]);
  if (problem) return <p class="notice bad">The motion cannot be drawn: {problem}</p>;
  if (loaded === undefined) return <div class="coming" />;
  if (!loaded) return null; // There is no verdict, or the motion is polynomial, and only the claim says what is known of it.
  const { model, motion } = loaded;
  return (
    <section aria-labelledby="h-motion">
      <h2 id="h-motion">The motion</h2>
      <div class="stage">
        <Robot model={model} q={q ?? motion.q[0]!} label={`The robot of ${model.name} on the motion`} />
        <Player motion={motion} names={positions(model)} units={model.units} onMove={setQ} />
      </div>
      <p class="quiet small">{motion.charts ? "The motion is straight in s. Between waypoints, it takes a second for each radian or metre that all joints move together" : "The motion is played so that all joints together move by 1 radian or metre a second"}. Your robot may move otherwise.</p>
    </section>
  );
}
