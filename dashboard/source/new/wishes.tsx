// The part of the form that says what the job shall do.
import type { ComponentChildren } from "preact";
import { METHODS, type Method, type Wish } from "./request";

interface Props {
  wish: Wish;
  onWish: (wish: Wish) => void;
  /** The configurations that were added, in words. */
  marks: string[];
  onMark: () => void;
  onGo: (mark: number) => void;
}

const MARKS = {
  grow: ["The region must also contain", "such as where it shall meet another region"],
  coverage: ["Regions begin at", "before the service chooses where to begin"],
  connect: ["Connect these configurations", "each gets a region; all of them shall end in one component"],
} as const;

export function Wishes({ wish, onWish, marks, onMark, onGo }: Props) {
  const set = (part: Partial<Wish>): void => onWish({ ...wish, ...part });
  const [title, why] = MARKS[wish.kind === "grow" ? "grow" : wish.goal];
  const number = (name: keyof Wish, label: string, unit: string, limits: { min: number | string; max?: number; step?: number | string; required?: boolean; placeholder?: string }): ComponentChildren => (
    <p class="field">
      <label for={`new-${name}`}>{label}</label>
      <input id={`new-${name}`} type="number" {...limits} value={wish[name] as string} onInput={(event) => set({ [name]: event.currentTarget.value })} />
      <span class="quiet">{unit}</span>
    </p>
  );
  const whole = { min: 1, step: 1, placeholder: "default" };
  return (
    <>
      <fieldset class="kinds">
        <legend>What shall the job do?</legend>
        <label class="card">
          <input type="radio" name="kind" checked={wish.kind === "grow"} onChange={() => set({ kind: "grow" })} />
          <span><strong>Grow one region</strong> around this configuration of the robot, and certify it.</span>
        </label>
        <label class="card">
          <input type="radio" name="kind" checked={wish.kind === "cover"} onChange={() => set({ kind: "cover" })} />
          <span><strong>Cover the scene</strong> with regions, one after another, until a share of it is covered or configurations are connected.</span>
        </label>
      </fieldset>
      {wish.kind === "grow" ? (
        <p class="field">
          <label for="new-method">First polytope</label>
          <select id="new-method" value={wish.method} onChange={(event) => set({ method: event.currentTarget.value as Method })}>
            {Object.entries(METHODS).map(([method, words]) => <option value={method} key={method}>{words}</option>)}
          </select>
        </p>
      ) : (
        <>
          <p class="field">
            <label for="new-goal">Goal</label>
            <select id="new-goal" value={wish.goal} onChange={(event) => set({ goal: event.currentTarget.value as Wish["goal"] })}>
              <option value="coverage">cover a share of the free configurations</option>
              <option value="connect">connect configurations</option>
            </select>
          </p>
          {wish.goal === "coverage" && number("coverage", "Share to cover", "%", { min: 0.1, max: 100, step: "any", required: true })}
          {number("regions", "At most", "regions", { ...whole, max: 100_000, placeholder: "1000" })}
        </>
      )}
      <div class="marks">
        <p>{title} <span class="quiet">({why})</span></p>
        {marks.length > 0 && (
          <ul>
            {marks.map((words, i) => (
              <li key={`${i} ${words}`}>
                <button type="button" class="plain" onClick={() => onGo(i)} aria-label={`${words}, show it`}>{words}</button>
                <button type="button" class="plain" onClick={() => set({ marks: wish.marks.filter((_, k) => k !== i) })} aria-label={`remove ${words}`}>remove</button>
              </li>
            ))}
          </ul>
        )}
        <button type="button" onClick={onMark}>Add this configuration</button>
      </div>
      <details>
        <summary>Effort, deadline and priority</summary>
        {number("minutes", "Deadline", "minutes; the regions so far are kept", { min: 0.01, max: 43200, step: "any", placeholder: "none" })}
        {number("cells", "Cells of a pair in a stage", "", { ...whole, max: 10_000_000 })}
        {number("stages", "Stages of a region", "", { ...whole, max: 100 })}
        <p class="field">
          <label for="new-priority">Priority</label>
          <select id="new-priority" value={wish.priority} onChange={(event) => set({ priority: event.currentTarget.value })}>
            {["3", "2", "1", "0", "-1", "-2", "-3"].map((step) => <option value={step} key={step}>{step === "0" ? "0, as others" : step}</option>)}
          </select>
          <span class="quiet">each step up doubles its share of the work</span>
        </p>
      </details>
    </>
  );
}
