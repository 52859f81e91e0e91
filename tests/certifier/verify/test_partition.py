"""Proofs over partitions: the true ones are accepted and say no more than is true; what is changed is refused, or still true."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from certifier.errors import ProofError
from certifier.jobs.region import certified_region
from certifier.kinematics import Kinematics
from certifier.model import WORLD, JointKind, Pair, Volume
from certifier.pair.certification import Certification
from certifier.partition.coarse import ball as ball_about
from certifier.partition.coarse import capsule
from certifier.proof import limits
from certifier.proof.container import pack, unpack, with_scene
from certifier.proof.pair import PairProof
from certifier.proof.partition import EMPTY, PLANE, STREAMS, PartitionProof
from certifier.proof.region import RegionProof
from certifier.verify import control_points, partition
from certifier.verify.file import answer, verify_file
from certifier.verify.region import verify_region
from certifier.verify.separations import statements, verify_separation
from tests.certifier.scenes import accepted, ball, box, cube, planar_arm, two_arms
from tests.certifier.truth import distances
from tests.certifier.verify.partitions import Producer

BAND = {"C": np.array([[1.0, 1.0], [-1.0, -1.0]]), "d": np.array([0.0, 0.15])}
CAMPAIGN = 1000
TOLERANCE = 1e-8
"""The distances of samples are computed in floating point, to about this many metres."""


def arm(place=(1.5, 1.0, 0.0), **changes):
    return planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), place), **changes)


def folding():
    """Three links, of which the last may come near the first."""
    scene = planar_arm(3)
    return replace(scene, pairs=(Pair("arm/link1/bar", "arm/link3/bar"),))


def coarse_proof(scene, first: str, second: str, frame: str, mid, half, **least) -> PartitionProof | None:
    """The last pair's, with balls fixed to the bodies named for either volume, and a capsule for "capsule", where there is such a thing."""
    pair = scene.pairs[-1]
    found = [[coarse_volume(scene, name, body) for body in bodies.split()] for name, bodies in ((pair.a, first), (pair.b, second))]
    coarse = tuple(tuple(volume for volume in volumes if volume) for volumes in found)
    return Producer(scene, pair, frame, mid, half, coarse=coarse).proof(**least)


def coarse_volume(scene, name: str, body: str) -> Volume | None:
    kinematics, geometry = Kinematics.of(scene), scene.geometry(name)
    return ball_about(kinematics, (geometry.name,), body) if body != "capsule" else capsule(kinematics, (geometry.name,))


def with_tip():
    scene = arm(padding=0.02)
    tip = ball("arm/link2/tip", "arm/link2", 0.1, (1.0, 0.0, 0.0))
    return replace(scene, geometries=(*scene.geometries, tip), pairs=(Pair(tip.name, "world/obstacle"),))


SEVERAL = "capsule world", "capsule right/link1 world"


@cache
def proof(name: str) -> PartitionProof:
    """A true proof: many cells; balls and padding; cells and pieces that the polytope misses; sliding joints; two arms; wide ranges.

    Those named in COARSE have coarse volumes in some cells: a ball; a capsule; for both bodies; for the second; seen from the body itself;
    with a joint in play that moves none of the volumes that any cell chooses; two for either body.
    """
    far = box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (2.5, 1.0, 0.0))
    above = box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.5, 0.2, 0.4))
    slides, arms, wide = planar_arm(2, far, kind=JointKind.PRISMATIC), two_arms(1, apart=2.3), planar_arm(1, above, limit=3.1)
    made = {
        "cells": lambda: Producer(arm(), arm().pairs[1], WORLD, [-0.2, -0.1], [0.3, 0.35]).proof(),
        "tip": lambda: Producer(with_tip(), with_tip().pairs[0], WORLD, [-0.2, -0.1], [0.3, 0.3]).proof(least=1),
        "band": lambda: Producer(arm(), arm().pairs[1], WORLD, [-0.1, 0.0], [0.3, 0.5], **BAND).proof(halvings=4),
        "corners": lambda: Producer(arm(), arm().pairs[1], "arm/link1", [-0.1, 0.0], [0.3, 0.5], **BAND).proof(least=5),
        "inside": lambda: Producer(arm(), arm().pairs[1], "arm/link2", [-0.2, -0.1], [0.3, 0.35]).proof(),
        "slides": lambda: Producer(slides, slides.pairs[1], WORLD, [-0.1, 0.0], [0.4, 0.3]).proof(least=2),
        "arms": lambda: Producer(arms, arms.pairs[0], WORLD, 0.1, 0.3).proof(),
        "ball": lambda: coarse_proof(arm(place=(1.7, 0.8, 0.0)), "arm/link1", "world", WORLD, [-0.2, -0.3], [0.25, 0.3], least=2),
        "capsule": lambda: coarse_proof(
            arm(place=(1.7, 0.8, 0.0), padding=0.01), "capsule", "world", WORLD, [-0.2, -0.3], [0.25, 0.3], least=2
        ),
        "both": lambda: coarse_proof(two_arms(2, apart=4.0), "capsule", "right/link1", WORLD, [0.1, 0.3, 0.1, 0.5], 0.15, least=1),
        "second": lambda: coarse_proof(two_arms(2, apart=4.0), "left/link2", "right/link1", WORLD, [0.1, 0.3, 0.1, 0.5], 0.15, least=1),
        "below": lambda: coarse_proof(arm(), "capsule", "world", "arm/link2", [-0.4, -0.1], [0.5, 0.35]),
        "several": lambda: coarse_proof(two_arms(2, apart=4.0), *SEVERAL, WORLD, [0.1, 0.3, 0.1, 0.5], 0.15, least=1),
        "beyond": lambda: coarse_proof(folding(), "world", "arm/link1", "arm/link1", [0.0, 1.0, 0.5], [0.1, 0.2, 0.1], least=1),
        "wide": lambda: Producer(wide, wide.pairs[0], WORLD, 0.0, 11.0).proof(),
    }
    found = made[name]()
    assert found is not None
    return found


COARSE = ("ball", "capsule", "both", "second", "below", "several", "beyond")
NAMES = (*COARSE, "cells", "tip", "band", "corners", "inside", "slides", "arms", "wide")


@pytest.mark.slow
def test_the_proofs_choose_every_combination_of_volumes():
    chosen = {name: set(proof(name).choices.tolist()) for name in NAMES}
    assert set().union(*(chosen[name] for name in NAMES if name != "several")) == {0, 1, 3}
    assert len(proof("several").chosen) > 4
    assert max(chosen["several"]) > 3
    assert all(chosen[name] == {0} for name in NAMES if name not in COARSE)
    assert all({len(v.vertices) for vs in proof(name).coarse for v in vs} == {n} for name, n in (("ball", 1), ("capsule", 2)))


def least_distance(of: PartitionProof) -> float:
    """Over samples of the polytope, in floating point."""
    scene = replace(of.scene, pairs=of.pairs)
    return min(distances(scene, of.ground.C, of.ground.d, 200).values())


@cache
def truth(name: str) -> float:
    return least_distance(proof(name))


@pytest.mark.parametrize("name", NAMES)
def test_true_proofs_hold_and_state_no_more_than_is_true(name):
    statement = verify_separation(proof(name))
    assert statement.pairs == proof(name).pairs
    assert 0 < statement.gap <= truth(name) + TOLERANCE
    again = PartitionProof.from_bytes(proof(name).to_bytes(), proof(name).scene)
    assert again.to_bytes() == proof(name).to_bytes()
    assert verify_separation(again) == statement


def test_the_proofs_use_every_kind_of_node():
    assert (proof("corners").nodes == EMPTY).any()
    kinds = Counter(kind for name in NAMES for kind in np.unique(proof(name).pieces).tolist())
    assert {PLANE, EMPTY, 0, 1} <= set(kinds)
    assert sum((proof(name).multipliers > 0).any() for name in NAMES) >= 4


@pytest.mark.parametrize("name", NAMES)
def test_any_number_of_processes_finds_the_same(name, monkeypatch):
    monkeypatch.setattr("certifier.verify.separations.CELLS", 1)
    told = []
    assert verify_separation(proof(name), 2, lambda done, total: told.append((done, total))) == verify_separation(proof(name))
    leaves = np.count_nonzero(proof(name).nodes < 0)
    assert told == [(i + 1, leaves) for i in range(leaves)]


def test_any_number_of_processes_finds_the_same_error(monkeypatch):
    monkeypatch.setattr("certifier.verify.separations.CELLS", 1)
    true = proof("cells")
    planes = true.planes.copy()
    planes[[2, 5]] *= -1
    cuts = true.cuts.copy()
    cuts[-1] = 7.0
    errors = {refused(replace(true, planes=planes, cuts=cuts), processes=processes).message for processes in (1, 2)}
    assert len(errors) == 1
    assert "cell 2," in errors.pop()


@pytest.mark.parametrize("name", NAMES)
def test_any_number_of_values_together_finds_the_same(name, monkeypatch):
    """To rounding: how BLAS adds up may depend on how much there is."""
    true = proof(name)
    gap = verify_separation(true).gap
    for number in (1, 100):
        monkeypatch.setattr(partition, "TOGETHER", number)
        monkeypatch.setattr(partition, "CORNERS", number)
        assert verify_separation(true).gap == pytest.approx(gap, rel=1e-9)
        refused(replace(true, planes=-true.planes), "proof_cell")


def refused(changed: PartitionProof, code: str | None = None, processes: int = 1) -> ProofError:
    with pytest.raises(ProofError) as refusal:
        verify_separation(changed, processes)
    assert code is None or refusal.value.code == code, refusal.value
    return refusal.value


def test_a_file_says_what_it_proves():
    true = proof("tip")
    data = with_scene(true.to_bytes(), true.scene)
    statement = verify_file(data)
    assert statement.kind == "partition"
    text = "\n".join(statement.lines)
    assert "'arm/link2/tip' and 'world/obstacle'" in text
    assert "exact" in text
    assert answer(data)["holds"]


def test_a_body_in_the_way_has_no_proof():
    """The infeasible twin: the same arm where it reaches the obstacle."""
    assert Producer(arm(), arm().pairs[1], WORLD, [0.3, 0.3], [0.3, 0.3]).proof(depth=3) is None


@pytest.mark.parametrize("name", ["cells", "tip", "slides", "arms"])
def test_a_proof_of_another_scene_is_refused(name):
    """The same streams about an obstacle that is in the way."""
    true = proof(name)
    first, second = true.volumes
    scene = replace(true.scene, padding=true.scene.padding + truth(name))
    refused(replace(true, scene=scene), "proof_cell")
    refused(replace(true, volumes=(second, first)))
    moved = replace(second, vertices=second.vertices - [0.0, 1.0, 0.0])
    geometries = tuple(replace(g, vertices=moved.vertices) if g.name in second.geometries else g for g in true.scene.geometries)
    refused(replace(true, scene=replace(true.scene, geometries=geometries), volumes=(first, moved)), "proof_cell")
    refused(replace(true, volumes=(first, moved)), "proof_volume" if not moved.is_geometry_of(true.scene) else None)


@pytest.mark.parametrize("stream", STREAMS)
@pytest.mark.parametrize("name", ["cells", "corners", "band"])
def test_streams_have_their_lengths(name, stream):
    array = getattr(proof(name), stream)
    # A stream may be empty, of cuts for instance; then there is one thing less to try.
    for changed, code in ((array[:-1], None), (np.concatenate([array, array[-1:]]), "proof_malformed"), (array[:0], None)):
        if len(changed) != len(array):
            refused(replace(proof(name), **{stream: changed}), code)
    refused(replace(proof(name), **{stream: array[..., None]}), "proof_malformed")
    refused(replace(proof(name), **{stream: array.astype(np.int64)}), "proof_malformed")


def test_each_part_of_a_stream_makes_sense():
    true = proof("corners")

    def changed(stream, at, value):
        array = getattr(true, stream).copy()
        array.reshape(-1)[at] = value
        return replace(true, **{stream: array})

    first_cut = true.nodes[0]
    lower, upper = true.ground.mid - true.ground.half, true.ground.mid + true.ground.half
    for value in (lower[first_cut], upper[first_cut], lower[first_cut] - 1, 1e300):
        refused(changed("cuts", 0, value), "proof_malformed")
    for stream in ("cuts", "planes"):
        for value in (np.nan, np.inf, -np.inf):
            refused(changed(stream, 0, value), "proof_malformed")
    for value in (np.nan, np.inf, -1e-30, -1.0):
        refused(changed("multipliers", 0, value), "proof_malformed")
    for value in (-1, len(true.ground.d), 2**15 - 1):
        refused(changed("faces", 0, value), "proof_malformed")
    for value in (-3, 2, 127, -128):
        refused(changed("nodes", 0, value), "proof_malformed")
        refused(changed("pieces", 0, value), "proof_malformed")
    for value in (-1, limits.FACES + 1):
        refused(changed("counts", 0, value), "proof_malformed")
    refused(replace(true, nodes=true.nodes[:0], cuts=true.cuts[:0]), "proof_malformed")


def test_trees_that_are_too_deep_or_too_large_are_refused(monkeypatch):
    for limit in ("NODES", "PIECES", "TREE", "CUT_DEPTH", "PIECE_DEPTH", "CHAIN", "PLAY"):
        with monkeypatch.context() as patched:
            patched.setattr(limits, limit, 0)
            refused(proof("band" if limit in ("TREE", "PIECE_DEPTH") else "cells"), "proof_too_large")


def test_a_polytope_that_is_said_to_be_empty_is_not():
    """One EMPTY cell with multipliers that sum to nothing, to something, and to too much."""
    true = proof("wide")
    for weight in (0.0, 1.0, 3e38):
        said = replace(
            true,
            nodes=np.array([EMPTY], np.int8),
            planes=true.planes[:0],
            choices=true.choices[:0],
            pieces=true.pieces[:0],
            counts=np.array([2], np.int16),
            faces=np.array([0, 1], np.int16),
            multipliers=np.array([weight, weight], np.float32),
        )
        refused(said, "proof_cell")


@pytest.mark.parametrize("scale", [1e100, 1e90, 1e6, 1e-3, 1e-30, 1e-150, 5e-324, 0.0])
def test_planes_of_any_size_are_refused_or_true(scale):
    codes = set()
    for name in [name for name in NAMES if not proof(name).multipliers.size]:
        try:
            statement = verify_separation(replace(proof(name), planes=proof(name).planes * scale))
        except ProofError as error:
            codes.add(error.code)
        else:
            assert 0 < statement.gap <= truth(name) + TOLERANCE
    assert codes <= ({"proof_cell"} if scale < 1e-10 or scale > 1e50 else set())


def test_large_and_tiny_multipliers_are_refused_or_true():
    for weight in (3e38, 1e-45, 1e30, 1e-38):
        true = proof("corners")
        multipliers = np.full(len(true.multipliers), weight, np.float32)
        assert np.isfinite(multipliers).all()
        check(replace(true, multipliers=multipliers), "corners")


@pytest.mark.parametrize("name", [name for name in COARSE if name != "beyond"])
def test_changed_coarse_volumes_are_refused_or_true(name):
    true, rng = proof(name), np.random.default_rng(3)
    scene = true.scene
    for i, k in [(side, number) for side, volumes in enumerate(true.coarse) for number in range(len(volumes))]:

        def with_all(others, i=i):
            return replace(true, coarse=tuple(others if j == i else volumes for j, volumes in enumerate(true.coarse)))

        def with_coarse(i=i, k=k, **changes):
            return with_all(tuple(replace(v, **changes) if number == k else v for number, v in enumerate(true.coarse[i])), i)

        volume = true.coarse[i][k]
        refused(with_coarse(radius=volume.radius * (1 - 1e-6)), "proof_volume")
        refused(with_coarse(vertices=volume.vertices + np.array([0.0, 0.1, 0.0])), "proof_volume")
        refused(with_coarse(geometries=true.volumes[1 - i].geometries), "proof_volume")
        refused(with_coarse(geometries=(*volume.geometries, *true.volumes[1 - i].geometries)), "proof_volume")
        refused(with_coarse(vertices=np.repeat(volume.vertices, 3, axis=0)), "proof_volume")
        for body in set(scene.bodies) - {volume.body}:
            refused(with_coarse(body=body))
        refused(with_coarse(body="arm/other"), "proof_volume")
        for _ in range(20):
            moved = volume.vertices + rng.normal(size=volume.vertices.shape) * 10.0 ** rng.uniform(-4, 0)
            check(with_coarse(vertices=moved, radius=volume.radius * rng.uniform(0.9, 1.2)), name)
        if name != "several":
            refused(with_all(()), "proof_malformed")
        refused(with_all((true.volumes[i],)), "proof_volume")
    for choice in range(-1, 1 + len(true.chosen)):
        said = replace(true, choices=np.full_like(true.choices, choice))
        if not np.array_equal(said.choices, true.choices):
            refused(said, None if 0 <= choice < len(true.chosen) else "proof_malformed")


def test_a_ball_that_is_too_small_proves_nothing():
    """The bar hits the obstacle. A ball about its joint that does not hold it is kept apart from the obstacle, and one that does is not."""
    scene = arm()
    ball = coarse_volume(scene, "arm/link2/bar", "arm/link1")
    small = replace(ball, radius=0.05)

    def made(coarse):
        return Producer(scene, scene.pairs[1], WORLD, [0.3, 0.3], [0.1, 0.1], coarse=((coarse,), ())).proof(depth=3)

    assert least_distance(replace(made(small), coarse=((ball,), ()))) < 0
    assert refused(made(small), "proof_volume").message.endswith("may leave the coarse volume that stands for it")
    refused(replace(made(small), coarse=((ball,), ())), "proof_cell")
    assert made(ball) is None


def test_a_coarse_volume_is_no_volume_of_another_proof():
    """Not even where it is known to hold its geometries, because a cell chose it."""
    true = proof("ball")
    coarse, obstacle = true.coarse[0][0], true.volumes[1]
    alone = replace(true, volumes=(coarse, obstacle), coarse=((), ()), choices=np.zeros_like(true.choices))
    refused(alone, "proof_volume")
    with pytest.raises(ProofError, match="not welded"):
        statements(true.scene, [true, alone])
    polytope = cube(true.scene, [-0.2, -0.3], 0.1)
    squares = PairProof.from_bytes(Certification(true.scene, polytope, np.array([-0.2, -0.3])).certify(1).proof, true.scene)
    assert verify_separation(squares).gap > 0
    with pytest.raises(ProofError, match="not welded"):
        statements(true.scene, [true, replace(squares, volumes=(coarse, obstacle))])


def test_coarse_volumes_count_among_those_that_take_long_to_check(monkeypatch):
    """The bar has eight vertices, behind one joint."""
    monkeypatch.setattr(limits, "CONTAINED", 9 * 4)
    assert verify_separation(proof("ball")).gap > 0
    assert verify_separation(proof("cells")).gap > 0
    monkeypatch.setattr(limits, "CONTAINED", 9 * 4 - 1)
    refused(proof("ball"), "proof_too_large")
    assert verify_separation(proof("cells")).gap > 0


def test_files_name_coarse_volumes_strictly():
    true = proof("both")
    header, arrays = unpack(true.to_bytes(), "partition")
    entry = header["proofs"][0]
    assert entry["coarse"] == [[2], [3]]
    others = [2, 3], [[2]], [[2], [3], [3]], [[2], 3], [[2], []], [[], []], [[2], [None]], [None, None], 2, None, {}
    for coarse in (*([[2], [number]] for number in (4, -1, 3.0, "3", [3])), *others, [[2] * 11, [3]]):
        with pytest.raises(ProofError) as refusal:
            PartitionProof.from_bytes(pack({**header, "proofs": [{**entry, "coarse": coarse}]}, arrays), true.scene)
        assert refusal.value.code == "proof_malformed"
    swapped = PartitionProof.from_bytes(pack({**header, "proofs": [{**entry, "coarse": [[3], [2]]}]}, arrays), true.scene)
    refused(swapped, "proof_volume")


def check(changed: PartitionProof, name: str) -> str:
    """Whether a changed proof is refused, or accepted and true; its own polytope and scene are those of the true one."""
    try:
        statement = verify_separation(changed)
    except ProofError:
        return "refused"
    assert statement.gap <= truth(name) + TOLERANCE
    return "accepted"


def random_change(name: str, rng: np.random.Generator) -> PartitionProof:
    """The proof with one stream changed: an entry, two of them swapped, one put in or out, or those of a range moved."""
    true = proof(name)
    stream = str(rng.choice([s for s in STREAMS if getattr(true, s).size]))
    array = getattr(true, stream).copy()
    flat = array if stream == "planes" else array.reshape(-1)
    i, j = rng.integers(len(flat), size=2)
    way = rng.integers(5)
    if way == 0:
        flat[i] = flat[j]
    elif way == 1:
        flat[[i, j]] = flat[[j, i]]
    elif way == 2:
        array = np.delete(array, i, axis=0)
    elif way == 3:
        array = np.insert(array, i, flat[j], axis=0)
    elif flat.dtype.kind == "f":
        flat[i] = flat[i] * rng.choice([-1.0, 0.0, 0.5, 0.9, 1.1, 2.0, 1e30])
    else:
        flat[i] += rng.choice(np.array([-1, 1], flat.dtype))
    return replace(true, **{stream: array})


@pytest.mark.parametrize("name", NAMES)
def test_random_changes_are_refused_or_true(name):
    rng = np.random.default_rng(7)
    found = Counter(check(random_change(name, rng), name) for _ in range(CAMPAIGN // len(NAMES)))
    assert found["refused"] > 10


@pytest.mark.parametrize("name", ["cells", "corners"])
def test_cells_that_leave_a_gap_are_refused(name):
    """Every leaf dropped for its neighbour's: its cut gone, with its plane, its pieces and their multipliers."""
    true = proof(name)
    for moved in (0.3, 0.9, 0.999):
        cuts = true.cuts.copy()
        cuts[0] = true.ground.mid[true.nodes[0]] + moved * true.ground.half[true.nodes[0]]
        check(replace(true, cuts=cuts), name)
    for i in range(len(true.planes)):
        planes = true.planes.copy()
        planes[i] = true.planes[(i + 1) % len(planes)]
        check(replace(true, planes=planes), name)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 10_000))
def test_hand_made_planes_hold_only_where_no_sample_contradicts(seed):
    """A plane of the true proof turned and shifted at random, without multipliers, on a random part of the box."""
    rng = np.random.default_rng(seed)
    true = proof("tip")
    plane = true.planes[:1] + rng.normal(size=(1, 5, 3)) * 10.0 ** rng.uniform(-4, 0)
    trees = sum(len(v.vertices) for v in true.volumes)
    changed = replace(
        true,
        nodes=np.array([PLANE], np.int8),
        cuts=true.cuts[:0],
        planes=plane,
        choices=true.choices[:1],
        pieces=np.full(trees, PLANE, np.int8),
        counts=np.zeros(trees, np.int16),
        faces=true.faces[:0],
        multipliers=true.multipliers[:0],
    )
    check(changed, "tip")


def test_files_are_read_strictly():
    true = proof("corners")
    header, arrays = unpack(true.to_bytes(), "partition")

    def read(header, arrays):
        with pytest.raises(ProofError) as refusal:
            PartitionProof.from_bytes(pack(header, arrays), true.scene)
        assert refusal.value.code in ("proof_malformed", "proof_scene")

    assert header["proofs"][0]["form"] == "partition"
    for entry in ({"form": "pair"}, {"form": "gram"}, {"form": 3}, {"faces": []}):
        read({**header, "proofs": [{**header["proofs"][0], **entry}]}, arrays)
    read({**header, "proofs": [{key: value for key, value in header["proofs"][0].items() if key != "form"}]}, arrays)
    for stream, kind in STREAMS.items():
        name = f"proof/0/{stream}"
        read(header, {key: value for key, value in arrays.items() if key != name})
        read(header, {**arrays, name: arrays[name].astype("int32" if kind != "int32" else "int64")})
        read(header, {**arrays, f"{name}2": arrays[name]})
    for value in (np.nan, np.inf):
        multipliers = arrays["proof/0/multipliers"].copy()
        multipliers[0] = value
        read(header, {**arrays, "proof/0/multipliers": multipliers})


@pytest.mark.parametrize("processes", [1, 2])
def test_a_region_may_hold_proofs_of_both_forms(processes):
    scene = arm(padding=0.01)
    polytope = cube(scene, [-0.2, -0.1], 0.2)
    sums_of_squares = Certification(scene, polytope, np.array([-0.2, -0.1])).certify(0).proof
    over_cells = Producer(scene, scene.pairs[1], WORLD, [-0.2, -0.1], 0.21).proof(least=3)
    region = certified_region(scene, accepted(polytope, [-0.2, -0.1]), {0: sums_of_squares, 1: over_cells.to_bytes()}, {})
    assert [part.KIND for part in RegionProof.from_bytes(region.proof).proofs] == ["pair", "partition"]
    told = []
    statement = verify_region(region.proof, processes, lambda done, total: told.append((done, total)))
    assert list(statement.gaps.values()) == list(region.statement.gaps.values())
    assert told[-1] == (9, 9)
    least = distances(scene, polytope.C, polytope.d, 200)
    assert all(0 < statement.gaps[pair] <= least[pair] + TOLERANCE for pair in least)
    other = Producer(scene, scene.pairs[1], WORLD, [-0.2, -0.1], 0.15).proof()
    parts = RegionProof.from_bytes(region.proof)
    smaller = replace(parts, proofs=(parts.proofs[0], replace(other, interior=parts.interior)))
    with pytest.raises(ProofError, match="does not contain the region"):
        verify_region(smaller.to_bytes(), processes)


def test_volumes_that_no_cell_chooses_cost_nothing(monkeypatch):
    """A stranger may add as many as a file holds."""
    scene = planar_arm(2)
    proof = Producer(scene, scene.pairs[1], WORLD, [-0.2, -0.1], [0.3, 0.3]).proof(least=3)
    name = next(name for name in proof.volumes[0].geometries + proof.volumes[1].geometries if name.startswith("arm/"))
    which = 0 if name in proof.volumes[0].geometries else 1
    large = Volume((name,), "arm/link1", np.zeros((1, 3)), 50.0)
    coarse = ((large,), ()) if which == 0 else ((), (large,))
    prepared = []
    monkeypatch.setattr(partition, "Side", lambda *arguments: prepared.append(arguments[2]) or control_points.Side(*arguments))
    assert verify_separation(replace(proof, coarse=coarse)).gap > 0
    assert prepared == list(proof.volumes)
