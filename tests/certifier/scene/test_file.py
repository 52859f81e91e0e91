"""The scene file's schema: what is accepted, and that every error names its field."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from certifier.errors import SceneError
from certifier.scene.file import read_scene_file

D = "directives: [{add_model: {name: a, file: a.urdf}}]\n"


def read(tmp_path, text):
    path = tmp_path / "scene.yaml"
    path.write_text(text) if isinstance(text, str) else path.write_bytes(text)
    return read_scene_file(path)


def test_defaults(tmp_path):
    scene = read(tmp_path, D)
    assert (scene.name, scene.q_star, scene.padding, scene.max_vertices, scene.cylinder_sides) == (tmp_path.name, None, 0.0, 32, 12)
    assert scene.models == ("a.urdf",)


def test_every_key(tmp_path):
    (tmp_path / "models").mkdir()
    scene = read(
        tmp_path,
        f"""name: all of it
packages: {{mine: models}}
{D}q_star: [0, -1.5, 1e-1]
padding: 1e-3
ignore:
  - [a/b, a/c]
  - {{pair: [a/b/box, a/d], reason: they are bolted together}}
mesh: {{mode: hull, max_vertices: 16}}
cylinder_sides: 6
""",
    )
    assert scene.name == "all of it"
    assert scene.packages == {"mine": (tmp_path / "models").resolve()}
    assert scene.q_star == (0.0, -1.5, 0.1)
    assert scene.padding == 0.001
    assert [(e.a, e.b, e.reason) for e in scene.ignore] == [
        ("a/b", "a/c", "ignored by the scene file"),
        ("a/b/box", "a/d", "they are bolted together"),
    ]
    assert (scene.max_vertices, scene.cylinder_sides) == (16, 6)


def test_directives_keep_their_text_and_lines_but_for_paths(tmp_path):
    text = """name: x
# a comment

directives:
  - add_model: {name: a, file: "sub/a b.urdf"}   # not beside it
  - add_weld: {parent: world, child: a::b, X_PC: {rotation: !Rpy {deg: [0, 0, 180]}}}
  - add_model: {name: c, file: package://p/c.sdf}
padding: 0
"""
    scene = read(tmp_path, text)
    assert scene.directives in text
    lines, resolved = text.splitlines(), scene.resolved_directives.splitlines()
    assert resolved[3] == "directives:"
    assert resolved[4] == lines[4].replace('"sub/a b.urdf"', f'"file://{tmp_path.resolve()}/sub/a b.urdf"')
    assert resolved[5:7] == lines[5:7]
    assert len([line for line in resolved if line]) == 4


@pytest.mark.parametrize(
    ("text", "code", "field", "words"),
    [
        ("- a\n- b\n", "scene_field", None, "mapping"),
        ("", "scene_field", None, "mapping"),
        ("name: x\n", "scene_field", "directives", "missing"),
        ("directives: []\n", "scene_field", "directives", "at least one"),
        ("directives: [add_model]\n", "scene_field", "directives[0]", "one key"),
        ("directives: {add_model: {}}\n", "scene_field", "directives", "list"),
        (D + "ignored: []\n", "scene_field", "ignored", "did you mean ignore"),
        (D + "padding: 0\npadding: 1\n", "scene_field", "padding", "twice"),
        (D + "padding: -1\n", "scene_field", "padding", "at least 0"),
        (D + "padding: .nan\n", "scene_field", "padding", "number of at most 1e+06"),
        (D + "padding: true\n", "scene_field", "padding", "number"),
        (D + "padding: {defualt: 0}\n", "scene_field", "padding.defualt", "did you mean default"),
        (D + "padding: {default: -1}\n", "scene_field", "padding.default", "at least 0"),
        (D + "padding: {bodies: [a]}\n", "scene_field", "padding.bodies", "map names"),
        (D + "padding: {bodies: {a/b: x}}\n", "scene_field", "padding.bodies.a/b", "number"),
        (D + "padding: {bodies: {3: 0.1}}\n", "scene_field", "padding.bodies", "text"),
        (D + "padding: {pairs: {a: 1}}\n", "scene_field", "padding.pairs", "list"),
        (D + "padding: {pairs: [{pair: [a], padding: 1}]}\n", "scene_field", "padding.pairs[0].pair", "two names"),
        (D + "padding: {pairs: [{pair: [a, b]}]}\n", "scene_field", "padding.pairs[0].padding", "number"),
        (D + "padding: {pairs: [{pair: [a, b], padding: -1}]}\n", "scene_field", "padding.pairs[0].padding", "at least 0"),
        (D + "padding: {pairs: [[a, b, 1]]}\n", "scene_field", "padding.pairs[0]", "mapping"),
        (D + "fix: {grip: 1, grip: 2}\n", "scene_field", "fix.grip", "twice, again in line 2"),
        (D + "limits: {a: [0, 1],\n  a: [0, 2]}\n", "scene_field", "limits.a", "twice, again in line 3"),
        (D + "ignore: [{pair: [a, b], pair: [a, c]}]\n", "scene_field", "ignore[0].pair", "twice"),
        (D.replace("name: a", "name: a, name: b"), "scene_field", "directives[0].add_model.name", "twice"),
        (D.replace("a.urdf", "/srv/a.urdf"), "scene_field", "directives", "package://NAME/FILE"),
        (D.replace("a.urdf", "file:///srv/a.urdf"), "scene_field", "directives", "'file:///srv/a.urdf' is not a relative path"),
        (D + "q_star: 3\n", "scene_field", "q_star", "list"),
        (D + "q_star: [0, x]\n", "scene_field", "q_star[1]", "'x'"),
        (D + "q_star: [0, .inf]\n", "scene_field", "q_star[1]", "number of at most 1e+06"),
        (D + "name: 3\n", "scene_field", "name", "must be a name"),
        (D + "packages: {m: nowhere}\n", "scene_field", "packages.m", "/nowhere"),
        (D + "packages: [m]\n", "scene_field", "packages", "map"),
        (D + "ignore: [[a]]\n", "scene_field", "ignore[0]", "two names"),
        (D + "ignore: [{pair: [a, 3]}]\n", "scene_field", "ignore[0].pair[1]", "text"),
        (D + "ignore: [{pair: [a, b], because: x}]\n", "scene_field", "ignore[0].because", "pair, reason"),
        (D + "mesh: {max_vertices: 4}\n", "scene_field", "mesh.max_vertices", "at least 8"),
        (D + "mesh: {max_vertices: 8.5}\n", "scene_field", "mesh.max_vertices", "whole"),
        (D + "mesh: {mode: raw}\n", "scene_field", "mesh.mode", "hull"),
        (D + "mesh: {verts: 9}\n", "scene_field", "mesh.verts", "max_vertices"),
        (D + "cylinder_sides: 2\n", "scene_field", "cylinder_sides", "at least 3"),
        (D + "name: !thing x\n", "scene_yaml", None, "line 2"),
        (D + "name: 2001-99-99\n", "scene_field", "name", "line 2"),
        (D + "limits: {<<: {a: [0, 1]}}\n", "scene_yaml", None, "line 2: the merge key <<"),
        (D + "? [a, b]\n: c\n", "scene_field", None, "key must be text"),
        ("name: [unclosed\n" + D, "scene_yaml", None, "line 2"),
        ("a: &x [1]\nb: *x\n", "scene_yaml", None, "alias"),
        ("[" * 5000, "scene_yaml", None, ""),
        (b"\xff\xfename", "scene_yaml", None, "UTF-8"),
        (b"#" * (2**20 + 1), "scene_yaml", None, "bytes"),
    ],
)
def test_what_is_wrong_is_named(tmp_path, text, code, field, words):
    with pytest.raises(SceneError) as caught:
        read(tmp_path, text)
    assert (caught.value.code, caught.value.field) == (code, field)
    assert words in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(SceneError, match=r"nothing\.yaml") as caught:
        read_scene_file(tmp_path / "nothing.yaml")
    assert caught.value.code == "scene_not_found"


@given(text=st.text(max_size=200))
def test_any_text_is_a_scene_or_a_scene_error(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("any") / "scene.yaml"
    path.write_text(text, encoding="utf-8", errors="replace")
    with pytest.raises(SceneError):
        read_scene_file(path)


@given(q=st.lists(st.floats(-1e6, 1e6), max_size=5))
def test_numbers_arrive_exactly(tmp_path_factory, q):
    path = tmp_path_factory.mktemp("q") / "scene.yaml"
    path.write_text(f"{D}q_star: {q}\n")
    np.testing.assert_array_equal(read_scene_file(path).q_star, q)
