"""The document of ``ciris bench pairs`` and ``ciris bench scene``: verdict by verdict, with the time that either side took."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from benchmarks import machine, measure
from benchmarks.catalogue import Region, region
from benchmarks.measure import Ours, Progress, Run
from benchmarks.verdicts import Verdict, verdict
from certifier.errors import CirisError
from certifier.forecast import forecast
from certifier.frames import choose_frame
from certifier.kinematics import Kinematics
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.reference import ReferenceResult


@dataclass(frozen=True)
class Task:
    """Pairs of one scene on one polytope."""

    name: str
    scene: Scene
    region: Region
    indices: list[int]

    @property
    def digest(self) -> str:
        """Names the question: scene and faces, not the pairs chosen."""
        text = self.scene.hash.encode() + self.region.C.tobytes() + self.region.d.tobytes()
        return hashlib.sha256(text).hexdigest()[:16]


def shelf(scene: Scene, count: int | None) -> Task:
    """The scene iiwa_shelf on its polytope ``simplex``: all pairs, or the ``count`` cheapest by their forecast."""
    seconds = [cost.seconds for cost in forecast(scene)]
    cheapest = sorted(range(len(scene.pairs)), key=seconds.__getitem__)[:count]
    return Task("iiwa_shelf/simplex", scene, region("iiwa_shelf", "simplex"), sorted(cheapest))


Reference = Callable[[Task], Run[ReferenceResult]]


def live(time_limit: float | None, progress: Progress) -> Reference:
    """Drake here and now."""
    return lambda task: measure.drake(task.scene, task.region, task.indices, time_limit, progress)


class Recorded:
    """Drake's side of an earlier document.

    Raises:
        CirisError: ``recorded``, when the file is no such document, or when it has no answer to a question.
    """

    def __init__(self, path: str) -> None:
        self.path = path
        try:
            document = json.loads(Path(path).read_text(encoding="utf-8"))
            self.machine: dict[str, Any] = document["drake_machine"]
            self._tasks = {task["digest"]: task for task in document["tasks"]}
        except (ValueError, KeyError, TypeError) as error:
            raise self._wrong(f"{path} is no document of ciris bench --against drake --json: {error!r}") from None

    def __call__(self, task: Task) -> Run[ReferenceResult]:
        recorded = self._tasks.get(task.digest, {"pairs": []})
        answers = {(row["a"], row["b"]): row["drake"] for row in recorded["pairs"]}
        found = {}
        for index in task.indices:
            pair = task.scene.pairs[index]
            if (pair.a, pair.b) not in answers:
                raise self._wrong(f"{self.path} has no answer for {pair.a} - {pair.b} on the faces of {task.name}")
            answer = dict(answers[pair.a, pair.b])
            found[index] = ReferenceResult(Outcome(answer.pop("outcome")), **answer)
        return Run(recorded["setup"]["drake"], found)

    def _wrong(self, message: str) -> CirisError:
        return CirisError("recorded", message, field="--against", hint="make one with --against drake --json")


def compare(
    benchmark: str, tasks: list[Task], reference: Reference | None, repeat: int, time_limit: float | None, progress: Progress
) -> dict[str, Any]:
    """Measure all tasks; of ``repeat`` runs of ours the fastest counts. A first run, not counted, loads the compiled kernels."""
    cheapest = min(range(len(tasks[0].scene.pairs)), key=[cost.seconds for cost in forecast(tasks[0].scene)].__getitem__)
    measure.ours(tasks[0].scene, tasks[0].region, [cheapest], lambda _: None)
    measured = [_task(task, reference, repeat, progress) for task in tasks]
    rows = [row for task in measured for row in task["pairs"]]
    here = machine.describe()
    return {
        "benchmark": benchmark,
        "machine": here,
        "drake_machine": reference.machine if isinstance(reference, Recorded) else here if reference else None,
        "repeat": repeat,
        "time_limit": time_limit,
        "tasks": measured,
        "total": _total(measured),
        "contradictions": sum(row["verdict"] == Verdict.CONTRADICTION for row in rows),
    }


def _task(task: Task, reference: Reference | None, repeat: int, progress: Progress) -> dict[str, Any]:
    runs = [measure.ours(task.scene, task.region, task.indices, progress) for _ in range(repeat)]
    ours = min(runs, key=lambda run: run.setup_seconds + sum(pair.seconds for pair in run.pairs.values()))
    theirs = reference(task) if reference else None
    kinematics = Kinematics(task.scene)
    return {
        "name": task.name,
        "scene": task.scene.name,
        "digest": task.digest,
        "faces": len(task.region.d),
        "setup": {"ciris": ours.setup_seconds, "drake": theirs.setup_seconds if theirs else None},
        "pairs": [
            _row(task.scene, kinematics, index, ours.pairs[index], theirs.pairs[index] if theirs else None) for index in task.indices
        ],
    }


def _row(scene: Scene, kinematics: Kinematics, index: int, ours: Ours, theirs: ReferenceResult | None) -> dict[str, Any]:
    pair, result = scene.pairs[index], ours.result
    geometries = [scene.geometry(name) for name in (pair.a, pair.b)]
    frame = choose_frame(kinematics, pair)
    row: dict[str, Any] = {
        "a": pair.a,
        "b": pair.b,
        "k": [len(frame.chain_a), len(frame.chain_b)],
        "rationals": sum(len(geometry.vertices) for geometry in geometries),
        "ciris": {
            "outcome": result.outcome.value,
            "stage": result.stage.value,
            "detail": result.detail,
            "margin": result.margin,
            "solve_seconds": ours.solve_seconds,
            "verify_seconds": ours.verify_seconds,
        },
        "drake": None,
        "verdict": None,
        "ratio": None,
        "bound": False,
    }
    if theirs is None:
        return row
    same_program = frame.body == theirs.frame and not any(geometry.radius for geometry in geometries)
    return row | {
        "drake": {**vars(theirs), "outcome": theirs.outcome.value},
        "verdict": verdict(result.outcome, theirs.outcome, same_program).value,
        "ratio": (theirs.build_seconds + theirs.solve_seconds) / ours.seconds,
        "bound": theirs.stopped,
    }


def _total(tasks: list[dict[str, Any]]) -> dict[str, Any]:
    """Sums over all pairs; ``ratio`` is everything against everything, ``solve_ratio`` solver against solver, ``bound`` when both are at
    least that, because the time limit stopped Drake.
    """
    rows = [row for task in tasks for row in task["pairs"]]
    ciris = {name: sum(row["ciris"][name] for row in rows) for name in ("solve_seconds", "verify_seconds")}
    ciris["setup_seconds"] = sum(task["setup"]["ciris"] for task in tasks)
    if any(row["drake"] is None for row in rows):
        return {"pairs": len(rows), "ciris": ciris, "drake": None, "ratio": None, "solve_ratio": None, "bound": False}
    drake = {name: sum(row["drake"][name] for row in rows) for name in ("build_seconds", "solve_seconds")}
    drake["setup_seconds"] = sum(task["setup"]["drake"] for task in tasks)
    return {
        "pairs": len(rows),
        "ciris": ciris,
        "drake": drake,
        "ratio": sum(drake.values()) / sum(ciris.values()),
        "solve_ratio": drake["solve_seconds"] / ciris["solve_seconds"],
        "bound": any(row["bound"] for row in rows),
    }
