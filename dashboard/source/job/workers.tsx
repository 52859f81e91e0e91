// Who does what for the job at this moment.
import type { HeldWork } from "../common/schema";
import { plural } from "../common/words";
import { tick } from "../live";
import { address } from "./route";
import { stepOf } from "./steps";
import type { JobStore } from "./store";

const NAMED = 4;

export function Workers({ store, subject }: { store: JobStore; subject: string }) {
  return (
    <section aria-labelledby="h-workers">
      <h2 id="h-workers">Working on it</h2>
      {store.workers.length === 0 ? (
        <p class="empty">No process works on the job at this moment.</p>
      ) : (
        <ul class="workers">
          {store.workers.map((worker) => (
            <li key={worker.process + worker.pairs.join()}>
              <code title={worker.process}>{worker.process.split(":").slice(0, 2).join(":")}</code>{" "}
              <span>{worker.work === "pairs" ? <Certifies store={store} worker={worker} /> : stepOf(worker.work, subject)}</span>
              {worker.since && (
                <>
                  {", for "}
                  <span ref={(clock) => void (clock && tick(clock))} data-since={worker.since} title={`since ${new Date(worker.since).toLocaleString()}`} />
                </>
              )}
            </li>
          ))}
        </ul>
      )}
    </section>
  );
}

function Certifies({ store, worker }: { store: JobStore; worker: HeldWork }) {
  const more = worker.pairs.length - NAMED;
  return (
    <>
      Certifying {plural(worker.pairs.length, "pair")}:{" "}
      {worker.pairs.slice(0, NAMED).map((index, i) => {
        const pair = store.pairs[index];
        return (
          <span key={index}>
            {i > 0 && ", "}
            <a href={address({ pair: index })}>{pair ? `${pair.a} – ${pair.b}` : `pair ${index}`}</a>
          </span>
        );
      })}
      {more > 0 && ` and ${more} more`}
    </>
  );
}
