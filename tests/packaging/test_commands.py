"""The shell around the project: the two commands, what they need and what they say when they cannot run."""

import os
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
SCRIPTS = ["start", "check", "requirements/install", "requirements/refresh", ".ci/run"]


def run(command: list[str], cwd: Path, path: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(command, cwd=cwd, env={"PATH": path, "HOME": str(cwd)}, capture_output=True, text=True, check=False)


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """The scripts and locks alone, with nothing installed."""
    (tmp_path / ".ci").mkdir()
    shutil.copytree(ROOT / "requirements", tmp_path / "requirements")
    for name in ("start", "check", ".ci/run", "pyproject.toml"):
        shutil.copy2(ROOT / name, tmp_path / name)
    return tmp_path


@pytest.fixture
def tools(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A directory for the PATH with what the scripts may take for granted, and no Python."""
    directory = tmp_path_factory.mktemp("bin")
    for name in ("bash", "cat", "cmp", "dirname", "env", "head", "rm"):
        (directory / name).symlink_to(shutil.which(name) or "")
    return directory


def fake_python(directory: Path, name: str, body: str) -> None:
    (directory / name).write_text(f"#!/usr/bin/env bash\n{body}\n")
    (directory / name).chmod(0o755)


def stamp(copy: Path, name: str) -> str:
    return f"{copy}\n{(copy / 'pyproject.toml').read_text()}{(copy / f'requirements/{name}.lock').read_text()}"


@pytest.mark.parametrize("script", SCRIPTS)
def test_a_script_is_executable_bash_without_errors(script: str) -> None:
    assert os.access(ROOT / script, os.X_OK)
    assert (ROOT / script).read_text().startswith("#!/usr/bin/env bash\n")
    assert subprocess.run(["bash", "-n", ROOT / script], check=False).returncode == 0


@pytest.mark.parametrize("command", ["./start", "./check", ".ci/run"])
def test_no_usable_python_is_one_clear_line(copy: Path, tools: Path, command: str) -> None:
    fake_python(tools, "python3.12", "echo 'pyenv: python3.12: command not found' >&2; exit 127")  # a shim that lies
    fake_python(tools, "python3", "exit 1")  # too old
    done = run([command], copy, str(tools))
    assert done.returncode != 0
    assert done.stdout == ""
    assert done.stderr.splitlines() == [
        "error: no Python 3.11, 3.12 or 3.13 with its venv module on the PATH (on Debian: apt-get install python3-venv)"
    ]
    assert not (copy / ".venv").exists()


def test_a_current_environment_is_left_alone(copy: Path, tools: Path) -> None:
    (copy / ".venv/bin").mkdir(parents=True)
    fake_python(copy / ".venv/bin", "python", '[ "$1" = -c ] || echo "$*"')
    for name in ("runtime", "test"):
        (copy / f".venv/{name}.stamp").write_text(stamp(copy, name))
    done = run(["./start", "--once"], copy, str(tools))
    assert (done.returncode, done.stdout, done.stderr) == (0, "-P -m certifier.compiled\n-P -m client.demo --once\n", "")


@pytest.mark.parametrize(("set_to", "seen"), [(None, "true"), ("", "true"), ("1", "1")])
def test_ci_is_told_to_the_tests(copy: Path, tools: Path, set_to: str | None, seen: str) -> None:
    (copy / ".venv/bin").mkdir(parents=True)
    for name in ("ruff", "mypy", "lint-imports"):
        fake_python(copy / ".venv/bin", name, "exit 0")
    fake_python(copy / ".venv/bin", "python", '[ "$1" = -c ] || echo "CI=$CI $*"')
    for name in ("runtime", "test"):
        (copy / f".venv/{name}.stamp").write_text(stamp(copy, name))
    environment = {"PATH": str(tools), "HOME": str(copy)} | ({} if set_to is None else {"CI": set_to})
    done = subprocess.run([".ci/run"], cwd=copy, env=environment, capture_output=True, text=True, check=False)
    assert f"CI={seen} requirements/browser.py .venv/browser\n" in done.stdout
    assert f"CI={seen} -m pytest " in done.stdout
    assert (done.returncode, done.stderr) == (0, "")


def test_a_changed_lock_is_installed_into_the_same_environment(copy: Path, tools: Path) -> None:
    (copy / ".venv/bin").mkdir(parents=True)
    fake_python(copy / ".venv/bin", "python", 'echo "$*" >>calls; [ "$*" != --version ] || echo Python 3.12.1')
    (copy / ".venv/runtime.stamp").write_text(f"{copy}\nan older lock")
    assert run(["requirements/install", "runtime"], copy, str(tools)).returncode == 0
    calls = (copy / "calls").read_text()
    assert "--require-hashes --requirement requirements/runtime.lock" in calls
    assert "--no-build-isolation --editable ." in calls
    assert run(["requirements/install", "runtime"], copy, str(tools)).returncode == 0
    assert (copy / "calls").read_text().count("-m pip") == 2


def test_slow_tests_get_their_packages_besides_those_of_the_others(copy: Path, tools: Path) -> None:
    (copy / ".venv/bin").mkdir(parents=True)
    fake_python(copy / ".venv/bin", "python", 'echo "$*" >>calls; [ "$*" != --version ] || echo Python 3.12.1')
    (copy / ".venv/runtime.stamp").write_text(stamp(copy, "runtime"))
    installed = [f"--require-hashes --requirement requirements/{name}.lock" for name in ("test", "slow")]
    for _ in range(2):
        run(["./check", "--slow"], copy, str(tools))
        calls = (copy / "calls").read_text().splitlines()
        assert [call.partition("--no-compile ")[2] for call in calls if "--require-hashes" in call] == installed
        assert calls[-1].startswith("-m pytest -m slow ")


def test_an_environment_that_was_moved_is_made_anew(copy: Path, tools: Path) -> None:
    (copy / ".venv/bin").mkdir(parents=True)
    fake_python(copy / ".venv/bin", "python", "exit 0")
    (copy / ".venv/runtime.stamp").write_text("/elsewhere\n")
    fake_python(tools, "python3.13", 'echo "$*" >>calls')
    run(["requirements/install", "runtime"], copy, str(tools))
    assert "-m venv .venv" in (copy / "calls").read_text()


def test_check_refuses_what_it_does_not_know() -> None:
    done = subprocess.run([ROOT / "check", "--fast"], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert done.stderr == "usage: ./check [--slow]\n"
