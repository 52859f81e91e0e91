"""Pairs that share one certificate: which they are, that volumes contain their geometries, and that proofs say so of each of them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.growth import whole
from certifier.growth.actions import Outcomes
from certifier.growth.machine import begin
from certifier.growth.options import GrowthOptions
from certifier.growth.state import Start
from certifier.jobs.local import grow, recertify
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair, Polytope
from certifier.outcome import Outcome
from certifier.pair.result import Weakness
from certifier.partition.certification import CellCertification
from certifier.partition.hulls import gaps, hull
from certifier.partition.together import LOST, divided, halves, together, volumes_of
from certifier.proof import limits
from certifier.proof.region import read_part
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.region import verify_region
from certifier.verify.volume import check_volume
from tests.certifier.scenes import beads, box, hand
from tests.scenes import box_seed


def samples(scene, half=0.3, count=500):
    return np.random.default_rng(0).uniform(-half, half, size=(count, scene.n))


KEEP = np.zeros((1, 2))


def units(scene, joined):
    """Returns the pairs that are certified as one, those by themselves included."""
    others = {other for members in joined.values() for other in members}
    return [(index, *joined.get(index, ())) for index in range(len(scene.pairs)) if index not in others]


def test_the_balls_of_a_link_are_certified_as_one_beside_an_obstacle():
    scene = beads()
    joined = together(scene, samples(scene), KEEP)
    assert sorted(units(scene, joined)) == [(0, 1, 2, 3), (4, 5, 6, 7)]


@pytest.mark.parametrize("count", [1, 3, 8, 9, 20])
def test_every_pair_is_in_one_unit_of_two_bodies_and_few_vertices(count):
    scene = beads(count, 1.0 / count)
    found = units(scene, together(scene, samples(scene), KEEP))
    assert sorted(index for unit in found for index in unit) == list(range(len(scene.pairs)))
    for unit in found:
        pairs = [scene.pairs[index] for index in unit]
        one, other = volumes_of(scene, pairs)
        assert {Pair(*sorted(names)) for names in itertools.product(one.geometries, other.geometries)} == set(pairs)
        assert max(len(one.vertices), len(other.vertices)) <= limits.CORNERS
        kinematics = ExactKinematics.at(scene, [])
        for volume in (one, other):
            check_volume(scene, kinematics, volume)


def test_balls_of_different_radius_are_not_joined():
    scene = beads(lean=(0.05, 0.0))
    assert sorted(units(scene, together(scene, samples(scene), KEEP))) == [(0, 1, 2), (3,), (4, 5, 6, 7)]


def test_pairs_that_are_left_out_of_the_scene_divide_a_hull():
    scene = beads()
    links = [[ball.name for ball in scene.geometries if ball.body == f"arm/link{link}"] for link in (1, 2)]
    scene = replace(scene, pairs=tuple(Pair(a, b) for a, b in itertools.product(*links)))
    assert units(scene, together(scene, samples(scene), KEEP)) == [tuple(range(16))]
    divided = replace(scene, pairs=scene.pairs[:-1])
    found = units(divided, together(divided, samples(scene), KEEP))
    assert sorted(map(len, found)) == [1, 2, 4, 8]
    assert sorted(index for unit in found for index in unit) == list(range(15))


def test_hulls_that_touch_what_none_of_their_balls_does_are_divided():
    # The obstacle is between the second and the third ball of the first link, where the hull is and the balls are not.
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.0, 0.0)))
    narrow = samples(scene, 0.01)
    assert sorted(units(scene, together(scene, narrow, KEEP)))[:2] == [(0, 1), (2, 3)]


def test_a_group_is_divided_where_its_hull_touches_what_none_of_its_balls_does():
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.0, 0.0)))
    away = np.array([[1.2, 0.0]])
    assert divided(scene, (0, 1, 2, 3), KEEP, away) == {0: (1,), 2: (3,)}
    assert divided(scene, (1, 2), KEEP, away) == {}, "two pairs are alone then"


def test_a_group_stays_together_where_one_of_its_balls_touches_as_well():
    scene = beads(obstacle=box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.875, 0.0, 0.0)))
    assert divided(scene, (0, 1, 2, 3), KEEP, np.array([[1.5, 0.0]])) is None


def test_growth_divides_a_group_that_touches_and_no_face_is_needed(monkeypatch):
    """The obstacle can be between two balls: it touches their hull, and none of them anywhere in the box that is proposed."""
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.35, 0.0)))
    scene = replace(scene, pairs=scene.pairs[:4])
    monkeypatch.setattr(whole, "together", lambda *_: {0: (1, 2, 3)})
    asked = GrowthOptions(seed=box_seed([0.0, 0.0], 0.25), cells=600)
    region = grow(scene, asked)
    assert proved(scene, region) > 1
    assert region.manifest["share"]["value"] == 1
    monkeypatch.setattr(whole, "divided", lambda *_: None)
    other = grow(scene, asked)
    assert proved(scene, other) == 1
    assert other.manifest["share"]["value"] < 0.9


def test_growth_divides_a_group_that_touches_where_no_face_can_be(monkeypatch):
    """As before, and a configuration at which the hull touches has to stay inside: nothing is cut off, so nothing is lost either."""
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.35, 0.0)))
    scene = replace(scene, pairs=scene.pairs[:4])
    monkeypatch.setattr(whole, "together", lambda *_: {0: (1, 2, 3)})
    region = grow(scene, GrowthOptions(seed=box_seed([0.0, 0.0], 0.25) | {"contain": [[0.24, 0.0]]}, cells=600))
    assert proved(scene, region) > 1
    assert region.manifest["share"]["value"] == 1


def test_a_group_is_divided_although_faces_for_another_one_cut_its_contacts_off(monkeypatch):
    """The first group pays for the faces at one place. When it is divided, the second one has to."""
    scene, groups, contacts = beads(), {0: (1, 2, 3), 4: (5, 6, 7)}, np.array([[0.5, 0.5], [0.52, 0.5]])
    monkeypatch.setattr(whole, "together", lambda *_: groups)
    monkeypatch.setattr(whole, "divided", lambda *_: {})
    start = Start(scene.polytope(np.concatenate([np.eye(2), -np.eye(2)]), [1.0] * 4), KEEP[0], KEEP)
    begun = whole.begin_stage(scene, replace(begin(scene, GrowthOptions(seed={})).state, start=start), start.rows)
    touching = Outcome.INCONCLUSIVE, Weakness(contacts, np.zeros(2), contacts=len(contacts)), 1
    reached = [(i, *(touching if i in groups else (Outcome.CERTIFIED, None, None))) for i, _ in begun.action.work]
    following = whole.after_cells(scene, begun.state, start, Outcomes.of_parts(begun.action, reached))
    assert following.state.whole.together == {}
    assert following.state.whole.polytope is begun.state.whole.polytope


def test_a_configuration_to_keep_divides_a_hull_that_no_sample_does():
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.0, 0.0)))
    away = samples(scene) + np.array([1.2, 0.0])
    assert (0, 1, 2, 3) in units(scene, together(scene, away, np.array([[1.2, 0.0]])))
    assert (0, 1, 2, 3) not in units(scene, together(scene, away, KEEP))


def test_only_a_small_share_of_the_samples_may_be_lost():
    scene = beads(4, 0.6, 0.05, box("world/obstacle", WORLD, (0.1, 0.1, 0.1), (1.2, 0.0, 0.0)))
    away = samples(scene, count=1000) + np.array([1.2, 0.0])
    for lost, joined in ((int(LOST * 1000), True), (int(LOST * 1000) + 1, False)):
        few = away.copy()
        few[:lost] = KEEP
        assert ((0, 1, 2, 3) in units(scene, together(scene, few, np.array([[1.2, 0.0]])))) is joined


def test_what_the_balls_touch_themselves_is_not_held_against_their_hull():
    scene = beads(obstacle=box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.875, 0.0, 0.0)))
    touching = np.zeros((100, 2))
    assert (0, 1, 2, 3) in units(scene, together(scene, touching, np.array([[1.5, 0.0]])))


def certified(scene, index, half):
    rows = np.vstack([np.eye(2), -np.eye(2)])
    limited = scene.polytope(rows, np.full(4, half))
    joined = together(scene, samples(scene, half), KEEP)
    return CellCertification(scene, Polytope(limited.C, limited.d), together=joined).certify(index, 500)


def test_a_proof_of_pairs_that_are_certified_as_one_is_about_each_of_them():
    scene = beads()
    result = certified(scene, 4, 0.3)
    assert result.outcome is Outcome.CERTIFIED
    proof = read_part(result.proof, scene)
    assert {f"arm/link2/ball{i}" for i in range(4)} <= {name for volume in proof.volumes for name in volume.geometries}


def test_pairs_of_which_one_touches_are_not_certified_as_one():
    scene = beads(obstacle=box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (2.05, 0.0, 0.0)))
    joined = {4: (5, 6, 7)}
    limited = scene.polytope(np.vstack([np.eye(2), -np.eye(2)]), np.full(4, 0.3))
    search = CellCertification(scene, Polytope(limited.C, limited.d), together=joined)
    outcomes = [search.certify(index, 500).outcome for index in (4,)]
    alone = CellCertification(scene, Polytope(limited.C, limited.d))
    assert [alone.certify(index, 500).outcome for index in (4, 5, 6, 7)] == [Outcome.CERTIFIED] * 3 + [Outcome.REFUTED]
    assert outcomes == [Outcome.INCONCLUSIVE]


def proved(scene, region):
    """Checks that the verifier accepts a proof of every pair, and returns how many proofs there are."""
    statement = verify_region(region.proof)
    assert set(statement.gaps) == set(scene.pairs)
    assert min(statement.gaps.values()) > 0
    return len({pair["proof_digest"] for pair in region.manifest["pairs"]})


def test_a_region_has_a_proof_of_every_pair_and_is_free():
    scene = beads()
    region = grow(scene, GrowthOptions(seed=box_seed([0.0, 0.0], 0.6), cells=600))
    assert proved(scene, region) < len(scene.pairs)
    C, d = (np.array(region.manifest[name]) for name in ("halfspace_normals", "halfspace_offsets"))
    s = np.random.default_rng(1).uniform(-1, 1, size=(20000, 2))
    inside = s[(s @ C.T <= d).all(axis=1)]
    assert len(inside) > 1000
    kinematics = Kinematics.of(scene)
    for pair in scene.pairs:
        one, other = volumes_of(scene, [pair])
        hulls = [hull(kinematics, one.body, v, v.radius, np.zeros(3), 1.0) for v in (one, other)]
        assert gaps(*hulls, inside).min() > 0


def test_a_region_of_such_pairs_is_certified_again_for_a_changed_scene():
    region = grow(beads(), GrowthOptions(seed=box_seed([0.0, 0.0], 0.5), cells=600))
    changed = beads(obstacle=box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.7, 1.4, 0.0)))
    proved(changed, recertify(changed, region.proof))


@pytest.mark.parametrize("seed", range(8))
def test_a_hand_of_several_bodies_shares_one_certificate_and_one_box_contains_it(seed):
    scene = hand(seed=seed)
    assert units(scene, together(scene, samples(scene), KEEP)) == [(0, 1, 2, 3)]
    around, obstacle = volumes_of(scene, scene.pairs)
    kinematics = ExactKinematics.at(scene, [])
    check_volume(scene, kinematics, around)
    assert len(around.vertices) == limits.CORNERS
    assert obstacle.is_geometry_of(scene)
    middle = around.vertices.mean(axis=0)
    with pytest.raises(ProofError, match="not contained"):
        check_volume(scene, kinematics, replace(around, vertices=middle + (1 - 1e-6) * (around.vertices - middle)))
    s = np.random.default_rng(seed).uniform(-1, 1, size=(200, 2))
    own = Kinematics.of(scene)
    for geometry in scene.geometries[:4]:
        inside = own.points(around.body, geometry.body, geometry.vertices, s)
        assert (inside > around.vertices.min(axis=0)).all()
        assert (inside < around.vertices.max(axis=0)).all()


@pytest.mark.parametrize("seed", range(4))
def test_a_hand_of_bodies_at_odd_angles_is_divided_where_its_bodies_lie_apart(seed):
    scene = hand(seed=seed)
    *bodies, _ = scene.geometries
    frame, zero = bodies[0].body, np.zeros((1, 2))
    center = {g.name: Kinematics.of(scene).points(frame, g.body, g.vertices.mean(axis=0)[None], zero)[0, 0] for g in bodies}
    spread = np.ptp(list(center.values()), axis=0)
    lower, upper = (np.array([center[g.name] for g in half])[:, spread.argmax()] for half in halves(Kinematics.of(scene), bodies))
    assert len(lower) == len(upper) == 2
    assert lower.max() <= upper.min()


def test_a_region_of_an_arm_with_a_hand_is_proved_of_each_of_its_bodies():
    scene = hand()
    region = grow(scene, GrowthOptions(seed=box_seed([0.0, 0.0], 0.3), cells=600))
    assert proved(scene, region) == 1


def test_a_volume_that_is_much_nearer_than_its_geometries_at_a_configuration_to_keep_is_divided():
    scene = hand()
    own, around = (min(distance(scene, [pair]) for pair in scene.pairs), distance(scene, scene.pairs))
    most = around - own / 2  # either volume is padded
    assert 0 < most < own / 2
    for padding, joined in ((0.0, True), (most - 1e-6, True), (most + 1e-6, False)):
        padded = replace(scene, padding=padding)
        assert ((0, 1, 2, 3) in units(padded, together(padded, KEEP, KEEP))) is joined


def distance(scene, pairs):
    """Returns the distance of the volumes of pairs at the origin, in metres."""
    kinematics, volumes = Kinematics.of(scene), volumes_of(scene, pairs)
    return float(gaps(*(hull(kinematics, WORLD, v, v.radius, np.zeros(3), 1.0) for v in volumes), KEEP)[0])
