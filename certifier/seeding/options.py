"""The options say from what a proposal is made, and by which method."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from enum import StrEnum
from typing import Any

from certifier.errors import RegionError
from certifier.positions import check_magnitude


class Method(StrEnum):
    """The method says where a proposal comes from."""

    IRIS_NP2 = "iris_np2"
    """Drake's IrisNp2 makes the polytope."""
    IRIS_ZO = "iris_zo"
    """Drake's IrisZo makes the polytope: it solves no nonlinear programs and gives more faces."""
    LIMITS = "limits"
    """The joint limits are the polytope; what cannot be certified is cut off pair by pair, by faces in the pair's joints alone."""
    BOX = "box"
    """A box around the seed, clipped to the joint limits, is the polytope."""
    POLYTOPE = "polytope"
    """The given C and d are the polytope."""


IRIS = (Method.IRIS_NP2, Method.IRIS_ZO)
IRIS_SEEDS = 2**31
"""IRIS has this many seeds of its random choices, from 0 on."""


@dataclass(frozen=True)
class SeedOptions:
    """The options say what to propose.

    Attributes:
        method: one of :class:`Method`; None for IRIS_NP2.
        q: (n,) the seed as joint positions, in radians or metres; for every method but ``polytope``.
        contain: (n,) each, joint positions that the region has to contain besides q.
        C, d: (m, n), (m,) the polytope in s, for ``polytope``; the joint limits are added to it.
        center: (n,) a point inside that polytope, in s; default: the centre of its largest ball.
        half_width: half the side of the ``box``, in s.
        epsilon, delta: IRIS stops adding faces when, except with probability delta, at most the fraction epsilon of the volume in s is in
            collision. Below 0.01, only the last rounds of faces reach epsilon; those before them stop at 0.01.
        max_iterations: IRIS' alternations between faces and ellipsoid; as many again where coarse volumes join the scene
            (:mod:`certifier.seeding.coarse_pairs`).
        max_iterations_separating_planes: IRIS' rounds of adding faces within each alternation.
        tolerance: IRIS ends when the ellipsoid's volume grows by less than this fraction.
        margin: distance in s at which IRIS' faces stay clear of the collisions found.
        random_seed: seeds IRIS; None for the growth's own, and 0 where nothing grows. Other seeds result in other proposals.
        tries: IRIS makes at most this many proposals, each with a random seed of its own, and the best is taken
            (:mod:`certifier.seeding.tries`).
    """

    method: Method | None = None
    q: tuple[float, ...] | None = None
    contain: tuple[tuple[float, ...], ...] = ()
    C: tuple[tuple[float, ...], ...] | None = None
    d: tuple[float, ...] | None = None
    center: tuple[float, ...] | None = None
    half_width: float = 1e-3
    epsilon: float = 0.001
    delta: float = 0.05
    max_iterations: int = 3
    max_iterations_separating_planes: int = 20
    tolerance: float = 0.02
    margin: float = 0.01
    random_seed: int | None = None
    tries: int = 2

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data; those that are not given are left out."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> SeedOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown, missing or out of range; the error names it.
        """
        known = {f.name for f in fields(cls)}
        for name in document:
            if name not in known:
                raise _refuse(name, f"there is no option {name!r}", "unknown_option", f"options: {', '.join(sorted(known))}")
        given = {name: value for name, value in document.items() if value is not None}
        try:
            method = Method(given.pop("method")) if "method" in given else None
        except ValueError:
            raise _refuse("method", f"method must be one of {', '.join(Method)}") from None
        needed, idle = (("C", "d"), ("q",)) if method is Method.POLYTOPE else (("q",), ("C", "d", "center"))
        for name in needed:
            if name not in given:
                raise _refuse(name, f"the method {method or Method.IRIS_NP2} needs {name}", "missing_option", "give it")
        for name in idle:
            if name in given:
                raise _refuse(name, f"the method {method or Method.IRIS_NP2} has no use for {name}", hint="leave it out")
        for name in ("q", "d", "center"):
            if name in given:
                given[name] = _numbers(name, given[name])
        for name in ("C", "contain"):
            if name in given:
                rows = given[name]
                given[name] = tuple(
                    _numbers(f"{name}[{i}]", row) for i, row in enumerate(rows if isinstance(rows, list | tuple) else [rows])
                )
        for name in ("q", "center"):
            check_magnitude(given.get(name, ()), f"seed.{name}")
        for i, row in enumerate(given.get("contain", ())):
            check_magnitude(row, f"seed.contain[{i}]")
        for name, most in (("half_width", math.inf), ("epsilon", 1), ("delta", 1), ("tolerance", math.inf), ("margin", math.inf)):
            if name in given and not (_is_number(given[name]) and 0 < given[name] < most):
                raise _refuse(name, f"{name} must be a positive number" + (f" below {most}" if most < math.inf else ""))
        for name, least, most in (
            ("max_iterations", 1, 1000),
            ("max_iterations_separating_planes", 1, 1000),
            ("random_seed", 0, IRIS_SEEDS - 1),
            ("tries", 1, 1000),
        ):
            if name in given and not (isinstance(given[name], int) and not isinstance(given[name], bool) and least <= given[name] <= most):
                raise _refuse(name, f"{name} must be an integer from {least} to {most}")
        return cls(method=method, **given)


def _refuse(name: str, message: str, code: str = "option_value", hint: str = "") -> RegionError:
    return RegionError(code, message, field=f"seed.{name}", hint=hint)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


def _numbers(name: str, values: object) -> tuple[float, ...]:
    if not isinstance(values, list | tuple) or not all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
        raise _refuse(name, f"{name} must be a list of numbers")
    return tuple(float(v) for v in values)
