"""The container of a proof: a zip of one JSON header and plain arrays (docs/proofs.md, "The file")."""

from __future__ import annotations

import io
import json
import math
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from typing import Any

import numpy as np

from certifier.errors import ProofError
from certifier.model import Array, Scene

FORMAT = 2
MAX_BYTES = 1 << 30
WORTH_DEFLATING = 1024
"""Bytes; a compressor takes longer to set up than a smaller member to write."""
TYPES = ("float64", "int32", "int64")
LARGEST = 1e100
"""Numbers above it stand for nothing real; sums and products of a few below it do not overflow."""


@contextmanager
def malformed() -> Iterator[None]:
    """Whatever a broken file makes its parser raise is the same error: the file is malformed.

    Raises:
        ProofError: proof_malformed, or the one that was raised.
    """
    try:
        yield
    except ProofError:
        raise
    except Exception as error:
        raise ProofError("proof_malformed", f"the proof file is malformed: {type(error).__name__}: {error}") from error


def pack(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    """The file; the same content gives the same bytes."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        members = {"header.json": json.dumps(header, sort_keys=True).encode(), **{f"{name}.npy": npy(a) for name, a in arrays.items()}}
        for name, content in members.items():
            kind = zipfile.ZIP_DEFLATED if len(content) >= WORTH_DEFLATING else zipfile.ZIP_STORED
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content, kind)
    return buffer.getvalue()


def npy(array: np.ndarray) -> bytes:
    """The array in NumPy's format."""
    return _npy_header(array.dtype.str, array.shape) + array.tobytes()


@lru_cache(maxsize=1024)
def _npy_header(dtype: str, shape: tuple[int, ...]) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(buffer, {"descr": dtype, "fortran_order": False, "shape": shape})
    return buffer.getvalue()


def unpack(data: bytes, kind: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    """Header and arrays of a file of this kind; every double is at most LARGEST in magnitude.

    Raises:
        ProofError: not such a file of this format, or one that unpacks to more than MAX_BYTES.
    """
    with _opened(data) as (archive, header):
        if header["kind"] != kind:
            raise ProofError("proof_malformed", f"the proof is of a {header['kind']}, not of a {kind}")
        names = [name for name in archive.namelist() if name.endswith(".npy")]
        return header, {name.removesuffix(".npy"): _array(archive.read(name)) for name in names}


def header_of(data: bytes) -> dict[str, Any]:
    """The header of a file of any kind.

    Raises:
        ProofError: not a file of this format.
    """
    with _opened(data) as (_, header):
        return header


def with_scene(data: bytes, scene: Scene) -> bytes:
    """The file with the scene itself instead of its hash: whoever has it can check it."""
    header, arrays = unpack(data, header_of(data)["kind"])
    return pack({**header, "scene": scene.to_document()}, arrays)


@contextmanager
def _opened(data: bytes) -> Iterator[tuple[zipfile.ZipFile, dict[str, Any]]]:
    with malformed(), zipfile.ZipFile(io.BytesIO(data)) as archive:
        if sum(info.file_size for info in archive.infolist()) > MAX_BYTES:
            raise ProofError("proof_too_large", f"the proof file unpacks to more than {MAX_BYTES} bytes")
        header = json.loads(archive.read("header.json"))
        if header["format"] != FORMAT:
            raise ProofError("proof_malformed", f"the proof file is of format {header['format']!r}, not {FORMAT}")
        yield archive, header


def _array(data: bytes) -> np.ndarray:
    stream = io.BytesIO(data)
    version = np.lib.format.read_magic(stream)
    if version != (1, 0):
        raise ValueError(f"an array of format {version}")
    shape, fortran_order, dtype = np.lib.format.read_array_header_1_0(stream)
    # Looked at before anything is allocated.
    if fortran_order or dtype.name not in TYPES or math.prod(shape) * dtype.itemsize != len(data) - stream.tell():
        raise ValueError(f"an array of {dtype} with shape {shape} in {len(data)} bytes")
    array = np.frombuffer(data, dtype, offset=stream.tell()).reshape(shape)
    if dtype.kind == "f" and not (np.abs(array) <= LARGEST).all():
        raise ValueError("a number is not finite")
    return array


def floats(array: np.ndarray) -> Array:
    """The array, of doubles.

    Raises:
        ProofError: proof_malformed.
    """
    if array.dtype != np.float64:
        raise ProofError("proof_malformed", f"an array of the proof file holds {array.dtype.name} where doubles belong")
    return array


def index(value: Any) -> int:
    """A number of the header that counts something.

    Raises:
        ProofError: proof_malformed.
    """
    if not isinstance(value, int) or isinstance(value, bool) or value < 0:
        raise ProofError("proof_malformed", f"{value!r} stands in the proof file where a number from 0 belongs")
    return value
