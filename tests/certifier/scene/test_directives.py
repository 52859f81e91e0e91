"""Directives: Drake reads no file and no number that was not checked here. YAML that two readers take differently is refused."""

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene import load_bundle, pack_bundle
from tests.certifier.scene.workshop import SCENE, parsed, write

BAD = "<robot name='arm'><link name='base'/><link name='hand'><collision><orgin xyz='1 0 0'/></collision></link></robot>"
"""Drake reads this without a word about <orgin>."""
PACKAGES = "packages: {p: .}"
ADDED = "arm, file: arm.urdf"
MORE = "add_directives: {file: more.yaml}"
BREAKS = {"\u2028": "2028", "\u2029": "2029", "\x85": "0085", "\r": "000D"}
NUMBERS = [".nan", ".inf", "-.inf", "nan", "1e7", "-1000001", "1e400", "0x10", "1_0", "true", '"1,5"']


def directive(text):
    """Returns the workshop's scene with another directive for the arm, which has another file for its model."""
    return PACKAGES + SCENE.replace(f"add_model: {{name: {ADDED}}}", text)


def posed(pose):
    return SCENE.replace("child: room::walls", f"child: room::walls, X_PC: {pose}")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('add_model: {name: arm, <<: {file: "package://p/arm.urdf"}}', "scene.yaml, line 3: the merge key <<"),
        ('add_model: {name: arm, "<<": {file: "package://p/arm.urdf"}}', "scene.yaml, line 3: the merge key <<"),
        ("add_model: {name: arm, &f file: arm.urdf}", "line 3: the anchor or alias 'f'"),
        ("add_model: {name: arm, file: !!str arm.urdf}", "line 3: the tag 'tag:yaml.org,2002:str'"),
        ("add_model: !AddModel {name: arm, file: arm.urdf}", "line 3: the tag '!AddModel'"),
        ("add_model: {name: arm, file: arm2.urdf}", "scene.yaml:3: there is no file arm2.urdf"),
        ("add_model: {name: arm, file: sub//arm.urdf}", "scene.yaml:3: there is no file sub/arm.urdf"),
        ('add_model: {name: arm, file: "package://p//arm2.urdf"}', "scene.yaml:3: there is no file arm2.urdf"),
        ('add_model: {name: arm, file: "package://q/arm.urdf"}', "scene.yaml:3: 'package://q/arm.urdf' names the unknown package 'q'"),
        ('add_model: {name: arm, file: "http://p/arm.urdf"}', "scene.yaml:3: 'http://p/arm.urdf' is no file of the scene"),
        ('add_model: {name: arm, file: "arm.urdf\\0"}', "scene.yaml:3: the text 'arm.urdf\\x00' has a character that cannot be printed"),
        ("add_model: {name: arm, file: >-\n      arm.urdf\n    }", "scene.yaml"),
        ("add_model:\n      name: arm\n      file: >-\n        arm.urdf", "scene.yaml:5: the text goes over several lines"),
        ("add_model:\n      name: arm\n      file: |-\n        arm.urdf", "scene.yaml:5: the text goes over several lines"),
        ('add_model:\n      name: arm\n      file: "arm.\\\n        urdf"', "scene.yaml:5: the text goes over several lines"),
        ("add_model:\n      name: arm\n      file: arm.urdf\n       b", "scene.yaml:5: the text goes over several lines"),
    ],
)
def test_a_file_that_is_not_found_here_is_not_left_to_drake(tmp_path, text, words):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, directive(text), arm=BAD))
    assert caught.value.message.startswith(words) or words in caught.value.message


@pytest.mark.parametrize("more", ["", "name: x\n"])
@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("directives: [{add_model: {name: arm, <<: {file: 'package://p/arm.urdf'}}}]", "the merge key <<"),
        ("<<: {directives: [{add_model: {name: arm, file: 'package://p/arm.urdf'}}]}", "the merge key <<"),
        ("directives: [{add_model: {name: arm, file: 'package://p/no.urdf'}}]", "more.yaml:{line}: there is no file no.urdf"),
        ("directives: [{add_model: {name: arm, file: 'file:///no/no.urdf'}}]", "more.yaml:{line}: there is no file no.urdf"),
        ("directives: [{add_model: {name: arm, file: 'file://arm.urdf'}}]", "more.yaml:{line}: 'file://arm.urdf' is no file of the scene"),
        ("directives: [{add_model: {name: arm, default_joint_positions: {turn: [.nan]}}}]", "more.yaml:{line}: 'turn' in default_joint"),
    ],
)
def test_directives_of_directives_are_checked_as_well(tmp_path, text, words, more):
    words = words.format(line=2 if more else 1)
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, directive(MORE), arm=BAD, files={"more.yaml": more + text}))
    assert words in caught.value.message


@pytest.mark.parametrize("character", BREAKS)
@pytest.mark.parametrize("added", [False, True])
def test_a_line_break_of_some_readers_only_is_refused(tmp_path, character, added):
    """The comment hides the model from one of the readers."""
    scene = directive(MORE) if added else SCENE
    path = write(tmp_path, scene, arm=BAD)
    (tmp_path / "more.yaml").write_bytes(f"directives: [\r\n # x{character} 'a\n {{add_model: {{name: {ADDED}}}}}\n #'\n ]\n".encode())
    if not added:
        path.write_bytes(f"# one\r\n# two{character}x\n{scene}".encode())
    with pytest.raises(SceneError, match=rf"(scene|more)\.yaml, line 2: the character U\+{BREAKS[character]} ends a line"):
        parsed(path)


def test_several_slashes_are_one_as_for_drake(tmp_path):
    scene = directive('add_model: {name: arm, file: "package://p//sub//../arm.urdf"}').replace("file: room.sdf", "file: .//room.sdf")
    path = write(tmp_path, scene)
    assert parsed(path).hash == load_bundle(pack_bundle(path)).scene.hash
    with pytest.raises(SceneError, match=r"arm\.urdf:1: <orgin>"):
        parsed(write(tmp_path, scene, arm=BAD))


@pytest.mark.parametrize("number", NUMBERS)
@pytest.mark.parametrize(
    ("pose", "what"),
    [
        ("{{translation: [0, {}, 0]}}", "translation of X_PC"),
        ("{{rotation: !Rpy {{deg: [0, 0, {}]}}}}", "deg of X_PC"),
        ("{{rotation: !AngleAxis {{angle_deg: {}, axis: [0, 0, 1]}}}}", "angle_deg of X_PC"),
        ("{{rotation: !AngleAxis {{angle_deg: 3, axis: [0, 0, {}]}}}}", "axis of X_PC"),
    ],
)
def test_what_is_no_number_in_a_pose_is_refused(tmp_path, pose, what, number):
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, posed(pose.format(number))))
    assert caught.value.message.startswith(f"scene.yaml:6: {what} has ")
    assert caught.value.field == "directives"


@pytest.mark.parametrize(
    "text",
    [
        "add_frame: {name: f, X_PF: {base_frame: world, translation: [.inf, 0, 0]}}",
        "add_model: {name: b, file: room.sdf, default_free_body_pose: {walls: {translation: [.inf, 0, 0]}}}",
        "add_model: {name: b, file: arm.urdf, default_joint_positions: {turn: [1e9]}}",
    ],
)
def test_numbers_are_checked_wherever_directives_have_them(tmp_path, text):
    with pytest.raises(SceneError, match=r"scene\.yaml:7: .* in the place of a finite decimal number of at most 1e\+06"):
        parsed(write(tmp_path, f"{SCENE}  - {text}\n"))


@pytest.mark.parametrize("axis", ["[0, 0, 0]", "[0, 0, 1e-200]", "[1e-7, 0, 0]"])
def test_an_axis_without_a_direction_is_refused(tmp_path, axis):
    """Drake makes a matrix of it that is no rotation."""
    with pytest.raises(SceneError, match=r"scene\.yaml:6: axis of X_PC is shorter than 1e-06"):
        parsed(write(tmp_path, posed(f"{{rotation: !AngleAxis {{angle_deg: 90, axis: {axis}}}}}")))


def test_poses_are_read_as_written(tmp_path):
    turned = [
        posed("{translation: [1, -.5, 2.5e-1], rotation: !Rpy {deg: [0, 0, 90]}}"),
        posed("{translation: [+1., -5e-1, 0.25], rotation: !AngleAxis {angle_deg: 90, axis: [0, 0, 7]}}"),
    ]
    walls = [parsed(write(tmp_path, scene)).geometry("room/walls/wall").vertices for scene in turned]
    # The wall is 0.1 by 1 by 1 around (0.6, 0, 0.3) in its file.
    for vertices in walls:
        center = next(j.X_PF for j in parsed(write(tmp_path, turned[0])).joints if j.child == "room/walls")
        placed = vertices @ center[:3, :3].T + center[:3, 3]
        np.testing.assert_allclose([placed.min(axis=0), placed.max(axis=0)], [[0.5, 0.05, 0.05], [1.5, 0.15, 1.05]], atol=1e-12)


def test_a_namespace_of_null_is_none_as_for_drake(tmp_path):
    """Without it, nothing takes the limits off a joint that turns without limits."""
    more = f"directives: [{{add_model: {{name: {ADDED.replace('arm.urdf', 'package://p/arm.urdf')}}}}}]"
    path = write(tmp_path, directive("add_directives: {file: more.yaml, model_namespace: ~}"), kind="continuous", files={"more.yaml": more})
    assert any("arm/turn is continuous" in warning for warning in parsed(path).warnings)
