"""The clearance of a motion, proved to 10 % and to 0.1 mm, and motions that are proved with padding of a request."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError, RegionError
from certifier.jobs.motion import certify
from certifier.motion.approach import FINEST
from certifier.motion.given import given
from certifier.motion.intervals import RESOLUTION
from certifier.motion.padding import padding_of
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.proof import limits
from certifier.proof.motion import Motion, Space
from certifier.verify.file import verify_file
from certifier.verify.motion import MotionStatement, MotionVerifier
from tests.certifier.motions import POST, TIP, distances, positions, raised, swing
from tests.certifier.scenes import planar_arm, two_arms


def enough(distance: float) -> float:
    """The clearance that has to be proved where the least distance is this one."""
    return max(0.9 * distance, distance - 1e-4)


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("gap", [0.3, 5e-3, 1e-3, 2e-4, 1e-5])
def test_the_clearance_of_a_swing_is_what_geometry_says(gap, space):
    """The tip passes the post at the gap, at 0."""
    scene = swing(gap, padding=0.01)
    found = certify(scene, given(scene, [[-1.5], [1.2]], Space.Q, space), clearance=True).document()
    assert enough(gap) <= found["clearance"] == found["proved_distance"] <= gap
    assert gap - 1e-12 <= found["nearest"]["distance"] <= found["clearance"] + min(0.1 * found["nearest"]["distance"], 1e-4) + 1e-9
    assert found["nearest"]["q"] == [pytest.approx(0, abs=0.03)]
    without = certify(scene, given(scene, [[-1.5], [1.2]], Space.Q, space)).document()
    assert (without["clearance"], without["nearest"]) == (None, None)


@pytest.mark.parametrize("gap", [3 * RESOLUTION, 10 * RESOLUTION])
def test_a_clearance_of_a_micrometre_is_proved_to_the_finest_resolution(gap):
    scene = swing(gap)
    found = certify(scene, given(scene, [[-1.5], [1.2]], Space.Q), clearance=True)
    assert found.outcome is Outcome.CERTIFIED
    assert max(0.0, gap - FINEST) < found.document()["clearance"] <= gap + 1e-12


@pytest.mark.parametrize("seed", range(6))
def test_the_clearance_is_that_of_dense_samples_for_lines_and_curves(seed):
    rng = np.random.default_rng(seed)
    scene = planar_arm(2) if seed % 2 else two_arms(apart=7.0)
    half = 0.4 if seed % 2 else 0.3
    controls = np.array([-0.4 if seed % 2 else 0.0] * scene.n) + rng.uniform(-half, half, (4, scene.n))
    motion = Motion(Space.Q, controls) if seed < 3 else raised(Motion(Space.Q, controls[:3], 2), 3)
    found = certify(scene, motion, clearance=True).document()
    times = np.linspace(0, 1, 400)
    sampled = min(distances(scene, positions(scene, motion, piece, times)).min() for piece in range(motion.pieces))
    nearest = found["nearest"]
    assert distances(scene, np.array([nearest["q"]]))[0] == pytest.approx(nearest["distance"], abs=1e-9)
    assert enough(min(sampled, nearest["distance"])) <= found["clearance"] <= min(sampled, nearest["distance"])
    assert nearest["distance"] <= sampled + 1e-4


def test_with_a_tube_the_clearance_is_that_of_the_tube():
    scene = planar_arm(2)
    motion = given(scene, [[-1.2, -0.5], [-0.4, 0.3], [0.1, -0.6]], Space.Q)
    found = certify(scene, motion, tube=True, clearance=True)
    tube, clearance = found.statement.rho, found.document()["clearance"]
    assert tube == certify(scene, motion, tube=True).statement.rho > 0.01
    rng, q = np.random.default_rng(0), np.concatenate([positions(scene, motion, piece, np.linspace(0, 1, 300)) for piece in range(2)])
    assert 0 < clearance <= distances(scene, q + tube * rng.choice([-1.0, 1.0], q.shape)).min()
    # A tip that turns about one joint moves exactly by the bound, so that what the tube takes is known. The nearest place is on the motion.
    scene = swing(0.2)
    found = certify(scene, given(scene, [[1.0], [0.0]], Space.Q), tube=True, clearance=True)
    least = 0.2 - found.statement.rho
    assert enough(least) <= found.document()["clearance"]
    assert found.nearest.distance == pytest.approx(0.2, abs=1e-4)


def test_where_a_tight_proof_takes_too_many_intervals_the_motion_is_certified_without(monkeypatch):
    scene = swing(0.05)
    motion = given(scene, [[-1.0], [1.0]], Space.Q)
    plain, tight = certify(scene, motion), certify(scene, motion, clearance=True)
    assert plain.intervals < tight.intervals
    monkeypatch.setattr(limits, "INTERVALS", tight.intervals - 1)
    found = certify(scene, motion, clearance=True)
    document = found.document()
    assert (found.outcome, document["clearance"], document["nearest"]) == (Outcome.CERTIFIED, None, None)
    assert document["proved_distance"] == plain.document()["proved_distance"]


@pytest.mark.parametrize("space", Space)
@pytest.mark.parametrize("tube", [False, True])
@pytest.mark.parametrize("padding", [0.0, 0.01])
def test_padding_of_a_request_is_kept_or_refuted_as_that_of_a_scene(space, tube, padding):
    """The bodies pass at 1 cm: 4.9 mm around each are proved, and 5.1 mm are not."""
    scene = swing(0.01, padding=padding)
    motion = given(scene, [[-1.5], [1.2]], Space.Q, space)
    kept = certify(scene, motion, tube, 0.0049)
    assert kept.outcome is Outcome.CERTIFIED
    assert kept.document()["padding"] == 0.0049
    assert verify_file(kept.proof).kind == "motion"
    assert 0.0098 <= kept.statement.gap <= 0.01
    broken, twin = certify(scene, motion, tube, 0.0051), certify(replace(scene, padding=padding + 0.0051), motion)
    for found in (broken, twin):
        assert (found.outcome, found.stop.piece, found.statement.rho) == (Outcome.REFUTED, 0, 0.0)
    assert broken.stop.time == pytest.approx(twin.stop.time, abs=1e-6)
    assert broken.stop.distance == pytest.approx(0.0102, abs=2e-7)
    assert broken.statement.gap >= 0.0102
    away, reach = 1.0 + TIP + POST + 0.01 + 2 * padding, TIP + POST + 2 * (padding + 0.0051)
    q = broken.document()["stop"]["q"][0]
    assert q == pytest.approx(-np.arccos((1 + away**2 - reach**2) / (2 * away)), abs=1e-4)
    begins = certify(scene, given(scene, [[0.0], [1.2]], Space.Q, space), tube, 0.0051)
    assert (begins.outcome, begins.proof, begins.document()["clearance"]) == (Outcome.REFUTED, None, None)


def test_a_tube_keeps_the_padding_and_the_clearance_is_beyond_it():
    scene = swing(0.2)
    motion = given(scene, [[1.0], [0.0]], Space.Q)
    found = certify(scene, motion, tube=True, padding=0.05, clearance=True)
    assert 0.9 * 0.1 < found.statement.rho < 0.1
    assert found.document()["clearance"] == found.statement.gap >= max(0.1, enough(0.2 - found.statement.rho))
    assert certify(scene, motion, padding=0.05, clearance=True).document()["clearance"] >= enough(0.2)


def test_a_proof_that_shows_less_than_the_padding_is_not_handed_out(monkeypatch):
    scene = swing(0.1)
    motion = given(scene, [[-1.0], [1.0]], Space.Q)
    weak = search(scene, motion)
    monkeypatch.setattr("certifier.jobs.motion.search", lambda *arguments: weak)
    monkeypatch.setattr(MotionVerifier, "verify", lambda self, proof: MotionStatement(scene, motion, 1.0, 0.0, 0.09))
    with pytest.raises(ProofError) as refusal:
        certify(scene, motion, padding=0.0499)
    assert (refusal.value.code, refusal.value.field) == ("proof_motion", "padding")


@pytest.mark.parametrize("padding", [-1e-9, np.inf, np.nan, 1e7])
def test_what_is_no_padding_is_refused(padding):
    with pytest.raises(RegionError) as refusal:
        padding_of(padding)
    assert (refusal.value.code, refusal.value.field) == ("padding", "padding")
