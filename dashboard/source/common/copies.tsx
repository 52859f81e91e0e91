// What a page asks the service for, as others may ask for it: by the command, by curl, or in Python.
import { useState } from "preact/hooks";
import { KEYED } from "./api";

const FORMS = ["command", "curl", "Python"] as const;
export type Texts = Record<(typeof FORMS)[number], string>;

export function Copies({ texts, note }: { texts: Texts; note?: string }) {
  const [form, setForm] = useState<(typeof FORMS)[number]>("command");
  const [copied, setCopied] = useState(false);
  const copy = async (): Promise<void> => {
    await navigator.clipboard.writeText(texts[form]);
    setCopied(true);
    setTimeout(() => setCopied(false), 2000);
  };
  return (
    <details class="copies">
      <summary>The same as a command, as curl, in Python</summary>
      <p class="toolbar">
        {FORMS.map((name) => <button type="button" key={name} aria-pressed={form === name} onClick={() => setForm(name)}>{name}</button>)}
        {/* Browsers let pages copy only where the connection is safe. */}
        {window.isSecureContext && <button type="button" onClick={() => void copy()}>{copied ? "Copied" : "Copy"}</button>}
      </p>
      <pre tabIndex={0}>{texts[form]}</pre>
      <p class="small quiet">{note}{KEYED && <> <code>CIRIS_API_KEY</code> holds your API key.</>}</p>
    </details>
  );
}

/** A word of a command, quoted where the shell would read it otherwise. */
export function shell(text: string): string {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

/** A command for this service. */
export function asCommand(...words: string[]): string {
  return [...words, `--url=${location.origin}`].join(" ");
}

/** Asks a path of the service, or posts a body to it. */
export function asCurl(path: string, body?: object): string {
  const key = KEYED ? ' -H "Authorization: Bearer $CIRIS_API_KEY"' : "";
  if (!body) return `curl${key} ${shell(location.origin + path)}`;
  return [`curl -X POST ${location.origin}${path} \\`, `  -H 'Content-Type: application/json'${key} \\`, `  -d ${shell(JSON.stringify(body))}`].join("\n");
}

/** What Python writes like JSON, but for three words. */
export function python(value: unknown): string {
  if (Array.isArray(value)) return `[${value.map(python).join(", ")}]`;
  if (typeof value === "object" && value !== null) return `{${Object.entries(value).map(([name, one]) => `${JSON.stringify(name)}: ${python(one)}`).join(", ")}}`;
  return value === true ? "True" : value === false ? "False" : value === null ? "None" : JSON.stringify(value);
}

/** Lines of Python that ask this service. */
export function asPython(...lines: string[]): string {
  return ["import ciris", "", `service = ciris.connect(${JSON.stringify(location.origin)})`, ...lines].join("\n");
}

/** What a page shows, as the server describes it (api/pages/copies.py). */
export interface Shown {
  commands: string[];
  paths: string[];
  python: string[];
}

export function CopiesIsland({ commands, paths, python: lines }: Shown) {
  const each = (all: string[], text: (one: string) => string): string => all.map((one) => (one.startsWith("#") ? one : text(one))).join("\n");
  return <Copies texts={{ command: each(commands, asCommand), curl: each(paths, asCurl), Python: asPython(...lines) }} />;
}
