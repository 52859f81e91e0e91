"""Joints that are swept: in the place of each body behind them stands a body that contains it at all their positions.

A joint that is swept, and those that are coupled to it, become welds. What hangs on them is replaced by the hull of its places.

A slide moves a point on a segment, whose ends are enough. A turn moves it on an arc. An arc of the angle 2h from x to y lies in the
triangle of x, y and the point where the tangents at x and y meet, which is 1/cos h as far from the axis. So arcs are divided into parts of
at most ARC, and each point becomes the corners of these triangles. Behind several joints this is done for one after the other, from the
body to the world. Where joints follow the same one, this is done for PARTS of its range, as otherwise each would count at all positions of
the others.

Last, the hull is made larger by SLACK on all sides.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import ConvexHull

from certifier.errors import SceneError
from certifier.kinematics import rigid_inverse, rotation
from certifier.model import Array, Geometry, Joint, JointKind
from certifier.scene.hull import hull_vertices, nearest_in_hull, outer, thickened
from certifier.scene.joints import EXACT, Coupling, by_full_name, narrowed, range_of
from certifier.scene.shapes import ellipsoid
from certifier.scene.tree import Tree, turned

ARC = 0.1
"""Arcs are divided into parts of at most this many radians."""
PARTS = 8
SAMPLES = 9
"""The inflation is measured from the places at this many positions of each joint that is named."""
SLACK = 1e-11
"""Bodies are larger by this part of the farthest distance from an origin: far more than the rounding errors of moving points."""
ROUNDING = 1e-9
"""Inflations are larger by this part, and by as many metres, than the distances that are computed."""


@dataclass(frozen=True)
class Sweep:
    """A joint that is swept: its position is ``factor`` times that of the joint ``leader``, plus ``offset``, in radians or metres.

    Attributes:
        joint: as in the model.
        lower, upper: between these the leader moves.
    """

    joint: Joint
    leader: str
    factor: float
    offset: float
    lower: float
    upper: float

    def at(self, position: float) -> float:
        """Returns the joint's position at one of the leader."""
        return self.factor * position + self.offset

    @property
    def middle(self) -> float:
        """Returns the position at which the joint becomes a weld."""
        return self.at((self.lower + self.upper) / 2)


Limits = Mapping[str, tuple[float, float]]
"""Narrower limits by joint, as a scene file has them."""


def sweeps_of(joints: Sequence[Joint], names: Sequence[str], limits: Limits, couplings: Sequence[Coupling]) -> dict[str, Sweep]:
    """Returns the joints that are swept, by their full names: the named ones, over all of their range, and those coupled to them.

    Raises:
        SceneError: ``unknown_name``; ``joint_range`` for a range that is not finite; ``scene_field`` where a coupled joint leaves its
            limits, where two of those that are coupled are named, or for one that its model holds.
    """
    by_name = {joint.name: joint for joint in joints if joint.index is not None}
    still = {name for coupling in couplings if len(coupling.factors) == 1 for name in coupling.factors}
    found = {}
    for name in by_full_name(dict.fromkeys(names), by_name, "fix"):
        if name in still:
            message = f"joint {name} mimics another one with the multiplier 0, so it does not move, and cannot be swept"
            raise SceneError("scene_field", message, field=f"fix.{name}", hint="leave it out of fix")
        (joint,) = narrowed([by_name[name]], _limits_of(limits, name, by_name))
        lower, upper = range_of(joint)
        if not np.isfinite([lower, upper]).all():
            message = f"joint {name} has no finite limits, so it cannot be swept"
            raise SceneError("joint_range", message, field=f"fix.{name}", hint=f"give it some by limits: {{{name}: [LOWER, UPPER]}}")
        found[name] = Sweep(by_name[name], name, 1.0, 0.0, lower, upper)
    waiting = [coupling for coupling in couplings if len(coupling.factors) == 2]
    while followed := next((c for c in waiting if any(name in found for name in c.factors)), None):
        waiting.remove(followed)
        leaders = [name for name in followed.factors if name in found]
        if len(leaders) == 2:
            message = f"joints {' and '.join(leaders)} are coupled (mimic), and both are swept"
            raise SceneError("scene_field", message, field="fix", hint="name one of them; the other follows")
        (leader,), (follower,) = leaders, [name for name in followed.factors if name not in found]
        found[follower] = _follower(by_name[follower], found[leader], followed)
    return found


def _limits_of(limits: Limits, name: str, names: Collection[str]) -> Limits:
    """Returns those of the limits that concern a joint, which may be named without its model where no other of the names ends so."""
    short = name.rsplit("/", 1)[-1]
    alone = [other.rsplit("/", 1)[-1] for other in names].count(short) == 1
    return {key: limit for key, limit in limits.items() if key == name or (key == short and alone)}


def others_of(limits: Limits, sweeps: Mapping[str, Sweep], joints: Sequence[Joint]) -> Limits:
    """Returns the limits without those of joints that are named as swept."""
    names = [joint.name for joint in joints if joint.index is not None]
    leaders = {sweep.leader for sweep in sweeps.values()}
    own = {key for leader in leaders for key in _limits_of(limits, leader, names)}
    return {key: limit for key, limit in limits.items() if key not in own}


def _follower(joint: Joint, sweep: Sweep, coupling: Coupling) -> Sweep:
    of_leader, own = coupling.factors[sweep.joint.name], coupling.factors[joint.name]
    factor, offset = -of_leader * sweep.factor / own, (coupling.constant - of_leader * sweep.offset) / own
    found = replace(sweep, joint=joint, factor=factor, offset=offset)
    ends = sorted((found.at(sweep.lower), found.at(sweep.upper)))
    lower, upper = range_of(joint)
    if ends[0] < lower - EXACT or ends[1] > upper + EXACT:
        limits = f"its limits are {lower:.9g} and {upper:.9g} {joint.unit}"
        message = f"joint {joint.name} follows {sweep.leader} from {ends[0]:.9g} to {ends[1]:.9g} {joint.unit}, and {limits}"
        hint = f"give {sweep.leader} narrower limits: limits: {{{sweep.leader}: [LOWER, UPPER]}}"
        raise SceneError("scene_field", message, field=f"fix.{sweep.leader}", hint=hint)
    return found


class Sweeper:
    """Makes the bodies that stand for geometries behind joints that are swept.

    Args:
        tree: its joints that are swept are welds at :attr:`Sweep.middle`.
        max_vertices: such a body has at most this many vertices.

    Raises:
        SceneError: ``unsupported_joint`` for a joint that moves behind one that is swept.
    """

    def __init__(self, tree: Tree, sweeps: Mapping[str, Sweep], max_vertices: int) -> None:
        above = {joint.child: joint for joint in tree.joints}
        self._chains = {body: _Chain(body, above, sweeps) for body in tree.bodies}
        self._max_vertices = max_vertices

    def around(self, geometry: Geometry) -> Geometry:
        """Returns a body that contains the geometry at all positions of the joints that are swept; the geometry itself without any.

        Raises:
            SceneError: ``hull``, as :func:`certifier.scene.hull.outer`.
        """
        return _swept(geometry, self._chains[geometry.body], self._max_vertices)

    def check_half_space(self, name: str, body: str) -> None:
        """Refuses a half-space behind a joint that is swept: its part within the robot's reach is not the same at all positions.

        Raises:
            SceneError: ``unsupported_shape``.
        """
        if self._chains[body].steps:
            message = f"geometry {name} is a half-space behind a joint that is swept"
            raise SceneError("unsupported_shape", message, field="directives", hint="use a box, or hold the joint by fix")


def said_of(sweeps: Mapping[str, Sweep]) -> list[str]:
    """Returns sentences for people about the joints that are swept."""
    found = []
    for leader in dict.fromkeys(sweep.leader for sweep in sweeps.values()):
        of_it = [sweep for sweep in sweeps.values() if sweep.leader == leader]
        others = [sweep.joint.name for sweep in of_it if sweep.joint.name != leader]
        following = f", and with it {', '.join(others)}" if others else ""
        unit = of_it[0].joint.unit
        found.append(
            f"joint {leader} is swept from {of_it[0].lower:.9g} to {of_it[0].upper:.9g} {unit}{following}: what hangs on it counts at all "
            "positions at once, and its frames are those at the middle; it makes no pair with what it is mounted on, nor with what else is "
            "mounted there without a joint that moves"
        )
    return found


class _Chain:
    """The swept joints between a body and the world, the nearest one first, with the poses at which they are welds."""

    def __init__(self, body: str, above: Mapping[str, Joint], sweeps: Mapping[str, Sweep]) -> None:
        self.steps: list[tuple[Sweep, Joint, Array]] = []
        X, moved = np.eye(4), ""
        while body in above:
            joint = above[body]
            if joint.name in sweeps:
                if moved:
                    message = f"joint {moved} moves, and it is behind joint {joint.name}, which is swept"
                    raise SceneError("unsupported_joint", message, field=f"fix.{joint.name}", hint=f"hold or sweep {moved} as well, by fix")
                sweep = sweeps[joint.name]
                oriented = sweep.joint if sweep.joint.child == body else turned(sweep.joint)
                # The pose of the body in the frame M of the joint, in which the joint moves it.
                self.steps.append((sweep, oriented, rigid_inverse(oriented.X_BM) @ X))
            if joint.index is not None:
                moved = moved or joint.name
            X = joint.X_PF @ rigid_inverse(joint.X_BM) @ X
            body = joint.parent

    def around(self, points: Array) -> Array:
        """Returns points whose hull contains the points (k, 3), in the body's frame, at all positions."""
        shared = Counter(sweep.leader for sweep, *_ in self.steps)
        leaders = {sweep.leader: (sweep.lower, sweep.upper) for sweep, *_ in self.steps}
        ends = {name: np.linspace(*between, 1 + (PARTS if shared[name] > 1 else 1)) for name, between in leaders.items()}
        found = []
        for parts in itertools.product(*(itertools.pairwise(ends[name].tolist()) for name in leaders)):
            part, moved = dict(zip(leaders, parts, strict=True)), points
            for sweep, joint, X in self.steps:
                lower, upper = sorted(sweep.at(end) - sweep.middle for end in part[sweep.leader])
                moved = hull_vertices(_back(X, _moved(joint, _placed(X, moved), lower, upper)))
            found.append(moved)
        return hull_vertices(np.concatenate(found))

    def reach(self, points: Array) -> float:
        """Returns a length, in metres, that the points (k, 3), moved, are no farther away than from the origin of any frame on the way."""
        ways = (2 * np.linalg.norm(X[:3, 3]) + abs(sweep.at(sweep.upper) - sweep.at(sweep.lower)) for sweep, _, X in self.steps)
        return 1.1 * float(np.linalg.norm(points, axis=1).max() + sum(ways))

    def places(self, points: Array) -> Array:
        """Returns the points (k, 3), in the body's frame, at some of the positions, the ends of all ranges among them."""
        leaders = {sweep.leader: np.linspace(sweep.lower, sweep.upper, SAMPLES) for sweep, *_ in self.steps}
        found = []
        for positions in itertools.product(*leaders.values()):
            at, moved = dict(zip(leaders, positions, strict=True)), points
            for sweep, joint, X in self.steps:
                offset = sweep.at(float(at[sweep.leader])) - sweep.middle
                moved = _back(X, _moved_by(joint, _placed(X, moved), offset))
            found.append(moved)
        return np.concatenate(found)


def _swept(geometry: Geometry, chain: _Chain, max_vertices: int) -> Geometry:
    if not chain.steps:
        return geometry
    names = ", ".join(sweep.joint.name for sweep, *_ in chain.steps)
    points, radius = chain.around(geometry.vertices), geometry.radius
    if radius and len(points) > 2:  # nothing but balls and capsules has a radius
        ball = ellipsoid((radius, radius, radius), max_vertices)
        points, radius = hull_vertices((points[:, None] + ball.vertices).reshape(-1, 3)), 0.0
    slack = SLACK * chain.reach(geometry.vertices)
    if radius:
        vertices, radius = points, radius + slack
    else:
        vertices, _, _ = outer(_grown(points, slack), max_vertices)
    places = hull_vertices(chain.places(geometry.vertices))
    reaches = max(nearest_in_hull(vertex, places)[1] for vertex in vertices)
    inflation = geometry.inflation + (1 + ROUNDING) * (reaches + radius - geometry.radius) + ROUNDING
    before = geometry.substitution or geometry.shape["kind"]
    substitution = f"{before} -> hull of {len(vertices)} vertices around all positions of {names}"
    return replace(geometry, vertices=vertices, radius=radius, substitution=substitution, inflation=inflation)


def _grown(points: Array, slack: float) -> Array:
    """Returns points whose hull contains all balls of the radius ``slack``, in metres, about the points of the hull of points (k, 3)."""
    points = thickened(points)
    middle = points.mean(axis=0)
    depth = float(-ConvexHull(points - middle).equations[:, 3].max())
    return middle + (1 + slack / depth) * (points - middle)


def _moved(joint: Joint, points: Array, lower: float, upper: float) -> Array:
    """Returns points whose hull contains the points (k, 3), in the joint's frame M, moved by all positions between two."""
    if joint.kind is JointKind.PRISMATIC:
        return np.concatenate([_moved_by(joint, points, end) for end in (lower, upper)])
    ends = np.linspace(lower, upper, 1 + max(1, int(np.ceil((upper - lower) / ARC))))
    along = (points @ joint.axis)[:, None] * joint.axis
    wide = along + (points - along) / np.cos((ends[1] - ends[0]) / 2)
    arcs = [_moved_by(joint, points, end) for end in ends]
    return np.concatenate([*arcs, *(_moved_by(joint, wide, middle) for middle in (ends[1:] + ends[:-1]) / 2)])


def _moved_by(joint: Joint, points: Array, position: float) -> Array:
    """Returns the points (k, 3), in the joint's frame M, moved by a position."""
    if joint.kind is JointKind.PRISMATIC:
        return points + position * joint.axis
    found: Array = points @ rotation(joint.axis, position).T
    return found


def _placed(X: Array, points: Array) -> Array:
    found: Array = points @ X[:3, :3].T + X[:3, 3]
    return found


def _back(X: Array, points: Array) -> Array:
    found: Array = (points - X[:3, 3]) @ X[:3, :3]
    return found
