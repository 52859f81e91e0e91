"""Options for tests, one of each kind and a group."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from certifier.options import option


@dataclass(frozen=True)
class Group:
    """Options of their own."""

    max_rounds: int = option(2, "Rounds of `it`.", argument="rounds", python="max_rounds", least=0, greatest=9)
    how: Literal["soft", "hard"] = option("soft", "The way.")
    start: tuple[float, ...] | None = option(None, "Where it begins.")


@dataclass(frozen=True)
class Grouped:
    """Options with a group among them."""

    cells: int = option(1, "Cells.", least=1)
    share: float = option(0.5, "Share.", above=0, below=1)
    careful: bool = option(False, "Take care.")
    old_way: Group | None = option(None, "Do it the old way.")
    names: dict[str, str] = option({}, "Names.", argument="name")
    visit: tuple[tuple[float, ...], ...] = option((), "Places to visit.")
