"""Files that commands write on this machine."""

from __future__ import annotations

import hashlib
import os
import re
import tempfile
from pathlib import Path

from certifier.errors import CirisError


class ProofFile:
    """A proof file holds the proof of a job's best region so far.

    Args:
        out: the file; None for one in this directory whose name holds the proof's digest, so that the same proof gives the same file.

    Attributes:
        path: where the proof is; None before there is one.
    """

    def __init__(self, out: str | None) -> None:
        self._out = out
        self.path: Path | None = None

    def write(self, scene: str, proof: bytes) -> Path:
        """Puts the proof of a region of the scene with this name in the place of the one before, if any, and returns its path.

        After an interruption, one of the two is there as a whole.
        """
        path = Path(self._out or f"{file_name(scene)}-{hashlib.sha256(proof).hexdigest()[:8]}.proof")
        if path.exists() and not path.is_file():
            path.write_bytes(proof)  # a pipe, or a device: nothing can take its place
            return path
        beside = path.with_name(f".{path.name}.{os.getpid()}")
        try:
            beside.write_bytes(proof)
            beside.replace(path)
        finally:
            beside.unlink(missing_ok=True)
        if self.path is not None and self.path != path:
            self.path.unlink(missing_ok=True)
        self.path = path
        return path


def check_writable(out: str | None) -> None:
    """Refuses, before a job takes minutes, a file that cannot be written, or that would be overwritten.

    Raises:
        CirisError: not_writable, file_exists.
    """
    path = Path(out or ".")
    directory = path.parent if out else path
    if path.is_dir() and out:
        raise CirisError("not_writable", f"{out} is a directory", field="--out", hint="name a file")
    if path.is_file():
        raise CirisError("file_exists", f"{out} is there already", field="--out", hint="move it away, or name another file")
    if not directory.is_dir():
        raise CirisError("not_writable", f"there is no directory {directory.absolute()}", field="--out", hint="make it, or name another")
    try:
        with tempfile.TemporaryFile(dir=directory):
            pass
    except OSError:
        message = f"nothing can be written into {directory.absolute()}"
        raise CirisError("not_writable", message, field="--out", hint="name a file elsewhere") from None


def file_name(name: str) -> str:
    """Returns a scene's name as part of a file's name: a name may hold slashes and dots, which must not lead elsewhere."""
    return re.sub(r"[^A-Za-z0-9_-]+", "-", name).strip("-") or "scene"
