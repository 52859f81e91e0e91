"""This module reads a planner's path from a file."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Callable
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from certifier.configurations import is_number
from certifier.errors import CirisError, RegionError
from certifier.model import Array
from certifier.motion.splines import curve
from client.number_files import UNREADABLE, NotNumbers, checked, document_of, text_of
from client.paths import FIELD, GivenPath

KINDS = (".npz", ".json", ".yaml", ".yml", ".csv")
_HINT = "give q or s, one row of numbers for each waypoint, and perhaps t; or bezier, or knots and control_points"
_NAMES = ("q", "s", "bezier", "knots", "control_points", "t")


def path_file(path: str) -> GivenPath:
    """Reads q or s and perhaps t from an npz, JSON, YAML or CSV file; or a curve, but not from CSV.

    Rows of q in JSON and YAML may be names of configurations.

    A CSV file has one row for each waypoint. Its first row may name the columns: q1, q2, ... or s1, s2, ..., and t for the times. Its
    numbers are q without names. The columns are in the scene's order of joints.

    Raises:
        RegionError: path_file, saying what is wrong with it; or what is wrong with the curve, as certifier.motion.splines.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in KINDS:
        raise RegionError("path_file", f"{path} is neither .npz nor .json, .yaml or .csv", field=FIELD, hint=_HINT)
    try:
        content: dict[str, Any] = _READERS.get(suffix, _document)(path)
    except FileNotFoundError:
        raise RegionError("path_file", f"there is no file {path}", field=FIELD, hint=_HINT) from None
    except CirisError:
        raise
    except NotNumbers as error:
        raise RegionError("path_file", f"{path}: {error}", field=FIELD, hint=_HINT) from None
    except (*UNREADABLE, BadZipFile):
        kind = suffix[1:].upper().replace("NPZ", "npz")
        raise RegionError("path_file", f"{path} is no {kind} file of numbers", field=FIELD, hint=_HINT) from None
    given = {name: content[name] for name in _NAMES[:-1] if name in content}
    if tuple(given) not in (("q",), ("s",), ("bezier",), ("knots", "control_points")):
        raise RegionError("path_file", f"{path} must have either q or s, or one curve", field=FIELD, hint=_HINT)
    times = content.get("t")
    try:
        found = None if isinstance(given.get("q"), list) else curve(given)
    except RegionError as error:
        error.field = f"{FIELD} {error.field}"
        raise
    motion = {name: value if isinstance(value, list) else value.tolist() for name, value in given.items()}
    if found is not None and found.times is not None:
        if times is not None:
            raise RegionError("path_file", f"{path} has knots, which are its times, and t", field=FIELD, hint="leave t out")
        return GivenPath(motion, found.times.tolist())
    places = next(iter(given.values())) if found is None else found.controls[:: found.degree]
    if times is not None and not (times.shape == (len(places),) and (np.diff(times) > 0).all()):
        problem = f"t of {path} must be ascending numbers, one for each waypoint, or for each piece's beginning and for the end"
        raise RegionError("path_file", problem, field=FIELD, hint="t may be left out")
    return GivenPath(motion, None if times is None else times.tolist())


def _arrays(path: str) -> dict[str, Array]:
    with np.load(path, allow_pickle=False) as arrays:
        found = {name: arrays[name].astype(float, casting="same_kind") for name in arrays.files if name in _NAMES}
    for name, array in found.items():
        if not np.isfinite(array).all():
            raise NotNumbers(f"{name} has numbers that are not finite")
    return found


def _document(path: str) -> dict[str, Any]:
    """Returns the arrays of a document; where rows of q are names, q as a list."""
    given = {name: value for name, value in document_of(path).items() if name in _NAMES}
    return {name: _rows(value) if name == "q" else np.array(checked(value, name), dtype=float) for name, value in given.items()}


def _rows(q: Any) -> Any:
    """Returns waypoints (K, n) as an array, or as a list with the names of configurations as they are.

    Raises:
        ValueError: they are neither names nor numbers.
    """
    if not (isinstance(q, list) and any(isinstance(row, str) for row in q)):
        return np.array(checked(q, "q"), dtype=float)
    return [row if isinstance(row, str) else np.array(checked(row, f"q[{i}]"), dtype=float).tolist() for i, row in enumerate(q)]


def _table(path: str) -> dict[str, Array]:
    rows = [row for row in csv.reader(io.StringIO(text_of(path), newline="")) if row]
    if not rows:
        raise ValueError("no rows")
    names = [] if is_number(rows[0][0]) else [name.strip() for name in rows.pop(0)]
    columns = len(names or rows[0])
    for i, row in enumerate(rows):
        wrong = next((text for text in row if not is_number(text) or not math.isfinite(float(text))), None)
        if wrong is not None:
            raise RegionError("path_file", f"{path}, waypoint {i}: {wrong[:100]!r} is no finite number", field=FIELD, hint=_HINT)
        if len(row) != columns:
            raise RegionError("path_file", f"{path}, waypoint {i}: it must have {columns} numbers, as the first row", field=FIELD)
    numbers = np.array([[float(text) for text in row] for row in rows])
    timed = np.array([name == "t" for name in names], dtype=bool) if names else np.zeros(numbers.shape[1:], dtype=bool)
    own = [name for name in names if name != "t"]
    kind = "s" if own and own[0].startswith("s") else "q"
    if own and own not in ([f"{kind}{i}" for i in range(first, first + len(own))] for first in (0, 1)):
        problem = f"{path}: columns are in the scene's order of joints, and their names {', '.join(own)[:200]} are not looked up"
        hint = "name them q1, q2, ... or s1, s2, ... in that order, and t; or leave the first row out"
        raise RegionError("path_file", problem, field=FIELD, hint=hint)
    found = {kind: numbers[:, ~timed]}
    return found | ({"t": numbers[:, timed][:, 0]} if timed.any() else {})


_READERS: dict[str, Callable[[str], dict[str, Any]]] = {".npz": _arrays, ".csv": _table}
"""What reads a file by its suffix, where it is not a document."""
