"""The command line: exit status, one-line errors, JSON alone on standard output."""

from __future__ import annotations

import io
import json
import signal
import subprocess
import time
from datetime import datetime, timedelta
from pathlib import Path

import httpx2
import numpy as np
import pytest

from certifier.errors import CirisError
from certifier.jobs import local
from certifier.jobs.region import Region
from certifier.jobs.verdict import Verdict
from certifier.model import Scene
from certifier.outcome import Guarantee, Outcome, Stage
from certifier.pair.result import PairResult
from certifier.verify.region import verify_region
from certifier.verify.uncovered import document
from ciris.find import data_dir
from client import output
from client.cli import INTERRUPTED, _joined
from client.files import ProofFile
from db import regions
from db.session import Database
from db.settings import Settings
from tests.certifier.scenes import planar_arm
from tests.client.conftest import PLANAR, ROOT, Ciris, command, surroundings


def test_the_help_documents_the_exit_status(spawn: Ciris) -> None:
    done = spawn("--help")
    assert done.status == 0
    assert "exit status: 0 success; 1 a negative answer" in done.stdout


def test_a_wrong_command_line_is_one_line(ciris: Ciris) -> None:
    for arguments in ((), ("fly",), ("certify", "scene.yaml"), ("grow", "a", "--rounds", "x")):
        done = ciris(*arguments)
        assert (done.status, done.raw) == (2, b"")
        assert "--help" in done.error


def test_without_a_service_the_error_says_what_to_do(ciris: Ciris) -> None:
    done = ciris("scene", "ls")
    assert done.status == 2
    assert "ciris up" in done.error
    assert ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9").error.startswith("the service at http://127.0.0.1:9 does not answer")


def write(path: Path, **arrays: object) -> Path:
    np.savez(path, **arrays)  # type: ignore[arg-type]
    return path


@pytest.fixture
def files(tmp_path: Path) -> Path:
    """Polytopes for the planar arm, one good and many bad."""
    eye, d = np.eye(2), np.full(4, 0.05)
    C = np.concatenate([eye, -eye])
    write(tmp_path / "small.npz", C=C, d=d, center=np.zeros(2))
    write(tmp_path / "empty.npz", C=C, d=-d)
    write(tmp_path / "narrow.npz", C=C[:, :1], d=d)
    write(tmp_path / "ragged.npz", C=C, d=d[:2])
    write(tmp_path / "nan.npz", C=C * np.nan, d=d)
    write(tmp_path / "nothing.npz", A=C)
    write(tmp_path / "pickled.npz", C=np.array([object()], dtype=object), d=d)
    (tmp_path / "text.npz").write_text("no zip")
    (tmp_path / "broken.yaml").write_text("name: arm\ndirectives: {]")
    return tmp_path


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("certify", PLANAR, "--polytope", "missing.npz"), "there is no file missing.npz"),
        (("certify", PLANAR, "--polytope", "text.npz"), "is no npz file of numbers"),
        (("certify", PLANAR, "--polytope", "pickled.npz"), "is no npz file of numbers"),
        (("certify", PLANAR, "--polytope", "nothing.npz"), "has no C and no d"),
        (("certify", PLANAR, "--polytope", "ragged.npz"), "C is 4 x 2 and d is 2"),
        (("certify", PLANAR, "--polytope", "nan.npz"), "must be finite numbers"),
        (("certify", PLANAR, "--polytope", "narrow.npz"), "C is 4 x 1"),
        (("certify", PLANAR, "--polytope", "empty.npz"), "no point satisfies"),
        (("certify", "planar-2dof", "--polytope", "small.npz"), "is not a scene file"),
        (("grow", "nowhere.yaml", "--q", "0,0"), "nowhere.yaml"),
        (("grow", "nowhere.yaml"), "there is no scene file nowhere.yaml"),
        (("grow", "broken.yaml", "--q", "0,0"), "broken.yaml, line 2"),
        (("grow", "broken.yaml"), "--q: no seed was given"),
        (("grow", PLANAR, "--q", "0,nan"), "--q[1]: 'nan' is not a finite number"),
        (("grow", PLANAR, "--q", "0"), "it has 1 number, the scene 2 joints"),
        (("grow", PLANAR, "--q", "0,9"), "--q[1]: joint arm/elbow is at 9 rad, not between its limits"),
        (("grow", PLANAR, "--q", "-1.2,1.0"), "arm/lower/bar and obstacles/body/post overlap"),
        (("grow", PLANAR, "--method", "magic"), "--method"),
        (("grow", PLANAR, "--deadline", "0"), "--deadline: must be a number above 0"),
        (("grow", PLANAR, "--deadline", "nan"), "--deadline: nan is not a finite number"),
        (("grow", PLANAR, "--out", "nowhere/region.proof"), "--out: there is no directory"),
        (("grow", PLANAR, "--out", "."), ". is a directory"),
    ],
)
@pytest.mark.usefixtures("parsed_once")
def test_bad_input_is_one_line_that_says_where(ciris: Ciris, files: Path, arguments: tuple[object, ...], words: str) -> None:
    done = ciris(*arguments, "--local", "--json")
    assert (done.status, done.raw) == (2, b"")
    assert words in done.error


@pytest.mark.usefixtures("parsed_once")
def test_a_deadline_that_no_region_keeps_is_a_negative_answer(ciris: Ciris) -> None:
    done = ciris("grow", PLANAR, "--deadline", "0.001", "--local", "--json")
    assert (done.status, done.raw) == (1, b"")
    assert "the deadline was reached (allow more time)" in done.stderr.splitlines()[-1]


@pytest.mark.parametrize("name", ["../../elsewhere", "/tmp/elsewhere", "..", "a b/c"])
def test_a_scenes_name_leads_the_proof_nowhere_else(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    path = ProofFile(None).write(name, b"proof")
    assert path.resolve().parent == tmp_path.resolve()
    assert path.read_bytes() == b"proof"


@pytest.mark.parametrize("name", ["", ".."])
def test_what_no_name_can_be_is_asked_nobody(ciris: Ciris, name: str) -> None:
    done = ciris("scene", "show", name, CIRIS_URL="http://127.0.0.1:9")
    assert (done.status, done.raw) == (2, b"")
    assert "is no name and no id" in done.error


def test_a_data_directory_that_cannot_be_made_is_said_in_one_line(spawn: Ciris, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    done = spawn("up", "--data", tmp_path / "file")
    assert (done.status, done.raw) == (2, b"")
    assert "cannot be used: File exists" in done.error


def test_certifying_here_prints_the_stable_document(spawn: Ciris, files: Path) -> None:
    done = spawn("certify", PLANAR, "--polytope", "small.npz", "--local", "--json")
    document = done.json
    assert done.status == 0
    assert {"scene", "outcome", "guarantee", "seconds", "pairs"} <= set(document)
    assert (document["scene"]["name"], document["outcome"], document["guarantee"]) == ("planar-2dof", "certified", "exact")
    assert len(document["pairs"]) == 6
    for pair in document["pairs"]:
        assert {"a", "b", "outcome", "proved_distance", "seconds", "stage", "witness_q"} <= set(pair)
        assert (pair["outcome"], pair["witness_q"]) == ("certified", None)


@pytest.mark.usefixtures("parsed_once")
def test_a_certified_polytope_gets_its_proof(ciris: Ciris, files: Path) -> None:
    done = ciris("certify", PLANAR, "--polytope", "small.npz", "--local", "--out", "small.proof", "--json")
    assert (done.status, done.json["outcome"], done.json["proof"]) == (0, "certified", "small.proof")
    checked = ciris("verify", "small.proof", "--json")
    assert checked.status == 0
    refused = ciris("certify", PLANAR, "--polytope", "small.npz", "--local", "--backend", "drake", "--out", "small.proof")
    assert (refused.status, "Drake writes no proof" in refused.error) == (2, True)


def test_a_polytope_may_be_a_document(ciris: Ciris, files: Path) -> None:
    with np.load("small.npz") as arrays:
        document = {name: arrays[name].tolist() for name in arrays.files}
    Path("small.json").write_text(json.dumps(document))
    Path("small.yaml").write_text(json.dumps(document))
    region = {"halfspace_normals": document["C"], "halfspace_offsets": document["d"], "interior_point": document["center"]}
    Path("region.json").write_text(json.dumps(region))
    for name in ("small.json", "small.yaml", "region.json"):
        assert ciris("certify", PLANAR, "--polytope", name, "--local", "--json").json["outcome"] == "certified"
    Path("broken.json").write_text("{")
    Path("list.yaml").write_text("[1, 2]")
    Path("words.yaml").write_text("C: hello\nd: [1]")
    Path("poly.txt").write_text("1 2 3")
    for name, words in (
        ("broken.json", "is no JSON file of numbers"),
        ("list.yaml", "list.yaml: it must be a mapping"),
        ("words.yaml", "words.yaml: C must be a finite number, not 'hello'"),
        ("poly.txt", "is neither .npz nor .json nor .yaml"),
    ):
        done = ciris("certify", PLANAR, "--polytope", name, "--local")
        assert (done.status, words in done.error) == (2, True)


def test_growing_here_says_what_happens(ciris: Ciris) -> None:
    quiet = ciris("grow", PLANAR, "--local", "--out", "a.proof")
    assert quiet.status == 0
    said = quiet.stderr.splitlines()
    assert any(line.startswith("seeding: done after") for line in said)
    assert any(line.startswith("certified region of iteration") and "% of the proposal" in line for line in said)
    assert not any(line.startswith("  1/") for line in said)
    watched = ciris("grow", PLANAR, "--local", "--watch", "--out", "b.proof").stderr
    assert "  1/" in watched


@pytest.mark.slow
def test_who_interrupts_growing_has_the_best_region_so_far(tmp_path: Path) -> None:
    scene, out = ROOT / "examples" / "ur3e_bin" / "scene.yaml", tmp_path / "so_far.proof"
    growing = subprocess.Popen(
        command("grow", scene, "--local", "--cells", "200", "--out", out),
        cwd=tmp_path,
        env=surroundings(CIRIS_DATA_DIR=str(tmp_path / "data")),
        stderr=subprocess.PIPE,
        text=True,
    )
    assert growing.stderr is not None
    said = [next(line for line in growing.stderr if line.startswith("its proof:"))]
    growing.send_signal(signal.SIGINT)
    said += growing.stderr
    assert growing.wait(60) == INTERRUPTED
    assert f"the proof of the best region so far: {out}" in "".join(said)
    assert verify_region(out.read_bytes()).gap > 0
    assert list(tmp_path.glob("*proof*")) == [out]


def test_a_polytope_is_certified_cell_by_cell(ciris: Ciris, files: Path) -> None:
    document = ciris("certify", PLANAR, "--polytope", "small.npz", "--local", "--cells", "300", "--json").json
    assert document["outcome"] == "certified"
    assert {pair["stage"] for pair in document["pairs"]} == {"cells"}


@pytest.mark.usefixtures("parsed_once")
def test_bodies_that_are_too_close_are_no_collision(ciris: Ciris, files: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    detail = "the padded bodies are 0.1 mm apart, too close for a plane"
    near = PairResult(Outcome.TOO_CLOSE, Stage.CELLS, witness_s=np.zeros(2), detail=detail)
    monkeypatch.setattr(local, "certify", lambda *_: Verdict({0: near}, Guarantee.EXACT, 0.1))
    done = ciris("certify", PLANAR, "--polytope", "small.npz", "--local", "--cells", "300")
    assert done.status == 1
    assert f"arm/lower/bar and obstacles/body/block: {detail}, at q = (0, 0) rad\n" in done.stdout
    assert "collision" not in done.stdout
    assert done.stdout.splitlines()[-1].startswith("planar-2dof: too close, guarantee none")


@pytest.mark.usefixtures("parsed_once")
def test_drakes_answer_is_numeric_at_most(ciris: Ciris, files: Path) -> None:
    arguments = ("certify", PLANAR, "--local", "--backend", "drake", "--json", "--polytope")
    done = ciris(*arguments, "small.npz")
    assert (done.status, done.json["outcome"], done.json["guarantee"]) == (0, "certified", "numeric")
    assert {pair["detail"] for pair in done.json["pairs"]} == {"clarabel: SolutionFound (Solved)"}
    write(files / "large.npz", C=np.concatenate([np.eye(2), -np.eye(2)]), d=np.full(4, 0.6))
    done = ciris(*arguments, "large.npz", "--solver", "scs")
    assert (done.status, done.json["outcome"], done.json["guarantee"]) == (1, "not_certifiable", "none")


@pytest.mark.usefixtures("parsed_once")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--local", "--backend", "drake", "--solver", "best"), "solver: best is unknown (available: clarabel"),
        (("--local", "--solver", "scs"), "add --backend drake"),
        (("--backend", "drake"), "add --local"),
        (("--local", "--backend", "drake", "--cells", "9"), "knows no cells"),
        (("--local", "--cells", "0"), "--cells: must be an integer from 1"),
    ],
)
def test_drake_and_its_solvers_are_asked_for_properly(ciris: Ciris, files: Path, arguments: tuple[str, ...], words: str) -> None:
    done = ciris("certify", PLANAR, "--polytope", "small.npz", *arguments)
    assert (done.status, done.raw) == (2, b"")
    assert words in done.error


@pytest.mark.usefixtures("parsed_once")
def test_a_collision_is_a_negative_answer_with_its_witness(ciris: Ciris, tmp_path: Path) -> None:
    write(tmp_path / "all.npz", C=np.zeros((0, 2)), d=np.zeros(0))
    done = ciris("certify", PLANAR, "--polytope", "all.npz", "--local")
    assert done.status == 1
    assert "arm/lower/bar and obstacles/body/block touch at q = (" in done.stdout
    assert done.stdout.splitlines()[-1].startswith("planar-2dof: refuted, guarantee none")


def test_a_proof_that_holds_says_what_it_proves(ciris: Ciris, certified: Region, tmp_path: Path) -> None:
    (tmp_path / "good.proof").write_bytes(certified.proof)
    done = ciris("verify", "good.proof")
    assert (done.status, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["the proof holds:", *(f"  {line}" for line in certified.statement.lines())]
    assert ciris("verify", "good.proof", "--json").json["holds"] is True


def test_a_proof_that_does_not_hold_is_a_negative_answer(ciris: Ciris, certified: Region, tmp_path: Path) -> None:
    damaged = bytearray(certified.proof)
    damaged[certified.proof.index(b"NUMPY")] ^= 1
    (tmp_path / "bad.proof").write_bytes(damaged)
    done = ciris("verify", "bad.proof", "--json")
    assert (done.status, done.json["holds"]) == (1, False)
    assert "does not hold" in done.error
    missing = ciris("verify", "missing.proof")
    assert (missing.status, missing.error) == (2, "missing.proof: there is no such file or directory (name a proof file)")


def test_scenes_are_added_listed_and_shown(ciris: Ciris, url: str) -> None:
    added = ciris("scene", "add", PLANAR, "--json", "--url", url)
    assert (added.status, added.json["name"]) == (0, "planar-2dof")
    assert [scene["id"] for scene in ciris("scene", "ls", "--json", CIRIS_URL=url).json] == [added.json["id"]]
    shown = ciris("scene", "show", "planar-2dof", CIRIS_URL=url)
    assert "arm/elbow" in shown.stdout
    assert "arm/lower/bar - obstacles/body/post" in shown.stdout
    assert len(ciris("scene", "show", "planar-2dof", "--json", CIRIS_URL=url).json["pair_list"]) == 6
    unknown = ciris("scene", "show", "nope", CIRIS_URL=url)
    assert (unknown.status, unknown.error) == (2, "scene: there is no scene 'nope' (`ciris scene ls`, or `scenes()` in Python, lists them)")


def test_regions_are_listed_shown_and_exported(ciris: Ciris, url: str, region: str, certified: Region) -> None:
    assert [r["id"] for r in ciris("region", "ls", "--scene", "slider", "--json", CIRIS_URL=url).json] == [region]
    assert region in ciris("region", "ls", CIRIS_URL=url).stdout
    assert ciris("region", "show", region, "--json", CIRIS_URL=url).json == certified.manifest
    shown = " ".join(ciris("region", "show", region, CIRIS_URL=url).stdout.split())
    assert "guarantee exact" in shown
    assert "joints model/slide: -0.3 to 0.2 m" in shown
    kept = output.share(certified.manifest["share"])
    assert f"share {kept} of the proposal's" in shown
    assert kept in ciris("region", "ls", CIRIS_URL=url).stdout
    assert ciris("region", "export", region, "--name", "here", CIRIS_URL=url).json == {"name": "here", **certified.manifest}
    with np.load(io.BytesIO(ciris("region", "export", region, "--format", "npz", CIRIS_URL=url).raw)) as arrays:
        assert arrays["C"].tolist() == certified.manifest["halfspace_normals"]
    assert verify_region(ciris("region", "export", region, "--format", "proof", CIRIS_URL=url).raw).faces == 4


def test_what_a_region_does_not_cover_is_said_where_it_is_shown(ciris: Ciris, url: str, region: str, database: Database) -> None:
    with database.write() as session:
        row = regions.get(session, region)
        row.manifest = {**row.manifest, "not_covered": document(planar_arm(2))}
    said = ["1 pair of neighbouring links is not covered", "  1 of arm/link1 and arm/link2: neighbours"]
    shown = ciris("region", "show", region, CIRIS_URL=url).stdout.splitlines()
    assert shown[-2:] == said
    (pairs,) = (i for i, line in enumerate(shown) if line.startswith("  pairs "))
    assert shown[pairs + 1].strip() == said[0]
    scene = ciris("scene", "show", "slider", CIRIS_URL=url).stdout.splitlines()
    assert "every pair of bodies that can move against each other is covered" in scene


def test_an_export_overwrites_nothing(ciris: Ciris, url: str, region: str, tmp_path: Path) -> None:
    assert ciris("region", "export", region, "--out", "a.json", CIRIS_URL=url).status == 0
    written = (tmp_path / "a.json").read_bytes()
    again = ciris("region", "export", region, "--format", "npz", "--out", "a.json", CIRIS_URL=url)
    assert (again.status, again.error) == (2, "--out: a.json is there already (move it away, or name another file)")
    assert (tmp_path / "a.json").read_bytes() == written
    nowhere = ciris("region", "export", region, "--out", "no/a.json", CIRIS_URL=url)
    assert (nowhere.status, "there is no directory" in nowhere.error) == (2, True)


def test_the_region_of_another_robot_is_not_certified_here(ciris: Ciris, url: str, region: str, certified: Region, tmp_path: Path) -> None:
    for format in ("json", "npz"):
        file = f"region.{format}"
        assert ciris("region", "export", region, "--format", format, "--out", file, CIRIS_URL=url).status == 0
        here = ciris("certify", PLANAR, "--polytope", file, "--local")
        assert (here.status, "has the joints model/slide, and the scene arm/shoulder, arm/elbow" in here.error) == (2, True)
        there = ciris("certify", PLANAR, "--polytope", file, CIRIS_URL=url)
        assert (there.status, there.error) == (2, here.error)
    moved = {**certified.manifest, "space": {**certified.manifest["space"], "q_star": [0.5]}}
    (tmp_path / "moved.json").write_text(json.dumps(moved))
    other = ciris("certify", "slider", "--polytope", "moved.json", CIRIS_URL=url)
    assert (other.status, "is about q* = 0.5, and the scene about 0" in other.error) == (2, True)
    assert httpx2.get(f"{url}/v1/jobs?kind=certify").json()["jobs"] == []


def test_a_region_that_was_stored_before_there_were_shares_is_shown(certified: Region, capsys: pytest.CaptureFixture[str]) -> None:
    older = {name: value for name, value in certified.manifest.items() if name not in ("share", "joint_ranges", "not_covered")}
    output.print_region(older)
    lines = capsys.readouterr().out.splitlines()
    assert ["joints", "model/slide"] in [line.split() for line in lines]
    assert not any("share" in line for line in lines)


def test_a_region_of_a_scene_without_pairs_that_was_stored_before_is_not_called_certified(
    certified: Region, capsys: pytest.CaptureFixture[str]
) -> None:
    output.print_region({**certified.manifest, "pairs": []})
    said = capsys.readouterr().out
    assert "no pair of bodies can collide in this scene" in said
    assert "certified" not in said


@pytest.mark.parametrize("command", [("grow", "--q", "0"), ("map",), ("certify-path", "--q", "0", "--q", "0.1")], ids=lambda c: c[0])
def test_nothing_is_proved_here_about_a_scene_without_pairs(ciris: Ciris, tmp_path: Path, command: tuple[str, ...]) -> None:
    (tmp_path / "rail.urdf").write_text(
        '<robot name="rail"><link name="base"/><link name="tip"><collision><geometry><sphere radius="0.1"/></geometry></collision></link>'
        '<joint name="slide" type="prismatic"><parent link="base"/><child link="tip"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'
        "</joint></robot>"
    )
    directives = "directives:\n  - add_model: {name: rail, file: rail.urdf}\n  - add_weld: {parent: world, child: rail::base}\n"
    (tmp_path / "scene.yaml").write_text(f"name: rail\n{directives}q_star: [0.0]\n")
    name, *given = command
    done = ciris(name, "scene.yaml", *given, "--local")
    assert done.status == 2
    assert done.error.startswith("scene: no pair of bodies can collide in this scene, so there is nothing to prove (give the robot's links")


def test_contains_answers_by_its_exit_status(ciris: Ciris, url: str, region: str) -> None:
    inside = ciris("contains", "slider", "--q", "-0.2", CIRIS_URL=url)
    assert (inside.status, inside.stdout.startswith(f"inside: -0.2 in {region} (margin 0.1, exact)")) == (0, True)
    outside = ciris("contains", "slider", "--q", "0.1", "--q", "0.9", "--q", "5", "--json", CIRIS_URL=url)
    assert outside.status == 1
    assert [point["inside"] for point in outside.json["points"]] == [True, False, False]
    assert [point.get("trouble") for point in outside.json["points"]] == [None, [], ["the joint model/slide is beyond its limits"]]
    told = ciris("contains", "slider", *["--q=0.9"] * 101, "--q=5", CIRIS_URL=url).stdout.splitlines()
    assert told == [
        *["outside: 0.9 is not in the scene's one region, though floating point finds nothing wrong there"] * 101,
        "outside: 5 is not in the scene's one region: the joint model/slide is beyond its limits",
    ]
    wrong = ciris("contains", "slider", "--q", "0,1", CIRIS_URL=url)
    assert (wrong.status, wrong.error.startswith("--q[0]: 2 numbers were given")) == (2, True)


def test_a_scene_of_the_service_gets_conditions(ciris: Ciris, url: str, scene: Scene, tmp_path: Path) -> None:
    (tmp_path / "low.yaml").write_text("conditions:\n  - name: low\n    inside: {what: [model/cart], half_spaces: [[0, 0, 1, 0.5]]}\n")
    made = ciris("scene", "constrain", "slider", "low.yaml", "--name", "low-slider", CIRIS_URL=url)
    assert made.status == 0, made.error
    first, statement = made.stdout.splitlines()
    assert first.endswith("  low-slider")
    assert statement.startswith("condition 'low': 'model/")
    assert ciris("scene", "show", "low-slider", "--json", CIRIS_URL=url).json["conditions"][0]["name"] == "low"
    (tmp_path / "high.yaml").write_text("conditions:\n  - name: high\n    inside: {what: [model/cart], half_spaces: [[0, 0, -1, -0.6]]}\n")
    both = ciris("scene", "constrain", "low-slider", "high.yaml", "--name", "no-slider", CIRIS_URL=url)
    assert both.stderr.splitlines()[-1].startswith("warning: the conditions 'low' and 'high' exclude each other")
    assert ciris("scene", "show", "no-slider", "--json", CIRIS_URL=url).json["warnings"] > 0
    (tmp_path / "none.yaml").write_text("name: low\n")
    wrong = ciris("scene", "constrain", "slider", "none.yaml", "--name", "x", CIRIS_URL=url)
    assert (wrong.status, wrong.error.startswith("none.yaml: name: is not a key of a scene file")) == (2, True)
    gone = ciris("scene", "constrain", "slider", "gone.yaml", "--name", "x", CIRIS_URL=url)
    assert (gone.status, "the file gone.yaml cannot be read" in gone.error) == (2, True)


def test_who_loses_the_service_is_told_how_to_come_back(ciris: Ciris, url: str, scene: Scene, monkeypatch: pytest.MonkeyPatch) -> None:
    def lost(*_: object) -> None:
        raise CirisError("unreachable", f"the service at {url} does not answer")

    monkeypatch.setattr("client.service.follow", lost)
    done = ciris("grow", "slider", "--q", "0", "--deadline", "3600", CIRIS_URL=url)
    assert done.status == 2
    assert "come back to it with `ciris job follow" in done.stderr.splitlines()[-2]
    assert "does not answer" in done.stderr.splitlines()[-1]


def test_an_interrupted_wait_leaves_the_job_alone(url: str, scene: Scene, tmp_path: Path) -> None:
    environment = surroundings(CIRIS_DATA_DIR=str(tmp_path), CIRIS_URL=url)
    asked = command("grow", "slider", "--q", "0", "--deadline", "3600")
    waiting = subprocess.Popen(asked, cwd=tmp_path, env=environment, stderr=subprocess.PIPE, text=True)
    assert waiting.stderr is not None
    assert waiting.stderr.readline().startswith("job ")
    time.sleep(1)
    waiting.send_signal(signal.SIGINT)
    _, said = waiting.communicate(timeout=20)
    assert waiting.returncode == 130
    assert "Traceback" not in said
    lines = said.splitlines()
    assert "goes on while the service runs" in lines[-3]
    assert lines[-1] == "error: interrupted"
    (job,) = httpx2.get(f"{url}/v1/jobs").json()["jobs"]
    short = job["id"][:8]
    assert lines[-2] == f"come back to it with `ciris job follow {short}`, or end it with `ciris job cancel {short}`"
    assert job["state"] == "queued"
    job = httpx2.get(f"{url}/v1/jobs/{job['id']}").json()
    made, ends = (datetime.fromisoformat(job[name]) for name in ("created_at", "deadline_at"))
    assert ends - made == timedelta(hours=1)


def test_a_queue_that_is_down_is_one_warning(url: str, scene: Scene, environment: pytest.MonkeyPatch, tmp_path: Path) -> None:
    environment.setenv("CIRIS_REDIS_URL", "redis+socket:///tmp/there-is-no-queue?virtual_host=0")
    from db.settings import settings
    from workers.app import celery_app

    settings.cache_clear()
    celery_app.cache_clear()
    variables = surroundings(CIRIS_DATA_DIR=str(tmp_path), CIRIS_URL=url)
    waiting = subprocess.Popen(command("grow", "slider", "--q", "0"), cwd=tmp_path, env=variables, stderr=subprocess.PIPE, text=True)
    assert waiting.stderr is not None
    said = [waiting.stderr.readline() for _ in range(2)]
    waiting.kill()
    waiting.communicate()
    assert said[1].startswith("warning: the job waits until the service has all that it needs (queue: Redis cannot be reached")


def test_doctor_lists_what_is_there(ciris: Ciris) -> None:
    done = ciris("doctor", "--json")
    findings = {finding["name"]: finding for finding in done.json}
    assert done.status == 0
    assert "Clarabel" in findings["drake solvers"]["text"]
    assert findings["exact arithmetic"]["good"]
    assert not any("PROBLEM" in json.dumps(finding) for finding in findings.values())
    assert ciris("doctor", CIRIS_URL="http://127.0.0.1:9").status == 1


def test_a_list_that_begins_with_a_minus_is_no_option() -> None:
    assert _joined(["grow", "s", "--q", "-1,2", "--json"]) == ["grow", "s", "--q=-1,2", "--json"]
    assert _joined(["contains", "s", "--q", "-.5", "--q", "1"]) == ["contains", "s", "--q=-.5", "--q", "1"]
    assert _joined(["grow", "--q", "--json"]) == ["grow", "--q", "--json"]


@pytest.mark.parametrize("variables", [{}, {"XDG_DATA_HOME": "/data"}, {"CIRIS_DATA_DIR": "/srv/ciris"}, {"CIRIS_DATA_DIR": "~/x"}])
def test_client_and_service_agree_on_the_data_directory(monkeypatch: pytest.MonkeyPatch, variables: dict[str, str]) -> None:
    for name in ("XDG_DATA_HOME", "CIRIS_DATA_DIR"):
        monkeypatch.delenv(name, raising=False)
    for name, value in variables.items():
        monkeypatch.setenv(name, value)
    assert data_dir() == Settings().data_dir.expanduser()
