"""A motion certified by a plain call."""

from __future__ import annotations

import json

import numpy as np
import pytest

from certifier.jobs.motion import certify
from certifier.motion.given import given
from certifier.outcome import Outcome
from certifier.proof.motion import Motion, Space
from certifier.verify.file import verify_file
from tests.certifier.motions import distances, swing
from tests.certifier.scenes import planar_arm, two_arms


def test_a_certified_motion_comes_with_its_verified_proof():
    scene = two_arms(apart=7.0)
    verdict = certify(scene, given(scene, [[0.3] * 6, [-0.4] * 6, [0.1] * 6], Space.Q), tube=True)
    found = json.loads(json.dumps(verdict.document()))
    assert (found["outcome"], found["guarantee"], found["stop"], found["waypoints"]) == ("certified", "exact", None, 3)
    assert found["certified_to"] == {"piece": 1, "time": 1.0, "q": [pytest.approx(0.1)] * 6}
    assert 0 < found["tube"] < 0.2
    statement = verify_file(verdict.proof)
    assert (statement.kind, statement.scene.hash) == ("motion", scene.hash)


@pytest.mark.parametrize("space", Space)
def test_a_contact_comes_with_its_place_and_a_proof_up_to_there(space):
    scene = swing(-0.01)
    verdict = certify(scene, given(scene, [[-1.0], [1.0]], Space.Q, space), tube=True)
    found = verdict.document()
    assert (found["outcome"], found["guarantee"], found["tube"]) == ("refuted", "none", None)
    assert abs(distances(scene, np.array([found["stop"]["q"]]))[0]) < 1e-6
    assert 0 <= found["stop"]["time"] - found["certified_to"]["time"] < 1e-6
    assert any("from its beginning" in line for line in verify_file(verdict.proof).lines)


def test_what_begins_in_contact_has_no_proof():
    scene = swing(-0.01)
    verdict = certify(scene, given(scene, [[0.0], [1.0]], Space.Q))
    assert (verdict.proof, verdict.document()["certified_to"], verdict.document()["proved_distance"]) == (None, None, None)


def test_waypoints_are_taken_from_one_space_to_the_other():
    scene = planar_arm(2, q_star=(0.3, -0.2))
    q = np.array([[-1.0, -0.5], [-2.0, 2.0]])
    in_s = given(scene, q, Space.Q, Space.S)
    assert np.allclose(in_s.waypoints, scene.to_s(q), rtol=1e-14)
    assert np.allclose(given(scene, in_s.waypoints, Space.S, Space.Q).waypoints, q, rtol=1e-14)
    assert certify(scene, in_s).outcome is certify(scene, given(scene, q, Space.Q)).outcome


def test_a_motion_that_rests_for_long_is_certified():
    """Its proof repeats itself, and is more than RATIO times smaller when it is deflated."""
    scene = two_arms(apart=7.0)
    verdict = certify(scene, given(scene, [*[[0.3] * 6] * 3000, [-0.4] * 6], Space.Q))
    assert verdict.outcome is Outcome.CERTIFIED
    assert verify_file(verdict.proof).kind == "motion"


def test_a_motion_of_more_pieces_than_a_proof_may_have_is_inconclusive(monkeypatch):
    monkeypatch.setattr("certifier.proof.limits.INTERVALS", 20)
    scene = two_arms(apart=7.0)
    verdict = certify(scene, Motion(Space.Q, np.linspace([0.3] * 6, [-0.4] * 6, 30)), tube=True)
    assert (verdict.outcome, verdict.proof) == (Outcome.INCONCLUSIVE, None)
