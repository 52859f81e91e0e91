// The job of the form as others may ask for it: by the command, by curl, or in Python.
import { useState } from "preact/hooks";
import { deadline, markName, pathOf, type Fields, type Option, type Parts, type Wish } from "./request";

interface Props {
  q: number[];
  wish: Wish;
  parts: Parts;
  /** Whether the service asks for keys. */
  keyed: boolean;
  /** The body of the request. */
  body: Fields;
}

const FORMS = { command: asCommand, curl: asCurl, Python: asPython } as const;

export function Copies(props: Props) {
  const [form, setForm] = useState<keyof typeof FORMS>("command");
  const [copied, setCopied] = useState(false);
  const text = FORMS[form](props);
  const copy = async (): Promise<void> => {
    await navigator.clipboard.writeText(text);
    setCopied(true);
    setTimeout(() => setCopied(false), 2000);
  };
  return (
    <details id="copies">
      <summary>The same as a command, as curl, in Python</summary>
      <p class="toolbar">
        {(Object.keys(FORMS) as (keyof typeof FORMS)[]).map((name) => <button type="button" key={name} aria-pressed={form === name} onClick={() => setForm(name)}>{name}</button>)}
        {/* Browsers let pages copy only where the connection is safe. */}
        {window.isSecureContext && <button type="button" onClick={() => void copy()}>{copied ? "Copied" : "Copy"}</button>}
      </p>
      <pre tabIndex={0}>{text}</pre>
      <p class="small quiet">Joint positions are radians and metres.{props.keyed && <> <code>CIRIS_API_KEY</code> holds your API key.</>}</p>
    </details>
  );
}

/** The options that somebody has set, each with its value; a group comes before its members. */
function* set(options: Option[], place: string, from: Fields): Generator<[Option, unknown]> {
  for (const one of options) {
    if (!(one.name in from)) continue;
    yield [one, from[one.name]];
    if (one.takes === "group") yield* set(one.options, pathOf(place, one.name), from[one.name] as Fields);
  }
}

function optionsOf({ wish, parts, body }: Props): [Option, unknown][] {
  return parts[wish.kind].flatMap(({ place, options }) => [...set(options, place, (place ? (body[place] ?? {}) : body) as Fields)]);
}

function shell(text: string): string {
  return /^[\w@%+=:,./-]+$/.test(text) ? text : `'${text.replaceAll("'", "'\\''")}'`;
}

function asCommand(props: Props): string {
  const { q, wish, body } = props;
  const list = (numbers: number[]): string => shell(numbers.join(","));
  const scene = String(body.scene);
  const marks = markName(wish);
  const argument = { contain: "contain", at: "at", connect: "connect", seeds: "seed", q: "q" }[marks];
  const words = ["ciris", wish.kind];
  if (wish.kind === "recertify") words.push(shell(String(body.region) || "REGION"), "--scene", scene);
  else words.push(scene);
  if (wish.kind === "grow") words.push(`--q=${list(q)}`);
  if (wish.kind === "certify") words.push("--polytope", shell(wish.file?.name || "FILE"));
  if (wish.kind === "certify-path") words.push("--job", ...(wish.file ? ["--path", shell(wish.file.name || "FILE")] : []));
  if (argument && !wish.file) words.push(...wish.marks.map((mark) => `--${argument}=${list(mark)}`));
  for (const [{ argument: name, takes }, value] of optionsOf(props)) {
    if (takes === "flag" || takes === "group") words.push(...(value === false ? [] : [`--${name}`]));
    else words.push(`--${name}=${shell(String(value))}`);
  }
  const seconds = deadline(wish);
  if (seconds !== null) words.push(`--deadline=${seconds}`);
  if (wish.priority !== "0") words.push(`--priority=${wish.priority}`);
  for (const [name, value] of Object.entries(wish.labels)) words.push(`--label=${shell(`${name}=${value}`)}`);
  const lacks = Object.keys(wish.kept).map((name) => `# The command is without the ${name} of the earlier job.\n`);
  return lacks.join("") + [...words, `--url=${location.origin}`].join(" ");
}

function asCurl({ body, keyed }: Props): string {
  return [
    `curl -X POST ${location.origin}/v1/jobs \\`,
    `  -H 'Content-Type: application/json'${keyed ? ' -H "Authorization: Bearer $CIRIS_API_KEY"' : ""} \\`,
    `  -d '${JSON.stringify(body).replaceAll("'", "'\\''")}'`,
  ].join("\n");
}

/** What Python writes like JSON, but for three words. */
function python(value: unknown): string {
  if (Array.isArray(value)) return `[${value.map(python).join(", ")}]`;
  if (typeof value === "object" && value !== null) return `{${Object.entries(value).map(([name, one]) => `${JSON.stringify(name)}: ${python(one)}`).join(", ")}}`;
  return value === true ? "True" : value === false ? "False" : value === null ? "None" : JSON.stringify(value);
}

function asPython({ body }: Props): string {
  return [
    "import ciris",
    "",
    `service = ciris.connect(${JSON.stringify(location.origin)})`,
    `document, _ = service.client.create_job(${python(body)})`,
    `job = service.job(document["id"]).wait()`,
    "print(job.state, job.reason)",
  ].join("\n");
}
