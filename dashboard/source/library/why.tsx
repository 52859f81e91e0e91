// Why there is no motion, in plain words, and what people can do about it.
import type { BeyondLimit, Collision, PlanResponse } from "../common/schema";
import { inText, shown } from "../common/units";
import { plural } from "../common/words";

interface Props {
  plan: PlanResponse;
  names: string[];
  units: ("rad" | "m")[];
  /** Takes a configuration as an end of the motion. */
  onUse: (end: "start" | "goal", q: number[]) => void;
  onLook: (q: number[]) => void;
}

export function Why({ plan, names, units, onUse, onLook }: Props) {
  const { collision, reached, complete } = plan;
  return (
    <div class="notice">
      <p>{why(plan, names, units)}</p>
      {collision && (collision.free ? (
        <p><button type="button" onClick={() => onUse(collision.where === "start" ? "start" : "goal", collision.free!)}>Use the free configuration near by</button></p>
      ) : (
        <p>No free configuration was found near by.</p>
      ))}
      {reached && <p><button type="button" onClick={() => onLook(reached.q)}>Show the nearest configuration</button></p>}
      {!complete && <p>Not all regions have been compared with each other yet. Ask again.</p>}
    </div>
  );
}

function why(plan: PlanResponse, names: string[], units: ("rad" | "m")[]): string {
  const { reason, limit, collision, reached, line, nearest, gap } = plan;
  const part = line && `There is a motion for ${(100 * line.part).toFixed(0)} % of the line.`;
  switch (reason!) {
    case "start_outside_limits":
    case "goal_outside_limits":
    case "via_outside_limits":
      return beyond(limit!, units[names.indexOf(limit!.joint)]!);
    case "start_in_collision":
    case "goal_in_collision":
    case "via_in_collision":
      return touching(collision!);
    case "pose_unreachable":
      return `No configuration was found at which the frame has this pose. The nearest one that was found is off by ${(1000 * reached!.metres).toPrecision(3)} mm and ${shown(reached!.radians, "rad")}.`;
    case "pose_in_collision":
      return `Bodies touch at every configuration that was found for this pose. At one of them, ${collision!.a} and ${collision!.b} touch.${collision!.free ? " At the free configuration near by, the frame has another pose." : ""}`;
    case "line_limit":
      return `${part} There ${line!.joint} is at its limit.`;
    case "line_singular":
      return `${part} There the arm cannot move the frame on: it is stretched, or two of its axes are in line.`;
    case "line_tolerance":
      return `${part} There the line asks for segments that are too short.`;
    case "line_collision":
      return line!.a ? `${part} There ${line!.a} and ${line!.b} touch.` : `${part} There two bodies touch.`;
    case "no_motion":
      return "The search found no motion in time. There may be one.";
    case "not_certified":
      return "The search found a motion, but none that can be certified: it passes by something too closely.";
    case "start_uncovered":
    case "goal_uncovered": {
      const said = `No region contains the ${reason === "start_uncovered" ? "start" : "goal"}.`;
      return nearest ? `${said} The nearest region is ${nearest.region!.slice(0, 8)}, whose nearest point is ${inText(nearest.q, units)}.` : said;
    }
    case "disconnected":
      return `No region that is connected with the start overlaps one that is connected with the goal (${plural(gap!.start_regions, "region")} and ${gap!.goal_regions}). ${gap!.q ? `A region that is grown at ${inText(gap!.q, units)} may join them.` : "No free configuration was found near its middle."}`;
    case "not_proved":
      return "Regions lead from the start to the goal, but no motion was found that is proved to lie in them.";
  }
}

function beyond({ where, joint, value, lower, upper }: BeyondLimit, unit: "rad" | "m"): string {
  const limit = upper !== null && value > upper ? `above its upper limit, ${shown(upper, unit)}` : `below its lower limit, ${shown(lower!, unit)}`;
  return `${joint} of the ${where} is at ${shown(value, unit)}. This is ${limit}.`;
}

function touching({ where, a, b, depth }: Collision): string {
  const how = ` With the padding, they overlap by ${(1000 * depth).toPrecision(3)} mm.`;
  return `${a} and ${b} touch at the ${where}.${how}`;
}
