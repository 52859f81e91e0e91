"""The options say from what a proposal is made, and by which method."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from enum import StrEnum
from typing import Any

from certifier.errors import RegionError
from certifier.options import option, read, table
from certifier.positions import check_magnitude


class Method(StrEnum):
    """The method says where a proposal comes from."""

    IRIS = "iris"
    """IRIS makes the polytope, and faces that lose least cut its colliding corners off."""
    IRIS_NP2 = "iris_np2"
    """Drake's IrisNp2 makes the polytope, for comparison."""
    IRIS_ZO = "iris_zo"
    """Drake's IrisZo makes the polytope, for comparison."""
    LIMITS = "limits"
    """The joint limits are the polytope; what cannot be certified is cut off pair by pair, by faces in the pair's joints alone."""
    BOX = "box"
    """A box around the seed, clipped to the joint limits, is the polytope."""
    POLYTOPE = "polytope"
    """The given C and d are the polytope."""


IRIS = (Method.IRIS, Method.IRIS_NP2, Method.IRIS_ZO)
OF_PAPER = (Method.LIMITS, Method.BOX)
"""Only the papers' algorithm makes a region of these."""
_GIVE = {"half_width": "give it in s, such as 0.1: about 11 degrees on each side of a joint near q*"}
IRIS_SEEDS = 2**31
"""IRIS has this many seeds of its random choices, from 0 on."""
GIVEN = ("polytope", "C", "d", "center")
"""The method that takes a given polytope, and its options. Documents have them; nobody types them: there is ``ciris certify``."""


@dataclass(frozen=True)
class SeedOptions:
    """The options say what to propose. The ``text`` of each says what it means."""

    method: Method | None = option(
        None,
        "Source of the first polytope: IRIS (`iris`), or for comparison Drake's (`iris_np2`, `iris_zo`), which takes minutes. The papers' "
        "algorithm can also begin with the joint limits (`limits`) or a box around the seed (`box`).",
        otherwise="`iris`",
    )
    q: tuple[float, ...] | None = option(None, "The seed: joint positions in radians or metres, in position order.")
    contain: tuple[tuple[float, ...], ...] = option(
        (), "More configurations (joint positions) that the region must contain, such as where it meets another region."
    )
    C: tuple[tuple[float, ...], ...] | None = option(
        None,
        "(m, n), the first polytope {s : C s <= d}, one row a face, in s; for the method `polytope`, which takes no `q`. The joint limits "
        "are added.",
        positions=False,
    )
    d: tuple[float, ...] | None = option(None, "(m,), the right-hand sides of these faces.", most=2000, positions=False)
    center: tuple[float, ...] | None = option(
        None, "(n,), a point inside that polytope, in s.", otherwise="the centre of its largest ball", positions=False
    )
    half_width: float | None = option(
        None, "Half the edge length of the first polytope, in s; the method `box` needs it. 0.1 is about 11 degrees of a joint.", above=0
    )
    epsilon: float = option(
        0.001,
        "IRIS adds faces until at most this fraction of the polytope's volume is in collision: in q, or in s for Drake's IRIS.",
        argument="iris-epsilon",
        above=0,
        below=1,
    )
    delta: float = option(0.05, "Probability that a larger fraction than that is in collision.", argument="iris-delta", above=0, below=1)
    max_iterations: int = option(
        8,
        "Most alternations of IRIS between faces and ellipsoid.",
        argument="iris-iterations",
        least=1,
        greatest=1000,
    )
    max_iterations_separating_planes: int = option(
        20,
        "Most rounds of new faces within each alternation of IRIS.",
        argument="iris-face-rounds",
        least=1,
        greatest=1000,
    )
    tolerance: float = option(
        0.05, "IRIS ends when the ellipsoid's volume grows by less than this fraction.", argument="iris-tolerance", above=0
    )
    margin: float = option(0.01, "Distance in s between IRIS' faces and the collisions that it finds.", argument="iris-margin", above=0)
    random_seed: int | None = option(
        None,
        "Seed of the random choices of IRIS only. Another seed gives another proposal.",
        otherwise="the seed of every random choice",
        argument="iris-random-seed",
        least=0,
        greatest=IRIS_SEEDS - 1,
    )
    tries: int = option(
        1,
        "IRIS makes this many proposals, each with its own random seed, and growth takes the one of which it is likely to keep most.",
        argument="iris-tries",
        least=1,
        greatest=1000,
    )

    def to_document(self) -> dict[str, Any]:
        """Returns the options as JSON-able data; those that are not given are left out."""
        return {name: value for name, value in asdict(self).items() if value is not None}

    @classmethod
    def from_document(cls, document: dict[str, Any]) -> SeedOptions:
        """Does the inverse of :meth:`to_document`.

        Raises:
            RegionError: an option is unknown, missing or out of range; the error names it.
        """
        options = read(cls, document, "seed")
        method, given = options.method, {name for name, value in document.items() if value is not None}
        needed = {Method.POLYTOPE: ("C", "d"), Method.BOX: ("q", "half_width")}.get(method or Method.IRIS, ("q",))
        idle = {"C", "d", "center", "half_width", "q"} - {*needed} - ({"center"} if method is Method.POLYTOPE else set())
        for name in needed:
            if name not in given:
                raise _refuse(name, f"the method {method or Method.IRIS} needs {name}", "missing_option", _GIVE.get(name, "give it"))
        for name in sorted(idle & given):
            raise _refuse(name, f"the method {method or Method.IRIS} has no use for {name}", hint="leave it out")
        if method is not None and method not in IRIS:
            for one in table(SeedOptions):
                if one.argument.startswith("iris-") and one.name != "random_seed" and getattr(options, one.name) != one.default:
                    raise _refuse(one.name, f"the method {method} has no use for {one.name}", hint="leave it out")
        for name in ("q", "center"):
            check_magnitude(getattr(options, name) or (), f"seed.{name}")
        for i, row in enumerate(options.contain):
            check_magnitude(row, f"seed.contain[{i}]")
        return options


def _refuse(name: str, message: str, code: str = "option_value", hint: str = "") -> RegionError:
    return RegionError(code, message, field=f"seed.{name}", hint=hint)
