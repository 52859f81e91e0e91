"""Trees of true proofs are changed at random, and the verifier accepts none that says something false.

A changed tree is false when a plane of it does not separate the volumes at a configuration of the polytope in its cell, or when such a
configuration is in a cell that is said to miss the polytope. Some changes leave a proof true, such as a cut that moves a little: these may
be accepted, and are counted apart.
"""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import WORLD, Pair
from certifier.outcome import Outcome
from certifier.partition import bodies
from certifier.partition.certification import CellCertification
from certifier.partition.tree import of_streams, to_streams
from certifier.polytopes.gibbs import uniform_in_q
from certifier.proof.partition import EMPTY, PLANE, STREAMS, PartitionProof
from certifier.scene import load_scene
from certifier.verify.separations import verify_separation
from tests.certifier.scenes import ball, box, cube, planar_arm

EXAMPLES = Path(__file__).parents[3] / "examples"
SAMPLES = 2000


def planar(radius):
    scene = planar_arm(2, box("world/block", WORLD, (0.1, 0.1, 0.1), (1.2, 1.0, 0.0)), limit=2.5)
    tip = ball("arm/link2/tip", "arm/link2", radius, (1.0, 0.0, 0.0))
    scene = replace(scene, geometries=(*scene.geometries, tip), pairs=(Pair(tip.name, "world/block"),))
    C = np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, -1.0], [0.4, 1.0], [-0.4, 1.0]])
    return scene, scene.polytope(C, [0.6, 0.6, 0.6, 0.5, 0.6]), 0


def wrist():
    """A pair in six joints, with two coarse volumes for the hand."""
    scene = load_scene(EXAMPLES / "ur3e_bin" / "scene.yaml")
    q = np.array(yaml.safe_load((EXAMPLES / "ur3e_bin" / "seed.yaml").read_text())["q"])
    index = next(i for i, pair in enumerate(scene.pairs) if "wrist_3" in pair.a + pair.b and "tray/right" in pair.a + pair.b)
    q[0] -= 0.2  # towards this side of the bin
    return scene, cube(scene, scene.to_s(q), 0.3), index


@pytest.fixture(scope="module")
def proofs():
    """Proofs with several cells each, and samples of their polytopes."""
    found = []
    for scene, polytope, index in (planar(0.08), planar(0.05), wrist()):
        with pytest.MonkeyPatch.context() as patched:
            patched.setattr(bodies, "PIECES", 1)
            patched.setattr(bodies, "MANY_PIECES", 4)
            result = CellCertification(scene, polytope).certify(index, 600)
        assert result.outcome is Outcome.CERTIFIED
        proof = PartitionProof.from_bytes(result.proof, scene)
        assert np.count_nonzero(proof.nodes < 0) >= 4, "the tree has cuts to move"
        verify_separation(proof)
        found.append((proof, uniform_in_q(polytope, scene, SAMPLES // 20, 20, seed=5).reshape(-1, scene.n)))
    assert any(len(set(proof.choices.tolist())) > 1 for proof, _ in found)
    assert any(len(proof.multipliers) for proof, _ in found)
    return found


def tree_of(proof):
    vertices = [len(a.vertices) + len(b.vertices) for a, b in proof.chosen]
    return of_streams({name: getattr(proof, name) for name in STREAMS}, vertices, 1)[0]


def leaf_dropped(rng, cuts, leaves):
    """One half of a cell takes the other's place."""
    node = cuts[rng.integers(len(cuts))]
    vars(node).update(vars(node.children[rng.integers(2)]))


def cut_moved(rng, cuts, leaves):
    node = cuts[rng.integers(len(cuts))]
    node.value += float(rng.choice([-1, 1]) * 10.0 ** rng.uniform(-3, 0))


def cut_elsewhere(rng, cuts, leaves):
    """Another joint is cut, so that the cells below are others than those whose proofs these are."""
    node = cuts[rng.integers(len(cuts))]
    node.kind = int(rng.integers(max(cut.kind for cut in cuts) + 2))


def proofs_swapped(rng, cuts, leaves):
    first, second = (leaves[i] for i in rng.choice(len(leaves), 2, replace=False))
    held = dict(vars(first))
    vars(first).update(vars(second))
    vars(second).update(held)


def halves_swapped(rng, cuts, leaves):
    node = cuts[rng.integers(len(cuts))]
    node.children = node.children[::-1]


def cell_emptied(rng, cuts, leaves):
    """A cell is said to miss the polytope, by the multipliers of its proof."""
    node = leaves[rng.integers(len(leaves))]
    node.kind, node.plane, node.choice = EMPTY, None, 0
    if node.streams is not None:
        counts = node.streams.counts[:1]
        total = int(counts.sum())
        node.streams = replace(
            node.streams,
            pieces=node.streams.pieces[:0],
            counts=counts,
            faces=node.streams.faces[:total],
            multipliers=node.streams.multipliers[:total],
        )


def plane_turned(rng, cuts, leaves):
    node = leaves[rng.integers(len(leaves))]
    if node.plane is not None:
        node.plane = node.plane + rng.normal(size=node.plane.shape) * 10.0 ** rng.uniform(-3, 0)


def multiplier_changed(rng, cuts, leaves):
    node = leaves[rng.integers(len(leaves))]
    if node.streams is not None and len(node.streams.multipliers):
        values = node.streams.multipliers.copy()
        values[rng.integers(len(values))] *= np.float32(rng.choice([-1.0, 0.0, 0.5, 2.0]))
        node.streams = replace(node.streams, multipliers=values)


def choice_changed(rng, cuts, leaves):
    node = leaves[rng.integers(len(leaves))]
    if node.kind == PLANE:
        node.choice = int(rng.integers(4))


CHANGES = (
    leaf_dropped,
    cut_moved,
    cut_elsewhere,
    proofs_swapped,
    halves_swapped,
    cell_emptied,
    plane_turned,
    multiplier_changed,
    choice_changed,
)


def is_false(proof, tree, samples):
    """Whether a sample contradicts what the tree says of its cell."""
    kinematics, scene = Kinematics.of(proof.scene), proof.scene
    play = sorted({j for volume in proof.all_volumes for j in kinematics.chain(proof.frame, volume.body)})
    waiting = [(tree, samples)]
    while waiting:
        node, S = waiting.pop()
        if not len(S):
            continue
        if node.children:
            below = S[:, node.kind] <= node.value
            waiting += [(node.children[0], S[below]), (node.children[1], S[~below])]
            continue
        if node.kind == EMPTY:
            return True
        planes = np.einsum("ij,sj->si", node.plane, np.concatenate([np.ones((len(S), 1)), S[:, play]], axis=1))
        for volume, sign in zip(proof.chosen[node.choice], (1.0, -1.0), strict=True):
            points = kinematics.points(proof.frame, volume.body, volume.vertices, S)
            sides = sign * (np.einsum("svc,sc->sv", points, planes[:, :3]) + planes[:, 3:4])
            reach = (volume.radius + scene.padding) * np.linalg.norm(planes[:, :3], axis=1)
            if (sides.min(axis=1) < reach).any():
                return True
    return False


def campaign(proofs, count):
    """What became of this many changes: (name of the change, refused or accepted and true) -> how often."""
    rng, counts, i = np.random.default_rng(0), Counter(), 0
    while counts.total() < count:
        (proof, samples), change = proofs[i % len(proofs)], CHANGES[i // len(proofs) % len(CHANGES)]
        i += 1
        tree = tree_of(proof)
        nodes = list(tree.preorder())
        change(rng, [node for node in nodes if node.children], [node for node in nodes if not node.children])
        other = replace(proof, **to_streams([tree], proof.planes.shape[2] - 1))
        if all(np.array_equal(getattr(other, name), getattr(proof, name)) for name in STREAMS):
            continue
        try:
            verify_separation(other)
        except ProofError:
            counts[change.__name__, "refused"] += 1
            continue
        assert not is_false(proof, tree, samples), f"change {i}, {change.__name__}, is accepted, and a sample contradicts it"
        counts[change.__name__, "accepted, and true"] += 1
    return counts


def check_campaign(counts):
    refused = Counter({name: number for (name, what), number in counts.items() if what == "refused"})
    assert set(refused) == {change.__name__ for change in CHANGES}, "every kind of change is refused somewhere"
    for row in sorted(counts.items()):
        print(*row)


def test_a_false_tree_is_found_false_by_the_samples(proofs):
    """The check that the campaign rests on is not blind: planes that are turned round are contradicted, true trees are not."""
    for proof, samples in proofs:
        tree = tree_of(proof)
        assert not is_false(proof, tree, samples)
        for node in tree.preorder():
            if node.plane is not None:
                node.plane = -node.plane
        assert is_false(proof, tree, samples)


def test_no_false_tree_is_accepted(proofs):
    check_campaign(campaign(proofs, 540))


@pytest.mark.slow
def test_no_false_tree_of_ten_thousand_is_accepted(proofs):
    check_campaign(campaign(proofs, 10_000))
