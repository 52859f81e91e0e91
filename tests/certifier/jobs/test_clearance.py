"""The clearance of a region: what is proved, and what geometry and a grid say."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.jobs import clearance as module
from certifier.jobs.clearance import Nearest, clearance
from certifier.jobs.local import certify
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.proof.region import RegionProof
from certifier.verify.region import verify_region
from tests.certifier.motions import distances, swing
from tests.certifier.scenes import planar_arm


def region(scene, lower, upper):
    """The proof file of a box in q."""
    low, high = scene.to_s(np.array(lower)), scene.to_s(np.array(upper))
    eye = np.eye(scene.n)
    polytope = scene.polytope(np.concatenate([eye, -eye]), np.concatenate([high, -low]))
    found = certify(scene, polytope, cells=20_000, assemble=True).region
    assert found is not None
    return found.proof


def enough(distance):
    return min(0.9 * distance, distance - 1e-4)


@pytest.mark.parametrize("padding", [0.0, 0.01])
@pytest.mark.parametrize("gap", [0.2, 0.02, 2e-3])
def test_the_clearance_of_a_swing_is_what_geometry_says(gap, padding):
    """The tip passes the post at the gap, at 0."""
    scene = swing(gap, padding)
    data = region(scene, [-1.0], [0.8])
    found = clearance(data)
    assert enough(gap) <= found.distance <= gap
    assert found.tight
    assert found.nearest.distance == pytest.approx(gap, abs=1e-6)
    assert scene.to_q(found.nearest.s) == pytest.approx(0, abs=1e-3)
    assert found.distance >= verify_region(data).gap
    if found.proof is not None:
        proof, old = RegionProof.from_bytes(found.proof), RegionProof.from_bytes(data)
        assert replace(proof.scene, padding=padding).hash == scene.hash
        assert np.array_equal(proof.C, old.C)
        assert np.array_equal(proof.d, old.d)
        assert 2 * (proof.scene.padding - padding) + verify_region(found.proof).gap == pytest.approx(found.distance, abs=1e-12)


def test_the_clearance_of_two_joints_is_that_of_a_grid():
    scene = planar_arm(2)
    lower, upper = [-0.3, -0.9], [0.5, -0.2]
    found = clearance(region(scene, lower, upper))
    grid = np.stack(np.meshgrid(*(np.linspace(*ends, 60) for ends in zip(lower, upper, strict=True))), axis=-1).reshape(-1, 2)
    least = distances(scene, grid).min()
    assert found.tight
    assert found.proof is not None
    assert enough(found.nearest.distance) <= found.distance <= found.nearest.distance <= least + 1e-6
    assert distances(scene, scene.to_q(found.nearest.s)[None])[0] == pytest.approx(found.nearest.distance, abs=1e-9)


def test_what_samples_missed_is_found_by_certifying(monkeypatch):
    """The search begins with the far end of the region, as if no sample were near to the post."""
    scene = swing(0.02)
    pair, end = scene.pairs[0], scene.to_s([-0.9])
    far = Nearest(pair, end, float(distances(scene, np.array([[-0.9]]))[0]))
    monkeypatch.setattr(module, "_sampled", lambda *arguments: far)
    found = clearance(region(scene, [-1.0], [0.8]))
    assert found.tight
    assert enough(0.02) <= found.distance <= 0.02


def test_next_to_a_contact_the_proof_of_the_region_is_enough():
    scene = swing(9e-5)
    data = region(scene, [-1.0], [-0.02])
    known = verify_region(data).gap
    found = clearance(data)
    assert (found.proof is None) == (known >= enough(found.nearest.distance))
    assert found.tight


def test_where_it_cannot_be_certified_so_finely_what_is_proved_is_said(monkeypatch):
    data = region(planar_arm(2), [-0.3, -0.9], [0.5, -0.2])
    open_ = PairResult(Outcome.INCONCLUSIVE, Stage.CELLS)
    asked = []
    monkeypatch.setattr(module, "_certified", lambda scene, proof, *_: asked.append(scene.padding) or [open_] * len(scene.pairs))
    found = clearance(data)
    assert len(asked) < module.TRIES
    assert sorted(asked, reverse=True) == asked
    assert (found.distance, found.proof, found.tight) == (verify_region(data).gap, None, False)
    assert found.document()["tight"] is False
