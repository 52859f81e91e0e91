"""Outcomes over partitions on small scenes, each feasible class beside its infeasible twin; every proof is verified and sampled again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks import catalogue
from certifier.errors import ProofError, RegionError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Geometry, Joint, JointKind, Pair, Polytope
from certifier.outcome import Outcome, Stage
from certifier.pair.certification import certify_pair
from certifier.partition import bodies, certification
from certifier.partition.area import Area
from certifier.partition.certification import CellCertification, CutOff
from certifier.partition.scouts import scouted
from certifier.partition.search import Search
from certifier.partition.shared import Shared
from certifier.partition.subtrees import open_cells
from certifier.partition.together import volumes_of
from certifier.partition.tree import OPEN
from certifier.polytopes.closest import first_within
from certifier.polytopes.gibbs import uniform_in_q
from certifier.polytopes.proved import ProvedBox
from certifier.proof.container import pack, unpack
from certifier.proof.negative import WitnessProof
from certifier.proof.partition import EMPTY, PLANE, PartitionProof
from certifier.verify.separations import verify_separation
from certifier.verify.witness import check_witness
from tests.certifier.scenes import ball, box, cube, obstacle, planar_arm, pose, random_tree, two_arms
from tests.certifier.truth import distances_at

CELLS = 300


def sampled_gap(scene, polytope, index, count=2000):
    """The least distance of the pair's padded bodies over samples of the polytope, uniform in q."""
    samples = uniform_in_q(polytope, scene, count // 20, 20, seed=7).reshape(-1, scene.n)
    return min(distances_at(replace(scene, pairs=(scene.pairs[index],)), samples).values())


def check_certified(scene, polytope, index, result):
    """The result's proof holds for a reader who has the file alone, is about the pair, and no sample contradicts it."""
    assert result.outcome is Outcome.CERTIFIED, result
    assert result.stage is Stage.CELLS
    proof = PartitionProof.from_bytes(result.proof, scene)
    statement = verify_separation(proof)
    assert scene.pairs[index] in statement.pairs
    assert statement.gap == result.margin
    assert 0 < result.margin <= sampled_gap(scene, polytope, index)
    return proof


def check_refuted(scene, polytope, index, result):
    """The configuration named lies in the polytope, and the padded bodies touch there."""
    assert result.outcome is Outcome.REFUTED, result
    assert polytope.contains(result.witness_s)
    assert distance(scene, index, result.witness_s) <= 1e-6
    check_witness(WitnessProof.from_bytes(result.proof, scene))
    assert polytope.contains(result.weakness.points).all()
    assert any((point == result.witness_s).all() for point in result.weakness.points)


def distance(scene, index, s):
    """The distance of the pair's padded bodies at s by closest points, negative or 0 where they touch."""
    pair, kinematics = scene.pairs[index], Kinematics.of(scene)
    a, b = scene.geometry(pair.a), scene.geometry(pair.b)
    A, B = (kinematics.points(WORLD, g.body, g.vertices, s[None]) for g in (a, b))
    found = first_within(A, B, np.inf)
    return found[1].gap - a.radius - b.radius - 2 * scene.padding


def certify(scene, polytope, index=0, cells=CELLS, **options):
    return CellCertification(scene, polytope, **options).certify(index, cells)


def passing(half, tip):
    """A tip that reaches past a block, and how far its two joints turn; only the pair of the tip and the block."""
    scene = planar_arm(2, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2.5)
    scene = replace(scene, geometries=(*scene.geometries, tip), pairs=(Pair(tip.name, "world/block"),))
    return scene, cube(scene, 0.0, half)


TIP = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0))
CLOSE = replace(TIP, radius=0.07)


@pytest.fixture
def one_piece(monkeypatch):
    """A vertex may take one piece, so that a polytope takes several cells though one plane separates the bodies."""
    monkeypatch.setattr(bodies, "PIECES", 1)


def test_a_ball_that_comes_near_gets_planes_although_their_normals_have_to_keep_their_length():
    """The ball comes within 0.04 m. Planes with the widest margin of their function alone have normals of very different lengths."""
    scene, polytope = passing(0.6, TIP)
    assert 0 < sampled_gap(scene, polytope, 0) < 0.08
    check_certified(scene, polytope, 0, certify(scene, polytope))
    thicker = replace(scene, geometries=(*scene.geometries[:-1], replace(TIP, radius=0.1)))
    check_refuted(thicker, polytope, 0, certify(thicker, polytope))


def nodes(scene, result):
    """The nodes of the proof of what is certified, or of what the search has left of what is not."""
    if result.subtrees is None:
        return PartitionProof.from_bytes(result.proof, scene).nodes.tolist()
    return unpack(result.subtrees, "subtrees")[1]["nodes"].tolist()


@pytest.mark.parametrize("shape", ["box", "ball"])
@pytest.mark.parametrize("kind", [JointKind.REVOLUTE, JointKind.PRISMATIC])
@pytest.mark.parametrize("links", [1, 2, 3])
def test_one_plane_is_enough_for_a_small_polytope_and_its_twin_is_refuted(links, kind, shape):
    free = planar_arm(links, obstacle(1.2, shape), kind=kind)
    region = cube(free, 0.0, 0.05)
    shared = CellCertification(free, region)
    for index in range(links):
        result = shared.certify(index, CELLS)
        check_certified(free, region, index, result)
        assert nodes(free, result) == [PLANE]
    blocked = planar_arm(links, obstacle(0.1, shape), kind=kind)
    check_refuted(blocked, region, 0, certify(blocked, region))


@pytest.mark.parametrize("half", [0.55, 0.6])
def test_cells_certify_what_one_plane_provably_cannot_and_the_twin_is_refuted(half):
    scene, polytope = passing(half, TIP)
    one = certify_pair(scene, 0, polytope)
    assert one.outcome is (Outcome.NOT_CERTIFIABLE if half == 0.6 else Outcome.CERTIFIED)
    check_certified(scene, polytope, 0, certify(scene, polytope))
    check_refuted(scene, cube(scene, 0.0, 0.7), 0, certify(scene, cube(scene, 0.0, 0.7)))


def with_shapes(seed):
    """A random tree with all kinds of joints, two bodies of a random shape each that may touch, and a random polytope about 0."""
    rng = np.random.default_rng(seed)
    tree = random_tree(seed)
    kinematics = Kinematics(tree)
    linked = [(a, b) for a in tree.bodies for b in tree.bodies if kinematics.chain(a, b)]
    a, b = linked[rng.integers(len(linked))]
    first, second = (shape(rng, name, body) for name, body in (("first", a), ("second", b)))
    way = rng.normal(size=3)
    way *= rng.uniform(0.2, 0.9) / np.linalg.norm(way)
    middle = kinematics.points(b, a, first.vertices, np.zeros((1, tree.n)))[0].mean(axis=0)
    second = replace(second, vertices=second.vertices - second.vertices.mean(axis=0) + middle + way)
    scene = replace(tree, geometries=(first, second), pairs=(Pair("first", "second"),), padding=0.01 * (seed % 2))
    C = rng.normal(size=(4, scene.n))
    C /= np.linalg.norm(C, axis=1)[:, None]
    around = cube(scene, 0.0, 0.4)
    return scene, Polytope(np.concatenate([C, around.C]), np.concatenate([rng.uniform(0.1, 0.3, 4), around.d]))


def shape(rng, name, body):
    """A sphere, a box or a capsule."""
    center, kind = rng.normal(size=3) * 0.3, rng.integers(3)
    if kind == 0:
        return ball(name, body, 0.1, center)
    if kind == 1:
        return box(name, body, (0.2, 0.1, 0.3), center)
    return Geometry(name, body, center + np.array([[0.0, 0.0, 0.0], [0.3, 0.0, 0.1]]), 0.07, {"kind": "capsule"})


def test_random_trees_and_shapes_get_no_outcome_that_sampling_contradicts():
    outcomes = []
    for seed in range(30):
        scene, polytope = with_shapes(seed)
        result = certify(scene, polytope)
        outcomes.append(result.outcome)
        (check_certified if result.outcome is Outcome.CERTIFIED else check_refuted)(scene, polytope, 0, result)
    assert min(outcomes.count(outcome) for outcome in (Outcome.CERTIFIED, Outcome.REFUTED)) >= 8


@pytest.mark.parametrize("radius", [0.0, 0.1])
def test_balls_about_one_point_are_refuted(radius):
    """The space of a search has no extent but that of their radii."""
    scene = planar_arm(2)
    balls = ball("arm/link1/ball", "arm/link1", radius, (0.0, 0.0, 0.0)), ball("world/ball", WORLD, radius, (0.0, 0.0, 0.0))
    scene = replace(scene, geometries=balls, pairs=(Pair("arm/link1/ball", "world/ball"),))
    polytope = cube(scene, 0.0, 0.3)
    check_refuted(scene, polytope, 0, certify(scene, polytope))


def test_bodies_that_nearly_touch_are_too_close_and_the_distance_is_the_one_there():
    """The ball comes within a millimetre. Thinner by 2 mm it is certified, thicker by 2 mm it touches."""
    scene, polytope = passing(0.6, replace(TIP, radius=0.082))
    result = certify(scene, polytope)
    assert result.outcome is Outcome.TOO_CLOSE, result
    assert polytope.contains(result.witness_s)
    apart = distance(scene, 0, result.witness_s)
    assert 0 < apart < 0.01
    assert f"are {1000 * apart:.3g} mm apart" in result.detail
    for radius, check in ((0.08, check_certified), (0.084, check_refuted)):
        other, _ = passing(0.6, replace(TIP, radius=radius))
        check(other, polytope, 0, certify(other, polytope))


@pytest.mark.usefixtures("one_piece")
def test_a_search_that_runs_out_of_cells_goes_on_from_where_it_was():
    scene, polytope = passing(0.6, replace(TIP, radius=0.08))
    box_ = ProvedBox.of_program(scene, polytope)
    shared = CellCertification(scene, polytope, box=box_)
    at_once = shared.certify(0, CELLS)
    check_certified(scene, polytope, 0, at_once)
    assert at_once.looked > 1
    rounds, result = [], shared.certify(0, 1)
    while result.open_cells and len(rounds) < 50:
        rounds.append([result.subtrees])
        result = shared.go_on(0, 1, rounds[-1])
        assert result.looked == 1
        assert result.outcome is Outcome.INCONCLUSIVE
        assert result.margin is None
    assert result.detail == "no cell is open; the cells are yet to be put together and verified"
    rounds.append([result.subtrees])
    assert len(rounds) >= 3
    check_certified(scene, polytope, 0, shared.put_together(0, rounds))


@pytest.mark.usefixtures("one_piece")
@pytest.mark.parametrize("parts", [2, 3])
def test_parts_of_a_pair_are_searched_and_verified_apart_and_put_together_to_one_proof(parts):
    scene, polytope = passing(0.6, replace(TIP, radius=0.08))
    shared = CellCertification(scene, polytope)
    rounds = [[shared.certify(0, 2).subtrees]]
    while open_cells(rounds[-1]):
        results = [shared.go_on(0, 1, rounds[-1], part, parts) for part in range(parts)]
        assert {result.outcome for result in results} == {Outcome.INCONCLUSIVE}
        assert sum(result.open_cells for result in results) == len(open_cells([result.subtrees for result in results]))
        rounds.append([result.subtrees for result in results])
    whole, shares = shared.put_together(0, rounds), [shared.put_together(0, rounds, part, parts) for part in range(parts)]
    check_certified(scene, polytope, 0, whole)
    assert {share.outcome for share in shares} == {Outcome.CERTIFIED}
    assert [share.proof for share in shares] == [whole.proof] + [None] * (parts - 1)
    assert min(share.margin for share in shares if share.margin is not None) == whole.margin
    wrong = [[tampered(data) for data in files] for files in rounds]
    assert Outcome.INCONCLUSIVE in {shared.put_together(0, wrong, part, parts).outcome for part in range(parts)}


def tampered(data):
    """The subtrees with planes moved."""
    header, arrays = unpack(data, "subtrees")
    planes = arrays["planes"].copy()
    planes[:, 3, 0] += 1.0
    return pack(header, {**arrays, "planes": planes})


@pytest.mark.usefixtures("one_piece")
def test_what_is_open_is_no_proof():
    scene, polytope = passing(0.6, CLOSE)
    result = certify(scene, polytope, cells=1)
    assert result.outcome is Outcome.INCONCLUSIVE
    assert result.proof is None
    assert result.open_cells == nodes(scene, result).count(OPEN) > 0
    together = CellCertification(scene, polytope).put_together(0, [[result.subtrees]])
    assert together.outcome is Outcome.INCONCLUSIVE
    assert "does not hold" in together.detail


@pytest.mark.usefixtures("one_piece")
def test_a_search_that_is_ending_names_points_of_every_open_cell():
    scene, polytope = passing(0.6, CLOSE)
    shared = CellCertification(scene, polytope)
    assert len(shared.certify(0, 1).weakness.points) == 0
    result = shared.certify(0, 1, cut_off=CutOff.ALL)
    assert result.outcome is Outcome.INCONCLUSIVE
    points, cells = result.weakness.points, open_cells([result.subtrees])
    assert polytope.contains(points).all()
    assert len(cells) == 2
    for _, low, up in cells:
        assert ((points >= low - 1e-9) & (points <= up + 1e-9)).all(axis=1).any()


def with_face(scene, polytope, c, d):
    """The polytope with a face more, before the joint limits."""
    place = len(polytope.d) - 2 * scene.n
    return Polytope(np.insert(polytope.C, place, c, axis=0), np.insert(polytope.d, place, d))


@pytest.mark.usefixtures("one_piece")
def test_what_was_begun_goes_on_when_a_face_has_cut_the_contact_off(monkeypatch):
    scene, polytope = passing(0.64, replace(TIP, radius=0.09))
    around = ProvedBox.of_program(scene, polytope)
    with monkeypatch.context() as patched:
        # A search that does not look for contacts proves some cells before one is met.
        patched.setattr(certification, "scouted", lambda *_: [])
        patched.setattr(bodies, "CLOSE", -1.0)
        blind = certify(scene, polytope, cells=20, box=around)
    assert blind.outcome is Outcome.INCONCLUSIVE
    first = CellCertification(scene, polytope, box=around).go_on(0, CELLS, [blind.subtrees])
    check_refuted(scene, polytope, 0, first)
    assert nodes(scene, first).count(PLANE) > 0
    c = np.array([0.0, 1.0])
    assert (first.weakness.points @ c > 0.58).all()
    smaller, elsewhere = with_face(scene, polytope, c, 0.58), with_face(scene, polytope, -c, 0.58)
    shared = CellCertification(scene, smaller, box=around)
    last = shared.go_on(0, CELLS, [first.subtrees])
    assert last.open_cells == 0
    result = shared.put_together(0, [[r.subtrees] for r in (blind, first, last)])
    check_certified(scene, smaller, 0, result)
    before, after = unpack(first.subtrees, "subtrees")[1]["planes"], PartitionProof.from_bytes(result.proof, scene).planes
    assert all((plane == after).all(axis=(1, 2)).any() for plane in before)
    again = CellCertification(scene, elsewhere, box=around).go_on(0, CELLS, [first.subtrees])
    check_refuted(scene, elsewhere, 0, again)


def gone_on_with(shared, first):
    """The result of a pair that is searched to its end from where the first search left it."""
    last = shared.go_on(0, CELLS, [first.subtrees])
    assert last.open_cells == 0
    return shared.put_together(0, [[first.subtrees], [last.subtrees]])


@pytest.mark.usefixtures("one_piece")
def test_cells_that_a_new_face_leaves_outside_are_shown_to_miss_the_polytope():
    scene, polytope = passing(0.6, CLOSE)
    around = ProvedBox.of_program(scene, polytope)
    first = certify(scene, polytope, cells=1, box=around)
    arrays = unpack(first.subtrees, "subtrees")[1]
    joint, value = arrays["nodes"][0], arrays["cuts"][0]
    smaller = with_face(scene, polytope, np.eye(2)[joint], value - 0.05)
    result = gone_on_with(CellCertification(scene, smaller, box=around), first)
    check_certified(scene, smaller, 0, result)
    assert nodes(scene, result)[-1] == EMPTY


@pytest.mark.usefixtures("one_piece")
def test_multipliers_of_the_joint_limits_stay_theirs_when_faces_are_added():
    """The root cell is larger than the joint limits, so the proofs of its planes need them."""
    scene = planar_arm(2, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2 * np.arctan(0.6))
    scene = replace(scene, geometries=(*scene.geometries, TIP), pairs=(Pair(TIP.name, "world/block"),))
    limits = scene.polytope([], [])
    around = replace(ProvedBox.of_program(scene, limits), mid=np.zeros(2), half=np.full(2, 0.7))
    shared = CellCertification(scene, limits, box=around)
    partial = next(r for r in (shared.certify(0, cells) for cells in range(1, 50)) if len(faces(r)))
    assert partial.outcome is Outcome.INCONCLUSIVE
    smaller = with_face(scene, with_face(scene, limits, [1.0, 1.0], 1.1), [-1.0, -1.0], 1.1)
    result = gone_on_with(CellCertification(scene, smaller, box=around), partial)
    check_certified(scene, smaller, 0, result)
    kept = PartitionProof.from_bytes(result.proof, scene)
    assert {*faces(partial)} <= {face - 2 for face in kept.faces.tolist()}


def faces(result):
    """The faces of the multipliers that a search has left."""
    return unpack(result.subtrees, "subtrees")[1]["faces"].tolist()


def blocks(y):
    """A link before four blocks side by side, welded to the world by a shelf that does not move."""
    scene = planar_arm(1, box("shelf/block0", "shelf", (0.1, 0.1, 0.1), (0.2, 0.0, 0.0)))
    weld = Joint("shelf/weld", JointKind.WELD, WORLD, "shelf", np.zeros(3), pose((0.0, y, 0.0)), np.eye(4), None, None, None)
    more = tuple(box(f"shelf/block{i}", "shelf", (0.1, 0.1, 0.1), (0.2 + 0.2 * i, 0.0, 0.0)) for i in range(1, 4))
    geometries = (*scene.geometries, *more)
    pairs = tuple(Pair("arm/link1/bar", g.name) for g in geometries[1:])
    return replace(scene, joints=(*scene.joints, weld), bodies=(*scene.bodies, "shelf"), geometries=geometries, pairs=pairs)


def test_one_proof_covers_what_lies_together_and_is_about_all_of_its_pairs():
    scene = blocks(1.0)
    region = cube(scene, 0.0, 0.2)
    shared = CellCertification(scene, region)
    results = [shared.certify(index, CELLS) for index in range(4)]
    proofs = [check_certified(scene, region, index, result) for index, result in enumerate(results)]
    assert len({result.proof for result in results}) == 1
    assert set(proofs[0].pairs) == set(scene.pairs)
    # Nearer, the blocks at the end are in the way. Every one has an outcome of its own.
    near = blocks(0.25)
    shared = CellCertification(near, region)
    outcomes = []
    for index in range(4):
        result = shared.certify(index, CELLS)
        outcomes.append(result.outcome)
        (check_certified if result.outcome is Outcome.CERTIFIED else check_refuted)(near, region, index, result)
    assert outcomes == [Outcome.CERTIFIED, *[Outcome.REFUTED] * 3]


@pytest.mark.parametrize(("padding", "outcome"), [(0.0, Outcome.CERTIFIED), (0.03, Outcome.CERTIFIED), (0.06, Outcome.REFUTED)])
def test_padding_is_part_of_the_proof(padding, outcome):
    gap = 0.1
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.15 + gap, 0.0)), padding=padding)
    region = cube(scene, 0.0, 0.01)
    result = certify(scene, region)
    (check_certified if outcome is Outcome.CERTIFIED else check_refuted)(scene, region, 0, result)
    if outcome is Outcome.CERTIFIED:
        assert result.margin < gap - 2 * padding


def test_a_proof_is_not_one_for_more_padding():
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (0.5, 0.25, 0.0)))
    padded = replace(scene, padding=0.06)
    region = cube(scene, 0.0, 0.01)
    proof = check_certified(scene, region, 0, certify(scene, region))
    with pytest.raises(ProofError):
        verify_separation(replace(proof, scene=padded))


@pytest.mark.parametrize("size", [0.05, 0.07])
def test_a_capsule_between_two_posts(size):
    """Its axis stays 0.068 m away from the posts."""
    posts = [ball(f"world/post{i}", WORLD, 0.01, (0.6, y, 0.0)) for i, y in enumerate((-0.1, 0.1))]
    capsule = Geometry("arm/link1/capsule", "arm/link1", np.array([[0.3, 0.0, 0.0], [0.7, 0.0, 0.0]]), size, {"kind": "capsule"})
    base = planar_arm(1)
    scene = replace(base, geometries=(capsule, *posts), pairs=tuple(Pair(capsule.name, post.name) for post in posts))
    region = cube(scene, 0.0, 0.02)
    for index in range(2):
        result = certify(scene, region, index)
        (check_certified if size < 0.06 else check_refuted)(scene, region, index, result)


def test_points_with_radii_that_swing_around_each_other():
    """Each is in the other's convex hull of all places, so the plane has to move."""
    scene = two_arms(1, apart=1.6, limit=1.2)
    left, right = (ball(f"{arm}/tip", f"{arm}/link1", 0.1, (1.0, 0.0, 0.0)) for arm in ("left", "right"))
    scene = replace(scene, geometries=(left, right), pairs=(Pair(left.name, right.name),))
    narrow, wide = scene.polytope([[0.0, 1.0], [0.0, -1.0]], [0.05, 0.05]), scene.polytope([], [])
    proof = check_certified(scene, narrow, 0, certify(scene, narrow))
    assert proof.planes[:, :3, 1:].any()
    check_refuted(scene, wide, 0, certify(scene, wide))


@pytest.mark.parametrize(("x", "outcome"), [(1.5, Outcome.CERTIFIED), (1.1, Outcome.REFUTED)])
def test_a_joint_that_turns_by_340_degrees(x, outcome):
    scene = planar_arm(1, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (x, 0.0, 0.0)), limit=np.radians(170))
    region = scene.polytope([], [])
    result = certify(scene, region)
    (check_certified if outcome is Outcome.CERTIFIED else check_refuted)(scene, region, 0, result)


@pytest.mark.parametrize(("apart", "outcome"), [(4.3, Outcome.CERTIFIED), (3.9, Outcome.REFUTED)])
def test_bodies_on_different_branches(apart, outcome):
    scene = two_arms(2, apart=apart, limit=1.0)
    region = cube(scene, 0.0, 0.2)
    result = certify(scene, region, 3)
    (check_certified if outcome is Outcome.CERTIFIED else check_refuted)(scene, region, 3, result)


def test_faces_that_couple_joints_of_the_pair_with_others_count():
    """The second link's joints are kept from the obstacle by two faces together, each of which involves the third joint."""
    scene = planar_arm(3, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.0, 1.4, 0.0)))
    region = cube(scene, [-0.2, -0.2, 0.0], 0.5)
    check_refuted(scene, region, 1, certify(scene, region, 1))
    faces = np.array([[1.0, 0.0, 1.0], [0.0, 1.0, -1.0]])
    smaller = scene.polytope(np.concatenate([faces, region.C]), np.concatenate([[0.0, 0.1], region.d]))
    proof = check_certified(scene, smaller, 1, certify(scene, smaller, 1))
    assert {0, 1} <= set(proof.faces.tolist())


def test_a_thin_polytope_across_its_box_is_proved_by_its_faces():
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.2, 0.2, 0.2), (1.0, 1.3, 0.0)), limit=2.5)
    band = scene.polytope([[1.0, 1.0], [-1.0, -1.0]], [0.05, 0.05])
    proof = check_certified(scene, band, 1, certify(scene, band, 1))
    assert len(proof.multipliers) > (proof.nodes == PLANE).sum()
    check_refuted(scene, scene.polytope([], []), 1, certify(scene, scene.polytope([], []), 1))


def test_the_same_seed_gives_the_same_proof_to_the_bit():
    scene, polytope = passing(0.6, TIP)
    first, second = (certify(scene, polytope, seed=3) for _ in range(2))
    assert first.proof == second.proof
    assert first.proof != certify(scene, polytope, seed=4).proof


@pytest.mark.parametrize(("half", "outcome"), [(0.4, Outcome.REFUTED), (0.01, Outcome.CERTIFIED)])
def test_contacts_in_a_small_corner_are_looked_for_again(half, outcome):
    """One of 200 000 samples of the cube about the seed touches, and the first look finds nothing; near the seed nothing is to be found."""
    scene = catalogue.scene("iiwa_sphere_shelf")
    index = next(i for i, pair in enumerate(scene.pairs) if {pair.a, pair.b} == {"iiwa/link_7/ball3", "shelf/boards/upper"})
    polytope = scene.polytope(*catalogue.cube(scene.to_s(catalogue.seed("iiwa_sphere_shelf")), half))
    result = certify(scene, polytope, index, cells=20)
    assert result.outcome is outcome
    if outcome is Outcome.REFUTED:
        check_refuted(scene, polytope, index, result)
        area = Area.of(scene, polytope, 0)
        assert not scouted(area, Search(area, Shared(area), volumes_of(scene, [scene.pairs[index]])).bodies, 0)


def test_an_empty_polytope_is_refused():
    scene = planar_arm(2)
    with pytest.raises(RegionError) as refusal:
        CellCertification(scene, scene.polytope([[1.0, 0.0], [-1.0, 0.0]], [-1.0, -1.0]))
    assert refusal.value.code == "polytope_empty"
