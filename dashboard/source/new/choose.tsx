// The scene to work on: one that is stored, or one that is uploaded now.
import { useEffect, useState } from "preact/hooks";
import { get, said, ServiceError, upload } from "../common/api";
import { plural } from "../common/words";
import { chosen as chosenFiles, dropped, nameOf, packed, pathsIn, saying, type Chosen } from "../common/zip";
import type { LintReport, SceneDetail, SceneModel } from "../common/schema";
import { seedIn } from "./seed";

export type Scene = Pick<SceneDetail, "id" | "name" | "names" | "joints" | "pairs" | "warnings">;

interface Props {
  scenes: Scene[];
  /** A name or an id. */
  chosen: string | null;
  /** The scene that is chosen; null until it is there. */
  model: SceneModel | null;
  onChoose: (scene: string) => void;
  /** `seed`: joint positions from the seed file that came along, as an address has them. */
  onUpload: (scene: Scene, seed: string | null) => void;
}

/** What a scene is called: the name that it has or had last, where that still means it. */
export function named({ id, name, names }: Scene): string {
  return names.includes(name) ? name : (names[0] ?? id);
}

/** A zip with several files of which each may be the scene or the robot, by what they may be. */
interface Several {
  /** What somebody would call it. */
  name: string;
  file: File;
  groups: [string, string[]][];
}

const MODEL = /\.(urdf|sdf|mjcf|xacro)$/i;
const GROUPS: [string, RegExp][] = [
  ["Models of robots", /\.(urdf|sdf|mjcf|urdf\.xacro|sdf\.xacro)$/i],
  ["Scene files", /\.yaml$/i],
  ["Models of MuJoCo", /\.xml$/i],
];

async function several(name: string, file: File): Promise<Several> {
  const paths = (await pathsIn(file)).filter((path) => !/^__MACOSX|(^|\/)package\.xml$/.test(path));
  return { name, file, groups: GROUPS.map(([title, kind]): [string, string[]] => [title, paths.filter((path) => kind.test(path)).sort()]).filter(([, found]) => found.length > 0) };
}

/** What is wrong. Of a model without the files that it names, the service speaks as of a zip, which nobody has given. */
function wrong(name: string, reason: unknown): string {
  if (!(reason instanceof ServiceError && reason.code === "scene_package" && MODEL.test(name))) return `${where(reason)}${said(reason)}`;
  return `${reason.message.replace(", and the zip has no ", ", such as ")}. A single file brings none along: choose the folder that has the model and these files.`;
}

/** Where in a scene file something is wrong. */
function where(reason: unknown): string {
  return reason instanceof ServiceError && reason.field && reason.field !== "bundle" ? `${reason.field}: ` : "";
}

export function ChooseScene({ scenes, chosen, model, onChoose, onUpload }: Props) {
  const [sending, setSending] = useState<string | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [added, setAdded] = useState<SceneDetail | null>(null);
  const [seeded, setSeeded] = useState(false);
  const [choice, setChoice] = useState<Several | null>(null);
  const [warnings, setWarnings] = useState<string[]>([]);
  /** Whether something is being dragged over the page. */
  const [over, setOver] = useState(false);
  const offers = scenes.flatMap((scene) => scene.names.map((name) => ({ ...scene, name, title: name })));
  // An address may give a scene otherwise, such as by its id.
  if (model && chosen !== null && !offers.some(({ name }) => name === chosen)) offers.unshift({ id: model.scene, name: chosen, title: model.name, names: [], joints: model.q_star.length, pairs: model.pairs.length, warnings: 0 });
  const send = async (name: string, file: () => Promise<File>): Promise<void> => {
    setSending(name);
    setProblem(null);
    setAdded(null);
    let whole: File | null = null;
    try {
      whole = await file();
      const scene = await upload<SceneDetail>("/v1/scenes", "bundle", whole);
      const seed = await seedIn(whole);
      setWarnings(scene.warnings > 0 ? (await get<LintReport>(`/v1/scenes/${scene.id}/lint`)).warnings : []);
      setAdded(scene);
      setSeeded(seed !== null);
      setChoice(null);
      onUpload(scene, seed);
    } catch (reason) {
      const found = whole && reason instanceof ServiceError && reason.code === "bundle_choice" ? await several(name, whole) : null;
      if (found?.groups.length) setChoice(found);
      else setProblem(`${name} is no scene that can be used: ${wrong(name, reason)}`);
    }
    setSending(null);
  };
  const take = async (files: Chosen[]): Promise<void> => {
    setChoice(null);
    if (files.length > 0) await send(nameOf(files), () => packed(files));
  };
  // A scene may be dropped anywhere, but where the form asks for another file.
  useEffect(() => {
    const dragged = (event: DragEvent): void => {
      // Another field may take it.
      setOver(!event.defaultPrevented && (event.dataTransfer?.types.includes("Files") ?? false));
      event.preventDefault();
    };
    // It leaves the page where there is nothing that it enters.
    const left = (event: DragEvent): void => void (event.relatedTarget === null && setOver(false));
    const drop = (event: DragEvent): void => {
      setOver(false);
      if (event.defaultPrevented || !event.dataTransfer) return;
      event.preventDefault();
      void dropped(event.dataTransfer).then(take, (reason: unknown) => setProblem(`What was dropped cannot be read: ${String(reason)}`));
    };
    document.addEventListener("dragover", dragged);
    document.addEventListener("dragleave", left);
    document.addEventListener("drop", drop);
    return () => {
      document.removeEventListener("dragover", dragged);
      document.removeEventListener("dragleave", left);
      document.removeEventListener("drop", drop);
    };
  }, [onUpload]);
  return (
    <div class={`choose card${over ? " over" : ""}`}>
      <p>
        <label for="new-scene">Scene</label>
        <select id="new-scene" value={chosen ?? ""} onChange={(event) => onChoose(event.currentTarget.value)} disabled={offers.length === 0}>
          {offers.length === 0 && <option value="">none yet</option>}
          {offers.map(({ id, name, title, joints, pairs }) => (
            <option value={name} key={name}>{`${title} · ${plural(joints, "joint")}, ${plural(pairs, "pair")} · ${id.slice(0, 8)}`}</option>
          ))}
        </select>
      </p>
      <p>
        <span class="file">
          <label for="new-upload">or upload one</label>
          <input id="new-upload" type="file" accept=".zip,.urdf,.sdf,.mjcf,.xacro,application/zip" disabled={sending !== null} aria-describedby="new-upload-says" onChange={(event) => void take(chosenFiles(event.currentTarget.files))} />
        </span>
        <span class="file">
          <label for="new-folder">or its folder</label>
          <input id="new-folder" type="file" {...{ webkitdirectory: true }} disabled={sending !== null} aria-describedby="new-upload-says" onChange={(event) => void take(chosenFiles(event.currentTarget.files))} />
        </span>
      </p>
      <p class="quiet small" id="new-upload-says">
        Give the file of your robot (URDF, SDFormat, MJCF or xacro). If it has meshes, give the folder with all of it, or a zip of the folder. The service makes a scene of the robot. If you have a <code>scene.yaml</code>, give its folder. You can also drop any of these anywhere on this page.
      </p>
      <div role="status">
        {sending && <p class="notice">Reading {sending} …</p>}
        {problem && <p class="notice bad">{problem}</p>}
        {choice && (
          <p class="notice">
            <label for="new-which">{choice.name} has several robots or scenes. Which one?</label>{" "}
            <select id="new-which" value="" onChange={({ currentTarget: { value } }) => void send(value, () => saying(choice.file, value))}>
              <option value="">choose …</option>
              {choice.groups.map(([title, paths]) => <optgroup label={title} key={title}>{paths.map((path) => <option key={path}>{path}</option>)}</optgroup>)}
            </select>
          </p>
        )}
        {added && (
          <p class="notice">
            {added.name} is stored, with {plural(added.joints, "joint")} and {plural(added.pairs, "pair")}.{seeded && " The robot stands at the seed that came with it."}
            {warnings.length > 0 && " Read this before you trust a proof about it:"}
          </p>
        )}
        {added && warnings.length > 0 && <ul class="small">{warnings.map((warning) => <li key={warning}>{warning}</li>)}</ul>}
      </div>
    </div>
  );
}
