"""These are the service's answers, as frozen data with numpy arrays. An answer that says yes is true, and every other one is false.

q are joint positions in radians or metres, and s are tangent-space coordinates (:class:`ciris.space.Space`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from datetime import datetime
from typing import Self, TypeVar, overload

import numpy as np
from numpy.typing import NDArray

from certifier.outcome import Guarantee, Outcome
from certifier.words import counted
from ciris.documents import Document
from ciris.space import Array, Straight

T = TypeVar("T", covariant=True)


class Answers(Sequence[T]):
    """One answer for each point or motion of a question, in order. It is true only if every one of them is."""

    def __init__(self, items: Sequence[T], version: int, regions: int) -> None:
        self._items = tuple(items)
        self.version = version
        """How often a region of the scene had been added or deleted. Answers with the same version are about the same regions."""
        self.regions = regions
        """How many regions the scene has."""

    @overload
    def __getitem__(self, index: int) -> T: ...
    @overload
    def __getitem__(self, index: slice) -> Self: ...
    def __getitem__(self, index: int | slice) -> T | Self:
        return type(self)(self._items[index], self.version, self.regions) if isinstance(index, slice) else self._items[index]

    def __len__(self) -> int:
        return len(self._items)

    def __iter__(self) -> Iterator[T]:
        return iter(self._items)

    def __bool__(self) -> bool:
        return all(self._items)

    def __repr__(self) -> str:
        return f"{type(self).__name__}({sum(map(bool, self._items))} of {len(self._items)}, about {counted(self.regions, 'region')})"


@dataclass(frozen=True)
class UncoveredBodies:
    """Two bodies with pairs of geometries that no proof is about."""

    a: str
    b: str
    pairs: int
    """How many pairs of their geometries."""
    why: str
    """``neighbours`` where a joint joins them, ``filtered`` by the model, or ``ignored`` by the scene file."""
    reason: str | None
    """The reason in the scene file; None for pairs that it does not ignore."""


@dataclass(frozen=True)
class NotCovered:
    """The pairs of geometries that can move against each other and are in no proof about the scene."""

    pairs: int
    """How many there are."""
    bodies: tuple[UncoveredBodies, ...]
    """They by their bodies; the first thousand."""
    summary: str
    """A sentence for people."""

    def __str__(self) -> str:
        return self.summary


@dataclass(frozen=True)
class Hit:
    """A region that contains a point."""

    region: str
    """Id of the region."""
    margin: float
    """Distance in s from the point to the nearest face."""
    guarantee: Guarantee


@dataclass(frozen=True)
class Contained:
    """What proves one point free: regions, tubes of motions, or the scene's latest map. It is true if something does."""

    inside: bool
    regions: tuple[Hit, ...]
    """The regions that contain the point, the one with the largest margin first."""
    margin: float | None
    """The largest margin, in s; None where no region contains the point."""
    motions: tuple[str, ...]
    """Ids of the proved motions whose tubes contain the point."""
    map: bool | None
    """Whether the scene's latest map proves the point free; None where the scene has no map."""

    def __bool__(self) -> bool:
        return self.inside


class Containment(Answers[Contained]):
    """What proves each of k points free. It is true only if something proves every point."""

    @property
    def inside(self) -> NDArray[np.bool_]:
        """(k,) whether some region, the tube of some motion, or the scene's latest map proves the point free."""
        return np.array([point.inside for point in self])

    @property
    def margin(self) -> Array:
        """(k,) the largest distance in s to the nearest face of a region around the point; NaN outside."""
        return np.array([np.nan if point.margin is None else point.margin for point in self])


@dataclass(frozen=True, eq=False)
class Near:
    """A region near a point, or the map, and its point that is nearest."""

    region: str | None
    """Id of the region; None for the map."""
    guarantee: Guarantee
    distance: float
    """Euclidean distance in s, 0 inside."""
    q: Array
    """(n,) the nearest point of the region or the map."""
    s: Array
    """(n,) the same point in s."""
    map: str | None = None
    """Id of the job that has grown the map; None for a region."""
    complete: bool = True
    """Whether nothing nearer is proved. False where the search in the map ended early, after much work."""


class Nearest(Answers[Near | None]):
    """What is proved nearest to each of k points, by a region or the map; None where nothing was found, or a joint is beyond its limits."""

    @property
    def distance(self) -> Array:
        """(k,) distances in s; NaN where nothing was found."""
        return np.array([np.nan if near is None else near.distance for near in self])


@dataclass(frozen=True)
class Piece:
    """What proves a motion between two times: a region that contains it, the tube of a proved motion, or a map."""

    begin: float
    end: float
    region: str | None
    """Id of the region; None where a motion's tube or a map proves it."""
    guarantee: Guarantee
    motion: str | None = None
    """Id of the proved motion; None for a region or a map."""
    map: str | None = None
    """Id of the job that has grown the map; None for a region or a motion."""


@dataclass(frozen=True, eq=False)
class Uncovered:
    """Where a motion stops being covered."""

    time: float
    """The motion is covered up to here, and not proved to be from here on."""
    segment: int
    """Number of the segment between two waypoints, from 0 on."""
    q: Array
    """(n,) the configuration there: a seed for a new region is best put a little beyond."""
    s: Array | None
    """(n,) the same in s; None where a joint is outside of its limits."""
    next: Near | None
    """The nearest region that does not contain it."""


@dataclass(frozen=True, eq=False)
class Coverage:
    """Whether every point of a motion is in certified regions, which is proved. It is true if so."""

    covered: bool
    pieces: tuple[Piece, ...]
    """The regions that cover the motion, in order, as far as it is covered from its start on."""
    uncovered: Uncovered | None
    """Where the motion stops being covered; None where it is covered."""

    def __bool__(self) -> bool:
        return self.covered

    def __repr__(self) -> str:
        where = "covered" if self.uncovered is None else f"not covered from {self.uncovered.time:.6g} on"
        return f"Coverage({where}, {counted(len(self.pieces), 'piece')})"


class Segments(Answers[Coverage]):
    """Whether each of k motions is in certified regions. It is true only if all are."""

    @property
    def covered(self) -> NDArray[np.bool_]:
        """(k,) whether the motion is covered."""
        return np.array([motion.covered for motion in self])


@dataclass(frozen=True)
class Node:
    """A region in the graph of a scene."""

    region: str
    """Id of the region."""
    guarantee: Guarantee
    component: int
    """Number of its component; the component with the most regions is number 0."""


@dataclass(frozen=True, eq=False)
class Edge:
    """Two regions that overlap. A motion may go from one to the other through the witness q."""

    a: str
    b: str
    depth: float
    """Radius of the largest ball inside of both, in s."""
    q: Array
    s: Array


@dataclass(frozen=True, eq=False)
class Gap:
    """The place where a component comes nearest to another."""

    a: str
    b: str
    distance: float
    """In s."""
    q: Array | None
    """(n,) a seed to try: midway between a and b, or near there, free of collision and in no region; None where none was found."""
    q_a: Array
    """(n,) a's point that is nearest to b."""
    q_b: Array
    """(n,) b's point that is nearest to a."""
    map: bool
    """Whether the scene's latest map proves the motion from q_a straight in q to q_b: no region has to be grown for it."""


@dataclass(frozen=True, eq=False)
class Graph:
    """The connected regions of a scene."""

    version: int
    nodes: tuple[Node, ...]
    edges: tuple[Edge, ...]
    components: int
    gaps: tuple[Gap, ...]
    map: str | None
    """The job that has grown the scene's latest map; None where the scene has none."""

    def __repr__(self) -> str:
        has = (counted(len(self.nodes), "region"), counted(len(self.edges), "overlap"), counted(self.components, "component"))
        return f"Graph({', '.join(has)})"


@dataclass(frozen=True, eq=False)
class PlanGap:
    """The place where the regions connected with the start of a plan are nearest to those of its goal."""

    start: str
    """Id of a region that is connected with the start."""
    goal: str
    distance: float
    """Between the two, in s."""
    q: Array | None
    """(n,) a seed to try: midway between the two, or near there, free of collision and in no region; None where none was found."""
    q_start: Array
    """(n,) the point of the region ``start`` that is nearest to the other."""
    q_goal: Array


@dataclass(frozen=True)
class BeyondLimit:
    """A joint that is outside its limits."""

    where: str
    """The argument, as ``start`` or ``via[0]``."""
    joint: str
    value: float
    """In radians or metres, as the limits are."""
    lower: float | None
    """None for no limit."""
    upper: float | None


@dataclass(frozen=True, eq=False)
class Collision:
    """Two bodies that touch."""

    where: str
    """The argument, as ``start`` or ``via[0]``."""
    a: str
    b: str
    depth: float
    """How deep the padded bodies are in each other, in metres."""
    free: Array | None
    """(n,) free joint positions near by; None where none were found."""


@dataclass(frozen=True, eq=False)
class Reached:
    """How near to a pose a frame comes."""

    q: Array
    """(n,)"""
    metres: float
    radians: float


@dataclass(frozen=True)
class LineStop:
    """Where a motion along a line ends."""

    part: float
    """How much of the line there is a motion for, from 0 to 1."""
    joint: str | None
    """The joint that is at its limit."""
    a: str | None
    """The geometries that touch."""
    b: str | None


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion from rest to rest that is proved to be free of collision, or why there is none. It is true if there is one.

    The motion is straight in q between its configurations.
    """

    found: bool
    q: Array
    """(k, n) configurations; without a row where there is no motion."""
    t: Array
    """(k,) seconds, when the robot is there."""
    pieces: tuple[Piece, ...]
    """What proves the motion, in order, with begin and end in seconds: regions, or a proved motion."""
    length: float | None
    """In q, in radians (and metres)."""
    duration: float | None
    """In seconds."""
    guarantee: Guarantee | None
    complete: bool
    """Whether every pair of regions has been compared."""
    motion: str | None
    """Id of the proved motion in whose tube the answer is; None for regions."""
    tube: float | None
    """Half the width of that tube, in radians or metres."""
    reason: str | None
    """Why there is no motion, as start_in_collision or no_motion; docs/planning.md lists all."""
    limit: BeyondLimit | None
    """The joint that is outside its limits."""
    collision: Collision | None
    """The bodies that touch."""
    reached: Reached | None
    """Where the frame comes nearest to the pose."""
    line: LineStop | None
    """Where the motion along the line ends."""
    nearest: Near | None
    """The region that is nearest to the end that no region contains."""
    gap: PlanGap | None
    """Where the regions of the two ends come nearest to each other."""
    uncovered: Uncovered | None
    """Where the last trajectory that was tried is not proved to be covered."""
    proof: bytes | None = field(repr=False)
    """The proof file about exactly this motion; None where it was not asked for."""

    def __bool__(self) -> bool:
        return self.found

    def __repr__(self) -> str:
        if not self.found:
            return f"Plan({self.reason})"
        has, pieces = counted(len(self.q), "configuration"), counted(len(self.pieces), "piece")
        return f"Plan({has}, {self.length:.4g} long, {self.duration:.4g} s, {pieces})"


@dataclass(frozen=True, eq=False)
class Place:
    """A place on a motion."""

    piece: int
    """The piece from waypoint ``piece`` to the next one, or the polynomial piece; both count from 0."""
    time: float
    """Which part of the piece is behind, from 0 to 1."""
    q: Array


@dataclass(frozen=True, eq=False)
class Approach(Place):
    """A place on a motion, and a pair of bodies with its distance there."""

    a: str
    b: str
    distance: float
    """How far the bodies, with the scene's padding, are apart there, in metres, in floating point; 0 where they overlap. It has no unit
    where the pair stands for a condition that is a cone or a range of angles."""


@dataclass(frozen=True)
class SceneReference:
    """The scene that an answer is about."""

    name: str
    hash: str
    """SHA-256 of everything in the scene that a proof depends on."""


@dataclass(frozen=True, eq=False)
class Motion:
    """What has become of a motion. It is true if all of it is certified, that is, proved to be free of collision."""

    scene: SceneReference
    space: Straight
    """In which coordinates the motion is straight, or polynomial."""
    degree: int
    """Of the polynomial pieces; 1 for a motion that is straight between waypoints."""
    waypoints: int
    """Number of the waypoints, or of the places where polynomial pieces begin or end."""
    outcome: Outcome
    guarantee: Guarantee
    padding: float
    """Metres that were added around every body, beyond the scene's padding."""
    proved_distance: float | None
    """The distance of the padded bodies that the proof happens to show as far as the motion is certified, in metres. They may be many times
    as far apart; ``clearance`` says how far."""
    clearance: float | None
    """A proved lower bound in metres of the distance of the padded bodies, in the tube as well. Without a tube, it is that of ``nearest``
    to 10 % and to 0.1 mm. None where it was not asked for, and as docs/motions.md says."""
    nearest: Approach | None
    """Where the padded bodies come closest; None where ``clearance`` is."""
    tube: float | None
    """Joint positions that are off by this much, in radians or metres, are certified as well."""
    certified_to: Place | None
    """Up to where every pair is proved to be apart; None where nothing is proved."""
    stop: Approach | None
    """The first contact, or where bodies first come nearer than ``padding`` allows, or too close to tell; None for a motion that is
    certified."""
    not_covered_summary: str | None
    """Which pairs of geometries the proof is not about, in a sentence; None in a verdict that an earlier version stored."""
    intervals: int
    """How many planes the proof has."""
    seconds: float
    """How long the search and the verification took together."""
    verify_seconds: float
    """How long the verification took."""
    proof: bytes | None = field(repr=False)
    """The proof file; None where it was not asked for."""

    def __bool__(self) -> bool:
        return self.outcome is Outcome.CERTIFIED

    def __repr__(self) -> str:
        where = "" if self.stop is None else f": {self.stop.a} and {self.stop.b}"
        return f"Motion({self.outcome.value}{where})"

    @property
    def margin(self) -> float | None:
        """Returns ``proved_distance``, by the name that it had first."""
        return self.proved_distance


@dataclass(frozen=True)
class Verification:
    """Whether a region's stored proof holds, and what it proves. It is true if the proof holds."""

    holds: bool
    statement: tuple[str, ...]
    """What was proved, in plain words, line by line."""
    guarantee: Guarantee
    error: Document | None
    """Why the proof does not hold: code, message, field, hint; None when it holds."""
    seconds: float

    def __bool__(self) -> bool:
        return self.holds


@dataclass(frozen=True)
class Event:
    """Something that happened to a job."""

    seq: int
    kind: str
    """One of job, iteration, pairs, step, region, lost."""
    data: Document
    created_at: datetime | None = None


@dataclass(frozen=True)
class MapCoverage:
    """How much of the collision-free configurations a map proves. It is estimated from samples, and proves nothing."""

    value: float
    stderr: float

    def __float__(self) -> float:
        return self.value


@dataclass(frozen=True)
class FreeCoverage(MapCoverage):
    """How much of the collision-free configurations is in regions. It is estimated from samples, and proves nothing."""

    samples: int


@dataclass(frozen=True)
class Wanted:
    """Whether a map proves a configuration that it was to cover first."""

    q: tuple[float, ...]
    state: str
    """``proved`` (free of collision), ``open`` (the map has no proof there), or ``in_collision``."""


@dataclass(frozen=True)
class StoredMap:
    """A map whose proof has passed the verifier."""

    cells: int
    """How many cells are proved."""
    uncovered_pairs: int
    """How many pairs have no cell. As long as there are some, no configuration is proved free."""
    at: tuple[Wanted, ...]
    paths: tuple[float, ...]
    """How much of each motion that the map was to cover first is proved: a share of its length."""
    proof: str
    """SHA-256 of the proof file."""
    free_set: bool
    """Whether there is a free set for lookups."""


@dataclass(frozen=True)
class Map:
    """What a job has proved of all of the joint space. It is true if it covers as much as was asked for."""

    outcome: Outcome | None
    ended: str | None
    """``coverage``, ``deadline``, ``nothing_left``, ``size`` (the verifier would not read a larger map) or ``cancelled``."""
    reason: str | None
    """A sentence that says why it ended."""
    seconds: float | None
    coverage: MapCoverage | None
    cells: int
    curve: tuple[tuple[float, float], ...]
    """Seconds since the start, and the coverage by then."""
    stored: StoredMap | None
    """What is verified and stored; None before the job has ended, and where nothing is proved."""
    former: str | None = None
    """The job whose map was taken over, as far as it holds here; None where there was none."""

    def __bool__(self) -> bool:
        return self.outcome is Outcome.CERTIFIED

    def __repr__(self) -> str:
        proved = "nothing known" if self.coverage is None else f"{100 * self.coverage.value:.3g} % proved"
        return f"Map({proved}, {counted(self.cells, 'cell')}, {self.reason})"


@dataclass(frozen=True)
class Cover:
    """The results of a cover. It is true if it has reached all of its goals."""

    outcome: Outcome | None
    reason: str | None
    """A sentence that says why it ended, and which goals it has not reached."""
    seconds: float | None
    regions: tuple[str, ...]
    """Ids of the regions that it has grown."""
    coverage: FreeCoverage | None
    curve: tuple[tuple[float, float, int], ...]
    """For each look at the scene seconds since the start, the coverage by then, and how many regions the scene had."""
    components: tuple[int, ...] | None
    """How many regions each connected component of the scene has, the one that covers most first."""
    connected: bool | None
    """Whether all regions of the scene are in one component."""
    connect: tuple[int | None, ...] | None
    """For each configuration to connect the component that it is in; None where it is in no region."""
    missing: tuple[str, ...] | None
    """The goals that are not reached, in words."""
    obstacles: tuple[str, ...] | None
    """What could not be gone on with, in words."""

    def __bool__(self) -> bool:
        return self.outcome is Outcome.CERTIFIED

    def __repr__(self) -> str:
        covered = "nothing known" if self.coverage is None else f"{100 * self.coverage.value:.3g} % covered"
        return f"Cover({covered}, {counted(len(self.regions), 'region')}, {self.reason})"


@dataclass(frozen=True, eq=False)
class Obstacle:
    """What holds a region back: a pair that is not certified, or for which something was cut off."""

    pair: int | None
    """Index of the pair; None where none is known."""
    a: str | None
    b: str | None
    text: str
    """What stands in the way, in a sentence, which says what is proved and what is not."""
    q: Array | None
    """(n,) joint positions at which the pair touches, comes too close, or could not be proved apart."""
    faces: int | None
    """How many faces were added or moved in for the pair."""
    lost: float | None
    """Share of the polytope, by volume in q, that they cut off, as samples say."""

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True)
class QVolume:
    """How large a region is in joint positions."""

    value: float
    stderr: float
    """Standard error of ``value``, which is found by sampling."""
    unit: str
    """Such as ``rad^7``."""
    box_side: float | None
    """Degrees: a box with this side in every joint has this volume; None where a joint slides."""
    least_width: float | None = None
    """Degrees: in some direction of joint space, no straight motion inside of the region is longer. None where a joint slides, and for a
    region that an earlier version stored."""

    def __float__(self) -> float:
        return self.value


@dataclass(frozen=True)
class Share:
    """How much of the proposal that a region was grown from the region keeps, by volume in q."""

    value: float | None
    """Part of the proposal's collision-free configurations that the region contains; None where no sample is free."""
    stderr: float | None
    collision_free: float
    """Part of the proposal's samples that is free of collision."""
    samples: int
