// The part of the form that says what the job shall do.
import { Options, type Refused } from "./options";
import type { Part, Wish } from "./request";

interface Props {
  wish: Wish;
  /** The options of the kind of job, by their places in the request. */
  parts: Part[];
  refused: Refused | null;
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
  map: ["Prove these configurations first", "before the samples decide where to work"],
} as const;

export function Wishes({ wish, parts, refused, onWish, marks, onMark, onGo }: Props) {
  const set = (part: Partial<Wish>): void => onWish({ ...wish, ...part });
  const [title, why] = MARKS[wish.kind === "cover" ? wish.goal : wish.kind];
  const shared = { given: wish.given, onGive: (path: string, value: string) => set({ given: { ...wish.given, [path]: value } }), refused };
  const goal = (name: string): boolean => (wish.kind === "map" || (wish.kind === "cover" && wish.goal === "coverage")) && name === "coverage";
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
        <label class="card">
          <input type="radio" name="kind" checked={wish.kind === "map"} onChange={() => set({ kind: "map" })} />
          <span><strong>Map the scene</strong>: prove as much as possible of the free configurations, cell by cell, without a seed.</span>
        </label>
      </fieldset>
      {wish.kind === "cover" && (
        <p class="field">
          <label for="new-goal">Goal</label>
          <select id="new-goal" value={wish.goal} onChange={(event) => set({ goal: event.currentTarget.value as Wish["goal"] })}>
            <option value="coverage">cover a share of the free configurations</option>
            <option value="connect">connect configurations</option>
          </select>
        </p>
      )}
      {parts.map(({ place, options }) => <Options key={place} place={place} options={options.filter(({ name }) => goal(name))} {...shared} />)}
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
      <details onInvalidCapture={(event) => void (event.currentTarget.open = true)}>
        <summary>More options</summary>
        {parts.map(({ place, title, options }) => (
          <fieldset key={place}>
            <legend>{title}</legend>
            <Options place={place} options={options.filter(({ name }) => !goal(name))} {...shared} />
          </fieldset>
        ))}
      </details>
      <details onInvalidCapture={(event) => void (event.currentTarget.open = true)}>
        <summary>Deadline and priority</summary>
        <p class="field">
          <label for="new-minutes">Deadline</label>
          <input id="new-minutes" type="number" min={0.01} max={43200} step="any" placeholder="none" value={wish.minutes} onInput={(event) => set({ minutes: event.currentTarget.value })} />
          <span class="quiet">minutes; what is proved until then is kept</span>
        </p>
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
