"""Joints that follow another one: what can move together, what documents say of it, and what the verifier refuses."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from flint import fmpq

from api.drawing import model
from certifier.errors import ProofError, SceneError
from certifier.jobs.reference import Reference
from certifier.model import JointKind, Pair, Scene
from certifier.seeding.options import Method, SeedOptions
from certifier.seeding.propose import propose
from certifier.verify.kinematics import ExactKinematics, exact
from certifier.verify.scene import check_scene
from certifier.verify.uncovered import Why, document
from tests.certifier.scene.hands import IGNORED, gripper, jaws
from tests.certifier.scene.test_sweep import knuckles, slides
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


@pytest.mark.parametrize("factor", [1, -1])
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
    assert "joint arm/other is at 0.1, and arm/grip, which it follows, at 0.1" in said


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
