"""A campaign of random single changes of valid proofs: what is still accepted is still true, everything else is a ProofError.

What an accepted change states is compared with the original statement; where it is about another scene or polytope, with the world: sampled
configurations and the distances of the bodies there, by other code.
"""

from __future__ import annotations

import copy
import itertools
import json
import warnings
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.model import WORLD, Pair, Scene, Volume
from certifier.outcome import Outcome
from certifier.pair.certification import Certification
from certifier.proof.container import pack, unpack
from certifier.proof.negative import DualProof
from certifier.proof.region import RegionProof
from certifier.verify.dual import verify_dual
from certifier.verify.region import RegionStatement, verify_region
from certifier.verify.witness import verify_witness
from tests.certifier.proofs import dual, region, scene, witness
from tests.certifier.scenes import box, cube
from tests.certifier.truth import distances

CAMPAIGN = 1000
LONG_CAMPAIGN = 20_000


@cache
def truth() -> dict[Pair, float]:
    original = RegionProof.from_bytes(region())
    return distances(scene(), original.C, original.d, 300)


def is_true(statement: RegionStatement, data: bytes) -> bool:
    """Whether what was accepted is true, as far as sampling can tell; of the original scene and a part of its region it is implied."""
    changed, original = RegionProof.from_bytes(data), RegionProof.from_bytes(region())
    same = statement.scene.hash == original.scene.hash and np.array_equal(changed.C, original.C) and (changed.d <= original.d).all()
    least = truth() if same else distances(statement.scene, changed.C, changed.d, 60)
    return all(statement.gaps[pair] <= least[pair] + 1e-9 for pair in statement.scene.pairs)


def test_the_campaigns_region_holds():
    statement = verify_region(region())
    assert is_true(statement, region())
    assert len(RegionProof.from_bytes(region()).proofs) == 4
    assert len(statement.gaps) == 6
    assert min(statement.gaps.values()) > 0


@cache
def _unpacked(data: bytes):
    for kind in ("region", "dual"):
        try:
            return unpack(data, kind)
        except ProofError:
            continue
    raise AssertionError("a valid file")


def parts_of(data: bytes):
    """Header and arrays of a valid file, to be changed."""
    header, arrays = _unpacked(data)
    return copy.deepcopy(header), dict(arrays)


def bits(data: bytes, rng: np.random.Generator) -> bytes:
    """One bit of the file."""
    changed = bytearray(data)
    changed[rng.integers(len(data))] ^= 1 << rng.integers(8)
    return bytes(changed)


def length(data: bytes, rng: np.random.Generator) -> bytes:
    """Truncated, or bytes taken out or put in."""
    i, j = sorted(rng.integers(0, len(data), 2))
    return (data[:i], data[:i] + data[j:], data[:i] + rng.bytes(5) + data[i:])[rng.integers(3)]


def number(data: bytes, rng: np.random.Generator) -> bytes:
    """One number of one array: a bit of it, its sign, its size, its place, or one that is none."""
    header, arrays = parts_of(data)
    name = rng.choice([name for name, array in arrays.items() if array.size])
    array = arrays[name].copy()
    flat = array.reshape(-1)
    i, j = rng.integers(flat.size, size=2)
    way = rng.integers(6)
    if way == 0:
        raw = flat.view(np.uint8).reshape(flat.size, -1)
        raw[i, rng.integers(raw.shape[1])] ^= 1 << rng.integers(8)
    elif way == 1:
        flat[i] = -flat[i]
    elif way == 2:
        flat[i] = (flat[i] * rng.choice([0.0, 0.5, 0.9, 1.1, 1.001, 2.0])).astype(array.dtype)
    elif way == 3:
        flat[[i, j]] = flat[[j, i]]
    elif way == 4:
        flat[i] += np.asarray(rng.choice([-1, 1])).astype(array.dtype)
    elif array.dtype.kind == "f":
        flat[i] = rng.choice([np.nan, np.inf, -np.inf, 1e300, 1e-300])
    else:
        flat[i] = np.iinfo(array.dtype).min
    return pack(header, {**arrays, name: array})


def shape(data: bytes, rng: np.random.Generator) -> bytes:
    """One array without a row, with a row more, of another type, scaled as a whole, gone, or in the place of another."""
    header, arrays = parts_of(data)
    name, other = rng.choice(sorted(arrays), size=2)
    array, way = arrays[name], rng.integers(6)
    if way == 0:
        arrays[name] = array[:-1] if array.ndim else array.reshape(1)
    elif way == 1:
        arrays[name] = np.concatenate([array, array[:1]]) if array.ndim else array.reshape(1, 1)
    elif way == 2:
        arrays[name] = array.astype(rng.choice(["float64", "int32", "int64"]))
    elif way == 3:
        with np.errstate(invalid="ignore"):
            arrays[name] = (array * rng.choice([-1.0, 0.5, 1.01, 3.0])).astype(array.dtype)
    elif way == 4:
        del arrays[name]
    else:
        arrays[name], arrays[other] = arrays[other], arrays[name]
    return pack(header, arrays)


def places(node, path=()) -> Iterator[tuple]:
    """The path of every leaf of a JSON document."""
    if isinstance(node, (dict, list)):
        for key, value in node.items() if isinstance(node, dict) else enumerate(node):
            yield from places(value, (*path, key))
    else:
        yield path


def header_field(data: bytes, rng: np.random.Generator, scene_too: bool = False) -> bytes:
    """One value of the header: another number, name, type, an item less or twice, or nothing. The scene has a campaign of its own."""
    header, arrays = parts_of(data)
    target = header["scene"] if scene_too else header
    leaves = [path for path in places(target) if path[0] not in ("provenance", "warnings", "name", *(() if scene_too else ("scene",)))]
    path = leaves[rng.integers(len(leaves))]
    node = target
    for key in path[:-1]:
        node = node[key]
    value, way = node[path[-1]], rng.integers(5)
    if way == 0 and isinstance(value, (int, float)):
        node[path[-1]] = value + rng.choice([-1, 1, 2]).item() if isinstance(value, int) else value * rng.choice([-1.0, 0.5, 1.1, 1e6])
    elif way <= 1 and isinstance(value, (int, float)):
        node[path[-1]] = value * (1 + 10.0 ** rng.integers(-12, 0).item())
    elif way == 2 and isinstance(node, list):
        node.pop(path[-1])
    elif way == 3 and isinstance(node, list):
        node.append(value)
    elif isinstance(value, str) and way != 4:
        values = [v for v in strings(header) if v != value]
        node[path[-1]] = values[rng.integers(len(values))]
    else:
        node[path[-1]] = [None, [], {}, "", -1, 10**30, 0.5, True][rng.integers(8)]
    return pack(header, arrays)


def strings(header) -> list[str]:
    found = []
    for path in places(header):
        node = header
        for key in path:
            node = node[key]
        if isinstance(node, str):
            found.append(node)
    return sorted(set(found))


def model(data: bytes, rng: np.random.Generator) -> bytes:
    """One value of the scene in the file, with a hash that fits it, so that nothing but the proof itself speaks against it."""
    changed = header_field(data, rng, scene_too=True)
    header, arrays = unpack(changed, "region")
    if rng.integers(4):
        header["scene"].pop("hash", None)
        try:
            header["scene"]["hash"] = Scene.from_document(header["scene"]).hash
        except Exception:
            # A scene that is no scene keeps the hash it had.
            header["scene"]["hash"] = scene().hash
    return pack(header, arrays)


def meaning(data: bytes, rng: np.random.Generator) -> bytes:
    """What a forger would do: exchange grounds, swap pairs, move a face, enlarge d, scale multipliers, change volumes."""
    proof = RegionProof.from_bytes(data)
    parts = list(proof.proofs)
    i, j = rng.choice(len(parts), size=2, replace=False)
    part, size = parts[i], 10.0 ** rng.uniform(-9, 0)
    sign = rng.choice([-1, 1])
    way = rng.integers(10)
    ground, side = part.ground, rng.integers(2)
    if way == 0:
        parts[i], parts[j] = replace(part, ground=parts[j].ground), replace(parts[j], ground=ground)
    elif way == 1:
        parts[i] = replace(part, volumes=part.volumes[::-1])
    elif way == 2:
        parts[i] = replace(part, sides=part.sides[::-1])
    elif way == 3:
        parts[i] = replace(part, volumes=parts[j].volumes)
    elif way == 4:
        del parts[i]
    elif way == 5:
        d = ground.d.copy()
        d[rng.integers(len(d))] += sign * size
        parts[i] = replace(part, ground=replace(ground, d=d))
    elif way == 6:
        d = proof.d.copy()
        d[rng.integers(len(d))] += sign * size
        return replace(proof, d=d).to_bytes()
    elif way == 7:
        exponent = part.sides[side].exponent.copy()
        exponent[rng.integers(len(exponent))] += sign
        sides = list(part.sides)
        sides[side] = replace(part.sides[side], exponent=exponent)
        parts[i] = replace(part, sides=tuple(sides))
    elif way == 8:
        volume = part.volumes[side]
        vertices = volume.vertices + sign * size * rng.normal(size=volume.vertices.shape) * (rng.random(volume.vertices.shape) < 0.3)
        volumes = list(part.volumes)
        volumes[side] = replace(volume, vertices=vertices, radius=abs(volume.radius + sign * size * rng.integers(2)))
        parts[i] = replace(part, volumes=tuple(volumes))
    else:
        names = [g.name for g in proof.scene.geometries]
        volumes = list(part.volumes)
        volumes[side] = replace(volumes[side], geometries=(*volumes[side].geometries[rng.integers(2) :], rng.choice(names)))
        parts[i] = replace(part, volumes=tuple(volumes))
    return replace(proof, proofs=tuple(parts)).to_bytes()


KINDS = {bits: 0.12, length: 0.05, number: 0.3, shape: 0.1, header_field: 0.13, model: 0.15, meaning: 0.15}


def campaign(count: int, seed: int) -> Counter:
    """What became of the changes; anything but a ProofError or a true statement fails at once."""
    rng, outcomes = np.random.default_rng(seed), Counter()
    for number_, kind in enumerate(rng.choice(list(KINDS), size=count, p=list(KINDS.values()))):
        data = kind(region(), rng)
        if data == region():
            outcomes[kind.__name__, "the same"] += 1
            continue
        try:
            statement = verify_region(data)
        except ProofError as error:
            outcomes[kind.__name__, error.code] += 1
            continue
        assert is_true(statement, data), (seed, number_, kind.__name__)
        outcomes[kind.__name__, "accepted"] += 1
    return outcomes


@pytest.mark.parametrize("seed", range(4))
def test_random_single_changes(seed):
    outcomes = campaign(CAMPAIGN // 4, seed)
    accepted = sum(count for (_, outcome), count in outcomes.items() if outcome in ("accepted", "the same"))
    assert accepted < 0.4 * CAMPAIGN / 4, outcomes
    assert {code for _, code in outcomes} >= {"proof_malformed", "proof_residual", "proof_box"}, outcomes


@pytest.mark.slow
def test_a_long_campaign():
    print(campaign(LONG_CAMPAIGN, 99))


@pytest.mark.parametrize("name", ["warnings", "name", "provenance"])
def test_what_is_no_part_of_the_statement_may_change(name):
    header, arrays = unpack(region(), "region")
    header["scene"][name] = {"warnings": ["a note"], "name": "another", "provenance": {"by": "hand"}}[name]
    assert verify_region(pack(header, arrays)).scene.hash == scene().hash


@pytest.mark.parametrize("index", range(4))
def test_every_ground_must_hold_the_region(index):
    """Each face of each ground moved inwards by a hair: the ground no longer contains the region."""
    proof = RegionProof.from_bytes(region())
    part = proof.proofs[index]
    for j in range(len(part.ground.d)):
        d = part.ground.d.copy()
        d[j] = min(np.nextafter(proof.d[j], -1), d[j])
        parts = list(proof.proofs)
        parts[index] = replace(part, ground=replace(part.ground, d=d))
        with pytest.raises(ProofError):
            verify_region(replace(proof, proofs=tuple(parts)).to_bytes())


def test_random_single_changes_of_a_dual_proof():
    world, original = dual()
    data, rng, outcomes = original.to_bytes(), np.random.default_rng(0), Counter()
    verify_dual(original)
    for kind, _ in itertools.product((bits, length, number, number, shape, header_field), range(50)):
        with warnings.catch_warnings():
            # Numbers as large as 1e100 may overflow on the way to being refused.
            warnings.simplefilter("ignore", RuntimeWarning)
            try:
                changed = DualProof.from_bytes(kind(data, rng), world)
                statement = verify_dual(changed)
            except ProofError as error:
                outcomes[kind.__name__, error.code] += 1
                continue
        outcomes[kind.__name__, "accepted"] += 1
        assert statement.pair == changed.pair == original.pair
        if not all(np.array_equal(getattr(changed.ground, name), value) for name, value in vars(original.ground).items()):
            polytope = world.polytope(changed.ground.C, changed.ground.d)
            result = Certification(world, polytope).certify(world.pairs.index(original.pair))
            assert result.outcome is not Outcome.CERTIFIED
    assert sum(n for (_, outcome), n in outcomes.items() if outcome == "accepted") < 150, outcomes


def test_a_dual_proof_of_a_certifiable_pair_does_not_pass():
    """The moments of a pair that cannot be certified, claimed on a smaller polytope where it can."""
    world, original = dual()
    index = world.pairs.index(original.pair)
    small = Certification(world, cube(world, 0.0, 0.02), np.zeros(2))
    assert small.certify(index).outcome is Outcome.CERTIFIED
    with pytest.raises(ProofError):
        verify_dual(replace(original, ground=small.ground))


def test_a_volume_that_is_too_small_for_its_group():
    proof = RegionProof.from_bytes(region())
    part = next(p for p in proof.proofs if len(p.volumes[1].geometries) == 2)
    group = part.volumes[1]
    alone = replace(part, volumes=(part.volumes[0], Volume.of(proof.scene.geometry(group.geometries[0]))))
    parts = tuple(alone if p is part else p for p in proof.proofs)
    with pytest.raises(ProofError) as refusal:
        verify_region(replace(proof, proofs=parts).to_bytes())
    assert refusal.value.code == "proof_pairs"
    shrunk = replace(part, volumes=(part.volumes[0], replace(group, vertices=group.vertices * [0.9, 1, 1])))
    with pytest.raises(ProofError) as refusal:
        verify_region(replace(proof, proofs=tuple(shrunk if p is part else p for p in proof.proofs)).to_bytes())
    assert refusal.value.code == "proof_volume"
    assert json.loads(json.dumps(refusal.value.to_document()))["code"] == "proof_volume"


def test_a_witness_must_be_in_the_polytope_and_in_both_bodies():
    world, proof = witness()
    verify_witness(proof)
    apart = replace(world, padding=0.0, geometries=(*world.geometries[:2], box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 0.2, 0.0))))
    turned = (proof.weights[0][::-1], proof.weights[1][::-1])
    for changed in (
        replace(proof, s=proof.s + 0.2),
        replace(proof, d=proof.d - 0.2),
        replace(proof, scene=apart),
        replace(proof, weights=turned),
        replace(proof, weights=(-proof.weights[0], proof.weights[1])),
        replace(proof, weights=(0 * proof.weights[0], proof.weights[1])),
        replace(proof, weights=proof.weights[:1] * 2, s=proof.s[:1]),
        replace(proof, pair=Pair("arm/link1/bar", "arm/link2/bar")),
    ):
        with pytest.raises(ProofError):
            verify_witness(changed)
