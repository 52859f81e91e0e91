"""This module writes regions as files for other programs, under a name. Each writer returns the file's bytes and its suffix."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from db.models import RegionRow

MEDIA_TYPES = {"json": "application/json", "npz": "application/x-npz", "drake-yaml": "application/yaml"}


def manifest(row: RegionRow, name: str) -> tuple[bytes, str]:
    """Writes the manifest as JSON, with the name."""
    return json.dumps({"name": name, **row.manifest}, indent=1, allow_nan=False).encode(), "json"


def npz(row: RegionRow, name: str) -> tuple[bytes, str]:
    """Writes arrays in s as npz.

    name (), C (m, n) and d (m,) with the joint limits, center (n,), ellipsoid_center (n,), ellipsoid_shape (n, n); and what s means: joints
    (n,) by name, q_star, q_lower and q_upper (n,), and revolute (n,), which is true where s = tan((q - q_star) / 2) and false where
    s = q - q_star.
    """
    buffer = io.BytesIO()
    ellipsoid, space = row.manifest["inscribed_ellipsoid"], row.manifest["space"]
    arrays = {
        "name": np.array(name),
        "C": row.arrays["C"],
        "d": row.arrays["d"],
        "center": np.array(row.manifest["interior_point"]),
        "ellipsoid_center": np.array(ellipsoid["center"]),
        "ellipsoid_shape": np.array(ellipsoid["shape"]),
    }
    # Regions that an earlier checkout stored do not say which joints turn.
    arrays |= {name: np.array(space[name]) for name in ("joints", "q_star", "q_lower", "q_upper", "revolute") if name in space}
    np.savez(buffer, allow_pickle=False, **arrays)
    return buffer.getvalue(), "npz"


def drake_yaml(row: RegionRow, name: str) -> tuple[bytes, str]:
    """Writes the region as Drake's IrisRegions in YAML: one HPolyhedron in s under its name. Comments say what s means."""
    C, d, space = row.arrays["C"], row.arrays["d"], row.manifest["space"]
    rows = "\n".join(f"    - [{_numbers(c)}]" for c in C)
    joints = "\n".join(f"#   {_meaning(space, i)}" for i in range(len(space["joints"])))
    head = f"# A certified region of {row.manifest['scene']['name']} in tangent-space coordinates s, one for each joint:\n{joints}\n"
    text = f'{head}"{name}":\n  ambient_dimension: {C.shape[1]}\n  A:\n{rows}\n  b: [{_numbers(d)}]\n'
    return text.encode(), "yaml"


def _meaning(space: dict[str, Any], i: int) -> str:
    """Returns what one coordinate of s means. Regions that an earlier checkout stored do not say which joints turn."""
    name, center, lower, upper = space["joints"][i], *(repr(float(space[key][i])) for key in ("q_star", "q_lower", "q_upper"))
    if "revolute" not in space:
        return f"{name}, q_star = {center}, q from {lower} to {upper}"
    meaning = f"s = tan((q - {center}) / 2), q in radians" if space["revolute"][i] else f"s = q - {center}, q in metres"
    return f"{name}: {meaning}, from {lower} to {upper}"


def _numbers(values: np.ndarray) -> str:
    return ", ".join(repr(float(value)) for value in values)


WRITERS: dict[str, Callable[[RegionRow, str], tuple[bytes, str]]] = {"json": manifest, "npz": npz, "drake-yaml": drake_yaml}
