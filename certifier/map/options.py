"""The options say what a map may be asked for."""

from __future__ import annotations

from dataclasses import dataclass

from certifier.options import option


@dataclass(frozen=True)
class MapOptions:
    """The options say how much of the free configurations a map is to prove, and what first."""

    coverage: float = option(0.9, "The map ends when it covers this share of the free configurations.", above=0, greatest=1)
    at: tuple[tuple[float, ...], ...] = option((), "Joint positions that the map is to cover first.", most=10_000)
    paths: tuple[tuple[tuple[float, ...], ...], ...] = option(
        (), "Motions that the map is to cover first, straight in joint positions from waypoint to waypoint.", argument="path", most=10_000
    )
    asked: bool = option(
        False,
        "Cover next the configurations that the service was asked about lately and nothing proved; those in collision are left out. The "
        "job's options have them in `at`.",
    )
    random_seed: int = option(0, "Seed of every random choice.", least=0, greatest=2**63 - 1)
