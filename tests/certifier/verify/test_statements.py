"""Files that say more than they prove, by a dishonest hand: what the verifier answers."""

from __future__ import annotations

import time
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.jobs.region import certified_region
from certifier.model import Ignored, Volume
from certifier.pair.certification import Certification
from certifier.proof.ground import Ground
from certifier.proof.pair import PairProof, Side
from certifier.verify.pair import PairCheck, verify_pair
from certifier.verify.region import verify_region
from certifier.verify.uncovered import unlisted
from tests.certifier.scenes import accepted, crowded, cube, planar_arm


def test_a_plane_without_a_normal_on_an_empty_polytope_is_refused():
    """-1 - s and -1 + s add up to -2: on the empty set anything is nonnegative, even the function -1 of a plane that is none."""
    scene = planar_arm(1)
    unit = np.eye(4)[:, None]
    ground = Ground(np.array([[1.0], [-1.0]]), np.array([-1.0, -1.0]), np.zeros(1), np.full(1, 1.0), unit[3], unit[2])
    limits = replace(ground, half=np.full(1, 1.6))
    volumes = tuple(Volume.of(scene.geometry(name)) for name in (scene.pairs[0].a, scene.pairs[0].b))
    # -t den = t (g_0 + g_1)/2 den, den = 1 + 1.6^2 u^2 on the side whose chain has the joint.
    root, mantissas = 2.0**-0.5, []
    for volume, chain in zip(volumes, ((0,), ()), strict=True):
        factor = np.zeros((len(volume.vertices), 3, 2 ** len(chain), 2 ** len(chain)))
        factor[:, 1:, 0, 0] = root
        if chain:
            factor[:, 1:, 1, 1] = root * 1.6
        mantissas.append(Side.rounded(chain, factor, "int64"))
    plane = np.zeros((4, 2))
    proof = PairProof(scene, volumes, "world", limits, np.zeros(1), plane, 1.0, 0.0, (0, 1), (mantissas[0], mantissas[1]))
    with pytest.raises(ProofError) as refusal:
        verify_pair(proof)
    assert refusal.value.code == "proof_interior"
    with pytest.raises(ProofError) as refusal:
        PairCheck(scene, limits).verify(proof)
    assert refusal.value.code == "proof_norm"


def test_a_region_names_what_its_scene_leaves_out():
    """A pair taken out of the scene is not proved, and the statement says that it is not covered; a reason to ignore it is quoted."""
    scene = planar_arm(2)
    assert [line for line in statement(scene) if line.startswith("not covered")] == [
        "not covered, as the scene has no such pairs: 1 of 'arm/link1' and 'arm/link2'"
    ]
    dropped = replace(scene, pairs=scene.pairs[:1])
    both = "1 of 'arm/link1' and 'arm/link2', 1 of 'arm/link2' and 'world'"
    assert f"not covered, as the scene has no such pairs: {both}" in statement(dropped)
    bars = Ignored("arm/link1/bar", "arm/link2/bar", "neighbours")
    assert [line for line in statement(replace(scene, ignored=(bars,))) if line.startswith("not covered")] == [
        "not covered: 'arm/link1/bar' and 'arm/link2/bar', for the reason \"neighbours\""
    ]


def statement(scene) -> list[str]:
    polytope = cube(scene, 0.0, 0.05)
    shared = Certification(scene, polytope, np.zeros(2))
    proofs = {i: shared.certify(i).proof for i in range(len(scene.pairs))}
    return verify_region(certified_region(scene, accepted(polytope, np.zeros(2)), proofs, {}).proof).lines()


def test_what_a_scene_leaves_out_is_named_in_a_line_however_much_it_is():
    """Two times 1000 bodies that move against each other make a million of two each; twenty are named."""
    scene = crowded()
    started = time.process_time()
    words = unlisted(scene)
    assert words.count(" of ") == 20
    assert words.endswith(", and more")
    assert time.process_time() - started < 2.0
