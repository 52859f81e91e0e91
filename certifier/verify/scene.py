"""The verifier checks here that the model of a proof makes sense, which exact checks need.

A model makes sense when it is a tree of rigid links, when tan((q - q*)/2) can express its limits, and when no body is empty. A statement
must also be able to print its names and reasons as they stand, and the model must be within the limits of what is checked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from certifier.conditions import of_condition
from certifier.errors import ProofError
from certifier.model import WORLD, Joint, JointKind, Scene
from certifier.names import escaped, is_name, is_sentence
from certifier.proof import limits
from certifier.verify.conditions import check_conditions
from certifier.verify.kinematics import ExactKinematics, has_speed

RIGID = 1e-9
"""The numbers of a rotation or of an axis may be this far from orthonormal; those of a parsed model are within about 1e-16."""


def check_scene(scene: Scene) -> None:
    """Checks the model that a proof is about.

    Raises:
        ProofError: proof_model, with what is wrong, or proof_too_large.
    """
    _check_size(scene)
    _check_words(scene)
    _check_tree(scene)
    for joint in scene.joints:
        _check_joint(scene, joint)
    _check_bodies(scene)
    if scene.following:
        _check_no_position_twice(scene)
    check_conditions(scene)


def following(scene: Scene) -> list[str]:
    """Returns a line for each joint of the robot that follows another one."""
    own = (joint for joint in scene.following if not of_condition(joint.name))
    return [f"  '{joint.name}' moves with '{scene.leader_of(joint).name}'{_how_far(joint)}" for joint in own]


def _how_far(joint: Joint) -> str:
    """Returns how far a joint moves for a change of its position, to nine digits; "" for just as far."""
    length = float(np.linalg.norm(joint.axis))
    return f", {length:.9g} times as far" if has_speed(joint) and f"{length:.9g}" != "1" else ""


def _require(condition: Any, problem: str) -> None:
    if not condition:
        raise ProofError("proof_model", f"the model of the proof makes no sense: {problem}")


def _check_size(scene: Scene) -> None:
    numbers = {
        "joints": (len(scene.joints), limits.JOINTS),
        "bodies": (len(scene.bodies), limits.JOINTS + 1),
        "joints that move": (len(scene.q_star), limits.POSITIONS),
        "geometries": (len(scene.geometries), limits.GEOMETRIES),
        "vertices of a geometry": (max((len(g.vertices) for g in scene.geometries), default=0), limits.VERTICES),
        "pairs": (len(scene.pairs), limits.PAIRS),
        "ignored pairs": (len(scene.ignored), limits.PAIRS),
    }
    for what, (number, most) in numbers.items():
        if number > most:
            raise ProofError("proof_too_large", f"the model of the proof has {number} {what}; at most {most} are checked")


def _check_words(scene: Scene) -> None:
    for what, names in (
        ("joint", [joint.name for joint in scene.joints]),
        ("body", scene.bodies),
        ("geometry", [geometry.name for geometry in scene.geometries]),
    ):
        wrong = next((name for name in names if not is_name(name)), None)
        _require(wrong is None, f"{escaped(str(wrong))[:100]} is no name for a {what}")
        _require(len(set(names)) == len(names), f"two of them are called the same: a {what}")
    _require(all(g.substitution is None or is_sentence(g.substitution) for g in scene.geometries), "a substitution is no sentence")
    _require(all(is_sentence(ignored.reason) for ignored in scene.ignored), "the reason why a pair is ignored is no sentence")


def _finite(*values: Any) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= limits.MAGNITUDE for x in values)


def _check_tree(scene: Scene) -> None:
    above = {joint.child: joint.parent for joint in scene.joints}
    _require(
        len(above) == len(scene.joints) and {*above, WORLD} == set(scene.bodies) and WORLD not in above, "every body has one joint above"
    )
    for body in scene.bodies:
        path = [body]
        while path[-1] != WORLD:
            _require(len(path) <= limits.PATH, f"{body} does not hang on the world by at most {limits.PATH} joints")
            _require(above[path[-1]] == WORLD or above[path[-1]] in above, f"the parent of {path[-1]} is no body")
            path.append(above[path[-1]])
    _require(scene.q_star.size, "no joint of it moves")
    positions = [joint.index for joint in scene.joints if joint.index is not None and not joint.follows]
    _require(scene.q_star.shape == (len(positions),) and (np.abs(scene.q_star) <= limits.MAGNITUDE).all(), "q*")
    _require(all(type(i) is int for i in positions) and sorted(positions) == list(range(scene.n)), "the joints' positions")
    for joint in scene.following:
        _require(type(joint.index) is int and 0 <= joint.index < scene.n, f"the position of {joint.name}")
        leader = scene.leader_of(joint)
        same = all(getattr(joint, what) == getattr(leader, what) for what in ("kind", "lower", "upper", "own_limits"))
        _require(same, f"{joint.name}, which follows a joint of another kind or with other limits")


def _check_no_position_twice(scene: Scene) -> None:
    """Refuses two joints of one position between the world and a body. Between the geometries of a pair there may be two slides, and no
    other joint between them: ExactKinematics.path says why.
    """
    kinematics, body = ExactKinematics.by_joint(scene), {geometry.name: geometry.body for geometry in scene.geometries}
    for name in scene.bodies:
        moving = [joint.index for joint, _ in kinematics.path(WORLD, name) if joint.index is not None]
        _require(len({*moving}) == len(moving), f"two joints between {WORLD} and {name} move together")
    for one, other in sorted({(body[pair.a], body[pair.b]) for pair in scene.pairs}):
        kinematics.path(one, other)


def _check_joint(scene: Scene, joint: Joint) -> None:
    for X in (joint.X_PF, joint.X_BM):
        _require(X.shape == (4, 4) and (np.abs(X) <= limits.MAGNITUDE).all() and (X[3] == [0, 0, 0, 1]).all(), f"a frame of {joint.name}")
        _require(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).max() < RIGID and np.linalg.det(X[:3, :3]) > 0, f"a rotation of {joint.name}")
    _require((joint.index is None) == (joint.kind is JointKind.WELD), f"the kind of {joint.name}")
    if joint.index is None:
        return
    least, most = limits.SPEEDS if has_speed(joint) else (1 - RIGID, 1 + RIGID)
    _require(joint.axis.shape == (3,) and least <= np.linalg.norm(joint.axis) <= most, f"the axis of {joint.name}")
    _require(_finite(joint.lower, joint.upper), f"the limits of {joint.name}")
    lower, upper = np.array([joint.lower, joint.upper], dtype=float)
    _require(lower < upper, f"the limits of {joint.name}")
    if joint.own_limits is not None:
        _require(joint.kind is JointKind.REVOLUTE, f"the window of {joint.name}, which does not turn")
        own = [end if limit is None else limit for limit, end in zip(joint.own_limits, (lower, upper), strict=True)]
        _require(_finite(*own) and own[0] <= lower and upper <= own[1], f"the window of {joint.name}")
    if joint.kind is JointKind.REVOLUTE:
        reach = np.abs(np.array([lower, upper]) - scene.q_star[joint.index])
        _require(reach.max() < math.pi, f"{joint.name} may turn more than half a turn away from q*")


def _check_bodies(scene: Scene) -> None:
    paddings = (scene.padding, *(pair.padding for pair in scene.pairs if pair.padding is not None))
    _require(_finite(*paddings) and min(paddings) >= 0, "the padding")
    bodies, names = set(scene.bodies), {geometry.name for geometry in scene.geometries}
    for geometry in scene.geometries:
        vertices = geometry.vertices
        _require(geometry.body in bodies, f"the body of {geometry.name}")
        _require(vertices.ndim == 2 and vertices.shape[1] == 3 and len(vertices) > 0, f"the vertices of {geometry.name}")
        _require((np.abs(vertices) <= limits.MAGNITUDE).all(), f"the vertices of {geometry.name}")
        _require(_finite(geometry.radius) and geometry.radius >= 0, f"the radius of {geometry.name}")
    _require(len(set(scene.pairs)) == len(scene.pairs), "its pairs")
    for what, pairs in (("a pair", scene.pairs), ("an ignored pair", scene.ignored)):
        _require(all(p.a in names and p.b in names for p in pairs), f"{what} of unknown geometries")
        _require(all(p.a < p.b for p in pairs), f"{what} that is not in the order of the names")
    ignored = {(p.a, p.b) for p in scene.ignored}
    _require(len(ignored) == len(scene.ignored), "a pair that is ignored twice")
    _require(not any((p.a, p.b) in ignored for p in scene.pairs), "a pair that is ignored as well")
