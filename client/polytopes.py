"""This module reads polytopes from files."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from certifier.errors import RegionError
from certifier.model import Array, Polytope
from client.number_files import UNREADABLE, NotNumbers, checked, document_of

SAME_CENTER = 1e-9
"""Two q* are the same where no joint differs by more than this, in radians or metres."""
_FORMATS = "give C, d and perhaps center as lists of numbers, or a region that `ciris region export` wrote"


@dataclass(frozen=True)
class PolytopeFile:
    """Holds a polytope in s.

    Attributes:
        polytope: the faces; the joint limits need not be among them.
        center: a point inside, (n,), in s; None where the file has none.
        joints: names of the joints, in the order of the columns; None where the file does not say.
        q_star: (n,) the joint positions at which s is 0; None where the file does not say.
    """

    polytope: Polytope
    center: Array | None = None
    joints: tuple[str, ...] | None = None
    q_star: Array | None = None

    def check_space(self, joints: Sequence[str], q_star: Sequence[float]) -> None:
        """Refuses a polytope of another robot, or with another q*: its numbers would mean other joint positions in this scene.

        Raises:
            RegionError: polytope_joints, polytope_q_star.
        """
        if self.joints is not None and self.joints != tuple(joints):
            message = f"the polytope has the joints {', '.join(self.joints)}, and the scene {', '.join(joints)}"
            raise RegionError("polytope_joints", message, field="--polytope", hint="certify it in the scene that it was grown in")
        if self.q_star is not None and not np.allclose(self.q_star, q_star, rtol=0, atol=SAME_CENTER):
            mine, others = (", ".join(f"{x:.6g}" for x in center) for center in (self.q_star, q_star))
            message = f"the polytope is about q* = {mine}, and the scene about {others}"
            raise RegionError("polytope_q_star", message, field="--polytope", hint="set q_star of the scene file to the polytope's")


def polytope_file(path: str) -> PolytopeFile:
    """Reads C, d and optionally center, joints and q_star from an npz, JSON or YAML file, or a region that was exported as npz or JSON.

    Raises:
        RegionError: polytope_file, polytope_shape, or as :meth:`Polytope.given`.
    """
    suffix = Path(path).suffix.lower()
    try:
        content = _arrays(path) if suffix == ".npz" else _document(path) if suffix in (".json", ".yaml", ".yml") else None
    except FileNotFoundError:
        raise RegionError("polytope_file", f"there is no file {path}", field="--polytope", hint=_FORMATS) from None
    except NotNumbers as error:
        raise RegionError("polytope_file", f"{path}: {error}", field="--polytope", hint=_FORMATS) from None
    except (*UNREADABLE, BadZipFile):
        kind = "npz" if suffix == ".npz" else suffix[1:].upper()
        raise RegionError("polytope_file", f"{path} is no {kind} file of numbers", field="--polytope", hint=_FORMATS) from None
    if content is None:
        raise RegionError("polytope_file", f"{path} is neither .npz nor .json nor .yaml", field="--polytope", hint=_FORMATS)
    missing = {"C", "d"} - content.keys()
    if missing:
        raise RegionError("polytope_file", f"{path} has no {' and no '.join(sorted(missing))}", field="--polytope", hint=_FORMATS)
    polytope, center = Polytope.given(content["C"], content["d"], field="--polytope"), content.get("center")
    if center is not None and not (center.shape == polytope.C.shape[1:] and np.isfinite(center).all()):
        raise RegionError(
            "polytope_shape", f"center must be {polytope.C.shape[1]} finite numbers, as many as C has columns", field="--polytope"
        )
    joints, q_star = content.get("joints"), content.get("q_star")
    return PolytopeFile(polytope, center, None if joints is None else tuple(joints.tolist()), q_star)


def _arrays(path: str) -> dict[str, Any]:
    with np.load(path, allow_pickle=False) as arrays:
        numbers = {name: arrays[name].astype(float, casting="same_kind") for name in arrays.files if name in ("C", "d", "center", "q_star")}
        return numbers | ({"joints": arrays["joints"]} if "joints" in arrays.files else {})


def _document(path: str) -> dict[str, Any]:
    document = document_of(path)
    space = document.get("space", document)
    document = {**space, **document}
    names = {
        "C": ("C", "halfspace_normals"),
        "d": ("d", "halfspace_offsets"),
        "center": ("center", "interior_point"),
        "q_star": ("q_star",),
    }
    found = {name: next((document[key] for key in keys if key in document), None) for name, keys in names.items()}
    numbers = {name: np.array(checked(value, name), dtype=float) for name, value in found.items() if value is not None}
    return numbers | ({"joints": np.array(space["joints"], dtype=str)} if space.get("joints") is not None else {})
