"""These functions make of what an engineer has, such as arrays, what the service takes."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, TypedDict, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from certifier.errors import CirisError, RegionError, close_matches
from ciris.answers import Document
from ciris.space import numbers

Straight = Literal["q", "s"]


class PaperOptions(TypedDict, total=False):
    """Options of the papers' algorithm. The service has a default for each."""

    contraction: Literal["targeted", "uniform"]
    """``targeted`` adds faces where pairs fail; ``uniform`` moves every face inwards by the same amount."""
    contractions: int
    """Number of targeted contractions. The largest region counts."""
    bisection_steps: int
    """Steps of uniform contraction's bisection, one certification each."""
    pushes: int
    """How often the faces are pushed out after the contractions."""
    max_rounds: int
    """Most rounds of the polytope step after the pushes."""
    tolerance: float
    """Relative growth of the ellipsoid's volume that is still worth a push or a round."""
    backoff: int
    """How often a polytope step that fails to certify is halved."""


class GrowOptions(TypedDict, total=False):
    """Options of growing a region. The service has a default for each."""

    contain: ArrayLike
    """(n,) or (k, n), more configurations that the region must contain, such as where it meets another region."""
    method: Literal["iris_np2", "iris_zo", "limits", "box"]
    """How the first polytope is found: by Drake's IRIS, or with ``paper`` also from the joint limits or as a box around q."""
    half_width: float
    """Half the edge length of this box, in s."""
    deadline: float
    """Seconds after which the job ends, with the best region so far."""
    cells: int
    """Cells of a pair in each stage. Cells still undecided when this budget is spent are removed by new faces."""
    paper: PaperOptions
    """Grows with the papers' algorithm: it shrinks the first polytope until every pair has one plane. ``{}`` takes its defaults."""
    random_seed: int
    """Seed of every random choice, those of Drake's IRIS too. Another seed gives another region."""
    priority: int
    """From -3 to 3; each step up doubles the job's share of the work."""
    labels: Mapping[str, str]
    """Labels to find the job by: name -> value."""


class CoverOptions(TypedDict, total=False):
    """Options of a cover. The service has a default for each."""

    coverage: float
    """Goal: this share of the collision-free configurations is in regions. Default: 0.95 where nothing else is asked for."""
    connected: bool
    """Goal: all regions of the scene are connected."""
    connect: ArrayLike
    """(k, n), k >= 2: goal: these configurations are in one connected component."""
    paths: Sequence[ArrayLike]
    """(k, n) each: goal: these motions, straight in q from waypoint to waypoint, are covered."""
    seeds: ArrayLike
    """(k, n), configurations that get regions first."""
    regions: int
    """Grow at most this many regions."""
    at_once: int
    """Number of regions that grow at the same time."""
    region_seconds: float
    """Each region ends after so long, with what there is of it."""
    cells: int
    """Cells of a pair in each stage of a region. New faces remove the cells that are undecided after that."""
    stages: int
    """Number of stages after which the growth of each region ends."""
    random_seed: int
    """Seed of every random choice."""
    deadline: float
    """Seconds after which the cover ends, with the regions grown so far."""
    priority: int
    """From -3 to 3; each step up doubles the job's share of the work."""
    labels: Mapping[str, str]
    """Labels to find the job by: name -> value."""


_IN_JOB = (("deadline", "deadline_seconds"), ("priority", "priority"), ("labels", "labels"))
_IN_OPTIONS = ("cells", "paper", "random_seed")


def grow_request(scene: str, q: ArrayLike, options: GrowOptions) -> Document:
    """Returns the request of a job that grows a region around q, (n,)."""
    given = _known(options, GrowOptions)
    seed: Document = {"q": numbers(q, "q").tolist()}
    if "contain" in given:
        seed["contain"] = np.atleast_2d(numbers(given["contain"], "contain")).tolist()
    seed |= {name: given[name] for name in ("method", "half_width") if name in given}
    request = {"kind": "grow", "scene": scene, "seed": seed, "options": {name: given[name] for name in _IN_OPTIONS if name in given}}
    return request | {field: given[name] for name, field in _IN_JOB if name in given}


def cover_request(scene: str, options: CoverOptions) -> Document:
    """Returns the request of a job that covers a scene."""
    given = _known(options, CoverOptions)
    asked = {name: value for name, value in given.items() if name not in dict(_IN_JOB)}
    for name in ("connect", "seeds"):
        if name in given:
            asked[name] = np.atleast_2d(numbers(given[name], name)).tolist()
    if "paths" in given:
        if not isinstance(given["paths"], Iterable) or isinstance(given["paths"], str):
            raise CirisError("argument", f"{type(given['paths']).__name__} is no paths", field="paths", hint="give a list of (k, n) arrays")
        asked["paths"] = [numbers(path, f"paths[{i}]").tolist() for i, path in enumerate(given["paths"])]
    request = {"kind": "cover", "scene": scene, "options": asked}
    return request | {field: given[name] for name, field in _IN_JOB if name in given}


def _known(options: Mapping[str, Any], kind: type) -> Document:
    """Returns the options that are given; None stands for the service's default.

    Raises:
        CirisError: unknown_option.
    """
    known = list(get_type_hints(kind))
    for name in options:
        if name not in known:
            hint = close_matches(name, known) or f"options: {', '.join(known)}"
            raise CirisError("unknown_option", f"there is no option {name!r}", field=name, hint=hint)
    return given(**options)


def document(value: Any) -> Any:
    """Returns what json writes of a value: numpy's numbers and arrays as Python's."""
    if isinstance(value, Mapping):
        return {name: document(one) for name, one in value.items()}
    if isinstance(value, list | tuple):
        return [document(one) for one in value]
    return value.tolist() if isinstance(value, np.generic | np.ndarray) else value


def named(name: object, field: str, what: str) -> str:
    """Returns the name or the id of something.

    Raises:
        CirisError: argument, for what is no text.
    """
    if isinstance(name, str):
        return name
    raise CirisError("argument", f"{type(name).__name__} is no {field}", field=field, hint=f"give {what}")


def patience(timeout: float) -> float:
    """Returns the seconds that a question may take.

    Raises:
        CirisError: argument, for what is no positive, finite number.
    """
    if isinstance(timeout, int | float | np.number) and 0 < timeout < np.inf:
        return float(timeout)
    raise CirisError("argument", f"{timeout!r} is no timeout", field="timeout", hint="give seconds, a number above 0")


def given(**values: Any) -> Document:
    """Returns the values that are not None, by name."""
    return {name: value for name, value in values.items() if value is not None}


def plain(value: ArrayLike | str | None, field: str) -> Any:
    """Returns an array, or what numpy makes one of, as nested lists; a text, such as an id, and None as they are.

    Raises:
        RegionError: points.
    """
    return value if value is None or isinstance(value, str) else numbers(value, field).tolist()


def straight(space: Straight | None, s: ArrayLike | None) -> str:
    """Returns in which coordinates a motion is straight: in those that it is given in, unless ``space`` says otherwise."""
    return space or ("q" if s is None else "s")


def points(axes: int, **values: ArrayLike | None) -> Document:
    """Returns points as nested lists with this number of axes, by the name under which they were given; the first axis may be missing.

    Raises:
        RegionError: points.
    """
    found = {name: numbers(value, name) for name, value in values.items() if value is not None}
    if len(found) != 1:
        hint = "q are joint positions, s tangent-space coordinates: give one of them"
        raise RegionError("points", "the points must be given either as q or as s", field="q", hint=hint)
    ((name, array),) = found.items()
    if array.ndim not in (axes - 1, axes):
        raise RegionError("points", f"it must be finite numbers in {axes - 1} or {axes} axes, joints last", field=name)
    return {name: (array if array.ndim == axes else array[None]).tolist()}


def bundle(path: str | Path) -> bytes:
    """Packs a scene file. What it takes, PyYAML and python-flint, is loaded here, so that asking needs neither.

    Raises:
        CirisError: argument, for what is no path.
        SceneError: as :func:`certifier.scene.bundle.pack_bundle`.
    """
    from certifier.scene.bundle import pack_bundle

    return pack_bundle(named(os.fspath(path) if isinstance(path, os.PathLike) else path, "path", "the path of a scene file"))
