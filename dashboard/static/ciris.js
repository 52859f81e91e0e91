// Keeps #live up to date: by a job's event stream (data-events) or by asking again (data-poll).
"use strict";

const POLL_MS = 3000;
const PAUSE_MS = 700;
const live = document.getElementById("live");
const connection = document.getElementById("connection");

function localTimes(root) {
  for (const time of root.querySelectorAll("time")) {
    time.textContent = new Date(time.dateTime).toLocaleString();
    time.title = time.dateTime;
  }
}

// Replaces the content; what the reader has opened, scrolled or focused stays as it was.
function replace(html) {
  const open = [...live.querySelectorAll("details[open][id]")].map((element) => element.id);
  const scrolled = [...live.querySelectorAll(".scroll[id]")].map((element) => [element.id, element.scrollLeft, element.scrollTop]);
  const focused = [...live.querySelectorAll("a, button, summary, [tabindex]")].indexOf(document.activeElement);
  live.innerHTML = html;
  localTimes(live);
  for (const id of open) document.getElementById(id)?.setAttribute("open", "");
  for (const [id, left, top] of scrolled) document.getElementById(id)?.scrollTo(left, top);
  if (focused >= 0) live.querySelectorAll("a, button, summary, [tabindex]")[focused]?.focus({ preventScroll: true });
}

async function refresh(url) {
  try {
    const response = await fetch(url, { headers: { Accept: "text/html" } });
    if (response.status === 401) location.reload();
    connection.hidden = response.ok;
    if (response.ok) replace(await response.text());
  } catch {
    connection.hidden = false;
  }
}

function poll(url) {
  setInterval(() => { if (!document.hidden) refresh(url); }, POLL_MS);
}

function follow(events, url) {
  const source = new EventSource(events);
  let waiting = null;
  const soon = () => {
    waiting ??= setTimeout(() => { waiting = null; refresh(url); }, PAUSE_MS);
  };
  for (const kind of ["job", "iteration", "pairs", "step", "region"]) source.addEventListener(kind, soon);
  source.addEventListener("end", () => { source.close(); soon(); });
  source.addEventListener("open", () => { connection.hidden = true; });
  source.addEventListener("error", () => { connection.hidden = false; });
}

function say(place, answer) {
  const lines = answer.holds ? ["The proof holds:", ...answer.statement] : ["The proof does not hold:", answer.error.message];
  place.textContent = lines.join("\n");
  place.hidden = false;
}

document.addEventListener("click", async (click) => {
  const button = click.target.closest("button[data-post]");
  if (!button) return;
  button.disabled = true;
  const response = await fetch(button.dataset.post, { method: "POST" });
  const answer = await response.json();
  if (response.ok && button.dataset.follow) location.assign(button.dataset.follow + answer.id);
  else if (response.ok && button.dataset.statement) {
    say(document.getElementById(button.dataset.statement), answer);
    button.disabled = false;
  }
  else if (response.ok) refresh(live.dataset.refresh);
  else button.textContent = answer.detail;
});

localTimes(document);
if (live?.dataset.poll) poll(live.dataset.poll);
if (live?.dataset.events) follow(live.dataset.events, live.dataset.refresh);
