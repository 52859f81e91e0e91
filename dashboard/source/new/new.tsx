// The form that starts a job: a scene, a configuration that the robot shows, and what shall be done.
import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { get, post, said, ServiceError } from "../common/api";
import { positions } from "../common/kinematics";
import { MomentText, touchingOf, useMoment } from "../common/moment";
import { nearby } from "../common/nearby";
import { Robot } from "../common/drawn";
import type { ContactsResponse, Job, SceneDetail, SceneModel, ScenePage } from "../common/schema";
import { Sliders } from "../common/sliders";
import { ChooseScene, named, type Scene } from "./choose";
import type { Refused } from "./options";
import { asked, stated, type Start as First } from "./again";
import { blocked, useBlocked } from "./blocked";
import { JobCopies } from "./copies";
import { isMarked, missing, request, type Parts, type Wish } from "./request";
import { Wishes } from "./wishes";
import { readQ, useAddress, within, written } from "../common/address";
import { asText } from "../common/units";

const TRIES = 100;

interface Props {
  parts: Parts;
}

export function NewIsland({ parts }: Props) {
  // The page rewrites its address, so it is read once. Its configuration is one of its scene, and of no other.
  const [first, setFirst] = useState<First | null>(null);
  const [scenes, setScenes] = useState<Scene[] | null>(null);
  // A scene is chosen as it is given: a name has configurations of its own, which an id has not.
  const [chosen, setChosen] = useState<string | null>(null);
  const [found, setFound] = useState<{ given: string; model: SceneModel } | null>(null);
  const [problem, setProblem] = useState<string | null>(null);

  useEffect(() => {
    const query = new URLSearchParams(location.search);
    const from = query.get("from");
    Promise.all([get<ScenePage>("/v1/scenes?limit=1000"), from ? get<Job>(`/v1/jobs/${encodeURIComponent(from)}`) : null]).then(
      ([page, job]) => {
        const begin = asked(query, parts, job);
        setFirst(begin);
        setScenes(page.scenes);
        setChosen(begin.scene ?? (page.scenes[0] && named(page.scenes[0])) ?? null);
      },
      (reason: unknown) => setProblem(said(reason)),
    );
  }, []);
  useEffect(() => {
    if (chosen === null) return;
    const stop = new AbortController();
    setProblem(null);
    get<SceneModel>(`/v1/scenes/${encodeURIComponent(chosen)}/model`, stop.signal).then(
      (model) => {
        if (!stop.signal.aborted) setFound({ given: chosen, model });
      },
      (reason: unknown) => {
        if (!stop.signal.aborted) setProblem(said(reason));
      },
    );
    return () => stop.abort();
  }, [chosen]);

  if (!scenes || !first) return <p class={problem ? "notice bad" : "empty"}>{problem ?? "Loading the scenes …"}</p>;
  const model = found?.given === chosen ? found.model : null;
  const choose = (scene: string, seed: string | null = null): void => {
    setFirst((old) => old && { ...old, q: seed, by: seed === null ? old.by : "The seed file" });
    setChosen(scene);
  };
  const take = (scene: Scene, seed: string | null): void => {
    // Its names may have meant other scenes until now.
    setScenes([scene, ...scenes.filter(({ id }) => id !== scene.id).map((other) => ({ ...other, names: other.names.filter((name) => !scene.names.includes(name)) }))]);
    choose(named(scene), seed);
    document.getElementById("welcome")?.remove();
  };
  return (
    <div class="new">
      <ChooseScene scenes={scenes} chosen={chosen} model={model} onChoose={(scene) => choose(scene)} onUpload={take} />
      {problem && <p class="notice bad">{problem}</p>}
      {model && <Start given={chosen!} model={model} parts={parts} first={first} key={`${chosen} ${first.q}`} />}
    </div>
  );
}

function Start({ given, model, parts, first }: Props & { given: string; model: SceneModel; first: First }) {
  const names = useMemo(() => positions(model), [model]);
  const [q, setQ] = useState(() => within(model, readQ(first.q, model.q_star.length) ?? model.q_star));
  const [unread] = useState(() => first.q !== null && q.join() !== readQ(first.q, model.q_star.length)?.join());
  const [wish, setWish] = useState<Wish>(first.wish);
  const [problem, setProblem] = useState<string | null>(null);
  const [refused, setRefused] = useState<Refused | null>(null);
  const [sending, setSending] = useState(false);
  const [looking, setLooking] = useState(false);
  /** What is wrong with q*, if the robot was moved away from it. */
  const [left, setLeft] = useState<string | null>(null);
  const latest = useRef(q);
  latest.current = q;
  const untouched = useRef(first.q === null ? q : null);
  const [configurations, setConfigurations] = useState<SceneDetail["configurations"]>({});
  const moment = useMoment(model.scene, q);
  const touching = useMemo(() => touchingOf(model, moment), [model, moment]);
  const body = request(model.scene, q, wish, parts);
  const held = wish.kind === "grow" ? [q, ...wish.marks] : [];
  const between = useBlocked(model, held);

  useAddress({ scene: given, q: written(q), ...stated(wish, parts, first) });

  useEffect(() => {
    get<SceneDetail>(`/v1/scenes/${encodeURIComponent(given)}`).then(
      (scene) => setConfigurations(scene.configurations),
      (reason: unknown) => setProblem(said(reason)),
    );
  }, [given]);

  // What was wrong with the wish may be right now.
  const change = (next: Wish): void => {
    setWish(next);
    setProblem(null);
  };
  /** Looks for another configuration, and says so meanwhile. */
  const look = async (search: () => Promise<unknown>): Promise<void> => {
    setLooking(true);
    setProblem(null);
    try {
      await search();
    } catch (reason) {
      setProblem(said(reason));
    }
    setLooking(false);
  };
  const search = async (): Promise<void> => {
    const drawn = Array.from({ length: TRIES }, () => model.q_lower.map((low, i) => low + (model.q_upper[i]! - low) * Math.random()));
    const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene: model.scene, q: drawn });
    const free = contacts.findIndex(({ pairs, outside }) => pairs?.length === 0 && outside.length === 0);
    if (free < 0) setProblem(`None of ${TRIES} random configurations is free.`);
    else setQ(drawn[free]!);
  };
  /** Moves the robot to a free configuration near by, unless somebody moves it meanwhile, and says whether it did. */
  const moveNear = async (): Promise<boolean> => {
    const free = await nearby(model, q);
    if (latest.current !== q) return false;
    if (free) setQ(free);
    else if (free === null) setProblem("No free configuration was found near by.");
    return Boolean(free);
  };
  // Nobody has asked for q*. Where it is not free, the robot begins beside it.
  useEffect(() => {
    if (moment.trouble.length === 0 || untouched.current !== q) return;
    untouched.current = null;
    void look(async () => {
      if (await moveNear()) setLeft(moment.trouble[0]!);
    });
  }, [moment]);
  const submit = async (event: Event): Promise<void> => {
    event.preventDefault();
    const lacking = missing(wish);
    if (lacking) return setProblem(lacking);
    setSending(true);
    setProblem(null);
    setRefused(null);
    try {
      const { contacts } = await post<ContactsResponse>("/v1/planning/contacts", { scene: model.scene, q: [q] });
      if (wish.kind === "grow" && contacts[0]!.pairs?.length) {
        setSending(false);
        return setProblem("The robot is in collision there, so no region can hold the configuration. Move it first: Free one near by, below the sliders, does so.");
      }
      const stands = await blocked(model, held);
      if (stands) {
        setSending(false);
        return setProblem(between ? null : stands);
      }
      const job = await post<Job>("/v1/jobs", body);
      location.assign(`/jobs/${job.id}`);
    } catch (reason) {
      const field = reason instanceof ServiceError && document.getElementById(`option-${reason.field}`);
      if (field) {
        setRefused({ path: reason.field!, text: said(reason) });
        field.closest("details")?.setAttribute("open", "");
        field.focus();
      } else setProblem(said(reason));
      setSending(false);
    }
  };
  return (
    <div class="stage">
      <div>
        <Robot model={model} q={q} onDrag={setQ} touching={touching} label={`The robot of ${model.name}${touching.length ? ", not free" : ""}`} />
        <MomentText moment={moment} />
        {left && <p class="notice">At q*, {left}. The robot began at a free configuration near it.</p>}
        {unread && <p class="notice">{first.by} does not name a configuration within the limits: {first.q}. The robot stands at the nearest one, or at q*.</p>}
        <div class="card">
          <Sliders names={names} units={model.units} lower={model.q_lower} upper={model.q_upper} q={q} onChange={setQ} />
          <p class="toolbar">
            <button type="button" title="The scene's own configuration q*, about which it is described" onClick={() => setQ(within(model, model.q_star))}>Centre q*</button>
            <button type="button" disabled={looking} onClick={() => void look(search)}>Random free one</button>
            {moment.trouble.length > 0 && <button type="button" disabled={looking} onClick={() => void look(moveNear)}>Free one near by</button>}
            <span role="status">{looking && "Looking for a free configuration …"}</span>
            {Object.keys(configurations).length > 0 && (
              <label>
                Named configuration{" "}
                <select value="" onChange={(event) => setQ(within(model, names.map((joint, i) => configurations[event.currentTarget.value]?.[joint] ?? q[i]!)))}>
                  <option value="">choose …</option>
                  {Object.keys(configurations).map((name) => (
                    <option key={name}>{name}</option>
                  ))}
                </select>
              </label>
            )}
          </p>
        </div>
      </div>
      <form onSubmit={(event) => void submit(event)}>
        <Wishes wish={wish} parts={parts[wish.kind]} refused={refused} onWish={change} marks={wish.marks.map((mark) => asText(mark, model.units))} here={isMarked(wish, q)} onMark={() => change({ ...wish, marks: [...wish.marks, q] })} onGo={(mark) => setQ(wish.marks[mark]!)} />
        {model.pairs.length === 0 && <p class="notice bad">No pair of bodies can collide in this scene, so there is nothing to prove: no two of its bodies move against each other. Has the model collision geometry (<code>&lt;collision&gt;</code>)? What is only for looks (<code>&lt;visual&gt;</code>) does not count.</p>}
        <div role="alert">
          {between && <p class="notice bad">{between} <button type="button" class="plain" onClick={() => change({ ...wish, kind: "cover", goal: "connect", marks: held })}>Connect them with several regions</button></p>}
          {problem && <p class="notice bad">{problem}</p>}
        </div>
        <p><button type="submit" class="primary" disabled={sending}>{sending ? "Starting …" : "Start the job"}</button></p>
        <JobCopies q={q} wish={wish} parts={parts} body={body} />
      </form>
    </div>
  );
}
