// Buttons with data-post or data-delete ask the service to do something; forms with data-submit-on-change need no button; times are shown as the reader's clock has them.
import { post, remove, said, upload } from "./common/api";
import { refresh } from "./live";

interface Answer {
  id?: string;
  holds?: boolean;
  statement?: string[];
  error?: { message: string };
}

export function localTimes(root: ParentNode): void {
  for (const time of root.querySelectorAll("time")) {
    time.textContent = new Date(time.dateTime).toLocaleString();
    time.title = time.dateTime;
  }
}

export function startButtons(): void {
  document.addEventListener("click", (click) => {
    const button = (click.target as Element).closest<HTMLButtonElement>("button[data-post], button[data-delete]");
    if (button) void press(button);
    const sample = (click.target as Element).closest<HTMLButtonElement>("button[data-sample]");
    if (sample) void addSample(sample);
  });
  const making = document.querySelector<HTMLFormElement>("#make-key");
  making?.addEventListener("submit", (submit) => {
    submit.preventDefault();
    void makeKey(making);
  });
  for (const form of document.querySelectorAll<HTMLFormElement>("form[data-submit-on-change]")) {
    form.addEventListener("change", () => {
      // What is not chosen stays out of the address.
      const chosen = [...new FormData(form)].filter(([, value]) => value !== "").map(([name, value]) => [name, String(value)]);
      location.assign(chosen.length ? `${form.action}?${new URLSearchParams(chosen)}` : form.action);
    });
  }
}

async function press(button: HTMLButtonElement): Promise<void> {
  const { post: path, delete: gone, follow, statement, confirm: question } = button.dataset;
  if (question && !confirm(question)) return;
  button.disabled = true;
  try {
    if (gone) await remove(gone);
    const answer = gone ? {} : await post<Answer>(path!);
    if (follow) location.assign(follow + answer.id);
    else if (statement) {
      say(document.getElementById(statement)!, answer);
      button.disabled = false;
    } else void refresh(document.getElementById("live")!.dataset.refresh!);
  } catch (problem) {
    button.disabled = false;
    complain(button, said(problem));
  }
}

/** Makes a key and shows it, which nobody can do again. */
async function makeKey(form: HTMLFormElement): Promise<void> {
  const place = document.getElementById("made-key")!;
  try {
    const given = Object.fromEntries(new FormData(form));
    const { name, key } = await post<{ name: string; key: string }>("/v1/keys", { ...given, days: given.days ? Number(given.days) : null });
    place.className = "notice";
    place.replaceChildren(`The key ${name}. Copy it now, nobody can see it again: `, Object.assign(document.createElement("code"), { textContent: key }));
    form.reset();
    void refresh(form.dataset.refresh!);
  } catch (problem) {
    place.className = "notice bad";
    place.textContent = said(problem);
  }
  place.hidden = false;
}

/** Adds a scene that comes with the service, and opens the form with it. */
async function addSample(button: HTMLButtonElement): Promise<void> {
  button.disabled = true;
  try {
    const file = await (await fetch(button.dataset.sample!)).blob();
    const { id } = await upload<{ id: string }>("/v1/scenes", "bundle", new File([file], "sample.zip", { type: "application/zip" }));
    location.assign(`/new?scene=${id}&q=${button.dataset.q}`);
  } catch (problem) {
    button.disabled = false;
    complain(button, said(problem));
  }
}

/** Says below a button's row why it could not be done. */
function complain(button: HTMLButtonElement, text: string): void {
  const row = button.parentElement!;
  const old = row.nextElementSibling;
  const notice = old?.classList.contains("refusal") ? old : document.createElement("p");
  notice.className = "notice bad refusal";
  notice.setAttribute("role", "alert");
  notice.textContent = text;
  row.after(notice);
}

function say(place: HTMLElement, answer: Answer): void {
  const lines = answer.holds ? ["The proof holds:", ...answer.statement!] : ["The proof does not hold:", answer.error!.message];
  place.textContent = lines.join("\n");
  place.hidden = false;
}
