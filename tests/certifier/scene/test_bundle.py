"""Bundles: what is packed, that a bundle is the same scene, and what is refused from strangers."""

import io
import json
import zipfile

import pytest

from certifier.errors import SceneError
from certifier.scene import BundleLimits, load_bundle, pack_bundle
from certifier.scene.references import references, resolve
from certifier.scene.unpack import check_bundle
from tests.certifier.scene.workshop import EXAMPLES, ROOM, SCENE, parsed, write

TETRAHEDRON = "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nv 0 0 0.1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def zipped(files):
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return data.getvalue()


def names(bundle):
    return sorted(zipfile.ZipFile(io.BytesIO(bundle)).namelist())


def test_a_bundle_is_the_same_scene():
    path = EXAMPLES / "dual_ur3e" / "scene.yaml"
    bundle = pack_bundle(path)
    assert names(bundle) == ["bundle.json", "dual_ur3e/pallet.sdf", "dual_ur3e/scene.yaml", "ur3e_bin/ur3e.urdf"]
    assert bundle == pack_bundle(path)
    assert load_bundle(bundle).scene.hash == parsed(path).hash


def test_a_zip_of_a_directory_is_a_scene_too():
    """Somebody has made it with the tools of their desktop, which may leave their own files in it."""
    path = EXAMPLES / "ur3e_bin" / "scene.yaml"
    files = {f"ur3e_bin/{file.name}": file.read_text() for file in path.parent.iterdir() if file.suffix in (".yaml", ".sdf", ".urdf")}
    litter = {"__MACOSX/ur3e_bin/._scene.yaml": "\0", "ur3e_bin/.DS_Store": "\0"}
    assert load_bundle(zipped(files | litter)).scene.hash == parsed(path).hash


def test_packages_and_meshes_travel_and_strangers_do_not(tmp_path):
    (tmp_path / "models" / "meshes").mkdir(parents=True)
    (tmp_path / "models" / "meshes" / "t.obj").write_text("mtllib t.mtl\n" + TETRAHEDRON)
    (tmp_path / "models" / "meshes" / "t.mtl").write_text("newmtl red\n")
    (tmp_path / "models" / "meshes" / "unused.obj").write_text(TETRAHEDRON)
    (tmp_path / "scenes").mkdir()
    path = write(
        tmp_path / "scenes",
        "packages: {mine: ../models, empty: ../empty}\n" + SCENE,
        shape='<mesh filename="package://mine/meshes/t.obj"/>',
    )
    (tmp_path / "empty").mkdir()
    bundle = pack_bundle(path)
    assert names(bundle) == [
        "bundle.json",
        "empty/",
        "models/",
        "models/meshes/t.mtl",
        "models/meshes/t.obj",
        "scenes/arm.urdf",
        "scenes/room.sdf",
        "scenes/scene.yaml",
    ]
    scene = load_bundle(bundle).scene
    assert len(scene.geometry("arm/hand/palm").vertices) == 4
    assert scene.hash == parsed(path).hash


def test_a_package_with_an_absolute_path_travels(tmp_path):
    models = tmp_path / "a b" / "models"
    models.mkdir(parents=True)
    (models / "t.obj").write_text(TETRAHEDRON)
    (tmp_path / "scenes").mkdir()
    path = write(
        tmp_path / "scenes",
        f"packages:\n  here: .\n  mine: {models}  # not beside it\n" + SCENE,
        shape='<mesh filename="package://mine/t.obj"/>',
    )
    bundle = pack_bundle(path)
    assert {"a b/models/t.obj", "scenes/scene.yaml"} < {*names(bundle)}
    text = zipfile.ZipFile(io.BytesIO(bundle)).read("scenes/scene.yaml").decode()
    assert text == path.read_text().replace(str(models), '"../a b/models"')
    assert load_bundle(bundle).scene.hash == parsed(path).hash


@pytest.mark.parametrize(
    "reference",
    ["/etc/passwd", "file:///etc/passwd", "http://example.org/a.urdf", "https://example.org/a", "package://other/a", "a\\b", "C:\\a"],
)
def test_references_that_cannot_travel_are_refused(tmp_path, reference):
    with pytest.raises(SceneError) as caught:
        resolve(reference, tmp_path, {"mine": tmp_path})
    assert caught.value.code == "bundle_uri"
    assert repr(reference) in str(caught.value)


def test_what_is_broken_in_a_bundle_is_named_without_the_servers_paths(tmp_path):
    bundle = pack_bundle(write(tmp_path, shape='<mesh filename="nothing.obj"/>'))
    with pytest.raises(SceneError) as caught:
        load_bundle(bundle)
    assert "nothing.obj" in str(caught.value)
    assert "/tmp" not in str(caught.value)
    assert "ciris-" not in str(caught.value)


@pytest.mark.parametrize(
    ("files", "code", "words"),
    [
        ({"arm.urdf": "<!DOCTYPE r [<!ENTITY a 'aaa'><!ENTITY b '&a;&a;'>]><robot name='r'>&b;</robot>"}, "bundle_xml", "arm.urdf"),
        ({"arm.urdf": "<robot><mesh"}, "bundle_xml", "arm.urdf"),
        ({"arm.urdf": "<robot><mesh filename='file:///etc/passwd'/></robot>"}, "bundle_uri", "file:///etc/passwd"),
        ({"arm.urdf": "<robot><mesh filename='http://example.org/m.obj'/></robot>"}, "bundle_uri", "http://"),
        ({"arm.urdf": "<robot><mesh filename='/etc/m.obj'/></robot>"}, "bundle_uri", "/etc/m.obj"),
        ({"arm.urdf": "<robot><mesh filename='&#x2e;./m.obj'/></robot>"}, "bundle_uri", "leads out"),
        ({"arm.urdf": "<robot><mesh filename='package://up/../../m.obj'/></robot>"}, "bundle_uri", "package"),
        ({"room.sdf": "<sdf><uri> ../../m.obj </uri></sdf>"}, "bundle_uri", "leads out"),
        ({"room.sdf": "<sdf><uri>x<![CDATA[/../../m.obj]]></uri></sdf>"}, "bundle_uri", "leads out"),
        ({"m.xml": "<mujoco><compiler meshdir='..'/></mujoco>"}, "bundle_uri", "meshdir"),
        ({"m.xml": "<mujoco><mesh file='a/../m.obj'/></mujoco>"}, "bundle_uri", ".."),
        ({"m.dmd.yaml": "directives: [{add_model: {file: '../x.urdf'}}]"}, "bundle_uri", "leads out"),
        ({"m.dmd.yaml": "a: &a [1]\nb: [*a]"}, "scene_yaml", "alias"),
        ({"m.obj": "mtllib ../../../etc/passwd\n"}, "bundle_uri", "leads out"),
        ({"m.obj": b"# \xe9\nmtllib ../../../etc/passwd\n"}, "bundle_uri", "leads out"),
        ({"m.gltf": b"\xff\xfe"}, "bundle_text", "m.gltf"),
        ({"m.gltf": json.dumps({"buffers": [{"uri": "../x.bin"}]})}, "bundle_uri", "leads out"),
        ({"m.gltf": "[" * 100000}, "bundle_text", "m.gltf"),
        ({"m.gltf": "[]"}, "bundle_text", "m.gltf"),
        ({"arm.urdf": "<robot><mesh filename='m.usda'/></robot>", "m.usda": "#usda 1.0"}, "bundle_file", "m.usda"),
        ({"room.sdf": "<sdf><uri>a.xacro</uri></sdf>", "a.xacro": "<robot><mesh filename='../m.obj'/></robot>"}, "bundle_uri", "leads out"),
        ({"scene.yaml": "packages: {up: ..}\n" + SCENE}, "bundle_uri", "packages.up"),
    ],
)
def test_a_hostile_file_is_refused_before_drake_sees_it(tmp_path, files, code, words):
    scene = write(tmp_path)
    for name, content in files.items():
        (tmp_path / name).write_bytes(content if isinstance(content, bytes) else content.encode())
    with pytest.raises(SceneError) as caught:
        check_bundle(tmp_path, scene)
    assert caught.value.code == code, caught.value
    assert words in str(caught.value)


def test_an_honest_directory_passes(tmp_path):
    honest = (
        "<robot xmlns:drake='http://drake.mit.edu' name='r'><plugin filename='libx.so'/><!-- file:///x --><mesh filename='m.obj'/></robot>"
    )
    scene = write(tmp_path, files={"more.urdf": honest, "m.obj": TETRAHEDRON, "README.yaml": "license: http://example.org\n"})
    check_bundle(tmp_path, scene)


def test_what_a_package_has_beside_its_robot_is_deleted_before_drake_sees_anything(tmp_path):
    manifest = "<package><name>arm</name><url type='website'>http://example.org</url></package>"
    beside = {"LICENSE": "", "README.md": "", "launch/show.launch": "<launch/>", "run.sh": "true", "arm.urdf.xacro": "<robot", "m.usda": ""}
    scene = write(tmp_path)
    kept = {file for file in tmp_path.rglob("*") if file.is_file()}
    for name, content in {**beside, "package.xml": manifest}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(content)
    check_bundle(tmp_path, scene)
    assert {file for file in tmp_path.rglob("*") if file.is_file()} == kept


@pytest.mark.parametrize(
    ("bundle", "code"),
    [
        (b"not a zip", "bundle_zip"),
        (zipped({"arm.obj": ""}), "bundle_zip"),
        (zipped({"arm.urdf": "<robot name='a'>"}), "bundle_xml"),
        (zipped({"a.yaml": SCENE, "b.yaml": SCENE}), "bundle_choice"),
        (zipped({"bundle.json": "[]"}), "bundle_zip"),
        (zipped({"bundle.json": "{"}), "bundle_zip"),
        (zipped({"bundle.json": '{"scene": 3}'}), "scene_not_found"),
        (zipped({"bundle.json": '{"scene": "arm.urdf"}'}), "scene_not_found"),
        (zipped({"bundle.json": '{"scene": "../scene.yaml"}'}), "bundle_path"),
        (zipped({"../evil": ""}), "bundle_path"),
        (zipped({"/evil": ""}), "bundle_path"),
        (zipped({"a/../../evil": ""}), "bundle_path"),
        (zipped({f"{i}.obj": "" for i in range(30)}), "bundle_too_large"),
        (zipped({"big.obj": "0" * 30000}), "bundle_too_large"),
        (bytes(50000), "bundle_too_large"),
    ],
)
def test_a_bad_zip_is_refused(bundle, code):
    with pytest.raises(SceneError) as caught:
        load_bundle(bundle, BundleLimits(bytes=40000, unpacked_bytes=20000, files=20))
    assert caught.value.code == code


def robot_with(*uris):
    link = "<link name='l{}'><collision><geometry><mesh filename='{}'/></geometry></collision></link>"
    joint = "<joint name='j{0}' type='revolute'><parent link='base'/><child link='l{0}'/><axis xyz='0 0 1'/>"
    joint += "<limit lower='-1' upper='1' effort='1' velocity='1'/></joint>"
    parts = [link.format(i, uri) + joint.format(i) for i, uri in enumerate(uris)]
    return f"<robot name='arm'><link name='base'/>{''.join(parts)}</robot>"


def test_copies_for_packages_are_limited_as_the_zip_is():
    """The same file is taken from one package after the other, so it would be written as often."""
    arm = robot_with(*(f"package://p{i}/meshes/t.obj" for i in range(12)))
    limits = BundleLimits(unpacked_bytes=20000)
    assert load_bundle(zipped({"arm.urdf": arm, "t.obj": TETRAHEDRON}), limits).scene.geometries
    for files in ({"arm.urdf": arm, "t.obj": TETRAHEDRON + 2000 * "#"}, {"arm.urdf": arm, "t.obj": TETRAHEDRON, "a/b/c.txt": ""}):
        with pytest.raises(SceneError) as caught:
            load_bundle(zipped(files), limits if "a/b/c.txt" not in files else BundleLimits(files=6))
        assert caught.value.code == "bundle_too_large"


@pytest.mark.parametrize("taken", ["package://p//etc/passwd", "package://p/../../../../../../etc/passwd"])
def test_nobody_learns_which_files_the_machine_has(taken):
    said = []
    for uri in (taken, taken.replace("passwd", "nothing-of-that-name")):
        with pytest.raises(SceneError) as caught:
            load_bundle(zipped({"arm.urdf": robot_with(uri, "package://p/other.obj")}))
        said.append((caught.value.code, str(caught.value).replace("passwd", "X").replace("nothing-of-that-name", "X")))
    assert said[0] == said[1]


def test_a_link_in_a_zip_is_refused():
    link = zipfile.ZipInfo("link.obj")
    link.external_attr = 0o120777 << 16
    data = io.BytesIO()
    with zipfile.ZipFile(data, "w") as archive:
        archive.writestr(link, "/etc/passwd")
    with pytest.raises(SceneError, match="plain file"):
        load_bundle(data.getvalue())


def test_references_of_a_model(tmp_path):
    path = tmp_path / "a.sdf"
    path.write_text(ROOM.replace("<box><size>0.1 1 1</size></box>", "<mesh><uri>m.obj</uri><scale>1 1 1</scale></mesh>"))
    assert references(path) == ["m.obj"]


MODEL = "<mujoco><compiler {}/>{}<worldbody><body name='b'><joint name='j' range='-1 1'/><geom type='mesh' mesh='m'/></body>"
MODEL += "</worldbody></mujoco>"
ASSET = "<asset><mesh name='m' file='{}'/></asset>"


@pytest.mark.parametrize(
    ("files", "packed"),
    [
        (
            {
                "arm.xml": MODEL.format("meshdir='meshes'", "<include file='assets.xml'/>"),
                "assets.xml": f"<mujoco>{ASSET.format('m.obj')}</mujoco>",
            },
            "meshes/m.obj",
        ),
        (
            {
                "arm.xml": MODEL.format("", "<include file='sub/a.xml'/><include file='assets.xml'/>"),
                "sub/a.xml": "<mujoco><include file='sub/b.xml'/></mujoco>",
                "sub/b.xml": "<mujoco><compiler meshdir='meshes'/></mujoco>",
                "assets.xml": f"<mujoco>{ASSET.format('m.obj')}</mujoco>",
            },
            "meshes/m.obj",
        ),
        (
            {
                "arm.xml": MODEL.format("", "<include file='sub/a.xml'/>"),
                "sub/a.xml": "<mujoco><include file='sub/b.xml'/></mujoco>",
                "sub/b.xml": f"<mujoco>{ASSET.format('sub/m.obj')}</mujoco>",
            },
            "sub/m.obj",
        ),
    ],
)
def test_what_included_mjcf_refers_to_starts_at_the_models_directory(tmp_path, files, packed):
    for name, text in {**files, packed: TETRAHEDRON}.items():
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).write_text(text)
    path = write(tmp_path, "directives: [{add_model: {name: arm, file: arm.xml}}]\n")
    bundle = pack_bundle(path)
    assert {*files, packed} <= {*names(bundle)}
    assert load_bundle(bundle).scene.hash == parsed(path).hash


def test_what_nobody_reads_does_not_keep_a_scene_from_travelling(tmp_path):
    more = "<gazebo><sensor filename='/x'><uri>http://example.org/x</uri></sensor></gazebo>"
    path = write(tmp_path, shape='<mesh filename="t.obj"/>', more=more)
    (tmp_path / "t.obj").write_bytes("# caf\u00e9\nmtllib \u00e9.mtl\n".encode("latin-1") + TETRAHEDRON.encode())
    assert load_bundle(pack_bundle(path)).scene.hash == parsed(path).hash
