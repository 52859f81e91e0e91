"""Joints that follow another one: told where each joint is, Drake has each body where ciris has it, from the models as they are."""

from __future__ import annotations

import itertools
import json
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import pytest
from flint import fmpq
from hypothesis import given, settings
from hypothesis import strategies as st
from pydrake.geometry import SceneGraph

from api.drawing import model
from certifier.errors import ProofError, SceneError
from certifier.growth.options import GrowthOptions
from certifier.jobs.local import grow
from certifier.jobs.motion import certify
from certifier.jobs.reference import Reference
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
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import propose
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.region import verify_region
from certifier.verify.scene import check_scene
from certifier.verify.uncovered import Why, document
from tests.certifier.scene.test_sweep import finger, knuckles, mimic, slides
from tests.certifier.scene.workshop import LIMIT, parsed, write
from tests.oracles.original import original_diagram
from tests.oracles.trees import random_plant

IGNORED = "ignore: [{pair: [arm/grip_link, arm/other_link], reason: they meet where they grasp}]\n"


def jaws(kind: str, factor: float, offset: float, limits: tuple[float, float] = (-0.3, 0.4), own: tuple[float, float] = (-2, 2)) -> str:
    """Two fingers on the hand, of which the second one follows the first one; both are turned against it."""
    other = finger("other", "hand", kind, "0.6 0.8 0", own, "box", mimic("grip", factor, offset), "0.2 0.1 0.3")
    return finger("grip", "hand", kind, "0 -0.6 0.8", limits, "box") + other


WRIST = jaws("prismatic", 1, 0.0).replace(
    '<joint name="grip" type="prismatic"><parent link="hand"/>', '<joint name="grip" type="prismatic"><parent link="w"/>'
)
WRIST += f"""<link name="w"/><joint name="wrist" type="revolute"><parent link="hand"/><child link="w"/><axis xyz="0 0 1"/>{LIMIT}</joint>"""
"""One of two fingers that slide is behind another joint."""


class Original:
    """What Drake makes of a scene file. A joint is where its name says, and the others at 0."""

    def __init__(self, path: Path, follows: dict[str, tuple[str, float, float]]) -> None:
        self._diagram, self._follows = original_diagram(path), follows
        self._context = self._diagram.CreateDefaultContext()
        self._inspector = self._diagram.scene_graph().model_inspector()

    def place(self, scene: Scene, q: np.ndarray) -> None:
        plant, at = self._diagram.plant(), {joint.name: float(x) for joint, x in zip(scene.moving, q, strict=True)}
        at |= {name: factor * at[leader] + offset for name, (leader, factor, offset) in self._follows.items()}
        positions = np.zeros(plant.num_positions())
        for name, value in at.items():
            model, joint = name.split("/")
            positions[plant.GetJointByName(joint, plant.GetModelInstanceByName(model)).position_start()] = value
        plant.SetPositions(self._diagram.mutable_plant_context(self._context), positions)

    def pose(self, name: str) -> np.ndarray:
        plant = self._diagram.plant()
        if name == WORLD:
            return np.eye(4)
        model, body = name.split("/")
        return plant.EvalBodyPoseInWorld(
            self._diagram.plant_context(self._context), plant.GetBodyByName(body, plant.GetModelInstanceByName(model))
        ).GetAsMatrix4()

    def touching(self, scene: Scene) -> set[Pair]:
        query = self._diagram.scene_graph().get_query_output_port().Eval(self._diagram.scene_graph_context(self._context))
        names = Names(self._diagram.plant(), self._inspector)
        found = {Pair(*sorted((names.geometry(p.id_A), names.geometry(p.id_B)))) for p in query.ComputePointPairPenetration()}
        return found & set(scene.pairs)


def exact_pose(scene: Scene, q: np.ndarray, frame: str, body: str) -> np.ndarray:
    """By the verifier's kinematics."""
    X = ExactKinematics.at(scene, [exact(x) for x in scene.to_s(q)]).pose(frame, body)
    return np.array([[float(Fraction(int((x / X[3][3]).p), int((x / X[3][3]).q))) for x in row] for row in X])


def our_pose(scene: Scene, q: np.ndarray, frame: str, body: str) -> np.ndarray:
    X = Kinematics.of(scene).numerators(frame, body, scene.to_s(q)[None])[0]
    return X / X[3, 3]


HANDS = {
    "panda": (jaws("prismatic", 1, 0.0), {"arm/other": ("arm/grip", 1, 0.0)}),
    "slides": (jaws("prismatic", -1, 0.07), {"arm/other": ("arm/grip", -1, 0.07)}),
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
                rng.choice([-1, 1]),
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


def test_limits_are_those_at_which_all_are_within_theirs(tmp_path):
    """0.1 - grip is within -0.15 and 0.05 for a grip from 0.05 to 0.25."""
    scene = parsed(write(tmp_path, more=jaws("prismatic", -1, 0.1, (-0.3, 0.4), (-0.15, 0.05)), extra=IGNORED))
    assert (scene.q_lower[1], scene.q_upper[1]) == pytest.approx((0.05, 0.25))
    for q in (scene.q_lower[1], scene.q_upper[1]):
        assert fmpq(-15, 100) <= exact(0.1) - exact(q) + fmpq(1, 10**17)
        assert exact(-0.15) <= exact(0.1) - exact(q) <= exact(0.05)
    narrow = parsed(write(tmp_path, more=jaws("prismatic", 1, 0.0), extra=IGNORED + "limits: {grip: [0.0, 0.1]}\n"))
    assert {(joint.lower, joint.upper) for joint in narrow.joints if joint.index == 1} == {(0.0, 0.1)}
    assert any(w == "joint arm/grip takes arm/other with it: one coordinate, from 0 to 0.1 m, moves them all" for w in narrow.warnings)


@pytest.mark.parametrize(
    ("more", "extra", "code", "words"),
    [
        (slides("box"), "", "unsupported_joint", "arm/grip and arm/other are coupled (mimic) with the multiplier 1.5"),
        (jaws("revolute", 2, 0.0), IGNORED, "unsupported_joint", "with the multiplier 2"),
        (jaws("prismatic", 1, 0.0).replace("prismatic", "revolute", 1), IGNORED, "unsupported_joint", "one slides and the other turns"),
        (jaws("revolute", 1, 0.0), "", "unsupported_joint", "both are between arm/grip_link/pad and arm/other_link/pad"),
        (WRIST, "", "unsupported_joint", "both are between arm/grip_link/pad and arm/other_link/pad"),
        (knuckles("box"), "", "unsupported_joint", "one is behind the other"),
        (jaws("prismatic", 1, 3.0), IGNORED, "joint_range", "no range of positions with both within their limits"),
        (jaws("prismatic", 1, 0.0), IGNORED + "limits: {other: [0, 0.1]}\n", "unknown_name", "no joint of the scene that can move"),
        (jaws("prismatic", 1, 0.0), IGNORED + "configurations: {open: {other: 0.1}}\n", "unknown_name", "no joint of the scene"),
        (jaws("prismatic", 1, 0.0), IGNORED + "limits: {grip: [0, 3]}\n", "scene_field", "own limits"),
    ],
)
def test_what_cannot_move_together_is_refused_with_what_to_do(tmp_path, more, extra, code, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, more=more, extra=extra))
    assert caught.value.code == code
    assert words in caught.value.message
    assert caught.value.hint


@pytest.mark.parametrize("fix", ["fix: {grip: 0.1}\n", "fix: {other: 0.1}\n", "fix: {grip: swept}\n"])
def test_holding_and_sweeping_remain(tmp_path, fix):
    scene = parsed(write(tmp_path, more=jaws("prismatic", 1, 0.0), extra=fix))
    assert [joint.name for joint in scene.moving] == ["arm/turn"]
    assert not scene.following


def test_documents_say_what_follows_and_others_are_as_before(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("revolute", -1, 0.2), extra=IGNORED))
    document = json.loads(json.dumps(scene.to_document()))
    again = Scene.from_document(document)
    assert again.hash == scene.hash
    assert [joint.name for joint in again.following] == ["arm/other"]
    assert [joint.get("follows") for joint in document["joints"] if joint["index"] == 1] == [None, True]
    apart = replace(scene, joints=tuple(replace(joint, follows=False) for joint in scene.joints))
    assert apart.hash != scene.hash
    assert "follows" not in json.dumps(parsed(write(tmp_path)).to_document())
    for wrong in (False, 1, "true"):
        document["joints"][-1]["follows"] = wrong
        with pytest.raises(SceneError, match="is not true"):
            Scene.from_document(document)


@pytest.mark.parametrize(
    ("words", "forge"),
    [
        ("the position of arm/other", lambda joint: replace(joint, index=7)),
        ("the position of arm/other", lambda joint: replace(joint, index=None)),
        ("which follows a joint of another kind", lambda joint: replace(joint, kind=JointKind.PRISMATIC)),
        ("or with other limits", lambda joint: replace(joint, upper=joint.upper + 0.1)),
        ("the axis of arm/other", lambda joint: replace(joint, axis=0.5 * joint.axis)),
        ("q*", lambda joint: replace(joint, follows=False)),
    ],
)
def test_the_verifier_refuses_followers_that_make_no_sense(tmp_path, words, forge):
    scene = parsed(write(tmp_path, more=jaws("revolute", -1, 0.2), extra=IGNORED))
    check_scene(scene)
    with pytest.raises(ProofError) as caught:
        check_scene(replace(scene, joints=tuple(forge(joint) if joint.follows else joint for joint in scene.joints)))
    assert caught.value.code == "proof_model"
    assert words in caught.value.message


def test_the_verifier_refuses_joints_that_move_together_on_one_way(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("revolute", 1, 0.0), extra=IGNORED))
    fingers = sorted(geometry.name for geometry in scene.geometries if geometry.body in ("arm/grip_link", "arm/other_link"))
    with pytest.raises(ProofError, match="move together"):
        check_scene(replace(scene, pairs=(*scene.pairs, Pair(*fingers)), ignored=()))
    behind = replace(
        scene, joints=tuple(replace(joint, parent="arm/grip_link") if joint.name == "arm/other" else joint for joint in scene.joints)
    )
    with pytest.raises(ProofError, match="move together"):
        check_scene(behind)
    with pytest.raises(ProofError, match="the body of"):
        check_scene(replace(scene, geometries=(replace(scene.geometries[0], body="arm/nothing"), *scene.geometries[1:])))
    ExactKinematics.by_joint(scene).path("arm/grip_link", "room/walls")
    with pytest.raises(ProofError, match="move together"):
        ExactKinematics.by_joint(scene).path("arm/grip_link", "arm/other_link")


def test_slides_behind_each_other_are_refused_by_the_verifier_though_their_kinematics_are_known(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("prismatic", 1, 0.0), extra=IGNORED))
    check_scene(scene)
    behind = tuple(replace(joint, parent="arm/grip_link") if joint.name == "arm/other" else joint for joint in scene.joints)
    with pytest.raises(ProofError, match="move together"):
        check_scene(replace(scene, joints=behind))


@pytest.mark.parametrize(("factor", "offset"), [(1, 0.0), (-1, 0.07)])
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


def test_states_of_makers_count_where_their_joints_are_together(tmp_path):
    def state(name: str, **positions: float) -> str:
        joints = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in positions.items())
        return f'<group_state name="{name}" group="hand">{joints}</group_state>'

    states = state("open", grip=0.1, other=-0.1) + state("half", other=-0.05) + state("torn", grip=0.1, other=0.1)
    files = {"arm.srdf": f'<robot name="arm">{states}</robot>'}
    scene = parsed(write(tmp_path, more=jaws("prismatic", -1, 0.0), extra=IGNORED + "srdf: {arm: arm.srdf}\n", files=files))
    assert scene.configurations == {"arm/hand/open": {"arm/grip": 0.1}, "arm/hand/half": {"arm/grip": 0.05}}
    (said,) = [w for w in scene.warnings if "is left out" in w]
    assert "joint arm/other is at 0.1, and arm/grip, which it follows, at 0.1" in said


GRIPPER = """
directives:
  - add_model: {name: arm, file: arm.urdf}
  - add_weld: {parent: world, child: arm::base}
  - add_model: {name: room, file: room.sdf}
  - add_weld: {parent: world, child: room::walls}
"""


def gripper(tmp_path: Path, at: float) -> tuple[Path, Scene]:
    """A hand that turns, with fingers that open to both sides, and a post beside the second finger, which follows.

    The fingers overlap where grip is less than -0.01.
    """
    pad = '<link name="{0}"><collision name="pad"><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>'
    joint = """<joint name="{0}" type="prismatic"><parent link="hand"/><child link="{0}_link"/><origin xyz="0 {1} 0.15"/>
      <axis xyz="0 {2} 0"/><limit lower="-0.02" upper="0.1" effort="1" velocity="1"/>{3}</joint>"""
    fingers = pad.format("grip_link") + pad.format("other_link")
    fingers += joint.format("grip", 0.02, 1, "") + joint.format("other", -0.02, -1, mimic("grip", 1.0))
    arm = f"""<robot name="arm"><link name="base"/><joint name="turn" type="revolute"><parent link="base"/><child link="hand"/>
      <axis xyz="0 0 1"/><limit lower="-0.5" upper="0.5" effort="1" velocity="1"/></joint>
      <link name="hand"><collision name="palm"><geometry><box size="0.1 0.1 0.1"/></geometry></collision></link>{fingers}</robot>"""
    room = f"""<sdf version="1.7"><model name="room"><link name="walls"><collision name="post"><pose>0 {at} 0.15 0 0 0</pose>
      <geometry><box><size>0.02 0.02 0.1</size></box></geometry></collision></link></model></sdf>"""
    path = write(tmp_path, GRIPPER, arm=arm, files={"room.sdf": room}, extra="ignore: [{pair: [arm/hand, room/walls], reason: r}]\n")
    return path, parsed(path)


def test_a_motion_is_proved_to_where_a_finger_meets_the_post_or_the_other_finger(tmp_path):
    """The pad's outside is at y = -0.03 - grip, and the post begins at -0.08."""
    path, scene = gripper(tmp_path, -0.09)
    drake = Original(path, {"arm/other": ("arm/grip", 1, 0.0)})
    for end, proved in ((0.049, True), (0.06, False)):
        motion = Motion(Space.Q, np.array([[0.0, 0.0], [0.0, end]]))
        verdict = certify(scene, motion)
        assert (verdict.outcome is Outcome.CERTIFIED) is proved
        drake.place(scene, motion.controls[-1])
        assert bool(drake.touching(scene)) is not proved
    closing = certify(scene, Motion(Space.Q, np.array([[0.0, 0.01], [0.0, -0.02]])))
    assert closing.stop.pair == scene.pairs[0]
    assert 0.01 - 0.03 * closing.stop.time == pytest.approx(-0.01, abs=1e-3)
    assert closing.statement.end < 2 / 3
    assert verdict.stop is not None
    assert 0.06 * verdict.stop.time == pytest.approx(0.05, abs=1e-3)
    assert "  'arm/other' moves with 'arm/grip'" in certify(scene, Motion(Space.Q, np.array([[0.0, 0.0], [0.0, 0.03]]))).statement.lines()


def test_drakes_methods_have_independent_joints_only(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    for ask in (lambda: Reference(scene), lambda: propose(scene, SeedOptions(Method.IRIS_NP2, q=(0.0, 0.01)))):
        with pytest.raises(SceneError, match="joint arm/other follows another one"):
            ask()


def test_what_draws_the_robot_is_told_which_joints_follow(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    drawn = model("id", scene)
    assert [(joint.name, joint.index) for joint in drawn.joints if joint.follows] == [("arm/other", 1)]
    assert len(drawn.units) == scene.n == 2


def test_bodies_that_a_follower_joins_are_neighbours_that_are_not_covered(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    said = [(one["a"], one["b"]) for one in document(scene)["bodies"] if one["why"] == Why.NEIGHBOURS]
    assert ("arm/hand", "arm/other_link") in said


def test_a_region_whose_fingers_move_is_free_and_the_post_is_found(tmp_path):
    """The second finger comes to y = -0.02 - 0.1, and a post at -0.09 is on its way. The fingers meet. There regions end, says Drake."""
    path, scene = gripper(tmp_path, -0.09)
    drake, post = Original(path, {"arm/other": ("arm/grip", 1, 0.0)}), Pair("arm/other_link/pad", "room/walls/post")
    assert scene.pairs == (Pair("arm/grip_link/pad", "arm/other_link/pad"), Pair("arm/grip_link/pad", "room/walls/post"), post)
    everywhere = scene.polytope(np.zeros((0, 2)), np.zeros(0))

    def hits(polytope: Polytope, count: int) -> int:
        found = 0
        for q in scene.to_q(hit_and_run(polytope, chebyshev_center(polytope)[0], count, 0)):
            drake.place(scene, q)
            found += bool(drake.touching(scene))
        return found

    region = grow(scene, GrowthOptions(seed={"q": [0.0, 0.01]}))
    grown = Polytope(np.array(region.manifest["halfspace_normals"]), np.array(region.manifest["halfspace_offsets"]))
    assert hits(grown, 10_000) == 0
    assert hits(everywhere, 1000) > 50
    for q, pair in (([0.0, 0.07], post), ([0.0, -0.015], scene.pairs[0])):
        assert not grown.contains(scene.to_s(np.array(q)))
        drake.place(scene, np.array(q))
        assert drake.touching(scene) == {pair}
    lines = verify_region(region.proof).lines()
    assert "  'arm/other' moves with 'arm/grip'" in lines
