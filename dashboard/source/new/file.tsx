// A file with a part of the request: chosen or dropped, and read in the browser.
import { useState } from "preact/hooks";
import { objectOf, readPath } from "../common/waypoints";
import { plural } from "../common/words";
import type { Fields, File as Read } from "./request";

interface Props {
  kind: "certify" | "certify-path";
  file: Read | null;
  onFile: (file: Read | null) => void;
}

const ABOUT = {
  certify: { title: "Polytope", accept: ".json,application/json", help: "A JSON file with C (m, n), d (m) and perhaps center (n), in s. The service adds the joint limits." },
  "certify-path": { title: "Motion", accept: ".json,.csv,application/json,text/csv", help: "A JSON file with q, one row for each waypoint, in radians and metres; or a CSV file with such rows." },
} as const;

export function FileField({ kind, file, onFile }: Props) {
  const [problem, setProblem] = useState<string | null>(null);
  const { title, accept, help } = ABOUT[kind];
  const take = async (given: File | undefined): Promise<void> => {
    if (!given) return;
    const text = await given.text();
    const found = kind === "certify" ? polytope(text) : motion(given.name, text);
    setProblem(typeof found === "string" ? `${given.name} cannot be used. ${found}` : null);
    onFile(typeof found === "string" ? null : { name: given.name, fields: found });
  };
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    void take(event.dataTransfer?.files[0]);
  };
  return (
    <div class="field drop" onDragOver={(event) => event.preventDefault()} onDrop={drop}>
      <label for="new-file">{title}</label>
      <input id="new-file" type="file" accept={accept} aria-describedby="new-file-says" onChange={(event) => void take(event.currentTarget.files?.[0])} />
      <span class="quiet" id="new-file-says">{help} Drop it here.</span>
      <span class="quiet" role="status">
        {problem && <strong class="bad">{problem}</strong>}
        {file && <>{file.name || "As in the earlier job"}: {counted(file.fields)}. <button type="button" class="plain" onClick={() => onFile(null)}>remove</button></>}
      </span>
    </div>
  );
}

function counted(fields: Fields): string {
  const [name, rows] = Object.entries(fields).find(([, value]) => Array.isArray(value) && value.length > 0) as [string, unknown[]];
  return `${plural(rows.length, "row")} of ${name}`;
}

function motion(name: string, text: string): Fields | string {
  const path = readPath(name, text);
  return typeof path === "string" ? path : { q: path.q };
}

function polytope(text: string): Fields | string {
  const found = objectOf(text, "C and d");
  if (typeof found === "string") return found;
  const { C, d, center } = found;
  if (!Array.isArray(C) || C.length === 0 || !Array.isArray(d)) return "It must be an object with C and d.";
  return { C, d, ...(center !== undefined && { center }) };
}
