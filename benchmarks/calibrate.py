"""Measures how long pairs of every size class take and fits certifier.forecast to it; ``python -m benchmarks.calibrate``."""

from __future__ import annotations

import sys
from collections import defaultdict

import numpy as np
from scipy.optimize import nnls

from benchmarks import catalogue, machine, measure
from certifier.forecast import SECONDS, forecast, terms
from certifier.model import Array
from certifier.outcome import Outcome

POLYTOPES = ("tiny", "simplex", "grown")
LONGEST_CHAIN = 4

SizeClass = tuple[int, tuple[int, int], tuple[int, int]]
"""n, the vertices of A and of B, the dimensions N of their polynomial spaces."""


def measured() -> dict[SizeClass, float]:
    """Mean seconds of the certified pairs of every size class, verification included."""
    seconds: dict[SizeClass, list[float]] = defaultdict(list)
    for name in catalogue.scenes():
        scene = catalogue.scene(name)
        costs = forecast(scene)
        indices = [i for i, cost in enumerate(costs) if max(len(cost.chain_a), len(cost.chain_b)) <= LONGEST_CHAIN]
        for polytope in POLYTOPES:
            run = measure.ours(scene, catalogue.region(name, polytope), indices, lambda _: None)
            for index, pair in run.pairs.items():
                if pair.result.outcome is Outcome.CERTIFIED:
                    cost = costs[index]
                    vertices = len(scene.geometry(cost.a).vertices), len(scene.geometry(cost.b).vertices)
                    seconds[scene.n, vertices, (cost.N_a, cost.N_b)].append(pair.seconds)
        print(name, file=sys.stderr, flush=True)
    return {size: float(np.mean(values)) for size, values in seconds.items()}


def main() -> None:
    """Prints the constants that fit best, and how well they and the present ones do."""
    found = measured()
    rows = np.array([terms(n, list(vertices), list(N)) for n, vertices, N in found])
    seconds = np.array(list(found.values()))
    constants, _ = nnls(rows / seconds[:, None], np.ones(len(seconds)))
    print(machine.sentence(machine.describe()))
    print(f"SECONDS = np.array([{', '.join(f'{value:.2g}' for value in constants)}])")
    _report("fitted", rows @ constants / seconds)
    _report("as they are", rows @ SECONDS / seconds)


def _report(name: str, ratio: Array) -> None:
    least, low, median, high, most = np.quantile(ratio, [0, 0.1, 0.5, 0.9, 1])
    print(f"{name}: median {median:.2f}, 80 % within {low:.2f} .. {high:.2f}, all {least:.2f} .. {most:.2f}")


if __name__ == "__main__":
    main()
