// The scene's robot, moved by sliders; what touches is painted as it moves.
import { useEffect, useState } from "preact/hooks";
import { get, said } from "../shared/api";
import { positions, type SceneModel } from "../shared/kinematics";
import { Robot } from "../shared/robot";
import { Sliders } from "../shared/sliders";

export function SceneIsland({ scene }: { scene: string }) {
  const [model, setModel] = useState<SceneModel | null>(null);
  const [q, setQ] = useState<number[]>([]);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    get<SceneModel>(`/v1/scenes/${scene}/model`).then(
      (found) => {
        setQ(found.q_star);
        setModel(found);
      },
      (reason: unknown) => setProblem(said(reason)),
    );
  }, [scene]);
  if (problem) return <p class="notice bad">{problem}</p>;
  if (!model) return <p class="empty">Loading the robot …</p>;
  return (
    <div class="stage">
      <Robot model={model} q={q} label={`The robot of ${model.name} with the bodies that are certified`} />
      <Sliders names={positions(model)} units={model.units} lower={model.q_lower} upper={model.q_upper} q={q} onChange={setQ} />
    </div>
  );
}
