// The program in a file that region/save.tsx writes: the robot, the sliders and the claim, without the service.
import { render } from "preact";
import { useMemo, useState } from "preact/hooks";
import { InClaim } from "./common/claim";
import { contains, rooms } from "./common/polytope";
import { Robot } from "./common/robot";
import { Sliders } from "./common/sliders";
import type { Saved } from "./region/save";

function Standalone({ model, space, faces, q: begin, proved }: Saved) {
  const [q, setQ] = useState(begin);
  const inside = useMemo(() => contains(space, faces, q), [q]);
  return (
    <div class="stage">
      <InClaim place="now">
        <p role="status" class={inside ? "proved" : "inside not"}>{inside ? proved : "The robot is outside the region: nothing is proved here."}</p>
      </InClaim>
      <Robot model={model} q={q} label={`The robot of ${model.name}`} />
      <Sliders names={space.joints} units={model.units} lower={space.q_lower} upper={space.q_upper} allowed={inside ? rooms(space, faces, q) : undefined} q={q} onChange={setQ} />
    </div>
  );
}

render(<Standalone {...(JSON.parse(document.getElementById("saved")!.textContent!) as Saved)} />, document.getElementById("robot")!);
