"""Why a growth has no region is said in terms of what users gave, whatever ended it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import CirisError, RegionError
from certifier.growth.obstacles import Obstacle
from certifier.growth.options import GrowthOptions
from certifier.growth.refusal import THIN, at_deadline, ended_by, refusal
from certifier.growth.state import GrowthState
from certifier.model import Polytope
from certifier.outcome import DEADLINE
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.seeding.proposal import NO_ROOM, mend
from tests.certifier.scenes import planar_arm

FLAT = Polytope(np.array([[1.0], [-1.0]]), np.array([1.0, -1.0]))


@pytest.mark.parametrize("ends", [lambda: chebyshev_center(FLAT), lambda: hit_and_run(FLAT, [2.0], 1, 0)], ids=["flat", "outside"])
def test_a_polytope_that_users_did_not_give_is_not_spoken_of(ends) -> None:
    with pytest.raises(RegionError) as error:
        ends()
    said = ended_by(error.value, "")
    assert (said.code, said.message, said.field) == ("not_grown", THIN, None)
    assert "polytope" not in f"{said} {said.hint}"
    assert said.hint == "try another seed", "no pair is named"


def test_other_errors_stay_as_they_are() -> None:
    error = CirisError("worker_lost", "a process died")
    assert ended_by(error, "") is error


def test_what_to_move_is_what_is_near() -> None:
    assert mend(f"the seed is 1 mm from contact of a and b{NO_ROOM}") == "move the seed away from the contact"
    assert mend(f"contain[0] is 1 mm from contact of a and b{NO_ROOM}") == "move it away from the contact"


def test_a_deadline_names_the_pair_that_was_most_in_the_way() -> None:
    scene = planar_arm(2)
    first, second = scene.pairs[:2]
    obstacles = {0: Obstacle(1, 1), 1: Obstacle(1, 3)}
    state = GrowthState(GrowthOptions(), obstacles=obstacles)
    reason = at_deadline(scene, state, "")
    assert reason == f"{DEADLINE}; {second.a} and {second.b} were in the way of a region in 3 rounds"
    assert refusal(reason, late=True).hint == "allow more time, or look at the pair named"
    assert at_deadline(scene, replace(state, obstacles={0: Obstacle(1, 1)}), "").endswith(
        f"{first.a} and {first.b} were in the way of a region in 1 round"
    )
    assert at_deadline(scene, None, "") == DEADLINE
    hindered = at_deadline(scene, None, f"the seed is near{NO_ROOM}")
    assert hindered == f"{DEADLINE}; the seed is near{NO_ROOM}"
    assert refusal(hindered, late=True).hint == "allow more time, or move the seed away from the contact"
    assert refusal(f"the seed is near{NO_ROOM}", late=False).hint == "move the seed away from the contact"
