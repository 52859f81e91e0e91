"""The options say what a growth job may be asked for."""

from __future__ import annotations

import math
from dataclasses import asdict, dataclass, field, fields
from typing import Any, Literal

from certifier.errors import RegionError
from certifier.seeding.options import IRIS

EFFORT = (
    (4, {"contractions": 2, "pushes": 10, "max_rounds": 3}),
    (6, {"contractions": 2, "pushes": 2, "max_rounds": 0}),
    (math.inf, {"contractions": 1, "pushes": 0, "max_rounds": 0}),
)
"""The defaults depend on the most joints that any pair has between its bodies.

With up to 4 joints growing then takes seconds, and with up to 6 a minute. With more joints it ends at the first region, which itself
takes a minute.
"""
NEAR = (1.0, 0.6, 0.3)
"""For each contraction in turn: failures closer than this shrink a joint's range; others get a cutting face."""


WHOLE_NUMBERS = {
    "contractions": (1, len(NEAR)),
    "bisection_steps": (0, 60),
    "pushes": (0, 1000),
    "max_rounds": (0, 1000),
    "backoff": (0, 20),
    "cells": (1, 10_000_000),
    "stages": (1, 100),
    "random_seed": (0, 2**63 - 1),
}
"""Maps an option to its least and its greatest value."""
MOST_CELLS = 6000
LARGEST_TOLERANCE = 10.0
"""A tolerance lies between 0 and this."""


@dataclass(frozen=True)
class GrowthOptions:
    """The options say what a job asks for.

    Attributes:
        kind: ``grow`` a region from a seed, ``certify`` a given polytope as it is, or ``recertify`` a region of the scene
            before it changed.
        seed: the document of :class:`certifier.seeding.propose.SeedOptions`; for ``certify`` its ``C``, ``d`` and optional ``center``; for
            ``recertify`` the ``C`` and ``d`` of the region, joint limits included, and ``q``, the joint positions (k, n) that stay inside.
        contraction: ``whole`` keeps the proposal and certifies it cell by cell; ``targeted`` and ``uniform`` shrink it until every pair
            has one plane that moves with the joints (11). None is ``whole`` where IRIS makes the proposal. Where a box, a polytope or the
            joint limits are the proposal, None is ``targeted``: much may collide in them, or much more be free.
        cells: number of cells to look at for each pair. For ``grow`` it holds in every stage, undecided cells are then cut off, and None
            is MOST_CELLS. For ``certify``, 1 and None give the program (11) of the papers.
        stages: for ``whole``, growth ends after this many stages, each of which results in a larger region than the one before; None: when
            a stage gains little.
        contractions: how many targeted contractions of the proposal are tried; each is given up when it is smaller than the best so far.
            None, for this and for ``pushes`` and ``max_rounds``, takes the default that pays: see EFFORT.
        bisection_steps: certifications spent on uniform contraction after the two ends are known.
        pushes: how often the faces are pushed out after the contractions; each push that fails is followed by a shorter one.
        max_rounds: rounds of the polytope step (12) after the pushes.
        tolerance: relative growth of the ellipsoid's volume that is still worth a push or a round.
        backoff: how many times a stepped polytope that fails to certify is halved towards the last certified one.
        random_seed: seeds every random choice; IRIS' too, unless the seed's document says another.
    """

    kind: Literal["grow", "certify", "recertify"] = "grow"
    seed: dict[str, Any] = field(default_factory=dict)
    contraction: Literal["whole", "targeted", "uniform"] | None = None
    cells: int | None = None
    stages: int | None = None
    contractions: int | None = None
    bisection_steps: int = 6
    pushes: int | None = None
    max_rounds: int | None = None
    tolerance: float = 0.02
    backoff: int = 2
    random_seed: int = 0

    @property
    def by_cells(self) -> bool:
        """Returns whether pairs are certified cell by cell, and not by the program (11) on all of P."""
        if self.kind != "grow":
            return self.kind == "recertify" or (self.cells or 1) > 1
        if self.contraction is not None:
            return self.contraction == "whole"
        return self.seed.get("method") in (None, *IRIS)

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data."""
        return asdict(self)

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> GrowthOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown or out of range; the error names it.
        """
        known = {f.name for f in fields(cls)}
        for name in document:
            if name not in known:
                raise RegionError(
                    "unknown_option", f"there is no option {name!r}", field=f"options.{name}", hint=f"options: {', '.join(sorted(known))}"
                )
        options = cls(**document)
        if options.kind not in ("grow", "certify", "recertify"):
            raise RegionError("option_value", "kind must be 'grow', 'certify' or 'recertify'", field="options.kind")
        if options.contraction not in ("whole", "targeted", "uniform", None):
            raise RegionError("option_value", "contraction must be 'whole', 'targeted' or 'uniform'", field="options.contraction")
        for name, (least, greatest) in WHOLE_NUMBERS.items():
            value = getattr(options, name)
            if name in ("cells", "stages", *EFFORT[0][1]) and value is None:
                continue
            if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= greatest:
                raise RegionError("option_value", f"{name} must be an integer from {least} to {greatest}", field=f"options.{name}")
        if options.contraction == "uniform" and options.seed.get("contain"):
            message = "uniform contraction does not keep points inside"
            raise RegionError("option_value", message, field="options.contraction", hint="leave out the points, or contract otherwise")
        if not (isinstance(options.tolerance, (int, float)) and 0 < options.tolerance < LARGEST_TOLERANCE):
            raise RegionError("option_value", f"tolerance must be a number between 0 and {LARGEST_TOLERANCE:g}", field="options.tolerance")
        return options
