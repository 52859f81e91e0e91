"""IRIS as Drake has it grows polytopes that are probably free of collisions, for comparison with :mod:`certifier.seeding.iris`.

Both algorithms grow in s through q = q* + 2 atan(s):

- IrisNp2 finds the closest collision by nonlinear programming (program (14)), then takes the tangent plane of the inscribed ellipsoid;
- IrisZo bisects towards sampled collisions instead.

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
from certifier.polytopes.proved import needed_faces
from certifier.scene.drake_model import build_diagram, check_independent, drake_name
from certifier.seeding.options import Method, SeedOptions

_START_RADIUS = 1e-2


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


def drake_iris(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    """Returns the faces (m, n), (m,) of Drake's region around points of s, and what Drake said about them.

    |c_j| = 1, and the joint limits are left out. Whether the points are inside remains to be checked.

    Args:
        points: (k, n) points in s, the seed first.

    Returns:
        (C, d, account); the account's keys are guarantee, termination, iterations, epsilon, delta, warnings.

    Raises:
        RegionError: ``seeding_failed``; Drake's words are the error's cause.
    """
    start = Hyperellipsoid.MakeHypersphere(_START_RADIUS, points[0])
    try:
        region, account = _Iris(scene, options).grow(start, points if len(points) > 1 else None)
    except (RuntimeError, ValueError) as error:
        message = f"the method {options.method} found no region around {'the seed' if len(points) == 1 else 'the seed and contain'}"
        raise RegionError("seeding_failed", message, field="seed", hint="leave the method out, or move the seed") from error
    C, d = region.A()[2 * scene.n :], region.b()[2 * scene.n :]
    norms = np.linalg.norm(C, axis=1)
    C, d = needed_faces(scene, C / norms[:, None], d / norms, points)
    return C, d, {"epsilon": options.epsilon, "delta": options.delta, **account}


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
        sampled.epsilon, sampled.delta = options.epsilon, options.delta
        sampled.max_iterations = options.max_iterations
        sampled.max_iterations_separating_planes = options.max_iterations_separating_planes
        sampled.relative_termination_threshold, sampled.termination_threshold = options.tolerance, -math.inf
        sampled.configuration_space_margin, sampled.relax_margin = options.margin, True
        sampled.random_seed = options.random_seed or 0
        sampled.parallelism = Parallelism.Max()
        sampled.sample_particles_in_parallel = False  # otherwise the samples would depend on the number of threads
        sampled.verbose = True

    def grow(self, start: Hyperellipsoid, points: Array | None) -> tuple[HPolyhedron, dict[str, Any]]:
        """Returns Drake's region, whose first faces are the joint limits, and the account of :func:`_account`.

        Args:
            points: (k, n) in s, kept inside where their convex hull is free; None for the start's centre alone.
        """
        limits = HPolyhedron.MakeBox(self._scene.s_lower, self._scene.s_upper)
        self._options.sampled_iris_options.containment_points = None if points is None else points.T
        with _listening() as records:
            region = self._function(self._checker, start, limits, self._options)
        return region, _account(records)


def checker(scene: Scene) -> SceneGraphCollisionChecker:
    """Returns Drake's collision checker of a scene, with its padding; its distance is the length in q."""
    check_independent(scene)
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
    for pair, padding in scene.other_paddings().items():
        one, other = (diagram.plant().GetBodyByName(drake_name(_own_body(name))).index() for name in (pair.a, pair.b))
        checker.SetPaddingBetween(one, other, 2 * padding)
    return checker


def _apart(scene: Scene) -> Scene:
    """Returns the same scene with every geometry on a body of its own, and the moving bodies in the order of their joints' positions.

    Drake's checker knows collision filters between bodies only. Drake's rational kinematics numbers s by bodies, not by positions.
    """
    eye = np.eye(4)
    welds = tuple(Joint(f"{g.name}/weld", JointKind.WELD, g.body, _own_body(g.name), np.zeros(3), eye, eye) for g in scene.geometries)
    moving = tuple(joint.child for joint in scene.moving)
    return replace(
        scene,
        joints=scene.joints + welds,
        bodies=tuple(body for body in scene.bodies if body not in moving) + moving + tuple(weld.child for weld in welds),
        geometries=tuple(replace(g, body=weld.child) for g, weld in zip(scene.geometries, welds, strict=True)),
    )


def _own_body(geometry: str) -> str:
    return f"{geometry}/body"


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
