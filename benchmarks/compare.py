"""This module makes the document of ``ciris bench pairs`` and ``ciris bench scene``.

It compares verdict by verdict, with the time that either side took.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any

from benchmarks import catalogue, measure
from benchmarks.catalogue import Instance, Region
from benchmarks.measure import Ours, Progress
from certifier.errors import CirisError
from certifier.jobs.reference import ReferenceResult
from certifier.model import Pair, Scene
from certifier.outcome import Outcome
from certifier.pair.forecast import PairCost, forecast


class Verdict(StrEnum):
    """A verdict says how our outcome and Drake's relate."""

    AGREE = "agree"
    """Both sides certified the pair, or neither did and both said so."""
    UNDECIDED = "undecided"
    """One side, or both, could not tell."""
    PROGRAMS_DIFFER = "programs differ"
    """One side found a plane. The other shows that there is none, but in another frame or with another relaxation of balls."""
    CONTRADICTION = "contradiction"
    """One side certified what the other refutes, or what the other proves infeasible as the very same program: one of them is wrong."""


def verdict(ours: Outcome, theirs: Outcome, same_program: bool) -> Verdict:
    """Returns what the two outcomes mean together.

    Args:
        same_program: True when both sides have the same frame and the same relaxation.
    """
    undecided = (Outcome.INCONCLUSIVE, Outcome.ERROR)
    if ours in undecided or theirs in undecided:
        return Verdict.UNDECIDED
    if (ours is Outcome.CERTIFIED) == (theirs is Outcome.CERTIFIED):
        return Verdict.AGREE
    if Outcome.REFUTED in (ours, theirs) or same_program:
        return Verdict.CONTRADICTION
    return Verdict.PROGRAMS_DIFFER


def same_program(scene: Scene, pair: Pair, frame: str, drakes_frame: str) -> bool:
    """Says whether (11) is the same program on both sides.

    It is not where the frames differ, nor where the pair has a ball, because Drake relaxes balls in another way.
    """
    return frame == drakes_frame and not any(scene.geometry(name).radius for name in (pair.a, pair.b))


@dataclass(frozen=True)
class Task:
    """A task asks about pairs of one scene on one polytope."""

    scene: Scene
    region_kind: str
    region: Region
    indices: list[int]


def ladder() -> list[Task]:
    """Returns the catalogue's ladder, one task for each instance. Each task has a scene of its own."""
    return [_alone(instance) for instance in catalogue.LADDER]


def _alone(instance: Instance) -> Task:
    scene = replace(catalogue.scene(instance.scene), pairs=(Pair(instance.a, instance.b),))
    return Task(scene, instance.region, catalogue.region(instance.scene, instance.region), [0])


def whole_scene(name: str, kind: str, match: str = "", count: int | None = None) -> Task:
    """Returns the task for the pairs of a scene with ``match`` in their names, or for the ``count`` cheapest of them by their forecast.

    Raises:
        CirisError: ``unknown_scene``; ``no_pairs`` when none matches.
    """
    scene = catalogue.scene(name)
    seconds = {i: cost.seconds for i, cost in enumerate(forecast(scene)) if match in f"{cost.a} {cost.b}"}
    if not seconds:
        raise CirisError("no_pairs", f"no pair of {name} has {match!r} in its names", field="--match")
    return Task(scene, kind, catalogue.region(name, kind), sorted(sorted(seconds, key=seconds.__getitem__)[:count]))


def compare(benchmark: str, tasks: list[Task], against: bool, repeat: int, progress: Progress) -> dict[str, Any]:
    """Measures all tasks. The fastest of our ``repeat`` runs counts.

    A first run that does not count loads the compiled kernels.
    """
    first = tasks[0]
    measure.ours(first.scene, first.region, first.indices[:1])
    measured = [_task(task, against, repeat, progress) for task in tasks]
    rows = [row for task in measured for row in task["pairs"]]
    return {
        "benchmark": benchmark,
        "machine": measure.machine(),
        "repeat": repeat,
        "tasks": measured,
        "total": _total(measured),
        "verdicts": dict(Counter(row["verdict"] for row in rows)) if against else None,
    }


def _task(task: Task, against: bool, repeat: int, progress: Progress) -> dict[str, Any]:
    runs = [measure.ours(task.scene, task.region, task.indices, progress) for _ in range(repeat)]
    ours = min(runs, key=lambda run: run.setup_seconds + sum(pair.seconds for pair in run.pairs.values()))
    theirs = measure.drake(task.scene, task.region, task.indices, progress) if against else None
    costs = forecast(task.scene)
    rows = [_row(task.scene, costs[i], ours.pairs[i], theirs.pairs[i] if theirs else None) for i in task.indices]
    return {
        "scene": task.scene.name,
        "region": task.region_kind,
        "faces": len(task.region.d),
        "setup": {"ciris": ours.setup_seconds, "drake": theirs.setup_seconds if theirs else None},
        "pairs": rows,
    }


def _row(scene: Scene, cost: PairCost, ours: Ours, theirs: ReferenceResult | None) -> dict[str, Any]:
    pair, result = Pair(cost.a, cost.b), ours.result
    row: dict[str, Any] = {
        "a": pair.a,
        "b": pair.b,
        "k": [len(cost.chain_a), len(cost.chain_b)],
        "vertices": cost.rationals,
        "ciris": {
            "outcome": result.outcome.value,
            "stage": result.stage,
            "detail": result.detail,
            "margin": result.margin,
            "covers": ours.covers,
            "solve_seconds": ours.solve_seconds,
            "verify_seconds": ours.verify_seconds,
        },
        "drake": None,
        "verdict": None,
        "ratio": None,
    }
    if theirs is None:
        return row
    return row | {
        "drake": {**vars(theirs), "outcome": theirs.outcome.value},
        "verdict": verdict(result.outcome, theirs.outcome, same_program(scene, pair, cost.frame, theirs.frame)).value,
        "ratio": (theirs.build_seconds + theirs.solve_seconds) / ours.seconds if ours.covers == 1 else None,
    }


def _total(tasks: list[dict[str, Any]]) -> dict[str, Any]:
    """Returns the sums over all pairs. ``ratio`` compares everything with everything, ``solve_ratio`` solver with solver."""
    rows = [row for task in tasks for row in task["pairs"]]
    ciris = {name: sum(row["ciris"][name] for row in rows) for name in ("solve_seconds", "verify_seconds")}
    ciris["setup_seconds"] = sum(task["setup"]["ciris"] for task in tasks)
    if any(row["drake"] is None for row in rows):
        return {"pairs": len(rows), "ciris": ciris, "drake": None, "ratio": None, "solve_ratio": None}
    drake = {name: sum(row["drake"][name] for row in rows) for name in ("build_seconds", "solve_seconds")}
    drake["setup_seconds"] = sum(task["setup"]["drake"] for task in tasks)
    return {
        "pairs": len(rows),
        "ciris": ciris,
        "drake": drake,
        "ratio": sum(drake.values()) / sum(ciris.values()),
        "solve_ratio": drake["solve_seconds"] / ciris["solve_seconds"],
    }
