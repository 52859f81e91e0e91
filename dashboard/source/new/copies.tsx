// The job of the form as others may ask for it.
import { asCommand, asCurl, asPython, Copies, python, shell, type Texts } from "../common/copies";
import { deadline, markName, pathOf, type Fields, type Option, type Parts, type Wish } from "./request";

interface Props {
  q: number[];
  wish: Wish;
  parts: Parts;
  /** The body of the request. */
  body: Fields;
}

export function JobCopies(props: Props) {
  return <Copies texts={textsOf(props)} note="Joint positions are radians and metres." />;
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

function commandOf(props: Props): string {
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
  return lacks.join("") + asCommand(...words);
}

function textsOf(props: Props): Texts {
  const lines = [`document, _ = service.client.create_job(${python(props.body)})`, `job = service.job(document["id"]).wait()`, "print(job.state, job.reason)"];
  return { command: commandOf(props), curl: asCurl("/v1/jobs", props.body), Python: asPython(...lines) };
}
