"""What a proof does not cover, as data: every pair that can move is either proved or counted, whoever counts."""

from __future__ import annotations

import itertools
import json
import time
from dataclasses import replace

import pytest

from certifier.model import Ignored, Scene
from certifier.scene import load_scene
from certifier.verify.uncovered import LISTED, document, named, not_covered
from tests.certifier.scene.workshop import EXAMPLES
from tests.certifier.scenes import crowded, planar_arm


def moving(scene: Scene) -> set[frozenset[str]]:
    """The pairs of geometries that a joint moves against each other, one pair at a time."""

    def chain(body: str) -> frozenset[int]:
        above = scene.joint_above.get(body)
        return frozenset() if above is None else chain(above.parent) | ({above.index} if above.index is not None else set())

    chains = {geometry.name: chain(geometry.body) for geometry in scene.geometries}
    return {frozenset((a, b)) for a, b in itertools.combinations(chains, 2) if chains[a] != chains[b]}


@pytest.mark.parametrize("name", ["ur3e_bin", "dual_ur3e", "iiwa_shelf", "planar_2dof"])
def test_what_is_proved_and_what_is_not_covered_is_all_that_moves(name: str) -> None:
    scene = load_scene(EXAMPLES / name / "scene.yaml")
    said = document(scene)
    proved = {frozenset((pair.a, pair.b)) for pair in scene.pairs}
    assert said["pairs"] == len(moving(scene) - proved) == sum(one["pairs"] for one in said["bodies"])
    assert said["pairs"] == said["neighbours"] + said["filtered"] + said["ignored"]
    assert json.loads(json.dumps(said)) == said
    joined = {frozenset((joint.parent, joint.child)) for joint in scene.moving}
    assert all((frozenset((one["a"], one["b"])) in joined) for one in said["bodies"] if one["why"] == "neighbours")
    words = " ".join(not_covered(scene))
    assert all(f"{one['pairs']} of '{one['a']}' and '{one['b']}'" in words for one in said["bodies"] if one["why"] != "ignored")


def test_the_reasons_are_told_apart_and_summed_up() -> None:
    scene = planar_arm(2)
    assert document(scene)["summary"] == "1 pair of neighbouring links is not covered"
    links = {"a": "arm/link1", "b": "arm/link2", "pairs": 1, "why": "neighbours", "reason": None}
    assert document(scene)["bodies"] == [links]
    bars = replace(scene, ignored=(Ignored("arm/link1/bar", "arm/link2/bar", "they are bolted"),))
    assert document(bars)["bodies"] == [links | {"why": "ignored", "reason": "they are bolted"}]
    assert document(bars)["summary"] == "1 pair that the scene file ignores is not covered"
    assert named(document(bars)) == ["1 of arm/link1 and arm/link2: they are bolted"]
    dropped = document(replace(scene, pairs=scene.pairs[:1]))
    assert (dropped["pairs"], dropped["neighbours"], dropped["filtered"]) == (2, 1, 1)
    assert dropped["summary"] == "2 pairs are not covered: 1 of neighbouring links, 1 that the model filters out"
    apart = replace(scene, pairs=(*scene.pairs, *bars.pairs[:0], type(scene.pairs[0])("arm/link1/bar", "arm/link2/bar")))
    assert document(apart) == {
        "pairs": 0,
        "neighbours": 0,
        "filtered": 0,
        "ignored": 0,
        "bodies": [],
        "summary": "every pair of bodies that can move against each other is covered",
    }


def test_a_million_pairs_are_counted_and_a_thousand_listed() -> None:
    scene, full = planar_arm(1), crowded()
    started = time.process_time()
    said = document(full)
    assert time.process_time() - started < 2.0
    assert said["pairs"] == len(moving(scene)) + 1000 * 1000 + 1000 * (len(scene.geometries)) - len(scene.pairs)
    assert len(said["bodies"]) == LISTED
    assert named(said)[-1] == f"and {said['pairs'] - 20} more"
