"""Joints that follow another one: what can move together, what documents say of it, and what the verifier refuses."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from flint import fmpq
from hypothesis import assume, given
from hypothesis import strategies as st

from api.drawing import model
from certifier.errors import ProofError, SceneError
from certifier.jobs.reference import Reference
from certifier.kinematics import Kinematics
from certifier.model import Joint, JointKind, Pair, Scene
from certifier.motion.search import search
from certifier.proof.motion import Motion, Space
from certifier.scene.following import followers_of, leading
from certifier.scene.joints import Coupling
from certifier.scene.tree import Tree
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import propose
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.motion import verify_motion
from certifier.verify.scene import check_scene
from certifier.verify.uncovered import Why, document
from tests.certifier.scene.hands import IGNORED, gripper, jaws
from tests.certifier.scene.test_sweep import knuckles, mimic
from tests.certifier.scene.workshop import LIMIT, SCENE, parsed, write

WRIST = jaws("prismatic", 1, 0.0).replace(
    '<joint name="grip" type="prismatic"><parent link="hand"/>', '<joint name="grip" type="prismatic"><parent link="w"/>'
)
WRIST += f"""<link name="w"/><joint name="wrist" type="revolute"><parent link="hand"/><child link="w"/><axis xyz="0 0 1"/>{LIMIT}</joint>"""
"""One of two fingers that slide is behind another joint."""


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
        (jaws("prismatic", 1001, 0.0, own=(-9e5, 9e5)), "", "unsupported_joint", "with the multiplier 1001; in ciris, joints that slide"),
        (
            jaws("prismatic", -9e-4, 0.0),
            "",
            "unsupported_joint",
            "multiplier -0.0009; in ciris, joints that slide move",
        ),
        (jaws("revolute", 2, 0.0), IGNORED, "unsupported_joint", "with the multiplier 2"),
        (jaws("prismatic", 1, 0.0).replace("prismatic", "revolute", 1), IGNORED, "unsupported_joint", "one slides and the other turns"),
        (jaws("revolute", 1, 0.0), "", "unsupported_joint", "both are between arm/grip_link/pad and arm/other_link/pad"),
        (WRIST, "", "unsupported_joint", "both are between arm/grip_link/pad and arm/other_link/pad"),
        (knuckles("box"), "", "unsupported_joint", "one is behind the other"),
        (jaws("prismatic", 1, 3.0), IGNORED, "joint_range", "no range of positions with both within their limits"),
        (jaws("prismatic", 1, 0.0), IGNORED + "limits: {other: [0, 0.1]}\n", "unknown_name", "arm/other follows arm/grip (mimic)"),
        (jaws("prismatic", 1, 0.0), IGNORED + "configurations: {open: {other: 0.1}}\n", "unknown_name", "arm/other follows arm/grip"),
        (jaws("prismatic", 1, 0.0), IGNORED + "limits: {grip: [0, 3]}\n", "scene_field", "own limits"),
        (jaws("prismatic", 1, 0.0), IGNORED + "q_star: [0, 0, 0]\n", "scene_field", "has 3 numbers for 2 joints"),
        (jaws("prismatic", 1, 0.0), IGNORED + "configurations: {open: [0, 0, 0]}\n", "scene_field", "has 3 numbers for 2 joints"),
    ],
)
def test_what_cannot_move_together_is_refused_with_what_to_do(tmp_path, more, extra, code, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, more=more, extra=extra))
    assert caught.value.code == code
    assert words in caught.value.message
    assert caught.value.hint
    if "3 numbers" in words:
        assert caught.value.hint == "in order: arm/turn, arm/grip; arm/other follows arm/grip"
    if code == "unknown_name":
        assert caught.value.hint == "name arm/grip, which takes it along"


@pytest.mark.parametrize(
    ("own", "hint"),
    [
        ((3.0, 4.0), "they can be held nowhere either: mend the limits, the multiplier or the offset in the model"),
        ((0.2, 4.0), "hold them at the only position, by fix: {arm/grip: 0.4}; or mend the limits"),
        ((0.25, 0.25), "hold them at the only position, by fix: {arm/grip: 0.3}; or mend the limits"),
    ],
)
def test_where_joints_have_no_range_together_the_hint_says_what_helps(tmp_path, own, hint):
    """The follower is at 0.5 grip + 0.1 or, for the second one, at 0.5 grip, and the grip is within -0.3 and 0.4."""
    more = jaws("prismatic", 0.5, 0.0 if own == (0.2, 4.0) else 0.1, own=own)
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, more=more, extra=IGNORED))
    assert caught.value.code == "joint_range"
    assert hint in caught.value.hint
    if fix := re.search(r"fix: {[^}]*}", caught.value.hint):
        parsed(write(tmp_path, more=more, extra=f"{IGNORED}{fix[0]}\n"))


def test_joints_that_follow_each_other_in_a_circle_are_said_to(tmp_path):
    more = jaws("prismatic", 0.5, 0.0).replace("</joint>", mimic("other", 2.0) + "</joint>", 1)
    with pytest.raises(SceneError, match="arm/grip and arm/other follow each other in a circle") as caught:
        parsed(write(tmp_path, more=more))
    assert caught.value.hint.startswith("remove one of their mimic elements")
    parsed(write(tmp_path, more=more, extra="fix: {grip: 0.1}\n"))


def test_a_joint_that_follows_with_the_multiplier_0_is_held_and_named(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("prismatic", 0, 0.25)))
    assert [joint.name for joint in scene.moving] == ["arm/turn", "arm/grip"]
    assert not scene.following
    (held,) = [joint for joint in scene.joints if joint.name == "arm/other"]
    assert held.kind is JointKind.WELD
    assert "joint arm/other has the multiplier 0 (mimic), so it never moves: it is held at 0.25" in scene.warnings


@pytest.mark.parametrize(
    ("kind", "factor", "offset", "said"),
    [
        ("prismatic", -0.5, 0.07, "arm/other (at -0.5 times its position plus 0.07)"),
        ("revolute", 1, -0.2, "arm/other (at its position minus 0.2)"),
    ],
)
def test_warnings_say_where_a_follower_is(tmp_path, kind, factor, offset, said):
    scene = parsed(write(tmp_path, more=jaws(kind, factor, offset), extra=IGNORED))
    assert any(f"joint arm/grip takes {said} with it: one coordinate" in warning for warning in scene.warnings)


@pytest.mark.parametrize("factor", [1, -1, 0.5, -2])
def test_the_coordinate_has_the_name_of_the_joint_that_is_followed_wherever_it_stands(tmp_path, factor):
    first, second = jaws("prismatic", factor, 0.05).split('<joint name="other"')
    scene = parsed(write(tmp_path, more=f'<joint name="other"{second}{first}', extra=IGNORED))
    assert [joint.name for joint in scene.moving] == ["arm/turn", "arm/grip"]
    assert [joint.name for joint in scene.following] == ["arm/other"]


@pytest.mark.parametrize(("offset", "own"), [(0.08, (0.0, 0.08)), (0.1, (0.0, 0.3)), (-0.3, (-0.7, 0.0))])
def test_limits_are_rounded_inwards_where_they_are_no_doubles_and_only_there(tmp_path, offset, own):
    """A joint is at ``offset`` - grip; the grip is within -1 and 1 itself."""
    scene = parsed(write(tmp_path, more=jaws("prismatic", -1, offset, (-1, 1), own), extra=IGNORED))
    for q, limit, outwards in ((scene.q_lower[1], own[1], -1), (scene.q_upper[1], own[0], 1)):
        exactly = exact(offset) - exact(limit)
        assert outwards * (exact(q) - exactly) <= 0
        assert outwards * (exact(float(np.nextafter(q, outwards * np.inf))) - exactly) > 0


@given(
    st.tuples(*[st.floats(-2, 2)] * 2).map(sorted),
    st.one_of(st.floats(1e-3, 1e3), st.floats(-1e3, -1e-3)),
    st.floats(-1, 1),
)
def test_a_leaders_limits_are_the_last_doubles_with_all_within_theirs(own, factor, offset):
    """In exact fractions, for a leader without limits of its own."""
    plain = Joint("a/leads", JointKind.PRISMATIC, "world", "one", np.eye(3)[0], np.eye(4), np.eye(4), 0, -np.inf, np.inf)
    behind = replace(plain, name="a/follows", index=1, lower=own[0], upper=own[1])
    followers = followers_of([plain, behind], [Coupling({"a/leads": -factor, "a/follows": 1.0}, offset)], ())
    leads = followers["a/follows"].leader
    assume(leads == "a/leads")
    try:
        (found,) = leading([plain, behind], followers)
    except SceneError:
        assume(False)

    def within(q: float) -> bool:
        return Fraction(own[0]) <= Fraction(factor) * Fraction(q) + Fraction(offset) <= Fraction(own[1])

    assert within(found.lower)
    assert within(found.upper)
    assert not within(float(np.nextafter(found.lower, -np.inf)))
    assert not within(float(np.nextafter(found.upper, np.inf)))


def test_no_point_of_a_fast_finger_is_farther_than_the_reach_says(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("prismatic", -8, 0.3, own=(-4, 4)), extra=IGNORED))
    reach = Tree(list(scene.joints), list(scene.bodies)).reach(list(scene.geometries), 0.0)
    (pad,) = [geometry for geometry in scene.geometries if geometry.body == "arm/other_link"]
    far = Kinematics.of(scene).points("world", pad.body, pad.vertices, np.array([scene.s_lower, scene.s_upper]))
    assert 2 < np.linalg.norm(far, axis=2).max() <= reach


def test_an_ignored_pair_that_could_not_be_certified_is_not_said_to_be(tmp_path):
    scene = parsed(write(tmp_path, more=jaws("revolute", 1, 0.0), extra=IGNORED))
    assert not [warning for warning in scene.warnings if "without the entry" in warning]


def test_what_sdformat_says_of_a_mimic_joint_is_named_where_drake_does_not_read_it(tmp_path):
    joint = """<link name="{0}l"/><joint name="{0}" type="prismatic"><parent>base</parent><child>{0}l</child><axis><xyz>0 1 0</xyz>
<limit><lower>0</lower><upper>1</upper></limit>{1}</axis></joint>"""
    mimic = '<mimic joint="a"><multiplier>-1</multiplier></mimic>'
    hand = f'<sdf version="1.11"><model name="hand"><link name="base"/>{joint.format("a", "")}{joint.format("b", mimic)}</model></sdf>'
    add = "  - add_model: {name: hand, file: hand.sdf}\n  - add_weld: {parent: world, child: hand::base}\n"
    scene = parsed(write(tmp_path, SCENE + add, files={"hand.sdf": hand}))
    (said,) = [warning for warning in scene.warnings if "<mimic>" in warning]
    assert "hand.sdf:3" in said
    assert "fix holds or sweeps them" in said


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


@pytest.mark.parametrize("length", [0.0, 2.0**-10, 2.0**12, np.inf, np.nan])
def test_the_verifier_refuses_a_slide_that_follows_too_slowly_or_too_fast(tmp_path, length):
    scene = parsed(write(tmp_path, more=jaws("prismatic", -0.5, 0.1), extra=IGNORED))
    check_scene(scene)
    with pytest.raises(ProofError, match="the axis of arm/other"), np.errstate(invalid="ignore"):
        check_scene(forged(scene, "arm/other", lambda joint: replace(joint, axis=length * joint.axis)))


@pytest.mark.parametrize("factor", [0.5, 2.0, 1 + 1e-8])
@pytest.mark.parametrize("name", ["arm/turn", "arm/grip"])
def test_the_verifier_refuses_a_longer_axis_of_what_follows_nothing(tmp_path, name, factor):
    scene = parsed(write(tmp_path, more=jaws("prismatic", -0.5, 0.1), extra=IGNORED))
    with pytest.raises(ProofError, match=f"the axis of {name}"):
        check_scene(forged(scene, name, lambda joint: replace(joint, axis=factor * joint.axis)))


@pytest.mark.parametrize("times", [0.5, 2.0])
def test_a_proof_about_a_slide_is_none_about_a_slower_or_a_faster_one(tmp_path, times):
    """The finger stops 2 mm before the post, moves half as far, or would go into it."""
    _, scene = gripper(tmp_path, -0.09, -0.8)
    proof = search(scene, Motion(Space.Q, np.array([[0.0, 0.0], [0.0, 0.06]]))).proof
    assert "  'arm/other' moves with 'arm/grip', 0.8 times as far" in verify_motion(proof).lines()
    other = forged(scene, "arm/other", lambda joint: replace(joint, axis=times * joint.axis))
    assert other.hash != scene.hash
    if times > 1:
        with pytest.raises(ProofError, match="does not keep arm/other_link/pad and room/walls/post apart"):
            verify_motion(replace(proof, scene=other))
    else:
        assert f"  'arm/other' moves with 'arm/grip', {0.8 * times:.9g} times as far" in verify_motion(replace(proof, scene=other)).lines()


def forged(scene: Scene, name: str, forge: Callable[[Joint], Joint]) -> Scene:
    """The scene with another joint of this name."""
    return replace(scene, joints=tuple(forge(joint) if joint.name == name else joint for joint in scene.joints))


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


def test_states_of_makers_count_where_their_joints_are_together(tmp_path):
    def state(name: str, **positions: float) -> str:
        joints = "".join(f'<joint name="{joint}" value="{value}"/>' for joint, value in positions.items())
        return f'<group_state name="{name}" group="hand">{joints}</group_state>'

    states = state("open", grip=0.1, other=-0.1) + state("half", other=-0.05) + state("torn", grip=0.1, other=0.1)
    files = {"arm.srdf": f'<robot name="arm">{states}</robot>'}
    scene = parsed(write(tmp_path, more=jaws("prismatic", -1, 0.0), extra=IGNORED + "srdf: {arm: arm.srdf}\n", files=files))
    assert scene.configurations == {"arm/hand/open": {"arm/grip": 0.1}, "arm/hand/half": {"arm/grip": 0.05}}
    (said,) = [w for w in scene.warnings if "is left out" in w]
    assert "joint arm/other is at 0.1 m, and arm/grip, which it follows, at 0.1 m" in said


def test_drakes_methods_have_independent_joints_only(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    for ask in (lambda: Reference(scene), lambda: propose(scene, SeedOptions(Method.IRIS_NP2, q=(0.0, 0.01)))):
        with pytest.raises(SceneError, match="joint arm/other follows another one"):
            ask()


def test_what_draws_the_robot_is_told_which_joints_follow(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    drawn = model("id", scene, False)
    assert [(joint.name, joint.index) for joint in drawn.joints if joint.follows] == [("arm/other", 1)]
    assert len(drawn.units) == scene.n == 2


def test_bodies_that_a_follower_joins_are_neighbours_that_are_not_covered(tmp_path):
    _, scene = gripper(tmp_path, -0.09)
    said = [(one["a"], one["b"]) for one in document(scene)["bodies"] if one["why"] == Why.NEIGHBOURS]
    assert ("arm/hand", "arm/other_link") in said
