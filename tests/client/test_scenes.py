"""Scene files are drafted and checked without a service, as a new user would do it first."""

from __future__ import annotations

import signal
import subprocess
import time
from pathlib import Path

import numpy as np
import yaml

from certifier.scene import load_scene
from tests.certifier.scene.workshop import ARM, BOX, EXAMPLES, LIMIT, ROOM, write
from tests.client.conftest import Ciris, command, surroundings

GRIPPER = """<link name="left"><collision><geometry><box size="0.02 0.02 0.1"/></geometry></collision></link>
  <joint name="grip" type="prismatic"><parent link="hand"/><child link="left"/><origin xyz="0.4 0.03 0"/><axis xyz="0 1 0"/>
    <limit lower="0.01" upper="0.05" effort="1" velocity="1"/></joint>
  <link name="right"><collision><geometry><mesh filename="package://tools/meshes/finger.obj"/></geometry></collision></link>
  <joint name="other" type="prismatic"><parent link="hand"/><child link="right"/><origin xyz="0.4 -0.03 0"/><axis xyz="0 -1 0"/>
    <limit lower="0" upper="0.05" effort="1" velocity="1"/><mimic joint="grip"/></joint>
  <link name="cover"><collision><geometry><sphere radius="0.4"/></geometry></collision></link>
  <joint name="on" type="fixed"><parent link="hand"/><child link="cover"/></joint>"""
FINGER = "v 0 0 0\nv 0.02 0 0\nv 0 0.02 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def robot(directory: Path, more: str = GRIPPER, limit: str = "", kind: str = "continuous") -> Path:
    """A hand on a continuous joint, with fingers that mimic each other, a mesh of a package, and a cover that is always in the base."""
    (directory / "ws" / "tools" / "meshes").mkdir(parents=True)
    (directory / "ws" / "tools" / "meshes" / "finger.obj").write_text(FINGER)
    (directory / "ws" / "robot").mkdir()
    (directory / "ws" / "robot" / "arm.urdf").write_text(ARM.format(kind=kind, limit=limit, shape=BOX, more=more))
    (directory / "room.sdf").write_text(ROOM.replace("0.6 0 0.3", "1.2 0 0.3"))
    return directory / "ws" / "robot" / "arm.urdf"


def test_a_draft_of_a_robot_as_people_ship_it_is_a_scene_with_a_free_seed(ciris: Ciris, tmp_path: Path) -> None:
    model, out = robot(tmp_path), tmp_path / "cell" / "scene.yaml"
    done = ciris("scene", "init", model, "--world", tmp_path / "room.sdf", "--out", out)
    assert done.status == 0, done.stderr
    text = out.read_text()
    document = yaml.safe_load(text.replace("!Rpy", ""))
    assert document["fix"] == {"arm/grip": 0.01}
    assert (out.parent / document["packages"]["tools"]).resolve() == tmp_path / "ws" / "tools"
    assert [entry["reason"] for entry in document["ignore"]] == ["they overlap at every configuration that was tried"]
    assert set(document["ignore"][0]["pair"]) == {"arm/base/foot", "arm/cover/Sphere"}
    scene = load_scene(out)
    assert [j.name for j in scene.moving] == ["arm/turn"]
    assert "arm/turn: -170 to 170 deg, a window" in text
    assert yaml.safe_load((out.parent / "seed.yaml").read_text())["q"] == [0.0]
    checked = ciris("scene", "check", out)
    assert checked.status == 0
    for words in (
        "1 joint, ",
        "window",
        "ignored: arm/base/foot and arm/cover/Sphere",
        "nothing touches at seed.yaml",
        "0 joints" not in checked.stdout,
    ):
        assert words is True or str(words) in checked.stdout
    grown = ciris("grow", out, "--local", "--out", tmp_path / "proof")
    assert grown.status == 0, grown.stderr


def test_a_draft_that_is_ended_leaves_nothing_behind(tmp_path: Path) -> None:
    asked = command("scene", "init", robot(tmp_path), "--world", tmp_path / "room.sdf")
    drafting = subprocess.Popen(asked, cwd=tmp_path, env=surroundings(), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True)
    while not list(tmp_path.glob(".draft-*")):
        assert drafting.poll() is None, "it drafts before it has ended"
        time.sleep(0.01)
    drafting.terminate()
    _, said = drafting.communicate(timeout=20)
    assert (drafting.returncode, said) == (128 + signal.SIGTERM, "")
    assert not [*tmp_path.glob(".draft-*"), *tmp_path.glob("*.yaml")]


def test_every_example_can_be_drafted_anew(ciris: Ciris, tmp_path: Path) -> None:
    for name, robots in (("planar_2dof", "*.urdf"), ("sphere_arm", "*.urdf")):
        (model,) = (EXAMPLES / name).glob(robots)
        worlds = [word for world in sorted((EXAMPLES / name).glob("*.sdf")) for word in ("--world", world)]
        out = tmp_path / name / "scene.yaml"
        done = ciris("scene", "init", model, *worlds, "--out", out)
        assert done.status == 0, done.stderr
        scene, known = load_scene(out), load_scene(EXAMPLES / name / "scene.yaml")
        assert scene.n == known.n
        np.testing.assert_allclose(scene.q_lower, known.q_lower)


def test_what_stands_in_the_robot_is_not_ignored(ciris: Ciris, tmp_path: Path) -> None:
    """Whoever moves the wall later must have it certified."""
    model, out = robot(tmp_path), tmp_path / "cell" / "scene.yaml"
    (tmp_path / "in.sdf").write_text(ROOM.replace("0.6 0 0.3", "0 0 0.3"))
    done = ciris("scene", "init", model, "--world", tmp_path / "in.sdf", "--out", out)
    assert done.status == 0, done.stderr
    assert "and room/walls/wall overlap at every configuration that was tried: move the weld of one" in done.stderr
    assert "room" not in out.read_text().partition("ignore:")[2]


def test_models_of_other_kinds_are_drafted(ciris: Ciris, tmp_path: Path) -> None:
    """A link called world, as in ROS; a world called like the robot; a name that YAML would read otherwise; SDFormat's mimic joints."""
    welded = ARM.format(
        kind="revolute",
        limit=LIMIT,
        shape=BOX,
        more="""<link name="world"/>
      <joint name="bolts" type="fixed"><parent link="world"/><child link="base"/></joint>""",
    )
    (tmp_path / "arm.urdf").write_text(welded)
    (tmp_path / "arm.sdf").write_text(ROOM.replace('name="room"', 'name="arm"').replace("0.6 0 0.3", "1.2 0 0.3"))
    done = ciris("scene", "init", tmp_path / "arm.urdf", "--world", tmp_path / "arm.sdf", "--out", tmp_path / "no" / "scene.yaml")
    assert done.status == 0, done.stderr
    scene = load_scene(tmp_path / "no" / "scene.yaml")
    assert scene.name == "no"
    assert [j.name for j in scene.moving] == ["arm/turn"]
    assert any(g.name == "arm_2/walls/wall" for g in scene.geometries)

    def finger(name: str, extra: str) -> str:
        return f'''<link name="{name}"><collision name="c"><geometry><sphere><radius>0.02</radius></sphere></geometry></collision></link>
          <joint name="j{name}" type="prismatic"><parent>palm</parent><child>{name}</child>
          <axis><xyz>1 0 0</xyz><limit><lower>0</lower><upper>0.05</upper></limit>{extra}</axis></joint>'''

    mimic = '<mimic joint="jl"><multiplier>1</multiplier><offset>0</offset><reference>0</reference></mimic>'
    turn = """<link name="base"/><joint name="turn" type="revolute"><parent>base</parent><child>palm</child>
      <axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis></joint>"""
    text = f'<sdf version="1.11"><model name="g"><link name="palm"/>{turn}{finger("l", "")}{finger("r", mimic)}</model></sdf>'
    (tmp_path / "g.sdf").write_text(text)
    done = ciris("scene", "init", tmp_path / "g.sdf", "--out", tmp_path / "grip" / "scene.yaml")
    assert done.status == 0, done.stderr
    assert [j.name for j in load_scene(tmp_path / "grip" / "scene.yaml").moving] == ["g/turn"]


def test_nothing_is_overwritten(ciris: Ciris, tmp_path: Path) -> None:
    model, out = robot(tmp_path), tmp_path / "scene.yaml"
    (tmp_path / "seed.yaml").write_text("q: [1]\n")
    done = ciris("scene", "init", model, "--out", out)
    assert (done.status, out.exists()) == (2, False)
    assert "seed.yaml is there already" in done.error
    assert (tmp_path / "seed.yaml").read_text() == "q: [1]\n"


def test_a_second_scene_of_a_directory_has_a_seed_of_its_own(ciris: Ciris, tmp_path: Path) -> None:
    model = robot(tmp_path)
    assert ciris("scene", "init", model).status == 0
    done = ciris("scene", "init", model, "--out", "other.yaml")
    assert done.status == 0, done.stderr
    assert yaml.safe_load((tmp_path / "other.seed.yaml").read_text())["q"] == [0.0]
    assert "nothing touches at other.seed.yaml" in ciris("scene", "check", "other.yaml").stdout
    (tmp_path / "other.seed.yaml").write_text("q: [0, 0]\n")
    assert "other.seed.yaml" in ciris("scene", "check", "other.yaml").error
    assert "nothing touches at seed.yaml" in ciris("scene", "check", "scene.yaml").stdout
    (tmp_path / "other.seed.yaml").write_text("q: [0, 0]\n")
    assert "other.seed.yaml: q: it has 2 numbers, the scene 1 joint" in ciris("grow", "other.yaml", "--local").error
    (tmp_path / "other.seed.yaml").write_text("q: [1e9]\n")
    assert "other.seed.yaml: q[0]: 1000000000.0 is no number of at most 1e+06" in ciris("grow", "other.yaml", "--local").error
    assert "--q: it has 2 numbers" in ciris("grow", "other.yaml", "--q", "0,0", "--local").error
    (tmp_path / "other.seed.yaml").unlink()
    assert "put q into other.seed.yaml" in ciris("grow", "other.yaml", "--local").error


def test_an_ignored_pair_that_never_touches_is_remarked_on(ciris: Ciris, tmp_path: Path) -> None:
    """The finger never comes to the foot; the cover is always in it, so it is right to ignore that."""
    model, out = robot(tmp_path), tmp_path / "cell" / "scene.yaml"
    assert ciris("scene", "init", model, "--out", out).status == 0
    assert "are ignored, but touch at none" not in ciris("scene", "check", out).stdout
    out.write_text(out.read_text() + "  - {pair: [arm/base, arm/left], reason: never mind}\n")
    checked = ciris("scene", "check", out).stdout
    assert "warning: arm/base and arm/left are ignored, but touch at none of 201 configurations tried" in checked
    assert "arm/cover are ignored, but" not in checked


def test_what_cannot_be_drafted_is_named_and_leaves_nothing(ciris: Ciris, tmp_path: Path) -> None:
    model = robot(tmp_path)
    (tmp_path / "alone").mkdir()
    (tmp_path / "alone" / "arm.urdf").write_text(model.read_text())
    cases = [
        ((tmp_path / "alone" / "arm.urdf",), "--package tools=DIRECTORY"),
        ((tmp_path / "nothing.urdf",), "there is no file"),
        ((model, "--world", tmp_path / "ws" / "tools" / "meshes" / "finger.obj"), "finger.obj"),
        ((model, "--package", "tools"), "must be NAME=DIRECTORY, not 'tools'"),
    ]
    for i, (arguments, words) in enumerate(cases):
        out = tmp_path / f"case{i}" / "scene.yaml"
        done = ciris("scene", "init", *arguments, "--out", out)
        assert done.status == 2
        assert words in done.stderr
        assert not out.parent.exists()
    done = ciris(
        "scene", "init", tmp_path / "alone" / "arm.urdf", "--package", f"tools={tmp_path / 'ws' / 'tools'}", "--out", tmp_path / "s.yaml"
    )
    assert done.status == 0, done.stderr


def test_a_whole_cell_is_drafted_with_one_command(ciris: Ciris, tmp_path: Path) -> None:
    """A gripper whose file name has the sign before poses, a table that stands turned, and a file that stays at the origin."""
    for name in ("grip", "grip@2"):
        (tmp_path / f"{name}.urdf").write_text("<robot name='grip'><link name='palm'/></robot>")
    one = "<sdf version='1.9'><model name='{0}'><link name='top'/></model></sdf>"
    for name in ("table", "lamp"):
        (tmp_path / f"{name}.sdf").write_text(one.format(name))
    (tmp_path / "s.srdf").write_text("<robot name='arm'/>")
    where = (f"{tmp_path / 'grip@2.urdf'}@hand@0.1,0,0.2", f"{tmp_path / 'table.sdf'}@1,0,0,0,0,90", tmp_path / "lamp.sdf")
    arm = write(tmp_path).with_name("arm.urdf")
    out = tmp_path / "cell" / "scene.yaml"
    worlds = ("--world", where[1], "--world", where[2])
    done = ciris("scene", "init", arm, "--mount", where[0], *worlds, "--srdf", tmp_path / "s.srdf", "--out", out)
    assert done.status == 0, done.stderr
    welds = [line for line in out.read_text().splitlines() if "add_weld" in line]
    assert welds == [
        '  - add_weld: {parent: world, child: "arm::base"}',
        '  - add_weld: {parent: "arm::hand", child: "grip::palm", X_PC: {translation: [0.1, 0.0, 0.2]}}',
        '  - add_weld: {parent: world, child: "table::top", X_PC: {translation: [1.0, 0.0, 0.0], rotation: !Rpy {deg: [0.0, 0.0, 90.0]}}}',
        '  - add_weld: {parent: world, child: "lamp::top"}',
    ]
    assert 'srdf: {arm: "../s.srdf"}' in out.read_text()
    for option, value, words in (
        ("--mount", str(tmp_path / "grip.urdf"), "write grip.urdf@LINK; links at its ends: hand"),
        ("--mount", f"{tmp_path / 'grip.urdf'}@0,0,1", "write grip.urdf@LINK"),
        ("--mount", f"{tmp_path / 'grip.urdf'}@hand@0,0", "3 or 6 numbers, not 2"),
        ("--world", f"{tmp_path / 'table.sdf'}@0,0,1,x", "'x' is not a finite number"),
    ):
        refused = ciris("scene", "init", arm, option, value, "--out", tmp_path / "no" / "scene.yaml")
        assert (refused.status, refused.error.partition(":")[0].partition("[")[0]) == (2, option)
        assert words in refused.error
        assert not (tmp_path / "no").exists()


def test_a_check_says_what_touches(ciris: Ciris, tmp_path: Path) -> None:
    done = ciris("scene", "check", EXAMPLES / "planar_2dof" / "scene.yaml", "--json")
    assert done.status == 0
    assert done.json["touching"] == []
    assert [joint["name"] for joint in done.json["joints"]] == [j.name for j in load_scene(EXAMPLES / "planar_2dof" / "scene.yaml").moving]
    wall = ROOM.replace("0.6 0 0.3", "0.3 0 0.3")
    for name, text in (("arm.urdf", ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more="")), ("room.sdf", wall)):
        (tmp_path / name).write_text(text)
    directives = "".join(
        f"  - add_model: {{name: {n}, file: {f}}}\n  - add_weld: {{parent: world, child: {n}::{r}}}\n"
        for n, f, r in (("arm", "arm.urdf", "base"), ("room", "room.sdf", "walls"))
    )
    (tmp_path / "scene.yaml").write_text("directives:\n" + directives)
    done = ciris("scene", "check", tmp_path / "scene.yaml", "--q", "0")
    assert done.status == 1
    assert "touching at --q: arm/hand/palm and room/walls/wall" in done.stdout
    for q, words in (
        ("0,0", "2 numbers for 1 joint"),
        ("5", "not between its limits"),
        ("x", "no configuration 'x'"),
        ("0,x", "not a finite number"),
    ):
        done = ciris("scene", "check", tmp_path / "scene.yaml", "--q", q)
        assert done.status == 2
        assert words in done.error


def test_an_angle_that_no_double_tells_from_others_is_refused_without_a_service(ciris: Ciris, tmp_path: Path) -> None:
    scene, huge = EXAMPLES / "planar_2dof" / "scene.yaml", "9185166224891948,0"
    polytope = tmp_path / "polytope.json"
    polytope.write_text('{"C": [[1, 0]], "d": [0.1], "center": [0, 1e300]}')
    for arguments, field in (
        (("scene", "check", scene, "--q", huge), "--q[0]"),
        (("grow", scene, "--local", "--q", huge), "--q[0]"),
        (("grow", scene, "--local", "--q", "0,0", "--contain", huge), "--contain[0][0]"),
        (("certify-path", scene, "--local", "--q", "0,0", "--q", huge), "--q[1][0]"),
        (("certify", scene, "--local", "--polytope", polytope), "polytope.center[1]"),
    ):
        done = ciris(*arguments)
        assert (done.status, done.stdout) == (2, "")
        number = "1e+300" if polytope in arguments else "9185166224891948.0"
        assert done.stderr.splitlines()[-1] == f"error: {field}: {number} is no number of at most 1e+06"
