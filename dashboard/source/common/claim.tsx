// The box with the claim, which the server writes and which stays in view. What is said of the robot at this moment is drawn into it.
import { render, type ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";

/** Draws its children into a place of the box: `now` for the configuration that is shown, `motion` for a motion. */
export function InClaim({ place, children }: { place: "now" | "motion"; children: ComponentChildren }) {
  useEffect(() => render(<>{children}</>, spot(place)));
  useEffect(() => () => render(null, spot(place)), [place]);
  return null;
}

function spot(place: string): HTMLElement {
  return document.getElementById(`claim-${place}`)!;
}
