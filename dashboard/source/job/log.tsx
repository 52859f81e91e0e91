// What has happened to the job, in sentences, the newest first.
import { useState } from "preact/hooks";
import { inAddress, useAddress } from "../common/address";
import type { Event } from "../common/schema";
import { plural } from "../common/words";
import { duration } from "./outcomes";
import { stageOf, stepOf } from "./steps";
import type { JobStore } from "./store";

const STEP: Record<string, string> = { open: "waits for a worker", running: "begun" };
const ITERATION: Record<string, string> = {
  certified: "is certified",
  failed: "ends with pairs that are not certified",
  skipped: "was left, because the job has ended",
};
const IS: Record<string, string> = {
  queued: "waits for a worker",
  running: "has begun",
  cancelling: "is being cancelled",
  cancelled: "was cancelled",
  succeeded: "has succeeded",
  failed: "has failed",
};
const KINDS: Record<string, string> = {
  job: "the job",
  iteration: "iterations",
  pairs: "pairs",
  step: "steps",
  note: "progress",
  region: "regions",
  lost: "lost work",
  cover: "the cover",
  child: "regions of the cover",
};

function counted(pairs: { state: string }[]): string {
  const counts = new Map<string, number>();
  for (const { state } of pairs) counts.set(state, (counts.get(state) ?? 0) + 1);
  return [...counts].map(([state, count]) => `${count} ${state.replaceAll("_", " ")}`).join(", ");
}

/** Says in a sentence what has happened to a job that makes the subject, such as the map. */
function sentence({ kind, data }: Event, subject: string): string {
  const text = (name: string): string => String(data[name] ?? "").replaceAll("_", " ");
  /** The part of a sentence that is there only where the event has a value of this name. */
  const where = (name: string, words: string): string => (data[name] ? words : "");
  const state = text("state"), number = text("iteration") || text("index");
  switch (kind) {
    case "job": {
      // The reason says more than the outcome, which for a cover or a map is about samples.
      const why = data.reason && data.reason !== data.outcome ? `: ${data.reason}` : where("outcome", ` with the outcome ${text("outcome")}`);
      return `The job ${IS[state] ?? state}${why}.`;
    }
    case "iteration": {
      const one = `Iteration ${number} (${stageOf(text("label"))})`;
      if (state !== "running") return `${one} ${ITERATION[state] ?? state}.`;
      const together = where("together", `, of which ${data.together} share the proof of another one`);
      return `${one} begins with ${plural(Number(data.pairs ?? 0), "pair")} to prove${together}${where("reused", `; ${data.reused} more keep their proofs`)}.`;
    }
    case "pairs": {
      const pairs = (data.pairs ?? []) as { state: string; seconds: number | null }[];
      const spent = pairs.reduce((sum, { seconds }) => sum + (seconds ?? 0), 0);
      return `${plural(pairs.length, "result")} in iteration ${number}: ${counted(pairs)}, after ${duration(spent)} of work.`;
    }
    case "step": {
      const after = where("seconds", ` after ${duration(Number(data.seconds))}`);
      return `${stepOf(String(data.kind), subject)}: ${STEP[state] ?? state}${after}.`;
    }
    case "region": {
      const share = (data.share as { value: number | null } | null)?.value;
      const kept = share == null ? "" : `; it keeps ${(100 * share).toPrecision(3)} % of the starting region, as samples say`;
      return `A region is certified in iteration ${number} (${text("guarantee")})${kept}.`;
    }
    case "note": {
      const told = String(data.text);
      return `${told.charAt(0).toUpperCase()}${told.slice(1)}.`;
    }
    case "lost":
      return `${data.worker ?? "A process"} no longer works for the job${where("reason", ` (${text("reason")})`)}; its work is open again.`;
    case "child":
      return `The job of region ${data.number} of the cover ${IS[state] ?? state}${where("reason", `: ${data.reason}`)}.`;
    case "cover":
      return "What is covered has been looked at.";
    default:
      return kind;
  }
}

export function Log({ store, subject }: { store: JobStore; subject: string }) {
  const [kind, setKind] = useState(inAddress("events") ?? "");
  useAddress({ events: kind || null });
  const known = store.events.filter((event) => !kind || event.kind === kind).reverse();
  const earlier = (store.events[0]?.seq ?? 1) > 1;
  // A map has no regions, and a region no cover. Of events that are not here yet, nobody knows the kinds.
  const there = Object.entries(KINDS).filter(([name]) => earlier || store.events.some((event) => event.kind === name));
  return (
    <section aria-labelledby="h-log">
      <h2 id="h-log">What happened</h2>
      <div class="tools">
        <label>
          Show{" "}
          <select aria-label="Show events" value={kind} onChange={(event) => setKind(event.currentTarget.value)}>
            <option value="">everything</option>
            {there.map(([name, words]) => (
              <option value={name} key={name}>
                {words}
              </option>
            ))}
          </select>
        </label>
      </div>
      {known.length === 0 && <p class="empty">{kind ? "Nothing of this kind is among the events that are shown." : "Nothing has happened yet."}</p>}
      <ol class="scroll log" tabIndex={0} aria-label="Events, the newest first" reversed>
        {known.slice(0, 400).map((event) => (
          <li key={event.seq} data-kind={event.kind}>
            <time dateTime={event.created_at} title={event.created_at}>
              {new Date(event.created_at).toLocaleTimeString()}
            </time>
            <span>{sentence(event, subject)}</span>
          </li>
        ))}
      </ol>
      {earlier && (
        <button type="button" onClick={() => void store.earlier()}>
          Show earlier events
        </button>
      )}
    </section>
  );
}
