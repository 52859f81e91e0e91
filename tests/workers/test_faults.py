"""What can go wrong with workers, messages and input, on real worker processes."""

from __future__ import annotations

import time

import numpy as np
import pytest

from certifier.model import Scene
from tests.services import Queue
from tests.workers.options import box_around
from tests.workers.service import Service, ended, events_of, eventually, job_of, kill_holder, pairs_of, submit
from workers.app import send_coordinate, send_work

pytestmark = [pytest.mark.usefixtures("service"), pytest.mark.parametrize("service", ["sqlite"], indirect=True)]


@pytest.mark.slow
def test_a_seed_in_collision_fails_the_job_and_says_which_pair(planar: Scene) -> None:
    job = ended(submit(planar, {"kind": "grow", "seed": {"q": [0.74, 0.0]}}))
    assert job.state == "failed"
    assert job.error is not None
    assert job.error["code"] == "seed_in_collision"


@pytest.mark.slow
def test_points_that_no_region_can_hold_together_fail_the_job_at_once(planar: Scene) -> None:
    job = ended(submit(planar, {"kind": "grow", "seed": {"q": [0.0, 0.0], "contain": [[1.6, 0.9]]}}))
    assert job.error is not None
    assert (job.state, job.error["code"], job.error["field"]) == ("failed", "contain_blocked", "seed.contain[0]")


@pytest.mark.slow
def test_a_pair_that_kills_its_process_every_time_ends_as_an_error(arm: tuple[Scene, np.ndarray]) -> None:
    scene, s = arm
    job_id = submit(scene, box_around(s, 0.01))
    for attempt in (1, 2, 3):
        kill_holder(job_id, index=2, attempt=attempt)
    job = ended(job_id)
    assert (job.state, job.outcome) == ("failed", "error")
    assert "its process died 3 times" in (job.error or {})["message"]
    assert [row.state for row in pairs_of(job_id)] == ["certified", "certified", "error", "certified"]


def test_messages_that_come_again_change_nothing(planar: Scene) -> None:
    job_id = submit(planar, box_around([0.0, 0.0], 0.05))
    for state in ("open", "running", "certified"):
        eventually(lambda state=state: any(row.state in (state, "certified") for row in pairs_of(job_id)), f"a pair is {state}")
        send_all_again(job_id)
    ended(job_id)
    before = len(events_of(job_id))
    send_all_again(job_id)
    last = ended(submit(planar, box_around([0.0, 0.0], 0.01)))
    assert (job_of(job_id).outcome, last.outcome) == ("certified", "certified")
    assert len(events_of(job_id)) == before
    assert all(row.attempts == 1 for row in pairs_of(job_id))


def send_all_again(job_id: str) -> None:
    for _ in range(5):
        send_coordinate(job_id)
    send_work(10)


def test_a_job_survives_the_death_of_both_workers(arm: tuple[Scene, np.ndarray], service: Service) -> None:
    scene, s = arm
    job_id = submit(scene, box_around(s, 0.012))
    eventually(lambda: any(row.state == "running" for row in pairs_of(job_id)), "a pair is running")
    for queue in ("solve", "control"):
        service.kill(queue)
        service.start(queue)
    assert ended(job_id).outcome == "certified"


def test_a_job_survives_the_loss_of_every_message(arm: tuple[Scene, np.ndarray], queue: Queue) -> None:
    scene, s = arm
    job_id = submit(scene, box_around(s, 0.013))
    eventually(lambda: any(row.state == "running" for row in pairs_of(job_id)), "a pair is running")
    queue.flush()
    assert ended(job_id).outcome == "certified"


def test_jobs_survive_an_outage_of_redis_in_which_every_process_ends_its_work(arm: tuple[Scene, np.ndarray], queue: Queue) -> None:
    scene, s = arm
    job_ids = [submit(scene, box_around(s, radius)) for radius in np.linspace(0.014, 0.0145, 6)]

    def working() -> set[str | None]:
        return {row.worker for job_id in job_ids for row in pairs_of(job_id) if row.state == "running"}

    eventually(lambda: len(working()) == 2, "both processes work")
    queue.stop()
    eventually(lambda: not working(), "they have done what they had begun")
    time.sleep(1)  # and nobody takes their acknowledgements
    queue.start()
    assert [ended(job_id).outcome for job_id in job_ids] == ["certified"] * 6
