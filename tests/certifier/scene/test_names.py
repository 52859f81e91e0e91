"""No two bodies, joints or geometries get one name, and every collision geometry of the models is in the scene."""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
import pytest

import certifier.scene.parse
from certifier.errors import SceneError
from certifier.scene.strict import StrictReader
from tests.certifier.scene.workshop import SCENE, parsed, write

CUBE = '<geometry><box size="0.1 0.1 0.1"/></geometry>'
LINK = '<link name="{0}">{1}</link><joint name="to {0}" type="fixed"><parent link="hand"/><child link="{0}"/></joint>'
ROOM = '<sdf version="1.9"><model name="room"><link name="walls"/>{}</model></sdf>'
BOX = "<geometry><box><size>0.1 0.1 0.1</size></box></geometry>"
WORLD_GEOM = '<mujoco model="floor"><worldbody><geom name="{}" size="0.1"/></worldbody></mujoco>'
HINGE = """<mujoco model="{}"><worldbody><body name="b"><joint name="{}" type="hinge" range="-60 60"/><geom size="0.1"/></body>
  </worldbody></mujoco>"""


def collision(name: str) -> str:
    return f'<collision name="{name}">{CUBE}</collision>'


def model(name: str, file: str, weld: str = "") -> str:
    weld = weld and f"  - add_weld: {{parent: world, child: '{name}::{weld}'}}\n"
    return f"  - add_model: {{name: '{name}', file: {file}}}\n{weld}"


@pytest.mark.parametrize(
    ("change", "name", "owners"),
    [
        (
            {"more": LINK.format("a", collision("b/c")) + LINK.format("a/b", collision("c"))},
            "arm/a/b/c",
            ["geometry 'b/c' of body 'a' of model 'arm'", "geometry 'c' of body 'a/b' of model 'arm'"],
        ),
        (
            {"more": LINK.format("a", collision("b")) + LINK.format("a/b", "")},
            "arm/a/b",
            ["body 'a/b' of model 'arm'", "geometry 'b' of body 'a' of model 'arm'"],
        ),
        (
            {
                "scene": SCENE + model("world", "cube.sdf", "b") + model("floor", "floor.xml"),
                "files": {
                    "floor.xml": WORLD_GEOM.format("b/c"),
                    "cube.sdf": ROOM.format("")
                    .replace("<link", f'<link name="b"><collision name="c">{BOX}</collision></link><link')
                    .replace("</model>", '<joint name="j" type="fixed"><parent>b</parent><child>walls</child></joint></model>'),
                },
            },
            "world/b/c",
            ["geometry 'c' of body 'b' of model 'world'", "geometry 'b/c' of body 'world' of model 'WorldModelInstance'"],
        ),
        (
            {
                "scene": SCENE + model("m/a", "one.xml") + model("m", "two.xml"),
                "files": {"one.xml": HINGE.format("one", "j"), "two.xml": HINGE.format("two", "a/j").replace('"b"', '"c"')},
            },
            "m/a/j",
            ["joint 'j' of model 'm/a'", "joint 'a/j' of model 'm'"],
        ),
        (
            {
                "scene": SCENE,
                "files": {
                    "room.sdf": ROOM.format(
                        f'<link name="a"><collision name="b/c">{BOX}</collision></link>'
                        f'<link name="a/b"><collision name="c">{BOX}</collision></link>'
                        '<joint name="i" type="fixed"><parent>walls</parent><child>a</child></joint>'
                        '<joint name="j" type="fixed"><parent>walls</parent><child>a/b</child></joint>'
                    )
                },
            },
            "room/a/b/c",
            ["body 'a'", "body 'a/b'"],
        ),
    ],
)
def test_two_things_of_one_name_are_refused(tmp_path: Path, change: dict, name: str, owners: list[str]) -> None:
    with pytest.raises(SceneError, match=rf"would both be called {name} \(") as caught:
        parsed(write(tmp_path, **change))
    assert caught.value.code == "scene_name"
    for owner in owners:
        assert owner in caught.value.message


def test_names_out_of_few_letters_are_distinct_or_refused(tmp_path: Path) -> None:
    """Every geometry that the file has is in the scene, or the scene is refused."""
    rng = np.random.default_rng(0)
    parts = ["/".join(word) for n in (1, 2, 3) for word in itertools.product("ab", repeat=n)]
    refused = 0
    for _ in range(30):
        links = rng.choice(parts, size=3, replace=False)
        collisions = [rng.choice(parts, size=3, replace=False) for _ in links]
        text = "".join(LINK.format(link, "".join(map(collision, names))) for link, names in zip(links, collisions, strict=True))
        expected = [f"arm/{link}/{name}" for link, names in zip(links, collisions, strict=True) for name in names]
        clear = len({*expected, *(f"arm/{link}" for link in links)}) == len(expected) + len(links)
        path = write(tmp_path, more=text)
        if clear:
            assert {*expected, "arm/base/foot", "arm/hand/palm", "room/walls/wall"} == {g.name for g in parsed(path).geometries}
        else:
            refused += 1
            with pytest.raises(SceneError, match="would both be called"):
                parsed(path)
    assert 5 < refused < 25


def test_a_hull_is_not_called_as_a_body(tmp_path: Path) -> None:
    claw = LINK.format("claw", collision("a") + collision("b")) + LINK.format("claw/hull", collision("c"))
    scene = parsed(write(tmp_path, more=claw, extra="hulls: [arm/claw]\n"))
    assert [g.name for g in scene.geometries if g.body == "arm/claw"] == ["arm/claw/hull2"]
    assert scene.geometry("arm/claw/hull/c").body == "arm/claw/hull"


COUNTED = f'<link name="b"><collision name="c">{BOX}</collision><collision name="d"><geometry><empty/></geometry></collision></link>'
TWICE = "".join(
    f'<include><uri>part.sdf</uri><name>{name}</name></include><joint name="to {name}" type="fixed"><parent>walls</parent>'
    f"<child>{name}::b</child></joint>"
    for name in "pq"
)


@pytest.mark.parametrize("more", ["", "  - add_directives: {file: package://here/more.yaml}\n"])
def test_geometries_of_files_that_are_added_again_count_again(tmp_path: Path, more: str, monkeypatch: pytest.MonkeyPatch) -> None:
    counted = []
    check = StrictReader.check
    monkeypatch.setattr(StrictReader, "check", lambda *arguments: counted.append(check(*arguments)) or counted[-1])
    files = {
        "room.sdf": ROOM.format(TWICE),
        "part.sdf": f'<sdf version="1.9"><model name="part">{COUNTED}</model></sdf>',
        "arm.sdf": f'<sdf version="1.9"><model name="arm">{COUNTED}<link name="t"/><joint name="j" type="revolute"><parent>b</parent>'
        "<child>t</child><axis><limit><lower>-1</lower><upper>1</upper></limit></axis></joint></model></sdf>",
        "more.yaml": f"directives:\n{model('third', 'package://here/room.sdf', 'walls')}{model('fourth', 'package://here/arm.sdf', 'b')}",
    }
    scene = "packages: {here: .}\n" + SCENE
    read = parsed(write(tmp_path, scene + model("second", "room.sdf", "walls") + more, files=files))
    assert counted == [len(read.geometries)] == [6 + 3 * bool(more)]


def test_a_geometry_that_drake_leaves_out_is_missed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(StrictReader, "check", lambda *_: 4)
    with pytest.raises(SceneError, match="the model files have 4 collision geometries, and Drake has read 3") as caught:
        parsed(write(tmp_path))
    assert caught.value.code == "scene_geometries"


def test_a_geometry_that_is_lost_on_the_way_to_the_scene_is_missed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Two geometry ids for one geometry are what a hull has, and no hull is asked for here."""
    monkeypatch.setattr(certifier.scene.parse, "with_hulls", lambda parts, *_: dict(zip(parts, [*parts.values()][:1] * 3, strict=True)))
    with pytest.raises(SceneError, match="must have each of them; it has 1"):
        parsed(write(tmp_path))
