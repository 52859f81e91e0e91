"""The lock files: complete, hashed, in step with pyproject.toml, and silent about where packages come from."""

import re
import subprocess
import sys
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text())
LOCKS = {name: (ROOT / "requirements" / f"{name}.lock").read_text() for name in ("runtime", "test", "slow", "docs")}
BROWSER = (ROOT / "requirements/browser.lock").read_text()


def pins(lock: str) -> dict[str, Requirement]:
    lines = [line.removesuffix("\\").strip() for line in lock.splitlines() if re.match(r"\w", line)]
    requirements = [Requirement(line) for line in lines]
    return {canonicalize_name(requirement.name): requirement for requirement in requirements}


def direct(extra: str) -> list[Requirement]:
    """Everything an extra asks for, other extras of this project resolved."""
    found = []
    for requirement in map(Requirement, PROJECT["project"]["optional-dependencies"][extra]):
        if requirement.name == PROJECT["project"]["name"]:
            found += [other for name in requirement.extras for other in direct(name)]
        else:
            found.append(requirement)
    return found


@pytest.mark.parametrize("lock", [*LOCKS.values(), BROWSER], ids=[*LOCKS, "browser"])
def test_a_lock_names_no_address(lock: str) -> None:
    assert "://" not in lock
    assert not re.search(r"^\s*(-i|-f|--[a-z-]*(url|links|host))\b", lock, re.MULTILINE)
    assert " @ " not in lock


@pytest.mark.parametrize("lock", LOCKS.values(), ids=LOCKS)
def test_every_pin_is_exact_and_hashed(lock: str) -> None:
    blocks = re.split(r"\n(?=\w)", lock.strip())
    assert len(blocks) == len(pins(lock)), "a package is pinned twice"
    for block in blocks:
        assert re.match(r"[\w.-]+==[\w.]+ ", block), block
        assert "--hash=sha256:" in block, block


def test_every_package_of_the_browser_is_exact_and_hashed() -> None:
    packages = [line for line in BROWSER.splitlines() if not line.startswith("#")]
    assert packages
    for package in packages:
        assert re.fullmatch(r"(@[\w-]+/)?[\w-]+@\d+\.\d+\.\d+ sha512-[\w+/]{86}==", package), package


@pytest.mark.parametrize(("name", "extra"), [("runtime", "service"), ("test", "test"), ("slow", "slow"), ("docs", "docs")])
def test_a_lock_satisfies_what_the_project_asks_for(name: str, extra: str) -> None:
    locked = pins(LOCKS[name])
    for requirement in [*direct(extra), *map(Requirement, PROJECT["dependency-groups"]["build"])]:
        (pin,) = locked[canonicalize_name(requirement.name)].specifier
        assert requirement.specifier.contains(pin.version), requirement


@pytest.mark.parametrize("other", ["test", "docs"])
def test_the_other_locks_contain_the_runtime_lock(other: str) -> None:
    runtime, more = pins(LOCKS["runtime"]), pins(LOCKS[other])
    assert {name: more[name].specifier for name in runtime} == {name: pin.specifier for name, pin in runtime.items()}


@pytest.mark.parametrize("name", ["slow", "docs"])
def test_packages_of_several_locks_have_one_version(name: str) -> None:
    test, other = pins(LOCKS["test"]), pins(LOCKS[name])
    assert {each: other[each].specifier for each in other if each in test} == {each: test[each].specifier for each in test if each in other}


def test_what_is_installed_is_what_is_locked() -> None:
    for pin in pins(LOCKS["test"]).values():
        if pin.marker is None or pin.marker.evaluate():
            assert pin.specifier.contains(metadata.version(pin.name)), pin
    check = subprocess.run([sys.executable, "-m", "pip", "check"], capture_output=True, text=True, check=False)
    assert check.returncode == 0, check.stdout


def test_checking_a_proof_needs_numpy_and_flint_only() -> None:
    assert {requirement.name for requirement in direct("verify")} == {"numpy", "python-flint"}
