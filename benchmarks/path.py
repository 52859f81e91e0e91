"""This module measures how motions are certified, beside dense sampling of the same motions by the collision checker.

Seconds are processor time of this process.
"""

from __future__ import annotations

import itertools
import statistics
import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np

from benchmarks import catalogue, measure
from benchmarks.measure import Progress
from certifier.jobs.motion import MotionVerdict, certify
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Geometry, Pair, Scene
from certifier.motion.given import given, motion_of
from certifier.outcome import Outcome
from certifier.pair.collisions import in_collision
from certifier.proof.motion import Motion, MotionProof, Space
from certifier.verify.motion import verify_motion

T = TypeVar("T")

TWO_IIWAS = "two_iiwas"
SCENES = (*catalogue.EXAMPLES, TWO_IIWAS)
APART = 0.9
"""The two arms of 14 joints stand so far apart, in metres, before the same shelf."""
LENGTHS = (1.0, 0.3)
"""A motion goes from one free configuration to another, drawn within the joint limits, or this part of the way."""
SPANS = 4
"""A cubic spline with this many spans goes from one free configuration to another,"""
AROUND = 0.1
"""with control points off the straight line by this part of the joints' ranges, normally distributed."""
SAMPLES = 1001
"""A motion is sampled at this number of times."""
MILLIMETRE = 1e-3


def scene(name: str) -> Scene:
    """Returns a scene that is measured; ``two_iiwas`` has 14 joints.

    Raises:
        CirisError: as :func:`benchmarks.catalogue.scene`.
    """
    return two_beside(catalogue.scene("iiwa_shelf"), "iiwa", APART) if name == TWO_IIWAS else catalogue.scene(name)


def two_beside(single: Scene, model: str, apart: float) -> Scene:
    """Returns a scene with a model of another scene twice, moved along y, each link of one against each link of the other as well.

    Args:
        apart: metres between the two.
    """
    names = ("left", "right")

    def called(name: str, arm: str) -> str:
        return f"{arm}/{name.removeprefix(f'{model}/')}" if name.startswith(f"{model}/") else name

    joints, geometries, pairs = [], [], []
    for number, arm in enumerate(names):
        for joint in single.joints:
            if not joint.child.startswith(f"{model}/"):
                continue
            X_PF = joint.X_PF.copy()
            if joint.parent == WORLD:
                X_PF[1, 3] += (number - 0.5) * apart
            index = None if joint.index is None else joint.index + number * single.n
            name, parent, child = (called(name, arm) for name in (joint.name, joint.parent, joint.child))
            joints.append(replace(joint, name=name, parent=parent, child=child, X_PF=X_PF, index=index))
        moved = [g for g in single.geometries if g.body.startswith(f"{model}/")]
        geometries.append([replace(g, name=called(g.name, arm), body=called(g.body, arm)) for g in moved])
        pairs += [Pair(*sorted((called(pair.a, arm), called(pair.b, arm)))) for pair in single.pairs]
    others = [joint for joint in single.joints if not joint.child.startswith(f"{model}/")]
    fixed = [g for g in single.geometries if not g.body.startswith(f"{model}/")]
    pairs += [
        Pair(*sorted((a.name, b.name))) for a, b in itertools.product(*geometries) if _moves(single, a, model) or _moves(single, b, model)
    ]
    bodies = [body for body in single.bodies if not body.startswith(f"{model}/")]
    bodies += [called(body, arm) for arm in names for body in single.bodies if body.startswith(f"{model}/")]
    everything = (*geometries[0], *geometries[1], *fixed)
    q_star = np.concatenate([single.q_star, single.q_star])
    return Scene(TWO_IIWAS, (*others, *joints), tuple(bodies), everything, tuple(pairs), (), q_star, single.padding)


def _moves(single: Scene, geometry: Geometry, model: str) -> bool:
    """Returns whether a joint moves the geometry of one of the two arms."""
    return Kinematics.of(single).rigid_root(f"{model}/{geometry.body.partition('/')[2]}") != WORLD


def path(names: list[str], count: int, progress: Progress) -> dict[str, Any]:
    """Certifies ``count`` random motions of each length in each scene, samples them, and returns the document of ``ciris bench path``."""
    return {"benchmark": "path", "machine": measure.machine(), "rows": [_row(name, count, progress) for name in names]}


def _row(name: str, count: int, progress: Progress) -> dict[str, Any]:
    found = scene(name)
    rng = np.random.default_rng(0)
    verdicts, taken, sampled = [], [], []
    certify(found, _motion(found, rng.uniform(found.q_lower, found.q_upper, (2, found.n))))  # compiles
    for length in LENGTHS:
        for _ in range(count):
            start, end = _free(found, rng), _free(found, rng)
            motion = _motion(found, np.array([start, start + length * (end - start)]))
            verdict, seconds = _timed(certify, found, motion)
            contact, sampling = _timed(_samples_touch, found, motion)
            verdicts.append(verdict)
            taken.append(seconds)
            sampled.append((contact, sampling))
            progress(f"{name}: {verdict.outcome.value}, {seconds:.3f} s; sampling {sampling:.3f} s")
    certified = [verdict for verdict in verdicts if verdict.stop is None]
    proofs = [verdict.proof for verdict in verdicts if verdict.proof is not None]
    touching = [verdict for verdict in verdicts if verdict.outcome is Outcome.REFUTED]
    told = [result for verdict in touching if (result := _told_apart(found, verdict)) is not None]
    return {
        "scene": name,
        "joints": found.n,
        "pairs": len(found.pairs),
        "motions": len(verdicts),
        "certified": len(certified),
        "contacts": len(touching),
        "sampling_finds": sum(contact for contact, _ in sampled),
        "certified_but_sampled_in_contact": sum(v.stop is None and c for v, (c, _) in zip(verdicts, sampled, strict=True)),
        "contacts_between_samples": sum(v.outcome is Outcome.REFUTED and not c for v, (c, _) in zip(verdicts, sampled, strict=True)),
        "seconds": _spread(taken),
        "verify_seconds": _spread([_timed(_verify, found, proof)[1] for proof in proofs]),
        "tube_seconds": _spread([_timed(certify, found, verdict.motion, True)[1] for verdict in certified]),
        "intervals": _spread([float(verdict.intervals) for verdict in certified]),
        "sampling_seconds": _spread([seconds for _, seconds in sampled]),
        "told_apart": sum(told),
        "millimetres": len(told),
        "splines": _splines(found, rng, count, lambda text: progress(f"{name}, spline: {text}")),
    }


def _splines(found: Scene, rng: np.random.Generator, count: int, progress: Progress) -> dict[str, Any]:
    """Certifies random cubic splines, and samples them."""
    verdicts, taken, sampled = [], [], []
    for _ in range(count):
        motion = _spline(found, rng)
        verdict, seconds = _timed(certify, found, motion)
        verdicts.append(verdict)
        taken.append(seconds)
        sampled.append(_samples_touch(found, motion))
        progress(f"{verdict.outcome.value}, {seconds:.3f} s")
    proofs = [verdict.proof for verdict in verdicts if verdict.proof is not None]
    return {
        "motions": count,
        "certified": sum(verdict.stop is None for verdict in verdicts),
        "contacts": sum(verdict.outcome is Outcome.REFUTED for verdict in verdicts),
        "certified_but_sampled_in_contact": sum(v.stop is None and c for v, c in zip(verdicts, sampled, strict=True)),
        "contacts_between_samples": sum(v.outcome is Outcome.REFUTED and not c for v, c in zip(verdicts, sampled, strict=True)),
        "seconds": _spread(taken),
        "verify_seconds": _spread([_timed(_verify, found, proof)[1] for proof in proofs]),
        "intervals": _spread([float(verdict.intervals) for verdict in verdicts if verdict.stop is None]),
    }


def _spline(found: Scene, rng: np.random.Generator) -> Motion:
    """Returns a random cubic spline between free configurations, within the joint limits."""
    start, end = _free(found, rng), _free(found, rng)
    along = np.linspace(0, 1, SPANS + 3)[:, None]
    points = start + along * (end - start)
    points[1:-1] += AROUND * (found.q_upper - found.q_lower) * rng.normal(size=(SPANS + 1, found.n))
    knots = np.concatenate([np.zeros(3), np.linspace(0, 1, SPANS + 1), np.ones(3)])
    return motion_of(found, {"knots": knots, "control_points": np.clip(points, found.q_lower, found.q_upper)})


def _motion(found: Scene, q: Array) -> Motion:
    return given(found, q, Space.Q)


def _free(found: Scene, rng: np.random.Generator) -> Array:
    """Returns a random configuration without a collision."""
    while True:
        q = rng.uniform(found.q_lower, found.q_upper)
        if not in_collision(found, found.to_s(q)[None])[0]:
            return q


def _timed(function: Callable[..., T], *arguments: Any) -> tuple[T, float]:
    """Returns what a function returns, and the seconds that it takes."""
    start = time.process_time()
    return function(*arguments), time.process_time() - start


def _verify(found: Scene, proof: bytes) -> None:
    verify_motion(MotionProof.from_bytes(proof, found))


def _samples_touch(found: Scene, motion: Motion) -> bool:
    """Returns whether a sample of a motion in q is in contact."""
    pieces, times = np.divmod(np.linspace(0, motion.pieces, SAMPLES)[:-1], 1)
    q = [motion.at(int(piece), time) for piece, time in zip(pieces, times, strict=True)]
    return bool(in_collision(found, found.to_s(np.array([*q, motion.controls[-1]]))).any())


def _told_apart(found: Scene, verdict: MotionVerdict) -> bool | None:
    """Returns whether two motions are told apart of which one ends before a contact and the other one behind it.

    They follow the motion of the verdict, and no vertex is farther apart at their ends than a millimetre. None where the contact comes
    within a millimetre of an end.
    """
    assert verdict.stop is not None
    at, step = verdict.stop.time, 1e-3
    start, end = verdict.motion.waypoints

    def q(part: float) -> Array:
        return np.asarray(start + part * (end - start))

    while _farthest(found, q(at - step), q(at + step)) > MILLIMETRE:
        step /= 2
    if not step < at < 1 - step:
        return None
    before, behind = (certify(found, _motion(found, np.array([start, q(part)]))) for part in (at - step, at + step))
    return before.stop is None and behind.outcome is Outcome.REFUTED


def _farthest(found: Scene, one: Array, other: Array) -> float:
    """Returns how far apart a vertex of the scene is at two configurations, at most, in metres."""
    kinematics, s = Kinematics.of(found), found.to_s(np.array([one, other]))
    placed = (kinematics.points(WORLD, geometry.body, geometry.vertices, s) for geometry in found.geometries)
    return max(float(np.linalg.norm(p[0] - p[1], axis=1).max()) for p in placed)


def _spread(values: list[float]) -> dict[str, float] | None:
    """Returns the median and the largest; None of nothing."""
    return {"median": statistics.median(values), "largest": max(values)} if values else None
