"""Padding of single pairs: what is free, what is proved and what a statement says is about the same distances, those of Drake."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from pydrake.geometry import QueryObject

from certifier.carry.carry import carry
from certifier.collisions.clearance import Clearance
from certifier.collisions.free import free_at_all
from certifier.collisions.seen import seen_of
from certifier.errors import CirisError, ProofError, SceneError
from certifier.jobs.clearance import _Distances, clearance
from certifier.jobs.motion import certify
from certifier.jobs.reference import Reference
from certifier.jobs.region import Region, certified_region
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Array, Pair, Scene, Volume
from certifier.motion.bodies import bodies_of
from certifier.motion.given import given
from certifier.motion.search import search
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.pair.collisions import contacts, in_collision
from certifier.pair.collisions import touching as touching_volumes
from certifier.partition.area import Area
from certifier.partition.certification import CellCertification
from certifier.partition.levels import levels_of
from certifier.partition.shared import Shared
from certifier.partition.together import together
from certifier.proof.motion import Space
from certifier.proof.negative import DualProof, WitnessProof
from certifier.proof.pair import PairProof
from certifier.proof.partition import PartitionProof
from certifier.proof.region import RegionProof
from certifier.scene.contacts import touching as overlapping
from certifier.scene.drake_model import build_diagram, geometry_name
from certifier.seeding.coarse_pairs import with_coarse_pairs
from certifier.seeding.drake_iris import checker
from certifier.seeding.free import check_free
from certifier.verify.dual import verify_dual
from certifier.verify.file import verify_file
from certifier.verify.motion import verify_motion
from certifier.verify.paddings import paddings
from certifier.verify.region import verify_region
from certifier.verify.separations import verify_separation
from certifier.verify.witness import verify_witness
from planner.sampling.ends import in_collision as deepest
from tests.certifier.proofs import region
from tests.certifier.scenes import accepted, ball, beads, box, cube, planar_arm, two_arms

BLOCK, POST = "world/block", "world/post"
OWN = {("arm/link1/bar", BLOCK): 0.0, ("arm/link2/tip", BLOCK): 0.15, ("arm/link2/tip", POST): 0.002}
INSIDE = np.array([-0.2, -0.2])
"""A configuration where all padded bodies are well apart."""


def arm(own: dict[tuple[str, str], float] | None = None, padding: float = 0.03) -> Scene:
    """Two bars and a ball at the tip, before a block and a post."""
    world = planar_arm(2, box(BLOCK, WORLD, (0.4, 0.3, 0.3), (0.6, 1.0, 0.0)), padding=padding)
    more = ball("arm/link2/tip", "arm/link2", 0.08, (1.0, 0.0, 0.0)), ball(POST, WORLD, 0.1, (1.3, -0.9, 0.0))
    moving = [*(g for g in world.geometries if g.body != WORLD), more[0]]
    own = OWN if own is None else own
    pairs = [Pair(g.name, other, padding=own.get((g.name, other))) for g in moving for other in (BLOCK, POST)]
    return replace(world, geometries=(*world.geometries, *more), pairs=tuple(pairs))


class Drake:
    """Measures by Drake how far apart the geometries of each pair are, less what its padding takes; (P,)."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._diagram = scene, build_diagram(scene)
        self._context = self._diagram.CreateDefaultContext()
        inspector = self._diagram.scene_graph().model_inspector()
        self._ids = {geometry_name(inspector, g): g for g in inspector.GetAllGeometryIds()}
        written = json.loads(json.dumps(scene.to_document()))
        self._reaches = 2 * np.array([own[0] if own else written["padding"] for _, _, *own in written["pairs"]])

    def __call__(self, q: Array) -> Array:
        self._diagram.plant().SetPositions(self._diagram.mutable_plant_context(self._context), q)
        port = self._diagram.scene_graph().get_query_output_port()
        query: QueryObject = port.Eval(self._diagram.mutable_scene_graph_context(self._context))
        ids = [(self._ids[p.a], self._ids[p.b]) for p in self._scene.pairs]
        return np.array([query.ComputeSignedDistancePairClosestPoints(a, b).distance for a, b in ids]) - self._reaches


def test_all_that_says_what_is_free_means_the_same_distances():
    scene = arm()
    drake, clearance_, drakes = Drake(scene), Clearance(scene), checker(scene)
    q = np.random.default_rng(0).uniform(scene.q_lower, scene.q_upper, (400, 2))
    distances = np.array([drake(x) for x in q])
    clear = (np.abs(distances) > 1e-6).all(axis=1)
    touching = [np.flatnonzero(row <= 0).tolist() for row in distances]
    free = ~(distances <= 0).any(axis=1)
    usual = ~np.array([Drake(arm({}))(x).min() <= 0 for x in q])
    assert min((usual & ~free).sum(), (free & ~usual).sum()) >= 2, "the paddings of pairs decide both ways"
    assert clear.mean() > 0.99
    q, touching, free, distances = q[clear], [t for t, c in zip(touching, clear, strict=True) if c], free[clear], distances[clear]
    s = scene.to_s(q)
    assert contacts(scene, s) == touching
    assert [{scene.pairs[i] for i in pairs} for pairs in touching] == list(overlapping(scene, q))
    assert np.array_equal(in_collision(scene, s), ~free)
    assert np.array_equal(free_at_all(bodies_of(scene), seen_of(scene), q, np.arange(6)), free)
    assert [clearance_.free(x) for x in q] == free.tolist()
    assert [drakes.CheckConfigCollisionFree(x) for x in q] == free.tolist()
    for x, row in zip(q[:60], distances[:60], strict=True):
        least, pair = clearance_.least(x)
        assert least <= row.min() + 1e-6, "Drake's distances may be too large"
        if row.min() < 0:
            assert (least, pair) == (pytest.approx(row.min(), abs=1e-6), scene.pairs[int(row.argmin())])
    for x, row in zip(q[~free][:5], distances[~free][:5], strict=True):
        assert deepest(scene, x).depth == pytest.approx(-row.min(), abs=1e-6)
        with pytest.raises(CirisError, match=r"overlap|padding of"):
            check_free(scene, x, "seed.q")


def test_a_refused_seed_names_the_padding_of_its_pair():
    scene = replace(arm(), pairs=(Pair("arm/link2/tip", POST, padding=0.5),))
    with pytest.raises(CirisError, match=r"with a padding of 0\.5 m on each"):
        check_free(scene, INSIDE, "seed.q")


@pytest.mark.parametrize("maker", [Certification, CellCertification])
def test_a_pair_is_certified_or_refuted_at_the_distance_of_its_own_padding(maker):
    """On tiny boxes about random configurations, either outcome is the one that Drake's distance asks for."""
    scene, seen = arm(), set()
    drake, rng = Drake(scene), np.random.default_rng(1)
    for q in rng.uniform(scene.q_lower, scene.q_upper, (30, 2)):
        distances = drake(q)
        for index in np.flatnonzero((np.abs(distances) > 2e-3) & (np.abs(distances) < 0.06)):
            tiny = maker(scene, cube(scene, scene.to_s(q), 1e-4))
            result = tiny.certify(index) if maker is Certification else tiny.certify(index, 50)
            assert result.outcome is (Outcome.CERTIFIED if distances[index] > 0 else Outcome.REFUTED), (q, index, distances[index])
            seen.add((int(index), result.outcome))
    assert {outcome for _, outcome in seen} == {Outcome.CERTIFIED, Outcome.REFUTED}
    assert len({index for index, _ in seen}) >= 4


def proofs_of(scene: Scene):
    """A proof of every positive kind about the tip and the block, whose padding is 0.15, and how far they are apart at most."""
    q, index, whole = INSIDE, 4, scene
    scene, polytope = replace(scene, pairs=scene.pairs[index : index + 1]), cube(scene, scene.to_s(q), 0.1)
    single = Certification(scene, polytope).certify(0).proof
    cells = CellCertification(scene, polytope).certify(0, 200).proof
    motion = search(scene, given(scene, [q - 0.1, q + 0.1], Space.Q)).proof
    assert motion is not None
    separations = PairProof.from_bytes(single, scene), PartitionProof.from_bytes(cells, scene)
    return (*(replace(proof, scene=whole) for proof in separations), motion)


def test_no_proof_holds_for_more_padding_of_its_pair():
    """The least padding with which the bodies touch at a configuration of the proof's polytope: all of it and more is refused."""
    scene = arm()
    for proof, verify in zip(proofs_of(scene), (verify_separation, verify_separation, verify_motion), strict=True):
        about = proof.scene
        (pair,) = [p for p in about.pairs if (p.a, p.b) == ("arm/link2/tip", BLOCK)]
        verify(proof)
        enough = clear_of(about, pair)
        for more in (enough + 1e-6, enough + 0.1, 10.0):
            thick = replace(pair, padding=0.15 + more)
            changed = replace(about, pairs=tuple(thick if p == pair else p for p in about.pairs))
            assert changed.hash != about.hash
            with pytest.raises(ProofError) as refusal:
                verify(replace(proof, scene=changed))
            assert refusal.value.code in ("proof_residual", "proof_partition", "proof_motion", "proof_margin", "proof_cell")
        # The padding of other pairs has nothing to do with it.
        others = tuple(p if p == pair else replace(p, padding=5.0) for p in about.pairs)
        verify(replace(proof, scene=replace(about, pairs=others)))


def clear_of(scene: Scene, pair: Pair) -> float:
    """How much more padding the pair has room for at a configuration that all proofs contain."""
    return float(Drake(replace(scene, pairs=(pair,)))(INSIDE)[0]) / 2


def test_a_refutation_holds_by_the_padding_of_its_pair_alone():
    scene = replace(arm({("arm/link2/tip", BLOCK): 0.0}), q_star=np.zeros(2))
    drake = Drake(scene)
    q = INSIDE
    need = drake(q)[4] / 2
    touching = replace(scene, pairs=tuple(replace(p, padding=need + 1e-6) if i == 4 else p for i, p in enumerate(scene.pairs)))
    proof = WitnessProof.from_bytes(Certification(touching, cube(scene, scene.to_s(q), 1e-4)).certify(4).proof, touching)
    assert verify_witness(proof).pair == scene.pairs[4]
    thin = tuple(replace(p, padding=need - 1e-4) if i == 4 else replace(p, padding=5.0) for i, p in enumerate(scene.pairs))
    with pytest.raises(ProofError, match="do not touch"):
        verify_witness(replace(proof, scene=replace(scene, pairs=thin)))


def test_that_no_certificate_exists_is_about_the_padding_of_its_pair():
    """A pair with less padding may have one. With more it has none either."""
    world = planar_arm(2, box(BLOCK, WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2.5, padding=1.0)
    tip = ball("arm/link2/tip", "arm/link2", 0.01, (1.0, 0.0, 0.0))
    scene = replace(world, geometries=(*world.geometries, tip), pairs=(*world.pairs, Pair(tip.name, BLOCK, padding=0.04)))
    found = Certification(scene, cube(scene, 0.0, 0.6), np.zeros(2)).certify(2)
    proof = DualProof.from_bytes(found.proof, scene)
    for padding, holds in ((0.0, False), (0.039, False), (0.04, True), (0.05, True)):
        changed = replace(scene, pairs=(*scene.pairs[:2], replace(scene.pairs[2], padding=padding)))
        if holds:
            verify_dual(replace(proof, scene=changed))
        else:
            with pytest.raises(ProofError):
                verify_dual(replace(proof, scene=changed))


def certified(scene: Scene, polytope) -> Region:
    shared = CellCertification(scene, polytope)
    results = [shared.certify(i, 2000) for i in range(len(scene.pairs))]
    assert {r.outcome for r in results} == {Outcome.CERTIFIED}
    center = scene.to_s(INSIDE)
    return certified_region(scene, accepted(polytope, center), {i: r.proof for i, r in enumerate(results)}, {})


def test_a_region_states_the_paddings_that_it_is_about():
    scene = arm()
    polytope = cube(scene, scene.to_s(INSIDE), 0.05)
    made = certified(scene, polytope)
    data = made.proof
    assert [p["padding"] for p in made.manifest["pairs"]] == [OWN.get((p.a, p.b), 0.03) for p in scene.pairs]
    assert made.manifest["padding"] == 0.03
    lines = verify_file(data).lines
    at = lines.index("padding 0.03 m around every body, but in 3 pairs:")
    assert lines[at + 1 : at + 4] == tuple(f"  {padding} m: '{a}' and '{b}'" for (a, b), padding in OWN.items())
    statement, drake = verify_region(data), Drake(scene)
    s = np.random.default_rng(0).uniform(-0.05, 0.05, (200, 2)) + scene.to_s(INSIDE)
    least = np.min([drake(q) for q in scene.to_q(s)], axis=0)
    assert all(0 < statement.gaps[pair] <= apart + 1e-9 for pair, apart in zip(scene.pairs, least, strict=True))
    for index, pair in enumerate(scene.pairs):
        thick = replace(pair, padding=scene.padding_of(pair) + least[index] / 2 + 1e-6)
        changed = replace(scene, pairs=tuple(thick if p == pair else p for p in scene.pairs))
        proof = RegionProof.from_bytes(data)
        with pytest.raises(ProofError):
            verify_region(replace(proof, scene=changed, proofs=tuple(replace(p, scene=changed) for p in proof.proofs)).to_bytes())


def test_the_clearance_of_a_region_is_beyond_the_padding_of_each_pair():
    scene = arm()
    polytope = cube(scene, scene.to_s(INSIDE), 0.02)
    found, drake = clearance(certified(scene, polytope).proof), Drake(scene)
    assert found.nearest.distance == pytest.approx(drake(scene.to_q(found.nearest.s)).min(), abs=1e-6)
    assert 0.85 * found.nearest.distance < found.distance <= found.nearest.distance
    if found.proof:
        verify_region(found.proof)


def test_a_proof_is_carried_over_where_the_padding_of_its_own_pairs_stays():
    scene = arm()
    old = RegionProof.from_bytes(certified(scene, cube(scene, scene.to_s(INSIDE), 0.05)).proof)
    changed = arm({**OWN, ("arm/link2/tip", BLOCK): 0.14})
    carried = carry(old, changed).proofs
    index = changed.pairs.index(Pair("arm/link2/tip", BLOCK))
    assert index not in carried
    assert {0, 1} <= carried.keys()
    thicker = carry(old, arm(padding=0.04)).proofs
    assert thicker.keys().isdisjoint({1, 3}), "these have the scene's padding"
    assert 0 in thicker
    for proof in (*carried.values(), *thicker.values()):
        verify_separation(proof)


def test_motions_keep_the_padding_of_each_pair():
    """A swing of the arm towards the block: the tip touches first, where its own padding says so."""
    motion = given(arm(), [[-0.9, 0.3], [0.7, 0.3]], Space.Q)
    for tip in (0.0, 0.1, 0.2):
        scene = arm({("arm/link2/tip", BLOCK): tip, ("arm/link2/bar", BLOCK): 0.0})
        stop = certify(scene, motion).document()["stop"]
        drake, times = Drake(scene), np.linspace(0, 1, 4001)
        touching = [t for t in times if (drake(np.array([-0.9 + 1.6 * t, 0.3])) <= 0).any()]
        assert stop["q"][0] == pytest.approx(-0.9 + 1.6 * touching[0], abs=1e-3)


def test_pairs_share_a_certificate_and_a_plane_only_with_the_same_padding():
    """Balls of a link whose paddings differ are not joined to one hull, and volumes of one shape are apart by their own padding."""
    scene = beads()
    samples = np.random.default_rng(0).uniform(-0.2, 0.2, (200, 2))
    joined = together(scene, samples, samples[:1])
    assert any(len(members) == 3 for members in joined.values())
    mixed = replace(scene, pairs=tuple(replace(p, padding=0.001) if i == 1 else p for i, p in enumerate(scene.pairs)))
    apart = together(mixed, samples, samples[:1])
    assert not any(1 in (first, *others) and others for first, others in apart.items())
    world = arm({("arm/link2/tip", BLOCK): 0.15})
    area = CellCertification(world, cube(world, 0.0, 0.05))._area
    twin = replace(world.geometry(BLOCK), name="world/twin")
    both = replace(world, geometries=(*world.geometries, twin), pairs=(*world.pairs, Pair("arm/link2/tip", twin.name)))
    shared, tip = Shared(replace(area, scene=both)), volume(both, "arm/link2/tip")
    one, other = (shared.bodies(WORLD, (tip, volume(both, name))) for name in (BLOCK, twin.name))
    assert one is not other
    assert {key[1]: value for key, value in with_padding(both, tip).items()} == {BLOCK: 0.15, twin.name: 0.03}


def volume(scene: Scene, name: str) -> Volume:
    return Volume.of(scene.geometry(name))


def with_padding(scene: Scene, tip) -> dict[tuple[str, str], float]:
    """What IRIS keeps clear of, for volumes of both obstacles."""
    found = {}
    for name in (BLOCK, "world/twin"):
        other = replace(volume(scene, name), radius=0.01)
        wider = with_coarse_pairs(scene, {(None, None): (tip, other)})
        found["tip", name] = wider.padding_of(wider.pairs[-1])
    return found


@pytest.fixture(params=[0.0, 0.02, 0.3])
def twins(request) -> Callable[[Scene], tuple[Scene, Scene]]:
    """A scene with a padding, and one whose pairs all have it as their own, while the scene's is another."""

    def made(scene: Scene) -> tuple[Scene, Scene]:
        own = tuple(replace(pair, padding=request.param) for pair in scene.pairs)
        return replace(scene, padding=request.param), replace(scene, padding=0.11, pairs=own)

    return made


def test_a_padding_of_all_pairs_is_the_padding_of_the_scene(twins):
    """What has no oracle of its own answers the same for both scenes: pairs joined, levels of volumes, volumes that touch, distances."""
    samples = np.random.default_rng(0).uniform(-0.4, 0.4, (300, 2))
    one, other = (together(scene, samples, samples[:1]) for scene in twins(beads()))
    assert one == other
    hands = two_arms(3, apart=6.5)
    one, other = (levels_of(Area.of(s, cube(s, 0.3, 0.4), 0), WORLD, volumes(s, s.pairs[-1])) for s in twins(hands))
    assert one.levels == other.levels
    one, other = (touching_volumes(Kinematics.of(s), volumes(s, s.pairs[4]), 4 * samples) for s in twins(arm({})))
    assert np.array_equal(one, other)
    one, other = (_Distances(s).of(s.pairs[4], s.to_s(samples[:9])) for s in twins(arm({})))
    assert np.array_equal(one, other)


def test_drakes_programs_refuse_padding_of_a_pair():
    scene = arm({("arm/link2/tip", BLOCK): 0.1}, padding=0.0)
    with pytest.raises(SceneError, match="no padding"):
        Reference(scene)
    Reference(arm({(p.a, p.b): 0.0 for p in scene.pairs}, padding=0.1))


def volumes(scene: Scene, pair: Pair) -> tuple[Volume, Volume]:
    return volume(scene, pair.a), volume(scene, pair.b)


def test_a_scene_without_paddings_of_pairs_has_the_document_and_the_hash_of_before():
    old = Scene.from_document(RegionProof.from_bytes(region()).scene.to_document())
    assert all(len(names) == 2 for names in old.to_document()["pairs"])
    same = replace(old, pairs=tuple(replace(p, padding=old.padding) for p in old.pairs))
    assert same.hash == old.hash
    scene = arm()
    document = json.loads(json.dumps(scene.to_document()))
    again = Scene.from_document(document)
    assert [again.padding_of(p) for p in scene.pairs] == [scene.padding_of(p) for p in scene.pairs]
    assert again.hash == scene.hash != arm({}).hash
    document["pairs"][0][2] = 0.5
    with pytest.raises(SceneError, match="stored hash"):
        Scene.from_document(document)


@pytest.mark.parametrize("padding", ["0", None, True, [0.1], 1e300])
def test_what_is_no_padding_of_a_pair_is_no_scene(padding):
    document = json.loads(json.dumps(arm().to_document()))
    document["pairs"][0][2:] = [padding]
    with pytest.raises(SceneError):
        Scene.from_document(document)


@pytest.mark.parametrize("padding", [-1e-9, 1e7])
def test_a_proof_with_an_impossible_padding_is_refused(padding):
    scene = arm()
    (proof, *_) = proofs_of(scene)
    changed = replace(scene, pairs=(replace(scene.pairs[0], padding=padding), *scene.pairs[1:]))
    with pytest.raises(ProofError, match="the padding"):
        verify_separation(replace(proof, scene=changed))


def test_a_statement_has_one_line_for_two_bodies_where_all_their_pairs_are_alike():
    scene = arm({("arm/link2/bar", BLOCK): 0.1, ("arm/link2/bar", POST): 0.1, ("arm/link2/tip", BLOCK): 0.1, ("arm/link2/tip", POST): 0.1})
    assert paddings(scene) == [
        "padding 0.03 m around every body, but in 4 pairs:",
        "  0.1 m: all 4 pairs of the bodies 'arm/link2' and 'world'",
    ]
    mixed = replace(scene, pairs=tuple(replace(p, padding=0.2) if i == 2 else p for i, p in enumerate(scene.pairs)))
    assert paddings(mixed)[1:] == [
        "  0.2 m: 'arm/link2/bar' and 'world/block'",
        "  0.1 m: 'arm/link2/bar' and 'world/post'",
        "  0.1 m: 'arm/link2/tip' and 'world/block'",
        "  0.1 m: 'arm/link2/tip' and 'world/post'",
    ]
    usual = replace(scene, pairs=tuple(replace(p, padding=None) if i == 2 else p for i, p in enumerate(scene.pairs)))
    assert len(paddings(usual)) == 4
    assert paddings(arm({}, padding=0.0)) == ["padding 0.0 m around every body"]
