// A goal by the pose of a frame: where its origin is in the world, and how it is turned.
import { poseAt } from "../common/kinematics";
import type { SceneModel } from "../common/schema";
import { SHOWN } from "../common/units";

/** A pose as it is typed: x, y, z in metres, and roll, pitch, yaw as angles are shown. */
export interface Typed {
  frame: string;
  texts: string[];
}

interface Props {
  model: SceneModel;
  q: number[];
  pose: Typed;
  onChange: (pose: Typed) => void;
}

const { scale, word, sign: ANGLE } = SHOWN.rad;
const FIELDS = [...["x", "y", "z"].map((name) => ({ name, unit: "metres", sign: "m" })), ...["roll", "pitch", "yaw"].map((name) => ({ name, unit: word, sign: ANGLE }))];

/** The pose of a frame while the robot is at q. It has twelve digits, because a robot with few joints reaches a pose only if it is exact. */
export function typedAt(model: SceneModel, frame: string, q: number[]): Typed {
  const { position, rpy } = poseAt(model, frame, q);
  return { frame, texts: [...position, ...rpy.map((angle) => angle / scale)].map((value) => String(Number(value.toFixed(12)))) };
}

/** Reads a pose from the address, which has the frame and six numbers, angles as they are shown; null where it has none. */
export function poseIn(frames: string[], text: string | null): Typed | null {
  const [frame, ...texts] = text?.split(",") ?? [];
  return frame && frames.includes(frame) && texts.length === FIELDS.length && texts.every((one) => one !== "" && Number.isFinite(Number(one))) ? { frame, texts } : null;
}

/** The pose as the service takes it. */
export function asked({ frame, texts }: Typed): { frame: string; position: number[]; rpy: number[] } {
  const numbers = texts.map(Number);
  return { frame, position: numbers.slice(0, 3), rpy: numbers.slice(3).map((angle) => angle * scale) };
}

export function PoseFields({ model, q, pose, onChange }: Props) {
  const set = (at: number, text: string): void => onChange({ ...pose, texts: pose.texts.map((old, i) => (i === at ? text : old)) });
  return (
    <fieldset class="pose">
      <legend>Pose of {pose.frame} in the world</legend>
      {FIELDS.map(({ name, unit, sign }, i) => (
        <label key={name}>
          <span>{name}</span> <input type="number" step="any" required value={pose.texts[i]} aria-label={`${name}, ${unit}`} onInput={(event) => set(i, event.currentTarget.value)} /> <span aria-hidden="true">{sign}</span>
        </label>
      ))}
      <button type="button" onClick={() => onChange(typedAt(model, pose.frame, q))}>Set as goal</button>
    </fieldset>
  );
}
