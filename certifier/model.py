"""A scene is held here as numbers: joints, bodies, convex geometries and pairs.

A :class:`Scene` is self-contained: nobody needs a robot file, a mesh or Drake to use it. The content hash, the kinematics, the proofs and
the verifier all refer to it. Drake's parsed doubles are taken as exact numbers.

Monogram notation: X_PF is the pose of frame F measured in frame P, and p_BV is the position of point V in frame B.
What s is, :mod:`certifier.coordinates` says.
"""

from __future__ import annotations

import hashlib
import json
import math
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from certifier import conditions
from certifier.conditions import Condition
from certifier.configurations import Configurations, is_configuration_name
from certifier.coordinates import ConfigurationSpace
from certifier.document import LARGEST, Node
from certifier.errors import CirisError, RegionError, SceneError
from certifier.positions import check_magnitude, without_turns

Array = NDArray[Any]

SCHEMA_VERSION = 1
_STORED = "the document was changed or is of another version; load the scene from its file again"
DESCRIPTIVE = frozenset({"name", "hash", "warnings", "provenance", "configurations"})
"""Fields of a scene's document on which no proof depends."""
WORLD = "world"
NO_PAIRS = "no pair of bodies can collide in this scene"


class JointKind(StrEnum):
    REVOLUTE = "revolute"
    PRISMATIC = "prismatic"
    WELD = "weld"


@dataclass(frozen=True)
class Joint:
    """A joint is one edge of the kinematic tree: X_PB(q) = X_PF X_FM(q) X_BM^-1.

    Attributes:
        name: ``model/joint``.
        kind: revolute, prismatic or weld.
        parent: name of the body on the side of the world.
        child: name of the other body.
        axis: (3,) axis in F, a unit vector (zeros for a weld). Of a joint that slides and follows another one, its length is the speed:
            by how many metres it slides for a metre of its position.
        X_PF: (4, 4) pose of F, which is fixed on the parent, metres. A weld's own offset is folded into it.
        X_BM: (4, 4) pose of M, which is fixed on the child, metres.
        index: position index in q and s; None for a weld.
        lower: lower limit of q in radians or metres; None for a weld.
        upper: upper limit of q in radians or metres; None for a weld.
        own_limits: the limits of the joint itself, in radians, where those above are a window that is narrower, because s stands for less
            than a whole turn; None on a side without one. None where the limits above are its own.
        follows: the joint has the position of another one, whose index, kind and limits these are. In the axis is which way it moves.
    """

    name: str
    kind: JointKind
    parent: str
    child: str
    axis: Array
    X_PF: Array
    X_BM: Array
    index: int | None = None
    lower: float | None = None
    upper: float | None = None
    own_limits: tuple[float | None, float | None] | None = None
    follows: bool = False

    @property
    def unit(self) -> Literal["rad", "m"]:
        """Returns the unit of the joint's position."""
        return "rad" if self.kind is JointKind.REVOLUTE else "m"

    @property
    def speed(self) -> float:
        """Returns by how many metres the joint slides for a metre of its position; 0 for one that does not slide."""
        if self.kind is not JointKind.PRISMATIC:
            return 0.0
        return float(np.linalg.norm(self.axis)) if self.follows else 1.0

    @property
    def shown(self) -> tuple[Literal["deg", "m"], float]:
        """Returns the unit in which people read the joint's position, and how many of it are in a radian or a metre."""
        return ("deg", math.degrees(1.0)) if self.kind is JointKind.REVOLUTE else ("m", 1.0)


@dataclass(frozen=True)
class Geometry:
    """A geometry is a convex body fixed to a link: conv(vertices) + ball(radius), in the frame of its body.

    Attributes:
        name: ``model/body/geometry``.
        body: ``model/body``, or ``world``.
        vertices: (v, 3) metres in the body's frame. A sphere has one vertex, a capsule has two.
        radius: metres, 0 for a polytope. The padding is *not* included.
        shape: what the file said, JSON-able: ``{"kind": "box", "size": [x, y, z], "X_BG": 4x4 list}`` and so on.
        substitution: None when vertices and radius describe the shape exactly, else a sentence that names the conservative
            replacement (mesh -> hull with V vertices, cylinder -> prism ...).
        inflation: upper bound in metres on how far the replacement reaches outside the shape, or outside the hull of a mesh; behind a
            joint that is swept, outside the hull of all its places.
    """

    name: str
    body: str
    vertices: Array
    radius: float
    shape: dict[str, Any]
    substitution: str | None = None
    inflation: float = 0.0


@dataclass(frozen=True)
class Pair:
    """A pair names two geometries that must not touch; a < b in string order. Pairs of the same names are equal.

    Attributes:
        padding: metres that are added around both geometries in this pair; None where the scene's padding counts. Of a scene's pair,
            :meth:`Scene.padding_of` says which one it is.
    """

    a: str
    b: str
    padding: float | None = field(default=None, compare=False, kw_only=True)


@dataclass(frozen=True)
class Ignored:
    """Names a pair of geometries that is not certified, and says why."""

    a: str
    b: str
    reason: str


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
        padding: metres that are added around both geometries of every pair that has no padding of its own.
        warnings: lint findings, sentences for people.
        provenance: how the scene was made (directives, package roots, versions of Drake and CoACD, how far hulls reach beyond their
            meshes, which of these bound no solid); not part of the hash.
        configurations: the named configurations: positions of joints by their full names, radians or metres; not part of the hash.
        conditions: what else holds where the pairs are apart. Geometries that stand for them are among the others
            (certifier.conditioned), and certifier.conditions.of_condition knows them by their names.
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
    configurations: Configurations = field(default_factory=dict)
    conditions: tuple[Condition, ...] = ()
    revolute: NDArray[np.bool_] = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "revolute", np.array([j.kind is JointKind.REVOLUTE for j in self.moving], dtype=bool))

    @property
    def n(self) -> int:
        """Returns the number of joint positions."""
        return len(self.q_star)

    @cached_property
    def moving(self) -> tuple[Joint, ...]:
        """Returns the n joints that have a position of their own, in position order."""
        return tuple(sorted((j for j in self.joints if j.index is not None and not j.follows), key=lambda j: j.index or 0))

    @cached_property
    def units(self) -> tuple[Literal["rad", "m"], ...]:
        """Returns the units of the n joint positions."""
        return tuple(joint.unit for joint in self.moving)

    @cached_property
    def following(self) -> tuple[Joint, ...]:
        """Returns the joints that move with another one."""
        return tuple(j for j in self.joints if j.follows)

    def leader_of(self, joint: Joint) -> Joint:
        """Returns the joint that another one follows, which is one of :attr:`following`."""
        return self.moving[joint.index or 0]

    @property
    def in_order(self) -> str:
        """Returns the names of the n joints in position order, and which ones follow them, for the hint of an error."""
        own = (joint for joint in self.following if not conditions.of_condition(joint.name))
        behind = [f"{joint.name} follows {self.leader_of(joint).name}" for joint in own]
        return "; ".join([f"in order: {', '.join(joint.name for joint in self.moving)}", *behind])

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

    def check_pairs(self, field: str = "scene") -> None:
        """Refuses the scene if it has no pairs: what would be proved about it would be about nothing. Conditions have pairs, too.

        Args:
            field: where the user has named it.

        Raises:
            SceneError: ``no_pairs``.
        """
        if not self.pairs:
            hint = "give the robot's links collision geometry (<collision> in a URDF), add what they may hit, or ignore fewer pairs"
            raise SceneError("no_pairs", f"{NO_PAIRS}, so there is nothing to prove", field=field, hint=hint)

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

    @cached_property
    def body_pairs(self) -> tuple[Pair, ...]:
        """Returns the pairs that stand for no condition."""
        return tuple(pair for pair in self.pairs if conditions.condition_named(pair.a, pair.b) is None)

    @cached_property
    def _own_paddings(self) -> dict[Pair, float]:
        return {pair: pair.padding for pair in self.pairs if pair.padding is not None}

    def padding_of(self, pair: Pair) -> float:
        """Returns how many metres are added around both geometries of the scene's pair with these names."""
        return self._own_paddings.get(pair, self.padding)

    @property
    def largest_padding(self) -> float:
        """Returns the largest padding of a pair, or that of the scene if it is larger, in metres."""
        return max(self.padding, *self._own_paddings.values()) if self._own_paddings else self.padding

    def other_paddings(self) -> dict[Pair, float]:
        """Returns the pairs with another padding than the scene's, and how many metres it is."""
        return {pair: padding for pair, padding in self._own_paddings.items() if padding != self.padding}

    def pairs_between(self, volumes: tuple[Volume, Volume]) -> tuple[Pair, ...]:
        """Returns the pairs with one geometry in the first volume and the other one in the second, in their order."""
        first, second = (set(volume.geometries) for volume in volumes)
        found = {i: pair for name in first for i, pair in self.pairs_of(name) if (pair.b if pair.a == name else pair.a) in second}
        return tuple(found[i] for i in sorted(found))

    def padding_between(self, volumes: tuple[Volume, Volume]) -> float:
        """Returns the largest padding of the pairs between two volumes, in metres: what keeps it is enough for each of them."""
        if not self._own_paddings:
            return self.padding
        return max(map(self.padding_of, self.pairs_between(volumes)), default=self.padding)

    def polytope(self, C: ArrayLike, d: ArrayLike) -> Polytope:
        """Returns the polytope {C s <= d} with the joint limits added as its last 2n rows (upper, then lower)."""
        C, d = np.asarray(C, dtype=float).reshape(-1, self.n), np.asarray(d, dtype=float).reshape(-1)
        eye = np.eye(self.n)
        return Polytope(np.concatenate([C, eye, -eye]), np.concatenate([d, self.s_upper, -self.s_lower]))

    def to_document(self) -> dict[str, Any]:
        """Returns the scene as JSON-able data, whose keys are stable (docs/architecture.md)."""
        document = {**self._content(), "name": self.name, "hash": self.hash, "warnings": list(self.warnings), "provenance": self.provenance}
        named = {name: dict(positions) for name, positions in self.configurations.items()}
        return document | ({"configurations": named} if named else {})

    @cached_property
    def hash(self) -> str:
        """Returns the SHA-256 over everything that a proof depends on, which its name, provenance and configurations are not."""
        return hash_of(self._content())

    def _content(self) -> dict[str, Any]:
        other = self.other_paddings()
        # Scenes without conditions keep the hash that they had before there were any.
        own = {"conditions": [conditions.to_document(one) for one in self.conditions]} if self.conditions else {}
        return own | {
            "schema_version": SCHEMA_VERSION,
            "joints": [_plain(joint) for joint in self.joints],
            "bodies": list(self.bodies),
            "geometries": [_plain(geometry) for geometry in self.geometries],
            # A pair without a padding of its own stands as before there were such, so that scenes keep their hash.
            "pairs": [[p.a, p.b, other[p]] if p in other else [p.a, p.b] for p in self.pairs],
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


def hash_of(document: dict[str, Any]) -> str:
    """Returns the hash of the scene of a document (:meth:`Scene.to_document`) without reading the scene, which takes longer."""
    content = {name: value for name, value in document.items() if name not in DESCRIPTIVE}
    text = json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def _plain(part: Joint | Geometry) -> dict[str, Any]:
    """Returns a part's fields as JSON-able data."""
    plain = {name: value.tolist() if isinstance(value, np.ndarray) else value for name, value in vars(part).items()}
    if limits := plain.pop("own_limits", None):  # Scenes without windows keep the hash that they had before there were any.
        plain["own_limits"] = list(limits)
    if not plain.get("follows"):  # So do scenes without joints that follow others.
        plain.pop("follows", None)
    return plain


def _size(array: Array) -> str:
    return " x ".join(map(str, array.shape)) or "a number"


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
    scene = Node(document).fields(*content, optional=("hash", "warnings", "provenance", "configurations", "conditions"))
    return Scene(
        name=scene["name"].text(),
        joints=tuple(_joint(joint) for joint in scene["joints"].items()),
        bodies=tuple(body.text() for body in scene["bodies"].items()),
        geometries=tuple(_geometry(geometry) for geometry in scene["geometries"].items()),
        pairs=tuple(_pair(pair) for pair in scene["pairs"].items()),
        ignored=tuple(_ignored(ignored) for ignored in scene["ignored"].items()),
        q_star=scene["q_star"].array(None),
        padding=float(scene["padding"].number()),
        warnings=tuple(warning.text() for warning in scene["warnings"].items()) if "warnings" in scene else (),
        provenance=scene["provenance"].free() if "provenance" in scene else {},
        configurations=_configurations(scene["configurations"], scene["joints"]) if "configurations" in scene else {},
        conditions=tuple(map(conditions.from_document, scene["conditions"].items())) if "conditions" in scene else (),
    )


def _configurations(node: Node, joints: Node) -> Configurations:
    moving = tuple(joint["name"] for joint in joints.value if joint["index"] is not None and not joint.get("follows"))
    found = {}
    for name, positions in node.members().items():
        if not is_configuration_name(name):
            node.refuse("an object of configurations by their names")
        found[name] = {joint: float(value.number()) for joint, value in positions.fields(optional=moving).items()}
    return found


def _joint(node: Node) -> Joint:
    needed = ("name", "kind", "parent", "child", "axis", "X_PF", "X_BM", "index", "lower", "upper")
    joint = node.fields(*needed, optional=("own_limits", "follows"))
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
        follows="follows" in joint and _true(joint["follows"]),
    )


def _true(node: Node) -> bool:
    if node.value is not True:
        node.refuse("true")
    return True


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


def _pair(node: Node) -> Pair:
    if not isinstance(node.value, list) or len(node.value) != 3:
        return Pair(*_texts(node))
    a, b, padding = node.items()
    return Pair(a.text(), b.text(), padding=float(padding.number()))


def _ignored(node: Node) -> Ignored:
    ignored = node.fields("pair", "reason")
    return Ignored(*_texts(ignored["pair"]), ignored["reason"].text())


def _texts(node: Node) -> tuple[str, str]:
    first, second = node.two()
    return first.text(), second.text()


@dataclass(frozen=True)
class Polytope:
    """A polytope is {s : C s <= d}, where C is (m, n) and d is (m,), both finite.

    The code that makes it decides whether the joint limits are among its rows. :meth:`given` checks what comes from users.
    """

    C: Array
    d: Array

    @classmethod
    def given(cls, C: Any, d: Any, n: int | None = None, field: str = "polytope") -> Polytope:
        """Returns a polytope from what users give: nested lists or arrays of numbers.

        Args:
            n: number of columns that C has to have; None for any. A C without rows is taken to have that many columns.
            field: field in which the user gave the polytope, for errors.

        Raises:
            RegionError: ``polytope_shape`` or ``polytope_not_finite``.
        """
        try:
            rows, offsets = np.array(C, dtype=float), np.array(d, dtype=float)
        except (TypeError, ValueError):
            raise RegionError("polytope_shape", "C and d must be lists of numbers, and the rows of C equally long", field=field) from None
        if rows.size == 0 and n is not None:
            rows = rows.reshape(0, n)
        if rows.ndim != 2 or offsets.shape != (len(rows),) or (n is not None and rows.shape[1] != n):
            hint = f"C must be m x {n or 'n'}, one column a joint in the scene's order, and d must have m numbers"
            message = f"C is {_size(rows)} and d is {_size(offsets)}"
            raise RegionError("polytope_shape", message, field=field, hint=hint)
        if not (np.abs(rows).max(initial=0.0) <= LARGEST and np.abs(offsets).max(initial=0.0) <= LARGEST):
            raise RegionError("polytope_not_finite", f"C and d must be finite numbers of at most {LARGEST:g}", field=field)
        return cls(rows, offsets)

    def contains(self, s: ArrayLike, tolerance: float = 0.0) -> NDArray[np.bool_]:
        """Returns which of the points s, (..., n), satisfy C s <= d + tolerance."""
        return np.all(np.asarray(s) @ self.C.T <= self.d + tolerance, axis=-1)


@dataclass(frozen=True)
class Box:
    """A box contains the polytope and gives it the coordinates u = (s - mid)/half.

    Attributes:
        mid: (n,) centre.
        half: (n,) half edges.
    """

    mid: Array
    half: Array

    @classmethod
    def around(cls, lower: Array, upper: Array) -> Box:
        """Returns the box of these bounds, rounded outwards."""
        mid = (lower + upper) / 2
        half = np.maximum(upper - mid, mid - lower)
        # Of a small box far from 0, the corners are rounded by more than the first of these.
        far = 8 * np.spacing(np.maximum(np.abs(lower), np.abs(upper)))
        return cls(mid, np.maximum(np.nextafter(half * (1 + 1e-12), np.inf), half + far))

    @property
    def lower(self) -> Array:
        """Returns the least doubles inside the box, (n,)."""
        return np.nextafter(self.mid - self.half, np.inf)

    @property
    def upper(self) -> Array:
        """Returns the largest doubles inside the box, (n,)."""
        return np.nextafter(self.mid + self.half, -np.inf)

    def to_u(self, s: Array) -> Array:
        return (s - self.mid) / self.half


@dataclass(frozen=True, eq=False)
class StoredRegion:
    """A stored region is a certified one as the database keeps it for planners.

    Attributes:
        guarantee: what its certificate is worth.
        C: (m, n) and d (m,), the half-spaces {s : C s <= d}, m >= 1, joint limits included.
        lower: (n,) lower corner of a box that contains the region, in s.
        upper: (n,) its upper corner.
    """

    id: str
    guarantee: str
    C: Array
    d: Array
    lower: Array
    upper: Array


@dataclass(frozen=True)
class Volume:
    """A volume is a convex body conv(vertices) + ball(radius), fixed to a link. It contains, and stands for, every geometry that it names.

    Attributes:
        geometries: names of the geometries.
        body: body in whose frame the vertices are. It is the geometries' own body, or their bodies are welded to it.
        vertices: (V, 3) metres.
        radius: metres; the padding of the pairs is added to it.
    """

    geometries: tuple[str, ...]
    body: str
    vertices: Array
    radius: float

    @classmethod
    def of(cls, geometry: Geometry) -> Volume:
        """Returns the volume that is the geometry itself."""
        return cls((geometry.name,), geometry.body, geometry.vertices, geometry.radius)

    def is_geometry_of(self, scene: Scene) -> bool:
        """Returns whether the volume is exactly the one geometry that it names."""
        geometry = scene.geometry(self.geometries[0])
        return (
            len(self.geometries) == 1
            and self.body == geometry.body
            and self.radius == geometry.radius
            and np.array_equal(self.vertices, geometry.vertices)
        )
