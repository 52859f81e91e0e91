"""Maps that say something false are refused, whatever was changed in them; what is accepted is true at samples."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.jobs.map import grow_map
from certifier.model import WORLD, Pair
from certifier.pair.collisions import in_collision
from certifier.proof import container, limits
from certifier.proof.container import pack, unpack
from certifier.proof.map import MapProof
from certifier.proof.partition import EMPTY, OBLIQUE, OPEN, PLANE, STREAMS
from certifier.proof.sub_scene import sub_scene
from certifier.verify.file import answer
from certifier.verify.map import verify_map
from tests.certifier.map.test_map import in_planes
from tests.certifier.scenes import ball, box, planar_arm

CHANGES = 300


@pytest.fixture(scope="module")
def proof() -> MapProof:
    """The map of an arm with a ball at its tip, before a block; three joints move the tip, and some cells are open."""
    arm = planar_arm(3, box("world/block", WORLD, (0.3, 0.3, 0.3), (0.9, 0.9, 0.0)), padding=0.01)
    tip = ball("arm/link3/tip", "arm/link3", 0.1, (1.0, 0.0, 0.0))
    scene = replace(arm, geometries=(*arm.geometries, tip), pairs=(*arm.pairs, Pair(tip.name, "world/block")))
    return grow_map(scene, 0.7).proof


def test_it_holds_and_says_so(proof):
    found = answer(proof.to_bytes())
    assert (found["holds"], found["kind"], found["guarantee"]) == (True, "map", "exact")
    assert any("4 pairs of bodies; a configuration is free" in line for line in found["statement"])


def tampered(proof: MapProof, number: int, **changed) -> MapProof:
    """The map with one of its parts changed."""
    maps = list(proof.maps)
    maps[number] = replace(maps[number], **changed)
    return replace(proof, maps=tuple(maps))


def leaf(part, kind):
    return int(np.flatnonzero(part.nodes == kind)[0])


def of_faces(part):
    """Which of the cuts are oblique."""
    return part.nodes[part.nodes >= 0] == OBLIQUE


def hand_made(proof: MapProof):
    """Forgeries, each with the code of its refusal."""
    part = proof.maps[-1]
    open_one, settled = leaf(part, OPEN), leaf(part, PLANE)
    nodes = part.nodes.copy()
    nodes[open_one] = PLANE
    before = int(np.count_nonzero(part.nodes[:open_one] == PLANE))
    yield "an open cell is said to have no collision", tampered(proof, -1, nodes=nodes), "proof_malformed"
    vertices = sum(len(volume.vertices) for volume in part.chosen[part.choices[0]])
    more = {
        "planes": np.insert(part.planes, before, part.planes[0], axis=0),
        "choices": np.insert(part.choices, before, part.choices[0]),
        "pieces": np.concatenate([part.pieces[:0], np.full(vertices, PLANE, np.int8), part.pieces]) if before == 0 else part.pieces,
        "counts": np.concatenate([np.zeros(vertices, np.int16), part.counts]) if before == 0 else part.counts,
    }
    yield "and gets the plane of another cell", tampered(proof, -1, nodes=nodes, **more), "proof_malformed" if before else "proof_cell"
    assert len(part.normals)
    assert part.multipliers.any()
    yield (
        "oblique cuts are where the bodies touch",
        tampered(proof, -1, cuts=np.where(of_faces(part), part.cuts + 0.1, part.cuts)),
        "proof_cell",
    )
    yield "oblique cuts are the other way round", tampered(proof, -1, normals=-part.normals), "proof_cell"
    yield "oblique cuts are in other joints", tampered(proof, -1, normals=np.roll(part.normals, 1, axis=1)), "proof_cell"
    yield "an oblique cut has no normal", tampered(proof, -1, normals=part.normals[1:]), "proof_malformed"
    yield (
        "a normal is no number",
        tampered(proof, -1, normals=np.where(np.arange(len(part.normals))[:, None], part.normals, np.nan)),
        "proof_malformed",
    )
    yield "multipliers are of other faces", tampered(proof, -1, faces=np.zeros(len(part.multipliers), np.int16)), "proof_malformed"
    yield "faces help nowhere", tampered(proof, -1, multipliers=0 * part.multipliers), "proof_cell"
    yield "faces help the wrong way", tampered(proof, -1, multipliers=-part.multipliers), "proof_malformed"
    yield "the face of a cell helps another one", tampered(proof, -1, counts=np.roll(part.counts, len(part.counts) // 2)), "proof_malformed"
    nodes = part.nodes.copy()
    nodes[np.flatnonzero(nodes == OBLIQUE)[0] + 1] = OPEN
    yield "nothing is proved before an oblique cut", tampered(proof, -1, nodes=nodes), "proof_malformed"
    nodes = part.nodes.copy()
    nodes[np.flatnonzero((nodes >= 0) & (nodes != OBLIQUE))[-1]] = OBLIQUE
    yield "a cut in a joint is called an oblique one", tampered(proof, -1, nodes=nodes), "proof_malformed"
    nodes = part.nodes.copy()
    nodes[settled] = EMPTY
    yield "a cell is said to miss the joint limits", tampered(proof, -1, nodes=nodes), "proof_malformed"
    yield "all planes are the other way round", tampered(proof, -1, planes=-part.planes), "proof_cell"
    short = part.planes.copy()
    short[:, 4] *= 0.5
    yield "the normals are longer than they are said to be", tampered(proof, -1, planes=short), "proof_cell"
    faces = replace(
        part.ground,
        C=np.eye(1, part.scene.n),
        d=np.full(1, -0.9),
        Y_lower=np.insert(part.ground.Y_lower, 0, 0.0, axis=1),
        Y_upper=np.insert(part.ground.Y_upper, 0, 0.0, axis=1),
    )
    inside = part.interior.copy()
    inside[0] = -0.95
    yield "all of it is about a part of the joint space", tampered(proof, -1, ground=faces, interior=inside), "proof_ground"
    narrow = replace(part.ground, half=part.ground.half * 0.99)
    yield "the box is smaller than the joint limits", tampered(proof, -1, ground=narrow), "proof_box"
    yield "the map of one pair is called that of another", replace(proof, pairs=proof.pairs[1:] + proof.pairs[:1]), "proof_scene"
    yield "a map is said to be about more pairs", replace(proof, pairs=(*proof.pairs[:-1], proof.pairs[0] + proof.pairs[-1])), "proof_scene"
    joints = (*proof.scene.joints[:-1], replace(proof.scene.joints[-1], upper=2.1))
    yield "the joint limits are wider", replace(proof, scene=replace(proof.scene, joints=joints)), "proof_scene"
    yield "the padding is larger", replace(proof, scene=replace(proof.scene, padding=0.02)), "proof_scene"


def test_forgeries_are_refused(proof):
    for what, forged, code in hand_made(proof):
        with pytest.raises(ProofError) as refused:
            verify_map(forged.to_bytes())
        assert refused.value.code == code, what


def test_a_map_without_some_pairs_says_that_nothing_is_proved_to_be_free(proof):
    statement = verify_map(replace(proof, pairs=proof.pairs[1:], maps=proof.maps[1:]).to_bytes())
    assert statement.missing == 1
    assert any("no configuration is proved to be free" in line for line in statement.lines())


def changed(part, rng):
    """A part with something in it changed, and what."""
    kind = rng.choice(["number", "plane", "swap", "cut", "leaf", "choice", "piece", "bound", "face", "multiplier", "count"])
    arrays = {
        name: getattr(part, name).copy() for name in ("planes", "cuts", "nodes", "choices", "pieces", "normals", "multipliers", "counts")
    }
    planes, cuts, nodes, choices, pieces, normals, multipliers, counts = arrays.values()
    i = rng.integers(len(planes))
    match kind:
        case "number":
            planes[i, rng.integers(5), rng.integers(planes.shape[2])] += rng.normal() * 10.0 ** rng.uniform(-6, 1)
        case "plane":
            planes[i] += rng.normal(size=planes[i].shape) * 10.0 ** rng.uniform(-4, 0)
        case "swap":
            planes[[i, rng.integers(len(planes))]] = planes[[rng.integers(len(planes)), i]]
        case "cut":
            cuts[rng.integers(len(cuts))] += rng.normal() * 10.0 ** rng.uniform(-6, 0)
        case "leaf":
            nodes[rng.integers(len(nodes))] = rng.choice([OPEN, PLANE, EMPTY, OBLIQUE, 0, 1, 2])
        case "choice":
            choices[i] = rng.integers(-1, 3)
        case "piece":
            pieces[rng.integers(len(pieces))] = rng.choice([PLANE, EMPTY, 0, 1])
        case "bound":
            planes[i, 4] *= rng.uniform(0.9, 1.0)
        case "face":
            normals[rng.integers(len(normals))] += rng.normal(size=normals.shape[1]) * 10.0 ** rng.uniform(-4, 0)
        case "multiplier":
            multipliers[rng.integers(len(multipliers))] *= rng.choice([0.0, 0.5, 0.99, 1.01, 2.0])
        case "count":
            counts[rng.integers(len(counts))] ^= 1
    return kind, replace(part, **arrays)


def test_what_is_accepted_of_changed_maps_is_true(proof):
    rng, counted = np.random.default_rng(0), Counter()
    number = len(proof.maps) - 1
    about = sub_scene(proof.scene, proof.pairs[number]).scene
    samples = about.to_s(rng.uniform(about.q_lower, about.q_upper, size=(60_000, about.n)))
    samples = samples[in_collision(about, samples)]
    assert len(samples) > 200
    for _ in range(CHANGES):
        kind, part = changed(proof.maps[number], rng)
        one = replace(proof, pairs=proof.pairs[number:], maps=(part,))
        try:
            verify_map(one.to_bytes())
        except ProofError:
            counted[kind, "refused"] += 1
            continue
        counted[kind, "accepted"] += 1
        assert not in_planes(part, samples).any(), kind
    assert sum(count for (_, what), count in counted.items() if what == "refused") > 0.5 * CHANGES, counted


def test_files_with_changed_bytes_get_an_answer(proof):
    data, rng = proof.to_bytes(), np.random.default_rng(0)
    for _ in range(150):
        changed = bytearray(data)
        for place in rng.integers(len(data), size=rng.integers(1, 4)):
            changed[place] ^= 1 << rng.integers(8)
        cut = changed if rng.random() < 0.7 else changed[: rng.integers(len(data))]
        found = answer(bytes(cut))
        if found["holds"]:
            assert MapProof.from_bytes(bytes(cut)).to_bytes() == data


def test_scenes_of_strangers_are_looked_at_before_anything_is_made_of_them(proof):
    """Two joints that hang on each other would never lead to the world."""
    header, arrays = unpack(proof.to_bytes(), "map")
    joints = header["scene"]["joints"]
    joints[0]["parent"], joints[1]["parent"] = joints[1]["child"], joints[0]["child"]
    del header["scene"]["hash"]
    with pytest.raises(ProofError) as refused:
        verify_map(pack(header, arrays))
    assert refused.value.code == "proof_model"


@pytest.mark.parametrize(("limit", "what"), [("CONTAINED", "vertices"), ("UNPACKED_BYTES", "bytes")])
def test_maps_that_would_take_too_long_are_refused(proof, monkeypatch, limit, what):
    data = proof.to_bytes()
    size = sum(getattr(part, name).nbytes for part in proof.maps for name in STREAMS)
    monkeypatch.setattr(container, "_most", lambda _: 1 << 30)
    monkeypatch.setattr(limits, limit, {"CONTAINED": 20, "UNPACKED_BYTES": size - 1}[limit])
    with pytest.raises(ProofError, match=what) as refused:
        verify_map(data)
    assert refused.value.code == "proof_too_large"
