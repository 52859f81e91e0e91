"""The survey certifies every pair of every scene on every region, with our certifier alone: by the program (11), or cell by cell.

It shows the outcomes, the undecided pairs, and the cost of a pair by its size.
"""

from __future__ import annotations

import time
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from scipy.optimize import nnls

from benchmarks import catalogue, measure
from benchmarks.catalogue import Region
from benchmarks.measure import Progress
from certifier.model import Pair, Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.certification import Certification
from certifier.pair.forecast import SECONDS, forecast, terms
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification
from certifier.proof.pair import PairProof

DECIDED = (Outcome.CERTIFIED, Outcome.REFUTED, Outcome.NOT_CERTIFIABLE, Outcome.TOO_CLOSE)

AGAIN = 20
"""A pair that is undecided after its cells is certified again with this many times as many cells."""

SizeClass = tuple[int, tuple[int, int], tuple[int, int]]
"""A size class is the number of joints that the plane moves with, the numbers of vertices of A and B, and the dimensions N of their
polynomial spaces.
"""


def survey(names: Iterable[str], most: float, progress: Progress, cells: int = 1) -> dict[str, Any]:
    """Certifies every pair of these scenes on every region of the catalogue, and returns the document of ``ciris bench survey``.

    Args:
        most: seconds; pairs with a longer forecast of the program (11) are left out, and counted.
        cells: the most cells of a pair to look at, and AGAIN times as many if it is then undecided; 1 for the program (11). Only
            its times are compared with the forecast.
    """
    counts, undecided = [], []
    spent: dict[SizeClass, list[float]] = defaultdict(list)
    for name in names:
        whole = catalogue.scene(name)
        scene = replace(whole, pairs=tuple(Pair(cost.a, cost.b) for cost in forecast(whole) if cells > 1 or cost.seconds <= most))
        sizes, left_out = _sizes(scene), len(whole.pairs) - len(scene.pairs)
        for kind in catalogue.REGIONS:
            outcomes: Counter[str] = Counter()
            total = 0.0
            for pair, size, (result, seconds) in zip(
                scene.pairs, sizes, _certified(scene, catalogue.region(name, kind), cells), strict=True
            ):
                outcomes[result.outcome.value] += 1
                total += seconds
                if result.outcome not in DECIDED:
                    found = {"scene": name, "region": kind, "a": pair.a, "b": pair.b, "outcome": result.outcome.value}
                    undecided.append(found | {"detail": result.detail})
                    progress(" ".join(undecided[-1].values()))
                elif (
                    cells == 1 and result.outcome is Outcome.CERTIFIED and len(PairProof.from_bytes(result.proof or b"", scene).pairs) == 1
                ):
                    spent[size].append(seconds)
            counts.append({"scene": name, "region": kind, "outcomes": dict(outcomes), "left_out": left_out, "seconds": total})
            progress(f"{name} {kind}: {dict(outcomes)}, {total:.1f} s")
    document = {"benchmark": "survey", "machine": measure.machine(), "cells": cells, "counts": counts, "undecided": undecided}
    if cells == 1:
        document["forecast"] = _fit({size: float(np.mean(seconds)) for size, seconds in spent.items()})
    return document


def _certified(scene: Scene, region: Region, cells: int) -> Iterator[tuple[PairResult, float]]:
    """Yields the result of every pair and its processor time. As in the service, an exception becomes the outcome ``error``."""
    polytope = scene.polytope(region.C, region.d)
    if cells == 1:
        certify = Certification(scene, polytope, region.center).certify
    else:
        certify = partial(_until_decided, CellCertification(scene, polytope), cells)
    for index in range(len(scene.pairs)):
        start = time.process_time()
        try:
            result = certify(index)
        except Exception as error:
            result = PairResult(Outcome.ERROR, Stage.SOS, detail=repr(error))
        yield result, time.process_time() - start


def _until_decided(certification: CellCertification, cells: int, index: int) -> PairResult:
    result = certification.certify(index, cells)
    return certification.certify(index, AGAIN * cells) if result.outcome is Outcome.INCONCLUSIVE else result


def _sizes(scene: Scene) -> list[SizeClass]:
    vertices = {geometry.name: len(geometry.vertices) for geometry in scene.geometries}
    return [(cost.joints, (vertices[cost.a], vertices[cost.b]), (cost.N_a, cost.N_b)) for cost in forecast(scene)]


def _fit(seconds: dict[SizeClass, float]) -> dict[str, Any]:
    """Returns the constants of the forecast that fit these mean times best, by relative error.

    It also returns how well these constants and the present ones fit.
    """
    rows = np.array([terms(joints, list(vertices), list(N)) for joints, vertices, N in seconds])
    measured = np.array(list(seconds.values()))
    constants, _ = nnls(rows / measured[:, None], np.ones(len(measured)))
    quantiles = {
        name: np.quantile(rows @ some / measured, [0, 0.1, 0.5, 0.9, 1]).tolist()
        for name, some in (("fitted", constants), ("present", SECONDS))
    }
    return {"size_classes": len(measured), "constants": constants.tolist(), "quantiles": quantiles}
