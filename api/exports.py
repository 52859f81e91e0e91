"""This module writes regions as files for other programs. Each writer returns the file's bytes and its suffix."""

from __future__ import annotations

import io
import json
from collections.abc import Callable

import numpy as np

from db.models import RegionRow

MEDIA_TYPES = {"json": "application/json", "npz": "application/x-npz", "drake-yaml": "application/yaml"}


def manifest(row: RegionRow) -> tuple[bytes, str]:
    """Writes the manifest as JSON."""
    return json.dumps(row.manifest, indent=1, allow_nan=False).encode(), "json"


def npz(row: RegionRow) -> tuple[bytes, str]:
    """Writes arrays in s as npz: C (m, n) and d (m,) with the joint limits, center (n,), ellipsoid_center (n,), ellipsoid_shape (n, n)."""
    buffer = io.BytesIO()
    ellipsoid = row.manifest["inscribed_ellipsoid"]
    np.savez(
        buffer,
        C=row.arrays["C"],
        d=row.arrays["d"],
        center=np.array(row.manifest["interior_point"]),
        ellipsoid_center=np.array(ellipsoid["center"]),
        ellipsoid_shape=np.array(ellipsoid["shape"]),
    )
    return buffer.getvalue(), "npz"


def drake_yaml(row: RegionRow) -> tuple[bytes, str]:
    """Writes the region as Drake's IrisRegions in YAML: one HPolyhedron in s, named after the region."""
    C, d = row.arrays["C"], row.arrays["d"]
    rows = "\n".join(f"    - [{_numbers(c)}]" for c in C)
    text = f'"{row.id}":\n  ambient_dimension: {C.shape[1]}\n  A:\n{rows}\n  b: [{_numbers(d)}]\n'
    return text.encode(), "yaml"


def _numbers(values: np.ndarray) -> str:
    return ", ".join(repr(float(value)) for value in values)


WRITERS: dict[str, Callable[[RegionRow], tuple[bytes, str]]] = {"json": manifest, "npz": npz, "drake-yaml": drake_yaml}
