"""Files as a stranger would make them: valid proofs with bytes, members, header and arrays changed in ways that parsers trip over."""

from __future__ import annotations

import copy
import io
import json
import struct
import warnings
import zipfile
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import numpy as np
from hypothesis import strategies as st

from certifier.model import Scene
from certifier.proof.container import npy
from tests.certifier import proofs

Draw = Callable[[st.SearchStrategy], Any]
Members = list[tuple[str, bytes]]

KINDS = ("region", "pair", "motion", "dual", "witness")
DEEP, RAW = "@deep@", "@raw@"
WORDS = [
    "",
    " ",
    "a\nb",
    "guarantee: exact\x1b[2K",
    "\u202e",
    "\ud800",
    "x" * 300,
    "world",
    "arm/link1/bar",
    "a" * 5000,
    "-1",
    "NaN",
    "1.0",
]
NUMBERS = [
    0,
    1,
    -1,
    2,
    7,
    0.5,
    -0.0,
    1e-320,
    1e100,
    1.0000001e100,
    1e308,
    10**30,
    10**400,
    2**53 + 1,
    float("nan"),
    float("inf"),
    -float("inf"),
]
OTHERS: list[Any] = [None, True, False, [], {}, [[]], {"a": 1}, [0, 1], ["world", "world"], [None], DEEP, RAW]
HOSTILE = st.sampled_from([*WORDS, *NUMBERS, *OTHERS]) | st.floats() | st.text(max_size=8) | st.integers()


@cache
def valid(kind: str) -> bytes:
    return proofs.files()[kind]


def members(data: bytes) -> Members:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(info.filename, archive.read(info)) for info in archive.infolist()]


def zipped(found: Members, kind: int = zipfile.ZIP_STORED, comment: bytes = b"") -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings(), zipfile.ZipFile(buffer, "w", kind) as archive:
        warnings.simplefilter("ignore", UserWarning)  # of a name that is there twice
        for name, content in found:
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content, kind)
        archive.comment = comment
    return buffer.getvalue()


def text_of(header: Any) -> bytes:
    """JSON with what only text can say: a depth that no encoder reaches, numbers too large."""
    text = json.dumps(header, sort_keys=True)
    return text.replace(f'"{DEEP}"', "[" * 30_000 + "]" * 30_000).replace(f'"{RAW}"', "1e999").encode()


def places(node: Any, path: tuple = ()) -> Iterator[tuple]:
    """The path of every value of a document, but the document itself."""
    for key, value in node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ():
        yield (*path, key)
        yield from places(value, (*path, key))


def bytes_changed(draw: Draw, data: bytes) -> bytes:
    """Bits flipped, bytes cut out, put in, repeated, or of another file."""
    i, j = sorted(draw(st.tuples(*[st.integers(0, len(data))] * 2)))
    way = draw(st.integers(0, 5))
    if way <= 1:
        changed = bytearray(data)
        for at in draw(st.lists(st.integers(0, len(data) - 1), min_size=1, max_size=8)):
            changed[at] ^= 1 << draw(st.integers(0, 7))
        return bytes(changed)
    other = valid(draw(st.sampled_from(KINDS)))
    return (data[:i] + data[j:], data[:i] + draw(st.binary(max_size=40)) + data[i:], data[:j] + data[i:], data[:i] + other[i:])[way - 2]


def zip_changed(draw: Draw, data: bytes) -> bytes:
    """Members twice, more, fewer, renamed or exchanged; a comment, another compression, wrong sizes, bytes before and behind."""
    found = members(data)
    i, j = draw(st.tuples(*[st.integers(0, len(found) - 1)] * 2))
    way = draw(st.integers(0, 12))
    if way == 0:
        found.append(found[i])
    elif way == 1:
        found.append((found[i][0], found[j][1]))
    elif way == 2:
        found.append(
            (draw(st.sampled_from(["extra.npy", "a.txt", "../a.npy", "header.json", "proof/0/more.npy", "x" * 300, "dir/"])), found[j][1])
        )
    elif way == 3:
        del found[i]
    elif way == 4:
        found[i] = (
            draw(st.sampled_from([found[j][0].upper(), "\u00e9.npy", found[i][0].removesuffix(".npy"), "header.json"])),
            found[i][1],
        )
    elif way == 5:
        found[i], found[j] = (found[i][0], found[j][1]), (found[j][0], found[i][1])
    elif way == 6:
        return zipped(found, draw(st.sampled_from([zipfile.ZIP_BZIP2, zipfile.ZIP_LZMA, zipfile.ZIP_DEFLATED])))
    elif way == 7:
        return zipped(found, comment=b"a comment")
    elif way == 8:
        return draw(st.binary(min_size=1, max_size=30)) + zipped(found)
    elif way == 9:
        return zipped(found) + draw(st.binary(min_size=1, max_size=30))
    elif way == 10:
        found[i] = (found[i][0], bytes(draw(st.sampled_from([10**6, 4 * 10**6]))))
        return zipped(found, zipfile.ZIP_DEFLATED)
    elif way == 11:
        found.reverse()
    else:
        return directory_changed(draw, zipped(found))
    return zipped(found)


def directory_changed(draw: Draw, data: bytes) -> bytes:
    """A field of one entry of the directory, or of its end, is another number."""
    changed = bytearray(data)
    starts = [at for at in range(len(data)) if data[at : at + 4] == b"PK\1\2"] or [len(data) - 22]
    at, format_ = draw(st.sampled_from([(draw(st.sampled_from(starts)) + 4, "<H"), (len(data) - 22, "<L")]))
    offset = draw(st.integers(0, 40 if format_ == "<H" else 18))
    struct.pack_into(format_, changed, min(at + offset, len(data) - 4), draw(st.sampled_from([0, 1, 8, 2**15, 2**16 - 1])))
    return bytes(changed)


def header_changed(draw: Draw, data: bytes) -> bytes:
    """A value of the header is another, gone, twice, or one that is not known; hashes are made to fit more often than not."""
    found = dict(members(data))
    try:
        header = json.loads(found["header.json"])
        paths = list(places(header))
    except (KeyError, ValueError, RecursionError):
        return data
    if not paths:
        return data
    # Lists of numbers would hide everything else.
    scarce = [path for path in paths if len(path) < 5]
    path = draw(st.sampled_from(scarce if scarce and draw(st.booleans()) else paths))
    node = header
    for key in path[:-1]:
        node = node[key]
    way = draw(st.integers(-6, 9))
    if way in (4, 5):
        node[path[-1]] = draw(HOSTILE)
    elif way <= 3:
        node[path[-1]] = another(draw, header, node[path[-1]])
    elif way == 6:
        del node[path[-1]]
    elif way == 7 and isinstance(node, list):
        node.append(copy.deepcopy(node[path[-1]]))
    elif way == 8 and isinstance(node, list):
        node.insert(0, draw(HOSTILE))
    elif isinstance(node, dict):
        node[draw(st.sampled_from(["more", "scene", "kind", "hash", "body", ""]))] = draw(HOSTILE)
    text = text_of(header if draw(st.integers(0, 9)) == 7 else fitting(header))
    if draw(st.integers(0, 29)) == 17:
        text = text.replace(b'"kind": ', b'"kind": "pair", "kind": ', 1)
    return zipped([(name, text if name == "header.json" else content) for name, content in found.items()], zipfile.ZIP_DEFLATED)


def another(draw: Draw, header: Any, value: Any) -> Any:
    """A value of the same kind: a number near by, a word from somewhere else in the header."""
    if isinstance(value, (int, float)) and not isinstance(value, bool) and abs(value) < 1e300:
        step = draw(st.sampled_from([1, -1, 10])) if isinstance(value, int) else draw(st.sampled_from([1e-12, 1e-6, 0.01, -0.3, 2.0]))
        return value + step if draw(st.booleans()) else -value
    if isinstance(value, str):
        return draw(st.sampled_from(sorted({word for word in leaves(header) if isinstance(word, str)})))
    return draw(HOSTILE)


def leaves(node: Any) -> Iterator[Any]:
    if isinstance(node, (dict, list)):
        for value in node.values() if isinstance(node, dict) else node:
            yield from leaves(value)
    else:
        yield node


def fitting(header: Any) -> Any:
    """The header with the hash that its scene has, if it is one."""
    try:
        scene = {name: value for name, value in header["scene"].items() if name != "hash"}
        digest = Scene.from_document(scene).hash
    except Exception:
        # Then there is none that fits.
        return header
    changed = {**header, "scene": {**scene, "hash": digest}}
    return {**changed, "scene_hash": digest} if "scene_hash" in header else changed


def array_changed(draw: Draw, data: bytes) -> bytes:
    """A number, the shape or the type of an array, or how it is written down."""
    found = members(data)
    at = draw(st.sampled_from([i for i, (name, _) in enumerate(found) if name.endswith(".npy")] or [0]))
    name, content = found[at]
    try:
        array = np.load(io.BytesIO(content), allow_pickle=False)
    except Exception:
        # What NumPy itself cannot read stays as it is.
        return data
    found[at] = (name, written(draw, array))
    return zipped(found, zipfile.ZIP_DEFLATED)


def written(draw: Draw, array: np.ndarray) -> bytes:
    way = draw(st.integers(-6, 11))
    if way <= 3 and array.size:
        changed = array.copy()
        values = NUMBERS if array.dtype.kind == "f" else [0, 1, -1, np.iinfo(array.dtype).min, np.iinfo(array.dtype).max, 30, -300]
        number = draw(
            st.sampled_from([x for x in values if isinstance(x, float) or abs(x) < 2**63]) if draw(st.booleans()) else st.floats(-4, 4)
        )
        with np.errstate(all="ignore"):
            changed.reshape(-1)[draw(st.integers(0, array.size - 1))] = np.asarray(number).astype(array.dtype)
            return npy(changed * np.asarray(-1, changed.dtype) if draw(st.integers(0, 9)) == 0 else changed)
    if way == 4:
        return npy(array[:-1] if array.ndim and len(array) else array.reshape(1, -1))
    if way == 5:
        return npy(np.concatenate([array, array]) if array.ndim else array.reshape(1))
    if way == 6:
        return npy(
            draw(st.sampled_from([array.reshape(-1), array.T, array[None], array[..., None], array[:0] if array.ndim else array[None][:0]]))
        )
    if way == 7:
        with np.errstate(all="ignore"):
            types = ["<f4", ">f8", "<i4", "<i8", ">i4", "<u8", "<i2", "|b1", "|S8", "<f2"]
            return saved(array.astype(draw(st.sampled_from(types))))
    if way == 8:
        return saved(array, version=draw(st.sampled_from([(2, 0), (3, 0)])))
    if way == 9:
        return saved(np.asfortranarray(array if array.ndim > 1 else np.ones((2, 3))))
    if way == 10:
        return saved(np.array([None, {"a": 1}], dtype=object))
    shapes = ["(1000000000000, 0)", "(0, 99999999999999999999)", "(-1,)", "(2, 2, 2,", "()", "(1,)" * 3, "(True,)", "9" * 30, "(((((((((("]
    text = f"{{'descr': '{array.dtype.str}', 'fortran_order': False, 'shape': {draw(st.sampled_from(shapes))}, }}"
    header = text.encode() + b" " * (63 - (10 + len(text)) % 64) + b"\n"
    return b"\x93NUMPY\1\0" + struct.pack("<H", len(header)) + header + (array.tobytes() if draw(st.booleans()) else b"")


def saved(array: np.ndarray, version: tuple[int, int] = (1, 0)) -> bytes:
    buffer = io.BytesIO()
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.lib.format.write_array(buffer, array, version, allow_pickle=True)
    return buffer.getvalue()


FAMILIES: dict[str, Callable[[Draw, bytes], bytes]] = {
    "bytes": bytes_changed,
    "zip": zip_changed,
    "header": header_changed,
    "array": array_changed,
}


@st.composite
def mutants(draw: Draw, family: str) -> tuple[str, bytes]:
    """A kind of proof and a file made of a valid one by up to three changes, the first of the family."""
    kind = draw(st.sampled_from(KINDS))
    data = FAMILIES[family](draw, valid(kind))
    for other in draw(st.lists(st.sampled_from(["header", "array"]), max_size=2)) if family != "bytes" else ():
        try:
            data = FAMILIES[other](draw, data)
        except Exception:
            # What is no zip any more stays as it is.
            break
    return kind, data
