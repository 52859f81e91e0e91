"""``ciris map`` as users run it."""

from __future__ import annotations

import os
import signal
from pathlib import Path

import pytest

from client import map
from client.output import Screen
from tests.client.conftest import PLANAR, Ciris


def test_a_map_is_grown_and_its_file_holds(ciris: Ciris, tmp_path: Path) -> None:
    done = ciris("map", PLANAR, "--local", "--coverage", "0.5", "--at", "0,0", "--out", "planar.proof")
    assert done.status == 0
    assert "q = (0, 0) rad: proved" in done.stdout
    assert "% of the free configurations proved" in done.stdout
    assert "check it: ciris verify planar.proof" in done.stdout
    checked = ciris("verify", "planar.proof", "--json")
    assert (checked.status, checked.json["kind"], checked.json["guarantee"]) == (0, "map", "exact")


def test_motions_are_covered_first(ciris: Ciris, tmp_path: Path) -> None:
    (tmp_path / "way.csv").write_text("0,0\n0.35,-0.1\n")
    (tmp_path / "through.csv").write_text("0,0\n-1.2,1.0\n")
    done = ciris("map", PLANAR, "--local", "--coverage", "0.5", "--path", "way.csv", "--json")
    assert (done.status, done.json["paths"]) == (0, [1.0])
    partly = ciris("map", PLANAR, "--local", "--coverage", "0.5", "--path", "way.csv", "--path", "through.csv")
    assert partly.status == 1, "one of the motions ends in the obstacle"
    first, second = (line for line in partly.stdout.splitlines() if line.startswith("path["))
    assert first == "path[0]: 100 % of it proved"
    assert 0 < float(second.removeprefix("path[1]: ").removesuffix(" % of it proved")) < 100
    wrong = ciris("map", PLANAR, "--local", "--path", "none.csv")
    assert (wrong.status, wrong.error.startswith("--path: there is no file none.csv")) == (2, True)


def test_it_can_be_read_by_programs(ciris: Ciris, tmp_path: Path) -> None:
    found = ciris("map", PLANAR, "--local", "--coverage", "0.5", "--json").json
    assert found["ended"] == "coverage"
    assert 0.5 <= found["coverage"]["value"] <= 1
    assert 0 < found["coverage"]["stderr"] < 0.02
    assert found["cells"] > 10
    assert (tmp_path / found["proof"]).is_file()


def test_a_deadline_leaves_the_map_so_far(ciris: Ciris, tmp_path: Path) -> None:
    done = ciris("map", PLANAR, "--local", "--coverage", "1", "--deadline", "0.01", "--json")
    assert (done.status, done.json["ended"]) == (1, "deadline")
    assert ciris("verify", done.json["proof"]).status == 0


def test_what_is_proved_stays_when_somebody_interrupts(ciris: Ciris, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patched:
        patched.setattr(Screen, "status", lambda *_: os.kill(os.getpid(), signal.SIGINT))
        done = ciris("map", PLANAR, "--local", "--coverage", "1", "--out", "planar.proof")
    assert done.status == 130
    assert "% of the free configurations proved" in done.stdout
    assert ciris("verify", "planar.proof").status == 0


def test_a_former_map_is_gone_on_with(ciris: Ciris, tmp_path: Path) -> None:
    ciris("map", PLANAR, "--local", "--coverage", "0.8", "--out", "first.proof")
    again = ciris("map", PLANAR, "--local", "--coverage", "0.8", "--former", "first.proof", "--json")
    assert (again.status, again.json["ended"]) == (0, "coverage")
    assert ciris("verify", again.json["proof"]).status == 0
    (tmp_path / "text.proof").write_text("no proof")
    for path, words in (("text.proof", "text.proof: the proof file is malformed"), ("missing.proof", "missing.proof")):
        done = ciris("map", PLANAR, "--local", "--former", path)
        assert (done.status, words in done.error) == (2, True), done.error


def test_what_was_asked_is_known_to_the_service_alone(ciris: Ciris) -> None:
    """The error's code is ``option``."""
    done = ciris("map", PLANAR, "--local", "--asked")
    assert (done.status, done.stderr) == (2, "error: --asked: is only for jobs of the service (leave out it or --local)\n")


def test_a_former_map_that_changes_meanwhile_is_refused(ciris: Ciris, monkeypatch: pytest.MonkeyPatch) -> None:
    """The error is a ``proof_malformed``."""
    ciris("map", PLANAR, "--local", "--coverage", "0.5", "--out", "first.proof")
    with monkeypatch.context() as patched:
        patched.setattr(map, "in_child", lambda *_: {"sha256": "of what was checked"})
        done = ciris("map", PLANAR, "--local", "--former", "first.proof")
    assert done.status == 2
    assert done.error.startswith("first.proof: it has changed since it was checked")


def test_a_scene_in_which_bodies_always_touch_says_so(ciris: Ciris, tmp_path: Path) -> None:
    model = "<link name='{0}'><collision name='{0}'><geometry><box><size>1 1 1</size></box></geometry></collision></link>"
    joint = "<joint name='turn' type='revolute'><parent>one</parent><child>two</child><axis><xyz>0 0 1</xyz><limit><lower>-1</lower>"
    joint += "<upper>1</upper></limit></axis></joint>"
    parts = "".join(model.format(name) for name in ("one", "two", "three"))
    weld = "<joint name='weld' type='fixed'><parent>two</parent><child>three</child></joint>"
    (tmp_path / "model.sdf").write_text(f"<sdf version='1.7'><model name='m'>{parts}{joint}{weld}</model></sdf>")
    (tmp_path / "scene.yaml").write_text(
        "name: touching\ndirectives:\n  - add_model: {name: m, file: model.sdf}\n  - add_weld: {parent: world, child: m::one}\n"
    )
    done = ciris("map", "scene.yaml", "--local", "--at", "0")
    assert done.status == 1, done.error
    assert "no configuration was found that is free of collision, 0 cells" in done.stdout
    assert "q = (0) rad: in collision" in done.stdout


def test_bad_input_is_named(ciris: Ciris, tmp_path: Path) -> None:
    for arguments, words in (
        (("missing.yaml", "--local"), "missing.yaml"),
        ((PLANAR, "--local", "--coverage", "1.5"), "--coverage"),
        ((PLANAR, "--local", "--at", "0"), "--at"),
        ((PLANAR, "--local", "--at", "0,400"), "--at"),
        ((PLANAR, "--local", "--priority", "1"), "--priority"),
        ((PLANAR, "--local", "--out", "."), "--out"),
    ):
        done = ciris("map", *arguments)
        assert (done.status, done.raw) == (2, b""), arguments
        assert words in done.error, arguments
    assert not list(tmp_path.glob("*.proof"))
