"""Every method of the Python client against a real service, in both kinds."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydrake.math import BsplineBasis
from pydrake.trajectories import BezierCurve, BsplineTrajectory
from scipy.interpolate import BPoly, CubicSpline, make_interp_spline

import ciris
from api.access import KEYS_SECONDS
from api.schemas.motions import JobMotion, MotionResponse
from certifier.model import Scene
from certifier.verify.file import verify_file
from certifier.verify.region import verify_region
from db import jobs, keys, scenes
from db.session import Database
from tests.api.conftest import store_region
from tests.api.test_planning import a_part
from tests.certifier.motions import swing
from tests.ciris.twin import SOURCE, TWIN, twins

ROOT = Path(__file__).parents[2]


def test_the_twins_are_alike() -> None:
    assert {path: path.read_text() for path in sorted(TWIN.glob("*.py"))} == twins(), "python -m tests.ciris.twin"
    assert len(list(SOURCE.glob("*.py"))) == 3


def test_a_scene_says_what_its_coordinates_mean(service: Any, scene: Scene) -> None:
    found = service.scene("slider")
    assert (found.id, found.hash, found.joints) == (scene.hash[:16], scene.hash, tuple(joint.name for joint in scene.moving))
    assert np.array_equal(found.to_q(found.to_s([[0.3], [-0.2]])), [[0.3], [-0.2]])
    assert repr(found) == f"Scene('slider', {found.id}: 1 joint, {found.geometries} geometries, 2 pairs)"
    assert [one.id for one in service.scenes()] == [found.id]
    assert len(service.warnings(found)) == found.warnings


def test_a_scene_file_is_uploaded_with_all_it_refers_to(service: Any) -> None:
    added = service.add_scene(ROOT / "examples" / "planar_2dof" / "scene.yaml")
    assert (added.name, len(added.joints)) == ("planar-2dof", 2)
    assert np.allclose(added.to_s([np.pi / 2, 0]), [1, 0])


def test_a_scene_is_constrained(service: Any, scene: Scene) -> None:
    low = {"name": "low", "inside": {"what": ["model/cart"], "half_spaces": np.array([[0.0, 0.0, 1.0, 0.5]])}}
    found = service.constrain_scene("slider", [low], name="low-slider")
    assert (found.name, service.scene("low-slider"), service.scene("slider").hash) == ("low-slider", found, scene.hash)
    assert found.hash != scene.hash


def test_a_scene_is_staged_and_promoted(service: Any, region: str) -> None:
    present = service.scene("slider")
    staged = service.stage_scene("slider", ROOT / "examples" / "planar_2dof" / "scene.yaml")
    assert (staged.name, service.scene("slider@staged"), service.scene("slider")) == ("slider@staged", staged, present)
    assert service.graph("slider@staged").edges == ()
    with pytest.raises(ciris.CirisError) as caught:
        service.promote_scene("slider")
    assert caught.value.code == "scene_without_regions"
    assert service.promote_scene("slider", without_regions=True) == service.scene("slider") == staged


def test_a_region_is_arrays_a_proof_and_a_verdict(service: Any, region: str, scene: Scene) -> None:
    (found,) = service.regions("slider")
    assert (found.id, found.guarantee, found.joints) == (region, ciris.Guarantee.EXACT, tuple(joint.name for joint in scene.moving))
    assert found.C.shape == (len(found.d), 1)
    assert found.contains([[0.1], [0.9], [-0.25]]).tolist() == [True, False, True]
    assert found.contains([0.1])
    assert (found.C @ found.center < found.d).all()
    assert 0 < float(found.q_volume) <= 0.51
    assert verify_region(found.proof()).scene.hash == scene.hash
    verdict = found.verify()
    assert verdict
    assert any("separated" in line for line in verdict.statement)
    assert (found.not_covered.pairs, str(found.not_covered), found.not_covered.bodies) == (0, str(service.scene("slider").not_covered), ())
    assert repr(found).startswith(f"Region({region[:8]} of slider: 1 joint, {len(found.d)} faces, ")
    assert b"slider" in found.export("json")
    assert service.region(region[:8]).id == region


@pytest.mark.parametrize("number", [9185166224891948.0, 1e300])
def test_a_number_that_no_double_tells_from_others_is_refused(service: Any, region: str, number: float) -> None:
    for ask in (
        lambda: service.contains("slider", [[number]]),
        lambda: service.nearest("slider", [number]),
        lambda: service.path("slider", [[0.1], [number]]),
        lambda: service.plan("slider", [0.1], [number]),
        lambda: service.certify_path("slider", [[0.1], [number]]),
    ):
        with pytest.raises(ciris.CirisError, match="is no number of at most 1e\\+06"):
            ask()
    assert not service.region(region).contains([number]), "it is taken literally, and is outside of the limits"


def test_a_region_names_the_pairs_that_are_not_covered(service: Any, planar_region: str) -> None:
    found = service.region(planar_region).not_covered
    assert (found.pairs, str(found)) == (1, "1 pair of neighbouring links is not covered")
    assert [(one.a, one.b, one.why, one.reason) for one in found.bodies] == [("arm/link1", "arm/link2", "neighbours", None)]


def test_regions_are_fetched_once(service: Any, region: str, database: Database) -> None:
    first = service.regions("slider")
    more = store_region(database, a_part(0.1, 0.4))
    again = service.regions("slider")
    assert [one.id for one in again] == [more, region]
    assert again[1].C is first[0].C


def test_a_job_says_what_cut_its_region(service: Any, region: str, database: Database) -> None:
    (job,) = service.jobs()
    assert job.obstacles() == ()
    growth = {"obstacles": {"1": {"stage": 1, "times": 1, "faces": 2, "lost": 0.125, "s": [0.25], "contact": False}}}
    with database.write() as session:
        jobs.keep_growth(session, jobs.get(session, job.id), growth)
    (found,) = job.obstacles()
    assert (found.pair, found.a, found.b, found.faces, found.lost) == (1, "model/cart/ball", "world/post1", 2, 0.125)
    assert found.q.tolist() == [0.25]
    assert str(found).startswith("model/cart/ball and world/post1 could not be proved apart near q = (0.250) m.")


def test_answers_are_true_only_if_all_of_them_are_yes(service: Any, region: str) -> None:
    assert service.contains("slider", [0.1])
    answer = service.contains("slider", [[0.1], [0.9]])
    assert not answer
    assert answer.inside.tolist() == [True, False]
    assert answer.margin[0] == pytest.approx(0.1)
    assert np.isnan(answer.margin[1])
    assert answer[0].regions[0].region == region
    assert repr(answer) == "Containment(1 of 2, about 1 region)"
    assert service.contains("slider", s=[[0.1]])


def test_what_is_near_has_a_place_and_a_distance(service: Any, region: str) -> None:
    inside, outside, beyond = answer = service.nearest("slider", [[0.1], [0.9], [5.0]])
    assert answer.distance[:2] == pytest.approx([0, 0.7])
    assert np.isnan(answer.distance[2])
    assert inside.region == outside.region == region
    assert outside.q == pytest.approx([0.2])
    assert (outside.map, outside.complete) == (None, True)
    assert beyond is None


def test_motions_are_covered_or_it_is_said_where_they_are_not(service: Any, region: str) -> None:
    answer = service.segments("slider", [[[-0.2], [0.15]], [[0.0], [0.4]]])
    assert answer.covered.tolist() == [True, False]
    assert not answer
    assert answer[1].uncovered.q == pytest.approx([0.2])
    assert service.segments("slider", s=[[-0.2], [0.15]])
    path = service.path("slider", [[0.0], [0.1], [0.5]], times=[2.0, 3.0, 7.0])
    assert not path
    assert path.uncovered.time == path.pieces[-1].end == pytest.approx(4.0)
    assert repr(path) == "Coverage(not covered from 4 on, 1 piece)"
    assert service.path("slider", s=[[0.0], [0.1]])


def test_a_motion_is_certified_by_itself_or_its_contact_is_named(service: Any, scene: Scene) -> None:
    motion = service.certify_path("slider", [[0.0], [0.1]], tube=True, prove=True)
    assert motion
    assert motion.proved_distance == motion.margin > 0
    assert (motion.clearance, motion.nearest, motion.padding) == (None, None, 0.0)
    assert motion.tube > 0
    assert verify_file(motion.proof)
    assert service.certify_path("slider", s=[[0.0], [0.1]]).proof is None


BEZIER = [[[0.0], [0.08], [0.05], [0.1]], [[0.1], [0.15], [0.12], [0.05]]]


def test_a_curve_is_asked_about_as_scipy_and_drake_have_it(service: Any, region: str, worker: None) -> None:
    cubic = CubicSpline([2.0, 3.0, 5.0], [[0.0], [0.1], [0.05]])
    pieces = np.moveaxis(BPoly.from_power_basis(cubic).c, 1, 0)
    pieces[:-1, -1] = pieces[1:, 0]
    spline = make_interp_spline([2.0, 3.0, 4.0, 5.0], [[0.0], [0.1], [0.02], [0.05]], k=3)
    drakes = BsplineTrajectory(BsplineBasis(4, spline.t), [point[:, None] for point in spline.c])
    one = BezierCurve(0.0, 2.0, np.array([[0.0, 0.08, 0.05, 0.1]]))
    curves = [
        ({"bezier": pieces}, cubic.x, 2.0, 5.0),
        ({"knots": spline.t, "control_points": spline.c}, None, 2.0, 5.0),
        ({"knots": drakes.basis().knots(), "control_points": np.hstack(drakes.control_points()).T}, None, 2.0, 5.0),
        ({"bezier": one.control_points().T}, [one.start_time(), one.end_time()], 0.0, 2.0),
    ]
    for curve, times, begin, end in curves:
        motion = service.certify_path("slider", **curve, prove=True)
        assert motion
        assert (motion.degree, verify_file(motion.proof).kind) == (3, "motion")
        path = service.path("slider", **curve, times=times)
        assert path
        assert [path.pieces[0].begin, path.pieces[-1].end] == [begin, end]
    assert service.submit_certify_path("slider", **curves[0][0], deadline=600).motion()


def test_the_control_points_of_a_curve_may_be_in_s(service: Any, region: str) -> None:
    motion = service.certify_path("slider", bezier=BEZIER, space="s")
    assert (motion.space, motion.waypoints) == ("s", 3)
    assert service.path("slider", bezier=BEZIER, space="s", times=[0.0, 1.0, 3.0]).pieces[-1].end == 3.0
    assert service.certify_path("slider", bezier=BEZIER).space == "q"


@pytest.mark.parametrize(
    ("given", "field", "words"),
    [
        ({}, "q", "the motion is missing \\(give waypoints as q or s, or a curve: bezier, or knots with control_points\\)"),
        ({"q": [[0.0], [0.1]], "bezier": BEZIER}, "bezier", "the motion is given by q and bezier"),
        ({"bezier": BEZIER, "knots": [0.0], "control_points": [[0.0]]}, "control_points", "given by bezier and knots and control_points"),
        ({"knots": [0.0, 0.0, 1.0, 1.0]}, "knots", "given by knots"),
        ({"control_points": [[0.0], [0.1]]}, "control_points", "given by control_points"),
        ({"knots": [0.0, 0.0, 1.0, 1.0], "control_points": [0.0, 0.1]}, "control_points", "it has the shape \\(2,\\)"),
        ({"bezier": [0.0, 0.1]}, "bezier", "2 or 3 axes"),
        ({"bezier": [["x"]]}, "bezier", "not finite numbers"),
    ],
)
def test_a_motion_that_is_not_given_in_one_way_is_refused(service: Any, given: dict[str, Any], field: str, words: str) -> None:
    for ask in (service.certify_path, service.submit_certify_path, service.path):
        with pytest.raises(ciris.CirisError, match=words) as caught:
            ask("slider", **given)
        assert (caught.value.code, caught.value.field) == ("points", field)


def test_a_spline_has_its_knots_for_times(service: Any, region: str) -> None:
    with pytest.raises(ciris.CirisError, match="the knots are the times of a B-spline: leave times out"):
        service.path("slider", knots=[0.0, 0.0, 1.0, 1.0], control_points=[[0.0], [0.1]], times=[0.0, 1.0])


@pytest.mark.parametrize("by_job", [False, True])
def test_a_motion_has_every_field_of_the_document(service: Any, worker: None, scene: Scene, by_job: bool) -> None:
    names = set(JobMotion.model_fields if by_job else MotionResponse.model_fields)
    waypoints = [[0.0], [0.1], [0.05]]
    motion = service.submit_certify_path("slider", waypoints).motion() if by_job else service.certify_path("slider", waypoints)
    assert {name for name in names if hasattr(motion, name)} == names
    assert (motion.scene.name, motion.scene.hash) == ("slider", scene.hash)
    assert (motion.space, motion.degree, motion.waypoints) == ("q", 1, 3)
    assert motion.intervals > 0
    assert 0 < motion.verify_seconds < motion.seconds
    assert motion.certified_to.piece == 1


def test_the_first_contact_of_a_motion_is_named(service: Any, database: Database) -> None:
    arm = swing(-0.01)
    with database.write() as session:
        scenes.add(session, arm)
    passing = service.certify_path(arm.name, [[-0.5], [-0.3]], clearance=True, padding=1)
    assert not passing
    passing = service.certify_path(arm.name, [[-0.5], [-0.3]], clearance=True, padding=0.001)
    assert passing.nearest.distance - 1e-4 <= passing.clearance <= passing.nearest.distance
    assert passing.nearest.q == pytest.approx([-0.3])
    stopped = service.certify_path(arm.name, s=[[-0.5], [0.6]], space="q")
    assert not stopped
    assert stopped.outcome is ciris.Outcome.REFUTED
    assert f"{stopped.stop.a} and {stopped.stop.b}" in repr(stopped)
    assert stopped.stop.q.shape == (1,)


def test_a_motion_is_certified_by_a_job(service: Any, worker: None, scene: Scene) -> None:
    job = service.submit_certify_path("slider", [[0.0], [0.1]], tube=True, deadline=600)
    motion = job.motion(prove=True)
    assert motion
    assert motion.tube > 0
    assert verify_file(motion.proof).kind == "motion"
    assert job.motion().proof is None
    assert (job.kind, job.refresh().outcome) == ("certify-path", ciris.Outcome.CERTIFIED)
    with pytest.raises(ciris.CirisError) as caught:
        service.submit_certify_path("slider", [[0.0], [99.0]])
    assert (caught.value.code, caught.value.field) == ("outside_limits", "q[1][0]")


def test_a_job_without_a_motion_says_why(service: Any, scene: Scene, database: Database) -> None:
    failed, late = (service.submit_certify_path("slider", [[0.0], [to]]) for to in (0.1, 0.2))
    with database.write() as session:
        row = jobs.get(session, failed.id)
        jobs.start(session, row)
        error = {"code": "worker_lost", "message": "it was all in vain", "field": None, "hint": ""}
        jobs.finish(session, row, jobs.JobState.FAILED, outcome="error", reason="it was all in vain", error=error)
        row = jobs.get(session, late.id)
        jobs.start(session, row)
        jobs.finish(session, row, jobs.JobState.SUCCEEDED, outcome="inconclusive", reason="the deadline was reached")
    for job, code, words in ((failed, "worker_lost", "all in vain"), (late, "motion_not_found", "the deadline was reached")):
        with pytest.raises(ciris.CirisError, match=words) as caught:
            job.motion()
        assert caught.value.code == code


def test_the_graph_is_complete(service: Any, region: str, database: Database) -> None:
    more, far = store_region(database, a_part(0.1, 0.4)), store_region(database, a_part(0.6, 0.9))
    graph = service.graph("slider")
    assert repr(graph) == "Graph(3 regions, 1 overlap, 2 components)"
    (edge,) = graph.edges
    assert {edge.a, edge.b} == {region, more}
    assert edge.q == pytest.approx([0.15])
    assert far in {graph.gaps[0].a, graph.gaps[0].b}


def test_a_job_is_followed_to_its_region(service: Any, region: str) -> None:
    (job,) = service.jobs("slider", state="succeeded")
    events = list(job.follow())
    assert [event.seq for event in events] == list(range(1, len(events) + 1))
    assert {"job", "iteration", "region"} <= {event.kind for event in events}
    assert (job.wait().ended, job.region_id, job.result().id) == (True, region, region)
    assert repr(job) == f"Job({job.id[:8]}: grow, succeeded, as large as asked for)"


def test_a_job_is_submitted_cancelled_and_retried(service: Any, scene: Scene, database: Database) -> None:
    job = service.submit_grow(service.scene("slider"), [0.0], contain=[0.1], deadline=60, paper={"pushes": 1}, priority=1)
    assert (job.state, job.ended) == ("queued", False)
    with database.read() as session:
        options = jobs.get(session, job.id).options
    assert (options["seed"]["contain"], options["paper"]["pushes"]) == ([[0.1]], 1)
    assert job.cancel().state in ("cancelling", "cancelled")
    again = service.submit_certify("slider", [[1.0], [-1.0]], [0.1, 0.1], cells=4)
    assert (again.kind, again.refresh().id, service.job(again.id[:8]).id) == ("certify", again.id, again.id)


def test_a_job_without_a_region_says_why(service: Any, scene: Scene, database: Database) -> None:
    job = service.submit_grow("slider", [0.0])
    with database.write() as session:
        row = jobs.get(session, job.id)
        jobs.start(session, row)
        jobs.finish(session, row, jobs.JobState.FAILED, reason="it was all in vain")
    with pytest.raises(ciris.CirisError, match="it was all in vain") as caught:
        job.result()
    assert caught.value.code == "job_failed"
    assert job.retry().id != job.id


@pytest.mark.parametrize(
    ("ask", "code", "field"),
    [
        (lambda service: service.scene("slidr"), "scene_not_found", "scene"),
        (lambda service: service.regions("slidr"), "scene_not_found", "scene"),
        (lambda service: service.submit_grow("slider", [0.1, 0.2]), "seed_wrong_length", "seed.q"),
        (lambda service: service.submit_grow("slider", [9]), "seed_outside_limits", "seed.q[0]"),
        (lambda service: service.contains("slider", [[0.1, 0.2]]), "wrong_length", "q[0]"),
        (lambda service: service.contains("slider", [[np.nan]]), "points", "q"),
        (lambda service: service.path("slider"), "points", "q"),
        (lambda service: service.path("slider", [[0.1]]), "invalid_request", "q"),
        (lambda service: service.region("nothing"), "region_not_found", "region"),
        (lambda service: service.regions("slider")[0].contains([0.1, 0.2]), "wrong_length", "q"),
    ],
)
def test_a_mistake_is_said_with_its_place(service: Any, region: str, ask: Any, code: str, field: str) -> None:
    with pytest.raises(ciris.CirisError) as caught:
        ask(service)
    assert (caught.value.code, caught.value.field) == (code, field)


def test_a_wrong_key_is_said(url: str, scene: Scene, database: Database) -> None:
    with database.write() as session:
        key = keys.add(session, "planner", keys.Scope.READ)
    time.sleep(KEYS_SECONDS)
    assert [one.name for one in ciris.connect(url, key).scenes()] == ["slider"]
    for wrong in (None, "nothing"):
        with pytest.raises(ciris.CirisError) as caught:
            ciris.connect(url, wrong).scenes()
        assert caught.value.code in ("key_needed", "key_unknown")


def test_users_code_has_precise_types(tmp_path: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "mypy",
        "--strict",
        "--follow-imports=silent",
        "--config-file",
        os.devnull,
        str(Path(__file__).with_name("typed.py")),
    ]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout


def test_a_service_that_is_not_there_is_said(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CIRIS_DATA_DIR", str(tmp_path))
    monkeypatch.delenv("CIRIS_URL", raising=False)
    with pytest.raises(ciris.CirisError, match="no service is running here"):
        ciris.connect()
    with pytest.raises(ciris.CirisError, match="does not answer"):
        ciris.connect("http://127.0.0.1:9").scenes()


def test_asking_loads_neither_drake_nor_the_service(url: str, region: str) -> None:
    script = f"""
import sys
import ciris
service = ciris.connect({url!r})
(region,) = service.regions("slider")
assert service.contains("slider", region.to_q(region.center)) and service.path("slider", [[0.0], [0.1]])
assert region.proof() and repr(service.graph("slider")) and list(service.jobs()[0].follow())
rooms = {{"pydrake", "numba", "scipy", "sqlalchemy", "pydantic", "flint", "yaml", "api", "db", "workers", "planner", "client", "dashboard"}}
print(sorted(rooms & set(sys.modules)), sorted(name for name in sys.modules if name.startswith("certifier.")))
"""
    done = subprocess.run([sys.executable, "-c", script], cwd=ROOT, capture_output=True, text=True, check=True)
    assert done.stdout == "[] ['certifier.errors', 'certifier.outcome', 'certifier.words']\n"
