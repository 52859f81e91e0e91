"""IRIS in s-space grows large polytopes that are probably free of collisions (C-IRIS, appendix B.4 and C, algorithm 2).

The algorithms are Drake's, and both grow in s through q = q* + 2 atan(s):

- IrisNp2 finds the closest collision by nonlinear programming (program (14)), then takes the tangent plane of the inscribed ellipsoid;
- IrisZo bisects towards sampled collisions instead.

Werner et al., "Faster Algorithms for Growing Collision-Free Convex Polytopes in Robot Configuration Space", 2024.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from enum import StrEnum
from typing import Any

import numpy as np
from pydrake.common import Parallelism
from pydrake.geometry.optimization import HPolyhedron, Hyperellipsoid
from pydrake.math import atan
from pydrake.planning import IrisNp2, IrisNp2Options, IrisParameterizationFunction, IrisZo, IrisZoOptions, SceneGraphCollisionChecker

from certifier.errors import RegionError
from certifier.model import Array, Joint, JointKind, Scene
from certifier.outcome import Guarantee
from certifier.polytopes.polytope import drop_redundant
from certifier.scene.drake_model import build_diagram
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


def iris(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    """Returns the faces (m, n), (m,) of an IRIS region around points of s, and what Drake said about them.

    |c_j| = 1, and the joint limits are left out. Whether the points are inside remains to be checked.

    Args:
        points: (k, n) points in s, the seed first.

    Returns:
        (C, d, account); the account's keys are guarantee, termination, iterations, epsilon, delta, warnings.

    Raises:
        RegionError: ``seeding_failed`` with Drake's words.
    """
    function, iris_options = (IrisNp2, IrisNp2Options()) if options.method is Method.IRIS_NP2 else (IrisZo, IrisZoOptions())
    iris_options.parameterization = IrisParameterizationFunction(_positions(scene), scene.n)
    sampled = iris_options.sampled_iris_options
    sampled.epsilon, sampled.delta = options.epsilon, options.delta
    sampled.max_iterations = options.max_iterations
    sampled.max_iterations_separating_planes = options.max_iterations_separating_planes
    sampled.relative_termination_threshold, sampled.termination_threshold = options.tolerance, -math.inf
    sampled.configuration_space_margin, sampled.relax_margin = options.margin, True
    sampled.random_seed = options.random_seed
    if len(points) > 1:
        sampled.containment_points = points.T
    sampled.parallelism = Parallelism(num_threads=1)
    sampled.verbose = True
    start = Hyperellipsoid.MakeHypersphere(_START_RADIUS, points[0])
    limits = HPolyhedron.MakeBox(scene.s_lower, scene.s_upper)
    try:
        with _listening() as records:
            region = function(_checker(scene), start, limits, iris_options)
    except (RuntimeError, ValueError) as error:
        raise RegionError(
            "seeding_failed", f"{options.method}: {error}", field="seed", hint="try another method, or move the seed"
        ) from error
    C, d = region.A()[2 * scene.n :], region.b()[2 * scene.n :]
    norms = np.linalg.norm(C, axis=1)
    C, d = C / norms[:, None], d / norms
    kept = drop_redundant(scene.polytope(C, d), fixed=2 * scene.n)[: -2 * scene.n]
    return C[kept], d[kept], {"epsilon": options.epsilon, "delta": options.delta, **_account(records)}


def _checker(scene: Scene) -> SceneGraphCollisionChecker:
    diagram = build_diagram(_apart(scene))
    robot = diagram.plant().GetJointByName(scene.moving[0].name).model_instance()
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
    """Returns the same scene with every geometry on a body of its own.

    Drake's checker knows collision filters between bodies only.
    """
    eye = np.eye(4)
    welds = tuple(Joint(f"{g.name}/weld", JointKind.WELD, g.body, f"{g.name}/body", np.zeros(3), eye, eye) for g in scene.geometries)
    return replace(
        scene,
        joints=scene.joints + welds,
        bodies=scene.bodies + tuple(weld.child for weld in welds),
        geometries=tuple(replace(g, body=weld.child) for g, weld in zip(scene.geometries, welds, strict=True)),
    )


def _positions(scene: Scene) -> Callable[[Any], Any]:
    """Returns the function s -> q for doubles, Drake's AutoDiffXd and Expression."""

    def q(s: Any) -> Any:
        if s.dtype == float:
            return scene.to_q(s)
        return np.array([c + (2 * atan(x) if r else x) for c, x, r in zip(scene.q_star, s, scene.revolute, strict=True)])

    return q


class _Recorder(logging.Handler):
    def __init__(self, level: int) -> None:
        super().__init__(level)
        self.records: list[logging.LogRecord] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.records.append(record)


@contextmanager
def _listening() -> Iterator[list[logging.LogRecord]]:
    """Yields the records that Drake logs meanwhile, at level INFO and above, and keeps them from other handlers."""
    recorder = _Recorder(logging.INFO)
    logger = logging.getLogger("drake")
    level, propagate, handlers = logger.level, logger.propagate, logger.handlers
    logger.setLevel(logging.INFO)
    logger.propagate, logger.handlers = False, [recorder]
    try:
        yield recorder.records
    finally:
        logger.setLevel(level)
        logger.propagate, logger.handlers = propagate, handlers


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
