// A field for each option that the service describes.
import { pathOf, type Given, type Option } from "./request";

/** What the service refused, at the path of a field. */
export interface Refused {
  path: string;
  text: string;
}

interface Props {
  options: Option[];
  /** Where the options stand in the request, such as `seed`. */
  place: string;
  given: Given;
  onGive: (path: string, value: string) => void;
  refused: Refused | null;
}

export function Options({ options, place, ...rest }: Props) {
  return (
    <>
      {options.map((one) => {
        const Shown = one.takes === "group" ? Group : Field;
        return <Shown key={one.name} one={one} path={pathOf(place, one.name)} {...rest} />;
      })}
    </>
  );
}

type FieldProps = Omit<Props, "options" | "place"> & { one: Option; path: string };

/** The options of a group are asked for where somebody turns it on. */
function Group({ one, path, ...rest }: FieldProps) {
  const on = rest.given[path] === "true";
  return (
    <fieldset>
      <legend><label><input id={`option-${path}`} type="checkbox" aria-describedby={`option-${path}-says`} checked={on} onChange={() => rest.onGive(path, on ? "" : "true")} /> {one.label}</label></legend>
      <Says one={one} path={path} refused={rest.refused} />
      {on && <Options options={one.options} place={path} {...rest} />}
    </fieldset>
  );
}

function Field({ one, path, given, onGive, refused }: FieldProps) {
  const value = given[path] ?? "";
  const about = { id: `option-${path}`, "aria-describedby": `option-${path}-says`, "aria-invalid": refused?.path === path };
  return (
    <p class="field">
      <label for={about.id}>{one.label}</label>
      {one.takes === "flag" ? (
        <input {...about} type="checkbox" checked={(value || String(one.default)) === "true"} onChange={({ currentTarget: { checked } }) => onGive(path, checked === (one.default ?? false) ? "" : String(checked))} />
      ) : one.takes === "choice" ? (
        <select {...about} value={value} onChange={(event) => onGive(path, event.currentTarget.value)}>
          <option value="">default</option>
          {one.choices.map((choice) => <option value={choice} key={choice}>{choice}</option>)}
        </select>
      ) : (
        <input {...about} type="number" {...bounds(one)} placeholder={String(one.default ?? "default")} value={value} onInput={(event) => onGive(path, event.currentTarget.value)} />
      )}
      <Says one={one} path={path} refused={refused} />
    </p>
  );
}

/** What an option means, and why its value was refused. What stands between backticks is code. */
function Says({ one, path, refused }: Pick<FieldProps, "one" | "path" | "refused">) {
  return (
    <span class="quiet" id={`option-${path}-says`}>
      {refused?.path === path && <strong class="bad" role="alert">{refused.text}</strong>}
      {one.unit && `In ${one.unit}. `}
      {one.text.split("`").map((part, i) => (i % 2 ? <code key={i}>{part}</code> : part))}
    </span>
  );
}

/** A larger integer than a browser can hold exactly would be sent as another one. */
function bounds({ takes, least, greatest }: Option): { min?: number; max?: number; step: number | "any" } {
  const whole = takes === "whole";
  return { min: least ?? undefined, max: whole ? Math.min(greatest ?? Infinity, Number.MAX_SAFE_INTEGER) : (greatest ?? undefined), step: whole ? 1 : "any" };
}
