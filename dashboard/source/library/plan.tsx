// A motion from a start to a goal: asked for, said why there is none, or played.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { inAddress, readQ, unlessUsual, useAddress } from "../common/address";
import { post, said } from "../common/api";
import { asCommand, asCurl, asPython, Copies, python, shell, type Texts } from "../common/copies";
import { movingBodies } from "../common/kinematics";
import type { Piece, PlanResponse, SceneModel } from "../common/schema";
import { plural } from "../common/words";
import type { Part, Shown } from "./player";
import { asked, poseIn, PoseFields, typedAt, type Typed } from "./pose";
import { Why } from "./why";
import { asText, inWords, shown, typed } from "../common/units";

interface Props {
  model: SceneModel;
  names: string[];
  /** Where a motion begins and ends unless the address says otherwise. */
  usual: number[];
  /** The same in place of q*, where that is not free: it comes once it is known. */
  free: Free | null;
  q: number[];
  onMove: (q: number[]) => void;
  /** Shows a motion, or takes the one that was shown away. */
  onShow: (motion: Shown | null) => void;
}

/** A free configuration, and in words why it stands in place of q*, and which one it is. */
export interface Free {
  q: number[];
  why: string;
  where: string;
}

/** An end of the motion as it is shown, and the configuration that is meant; null where the text is none. */
interface End {
  text: string;
  q: number[] | null;
}

/** How far a frame may be from a straight line. */
const LINE = { metres: 1e-3, radians: (0.5 * Math.PI) / 180 };

export function Planning({ model, names, usual, free, q, onMove, onShow }: Props) {
  const { units } = model;
  const here = (at: number[]): End => ({ text: asText(at, units), q: at });
  const [ends, setEnds] = useState(() => ({ start: here(readQ(inAddress("from"), units.length) ?? usual), goal: here(readQ(inAddress("to"), units.length) ?? usual) }));
  /** The ends that nobody has chosen. They leave q* where it is not free. */
  const unchosen = useRef({ start: inAddress("from") === null, goal: inAddress("to") === null });
  const [left, setLeft] = useState<("start" | "goal")[]>([]);
  useEffect(() => {
    if (!free) return;
    const moved = (["start", "goal"] as const).filter((end) => unchosen.current[end]);
    setEnds((old) => ({ ...old, ...Object.fromEntries(moved.map((end) => [end, here(free.q)])) }));
    setLeft(moved);
  }, [free]);
  const frames = useMemo(() => movingBodies(model).reverse(), [model]);
  /** The goal where it is the pose of a frame; null where it is a configuration. */
  const [pose, setPose] = useState(() => poseIn(frames, inAddress("pose")));
  const [flags, setFlags] = useState({ only: inAddress("regions_only") !== null, straight: inAddress("line") !== null });
  const [plan, setPlan] = useState<PlanResponse | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [asking, setAsking] = useState(false);
  const words = inWords(units);
  const began = left.filter((end) => end === "start" || !pose).map((end) => (end === "start" ? "From" : "To"));
  useAddress({
    from: ends.start.q && unlessUsual(ends.start.q, usual),
    to: pose ? null : ends.goal.q && unlessUsual(ends.goal.q, usual),
    pose: pose && [pose.frame, ...pose.texts].join(","),
    regions_only: flags.only ? "1" : null,
    line: flags.straight ? "1" : null,
  });
  const onPlan = (found: PlanResponse | null): void => {
    setPlan(found);
    onShow(found?.found ? shownOf(found) : null);
  };
  /** What the service is asked for. */
  const requested = (start: number[]): Requested => ({ scene: model.scene, start, ...(pose ? { pose: asked(pose), ...(flags.straight && { line: LINE }) } : { goal: ends.goal.q!, regions_only: flags.only }) });
  const ask = async (event: Event): Promise<void> => {
    event.preventDefault();
    const [start, goal] = [ends.start.q, ends.goal.q];
    unchosen.current = { start: false, goal: false };
    if (!start || !(goal || pose)) return setProblem(`Give ${plural(units.length, "number")} for ${start ? "the goal" : "the start"}, one for each joint, in ${words}.`);
    setProblem(null);
    setAsking(true);
    try {
      const found = await post<PlanResponse>("/v1/planning/plan", requested(start));
      onPlan(found);
      if (found.found) onMove(found.q[0]!);
    } catch (reason) {
      onPlan(null);
      setProblem(said(reason));
    }
    setAsking(false);
  };
  const set = (end: "start" | "goal", to: End): void => {
    unchosen.current[end] = false;
    setEnds((old) => ({ ...old, [end]: to }));
    onPlan(null);
  };
  const setGoalPose = (to: Typed | null): void => {
    setPose(to);
    onPlan(null);
  };
  const flag = (name: keyof typeof flags, on: boolean): void => {
    setFlags((old) => ({ ...old, [name]: on }));
    onPlan(null);
  };
  const use = (end: "start" | "goal", free: number[]): void => {
    if (end === "goal") setPose(null);
    set(end, here(free));
    onMove(free);
  };
  const field = (end: "start" | "goal") => (
    <>
      <label for={`plan-${end}`}>{end === "start" ? "From" : "To"}</label>
      <input id={`plan-${end}`} value={ends[end].text} onInput={({ currentTarget: { value } }) => set(end, { text: value, q: typed(value, units) })} aria-describedby="plan-units" spellcheck={false} autocomplete="off" />
      <button type="button" onClick={() => set(end, here(q))}>Set as {end}</button>
    </>
  );
  return (
    <div class="planning">
      <form onSubmit={(event) => void ask(event)}>
        <p class="end">{field("start")}</p>
        <p class="end">
          <label for="plan-kind">Goal</label>
          <select id="plan-kind" value={pose?.frame ?? ""} onChange={({ currentTarget: { value } }) => setGoalPose(value ? typedAt(model, value, q) : null)}>
            <option value="">a configuration</option>
            <optgroup label="a pose of the frame">{frames.map((frame) => <option key={frame}>{frame}</option>)}</optgroup>
          </select>
        </p>
        {pose ? <PoseFields model={model} q={q} pose={pose} onChange={setGoalPose} /> : <p class="end">{field("goal")}</p>}
        {free && began.length > 0 && <p class="quiet small">At q*, {free.why}. {began.join(" and ")} began at {free.where}.</p>}
        <p class="quiet small" id="plan-units">A configuration has one number for each joint, in {words}. Move the robot and set the start or the goal, or type.</p>
        {pose ? (
          <p><label><input type="checkbox" checked={flags.straight} onChange={(event) => flag("straight", event.currentTarget.checked)} /> On a straight line of the frame, to 1 mm and 0.5°</label></p>
        ) : (
          <p><label><input type="checkbox" checked={flags.only} onChange={(event) => flag("only", event.currentTarget.checked)} /> Only in certified regions</label></p>
        )}
        <button type="submit" class="primary" disabled={asking}>{asking ? "Planning …" : "Plan a motion"}</button>
      </form>
      {ends.start.q && (pose ?? ends.goal.q) && <Copies texts={textsOf(requested(ends.start.q))} note="Positions are in radians and metres." />}
      <div role="status">
        {problem && <p class="notice bad">{problem}</p>}
        {plan && !plan.found && <Why plan={plan} names={names} units={units} onUse={use} onLook={onMove} />}
      </div>
      {plan?.found && <p class="found"><strong>{plan.duration!.toFixed(2)} s</strong>, {units.includes("m") ? `${plan.length!.toPrecision(3)} long in radians and metres` : `${shown(plan.length!, "rad")} long`}. The robot's view plays it.</p>}
    </div>
  );
}

interface Requested {
  scene: string;
  start: number[];
  goal?: number[];
  regions_only?: boolean;
  pose?: ReturnType<typeof asked>;
  line?: typeof LINE;
}

/** The same request by the command, by curl, and in Python. */
function textsOf(body: Requested): Texts {
  const { scene, start, goal, regions_only: only, pose, line } = body;
  const to = pose ? [`--to-pose=${[...pose.position, ...pose.rpy].join(",")}`, `--frame=${shell(pose.frame)}`, ...(line ? ["--line", `--tolerance=${line.metres},${line.radians}`] : [])] : [`--to=${goal}`, ...(only ? ["--regions-only"] : [])];
  const given = pose ? `pose=${python(pose)}${line ? `, line=${python(line)}` : ""}` : `${python(goal)}${only ? ", regions_only=True" : ""}`;
  return {
    command: asCommand("ciris", "plan", scene, `--from=${start}`, ...to),
    curl: asCurl("/v1/planning/plan", body),
    Python: asPython(`motion = service.plan(${python(scene)}, ${python(start)}, ${given})`, "print(motion.q, motion.t, motion.reason)"),
  };
}

/** What proves a piece of the motion, in words. */
function partOf({ begin, end, region, map, motion, guarantee }: Piece): Part {
  const worth = <span class={`badge ${guarantee}`}>{guarantee}</span>;
  if (region) return { begin, end, by: "region", said: <>in region <a href={`/regions/${region}`}>{region.slice(0, 8)}</a> {worth}</> };
  return map
    ? { begin, end, by: "map", said: <>in proved cells of the <a href={`/jobs/${map}`}>map</a> {worth}</> }
    : { begin, end, by: "motion", said: <>in the tube of the proved motion <code>{motion!.slice(0, 8)}</code> {worth}</> };
}

function shownOf(plan: PlanResponse): Shown {
  const claim = <><span class="proved">Proved:</span> on all of the planned motion, no collision of the scene's pairs. Below the robot stands what proves each part; guarantee {plan.guarantee}.</>;
  return { q: plan.q, t: plan.t, parts: plan.pieces.map(partOf), way: plan.pieces.map(({ region }) => region), claim, file: plan };
}
