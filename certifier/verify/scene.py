"""Exact checks need a model that makes sense: a tree of rigid links, limits that tan((q - q*)/2) can express, bodies that are not empty."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

import numpy as np

from certifier.errors import ProofError
from certifier.model import WORLD, Joint, JointKind, Scene
from certifier.proof.container import LARGEST, malformed

RIGID = 1e-9
"""How far the numbers of a rotation or of an axis may be from orthonormal; those of a parsed model are so to about 1e-16."""


def check_scene(scene: Scene) -> None:
    """Check the model that a proof is about.

    Raises:
        ProofError: proof_model, with what is wrong.
    """
    with malformed():
        _check_tree(scene)
        for joint in scene.joints:
            _check_joint(scene, joint)
        _check_bodies(scene)


def _require(condition: Any, problem: str) -> None:
    if not condition:
        raise ProofError("proof_model", f"the model of the proof makes no sense: {problem}")


def _finite(*values: Any) -> bool:
    return all(isinstance(x, (int, float)) and not isinstance(x, bool) and abs(x) <= LARGEST for x in values)


def _unique(names: Iterable[Any]) -> bool:
    names = list(names)
    return all(isinstance(name, str) for name in names) and len(set(names)) == len(names)


def _check_tree(scene: Scene) -> None:
    above = {joint.child: joint.parent for joint in scene.joints}
    _require(_unique(scene.bodies) and WORLD in scene.bodies, "its bodies")
    _require(
        len(above) == len(scene.joints) and {*above, WORLD} == set(scene.bodies) and WORLD not in above, "every body has one joint above"
    )
    for body in scene.bodies:
        path = [body]
        while path[-1] != WORLD:
            _require(len(path) <= len(above) and above[path[-1]] in scene.bodies, f"{body} does not hang on the world")
            path.append(above[path[-1]])
    positions = [joint.index for joint in scene.joints if joint.index is not None]
    _require(scene.q_star.shape == (len(positions),) and (np.abs(scene.q_star) <= LARGEST).all(), "q*")
    _require(all(type(i) is int for i in positions) and sorted(positions) == list(range(scene.n)), "the joints' positions")


def _check_joint(scene: Scene, joint: Joint) -> None:
    for X in (joint.X_PF, joint.X_BM):
        _require(X.shape == (4, 4) and (np.abs(X) <= LARGEST).all() and (X[3] == [0, 0, 0, 1]).all(), f"a frame of {joint.name}")
        _require(np.abs(X[:3, :3].T @ X[:3, :3] - np.eye(3)).max() < RIGID and np.linalg.det(X[:3, :3]) > 0, f"a rotation of {joint.name}")
    _require((joint.index is None) == (joint.kind is JointKind.WELD), f"the kind of {joint.name}")
    if joint.index is None:
        return
    _require(joint.axis.shape == (3,) and abs(np.linalg.norm(joint.axis) - 1) < RIGID, f"the axis of {joint.name}")
    _require(_finite(joint.lower, joint.upper), f"the limits of {joint.name}")
    lower, upper = np.array([joint.lower, joint.upper], dtype=float)
    _require(lower < upper, f"the limits of {joint.name}")
    if joint.kind is JointKind.REVOLUTE:
        reach = np.abs(np.array([lower, upper]) - scene.q_star[joint.index])
        _require(reach.max() < math.pi, f"{joint.name} may turn more than half a turn away from q*")


def _check_bodies(scene: Scene) -> None:
    _require(_finite(scene.padding) and scene.padding >= 0, "the padding")
    _require(_unique(geometry.name for geometry in scene.geometries), "the geometries' names")
    for geometry in scene.geometries:
        vertices = geometry.vertices
        _require(geometry.body in scene.bodies, f"the body of {geometry.name}")
        _require(vertices.ndim == 2 and len(vertices) > 0 and (np.abs(vertices) <= LARGEST).all(), f"the vertices of {geometry.name}")
        _require(_finite(geometry.radius) and geometry.radius >= 0, f"the radius of {geometry.name}")
    names = {geometry.name for geometry in scene.geometries}
    _require(len(set(scene.pairs)) == len(scene.pairs), "its pairs")
    _require(all(p.a in names and p.b in names and p.a != p.b for p in scene.pairs), "a pair of unknown geometries")
