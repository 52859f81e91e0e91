// Two regions side by side: a slice of each, along the same two joints.
import { useEffect, useMemo, useState } from "preact/hooks";
import { get, said } from "../common/api";
import type { Space } from "../common/polytope";
import type { RegionConfigurations, RegionDetail } from "../common/schema";
import { axesIn, AxesChoice, SliceOf } from "../common/slice";

interface Compared {
  id: string;
  scene: string;
  space: Space;
  /** Where growing began, or the centre of a region that has no seed. */
  seed: number[];
}

async function load(id: string): Promise<Compared> {
  const [region, { seed, center }] = await Promise.all([get<RegionDetail>(`/v1/regions/${id}`), get<RegionConfigurations>(`/v1/regions/${id}/configurations?samples=0`)]);
  return { id, scene: region.scene, space: (region.manifest as unknown as { space: Space }).space, seed: seed ?? center };
}

export function CompareRegionsIsland({ regions }: { regions: string[] }) {
  const [loaded, setLoaded] = useState<Compared[] | null>(null);
  const [problem, setProblem] = useState<string | null>(null);
  useEffect(() => {
    Promise.all(regions.map(load)).then(setLoaded, (reason: unknown) => setProblem(said(reason)));
  }, [regions]);
  if (problem) return <p class="notice bad">The slices cannot be drawn: {problem}</p>;
  if (!loaded) return <p class="empty">Loading the slices …</p>;
  return <Slices both={loaded} />;
}

function Slices({ both }: { both: Compared[] }) {
  const [first, second] = both as [Compared, Compared];
  const joints = useMemo(() => first.space.joints.filter((name) => second.space.joints.includes(name)), [both]);
  const alike = first.space.joints.join() === second.space.joints.join();
  const [axes, setAxes] = useState(() => {
    const given = new URLSearchParams(location.hash.slice(1));
    return axesIn(joints, given.get("across"), given.get("up"));
  });
  const choose = (next: [number, number]): void => {
    setAxes(next);
    location.replace(`#${new URLSearchParams({ across: joints[next[0]]!, up: joints[next[1]]! })}`);
  };
  const [at, setAt] = useState(both.map(({ seed }) => seed));
  const through = (of: string): void => setAt(both.map(({ seed }) => both.find(({ id }) => id === of)?.seed ?? seed));
  /** Both points move along the joints of the slice. */
  const pick = (which: number, q: number[]): void => {
    const moved = axes.map((axis) => joints[axis]!);
    setAt(at.map((old, i) => (i === which ? q : both[i]!.space.joints.map((name, j) => (moved.includes(name) ? q[both[which]!.space.joints.indexOf(name)]! : old[j]!)))));
  };
  if (joints.length < 2) return <p class="empty">A slice of both needs two joints of the same names.</p>;
  return (
    <section aria-labelledby="h-slices" class="slice">
      <h2 id="h-slices">Slices</h2>
      <div class="axes">
        <AxesChoice joints={joints} axes={axes} onChange={choose} />
        {alike && (
          <label>
            through{" "}
            <select onChange={(event) => through(event.currentTarget.value)}>
              <option value="">the seed of each</option>
              {both.map(({ id }) => (
                <option value={id} key={id}>the seed of {id.slice(0, 8)}</option>
              ))}
            </select>
          </label>
        )}
      </div>
      <div class="beside">
        {both.map((one, i) => (
          <section aria-label={`Slice of ${one.id.slice(0, 8)}`} key={i}>
            <h3><code>{one.id.slice(0, 8)}</code></h3>
            <Sliced one={one} q={at[i]!} axes={[one.space.joints.indexOf(joints[axes[0]]!), one.space.joints.indexOf(joints[axes[1]]!)]} onPick={(q) => pick(i, q)} />
          </section>
        ))}
      </div>
    </section>
  );
}

function Sliced({ one: { id, scene, space }, ...rest }: { one: Compared; q: number[]; axes: [number, number]; onPick: (q: number[]) => void }) {
  const only = useMemo(() => [id], [id]);
  const units = useMemo(() => space.revolute.map((turns) => (turns ? "rad" : "m")), [space]);
  return <SliceOf scene={scene} space={space} units={units} regions={only} strongest={id} {...rest} />;
}
