"""What a scene file says of the padding of bodies and of pairs becomes the padding of each pair here."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from certifier.scene.known import check_known, names_of

if TYPE_CHECKING:  # The command reads scene files without numpy, which the model needs.
    from certifier.model import Geometry, Pair


@dataclass(frozen=True)
class PaddedPair:
    """Names two bodies or geometries, and the padding of their pairs in metres; ``field`` is where the file says so."""

    a: str
    b: str
    padding: float
    field: str


@dataclass(frozen=True)
class Paddings:
    """Holds the paddings in which some pairs of a scene file differ from the others.

    Attributes:
        bodies: by the name of a body or a geometry, metres.
        pairs: those of pairs, which come before those of bodies.
    """

    bodies: Mapping[str, float] = field(default_factory=dict)
    pairs: Sequence[PaddedPair] = ()

    def on(self, pairs: Sequence[Pair], geometries: Sequence[Geometry], bodies: Sequence[str]) -> tuple[tuple[Pair, ...], list[str]]:
        """Returns the pairs with their paddings, and a warning for everything that concerns no pair.

        The first entry that names a pair counts. Without one, it is the larger padding of its two geometries; what is said of a geometry
        comes before what is said of the mesh that it is a part of, and this before what is said of its body.

        Raises:
            SceneError: ``unknown_name``, for what is neither a body nor a geometry.
        """
        names = {geometry.name: names_of(geometry) for geometry in geometries}
        known = [*bodies, *(name for several in names.values() for name in several)]
        named = [(name, f"padding.bodies.{name}") for name in self.bodies]
        named += [(name, f"{entry.field}[{k}]") for entry in self.pairs for k, name in enumerate((entry.a, entry.b))]
        for name, where in named:
            check_known(name, known, where)
        first = {frozenset((entry.a, entry.b)): entry for entry in reversed(self.pairs)}
        unused = {f"padding.bodies.{name}: {name} has no pair to certify": name for name in self.bodies}
        used: set[str] = set()
        found = []
        for pair in pairs:
            sides = [names[name] for name in (pair.a, pair.b)]
            entries = [first[both] for a in sides[0] for b in sides[1] if (both := frozenset((a, b))) in first]
            own = [next((name for name in side if name in self.bodies), None) for side in sides]
            used |= {name for name in own if name is not None}
            if entries:
                entry = min(entries, key=self.pairs.index)
                used.add(entry.field)
                found.append(replace(pair, padding=entry.padding))
            else:
                found.append(replace(pair, padding=max((self.bodies[name] for name in own if name is not None), default=None)))
        warnings = [said for said, name in unused.items() if name not in used]
        warnings += [f"{e.field}: {e.a} and {e.b} have no pair to certify" for e in self.pairs if e.field not in used]
        return tuple(found), warnings
