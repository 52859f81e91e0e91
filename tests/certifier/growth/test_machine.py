"""What all ways to grow have in common, and the options that a job may have."""

from __future__ import annotations

import numpy as np
import pytest

from certifier import stored
from certifier.errors import CirisError, RegionError
from certifier.growth.actions import Finish, Outcomes, Propose
from certifier.growth.machine import advance, begin, stored_state
from certifier.growth.options import GrowthOptions
from certifier.growth.paper.options import PaperOptions
from certifier.jobs.local import grow
from certifier.model import WORLD
from certifier.outcome import Outcome
from certifier.seeding.options import SeedOptions
from tests.certifier.scenes import box, planar_arm

SCENE = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 1.2, 0.0)))


def test_a_given_polytope_is_certified_once_with_every_pair():
    begun = begin(SCENE, GrowthOptions(kind="certify", seed={"C": [[1.0, 0.0]], "d": [0.5]}))
    assert begun.action.pairs == [0, 1]
    assert begun.action.failures is None
    outcomes = {0: Outcome.NOT_CERTIFIABLE, 1: Outcome.CERTIFIED}
    ended = advance(SCENE, begun.state, Outcomes(begun.action, outcomes))
    assert ended.candidate is None
    assert isinstance(ended.action, Finish)
    assert ended.action.outcome is Outcome.NOT_CERTIFIABLE


@pytest.mark.parametrize(
    ("document", "field"),
    [
        ({"colour": 1}, "options.colour"),
        ({"kind": "shrink"}, "options.kind"),
        ({"cells": 0}, "options.cells"),
        ({"paper": True}, "options.paper"),
        ({"paper": {"contraction": "hope"}}, "options.paper.contraction"),
        ({"paper": {"pushes": -1}}, "options.paper.pushes"),
        ({"paper": {"contractions": 0}}, "options.paper.contractions"),
        ({"paper": {"bisection_steps": -1}}, "options.paper.bisection_steps"),
        ({"paper": {"max_rounds": True}}, "options.paper.max_rounds"),
        ({"paper": {"tolerance": 0}}, "options.paper.tolerance"),
        ({"paper": {"contraction": "uniform"}, "seed": {"contain": [[0.1, 0.1]]}}, "options.paper.contraction"),
        ({"seed": {"method": "limits"}}, "seed.method"),
        ({"seed": {"method": "box"}}, "seed.method"),
    ],
)
def test_bad_options_are_named(document, field):
    with pytest.raises(RegionError) as refusal:
        GrowthOptions.from_document(document)
    assert refusal.value.field == field


@pytest.mark.parametrize(("name", "value"), [("contraction", "targeted"), ("pushes", 0), ("max_rounds", 2), ("tolerance", 0.1)])
def test_an_option_of_the_papers_algorithm_at_another_place_is_refused_with_its_own(name, value):
    with pytest.raises(RegionError) as refusal:
        GrowthOptions.from_document({"seed": {"q": [0.0]}, name: value})
    place = (refusal.value.code, refusal.value.field, refusal.value.hint)
    assert place == ("unknown_option", f"options.{name}", f"give options.paper.{name}")


@pytest.mark.parametrize("name", ["cells", "stages"])
def test_an_option_of_no_use_to_the_papers_algorithm_is_refused(name):
    with pytest.raises(RegionError, match=f"no use for {name}"):
        GrowthOptions.from_document({"seed": {"q": [0.0]}, "paper": {}, name: 3})


@pytest.mark.parametrize("options", [GrowthOptions(), GrowthOptions(paper=PaperOptions())])
def test_a_state_of_another_version_is_refused(options):
    document = stored.document(begin(SCENE, options).state)
    assert stored.document(stored_state(document)) == document
    for other in ({**document, "reach_of_old": 1.0}, {name: value for name, value in document.items() if name != "options"}):
        with pytest.raises(CirisError) as refusal:
            stored_state(other)
        assert (refusal.value.code, refusal.value.hint) == ("other_version", "retry it")


@pytest.mark.parametrize(
    "seed",
    [
        {},
        {"C": [[1.0]], "d": [1.0]},
        {"C": [[1.0, 0.0]], "d": [1.0, 2.0]},
        {"C": [["x", 0.0]], "d": [1.0]},
        {"C": [[np.nan, 0.0]], "d": [1.0]},
    ],
)
def test_bad_polytopes_are_refused(seed):
    with pytest.raises(RegionError):
        begin(SCENE, GrowthOptions(kind="certify", seed=seed))


def test_points_that_cannot_be_contained_together_are_refused():
    with pytest.raises(RegionError) as refusal:
        grow(SCENE, GrowthOptions(seed={"q": [0.0, 0.0], "contain": [[0.9, 0.1]]}))
    assert refusal.value.field == "seed.contain[0]"


@pytest.mark.parametrize(
    ("growth", "iris", "expected"), [(0, None, 0), (7, None, 7), (7, 3, 3), (7, 0, 0), (2**31 + 5, None, 5), (2**63 - 1, None, 2**31 - 1)]
)
def test_the_random_seed_is_that_of_iris_too_unless_the_seed_has_its_own(growth, iris, expected):
    """A growth takes larger ones than IRIS does."""
    seed = {"q": [0.1, 0.2], "contain": [[0.9, 0.1]], **({} if iris is None else {"random_seed": iris})}
    action = begin(planar_arm(), GrowthOptions.from_document({"kind": "grow", "seed": seed, "random_seed": growth})).action
    assert isinstance(action, Propose)
    assert SeedOptions.from_document(action.seed).random_seed == expected
