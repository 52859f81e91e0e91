"""The container of a proof is a zip of one JSON header and plain arrays (docs/proofs.md, "The file").

Files come from strangers. What can be written in two ways is read in one only. So the reader refuses a zip with a comment, a zip with a
member twice, and an array in Fortran's order or with a header that NumPy would not write. It also refuses what no part of the proof reads.
"""

from __future__ import annotations

import io
import json
import math
import re
import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np

from certifier.document import LARGEST, Node, parse
from certifier.errors import CirisError, ProofError
from certifier.model import Array, Scene
from certifier.proof import limits

FORMAT = 3
WORTH_DEFLATING = 1024
"""Members of at least this many bytes are deflated; a compressor takes longer to set up than a smaller member takes to write."""
TYPES: dict[bytes, np.dtype[Any]] = {code: np.dtype(code.decode()) for code in (b"<f4", b"<f8", b"|i1", b"<i2", b"<i4", b"<i8")}
HEADER = "header.json"
_NPY = re.compile(rb"\x93NUMPY\x01\x00..\{'descr': '([<|]..)', 'fortran_order': False, 'shape': \(([0-9, ]{0,60})\), \} *\n", re.DOTALL)
_END = struct.Struct("<4s4H2LH")
"""The end of a zip holds a signature, disks, members (twice), size and offset of the directory, and the length of the comment."""
_LOCAL, _ENTRY, _LOCATOR = 30, 46, 20
"""A member takes _LOCAL bytes before its content and _ENTRY in the directory, besides its name. What stands before the end of a zip of more
than 4 GiB takes _LOCATOR."""


@contextmanager
def malformed() -> Iterator[None]:
    """Turns every error about a broken file into the same one: the file is malformed.

    Raises:
        ProofError: proof_malformed for any other CirisError; a ProofError is raised as it is.
    """
    try:
        yield
    except ProofError:
        raise
    except CirisError as error:
        raise _malformed(error.message, error.field) from error


def _malformed(problem: str, where: str | None = None) -> ProofError:
    return ProofError("proof_malformed", f"the proof file is malformed: {problem}", field=where)


def pack(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """Returns the bytes of the file; the same content gives the same bytes.

    A file that would be deflated to less than its limits allow is stored as it is.
    """
    members = {HEADER: json.dumps(header, sort_keys=True).encode(), **{f"{name}.npy": npy(a) for name, a in arrays.items()}}
    data = _zipped(members, zipfile.ZIP_DEFLATED)
    return _zipped(members, zipfile.ZIP_STORED) if sum(map(len, members.values())) > _most(data) else data


def _zipped(members: dict[str, bytes], kind: int) -> bytes:
    """Returns a zip of files, in which those that are worth it are stored in this way."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, content in members.items():
            own = kind if len(content) >= WORTH_DEFLATING else zipfile.ZIP_STORED
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content, own)
    return buffer.getvalue()


def _most(data: bytes) -> int:
    """Returns how many bytes a file may unpack to."""
    return min(limits.UNPACKED_BYTES, limits.FREE_BYTES + limits.RATIO * len(data))


def npy(array: np.ndarray) -> bytes:
    """Returns the array in NumPy's format."""
    return _npy_header(array.dtype.str, array.shape) + array.tobytes()


@lru_cache(maxsize=1024)
def _npy_header(dtype: str, shape: tuple[int, ...]) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


Wanted = Callable[[str], bool]
"""Says of an array's name whether the array is wanted. The others are not inflated."""


def unpack(data: bytes, kind: str, wanted: Wanted = lambda _: True) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Returns the header and the wanted arrays of a file of this kind; every double is at most LARGEST in magnitude.

    Raises:
        ProofError: this is no such file of this format, or it is beyond the limits.
    """
    with _opened(data) as (archive, header):
        if header["kind"] != kind:
            raise _malformed(f"it is a proof of kind {header['kind']}, not {kind}", "header.kind")
        return header, _arrays(data, archive, wanted)


def header_of(data: bytes) -> dict[str, Any]:
    """Returns the header of a file of any kind; its ``kind`` is there and is a text.

    Raises:
        ProofError: this is no file of this format, or it is beyond the limits.
    """
    with _opened(data) as (_, header):
        return header


def unpacked_size(data: bytes) -> int:
    """Returns how many bytes the members of a file have together when they are inflated.

    Raises:
        ProofError: this is no file of this format, or it is beyond the limits.
    """
    with _opened(data) as (archive, _):
        return sum(info.file_size for info in archive.infolist())


def some_of(data: bytes, wanted: Wanted) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Returns the header of a file of any kind and the wanted arrays.

    Raises:
        ProofError: this is no file of this format, or it is beyond the limits.
    """
    with _opened(data) as (archive, header):
        return header, _arrays(data, archive, wanted)


def _arrays(data: bytes, archive: zipfile.ZipFile, wanted: Wanted) -> dict[str, np.ndarray]:
    members = ((info.filename.removesuffix(".npy"), info) for info in archive.infolist() if info.filename != HEADER)
    return {name: _array(info.filename, _content(data, info)) for name, info in members if wanted(name)}


def with_scene(data: bytes, scene: Scene) -> bytes:
    """Returns the file with the scene itself besides its hash, so that anyone who has the file can check it."""
    header, arrays = unpack(data, header_of(data)["kind"])
    return pack({**header, "scene": scene.to_document()}, arrays)


@contextmanager
def _opened(data: bytes) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any]]]:
    _check_end(data)
    try:
        archive = zipfile.ZipFile(io.BytesIO(data))
    except Exception as error:  # zipfile raises many kinds of error about a broken file
        raise _malformed(f"it is no zip: {error}") from error
    with archive, malformed():
        _check_members(archive, data)
        header = parse(_content(data, archive.getinfo(HEADER)), "header")
        if not isinstance(header, dict) or header.get("format") != FORMAT or type(header["format"]) is not int:
            raise _malformed(f"it is not of format {FORMAT}, the one that this version reads and writes", "header.format")
        if not isinstance(header.get("kind"), str):
            raise _malformed("it does not say of what kind the proof is", "header.kind")
        yield archive, header


def _check_end(data: bytes) -> None:
    """Checks that the end of the zip is where it belongs and gives a directory that is not too long, as zipfile would read it all."""
    if len(data) > limits.FILE_BYTES:
        raise ProofError("proof_too_large", f"the proof file has {len(data)} bytes, more than {limits.FILE_BYTES}")
    if len(data) < _END.size:
        raise _malformed(f"it has {len(data)} bytes, fewer than the end of a zip")
    signature, disk, first_disk, here, members, size, offset, comment = _END.unpack(data[-_END.size :])
    if (signature, disk, first_disk, comment) != (b"PK\5\6", 0, 0, 0) or here != members or offset + size + _END.size != len(data):
        raise _malformed("it does not end as a zip of one piece without a comment does")
    if data[-_END.size - _LOCATOR : -_END.size].startswith(b"PK\6\7"):
        raise _malformed("it ends as a zip of more than 4 GiB does")
    if members > limits.MEMBERS or size > members * (_ENTRY + limits.MEMBER_NAME):
        raise ProofError("proof_too_large", f"the proof file has more than {limits.MEMBERS} members, or too long names")


def _check_members(archive: zipfile.ZipFile, data: bytes) -> None:
    members = {info.filename: info for info in archive.infolist()}
    if len(members) < len(archive.infolist()):
        raise _malformed("it has two members of the same name")
    if HEADER not in members:
        raise _malformed("it has no header.json")
    for name, info in members.items():
        kinds = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
        if info.compress_type not in kinds or info.flag_bits or info.extra or info.comment or not (name == HEADER or name.endswith(".npy")):
            raise _malformed("it is no plain array, stored or deflated", name)
    if not all(_starts(data, info) for info in members.values()):
        raise _malformed("a member begins otherwise than the directory says")
    if sum(_LOCAL + len(name) + info.compress_size for name, info in members.items()) != archive.start_dir:
        raise _malformed("its members do not lie one after the other, or hold more than the directory says")
    total = sum(info.file_size for info in members.values())
    if total > _most(data):
        most = f"{limits.UNPACKED_BYTES} or {limits.RATIO} times what it takes"
        raise ProofError("proof_too_large", f"the proof file unpacks to {total} bytes, more than {most}")
    if members[HEADER].file_size > limits.HEADER_BYTES:
        raise ProofError("proof_too_large", f"the header has {members[HEADER].file_size} bytes, more than {limits.HEADER_BYTES}")


def _starts(data: bytes, info: zipfile.ZipInfo) -> bool:
    """Returns whether a member's own header repeats what the directory says."""
    header = info.FileHeader(zip64=False)
    return data[info.header_offset : info.header_offset + len(header)] == header


def _content(data: bytes, info: zipfile.ZipInfo) -> bytes:
    """Returns a member, which has the length and the sum that the directory says; no more is inflated, and nothing hides behind it."""
    start = info.header_offset + len(info.FileHeader(zip64=False))
    content = data[start : start + info.compress_size]
    if info.compress_type == zipfile.ZIP_DEFLATED:
        inflating = zlib.decompressobj(-zlib.MAX_WBITS)
        try:
            content = inflating.decompress(content, info.file_size + 1)
        except zlib.error as error:
            raise _malformed(f"it cannot be read: {error}", info.filename) from error
        if len(content) <= info.file_size and (not inflating.eof or inflating.unused_data):
            raise _malformed("it ends otherwise than the directory says", info.filename)
    if len(content) != info.file_size:
        raise _malformed(f"it has not {info.file_size} bytes", info.filename)
    if zlib.crc32(content) != info.CRC:
        raise _malformed("it is not what it was: its checksum is wrong", info.filename)
    return content


def _array(name: str, data: bytes) -> np.ndarray:
    match = _NPY.match(data)
    if match is None or match[1] not in TYPES:
        raise _malformed("it is no array of float32, float64, int8, int16, int32 or int64 in C's order", name)
    dtype, shape = TYPES[match[1]], tuple(int(length) for length in match[2].replace(b",", b" ").split())
    if not data.startswith(_npy_header(dtype.str, shape)) or max(shape, default=0) > limits.DIMENSION:
        raise _malformed("its header is not the one that NumPy writes for such an array", name)
    if math.prod(shape) * dtype.itemsize != len(data) - match.end():
        raise _malformed(f"an array of {dtype} of shape {shape} has not {len(data) - match.end()} bytes", name)
    # A copy, because Numba compiles a function again for an array that may not be written to, and that takes a minute.
    array = np.frombuffer(data, dtype, offset=match.end()).reshape(shape).copy()
    if dtype.kind == "f" and array.size and not (float(array.min()) >= -LARGEST and float(array.max()) <= LARGEST):
        raise _malformed(f"a number is not finite, or larger than {LARGEST:g}", name)
    return array


class Arrays:
    """Holds the arrays of a file, which are to be read once each."""

    def __init__(self, arrays: dict[str, np.ndarray]) -> None:
        self._left = dict(arrays)

    def take(self, name: str, *types: str) -> np.ndarray:
        """Returns an array that has not been read yet, of one of these types.

        Raises:
            ProofError: proof_malformed, when it is missing or of another type.
        """
        array = self._left.pop(name, None)
        if array is None:
            raise _malformed("it is missing", f"{name}.npy")
        if array.dtype.name not in types:
            raise _malformed(f"it holds {array.dtype.name} where {' or '.join(types)} belongs", f"{name}.npy")
        return array

    def floats(self, name: str) -> Array:
        """Returns an array of doubles that has not been read yet.

        Raises:
            ProofError: proof_malformed, when it is missing or of another type.
        """
        return self.take(name, "float64")

    def has(self, name: str) -> bool:
        """Says whether there is an array of this name that has not been read yet."""
        return name in self._left

    def end(self) -> None:
        """Raises ProofError, proof_malformed, if the file has more arrays than were read."""
        if self._left:
            raise _malformed("it is no part of the proof", f"{min(self._left)}.npy")


def head(header: dict[str, Any], *names: str) -> dict[str, Node]:
    """Returns the members of a header that has these names besides format, kind and the scene or its hash.

    Raises:
        CirisError: the header lacks one of them, or has others.
    """
    scene, more = ("scene", ()) if header["kind"] in ("region", "map") else ("scene_hash", ("scene",))
    return Node(header, "header").fields("format", "kind", scene, *names, optional=more)
