// A motion from a file: certified, or shown where bodies first touch on it.
import { useState } from "preact/hooks";
import { post, said } from "../common/api";
import { asCommand, asCurl, asPython, Copies, python, shell, type Texts } from "../common/copies";
import type { Approach, MotionResponse, SceneModel } from "../common/schema";
import type { Motion, Part, Shown } from "./player";
import { readPath, type Path } from "../common/waypoints";

interface Props {
  model: SceneModel;
  onMove: (q: number[]) => void;
  /** Moves the robot to where a pair of bodies is near or touches, and paints the two. */
  onPair: (pair: Approach) => void;
  onShow: (motion: Shown | null) => void;
}

type MotionVerdict = Pick<MotionResponse, "certified_to" | "stop" | "clearance" | "proved_distance" | "seconds" | "verify_seconds">;

interface Answered {
  name: string;
  path: Path;
  verdict: MotionResponse;
}

export function Upload({ model, onMove, onPair, onShow }: Props) {
  const [asking, setAsking] = useState<string | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [answered, setAnswered] = useState<Answered | null>(null);
  const ask = async (file: File | undefined): Promise<void> => {
    if (!file) return;
    setAnswered(null);
    onShow(null);
    setProblem(null);
    setAsking(file.name);
    try {
      const path = readPath(file.name, await file.text());
      if (typeof path === "string") setProblem(`${file.name} holds no motion. ${path}`);
      else {
        const verdict = await post<MotionResponse>("/v1/planning/certify-path", { scene: model.scene, q: path.q, clearance: true });
        setAnswered({ name: file.name, path, verdict });
        onShow(shownOf(path, verdict));
        if (verdict.stop) onPair(verdict.stop);
        else onMove(path.q[0]!);
      }
    } catch (reason) {
      setProblem(said(reason));
    }
    setAsking(null);
  };
  return (
    <div class="upload">
      <p class="end">
        <label for="upload-path">File</label>
        <input id="upload-path" type="file" accept=".json,.csv,application/json,text/csv" disabled={asking !== null} aria-describedby="upload-says" onChange={(event) => void ask(event.currentTarget.files?.[0])} />
      </p>
      <p class="quiet small" id="upload-says">
        A JSON file with <code>q</code>, one row for each waypoint, and perhaps <code>t</code>; or a CSV file with such rows. Positions are in radians and metres. Between waypoints, each joint moves evenly.
      </p>
      <div role="status">
        {asking && <p class="notice">Certifying {asking} …</p>}
        {problem && <p class="notice bad">{problem}</p>}
        {answered && <Verdict verdict={answered.verdict} onPair={onPair} />}
      </div>
      {answered && <Copies texts={textsOf(model.scene, answered)} note="Positions are in radians and metres." />}
      {answered && <p class="quiet small">{answered.path.t ? "The robot's view plays the times of the file as seconds, from 0 on." : "The file has no times. The robot's view plays the motion so that all joints together move by 1 radian or metre a second. Your robot may move otherwise."}</p>}
    </div>
  );
}

/** The same question by the command, by curl, and in Python. */
function textsOf(scene: string, { name, path: { q } }: Answered): Texts {
  return {
    command: asCommand("ciris", "certify-path", scene, `--path=${shell(name)}`, "--clearance"),
    curl: asCurl("/v1/planning/certify-path", { scene, q, clearance: true }),
    Python: asPython(`motion = service.certify_path(${python(scene)}, ${python(q)}, clearance=True)`, "print(motion.outcome, motion.clearance)"),
  };
}

function Verdict({ verdict: { outcome, stop, nearest, clearance, proved_distance }, onPair }: { verdict: MotionResponse; onPair: (pair: Approach) => void }) {
  if (stop) {
    const where = `between waypoints ${stop.piece} and ${stop.piece + 1}, ${(100 * stop.time).toFixed(1)} % of the way`;
    return (
      <div class="notice bad">
        <p>
          <strong>Not certified.</strong>{" "}
          {outcome === "refuted" ? `${stop.a} and ${stop.b} touch. Their first contact is ${where}.` : outcome === "too_close" ? `${stop.a} and ${stop.b} are too close to tell, ${where}.` : `The motion needs too many intervals. The search ended at ${stop.a} and ${stop.b}, ${where}.`}
        </p>
        <p><button type="button" onClick={() => onPair(stop)}>Show this place</button></p>
      </div>
    );
  }
  return (
    <div class="notice">
      <p><strong class="proved">Certified.</strong> All along the motion, the bodies of every pair are at least {atLeast(1000 * (clearance ?? proved_distance!))} mm apart, as proved. The scene's padding is around them.</p>
      {nearest && <p><button type="button" onClick={() => onPair(nearest)}>Show where they are nearest</button></p>}
    </div>
  );
}

/** A number that is not negative in three digits, rounded down. */
function atLeast(value: number): string {
  const unit = value > 0 ? 10 ** (Math.floor(Math.log10(value)) - 2) : 1;
  return Number((Math.floor(value / unit) * unit).toPrecision(3)).toString();
}

export function shownOf(path: Path, verdict: MotionVerdict): Shown {
  const motion = timed(path);
  const parts = partsOf(motion, verdict);
  const { stop, clearance, proved_distance, seconds, verify_seconds } = verdict;
  const took = `verified now, in ${verify_seconds.toPrecision(2)} of ${seconds.toPrecision(2)} s`;
  const claim = stop ? (
    <><span class="inside not">Not proved</span> from {parts.at(-1)!.begin.toFixed(2)} s of the motion on{parts.length > 1 && <>; <span class="proved">proved</span> before, {took}</>}.</>
  ) : (
    <><span class="proved">Proved:</span> on all of the motion, the bodies of each covered pair are at least {atLeast(1000 * (clearance ?? proved_distance!))} mm apart; {took}.</>
  );
  return { ...motion, parts, way: parts.map(() => null), claim, file: null };
}

/** The path with times from 0 on: those of the file, or the length in q up to each waypoint. */
function timed({ q, t }: Path): Motion {
  let length = 0;
  const times = t?.map((time) => time - t[0]!) ?? q.map((at, i) => (length += i === 0 ? 0 : Math.hypot(...at.map((value, joint) => value - q[i - 1]![joint]!))));
  return { q, t: times };
}

function partsOf({ t }: Motion, { certified_to: to, stop }: MotionVerdict): Part[] {
  const end = t.at(-1)!;
  if (!stop) return [{ begin: 0, end, by: "motion", said: "on the motion, which is certified" }];
  const until = to ? t[to.piece]! + to.time * (t[to.piece + 1]! - t[to.piece]!) : 0;
  return [...(until > 0 ? [{ begin: 0, end: until, by: "motion", said: "on the part of the motion that is certified" } as const] : []), { begin: until, end, by: "nothing", said: "where nothing is proved" }];
}
