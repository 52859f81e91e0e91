// Keeps #live, a part of a page that the server writes, up to date: by asking again (data-poll), or when a job's island says so.
import { localTimes } from "./buttons";
import { localAngles } from "./common/units";

const POLL_MS = 3000;

export function startLive(): void {
  const live = document.getElementById("live");
  if (live?.dataset.poll) setInterval(() => { if (!document.hidden) void refresh(live.dataset.poll!); }, POLL_MS);
  setInterval(clocks, 1000);
}

export function connected(is: boolean): void {
  document.getElementById("connection")!.hidden = is;
}

/** Times that run: <dd data-since="..."> shows how long ago that is, to the second. */
function clocks(): void {
  document.querySelectorAll<HTMLElement>("[data-since]").forEach(tick);
}

export function tick(clock: HTMLElement): void {
  const seconds = Math.max(0, Math.round((Date.now() - Date.parse(clock.dataset.since!)) / 1000));
  const [hours, minutes] = [Math.floor(seconds / 3600), Math.floor(seconds / 60) % 60];
  clock.textContent = seconds < 100 ? `${seconds} s` : hours ? `${hours} h ${minutes} min` : `${minutes} min ${seconds % 60} s`;
}

let asked = 0;
let shown = 0;
let again: ReturnType<typeof setTimeout> | undefined;

/** Asks for the part again and shows it, unless a later answer is there already. It asks until it is answered. */
export async function refresh(url: string): Promise<void> {
  clearTimeout(again);
  const turn = ++asked;
  let ok = false;
  try {
    const response = await fetch(url, { headers: { Accept: "text/html" } });
    if (response.status === 401 || response.redirected) return location.reload(); // to the page for signing in
    ok = response.ok;
    const html = ok ? await response.text() : "";
    if (ok && turn > shown) {
      shown = turn;
      replace(document.getElementById("live")!, html);
    }
  } catch {
    ok = false;
  }
  connected(ok);
  if (!ok) again = setTimeout(() => void refresh(url), POLL_MS);
}

const FOCUSABLE = "a, button, summary, [tabindex]";

/** Says what a focusable element is for; a row that comes before it does not change that. */
function purpose(element: Element): string {
  return ["href", "data-post", "data-delete", "id", "aria-label"].map((name) => element.getAttribute(name)).join(" ") + element.textContent;
}

let last = "";

// What the reader has opened, scrolled, focused or selected stays as it was. While text is selected, the part waits.
function replace(live: HTMLElement, html: string): void {
  const selection = getSelection();
  if (html === last || (selection && !selection.isCollapsed && live.contains(selection.anchorNode))) return;
  last = html;
  const open = [...live.querySelectorAll("details[open][id]")].map((element) => element.id);
  const scrolled = [...live.querySelectorAll(".scroll[id]")].map((element) => [element.id, element.scrollLeft, element.scrollTop] as const);
  const focused = live.contains(document.activeElement) ? purpose(document.activeElement!) : null;
  live.innerHTML = html;
  localTimes(live);
  localAngles(live);
  for (const id of open) document.getElementById(id)?.setAttribute("open", "");
  for (const [id, left, top] of scrolled) document.getElementById(id)?.scrollTo(left, top);
  if (focused !== null) [...live.querySelectorAll<HTMLElement>(FOCUSABLE)].find((element) => purpose(element) === focused)?.focus({ preventScroll: true });
}
