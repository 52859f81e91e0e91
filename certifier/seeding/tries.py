"""IRIS is tried with several random seeds, and the proposal is taken of which a growth is likely to keep most.

Which collisions IRIS happens to find decides where its faces lie. So another random seed may result in a proposal that is twice as large.
Or growth may lose only a fifth of what it loses of the first proposal (docs/trials.md).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from certifier.errors import RegionError
from certifier.model import Array, Scene
from certifier.seeding.iris import iris
from certifier.seeding.options import IRIS_SEEDS, Method, SeedOptions
from certifier.seeding.rating import Rating, rated


@dataclass(frozen=True, eq=False)
class _Try:
    """A try is the result of IRIS with one random seed.

    Attributes:
        C, d, account: as :func:`certifier.seeding.iris.iris` returns them.
        holds: whether the points that have to stay inside are inside.
    """

    C: Array
    d: Array
    account: dict[str, Any]
    holds: bool
    rating: Rating

    @property
    def worth(self) -> tuple[bool, float, float]:
        return self.holds, self.rating.kept, -self.rating.touched


def best_of_tries(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    """Returns the faces (m, n), (m,) of the best of ``options.tries`` IRIS regions around points of s, and its account.

    The account is that of :func:`certifier.seeding.iris.iris`, with the ``random_seed`` of the try and the number of ``tries``. The first
    random seed is that of the options.

    Args:
        points: (k, n) points in s, the seed first. Whether they are inside remains to be checked.

    Raises:
        RegionError: no try resulted in a region; the error is that of the first try.
    """
    first = options.random_seed or 0
    if options.tries == 1:
        C, d, account = _iris(scene, points, replace(options, random_seed=first))
        return C, d, {**account, "random_seed": first, "tries": 1}
    others = np.random.SeedSequence(first).generate_state(options.tries - 1) % IRIS_SEEDS
    tries: list[_Try] = []
    failures: list[RegionError] = []
    for random_seed in (first, *map(int, others)):
        try:
            tries.append(_tried(scene, points, replace(options, random_seed=random_seed)))
        except RegionError as error:
            failures.append(error)
    if not tries:
        raise failures[0]
    best = max(tries, key=lambda one: one.worth)
    warnings = [*best.account["warnings"], *(f"another try failed: {error}" for error in failures)]
    return best.C, best.d, {**best.account, "warnings": warnings, "tries": options.tries}


def _iris(scene: Scene, points: Array, options: SeedOptions) -> tuple[Array, Array, dict[str, Any]]:
    if options.method is Method.IRIS:
        return iris(scene, points, options)
    from certifier.seeding.drake_iris import drake_iris  # loading Drake's planning takes a second

    return drake_iris(scene, points, options)


def _tried(scene: Scene, points: Array, options: SeedOptions) -> _Try:
    C, d, account = _iris(scene, points, options)
    holds = bool((d[:, None] > C @ points.T).all())
    rating = rated(scene, scene.polytope(C, d), points)
    return _Try(C, d, {**account, "random_seed": options.random_seed}, holds, rating)
