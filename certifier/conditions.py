"""Conditions beside collisions: what else has to hold at every configuration that is proved, such as a tool that stays upright.

This module has the data alone. :mod:`certifier.conditioned` says which pairs of geometries prove a condition.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass, field
from decimal import ROUND_CEILING, ROUND_FLOOR, Context
from typing import TYPE_CHECKING, Any, ClassVar

from certifier.names import is_name

if TYPE_CHECKING:  # The command reads scene files without numpy, which documents need.
    from certifier.document import Node

MODEL = "conditions"
"""Bodies and geometries that stand for conditions have names that begin with this and a slash."""
TURNING = "turning"
"""No condition has this name, which copies of bodies have that only turn."""
NAMED = f"needs a name without a slash, and other than {TURNING!r}"

DIGITS, NEARLY = 9, 1e-13
"""Statements give numbers to DIGITS digits, rounded to the safe side; a part NEARLY of a number is not seen."""

Vector = tuple[float, float, float]
_OF_A_BOX = ([1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1])
"""The normals of the faces of a box along the axes."""


def of_condition(name: str) -> bool:
    """Says whether a joint, a body or a geometry stands for a condition, by its name."""
    return name.startswith(f"{MODEL}/")


def is_condition_name(text: object) -> bool:
    """Returns whether a condition may have this name: as :func:`certifier.names.is_name`, without a slash, and not ``turning``."""
    return is_name(text) and "/" not in str(text) and text != TURNING


def condition_named(*names: str) -> str | None:
    """Returns the name of the condition that one of the geometries stands for; None where none does."""
    return next((name.split("/")[1] for name in names if of_condition(name)), None)


def called(a: str, b: str) -> str:
    """Returns what messages call a pair: its two geometries, or the condition that it proves."""
    condition = condition_named(a, b)
    return f"{a} and {b}" if condition is None else f"the condition '{condition}'"


def fails(a: str, b: str, how: str = "touch") -> str:
    """Returns in words that two geometries touch, or do whatever ``how`` says, or that the condition that they prove is not kept."""
    return f"{called(a, b)} {how if condition_named(a, b) is None else 'is not kept'}"


@dataclass(frozen=True)
class Cone:
    """A direction of a body stays within an angle of a direction of another body, or of the world.

    Attributes:
        axis: the direction in the frame of ``body``; a unit vector, as far as doubles go.
        along: the other direction, in the frame of ``of``, likewise.
        angle: radians, above 0 and below pi.
    """

    name: str
    body: str
    axis: Vector
    of: str
    along: Vector
    angle: float
    kind: ClassVar = "cone"

    def __str__(self) -> str:
        angle = f"{_up(math.degrees(self.angle))} degrees"
        return f"the direction {_shown(self.axis)} of '{self.body}' stays within {angle} of {_shown(self.along)} of '{self.of}'"


@dataclass(frozen=True)
class Staying:
    """What stays in a zone. The padding of the scene does not count for it.

    Attributes:
        geometries: their names.
        of: the body in whose frame the zone is, or the world.
        points: bodies, and a point of each in its frame, in metres.
    """

    name: str
    geometries: tuple[str, ...]
    of: str
    points: tuple[tuple[str, Vector], ...] = field(default=(), kw_only=True)

    @property
    def stay(self) -> str:
        """Returns who stays, in words."""
        named = [*map(repr, self.geometries), *(f"the point {_shown(point)} m of '{body}'" for body, point in self.points)]
        return f"{', '.join(named)} {'stays' if len(named) == 1 else 'stay'}"


@dataclass(frozen=True)
class Inside(Staying):
    """Geometries and points stay in a convex zone.

    Attributes:
        faces: the zone has x . (a, b, c) <= d for each (a, b, c, d), in metres; (a, b, c) is a unit vector, as far as doubles go.
    """

    faces: tuple[tuple[float, float, float, float], ...]
    kind: ClassVar = "inside"

    def __str__(self) -> str:
        if tuple(normal for *normal, _ in self.faces) == _OF_A_BOX:
            offsets = [d for *_, d in self.faces]
            lower, upper = (", ".join(side) for side in ([_down(-d) for d in offsets[3:]], [_up(d) for d in offsets[:3]]))
            box = f"in the box from ({lower}) to ({upper}) m"
            return f"{self.stay} {box}, in the frame of '{self.of}'"
        faces = ", ".join(f"{_shown(normal)} . x <= {_up(d)} m" for *normal, d in self.faces)
        return f"{self.stay} where {faces}, in the frame of '{self.of}'"


@dataclass(frozen=True)
class InBall(Staying):
    """Geometries and points stay in a ball.

    Attributes:
        center: metres, in the frame of ``of``.
        radius: metres.
    """

    center: Vector
    radius: float
    kind: ClassVar = "ball"

    def __str__(self) -> str:
        return f"{self.stay} in the ball of {_up(self.radius)} m about {_shown(self.center)}, in the frame of '{self.of}'"


@dataclass(frozen=True)
class Distance:
    """Two bodies, or geometries, keep a distance in metres."""

    name: str
    a: str
    b: str
    metres: float
    kind: ClassVar = "distance"

    def __str__(self) -> str:
        return f"'{self.a}' and '{self.b}' stay at least {_down(self.metres)} m apart"


@dataclass(frozen=True)
class Summed:
    """A sum of joint positions that stays between two numbers.

    Attributes:
        joints: the joints, and 1 or -1 for each.
        lower, upper: radians or metres.
    """

    name: str
    joints: tuple[tuple[str, int], ...]
    lower: float
    upper: float

    @property
    def total(self) -> str:
        """Returns the sum, in words."""
        return " ".join(f"{'+' if sign > 0 else '-'} '{joint}'" for joint, sign in self.joints).removeprefix("+ ")


@dataclass(frozen=True)
class Range(Summed):
    """The sum of the angles of joints, each with its sign, stays between two angles, less than a whole turn apart, but for whole turns."""

    kind: ClassVar = "range"

    def __str__(self) -> str:
        lower, upper = _down(math.degrees(self.lower)), _up(math.degrees(self.upper))
        return f"{self.total} stays from {lower} to {upper} degrees, but for whole turns"


@dataclass(frozen=True)
class SlideRange(Summed):
    """The sum of the positions of joints that slide, each with its sign, stays between two numbers, in metres."""

    kind: ClassVar = "slides"

    def __str__(self) -> str:
        return f"{self.total} stays from {_down(self.lower)} to {_up(self.upper)} m"


Condition = Cone | Inside | InBall | Distance | Range | SlideRange
_READ: dict[str, tuple[tuple[str, ...], Callable[[dict[str, Node]], Condition]]] = {
    Cone.kind: (
        ("name", "body", "axis", "of", "along", "angle"),
        lambda f: Cone(_text(f, "name"), _text(f, "body"), _vector(f["axis"]), _text(f, "of"), _vector(f["along"]), _number(f["angle"])),
    ),
    Inside.kind: (
        ("name", "geometries", "of", "faces"),
        lambda f: Inside(_text(f, "name"), _names(f), _text(f, "of"), _faces(f["faces"]), points=_points(f)),
    ),
    InBall.kind: (
        ("name", "geometries", "of", "center", "radius"),
        lambda f: InBall(_text(f, "name"), _names(f), _text(f, "of"), _vector(f["center"]), _number(f["radius"]), points=_points(f)),
    ),
    Distance.kind: (
        ("name", "a", "b", "metres"),
        lambda f: Distance(_text(f, "name"), _text(f, "a"), _text(f, "b"), _number(f["metres"])),
    ),
    Range.kind: (
        ("name", "joints", "lower", "upper"),
        lambda f: Range(_text(f, "name"), _signed(f["joints"]), _number(f["lower"]), _number(f["upper"])),
    ),
    SlideRange.kind: (
        ("name", "joints", "lower", "upper"),
        lambda f: SlideRange(_text(f, "name"), _signed(f["joints"]), _number(f["lower"]), _number(f["upper"])),
    ),
}


def to_document(condition: Condition) -> dict[str, Any]:
    """Returns a condition as JSON-able data. Points are there if there are some: scenes had conditions before they had points."""
    given = {name: _plain(value) for name, value in asdict(condition).items() if name != "points" or value}
    return {"kind": condition.kind, **given}


def from_document(node: Node) -> Condition:
    """Returns the condition that :func:`to_document` has described.

    Raises:
        CirisError: document.
    """
    kind = node.value.get("kind") if isinstance(node.value, dict) else None
    if not isinstance(kind, str) or kind not in _READ:
        node.refuse(f"a condition, whose kind is one of {', '.join(_READ)}")
    fields, read = _READ[kind]
    return read(node.fields("kind", *fields, optional=("points",) if "geometries" in fields else ()))


def _plain(value: Any) -> Any:
    return [_plain(one) for one in value] if isinstance(value, tuple) else value


def _shown(vector: Iterable[float]) -> str:
    """Returns a direction with all digits of its doubles."""
    return f"({', '.join(f'{x:g}' if x == int(x) else repr(x) for x in (y + 0.0 for y in vector))})"


def _up(x: float) -> str:
    """Returns a number, to nine digits, that is no smaller but for what certifier.conditioned.ROOM covers."""
    return _rounded(x - NEARLY * abs(x), ROUND_CEILING)


def _down(x: float) -> str:
    """Returns a number, to nine digits, that is no larger but for what certifier.conditioned.ROOM covers."""
    return _rounded(x + NEARLY * abs(x), ROUND_FLOOR)


def _rounded(x: float, how: str) -> str:
    found = Context(prec=DIGITS, rounding=how).create_decimal(x)
    return f"{found.normalize() + 0:f}"


def _text(fields: dict[str, Node], name: str) -> str:
    return fields[name].text()


def _number(node: Node) -> float:
    return float(node.number())


def _vector(node: Node) -> Vector:
    x, y, z = node.array(3).tolist()
    return x, y, z


def _names(fields: dict[str, Node]) -> tuple[str, ...]:
    return tuple(one.text() for one in fields["geometries"].items())


def _points(fields: dict[str, Node]) -> tuple[tuple[str, Vector], ...]:
    pairs = [one.two() for one in fields["points"].items()] if "points" in fields else []
    return tuple((body.text(), _vector(point)) for body, point in pairs)


def _faces(node: Node) -> tuple[tuple[float, float, float, float], ...]:
    return tuple(tuple(face) for face in node.array(None, 4).tolist())


def _signed(node: Node) -> tuple[tuple[str, int], ...]:
    found = []
    for one in node.items():
        joint, sign = one.two()
        if type(sign.value) is not int or sign.value not in (1, -1):
            sign.refuse("1 or -1")
        found.append((joint.text(), int(sign.value)))
    return tuple(found)
