"""Models in xacro are expanded in a child that reads nothing but the scene's files, and they travel expanded."""

import zipfile
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from types import SimpleNamespace

import pytest

from certifier.errors import SceneError
from certifier.isolation.confinement import Layers
from certifier.scene import load_bundle, load_scene, pack_bundle
from certifier.scene.bundle import BundleLimits
from certifier.scene.macros import Expander
from certifier.scene.strange_xacro import MOST
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


def zipped(path, **more):
    """A plain zip of the directory of a scene file, as a stranger sends it."""
    data = BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for file in sorted(path.parent.rglob("*")):
            if file.is_file() and not file.is_symlink():
                archive.write(file, file.relative_to(path.parent))
        for name, text in more.items():
            archive.writestr(name, text)
    return data.getvalue()


CONFINING = Layers(namespaces=True, landlock=1, seccomp=True)


@pytest.fixture
def confining(monkeypatch):
    """The kernel is taken for one that confines children, whatever it can: tests of the confinement itself are elsewhere."""
    monkeypatch.setattr("certifier.scene.bundle.probed", lambda: CONFINING)


@pytest.mark.usefixtures("confining")
def test_a_strangers_xacro_is_expanded(tmp_path):
    path = scene(tmp_path, extra="xacro: {size: 0.3}\n")
    assert load_bundle(zipped(path)).scene.hash == load_scene(path).hash


@pytest.mark.parametrize("layers", [replace(CONFINING, landlock=0), replace(CONFINING, seccomp=False)])
def test_where_the_kernel_does_not_confine_who_expands_it_a_strangers_xacro_is_refused(tmp_path, monkeypatch, layers):
    monkeypatch.setattr("certifier.scene.bundle.probed", lambda: layers)
    with pytest.raises(SceneError, match=r"arm\.urdf is written in xacro, and this machine cannot keep") as caught:
        load_bundle(zipped(scene(tmp_path)))
    assert caught.value.code == "bundle_file"
    assert "ciris scene add" in caught.value.hint


@pytest.mark.usefixtures("confining")
def test_a_robot_alone_in_xacro_is_drafted_with_the_packages_of_the_zip(tmp_path):
    part = '<robot xmlns:xacro="http://www.ros.org/wiki/xacro"><xacro:property name="size" value="0.3"/></robot>'
    more = '<xacro:include filename="$(find parts)/part.xacro"/>'
    (tmp_path / "parts").mkdir()
    path = scene(tmp_path, more=more, files={"parts/part.xacro": part})
    (tmp_path / "arm.urdf").rename(tmp_path / "arm.urdf.xacro")
    for file in (path, tmp_path / "room.sdf"):
        file.unlink(missing_ok=True)
    drafted = load_bundle(zipped(path)).scene
    assert (drafted.name, drafted.n) == ("arm", 1)


@pytest.mark.usefixtures("confining")
@pytest.mark.parametrize(
    "expression",
    [
        "xacro.load_yaml('/etc/passwd')",
        "xacro.load_yaml('../bundle.zip')",
        "python.open('/etc/passwd').read()",
        "python.__import__('socket').socket().connect(('127.0.0.1', 80))",
        "python.__import__('os').fork()",
        "python.__import__('os').environ",
    ],
)
def test_a_strangers_expression_reaches_no_file_and_no_network(tmp_path, expression):
    path = scene(tmp_path, more=f'<xacro:property name="x" value="${{{expression}}}"/><link name="${{x}}"/>')
    with pytest.raises(SceneError) as caught:
        load_bundle(zipped(path))
    assert caught.value.code == "scene_xacro"
    assert "root:" not in caught.value.message


def test_nothing_is_expanded_in_the_process_that_reads_a_strangers_files(tmp_path, monkeypatch):
    path = scene(tmp_path)
    monkeypatch.setattr("certifier.scene.macros.alone", lambda: True)
    with pytest.raises(SceneError, match=r"arm\.urdf is written in xacro, and only models") as caught:
        Expander(tmp_path, {}, {}).expanded(path.parent / "arm.urdf", "arm.urdf")
    assert caught.value.code == "bundle_file"


@pytest.mark.usefixtures("confining")
def test_an_argument_that_no_model_of_a_stranger_has_is_refused(tmp_path):
    with pytest.raises(SceneError, match="no model has an argument 'sise'"):
        load_bundle(zipped(scene(tmp_path, extra="xacro: {sise: 0.2}\n")))


def test_a_stranger_may_have_a_few_models_in_xacro(tmp_path):
    models = {f"m{k}.urdf": f'{HEAD}<xacro:property name="x" value="{k}"/></robot>' for k in range(MOST + 1)}
    add = "".join(f"- add_model: {{name: m{k}, file: m{k}.urdf}}\n" for k in range(MOST + 1))
    with pytest.raises(SceneError, match=f"{MOST + 1} models in xacro, and at most {MOST}"):
        load_bundle(zipped(tmp_path / "scene.yaml", **models, **{"scene.yaml": f"directives:\n{add}"}))


@pytest.mark.usefixtures("confining")
def test_all_children_of_a_strangers_zip_are_confined_and_share_its_time(monkeypatch):
    """Each child takes 15 s here, of 20 s that a small zip may take."""
    answers = [{"scene": "scene.yaml", "expand": [{"path": f"m{k}.urdf"} for k in range(3)]}, *[{"text": "", "declared": []}] * 3, None]
    clock, given = [0.0], []

    def child(function, payload, name, seconds, memory, strange):
        assert Path(strange).is_dir(), "a child with a directory of its own is confined"
        given.append(seconds)
        clock[0] += 15.0
        answer = answers[len(given) - 1]
        if answer is None:
            raise SceneError("scene_model_crash", "no time is left")
        return answer

    monkeypatch.setattr("certifier.scene.bundle.read_in_child", child)
    monkeypatch.setattr("certifier.scene.bundle.time", SimpleNamespace(monotonic=lambda: clock[0]))
    with pytest.raises(SceneError, match="no time is left"):
        load_bundle(b"a zip", BundleLimits(timeout_s=20.0))
    assert given == pytest.approx([20.0, 5.0, 0.1, 0.1, 0.1], abs=1e-3)


def test_a_file_that_only_declares_the_namespace_is_read_in_place(tmp_path):
    arm = ARM.format(kind="revolute", limit=LIMIT, shape=BOX, more="")
    plain = load_scene(write(tmp_path, arm=arm))
    assert load_scene(write(tmp_path, arm=arm.replace('<robot name="arm">', HEAD))).hash == plain.hash
