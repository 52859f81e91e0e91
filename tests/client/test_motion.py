"""``ciris certify-path``: waypoints from the command line and from files, what is printed, and what is refused."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from certifier.errors import RegionError
from certifier.model import Scene
from client import number_files
from client.path_files import path_file
from tests.client.conftest import PLANAR, Ciris

FREE, TOUCHING = ("0.2,-0.4", "-0.4,0.3"), ("0,0", "2,2")


def test_a_motion_is_certified_and_its_proof_kept(ciris: Ciris, tmp_path: Path) -> None:
    proof = tmp_path / "motion.proof"
    done = ciris("certify-path", PLANAR, "--q", FREE[0], "--q", FREE[1], "--local", "--tube", "--out", proof)
    assert done.status == 0, done.stderr
    for word in ("certified, guarantee exact", "straight in q", "tube", "rad", f"ciris verify {proof}"):
        assert word in done.stdout
    checked = ciris("verify", proof)
    assert checked.status == 0
    assert "all along it the padded bodies" in checked.stdout


def test_a_contact_is_a_negative_answer_with_the_time_of_the_file(ciris: Ciris, tmp_path: Path) -> None:
    path = tmp_path / "path.json"
    path.write_text(json.dumps({"q": [[0.0, 0.0], [2.0, 2.0]], "t": [10.0, 12.0]}))
    done = ciris("certify-path", PLANAR, "--path", path, "--local", "--json")
    found = json.loads(done.stdout)
    assert (done.status, found["outcome"], found["proof"]) == (1, "refuted", None)
    assert found["stop"]["t"] == pytest.approx(10 + 2 * found["stop"]["time"])
    done = ciris("certify-path", PLANAR, "--path", path, "--local")
    assert "touch" in done.stdout
    assert re.search(r"^q = \(\S+, \S+\) rad$", done.stdout, re.MULTILINE)
    assert "all pairs are certified up to" in done.stdout


def test_the_service_answers_as_well(ciris: Ciris, url: str, scene: Scene, tmp_path: Path) -> None:
    proof = tmp_path / "motion.proof"
    done = ciris("certify-path", "slider", "--q", "0.1", "--q", "-0.3", "--url", url, "--out", proof)
    assert (done.status, done.stderr) == (0, "")
    assert "certified, guarantee exact" in done.stdout
    assert ciris("verify", proof).status == 0
    refused = ciris("certify-path", "slider", "--q", "0.1", "--q", "99", "--url", url)
    assert refused.error.startswith("--q[1][0]: joint ")


def test_a_job_prints_what_the_service_says_at_once(ciris: Ciris, url: str, worker: None, scene: Scene, tmp_path: Path) -> None:
    proof, motion = tmp_path / "motion.proof", ("certify-path", "slider", "--q", "0.1", "--q", "-0.3", "--tube", "--url", url)
    done = ciris(*motion, "--job", "--deadline", "600", "--out", proof)
    assert done.status == 0, done.stderr
    assert "certified, guarantee exact" in done.stdout
    assert "certifying the motion: done after" in done.stderr
    assert ciris("verify", proof).status == 0
    at_once, by_job = ciris(*motion, "--json").json, ciris(*motion, "--job", "--json").json
    for document in (at_once, by_job):
        assert document.pop("seconds") >= document.pop("verify_seconds") > 0
    assert by_job == at_once
    (job, *_) = ciris("job", "ls", "--json", "--url", url).json
    shown = ciris("job", "show", job["id"], "--url", url).stdout
    assert "certify-path" in shown
    assert "every pair is certified all along the motion" in shown
    refused = ciris("certify-path", "slider", "--q", "0.1", "--q", "99", "--job", "--url", url)
    assert refused.error.startswith("--q[1][0]: joint ")


def test_a_curve_is_certified_here_and_by_the_service(ciris: Ciris, url: str, scene: Scene, tmp_path: Path) -> None:
    path, proof = tmp_path / "curve.json", tmp_path / "motion.proof"
    path.write_text(json.dumps({"knots": [0, 0, 0, 0, 2, 3, 3, 3, 3], "control_points": [[0.1], [-0.2], [-0.3], [0.2], [0.0]]}))
    done = ciris("certify-path", "slider", "--path", path, "--url", url, "--out", proof)
    assert (done.status, done.stderr) == (0, "")
    assert "2 pieces of degree 3 in q" in done.stdout
    assert "a motion of 2 polynomial pieces of degree 3 in q" in ciris("verify", proof).stdout
    path.write_text(json.dumps({"bezier": [[[0.1], [99.0], [0.0]]]}))
    refused = ciris("certify-path", "slider", "--path", path, "--url", url)
    assert refused.error.startswith("--path bezier[0][1][0]: joint ")
    path.write_text(json.dumps({"bezier": [[[0.0, 0.0], [2.0, 0.0], [2.0, 2.0]]], "t": [1.0, 3.0]}))
    done = ciris("certify-path", PLANAR, "--path", path, "--local", "--json")
    found = json.loads(done.stdout)
    assert (done.status, found["outcome"], found["degree"], found["waypoints"]) == (1, "refuted", 2, 2)
    assert found["stop"]["t"] == pytest.approx(1 + 2 * found["stop"]["time"])
    assert "of the time of piece 0, t = " in ciris("certify-path", PLANAR, "--path", path, "--local").stdout
    path.write_text(json.dumps({"bezier": [[[0.0, 0.0], [0.1, 0.0]], [[0.2, 0.0], [0.1, 0.0]]]}))
    assert ciris("certify-path", PLANAR, "--path", path, "--local").error.startswith("--path bezier[1][0]: piece 1 does not begin")


def test_clearance_and_padding_are_printed_here_and_by_the_service(ciris: Ciris, url: str, scene: Scene, tmp_path: Path) -> None:
    motion = ("--q", FREE[0], "--q", FREE[1], "--local")
    assert "proved distance  at least" in ciris("certify-path", PLANAR, *motion).stdout
    done = ciris("certify-path", PLANAR, *motion, "--clearance")
    for word in ("clearance  at least", "closest", "mm apart", "of the way from waypoint 0 to 1", "q = "):
        assert word in done.stdout
    found = ciris("certify-path", PLANAR, *motion, "--clearance", "--json").json
    assert (
        max(0.9 * found["nearest"]["distance"], found["nearest"]["distance"] - 1e-4) <= found["clearance"] <= found["nearest"]["distance"]
    )
    half = found["clearance"] / 2
    kept = ciris("certify-path", PLANAR, *motion, "--padding", f"{half - 1e-6}", "--out", tmp_path / "kept.proof")
    assert kept.status == 0, kept.stderr
    assert "m around every body, beyond the scene's" in kept.stdout
    assert "m apart" in ciris("verify", tmp_path / "kept.proof").stdout
    broken = ciris("certify-path", PLANAR, *motion, "--padding", f"{half + 1e-4}")
    assert (broken.status, "less than the padding asks for" in broken.stdout) == (1, True)
    refused = ciris("certify-path", PLANAR, *motion, "--padding", "-1")
    assert refused.error.startswith("--padding: must be from 0 to 1e+06 metres, not -1")
    asked = ("certify-path", "slider", "--q", "0.1", "--q", "-0.3", "--clearance", "--padding", "0.001", "--url", url)
    answer = ciris(*asked, "--json").json
    assert (answer["outcome"], answer["padding"]) == ("certified", 0.001)
    assert 0.002 <= answer["clearance"] == answer["proved_distance"]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--local"], "--path: a motion needs its waypoints"),
        (["--q", "0,0", "--local"], "a motion has two waypoints or more, not 1 (give two or more, with 2 numbers each, in order: arm/"),
        (["--q", "0,0,0,0", "--q", "0,0,0,0", "--local"], "--q: each waypoint has 4 numbers, and the scene has 2 joints that can move"),
        (["--q", "0,0", "--q", "0", "--local"], "different numbers of joints"),
        (["--q", "0,0", "--q", "0,x", "--local"], "--q 1[1]: 'x' is not a finite number"),
        (["--q", "0,0", "--q", "0,99", "--local"], "--q[1][1]: joint "),
        (["--q", "0,0", "--q", "0,0.1", "--local", "--job"], "--job: a job needs a service"),
        (["--q", "0,0", "--q", "0,0.1", "--deadline", "9"], "--deadline: is an option of --job (add --job)"),
        (["--q", "0,0", "--q", "0,0.1"], "ciris up"),
        (["--path", "nothing.npz", "--local"], "there is no file nothing.npz"),
    ],
)
def test_what_cannot_be_a_motion_is_said_in_one_line(ciris: Ciris, arguments: list[str], words: str) -> None:
    done = ciris("certify-path", PLANAR, *arguments)
    assert (done.status, done.stdout) == (2, "")
    assert words in done.error


def test_files_of_every_kind_say_the_same(tmp_path: Path) -> None:
    s, t = np.array([[0.1, -0.2], [0.3, 0.4], [0.5, 0.25]]), np.array([0.0, 1.0, 2.5])
    np.savez(tmp_path / "a.npz", s=s, t=t)
    (tmp_path / "a.json").write_text(json.dumps({"s": s.tolist(), "t": t.tolist()}))
    (tmp_path / "a.yaml").write_text(f"s: {s.tolist()}\nt: {t.tolist()}\n")
    rows = "\n".join(f"{time},{x},{y}" for time, (x, y) in zip(t, s, strict=True))
    (tmp_path / "a.csv").write_text(f"t,s1,s2\n{rows}\n\n")
    for suffix in ("npz", "json", "yaml", "csv"):
        found = path_file(str(tmp_path / f"a.{suffix}"))
        assert (found.motion, found.times) == ({"s": s.tolist()}, t.tolist())
    (tmp_path / "b.csv").write_text("0.1,-0.2\n0.3,0.4\n")
    found = path_file(str(tmp_path / "b.csv"))
    assert (found.motion, found.times) == ({"q": s[:2].tolist()}, None)


def test_files_of_curves_say_the_same(tmp_path: Path) -> None:
    points, knots = np.array([[0.1, -0.2], [0.3, 0.4], [0.5, 0.25], [0.2, 0.0]]), np.array([0.0, 0, 0, 0.5, 2, 2, 2])
    pieces, t = np.array([points, points[::-1]]), np.array([3.0, 4.0, 6.0])
    for name, arrays in (("spline", {"knots": knots, "control_points": points}), ("pieces", {"bezier": pieces, "t": t})):
        np.savez(tmp_path / f"{name}.npz", **arrays)
        (tmp_path / f"{name}.json").write_text(json.dumps({key: array.tolist() for key, array in arrays.items()}))
        (tmp_path / f"{name}.yaml").write_text("\n".join(f"{key}: {array.tolist()}" for key, array in arrays.items()))
        for suffix in ("npz", "json", "yaml"):
            found = path_file(str(tmp_path / f"{name}.{suffix}"))
            assert found.motion == {key: array.tolist() for key, array in arrays.items() if key != "t"}
            assert found.times == (t.tolist() if name == "pieces" else [0.0, 0.5, 2.0])


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("a.txt", "0 0", "neither .npz"),
        ("a.json", "[1]", "it must be a mapping"),
        ("a.json", '{"x": [[1]]}', "either q or s"),
        ("a.json", '{"q": [[1]], "bezier": [[[1], [2]]]}', "either q or s, or one curve"),
        ("a.json", '{"knots": [0, 0, 1, 1]}', "either q or s, or one curve"),
        ("a.json", '{"knots": [0, 0, 1, 1], "control_points": [[0], [1]], "t": [0, 1]}', "leave t out"),
        ("a.json", '{"bezier": [[[0], [1]]], "t": [0, 1, 2]}', "for each piece's beginning and for the end"),
        ("a.json", '{"bezier": [[[0], [1]], [[1]]]}', "no JSON file"),
        ("a.json", '{"q": [[1]], "s": [[1]]}', "either q or s"),
        ("a.json", '{"q": [[1], [2]], "t": [1, 1]}', "ascending"),
        ("a.json", '{"q": [[1], ["x"]]}', "q[1][0] must be a finite number, not 'x'"),
        ("a.json", '{"q": [[1], ["2"]]}', "q[1][0] must be a finite number, not '2'"),
        ("a.json", '{"q": [[1], [true]]}', "q[1][0] must be a finite number, not 'True'"),
        ("a.json", '{"q": ["home", ["2"]]}', "q[1][0] must be a finite number, not '2'"),
        ("a.json", '{"s": [[1], [NaN]]}', "s[1][0] must be a finite number, not 'nan'"),
        ("a.yaml", "q: [[1], [.inf]]", "q[1][0] must be a finite number, not 'inf'"),
        ("a.yaml", "q: [[1], ['1_0']]", "q[1][0] must be a finite number, not '1_0'"),
        ("a.csv", "0,0\n0,nan\n", "waypoint 1: 'nan' is no finite number"),
        ("a.csv", "0,0\n0,1_0\n", "waypoint 1: '1_0' is no finite number"),
        ("a.npz", "x", "no npz file"),
        ("a.yaml", "q: [", "no YAML file"),
        ("a.csv", "0,0\n0,x\n", "waypoint 1: 'x' is no finite number"),
        ("a.csv", "0,0\n0\n", "waypoint 1: it must have 2 numbers"),
        ("a.csv", "", "no CSV file"),
        ("a.csv", "elbow,shoulder\n0,0\n0,1\n", "their names elbow, shoulder are not looked up"),
        ("a.csv", "q2,q1\n0,0\n0,1\n", "are not looked up"),
        ("a.csv", "t,shoulder,swivel\n0,0,0\n1,0,1\n", "are not looked up"),
    ],
)
def test_a_bad_file_is_refused_with_what_is_wrong(tmp_path: Path, name: str, content: str, words: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(RegionError) as refusal:
        path_file(str(tmp_path / name))
    assert words in str(refusal.value)
    assert refusal.value.field == "--path"


def test_yaml_has_numbers_with_exponents(tmp_path: Path) -> None:
    """YAML 1.1, which PyYAML reads by itself, takes 1e-3 for a text."""
    (tmp_path / "a.yaml").write_text("q: [[1e-3, -2E+0], [.5, 3]]")
    assert path_file(str(tmp_path / "a.yaml")).motion == {"q": [[0.001, -2.0], [0.5, 3.0]]}


def test_numbers_that_are_not_finite_are_refused_in_arrays(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", q=[[0.0], [np.nan]])
    with pytest.raises(RegionError, match="q has numbers that are not finite"):
        path_file(str(tmp_path / "a.npz"))


@pytest.mark.parametrize("suffix", ["csv", "json", "yaml"])
def test_a_file_without_an_end_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    monkeypatch.setattr(number_files, "LARGEST", 1000)
    endless = tmp_path / f"a.{suffix}"
    endless.symlink_to("/dev/zero")
    with pytest.raises(RegionError, match="it has more than 1000 bytes"):
        path_file(str(endless))
