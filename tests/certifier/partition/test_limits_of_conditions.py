"""The plane of a condition is known: cells are proved with it, and no plane is looked for."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from certifier.conditioned import BALL, condition_of, limit_of, with_conditions, without_conditions
from certifier.conditions import Condition, Cone, Distance, InBall, Inside
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.partition import bodies
from certifier.partition.certification import CellCertification
from certifier.proof.partition import PartitionProof
from certifier.verify.separations import verify_separation
from tests.certifier.scenes import cube
from tests.certifier.verify.condition_mutations import HALF, scene

CELLS = 400


def alone(condition: Condition) -> Scene:
    """The scene with one condition and its pairs alone."""
    found = with_conditions(without_conditions(scene()), [condition])
    return replace(found, pairs=tuple(pair for pair in found.pairs if condition_of(found, pair)))


LIMITS = [
    replace(one, faces=one.faces[:1]) if isinstance(one, Inside) else one
    for one in scene().conditions
    if not isinstance(one, Distance | InBall)
]
"""One face for each zone, and no ball: the pairs of several faces are first tried together, as one volume."""


@pytest.mark.parametrize("condition", LIMITS, ids=lambda one: one.name)
def test_every_cell_has_the_plane_of_the_limit(condition: Condition, monkeypatch: pytest.MonkeyPatch) -> None:
    def never(*_: Any) -> None:
        raise AssertionError("a plane is looked for")

    monkeypatch.setattr(bodies, "separated", never)
    found = alone(condition)
    shared = CellCertification(found, cube(found, 0.0, HALF))
    for i in range(len(found.pairs)):
        result = shared.certify(i, CELLS)
        assert result.outcome is Outcome.CERTIFIED
        assert result.proof is not None
        proof = PartitionProof.from_bytes(result.proof, found)
        verify_separation(proof)
        assert len(proof.planes)
        assert not proof.planes[:, :4, 1:].any()


@pytest.mark.parametrize("condition", LIMITS, ids=lambda one: one.name)
def test_where_a_condition_fails_the_configuration_is_found(condition: Condition) -> None:
    if isinstance(condition, Inside):
        condition = replace(condition, faces=tuple((a, b, c, d - 0.05) for a, b, c, d in condition.faces))
    found = alone(condition)
    shared = CellCertification(found, cube(found, 0.0, 0.12))
    results = [shared.certify(i, 2000) for i in range(len(found.pairs))]
    refuted = [result for result in results if result.outcome is Outcome.REFUTED]
    assert refuted
    assert all(result.witness_s is not None for result in refuted)
    assert all(result.outcome is Outcome.CERTIFIED for result in results if result not in refuted)


def test_a_limit_has_what_is_allowed_on_its_positive_side() -> None:
    box, cone = (next(one for one in scene().conditions if isinstance(one, kind)) for kind in (Inside, Cone))
    x = np.random.default_rng(0).normal(size=(1000, 3))
    planes = [limit_of(scene().geometry(f"conditions/{box.name}/face{i}")) for i in range(len(box.faces))]
    for plane, (*normal, d) in zip(planes, box.faces, strict=True):
        assert plane is not None
        assert ((x @ plane[:3] + plane[3] >= 0) == (x @ np.array(normal) <= d)).all()
    directions = x / np.linalg.norm(x, axis=1)[:, None]
    plane = limit_of(scene().geometry(f"conditions/{cone.name}/beyond"))
    assert plane is not None
    assert ((directions @ plane[:3] + plane[3] >= BALL) == (directions @ np.array(cone.along) >= np.cos(cone.angle))).all()
    assert [limit_of(scene().geometry(name)) for name in (f"conditions/{cone.name}/direction", "arm/link2/rod")] == [None, None]
