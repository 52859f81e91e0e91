"""What Numba has compiled of sources that have changed since does not run."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

CALLER = "from numba import njit\nfrom certifier.called import f\n@njit(cache=True)\ndef g():\n    return f()\n"
CALLED = "from numba import njit\n@njit(cache=True)\ndef f():\n    return {}\n"
COMPILED = Path(__file__).parents[2] / "certifier/compiled.py"


@pytest.mark.parametrize("elsewhere", [False, True], ids=["beside the sources", "in NUMBA_CACHE_DIR"])
def test_a_function_is_compiled_again_when_one_that_it_calls_has_changed(tmp_path: Path, elsewhere: bool) -> None:
    package = tmp_path / "certifier"
    package.mkdir()
    environment = {"PATH": os.environ["PATH"], **({"NUMBA_CACHE_DIR": str(tmp_path / "cache")} if elsewhere else {})}

    def python(*arguments: str) -> str:
        done = subprocess.run([sys.executable, *arguments], cwd=tmp_path, env=environment, check=True, capture_output=True, text=True)
        return done.stdout.strip()

    def found() -> str:
        return python("-c", "from certifier.caller import g; print(g())")

    (package / "compiled.py").write_text(COMPILED.read_text())
    (package / "caller.py").write_text(CALLER)
    (package / "called.py").write_text(CALLED.format(1))
    python("-m", "certifier.compiled")
    assert found() == "1"
    assert list(tmp_path.rglob("caller.g-*.nbc"))
    python("-m", "certifier.compiled")
    assert list(tmp_path.rglob("caller.g-*.nbc")), "nothing has changed"
    (package / "called.py").write_text(CALLED.format(2))
    assert found() == "1", "Numba looks at the function's own file"
    python("-m", "certifier.compiled")
    assert not list(tmp_path.rglob("*.nb[ic]"))
    assert found() == "2"


def test_a_function_that_is_compiled_says_so_and_one_that_is_loaded_does_not(tmp_path: Path) -> None:
    (tmp_path / "called.py").write_text(CALLED.format(1))
    code = "from certifier.compiled import compiling; from called import f\nwith compiling(lambda: print('compiles')): print(f())"
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": f"{tmp_path}:{COMPILED.parents[1]}"}
    said = [subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True).stdout for _ in "12"]
    assert said == ["compiles\n1\n", "1\n"]
