"""A ground is the polytope that a proof is about, with its box; it is held here, written to files and read from them."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass

import numpy as np

from certifier.model import Array
from certifier.proof.container import Arrays


@dataclass(frozen=True)
class Ground:
    """A ground is the polytope that a proof is about, with its box.

    Attributes:
        C: (m, n) left-hand sides of the faces; the joint limits hold besides.
        d: (m,) right-hand sides of the faces.
        mid: (n,) centre of the box.
        half: (n,) half edges of the box.
        Y_lower: (n, m + 2n) multipliers of the faces, the upper and the lower joint limits that prove the box's lower bounds.
        Y_upper: (n, m + 2n) multipliers of the same that prove the box's upper bounds.
    """

    C: Array
    d: Array
    mid: Array
    half: Array
    Y_lower: Array
    Y_upper: Array

    @classmethod
    def of_box(cls, mid: Array, half: Array) -> Ground:
        """Returns a box as a polytope: its upper, then its lower faces, which are a rounding inside the exact ones."""
        eye, unit = np.eye(len(mid)), np.eye(2 * len(mid), 4 * len(mid))
        d = np.concatenate([np.nextafter(mid + half, -np.inf), -np.nextafter(mid - half, np.inf)])
        return cls(np.concatenate([eye, -eye]), d, mid, half, unit[len(mid) :], unit[: len(mid)])


def ground_arrays(ground: Ground, i: int) -> dict[str, np.ndarray]:
    """Returns the arrays of a file's ground i."""
    return {f"ground/{i}/{name}": value for name, value in vars(ground).items()}


def read_ground(arrays: Arrays, i: int) -> Ground:
    """Returns ground i of a file."""
    return Ground(*(arrays.floats(f"ground/{i}/{field.name}") for field in dataclasses.fields(Ground)))
