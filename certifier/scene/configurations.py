"""The named configurations of a scene come from its scene file and from SRDF files. Each is checked against the joints here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from certifier.configurations import is_configuration_name
from certifier.errors import SceneError, close_matches
from certifier.model import Scene
from certifier.names import escaped
from certifier.scene.formats.srdf import State
from certifier.scene.joints import EXACT, by_full_name
from certifier.scene.mimics import Mimic
from certifier.scene.semantics import Semantics
from certifier.words import counted

Given = Mapping[str, float] | tuple[float, ...]
"""Positions by joint, or one for every joint, radians or metres."""


def own_configurations(scene: Scene, given: Mapping[str, Given]) -> dict[str, dict[str, float]]:
    """Returns the configurations that a scene file names: positions by the full names of joints, by their own names.

    Raises:
        SceneError: ``scene_field`` for a wrong number of positions, or one that its joint cannot have; ``unknown_name``.
    """
    moving = {joint.name: joint for joint in scene.moving}
    leaders = {joint.name: scene.leader_of(joint).name for joint in scene.following}
    found = {}
    for name, said in given.items():
        field = f"configurations.{name}"
        if isinstance(said, tuple):
            if len(said) != scene.n:
                message = f"has {counted(len(said), 'number')} for {counted(scene.n, 'joint')}"
                raise SceneError("scene_field", message, field=field, hint=scene.in_order)
            said = dict(zip(moving, said, strict=True))
        found[name] = by_full_name(said, moving, field, leaders)
        for joint, value in found[name].items():
            if wrong := _outside(scene, joint, value):
                raise SceneError("scene_field", wrong, field=f"{field}.{joint}", hint="move it between them")
    return found


def srdf_configurations(
    scene: Scene, semantics: Sequence[Semantics], held: Mapping[str, float], followers: Mapping[str, Mimic]
) -> tuple[dict[str, dict[str, float]], list[str]]:
    """Returns the configurations that SRDF files name, as ``model/group/state``, and warnings about states that are left out.

    Files of makers have states that the scene does not allow. Such a state is of no use, and it does not stop the scene.

    Args:
        held: the positions of joints that are held, by their full names.
        followers: the joints that move with another one, by their full names.
    """
    found: dict[str, dict[str, float]] = {}
    warnings = []
    for one in semantics:
        for state in one.srdf.states:
            name = "/".join(part for part in (one.model, state.group, state.name) if part)
            positions, wrong = _of_state(scene, one.model, state, held, followers)
            if not wrong and not is_configuration_name(name):
                wrong = "its name is not accepted: names have no commas, and letters, digits and a few signs of ASCII"
            if not wrong and not positions:
                wrong = "it names no joint that can move"
            if wrong:
                warnings.append(f"{one.file}:{state.line}: the state {escaped(name)[:200]} is left out: {wrong}")
            else:
                found[name] = positions
    return found, warnings


def _of_state(
    scene: Scene, model: str, state: State, held: Mapping[str, float], followers: Mapping[str, Mimic]
) -> tuple[dict[str, float], str | None]:
    """Returns the positions of the joints of a state that can move, by their full names, and what is wrong with the state."""
    moving, every = {joint.name for joint in scene.moving}, [joint.name for joint in scene.joints]
    positions = {}
    for joint, value in state.positions.items():
        name = f"{model}/{joint}"
        if name in moving:
            if wrong := _outside(scene, name, value):
                return {}, wrong
            positions[name] = value
        elif name in held and abs(held[name] - value) > EXACT:
            return {}, f"joint {name} is held at {held[name]:.9g}, and the state has it at {value:.9g}"
        elif name not in every:
            near = close_matches(name, every)
            return {}, f"{escaped(name)[:200]} is no joint of the scene{f' ({near})' if near else ''}"
    return positions, _of_followers(scene, {f"{model}/{joint}": value for joint, value in state.positions.items()}, positions, followers)


def _of_followers(scene: Scene, given: Mapping[str, float], positions: dict[str, float], followers: Mapping[str, Mimic]) -> str | None:
    """Adds the positions of leaders of which a state names followers alone, and returns what is wrong with a follower's position."""
    units = {joint.name: joint.unit for joint in scene.joints}
    for name, mimic in followers.items():
        if name in given:
            here = f"{given[name]:.9g} {units[name]}"
            if mimic.leader not in positions:
                meant = (given[name] - mimic.offset) / mimic.factor
                if wrong := _outside(scene, mimic.leader, meant):
                    return f"{name} is at {here}, so {wrong}"
                positions[mimic.leader] = meant
            elif abs(mimic.factor * positions[mimic.leader] + mimic.offset - given[name]) > EXACT:
                at = f"{positions[mimic.leader]:.9g} {units[mimic.leader]}"
                return f"joint {name} is at {here}, and {mimic.leader}, which it follows, at {at}"
    return None


def _outside(scene: Scene, name: str, value: float) -> str | None:
    """Returns why a joint cannot have a position; None where it can."""
    (i,) = [i for i, joint in enumerate(scene.moving) if joint.name == name]
    lower, upper, unit = *(limits[i] for limits in scene.own_limits), scene.units[i]
    if not lower - EXACT <= value <= upper + EXACT:
        return f"joint {name} is at {value:.9g} {unit}, not between its limits {lower:.9g} and {upper:.9g} {unit}"
    q = scene.q_star.copy()
    q[i] = value
    if not scene.q_lower[i] - EXACT <= scene.in_windows(q)[i] <= scene.q_upper[i] + EXACT:
        window = f"{scene.q_lower[i]:.9g} to {scene.q_upper[i]:.9g} {unit}"
        return f"joint {name} is at {value:.9g} {unit}, outside of the window from {window} that the scene covers"
    return None
