"""Conditions become pairs of geometries here, so that whatever proves pairs apart proves conditions.

A cone is about directions. The joints that turn the body are copied without their offsets, each moving with the one that it copies. A ball
at the end of the direction has to stay out of the box of all directions that are too far away. A range of angles is a cone of a chain
that turns in a plane, and a range of slides is a zone on a line. Outside of each face of a zone there is a box as large as the geometries
reach. A ball is a zone with many faces inside of it. A distance is padding.

All numbers are rounded to the safe side by ROOM: two geometries are apart only if the condition holds.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import combinations, product

import numpy as np

from certifier.conditions import (
    MODEL,
    NAMED,
    TURNING,
    Condition,
    Cone,
    Distance,
    InBall,
    Inside,
    Range,
    SlideRange,
    condition_named,
    is_condition_name,
    of_condition,
)
from certifier.errors import SceneError
from certifier.model import WORLD, Array, Geometry, Joint, JointKind, Pair, Scene
from certifier.names import escaped, is_name
from certifier.positions import MAGNITUDE

ROOM = 1e-9
"""A face is moved by this to the safe side, in metres, and in cosines of angles; the face of a zone by this part of what the geometries
reach, where that is more than a metre. It is far above what doubles round, and above what statements round in their numbers.
"""
POINT = 1e-7
"""A point that has to stay somewhere is a ball of this radius, in metres."""
BALL = 0.01
"""Radius of the ball at the end of a direction, which is 1 long."""
LONG = 2.0
"""How far the box of the directions that are too far away extends beyond the sphere of directions."""
TIGHT = 14 / 15
"""Proposals are made for cones and ranges that are narrower by this factor (docs/trials.md)."""
FAR = 2.0
"""The box beyond a face extends to this many times what the geometries reach within the joint limits."""
LEAST_ANGLE = math.radians(0.1)
"""A cone is no narrower than this, so that ROOM does not matter."""
MOST_CONDITIONS, MOST_FACES, MOST_IN_ZONES = 100, 100, 20_000
"""A scene has at most this many conditions, a zone this many faces, and all zones together this many pairs of a geometry and a face."""
MOST_TURNS = 10
"""The lower angle of a range is at most this many turns, so that ROOM is far above what doubles round in it."""
UNIT = 1e-12
"""The length of a direction differs from 1 by less than this."""
Face = tuple[float, float, float, float]
ALONG = 0.65
"""A face begins at the first axis along which its normal has less than this: at least one has less than 0.58, and rounding is far away."""
CORNERS = np.array([[x, y, z] for x in (0, 1) for y in (-1, 1) for z in (-1, 1)], dtype=float)


def with_conditions(scene: Scene, conditions: Sequence[Condition]) -> Scene:
    """Returns the scene with conditions, and with the pairs that prove them.

    Args:
        scene: has no conditions.

    Raises:
        SceneError: ``condition``, for one that concerns nothing that moves, or that a pair without a certificate would have to prove;
            and for a model that is called as what stands for conditions.
    """
    names = all_names(scene)
    if own := next(filter(of_condition, names), None):
        hint = "rename the model"
        raise SceneError("condition", f"{own} would stand for a condition: no model may be called {MODEL}", field="directives", hint=hint)
    _check_size(conditions)
    parts = _Parts(scene)
    for condition in conditions:
        _check(scene, condition)
        parts.add(condition)
    if len({condition.name for condition in conditions}) < len(conditions):
        raise SceneError("condition", "two conditions have one name", field="conditions", hint="give each its own name")
    if too_long := next((name for name in (*parts.above, *(g.name for g in parts.geometries)) if not is_name(name)), None):
        raise SceneError("condition", f"the name {escaped(too_long)[:60]}... is too long", field="conditions", hint="give shorter names")
    return replace(
        scene,
        joints=(*scene.joints, *parts.above.values()),
        bodies=(*scene.bodies, *parts.above),
        geometries=(*scene.geometries, *parts.geometries),
        pairs=(*parts.padded, *parts.pairs),
        conditions=tuple(conditions),
    )


def _check_size(conditions: Sequence[Condition]) -> None:
    """Checks that there are not too many conditions, before anything is made of them.

    Raises:
        SceneError: ``condition``.
    """
    pairs = sum((len(one.geometries) + len(one.points)) * len(faces_of(one)) for one in conditions if isinstance(one, Inside | InBall))
    for number, most, what, hint in (
        (len(conditions), MOST_CONDITIONS, "conditions", "leave some out"),
        (pairs, MOST_IN_ZONES, "pairs of a geometry and a face of a zone", "name fewer geometries, or give zones fewer faces"),
    ):
        if number > most:
            raise SceneError("condition", f"there are {number} {what}, and {most} at most", field="conditions", hint=hint)


def all_names(scene: Scene) -> list[str]:
    """Returns the names of joints, bodies and geometries, and of what is ignored."""
    found = [*scene.bodies, *(joint.name for joint in scene.joints), *(geometry.name for geometry in scene.geometries)]
    return found + [name for ignored in scene.ignored for name in (ignored.a, ignored.b)]


def _check(scene: Scene, condition: Condition) -> None:
    """Checks that a condition makes sense in a scene.

    Raises:
        SceneError: ``condition``.
    """
    if not is_condition_name(condition.name):
        raise _wrong(condition, NAMED)
    match condition:
        case Cone():
            _check_bodies(scene, condition, condition.body, condition.of)
            _check_vectors(condition, condition.axis, condition.along)
            if not LEAST_ANGLE <= condition.angle <= math.pi - LEAST_ANGLE:
                raise _wrong(condition, "its angle has to be between 0.1 and 179.9 degrees")
        case Inside() | InBall():
            _check_bodies(scene, condition, condition.of, *(body for body, _ in condition.points))
            if not condition.geometries + condition.points or not all(map(scene.has_geometry, condition.geometries)):
                raise _wrong(condition, "it has to name geometries of the scene, or points of bodies")
            if any(scene.geometry(name).shape.get("kind") == "half_space" for name in condition.geometries):
                raise _wrong(condition, "a half-space has no end, so it is in no zone")
            if isinstance(condition, InBall):
                if not 0 < condition.radius <= MAGNITUDE:
                    raise _wrong(condition, "its radius has to be positive")
            elif not condition.faces or len(condition.faces) > MOST_FACES:
                raise _wrong(condition, f"its zone needs 1 to {MOST_FACES} faces")
            else:
                _check_vectors(condition, *(face[:3] for face in condition.faces))
        case Distance():
            if not (is_name(condition.a) and is_name(condition.b)):
                raise _wrong(condition, "it has to name two bodies or geometries")
            if not 0 < condition.metres <= MAGNITUDE:
                raise _wrong(condition, "its distance has to be positive")
        case SlideRange():
            _check_joints(scene, condition, JointKind.PRISMATIC, "slide")
            if not condition.lower < condition.upper:
                raise _wrong(condition, "its lower number has to be less than its upper one")
        case Range():
            _check_joints(scene, condition, JointKind.REVOLUTE, "turn")
            apart = condition.upper - condition.lower
            if not 2 * LEAST_ANGLE <= apart <= 2 * (math.pi - LEAST_ANGLE):
                raise _wrong(condition, "its angles have to be 0.2 to 359.8 degrees apart")
            if not abs(condition.lower) <= 2 * math.pi * MOST_TURNS:
                raise _wrong(condition, f"its lower angle has to be within {360 * MOST_TURNS} degrees of 0")


def _check_joints(scene: Scene, condition: Range | SlideRange, kind: JointKind, move: str) -> None:
    names, known = [joint for joint, _ in condition.joints], {joint.name for joint in scene.moving if joint.kind is kind}
    if not names or len(set(names)) < len(names) or not {*names} <= known:
        raise _wrong(condition, f"it has to name joints that {move} and have positions of their own, each once")


def _check_bodies(scene: Scene, condition: Condition, *bodies: str) -> None:
    for body in bodies:
        if body not in scene.bodies:
            raise _wrong(condition, f"{body} is no body of the scene")


def _check_vectors(condition: Condition, *vectors: Sequence[float]) -> None:
    for vector in vectors:
        if not abs(float(np.linalg.norm(vector)) - 1) < UNIT:
            raise _wrong(condition, "a direction is no unit vector")


def without_conditions(scene: Scene) -> Scene:
    """Returns the scene without conditions, and without what stands for them. Paddings of distances remain."""
    return replace(
        scene,
        joints=tuple(joint for joint in scene.joints if not of_condition(joint.child)),
        bodies=tuple(body for body in scene.bodies if not of_condition(body)),
        geometries=tuple(geometry for geometry in scene.geometries if not of_condition(geometry.name)),
        pairs=tuple(pair for pair in scene.pairs if condition_named(pair.a, pair.b) is None),
        conditions=(),
    )


def tightened(scene: Scene) -> Scene:
    """Returns the scene with narrower cones and ranges.

    A proposal of such a scene has faces that do not touch the conditions of the scene itself. Where they touch, proofs need many cells.
    """
    narrower = [_tightened(condition) for condition in scene.conditions]
    return scene if narrower == list(scene.conditions) else with_conditions(without_conditions(scene), narrower)


def _tightened(condition: Condition) -> Condition:
    match condition:
        case Cone():
            return replace(condition, angle=max(TIGHT * condition.angle, LEAST_ANGLE))
        case Range():
            less = (1 - TIGHT) * (condition.upper - condition.lower) / 2
            return replace(condition, lower=condition.lower + less, upper=condition.upper - less)
    return condition


def condition_of(scene: Scene, pair: Pair) -> Condition | None:
    """Returns the condition that a pair proves; None for a pair of bodies that are to stay apart."""
    name = condition_named(pair.a, pair.b)
    return next((condition for condition in scene.conditions if condition.name == name), None)


def contact_refutes(scene: Scene, pair: Pair) -> bool:
    """Returns whether a contact of a pair shows that something fails. A polytope in a ball stands for the ball, and ends earlier."""
    return not isinstance(condition_of(scene, pair), InBall)


def distance_of(scene: Scene, pair: Pair) -> Distance | None:
    """Returns the condition with the largest distance that the two bodies of a pair have to keep; None where there is none."""
    kept = [one for one in scene.conditions if isinstance(one, Distance) and _between(_sides(scene, one), pair)]
    return max(kept, key=lambda one: one.metres, default=None)


@dataclass
class _Parts:
    """Gathers what stands for the conditions of a scene.

    Attributes:
        above: maps each body to the joint whose child it is.
        padded: the pairs of the scene itself.
    """

    scene: Scene
    above: dict[str, Joint] = field(default_factory=dict)
    geometries: list[Geometry] = field(default_factory=list)
    pairs: list[Pair] = field(default_factory=list)
    padded: list[Pair] = field(init=False)

    def __post_init__(self) -> None:
        self.padded = list(self.scene.pairs)
        self._copies: dict[str, str] = {WORLD: WORLD}

    def add(self, condition: Condition) -> None:
        match condition:
            case Cone():
                self._cone(condition, self._turning(condition.body), condition.axis, self._turning(condition.of), condition.along)
            case Inside() | InBall():
                self._inside(condition)
            case Distance():
                self._distance(condition)
            case Range():
                self._range(condition)
            case SlideRange():
                self._slides(condition)

    def _cone(self, condition: Cone | Range, body: str, axis: Sequence[float], of: str, along: Sequence[float]) -> None:
        angle = condition.angle if isinstance(condition, Cone) else (condition.upper - condition.lower) / 2
        _check_way(condition, self.above, body, of, "no joint turns the one direction against the other")
        top = math.cos(angle) + ROOM - BALL
        beyond = _slab(np.array(along), top, -LONG - top, LONG)
        names, shape = [f"{MODEL}/{condition.name}/{one}" for one in ("beyond", "direction")], {"kind": "condition"}
        self.geometries.append(Geometry(names[1], body, np.array([_unit(axis)]), BALL, shape))
        self.geometries.append(Geometry(names[0], of, beyond, 0.0, shape))
        self.pairs.append(Pair(names[0], names[1], padding=0.0))

    def _turning(self, body: str) -> str:
        """Returns the copy of a body that turns as the body does, but never moves: its joints have no offsets."""
        if body not in self._copies:
            joint = self.scene.joint_above[body]
            parent, copy = self._turning(joint.parent), f"{MODEL}/{TURNING}/{body}"
            X_PF, X_BM = _turned(joint.X_PF), _turned(joint.X_BM)
            if joint.kind is JointKind.REVOLUTE:
                copied = replace(joint, name=copy, parent=parent, child=copy, X_PF=X_PF, X_BM=X_BM, follows=True)
            else:
                copied = Joint(copy, JointKind.WELD, parent, copy, np.zeros(3), X_PF, X_BM)
            self.above[copy] = copied
            self._copies[body] = copy
        return self._copies[body]

    def _sum(self, condition: Range | SlideRange, axis: Array) -> str:
        """Returns the last of bodies that copies of the joints move one after the other about an axis, or along it."""
        moving = {joint.name: joint for joint in self.scene.moving}
        parent = WORLD
        for i, (name, sign) in enumerate(condition.joints):
            leader, child = moving[name], f"{MODEL}/{condition.name}/turn{i}"
            copied = replace(
                leader, name=child, parent=parent, child=child, axis=float(sign) * axis, X_PF=np.eye(4), X_BM=np.eye(4), follows=True
            )
            self.above[child] = copied
            parent = child
        return parent

    def _slides(self, condition: SlideRange) -> None:
        point = Geometry(
            f"{MODEL}/{condition.name}/point",
            self._sum(condition, np.array([1.0, 0.0, 0.0])),
            np.zeros((1, 3)),
            POINT,
            {"kind": "condition"},
        )
        faces = ((1.0, 0.0, 0.0, condition.upper), (-1.0, 0.0, 0.0, -condition.lower))
        self.geometries.append(point)
        self._zone(condition, WORLD, faces, [point], _reach(self.above, point, WORLD))

    def _range(self, condition: Range) -> None:
        parent = self._sum(condition, np.array([0.0, 0.0, 1.0]))
        middle = (condition.lower + condition.upper) / 2
        self._cone(condition, parent, (1.0, 0.0, 0.0), WORLD, (math.cos(middle), math.sin(middle), 0.0))

    def _inside(self, condition: Inside | InBall) -> None:
        scene, points = self.scene, _points(condition)
        self.geometries += points
        geometries = [*(scene.geometry(name) for name in condition.geometries), *points]
        for geometry in geometries:
            _check_way(condition, scene.joint_above, geometry.body, condition.of, f"{geometry.name} does not move against {condition.of}")
        self._zone(condition, condition.of, faces_of(condition), geometries, zone_reach(scene, condition))

    def _zone(self, condition: Condition, of: str, faces: Iterable[Face], geometries: Sequence[Geometry], reach: float) -> None:
        """Adds what geometries have to stay out of, so that they are within faces in the frame of a body."""
        frame = f"{MODEL}/{condition.name}/zone"
        self.above[frame] = Joint(frame, JointKind.WELD, of, frame, np.zeros(3), np.eye(4), np.eye(4))
        for i, (*normal, offset) in enumerate(faces):
            if offset >= reach:
                continue  # No geometry reaches this face.
            name = f"{MODEL}/{condition.name}/face{i}"
            vertices = _slab(np.array(normal), offset - ROOM * max(1.0, reach), FAR * reach - offset, FAR * reach)
            self.geometries.append(Geometry(name, frame, vertices, 0.0, {"kind": "condition"}))
            self.pairs += [Pair(*sorted((name, geometry.name)), padding=0.0) for geometry in geometries]

    def _distance(self, condition: Distance) -> None:
        scene, sides = self.scene, _sides(self.scene, condition)
        kept = {(pair.a, pair.b) for pair in scene.pairs}
        missing = next((pair for pair in product(*map(sorted, sides)) if tuple(sorted(pair)) not in kept), None)
        if missing or not all(sides):
            what = " and ".join(missing or (condition.a, condition.b))
            raise _wrong(condition, f"the scene does not certify {what} against each other")
        each = condition.metres / 2 * (1 + ROOM)
        self.padded = [
            replace(pair, padding=max(each, pair.padding if pair.padding is not None else scene.padding)) if _between(sides, pair) else pair
            for pair in self.padded
        ]


def _sides(scene: Scene, condition: Distance) -> tuple[set[str], set[str]]:
    """Returns the geometries of the one side, and those of the other, that have to keep a distance."""
    names = {one: {g.name for g in scene.geometries if one in (g.name, g.body, g.shape.get("of"))} for one in (condition.a, condition.b)}
    return names[condition.a], names[condition.b]


def _between(sides: tuple[set[str], set[str]], pair: Pair) -> bool:
    """Returns whether one geometry of a pair is on the one side, and the other on the other."""
    a, b = sides
    return (pair.a in a and pair.b in b) or (pair.a in b and pair.b in a)


def _slab(normal: Array, begin: float, depth: float, lateral: float) -> Array:
    """Returns the corners, (8, 3), of the box from ``begin`` along a direction on, as deep as ``depth``, and ``lateral`` to all sides."""
    normal = _unit(normal)
    first = _unit(np.cross(normal, np.eye(3)[np.argmax(np.abs(normal) < ALONG)]))
    across = first, np.cross(normal, first)
    x, y, z = CORNERS.T
    return np.outer(begin + depth * x, normal) + lateral * (np.outer(y, across[0]) + np.outer(z, across[1]))


def limit_of(geometry: Geometry) -> Array | None:
    """Returns the plane, (4,), that has what a condition allows on its positive side: x is allowed where plane @ [x, 1] >= 0, in metres.

    It is the face of a box of what the condition does not allow, in the frame of its body; None for any other geometry.
    """
    if not of_condition(geometry.name) or len(geometry.vertices) != len(CORNERS):
        return None
    near, far = geometry.vertices[:4].mean(axis=0), geometry.vertices[4:].mean(axis=0)
    normal = _unit(near - far)
    return np.array([*normal, -normal @ near])


def _unit(vector: Iterable[float]) -> Array:
    array = np.array(list(vector), dtype=float)
    return np.asarray(array / np.linalg.norm(array))


def _turned(X: Array) -> Array:
    """Returns a pose without its offset."""
    found = np.eye(4)
    found[:3, :3] = X[:3, :3]
    return found


def _path(above: Mapping[str, Joint], body: str, of: str) -> list[Joint]:
    """Returns the joints between two bodies, each of which ``above`` maps to the joint whose child it is."""

    def ways(start: str) -> list[Joint]:
        found = []
        while start in above:
            found.append(above[start])
            start = above[start].parent
        return found

    one, other = ways(body), ways(of)
    while one and other and one[-1] is other[-1]:
        one.pop()
        other.pop()
    return one + other


def _check_way(condition: Condition, above: Mapping[str, Joint], body: str, of: str, still: str) -> None:
    """Checks that a joint moves two bodies against each other, and that no two of one position do, which the verifier does not take."""
    moving = [joint for joint in _path(above, body, of) if joint.index is not None]
    if not moving:
        raise _wrong(condition, still)
    slides = len(moving) == 2 and all(joint.kind is JointKind.PRISMATIC for joint in moving)
    if len({joint.index for joint in moving}) < len(moving) and not slides:
        raise _wrong(condition, f"joints that move together are between {body} and {of}")


def _points(condition: Inside | InBall) -> list[Geometry]:
    """Returns what stands for the points of a condition."""
    names = (f"{MODEL}/{condition.name}/point{i}" for i in range(len(condition.points)))
    return [
        Geometry(name, body, np.array([point]), POINT, {"kind": "condition"})
        for name, (body, point) in zip(names, condition.points, strict=True)
    ]


def faces_of(condition: Inside | InBall) -> tuple[Face, ...]:
    """Returns the faces of a zone, as :class:`certifier.conditions.Inside` has them; those of a polytope in the ball for a ball."""
    if isinstance(condition, Inside):
        return condition.faces
    offsets = AROUND @ condition.center + COVERED * condition.radius
    return tuple((x, y, z, d) for (x, y, z), d in zip(AROUND.tolist(), offsets.tolist(), strict=True))


def _around() -> Array:
    """Returns 92 directions, (92, 3): the corners of an icosahedron, and the points that cut its triangles into nine each."""
    golden = (1 + math.sqrt(5)) / 2
    corners = np.array([np.roll([0.0, a, b * golden], k) for k in range(3) for a in (1, -1) for b in (1, -1)])
    found = [*corners]
    for i, j in combinations(range(12), 2):
        if corners[i] @ corners[j] > 0:  # an edge
            found += [(2 * corners[i] + corners[j]) / 3, (corners[i] + 2 * corners[j]) / 3]
            found += [(corners[i] + corners[j] + corners[k]) / 3 for k in range(j + 1, 12) if min(corners[[i, j]] @ corners[k]) > 0]
    return np.array([_unit(one) for one in found])


def zone_reach(scene: Scene, condition: Inside | InBall) -> float:
    """Returns a distance in metres from the origin of a zone's body that no point of its geometries exceeds."""
    geometries = [*(scene.geometry(name) for name in condition.geometries), *_points(condition)]
    return max(_reach(scene.joint_above, geometry, condition.of) for geometry in geometries)


def _reach(above: Mapping[str, Joint], geometry: Geometry, of: str) -> float:
    """Returns a distance in metres from a body's origin that no point of a geometry exceeds, as certifier.scene.tree.Tree.reach."""
    total = float(np.linalg.norm(geometry.vertices, axis=1).max()) + geometry.radius
    for joint in _path(above, geometry.body, of):
        slide = max(abs(joint.lower or 0.0), abs(joint.upper or 0.0)) * joint.speed
        total += float(np.linalg.norm(joint.X_PF[:3, 3])) + slide + float(np.linalg.norm(joint.X_BM[:3, 3]))
    return total * (1 + ROOM) + ROOM


def _wrong(condition: Condition, problem: str) -> SceneError:
    return SceneError(
        "condition",
        f"{escaped(condition.name)}: {problem}",
        field=f"conditions.{condition.name}",
        hint="docs/conditions.md says what conditions need",
    )


AROUND, COVERED = _around(), 0.9716
"""Directions of the faces of a polytope in a ball. Each direction has one of them so near that the cosine of the angle between the two is
above COVERED. So what is within COVERED of the radius along all of them is in the ball.
"""
