"""The state of a cover, its actions and their reports: plain data, which goes into the database as JSON."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum
from hashlib import sha256

from planner.cover.options import CoverOptions, Q


class Purpose(StrEnum):
    """The purpose says why a region is grown."""

    SEED = "seed"
    """It is around a given seed."""
    CONNECT = "connect"
    """It is around a configuration that shall be connected."""
    PATH = "path"
    """It covers the first part of a given path that is not covered."""
    JOIN = "join"
    """It leads from the component of the first configuration to connect towards that of another one."""
    LINK = "link"
    """It leads from the largest component of the regions towards another one."""
    COVER = "cover"
    """It covers free configurations that are in no region."""


@dataclass(frozen=True)
class Task:
    """A region to grow.

    Attributes:
        q: (n,) its seed, joint positions.
        purpose: why it is grown.
        about: number of the seed, of the configuration to connect or of the path that it is about; what it joins; 0 else.
        contain: (n,) each, joint positions that it has to contain besides.
        turn: how often it was tried with other random seeds before.
    """

    q: Q
    purpose: Purpose
    about: int = 0
    contain: tuple[Q, ...] = ()
    turn: int = 0

    @property
    def key(self) -> str:
        """Returns what it is about, as a text."""
        return self.purpose.value if self.purpose is Purpose.COVER else f"{self.purpose}[{self.about}]"

    @property
    def request(self) -> str:
        """Returns a digest of what the job that grows it is asked for. All else of that is the same for all regions of a cover."""
        return sha256(repr((self.q, self.contain, self.turn)).encode()).hexdigest()[:16]


@dataclass(frozen=True)
class Scouted:
    """A report: how much of the scene is covered, which of its regions are connected, and where it is best to go on.

    Attributes:
        version: version of the library that it is about.
        regions: how many regions the scene has.
        samples: how many collision-free configurations were tested.
        covered: how many of them are in regions.
        components: how many regions each connected component has, the largest component by samples first.
        largest: how many of the covered samples are in the first component.
        seeds: for each given seed whether a region contains it.
        connect: for each configuration to connect the component that contains it, None where no region does.
        paths: which part of each path is covered from its start on, from 0 to 1.
        proposals: regions to grow next, the best first.
        obstacles: what cannot be gone on with, and why, in words.
    """

    version: int = 0
    regions: int = 0
    samples: int = 0
    covered: int = 0
    components: tuple[int, ...] = ()
    largest: int = 0
    seeds: tuple[bool, ...] = ()
    connect: tuple[int | None, ...] = ()
    paths: tuple[float, ...] = ()
    proposals: tuple[Task, ...] = ()
    obstacles: tuple[str, ...] = ()

    @property
    def coverage(self) -> float:
        """Returns the share of the samples that are covered."""
        return self.covered / self.samples if self.samples else 0.0

    @property
    def stderr(self) -> float:
        """Returns the standard error of the coverage; it is never said to be less than that of one sample."""
        if not self.samples:
            return 1.0
        return max(math.sqrt(self.coverage * (1 - self.coverage) / self.samples), 1 / self.samples)

    def joined(self, moved: Sequence[tuple[int, int]] = ()) -> bool:
        """Returns whether the configurations to connect are connected, by regions and by proved motions between two of them."""
        same = [(i, j) for i, part in enumerate(self.connect) for j in range(i) if part is not None and part == self.connect[j]]
        reached, ahead = set[int](), {0}
        while ahead:
            reached |= ahead
            ahead = {b for pair in (*same, *moved) for a, b in (pair, pair[::-1]) if a in ahead} - reached
        return len(reached) >= len(self.connect)


@dataclass(frozen=True)
class Ended:
    """A report: these regions are not growing any more. It maps their numbers to why there is no region; None where there is one."""

    regions: Mapping[int, str | None]


@dataclass(frozen=True)
class Moved:
    """A report: proved motions lead between these pairs of configurations to connect, by number."""

    pairs: tuple[tuple[int, int], ...]


@dataclass(frozen=True)
class Late:
    """A report: the deadline was reached."""


Report = Scouted | Ended | Moved | Late


@dataclass(frozen=True)
class Scout:
    """An action: look at what is covered, and for what is next."""

    kind = "scout"


@dataclass(frozen=True)
class Watch:
    """An action: begin to grow these regions, by number, and wait until one of all that grow has ended.

    Attributes:
        begin: number of the region -> what to grow.
        stop: True ends all that grow.
    """

    kind = "watch"
    begin: Mapping[int, Task] = field(default_factory=dict)
    stop: bool = False


@dataclass(frozen=True)
class Finish:
    """An action: end the cover.

    Attributes:
        reached: whether all goals are reached.
        reason: a sentence that says why it ends.
        fruitless: whether it can show nothing: no goal is reached, and it could not go on.
    """

    kind = "finish"
    reached: bool
    reason: str
    fruitless: bool = False


@dataclass(frozen=True)
class Move:
    """An action: search for motions between configurations to connect where regions do not lead, and prove them."""

    kind = "move"


Action = Scout | Watch | Move | Finish


@dataclass(frozen=True)
class CoverState:
    """What a cover remembers between two decisions.

    Attributes:
        options: what was asked for.
        begun: how many regions were begun.
        growing: number of a region that grows -> what it is.
        tried: the requests of all regions that were begun.
        last: the last look at the scene; None before the first.
        failed: key of a task -> how often in a row it gave no region.
        why: key of a task -> why it gave no region the last time.
        idle: how many regions in a row changed nothing that the scouts count.
        looks: how many scouts were sent.
        fruitless: how many looks in a row found nothing to grow while nothing grew.
        closing: why the cover ends, once that is decided.
        moved: pairs of configurations to connect between which motions were proved; None where no motion was searched for.
    """

    options: CoverOptions
    begun: int = 0
    growing: Mapping[int, Task] = field(default_factory=dict)
    tried: tuple[str, ...] = ()
    last: Scouted | None = None
    failed: Mapping[str, int] = field(default_factory=dict)
    why: Mapping[str, str] = field(default_factory=dict)
    idle: int = 0
    looks: int = 0
    fruitless: int = 0
    closing: str | None = None
    moved: tuple[tuple[int, int], ...] | None = None


@dataclass(frozen=True)
class Transition:
    """The next state of a cover, and the next action."""

    state: CoverState
    action: Action
