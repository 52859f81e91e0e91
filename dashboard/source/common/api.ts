// Asks the service. Every answer that is no success becomes a ServiceError that says what, where and what to do.
import type { Event, EventList, Job } from "./schema";

/** Whether the service asks for keys. */
export const KEYED = document.body.dataset.keyed !== undefined;
/** Whether whoever reads the page may add scenes and start jobs. What somebody may not do is not offered. */
export const MAY_START = document.body.dataset.scope !== "read";

export class ServiceError extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    message: string,
    readonly field: string | null,
    readonly hint: string | null,
  ) {
    super(message);
  }

  /** All of it in a sentence, for people, as the command says it. */
  get text(): string {
    return this.hint ? `${this.message} (${this.hint})` : this.message;
  }
}

async function answer<T>(response: Response): Promise<T> {
  if (response.ok) return response.status === 204 ? (undefined as T) : ((await response.json()) as T);
  if (response.status === 401) location.reload();
  const problem = (await response.json().catch(() => ({}))) as Record<string, string | undefined>;
  throw new ServiceError(
    response.status,
    problem.code ?? "unknown",
    problem.detail ?? `the service answered ${response.status}`,
    problem.field ?? null,
    problem.hint ?? null,
  );
}

export async function get<T>(path: string, signal?: AbortSignal): Promise<T> {
  return answer<T>(await fetch(path, { headers: { Accept: "application/json" }, signal }));
}

export async function post<T>(path: string, body?: unknown, signal?: AbortSignal): Promise<T> {
  const headers = { Accept: "application/json", "Content-Type": "application/json" };
  return answer<T>(await fetch(path, { method: "POST", headers, body: body === undefined ? undefined : JSON.stringify(body), signal }));
}

export async function remove(path: string): Promise<void> {
  return answer<void>(await fetch(path, { method: "DELETE", headers: { Accept: "application/json" } }));
}

export async function upload<T>(path: string, field: string, file: File): Promise<T> {
  const form = new FormData();
  form.append(field, file);
  return answer<T>(await fetch(path, { method: "POST", headers: { Accept: "application/json" }, body: form }));
}

/** Says in a sentence what went wrong, whatever was thrown. */
export function said(problem: unknown): string {
  if (problem instanceof ServiceError) return problem.text;
  return problem instanceof TypeError ? "The service does not answer." : String(problem);
}

const KINDS = ["job", "iteration", "pairs", "step", "note", "region", "lost", "cover", "child"];
const POLL_MS = 2000;
/** A stream that says nothing, not even that it is open, for so long after it was asked for is held back by somebody. */
const OPEN_MS = 4000;

/**
 * Follows a job's events from `after` on: by the stream, or by asking again where no stream opens. A hidden page has no stream, because a
 * browser opens only six connections to one service; it goes on where it stopped when it is looked at.
 *
 * @returns a function that ends it.
 */
export function follow(job: string, after: number, seen: (event: Event) => void, connected: (is: boolean) => void, ended: () => void): () => void {
  let last = after;
  let stopped = false;
  let source: EventSource | null = null;
  let timer: ReturnType<typeof setTimeout> | undefined;
  let polling = false;
  const take = (event: Event): void => {
    if (event.seq <= last) return;
    last = event.seq;
    seen(event);
  };
  const close = (): void => {
    source?.close();
    source = null;
    clearTimeout(timer);
    polling = false;
  };
  const end = (): void => {
    if (stopped) return;
    stop();
    ended();
  };
  const poll = async (): Promise<void> => {
    polling = true;
    try {
      const { events } = await get<EventList>(`/v1/jobs/${job}/events?after=${last}`);
      events.forEach(take);
      const now = await get<Job>(`/v1/jobs/${job}`);
      connected(true);
      if (now.ended && events.length === 0) return end();
    } catch {
      connected(false);
    }
    if (!stopped && polling) timer = setTimeout(() => void poll(), POLL_MS);
  };
  const open = (): void => {
    close();
    source = new EventSource(`/v1/jobs/${job}/events/stream?after=${last}`);
    timer = setTimeout(() => {
      source?.close();
      void poll();
    }, OPEN_MS);
    for (const kind of KINDS) source.addEventListener(kind, (message) => take(JSON.parse((message as MessageEvent<string>).data) as Event));
    source.addEventListener("end", end);
    source.addEventListener("open", () => {
      clearTimeout(timer);
      connected(true);
    });
    source.addEventListener("error", () => {
      // A browser opens a stream again by itself, unless the first answer was no stream. Meanwhile the events are asked for.
      if (stopped || polling) return;
      clearTimeout(timer);
      timer = setTimeout(() => {
        source?.close();
        void poll();
      }, POLL_MS);
    });
  };
  const look = (): void => (document.hidden ? close() : open());
  const stop = (): void => {
    stopped = true;
    close();
    document.removeEventListener("visibilitychange", look);
  };
  document.addEventListener("visibilitychange", look);
  look();
  return stop;
}
