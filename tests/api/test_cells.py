"""Pairs and cells of regions and jobs, workers and obstacles over HTTP, of jobs that really grow, and of stored ones."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from api import cells
from certifier.kinematics import Kinematics
from certifier.model import Array, Pair, Scene
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.partition.certification import CellCertification
from certifier.polytopes.proved import ProvedBox
from certifier.proof.outline import Outline, Silhouette, Tree
from certifier.proof.partition import EMPTY, OPEN, PLANE
from db import jobs, pairs, proofs, regions, scenes, steps, subtrees
from db.leases import this_worker
from db.models import JobRow, SubtreesRow
from db.session import Database
from db.states import PairState, StepState
from db.types import utcnow
from tests.api.conftest import certified_polytope, store_region
from tests.certifier.scenes import ball, box, cube, planar_arm
from tests.db.builders import add_iteration
from tests.scenes import box_seed, slider

Ask = Callable[[str], Any]


@pytest.fixture
def ask(client: TestClient) -> Ask:
    """Asks for a document, and is not refused."""

    def get(path: str) -> Any:
        answer = client.get(f"/v1/{path}")
        assert answer.status_code == 200, answer.text
        return answer.json()

    return get


def stored(database: Database, scene: Scene) -> Scene:
    with database.write() as session:
        scenes.add(session, scene)
    return scene


def passing() -> Scene:
    """An arm of two joints with a ball at its tip, which touches a block where the joints turn far."""
    tip, block = ball("arm/link2/tip", "arm/link2", 0.05, (1.0, 0.0, 0.0)), box("world/block", "world", (0.1, 0.1, 0.1), (1.2, 1.0, 0.0))
    scene = planar_arm(2, block, limit=2.5)
    return replace(scene, geometries=(*scene.geometries, tip), pairs=(*scene.pairs, Pair(tip.name, block.name)))


def grown(client: TestClient, scene: Scene, half_width: float = 0.45, **options: Any) -> dict[str, Any]:
    """A job that has ended: it has grown a region from a box, cell by cell."""
    seed = box_seed(np.zeros(scene.n), half_width)
    request = {"kind": "grow", "scene": scene.name, "seed": seed, "options": {"cells": 100, "stages": 1, **options}}
    job = client.post("/v1/jobs", json=request).json()
    return ended(client, job["id"])


def ended(client: TestClient, job_id: str) -> dict[str, Any]:
    until = time.monotonic() + 120
    while time.monotonic() < until:
        job: dict[str, Any] = client.get(f"/v1/jobs/{job_id}").json()
        if job["ended"]:
            return job
        time.sleep(0.05)
    raise AssertionError("the job does not end")


def leaves(partition: dict[str, Any]) -> list[tuple[int, np.ndarray, np.ndarray]]:
    """The leaves of an answer with the bounds of their cells, read as whoever draws them does."""
    nodes, cuts, choices = iter(partition["nodes"]), iter(partition["cuts"]), iter(partition["choices"])
    found, waiting = [], [(np.array(partition["lower"]), np.array(partition["upper"]))]
    while waiting:
        lower, upper = waiting.pop()
        kind = next(nodes)
        if kind < 0:
            assert kind != PLANE or 0 <= next(choices) < len(partition["volumes"])
            found.append((kind, lower, upper))
            continue
        assert kind in partition["joints"]
        value, below, above = next(cuts), upper.copy(), lower.copy()
        assert lower[kind] < value < upper[kind]
        below[kind] = above[kind] = value
        waiting += [(above, upper), (lower, below)]
    assert [*nodes, *cuts, *choices] == []
    return found


def check(partition: dict[str, Any], scene: Scene) -> None:
    """The cells fill the root cell, and their counts are right."""
    found = leaves(partition)
    whole = np.prod(np.array(partition["upper"]) - partition["lower"])
    assert sum(np.prod(upper - lower) for _, lower, upper in found) == pytest.approx(whole)
    kinds = [kind for kind, _, _ in found]
    assert partition["counts"] == {"plane": kinds.count(PLANE), "empty": kinds.count(EMPTY), "open": kinds.count(OPEN)}
    assert (partition["q_star"], partition["revolute"]) == (scene.q_star.tolist(), scene.revolute.tolist())
    assert partition["folded"] == []


def test_a_grown_region_shows_its_pairs_and_their_cells(client: TestClient, worker: None, database: Database, ask: Ask) -> None:
    scene = stored(database, passing())
    job = grown(client, scene)
    assert (job["state"], job["outcome"]) == ("succeeded", "certified"), job["reason"]
    region = ask(f"regions/{job['region']}")
    listed = ask(f"regions/{job['region']}/pairs")["pairs"]
    assert [(pair["index"], pair["a"], pair["b"]) for pair in listed] == [(i, p.a, p.b) for i, p in enumerate(scene.pairs)]
    assert (
        [pair["proved_distance"] for pair in listed]
        == [pair["margin"] for pair in listed]
        == [pair["margin"] for pair in region["manifest"]["pairs"]]
    )
    for pair in listed:
        partition = ask(f"regions/{job['region']}/pairs/{pair['index']}/cells")
        check(partition, scene)
        assert (partition["certified"], partition["state"], partition["iteration"]) == (True, "certified", None)
        assert pair["cells"] == partition["counts"]["plane"] + partition["counts"]["empty"]
        assert partition["counts"]["open"] == 0
        assert partition["kind"] == pair["kind"] == "partition"
        of_job = ask(f"jobs/{job['id']}/pairs/{pair['index']}/cells")
        assert {**of_job, "iteration": None} == partition, "the region has the job's proof"
    for one in listed:
        assert all(one["index"] in listed[other]["shares_with"] for other in one["shares_with"])
    # The root cells contain the region.
    box = region["manifest"]["bounding_box"]
    assert (np.array(partition["lower"]) <= np.array(box["lower"]) + 1e-9).all()
    assert (np.array(partition["upper"]) >= np.array(box["upper"]) - 1e-9).all()

    cut = region["manifest"]["provenance"]["cuts"]
    obstacles = ask(f"jobs/{job['id']}/obstacles")
    assert obstacles["total"] == len(cut) >= 1
    first = obstacles["obstacles"][0]
    assert (first["a"], first["b"], first["faces"], first["lost"]) == (cut[0]["a"], cut[0]["b"], cut[0]["faces"], cut[0]["lost"])
    assert first["faces"] >= 1
    assert 0 < first["lost"] < 1
    assert f"{first['a']} and {first['b']}" in first["text"]
    assert "samples say" in first["text"]
    q, rows = scene.to_s(np.array(first["q"])), region["manifest"]
    assert (np.array(rows["halfspace_normals"]) @ q > np.array(rows["halfspace_offsets"])).any(), "what was cut off is not in the region"
    assert [one["lost"] for one in obstacles["obstacles"]] == sorted((one["lost"] for one in obstacles["obstacles"]), reverse=True)
    assert ask(f"jobs/{job['id']}/obstacles?limit=1") == {"obstacles": [first], "total": len(cut)}

    progress = ask(f"jobs/{job['id']}")["progress"]
    assert progress["settled"] == progress["total"] >= 1
    assert progress["share"] == region["share"]["value"]
    assert [one["progress"] for one in ask("jobs?ended=true")["jobs"]] == [progress]
    assert ask("jobs?ended=false")["jobs"] == []
    assert ask(f"jobs/{job['id']}/workers") == {"workers": []}


def test_one_plane_on_all_of_a_region_is_one_cell(ask: Ask, region: str) -> None:
    listed = ask(f"regions/{region}/pairs")["pairs"]
    assert [(pair["kind"], pair["cells"]) for pair in listed] == [("program", 1)] * 2
    partition = ask(f"regions/{region}/pairs/1/cells")
    assert (partition["kind"], partition["nodes"], partition["choices"]) == ("program", [PLANE], [0])
    # Both posts are proved together, with a plane before a box about them.
    assert partition["volumes"] == [["model/cart/ball", "a box about world/post0, world/post1, fixed to world"]]
    assert partition["joints"] == [0]
    assert [pair["shares_with"] for pair in listed] == [[1], [0]]


def test_a_pair_that_is_not_there_is_refused(client: TestClient, region: str) -> None:
    for index in (-1, 2):
        answer = client.get(f"/v1/regions/{region}/pairs/{index}/cells")
        assert (answer.status_code, answer.json()["code"]) == (404, "pair_not_found")
    assert client.get("/v1/regions/none/pairs").status_code == 404
    assert client.get("/v1/jobs/none/obstacles").status_code == 404
    assert client.get("/v1/jobs/none/workers").status_code == 404


OWN = Silhouette(("model/cart/ball",), "model/cart", 1, 0.1, own=True)
OTHER = Silhouette(("world/post0",), "world", 1, 0.1, own=True)


def outline(*nodes: int, cuts: tuple[float, ...] = (), planes: int | None = None) -> bytes:
    count = sum(node == PLANE for node in nodes) if planes is None else planes
    tree = Tree(np.array(nodes, dtype=np.int8), np.array(cuts, dtype=float), np.zeros(count, dtype=np.int8))
    return Outline((0,), np.array([-1.0]), np.array([1.0]), ((OWN,), (OTHER,)), tree).to_bytes()


def left(data: bytes, cells: int, outcome: Outcome = Outcome.INCONCLUSIVE, **more: Any) -> PairResult:
    return PairResult(outcome, Stage.CELLS, subtrees=b"subtrees", outline=data, open_cells=cells, detail="2 cells are open", **more)


@pytest.fixture
def job(database: Database) -> JobRow:
    """A running job, cell by cell, that nobody works on; its scene is a slider with two pairs."""
    scene = stored(database, slider(posts=2))
    with database.write() as session:
        row = scenes.get(session, scene.hash[:16])
        made, _ = jobs.create(session, kind="grow", scene_id=row.id, options={"kind": "grow", "seed": {"q": [0.0]}, "random_seed": 0})
        jobs.start(session, made)
        return made


BOX = ProvedBox(np.zeros(1), np.ones(1), np.array([[0.0, 0.0, 0.0, 1.0]]), np.array([[0.0, 0.0, 1.0, 0.0]]))
"""The root cell of all partitions, with multipliers of the faces and the limits."""


def begin(database: Database, job: JobRow, index: int, parts: dict[int, int], reuse: dict[int, int] | None = None) -> pairs.Claim:
    """Claims all of a further iteration, in which pairs have this many parts."""
    new = [pairs.NewPair(i, f"a{i}", f"b{i}", 0.01, part) for i, count in parts.items() for part in range(count)]
    more: dict[str, Any] = {"box": BOX, "begun": dict.fromkeys(parts, 0) if index else {}, "cells": 100, "parts": parts}
    with database.write() as session:
        row = jobs.lock(session, job.id)
        polytope = {"C": [[1.0], [-1.0]], "d": [1.0, 1.0], "center": None}
        add_iteration(session, row, index=index, label="cells", **polytope, pairs=new, reuse=reuse or {}, hard=[], failures=None, **more)
        claim = pairs.claim(session, row, lease_seconds=60, batch_seconds=1e9)
    assert claim is not None
    return claim


def save(database: Database, claim: pairs.Claim, results: dict[tuple[int, int], PairResult]) -> None:
    with database.write() as session:
        pairs.save(session, claim, results)


def test_a_running_job_shows_what_its_rounds_have_left(database: Database, job: JobRow, client: TestClient, ask: Ask) -> None:
    path = f"jobs/{job.id}/pairs/0/cells"
    refused = client.get(f"/v1/{path}").json()
    assert (refused["code"], refused["field"]) == ("cells_not_found", "pair")
    claim = begin(database, job, 0, {0: 1, 1: 1})
    assert (
        client.get(f"/v1/{path}").json()["detail"]
        == "pair 0 has no cells: no search has left cells of it in iteration 0, where it is running"
    )
    save(database, claim, {(0, 0): left(outline(0, OPEN, 0, OPEN, PLANE, cuts=(0.0, 0.5)), 2), (1, 0): left(outline(OPEN), 1)})
    first = ask(path)
    assert (first["nodes"], first["iteration"], first["state"], first["certified"]) == ([0, OPEN, 0, OPEN, PLANE], 0, "inconclusive", False)
    assert first["counts"] == {"plane": 1, "empty": 0, "open": 2}

    claim = begin(database, job, 1, {0: 2, 1: 1})
    held = ask(f"jobs/{job.id}/workers")["workers"]
    assert [(one["work"], one["iteration"], one["pairs"]) for one in held] == [("pairs", 1, [0, 1])]
    assert held[0]["process"]
    assert held[0]["until"]
    save(database, claim, {(0, 1): left(outline(EMPTY), 0)})
    second = ask(path)
    assert (second["nodes"], second["state"], second["iteration"]) == ([0, OPEN, 0, EMPTY, PLANE], "running", 1)
    assert ask(f"{path}?iteration=0") == first
    save(database, claim, {(0, 0): left(outline(0, PLANE, OPEN, cuts=(-0.5,)), 1)})
    third = ask(path)
    assert third["nodes"] == [0, 0, PLANE, OPEN, 0, EMPTY, PLANE]
    assert third["cuts"] == [0.0, -0.5, 0.5]
    assert third["counts"] == {"plane": 2, "empty": 1, "open": 1}
    assert client.get(f"/v1/{path}?iteration=7").json()["detail"] == "pair 0 has no cells: the job has not begun iteration 7 with it"


def test_an_ended_job_keeps_the_cells_of_what_it_has_not_certified(database: Database, job: JobRow, ask: Ask) -> None:
    save(database, begin(database, job, 0, {0: 1, 1: 1}), {(i, 0): left(outline(0, PLANE, OPEN, cuts=(0.1,)), 1) for i in range(2)})
    before = ask(f"jobs/{job.id}/pairs/0/cells")
    claim = begin(database, job, 1, {0: 1, 1: 1})
    save(database, claim, {(1, 0): PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=0.1, proof=b"proof")})
    with database.write() as session:
        row = jobs.lock(session, job.id)
        pairs.skip(session, row)
        pairs.skip_iterations(session, row.id)
        subtrees.end(session, row.id)
        jobs.finish(session, row, jobs.JobState.CANCELLED, reason="cancelled")
        kept = session.query(SubtreesRow).where(SubtreesRow.job_id == row.id).all()
        assert [(one.pair_index, one.data) for one in kept] == [(0, b"")]
    after = ask(f"jobs/{job.id}/pairs/0/cells")
    assert (after["nodes"], after["state"], after["iteration"]) == (before["nodes"], "skipped", 1)
    said = ask(f"jobs/{job.id}/obstacles")
    assert [(one["pair"], one["q"], one["faces"]) for one in said["obstacles"]] == [(0, None, None)]
    assert said["obstacles"][0]["text"] == "model/cart/ball and world/post0 are not certified: 2 cells are open."


def test_a_large_tree_is_folded_in_the_answer(database: Database, job: JobRow, ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    save(database, begin(database, job, 0, {0: 1}), {(0, 0): left(outline(0, 0, PLANE, EMPTY, 0, OPEN, PLANE, cuts=(0.0, -0.5, 0.5)), 1)})
    monkeypatch.setattr(cells, "MOST_NODES", 3)
    found = ask(f"jobs/{job.id}/pairs/0/cells")
    assert (found["nodes"], found["cuts"], found["choices"]) == ([0, -4, -4], [0.0], [])
    assert found["counts"] == {"plane": 2, "empty": 1, "open": 1}
    assert found["folded"] == [{"plane": 1, "empty": 1, "open": 0}, {"plane": 1, "empty": 0, "open": 1}]


def test_pairs_that_hold_a_region_back_come_worst_first(database: Database, job: JobRow, ask: Ask) -> None:
    touching = left(outline(OPEN), 1, Outcome.REFUTED, witness_s=np.array([0.25]))
    save(database, begin(database, job, 0, {0: 1, 1: 1}), {(0, 0): left(outline(OPEN), 1), (1, 0): replace(touching, detail="")})
    found = ask(f"jobs/{job.id}/obstacles")["obstacles"]
    assert [one["pair"] for one in found] == [1, 0]
    assert found[0]["text"] == "model/cart/ball and world/post1 touch at q = (0.250) m, which is proved."
    assert (found[0]["q"], found[0]["at"]) == ([0.25], "q = (0.250) m")
    assert (found[1]["q"], found[1]["at"]) == (None, None)
    # While the next round runs, the one before is what is known; what it has certified is no obstacle any more.
    claim = begin(database, job, 1, {0: 1, 1: 1})
    assert [one["pair"] for one in ask(f"jobs/{job.id}/obstacles")["obstacles"]] == [1, 0]
    save(database, claim, {(1, 0): PairResult(Outcome.CERTIFIED, Stage.CELLS, margin=0.1, proof=b"proof")})
    assert [one["pair"] for one in ask(f"jobs/{job.id}/obstacles")["obstacles"]] == [0]


def test_what_an_earlier_version_knows_of_its_cuts_is_said(database: Database, job: JobRow, ask: Ask) -> None:
    with database.write() as session:
        jobs.keep_growth(session, jobs.lock(session, job.id), {"whole": {"cuts": {"1": 3}}, "cuts": {"attempts": {}}})
    (found,) = ask(f"jobs/{job.id}/obstacles")["obstacles"]
    assert (found["pair"], found["faces"], found["q"]) == (1, None, None)
    assert found["text"] == "Something was cut off for model/cart/ball and world/post1 3 times."


def test_a_job_that_ended_before_it_had_pairs_says_why(database: Database, job: JobRow, ask: Ask) -> None:
    assert ask(f"jobs/{job.id}/obstacles") == {"obstacles": [], "total": 0}
    error = {"code": "seed_in_collision", "message": "a and b overlap by 0.1 m", "field": "seed.q", "hint": ""}
    with database.write() as session:
        jobs.finish(session, jobs.lock(session, job.id), jobs.JobState.FAILED, reason="a and b overlap", outcome="error", error=error)
    (found,) = ask(f"jobs/{job.id}/obstacles")["obstacles"]
    assert (found["pair"], found["text"], found["q"]) == (None, "a and b overlap by 0.1 m", [0.0])


def test_nothing_holds_back_a_job_that_has_reached_what_was_asked(database: Database, job: JobRow, ask: Ask) -> None:
    with database.write() as session:
        row = jobs.lock(session, job.id)
        row.kind = "certify-path"
        jobs.finish(session, row, jobs.JobState.SUCCEEDED, reason="every pair is certified all along the motion", outcome="certified")
    assert ask(f"jobs/{job.id}/obstacles") == {"obstacles": [], "total": 0}


@pytest.mark.parametrize(
    ("outcome", "distance", "how"),
    [("refuted", 0.0, "touch"), ("refuted", 1.96e-9, "touch"), ("too_close", 0.002, "are too close to tell")],
)
def test_the_first_contact_of_a_motion_is_its_obstacle(
    database: Database, job: JobRow, ask: Ask, outcome: str, distance: float, how: str
) -> None:
    """Bodies that are proved to touch are not said to be apart, although floating point may find a distance there."""
    stop = {"a": "model/cart/ball", "b": "world/post1", "distance": distance, "q": [0.5], "piece": 0, "time": 0.2}
    with database.write() as session:
        row = jobs.lock(session, job.id)
        row.kind = "certify-path"
        steps.add(session, row, "motion", {})
        claim = steps.claim(session, row, accepts=False, lease_seconds=60)
        assert claim is not None
        steps.save(session, claim, StepState.DONE, {"outcome": outcome, "stop": stop}, 0.1)
    (found,) = ask(f"jobs/{job.id}/obstacles")["obstacles"]
    assert (found["pair"], found["q"]) == (1, [0.5])
    said = f"model/cart/ball and world/post1 {how} at q = (0.500) m, the first configuration on the motion that could not be certified."
    assert found["text"] == said


def test_steps_and_decisions_have_workers_too(database: Database, job: JobRow, ask: Ask) -> None:
    with database.write() as session:
        row = jobs.lock(session, job.id)
        steps.add(session, row, "propose", {"seed": {}})
        steps.claim(session, row, accepts=False, lease_seconds=60)
        row.coordinator, row.coordinator_until = this_worker(), utcnow().replace(year=2100)
    assert [one["work"] for one in ask(f"jobs/{job.id}/workers")["workers"]] == ["seed", "decide"]


def test_volumes_are_named_in_words() -> None:
    scene = slider(posts=2)
    several = tuple(f"link{i}" for i in range(5))
    first = (OWN, Silhouette(several, "base", 1, 0.25, own=False), Silhouette(several[:1], "base", 2, 0.05, own=False))
    box_of = Silhouette(several[:2], "world", 8, 0.0, own=False)
    tree = Tree(np.array([PLANE], dtype=np.int8), np.zeros(0), np.array([4], dtype=np.int8))
    made = Outline((0,), np.zeros(1), np.ones(1), (first, (OTHER, box_of)), tree)
    found = cells.partition(scene, 0, made, PairState.CERTIFIED, cells.ProofKind.PARTITION)
    assert found.volumes[0] == ("model/cart/ball", "world/post0")
    assert found.volumes[found.choices[0]] == (
        "a ball of radius 0.25 m about link0, link1, link2 and 2 more, fixed to base",
        "a box about link0, link1, fixed to world",
    )
    assert found.volumes[2][0] == "a capsule of radius 0.05 m about link0, fixed to base"
    turned = replace(made, sides=((OTHER,), (OWN,)), tree=tree._replace(choices=np.zeros(1, dtype=np.int8)))
    assert cells.partition(scene, 0, turned, PairState.CERTIFIED, cells.ProofKind.PARTITION).volumes == [("model/cart/ball", "world/post0")]


def proof_of(scene: Scene) -> bytes:
    """Another proof file of the scene."""
    result = CellCertification(scene, scene.polytope([[1.0], [-1.0]], [0.1, 0.1])).certify(0, 10)
    assert result.proof is not None
    return result.proof


def test_the_outlines_of_regions_are_kept_within_bounds(database: Database, region: str, ask: Ask, monkeypatch: pytest.MonkeyPatch) -> None:
    read: list[str] = []
    monkeypatch.setattr(cells, "outlines", lambda data, scene, read_file=cells.outlines: read.append("file") or read_file(data, scene))
    ask(f"regions/{region}/pairs")
    ask(f"regions/{region}/pairs/0/cells")
    assert read == ["file"], "a file is read once"
    monkeypatch.setattr(cells, "KEPT_NODES", 1)
    kept = cells.OutlinesKept()
    with database.read() as session:
        row = regions.get(session, region)
    scene = scenes.load(database, row.scene_id)
    first = kept.of(database, row.proof_digest, scene)
    assert kept.of(database, row.proof_digest, scene) is first, "the last one is kept, however large it is"
    other = proof_of(scene)
    with database.write() as session:
        digest = proofs.put(session, [other])[other]
    kept.of(database, digest, scene)
    assert kept.of(database, row.proof_digest, scene) is not first, "it made room"


def sides_of(scene: Scene, plane: dict[str, Any], s: Array) -> tuple[float, float]:
    """How far the two bodies of a pair are from the plane at s, (n,), times |a|: the least of the first, the most of the second."""
    *a, b = np.array(plane["Z"]) @ [1.0, *s[plane["joints"]]]
    a = np.array(a)
    found = []
    for name, least in ((plane["pair"]["a"], 1), (plane["pair"]["b"], -1)):
        geometry = scene.geometry(name)
        p = Kinematics.of(scene).points(plane["frame"], geometry.body, geometry.vertices, s[None])[0]
        found.append(least * ((least * (p @ a + b)).min() - geometry.radius * np.linalg.norm(a)))
    return found[0], found[1]


def test_the_plane_of_a_cell_is_between_the_bodies(client: TestClient, worker: None, database: Database, ask: Ask) -> None:
    """At random configurations of the region, all of one body is on one side of the plane of their cell, and all of the other beyond."""
    scene = stored(database, passing())
    region = grown(client, scene)["region"]
    rng, met = np.random.default_rng(0), set()
    samples = ask(f"regions/{region}/configurations?samples=40")["samples"]
    for index in range(len(scene.pairs)):
        partition = ask(f"regions/{region}/pairs/{index}/cells")
        for q in samples:
            plane = ask(f"regions/{region}/pairs/{index}/plane?" + "&".join(f"q={value}" for value in q))
            s, lower, upper = scene.to_s(np.array(q)), np.array(plane["lower"]), np.array(plane["upper"])
            assert partition["nodes"][plane["cell"]] == PLANE
            assert (lower <= s).all()
            assert (s <= upper).all()
            assert any((low == lower).all() and (high == upper).all() for _, low, high in leaves(partition))
            # It is the plane of all of the cell, as far as the region reaches.
            C, d = (np.array(ask(f"regions/{region}")["manifest"][name]) for name in ("halfspace_normals", "halfspace_offsets"))
            others = rng.uniform(lower, upper, (20, scene.n))
            for point in (s, *others[(others @ C.T <= d).all(axis=1)]):
                first, second = sides_of(scene, plane, point)
                assert first > 0 > second
            met.add((index, plane["cell"]))
    assert len(met) > len(scene.pairs), "several cells of a pair are met"


def test_the_plane_of_all_of_a_region_is_between_the_bodies(database: Database, ask: Ask) -> None:
    """A program's plane is affine in u, whose origin and unit are not those of s; what is served is affine in s.

    The tip passes the block closely: a plane that is read in u, or moved by a part of the conversion, cuts one of the two.
    """
    scene = stored(database, replace(passing(), pairs=passing().pairs[-1:]))
    polytope, center = cube(scene, 0.3, 0.3), np.full(scene.n, 0.3)
    region = store_region(database, certified_polytope(scene, polytope, center))
    assert [pair["kind"] for pair in ask(f"regions/{region}/pairs")["pairs"]] == ["program"]
    served = []
    for s in np.random.default_rng(0).uniform(0.0, 0.6, (60, scene.n)):
        plane = ask(f"regions/{region}/pairs/0/plane?" + "&".join(f"q={value}" for value in scene.to_q(s)))
        first, second = sides_of(scene, plane, s)
        assert first > 0 > second
        served.append((plane["cell"], plane["joints"], plane["Z"]))
    assert served == [(0, [0, 1], served[0][2])] * 60, "one plane serves everywhere"


def test_outside_of_the_region_no_plane_is_proved(client: TestClient, region: str, ask: Ask) -> None:
    for q, code in (("q=2.0", "cells_not_found"), ("q=999", "cells_not_found"), ("q=0&q=0", "wrong_length")):
        refused = client.get(f"/v1/regions/{region}/pairs/0/plane?{q}")
        assert refused.status_code in {404, 422}
        assert (refused.json()["code"], refused.json()["field"]) == (code, "q")
