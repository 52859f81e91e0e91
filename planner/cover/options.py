"""The options say what a cover shall reach, where it begins, and how much effort a region is worth."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from certifier.errors import RegionError
from certifier.options import option, read

Q = tuple[float, ...]

MOST_GIVEN = 1000
"""Number of configurations that may be given in each of the lists."""
MOST_JOINTS = 4
STAGES = 1
"""For robots with more joints than that, a region ends after this many stages, unless somebody asks for more."""
ENOUGH = 0.95
"""The coverage that is asked for where nothing else is."""


@dataclass(frozen=True)
class CoverOptions:
    """The options say what a job asks for that covers a scene. The ``text`` of each says what it means."""

    seeds: tuple[Q, ...] = option((), "Configurations (joint positions) that get regions first.", argument="seed", most=MOST_GIVEN)
    connect: tuple[Q, ...] = option(
        (), "Goal: each of these configurations is in a region, and all of them are in one connected component.", most=MOST_GIVEN
    )
    paths: tuple[tuple[Q, ...], ...] = option(
        (),
        "Goal: regions cover these motions, which are straight in joint positions from waypoint to waypoint.",
        argument="path",
        most=MOST_GIVEN,
    )
    coverage: float | None = option(
        None,
        "Goal: this share of the collision-free configurations, uniform in joint positions within the limits, is in regions.",
        otherwise=f"{ENOUGH} where nothing else is asked for, else no goal",
        above=0,
        greatest=1,
    )
    connected: bool = option(False, "Goal: all regions of the scene are connected.")
    regions: int = option(1000, "Grow at most this many regions.", least=1, greatest=100_000)
    at_once: int = option(2, "Number of regions that grow at the same time.", least=1, greatest=64)
    region_seconds: float | None = option(
        None,
        "The growth of a region ends after this many seconds, with the region so far.",
        otherwise="no limit",
        unit="s",
        above=0,
        greatest=30 * 86400,
    )
    cells: int = option(
        6000,
        "Most cells of a pair in each stage of a region. After that, new faces cut off the cells that are still undecided.",
        least=1,
        greatest=10_000_000,
    )
    stages: int | None = option(
        None,
        "The growth of a region ends after this many stages. A further stage makes the region larger.",
        otherwise=f"{STAGES} for robots with more than {MOST_JOINTS} joints; else as for one region",
        least=1,
        greatest=100,
    )
    random_seed: int = option(0, "Seed of every random choice.", least=0, greatest=2**31 - 1)

    @property
    def enough(self) -> float | None:
        """Returns the coverage that is a goal; None where none is."""
        if self.coverage is not None or self.connect or self.paths or self.connected:
            return self.coverage
        return ENOUGH

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> CoverOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown or out of range; the error names it.
        """
        options = read(cls, document, "options")
        if len(options.connect) == 1:
            message = "at least two configurations can be connected, and one was given"
            raise RegionError("option_value", message, field="options.connect", hint="give another one, or give it as a seed")
        return options
