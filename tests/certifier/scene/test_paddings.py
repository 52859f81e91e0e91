"""What a scene file says of the padding of bodies and of pairs."""

from __future__ import annotations

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene.file import read_scene_file
from tests.certifier.scene.workshop import parsed, write

MORE = """<joint name="nod" type="revolute"><parent link="hand"/><child link="tip"/><origin xyz="0.3 0 0.3"/><axis xyz="0 1 0"/>
  <limit lower="-1" upper="1" effort="1" velocity="1"/></joint>
  <link name="tip"><collision name="left"><geometry><box size="0.1 0.02 0.02"/></geometry></collision>
    <collision name="right"><origin xyz="0 0.05 0"/><geometry><box size="0.1 0.02 0.02"/></geometry></collision></link>"""
PAIRS = (("hand/palm", "walls"), ("base/foot", "tip/left"), ("base/foot", "tip/right"), ("tip/left", "walls"), ("tip/right", "walls"))


def paddings(tmp_path, said):
    """By the short names of PAIRS, and what the scene warns of."""
    scene = parsed(write(tmp_path, more=MORE, extra=f"padding: {said}\n"))
    full = {("arm/" + a, "room/walls/wall" if b == "walls" else "arm/" + b): (a, b) for a, b in PAIRS}
    found = {full[p.a, p.b]: scene.padding_of(p) for p in scene.pairs}
    assert found.keys() == set(PAIRS)
    return tuple(found[pair] for pair in PAIRS), [w for w in scene.warnings if "padding" in w]


@pytest.mark.parametrize(
    ("said", "expected"),
    [
        ("0.01", (0.01, 0.01, 0.01, 0.01, 0.01)),
        ("{default: 0.01}", (0.01, 0.01, 0.01, 0.01, 0.01)),
        ("{bodies: {arm/tip: 0.02}}", (0, 0.02, 0.02, 0.02, 0.02)),
        ("{default: 0.01, bodies: {arm/tip: 0.002}}", (0.01, 0.002, 0.002, 0.002, 0.002)),
        ("{bodies: {arm/tip: 0.02, room/walls: 0.03}}", (0.03, 0.02, 0.02, 0.03, 0.03)),
        ("{bodies: {arm/tip: 0.02, arm/tip/left: 0.001}}", (0, 0.001, 0.02, 0.001, 0.02)),
        ("{bodies: {arm/tip: 0.02, arm/tip/left: 0.001, room/walls: 0.005}}", (0.005, 0.001, 0.02, 0.005, 0.02)),
        ("{bodies: {arm/tip: 1}, pairs: [{pair: [room/walls, arm/tip], padding: 0}]}", (0, 1, 1, 0, 0)),
        (
            "{pairs: [{pair: [arm/tip/left, room/walls], padding: 0.1}, {pair: [arm/tip, room/walls/wall], padding: 0.2}]}",
            (0, 0, 0, 0.1, 0.2),
        ),
        (
            "{pairs: [{pair: [arm/tip, room/walls/wall], padding: 0.2}, {pair: [arm/tip/left, room/walls], padding: 0.1}]}",
            (0, 0, 0, 0.2, 0.2),
        ),
    ],
)
def test_the_padding_of_each_pair_is_what_the_file_says(tmp_path, said, expected):
    assert paddings(tmp_path, said)[0] == expected


def test_what_concerns_no_pair_gives_a_warning(tmp_path):
    said = "{bodies: {world: 0.1}, pairs: [{pair: [arm/base, arm/hand], padding: 0.1}]}"
    warnings = [
        "padding.bodies.world: world has no pair to certify",
        "padding.pairs[0].pair: arm/base and arm/hand have no pair to certify",
    ]
    assert paddings(tmp_path, said) == ((0, 0, 0, 0, 0), warnings)
    both = "{pairs: [{pair: [arm/tip, room/walls], padding: 0.1}, {pair: [room/walls, arm/tip], padding: 0.2}]}"
    assert paddings(tmp_path, both) == ((0, 0, 0, 0.1, 0.1), ["padding.pairs[1].pair: room/walls and arm/tip have no pair to certify"])


@pytest.mark.parametrize(
    ("said", "field"),
    [
        ("{bodies: {arm/tpi: 0.1}}", "padding.bodies.arm/tpi"),
        ("{pairs: [{pair: [arm/tip, room], padding: 0.1}]}", "padding.pairs[0].pair[1]"),
    ],
)
def test_unknown_names_are_refused(tmp_path, said, field):
    with pytest.raises(SceneError) as refusal:
        parsed(write(tmp_path, more=MORE, extra=f"padding: {said}\n"))
    assert (refusal.value.code, refusal.value.field) == ("unknown_name", field)


def test_a_name_is_suggested_once(tmp_path):
    with pytest.raises(SceneError) as refusal:
        parsed(write(tmp_path, extra="padding: {bodies: {arm/hnd: 0.01}}\n"))
    assert str(refusal.value.hint).count("arm/hand") == 1 + str(refusal.value.hint).count("arm/hand/")


@pytest.mark.parametrize("said", ["0.4", "{bodies: {arm/tip: 0.4}}", "{pairs: [{pair: [arm/tip, room/walls], padding: 0.4}]}"])
def test_a_half_space_reaches_as_far_as_the_largest_padding(tmp_path, said):
    path = write(tmp_path, more=MORE, extra=f"padding: {said}\n")
    (tmp_path / "room.sdf").write_text(
        '<sdf version="1.7"><model name="room"><link name="walls"><collision name="wall"><pose>0 0 -1 0 0 0</pose>'
        "<geometry><plane><normal>0 0 1</normal></plane></geometry></collision></link></model></sdf>"
    )
    assert read_scene_file(path).largest_padding == 0.4
    slab = parsed(path).geometry("room/walls/wall").vertices
    assert np.abs(slab[:, :2]).max() >= 0.3 + 0.3 + 2 * 0.4


def test_a_pair_that_is_always_nearer_than_its_padding_gives_a_warning(tmp_path):
    """The foot and the tip are 0.3 to 0.6 m apart."""
    scene = parsed(write(tmp_path, more=MORE, extra="padding: {pairs: [{pair: [arm/base, arm/tip/left], padding: 0.4}]}\n"))
    foot = "arm/base/foot and arm/tip/left are nearer than a padding of 0.4 m on each in every configuration tried"
    assert [w for w in scene.warnings if "every configuration" in w] == [
        f"{foot}: mend the geometry, or ignore the pair with a reason, or give it less padding"
    ]
    assert not [w for w in parsed(write(tmp_path, more=MORE)).warnings if "every configuration" in w]
