// Keeps #live, a part of a page that the server writes, up to date: by asking again (data-poll), or when a job's island says so.
import { localTimes } from "./buttons";

const POLL_MS = 3000;

export function startLive(): void {
  const live = document.getElementById("live");
  if (live?.dataset.poll) setInterval(() => { if (!document.hidden) void refresh(live.dataset.poll!); }, POLL_MS);
}

export function connected(is: boolean): void {
  document.getElementById("connection")!.hidden = is;
}

/** Asks for the part again and shows it. */
export async function refresh(url: string): Promise<void> {
  try {
    const response = await fetch(url, { headers: { Accept: "text/html" } });
    if (response.status === 401) location.reload();
    connected(response.ok);
    if (response.ok) replace(document.getElementById("live")!, await response.text());
  } catch {
    connected(false);
  }
}

// What the reader has opened, scrolled or focused stays as it was.
function replace(live: HTMLElement, html: string): void {
  const focusable = "a, button, summary, [tabindex]";
  const open = [...live.querySelectorAll("details[open][id]")].map((element) => element.id);
  const scrolled = [...live.querySelectorAll(".scroll[id]")].map((element) => [element.id, element.scrollLeft, element.scrollTop] as const);
  const focused = [...live.querySelectorAll(focusable)].indexOf(document.activeElement!);
  live.innerHTML = html;
  localTimes(live);
  for (const id of open) document.getElementById(id)?.setAttribute("open", "");
  for (const [id, left, top] of scrolled) document.getElementById(id)?.scrollTo(left, top);
  if (focused >= 0) live.querySelectorAll<HTMLElement>(focusable)[focused]?.focus({ preventScroll: true });
}
