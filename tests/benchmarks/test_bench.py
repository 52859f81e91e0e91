"""The benchmarks at their smallest: what ``ciris bench`` prints, and that it would say so if verdicts or proofs did not fit."""

from __future__ import annotations

import json
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from benchmarks import agreement, catalogue, compare, growth, lookups, maps, path, plan, query, recertify, report, service, store, survey
from benchmarks.compare import Verdict, verdict
from benchmarks.ompl import Ompl
from certifier.carry.robot import same_bodies
from certifier.conditioned import without_conditions
from certifier.conditions import Cone
from certifier.errors import CirisError
from certifier.growth.paper.options import PaperOptions
from certifier.kinematics import Kinematics
from certifier.model import WORLD
from certifier.outcome import Outcome, Stage
from certifier.pair.result import PairResult
from certifier.polytopes.closest import closest
from certifier.scene import load_scene
from certifier.verify.scene import check_scene
from tests.client.conftest import surroundings
from tests.docs.test_quickstart import service as service_of
from tests.services import Postgres

CUP = catalogue.ROOT / "examples/ur3e_cup/scene.yaml"


def bench(*arguments: str) -> dict[str, Any]:
    command = [sys.executable, "-m", "client.cli", "bench", *arguments, "--json"]
    document: dict[str, Any] = json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout)
    return document


def test_a_scene_is_compared_with_drake_pair_by_pair() -> None:
    document = bench("scene", "planar_2dof", "--region", "wide", "--against", "drake")
    (task,) = document["tasks"]
    assert (task["scene"], task["region"], task["faces"]) == ("planar-2dof", "wide", 4)
    assert {row["ciris"]["outcome"] for row in task["pairs"]} == {"certified", "refuted"}
    assert {row["drake"]["outcome"] for row in task["pairs"]} == {"certified", "not_certifiable"}
    assert document["verdicts"] == {"agree": 6}
    drake, ciris = (sum(document["total"][side].values()) for side in ("drake", "ciris"))
    assert document["total"]["ratio"] == pytest.approx(drake / ciris)
    assert all(row["a"] in report.text(document) for row in task["pairs"])


def test_pairs_are_chosen_by_name_and_cost() -> None:
    task = compare.whole_scene("iiwa_shelf", "middle", match="link_5", count=3)
    assert len(task.indices) == 3
    assert all("link_5" in f"{task.scene.pairs[i].a} {task.scene.pairs[i].b}" for i in task.indices)


@pytest.mark.slow
def test_a_way_to_grow_is_a_row_with_its_region(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "WAYS", {"pushes": PaperOptions(max_rounds=0)})
    document = growth.growth(["planar_2dof"], against=False, limit=growth.LIMIT, progress=lambda _: None)
    iris, row = document["ways"]
    assert (iris["scene"], iris["way"], iris["share"]) == ("planar_2dof", growth.IRIS, 1.0)
    assert "not certified; of 10000 samples" in iris["ended"]
    assert (row["scene"], row["way"]) == ("planar_2dof", "pushes")
    assert row["ellipsoid"] > 0.1
    assert row["curve"][-1]["ellipsoid_volume"] == pytest.approx(row["ellipsoid"])
    assert row["curve"][-1]["share"] == row["share"]
    assert 0 < row["share_stderr"] < row["share"] < 1
    assert 0 < row["seeding_seconds"] < row["seconds"]
    assert row["processor_seconds"] > 0
    assert f"| {row['share']:.3f} | {row['share_stderr']:.4f} |" in report.text(document)


def test_a_region_that_cannot_be_grown_is_a_row_that_says_why(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "WAYS", {"nothing": None})
    monkeypatch.setattr(catalogue, "seed", lambda _: np.array([9.0, 0.0]))
    document = growth.growth(["planar_2dof"], against=False, limit=growth.LIMIT, progress=lambda _: None)
    assert [row["ellipsoid"] for row in document["ways"]] == [0, 0]
    assert all("is at 9 rad," in row["ended"] for row in document["ways"])
    assert "is at 9 rad," in report.text(document)


def test_a_way_that_takes_too_long_is_a_row_that_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(growth, "WAYS", {"whole": growth.WAYS["whole"]})
    (row,) = growth.growth(["planar_2dof"], against=False, limit=1e-9, progress=lambda _: None, only=["whole"])["ways"]
    assert (row["ellipsoid"], row["curve"]) == (0, [])
    assert "the deadline was reached" in row["ended"]


def test_what_is_measured_anew_replaces_its_own_rows_only() -> None:
    def rows(*names: tuple[str, str]) -> list[dict[str, Any]]:
        return [{"scene": scene, "way": way} for scene, way in names]

    old = {"benchmark": "growth", "ways": rows(("planar_2dof", "a"), ("arm_3dof", "whole"), ("arm_3dof", "targeted"), ("sphere_arm", "a"))}
    again = rows(("iiwa_shelf", "targeted"), ("iiwa_shelf", growth.IRIS), ("arm_3dof", "whole"))
    new = {"benchmark": "growth", "ways": [row | {"new": True} for row in again], "against": []}
    merged = growth.merged(old | {"against": rows(("arm_3dof", "a"))}, new)
    assert [(row["scene"], row["way"], row.get("new", False)) for row in merged["ways"]] == [
        ("planar_2dof", "a", False),
        ("arm_3dof", "whole", True),
        ("arm_3dof", "targeted", False),
        ("iiwa_shelf", growth.IRIS, True),
        ("iiwa_shelf", "targeted", True),
        ("sphere_arm", "a", False),
    ]
    assert merged["against"] == rows(("arm_3dof", "a")), "Drake was not asked again"


def test_rows_of_several_machines_say_which_is_whose() -> None:
    document = json.loads((report.FIGURES / "growth.json").read_text(encoding="utf-8"))
    row = document["ways"][-1]
    other = row | {"scene": "another"}
    document |= {"ways": [row, other], "against": []}
    assert ": Measured on" not in report.text(document)
    other["machine"] = row["machine"] | {"processor": "an abacus"}
    assert f"{row['scene']}: Measured on" in report.text(document)
    assert "another: Measured on: an abacus, " in report.text(document)


@pytest.mark.slow
def test_the_service_is_measured_beside_local(postgres: Postgres) -> None:
    document = bench("service", "planar_2dof", "arm_3dof", "--turns", "1", "--postgresql", postgres.new_database())
    for name in ("planar_2dof", "arm_3dof"):
        rows = {row["way"]: row for row in document["rows"] if row["scene"] == name}
        assert list(rows) == ["SQLite", "PostgreSQL", "--local"]
        for row in rows.values():
            assert min(row["seconds"], row["seeding_seconds"], row["processor_seconds"], row["cells"]) > 0
        for more in (row for row in document["more"] if row["scene"] == name):
            assert more["seconds"] == pytest.approx(rows[more["way"]]["seconds"] - rows["--local"]["seconds"])
            processor = rows[more["way"]]["processor_seconds"] - rows["--local"]["processor_seconds"]
            assert more["cell_ms"] == pytest.approx(1e3 * processor / rows["--local"]["cells"])
    assert "With one solving process" in report.text(document)


def test_what_the_service_takes_more_is_of_medians(monkeypatch: pytest.MonkeyPatch) -> None:
    taken = iter([3.0, 1.0, 2.0, 9.0, 5.0, 1.0])  # SQLite first in the first and in the third turn
    monkeypatch.setattr(service, "running", lambda *_: nullcontext("a service"))
    monkeypatch.setattr(service, "_line", str)
    monkeypatch.setattr(
        service, "_grown", lambda *_: {"seconds": (t := next(taken)), "processor_seconds": t, "cells": 10, "ellipsoid": 0.5}
    )
    document = service.beside_local(["planar_2dof"], None, processes=1, turns=3, progress=lambda _: None)
    assert [row["way"] for row in document["rows"]] == ["SQLite", "--local", "--local", "SQLite", "SQLite", "--local"]
    assert document["more"] == [
        {"scene": "planar_2dof", "way": "SQLite", "cells": 10, "seconds": 4.0, "processor_seconds": 4.0, "cell_ms": 400.0}
    ]


def test_runs_that_come_to_different_regions_are_no_measurement(monkeypatch: pytest.MonkeyPatch) -> None:
    volumes = iter([0.5, 0.6])
    monkeypatch.setattr(service, "running", lambda *_: nullcontext())
    monkeypatch.setattr(service, "_line", str)
    monkeypatch.setattr(service, "_grown", lambda *_: {"seconds": 1.0, "ellipsoid": next(volumes)})
    with pytest.raises(CirisError, match="different regions"):
        service.beside_local(["planar_2dof"], None, processes=1, turns=1, progress=lambda _: None)


def test_the_store_is_measured_on_both_databases(postgres: Postgres) -> None:
    document = store.store(postgres.new_database(), [80], lambda _: None)
    rows = [(row["database"], row["pairs"], row["settled"]) for row in document["rows"]]
    assert rows == [(database, 80, settled) for database in ("SQLite", "PostgreSQL") for settled in (0, 40)]
    for row in document["rows"]:
        assert min(row["insert_seconds"], row["claim_ms"], row["look_ms"], row["save_ms"]) > 0
        assert row["database"] in report.text(document)


@pytest.mark.slow
@pytest.mark.parametrize("database", ["SQLite", pytest.param("PostgreSQL", marks=pytest.mark.slow)])
def test_a_fleet_is_measured(database: str, request: pytest.FixtureRequest) -> None:
    """Twenty workers hold pieces of 50 ms: no more than 400 a second can be done, and more than one by one."""
    where = ["--postgresql", request.getfixturevalue("postgres").new_database()] if database == "PostgreSQL" else []
    document = bench("fleet", *where, "--workers", "20", "--pieces", "3000", "--seconds", "0.05", "--limit", "2")
    assert 20 < document["pieces_per_second"] < 500
    assert document["efficiency"] == pytest.approx(document["pieces_per_second"] * 0.05 / 20)
    assert document["database"] == database
    assert database in report.text(document)


@pytest.mark.parametrize(
    ("ours", "theirs", "same", "expected"),
    [
        (Outcome.CERTIFIED, Outcome.CERTIFIED, False, Verdict.AGREE),
        (Outcome.REFUTED, Outcome.NOT_CERTIFIABLE, False, Verdict.AGREE),
        (Outcome.CERTIFIED, Outcome.NOT_CERTIFIABLE, False, Verdict.PROGRAMS_DIFFER),
        (Outcome.CERTIFIED, Outcome.NOT_CERTIFIABLE, True, Verdict.CONTRADICTION),
        (Outcome.REFUTED, Outcome.CERTIFIED, False, Verdict.CONTRADICTION),
        (Outcome.INCONCLUSIVE, Outcome.CERTIFIED, True, Verdict.UNDECIDED),
    ],
)
def test_what_two_answers_mean_together(ours: Outcome, theirs: Outcome, same: bool, expected: Verdict) -> None:
    assert verdict(ours, theirs, same) is expected


def test_the_campaign_finds_agreement_and_evidence() -> None:
    document = agreement.campaign(agreement.questions(boxes=1, rounded=0), lambda _: None)
    assert document["instances"] == 4
    assert document["verdicts"].keys() <= {"agree", "programs differ"}
    assert "none" not in document["evidence"]
    assert len(document["counts"]) > 1, "feasible and infeasible ones"


@pytest.mark.parametrize("name", catalogue.SCENES)
def test_seeds_are_free(name: str) -> None:
    scene = catalogue.scene(name)
    kinematics, s = Kinematics(scene), scene.to_s(catalogue.seed(name))[None]
    at_seed = {g.name: kinematics.points(WORLD, g.body, g.vertices, s)[0] for g in scene.geometries}
    gaps = [closest(at_seed[p.a], at_seed[p.b]).gap - scene.geometry(p.a).radius - scene.geometry(p.b).radius for p in scene.pairs]
    assert min(gaps) > 0


def test_figures_cover_the_boxes_they_stand_for() -> None:
    """Balls and capsules do; every point of a box lies in one of them."""
    boxes = catalogue.scene("iiwa_shelf")
    rng = np.random.default_rng(0)
    for name in ("iiwa_sphere_shelf", "iiwa_dense_cupboard"):
        balls = catalogue.scene(name).geometries
        for link in (g for g in boxes.geometries if g.body.startswith("iiwa/")):
            points = rng.dirichlet(np.ones(8), 200) @ link.vertices
            reach = [np.linalg.norm(points - ball.vertices[0], axis=1) - ball.radius for ball in balls if ball.body == link.body]
            assert np.min(reach, axis=0).max() <= 0


@pytest.mark.parametrize(("needed", "asked", "undecided"), [(5, [10], 0), (150, [10, 200], 0), (300, [10, 200], 1)])
def test_the_survey_tries_again_what_stays_open(monkeypatch: pytest.MonkeyPatch, needed: int, asked: list[int], undecided: int) -> None:
    given: list[int] = []

    def certify(_: Any, index: int, cells: int) -> PairResult:
        given.append(cells)
        return PairResult(Outcome.CERTIFIED if cells >= needed else Outcome.INCONCLUSIVE, Stage.CELLS, detail="open")

    monkeypatch.setattr(survey.CellCertification, "certify", certify)
    monkeypatch.setattr(catalogue, "REGIONS", {"tiny": catalogue.REGIONS["tiny"]})
    document = survey.survey(["planar_2dof"], 5.0, lambda _: None, cells=10)
    assert given == asked * 6
    assert len(document["undecided"]) == 6 * undecided


def test_the_survey_decides_every_pair() -> None:
    document = survey.survey(["planar_2dof", "rail_arm"], 5.0, lambda _: None)
    assert document["undecided"] == []
    assert [sum(row["outcomes"].values()) for row in document["counts"]] == [6] * 4 + [18] * 4
    by_cells = survey.survey(["planar_2dof"], 5.0, lambda _: None, cells=500)
    assert by_cells["undecided"] == []
    assert {outcome for row in by_cells["counts"] for outcome in row["outcomes"]} <= {"certified", "refuted", "too_close"}


def test_questions_about_many_regions_are_measured_beside_a_plain_product() -> None:
    document = query.query(60, lambda _: None, sizes=[2.0])
    (row,) = document["rows"]
    assert (row["regions"], row["size"]) == (60, 2.0)
    assert 60 * 50 <= row["faces"] <= 60 * 600
    assert all(value > 0 for value in row.values())
    assert "plain product, 1 point" in report.text(document)


def test_a_map_is_measured_with_what_it_connects(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(maps, "COVERAGE", 0.8)
    document = maps.maps(["planar_2dof"], 60.0, lambda _: None, drake=2000)
    (row,) = document["rows"]
    assert row["drake"] == {"configurations": 2000, "collisions": 0}
    again = row["obstacle_more"]
    assert min(again[run]["coverage"] for run in ("taken_over", "anew")) >= again["wanted"] == 0.95 * row["coverage"]["value"]
    assert row["coverage"]["value"] >= 0.8
    assert row["over_time"][-1][1] == row["coverage"]["value"]
    assert [at for at, _ in row["over_time"]] == sorted(at for at, _ in row["over_time"])
    assert 0 < row["straight"] < row["connected"] < 1
    assert "planar_2dof" in report.text(document)


def test_lookups_are_measured_in_as_many_cells_as_are_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(lookups, "COVERED", 0.5)
    (row,) = lookups.lookups(["planar_2dof"], 5000, 60.0, lambda _: None)["rows"]
    assert row["grown"] < 5000 <= row["cells"] < 5500
    assert all(0 < row[what]["p50"] <= row[what]["p99"] <= row[what]["most"] for what in ("point", "batch", "motion"))
    assert "1000 points, p99" in report.text({"benchmark": "lookups", "rows": [row]})


@pytest.mark.slow
def test_motions_are_planned_beside_ompl(tmp_path: Path) -> None:
    environment = surroundings(CIRIS_DATA_DIR=str(tmp_path / "data"))
    with service_of(environment, tmp_path):
        url = json.loads((tmp_path / "data" / "stack.json").read_text())["url"]
        document = bench("plan", "planar_2dof", "--url", url, "--queries", "12", "--points", "500")
        conditioned = bench("plan", str(CUP), "--url", url, "--queries", "3", "--points", "100")
    assert document["asked"] == len(document["rows"]) == document["answered"] == 11
    assert document["answered_of_these"] == document["ompl_solved"]
    assert document["proved"] == 11
    assert document["ours"]["fail"] == 0
    for row in document["rows"]:
        assert row["ours"]["length"] >= row["straight"] * (1 - 1e-9)
    assert all(row["straight"] <= plan.NEAR * 6**0.5 for row in conditioned["rows"])
    assert conditioned["proved"] == conditioned["answered"] == conditioned["ompl_solved"] == 2
    assert "OMPL, no proof" in report.text(document)


def test_the_check_of_a_path_finds_what_fails() -> None:
    rival = Ompl(catalogue.scene("planar_2dof"))
    assert rival.fails(np.array([[0.0, 0.0], [1.72, -2.1]]), 500)
    assert not rival.fails(np.array([[0.0, 0.0], [0.1, -0.1]]), 500)


def test_the_check_of_a_path_finds_conditions_that_are_not_kept() -> None:
    scene = load_scene(CUP)
    q = np.array(yaml.safe_load((CUP.parent / "seed.yaml").read_text())["q"])
    upright, rival = scene.conditions[0], Ompl(scene)
    assert isinstance(upright, Cone)
    tilted = q + upright.angle * 1.1 * np.eye(6)[3]
    assert not rival.fails(np.array([q, q + 0.8 * (tilted - q)]), 20)
    assert rival.fails(np.array([q, tilted]), 20)
    assert not Ompl(without_conditions(scene)).fails(np.array([q, tilted]), 20)


def test_the_page_shows_the_figures_that_lie_beside_it() -> None:
    page = report.PAGE.read_text(encoding="utf-8")
    assert page == report.page(page)


@pytest.mark.slow
def test_motions_are_measured_beside_sampling() -> None:
    document = bench("path", "planar_2dof", "--motions", "4")
    (row,) = document["rows"]
    assert (row["scene"], row["joints"], row["motions"]) == ("planar_2dof", 2, 8)
    assert 0 < row["certified"] < 8
    assert row["certified"] + row["contacts"] == 8
    assert row["certified_but_sampled_in_contact"] == 0
    assert row["told_apart"] == row["millimetres"] > 0
    splines = row["splines"]
    assert splines["certified"] + splines["contacts"] == splines["motions"] == 4
    assert splines["certified_but_sampled_in_contact"] == 0
    assert "planar_2dof" in report.text(document)
    assert "splines certified" in report.text(document)


def test_two_arms_of_seven_joints_make_one_of_fourteen() -> None:
    single, both = catalogue.scene("iiwa_shelf"), path.scene(path.TWO_IIWAS)
    check_scene(both)
    assert (both.n, len(both.pairs)) == (14, 2 * len(single.pairs) + 8 * 8 - 1)
    s = np.full((1, 14), 0.2)
    of_one, of_two = Kinematics.of(single), Kinematics.of(both)
    hand = of_one.points(WORLD, "iiwa/link_7", np.zeros((1, 3)), s[:, :7])
    left, right = (of_two.points(WORLD, f"{arm}/link_7", np.zeros((1, 3)), s) for arm in ("left", "right"))
    assert (left + right) / 2 == pytest.approx(hand)
    assert (right - left)[0, 0] == pytest.approx([0, path.APART, 0])


@pytest.mark.parametrize(("name", "change"), [(name, change) for name in recertify.SCENES for change in recertify.CHANGES[name]])
def test_a_scene_changes_in_the_manner_that_is_measured(tmp_path: Path, name: str, change: str) -> None:
    before, after = catalogue.scene(name), load_scene(recertify.changed(name, recertify.CHANGES[name][change], tmp_path / name))
    assert before.hash != after.hash
    assert (len(after.pairs) > len(before.pairs)) == ("added" in change)
    assert (len(after.pairs) < len(before.pairs)) == ("taken away" in change)
    assert set(same_bodies(before, after)) >= {joint.child for joint in before.moving}
