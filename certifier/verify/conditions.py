"""The verifier checks here that the pairs of a scene prove the conditions that it names, and says what these are."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from certifier.conditioned import all_names, with_conditions, without_conditions
from certifier.conditions import of_condition
from certifier.errors import ProofError, SceneError
from certifier.model import Scene

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
    try:
        expected = with_conditions(without_conditions(scene), scene.conditions)
    except SceneError as error:
        raise ProofError("proof_model", f"the model of the proof makes no sense: the condition {error.message}") from None
    if not _alike(scene, expected):
        raise ProofError("proof_model", "the model of the proof makes no sense: what stands for its conditions is not what they say")


def _alike(scene: Scene, expected: Scene) -> bool:
    """Returns whether two scenes are the same, but for what doubles round in the vertices of what stands for conditions."""
    mine, other = (replace(one, geometries=()).hash for one in (scene, expected))
    if mine != other or len(scene.geometries) != len(expected.geometries):
        return False
    for a, b in zip(scene.geometries, expected.geometries, strict=True):
        if (a.name, a.body, a.radius, a.vertices.shape) != (b.name, b.body, b.radius, b.vertices.shape):
            return False
        if np.abs(a.vertices - b.vertices).max(initial=0.0) > ROUNDED:
            return False
    return True


def conditions(scene: Scene) -> list[str]:
    """Returns a line for each condition of a scene, all of whose pairs are proved apart."""
    return [f"condition '{condition.name}': {condition}" for condition in scene.conditions]
