// The scene to work on: one that is stored, or one that is uploaded now.
import { useState } from "preact/hooks";
import { said, upload } from "../common/api";
import { packed } from "../common/zip";
import type { SceneDetail } from "../common/schema";

export type Scene = Pick<SceneDetail, "id" | "name" | "joints" | "pairs" | "warnings">;

interface Props {
  scenes: Scene[];
  chosen: string | null;
  onChoose: (id: string) => void;
  onUpload: (scene: Scene) => void;
}

export function ChooseScene({ scenes, chosen, onChoose, onUpload }: Props) {
  const [sending, setSending] = useState<string | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  const [added, setAdded] = useState<SceneDetail | null>(null);
  const send = async (files: File[]): Promise<void> => {
    if (files.length === 0) return;
    const name = files[0]!.webkitRelativePath.split("/")[0] || files[0]!.name;
    setSending(name);
    setProblem(null);
    setAdded(null);
    try {
      const scene = await upload<SceneDetail>("/v1/scenes", "bundle", await packed(files));
      setAdded(scene);
      onUpload(scene);
    } catch (reason) {
      setProblem(`${name} is no scene that can be used. ${said(reason)}`);
    }
    setSending(null);
  };
  const drop = (event: DragEvent): void => {
    event.preventDefault();
    void send([...(event.dataTransfer?.files ?? [])]);
  };
  return (
    <div class="choose card" onDragOver={(event) => event.preventDefault()} onDrop={drop}>
      <p>
        <label for="new-scene">Scene</label>
        <select id="new-scene" value={chosen ?? ""} onChange={(event) => onChoose(event.currentTarget.value)} disabled={scenes.length === 0}>
          {scenes.length === 0 && <option value="">none yet</option>}
          {scenes.map(({ id, name, joints, pairs }) => (
            <option value={id} key={id}>{`${name} · ${joints} joint${joints === 1 ? "" : "s"}, ${pairs} pairs · ${id.slice(0, 8)}`}</option>
          ))}
        </select>
      </p>
      <p>
        <label for="new-upload">or upload one</label>
        <input id="new-upload" type="file" accept=".zip,.urdf,.sdf,.mjcf,application/zip" disabled={sending !== null} aria-describedby="new-upload-says" onChange={(event) => void send([...(event.currentTarget.files ?? [])])} />
        <label for="new-folder">or its folder</label>
        <input id="new-folder" type="file" {...{ webkitdirectory: true }} disabled={sending !== null} aria-describedby="new-upload-says" onChange={(event) => void send([...(event.currentTarget.files ?? [])])} />
      </p>
      <p class="quiet small" id="new-upload-says">
        A folder, or a zip of it, with <code>scene.yaml</code> and every model and mesh that it refers to. Or a robot alone: its URDF, SDFormat or MJCF file, or a folder that has one and its meshes; the service then drafts the scene, as <code>ciris scene init</code> does. Drop it here.
      </p>
      <div role="status">
        {sending && <p class="notice">Reading {sending} …</p>}
        {problem && <p class="notice bad">{problem}</p>}
        {added && (
          <p class="notice">
            {added.name} is stored, with {added.joints} {added.joints === 1 ? "joint" : "joints"} and {added.pairs} {added.pairs === 1 ? "pair" : "pairs"}.
            {added.warnings > 0 && <> Read its <a href={`/scenes/${added.id}`}>{added.warnings} {added.warnings === 1 ? "warning" : "warnings"}</a> first.</>}
          </p>
        )}
      </div>
    </div>
  );
}
