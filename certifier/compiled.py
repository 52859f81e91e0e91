"""What Numba has compiled is forgotten here where it may be out of date: ``python -m certifier.compiled``. And who compiles can say so.

Numba compiles a function again when its own file has changed. What the function calls from other files is in its machine code as well, and
Numba does not look at these. So all is forgotten as soon as one of the files has changed.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from numba import config
from numba.core import event
from numba.core.caching import UserProvidedCacheLocator

ROOT = Path(__file__).parents[1]
PACKAGES = ("certifier", "ciris", "planner")
"""These have compiled functions."""
STAMP = "compiled.sha256"
"""This file, beside what is compiled, has the digest of the sources."""


def forget_stale(root: Path = ROOT) -> int:
    """Deletes what was compiled before one of the sources changed.

    Args:
        root: the directory of the packages.

    Returns:
        The number of files that were deleted.

    Raises:
        OSError: they cannot be deleted.
    """
    files = (path for package in PACKAGES for path in sorted((root / package).rglob("*.py")))
    sources = {path: data for path in files if b"njit" in (data := path.read_bytes())}
    digest = hashlib.sha256(b"".join(sources.values())).hexdigest()
    stamp = (Path(config.CACHE_DIR) if config.CACHE_DIR else root / PACKAGES[0] / "__pycache__") / STAMP
    if stamp.is_file() and stamp.read_text() == digest:
        return 0
    stale = [file for path in sources for file in _kept(path).glob(f"{path.stem}.*.nb[ic]")]
    for file in stale:
        file.unlink(missing_ok=True)
    stamp.parent.mkdir(parents=True, exist_ok=True)
    stamp.write_text(digest)
    return len(stale)


@contextmanager
def compiling(say: Callable[[], None]) -> Iterator[None]:
    """Calls ``say`` in the block whenever this process begins to compile a function, rather than to load it."""
    with event.install_listener("numba:compile", _Listener(say)):
        yield


class _Listener(event.Listener):
    def __init__(self, say: Callable[[], None]) -> None:
        self._say = say

    def on_start(self, event: event.Event) -> None:
        self._say()

    def on_end(self, event: event.Event) -> None:
        pass


def _kept(path: Path) -> Path:
    """Returns the directory in which Numba keeps what it compiles of a file."""
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR) / UserProvidedCacheLocator.get_suitable_cache_subpath(str(path))
    return path.parent / "__pycache__"


if __name__ == "__main__":
    forget_stale()
