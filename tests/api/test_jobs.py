"""Jobs over HTTP: creation, idempotency, refusals, pages, cancel, retry; the queue is real, the workers are not there."""

import json
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api.app import create_app
from certifier.growth.machine import begin
from certifier.growth.options import GrowthOptions
from certifier.model import Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification
from certifier.verify.file import verify_file
from db import jobs, pairs, scenes
from db.session import Database
from tests.api.conftest import BASE_URL, PROBLEM
from tests.db.builders import add_iteration
from tests.scenes import slider
from workers.app import CONTROL, waiting

GROW: dict[str, Any] = {"kind": "grow", "scene": "slider", "seed": {"q": [0.1]}}
CERTIFY: dict[str, Any] = {"kind": "certify", "scene": "slider", "polytope": {"C": [[1], [-1]], "d": [0.2, 0.2], "center": [0]}}


def test_a_job_is_queued_and_announced(client: TestClient, scene: Scene) -> None:
    answer = client.post("/v1/jobs", json=GROW)
    assert answer.status_code == 201, answer.text
    job = answer.json()
    assert answer.headers["Location"] == f"/v1/jobs/{job['id']}"
    assert (job["state"], job["kind"], job["scene"], job["ended"]) == ("queued", "grow", scene.hash[:16], False)
    assert client.get(f"/v1/jobs/{job['id']}").json() | {"warnings": []} == job
    assert waiting(CONTROL) == 1
    GrowthOptions.from_document(job["options"])


def test_a_polytope_is_taken_as_it_is(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=CERTIFY).json()
    options = GrowthOptions.from_document(job["options"])
    assert (options.kind, options.seed["C"], options.seed["center"]) == ("certify", [[1], [-1]], [0])


def test_the_same_request_under_the_same_key_is_the_same_job(client: TestClient, scene: Scene) -> None:
    headers = {"Idempotency-Key": "k"}
    first = client.post("/v1/jobs", json=GROW, headers=headers)
    again = client.post("/v1/jobs", json=GROW | {"scene": scene.hash[:16]}, headers=headers)
    assert (first.status_code, again.status_code) == (201, 200)
    assert again.json() == first.json()
    other = client.post("/v1/jobs", json=CERTIFY, headers=headers)
    assert (other.status_code, other.json()["code"], other.headers["content-type"]) == (409, "idempotency_conflict", PROBLEM)
    assert len(client.get("/v1/jobs").json()["jobs"]) == 1


REFUSED: list[tuple[dict[str, Any], int, str, str | None]] = [
    (GROW | {"scene": "nope"}, 404, "scene_not_found", "scene"),
    (GROW | {"seed": {"q": [0.1, 0.2]}}, 422, "seed_wrong_length", "seed.q"),
    (GROW | {"seed": {"q": [1.5]}}, 422, "seed_outside_limits", "seed.q[0]"),
    (GROW | {"seed": {"q": ["NaN"]}}, 422, "invalid_request", "seed.q[0]"),
    (GROW | {"seed": {"q": [0.1], "method": "magic"}}, 422, "invalid_request", "seed.method"),
    (GROW | {"seed": {}}, 422, "missing_option", "seed.q"),
    (GROW | {"seed": {"q": [0.1], "C": [[1]]}}, 422, "option_value", "seed.C"),
    (GROW | {"seed": {"method": "polytope", "C": [[1, 2]], "d": [1]}}, 422, "polytope_shape", "seed.C[0]"),
    (GROW | {"seed": {"q": [0.1], "epsilon": 2}}, 422, "invalid_request", "seed.epsilon"),
    (GROW | {"color": "red"}, 422, "invalid_request", "color"),
    (GROW | {"options": {"max_rounds": 1}}, 422, "invalid_request", "options.max_rounds"),
    (GROW | {"options": {"paper": {"max_rounds": -1}}}, 422, "invalid_request", "options.paper.max_rounds"),
    (GROW | {"seed": {"q": [0.1], "method": "limits"}}, 422, "option_value", "seed.method"),
    (GROW | {"seed": {"q": [0.1], "method": "box"}, "options": {"paper": {}}}, 422, "missing_option", "seed.half_width"),
    (GROW | {"options": {"rounds": 1}}, 422, "invalid_request", "options.rounds"),
    (GROW | {"deadline_seconds": 0}, 422, "invalid_request", "deadline_seconds"),
    (GROW | {"kind": "conquer"}, 422, "invalid_request", "kind"),
    (CERTIFY | {"polytope": {"C": [[1, 2]], "d": [1]}}, 422, "polytope_shape", "polytope.C[0]"),
    (CERTIFY | {"polytope": {"C": [[1]], "d": [1, 2]}}, 422, "polytope_shape", "polytope.d"),
    (CERTIFY | {"polytope": {"C": [[1]], "d": [-1], "center": [0]}}, 422, "center_outside", "polytope.center"),
    (CERTIFY | {"polytope": {"C": [[1]], "d": ["inf"]}}, 422, "invalid_request", "polytope.d[0]"),
]


@pytest.mark.parametrize(("body", "status", "code", "field"), REFUSED)
def test_a_bad_request_is_a_problem_that_names_the_field(
    client: TestClient, scene: Scene, body: dict[str, Any], status: int, code: str, field: str | None
) -> None:
    answer = client.post("/v1/jobs", json=body)
    problem = answer.json()
    assert (answer.status_code, problem["code"], problem["field"]) == (status, code, field)
    assert answer.headers["content-type"] == PROBLEM
    assert problem["detail"]
    assert client.get("/v1/jobs").json()["jobs"] == []


@pytest.mark.parametrize("number", ["NaN", "Infinity", "1e999"])
def test_numbers_that_are_not_finite_are_refused(client: TestClient, scene: Scene, number: str) -> None:
    body = json.dumps(GROW).replace("0.1", number)
    answer = client.post("/v1/jobs", content=body, headers={"Content-Type": "application/json"})
    assert (answer.status_code, answer.json()["field"]) == (422, "seed.q[0]")


def test_pages_follow_each_other_and_filters_apply(client: TestClient, scene: Scene) -> None:
    ids = [client.post("/v1/jobs", json=GROW).json()["id"] for _ in range(5)]
    client.post(f"/v1/jobs/{ids[0]}/cancel")
    seen: list[str] = []
    after = None
    while True:
        page = client.get("/v1/jobs", params={"limit": 2} | ({"after": after} if after else {})).json()
        seen += [job["id"] for job in page["jobs"]]
        after = page["next"]
        if after is None:
            break
    assert seen == ids[::-1]
    assert [job["id"] for job in client.get("/v1/jobs?state=cancelled").json()["jobs"]] == [ids[0]]
    assert client.get("/v1/jobs?kind=certify").json()["jobs"] == []
    assert len(client.get("/v1/jobs?scene=slider").json()["jobs"]) == 5
    assert client.get("/v1/jobs?state=lost").json()["field"] == "state"
    assert client.get("/v1/jobs?after=nope").json()["code"] == "cursor"


def test_a_cancelled_job_can_be_tried_again_once(client: TestClient, scene: Scene) -> None:
    job = client.post("/v1/jobs", json=GROW).json()
    assert client.post(f"/v1/jobs/{job['id']}/retry").json()["code"] == "job_not_retryable"
    cancelled = client.post(f"/v1/jobs/{job['id']}/cancel")
    assert (cancelled.status_code, cancelled.json()["state"]) == (202, "cancelled")
    again = client.post(f"/v1/jobs/{job['id']}/retry")
    assert (again.status_code, again.json()["retry_of"], again.json()["state"]) == (201, job["id"], "queued")
    assert client.post(f"/v1/jobs/{job['id']}/retry").json()["id"] == again.json()["id"]


ROUTES = [
    ("GET", ""),
    ("GET", "/events"),
    ("GET", "/events/stream"),
    ("GET", "/pairs"),
    ("GET", "/growth"),
    ("POST", "/cancel"),
    ("POST", "/retry"),
]


@pytest.mark.parametrize(("method", "path"), ROUTES)
def test_unknown_jobs_are_not_found(client: TestClient, method: str, path: str) -> None:
    answer = client.request(method, f"/v1/jobs/nope{path}")
    assert (answer.status_code, answer.json()["code"]) == (404, "job_not_found")


def test_the_matrix_and_the_curve_of_an_ended_job(client: TestClient, region: str) -> None:
    job = client.get("/v1/jobs").json()["jobs"][0]
    assert (job["state"], job["outcome"], job["region"], job["ended"]) == ("succeeded", "certified", region, True)
    matrix = client.get(f"/v1/jobs/{job['id']}/pairs").json()
    assert [(cell["pair"], cell["iteration"], cell["state"], cell["stage"]) for cell in matrix["cells"]] == [
        (0, 0, "certified", "sos"),
        (1, 0, "certified", "sos"),
    ]
    assert [pair["b"] for pair in matrix["pairs"]] == ["world/post0", "world/post1"]
    assert [(it["label"], it["state"], it["faces"]) for it in matrix["iterations"]] == [("contract", "certified", 4)]
    assert client.get(f"/v1/jobs/{job['id']}/pairs?iteration=7").json()["cells"] == []
    one = client.get(f"/v1/jobs/{job['id']}/pairs?iteration=0&pair=1").json()
    assert ([cell["pair"] for cell in one["cells"]], [pair["index"] for pair in one["pairs"]]) == ([1], [1])
    assert client.get(f"/v1/jobs/{job['id']}/pairs?pair=1").json() == one
    states = client.get(f"/v1/jobs/{job['id']}/pairs/states").json()["iterations"]
    assert [(it["index"], it["state"], it["states"]) for it in states] == [(0, "certified", "cc")]
    assert client.get(f"/v1/jobs/{job['id']}/pairs/states?since=1").json()["iterations"] == []
    points = client.get(f"/v1/jobs/{job['id']}/growth").json()["points"]
    assert [point["region"] for point in points] == [region]


def test_a_witness_is_given_in_joint_positions(client: TestClient, database: Database, scene: Scene) -> None:
    job_id = client.post("/v1/jobs", json=CERTIFY).json()["id"]
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        new = [pairs.NewPair(0, scene.pairs[0].a, scene.pairs[0].b, 1.0)]
        C, d = [[1.0], [-1.0]], [1.0, 1.0]
        add_iteration(session, job, index=0, label="given", C=C, d=d, center=None, pairs=new, reuse={1: 0}, hard=[], failures=None)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
        assert claim is not None
        refuted = PairResult(Outcome.REFUTED, Stage.SCREEN, seconds=0.1, witness_s=np.array([0.25]))
        pairs.save(session, claim, {(0, 0): refuted})
    matrix = client.get(f"/v1/jobs/{job_id}/pairs").json()
    assert matrix["cells"][0]["witness_q"] == scene.to_q([0.25]).tolist()
    assert matrix["iterations"][0]["reused"] == {"1": 0}
    assert client.get(f"/v1/jobs/{job_id}/pairs/states").json()["iterations"] == [
        {"index": 0, "label": "given", "state": "failed", "faces": 2, "states": "ru"}
    ]


def test_only_outcomes_that_have_a_proof_offer_one(client: TestClient, database: Database, scene: Scene) -> None:
    """The first pair's search has left a partition with open cells; the second pair is certified."""
    job_id = client.post("/v1/jobs", json=CERTIFY | {"cells": 50}).json()["id"]
    polytope = scene.polytope([[1.0], [-1.0]], [0.9, 0.9])
    search = CellCertification(scene, polytope)
    certified = search.certify(1, 50)
    assert certified.outcome is Outcome.CERTIFIED
    left = PairResult(Outcome.INCONCLUSIVE, Stage.CELLS, detail="2 cells are open", subtrees=certified.proof, open_cells=2)
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        new = [pairs.NewPair(i, pair.a, pair.b, 1.0) for i, pair in enumerate(scene.pairs)]
        C, d = polytope.C, polytope.d
        add_iteration(session, job, index=0, label="given", C=C, d=d, center=None, pairs=new, reuse={}, hard=[], failures=None, cells=50)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
        assert claim is not None
        pairs.save(session, claim, {(0, 0): left, (1, 0): certified})
    cells = client.get(f"/v1/jobs/{job_id}/pairs").json()["cells"]
    assert [(cell["state"], cell["stage"], cell["open_cells"], cell["proof"] is None) for cell in cells] == [
        ("inconclusive", "cells", 2, True),
        ("certified", "cells", None, False),
    ]
    answers = [client.get(f"/v1/jobs/{job_id}/pairs/{pair}/proof", params={"iteration": 0}) for pair in (0, 1)]
    assert [answer.status_code for answer in answers] == [404, 200]
    assert answers[0].json()["code"] == "proof_not_found"
    assert verify_file(answers[1].content).kind == "partition"


def test_the_parts_of_a_pair_are_shown_as_one(client: TestClient, database: Database, scene: Scene) -> None:
    """It is certified when all its parts are, at the least of their margins, and only then offers the proof of the first one."""
    job_id = client.post("/v1/jobs", json=CERTIFY | {"cells": 50}).json()["id"]
    polytope = scene.polytope([[1.0], [-1.0]], [0.9, 0.9])
    search = CellCertification(scene, polytope)
    first, second = (replace(search.certify(index, 50), seconds=1.0, margin=margin) for index, margin in ((0, 0.02), (1, 0.01)))
    other = PairResult(Outcome.CERTIFIED, Stage.CELLS, seconds=2.0, margin=0.01)
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        new = [pairs.NewPair(index, f"a{index}", f"b{index}", 1.0, part) for index, part in ((0, 0), (0, 1), (1, 0))]
        more = {"cells": 50, "begun": {0: 0, 1: 0}, "parts": {0: 2}}
        C, d = polytope.C, polytope.d
        add_iteration(session, job, index=0, label="given", C=C, d=d, center=None, pairs=new, reuse={}, hard=[], failures=None, **more)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
        assert claim is not None
        pairs.save(session, claim, {(0, 0): first, (1, 0): second})

    def shown() -> list[tuple[Any, ...]]:
        cells = client.get(f"/v1/jobs/{job_id}/pairs").json()["cells"]
        return [
            (cell["pair"], cell["parts"], cell["state"], cell["proved_distance"], cell["seconds"], cell["proof"] is None) for cell in cells
        ]

    def proof() -> int:
        return client.get(f"/v1/jobs/{job_id}/pairs/0/proof", params={"iteration": 0}).status_code

    def letters() -> str:
        return str(client.get(f"/v1/jobs/{job_id}/pairs/states").json()["iterations"][0]["states"])

    assert shown() == [(0, 2, "running", None, 1.0, True), (1, 1, "certified", 0.01, 1.0, False)]
    assert letters() == "wc"
    assert proof() == 404
    with database.write() as session:
        pairs.save(session, claim, {(0, 1): other})
    assert shown()[0] == (0, 2, "certified", 0.01, 3.0, False)
    assert letters() == "cc"
    assert proof() == 200


def test_a_pair_that_is_certified_with_another_one_is_found_there(client: TestClient, database: Database, scene: Scene) -> None:
    job_id = client.post("/v1/jobs", json=CERTIFY | {"cells": 50}).json()["id"]
    polytope = scene.polytope([[1.0], [-1.0]], [0.9, 0.9])
    certified = CellCertification(scene, polytope).certify(0, 50)
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        new, given = [pairs.NewPair(0, "a0", "b0", 1.0)], {"C": polytope.C, "d": polytope.d, "center": None}
        more = {"hard": [], "failures": None, "cells": 50, "together": {0: (1,)}}
        add_iteration(session, job, index=0, label="cells", **given, pairs=new, reuse={}, **more)
        claim = pairs.claim(session, job, lease_seconds=60, batch_seconds=60)
        assert claim is not None
        pairs.save(session, claim, {(0, 0): certified})
    matrix = client.get(f"/v1/jobs/{job_id}/pairs?pair=1").json()
    assert ([pair["index"] for pair in matrix["pairs"]], [cell["pair"] for cell in matrix["cells"]]) == ([1], [0])
    assert matrix["iterations"][0]["together"] == {"0": [1]}
    assert [it["states"] for it in client.get(f"/v1/jobs/{job_id}/pairs/states").json()["iterations"]] == ["cc"]
    first, second = (client.get(f"/v1/jobs/{job_id}/pairs/{pair}/proof", params={"iteration": 0}) for pair in (0, 1))
    assert first.status_code == 200
    assert first.content == second.content
    cells = [client.get(f"/v1/jobs/{job_id}/pairs/{pair}/cells").json() for pair in (0, 1)]
    assert [cell["cuts"] for cell in cells] == 2 * [cells[0]["cuts"]]


def test_a_job_that_asks_for_cells_says_so(client: TestClient, scene: Scene) -> None:
    def options(body: dict[str, Any]) -> GrowthOptions:
        return GrowthOptions.from_document(client.post("/v1/jobs", json=body).json()["options"])

    assert [options(body).by_cells for body in (CERTIFY, CERTIFY | {"cells": 300})] == [False, True]
    whole = options(GROW | {"options": {"cells": 900}})
    assert (whole.by_cells, whole.cells) == (True, 900)
    refused = client.post("/v1/jobs", json=CERTIFY | {"cells": 0})
    assert (refused.status_code, refused.json()["field"]) == (422, "cells")


def test_an_option_that_has_moved_into_a_group_is_refused_with_its_place(client: TestClient, scene: Scene) -> None:
    problem = client.post("/v1/jobs", json=GROW | {"options": {"pushes": 1, "color": "red"}}).json()
    said = {error["field"]: error["message"] for error in problem["errors"]}
    assert said == {
        "options.pushes": "there is no such field: give options.paper.pushes",
        "options.color": "there is no such field",
    }


def test_a_job_is_accepted_while_redis_is_down(database: Database, scene: Scene, environment: pytest.MonkeyPatch) -> None:
    environment.setenv("CIRIS_REDIS_URL", "redis+socket:///tmp/there-is-no-queue?virtual_host=0")
    with TestClient(create_app(database), base_url=BASE_URL) as client:
        assert client.post("/v1/jobs", json=GROW).status_code == 201
        assert [job["state"] for job in client.get("/v1/jobs").json()["jobs"]] == ["queued"]
        ready = client.get("/readyz")
        assert (ready.status_code, ready.json()["ready"]) == (200, True)
        assert ready.json()["checks"]["database"] == "ok"
        assert ready.json()["checks"]["queue"].startswith("Redis cannot be reached")
        assert client.get("/healthz").status_code == 200


def test_the_service_is_ready_with_its_database_and_its_queue(client: TestClient) -> None:
    assert client.get("/readyz").json() == {"ready": True, "checks": {"database": "ok", "queue": "ok", "disk": "ok"}}


def test_a_region_of_another_scene_is_certified_again_with_its_seed_inside(client: TestClient, database: Database, region: str) -> None:
    changed = replace(slider(posts=3), name="changed")
    with database.write() as session:
        scenes.add(session, changed)
    answer = client.post("/v1/jobs", json={"kind": "recertify", "scene": "changed", "region": region[:8]})
    assert answer.status_code == 201, answer.text
    job = answer.json()
    assert (job["kind"], job["scene"]) == ("recertify", changed.hash[:16])
    options = GrowthOptions.from_document(job["options"])
    assert (options.seed["region"], options.seed["q"], options.by_cells) == (region, [[0.0]], True)
    transition = begin(changed, options)
    assert transition.state.start is not None
    assert transition.action.kind == "certify"


def test_a_region_is_not_certified_again_for_another_robot(client: TestClient, database: Database, region: str) -> None:
    with database.write() as session:
        scenes.add(session, replace(slider(), name="other", q_star=np.array([0.1])))
    refused = client.post("/v1/jobs", json={"kind": "recertify", "scene": "other", "region": region})
    assert (refused.status_code, refused.json()["code"], refused.json()["field"]) == (422, "other_robot", "scene")
    missing = client.post("/v1/jobs", json={"kind": "recertify", "scene": "other", "region": "nothing"})
    assert (missing.status_code, missing.json()["code"]) == (404, "region_not_found")


def test_the_pair_matrix_comes_in_pages_that_do_not_part_the_parts_of_a_pair(client: TestClient, database: Database, scene: Scene) -> None:
    job_id = client.post("/v1/jobs", json=CERTIFY | {"cells": 50}).json()["id"]
    with database.write() as session:
        job = jobs.lock(session, job_id)
        jobs.start(session, job)
        for index in range(3):
            new = [pairs.NewPair(i, one.a, one.b, 1.0, part) for i, one in enumerate(scene.pairs) for part in range(index + 1)]
            given = {"C": [[1.0], [-1.0]], "d": [1.0, 1.0], "center": None, "reuse": {}, "hard": [], "failures": None}
            add_iteration(session, job, index=index, label="given", pairs=new, **given)
    path = f"/v1/jobs/{job_id}/pairs"
    whole = client.get(path).json()
    assert ([(c["iteration"], c["pair"]) for c in whole["cells"]], whole["next"]) == ([(i, p) for i in range(3) for p in range(2)], None)
    for limit in (1, 2, 3, 5, 6):
        cells, after = [], None
        while True:
            page = client.get(path, params={"limit": limit, **({"after": after} if after else {})}).json()
            assert len(page["cells"]) <= limit
            assert (page["pairs"] == whole["pairs"]) == (page["iterations"] == whole["iterations"]) == (after is None)
            cells += page["cells"]
            after = page["next"]
            if after is None:
                break
        assert cells == whole["cells"]
    one = client.get(path, params={"pair": [1], "limit": 2}).json()
    assert [(c["iteration"], c["pair"]) for c in one["cells"]] == [(0, 1), (1, 1)]
    for wrong in ("1", "a.b", "-1.0", "9999999999.0", "²2.0"):
        assert client.get(path, params={"after": wrong}).json()["code"] == "cursor"
