"""The verifier checks here that the pairs of a scene prove the conditions that it names, and says what these are."""

from __future__ import annotations

from certifier.conditioned import with_conditions, without_conditions
from certifier.conditions import of_condition
from certifier.errors import ProofError, SceneError
from certifier.model import Scene


def check_conditions(scene: Scene) -> None:
    """Checks that what stands for the conditions of a scene is what follows from them, and that nothing else has such a name.

    Raises:
        ProofError: proof_model.
    """
    if not scene.conditions and not any(map(of_condition, [*scene.bodies, *(geometry.name for geometry in scene.geometries)])):
        return
    try:
        expected = with_conditions(without_conditions(scene), scene.conditions)
    except SceneError as error:
        raise ProofError("proof_model", f"the model of the proof makes no sense: the condition {error.message}") from None
    if expected.hash != scene.hash:
        raise ProofError("proof_model", "the model of the proof makes no sense: what stands for its conditions is not what they say")


def conditions(scene: Scene) -> list[str]:
    """Returns a line for each condition of a scene, all of whose pairs are proved apart."""
    return [f"condition '{condition.name}': {condition}" for condition in scene.conditions]
