"""The metrics: Prometheus' format, and figures that are those of the database and the queue."""

from __future__ import annotations

import re
from datetime import timedelta
from pathlib import Path

from fastapi.testclient import TestClient

from api.metrics import BUCKETS, Requests, render
from certifier.model import Scene
from db import jobs, steps, work
from db.models import IterationRow
from db.session import Database
from db.statistics import collect
from db.types import utcnow
from tests.api.test_jobs import GROW
from tests.db.builders import a_job, a_running_job
from tests.workers.service import eventually

SAMPLE = re.compile(r'([a-z_]+)(?:\{((?:[a-z]+="[^"\\]*",?)*)\})? (-?[0-9.e+-]+)')


def samples(text: str) -> dict[str, float]:
    """Every sample by its name and labels; each family is announced before its samples."""
    found: dict[str, float] = {}
    announced: set[str] = set()
    for line in text.splitlines():
        if line.startswith("# "):
            announced.add(line.split()[2])
            continue
        match = SAMPLE.fullmatch(line)
        assert match, line
        assert match[1] in announced or re.sub("_(bucket|sum|count)$", "", match[1]) in announced
        assert line.rpartition(" ")[0] not in found, "twice"
        found[line.rpartition(" ")[0]] = float(match[3])
    return found


def counted(client: TestClient) -> dict[str, float]:
    """The samples with those of the database. On a busy machine, they are without these until these are counted."""

    def look() -> dict[str, float] | None:
        found = samples(client.get("/metrics").text)
        return found if "ciris_regions" in found else None

    return eventually(look, "the database is counted", 30)


def test_the_figures_are_those_of_the_database(client: TestClient, region: str) -> None:
    client.post("/v1/jobs", json=GROW)
    assert client.get("/metrics").headers["content-type"].startswith("text/plain; version=0.0.4")
    found = counted(client)
    assert found['ciris_jobs{state="queued"}'] == 1
    assert found['ciris_jobs{state="succeeded"}'] == 1
    assert found['ciris_jobs{state="failed"}'] == 0
    assert found['ciris_pairs{state="certified"}'] == 2
    assert found['ciris_pair_seconds{state="certified"}'] == 0.2
    assert found["ciris_regions"] == 1
    assert found['ciris_queue_messages{queue="control"}'] == 1
    assert found["ciris_decisions_due"] == 1
    assert found['ciris_http_requests_total{method="POST",status="201"}'] == 1


def test_an_empty_service_has_figures_too(client: TestClient) -> None:
    found = counted(client)
    assert found['ciris_pairs{state="refuted"}'] == 0
    assert found["ciris_regions"] == 0


def test_both_databases_count_alike(db: Database) -> None:
    with db.read() as session:
        statistics = collect(session)
    assert set(statistics.jobs.values()) == {0}
    assert samples(render((0.0, statistics), {}, Requests(), {}, {}))['ciris_step_seconds{kind="accept"}'] == 0


def test_processes_on_one_port_count_together_and_go_on_when_they_are_started_again(tmp_path: Path) -> None:
    first, second = (Requests(tmp_path / "requests" / name) for name in ("api", "api-2"))
    first.note("GET", 200, 0.5)
    for _ in range(2):
        second.note("GET", 200, 0.25)
    second.note("POST", 503, 0.1)
    everything = {("GET", 200): (3, 1.0), ("POST", 503): (1, 0.1)}
    assert first.totals() == second.totals() == everything
    again = Requests(tmp_path / "requests" / "api")
    again.note("GET", 200, 1.0)
    assert second.totals() == everything | {("GET", 200): (4, 2.0)}
    assert Requests().totals() == {}


def test_invented_methods_make_no_new_series(client: TestClient, scene: Scene) -> None:
    for number in range(5):
        client.request(f"METHOD{number}", "/v1/jobs")
    found = counted(client)
    assert found['ciris_http_requests_total{method="other",status="405"}'] == 5
    assert not any("METHOD" in name for name in found)


def test_the_file_of_the_counts_has_its_place_on_the_disk(tmp_path: Path) -> None:
    """A file with holes, as earlier versions left it, would end its process on a full disk."""
    file = tmp_path / "requests" / "api"
    Requests(file).note("GET", 200, 0.5)
    whole = file.stat().st_size
    assert file.stat().st_blocks * 512 >= whole
    file.unlink()
    with file.open("wb") as holes:
        holes.truncate(whole)
    assert file.stat().st_blocks * 512 < whole
    Requests(file).note("GET", 200, 0.5)
    assert file.stat().st_blocks * 512 >= whole
    assert Requests(file).totals() == {("GET", 200): (1, 0.5)}


def test_requests_are_counted_where_their_file_cannot_be_made(tmp_path: Path) -> None:
    (tmp_path / "requests").write_text("no directory")
    requests = Requests(tmp_path / "requests" / "api")
    requests.note("GET", 200, 0.5)
    assert requests.totals() == {("GET", 200): (1, 0.5)}


def test_latencies_are_counted_in_buckets_and_streams_are_not(tmp_path: Path) -> None:
    first, second = (Requests(tmp_path / "requests" / name) for name in ("api", "api-2"))
    for seconds in (0.001, 0.005, 0.3, 100.0):
        first.note("GET", 200, seconds)
    second.note("GET", 200, 0.02)
    second.note("GET", 200, 500.0, stream=True)
    counts, total = second.latencies()["GET"]
    assert dict(zip((*BUCKETS, "+Inf"), counts, strict=True)) | {0.005: 2, 0.025: 3, 0.25: 3, 0.5: 4, 30.0: 4, "+Inf": 5} == dict(
        zip((*BUCKETS, "+Inf"), counts, strict=True)
    )
    assert abs(total - 100.326) < 1e-9
    assert "POST" not in first.latencies()
    again = Requests(tmp_path / "requests" / "api")
    assert again.latencies() == second.latencies()


def test_jobs_that_wait_for_a_solver_are_counted(db: Database) -> None:
    """Those with pairs, and those with a step, which no iteration has begun for."""
    with db.write() as session:
        begun, seeding, _new = a_running_job(session, pair_count=1), a_job(session), a_job(session)
        jobs.start(session, seeding)
        steps.add(session, seeding, "propose", {})

    def waiting() -> float:
        with db.read() as session:
            return samples(render((0.0, collect(session)), {}, Requests(), {}, {}))["ciris_jobs_without_solver"]

    assert waiting() == 2
    with db.write() as session:
        work.claim(session, begun.id, lease_seconds=60, batch_seconds=0.5)
    assert waiting() == 1
    with db.write() as session:
        work.claim(session, seeding.id, lease_seconds=60, batch_seconds=0.5)
    assert waiting() == 0


def test_the_age_of_what_waits_is_told(db: Database) -> None:
    with db.write() as session:
        job = a_running_job(session, pair_count=3)
        session.get_one(IterationRow, (job.id, 0)).started_at = utcnow() - timedelta(seconds=90)
        a_running_job(session, pair_count=2)
    with db.read() as session:
        found = samples(render((0.0, collect(session)), {}, Requests(), {}, {}))
    assert [found[f'ciris_open_pieces{{seconds="{age}"}}'] for age in (0, 60, 600)] == [5, 3, 0]
    assert 90 <= found["ciris_oldest_open_piece_seconds"] < 120
