"""An STL mesh, binary or text, is read strictly here. Its normals are not read, because the triangles say it all."""

from __future__ import annotations

import math

import numpy as np

from certifier.model import Array
from certifier.scene.meshes.mesh import Mesh, refuse
from certifier.words import counted

_HEAD = 84
"""A binary file begins with this many bytes, of which the last four count the triangles."""
_TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
_DIGITS = b"0123456789+-.eE"
_NEXT = {
    b"": (b"solid",),
    b"solid": (b"facet", b"endsolid"),
    b"facet": (b"outer",),
    b"outer": (b"vertex",),
    b"vertex": (b"vertex", b"endloop"),
    b"endloop": (b"endfacet",),
    b"endfacet": (b"facet", b"endsolid"),
    b"endsolid": (b"solid",),
}
"""The statements of text STL, and which may follow them."""
_WORDS = {b"facet": 5, b"outer": 2, b"vertex": 4, b"endloop": 1, b"endfacet": 1}
"""How many words a statement has."""


def read_stl(data: bytes, name: str) -> Mesh:
    """Returns the mesh of an STL file; equal corners of triangles are one point.

    Args:
        name: the file's name for people.

    Raises:
        SceneError: ``scene_model``, with the line or the triangle, for a file that is cut short, has a coordinate that is no finite number,
            or has no triangles.
    """
    count = int.from_bytes(data[_HEAD - 4 : _HEAD], "little")
    if len(data) >= _HEAD and len(data) == _HEAD + count * _TRIANGLE.itemsize:
        corners = _binary(data, name)
    elif data.lstrip()[:5].lower() == b"solid" and b"\0" not in data:
        corners = _text(data, name)
    elif len(data) < _HEAD:
        refuse(name, f"this is no STL: it has {counted(len(data), 'byte')}, and binary STL has {_HEAD} before the first triangle")
    else:
        needed = _HEAD + count * _TRIANGLE.itemsize
        refuse(name, f"the file has {len(data)} bytes, and the {count} triangles that it counts need {needed}")
    if not len(corners):
        refuse(name, "the file has no triangles")
    points, numbers = np.unique(corners, axis=0, return_inverse=True)
    return Mesh(points, numbers.reshape(-1, 3).astype(np.int64))


def _binary(data: bytes, name: str) -> Array:
    """Returns the corners (3 t, 3) of the triangles of a file whose length is right."""
    corners = np.frombuffer(data, _TRIANGLE, offset=_HEAD)["corners"].astype(float)
    finite = np.isfinite(corners).all(axis=(1, 2))
    if not finite.all():
        refuse(name, f"triangle {int(finite.argmin()) + 1} has a coordinate that is no finite number")
    return corners.reshape(-1, 3)


def _text(data: bytes, name: str) -> Array:
    """Returns the corners (3 t, 3) of the triangles of a text."""
    corners: list[list[float]] = []
    before, line, begun = b"", 0, 0
    for line, raw in enumerate(data.splitlines(), 1):
        words = raw.split()
        if not words:
            continue
        where, statement = f"{name}:{line}", words[0].lower()
        if statement not in _NEXT[before]:
            refuse(where, f"{_shown(raw)} stands where {' or '.join(word.decode() for word in _NEXT[before])} must stand")
        if len(words) != _WORDS.get(statement, len(words)):
            refuse(where, f"{_shown(raw)} has {counted(len(words), 'word')} instead of {_WORDS[statement]}")
        if statement == b"outer":
            begun = len(corners)
        elif statement == b"vertex":
            corners.append(_vertex(words[1:], where))
        elif statement == b"endloop" and len(corners) - begun != 3:
            refuse(where, f"the facet has {counted(len(corners) - begun, 'vertex', 'vertices')} instead of 3")
        before = statement
    if before != b"endsolid":
        refuse(f"{name}:{line}", "the file ends before endsolid")
    return np.array(corners, dtype=float).reshape(-1, 3)


def _vertex(words: list[bytes], where: str) -> list[float]:
    try:
        numbers = [float(word) for word in words if not word.translate(None, _DIGITS)]
    except ValueError:
        numbers = []
    if len(numbers) != 3 or not all(map(math.isfinite, numbers)):
        refuse(where, f"{_shown(b' '.join(words))} is not three finite decimal numbers")
    return numbers


def _shown(line: bytes) -> str:
    return ascii(line[:60].decode(errors="replace"))
