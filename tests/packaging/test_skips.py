"""Where CI is set a skipped test fails the run, whoever skipped it, in one process and in several."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
PASSES = "def test_passes():\n    pass\n"
EXPECTED_TO_FAIL = "import pytest\n\n@pytest.mark.xfail\ndef test_fails():\n    assert False\n"
SKIPPED = {
    "test_in_body.py": "import pytest\n\ndef test():\n    pytest.skip('no moon')\n",
    "test_by_mark.py": "import pytest\n\n@pytest.mark.skipif(True, reason='no sun')\ndef test():\n    pass\n",
    "test_by_fixture.py": "import pytest\n\n@pytest.fixture\ndef sky():\n    pytest.skip('no sky')\n\ndef test(sky):\n    pass\n",
    "test_module.py": "import pytest\n\npytest.skip('no star', allow_module_level=True)\n",
}
TOLD = [
    "test_by_fixture.py::test: Skipped: no sky",
    "test_by_mark.py::test: Skipped: no sun",
    "test_in_body.py::test: Skipped: no moon",
    "test_module.py: Skipped: no star",
]
HEADING = "skipped, which fails a run where CI is set"
PROCESSES = pytest.mark.parametrize("processes", [[], ["-p", "xdist", "-n", "2"]], ids=["one process", "two workers"])


@pytest.fixture
def directory(tmp_path: Path) -> Path:
    (tmp_path / "test_passes.py").write_text(PASSES)
    (tmp_path / "test_fails.py").write_text(EXPECTED_TO_FAIL)
    return tmp_path


def run(directory: Path, ci: str, *options: str) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "pytest", "-p", "tests.skips", *options]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1", "CI": ci}
    return subprocess.run(command, cwd=directory, env=environment, capture_output=True, text=True, check=False)


def test_this_suite_is_held_to_it(request: pytest.FixtureRequest) -> None:
    assert request.config.pluginmanager.has_plugin("tests.skips")


@PROCESSES
def test_a_skipped_test_fails_the_run(directory: Path, processes: list[str]) -> None:
    for name, text in SKIPPED.items():
        (directory / name).write_text(text)
    done = run(directory, "true", *processes)
    assert done.returncode == pytest.ExitCode.TESTS_FAILED
    told = done.stdout.partition(HEADING)[2].splitlines()
    assert sorted(line for line in told if "Skipped" in line) == TOLD


@pytest.mark.parametrize("name", SKIPPED)
def test_one_is_enough(directory: Path, name: str) -> None:
    (directory / name).write_text(SKIPPED[name])
    assert run(directory, "true").returncode == pytest.ExitCode.TESTS_FAILED


@PROCESSES
def test_a_developer_may_skip(directory: Path, processes: list[str]) -> None:
    for name, text in SKIPPED.items():
        (directory / name).write_text(text)
    done = run(directory, "", *processes)
    assert done.returncode == pytest.ExitCode.OK
    assert HEADING not in done.stdout


@PROCESSES
def test_a_run_without_a_skipped_test_passes(directory: Path, processes: list[str]) -> None:
    done = run(directory, "true", *processes)
    assert done.returncode == pytest.ExitCode.OK
    assert HEADING not in done.stdout
