"""Joints that follow another one: told where each joint is, Drake has each body where ciris has it, from the models as they are."""

from __future__ import annotations

import itertools
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph

from certifier.errors import ProofError, SceneError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import certify as certify_box
from certifier.jobs.local import grow
from certifier.jobs.motion import certify
from certifier.kinematics import Kinematics
from certifier.model import WORLD, JointKind, Pair, Polytope, Scene
from certifier.motion.bodies import bodies_of, place_links
from certifier.outcome import Outcome
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.motion import Motion, Space
from certifier.scene import following
from certifier.scene.contacts import touching
from certifier.scene.joints import Coupling, centered
from certifier.scene.names import Names
from certifier.scene.parse import joint_of
from certifier.scene.tree import Tree
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.region import verify_region
from certifier.verify.scene import check_scene
from tests.certifier.scene.hands import IGNORED, Original, exact_pose, gripper, jaws, our_pose
from tests.certifier.scene.test_sweep import finger, mimic
from tests.certifier.scene.workshop import parsed, write
from tests.oracles.trees import random_plant

HANDS = {
    "panda": (jaws("prismatic", 1, 0.0), {"arm/other": ("arm/grip", 1, 0.0)}),
    "slides": (jaws("prismatic", -1, 0.07), {"arm/other": ("arm/grip", -1, 0.07)}),
    "slower": (jaws("prismatic", 0.3, -0.05), {"arm/other": ("arm/grip", 0.3, -0.05)}),
    "faster": (jaws("prismatic", -2.5, 0.07), {"arm/other": ("arm/grip", -2.5, 0.07)}),
    "turns": (jaws("revolute", 1, 0.3), {"arm/other": ("arm/grip", 1, 0.3)}),
    "mirrored": (jaws("revolute", -1, -0.7), {"arm/other": ("arm/grip", -1, -0.7)}),
    "whole turns": (
        jaws("continuous", -1, 0.4).replace('upper="2"', 'upper="1e9"').replace('lower="-2"', 'lower="-1e9"'),
        {"arm/other": ("arm/grip", -1, 0.4)},
    ),
    "behind": (
        finger("late", "hand", "revolute", "1 0 0", (-1, 1), "box", mimic("other", -1, 0.1), "0 0 0.2") + jaws("revolute", 1, 0.2),
        {"arm/other": ("arm/grip", 1, 0.2), "arm/late": ("arm/grip", -1, -0.1)},
    ),
}


LATE = ", ".join(f"{{pair: [arm/late_link, arm/{other}_link], reason: r}}" for other in ("grip", "other"))
LATE = IGNORED.replace("]\n", f", {LATE}]\n")


@pytest.mark.parametrize("hand", HANDS)
def test_drake_has_every_body_where_ciris_has_it(tmp_path, hand):
    more, follows = HANDS[hand]
    path = write(tmp_path, more=more, extra=LATE if hand == "behind" else IGNORED)
    scene, rng = parsed(path), np.random.default_rng(0)
    check_scene(scene)
    assert [joint.name for joint in scene.moving] == ["arm/turn", "arm/grip"]
    assert {joint.name for joint in scene.following} == set(follows)
    drake, links = Original(path, follows), bodies_of(scene)
    R, p = np.empty((len(links.parents), 3, 3)), np.empty((len(links.parents), 3))
    for q in [scene.q_lower, scene.q_upper, *rng.uniform(scene.q_lower, scene.q_upper, (20, 2))]:
        drake.place(scene, q)
        for body in scene.bodies:
            expected = drake.pose(body)
            np.testing.assert_allclose(our_pose(scene, q, WORLD, body), expected, rtol=0, atol=1e-13)
            np.testing.assert_allclose(exact_pose(scene, q, WORLD, body), expected, rtol=0, atol=1e-13)
        place_links(links, q, R, p)
        for i, geometry in enumerate(scene.geometries):
            X, link, own = drake.pose(geometry.body), links.links[i], links.vertices[links.first[i] : links.first[i + 1]]
            np.testing.assert_allclose(own @ R[link].T + p[link], geometry.vertices @ X[:3, :3].T + X[:3, 3], rtol=0, atol=1e-13)
        assert next(touching(scene, [q])) == drake.touching(scene)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(3, 9))
def test_random_trees_with_random_couplings_are_where_drake_has_them(seed, bodies):
    """Where joints that move together are on one way, the verifier refuses it, unless they are slides without another joint between."""
    rng = np.random.default_rng(seed)
    plant = random_plant(rng, bodies)
    names = Names(plant, SceneGraph().model_inspector())
    every = [joint_of(plant.get_joint(index), names) for index in plant.GetJointIndices()]
    couplings, values = coupled(rng, [joint for joint in every if joint.index is not None])
    if not values:
        return
    followers = following.followers_of(every, couplings, ())
    own = ranged(every, followers)
    if own is None:
        return
    order = {joint.name: i for i, joint in enumerate(joint for joint in own if joint.index is not None)}
    leaders, q_star = centered([replace(joint, index=order.get(joint.name)) for joint in own], None)
    tree = Tree(following.with_followers(leaders, every, followers), list(names.bodies))
    scene = Scene("tree", tree.joints, tree.bodies, (), (), (), q_star)
    q = rng.uniform(scene.q_lower, scene.q_upper)
    at = dict(zip((joint.name for joint in scene.moving), q.tolist(), strict=True))
    at = solved(at, couplings, {joint.name for joint in scene.moving})
    context, positions = plant.CreateDefaultContext(), np.zeros(plant.num_positions())
    for joint in every:
        if joint.index is not None:
            assert joint.lower - 1e-12 <= at[joint.name] <= joint.upper + 1e-12
            positions[joint.index] = at[joint.name]
    plant.SetPositions(context, positions)
    for frame, body in itertools.product(scene.bodies, repeat=2):
        ends = [plant.world_body() if name == WORLD else plant.GetBodyByName(name.split("/")[1]) for name in (frame, body)]
        expected = plant.CalcRelativeTransform(context, *(end.body_frame() for end in ends)).GetAsMatrix4()
        np.testing.assert_allclose(our_pose(scene, q, frame, body), expected, rtol=0, atol=1e-11)
        moving = [(joint.index, joint.kind) for joint, _ in Kinematics.of(scene).joints(frame, body) if joint.index is not None]
        apart = [one for i, one in enumerate(moving) if i == 0 or one != moving[i - 1] or one[1] is JointKind.REVOLUTE]
        if len({*apart}) == len(apart):
            np.testing.assert_allclose(exact_pose(scene, q, frame, body), expected, rtol=0, atol=1e-11)
            assert Kinematics.of(scene).chain(frame, body) == [index for index, _ in apart]
            factors = ExactKinematics.by_joint(scene).factors(frame, body)
            assert [index for index, _ in factors if index is not None] == [index for index, _ in apart]
        else:
            with pytest.raises(ProofError, match="move together"):
                ExactKinematics.at(scene, [fmpq(0)] * scene.n).pose(frame, body)


def ranged(every, followers):
    """The leaders with their limits; None where these leave no range, for which there is a test of its own."""
    try:
        return following.leading(every, followers)
    except SceneError:
        return None


def coupled(rng, moving):
    """Random couplings of joints of one kind, written as any multiple, each with one that comes before it; and the names that they have."""
    found, names = [], {}
    for i, joint in enumerate(moving):
        before = [other for other in moving[:i] if other.kind is joint.kind]
        if before and rng.random() < 0.6:
            other, scale, factor, offset = (
                before[rng.integers(len(before))],
                rng.choice([1.0, -1.0, 2.0]),
                rng.choice([-1, 1]) * (10 ** rng.uniform(-0.7, 0.7) if joint.kind is JointKind.PRISMATIC else 1.0),
                rng.normal() / 8,
            )
            found.append(Coupling({other.name: -scale * factor, joint.name: scale}, scale * offset))
            names |= {other.name: None, joint.name: None}
    return found, names


def solved(at, couplings, leaders):
    """All positions that follow from those of the leaders."""
    known = {name: value for name, value in at.items() if name in leaders}
    for _ in couplings:
        for coupling in couplings:
            (one, a), (other, b) = coupling.factors.items()
            if one in known:
                known.setdefault(other, (coupling.constant - a * known[one]) / b)
            elif other in known:
                known[one] = (coupling.constant - b * known[other]) / a
    return known


@pytest.mark.parametrize(("factor", "offset"), [(1, 0.0), (-1, 0.07), (0.5, 0.0), (-3, 0.1)])
def test_two_fingers_that_slide_are_one_factor_of_degree_1(tmp_path, factor, offset):
    path = write(tmp_path, more=jaws("prismatic", factor, offset))
    scene, rng = parsed(path), np.random.default_rng(0)
    check_scene(scene)
    fingers = "arm/grip_link", "arm/other_link"
    assert Pair(*(f"{body}/pad" for body in fingers)) in scene.pairs
    assert Kinematics.of(scene).chain(*fingers) == ExactKinematics.by_joint(scene).positions(*fingers) == [1]
    ((index, terms),) = ExactKinematics.by_joint(scene).factors(*fingers)
    assert index == 1
    assert all(x == 0 for row in terms[2] for x in row)
    drake = Original(path, {"arm/other": ("arm/grip", factor, offset)})
    for q in rng.uniform(scene.q_lower, scene.q_upper, (20, 2)):
        drake.place(scene, q)
        expected = np.linalg.inv(drake.pose(fingers[0])) @ drake.pose(fingers[1])
        s = exact(scene.to_s(q)[1])
        of_factor = [
            [float(Fraction(str(t0 + s * t1))) for t0, t1 in zip(*rows, strict=True)] for rows in zip(terms[0], terms[1], strict=True)
        ]
        for found in (our_pose(scene, q, *fingers), exact_pose(scene, q, *fingers), of_factor):
            np.testing.assert_allclose(found, expected, rtol=0, atol=1e-13)
    assert Kinematics.of(scene).frames(*fingers) == list(fingers)


@pytest.mark.parametrize(("factor", "at"), [(1, -0.09), (0.5, -0.07), (-2, -0.13)])
def test_a_motion_is_proved_to_where_a_finger_meets_the_post_or_the_other_finger(tmp_path, factor, at):
    """The pad's outside is at y = -0.03 - |factor| grip, and the post begins at ``at`` + 0.01."""
    path, scene = gripper(tmp_path, at, factor)
    drake, meets = Original(path, {"arm/other": ("arm/grip", factor, 0.0)}), (-0.04 - at) / abs(factor)
    for end, proved in ((0.98 * meets, True), (1.2 * meets, False)):
        motion = Motion(Space.Q, np.array([[0.0, 0.0], [0.0, end]]))
        verdict = certify(scene, motion)
        assert (verdict.outcome is Outcome.CERTIFIED) is proved
        drake.place(scene, motion.controls[-1])
        assert bool(drake.touching(scene)) is not proved
    closing = certify(scene, Motion(Space.Q, np.array([[0.0, 0.01], [0.0, -0.02]])))
    assert closing.stop.pair == scene.pairs[0]
    assert 0.01 - 0.03 * closing.stop.time == pytest.approx(-0.02 / (1 + abs(factor)), abs=1e-3)
    assert closing.statement.end < (0.01 + 0.02 / (1 + abs(factor))) / 0.03
    assert verdict.stop is not None
    assert 1.2 * meets * verdict.stop.time == pytest.approx(meets, abs=1e-3)
    lines = certify(scene, Motion(Space.Q, np.array([[0.0, 0.0], [0.0, 0.6 * meets]]))).statement.lines()
    assert f"  'arm/other' moves with 'arm/grip'{'' if factor == 1 else f', {abs(factor)} times as far'}" in lines


@pytest.mark.parametrize(("factor", "at"), [(1, -0.09), (0.5, -0.07), (-2, -0.13)])
def test_a_box_is_certified_nearly_up_to_the_post_and_not_beyond(tmp_path, factor, at):
    _, scene = gripper(tmp_path, at, factor)
    meets, post = (-0.04 - at) / abs(factor), scene.pairs.index(Pair("arm/other_link/pad", "room/walls/post"))
    for part, outcomes in ((0.97, {Outcome.CERTIFIED}), (1.03, {Outcome.REFUTED})):
        upper, lower = (scene.to_s(np.array(q)) for q in ((0.01, part * meets), (-0.01, 0.0)))
        box = Polytope(np.concatenate([np.eye(2), -np.eye(2)]), np.concatenate([upper, -lower]))
        verdict = certify_box(scene, box, assemble=True)
        assert {verdict.results[post].outcome} == outcomes
        assert (verdict.region is not None) == (part < 1)
        assert verdict.region is None or verify_region(verdict.region.proof)


@pytest.mark.parametrize(("factor", "at"), [(1, -0.09), (0.5, -0.07), (-2, -0.13)])
def test_a_region_whose_fingers_move_is_free_and_the_post_is_found(tmp_path, factor, at):
    """One finger reaches the post, which stands at y = ``at``. The fingers can also touch each other. Drake finds no contact in the region,
    and finds both contacts outside of it.
    """
    path, scene = gripper(tmp_path, at, factor)
    drake, post = Original(path, {"arm/other": ("arm/grip", factor, 0.0)}), Pair("arm/other_link/pad", "room/walls/post")
    assert scene.pairs == (Pair("arm/grip_link/pad", "arm/other_link/pad"), Pair("arm/grip_link/pad", "room/walls/post"), post)
    everywhere = scene.polytope(np.zeros((0, 2)), np.zeros(0))

    def hits(polytope: Polytope, count: int) -> int:
        every, found = scene.to_q(hit_and_run(polytope, chebyshev_center(polytope)[0], count, 0)), []
        for q in every:
            drake.place(scene, q)
            found.append(drake.touching(scene))
        assert found[:1000] == list(touching(scene, every[:1000]))
        return sum(map(bool, found))

    region = grow(scene, GrowthOptions(seed={"q": [0.0, 0.01]}))
    grown = Polytope(np.array(region.manifest["halfspace_normals"]), np.array(region.manifest["halfspace_offsets"]))
    assert hits(grown, 10_000) == 0
    assert hits(everywhere, 1000) > 50
    for q, pair in (([0.0, (-0.04 - at) / abs(factor) + 0.005], post), ([0.0, -0.0175], scene.pairs[0])):
        assert not grown.contains(scene.to_s(np.array(q)))
        drake.place(scene, np.array(q))
        assert drake.touching(scene) == {pair}
    lines = verify_region(region.proof).lines()
    assert f"  'arm/other' moves with 'arm/grip'{'' if factor == 1 else f', {abs(factor)} times as far'}" in lines
