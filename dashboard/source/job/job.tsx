// The page of a job, below its head: the matrix of pairs or one of them, what limits the region, how it grew, and who works on it.
import type { ComponentType } from "preact";
import { useEffect, useMemo, useReducer, useState } from "preact/hooks";
import { get, said } from "../common/api";
import type { SceneModel } from "../common/schema";
import type { Unit } from "../common/units";
import { measureOf } from "./curve";
import { Growth } from "./growth";
import { Log } from "./log";
import { Matrix, Memory } from "./matrix";
import { Obstacles } from "./obstacles";
import { Pair } from "./pair";
import { useRoute } from "./route";
import { JobStore, type Drawable } from "./store";
import { Timeline } from "./timeline";
import { Workers } from "./workers";

/** The motion of a job, once what draws it is there: three.js is large. */
function Moved(props: { job: string; scene: string }) {
  const [Motion, setMotion] = useState<ComponentType<typeof props> | null>(null);
  useEffect(() => void import("./motion").then((module) => setMotion(() => module.Motion)), []);
  return Motion ? <Motion {...props} /> : <div class="coming" />;
}

export function JobIsland({ job, kind, subject, scene, ended, begun, units }: { job: string; kind: string; subject: string; scene: string; ended: boolean; begun: number; units: Unit[] }) {
  const [version, changed] = useReducer((count: number) => count + 1, 0);
  const [robot, setRobot] = useState<Drawable>({ model: null, problem: null });
  const store = useMemo(() => new JobStore(job, measureOf(kind), ended, begun, units, () => changed(undefined)), [job]);
  const memory = useMemo(() => new Memory(), []);
  const route = useRoute();
  useEffect(() => {
    void store.start();
    return () => store.close();
  }, [store]);
  const needed = route.pair !== null || store.obstacles?.some(({ q }) => q !== null);
  useEffect(() => {
    // Without the model joints have numbers instead of names, and the robot is not drawn; what there is to read is there.
    if (needed && !robot.model)
      get<SceneModel>(`/v1/scenes/${scene}/model`).then(
        (model) => setRobot({ model, problem: null }),
        (reason: unknown) => setRobot({ model: null, problem: said(reason) }),
      );
  }, [needed, scene]);
  if (!store.loaded)
    return store.problem ? (
      <p class="notice bad" role="alert">
        {store.problem} It is asked again every few seconds.
      </p>
    ) : (
      <p class="empty">Loading the pairs …</p>
    );
  return (
    <>
      {store.problem && (
        <p class="notice bad" role="alert">
          {store.problem}
        </p>
      )}
      {route.pair !== null ? (
        <Pair store={store} version={version} robot={robot} scene={scene} route={{ ...route, pair: route.pair }} />
      ) : (
        <>
          {store.iterations.length > 0 && <Matrix store={store} version={version} memory={memory} />}
          {store.ended && subject === "the motion" && <Moved job={job} scene={scene} />}
          <Growth job={job} measure={store.measure} points={store.reached} />
          <Obstacles obstacles={store.obstacles} robot={robot} whom={subject} scene={scene} units={units} />
          {!store.ended && <Workers store={store} subject={subject} />}
          <Timeline store={store} subject={subject} />
          <Log store={store} subject={subject} />
        </>
      )}
    </>
  );
}
