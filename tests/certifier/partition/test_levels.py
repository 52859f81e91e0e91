"""The volumes that the cells of a pair are tried with, and what pairs share of what was found for them."""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np
import pytest
import yaml

from benchmarks import catalogue
from certifier.kinematics import Kinematics
from certifier.model import Volume
from certifier.outcome import Outcome
from certifier.partition import search
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies, Undecided, in_s
from certifier.partition.cell import Cell
from certifier.partition.certification import CellCertification, CutOff
from certifier.partition.frames import choose_frame
from certifier.partition.hulls import gaps
from certifier.partition.levels import APART, LOOKED, levels_of
from certifier.partition.search import Search
from certifier.partition.shared import Shared
from certifier.partition.tree import Node, OpenCell
from certifier.proof.partition import PartitionProof, choices_of
from certifier.scene import load_scene
from certifier.verify.coarse import check_coarse
from certifier.verify.kinematics import ExactKinematics
from certifier.verify.partition import _norms
from certifier.verify.separations import verify_separation
from tests.certifier.scenes import box, cube, planar_arm, two_arms
from tests.certifier.truth import distances_at

EXAMPLES = Path(__file__).parents[3] / "examples"
EXAMPLE = EXAMPLES / "ur3e_bin"
CELLS = 60
HANDS = 8
"""The pair of both last links, which six joints move."""


@cache
def facing(apart=5.0, half=0.6):
    """Two arms of three links, with a second body on either last link, and a polytope about a configuration where they are folded."""
    scene = two_arms(3, apart=apart)
    tips = [box(f"{arm}/link3/tip", f"{arm}/link3", (0.2, 0.2, 0.2), (0.9, 0.0, 0.0)) for arm in ("left", "right")]
    links = [f"{arm}/link3/{part}" for arm in ("left", "right") for part in ("bar", "tip")]
    pairs = tuple(pair for pair in scene.pairs) + tuple(
        replace(scene.pairs[0], a=a, b=b) for a in links[:2] for b in links[2:] if "tip" in a + b
    )
    scene = replace(scene, geometries=(*scene.geometries, *tips), pairs=pairs)
    return scene, cube(scene, 0.3, half)


def levels(scene, polytope, index):
    area, pair = Area.of(scene, polytope, 0), scene.pairs[index]
    volumes = Volume.of(scene.geometry(pair.a)), Volume.of(scene.geometry(pair.b))
    frame, _ = choose_frame(area.kinematics, volumes, area.lower, area.upper)
    coarse, found, *_ = levels_of(area, frame, volumes)
    chosen = choices_of(volumes, coarse)
    return area, coarse, [chosen[i + (1 + len(coarse[0])) * j] for i, j in found]


@pytest.mark.parametrize(("apart", "half", "joints"), [(5.0, 0.6, [6]), (5.5, 0.35, [6, 5]), (6.0, 0.6, [6, 4, 3]), (8.0, 0.6, [6, 1])])
def test_the_farther_bodies_are_apart_the_fewer_joints_move_the_coarsest_level(apart, half, joints):
    scene, polytope = facing(apart, half)
    area, coarse, found = levels(scene, polytope, HANDS)
    assert [len(area.kinematics.chain(a.body, b.body)) for a, b in found] == joints
    for a, b in found[-1:] if len(joints) > 1 else []:
        assert fat_balls_apart(area, a, b) >= APART[0] - 1 / LOOKED
    exact = ExactKinematics.at(scene, [])
    for volume in (*coarse[0], *coarse[1]):
        check_coarse(scene, exact, volume)


def fat_balls_apart(area, a, b):
    """At which share of the samples the balls, or the boxes' corners in their place, do not come as near as their radii."""
    A, B = (area.kinematics.points("world", v.body, v.vertices, area.samples[:LOOKED]) for v in (a, b))
    distances = np.linalg.norm(A[:, :, None] - B[:, None], axis=3).min(axis=(1, 2))
    return (distances > a.radius + b.radius).mean()


def hands(scene):
    kinematics = Kinematics.of(scene)
    return [i for i, pair in enumerate(scene.pairs) if len(kinematics.chain(scene.geometry(pair.a).body, scene.geometry(pair.b).body)) == 6]


def test_pairs_share_what_is_found_for_coarse_volumes_and_come_to_the_same_bytes_as_alone(monkeypatch):
    scene, polytope = facing(6.0)
    asked = []
    separate = Bodies.separate
    monkeypatch.setattr(Bodies, "separate", lambda self, *given: asked.append(1) or separate(self, *given))
    together = CellCertification(scene, polytope)
    indices = hands(scene)
    assert len(indices) == 4
    counts = []
    for index in indices:
        asked.clear()
        shared, with_others = together.certify(index, CELLS), len(asked)
        asked.clear()
        alone = CellCertification(scene, polytope).certify(index, CELLS)
        assert (shared.outcome, shared.subtrees, shared.proof) == (alone.outcome, alone.subtrees, alone.proof)
        assert shared.open_cells > 0
        counts.append((with_others, len(asked)))
    # The first pair asks as often as alone. A pair with the same fat balls asks for next to nothing as long as they are enough.
    assert counts[0][0] == counts[0][1] >= CELLS
    assert sum(with_others <= 0.05 * alone for with_others, alone in counts) == 2


def test_a_pair_is_certified_on_several_levels_and_its_twin_is_refuted():
    scene, q = load_scene(EXAMPLE / "scene.yaml"), np.array(yaml.safe_load((EXAMPLE / "seed.yaml").read_text())["q"])
    index = next(i for i, pair in enumerate(scene.pairs) if "wrist_3" in pair.a + pair.b and "tray/right" in pair.a + pair.b)
    q[0] -= 0.2  # towards this side of the bin
    polytope = cube(scene, scene.to_s(q), 0.3)
    result = CellCertification(scene, polytope).certify(index, 600)
    assert result.outcome is Outcome.CERTIFIED, result
    proof = PartitionProof.from_bytes(result.proof, scene)
    samples = Area.of(scene, polytope, 3).samples
    assert 0 < verify_separation(proof).gap <= min(distances_at(replace(scene, pairs=(scene.pairs[index],)), samples).values())
    assert set(proof.choices.tolist()) == {0, 1, 2}
    larger = CellCertification(scene, cube(scene, scene.to_s(q), 0.6)).certify(index, 600)
    assert larger.outcome is Outcome.REFUTED


def test_a_capsule_for_one_joint_is_tried_between_the_body_and_a_ball_for_three():
    """The flange of iiwa_gripper in its shelf; a configuration beside a board, and its twin where the flange would be in another one."""
    scene, q = load_scene(EXAMPLES / "iiwa_gripper" / "scene.yaml"), np.array([2.694, -1.059, -1.179, -1.004, -1.646, 0.915, 0.313])
    polytope = cube(scene, scene.to_s(q), 0.25)
    index, twin = (
        next(i for i, pair in enumerate(scene.pairs) if {pair.a, pair.b} == {"arm/link_7/box", f"shelf/boards/{board}"})
        for board in ("right", "top")
    )
    area, coarse, found = levels(scene, polytope, index)
    flanges = [(a if a.geometries == ("arm/link_7/box",) else b) for a, b in found]
    assert [(len(area.kinematics.chain(a.body, b.body)), len(flange.vertices)) for (a, b), flange in zip(found, flanges, strict=True)] == [
        (7, 8),
        (6, 2),
        (4, 1),
    ]
    exact = ExactKinematics.at(scene, [])
    for volume in (*coarse[0], *coarse[1]):
        check_coarse(scene, exact, volume)
    certification = CellCertification(scene, polytope)
    result = certification.certify(index, 600)
    assert result.outcome is Outcome.CERTIFIED, result
    proof = PartitionProof.from_bytes(result.proof, scene)
    assert sorted(len(volume.vertices) for volumes in proof.coarse for volume in volumes) == [1, 2], "cells use both"
    samples = Area.of(scene, polytope, 3).samples
    assert 0 < verify_separation(proof).gap <= min(distances_at(replace(scene, pairs=(scene.pairs[index],)), samples).values())
    assert certification.certify(twin, 600).outcome is Outcome.REFUTED


def test_a_proof_names_only_the_coarse_volumes_that_its_cells_choose():
    scene, polytope = facing(8.0)
    proof = PartitionProof.from_bytes(CellCertification(scene, polytope).certify(HANDS, 10).proof, scene)
    _, coarse, _ = levels(scene, polytope, HANDS)
    assert sum(map(len, coarse)) > 2
    assert list(map(len, proof.coarse)) == [1, 1]
    assert set(proof.choices.tolist()) == {3}


class Facing:
    """The hands of two arms on a cell that is a sliver in one joint, far from 0 in it."""

    def __init__(self, width: float) -> None:
        scene, polytope = facing(8.0)
        scene = replace(scene, padding=0.05)
        self.area, pair = Area.of(scene, polytope, 0), scene.pairs[HANDS]
        volumes = Volume.of(scene.geometry(pair.a)), Volume.of(scene.geometry(pair.b))
        frame, joints = choose_frame(self.area.kinematics, volumes, self.area.lower, self.area.upper)
        self.search, self.bodies = Search(self.area, Shared(self.area), volumes), Bodies(self.area, frame, volumes)
        lower, upper = self.area.center - 0.05, self.area.center + 0.05
        self.sliver = joints[-1]
        lower[self.sliver], upper[self.sliver] = 0.7, 0.7 + width
        start = (lower + upper) / 2
        self.cell = Cell(self.area, Node(), lower, upper, start[None], start[None])


@pytest.mark.parametrize("width", [1e-2, 1e-6, 1e-10, 1e-13])
def test_the_bound_of_a_normals_length_holds_for_the_verifier_in_a_sliver_too(width):
    given = Facing(width)
    rng, k = np.random.default_rng(0), len(given.bodies.joints)
    for _ in range(50):
        z = rng.normal(size=4 * (1 + k)) * 10.0 ** rng.uniform(-6, 0, size=4 * (1 + k))
        plane = in_s(given.bodies.pair, given.cell.lower, given.cell.upper, z)
        bounds = given.cell.lower[given.bodies.joints], given.cell.upper[given.bodies.joints]
        _, room = _norms(plane[None], bounds[0][None], bounds[1][None])
        assert room[0] >= 0


def test_a_cell_is_not_cut_where_it_is_a_sliver():
    given = Facing(1e-6)
    points = given.cell.points
    cut = partial(given.search._cut, given.cell, given.bodies)
    assert cut(Undecided(points, None, np.ones(1), joint=given.sliver)) != given.sliver
    wide = given.bodies.joints[0]
    assert cut(Undecided(points, None, np.ones(1), joint=wide)) == wide
    assert cut(Undecided(points, None, np.ones(1))) in set(given.bodies.joints) - {given.sliver}


def test_points_are_named_where_the_volumes_at_hand_touch_so_that_these_become_enough():
    """The fat balls of the hands touch in some open cells, the hands themselves do not."""
    scene, polytope = facing(6.0)
    certification = CellCertification(scene, polytope)
    assert len(certification.certify(HANDS, CELLS).weakness.points) == 0
    found = certification.certify(HANDS, CELLS // 2, cut_off=CutOff.COARSELY)
    area, _, alternatives = levels(scene, polytope, HANDS)
    weakness, (a, b) = found.weakness, alternatives[-1]
    assert (found.outcome, weakness.contacts) == (Outcome.INCONCLUSIVE, 0)
    assert weakness.joints == tuple(sorted(area.kinematics.chain(a.body, b.body)))
    assert len(weakness.points) > 0
    assert polytope.contains(weakness.points).all()
    ends = [area.kinematics.points("world", volume.body, volume.vertices, weakness.points) for volume in (a, b)]
    reach = np.linalg.norm(ends[0][:, :, None] - ends[1][:, None], axis=3).min(axis=(1, 2))
    assert (reach < a.radius + b.radius + 0.05).all()
    # How many points there are depends on the last digits, and so on the processor. What they are about does not.
    assert certification.certify(HANDS, CELLS, cut_off=CutOff.ALL).weakness.joints == ()


@cache
def reaching():
    """An arm of seven links beside an obstacle, and the pair of its last link, which seven joints move; a ball about it needs four."""
    scene = planar_arm(7, box("world/obstacle", "world", (0.3, 0.3, 0.3), (4.0, 5.8, 0.0)))
    return scene, cube(scene, 0.0, 0.25), len(scene.pairs) - 1


def test_points_are_named_where_a_ball_touches_that_saves_joints_so_that_faces_part_it():
    """The ball touches the obstacle in some open cells. Where no faces are added, only contacts of the link itself are named."""
    scene, polytope, index = reaching()
    without = CellCertification(scene, polytope).certify(index, CELLS // 2).weakness
    assert (len(without.points), without.joints) == (without.contacts, ())
    certification = CellCertification(scene, polytope, keep=np.zeros((1, scene.n)))
    found = certification.certify(index, CELLS // 2)
    area, _, alternatives = levels(scene, polytope, index)
    weakness, (a, b) = found.weakness, alternatives[1]
    assert (found.outcome, weakness.contacts) == (Outcome.INCONCLUSIVE, 0)
    assert weakness.joints == tuple(sorted(area.kinematics.chain(a.body, b.body))) == (0, 1, 2, 3)
    assert len(weakness.points) > 0
    assert polytope.contains(weakness.points).all()
    ends = [area.kinematics.points("world", volume.body, volume.vertices, weakness.points) for volume in (a, b)]
    assert {len(of_volume[0]) for of_volume in ends} == {1, 8}, "a ball and the obstacle"
    centers = next(of_volume for of_volume in ends if len(of_volume[0]) == 1)
    outside = np.abs(centers - np.array([4.0, 5.8, 0.0])).max(axis=(1, 2))
    assert (outside < a.radius + b.radius + 0.15 + 0.05).all()
    # How many points there are depends on the last digits, and so on the processor. What they are about does not.
    assert certification.certify(index, CELLS // 2, cut_off=CutOff.ALL).weakness.joints == ()


def parted(scene, polytope, index, faces=True):
    return search_of(CellCertification(scene, polytope), index, faces).parted


def search_of(certification, index, faces):
    """The search of a pair; with ``faces`` it knows a point that stays inside."""
    area = certification._area
    return Search(area, certification._shared, certification._volumes(index), area.center[None] if faces else None)


def test_faces_part_coarse_volumes_only_where_they_are_added_and_save_two_joints_of_seven():
    scene, polytope, index = reaching()
    assert parted(scene, polytope, index).joints == [0, 1, 2, 3]
    assert parted(scene, polytope, index, faces=False) is None
    assert parted(scene, polytope, index - 1) is None, "six joints move link 6"
    two, cube_of_two = facing(6.0)
    assert parted(two, cube_of_two, HANDS) is None, "both bodies would be coarse"


def test_faces_part_no_volumes_that_lack_room_at_a_point_to_keep():
    """Faces keep the ball about the hand from the obstacle where it has room at all points to keep, and else the links themselves."""
    scene, polytope, index = reaching()
    certification = CellCertification(scene, polytope)
    given = certification._area, certification._shared, certification._volumes(index)
    ball = Search(*given, np.zeros((1, scene.n))).parted
    radius = max(volume.radius for volume in ball.volumes)
    samples = certification._area.samples
    apart = ball.extent * gaps(*ball.hulls, samples)
    nearest = np.argsort(apart)[[0, 1, 2, 3, -3, -2, -1]]
    assert apart[nearest[0]] < search.ROOM * radius < apart[nearest[-1]]
    for s, distance in zip(samples[nearest], apart[nearest], strict=True):
        found = Search(*given, s[None]).parted
        assert (found is not None) == (distance > search.ROOM * radius)
        assert Search(*given, np.stack([np.zeros(scene.n), s])).parted is None or found is not None


def test_wide_cells_are_cut_for_the_volumes_that_faces_part_and_not_for_the_bodies():
    scene, polytope, index = reaching()
    certification = CellCertification(scene, polytope)
    cuts = {}
    for faces in (False, True):
        looking, root = search_of(certification, index, faces), Node()
        looking.run([OpenCell(root, certification._area.lower, certification._area.upper)], CELLS)
        cuts[faces] = {node.kind for node in root.preorder() if node.children}
    assert cuts[True] <= {0, 1, 2, 3}
    assert not cuts[False] <= {0, 1, 2, 3}, "without faces the link itself is tried in cells that hold no sample"


@cache
def two_wrists(half=0.5, right="wrist_1/box"):
    """A cube about the seed of dual_ur3e, and the pair of left/wrist_1 and a link of the right arm; eight joints move two wrists."""
    example = EXAMPLE.parent / "dual_ur3e"
    scene, q = load_scene(example / "scene.yaml"), np.array(yaml.safe_load((example / "seed.yaml").read_text())["q"])
    index = next(i for i, pair in enumerate(scene.pairs) if (pair.a, pair.b) == ("left/wrist_1/box", f"right/{right}"))
    return scene, cube(scene, scene.to_s(q), half), index


@pytest.mark.parametrize("half", [0.1, 0.2, 0.5])
@pytest.mark.parametrize("right", ["wrist_1/box", "forearm/capsule"])
def test_what_faces_part_of_two_chains_stays_the_same_where_fatter_balls_are_apart(half, right):
    """Or they would part fatter and fatter balls while the polytope shrinks, and lose far more."""
    given = two_wrists(half, right)
    assert parted(*given).joints == [0, 1, 2, 6, 7, 8]
    assert parted(*given, faces=False) is None


@pytest.mark.parametrize("faces", [False, True])
def test_cells_of_two_chains_are_not_cut_for_volumes_that_touch(monkeypatch, faces):
    """The fat balls touch somewhere, and slimmer ones never: with cuts for the fat ones, half of the cells are still open."""
    scene, polytope, index = two_wrists()
    results = []
    for touch in (search._touch, lambda bodies, found: False):
        monkeypatch.setattr(search, "_touch", touch)
        results.append(CellCertification(scene, polytope, keep=np.zeros((1, scene.n)) if faces else None).certify(index, 10 * CELLS))
    assert [result.outcome for result in results] == [Outcome.CERTIFIED, Outcome.INCONCLUSIVE]
    proof = PartitionProof.from_bytes(results[0].proof, scene)
    samples = Area.of(scene, polytope, 3).samples
    gap = verify_separation(proof).gap
    assert 0 < gap <= min(distances_at(replace(scene, pairs=(scene.pairs[index],)), samples).values())


def test_a_pair_of_two_chains_that_touches_is_refuted():
    """Fewer than one in 2000 of the configurations touch, and no search for contacts finds one: the cells come to it."""
    scene, _, index = two_wrists()
    result = CellCertification(scene, scene.polytope([], [])).certify(index, 4 * CELLS)
    assert result.outcome is Outcome.REFUTED, result


@pytest.mark.slow
def test_cells_are_not_cut_for_ever_in_joints_in_which_they_are_narrow(monkeypatch):
    """A ball about links 6 and 7 touches a board which link 7's own ball, 22 mm away, does not. It hardly moves with joint 6, which is wide
    in all cells, so cutting the other joints for it does not end."""
    scene, region = catalogue.scene("iiwa_dense_cupboard"), catalogue.region("iiwa_dense_cupboard", "wide")
    names = {"iiwa/link_7/ball4", "world/cupboard5"}
    (index,) = (i for i, pair in enumerate(scene.pairs) if {pair.a, pair.b} == names)
    polytope = scene.polytope(region.C, region.d)
    result = CellCertification(scene, polytope).certify(index, 6000)
    assert result.outcome is Outcome.CERTIFIED
    monkeypatch.setattr(search, "NARROW_CUT", 0.0)
    few, many = (CellCertification(scene, polytope).certify(index, cells) for cells in (1500, 3000))
    assert {few.outcome, many.outcome} == {Outcome.INCONCLUSIVE}
    assert many.open_cells > 2 * few.open_cells > 1000, "half of the cells are open, however many there are"


def test_cells_of_two_chains_are_cut_for_coarse_volumes_however_narrow_they_are(monkeypatch):
    """The next level has more joints, so there would be many more cells."""
    scene, polytope, index = two_wrists(1.0)
    found = []
    for narrow in (search.NARROW_CUT, np.pi):
        monkeypatch.setattr(search, "NARROW_CUT", narrow)
        result = CellCertification(scene, polytope).certify(index, CELLS)
        found.append((result.outcome, result.open_cells))
    assert found[0] == found[1]
    assert found[0][1] > 1, "cells were cut"
