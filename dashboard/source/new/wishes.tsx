// The part of the form that says what the job shall do.
import { FileField } from "./file";
import { Options, type Refused } from "./options";
import { PRIORITIES, type Kind, type Part, type Wish } from "./request";

interface Props {
  wish: Wish;
  /** The options of the kind of job, by their places in the request. */
  parts: Part[];
  refused: Refused | null;
  onWish: (wish: Wish) => void;
  /** The configurations that were added, in words. */
  marks: string[];
  /** Whether the configuration that is shown is one of them. */
  here: boolean;
  onMark: () => void;
  onGo: (mark: number) => void;
}

const KINDS: Record<Kind, [string, string]> = {
  grow: ["Grow one region", "around this configuration of the robot, and certify it."],
  cover: ["Cover the scene", "with regions, one after another, until a share of it is covered or configurations are connected."],
  map: ["Map the scene", "to prove as much as possible of the free configurations, cell by cell. It needs no configuration to begin with."],
  "certify-path": ["Certify a motion", "from a file or through configurations, or find its first contact."],
  certify: ["Certify a polytope", "of joint positions (C s ≤ d) from a file, as it is: one outcome for each pair."],
  recertify: ["Certify a region again", "in this scene, after the scene has changed."],
};
const MARKS = {
  grow: ["The region must also contain", "such as where it shall meet another region"],
  coverage: ["Regions begin at", "before the service chooses where to begin"],
  connect: ["Connect these configurations", "each gets a region; overlaps shall lead from each to all others"],
  map: ["Prove these configurations first", "before the samples decide where to work"],
  "certify-path": ["Waypoints", "where there is no file; the motion is straight in q between them"],
} as const;

export function Wishes({ wish, parts, refused, onWish, marks, here, onMark, onGo }: Props) {
  const { kind } = wish;
  const set = (part: Partial<Wish>): void => onWish({ ...wish, ...part });
  const about = kind === "certify" || kind === "recertify" ? null : MARKS[kind === "cover" ? wish.goal : kind];
  const shared = { given: wish.given, onGive: (path: string, value: string) => set({ given: { ...wish.given, [path]: value } }), refused };
  // What everybody should see stands above, and the rest in a fold.
  const first = (name: string): boolean => kind === "certify-path" || ((kind === "map" || (kind === "cover" && wish.goal === "coverage")) && name === "coverage");
  const rest = parts.filter(({ options }) => options.some(({ name }) => !first(name)));
  return (
    <>
      <fieldset class="kinds">
        <legend>What shall the job do?</legend>
        {(Object.keys(KINDS) as Kind[]).map((name) => (
          <label class="card" key={name}>
            <input type="radio" name="kind" checked={kind === name} onChange={() => set({ kind: name, file: null, kept: {} })} />
            <span><strong>{KINDS[name][0]}</strong> {KINDS[name][1]}</span>
          </label>
        ))}
      </fieldset>
      {(kind === "certify" || kind === "certify-path") && <FileField kind={kind} file={wish.file} onFile={(file) => set({ file })} key={kind} />}
      {kind === "recertify" && (
        <p class="field">
          <label for="new-region">Region</label>
          <input id="new-region" value={wish.region} spellcheck={false} autocomplete="off" aria-describedby="new-region-says" onInput={(event) => set({ region: event.currentTarget.value })} />
          <span class="quiet" id="new-region-says">Its id, or the first characters. Its scene has the same robot, limits and q* as this one. The pages of regions lead here.</span>
        </p>
      )}
      {wish.kind === "cover" && (
        <p class="field">
          <label for="new-goal">Goal</label>
          <select id="new-goal" value={wish.goal} onChange={(event) => set({ goal: event.currentTarget.value as Wish["goal"] })}>
            <option value="coverage">cover a share of the free configurations</option>
            <option value="connect">connect configurations</option>
          </select>
        </p>
      )}
      {parts.map(({ place, options }) => <Options key={place} place={place} options={options.filter(({ name }) => first(name))} {...shared} />)}
      {about && <div class="marks">
        <p>{about[0]} <span class="quiet">({about[1]})</span></p>
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
        <button type="button" disabled={here} onClick={onMark}>{here ? "This configuration is added" : "Add this configuration"}</button>
      </div>}
      {Object.keys(wish.kept).length > 0 && <p class="notice">Kept from the earlier job: {Object.keys(wish.kept).join(", ")}. <button type="button" class="plain" onClick={() => set({ kept: {} })}>remove</button></p>}
      {rest.length > 0 && <details onInvalidCapture={(event) => void (event.currentTarget.open = true)}>
        <summary>More options</summary>
        {rest.map(({ place, title, options }) => (
          <fieldset key={place}>
            <legend>{title}</legend>
            <Options place={place} options={options.filter(({ name }) => !first(name))} {...shared} />
          </fieldset>
        ))}
      </details>}
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
            {PRIORITIES.map((step) => <option value={step} key={step}>{step === "0" ? "0, as others" : step}</option>)}
          </select>
          <span class="quiet">each step up doubles its share of the work</span>
        </p>
      </details>
    </>
  );
}
