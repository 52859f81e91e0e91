// The robot in 3D, whose code is fetched apart: tables, sliders and words do not wait for it. Its place is kept until it is there.
import type { ComponentChildren } from "preact";
import { useEffect, useState } from "preact/hooks";
import type { Robot as Component } from "./robot";

type Props = Parameters<typeof Component>[0];

export function Robot(props: Props) {
  const [Drawn, setDrawn] = useState<typeof Component | null>(null);
  const [failed, setFailed] = useState(false);
  useEffect(() => void import("./robot").then((module) => setDrawn(() => module.Robot), () => setFailed(true)), []);
  if (Drawn) return <Drawn {...props} />;
  return <Waiting>{failed ? "The code that draws the robot could not be fetched. Load the page again." : "Loading the robot …"}</Waiting>;
}

/** Keeps the place of the robot, and says why it is not there. */
export function Waiting({ children }: { children: ComponentChildren }) {
  return (
    <figure class="robot">
      <div class="waiting" role="status">{children}</div>
    </figure>
  );
}
