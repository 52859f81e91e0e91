"""What each room may import from outside: import-linter holds the rooms apart, this holds them to their third parties."""

import os
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

from tests.certifier.proofs import files
from tests.rooms import ROOMS

ROOT = Path(__file__).parents[2]
THIRD_PARTIES = {
    "certifier": {"cachetools", "cattrs", "coacd", "flint", "numba", "numpy", "pydrake", "scipy", "xacro", "yaml"},
    "certifier.verify": {"flint", "numpy"},
    "db": {"alembic", "cryptography", "numpy", "opentelemetry", "pydantic", "pydantic_settings", "sqlalchemy", "structlog"},
    "jobs": {"cachetools", "numpy", "pydantic", "pydantic_core", "sqlalchemy"},
    "planner": {"flint", "numba", "numpy", "ompl", "pydrake", "scipy"},
    "ciris": {"httpx2", "numba", "numpy"},
    "client": {"flint", "httpx2", "numpy", "pydrake", "yaml"},
    "dashboard": set(),
}


@pytest.fixture(scope="module")
def graph() -> grimp.ImportGraph:
    return grimp.build_graph(*ROOMS, include_external_packages=True, cache_dir=None)


@pytest.mark.parametrize("room", THIRD_PARTIES)
def test_a_room_imports_only_its_third_parties(graph: grimp.ImportGraph, room: str) -> None:
    modules = {room} | graph.find_descendants(room)
    imported = {name for module in modules for name in graph.find_modules_directly_imported_by(module)}
    outside = {name for name in imported if name.partition(".")[0] not in {*ROOMS, *sys.stdlib_module_names}}
    assert outside <= THIRD_PARTIES[room]


def test_importing_modules_has_no_side_effects(graph: grimp.ImportGraph, tmp_path: Path) -> None:
    """No output, no file, no thread, whatever is imported."""
    ours = {module for room in ROOMS for module in {room} | graph.find_descendants(room)}
    scripts = {module for module in ours if module.endswith(".__main__") or module.startswith("db.migrations")}
    script = f"""
import importlib, threading
for name in {sorted(ours - scripts)}:
    importlib.import_module(name)
assert threading.active_count() == 1
"""
    environment = {"HOME": str(tmp_path), "PYTHONPATH": str(ROOT), "PYTHONDONTWRITEBYTECODE": "1"}
    done = subprocess.run([sys.executable, "-c", script], env=environment, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr) == (0, "", "")
    assert list(tmp_path.iterdir()) == []


VERIFY_ONLY = """
import sys

class Absent:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] not in {"certifier", "ciris", "client", "flint", "numpy", "planner", *sys.stdlib_module_names}:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Absent())
"""


@pytest.fixture
def bare(tmp_path: Path) -> dict[str, str]:
    """The surroundings of processes that find nothing but what `pip install '.[verify]'` installs; their children's are the same."""
    (tmp_path / "sitecustomize.py").write_text(VERIFY_ONLY)
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), str(ROOT)])}


def ciris(bare: dict[str, str], *arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "client.cli", *map(str, arguments)]
    return subprocess.run(command, cwd=ROOT, env=bare, capture_output=True, text=True, check=False)


@pytest.mark.slow
def test_every_proof_is_checked_where_only_numpy_and_flint_are_installed(tmp_path: Path, bare: dict[str, str]) -> None:
    words = {
        "region": "6 pairs of bodies separated",
        "pair": "are at least",
        "dual": "no certificate of this form",
        "motion": "all along it the padded bodies",
        "witness": "touch at a configuration",
    }
    for kind, data in files().items():
        path = tmp_path / f"{kind}.proof"
        path.write_bytes(data)
        done = ciris(bare, "verify", path)
        assert (done.returncode, done.stderr) == (0, "")
        assert words[kind] in done.stdout
        assert "padding" in done.stdout
        assert f"guarantee: {'numeric' if kind == 'witness' else 'exact'}" in done.stdout
        path.write_bytes(data[:-30])
        done = ciris(bare, "verify", path)
        assert (done.returncode, done.stdout) == (1, "")
        assert "the proof does not hold" in done.stderr


def test_another_command_says_what_is_missing(bare: dict[str, str]) -> None:
    done = ciris(bare, "scene", "ls")
    assert (done.returncode, done.stdout) == (2, "")
    assert "httpx2" in done.stderr
    assert "pip install" in done.stderr
