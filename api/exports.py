"""This module writes regions as files for other programs, from their manifests and arrays, under a name.

Each writer returns the file's bytes and its suffix.
"""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from typing import Any

import numpy as np

from certifier.verify.uncovered import named
from db.models import Document

Arrays = dict[str, np.ndarray]

MEDIA_TYPES = {"json": "application/json", "npz": "application/x-npz", "drake-yaml": "application/yaml"}


def manifest(manifest: Document, arrays: Arrays, name: str) -> tuple[bytes, str]:
    """Writes the manifest as JSON, with the name."""
    return json.dumps({"name": name, **manifest}, indent=1, allow_nan=False).encode(), "json"


def npz(manifest: Document, arrays: Arrays, name: str) -> tuple[bytes, str]:
    """Writes arrays in s as npz.

    name (), C (m, n) and d (m,) with the joint limits, center (n,), ellipsoid_center (n,), ellipsoid_shape (n, n); and what s means: joints
    (n,) by name, q_star, q_lower and q_upper (n,), and revolute (n,), which is true where s = tan((q - q_star) / 2) and false where
    s = q - q_star. What the proof is not about: not_covered (k, 2), names of two bodies, not_covered_pairs (k,), how many pairs of their
    geometries, not_covered_why (k,), and not_covered_summary (), a sentence. What else it is about: conditions (c,), in words.
    """
    buffer = io.BytesIO()
    ellipsoid, space, uncovered = manifest["inscribed_ellipsoid"], manifest["space"], manifest["not_covered"]
    contents = {
        "name": np.array(name),
        "C": arrays["C"],
        "d": arrays["d"],
        "center": np.array(manifest["interior_point"]),
        "ellipsoid_center": np.array(ellipsoid["center"]),
        "ellipsoid_shape": np.array(ellipsoid["shape"]),
        "not_covered": np.array([[one["a"], one["b"]] for one in uncovered["bodies"]], dtype=str).reshape(-1, 2),
        "not_covered_pairs": np.array([one["pairs"] for one in uncovered["bodies"]], dtype=int),
        "not_covered_why": np.array([one["reason"] or one["why"] for one in uncovered["bodies"]], dtype=str),
        "not_covered_summary": np.array(uncovered["summary"]),
        "conditions": np.array([f"{one['name']}: {one['statement']}" for one in manifest.get("conditions", ())], dtype=str),
    }
    # Regions that an earlier checkout stored do not say which joints turn.
    contents |= {name: np.array(space[name]) for name in ("joints", "q_star", "q_lower", "q_upper", "revolute") if name in space}
    np.savez(buffer, allow_pickle=False, **contents)
    return buffer.getvalue(), "npz"


def drake_yaml(manifest: Document, arrays: Arrays, name: str) -> tuple[bytes, str]:
    """Writes the region as Drake's IrisRegions in YAML: one HPolyhedron in s under its name. Comments say what s means.

    Other comments say which conditions hold, and which pairs the proof does not cover.
    """
    C, d, space = arrays["C"], arrays["d"], manifest["space"]
    rows = "\n".join(f"    - [{_numbers(c)}]" for c in C)
    joints = "\n".join(f"#   {_meaning(space, i)}" for i in range(len(space["joints"])))
    uncovered = manifest["not_covered"]
    conditions = [f"# condition {one['name']}: {one['statement']}" for one in manifest.get("conditions", ())]
    besides = "\n".join((*conditions, f"# {uncovered['summary']}", *(f"#   {line}" for line in named(uncovered))))
    head = f"# A certified region of {manifest['scene']['name']} in tangent-space coordinates s, one for each joint:\n{joints}\n{besides}\n"
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


WRITERS: dict[str, Callable[[Document, Arrays, str], tuple[bytes, str]]] = {"json": manifest, "npz": npz, "drake-yaml": drake_yaml}
