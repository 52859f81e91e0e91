"""The verifier checks here that the pairs of a scene prove the conditions that it names, and says what these are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.conditioned import all_names, with_conditions, without_conditions
from certifier.conditions import InBall, Inside, SlideRange, of_condition
from certifier.errors import ProofError, SceneError
from certifier.model import JointKind, Scene

ROUNDED = 1e-10
"""Vertices of what stands for conditions may differ by this from those that are computed here, in metres: other machines round cosines and
directions otherwise. It is a tenth of what they are moved to the safe side by.
"""


def check_conditions(scene: Scene) -> None:
    """Checks that what stands for the conditions of a scene is what follows from them, and that nothing else has such a name.

    Raises:
        ProofError: proof_model.
    """
    if not scene.conditions and not any(map(of_condition, all_names(scene))):
        return
    own = without_conditions(scene)
    if not {*(joint.parent for joint in own.joints), *(geometry.body for geometry in own.geometries)} <= {*own.bodies}:
        raise ProofError("proof_model", "the model of the proof makes no sense: a body of it hangs on what stands for a condition")
    try:
        expected = with_conditions(own, scene.conditions)
    except SceneError as error:
        raise ProofError("proof_model", f"the model of the proof makes no sense: the condition {error.message}") from None
    if not _alike(scene, expected):
        raise ProofError("proof_model", "the model of the proof makes no sense: what stands for its conditions is not what they say")


def _alike(scene: Scene, expected: Scene) -> bool:
    """Returns whether two scenes are the same, but for what doubles round in the vertices of what stands for conditions."""
    rounded = []
    for a, b in zip(scene.geometries, expected.geometries, strict=False):
        if a.vertices.shape != b.vertices.shape or not (np.abs(a.vertices - b.vertices) <= ROUNDED).all():
            return False
        rounded.append(replace(a, vertices=b.vertices))
    return len(rounded) == len(scene.geometries) and replace(scene, geometries=tuple(rounded)).hash == expected.hash


def conditions(scene: Scene, beyond_limits: bool = False) -> list[str]:
    """Returns a line for each condition of a scene, all of whose pairs are proved apart.

    Args:
        beyond_limits: they are apart beyond the joint limits as well. What hangs on slides can be beyond all that stands for a zone there.
    """
    slides = beyond_limits and any(joint.kind is JointKind.PRISMATIC for joint in scene.moving)
    where = ", at configurations within the joint limits" if slides else ""
    return [
        f"condition '{condition.name}': {condition}{where if isinstance(condition, Inside | InBall | SlideRange) else ''}"
        for condition in scene.conditions
    ]
