"""The whole path as a user walks it: ``ciris up``, a scene, a certified polytope, a grown region, its proof, a question, Ctrl-C."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.client.conftest import PLANAR, Done, command, surroundings


class Machine:
    """A directory with a running stack, and commands that find it there."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.environment = surroundings(CIRIS_DATA_DIR=str(directory / "data"), CIRIS_SOLVE_PROCESSES="1")

    def up(self) -> subprocess.Popen[str]:
        return subprocess.Popen(
            command("up", "--port", "0"),
            cwd=self.directory,
            env=self.environment,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )

    def ciris(self, *arguments: object) -> Done:
        done = subprocess.run(command(*arguments), cwd=self.directory, env=self.environment, capture_output=True, timeout=200, check=False)
        return Done(done.returncode, done.stdout, done.stderr.decode())


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    machine = Machine(tmp_path_factory.mktemp("machine"))
    stack = machine.up()
    assert stack.stdout is not None
    assert "ciris is up at http://127.0.0.1:" in stack.stdout.readline()
    yield machine
    stack.send_signal(signal.SIGINT)
    stack.communicate(timeout=30)
    assert stack.returncode == 0
    assert not (machine.directory / "data" / "stack.json").exists()


def test_a_polytope_is_certified_and_answers_questions(machine: Machine) -> None:
    eye = np.eye(2)
    np.savez(machine.directory / "p.npz", C=np.concatenate([eye, -eye]), d=np.full(4, 0.05))
    done = machine.ciris("certify", PLANAR, "--polytope", "p.npz", "--json")
    assert done.status == 0, done.stderr
    assert (done.json["outcome"], done.json["guarantee"]) == ("certified", "exact")
    assert [pair["outcome"] for pair in done.json["pairs"]] == ["certified"] * 6
    assert machine.ciris("contains", "planar-2dof", "--q", "0.01,-0.01").status == 0
    assert machine.ciris("contains", "planar-2dof", "--q", "1,1").status == 1


def test_a_region_is_grown_and_its_proof_holds_offline(machine: Machine) -> None:
    done = machine.ciris(
        "grow", PLANAR, "--paper", "--method", "box", "--half-width", "0.001", "--pushes", "1", "--rounds", "0", "--json", "--watch"
    )
    assert done.status == 0, done.stderr
    manifest = done.json
    assert manifest["seconds"] > 0
    assert (manifest["guarantee"], len(manifest["pairs"])) == ("exact", 6)
    assert done.stderr.count("obstacles/body/post: certified") >= 2, "--watch tells of every pair"
    verified = machine.ciris("verify", manifest["proof"])
    assert verified.status == 0
    assert f"hash {manifest['scene']['hash']}" in verified.stdout


@pytest.mark.slow
def test_several_seeds_grow_at_once_and_each_says_what_became_of_it(machine: Machine) -> None:
    seeds = ("--q", "0.0,0.1", "--q", "-1.2,1.0", "--q", "0.05,-0.05", "--contain", "0.02,0.02")
    done = machine.ciris("grow", PLANAR, *seeds, "--paper", "--method", "box", "--half-width", "0.001", "--pushes", "1", "--rounds", "0")
    assert done.status == 1
    rows = done.stdout.splitlines()[-3:]
    assert ["none" in row for row in rows] == [False, True, False]
    assert "overlap" in rows[1]
    assert machine.ciris("contains", "planar-2dof", "--q", "0.02,0.02").status == 0
    for space in ("q", "s"):
        assert machine.ciris("path", "planar-2dof", "--q", "0.05,-0.05", "--q", "0,0.1", "--space", space).status == 0
        assert machine.ciris("path", "planar-2dof", "--q", "0,0.1", "--q", "-1.2,1.0", "--space", space).status == 1
    found = machine.ciris("graph", "planar-2dof", "--json").json
    assert (found["complete"], found["regions"] >= 2, len(found["edges"]) >= 1) == (True, True, True)
    assert machine.ciris("grow", PLANAR, *seeds, "--local").status == 2


def test_bad_input_fails_the_job_with_a_reason_and_nothing_else(machine: Machine) -> None:
    done = machine.ciris("grow", PLANAR, "--q", "-1.2,1.0")
    assert done.status == 2
    assert "arm/lower/bar and obstacles/body/post overlap" in done.stderr.splitlines()[-1]
    assert machine.ciris("doctor").status == 0
