"""OBJ meshes: what is read is what is written, and everything else is refused with its line."""

import json
import math
import os

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from pydrake.geometry import Convex

from certifier.errors import SceneError
from certifier.scene.meshes.read import read_mesh

TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
WORDS = ["nan", "inf", "-inf", "infinity", "abc", "1e400"]
HALF = ["1,5", "1.0abc", "0x10", "0x1p3", "1e", "1e+", "1_0", "1d0", "1.2.3", "1/2", "1;", "1\0", "1\x0b2"]
HOSTILE = [*WORDS, *HALF, "-", "+", "--1", "\u0661", "\\"]


def points(tmp_path, text):
    path = tmp_path / "m.obj"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_mesh(path, "meshes/m.obj").points


def drakes_hull(path):
    """The vertices of Drake's hull, read by a child, because Drake ends the process on some files."""
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        hull = Convex(str(path)).GetConvexHull()
        os.write(into, json.dumps([hull.vertex(k).tolist() for k in range(hull.num_vertices())]).encode())
        os._exit(0)
    os.close(into)
    with os.fdopen(out, "rb") as stream:
        text = stream.read()
    os.waitpid(child, 0)
    return np.array(json.loads(text))


@pytest.mark.parametrize("token", HOSTILE)
@pytest.mark.parametrize("place", [0, 1, 2])
def test_a_vertex_that_is_not_three_numbers_is_refused(tmp_path, token, place):
    numbers = ["1", "0", "0"]
    numbers[place] = token
    with pytest.raises(SceneError, match=r"meshes/m\.obj:2: ") as caught:
        points(tmp_path, TETRAHEDRON.replace("v 1 0 0", f"v {' '.join(numbers)}"))
    assert caught.value.code == "scene_model"
    assert str(caught.value).isprintable()


@pytest.mark.parametrize(
    ("written", "instead", "line"),
    [
        ("v 1 0 0", "v", 2),
        ("v 1 0 0", "v 1 0", 2),
        ("v 1 0 0", "v 1 0 0 2", 2),
        ("v 1 0 0", "v 1 0 0 nan", 2),
        ("v 1 0 0", "v 1 0 0 0.5 0.5", 2),
        ("v 1 0 0", "v 1 0 0 1 0.5 0.5 0.5", 2),
        ("v 1 0 0", "v 1 0 0 red 0 0", 2),
        ("v 1 0 0", "V 1 0 0", 2),
        ("v 1 0 0", "v1 0 0", 2),
        ("v 1 0 0", "v\x0b1 0 0", 2),
        ("v 1 0 0", "\u00a0v 1 0 0", 2),
        ("v 1 0 0", "v 1 0 \\\n0", 2),
        ("v 1 0 0", "v 1" + " " * 2000 + "0 0", 2),
        ("v 1 0 0", "v " + "1" * 2000 + " 0 0", 2),
        ("v 1 0 0", "curv 0 1 1 2", 2),
        ("v 1 0 0", "call other.obj", 2),
        ("f 1 3 2", "f 1 3 9", 5),
        ("f 1 3 2", "f 1 3 0", 5),
        ("f 1 3 2", "f 1 3 -5", 5),
        ("f 1 3 2", "f 1 3", 5),
        ("f 1 3 2", "f 1 3 two", 5),
        ("f 1 3 2", "f 1 3 2 x", 5),
        ("f 1 3 2", "f 1.5 3 2", 5),
        ("f 1 3 2", "f 1a 3 2", 5),
        ("f 1 3 2", "f 4294967297 3 2", 5),
        ("f 1 3 2", "f " + "1" * 5000 + " 3 2", 5),
        ("f 1 3 2", "f 1 \\\n3 2", 5),
    ],
)
def test_what_readers_take_differently_is_refused(tmp_path, written, instead, line):
    with pytest.raises(SceneError, match=rf"meshes/m\.obj:{line}: "):
        points(tmp_path, TETRAHEDRON.replace(written, instead))


@pytest.mark.parametrize("text", ["", "# nothing\n", "f 1 2 3\n", "vt 0 0\n", b"v 1 0 0\n\0", b"\xff\xfev\x00 \x001\x00"])
def test_what_is_no_mesh_is_refused(tmp_path, text):
    with pytest.raises(SceneError, match=r"meshes/m\.obj:\d+: "):
        points(tmp_path, text)


@pytest.mark.parametrize(
    "text",
    [
        TETRAHEDRON,
        TETRAHEDRON.replace("\n", "\r\n"),
        TETRAHEDRON.replace("\n", "\r"),
        "\ufeff" + TETRAHEDRON,
        TETRAHEDRON.rstrip(),
        TETRAHEDRON.replace("v 1 0 0", " \tv  1.0\t0 0 \t"),
        TETRAHEDRON.replace("v 1 0 0", "v 1 0 0 1"),
        TETRAHEDRON.replace("v 1 0 0", "v +1e0 .0 0. 0.5 0.25 1"),
        TETRAHEDRON.replace("v 1 0 0", "v 1 0 0 # the tip"),
        TETRAHEDRON.replace("f 1 3 2", "vn 0 0 1\nvt 0 0\nf 1/1/1 3//1 2/1 # below"),
        TETRAHEDRON.replace("f 1 3 2", "f -4 -2 -3"),
        "f 1 3 2\n" + TETRAHEDRON,
        b"# caf\xe9 \\\no part\ng a b\ns off\nmtllib m.mtl\nusemtl red\n" + TETRAHEDRON.encode() + b"p 1\nl 1 2\n",
    ],
)
def test_a_mesh_is_read_as_drake_reads_it(tmp_path, text):
    read = points(tmp_path, text)
    assert read.tolist() == [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]
    assert sorted(drakes_hull(tmp_path / "m.obj").tolist()) == sorted(read.tolist())


FINITE = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e6, max_value=1e6)


@settings(max_examples=30, deadline=None)
@given(st.lists(st.tuples(FINITE, FINITE, FINITE), min_size=4, max_size=30), st.sampled_from(["r", ".17g", ".3e", "f"]))
def test_numbers_arrive_exactly(tmp_path_factory, vertices, form):
    written = [[repr(x) if form == "r" else format(x, form) for x in v] for v in vertices]
    read = points(tmp_path_factory.mktemp("obj"), "".join(f"v {' '.join(v)}\n" for v in written) + "f 1 2 3\n")
    np.testing.assert_array_equal(read, [[float(x) for x in v] for v in written])


@settings(max_examples=20, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_drakes_hull_is_made_of_the_files_numbers(tmp_path_factory, seed):
    directory = tmp_path_factory.mktemp("obj")
    cloud = np.random.default_rng(seed).standard_normal((30, 3)) * 10.0 ** np.random.default_rng(seed + 1).integers(-3, 3)
    read = points(directory, "".join(f"v {x!r} {y!r} {z!r}\n" for x, y, z in cloud.tolist()) + "f 1 2 3\n")
    np.testing.assert_array_equal(read, cloud)
    assert {tuple(v) for v in drakes_hull(directory / "m.obj").tolist()} <= {tuple(v) for v in cloud.tolist()}


TOKENS = [token for line in TETRAHEDRON.splitlines() for token in line.split()]
ANY_TOKEN = st.one_of(st.sampled_from(HOSTILE), st.from_regex(r"[-+0-9.,eExa#/\\ ]{1,8}", fullmatch=True), FINITE.map(repr))


@settings(max_examples=300, deadline=None)
@given(st.integers(0, len(TOKENS) - 1), ANY_TOKEN)
@example(5, "1,5")
@example(5, "0x10")
def test_one_token_replaced_is_refused_with_its_line_or_read_as_written(tmp_path_factory, place, token):
    tokens = [*TOKENS[:place], token, *TOKENS[place + 1 :]]
    lines = [" ".join(tokens[4 * k : 4 * k + 4]) for k in range(8)]
    try:
        read = points(tmp_path_factory.mktemp("obj"), "\n".join(lines) + "\n")
    except SceneError as error:
        name, line, what = error.message.split(":", 2)
        assert name == "meshes/m.obj"
        assert int(line) == place // 4 + 1 or "names" in what
        return
    said = [line.partition("#")[0].split() for line in lines]
    plain = [words for words in said if words and words[0] == "v"]
    assert all(not set(x) - set("+-.0123456789eE") and math.isfinite(float(x)) for words in plain for x in words[1:4])
    np.testing.assert_array_equal(read, [[float(x) for x in words[1:4]] for words in plain])
