"""Maps of small arms: what they prove is true, what they cover, and that the effort alone decides."""

from __future__ import annotations

import os
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.jobs.map import _adopted, grow_map, grow_round, ways_of
from certifier.map import growing as growing_module
from certifier.map.free_set import as_file, free_set
from certifier.map.growing import Growing
from certifier.map.pair import PIECES
from certifier.map.trees import FEW_JOINTS, Plan
from certifier.model import WORLD, Joint, JointKind, Pair
from certifier.pair.collisions import in_collision
from certifier.partition.sides import room_for
from certifier.proof import limits
from certifier.proof.map import MapProof, PairMap
from certifier.proof.partition import OBLIQUE, OPEN, PLANE
from certifier.proof.sub_scene import sub_scene
from certifier.verify.map import verify_map
from ciris.free_set import FreeSet
from tests.certifier.scenes import ball, beads, box, hand, planar_arm, two_arms

CROWDED = box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 0.9, 0.0))


def scenes():
    slide = planar_arm(2, CROWDED)
    return {
        "boxes": planar_arm(2, CROWDED),
        "ball": planar_arm(2, ball("world/obstacle", WORLD, 0.2, (0.8, 0.9, 0.0)), padding=0.01),
        "beads": beads(3),
        "hand": hand(),
        "two arms": two_arms(2, apart=3.0),
        "slide": replace(slide, joints=(replace(slide.joints[0], kind=JointKind.PRISMATIC), slide.joints[1])),
    }


@pytest.fixture(scope="module", params=scenes())
def grown(request):
    scene = scenes()[request.param]
    return scene, grow_map(scene, 0.95, deadline_s=30)


def samples_of(scene, count=20000):
    q = np.random.default_rng(7).uniform(scene.q_lower, scene.q_upper, size=(count, scene.n))
    return scene.to_s(q)


def inside(scene, proof: MapProof, samples):
    """Which configurations the map proves to be free, by a walk through the proof's own streams."""
    free = dict.fromkeys(scene.pairs, np.zeros(len(samples), dtype=bool))
    for pairs, part in zip(proof.pairs, proof.maps, strict=True):
        apart = in_planes(part, samples[:, sub_scene(scene, pairs).positions])
        free |= {pair: free[pair] | apart for pair in pairs}
    return np.logical_and.reduce(list(free.values()))


def in_planes(part: PairMap, s):
    """Which configurations (S, k) lie in a cell that has a plane."""
    nodes, cuts, normals, apart = iter(part.nodes.tolist()), iter(part.cuts.tolist()), iter(part.normals), np.zeros(len(s), dtype=bool)

    def walk(here):
        kind = next(nodes)
        if kind >= 0:
            cut, at = next(cuts), s @ next(normals) if kind == OBLIQUE else s[:, kind]
            walk(here & (at <= cut))
            walk(here & (at > cut))
        elif kind == PLANE:
            apart[here] = True

    walk(np.ones(len(s), dtype=bool))
    return apart


def test_most_of_the_free_configurations_are_proved_and_none_in_collision(grown):
    scene, found = grown
    samples = samples_of(scene)
    collides, proved = in_collision(scene, samples), inside(scene, found.proof, samples)
    assert not (collides & proved).any()
    share = proved[~collides].mean()
    assert share >= 0.93
    assert found.coverage.share == pytest.approx(share, abs=0.03)
    assert (found.reason, found.refused) == ("coverage", 0)


def test_its_file_is_read_again_and_holds(grown):
    scene, found = grown
    data = found.proof.to_bytes()
    assert MapProof.from_bytes(data).to_bytes() == data
    statement = verify_map(data)
    assert statement.cells == found.cells
    assert statement.missing == 0
    assert statement.scene.hash == scene.hash


def test_the_same_effort_gives_the_same_map_whatever_the_processes(grown):
    scene, found = grown
    assert grow_map(scene, 0.95, processes=2).proof.to_bytes() == found.proof.to_bytes()


def test_a_former_map_of_the_same_scene_is_gone_on_with(grown):
    scene, found = grown
    again = Growing(scene, np.zeros((0, scene.n)), former=MapProof.from_bytes(found.proof.to_bytes()))
    assert again.coverage == found.coverage
    assert again.planes == found.cells
    more = grow_map(scene, min(1.0, found.coverage.share + 0.01), deadline_s=20, former=found.proof)
    assert more.coverage.share >= found.coverage.share
    statement = verify_map(more.proof.to_bytes())
    assert statement.cells == more.cells >= found.cells
    samples = samples_of(scene)
    proved = inside(scene, more.proof, samples)
    assert (proved >= inside(scene, found.proof, samples)).all()
    assert not (in_collision(scene, samples) & proved).any()


def test_a_new_obstacle_opens_its_own_pairs_alone():
    before, post = planar_arm(4, CROWDED), box("post/box", "post", (0.1, 0.1, 0.3), (-0.9, 1.4, 0.0))
    weld = Joint("post", JointKind.WELD, WORLD, "post", np.zeros(3), np.eye(4), np.eye(4))
    after = replace(
        before,
        joints=(*before.joints, weld),
        bodies=(*before.bodies, "post"),
        geometries=(*before.geometries, post),
        pairs=(*before.pairs, *(Pair(geometry.name, post.name) for geometry in before.geometries[:-1])),
    )
    first = grow_map(before, 0.95)
    anew, taken = grow_map(after, 0.93), grow_map(after, 0.93, former=first.proof)
    assert taken.looked < 0.8 * anew.looked
    samples = samples_of(after)
    assert not (in_collision(after, samples) & inside(after, taken.proof, samples)).any()
    assert verify_map(taken.proof.to_bytes()).missing == 0
    known = {part.scene.hash: part for part in first.proof.maps}
    for pairs, part in zip(taken.proof.pairs, taken.proof.maps, strict=True):
        if all(post.name not in (pair.a, pair.b) for pair in pairs):
            old = known[part.scene.hash]
            s = samples[:, sub_scene(after, pairs).positions]
            assert (in_planes(part, s) >= in_planes(old, s)).all()


def test_a_former_map_with_another_padding_is_of_no_use():
    scene = planar_arm(2, CROWDED)
    other = grow_map(replace(scene, padding=0.02), 0.9)
    assert grow_map(scene, 0.9, former=other.proof).proof.to_bytes() == grow_map(scene, 0.9).proof.to_bytes()


@pytest.mark.parametrize("ignored", range(4))
def test_a_pair_that_is_ignored_leaves_the_others_of_its_bodies(ignored):
    """The geometries of a rigid part are looked at together, and then apart."""
    one = planar_arm(2, CROWDED)
    other = box("world/other", WORLD, (0.2, 0.2, 0.3), (-0.9, -1.2, 0.0))
    pairs = [pair for obstacle in (CROWDED, other) for pair in (Pair(bar.name, obstacle.name) for bar in one.geometries[:-1])]
    scene = replace(one, geometries=(*one.geometries, other), pairs=tuple(pairs[:ignored] + pairs[ignored + 1 :]))
    samples = samples_of(scene, 2000)
    free, collides = Plan(scene).free(samples), in_collision(scene, samples)
    assert not (free & collides).any()
    assert (free | collides).mean() > 0.999
    assert grow_map(scene, 0.9, deadline_s=20).reason == "coverage"


@pytest.mark.parametrize("joints", [FEW_JOINTS, FEW_JOINTS + 1])
def test_geometries_share_a_tree_where_few_joints_move_their_fattest_volumes(joints):
    scene = hand()
    samples = samples_of(scene, 2000)
    samples = samples[Plan(scene).free(samples)]
    found = Plan(scene).assigned(samples, lambda pairs: joints)
    assert any(len(pairs) > 1 for pairs in found) == (joints <= FEW_JOINTS)
    for pair in scene.pairs:
        numbers = np.concatenate([places for pairs, places in found.items() if pair in pairs])
        assert sorted(numbers) == list(range(len(samples))), "each configuration has one tree for each pair"


def test_of_two_parts_the_wider_one_is_divided_first():
    scene = hand()
    *fingers, board = scene.geometries
    boards = [replace(board, name=f"world/board{i}", vertices=board.vertices - (0.0, 3.8 * i, 0.0)) for i in range(2)]
    pairs = tuple(Pair(finger.name, board.name) for board in boards for finger in fingers)
    scene = replace(scene, geometries=(*fingers, *boards), pairs=pairs)
    samples = samples_of(scene, 2000)
    trees = Plan(scene).assigned(samples[Plan(scene).free(samples)], lambda pairs: 0)
    for board in boards:
        assert {Pair(finger.name, board.name) for finger in fingers} in map(set, trees)


def test_bodies_that_always_touch_have_no_cells():
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.3, 0.3, 0.3)))
    found = grow_map(scene, 0.9, deadline_s=10)
    assert (found.cells, found.reason, found.coverage.share) == (0, "nothing_left", 0.0)
    assert verify_map(found.proof.to_bytes()).missing == 1


def grown_until(growing, enough):
    """Lets a map grow until it has enough, or nothing is left to do, and returns how many cells were looked at."""
    while not enough(growing) and (tasks := growing.round()):
        for task in tasks:
            tree = growing.trees[task.pairs].pair
            growing.take(task, tree.advance(task.given, task.samples, task.weights, task.most, task.water))
    return growing.looked


def test_a_task_with_many_pieces_is_accepted_by_the_verifier():
    scene = planar_arm(3, ball("world/obstacle", WORLD, 0.2, (0.8, 0.9, 0.0)))
    growing = Growing(scene, np.zeros((0, 3)))
    tree = max(growing.trees.values(), key=lambda tree: tree.pair.joints)
    samples = np.ascontiguousarray(growing._samples[tree.cells.numbers][:, tree.pair.positions])
    given = tree.pair.root(np.arange(len(samples)))
    found = tree.pair.verified(given, tree.pair.advance(given, samples, np.ones(len(samples)), 3000, 0.0))
    vertices = sum(len(volume.vertices) for volume in tree.pair._volumes)
    assert len(found.proved.pieces) > 4 * len(room_for(vertices, PIECES).pieces), "the room for pieces was made larger"
    assert found.looked > 0


def test_samples_that_are_never_proved_do_not_keep_new_ones_away(monkeypatch):
    growing = Growing(planar_arm(2, CROWDED), np.zeros((0, 2)))
    grown_until(growing, lambda growing: growing.coverage.share > 0.5)
    cells = max((tree.cells for tree in growing.trees.values()), key=lambda cells: np.diff(cells.samples).max())
    lost = np.diff(cells.samples).argmax()
    cells.level[lost] = 0
    monkeypatch.setattr(growing_module, "WANTED", np.diff(cells.samples)[lost] // 2)
    before = len(growing._samples)
    grown_until(growing, lambda growing: len(growing._samples) > before)
    assert len(growing._samples) > before


def test_a_map_that_has_ended_does_not_grow_on():
    """So a process that goes on with the map of another one, which died before it said that the map has ended, ends it there too."""
    growing = Growing(planar_arm(2, CROWDED), np.zeros((0, 2)))
    looked = grown_until(growing, lambda growing: growing.coverage.share >= 0.9)
    assert grow_round(growing, lambda _: [], 0.9, lambda: None) == "coverage"
    assert grow_round(growing, lambda _: [], 1.0, lambda: "deadline") == "deadline"
    assert growing.looked == looked


def test_wanted_configurations_come_first():
    """A configuration that is among the last ones without a demand."""
    scene = planar_arm(3, CROWDED, limit=2.5)
    samples, growing = samples_of(scene, 2000), Growing(scene, np.zeros((0, 3)))
    grown_until(growing, lambda growing: growing.coverage.share > 0.8)
    early = growing.contains(samples)
    grown_until(growing, lambda growing: growing.coverage.share > 0.93)
    late = samples[growing.contains(samples) & ~early][:1]
    efforts = [grown_until(Growing(scene, at), lambda growing: growing.contains(late).any()) for at in (late, late[:0])]
    assert efforts[0] < 0.5 * efforts[1]


def test_a_map_says_of_what_was_wanted_whether_it_is_proved():
    scene = planar_arm(2, CROWDED)
    at = scene.to_s(np.array([[-1.0, 0.0], [0.84, 0.0]]))
    assert grow_map(scene, 0.9, at=at).wanted == ["proved", "in_collision"]
    assert grow_map(scene, 0.9, deadline_s=0.0, at=at[:1]).wanted in (["open"], ["proved"])


@pytest.mark.parametrize("n", [2, 3])
def test_what_is_wanted_on_a_cut_is_proved_on_all_sides_as_lookups_need_it(n):
    """Cells are halved, so the zero configuration is on a cut of every joint that is cut."""
    scene = planar_arm(n, CROWDED)
    q = np.zeros((1, n))
    rows = np.random.default_rng(0).uniform(-1.0, 1.0, size=(60, n)).round(1) * np.resize([1.0, 0.0], (60, n))
    at = scene.to_s(np.concatenate([q, rows]))
    grown = grow_map(scene, 0.5, at=at)
    free = FreeSet.of_bytes(as_file(free_set(grown.proof)), "here")
    on_cuts = [(part.cuts == 0).any() for part in grown.proof.maps]
    assert any(on_cuts)
    assert free.contains(scene.to_q(at)).tolist() == [state == "proved" for state in grown.wanted]
    assert grown.wanted[0] == "proved"


def test_a_motion_that_is_wanted_comes_first():
    """A motion that is among the last ones without a demand."""
    scene, rng = planar_arm(3, CROWDED, limit=2.5), np.random.default_rng(0)
    growing, t = Growing(scene, np.zeros((0, 3))), np.linspace(0.0, 1.0, 200)[:, None]
    ways = rng.uniform(scene.q_lower, scene.q_upper, size=(300, 2, 3))
    ways = [way for way in ways if Plan(scene).free(scene.to_s(way[0] + t * (way[1] - way[0]))).all()]
    grown_until(growing, lambda growing: growing.coverage.share > 0.85)
    early = [share_of(growing, way) for way in ways]
    grown_until(growing, lambda growing: growing.coverage.share > 0.95)
    late = next(way for way, share in zip(ways, early, strict=True) if share < 1.0 and share_of(growing, way) == 1.0)
    efforts = [
        grown_until(Growing(scene, np.zeros((0, 3)), ways=ways), lambda growing: share_of(growing, late) == 1.0)
        for ways in (late[None], None)
    ]
    assert efforts[0] < 0.5 * efforts[1]


@pytest.mark.parametrize(
    "path",
    [
        [[0.5, 0.4], [0.0, 0.0], [0.5, -0.4]],
        [[0.4, 0.4], [-0.4, -0.4]],
        [[0.0, 0.5], [0.0, -0.5]],
        [[0.0, 0.0], [0.0, 0.0]],
        [[0.5, 0.0], [0.5, 0.0], [0.25, 0.0]],
    ],
    ids=["turns on a cut", "crosses a corner of cells", "runs along a cut", "stays on a cut", "waits, and runs along a cut"],
)
def test_a_motion_that_is_wanted_is_proved_on_all_sides_of_cuts(path):
    """Cells are halved, so there are cuts at 0."""
    scene, path = planar_arm(2, CROWDED), np.array(path)
    t = np.linspace(0.0, 1.0, 400)[:, None]
    samples = np.concatenate([a + t * (b - a) for a, b in pairwise(path)])
    assert Plan(scene).free(scene.to_s(samples)).all()
    growing = Growing(scene, np.zeros((0, 2)), ways=ways_of(scene, [path.tolist()]))
    grown_until(growing, lambda growing: share_of(growing, path) == 1.0)


def share_of(growing, path):
    try:
        return FreeSet.of_bytes(as_file(free_set(growing.proof())), "here").share_of(path)
    except ProofError:
        return 0.0


def test_a_map_ends_before_the_verifier_would_not_read_it(monkeypatch):
    monkeypatch.setattr(limits, "UNPACKED_BYTES", 20_000)
    found = grow_map(planar_arm(2, CROWDED), 1.0)
    assert found.reason == "size"


def test_the_map_so_far_is_there_when_a_process_dies(monkeypatch):
    monkeypatch.setattr("certifier.jobs.map._run", dying)
    found = grow_map(planar_arm(2, CROWDED), 1.0, processes=2)
    assert found.reason == "worker_lost"
    assert verify_map(found.proof.to_bytes()).cells == found.cells


def dying(task):
    if task.most > 100:
        os._exit(1)
    return _adopted[0](task)


def test_what_the_verifier_refuses_stays_open():
    """A worker that finds wrong planes costs cells, and nothing wrong is taken."""
    scene = planar_arm(2, CROWDED)
    growing = Growing(scene, np.zeros((0, 2)))
    (task, *_) = growing.round()
    tree = growing.trees[task.pairs].pair
    found = tree.advance(task.given, task.samples, task.weights, 50, 0.0)
    assert len(found.proved.planes) > 0
    assert tree.verified(task.given, found) is found
    refused = tree.verified(task.given, found._replace(proved=found.proved._replace(planes=-found.proved.planes)))
    assert (len(refused.proved.planes), refused.nodes.tolist()) == (0, [OPEN])
    before = growing.coverage
    growing.take(task, refused)
    assert (growing.coverage, growing.refused) == (before, 1)
    assert not growing.trees[task.pairs].weights(np.ones(100000)).any()
