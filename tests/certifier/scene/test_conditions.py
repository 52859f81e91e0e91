"""Conditions of scene files: what they mean, and that every error names its field."""

from __future__ import annotations

import math
import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from certifier.conditions import Cone, Distance, InBall, Inside, Range
from certifier.errors import SceneError
from certifier.model import Scene
from certifier.scene.conditions import condition, constrained, swept_in
from certifier.scene.file import read_condition_file, read_scene_file
from certifier.scene.load import load_scene

EXAMPLES = Path(__file__).parents[3] / "examples"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return load_scene(EXAMPLES / "ur3e_cup/scene.yaml")


def file(tmp_path: Path, conditions: str) -> Path:
    """The example with other conditions."""
    for name in ("ur3e_bin", "ur3e_cup"):
        shutil.copytree(EXAMPLES / name, tmp_path / name)
    path = tmp_path / "ur3e_cup/scene.yaml"
    path.write_text(path.read_text().partition("conditions:")[0] + f"conditions:\n{conditions}\n")
    return path


def test_the_example_means_what_it_says(scene: Scene) -> None:
    zone = ((1, 0, 0, 0.65), (0, 1, 0, 0.35), (0, 0, 1, 0.6), (-1, 0, 0, -0.1), (0, -1, 0, 0.35), (0, 0, -1, -0.02))
    assert scene.conditions == (
        Cone("upright", "cup/cup", (0, 0, 1), "world", (0, 0, 1), math.radians(15)),
        Inside("over-the-table", ("cup/cup/wall",), "world", zone),
    )
    assert len(scene.pairs) == len(scene.body_pairs) + 7


BOX = ((1, 0, 0, 1), (0, 1, 0, 1), (0, 0, 1, 1), (-1, 0, 0, 1), (0, -1, 0, 1), (0, 0, -1, 0))


def test_all_kinds_are_read(tmp_path: Path) -> None:
    path = file(
        tmp_path,
        """  - name: a
    cone: {body: cup/cup, axis: [0, 0, 2], along: [3, 0, 4], of: arm/forearm, degrees: 90}
  - name: b
    inside: {what: [cup/cup/wall, arm/wrist_3], of: arm/base, half_spaces: [[0, 0, -2, 1]]}
  - name: c
    distance: {between: [cup/cup, table/body], metres: 0.02}
  - name: d
    range: {joints: {arm/elbow_joint: 1, arm/wrist_1_joint: -1}, degrees: [-200, 90]}
  - name: e
    inside: {what: [{body: cup/cup, point: [0, 0, 0.1]}, arm/wrist_3], ball: {center: [0.1, 0, 0.2], radius: 0.9}}
  - name: f
    inside: {what: [{body: cup/cup, point: [0, 0, 0.1]}], box: {lower: [-1, -1, 0], upper: [1, 1, 1]}}""",
    )
    loaded = load_scene(path)
    assert loaded.conditions == (
        Cone("a", "cup/cup", (0, 0, 1), "arm/forearm", (0.6, 0, 0.8), math.radians(90)),
        Inside("b", ("cup/cup/wall", "arm/wrist_3/box"), "arm/base", ((0, 0, -1, 0.5),)),
        Distance("c", "cup/cup", "table/body", 0.02),
        Range("d", (("arm/elbow_joint", 1), ("arm/wrist_1_joint", -1)), math.radians(-200), math.radians(90)),
        InBall("e", ("arm/wrist_3/box",), "world", (0.1, 0.0, 0.2), 0.9, points=(("cup/cup", (0.0, 0.0, 0.1)),)),
        Inside("f", (), "world", BOX, points=(("cup/cup", (0.0, 0.0, 0.1)),)),
    )
    assert Scene.from_document(loaded.to_document()).conditions == loaded.conditions


@pytest.mark.parametrize(
    ("said", "code", "field", "words"),
    [
        ("cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1]}", "scene_field", "cone.degrees", "number"),
        ("cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1], degrees: true}", "scene_field", "cone.degrees", "number"),
        ("cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1], degrees: -1}", "scene_field", "cone.degrees", "at least 0"),
        ("cone: {body: cup/cup, axis: [0, 0], along: [0, 0, 1], degrees: 5}", "scene_field", "cone.axis", "direction"),
        ("cone: {body: cup/cup, axis: [0, 0, 0], along: [0, 0, 1], degrees: 5}", "scene_field", "cone.axis", "longer than 0"),
        ("cone: {body: cup/cup, axis: [0, 0, .nan], along: [0, 0, 1], degrees: 5}", "scene_field", "cone.axis[2]", "number"),
        ("cone: {body: cup/cpu, axis: [0, 0, 1], along: [0, 0, 1], degrees: 5}", "unknown_name", "cone.body", "did you mean cup/cup"),
        ("cone: {axis: [0, 0, 1], along: [0, 0, 1], degrees: 5}", "scene_field", "cone.body", "text"),
        ("cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1], of: lab, degrees: 5}", "unknown_name", "cone.of", "lab"),
        ("inside: {what: cup/cup, box: {lower: [0, 0, 0], upper: [1, 1, 1]}}", "scene_field", "inside.what", "list"),
        ("inside: {what: [cup/cup]}", "scene_field", "inside", "one of box, half_spaces, ball"),
        ("inside: {what: [cup/cup], ball: {center: [0, 0, 0], radius: -1}}", "scene_field", "inside.ball.radius", "at least 0"),
        ("inside: {what: [cup/cup], ball: {radius: 1}}", "scene_field", "inside.ball.center", "point"),
        ("inside: {what: [{body: cup, point: [0, 0, 0]}], ball: {}}", "unknown_name", "inside.what[0].body", "cup"),
        ("inside: {what: [{body: cup/cup/wall, point: [0, 0, 0]}], ball: {}}", "scene_field", "inside.what[0].body", "is a geometry"),
        ("inside: {what: [{body: cup/cup}], ball: {}}", "scene_field", "inside.what[0].point", "point"),
        ("range: {joints: {arm/elbow_joint: 1}}", "scene_field", "range", "either degrees"),
        ("range: {joints: {arm/elbow_joint: 1}, metres: [0]}", "scene_field", "range.metres", "two numbers in metres"),
        ("inside: {what: [cup], box: {lower: [0, 0, 0], upper: [1, 1, 1]}}", "unknown_name", "inside.what[0]", "cup"),
        ("inside: {what: [cup/cup], box: {lower: [0, 0, 0], upper: [1, 0, 1]}}", "scene_field", "inside.box", "interior"),
        ("inside: {what: [cup/cup], box: {lower: [0, 0], upper: [1, 1, 1]}}", "scene_field", "inside.box.lower", "point"),
        ("inside: {what: [cup/cup], half_spaces: []}", "scene_field", "inside.half_spaces", "list"),
        (f"inside: {{what: [cup/cup], half_spaces: [{'x, ' * 101}]}}", "scene_field", "inside.half_spaces", "list of 1 to 100 half-spaces"),
        ("inside: {what: [cup/cup], half_spaces: [[1, 0, 0]]}", "scene_field", "inside.half_spaces[0]", "four"),
        ("inside: {what: [cup/cup], half_spaces: [[0, 0, 0, 1]]}", "scene_field", "inside.half_spaces[0]", "longer"),
        (
            "inside: {what: [cup/cup], half_spaces: [[0, 0, 1, 0], [0, 0, -1, -1]]}",
            "scene_field",
            "inside.half_spaces",
            "no room",
        ),
        (
            "inside: {what: [cup/cup], half_spaces: [[0, 0, 1, 0], [0, 0, -1, 0]]}",
            "scene_field",
            "inside.half_spaces",
            "no room",
        ),
        ("distance: {between: [cup/cup], metres: 0.1}", "scene_field", "distance.between", "two names"),
        ("distance: {between: [cup/cup, table/body]}", "scene_field", "distance.metres", "number"),
        ("distance: {between: [cup/cup, lab], metres: 0.1}", "unknown_name", "distance.between[1]", "lab"),
        ("range: {joints: [arm/elbow_joint], degrees: [0, 1]}", "scene_field", "range.joints", "map joints"),
        ("range: {joints: {arm/elbow_joint: 2}, degrees: [0, 1]}", "scene_field", "range.joints.arm/elbow_joint", "1 or -1"),
        ("range: {joints: {arm/elbow: 1}, degrees: [0, 1]}", "unknown_name", "range.joints", "no joint that moves"),
        ("range: {joints: {arm/elbow_joint: 1}, degrees: 90}", "scene_field", "range.degrees", "two numbers in degrees"),
    ],
)
def test_errors_name_the_field(tmp_path: Path, scene: Scene, said: str, code: str, field: str, words: str) -> None:
    (entry,) = read_scene_file(file(tmp_path, f"  - name: c\n    {said}")).conditions
    with pytest.raises(SceneError, match=words) as error:
        condition(entry, scene, ())
    assert (error.value.code, error.value.field) == (code, f"conditions[0].{field}")


@pytest.mark.parametrize(
    ("said", "field", "words"),
    [
        ("cone: {body: arm/base, axis: [0, 0, 1], along: [0, 0, 1], degrees: 5}", "cone", "no joint turns the one direction"),
        ("cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1], degrees: 200}", "cone", "between 0.1 and 179.9 degrees"),
        ("range: {joints: {arm/elbow_joint: 1}, degrees: [90, 0]}", "range", "0.2 to 359.8 degrees apart"),
    ],
)
def test_a_condition_that_makes_no_sense_is_refused(tmp_path: Path, said: str, field: str, words: str) -> None:
    path = file(tmp_path, f"  - name: fine\n    range: {{joints: {{arm/elbow_joint: 1}}, degrees: [0, 90]}}\n  - name: c\n    {said}")
    with pytest.raises(SceneError, match=words) as error:
        load_scene(path)
    assert (error.value.code, error.value.field) == ("condition", f"conditions[1].{field}")


@pytest.mark.parametrize("name", ["a/b", "turning"])
def test_a_condition_needs_a_name_of_its_own_kind(tmp_path: Path, name: str) -> None:
    path = file(tmp_path, f"  - name: {name}\n    range: {{joints: {{arm/elbow_joint: 1}}, degrees: [0, 90]}}")
    with pytest.raises(SceneError, match="without a slash") as error:
        load_scene(path)
    assert (error.value.code, error.value.field) == ("scene_field", "conditions[0].name")


def test_a_file_of_conditions_has_nothing_else(tmp_path: Path) -> None:
    path = tmp_path / "low.yaml"
    for text, field, words in (
        ("conditions: []\npadding: 0.01", "low.yaml: padding", "known keys: conditions"),
        ("padding: 0.01", "low.yaml: padding", "known keys: conditions"),
        ("{}", "low.yaml: conditions", "is missing"),
        ("", "low.yaml", "must be a mapping with the key conditions"),
        ("5", "low.yaml", "must be a mapping with the key conditions"),
        ("conditions: 5", "low.yaml: conditions", "must be a list of conditions"),
    ):
        path.write_text(text)
        with pytest.raises(SceneError, match=words) as error:
            read_condition_file(path)
        assert (error.value.code, error.value.field) == ("scene_field", field)
    endless = tmp_path / "endless.yaml"
    endless.symlink_to("/dev/zero")
    with pytest.raises(SceneError, match="too long"):
        read_condition_file(endless)


def test_a_scene_is_constrained_as_if_its_file_had_the_conditions(tmp_path: Path, scene: Scene) -> None:
    bare = load_scene(file(tmp_path, "  []"))
    entries = read_scene_file(EXAMPLES / "ur3e_cup/scene.yaml").conditions
    one = constrained(bare, entries[:1])
    assert constrained(one, entries[1:]).hash == constrained(bare, entries).hash == scene.hash
    with pytest.raises(SceneError, match="upright is the name of a condition that the scene has"):
        constrained(one, entries)
    assert constrained(scene, ()).hash == scene.hash


def test_a_frame_behind_a_swept_joint_is_refused(tmp_path: Path) -> None:
    for i, said in enumerate(
        (
            "cone: {body: cup/cup, axis: [0, 0, 1], along: [0, 0, 1], degrees: 15}",
            "inside: {what: [arm/upper_arm], of: arm/wrist_3, box: {lower: [-9, -9, -9], upper: [9, 9, 9]}}",
        )
    ):
        path = file(tmp_path / str(i), f"  - name: c\n    {said}\nfix: {{arm/wrist_3_joint: swept}}")
        with pytest.raises(SceneError, match="is behind the joint arm/wrist_3_joint, which is swept") as error:
            load_scene(path)
        assert error.value.code == "scene_field"
        (entry,), swept = read_scene_file(path).conditions, load_scene(bare(path))
        with pytest.raises(SceneError, match="is behind the joint arm/wrist_3_joint, which is swept"):
            constrained(swept, [entry], swept_in(swept))
        older = replace(swept, provenance={"directives": ""})
        with pytest.raises(SceneError, match="its name was not kept"):
            swept_in(older)


def bare(path: Path) -> Path:
    """The same scene file without conditions."""
    found = path.with_name("bare.yaml")
    found.write_text(path.read_text().partition("conditions:")[0] + "fix: {arm/wrist_3_joint: swept}")
    return found
