"""Proofs as data: what a certificate of a pair, or of a region, consists of, and its portable file.

A pair's proof on P = {s : C s <= d} holds, in the frame F and the coordinates u = (s - mid)/half of a box around P,
the plane [a; b] = Z [1; u], a margin t, a bound kappa of |a|, and for every vertex v of either body Gram factors L_j with

    +-(a'p_v + b den) - r kappa den - t den - |L_0' rho|^2 - sum_j g_j |L_j' rho|^2  ~  0,

the g_j some of P's faces d_j - c_j's and of its box's, 1 + u_i and 1 - u_i, rho the 2^k products of the chain's coordinates u_i
(plain monomials). The factors are fixed-point numbers, one exponent a matrix, of 30 bits or, where rounding would eat up the margin,
of 48. Nothing here decides whether a proof holds: certifier.verify does.
The file is a zip of plain arrays and one JSON header (docs/algorithm.md, "Proof file").
"""

from __future__ import annotations

import hashlib
import io
import json
import zipfile
from dataclasses import dataclass, field
from typing import Any
from zlib import error as zlib_error

import numpy as np

from certifier.errors import CirisError
from certifier.model import Array, Scene
from certifier.verify.archimedean import Archimedean

FORMAT = 1
BITS = {"int32": 30, "int64": 48}
"""Bits of a Gram factor's mantissa by its type."""
MAX_BYTES = 1 << 30


class ProofError(CirisError):
    """The proof does not hold, or the file is not one."""


@dataclass(frozen=True)
class Ground:
    """The polytope a proof is about and its box.

    Attributes:
        C, d: (m, n), (m,) faces; the joint limits hold besides.
        mid, half: (n,) the box.
        Y_lower, Y_upper: (n, m + 2n) multipliers of the faces, the upper and the lower joint limits, that prove the box.
    """

    C: Array
    d: Array
    mid: Array
    half: Array
    Y_lower: Array
    Y_upper: Array


@dataclass(frozen=True)
class Side:
    """Gram factors of one body's vertices: factor = mantissa 2^exponent, lower triangles row by row.

    Attributes:
        chain: position indices of the joints between F and the body; rho's coordinates in this order.
        mantissa: (V, f + 1, L (L + 1) / 2) int32 or int64, L = 2^k, for 1 and the f faces used.
        exponent: (V, f + 1) int32.
    """

    chain: tuple[int, ...]
    mantissa: np.ndarray
    exponent: np.ndarray

    @classmethod
    def from_gram(cls, chain: tuple[int, ...], Q: Array, kind: str = "int32") -> Side:
        """Rounded factors of positive definite Gram matrices Q, (V, f + 1, L, L), in plain monomials; ``kind`` as in BITS.

        Raises:
            np.linalg.LinAlgError: a matrix is not positive definite.
        """
        factor = np.linalg.cholesky(Q)
        exponent = np.frexp(np.abs(factor).max(axis=(2, 3)))[1].astype(np.int32) - BITS[kind]
        rows, columns = np.tril_indices(Q.shape[-1])
        mantissa = np.rint(np.ldexp(factor[:, :, rows, columns], -exponent[:, :, None])).astype(kind)
        return cls(chain, mantissa, exponent)


@dataclass(frozen=True)
class PairProof:
    """A separating plane for one pair on a polytope, with the sums of squares that prove it.

    Attributes:
        a, b: geometry names.
        frame: body whose frame the plane is expressed in.
        plane: Z, (4, n + 1).
        t, kappa: margin and bound of |a(u)| on the box (0 where no radius is involved).
        faces: the f faces used: j for the ground's face j, m + i for 1 + u_i, m + n + i for 1 - u_i.
        sides: of a and b.
    """

    scene_hash: str
    a: str
    b: str
    frame: str
    ground: Ground
    plane: Array
    t: float
    kappa: float
    faces: tuple[int, ...]
    sides: tuple[Side, Side]

    def to_bytes(self) -> bytes:
        """The proof as a file."""
        header = {"format": FORMAT, "kind": "pair", "scene_hash": self.scene_hash, "pairs": [self._header(0)]}
        return _pack(header, {**_ground_arrays("ground/0", self.ground), **self._arrays("pair/0")})

    @classmethod
    def from_bytes(cls, data: bytes) -> PairProof:
        """Inverse of :meth:`to_bytes`.

        Raises:
            ProofError: not a pair's proof.
        """
        header, arrays = _unpack(data, "pair")
        with _malformed():
            return _pair(header["scene_hash"], header["pairs"][0], [_ground("ground/0", arrays)], "pair/0", arrays)

    def _header(self, ground: int) -> dict[str, Any]:
        chains = [list(side.chain) for side in self.sides]
        return {"a": self.a, "b": self.b, "frame": self.frame, "ground": ground, "faces": list(self.faces), "chains": chains}

    def _arrays(self, prefix: str) -> dict[str, np.ndarray]:
        arrays = {f"{prefix}/plane": self.plane, f"{prefix}/scalars": np.array([self.t, self.kappa])}
        for i, side in enumerate(self.sides):
            arrays[f"{prefix}/mantissa{i}"], arrays[f"{prefix}/exponent{i}"] = side.mantissa, side.exponent
        return arrays


@dataclass(frozen=True)
class RegionProof:
    """Everything needed to check that a region is free of collision for every pair of its scene.

    Attributes:
        C, d: the region's half-spaces, joint limits included.
        interior: (n,) a point strictly inside.
        pairs: one proof for every pair of the scene; each ground contains the region.
    """

    scene: Scene
    C: Array
    d: Array
    interior: Array
    archimedean: Archimedean
    pairs: tuple[PairProof, ...] = field(repr=False)

    def to_bytes(self) -> bytes:
        """The proof as a file; grounds that several pairs share are stored once."""
        grounds: dict[bytes, int] = {}
        arrays: dict[str, np.ndarray] = {"region/C": self.C, "region/d": self.d, "region/interior": self.interior}
        arrays |= {f"archimedean/{name}": np.asarray(value) for name, value in vars(self.archimedean).items()}
        headers = []
        for i, pair in enumerate(self.pairs):
            own = _ground_arrays("", pair.ground)
            key = hashlib.sha256(b"".join(a.tobytes() for a in own.values())).digest()
            if key not in grounds:
                grounds[key] = len(grounds)
                arrays |= {f"ground/{grounds[key]}{name}": value for name, value in own.items()}
            headers.append(pair._header(grounds[key]))
            arrays |= pair._arrays(f"pair/{i}")
        header = {"format": FORMAT, "kind": "region", "scene": self.scene.to_document(), "grounds": len(grounds), "pairs": headers}
        return _pack(header, arrays)

    @classmethod
    def from_bytes(cls, data: bytes) -> RegionProof:
        """Inverse of :meth:`to_bytes`.

        Raises:
            ProofError: not a region's proof.
        """
        header, arrays = _unpack(data, "region")
        with _malformed():
            scene = Scene.from_document(header["scene"])
            grounds = [_ground(f"ground/{i}", arrays) for i in range(header["grounds"])]
            fields = ("N", "lower", "upper", "Y_lower", "Y_upper", "y")
            values = {name: _floats(arrays[f"archimedean/{name}"]) for name in fields}
            return cls(
                scene=scene,
                C=_floats(arrays["region/C"]),
                d=_floats(arrays["region/d"]),
                interior=_floats(arrays["region/interior"]),
                archimedean=Archimedean(values.pop("N").item(), **values),
                pairs=tuple(_pair(scene.hash, h, grounds, f"pair/{i}", arrays) for i, h in enumerate(header["pairs"])),
            )


def digest(data: bytes) -> str:
    """SHA-256 of a proof file."""
    return hashlib.sha256(data).hexdigest()


class _malformed:
    """Turns whatever a broken file makes the parser raise into a ProofError."""

    def __enter__(self) -> None:
        return None

    def __exit__(self, kind: Any, error: BaseException | None, trace: Any) -> None:
        if isinstance(error, (KeyError, IndexError, TypeError, ValueError, AttributeError, CirisError)) and not isinstance(
            error, ProofError
        ):
            raise ProofError("proof_malformed", f"the proof file is malformed: {type(error).__name__}: {error}") from error


def _ground_arrays(prefix: str, ground: Ground) -> dict[str, np.ndarray]:
    return {f"{prefix}/{name}": value for name, value in vars(ground).items()}


def _ground(prefix: str, arrays: dict[str, np.ndarray]) -> Ground:
    return Ground(*(_floats(arrays[f"{prefix}/{name}"]) for name in ("C", "d", "mid", "half", "Y_lower", "Y_upper")))


def _floats(array: np.ndarray) -> Array:
    if array.dtype != np.float64 or not np.isfinite(array).all():
        raise ProofError("proof_malformed", "a number in the proof file is not a finite double")
    return array


def _integers(array: np.ndarray) -> np.ndarray:
    if array.dtype.name not in BITS:
        raise ProofError("proof_malformed", f"a Gram factor in the proof file is of {array.dtype.name}")
    return array


def _pair(scene_hash: str, header: dict[str, Any], grounds: list[Ground], prefix: str, arrays: dict[str, np.ndarray]) -> PairProof:
    t, kappa = _floats(arrays[f"{prefix}/scalars"])
    faces = tuple(int(j) for j in header["faces"])
    chain_a, chain_b = (tuple(int(i) for i in chain) for chain in header["chains"])
    side_a, side_b = (
        Side(chain, _integers(arrays[f"{prefix}/mantissa{i}"]), _integers(arrays[f"{prefix}/exponent{i}"]))
        for i, chain in enumerate((chain_a, chain_b))
    )
    plane = _floats(arrays[f"{prefix}/plane"])
    names = (header["a"], header["b"], header["frame"])
    return PairProof(scene_hash, *names, grounds[header["ground"]], plane, float(t), float(kappa), faces, (side_a, side_b))


def _pack(header: dict[str, Any], arrays: dict[str, np.ndarray]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in [
            ("header.json", json.dumps(header, sort_keys=True).encode()),
            *((f"{n}.npy", _npy(a)) for n, a in arrays.items()),
        ]:
            archive.writestr(zipfile.ZipInfo(name, (2020, 1, 1, 0, 0, 0)), content, zipfile.ZIP_DEFLATED)
    return buffer.getvalue()


def _npy(array: np.ndarray) -> bytes:
    buffer = io.BytesIO()
    np.lib.format.write_array(buffer, np.ascontiguousarray(array), allow_pickle=False)
    return buffer.getvalue()


def _unpack(data: bytes, kind: str) -> tuple[dict[str, Any], dict[str, np.ndarray]]:
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            if sum(info.file_size for info in archive.infolist()) > MAX_BYTES:
                raise ProofError("proof_too_large", f"the proof file unpacks to more than {MAX_BYTES} bytes")
            header = json.loads(archive.read("header.json"))
            arrays = {
                name.removesuffix(".npy"): np.lib.format.read_array(io.BytesIO(archive.read(name)), allow_pickle=False)
                for name in archive.namelist()
                if name.endswith(".npy")
            }
    except (
        zipfile.BadZipFile,
        zipfile.LargeZipFile,
        KeyError,
        ValueError,
        EOFError,
        OSError,
        NotImplementedError,
        RuntimeError,
        zlib_error,
    ) as error:
        raise ProofError("proof_malformed", f"not a proof file: {error}") from error
    if not isinstance(header, dict) or header.get("format") != FORMAT or header.get("kind") != kind:
        raise ProofError("proof_malformed", f"not a {kind}'s proof of format {FORMAT}")
    return header, arrays
