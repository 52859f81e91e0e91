// The robot in 3D as a component: what it holds is drawn by view.ts.
import { useEffect, useRef, useState } from "preact/hooks";
import { get, said } from "./api";
import type { SceneMeshes, SceneModel } from "./schema";
import type { PlaneDrawn } from "./square";
import { haveBodies, View } from "./view";

interface Props {
  model: SceneModel;
  q: number[];
  /** Says in words what is to be seen, for those who do not see it. */
  label: string;
  /** Pairs of geometries, by index, that touch: they are painted, and the place is marked. */
  touching?: number[][];
  /** Whether the view looks at the first contact, wherever it is. */
  framed?: boolean;
  /** Configurations at which the links are drawn faintly as well. Give the same array again as long as it does not change. */
  ghosts?: number[][];
  /** A plane between two geometries. Give the same object again as long as it does not change. */
  plane?: PlaneDrawn | null;
  /** Called with the joint positions while a link is dragged. */
  onDrag?: (q: number[]) => void;
}

const NONE: number[][] = [];

export function Robot({ model, q, label, touching = NONE, framed = false, ghosts = NONE, plane = null, onDrag }: Props) {
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
  useEffect(() => view.current?.colour(touching), [model, JSON.stringify(touching)]);
  useEffect(() => {
    if (framed) view.current?.frameContact();
  }, [model, framed, JSON.stringify(touching), q.join()]);
  useEffect(() => view.current?.setGhosts(ghosts), [model, ghosts]);
  useEffect(() => view.current?.setPlane(plane), [model, plane]);
  useEffect(() => {
    if (view.current) view.current.onDrag = onDrag ?? null;
  }, [model, onDrag]);

  const onKeyDown = (event: KeyboardEvent): void => {
    if (!event.ctrlKey && !event.metaKey && !event.altKey && view.current?.key(event.key)) event.preventDefault();
  };
  return (
    <figure class="robot">
      {!failed && <Tools model={model} view={view} contact={touching.some((pair) => haveBodies(model, pair))} />}
      {failed ? (
        <p class="empty">This browser cannot draw the robot, because WebGL is off.</p>
      ) : (
        <canvas ref={canvas} tabIndex={0} role="img" aria-label={`${label}. Arrow keys turn the view, plus and minus zoom, 0 goes back.${onDrag ? " A link can be dragged; the sliders do the same." : ""}`} onKeyDown={onKeyDown} />
      )}
    </figure>
  );
}

/** What else the view can do: stand elsewhere, show frames and the models' own meshes, and leave bodies out. */
function Tools({ model, view, contact }: { model: SceneModel; view: { current: View | null }; contact: boolean }) {
  const [frames, setFrames] = useState(false);
  const [hidden, setHidden] = useState<Set<string>>(new Set());
  useEffect(() => view.current?.setFrames(frames), [model, frames]);
  const [faded, setFaded] = useState<Set<string>>(new Set());
  useEffect(() => view.current?.setHidden(hidden), [model, hidden]);
  useEffect(() => view.current?.setFaded(faded), [model, faded]);
  return (
    <div class="view-tools">
      {(["front", "top", "fit"] as const).map((from) => <button type="button" key={from} aria-label={`View: ${from}`} onClick={() => view.current?.look(from)}>{from}</button>)}
      {contact && <button type="button" aria-label="View: contact" onClick={() => view.current?.frameContact()}>contact</button>}
      <label><input type="checkbox" checked={frames} onChange={(event) => setFrames(event.currentTarget.checked)} /> frames</label>
      <details>
        <summary>bodies{hidden.size > 0 && `, ${hidden.size} hidden`}</summary>
        <Bodies bodies={roots(model)} model={model} hidden={hidden} faded={faded} onShow={(body, on) => setHidden(changed(hidden, body, !on))} onFade={(body, on) => setFaded(changed(faded, body, on))} onPoint={(body) => view.current?.point(body)} />
      </details>
      {model.has_meshes && <Shown key={model.scene} model={model} view={view} />}
    </div>
  );
}

/** The set with or without a body. */
function changed(bodies: Set<string>, body: string, with_: boolean): Set<string> {
  return new Set([...[...bodies].filter((other) => other !== body), ...(with_ ? [body] : [])]);
}

/** Switches the certified bodies, and the meshes that they stand for. The meshes are fetched when somebody wants them. */
function Shown({ model, view }: { model: SceneModel; view: { current: View | null } }) {
  const [certified, setCertified] = useState(true);
  const [wanted, setWanted] = useState(false);
  const [meshes, setMeshes] = useState<SceneMeshes | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    if (!wanted || meshes) return;
    setProblem(null);
    get<SceneMeshes>(`/v1/scenes/${model.scene}/meshes`).then(setMeshes, (reason: unknown) => setProblem(said(reason)));
  }, [wanted]);
  useEffect(() => view.current?.setShown(certified, wanted ? meshes : null), [model, certified, wanted, meshes]);
  return (
    <>
      <label><input type="checkbox" checked={certified} onChange={(event) => setCertified(event.currentTarget.checked)} /> certified bodies</label>
      <label><input type="checkbox" checked={wanted} onChange={(event) => setWanted(event.currentTarget.checked)} /> meshes of the model</label>
      {wanted && <p class="view-note" role="status">{problem ?? (meshes ? about(meshes) : "Loading the meshes …")}</p>}
    </>
  );
}

/** Says in words what the meshes are, and whether they are drawn as their files have them. */
function about({ meshes, triangles, moved }: SceneMeshes): string {
  if (meshes.length === 0) return `The meshes of the model have ${triangles.toLocaleString("en")} triangles, which are too many to draw.`;
  const coarser = moved > 0 ? ` They are drawn coarser: points are up to ${rounded(1000 * moved)} mm from where they are in the files.` : "";
  return `Grey: the model's collision meshes. Proofs are about the certified bodies, which contain them.${coarser}`;
}

/** Two digits, rounded up. */
function rounded(value: number): string {
  const unit = 10 ** (Math.floor(Math.log10(value)) - 1);
  return String(Number((Math.ceil(value / unit) * unit).toPrecision(2)));
}

interface Listed {
  bodies: string[];
  model: SceneModel;
  hidden: Set<string>;
  faded: Set<string>;
  onShow: (body: string, on: boolean) => void;
  onFade: (body: string, on: boolean) => void;
  onPoint: (body: string | null) => void;
}

/** The tree of bodies, each below the one that carries it. */
function Bodies({ bodies, ...rest }: Listed) {
  const { model, hidden, faded, onShow, onFade, onPoint } = rest;
  return (
    <ul>
      {bodies.map((body) => {
        const children = model.joints.filter(({ parent }) => parent === body).map(({ child }) => child);
        return (
          <li key={body}>
            <label onPointerEnter={() => onPoint(body)} onPointerLeave={() => onPoint(null)} onFocusIn={() => onPoint(body)} onFocusOut={() => onPoint(null)}>
              <input type="checkbox" checked={!hidden.has(body)} onChange={(event) => onShow(body, event.currentTarget.checked)} /> {body}
            </label>{" "}
            <button type="button" class="plain" aria-pressed={faded.has(body)} aria-label={`Fade ${body}`} onClick={() => onFade(body, !faded.has(body))}>fade</button>
            {children.length > 0 && <Bodies {...rest} bodies={children} />}
          </li>
        );
      })}
    </ul>
  );
}

function roots({ bodies, joints }: SceneModel): string[] {
  const carried = new Set(joints.map(({ child }) => child));
  return bodies.filter((body) => !carried.has(body));
}
