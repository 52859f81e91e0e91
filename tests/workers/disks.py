"""Disks for tests: one that is small and can be filled, one that breaks and becomes read-only, one that is slow. They need root."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

THROTTLE = Path("/sys/fs/cgroup/blkio/blkio.throttle.write_bps_device")


class Small:
    """A file system in memory of a fixed size."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self._filler = directory / "filler"

    def fill(self) -> None:
        """Leaves no room at all."""
        with self._filler.open("ab", buffering=0) as filler, suppress(OSError):
            while True:
                filler.write(bytes(2**16))

    def clear(self) -> None:
        self._filler.unlink(missing_ok=True)

    @property
    def free_bytes(self) -> int:
        found = os.statvfs(self.directory)
        return found.f_bavail * found.f_frsize


@contextmanager
def small(directory: Path, mebibytes: int) -> Iterator[Small]:
    """A disk of this size at a directory."""
    with _mounted(directory, "-t", "tmpfs", "-o", f"size={mebibytes}m", "ciris-test"):
        yield Small(directory)


class Image:
    """An ext4 in a file, mounted through a loop device."""

    def __init__(self, file: Path, directory: Path) -> None:
        self._file, self.directory = file, directory
        with file.open("wb") as image:
            image.truncate(256 * 2**20)
        run("mkfs.ext4", "-q", "-F", str(file))

    @contextmanager
    def mounted(self) -> Iterator[None]:
        run("e2fsck", "-p", str(self._file), accepted=(0, 1))
        with _mounted(self.directory, "-o", "loop,errors=remount-ro", str(self._file)):
            yield

    def break_it(self) -> None:
        """Makes the kernel find an error, after which it writes nothing to this file system any more."""
        (Path("/sys/fs/ext4") / Path(self._device()).name / "trigger_fs_error").write_text("1")

    @contextmanager
    def slow(self, bytes_a_second: int) -> Iterator[None]:
        """Lets the disk write no more than this many bytes a second."""
        device = os.stat(self._device()).st_rdev
        name = f"{os.major(device)}:{os.minor(device)}"
        THROTTLE.write_text(f"{name} {bytes_a_second}")
        try:
            yield
        finally:
            THROTTLE.write_text(f"{name} 0")

    def _device(self) -> str:
        return run("findmnt", "-no", "SOURCE", str(self.directory)).strip()


@contextmanager
def _mounted(directory: Path, *what: str) -> Iterator[None]:
    directory.mkdir(exist_ok=True)
    run("mount", *what, str(directory))
    try:
        yield
    finally:
        run("umount", "--lazy", str(directory))


def run(*command: str, accepted: tuple[int, ...] = (0,)) -> str:
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode not in accepted:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr}")
    return done.stdout
