"""Where a cell is cut: in the joint that changes the gap between the bodies most, and for coarse volumes until it is narrow."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.model import WORLD
from certifier.partition import search
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies, Undecided
from certifier.partition.cell import Cell
from certifier.partition.certification import CellCertification
from certifier.partition.hulls import gaps
from certifier.partition.search import NARROW_APART, NARROW_COARSE, NARROW_CUT, Search
from certifier.partition.shared import Shared
from certifier.partition.together import volumes_of
from certifier.partition.tree import Node, OpenCell
from certifier.proof.partition import OPEN, PLANE
from tests.certifier.scenes import box, cube, planar_arm
from tests.certifier.truth import distances_at


def apart(links, place):
    """An arm of bars and a block, the pair of the block and the last bar alone, and the area of a cube about the arm stretched out."""
    scene = planar_arm(links, box("world/block", WORLD, (0.1, 0.1, 0.1), place))
    scene = replace(scene, pairs=scene.pairs[-1:])
    return scene, Area.of(scene, cube(scene, 0.0, 0.2), 0)


@pytest.mark.parametrize("place", [(3.6, 0.0, 0.0), (3.4, 1.6, 0.0), (1.0, -2.5, 0.5)])
def test_the_gap_changes_as_distances_do_that_are_computed_in_another_way(place):
    scene, area = apart(3, place)
    bodies, cell = Bodies(area, WORLD, volumes_of(scene, scene.pairs)), Cell.at(area, Node(), area.lower, area.upper, area.samples)
    for s in area.samples[:5]:
        changes = bodies.changes(cell, s, bodies.joints)
        for joint, change in zip(bodies.joints, changes, strict=True):
            X = np.tile(s, (3, 1))
            X[0, joint], X[2, joint] = area.lower[joint], area.upper[joint]
            distances = [min(distances_at(scene, x[None]).values()) for x in X]
            assert change * bodies.extent == pytest.approx(np.ptp(distances), rel=1e-3, abs=1e-5)


def test_a_joint_whose_ends_are_alike_is_cut_if_the_gap_changes_between_them():
    """The arm points at the block: joint 1 turns it away to either side, by as much."""
    scene, area = apart(2, (2.4, 0.0, 0.0))
    bodies, cell = Bodies(area, WORLD, volumes_of(scene, scene.pairs)), Cell.at(area, Node(), area.lower, area.upper, area.samples)
    changes = bodies.changes(cell, np.zeros(2), bodies.joints)
    assert changes[0] > changes[1] > 0
    ends = np.array([[area.lower[0], 0.0], [area.upper[0], 0.0]])
    near, far = (min(distances_at(scene, s[None]).values()) for s in ends)
    assert near == pytest.approx(far)


@pytest.mark.parametrize(("turn", "touching", "cut"), [(5.0, False, True), (5.0, True, False), (3.0, False, False), (20.0, True, True)])
def test_cells_of_bodies_that_seven_joints_move_are_cut_on_for_volumes_that_are_apart(turn, touching, cut):
    """A cell of the bodies themselves has hundreds below it. Where volumes touch, the search goes on with the next level sooner."""
    assert np.degrees(NARROW_APART) < 5.0 < np.degrees(NARROW_CUT) < np.degrees(NARROW_COARSE) < 20.0
    scene = planar_arm(7, box("world/block", WORLD, (0.3, 0.3, 0.3), (4.0, 5.6, 0.0)))
    scene = replace(scene, pairs=scene.pairs[-1:])
    looking = Search(*_given(CellCertification(scene, cube(scene, 0.0, 0.25))))
    ball = looking._levels[1]
    X = np.ascontiguousarray(looking._area.samples)
    touch = gaps(*ball.hulls, X) <= 0
    assert 0 < touch.sum() < len(X)
    half = np.full(7, np.tan(np.radians(turn) / 4))
    cell = Cell.at(looking._area, Node(), -half, half, np.zeros((1, 7)))
    points = X[touch == touching][:2]
    found = Undecided(points, points, np.ones(len(points)))
    assert (looking._cut_for(cell, ball, found) is not None) == cut


def test_narrow_cells_of_volumes_that_faces_separate_are_not_cut_for_the_bodies(monkeypatch):
    monkeypatch.setattr(search, "NARROW_APART", np.radians(20.0))
    scene = planar_arm(7, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (4.0, 5.8, 0.0)))
    certification = CellCertification(replace(scene, pairs=scene.pairs[-1:]), cube(scene, 0.0, 0.25))
    cuts = {}
    for faces in (True, False):
        keep = certification._area.center[None] if faces else None
        looking, root = Search(*_given(certification), keep), Node()
        assert (looking.parted is not None) == faces
        looking.run([OpenCell(root, certification._area.lower, certification._area.upper)], 600)
        nodes = list(root.preorder())
        cuts[faces] = {node.kind for node in nodes if node.children}
        assert any(node.kind == OPEN for node in nodes)
        if faces:
            moving = set(looking.parted.joints)
    assert cuts[True] <= moving < set(range(7))
    assert not cuts[False] <= moving, "without faces, cells are cut for the bodies themselves"


def test_narrow_cells_of_volumes_that_faces_separate_are_settled_where_slimmer_volumes_have_a_plane():
    scene = planar_arm(7, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (4.0, 5.8, 0.0)))
    certification = CellCertification(replace(scene, pairs=scene.pairs[-1:]), cube(scene, 0.0, 0.25))
    looking = Search(*_given(certification), certification._area.center[None])
    place = looking._levels.index(looking.parted)
    for half, kind in ((0.01, PLANE), (0.25, OPEN)):
        node, corner = Node(), np.full(7, half)
        looking._try_slimmer(Cell.at(looking._area, node, -corner, corner, np.zeros((1, 7))), np.zeros(7), place)
        assert node.kind == kind
        assert node.kind == OPEN or node.choice in looking._choices[:place]


def wedge():
    """The area of a wedge beside an arm of two bars and a block: in joint 1, it is much narrower than the joint limits."""
    scene, _ = apart(2, (2.4, 0.0, 0.0))
    C, d = np.array([[1.0, 0.0], [-1.0, 0.0], [0.3, 1.0]]), np.array([0.02, 0.01, 0.2])
    return Area.of(scene, scene.polytope(C, d), 0)


def test_a_side_that_the_polytope_leaves_free_is_cut_off_where_a_plane_was_not_proved():
    area = wedge()
    scene = area.scene
    looking = Search(area, Shared(area), volumes_of(scene, scene.pairs))
    cell = Cell.at(area, Node(), np.array([-0.01, -0.3]), np.array([1.0, 0.19]), area.samples)
    start = area.center
    cut = looking._beside_polytope(cell, looking.bodies, start, Undecided(area.samples, None, np.zeros(0), 1))
    assert cut.joint == 0
    assert area.samples[:, 0].max() < 0.02 < cut.value < 0.03
    no_plane = Undecided(area.samples, area.samples[:1], np.ones(1))
    assert looking._beside_polytope(cell, looking.bodies, start, no_plane) is None, "what lies beside the polytope is no reason for that"
    tight = Cell.at(area, Node(), np.array([-0.01, -0.3]), np.array([0.02, 0.19]), area.samples)
    assert looking._beside_polytope(tight, looking.bodies, start, Undecided(area.samples, None, np.zeros(0), 1)) is None


def _given(certification):
    return certification._area, certification._shared, certification._volumes(0)
