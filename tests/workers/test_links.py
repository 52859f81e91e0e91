"""Two workers whose links to Redis and to the database are cut and restored: nothing is lost, and nothing done twice."""

from __future__ import annotations

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, suppress
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import redis
from sqlalchemy import select

from certifier.jobs.map import grow_map
from certifier.map.options import MapOptions
from certifier.model import Scene
from certifier.orphans import die_with_parent
from db import migrate, proofs
from db.models import StepRow
from db.session import database
from db.states import ACCEPT, StepState
from tests.services import free_port, postgres_server
from tests.workers import links
from tests.workers.links import DATABASE, REDIS, Machine
from tests.workers.options import box_around, grow_box
from tests.workers.record import check_record, region_of
from tests.workers.service import PATIENCE_SECONDS, Service, ended, environment, events_of, eventually, job_of, pairs_of, submit
from workers.processes import queue_server_command

pytestmark = pytest.mark.slow

LEASE_SECONDS = 6


@dataclass
class Site:
    """The servers, a control worker beside them, and two machines with a worker each."""

    first: Machine
    second: Machine


@pytest.fixture(scope="module")
def site(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Site]:
    directory = tmp_path_factory.mktemp("links")
    with ExitStack() as stack:
        permitted = links.namespaces_are_permitted()
        how = "network namespaces" if permitted else "TCP proxies: this process may not make network namespaces"
        ports = {REDIS: free_port(), DATABASE: free_port()}
        machines = stack.enter_context((links.namespaces if permitted else links.proxies)(2, ports))
        reachable = links.addresses(2) if permitted else []
        stack.enter_context(redis_server(directory, ports[REDIS], reachable))
        postgres = stack.enter_context(postgres_server(ports[DATABASE], reachable))
        url = postgres.new_database()
        migrate.upgrade(url)
        near = {"CIRIS_DATABASE_URL": url, "CIRIS_REDIS_URL": f"redis://127.0.0.1:{ports[REDIS]}/0"}
        stack.enter_context(environment(**near, CIRIS_LEASE_SECONDS=str(LEASE_SECONDS), CIRIS_SWEEP_SECONDS="0.5"))
        control = Service(directory)
        stack.callback(control.stop)
        control.start("control")
        for machine in machines:
            far = {
                "CIRIS_DATABASE_URL": url.replace(f"127.0.0.1:{postgres.port}", f"{machine.host_of[DATABASE]}:{machine.port_of[DATABASE]}"),
                "CIRIS_REDIS_URL": f"redis://{machine.host_of[REDIS]}:{machine.port_of[REDIS]}/0",
            }
            stack.enter_context(machine.worker(directory / f"{machine.name}.log", **far))
        print(f"links are cut in {how}")
        yield Site(machines[0], machines[1])


def redis_server(directory: Path, port: int, reachable: list[str]) -> ExitStack:
    """A queue server that the machines can reach."""
    command = [*queue_server_command(directory / "q", directory / "queue"), "--port", str(port), "--protected-mode", "no"]
    process = subprocess.Popen([*command, "--bind", "127.0.0.1", *reachable], stdout=subprocess.DEVNULL, preexec_fn=die_with_parent)
    stack = ExitStack()
    stack.callback(process.wait)
    stack.callback(process.kill)

    def answers() -> bool:
        with suppress(redis.RedisError):
            return bool(redis.Redis(port=port).ping())
        return False

    eventually(answers, "Redis answers")
    return stack


def work_of(job_id: str, machine: Machine) -> list[int]:
    """The pairs that a machine holds or has certified."""
    return [row.pair_index for row in pairs_of(job_id) if row.parent and int(row.parent.split(":")[1]) == machine.pid]


def holds_a_step(job_id: str, machine: Machine) -> bool:
    """Whether a machine works on a step of a job."""
    with database().read() as session:
        parents = session.scalars(select(StepRow.parent).where(StepRow.job_id == job_id, StepRow.state == StepState.RUNNING))
        return any(parent is not None and int(parent.split(":")[1]) == machine.pid for parent in parents)


def cut_again_and_again(job_id: str, machine: Machine, link: str, holds: Callable[[], bool]) -> None:
    """Cuts a link of a machine for a while whenever it works on a job, until the job ends."""
    cuts = 0
    while not job_of(job_id).finished_at:
        if not holds():
            time.sleep(0.01)
            continue
        machine.cut(link)
        time.sleep(2.0)
        machine.restore(link)
        cuts += 1
        time.sleep(1.0)
    assert cuts > 0
    print(f"{cuts} cuts")


def job(arm: tuple[Scene, np.ndarray], radius: float) -> str:
    scene, s = arm
    return submit(scene, box_around(s, radius))


def both_work(arm: tuple[Scene, np.ndarray], site: Site, radius: float) -> None:
    """Waits until jobs are done by both machines, undisturbed."""
    until = time.monotonic() + PATIENCE_SECONDS
    seen: set[str] = set()
    while len(seen) < 2:
        assert time.monotonic() < until, f"only {seen} work"
        job_id = job(arm, radius)
        assert ended(job_id).state == "succeeded"
        check_record(job_id)
        seen |= {machine.name for machine in (site.first, site.second) if work_of(job_id, machine)}
        radius *= 0.99


def check_certified(job_id: str) -> None:
    assert ended(job_id).outcome == "certified"
    check_record(job_id)
    region_of(job_id)


@pytest.mark.parametrize("seconds", [3.0, 30.0])
def test_the_link_to_redis_is_cut(arm: tuple[Scene, np.ndarray], site: Site, seconds: float) -> None:
    job_id = job(arm, 0.012)
    eventually(lambda: any(row.state == "running" for row in pairs_of(job_id)), "a pair is running")
    site.first.cut(REDIS)
    time.sleep(seconds)
    check_certified(job_id)
    site.first.restore(REDIS)
    both_work(arm, site, 0.011)


def test_both_links_to_redis_are_cut(arm: tuple[Scene, np.ndarray], site: Site) -> None:
    for machine in (site.first, site.second):
        machine.cut(REDIS)
    job_id = job(arm, 0.0125)
    time.sleep(5)
    for machine in (site.first, site.second):
        machine.restore(REDIS)
    check_certified(job_id)


@pytest.mark.parametrize("seconds", [3.0, 30.0])
def test_the_link_to_the_database_is_cut_while_pairs_are_held(arm: tuple[Scene, np.ndarray], site: Site, seconds: float) -> None:
    held: list[int] = []
    radius = 0.0135
    while not held:
        radius *= 0.99
        job_id = job(arm, radius)
        eventually(partial(work_of, job_id, site.first), "the first machine has claimed a pair", 20)
        site.first.cut(DATABASE)
        held = [row.pair_index for row in pairs_of(job_id) if row.state == "running" and row.pair_index in work_of(job_id, site.first)]
        if not held:
            site.first.restore(DATABASE)
            ended(job_id)
    time.sleep(seconds)
    if seconds > 3 * LEASE_SECONDS:
        check_certified(job_id)
        reasons = {event.data["reason"] for event in events_of(job_id) if event.kind == "lost"}
        assert reasons == {"its lease ran out"}
        assert not set(work_of(job_id, site.first)) & set(held)
    site.first.restore(DATABASE)
    check_certified(job_id)
    both_work(arm, site, 0.0105)


@pytest.mark.parametrize("link", [REDIS, DATABASE])
def test_a_region_of_cells_is_the_same_though_a_link_is_cut_again_and_again(planar: Scene, site: Site, link: str) -> None:
    options = grow_box(planar.to_s([0.4, 0.3]), 0.4, cells=600)
    undisturbed = submit(planar, options)
    assert ended(undisturbed).outcome == "certified"
    job_id = submit(planar, options)

    def holds() -> bool:
        return any(row.state == "running" and row.pair_index in work_of(job_id, site.first) for row in pairs_of(job_id))

    cut_again_and_again(job_id, site.first, link, holds)
    check_record(job_id)
    assert region_of(job_id) == region_of(undisturbed)


@pytest.mark.parametrize("link", [REDIS, DATABASE])
def test_a_map_is_the_same_though_a_link_is_cut_again_and_again(arm: tuple[Scene, np.ndarray], site: Site, link: str) -> None:
    scene, options = arm[0], MapOptions(coverage=0.84)
    job_id = submit(scene, {**asdict(options), "former": None}, kind="map")
    cut_again_and_again(job_id, site.first, link, partial(holds_a_step, job_id, site.first))
    assert job_of(job_id).state == "succeeded", job_of(job_id).reason
    with database().read() as session:
        digest = session.scalar(select(StepRow.proof_digest).where(StepRow.job_id == job_id, StepRow.kind == ACCEPT))
        assert digest is not None
        assert proofs.get(session, digest) == grow_map(scene, options.coverage).proof.to_bytes()
