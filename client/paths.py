"""This module reads a planner's path from a file."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import yaml

from certifier.errors import CirisError, RegionError
from certifier.model import Array
from certifier.proof.motion import Space

FIELD = "--path"
KINDS = (".npz", ".json", ".yaml", ".yml", ".csv")
_HINT = "give q or s, one row of numbers for each waypoint, and perhaps t"


@dataclass(frozen=True)
class PathFile:
    """Holds the waypoints of a file.

    Attributes:
        coordinates: what they are, q or s.
        waypoints: (K, n); whether they fit a scene is not known here.
        times: (K,) when the robot is there, in the file's unit, ascending; None where the file does not say.
    """

    coordinates: Space
    waypoints: Array
    times: Array | None


def path_file(path: str) -> PathFile:
    """Reads q or s and perhaps t from an npz, JSON, YAML or CSV file.

    A CSV file has one row for each waypoint. Its first row may name the columns; one that is called t holds the times. Its numbers are q,
    unless all other columns' names begin with s.

    Raises:
        RegionError: path_file, saying what is wrong with it.
    """
    suffix = Path(path).suffix.lower()
    if suffix not in KINDS:
        raise RegionError("path_file", f"{path} is neither .npz nor .json, .yaml or .csv", field=FIELD, hint=_HINT)
    try:
        content = {".npz": _arrays, ".csv": _table}.get(suffix, _document)(path)
    except FileNotFoundError:
        raise RegionError("path_file", f"there is no file {path}", field=FIELD, hint=_HINT) from None
    except CirisError:
        raise
    except (OSError, ValueError, TypeError, BadZipFile, EOFError, yaml.YAMLError, RecursionError):
        kind = suffix[1:].upper().replace("NPZ", "npz")
        raise RegionError("path_file", f"{path} is no {kind} file of numbers", field=FIELD, hint=_HINT) from None
    spaces = [space for space in Space if space.value in content]
    if len(spaces) != 1:
        raise RegionError("path_file", f"{path} must have either q or s", field=FIELD, hint=_HINT)
    waypoints, times = content[spaces[0].value], content.get("t")
    if times is not None and not (times.shape == waypoints.shape[:1] and (np.diff(times) > 0).all()):
        problem = f"t of {path} must be ascending numbers, one for each waypoint"
        raise RegionError("path_file", problem, field=FIELD, hint="t may be left out")
    return PathFile(spaces[0], waypoints, times)


def _arrays(path: str) -> dict[str, Array]:
    with np.load(path, allow_pickle=False) as arrays:
        return {name: arrays[name].astype(float, casting="same_kind") for name in arrays.files if name in ("q", "s", "t")}


def _document(path: str) -> dict[str, Array]:
    text = Path(path).read_text(encoding="utf-8")
    document: Any = json.loads(text) if path.lower().endswith(".json") else yaml.safe_load(text)
    if not isinstance(document, dict):
        raise TypeError("not a mapping")
    return {name: np.array(document[name], dtype=float) for name in ("q", "s", "t") if name in document}


def _table(path: str) -> dict[str, Array]:
    with open(path, encoding="utf-8", newline="") as file:
        rows = [row for row in csv.reader(file) if row]
    if not rows:
        raise ValueError("no rows")
    names = [] if _is_number(rows[0][0]) else [name.strip() for name in rows.pop(0)]
    columns = len(names or rows[0])
    for i, row in enumerate(rows):
        wrong = next((text for text in row if not _is_number(text)), None)
        if wrong is not None:
            raise RegionError("path_file", f"{path}, waypoint {i}: {wrong!r} is no number", field=FIELD, hint=_HINT)
        if len(row) != columns:
            raise RegionError("path_file", f"{path}, waypoint {i}: it must have {columns} numbers, as the first row", field=FIELD)
    numbers = np.array([[float(text) for text in row] for row in rows])
    timed = np.array([name == "t" for name in names], dtype=bool) if names else np.zeros(numbers.shape[1:], dtype=bool)
    in_s = bool(names) and all(name.startswith("s") for name in names if name != "t")
    found = {"s" if in_s else "q": numbers[:, ~timed]}
    return found | ({"t": numbers[:, timed][:, 0]} if timed.any() else {})


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
