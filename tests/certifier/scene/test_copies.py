"""Where Drake reads a copy, the scene is that of the user's file, and messages name the user's file and its line."""

import struct
from pathlib import Path

import mujoco
import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene.draft import draft
from tests.certifier.scene.workshop import parsed, write

TRANSMISSION = '<transmission name="{}"><type>SimpleTransmission</type><joint name="turn"/><actuator name="motor"/></transmission>'
NOT_GEOMETRY = """<safety_controller k_velocity="1"/>
<calibration rising="0"/>
<dynamics friction="1"/>"""
CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], np.float32) / 10
STL = bytes(80) + struct.pack("<I", 4) + b"".join(
    struct.pack("<12fH", 0, 0, 0, *CORNERS[face].ravel(), 0) for face in ([0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3])
)  # fmt: skip


def limit(more):
    return {"limit": f'<limit lower="-1" upper="2" effort="1" velocity="1"/>{more}'}


def test_what_is_not_geometry_is_left_out_with_one_warning(tmp_path):
    plain = parsed(write(tmp_path))
    scene = parsed(write(tmp_path, more=TRANSMISSION.format("a") + TRANSMISSION.format("b"), **limit(NOT_GEOMETRY)))
    assert scene.hash == plain.hash
    said = set(scene.warnings) - set(plain.warnings)
    assert said == {
        "left out of the models: calibration, dynamics, safety_controller, transmission; they say nothing about where the robot can be"
    }


def test_drakes_messages_name_the_users_file_and_line(tmp_path):
    more = (
        TRANSMISSION.format("a") + '\n<drake:collision_filter_group name="g"><drake:member link="nobody"/></drake:collision_filter_group>'
    )
    with pytest.raises(SceneError) as caught:
        parsed(write(tmp_path, more=more))
    plain = write(tmp_path, more="\n" + more.partition("\n")[2])
    with pytest.raises(SceneError) as expected:
        parsed(plain)
    assert caught.value.message == expected.value.message
    assert "arm.urdf" in caught.value.message


@pytest.mark.parametrize("room", ["room.sdf", "package://here/room.sdf"])
def test_a_file_that_includes_a_copy_is_copied(tmp_path, room):
    (tmp_path / "m.stl").write_bytes(STL)
    inner = """<sdf version="1.7"><model name="in"><link name="walls"><collision name="wall"><geometry>
<mesh><uri> m.stl
</uri></mesh></geometry></collision></link></model></sdf>"""
    outer = '<sdf version="1.7"><model name="room"><include merge="true"><uri>in.sdf</uri></include></model></sdf>'
    scene = write(tmp_path, extra="packages: {here: .}\n", files={"room.sdf": outer, "in.sdf": inner})
    scene.write_text(scene.read_text().replace("file: room.sdf", f"file: {room}"))
    wall = parsed(scene).geometry("room/walls/wall")
    assert wall.shape["file"] == "m.stl"
    assert np.abs(wall.vertices).max() == CORNERS.max()


def test_added_directives_lead_to_copies(tmp_path):
    more = "directives:\n- add_model: {name: room, file: 'package://here/room.sdf'}\n"
    (tmp_path / "m.stl").write_bytes(STL)
    room = '<sdf version="1.7"><model name="room"><link name="walls"><collision name="wall"><geometry><mesh><uri>m.stl</uri></mesh>'
    room += "</geometry></collision></link></model></sdf>"
    scene = write(tmp_path, extra="packages: {here: .}\n", files={"room.sdf": room, "more.dmd.yaml": more})
    scene.write_text(scene.read_text().replace("add_model: {name: room, file: room.sdf}", "add_directives: {file: more.dmd.yaml}"))
    assert parsed(scene).geometry("room/walls/wall").shape["file"] == "m.stl"


def test_mujoco_sees_the_same_stl_in_mjcf(tmp_path):
    (tmp_path / "meshes").mkdir()
    (tmp_path / "meshes" / "m.stl").write_bytes(STL)
    (tmp_path / "meshes" / "drawn.stl").write_bytes(STL)
    text = """<mujoco model="arm"><compiler meshdir="meshes"/><asset><mesh name="m" file="m.stl" scale="2 2 2"/>
<mesh name="drawn" file="drawn.stl"/></asset>
<worldbody><body name="hand"><joint name="turn" axis="0 0 1" range="-1 1"/><geom name="palm" type="mesh" mesh="m"/>
<geom type="mesh" mesh="drawn" contype="0" conaffinity="0"/></body></worldbody></mujoco>"""
    scene = write(tmp_path, files={"arm.xml": text})
    directives = "directives:\n- add_model: {name: arm, file: arm.xml}\n- add_model: {name: room, file: room.sdf}\n"
    scene.write_text(directives + "- add_weld: {parent: world, child: 'room::walls'}\n")
    ours = parsed(scene).geometry("arm/hand/palm").vertices
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "arm.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    palm, mesh = model.geom("palm").id, model.mesh("m").id
    first = model.mesh_vertadr[mesh]
    theirs = model.mesh_vert[first : first + model.mesh_vertnum[mesh]] @ data.geom_xmat[palm].reshape(3, 3).T + data.geom_xpos[palm]
    assert np.allclose(np.unique(np.round(ours, 6), axis=0), np.unique(np.round(theirs, 6), axis=0), atol=1e-6)


def test_a_mimic_of_a_fixed_joint_and_materials_stop_nothing(tmp_path):
    materials = '<material name="m"><color rgba="1 0 0 1"/></material><material name="m"><color rgba="0 0 0 1"/></material>'
    fixed = '<link name="tip"/><joint name="t" type="fixed"><parent link="hand"/><child link="tip"/><mimic joint="turn"/></joint>'
    assert parsed(write(tmp_path, more=materials + fixed)).pairs


@pytest.mark.parametrize("encoding", ["utf-16", "utf-32"])
def test_a_model_in_another_encoding_is_refused_by_name(tmp_path: Path, encoding: str) -> None:
    model = tmp_path / "arm.urdf"
    model.write_bytes(f'<?xml version="1.0" encoding="{encoding}"?><robot name="arm"/>'.encode(encoding))
    with pytest.raises(SceneError, match=r"arm\.urdf: the file is in UTF-16 or UTF-32"):
        draft(model, [], tmp_path / "scene.yaml", {})
