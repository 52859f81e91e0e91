// The robot in 3D as a component: what it holds is drawn by view.ts.
import { useEffect, useRef, useState } from "preact/hooks";
import type { SceneModel } from "./schema";
import { View } from "./view";

interface Props {
  model: SceneModel;
  q: number[];
  /** Says in words what is to be seen, for those who do not see it. */
  label: string;
  /** Indices of geometries that are painted as touching. */
  touching?: number[];
  /** Configurations at which the links are drawn faintly as well. Give the same array again as long as it does not change. */
  ghosts?: number[][];
  /** Called with the joint positions while a link is dragged. */
  onDrag?: (q: number[]) => void;
}

const NONE: number[][] = [];

export function Robot({ model, q, label, touching = [], ghosts = NONE, onDrag }: Props) {
  const canvas = useRef<HTMLCanvasElement>(null);
  const view = useRef<View | null>(null);
  const [failed, setFailed] = useState(false);

  useEffect(() => {
    try {
      view.current = new View(canvas.current!, model);
    } catch {
      setFailed(true); // without WebGL; everything else on the page works
    }
    return () => {
      view.current?.dispose();
      view.current = null;
    };
  }, [model]);
  useEffect(() => view.current?.setPose(q), [model, q.join()]);
  useEffect(() => view.current?.colour(touching), [model, touching.join()]);
  useEffect(() => view.current?.setGhosts(ghosts), [model, ghosts]);
  useEffect(() => {
    if (view.current) view.current.onDrag = onDrag ?? null;
  }, [model, onDrag]);

  const onKeyDown = (event: KeyboardEvent): void => {
    if (!event.ctrlKey && !event.metaKey && !event.altKey && view.current?.key(event.key)) event.preventDefault();
  };
  return (
    <figure class="robot">
      {failed ? (
        <p class="empty">This browser cannot draw the robot, because WebGL is off.</p>
      ) : (
        <canvas ref={canvas} tabIndex={0} role="img" aria-label={`${label}. Arrow keys turn the view, plus and minus zoom, 0 goes back.${onDrag ? " A link can be dragged; the sliders do the same." : ""}`} onKeyDown={onKeyDown} />
      )}
    </figure>
  );
}
