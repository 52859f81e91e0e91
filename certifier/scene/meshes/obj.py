"""An OBJ mesh is read strictly here.

Drake's reader makes 0 of ``nan`` and 1 of ``1,5``, and leaves out what it does not know, without a word. So collision meshes are read here,
and whatever is in doubt is refused. Only vertices count for a convex hull. Faces are checked because a face whose vertex is missing is a
sign of a file that was cut short, and they say how far the hull reaches beyond the mesh.
"""

from __future__ import annotations

import itertools
import math
import re
from array import array
from typing import NoReturn

import numpy as np

from certifier.errors import SceneError
from certifier.scene.meshes.mesh import EXPORT, Mesh

_BOM = b"\xef\xbb\xbf"
_LENGTH = 1000
"""A vertex line has at most this many bytes."""
_DIGITS = b"0123456789+-.eE \t"
"""The numbers of a line consist of these bytes. ``float`` reads every text of them either as a decimal number or not at all."""
_FACE = re.compile(rb"f(?:[ \t]+-?[0-9]{1,12}(?:/(?:-?[0-9]{1,12})?(?:/-?[0-9]{1,12})?)?){3,}[ \t]*")
_CORNERS = re.compile(rb"[ \t](-?[0-9]+)")
_OTHER = frozenset([b"vt", b"vn", b"g", b"o", b"s", b"l", b"p", b"mtllib", b"usemtl"])
"""These statements move no point of the surface."""


def read_obj(data: bytes, name: str) -> Mesh:
    """Returns the mesh of an OBJ file.

    Args:
        name: the file's name for people.

    Raises:
        SceneError: ``scene_model``, with the line, when a vertex is not three finite decimal numbers, a face names a vertex that does not
            exist, or a statement is not known.
    """
    data = data.removeprefix(_BOM)
    coordinates, triangles = array("d"), array("q")
    farthest, farthest_line = 0, 0

    def refuse(line: int, what: str, hint: str = EXPORT) -> NoReturn:
        raise SceneError("scene_model", f"{name}:{line}: {what}", field="directives", hint=hint)

    if b"\0" in data:
        refuse(data[: data.index(b"\0")].count(b"\n") + 1, "the line holds a zero byte; OBJ files are text")
    for number, raw in enumerate(data.splitlines(), 1):
        line = raw.partition(b"#")[0].strip(b" \t")
        if not line:
            continue
        words = line.split()
        if line.endswith(b"\\"):
            refuse(number, "the line goes on behind a backslash, which readers take differently", "put it on one line")
        if words[0] == b"v":
            vertex = _vertex(line, words)
            if vertex is None:
                refuse(number, f"{_shown(line)} is not a vertex", "write v and three finite decimal numbers")
            coordinates.extend(vertex)
        elif words[0] == b"f":
            if not _FACE.fullmatch(line):
                refuse(number, f"{_shown(line)} is not a face", "write f and the numbers of three or more vertices")
            corners = [int(corner) for corner in _CORNERS.findall(line)]
            if 0 in corners or -min(corners) > len(coordinates) // 3:
                refuse(number, f"{_shown(line)} names a vertex that does not exist")
            first, *rest = [corner - 1 if corner > 0 else len(coordinates) // 3 + corner for corner in corners]
            for pair in itertools.pairwise(rest):
                triangles.extend((first, *pair))
            if max(corners) > farthest:
                farthest, farthest_line = max(corners), number
        elif words[0] not in _OTHER:
            refuse(number, f"{_shown(words[0])} is not a statement of a polygon mesh", "export the mesh as polygons")
    if farthest > len(coordinates) // 3:
        refuse(farthest_line, f"the face names vertex {farthest} of {len(coordinates) // 3}")
    if not coordinates:
        refuse(1, "the file has no vertices")
    if not triangles:
        refuse(1, "the file has no faces")
    return Mesh(np.array(coordinates).reshape(-1, 3), np.array(triangles, dtype=np.int64).reshape(-1, 3))


def _vertex(line: bytes, words: list[bytes]) -> list[float] | None:
    """Returns the three coordinates of a vertex line, or None.

    It returns None unless the line has three finite decimal numbers, perhaps with weight 1 or a colour behind them.
    """
    if len(line) > _LENGTH or len(words) not in (4, 5, 7) or line[1:].translate(None, _DIGITS):
        return None
    try:
        numbers = [float(word) for word in words[1:]]
    except ValueError:
        return None
    weighted = len(numbers) == 4 and numbers[3] != 1
    return None if weighted or not all(map(math.isfinite, numbers)) else numbers[:3]


def _shown(line: bytes) -> str:
    return ascii(line[:60].decode(errors="replace")) + ("..." if len(line) > 60 else "")
