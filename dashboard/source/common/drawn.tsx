// The robot in 3D, whose code is fetched apart: tables, sliders and words do not wait for it. Its place is kept until it is there.
import { useEffect, useState } from "preact/hooks";
import type { Robot as Component } from "./robot";

type Props = Parameters<typeof Component>[0];

export function Robot(props: Props) {
  const [Drawn, setDrawn] = useState<typeof Component | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => void import("./robot").then((module) => setDrawn(() => module.Robot), () => setFailed(true)), []);
  if (Drawn) return <Drawn {...props} />;
  return (
    <figure class="robot">
      <div class="waiting">{failed ? "The code that draws the robot could not be fetched. Load the page again." : "Loading the robot …"}</div>
    </figure>
  );
}
