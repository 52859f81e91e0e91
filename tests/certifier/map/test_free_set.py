"""The free set of a map holds what its trees hold: at samples, each clause is proved where a tree of each of its pairs is."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.jobs.map import grow_map
from certifier.map.free_set import OPEN, PROVED, free_set
from certifier.model import WORLD, JointKind
from certifier.proof.map import MapProof
from certifier.proof.partition import OBLIQUE, PLANE
from certifier.proof.sub_scene import sub_scene
from tests.certifier.scenes import box, planar_arm, two_arms

CROWDED = box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (0.8, 0.9, 0.0))


def proved_by(proof: MapProof, s: np.ndarray) -> set[tuple[str, str]]:
    """The pairs that have a plane at a configuration, read from the map's streams one node after the other."""
    found = set()
    for pairs, part in zip(proof.pairs, proof.maps, strict=True):
        own = s[sub_scene(proof.scene, pairs).positions]
        node, cut, face, skip = 0, 0, 0, 0
        while skip or part.nodes[node] >= 0:
            inner, oblique = part.nodes[node] >= 0, part.nodes[node] == OBLIQUE
            if skip:
                skip += 1 if inner else -1
            elif (part.normals[face] @ own if oblique else own[part.nodes[node]]) > part.cuts[cut]:
                skip = 1
            cut += inner
            face += oblique
            node += 1
        if part.nodes[node] == PLANE:
            found |= {(pair.a, pair.b) for pair in pairs}
    return found


def leaf(arrays: dict[str, np.ndarray], tree: int, q: np.ndarray, s: np.ndarray) -> int:
    node, face = arrays["root"][tree], np.cumsum(arrays["joint"] == OBLIQUE) - 1
    while (joint := arrays["joint"][node]) >= 0:
        at = arrays["normals"][face[node]] @ s if joint == OBLIQUE else q[joint]
        node = arrays["upper"][node] if at > arrays["cut"][node] else node + 1
    return int(arrays["joint"][node])


ARM = planar_arm(2, CROWDED)
SLIDE = replace(ARM, joints=(replace(ARM.joints[0], kind=JointKind.PRISMATIC), ARM.joints[1]))


@pytest.mark.parametrize("scene", [ARM, SLIDE, two_arms(2, apart=3.0)], ids=["arm", "slide", "two arms"])
def test_each_clause_holds_where_the_trees_of_its_pairs_do(scene):
    proof = grow_map(scene, 0.9, deadline_s=30).proof
    arrays = free_set(proof)
    clauses = json.loads(str(arrays["head"]))["clauses"]
    assert sorted(tuple(pair) for pairs in clauses for pair in pairs) == sorted((pair.a, pair.b) for pair in scene.pairs)
    rng, both = np.random.default_rng(0), set()
    for q in rng.uniform(scene.q_lower, scene.q_upper, (500, scene.n)):
        known = proved_by(proof, scene.to_s(q))
        for number, pairs in enumerate(clauses):
            trees = arrays["tree"][arrays["first"][number] : arrays["first"][number + 1]]
            leaves = {leaf(arrays, tree, q, scene.to_s(q)) for tree in trees}
            assert leaves <= {PROVED, OPEN}
            assert all(((a, b) in known) == (PROVED in leaves) for a, b in pairs)
            both.add(PROVED in leaves)
    assert both == {True, False}
    assert len(arrays["normals"]) > 0
    inner = np.flatnonzero(arrays["joint"] >= 0)
    lower, upper = arrays["joint"][inner + 1], arrays["joint"][arrays["upper"][inner]]
    assert not ((lower < 0) & (lower == upper)).any()


def test_a_map_without_a_cell_for_a_pair_has_no_free_set():
    proof = grow_map(ARM, 1.0, deadline_s=0.0).proof
    with pytest.raises(ProofError, match="no configuration is proved to be free") as error:
        free_set(proof)
    assert error.value.code == "not_covered"


def test_a_scene_without_pairs_has_no_free_set():
    scene = replace(ARM, pairs=())
    with pytest.raises(ProofError) as error:
        free_set(MapProof(scene, (), ()))
    assert error.value.code == "no_pairs"
