"""A wheel, which is what the image installs, carries everything the packages need."""

import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

from tests.rooms import ROOMS

ROOT = Path(__file__).parents[2]
WORKSHOP = ["node_modules", "source", "build.mjs", "*.json", ".npmrc"]
"""What the dashboard's scripts are built from and with; a wheel has them built."""


def test_a_wheel_contains_every_file_of_the_packages(tmp_path: Path) -> None:
    source = tmp_path / "source"
    for room in ROOMS:
        shutil.copytree(ROOT / room, source / room, ignore=shutil.ignore_patterns("__pycache__", *WORKSHOP))
    for name in ("pyproject.toml", "README.md"):
        shutil.copy(ROOT / name, source / name)
    expected = {str(path.relative_to(source)) for room in ROOMS for path in (source / room).rglob("*") if path.is_file()}
    command = [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "--wheel-dir", tmp_path, source]
    subprocess.run(command, check=True, capture_output=True)
    (wheel,) = tmp_path.glob("*.whl")
    with zipfile.ZipFile(wheel) as archive:
        contained = set(archive.namelist())
    assert expected <= contained
    assert {name.partition("/")[0] for name in contained if ".dist-info/" not in name} == {*ROOMS}
