"""What a pair is about says all that its distance depends on, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import ProofError
from certifier.kinematics import Kinematics
from certifier.model import Pair
from certifier.proof.sub_scene import sub_scene
from certifier.verify.scene import check_scene
from tests.certifier.scenes import box, hand, planar_arm, random_tree, slides_together, two_arms


def with_boxes(tree, seed):
    """A tree with a box on every body, and all pairs between bodies that a joint moves."""
    rng, kinematics = np.random.default_rng(seed), Kinematics(tree)
    boxes = [box(f"{body}/box", body, rng.uniform(0.1, 0.3, 3), rng.normal(size=3) * 0.1) for body in tree.bodies]
    pairs = [Pair(*sorted((a.name, b.name))) for i, a in enumerate(boxes) for b in boxes[:i] if kinematics.chain(a.body, b.body)]
    return replace(tree, geometries=tuple(boxes), pairs=tuple(pairs))


def valid(scene):
    try:
        check_scene(scene)
    except ProofError:
        return False
    return True


WORLDS = [with_boxes(tree, seed) for seed in range(16) for tree in (random_tree(seed), slides_together(random_tree(seed), seed))]
KNOWN = [scene for scene in WORLDS if valid(scene)]


def test_some_of_these_scenes_have_joints_that_follow_others():
    assert len(KNOWN) >= 16
    assert sum(bool(scene.following) for scene in KNOWN) >= 2


@pytest.mark.parametrize("scene", KNOWN)
def test_the_bodies_of_a_pair_are_where_they_are_in_the_whole_scene(scene):
    rng = np.random.default_rng(0)
    whole = Kinematics(scene)
    for pair in scene.pairs:
        found, positions = sub_scene(scene, [pair])
        check_scene(found)
        s = rng.uniform(-0.5, 0.5, (5, scene.n))
        (a, b), (c, d) = [[world.geometry(name) for name in (p.a, p.b)] for world, p in ((scene, pair), (found, found.pairs[0]))]
        here = Kinematics(found).points(c.body, d.body, d.vertices, s[:, positions])
        assert here == pytest.approx(whole.points(a.body, b.body, b.vertices, s), rel=1e-9, abs=1e-9)
        assert (found.q_lower == scene.q_lower[positions]).all()


def test_a_robots_own_pairs_are_about_the_same_whatever_stands_around_it():
    one, other = two_arms(), two_arms(apart=5.0)
    obstacle = box("world/other", "world", (0.1, 0.2, 0.3))
    more = replace(one, geometries=(*one.geometries, obstacle), pairs=(*one.pairs, Pair(one.geometries[0].name, obstacle.name)))
    own = Pair("left/link1/bar", "left/link3/bar")
    about = [sub_scene(scene, [own]).scene.hash for scene in (one, other, more)]
    assert len(set(about)) == 1
    between = [sub_scene(scene, one.pairs[:1]).scene.hash for scene in (one, other, more)]
    assert between[0] == between[2] != between[1]


@pytest.mark.parametrize("what", ["limit", "q_star", "padding", "vertices", "frame"])
def test_what_the_distance_depends_on_changes_what_a_pair_is_about(what):
    scene = planar_arm(3)
    changed = {
        "limit": lambda: planar_arm(3, limit=1.9),
        "q_star": lambda: planar_arm(3, q_star=[0.0, 0.1, 0.0]),
        "padding": lambda: planar_arm(3, padding=0.01),
        "vertices": lambda: planar_arm(3, box("world/obstacle", "world", (0.3, 0.3, 0.4), (1.5, 1.0, 0.0))),
        "frame": lambda: replace(scene, joints=(replace(scene.joints[0], X_PF=scene.joints[1].X_PF), *scene.joints[1:])),
    }[what]()
    assert sub_scene(changed, changed.pairs[2:]).scene.hash != sub_scene(scene, scene.pairs[2:]).scene.hash


def test_what_it_does_not_depend_on_does_not():
    scene = planar_arm(3)
    changed = replace(scene, name="other", pairs=scene.pairs[:2], joints=(*scene.joints[:2], replace(scene.joints[2], upper=1.0)))
    assert sub_scene(changed, changed.pairs[1:]).scene.hash == sub_scene(scene, scene.pairs[1:2]).scene.hash


def test_names_do_not_count():
    scene = hand()
    found = sub_scene(scene, scene.pairs).scene
    words = " ".join([*found.bodies, *(g.name for g in found.geometries), *(j.name for j in found.joints), found.name])
    assert not any(word in words for word in ("arm", "hand", "palm", "finger", "obstacle", "link"))
