"""The pages as HTML: they work offline, escape what users wrote, and say what the JSON says."""

from __future__ import annotations

import os
import re
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from fastapi.testclient import TestClient

import dashboard
from api.pages.job import progress
from api.pages.rendering import significant
from api.schemas.jobs import Iteration, PairCell, PairMatrix
from api.schemas.scenes import PairInfo
from certifier.jobs.region import Region
from certifier.model import Scene
from certifier.outcome import Outcome
from certifier.verify.decimals import at_least_mm
from db import jobs, leases, pairs, regions, scenes, steps, workers
from db.models import StepRow
from db.pairs import NewPair
from db.session import Database
from db.states import ACCEPT, IterationState, JobState, PairState, StepState, WorkerState
from db.workers import Made, WorkerKind
from tests.api.conftest import certified_polytope, store_region
from tests.api.test_planning import store_map
from tests.db.builders import add_iteration
from tests.db.builders import certified as certified_pair
from tests.scenes import slider

ROOT = Path(dashboard.__file__).parent


@pytest.fixture
def paths(client: TestClient, region: str) -> list[str]:
    job = client.get("/v1/jobs").json()["jobs"][0]
    return [
        "/",
        "/live",
        "/workers",
        "/workers/live",
        f"/jobs/{job['id']}",
        f"/jobs/{job['id']}/live",
        "/regions",
        f"/regions/{region}",
        f"/scenes/{job['scene']}",
        f"/compare/jobs?a={job['id']}&b={job['id']}",
        f"/compare/scenes?a={job['scene']}&b={job['scene']}",
    ]


def test_every_page_works_offline_and_under_a_strict_policy(client: TestClient, paths: list[str]) -> None:
    for path in [*paths, "/static/ciris.css", "/static/built/main.js", "/static/icon.svg"]:
        answer = client.get(path)
        assert answer.status_code == 200, path
        assert re.findall(r"(?:src|href|url)\s*[=(]\s*[\"']?(?:https?:)?//", answer.text) == [], path
        if not path.startswith("/static"):
            assert "default-src 'self'" in answer.headers["content-security-policy"]
            assert not re.search(r"<script>|\sstyle=|\son\w+=", answer.text), path


def test_the_pages_are_no_part_of_the_api(client: TestClient, paths: list[str]) -> None:
    assert all(path.startswith(("/v1/", "/healthz", "/readyz", "/metrics")) for path in client.get("/openapi.json").json()["paths"])


def motion_job(database: Database, scene: Scene, verdict: dict[str, object]) -> str:
    with database.write() as session:
        job, _ = jobs.create(session, kind="certify-path", scene_id=scene.hash[:16], options={"q": [[0.0], [0.1]]})
        jobs.start(session, job)
        steps.add(session, job, "motion", {})
        claim = steps.claim(session, job, accepts=False, lease_seconds=60)
        assert claim is not None
        steps.save(session, claim, StepState.DONE, verdict, 0.1)
        jobs.finish(session, job, JobState.SUCCEEDED, outcome=str(verdict["outcome"]), reason="as it is")
        return job.id


def test_the_page_of_a_motion_says_what_is_proved_and_what_is_not(client: TestClient, database: Database, scene: Scene) -> None:
    begun = {"piece": 0, "time": 0.25, "q": [0.0]}
    whole = {"outcome": "certified", "stop": None, "certified_to": begun, "proved_distance": 0.01, "clearance": 0.02, "tube": None}
    touching = {"a": "model/cart/ball", "b": "world/post0", "distance": 2e-9, "piece": 0, "time": 0.25, "q": [0.0]}
    said = {
        "all along the motion, the bodies of each covered pair stay apart": whole,
        "up to 25.0 % of piece 0": whole | {"outcome": "refuted", "stop": touching, "clearance": None},
        "Nothing is proved of this motion": whole | {"outcome": "refuted", "stop": touching, "certified_to": None, "proved_distance": None},
    }
    for words, verdict in said.items():
        text = client.get(f"/jobs/{motion_job(database, scene, verdict)}").text
        claim = claim_of(text)
        assert words in claim
        assert (f"at least {at_least_mm(0.02)}" in claim) == (verdict["clearance"] is not None and verdict["certified_to"] is not None)
        assert ("<dt>Pairs covered</dt><dd>2</dd>" in claim) == (verdict["certified_to"] is not None)
        text = client.get(f"/jobs/{motion_job(database, scene, verdict)}").text
        assert "As it is." in text, "a reason is a sentence"
        assert "growth curve" not in text, "a motion has none"


def test_the_claim_of_a_scene_names_its_map(client: TestClient, database: Database, scene: Scene, region: str) -> None:
    """What a map proves counts beside regions, and alone."""
    before = claim_of(client.get("/scenes/slider").text)
    assert "the certified region of this scene" in before
    job = store_map(database, scene, region)
    both = claim_of(client.get("/scenes/slider").text)
    assert f'in the certified region and the proved cells of the <a href="/jobs/{job}">latest map</a> of this scene' in both
    assert client.delete(f"/v1/regions/{region}").status_code == 204
    alone = claim_of(client.get("/scenes/slider").text)
    assert f'Proved:</span> in the proved cells of the <a href="/jobs/{job}">latest map</a> of this scene' in alone
    assert f"<dt>Pairs covered</dt><dd>{len(scene.pairs)}</dd>" in alone


def map_page(client: TestClient, database: Database, scene: Scene, **stored: object) -> str:
    """The page of a job whose map was stored with this report."""
    report = {"cells": 3, "uncovered_pairs": 0, "at": [], "paths": [], "proof": "ab" * 32, "proof_bytes": 1, "free_set": True} | stored
    with database.write() as session:
        row = scenes.add(session, scene)
        job, _ = jobs.create(session, kind="map", scene_id=row.id, options={"paths": [[[0.0], [0.1]]] * len(report["paths"])})
        jobs.start(session, job)
        session.add(StepRow(job_id=job.id, turn=1, input={}, kind=ACCEPT, state=StepState.DONE, report=report, data=b""))
    return client.get(f"/jobs/{job.id}").text


def test_the_page_of_a_map_says_what_is_known_of_each_wanted_configuration(client: TestClient, database: Database) -> None:
    """What is not proved does not look proved, whether or not bodies touch there."""
    wanted = [{"q": [0.1], "state": "proved"}, {"q": [0.2], "state": "open"}, {"q": [0.3], "state": "in_collision"}]
    text = map_page(client, database, slider(), at=wanted, paths=[1.0, 0.99999, 0.0])
    rows = re.findall(r"<tr><td>(0\.\d+) m</td><td>(.*?)</td></tr>", text)
    assert rows == [
        ("0.1000", '<span class="proved">proved free of collision</span>'),
        ("0.2000", "not proved"),
        ("0.3000", '<span class="computed">in collision</span>'),
    ]
    shares = re.findall(r'<td class="number"><span class="proved">([\d.]+) %</span></td>', text)
    assert shares == ["100.0", "99.9", "0.0"], "a proved share is rounded down"


def test_a_map_that_leaves_a_pair_without_a_cell_proves_no_configuration(client: TestClient, database: Database) -> None:
    said = "1 pair of bodies has no proved cell, so no configuration is proved to be free of collision."
    assert said in map_page(client, database, slider(), uncovered_pairs=1)
    assert "no configuration is proved" not in map_page(client, database, slider())


def test_numbers_have_no_exponent_of_a_computer() -> None:
    said = {0.86: "0.86", 8190.0: "8190", 1.15e-12: "1.15 \N{MIDDLE DOT} 10\u207b\u00b9\u00b2", 2e9: "2 \N{MIDDLE DOT} 10\u2079", 0.0: "0"}
    assert {value: significant(value) for value in said} == said
    assert significant(800.0, 1) == "800"


def test_a_job_whose_joints_slide_has_no_width_in_degrees(client: TestClient, region: str) -> None:
    text = client.get(f"/jobs/{client.get(f'/v1/regions/{region}').json()['job']}").text
    facts = text.partition('<dl class="facts">')[2].partition("</dl>")[0]
    assert "<dt>Volume in joint positions</dt>" in facts
    assert "Average width" not in facts


def test_a_region_that_is_thin_in_one_direction_has_its_least_width_beside_the_average(
    client: TestClient, database: Database, planar: Scene, planar_region: str
) -> None:
    """Each joint moves by 20 degrees within the region, and almost only together with the other one."""
    slab = planar.polytope([[1.0, -1.0], [-1.0, 1.0], [1.0, 0.0], [-1.0, 0.0]], [-0.098, 0.102, -0.1, 0.3])
    region = store_region(database, certified_polytope(planar, slab, np.array([-0.2, -0.1])))
    found = client.get(f"/v1/regions/{region}").json()
    average, least = (found["q_volume"][name] for name in ("box_side", "least_width"))
    assert least < 0.5 < 2.0 < average
    shown = f"<data[^>]*>{least:.3g}°</data> or less"
    comparing = f"/compare/jobs?a={found['job']}&b={client.get(f'/v1/regions/{planar_region}').json()['job']}"
    for address in (f"/regions/{region}", f"/jobs/{found['job']}", "/regions", f"/compare?a={region}&b={planar_region}", comparing):
        text = client.get(address).text
        assert re.search(rf"least: (<[^>]*>)*{least:.3g}°" if address.startswith(("/regions/", "/jobs/")) else "Least width", text), address
        assert re.search(shown, text), address
        assert f"{average:.3g}°</data>" in text, address
    with database.write() as session:
        row = regions.get(session, region)
        row.summary = {**row.summary, "q_volume": {name: value for name, value in found["q_volume"].items() if name != "least_width"}}
    text = client.get(f"/regions/{region}").text
    assert "Average width" in text
    assert "least:" not in text, "an earlier version stored the region"


def test_where_nothing_is_proved_no_numbers_are_said(client: TestClient, database: Database) -> None:
    with database.write() as session:
        scenes.add(session, slider())
    assert "<dl>" not in claim_of(client.get("/scenes/slider").text)


def claim_of(text: str) -> str:
    return text.partition('<section class="claim')[2].partition("</section>")[0]


def test_names_are_escaped(client: TestClient, database: Database, monkeypatch: pytest.MonkeyPatch) -> None:
    """A scene cannot get such a name any more; an older database may have one."""
    monkeypatch.setattr(scenes, "check_name", lambda name, field: None)
    with database.write() as session:
        row = scenes.add(session, replace(slider(), name="<script>alert(1)</script>"))
    for path in ("/", f"/scenes/{row.id}"):
        text = client.get(path).text
        assert "&lt;script&gt;alert(1)" in text
        assert "<script>alert" not in text


def test_the_job_page_shows_outcomes_regions_and_their_files(client: TestClient, region: str) -> None:
    job = client.get("/v1/jobs").json()["jobs"][0]
    text = client.get(f"/jobs/{job['id']}").text
    assert 'class="certified" x="0" width="2"' in text
    assert 'data-island="job"' in text
    for link in (f"/regions/{region}", f"/v1/regions/{region}/proof", f"/v1/regions/{region}/export?format=json"):
        assert f'href="{link}"' in text
    assert '"ended": true' in text, "an ended job is not followed"


def test_the_region_page_shows_the_share_and_the_ranges(client: TestClient, region: str, certified: Region, database: Database) -> None:
    text = client.get(f"/regions/{region}").text
    kept = certified.manifest["share"]
    assert f'{100 * kept["value"]:.3g} <span class="small">± {100 * kept["stderr"]:.1g}</span> %' in text
    assert "from 10000 samples, of which 100 % are collision-free" in text
    assert "-0.3000 to 0.2000 m" in text
    with database.write() as session:
        row = regions.get(session, region)
        turning = {"joint_ranges": {"model/slide": {"lower": -17.2, "upper": 11.5, "unit": "deg"}}}
        row.manifest = row.manifest | turning
    text = client.get(f"/regions/{region}").text
    assert "-17.2° to 11.5°" in text
    assert "-57.3° to 57.3°" in text


def test_the_page_of_a_region_that_was_stored_before_there_were_shares(client: TestClient, region: str, database: Database) -> None:
    with database.write() as session:
        row = regions.get(session, region)
        row.manifest = {name: value for name, value in row.manifest.items() if name not in ("share", "joint_ranges")}
        row.summary = {**row.summary, "share": None}
    text = client.get(f"/regions/{region}").text
    assert "<dt>Kept of the starting region</dt><dd>\N{EN DASH}</dd>" in text
    assert "samples" not in text
    assert client.get("/v1/regions").json()["regions"][0]["share"] is None


NOW = datetime(2026, 1, 1, tzinfo=UTC)


def iteration(index: int, reused: dict[int, int]) -> Iteration:
    return Iteration(
        index=index,
        label="round",
        state=IterationState.RUNNING,
        faces=4,
        ellipsoid_volume=None,
        reused=reused,
        together={},
        started_at=NOW,
        finished_at=None,
    )


def cell(pair: int, index: int, state: PairState, **values: object) -> PairCell:
    known = (
        dict.fromkeys(("stage", "proved_distance", "margin", "seconds", "detail", "worker", "witness_q", "open_cells", "proof")) | values
    )
    return PairCell(iteration=index, pair=pair, parts=1, state=state, **known)  # type: ignore[arg-type]


@pytest.fixture
def matrix() -> PairMatrix:
    return PairMatrix(
        pairs=[PairInfo(index=i, a=f"a{i}", b=f"b{i}") for i in range(3)],
        iterations=[iteration(0, {}), iteration(1, {0: 0})],
        cells=[
            cell(0, 0, PairState.CERTIFIED, seconds=0.5, proved_distance=0.0123, stage="sos"),
            cell(1, 0, PairState.REFUTED, witness_q=[0.5, 1.0]),
            cell(1, 1, PairState.RUNNING),
            cell(2, 1, PairState.OPEN),
        ],
        next=None,
    )


def test_what_a_search_has_left_open_is_said(matrix: PairMatrix) -> None:
    left = [
        cell(1, 1, PairState.TOO_CLOSE, witness_q=[0.5, 1.0], open_cells=4, detail="0.001 m apart"),
        cell(2, 1, PairState.INCONCLUSIVE, open_cells=1),
    ]
    later = matrix.model_copy(update={"cells": [*matrix.cells[:2], *left]})
    found = progress(later)
    assert (found.parts, found.open_cells) == ([("too_close", 1), ("inconclusive", 1), ("reused", 1)], "5 open cells")
    assert progress(matrix).open_cells is None


def test_every_state_of_a_pair_has_a_colour_and_a_key() -> None:
    css, words = ((ROOT / name).read_text() for name in ("static/ciris.css", "source/job/outcomes.ts"))
    for outcome in Outcome:
        for selector in (f".badge.{outcome}", f".cell.{outcome}", f".key.{outcome}", f".bar .{outcome}"):
            assert re.search(rf"{re.escape(selector)}\b", css), selector
        assert f'name: "{outcome}"' in words


def test_progress_counts_what_is_settled(matrix: PairMatrix) -> None:
    found = progress(matrix)
    assert (found.parts, found.settled, found.total) == ([("running", 1), ("open", 1), ("reused", 1)], 1, 3)


def test_lists_and_pages_count_alike(client: TestClient, database: Database, scene: Scene, running: str) -> None:
    new = [NewPair(0, "a", "b", 1.0), *(NewPair(1, "a", "c", 1.0, part) for part in range(3))]
    asked = {"reuse": {3: 0, 4: 0, 6: 0}, "together": {0: (2,), 3: (5,)}, "parts": {1: 3}}
    with database.write() as session:
        job = jobs.lock(session, running)
        add_iteration(session, job, index=0, label="contract", C=[[1.0]], d=[1.0], center=[0.0], pairs=new, **asked)
    settled = ["4 of 7", "6 of 7"]
    for said in settled:
        listed = client.get("/v1/jobs").json()["jobs"][0]["progress"]
        assert f"{listed['settled']} of {listed['total']}" == said
        assert f">{said}<" in client.get("/").text
        assert f"{said} pairs settled" in client.get(f"/jobs/{running}").text
        with database.write() as session:
            claim = pairs.claim(session, jobs.lock(session, running), lease_seconds=60, batch_seconds=0.5)
            assert claim is not None
            pairs.save(session, claim, certified_pair(0))


def test_lists_pages_and_the_api_say_what_a_job_does(client: TestClient, running: str) -> None:
    (listed,) = client.get("/v1/jobs").json()["jobs"]
    assert (listed["state"], listed["status"]) == ("running", "queued: no worker")
    for path in ("/", f"/jobs/{running}"):
        text = client.get(path).text
        assert '<span class="badge queued">queued: no worker</span>' in text
        assert ">running</span>" not in text


def test_an_iteration_is_said_to_go_on_only_where_somebody_works(client: TestClient, running: str, database: Database) -> None:
    with database.write() as session:
        job = jobs.lock(session, running)
        new = [NewPair(0, "a", "b", 1.0)]
        add_iteration(session, job, index=0, label="cells", C=[[1.0]], d=[1.0], center=[0.0], pairs=new)

    def head() -> str:
        return client.get(f"/jobs/{running}").text.partition('id="h-progress">')[2].partition("</h2>")[0]

    assert head().strip() == "Iteration 0: cell by cell"
    with database.write() as session:
        workers.tell(session, Made(leases.name_of(os.getppid()), WorkerKind.SOLVE, "1.2", 4, 8, 2**34), WorkerState.RUNNING)
        assert pairs.claim(session, jobs.lock(session, running), lease_seconds=60, batch_seconds=0.5) is not None
    assert "since <time" in head()


def test_the_documentation_is_a_link_away(client: TestClient) -> None:
    assert '<a href="/docs/dashboard">Help</a>' in client.get("/workers").text
    assert '<a href="/docs/quickstart">how to begin</a>' in client.get("/new").text
    text = client.get("/docs/scenes").text
    assert text.count("<h1>") == 1, "a comment in a block of code is no heading"
    assert re.search(r'<a href="/docs/\w+">[^<]+</a>', text.partition("<article")[2])
    for name in re.findall(r'href="/docs/(\w+)"', text):
        assert client.get(f"/docs/{name}").status_code == 200, name
    for name in ("nothing", "..%2FREADME", "scenes.md"):
        assert client.get(f"/docs/{name}", headers={"Accept": "text/html"}).status_code == 404, name


@pytest.mark.parametrize("path", ["/", "/live", "/scenes", "/workers", "/workers/live", "/project", "/project/live", "/compare"])
def test_a_list_refuses_a_parameter_that_it_does_not_have(client: TestClient, path: str) -> None:
    """A misspelt filter would list everything. Every page may say in which unit angles are."""
    answer = client.get(f"{path}?sate=failed", headers={"Accept": "text/html"})
    assert answer.status_code == 422
    assert "there is no parameter &#39;sate&#39; here" in answer.text
    if path != "/compare":
        assert client.get(f"{path}?angles=rad").status_code == 200
        assert client.get(path).status_code == 200


def test_the_list_of_jobs_says_which_filter_was_meant(client: TestClient) -> None:
    answer = client.get("/?sate=failed", headers={"Accept": "text/html"})
    assert "state" in answer.text.partition("</h1>")[2]
    assert client.get("/?state=failed&kind=&scene=&outcome=&key=&search=").status_code == 200


def test_words_of_the_trade_say_what_they_mean(client: TestClient, database: Database, region: str, scene: Scene) -> None:
    assert 'class="badge exact" title="The verifier has checked every proof in exact arithmetic."' in client.get(f"/regions/{region}").text
    job = motion_job(
        database,
        scene,
        {"outcome": "refuted", "stop": None, "certified_to": None, "clearance": None, "proved_distance": None, "margin": None},
    )
    text = client.get(f"/jobs/{job}").text
    assert 'class="badge refuted" title="Bodies touch, at a configuration that is shown."' in text


def test_a_kind_of_job_has_one_name_on_all_pages(client: TestClient, database: Database, scene: Scene) -> None:
    begun = {"piece": 0, "time": 0.25, "q": [0.0]}
    verdict = {"outcome": "certified", "stop": None, "certified_to": begun, "proved_distance": 0.01, "clearance": 0.02, "tube": None}
    job = motion_job(database, scene, verdict)
    assert "Certify a motion of" in client.get(f"/jobs/{job}").text
    listed = client.get("/").text
    assert "<td>certify a motion</td>" in listed
    assert '<option value="certify-path">certify a motion</option>' in listed


def test_a_tube_is_said_to_be_no_wider_than_it_is(client: TestClient, database: Database, scene: Scene) -> None:
    """The joint of the scene slides, so the tube is in metres, too."""
    begun = {"piece": 0, "time": 0.25, "q": [0.0]}
    verdict = {"outcome": "certified", "stop": None, "certified_to": begun, "proved_distance": 0.01, "clearance": 0.02, "tube": 0.0123999}
    text = claim_of(client.get(f"/jobs/{motion_job(database, scene, verdict)}").text)
    assert "off by up to 0.710° (0.0123 rad), or by 0.0123 m where it slides" in text
