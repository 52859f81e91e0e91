"""STL and DAE meshes: readers that know nothing of ours agree on the points, and what is broken is refused with its place."""

import struct
from io import BytesIO

import collada
import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from pydrake.geometry import Convex

from certifier.errors import SceneError
from certifier.scene.meshes.mesh import Mesh
from certifier.scene.meshes.read import read_mesh
from tests.certifier.scene.workshop import parsed, write

CORNERS = np.array([[0, 0, 0], [1, 0, 0], [0, 2, 0], [0, 0, 3]], float)
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
FACET = "facet normal nan 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\nendloop\nendfacet\n"
TEXT = f"solid part\n{FACET}endsolid part\n"


def binary(triangles):
    head = b"solid of a binary file".ljust(80)
    body = b"".join(struct.pack("<12fH", 0, 0, 0, *np.ravel(triangle), 0) for triangle in triangles)
    return head + struct.pack("<I", len(triangles)) + body


NUMBERS = "0 0 0 1 0 0 0 2 0 0 0 3"


def dae(*, mesh="", nodes='<instance_geometry url="#g"/>', unit='<unit meter="1"/>', faces=None, numbers=NUMBERS, count=12):
    faces = faces or '<triangles count="2"><input semantic="VERTEX" source="#v" offset="0"/><p>0 2 1 0 1 3</p></triangles>'
    source = (
        f'<source id="s"><float_array id="a" count="{count}">{numbers}</float_array><technique_common><accessor source="#a" count="4" '
        'stride="3"><param name="X"/><param name="Y"/><param name="Z"/></accessor></technique_common></source>'
    )
    vertices = '<vertices id="v"><input semantic="POSITION" source="#s"/></vertices>'
    return f"""<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1"><asset>{unit}<up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="g"><mesh>{source}{vertices}
{faces}{mesh}</mesh></geometry></library_geometries>
<library_nodes><node id="n"><translate>0 0 1</translate><instance_geometry url="#g"/></node></library_nodes>
<library_visual_scenes><visual_scene id="w"><node>
{nodes}</node></visual_scene></library_visual_scenes><scene><instance_visual_scene url="#w"/></scene></COLLADA>"""


def read(tmp_path, text, kind):
    path = tmp_path / f"m.{kind}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_mesh(path, path.name)


def refused(tmp_path, text, kind, words):
    with pytest.raises(SceneError) as caught:
        read(tmp_path, text, kind)
    assert caught.value.code == "scene_model"
    assert caught.value.message.startswith(f"m.{kind}")
    assert words in caught.value.message
    assert caught.value.hint


@settings(max_examples=50, deadline=None)
@given(arrays.arrays(np.float32, st.tuples(st.integers(1, 6), st.just(3), st.just(3)), elements=st.floats(-1e6, 1e6, width=32)))
def test_binary_stl_is_what_was_written(tmp_path_factory, triangles):
    mesh = read(tmp_path_factory.mktemp("m"), binary(triangles), "STL")
    assert (mesh.points[mesh.triangles] == triangles).all()
    assert len(np.unique(mesh.points, axis=0)) == len(mesh.points)


@pytest.mark.parametrize("kind", ["stl", "stl_ascii"])
def test_trimesh_writes_what_is_read(tmp_path, kind):
    mesh = read(tmp_path, trimesh.Trimesh(CORNERS, FACES, process=False).export(file_type=kind), "stl")
    assert (mesh.points[mesh.triangles] == CORNERS[FACES]).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (binary([CORNERS[:3]])[:-1], "the 1 triangles that it counts need 134"),
        (binary([CORNERS[:3]]) + b"\0", "the file has 135 bytes"),
        (binary([CORNERS[:3] * np.nan]), "triangle 1 has a coordinate"),
        (binary([]), "no triangles"),
        (b"", "it has 0 bytes"),
        ("solid x\nendsolid x\n", "no triangles"),
        (TEXT.replace("endsolid part", ""), "m.stl:9: the file ends before endsolid"),
        (TEXT.replace("vertex 1 0 0", "vertex 1 nan 0"), "m.stl:5: '1 nan 0' is not three finite"),
        (TEXT.replace("vertex 1 0 0", "vertex 1 0x1 0"), "m.stl:5: "),
        (TEXT.replace("vertex 1 0 0", "vertex 1 0"), "m.stl:5: 'vertex 1 0' has 3 words instead of 4"),
        (TEXT.replace("vertex 1 0 0\n", ""), "m.stl:6: the facet has 2 vertices"),
        (TEXT.replace("outer loop\n", ""), "m.stl:3: 'vertex 0 0 0' stands where outer must stand"),
    ],
)
def test_broken_stl_is_refused(tmp_path, text, words):
    refused(tmp_path, text, "stl", words)


def bounds(mesh):
    used = mesh.points[np.unique(mesh.triangles)]
    return np.array([used.min(axis=0), used.max(axis=0)])


STRIP = '<{} count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p></{}>'
LIST = '<polylist count="1"><input semantic="VERTEX" source="#v" offset="0"/><vcount>4</vcount><p>0 1 2 3</p></polylist>'
POLYGONS = '<polygons count="1"><input semantic="VERTEX" source="#v" offset="0"/><p>0 1 2 3</p></polygons>'


@pytest.mark.parametrize(
    "given",
    [
        {},
        {"nodes": '<translate>1 2 3</translate><rotate>0 0 1 90</rotate><scale>1 2 3</scale><instance_geometry url="#g"/>'},
        {"nodes": '<matrix>0 -1 0 4 1 0 0 5 0 0 1 6 0 0 0 1</matrix><node><scale>2 2 2</scale><instance_geometry url="#g"/></node>'},
        {"nodes": '<instance_geometry url="#g"/><instance_node url="#n"/>'},
        {"faces": LIST},
        {"faces": POLYGONS},
        {"faces": STRIP.format("tristrips", "tristrips")},
    ],
)
def test_dae_stands_where_trimesh_sees_it(tmp_path, given):
    text = dae(**given)
    mesh = read(tmp_path, text, "dae")
    assert np.allclose(bounds(mesh), trimesh.load_scene(BytesIO(text.encode()), file_type="dae").bounds, atol=1e-12)
    assert len(mesh.points) % 4 == 0


def test_the_unit_is_applied(tmp_path):
    text = dae(unit='<unit name="inch" meter="0.0254"/>')
    unit = collada.Collada(BytesIO(text.encode())).assetInfo.unitmeter
    assert (read(tmp_path, text, "dae").points == CORNERS * unit).all()


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"numbers": "0 0 0 1 0 0 0 2 0 0 0 nan"}, "'nan' in the place of a finite"),
        ({"numbers": "0 0 0 1 0 0 0 2 0 0 0"}, "has 11 numbers, and its count is 12"),
        ({"numbers": "0 0 0 1 0 0", "count": 6}, "<accessor> takes another count"),
        ({"faces": LIST.replace("0 1 2 3", "0 1 2 4")}, "m.dae:3: a face has the corners 0, 1, 2, 4"),
        ({"faces": LIST.replace("0 1 2 3", "0 1 2")}, "m.dae:3: <polylist> counts 1 face, and has 3 corners"),
        ({"faces": LIST.replace("0 1 2 3", "0 1 2 -3")}, "something else than whole numbers"),
        ({"faces": LIST.replace("#v", "#w")}, "source of <input> is '#w'"),
        ({"faces": POLYGONS.replace("<p>", "<ph/><p>")}, "a polygon with holes"),
        ({"faces": POLYGONS.replace('count="1"', 'count="2"')}, "has 1 face, and its count is 2"),
        ({"faces": POLYGONS.replace("VERTEX", "NORMAL")}, "one input VERTEX"),
        ({"faces": "<lines/>"}, "the scene has no faces"),
        ({"mesh": "<spline/>"}, "<spline> in <mesh> is not read"),
        ({"mesh": "<vertices id='u'/>"}, "<mesh> has 2 <vertices>"),
        ({"nodes": '<instance_controller url="#g"/>'}, "m.dae:6: <instance_controller> in <node> is not read"),
        ({"nodes": "<lookat/>"}, "<lookat> in <node> is not read"),
        ({"nodes": '<instance_geometry url="#no"/>'}, "url of <instance_geometry> is '#no'"),
        ({"nodes": '<node id="c"><instance_node url="#c"/></node>'}, "in itself"),
        ({"nodes": ""}, "no faces"),
        ({"nodes": "<matrix>1</matrix>"}, "<matrix> has 1 number instead of 16"),
        ({"nodes": "<matrix>1 0 0 0 0 1 0 0 0 0 1 0 0 0 0 2</matrix>"}, "last row"),
        ({"nodes": "<rotate>0 0 0 90</rotate>"}, "length 0"),
        ({"nodes": '<scale>1e300 1 1</scale><scale>1e300 1 1</scale><instance_geometry url="#g"/>'}, "not finite"),
        ({"unit": '<unit meter="0"/>'}, "meter of <unit>"),
    ],
)
@pytest.mark.filterwarnings("ignore:overflow")
def test_broken_dae_is_refused(tmp_path, given, words):
    refused(tmp_path, dae(**given), "dae", words)


def test_what_is_no_dae_is_refused(tmp_path):
    refused(tmp_path, "<x/>", "dae", "instead of <COLLADA>")
    refused(tmp_path, dae()[:-20], "dae", "this is not XML")
    refused(tmp_path, "<!DOCTYPE a><COLLADA/>", "dae", "declares a document type")
    refused(tmp_path, "<COLLADA/>", "dae", "shows 0 scenes")


def test_another_axis_is_said_and_not_applied(tmp_path):
    turned = dae().replace("Z_UP", "Y_UP")
    assert (read(tmp_path, turned, "dae").points == read(tmp_path, dae(), "dae").points).all()
    assert read(tmp_path, turned, "dae").up == "Y_UP"
    (tmp_path / "m.dae").write_text(turned)
    scene = parsed(write(tmp_path, shape='<mesh filename="m.dae"/>'))
    assert sum("up_axis of m.dae (Y_UP) is not applied" in warning for warning in scene.warnings) == 1


@settings(max_examples=20, deadline=None)
@given(arrays.arrays(float, (12, 3), elements=st.floats(-10, 10), unique=True))
def test_drake_gets_exactly_the_doubles(tmp_path_factory, points):
    path = tmp_path_factory.mktemp("m") / "m.obj"
    points = np.concatenate([points, 20 * CORNERS - 15])
    path.write_text(Mesh(points, FACES).obj())
    hull = Convex(str(path)).GetConvexHull()
    assert {tuple(hull.vertex(k)) for k in range(hull.num_vertices())} <= {tuple(point) for point in points.tolist()}


@pytest.mark.parametrize("kind", ["stl", "dae"])
def test_a_scene_is_the_same_with_a_mesh_of_any_kind(tmp_path, kind):
    text = binary(CORNERS[FACES]) if kind == "stl" else dae().encode()
    mesh = read(tmp_path, text, kind)
    (tmp_path / "m.obj").write_text(Mesh(mesh.points, mesh.triangles).obj())
    scenes = [parsed(write(tmp_path, shape=f'<mesh filename="m.{suffix}" scale="0.1 0.1 0.1"/>')) for suffix in (kind, "obj")]
    palms = [scene.geometry("arm/hand/palm") for scene in scenes]
    assert (palms[0].vertices == palms[1].vertices).all()
    assert palms[0].shape["file"] == f"m.{kind}"
