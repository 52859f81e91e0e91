"""IRIS in s-space grows large polytopes that are probably free of collisions (C-IRIS, appendix B.4 and C, algorithm 2).

The algorithms are Drake's, and both grow in s through q = q* + 2 atan(s):

- IrisNp2 finds the closest collision by nonlinear programming (program (14)), then takes the tangent plane of the inscribed ellipsoid;
- IrisZo bisects towards sampled collisions instead.

Both draw the more samples the smaller epsilon is. So they run with a coarse epsilon first, and a last round with the small one begins
with that polytope, where few collisions are left to find.

Where growth will keep coarse volumes apart by faces (certifier.seeding.coarse_pairs), the same algorithm goes on from the ellipsoid of the
first polytope, and looks for contacts of these volumes too. Its last round is repeated, a few times at most, until it knows those that
matter to its polytope.

Werner et al., "Faster Algorithms for Growing Collision-Free Convex Polytopes in Robot Configuration Space", 2024.
"""

from __future__ import annotations

import logging
import math
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from types import FrameType
from typing import Any

import numpy as np
from pydrake.common import Parallelism
from pydrake.geometry.optimization import HPolyhedron, Hyperellipsoid
from pydrake.multibody.rational import RationalForwardKinematics
from pydrake.planning import IrisNp2, IrisNp2Options, IrisParameterizationFunction, IrisZo, IrisZoOptions, SceneGraphCollisionChecker

from certifier.errors import RegionError
from certifier.model import Array, Joint, JointKind, Scene
from certifier.outcome import Guarantee
from certifier.polytopes.polytope import drop_redundant
from certifier.polytopes.proved import cleaned
from certifier.scene.drake_model import build_diagram, drake_name
from certifier.seeding.coarse_pairs import CoarsePairs, coarse_pairs_of, with_coarse_pairs
from certifier.seeding.options import Method, SeedOptions

_START_RADIUS = 1e-2
_COARSE = 0.01
"""The alternation between faces and ellipsoid has an epsilon of at least this."""
_BEYOND = 0.05
"""For each point that has to stay inside, another one has to: it is farther from the ellipsoid's centre by this part."""
_LAST_ROUNDS = 3
"""There are at most this many last rounds beside coarse volumes."""


class Termination(StrEnum):
    """The termination says why IRIS stopped."""

    TOLERANCE = "tolerance"
    """The inscribed ellipsoid's volume grew by less than the tolerance."""
    ITERATION_LIMIT = "iteration_limit"
    """``max_iterations`` was reached."""
    SEED_CUT_OFF = "seed_cut_off"
    """The next region would have lost the seed, so the one before is the answer."""
    CENTER_IN_COLLISION = "center_in_collision"
    """The ellipsoid's new centre is in collision."""
    UNKNOWN = "unknown"
    """Drake did not say."""


def iris(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    """Returns the faces (m, n), (m,) of an IRIS region around points of s, and what Drake said about them.

    |c_j| = 1, and the joint limits are left out. Whether the points are inside remains to be checked.

    Args:
        points: (k, n) points in s, the seed first.

    Returns:
        (C, d, account); the account's keys are guarantee, termination, iterations, epsilon, delta, warnings. The epsilon is the coarse one
        where the last round failed or would have cut a point off.

    Raises:
        RegionError: ``seeding_failed`` with Drake's words.
    """
    try:
        region, account = _region(scene, points, options)
    except (RuntimeError, ValueError) as error:
        raise RegionError(
            "seeding_failed", f"{options.method}: {error}", field="seed", hint="try another method, or move the seed"
        ) from error
    C, d = _faces(scene, region)
    kept = drop_redundant(scene.polytope(C, d), fixed=2 * scene.n)[: -2 * scene.n]
    C, d = cleaned(C[kept], d[kept], scene.s_lower, scene.s_upper, points)
    return C, d, {"delta": options.delta, **account}


def _region(scene: Scene, points: Array, options: SeedOptions) -> tuple[HPolyhedron, dict[str, Any]]:
    """Returns Drake's region, with the joint limits first, and the account of :func:`iris` without delta."""
    alone = drake = _Iris(scene, options)
    region, account = _coarse(drake, scene, points, options)
    known = coarse = _coarse_pairs(scene, region, points)
    if coarse:
        drake = _Iris(with_coarse_pairs(scene, coarse), options)
        region, account = _again(drake, scene, region, account, points, options)
    if options.epsilon >= account["epsilon"]:
        return region, account
    if known:
        coarse = _coarse_pairs(scene, region, points)
    for _ in range(_LAST_ROUNDS):
        if coarse.keys() != known.keys():
            drake = _Iris(with_coarse_pairs(scene, coarse), options)
        region, account = _refined(drake, region, account, points, options.epsilon)
        known, coarse = coarse, _coarse_pairs(scene, region, points)
        if coarse.keys() == known.keys():
            break
    if known and account["epsilon"] > options.epsilon:  # The round beside these volumes has failed.
        region, account = _refined(alone, region, account, points, options.epsilon)
    return region, account


def _coarse_pairs(scene: Scene, region: HPolyhedron, points: Array) -> CoarsePairs:
    """Returns the volumes that growth would part on Drake's region."""
    return coarse_pairs_of(scene, scene.polytope(*_faces(scene, region)), points)


def _faces(scene: Scene, region: HPolyhedron) -> tuple[Array, Array]:
    """Returns the faces (m, n), (m,) of Drake's region without the joint limits, scaled to |c_j| = 1."""
    C, d = region.A()[2 * scene.n :], region.b()[2 * scene.n :]
    norms = np.linalg.norm(C, axis=1)
    return C / norms[:, None], d / norms


def _coarse(drake: _Iris, scene: Scene, points: Array, options: SeedOptions) -> tuple[HPolyhedron, dict[str, Any]]:
    """Alternates between faces and ellipsoid from a small ball around the seed, within the joint limits."""
    limits = HPolyhedron.MakeBox(scene.s_lower, scene.s_upper)
    start = Hyperellipsoid.MakeHypersphere(_START_RADIUS, points[0])
    contain = points if len(points) > 1 else None
    return drake.grow(limits, start, max(options.epsilon, _COARSE), options.max_iterations, contain)


def _again(
    drake: _Iris, scene: Scene, region: HPolyhedron, account: dict[str, Any], points: Array, options: SeedOptions
) -> tuple[HPolyhedron, dict[str, Any]]:
    """Alternates from the ellipsoid of a region, with more to keep clear of, within the joint limits."""
    limits = HPolyhedron.MakeBox(scene.s_lower, scene.s_upper)
    grown, said = _onward(drake, limits, region, account, points, account["epsilon"], options.max_iterations)
    if grown is not region:
        said["iterations"] += account["iterations"]
    return grown, said


def _refined(
    drake: _Iris, region: HPolyhedron, account: dict[str, Any], points: Array, epsilon: float
) -> tuple[HPolyhedron, dict[str, Any]]:
    """Adds faces to a region until it passes the test with a smaller epsilon.

    The faces are those nearest to the centre of the inscribed ellipsoid, which cost least of its volume, or to the seed if that centre
    is in collision.
    """
    refined, said = _onward(drake, region, region, account, points, epsilon, 1)
    return refined, {**said, **{name: account[name] for name in ("termination", "iterations")}}


def _onward(
    drake: _Iris, domain: HPolyhedron, region: HPolyhedron, account: dict[str, Any], points: Array, epsilon: float, most: int
) -> tuple[HPolyhedron, dict[str, Any]]:
    """Goes on from the inscribed ellipsoid of a region, with at most ``most`` alternations.

    Returns:
        What was found, and what Drake said of it. Where Drake fails, or a point would be lost, it is the region as it was, and its account
        with a warning more.
    """
    start, contain = _start(drake, region, points)
    try:
        found, said = drake.grow(domain, start, epsilon, most, contain)
    except (RuntimeError, ValueError) as error:
        return region, {**account, "warnings": [*account["warnings"], f"the polytope was left as it was: {error}"]}
    warnings = account["warnings"] + said["warnings"]
    # Drake returns the domain where the first faces lose the ellipsoid's centre.
    nothing = said["termination"] == Termination.SEED_CUT_OFF and said["iterations"] <= 1
    if nothing or not (found.A() @ points.T < found.b()[:, None]).all():
        return region, {**account, "warnings": [*warnings, "the polytope was left as it was: a point would have been lost"]}
    return found, {**said, "warnings": warnings}


def _start(drake: _Iris, region: HPolyhedron, points: Array) -> tuple[Hyperellipsoid, Array]:
    """Returns the inscribed ellipsoid of a region, and the points to keep inside: those given, and its centre.

    Drake lays faces through points that it keeps inside. So another one joins each of them that is a little farther from the centre, where
    that is free and in the region. Where the centre is in collision, the ellipsoid is about the seed, and the points are those given.
    """
    inscribed = region.MaximumVolumeInscribedEllipsoid()
    center = inscribed.center()
    if not drake.is_free(center):
        return Hyperellipsoid(inscribed.A(), points[0]), points
    beyond = points + _BEYOND * (points - center)
    free = [s for s in beyond if region.PointInSet(s) and drake.is_free(s)]
    return inscribed, np.stack([*points, *free, center])


class _Iris:
    """Runs Drake's function on one scene.

    It uses as many threads as ``OMP_NUM_THREADS`` allows, which is one in the service's children. The result is the same for any number.
    """

    def __init__(self, scene: Scene, options: SeedOptions) -> None:
        self._function, self._options = (IrisNp2, IrisNp2Options()) if options.method is Method.IRIS_NP2 else (IrisZo, IrisZoOptions())
        self._scene = scene
        with _listening():  # Drake tells how many contexts it allocates, which is nothing to people who grow a region
            self._checker = checker(scene)
        self._kinematics = RationalForwardKinematics(self._checker.plant())  # Drake's parameterization does not keep it alive
        self._options.parameterization = IrisParameterizationFunction(self._kinematics, scene.q_star)
        sampled = self._options.sampled_iris_options
        sampled.delta = options.delta
        sampled.max_iterations_separating_planes = options.max_iterations_separating_planes
        sampled.relative_termination_threshold, sampled.termination_threshold = options.tolerance, -math.inf
        sampled.configuration_space_margin, sampled.relax_margin = options.margin, True
        sampled.random_seed = options.random_seed or 0
        sampled.parallelism = Parallelism.Max()
        sampled.sample_particles_in_parallel = False  # otherwise the samples would depend on the number of threads
        sampled.verbose = True

    def is_free(self, s: Array) -> bool:
        """Returns whether nothing collides at a point of s."""
        return bool(self._checker.CheckConfigCollisionFree(self._scene.to_q(s)))

    def grow(
        self, domain: HPolyhedron, start: Hyperellipsoid, epsilon: float, max_iterations: int, points: Array | None
    ) -> tuple[HPolyhedron, dict[str, Any]]:
        """Returns Drake's region within the domain, whose faces come first, the epsilon, and the account of :func:`_account`.

        Args:
            start: its centre is kept inside, and its shape says which collisions are near.
            points: (k, n) in s, kept inside where their convex hull is free, with the start's centre among them or in their hull; None for
                that centre alone.
        """
        sampled = self._options.sampled_iris_options
        sampled.epsilon, sampled.max_iterations = epsilon, max_iterations
        sampled.containment_points = None if points is None else points.T
        with _listening() as records:
            region = self._function(self._checker, start, domain, self._options)
        return region, {"epsilon": epsilon, **_account(records)}


def checker(scene: Scene) -> SceneGraphCollisionChecker:
    """Returns Drake's collision checker of a scene, with its padding; its distance is the length in q."""
    diagram = build_diagram(_apart(scene))
    robot = diagram.plant().GetJointByName(drake_name(scene.moving[0].name)).model_instance()
    checker = SceneGraphCollisionChecker(
        model=diagram,
        robot_model_instances=[robot],
        edge_step_size=0.1,
        configuration_distance_function=lambda a, b: float(np.linalg.norm(a - b)),
    )
    checker.SetPaddingAllRobotEnvironmentPairs(2 * scene.padding)
    checker.SetPaddingAllRobotRobotPairs(2 * scene.padding)
    return checker


def _apart(scene: Scene) -> Scene:
    """Returns the same scene with every geometry on a body of its own, and the moving bodies in the order of their joints' positions.

    Drake's checker knows collision filters between bodies only. Drake's rational kinematics numbers s by bodies, not by positions.
    """
    eye = np.eye(4)
    welds = tuple(Joint(f"{g.name}/weld", JointKind.WELD, g.body, f"{g.name}/body", np.zeros(3), eye, eye) for g in scene.geometries)
    moving = tuple(joint.child for joint in scene.moving)
    return replace(
        scene,
        joints=scene.joints + welds,
        bodies=tuple(body for body in scene.bodies if body not in moving) + moving + tuple(weld.child for weld in welds),
        geometries=tuple(replace(g, body=weld.child) for g, weld in zip(scene.geometries, welds, strict=True)),
    )


class _Recorder(logging.Handler):
    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


@contextmanager
def _listening() -> Iterator[list[logging.LogRecord]]:
    """Yields the records that Drake logs meanwhile, at level INFO and above, and keeps them from other handlers.

    Raises:
        KeyboardInterrupt: somebody interrupted meanwhile. Where that is raised within a call of the log, Drake swallows it.
    """
    recorder = _Recorder(logging.INFO)
    logger = logging.getLogger("drake")
    level, propagate, handlers = logger.level, logger.propagate, logger.handlers
    logger.setLevel(logging.INFO)
    logger.propagate, logger.handlers = False, [recorder]
    try:
        with _interrupts_kept():
            yield recorder.records
    finally:
        logger.setLevel(level)
        logger.propagate, logger.handlers = propagate, handlers


@contextmanager
def _interrupts_kept() -> Iterator[None]:
    """Raises a KeyboardInterrupt at the end where one was swallowed meanwhile. Only the main thread hears of interrupts."""
    before = signal.getsignal(signal.SIGINT)
    if threading.current_thread() is not threading.main_thread() or not callable(before):
        yield
        return
    heard: list[int] = []

    def hear(number: int, frame: FrameType | None) -> None:
        heard.append(number)
        before(number, frame)

    signal.signal(signal.SIGINT, hear)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)
    if heard:
        raise KeyboardInterrupt


_ENDINGS = (
    (("no longer in the region", "seed point not contained"), Termination.SEED_CUT_OFF),
    (("relative volume change", "reldelta vol"), Termination.TOLERANCE),
    (("iteration limit", "iter limit"), Termination.ITERATION_LIMIT),
    (("new ellipsoid center",), Termination.CENTER_IN_COLLISION),
)


def _account(records: list[logging.LogRecord]) -> dict[str, Any]:
    """Returns guarantee, termination, iterations and warnings, read from the log: Drake's functions return the polytope alone."""
    messages = [record.getMessage() for record in records]
    endings = [ending for words, ending in _ENDINGS if any(word in message for message in messages for word in words)]
    warnings = [record.getMessage() for record in records if record.levelno >= logging.WARNING]
    tests = [message for message in messages if "probabilistic test" in message]
    passed = bool(tests) and "passed" in tests[-1] and not any("voids" in message for message in warnings)
    return {
        "guarantee": Guarantee.SAMPLED if passed else Guarantee.NONE,
        "termination": (endings or [Termination.UNKNOWN])[0].value,
        "iterations": sum(message.startswith(("IrisNp2 iteration", "IrisZo outer iteration")) for message in messages),
        "warnings": warnings,
    }
