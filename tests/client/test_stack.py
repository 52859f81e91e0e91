"""The whole path as a user walks it: ``ciris up``, a scene, a certified polytope, a grown region, its proof, a question, Ctrl-C."""

from __future__ import annotations

import signal
import subprocess
from collections.abc import Iterator
from pathlib import Path

import httpx2
import numpy as np
import pytest

import ciris
from tests.client.conftest import PLANAR, Done, command, surroundings


class Machine:
    """A directory with a running stack, and commands that find it there."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory
        self.url = ""
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
    said = stack.stdout.readline()
    assert "ciris is up at http://127.0.0.1:" in said
    machine.url = said.split(" at ")[1].split()[0].rstrip(".,:")
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


def test_a_map_of_the_service_is_that_of_this_machine_and_answers_questions(machine: Machine) -> None:
    asked = ("map", PLANAR, "--coverage", "0.9", "--at", "0.2,-0.4", "--json")
    done, here = machine.ciris(*asked, "--out", "service.proof"), machine.ciris(*asked, "--local", "--out", "local.proof")
    assert done.status == 0, done.stderr
    assert (here.status, here.json["ended"]) == (0, "coverage")
    same = ("outcome", "coverage", "cells", "looked_at", "ended", "given_up", "at")
    assert [done.json[name] for name in same] == [here.json[name] for name in same]
    assert (machine.directory / "service.proof").read_bytes() == (machine.directory / "local.proof").read_bytes()
    assert machine.ciris("verify", "service.proof").status == 0
    job = done.json["job"]
    again = machine.ciris("job", "map", job[:8], "--out", "again.proof", "--free-set", "again.npz", "--json")
    assert (again.status, again.json["coverage"], again.json["proof"]) == (0, done.json["coverage"], "again.proof")
    assert (machine.directory / "again.proof").read_bytes() == (machine.directory / "local.proof").read_bytes()
    assert ciris.FreeSet.load(machine.directory / "again.npz").contains([0.2, -0.4])
    inside = machine.ciris("contains", "planar-2dof", "--q", "0.2,-0.4")
    assert (inside.status, inside.stdout) == (0, f"inside: 0.2, -0.4 in map of job {job}\n")
    path = machine.ciris("path", "planar-2dof", "--q", "0.2,-0.4", "--q", "0.201,-0.401")
    assert path.status == 0
    assert f"map of job {job}" in path.stdout
    with ciris.connect(machine.url) as service:
        found = service.map_of(job)
        assert found
        assert found.stored is not None
        assert (found.cells, found.stored.at[0].state) == (done.json["cells"], "proved")
        free = service.free_set(service.job(job))
        assert free.contains([0.2, -0.4])
        assert service.map_proof(job) == (machine.directory / "local.proof").read_bytes()
        assert service.contains("planar-2dof", [0.2, -0.4])[0].map
        early = service.map("planar-2dof", former=service.job(job), coverage=1.0, deadline=3)
        assert (bool(early), early.ended) == (False, "deadline")
    page = httpx2.get(f"{machine.url}/jobs/{job}").text
    for words in ("Configurations wanted first", f"/v1/jobs/{job}/map/free-set"):
        assert words in page
