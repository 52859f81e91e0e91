"""Drake as a backend: whose word counts, which solvers there are, what Drake cannot take."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import CirisError
from certifier.jobs import reference
from certifier.jobs.reference import Reference, Solver, available
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Polytope, Scene
from certifier.outcome import Outcome
from certifier.pair.certification import certify_pair
from certifier.polytopes.ellipsoid import inscribed_ellipsoid
from tests.certifier.scenes import ball, box, planar_arm, pose

EYE = np.eye(2)
C = np.concatenate([EYE, -EYE])


def cube(half: float) -> np.ndarray:
    return np.full(4, half)


def test_the_open_solvers_are_available() -> None:
    assert {Solver.CLARABEL, Solver.SCS, Solver.CSDP} <= set(available())


@pytest.mark.parametrize("solver", [Solver.CLARABEL, Solver.SCS, Solver.CSDP])
@pytest.mark.parametrize(("half", "expected"), [(0.05, Outcome.CERTIFIED), (0.25, Outcome.NOT_CERTIFIABLE)])
def test_every_open_solver_tells_a_feasible_program_from_its_infeasible_twin(solver: Solver, half: float, expected: Outcome) -> None:
    found = Reference(planar_arm(2), solver).certify(1, C, cube(half))
    assert found.outcome is expected
    assert found.status.startswith(f"{solver}: ")
    assert min(found.build_seconds, found.solve_seconds) > 0


def test_drakes_almost_is_neither_yes_nor_no(monkeypatch: pytest.MonkeyPatch) -> None:
    """Drake says kSolutionFound for Clarabel's AlmostSolved; so it would here, if "Solved" were not the solver's own word for yes."""
    answers = reference._SOLVERS[Solver.CLARABEL]
    monkeypatch.setitem(reference._SOLVERS, Solver.CLARABEL, replace(answers, yes="another word", no="another word"))
    for half in (0.05, 0.25):
        assert Reference(planar_arm(2)).certify(1, C, cube(half)).outcome is Outcome.INCONCLUSIVE


@pytest.mark.parametrize(("solver", "words"), [("simplex", "simplex is unknown"), ("mosek", "mosek is not available or not licensed")])
def test_a_solver_that_is_not_there_is_an_error_that_lists_those_that_are(solver: str, words: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("MOSEKLM_LICENSE_FILE", raising=False)
    with pytest.raises(CirisError, match=words) as caught:
        Reference(planar_arm(2), solver)
    assert (caught.value.code, caught.value.hint) == ("solver_unavailable", "available: clarabel, scs, csdp")


def test_what_drake_cannot_take_is_an_error() -> None:
    with pytest.raises(CirisError, match="no padding"):
        Reference(planar_arm(2, padding=0.01))
    rounded = Geometry("world/obstacle", WORLD, box("", WORLD, (0.1, 0.1, 0.1), (1.5, 1.0, 0.0)).vertices, 0.05, {"kind": "rounded"})
    with pytest.raises(CirisError, match="can round at most two") as caught:
        Reference(planar_arm(2, obstacle=rounded))
    assert caught.value.code == "unsupported_shape"


@pytest.mark.parametrize("d", [[-1.0, -1.0, -1.0, -1.0], [1.0, 1.0, -1.0, 1.0]])
def test_nothing_is_certified_on_an_empty_polytope(d: list[float]) -> None:
    with pytest.raises(CirisError, match=r"no point satisfies|flat"):
        reference.certify(planar_arm(2), Polytope(C, np.array(d)), Solver.CLARABEL)


def two_arms() -> Scene:
    """Two arms of two joints, numbered left to right but listed by turns; the left one's obstacle is near, the right one's far."""
    joints, geometries = [], []
    for arm, x in (("left", -3.0), ("right", 3.0)):
        for i in range(2):
            parent = WORLD if i == 0 else f"{arm}/link1"
            body = f"{arm}/link{i + 1}"
            X_PF = pose((x, 0.0, 0.0) if i == 0 else (1.0, 0.0, 0.0))
            axis = np.array([0.0, 0.0, 1.0])
            joints.append(Joint(f"{arm}/joint{i}", JointKind.REVOLUTE, parent, body, axis, X_PF, np.eye(4), len(joints), -2.0, 2.0))
        geometries.append(box(f"{arm}/link2/bar", f"{arm}/link2", (1.0, 0.1, 0.1), (0.5, 0.0, 0.0)))
    geometries += [ball("world/near", WORLD, 0.2, (-1.3, 0.7, 0.0)), ball("world/far", WORLD, 0.2, (4.3, 3.0, 0.0))]
    pairs = (Pair("left/link2/bar", "world/near"), Pair("right/link2/bar", "world/far"))
    by_turns = (WORLD, "left/link1", "right/link1", "left/link2", "right/link2")
    return Scene("two arms", tuple(joints), by_turns, tuple(geometries), pairs, (), np.zeros(4))


def test_drakes_alternation_grows_what_it_certifies() -> None:
    scene = planar_arm(2)
    rounds = Reference(scene).alternate(C, cube(0.05), max_rounds=3, tolerance=1e-3)
    volumes = [inscribed_ellipsoid(scene.polytope(*polytope)).volume for polytope in [(C, cube(0.05)), *rounds]]
    assert volumes == sorted(volumes)
    assert volumes[-1] > 2 * volumes[0]
    assert Reference(scene).alternate(C, cube(0.25), max_rounds=3, tolerance=1e-3) == []


def test_columns_are_our_joints_on_a_branched_tree() -> None:
    """The box is narrow for one arm and wide for the other; Drake, which numbers s its own way, must not mix them up."""
    scene = two_arms()
    assert Reference(scene)._order != list(range(scene.n))
    rows = np.concatenate([np.eye(4), -np.eye(4)])
    verdicts = []
    for wide in itertools.product((0.05, 0.5), repeat=2):
        half = np.repeat(wide, 2)
        d = np.concatenate([half, half])
        for index in range(2):
            ours = certify_pair(scene, index, scene.polytope(rows, d), np.zeros(4)).outcome
            theirs = Reference(scene).certify(index, rows, d).outcome
            assert (ours is Outcome.CERTIFIED) == (theirs is Outcome.CERTIFIED)
            verdicts.append(theirs is Outcome.CERTIFIED)
    assert verdicts == [True, True, True, True, False, True, False, True]
