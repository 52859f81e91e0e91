"""A small arm in a room, written to files with any part replaced."""

from pathlib import Path

from certifier.model import Scene
from certifier.scene.parse import parse

EXAMPLES = Path(__file__).parents[3] / "examples"
NAMES = ("planar_2dof", "arm_3dof", "iiwa_shelf", "ur3e_bin", "dual_ur3e", "sphere_arm", "ur3e_gripper", "iiwa_gripper")

ARM = """<robot name="arm">
  <link name="base"><collision name="foot"><geometry><box size="0.2 0.2 0.1"/></geometry></collision></link>
  <joint name="turn" type="{kind}">
    <parent link="base"/><child link="hand"/><origin xyz="0 0 0.3"/><axis xyz="0 0 1"/>
    {limit}
  </joint>
  <link name="hand"><collision name="palm"><origin xyz="0.3 0 0"/><geometry>{shape}</geometry></collision></link>
  {more}
</robot>
"""
LIMIT = '<limit lower="-1" upper="2" effort="1" velocity="1"/>'
BOX = '<box size="0.1 0.1 0.1"/>'
ROOM = """<sdf version="1.7"><model name="room"><link name="walls">
  <collision name="wall"><pose>0.6 0 0.3 0 0 0</pose><geometry><box><size>0.1 1 1</size></box></geometry></collision>
</link></model></sdf>
"""
SCENE = """
directives:
  - add_model: {name: arm, file: arm.urdf}
  - add_weld: {parent: world, child: arm::base}
  - add_model: {name: room, file: room.sdf}
  - add_weld: {parent: world, child: room::walls}
"""


def write(directory: Path, scene=SCENE, *, extra="", kind="revolute", limit=LIMIT, shape=BOX, more="", arm=None, files=None) -> Path:
    """The path of the scene file."""
    texts = {"arm.urdf": arm or ARM.format(kind=kind, limit=limit, shape=shape, more=more), "room.sdf": ROOM, **(files or {})}
    for name, text in texts.items():
        (directory / name).write_text(text)
    path = directory / "scene.yaml"
    path.write_text(scene + extra)
    return path


def parsed(path: Path) -> Scene:
    """The child's half of loading, in this process: quick, for models that Drake survives."""
    return Scene.from_document(parse({"path": str(path)}))
