"""colcon installs models as symbolic links. Their meshes and includes are beside the link, where MuJoCo and yourdfpy find them, too."""

import os
import re

import mujoco
import numpy as np
import pytest
import yourdfpy

from certifier.errors import SceneError
from certifier.scene import load_bundle, load_scene, pack_bundle
from certifier.scene.draft import draft
from tests.certifier.scene.workshop import parsed

MESH = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 {}\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
HEIGHTS = {"source": 9, "installed": 2}
"""The height of the mesh beside the file itself, and beside the link, metres."""
URDF = """<robot name="r"><link name="base"/><link name="arm"><collision><geometry><mesh filename="{}m.obj"/></geometry></collision></link>
<joint name="j" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/>
<limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>"""
SDF = """<sdf version="1.9"><model name="r"><link name="base"/><link name="arm">{}</link>
<joint name="j" type="revolute"><parent>base</parent><child>arm</child>
<axis><xyz>0 0 1</xyz><limit><lower>-1</lower><upper>1</upper></limit></axis>
</joint>{}</model></sdf>"""
SOLID = "<collision name='c'><geometry><mesh><uri>m.obj</uri></mesh></geometry></collision>"
INCLUDE = "<include><uri>part.sdf</uri></include><joint name='f' type='fixed'><parent>arm</parent><child>part::l</child></joint>"
PART = f'<sdf version="1.9"><model name="part"><link name="l">{SOLID}</link></model></sdf>'
MJCF = """<mujoco model="r"><compiler {}/>{}<worldbody><body name="base"><body name="arm"><joint name="j" range="-60 60"/>
<geom name="c" type="mesh" mesh="m"/></body></body></worldbody></mujoco>"""
ASSET = "<asset><mesh name='m' file='m.obj'/></asset>"
MODELS = {
    "r.urdf": URDF.format(""),
    "package.urdf": URDF.format("package://p/"),
    "r.sdf": SDF.format(SOLID, ""),
    "include.sdf": SDF.format("", INCLUDE),
    "r.xml": MJCF.format("", ASSET),
    "include.xml": MJCF.format("", "<include file='assets.xml'/>"),
}
WELD = "add_weld: {parent: world, child: r::base}"


def laid_out(directory, model, by_package):
    """Writes a model into source/ and a link to it into installed/, other files into both, and returns a scene file with the link."""
    for place, height in HEIGHTS.items():
        (directory / place).mkdir()
        (directory / place / "m.obj").write_text(MESH.format(height))
        (directory / place / "part.sdf").write_text(PART)
        (directory / place / "assets.xml").write_text(f"<mujoco>{ASSET}</mujoco>")
    (directory / "source" / model).write_text(MODELS[model])
    (directory / "installed" / model).symlink_to(os.path.join("..", "source", model))
    file = f"package://p/{model}" if by_package else f"installed/{model}"
    weld = f"\n  - {WELD}" if not model.endswith(".xml") else ""
    scene = directory / "scene.yaml"
    scene.write_text(f"packages: {{p: installed}}\ndirectives:\n  - add_model: {{name: r, file: {file}}}{weld}\n")
    return scene


def height(scene):
    return np.concatenate([g.vertices for g in scene.geometries])[:, 2].max()


@pytest.mark.parametrize("by_package", [False, True])
@pytest.mark.parametrize("model", MODELS)
def test_what_stands_beside_a_link_is_read(tmp_path, model, by_package):
    path = laid_out(tmp_path, model, by_package)
    scene = parsed(path)
    assert height(scene) == pytest.approx(HEIGHTS["installed"])
    assert scene.hash == load_bundle(pack_bundle(path)).scene.hash
    link = tmp_path / "installed" / model
    if model == "r.urdf":
        bounds = yourdfpy.URDF.load(str(link), load_meshes=False, load_collision_meshes=True, build_collision_scene_graph=True)
        assert bounds.collision_scene.bounds[1][2] == pytest.approx(height(scene))
    if model.endswith(".xml"):
        compiled = mujoco.MjModel.from_xml_path(str(link))
        R = np.zeros(9)
        mujoco.mju_quat2Mat(R, compiled.mesh_quat[0])
        assert (compiled.mesh_vert @ R.reshape(3, 3).T)[:, 2].max() + compiled.mesh_pos[0, 2] == pytest.approx(height(scene), abs=1e-5)


def test_a_draft_names_the_link(tmp_path):
    laid_out(tmp_path, "r.urdf", by_package=False)
    made = draft(tmp_path / "installed" / "r.urdf", [], tmp_path / "drafted.yaml", {}, {})
    assert "file: installed/r.urdf" in made.text
    assert height(made.scene) == pytest.approx(HEIGHTS["installed"])


def test_a_scene_file_that_is_a_link_has_its_models_beside_it(tmp_path):
    path = laid_out(tmp_path, "r.urdf", by_package=False)
    (tmp_path / "elsewhere").mkdir()
    path.rename(tmp_path / "elsewhere" / "scene.yaml")
    path.symlink_to(tmp_path / "elsewhere" / "scene.yaml")
    scene = load_scene(path)
    assert height(scene) == pytest.approx(HEIGHTS["installed"])
    assert scene.hash == load_bundle(pack_bundle(path)).scene.hash


@pytest.mark.parametrize("model", ["r.urdf", "r.sdf", "include.sdf", "r.xml", "include.xml"])
def test_a_path_that_goes_up_from_a_linked_directory_is_refused(tmp_path, model):
    """Drake looks beside the link, and MuJoCo beside what it leads to."""
    path = laid_out(tmp_path, model, by_package=True)
    link = tmp_path / "installed" / model
    text = re.sub(r"(m\.obj|part\.sdf|assets\.xml)", r"linked/../\1", MODELS[model])
    (tmp_path / "source" / model).write_text(text)
    (tmp_path / "source" / "deep").mkdir()
    (link.parent / "linked").symlink_to(tmp_path / "source" / "deep")
    with pytest.raises(SceneError, match=r"'linked/\.\./[\w.]+' goes up by \.\. from a symbolic link"):
        parsed(path)


def test_a_model_behind_a_linked_directory_is_read(tmp_path):
    path = laid_out(tmp_path, "r.urdf", by_package=True)
    (tmp_path / "way").symlink_to("installed")
    path.write_text(path.read_text().replace("p: installed", "p: way"))
    assert height(parsed(path)) == pytest.approx(HEIGHTS["installed"])
