"""Random scenes are written, grown and verified by the command, and Drake alone looks for a collision in every region.

    python -m tests.oracles.random_scenes --scenes 30 --first 0 --out DIR

Scene by scene, on one core each: a region is grown by `ciris grow --local`, its proof is verified by `ciris verify`, and a plant that
Drake's parser makes of the scene's files, with their own meshes, is asked for the distances at samples of the region. A fifth of them is on
its faces. From the nearest ones the distance is followed downwards within the region. What DIR holds is not done again.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import subprocess
import sys
import time
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from certifier.model import Array
from certifier.proof.region import RegionProof
from certifier.verify.region import verify_region
from client.cores import cores
from tests.oracles.distances import Distances
from tests.oracles.written_scenes import write_scene

ROOT = Path(__file__).parents[2]
SAMPLES, ON_FACES = 100_000, 0.2
STARTS = 20
"""From this many of the nearest samples the distance is followed downwards."""
STEPS = 40
"""It is followed for this many steps, or until bodies touch."""
ROOM = 0.03
"""At a seed all padded bodies are farther apart than this, in metres."""
PRECISION = 1e-6
"""Drake's distances are good to this, in metres."""


@dataclass
class Result:
    """What became of a scene.

    Attributes:
        seconds: of growing, verifying and looking.
        region: whether there is one; else ``said`` says why not.
        samples: at which Drake was asked, steps downwards left out.
        least: the smallest distance of padded bodies that was found, in metres.
        margin: the smallest distance that the proof states.
        problem: "" or what is wrong.
    """

    scene: int
    joints: int
    pairs: int
    seconds: float
    region: bool
    said: str
    samples: int = 0
    least: float = float("inf")
    margin: float = 0.0
    problem: str = ""


def look(number: int, directory: Path, deadline: float, samples: int) -> Result:
    """Carries out everything for one scene, which its number determines."""
    start, rng = time.perf_counter(), np.random.default_rng(number)
    path, distances, seed = random_scene(directory, rng)
    proof = directory / "region.proof"
    proof.unlink(missing_ok=True)
    q = ",".join(f"{x:.9f}" for x in seed)
    grown = _ciris("grow", str(path), f"--q={q}", "--local", "--deadline", f"{deadline:g}", "--out", str(proof))
    (directory / "grow.txt").write_text(grown.stdout + grown.stderr)
    result = Result(number, len(seed), 0, 0.0, proof.exists(), grown.stderr.strip().splitlines()[-1] if grown.stderr.strip() else "")
    if "Warning" in grown.stdout + grown.stderr or "Traceback" in grown.stderr:
        result.problem = "a warning or a traceback reached the terminal"
    elif result.region:
        verified = _ciris("verify", str(proof))
        statement = verify_region(proof.read_bytes())
        result.pairs, result.margin = len(statement.gaps), statement.gap
        result.problem = "" if verified.returncode == 0 else f"ciris verify: {verified.stdout}{verified.stderr}"
        search(result, ProvedRegion(proof.read_bytes(), distances), distances, rng, samples)
    result.seconds = time.perf_counter() - start
    return result


def random_scene(directory: Path, rng: np.random.Generator) -> tuple[Path, Distances, Array]:
    """Writes a scene that has a free configuration, and returns its path, its distances, and that configuration as a seed."""
    while True:
        path = write_scene(directory, rng, int(rng.integers(5, 8)))
        distances = Distances(path)
        for q in rng.uniform(*distances.limits, (300, distances.n)):
            if distances.least(q, ROOM) >= ROOM:
                return path, distances, q
        for file in directory.iterdir():
            file.unlink()


def _ciris(*words: str) -> subprocess.CompletedProcess[str]:
    environment = {**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    return subprocess.run(
        [sys.executable, "-m", "client.cli", *words], cwd=ROOT, env=environment, capture_output=True, text=True, check=False
    )


def search(result: Result, region: ProvedRegion, distances: Distances, rng: np.random.Generator, samples: int) -> None:
    """Looks for the smallest distance in the region, in terms of the proof's numbers and of Drake's plant alone."""
    result.samples = samples
    points, nearest = region.samples(rng, samples), []
    worst = np.inf
    for s in points:
        distance = distances.least(region.to_q(s), max(worst, 0.0) + 1e-3 if np.isfinite(worst) else 0.05)
        nearest.append(distance)
        if len(nearest) % 1000 == 0:
            worst = float(np.sort(nearest)[min(STARTS, len(nearest) - 1)])
    order = np.argsort(nearest, kind="stable")[:STARTS]
    found = [(nearest[k], points[k]) for k in order]
    found += [region.descended(points[k], nearest[k], rng) for k in order]
    least, s = min(found, key=lambda one: one[0])
    result.least = float(least)
    if result.least <= result.margin - PRECISION:
        q = ", ".join(f"{x:.9g}" for x in region.to_q(s))
        result.problem = f"the padded bodies are {result.least:.3g} m apart at q = {q}, and the proof says {result.margin:.3g} m"


class ProvedRegion:
    """A region as its proof states it: {s : C s <= d} with s = tan((q - q*)/2) for what turns, and q - q* for what slides."""

    def __init__(self, proof: bytes, distances: Distances) -> None:
        read = RegionProof.from_bytes(proof)
        self.C, self.d, self.interior = read.C, read.d, read.interior
        scene = read.scene
        self._q_star, self._turns = scene.q_star, scene.revolute
        self._order = distances.order([joint.name for joint in scene.moving])
        self._distances = distances
        self._width = np.array([np.diff(self._ends(self.interior, axis))[0] for axis in np.eye(len(self.interior))])

    def to_q(self, s: Array) -> Array:
        """Returns the positions of a point, (n,), in Drake's order."""
        q = self._q_star + np.where(self._turns, 2 * np.arctan(s), s)
        return q[self._order]

    def samples(self, rng: np.random.Generator, count: int) -> Array:
        """Returns points (count, n) by hit-and-run, the last ON_FACES of them on faces."""
        points, s = np.empty((count, len(self.interior))), self.interior
        for k in range(count):
            direction = rng.normal(size=len(s)) * self._width
            low, high = self._ends(s, direction)
            if k < (1 - ON_FACES) * count:
                s = s + rng.uniform(low, high) * direction
                points[k] = s
            else:
                points[k] = s + (1 - 1e-12) * (low if rng.random() < 0.5 else high) * direction
                s = s + rng.uniform(low, high) * direction
        return points

    def descended(self, s: Array, distance: float, rng: np.random.Generator) -> tuple[float, Array]:
        """Returns the distance that is reached from a point by steps that stay in the region and come nearer, and where."""
        size, n = 0.05, len(s)
        for _ in range(STEPS):
            if distance <= 0:
                break
            steps = np.concatenate([np.eye(n), -np.eye(n), rng.normal(size=(n, n)) / np.sqrt(n)]) * size * self._width
            tried = [s + min(1.0, (1 - 1e-12) * self._ends(s, step)[1]) * step for step in steps]
            found = [self._distances.least(self.to_q(point), max(distance, 0.0) + 1e-3) for point in tried]
            best = int(np.argmin(found))
            if found[best] < distance:
                distance, s = found[best], tried[best]
            else:
                size /= 3
        return distance, s

    def _ends(self, s: Array, direction: Array) -> tuple[float, float]:
        """Returns between which multiples of the direction a point stays in the region."""
        slack, speed = np.maximum(self.d - self.C @ s, 0.0), self.C @ direction
        with np.errstate(divide="ignore", invalid="ignore"):
            times = slack / speed
        return float(times[speed < 0].max(initial=-np.inf)), float(times[speed > 0].min(initial=np.inf))


def _one(arguments: tuple[int, Path, float, int]) -> Result:
    number, out, deadline, samples = arguments
    directory = out / f"scene-{number:03d}"
    result = look(number, directory, deadline, samples)
    (directory / "result.json").write_text(json.dumps(asdict(result)))
    return result


def campaign(first: int, scenes: int, out: Path, deadline: float, samples: int, processes: int) -> list[Result]:
    """Looks at this many scenes in this many processes, prints a line for each, and returns all results."""
    known = {n: out / f"scene-{n:03d}" / "result.json" for n in range(first, first + scenes)}
    results = [Result(**json.loads(file.read_text())) for file in known.values() if file.exists()]
    for result in results:
        _tell(result, "before: ")
    left = [(n, out, deadline, samples) for n, file in known.items() if not file.exists()]
    with multiprocessing.get_context("spawn").Pool(processes, _pin, [_cores(processes)]) as pool:
        for result in pool.imap_unordered(_one, left):
            results.append(result)
            _tell(result)
    return results


def _cores(processes: int) -> Any:
    queue = multiprocessing.get_context("spawn").Manager().Queue()
    for core in sorted(os.sched_getaffinity(0))[:processes]:
        queue.put(core)
    return queue


def _pin(queue: Any) -> None:
    """Gives a process a core of its own, which what it starts keeps to."""
    os.sched_setaffinity(0, {queue.get()})


def _tell(result: Result, before: str = "") -> None:
    what = f"{result.samples} samples, least {1e3 * result.least:.4g} mm, proved {1e3 * result.margin:.4g} mm"
    what = what if result.region else f"no region: {result.said}"
    problem = f"  PROBLEM: {result.problem}" if result.problem else ""
    print(f"{before}scene {result.scene}: {result.joints} joints, {result.seconds:.0f} s, {what}{problem}", flush=True)


def main() -> int:
    parser = argparse.ArgumentParser(description="random scenes are grown, and Drake alone looks for a collision in the regions")
    parser.add_argument("--scenes", type=int, default=30)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--out", type=Path, required=True, help="directory for scenes and results; what it holds is not done again")
    parser.add_argument("--deadline", type=float, default=60.0, help="seconds for each region")
    parser.add_argument("--samples", type=int, default=SAMPLES)
    parser.add_argument("--processes", type=int, default=cores())
    given = parser.parse_args()
    start = time.perf_counter()
    results = campaign(given.first, given.scenes, given.out, given.deadline, given.samples, min(given.processes, cores()))
    regions, problems = [r for r in results if r.region], [r for r in results if r.problem]
    closest = min(regions, key=lambda r: r.least - r.margin, default=None)
    print(f"{len(results)} scenes, {len(regions)} regions, {sum(r.samples for r in regions)} samples, {time.perf_counter() - start:.0f} s")
    if closest is not None:
        print(f"nearest to its margin: scene {closest.scene}, {1e3 * closest.least:.4g} mm found, {1e3 * closest.margin:.4g} mm proved")
    print(f"{len(problems)} problems")
    return 1 if problems else 0


if __name__ == "__main__":
    sys.exit(main())
