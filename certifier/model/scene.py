"""The scene: a kinematic tree with convex geometries, and the pairs of them to certify."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier.document import Node
from certifier.errors import CirisError, SceneError
from certifier.model.bodies import Geometry, Ignored, Pair
from certifier.model.joints import Array, ConfigurationSpace, Joint, JointKind
from certifier.model.polytope import Polytope
from certifier.positions import check_magnitude, without_turns

SCHEMA_VERSION = 1
_STORED = "the document was changed or is of another version; load the scene from its file again"


@dataclass(frozen=True, eq=False)
class Scene(ConfigurationSpace):
    """A scene is the configuration space of a kinematic tree, with convex geometries and the pairs of them to certify.

    A scene is equal to itself alone, so that what is derived from it can be kept.

    Attributes:
        joints: every joint of the tree, welds included; each body but ``world`` is the child of exactly one joint.
        bodies: names of the bodies, ``world`` included.
        pairs: the pairs of geometries to certify.
        ignored: the pairs of geometries that are not certified by request.
        q_star: (n,) centre of the parametrisation, radians or metres.
        padding: metres that are added around every geometry of every pair (both sides).
        warnings: lint findings, sentences for people.
        provenance: how the scene was made (directives, package roots, Drake's version, how far hulls reach beyond their meshes); not part
            of the hash.
    """

    name: str
    joints: tuple[Joint, ...]
    bodies: tuple[str, ...]
    geometries: tuple[Geometry, ...]
    pairs: tuple[Pair, ...]
    ignored: tuple[Ignored, ...]
    q_star: Array
    padding: float = 0.0
    warnings: tuple[str, ...] = ()
    provenance: dict[str, Any] = field(default_factory=dict)
    revolute: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "revolute", np.array([j.kind is JointKind.REVOLUTE for j in self.moving], dtype=bool))

    @property
    def n(self) -> int:
        """Returns the number of joint positions."""
        return len(self.q_star)

    @cached_property
    def moving(self) -> tuple[Joint, ...]:
        """Returns the n joints that have a position, in position order."""
        return tuple(sorted((j for j in self.joints if j.index is not None), key=lambda j: j.index or 0))

    @cached_property
    def q_lower(self) -> Array:
        return np.array([j.lower for j in self.moving], dtype=float)

    @cached_property
    def q_upper(self) -> Array:
        return np.array([j.upper for j in self.moving], dtype=float)

    @cached_property
    def own_limits(self) -> tuple[Array, Array]:
        """The lower and the upper limits of the joints themselves, (n,) each; windows may be narrower."""
        own = [(j.lower, j.upper) if j.own_limits is None else j.own_limits for j in self.moving]
        lower = [-np.inf if limits[0] is None else limits[0] for limits in own]
        return np.array(lower), np.array([np.inf if limits[1] is None else limits[1] for limits in own])

    def in_windows(self, q: ArrayLike, field: str = "q") -> Array:
        """Returns positions q, (..., n), shifted by whole turns to half a turn about q* for every joint that has a window.

        The robot is in the same pose there, but for the rounding of the last digit. Positions beyond a joint's own limits are shifted as
        well.

        Args:
            field: where the user gave the positions, for errors.

        Raises:
            RegionError: number_too_large, for a position above certifier.positions.MAGNITUDE.
        """
        given = np.asarray(q, dtype=float)
        check_magnitude(given, field)
        windowed = np.array([j.own_limits is not None for j in self.moving])
        turns = np.where(windowed, np.round((given - self.q_star) / (2 * np.pi)), 0.0)
        return without_turns(given, turns)

    @cached_property
    def s_lower(self) -> Array:
        # The difference from q* is rounded before the tangent, which may lead beyond the limit as the verifier believes it.
        return np.maximum(self.nearest_s(self.q_lower), self.outer_limits[0])

    @cached_property
    def s_upper(self) -> Array:
        return np.minimum(self.nearest_s(self.q_upper), self.outer_limits[1])

    @cached_property
    def outer_limits(self) -> tuple[Array, Array]:
        """The largest and the least doubles, (n,) each, beyond which s never is within the joint limits.

        Code that relies on the joint limits must not round them inwards, because that would leave configurations out.
        """
        return self.outer_s(self.q_lower, self.q_upper)

    @cached_property
    def joint_above(self) -> dict[str, Joint]:
        """Maps every body to the joint whose child it is; the world has none."""
        return {joint.child: joint for joint in self.joints}

    @cached_property
    def _geometry(self) -> dict[str, Geometry]:
        return {g.name: g for g in self.geometries}

    def has_geometry(self, name: str) -> bool:
        """Returns whether a geometry is called ``name``."""
        return name in self._geometry

    def geometry(self, name: str) -> Geometry:
        """Returns the geometry called ``name``.

        Raises:
            SceneError: no geometry has that name.
        """
        try:
            return self._geometry[name]
        except KeyError:
            raise SceneError("unknown_geometry", f"no geometry is called {name!r}", hint="write model/body/geometry") from None

    @cached_property
    def _pairs_of(self) -> dict[str, list[tuple[int, Pair]]]:
        found: dict[str, list[tuple[int, Pair]]] = {}
        for i, pair in enumerate(self.pairs):
            for name in (pair.a, pair.b):
                found.setdefault(name, []).append((i, pair))
        return found

    def pairs_of(self, name: str) -> list[tuple[int, Pair]]:
        """Returns the pairs that contain the geometry called ``name``, each with its index in ``pairs``."""
        return self._pairs_of.get(name, [])

    def polytope(self, C: ArrayLike, d: ArrayLike) -> Polytope:
        """Returns the polytope {C s <= d} with the joint limits added as its last 2n rows (upper, then lower)."""
        C, d = np.asarray(C, dtype=float).reshape(-1, self.n), np.asarray(d, dtype=float).reshape(-1)
        eye = np.eye(self.n)
        return Polytope(np.concatenate([C, eye, -eye]), np.concatenate([d, self.s_upper, -self.s_lower]))

    def to_document(self) -> dict[str, Any]:
        """Returns the scene as JSON-able data, whose keys are stable (docs/architecture.md)."""
        return {**self._content(), "name": self.name, "hash": self.hash, "warnings": list(self.warnings), "provenance": self.provenance}

    @cached_property
    def hash(self) -> str:
        """Returns the SHA-256 over everything that a proof depends on, which the scene's name and its provenance are not."""
        text = json.dumps(self._content(), sort_keys=True, separators=(",", ":"), allow_nan=False)
        return hashlib.sha256(text.encode()).hexdigest()

    def _content(self) -> dict[str, Any]:
        return {
            "schema_version": SCHEMA_VERSION,
            "joints": [
                {
                    "name": j.name,
                    "kind": j.kind.value,
                    "parent": j.parent,
                    "child": j.child,
                    "axis": j.axis.tolist(),
                    "X_PF": j.X_PF.tolist(),
                    "X_BM": j.X_BM.tolist(),
                    "index": j.index,
                    "lower": j.lower,
                    "upper": j.upper,
                    # Scenes without windows keep the hash that they had before there were any.
                    **({} if j.own_limits is None else {"own_limits": list(j.own_limits)}),
                }
                for j in self.joints
            ],
            "bodies": list(self.bodies),
            "geometries": [
                {
                    "name": g.name,
                    "body": g.body,
                    "vertices": g.vertices.tolist(),
                    "radius": g.radius,
                    "shape": g.shape,
                    "substitution": g.substitution,
                    "inflation": g.inflation,
                }
                for g in self.geometries
            ],
            "pairs": [[p.a, p.b] for p in self.pairs],
            "ignored": [{"pair": [i.a, i.b], "reason": i.reason} for i in self.ignored],
            "q_star": self.q_star.tolist(),
            "padding": self.padding,
        }

    @classmethod
    def from_document(cls, document: Any) -> Scene:
        """Reads what :meth:`to_document` returns.

        Raises:
            SceneError: this is no scene document, its schema version is unknown, or the stored hash does not match the content.
        """
        try:
            scene = _read(document)
        except SceneError:
            raise
        except CirisError as error:
            raise SceneError("scene_document", error.message, field=error.field, hint=_STORED) from None
        if document.get("hash", scene.hash) != scene.hash:
            raise SceneError("scene_hash", "the scene's stored hash does not match its content", field="hash", hint=_STORED)
        return scene


def _read(document: Any) -> Scene:
    """Returns the scene of a document; the document's hash is not looked at.

    Raises:
        CirisError: this is no scene document.
    """
    version = document.get("schema_version") if isinstance(document, dict) else SCHEMA_VERSION
    if version != SCHEMA_VERSION or type(version) is not int:
        message = f"the scene's schema version is not {SCHEMA_VERSION}"
        raise SceneError("scene_schema", message, field="schema_version", hint=_STORED)
    content = ("schema_version", "name", "joints", "bodies", "geometries", "pairs", "ignored", "q_star", "padding")
    scene = Node(document).fields(*content, optional=("hash", "warnings", "provenance"))
    return Scene(
        name=scene["name"].text(),
        joints=tuple(_joint(joint) for joint in scene["joints"].items()),
        bodies=tuple(body.text() for body in scene["bodies"].items()),
        geometries=tuple(_geometry(geometry) for geometry in scene["geometries"].items()),
        pairs=tuple(Pair(*_texts(pair)) for pair in scene["pairs"].items()),
        ignored=tuple(_ignored(ignored) for ignored in scene["ignored"].items()),
        q_star=scene["q_star"].array(None),
        padding=float(scene["padding"].number()),
        warnings=tuple(warning.text() for warning in scene["warnings"].items()) if "warnings" in scene else (),
        provenance=scene["provenance"].free() if "provenance" in scene else {},
    )


def _joint(node: Node) -> Joint:
    joint = node.fields("name", "kind", "parent", "child", "axis", "X_PF", "X_BM", "index", "lower", "upper", optional=("own_limits",))
    kind = joint["kind"].text()
    if kind not in set(JointKind):
        joint["kind"].refuse("a kind of joint: " + ", ".join(JointKind))
    return Joint(
        name=joint["name"].text(),
        kind=JointKind(kind),
        parent=joint["parent"].text(),
        child=joint["child"].text(),
        axis=joint["axis"].array(3),
        X_PF=joint["X_PF"].array(4, 4),
        X_BM=joint["X_BM"].array(4, 4),
        index=None if joint["index"].value is None else joint["index"].count(),
        lower=None if joint["lower"].value is None else joint["lower"].number(),
        upper=None if joint["upper"].value is None else joint["upper"].number(),
        own_limits=_own_limits(joint["own_limits"]) if "own_limits" in joint else None,
    )


def _own_limits(node: Node) -> tuple[float | None, float | None]:
    lower, upper = (None if limit.value is None else float(limit.number()) for limit in node.two())
    return lower, upper


def _geometry(node: Node) -> Geometry:
    geometry = node.fields("name", "body", "vertices", "radius", "shape", "substitution", "inflation")
    return Geometry(
        name=geometry["name"].text(),
        body=geometry["body"].text(),
        vertices=geometry["vertices"].array(None, 3),
        radius=float(geometry["radius"].number()),
        shape=geometry["shape"].free(),
        substitution=None if geometry["substitution"].value is None else geometry["substitution"].text(),
        inflation=float(geometry["inflation"].number()),
    )


def _ignored(node: Node) -> Ignored:
    ignored = node.fields("pair", "reason")
    return Ignored(*_texts(ignored["pair"]), ignored["reason"].text())


def _texts(node: Node) -> tuple[str, str]:
    first, second = node.two()
    return first.text(), second.text()
