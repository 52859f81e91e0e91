"""What a scene file says of conditions is read here, and becomes conditions of its scene."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

from certifier.conditions import NAMED, Condition, Cone, Distance, InBall, Inside, Range, SlideRange, is_condition_name
from certifier.errors import SceneError
from certifier.scene import fields
from certifier.scene.known import check_known, names_of

if TYPE_CHECKING:  # The command reads scene files without numpy, which the model needs.
    from certifier.model import Scene

WORLD = "world"
KEYS: Mapping[str, tuple[str, ...]] = {
    Cone.kind: ("body", "axis", "along", "of", "degrees"),
    Inside.kind: ("what", "of", "box", "half_spaces", "ball"),
    Distance.kind: ("between", "metres"),
    Range.kind: ("joints", "degrees", "metres"),
}
"""The kinds of conditions, and what each is about."""


ZONES = ("box", "half_spaces", "ball")
"""The kinds of zones."""


@dataclass(frozen=True)
class ConditionEntry:
    """Holds what a scene file says of a condition, by the keys of its kind; ``field`` is where."""

    name: str
    kind: str
    said: Mapping[str, Any]
    field: str


def read_conditions(value: Any) -> tuple[ConditionEntry, ...]:
    """Returns the conditions of a scene file, whose names of bodies and joints nobody has looked up yet.

    Raises:
        SceneError: ``scene_field``.
    """
    if not isinstance(value, list):
        raise fields.wrong("conditions", "must be a list of conditions, each with a name and one of " + ", ".join(KEYS))
    found: list[ConditionEntry] = []
    for i, entry in enumerate(value):
        where = f"conditions[{i}]"
        given = fields.section(entry, where, ("name", *KEYS))
        if "name" not in given:
            raise fields.wrong(f"{where}.name", "is missing", hint="give each condition a name, which statements use")
        name = fields.name(given["name"], f"{where}.name")
        if not is_condition_name(name):
            raise fields.wrong(f"{where}.name", NAMED)
        kinds = [kind for kind in KEYS if kind in given]
        if len(kinds) != 1:
            raise fields.wrong(where, f"must have one of {', '.join(KEYS)}")
        if name in {one.name for one in found}:
            raise fields.wrong(f"{where}.name", f"{name} is the name of another condition", hint="give each its own name")
        place = f"{where}.{kinds[0]}"
        found.append(ConditionEntry(name, kinds[0], fields.section(given[kinds[0]], place, KEYS[kinds[0]]), place))
    return tuple(found)


def constrained(scene: Scene, entries: Sequence[ConditionEntry], swept: Collection[str] = ()) -> Scene:
    """Returns a scene with the conditions that it has, and with these, and with a warning about those that nothing keeps.

    Args:
        swept: joints that are swept. Geometries behind them stand for all of their places, but frames are in the middle.

    Raises:
        SceneError: ``scene_field``; ``unknown_name``, for a body, a geometry or a joint that the scene does not have; ``condition``.
    """
    from certifier.conditioned import with_conditions, without_conditions
    from certifier.scene.exclusions import exclusions

    base, own = without_conditions(scene), {one.name for one in scene.conditions}
    for i, entry in enumerate(entries):
        if entry.name in own:
            problem = f"{entry.name} is the name of a condition that the scene has"
            raise fields.wrong(f"conditions[{i}].name", problem, hint="give each its own name")
    try:
        made = with_conditions(base, [*scene.conditions, *(condition(entry, base, swept) for entry in entries)])
    except SceneError as error:
        error.field = {f"conditions.{entry.name}": entry.field for entry in entries}.get(error.field or "", error.field)
        raise
    return replace(made, warnings=tuple(dict.fromkeys([*scene.warnings, *exclusions(made)])))


def swept_in(scene: Scene) -> Collection[str]:
    """Returns the joints of a scene that are swept.

    Raises:
        SceneError: ``condition``, where some are, in a scene that was read before their names were kept.
    """
    known: list[str] | None = scene.provenance.get("swept")
    if known is None and any(" is swept from " in warning for warning in scene.warnings):
        hint = "write the conditions into the scene file, and add it"
        raise SceneError("condition", "the scene has a joint that is swept, and its name was not kept", field="conditions", hint=hint)
    return known or ()


def condition(entry: ConditionEntry, scene: Scene, swept: Collection[str]) -> Condition:
    """Returns the condition that an entry describes.

    Raises:
        SceneError: ``scene_field``; ``unknown_name``, for a body, a geometry or a joint that the scene does not have.
    """
    said, where = entry.said, entry.field
    match entry.kind:
        case Cone.kind:
            axis, along = (_direction(said.get(key), f"{where}.{key}") for key in ("axis", "along"))
            angle = math.radians(fields.number(said.get("degrees"), f"{where}.degrees", minimum=0.0))
            body, of = _body(said.get("body"), f"{where}.body", scene), _body(said.get("of", WORLD), f"{where}.of", scene)
            for key, name in (("body", body), ("of", of)):
                _check_not_swept(name, f"{where}.{key}", scene, swept)
            return Cone(entry.name, body, axis, of, along, angle)
        case Inside.kind:
            what = said.get("what")
            if not isinstance(what, list) or not what:
                hint = "a point of a body is {body: arm/hand, point: [0, 0, 0.1]}"
                raise fields.wrong(f"{where}.what", "must be a list of bodies, geometries or points, such as [arm/hand]", hint=hint)
            of = _body(said.get("of", WORLD), f"{where}.of", scene)
            _check_not_swept(of, f"{where}.of", scene, swept)
            kept = [(one, f"{where}.what[{i}]") for i, one in enumerate(what)]
            points = tuple(_point_of(one, place, scene, swept) for one, place in kept if isinstance(one, dict))
            named = dict.fromkeys(name for one, place in kept if not isinstance(one, dict) for name in _geometries(one, place, scene))
            if [key in said for key in ZONES].count(True) != 1:
                raise fields.wrong(where, f"must have one of {', '.join(ZONES)}")
            if "ball" in said:
                ball = fields.section(said["ball"], f"{where}.ball", ("center", "radius"))
                radius = fields.number(ball.get("radius"), f"{where}.ball.radius", minimum=0.0)
                return InBall(entry.name, tuple(named), of, _point(ball.get("center"), f"{where}.ball.center"), radius, points=points)
            zone = _zone(said, where)
            _check_room(zone, where)
            return Inside(entry.name, tuple(named), of, zone, points=points)
        case Distance.kind:
            between = said.get("between")
            if not isinstance(between, list) or len(between) != 2:
                raise fields.wrong(f"{where}.between", "must be two names of bodies or geometries, [a, b]")
            for i, one in enumerate(between):
                _geometries(one, f"{where}.between[{i}]", scene)
            a, b = between
            return Distance(entry.name, a, b, fields.number(said.get("metres"), f"{where}.metres", minimum=0.0))
    joints = said.get("joints")
    if not isinstance(joints, dict) or not joints:
        raise fields.wrong(f"{where}.joints", "must map joints to 1 or -1, as in {arm/elbow: 1}")
    signed = tuple((_joint(name, f"{where}.joints", scene), _sign(sign, f"{where}.joints.{name}")) for name, sign in joints.items())
    if ("degrees" in said) == ("metres" in said):
        raise fields.wrong(where, "must have either degrees, for joints that turn, or metres, for joints that slide")
    unit = "degrees" if "degrees" in said else "metres"
    if not isinstance(said[unit], list) or len(said[unit]) != 2:
        raise fields.wrong(f"{where}.{unit}", f"must be two numbers in {unit}, [lower, upper]")
    lower, upper = (fields.number(x, f"{where}.{unit}[{i}]") for i, x in enumerate(said[unit]))
    if unit == "metres":
        return SlideRange(entry.name, signed, lower, upper)
    return Range(entry.name, signed, math.radians(lower), math.radians(upper))


def _point_of(value: Any, where: str, scene: Scene, swept: Collection[str]) -> tuple[str, tuple[float, float, float]]:
    """Returns a body, and a point in its frame."""
    said = fields.section(value, where, ("body", "point"))
    body = _body(said.get("body"), f"{where}.body", scene)
    _check_not_swept(body, f"{where}.body", scene, swept)
    return body, _point(said.get("point"), f"{where}.point")


def _check_not_swept(body: str, where: str, scene: Scene, swept: Collection[str]) -> None:
    """Refuses a body behind a joint that is swept, whose directions and frame nobody knows."""
    above = scene.joint_above
    while body in above:
        if above[body].name in swept:
            hint = f"leave {above[body].name} out of fix, or hold it at a position"
            raise fields.wrong(where, f"is behind the joint {above[body].name}, which is swept", hint=hint)
        body = above[body].parent


def _direction(value: Any, where: str) -> tuple[float, float, float]:
    """Returns three numbers, divided by the length of the vector."""
    if not isinstance(value, list) or len(value) != 3:
        raise fields.wrong(where, "must be a direction, [x, y, z]")
    x, y, z = (fields.number(one, f"{where}[{i}]") for i, one in enumerate(value))
    length = math.hypot(x, y, z)
    if not length > 1e-6:
        raise fields.wrong(where, "must be a direction, which is longer than 0")
    return x / length, y / length, z / length


def _zone(said: Mapping[str, Any], where: str) -> tuple[tuple[float, float, float, float], ...]:
    """Returns the faces of a box, or the half-spaces themselves. A list that is too long is refused before any of it is read."""
    from certifier.conditioned import MOST_FACES

    if "box" in said:
        box = fields.section(said["box"], f"{where}.box", ("lower", "upper"))
        lower, upper = (_point(box.get(key), f"{where}.box.{key}") for key in ("lower", "upper"))
        if not all(a < b for a, b in zip(lower, upper, strict=True)):
            raise fields.wrong(f"{where}.box", "must have an interior: each number of lower is less than that of upper")
        axes = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
        above = [(*axis, x) for axis, x in zip(axes, upper, strict=True)]
        return (*above, *((-a, -b, -c, -x) for (a, b, c), x in zip(axes, lower, strict=True)))
    rows = said["half_spaces"]
    if not isinstance(rows, list) or not 1 <= len(rows) <= MOST_FACES:
        what = f"must be a list of 1 to {MOST_FACES} half-spaces [a, b, c, d], each for a x + b y + c z <= d"
        raise fields.wrong(f"{where}.half_spaces", what)
    found = []
    for i, row in enumerate(rows):
        place = f"{where}.half_spaces[{i}]"
        if not isinstance(row, list) or len(row) != 4:
            raise fields.wrong(place, "must be four numbers, [a, b, c, d]")
        normal = _direction(row[:3], place)
        found.append((*normal, fields.number(row[3], f"{place}[3]") / math.hypot(*row[:3])))
    return tuple(found)


def _check_room(zone: Sequence[tuple[float, float, float, float]], where: str) -> None:
    """Refuses faces between which nothing is."""
    from certifier.scene.exclusions import room_in

    if room_in(zone) <= 0:
        raise fields.wrong(f"{where}.half_spaces", "leave no room between them", hint="each says a x + b y + c z <= d")


def _point(value: Any, where: str) -> tuple[float, float, float]:
    if not isinstance(value, list) or len(value) != 3:
        raise fields.wrong(where, "must be a point in metres, [x, y, z]")
    x, y, z = (fields.number(one, f"{where}[{i}]") for i, one in enumerate(value))
    return x, y, z


def _body(value: Any, where: str, scene: Scene) -> str:
    name = fields.string(value, where)
    if scene.has_geometry(name):
        raise fields.wrong(where, f"{name} is a geometry, and a body is needed", hint=f"name its body, {scene.geometry(name).body}")
    check_known(name, scene.bodies, where)
    return name


def _geometries(value: Any, where: str, scene: Scene) -> list[str]:
    """Returns the geometries that a name means: one, the parts of a mesh, or all of a body."""
    name = fields.string(value, where)
    found = [geometry.name for geometry in scene.geometries if name in names_of(geometry)]
    if not found:
        check_known(name, [known for geometry in scene.geometries for known in names_of(geometry)], where)
    return found


def _joint(value: Any, where: str, scene: Scene) -> str:
    name, known = fields.string(value, where), [joint.name for joint in scene.moving]
    if name not in known:
        raise SceneError("unknown_name", f"{name!r} is no joint that moves", field=where, hint=f"joints: {', '.join(known)}")
    return name


def _sign(value: Any, where: str) -> int:
    if value not in (1, -1) or isinstance(value, bool):
        raise fields.wrong(where, f"must be 1 or -1, not {value!r}")
    return int(value)
