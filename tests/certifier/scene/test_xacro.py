"""Models in xacro are expanded in a child that reads nothing but the scene's files, and they travel expanded."""

import zipfile
from io import BytesIO

import pytest

from certifier.errors import SceneError
from certifier.scene import load_bundle, load_scene, pack_bundle
from tests.certifier.scene.workshop import ARM, BOX, LIMIT, write

HEAD = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" name="arm">'
SIZED = '<box size="${size} 0.1 0.1"/>'
ARGUMENT = '<xacro:arg name="size" default="0.1"/><xacro:property name="size" value="$(arg size)"/>'


def scene(tmp_path, *, more="", shape=SIZED, extra="", files=None):
    arm = ARM.format(kind="revolute", limit=LIMIT, shape=shape, more="").replace('<robot name="arm">', HEAD + ARGUMENT + more)
    return write(tmp_path, arm=arm, extra=extra, files=files)


def refusal(path):
    with pytest.raises(SceneError) as caught:
        load_scene(path)
    return caught.value


def test_an_argument_makes_the_box_that_it_says(tmp_path):
    plain = load_scene(write(tmp_path, shape='<box size="0.2 0.1 0.1"/>'))
    assert load_scene(scene(tmp_path, extra="xacro: {size: 0.2}\n")).hash == plain.hash
    assert load_scene(scene(tmp_path)).hash != plain.hash


def test_the_service_loads_the_same_scene_without_xacro(tmp_path):
    macro = '<xacro:macro name="ball" params="r"><link name="ball_${r}"/></xacro:macro>'
    part = f'<robot xmlns:xacro="http://www.ros.org/wiki/xacro">{macro}</robot>'
    more = '<xacro:include filename="$(find parts)/part.xacro"/><xacro:ball r="1"/>'
    more += '<joint name="j" type="fixed"><parent link="hand"/><child link="ball_1"/></joint>'
    (tmp_path / "parts").mkdir()
    extra = "packages: {parts: parts}\nxacro:\n  size: 0.3\n"
    path = scene(tmp_path, more=more, extra=extra, files={"parts/part.xacro": part})
    data = pack_bundle(path)
    assert load_bundle(data).scene.hash == load_scene(path).hash
    with zipfile.ZipFile(BytesIO(data)) as archive:
        texts = {name: archive.read(name).decode() for name in archive.namelist()}
    assert "xacro:include" not in texts["arm.urdf"]
    assert str(tmp_path) not in "".join(texts.values())
    assert "size: 0.3" not in texts["scene.yaml"]


def test_an_argument_that_nothing_declares_is_refused(tmp_path):
    error = refusal(scene(tmp_path, extra="xacro: {sise: 0.2}\n"))
    assert (error.code, error.field) == ("scene_xacro", "xacro.sise")
    assert "size" in error.hint


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ('<xacro:property name="x" value="${xacro.load_yaml(\'/etc/passwd\')}"/><link name="${x}"/>', "/etc/passwd"),
        ('<xacro:include filename="/etc/hosts"/>', "/etc/hosts"),
        ('<xacro:include filename="link.xacro"/>', "link.xacro"),
        ('<xacro:include filename="/etc/*.conf"/>', "/etc"),
        ('<link name="$(env HOME)"/>', "environment variable 'HOME' is not read"),
        ('<link name="$(optenv HOME x)"/>', "environment variable 'HOME' is not read"),
        ('<link name="$(find nowhere)"/>', "the package 'nowhere' is not known"),
        ('<link name="${python.type(python.list).mro()[1].__subclasses__()}"/>', "arm.urdf: xacro: "),
        ('<xacro:include filename="arm.urdf"/>', "xacro: "),
        ('<xacro:macro name="m"><xacro:m/></xacro:macro><xacro:m/>', "xacro: "),
        ('<link name="${nothing}"/>', "arm.urdf: xacro: name 'nothing' is not defined"),
    ],
)
def test_expressions_reach_nothing_else(tmp_path, more, words):
    (tmp_path / "link.xacro").symlink_to("/etc/hosts")
    error = refusal(scene(tmp_path, more=more))
    assert error.code == "scene_xacro"
    assert words in error.message
    assert error.hint


def test_what_grows_without_end_ends_with_the_child(tmp_path):
    doubled = '<xacro:property name="a0" value="xxxxxxxxxx"/>'
    doubled += "".join(f'<xacro:property name="a{i + 1}" value="${{a{i} * 10}}"/>' for i in range(12))
    error = refusal(scene(tmp_path, more=doubled + '<link name="${a12}"/>'))
    assert error.code in ("scene_xacro", "scene_model_crash")


def test_errors_of_the_expansion_say_so(tmp_path):
    error = refusal(scene(tmp_path, shape='<box size="${size} 0 0.1"/>'))
    assert error.message.startswith("arm.urdf (expanded):")


def test_a_strangers_xacro_is_refused(tmp_path):
    path = scene(tmp_path)
    data = BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for file in path.parent.iterdir():
            archive.write(file, file.name)
    with pytest.raises(SceneError, match=r"written in xacro.*ciris scene add") as caught:
        load_bundle(data.getvalue())
    assert caught.value.code == "bundle_file"


def test_a_file_that_only_declares_the_namespace_is_read_in_place(tmp_path):
    arm = ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more="")
    plain = load_scene(write(tmp_path, arm=arm))
    assert load_scene(write(tmp_path, arm=arm.replace('<robot name="arm">', HEAD))).hash == plain.hash
