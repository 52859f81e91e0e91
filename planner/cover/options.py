"""The options say what a cover shall reach, where it begins, and how much effort a region is worth."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, fields
from typing import Any

from certifier.errors import RegionError

Q = tuple[float, ...]

WHOLE_NUMBERS = {"regions": (1, 100_000), "at_once": (1, 64), "cells": (1, 10_000_000), "stages": (1, 100), "random_seed": (0, 2**31 - 1)}
"""Maps an option to its least and its greatest value."""
MOST_GIVEN = 1000
"""Number of configurations that may be given in each of the lists."""
MOST_JOINTS = 4
STAGES = 2
"""For robots with more joints than that a region ends after this many stages, unless somebody asks for more."""
ENOUGH = 0.95
"""The coverage that is asked for where nothing else is."""


@dataclass(frozen=True)
class CoverOptions:
    """The options say what a job asks for that covers a scene.

    Attributes:
        seeds: (n,) each, joint positions that get regions first.
        connect: (n,) each, joint positions of which each gets a region, and which shall end in one connected component.
        paths: waypoints, (n,) each; the motions that are straight in q between them shall be covered.
        coverage: ends when this share of the collision-free configurations, uniform in q within the joint limits, is in regions. None is
            ENOUGH where neither ``connect`` nor ``paths`` nor ``connected`` asks for anything, and no goal elsewhere.
        connected: ends when all regions of the scene are connected.
        regions: largest number of regions that are begun.
        at_once: number of regions that grow at the same time.
        region_seconds: each region is given up, or ends with what there is of it, after so long; None sets no limit.
        cells: number of cells of each pair in every stage of a region (certifier.growth.options).
        stages: each region ends after this many stages (certifier.growth.options); None sets no limit.
        random_seed: seeds every random choice.
    """

    seeds: tuple[Q, ...] = ()
    connect: tuple[Q, ...] = ()
    paths: tuple[tuple[Q, ...], ...] = ()
    coverage: float | None = None
    connected: bool = False
    regions: int = 1000
    at_once: int = 2
    region_seconds: float | None = None
    cells: int = 6000
    stages: int | None = None
    random_seed: int = 0

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
        known = {f.name for f in fields(cls)}
        for name in document:
            if name not in known:
                hint = f"options: {', '.join(sorted(known))}"
                raise RegionError("unknown_option", f"there is no option {name!r}", field=f"options.{name}", hint=hint)
        given = dict(document)
        for name in ("seeds", "connect"):
            given[name] = tuple(tuple(float(x) for x in q) for q in given.get(name, ()))
        given["paths"] = tuple(tuple(tuple(float(x) for x in q) for q in path) for path in given.get("paths", ()))
        options = cls(**given)
        for name, (least, greatest) in WHOLE_NUMBERS.items():
            value = getattr(options, name)
            if name == "stages" and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= greatest:
                raise RegionError("option_value", f"{name} must be an integer from {least} to {greatest}", field=f"options.{name}")
        if options.coverage is not None and not 0 < options.coverage <= 1:
            raise RegionError("option_value", "coverage must be a number above 0 and at most 1", field="options.coverage")
        if options.region_seconds is not None and not 0 < options.region_seconds < math.inf:
            raise RegionError("option_value", "region_seconds must be a number above 0", field="options.region_seconds")
        if len(options.connect) == 1:
            message = "at least two configurations can be connected, and one was given"
            raise RegionError("option_value", message, field="options.connect", hint="give another one, or give it as a seed")
        return options
