"""The commands that ask about regions, as people type them."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from api import advice
from certifier.model import Scene
from ciris.synchronous.client import Client
from db.session import Database
from tests.api.conftest import store_region
from tests.api.test_planning import a_part
from tests.client.conftest import PLANAR, Ciris, surroundings


def test_nearest_says_how_far_the_nearest_region_is(ciris: Ciris, url: str, region: str) -> None:
    done = ciris("nearest", "slider", "--q", "0.1", "--q", "-0.8", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    inside, outside = done.stdout.splitlines()
    assert inside == f"0.1: inside {region} (exact)"
    assert outside == f"-0.8: 0.5 in s from {region} (exact), whose nearest point is (-0.3) m"
    assert ciris("nearest", "slider", "--q", "0.1", "--json", CIRIS_URL=url).json["points"][0]["nearest"]["region"] == region


def test_nearest_without_a_region_is_a_negative_answer(ciris: Ciris, url: str, scene: Scene) -> None:
    done = ciris("nearest", "slider", "--q", "0.1", CIRIS_URL=url)
    assert (done.status, done.stdout) == (1, "0.1: the scene has no regions and no map\n")


def test_a_path_is_answered_by_the_exit_status(ciris: Ciris, url: str, region: str, database: Database, tmp_path: Path) -> None:
    more = store_region(database, a_part(0.1, 0.4))
    covered = ciris("path", "slider", "--q", "-0.2", "--q", "0.1", "--q", "0.3", CIRIS_URL=url)
    assert (covered.status, covered.stderr) == (0, "")
    header, first, second, verdict = covered.stdout.splitlines()
    assert header.split() == ["from", "to", "proved", "by", "guarantee"]
    assert (first.split()[0], second.split()[1]) == ("0", "2")
    assert [first.split()[2:4], second.split()[2:4]] == [["region", region], ["region", more]]
    assert verdict == "covered: every point of the path is proved to be free of collision"
    beyond = ciris("path", "slider", "--q", "-0.4", "--q", "0.1", "--space", "s", CIRIS_URL=url)
    assert beyond.status == 1
    assert beyond.stdout.splitlines() == [
        "not covered from 0 on, at q = (-0.4) m",
        f"next: 0.1 in s from {region} (exact), whose nearest point is (-0.3) m",
    ]
    assert ciris("path", "slider", "--q", "-0.4", "--q", "0.1", "--json", CIRIS_URL=url).json["covered"] is False
    curve = tmp_path / "curve.json"
    curve.write_text(json.dumps({"bezier": [[[0.0], [0.5], [-0.1]]], "t": [3.0, 5.0]}))
    done = ciris("path", "slider", "--path", curve, CIRIS_URL=url)
    assert (done.status, done.stdout.splitlines()[1].split()[0], done.stdout.splitlines()[-2].split()[1]) == (0, "3", "5")
    curve.write_text(json.dumps({"knots": [0, 0, 0, 2, 2, 2], "control_points": [[0.0], [2.0], [-0.1]]}))
    assert ciris("path", "slider", "--path", curve, "--json", CIRIS_URL=url).json["covered"] is False
    curve.write_text(json.dumps({"bezier": [[[0.0, 0.1], [0.1, 0.0]]]}))
    assert ciris("path", "slider", "--path", curve, CIRIS_URL=url).error.startswith("--path bezier[0]: 2 numbers were given")
    curve.write_text(json.dumps({"s": [[0.0], [0.1]], "t": [1.0, 2.0]}))
    assert ciris("path", "slider", "--path", curve, CIRIS_URL=url).status == 0
    alone = ciris("path", "slider", "--q", "0.1", CIRIS_URL=url)
    assert (alone.status, alone.error) == (2, "--q: a path has two waypoints or more (give it once for each waypoint)")


def test_the_graph_shows_overlaps_and_gaps(ciris: Ciris, url: str, region: str, database: Database) -> None:
    more, far = store_region(database, a_part(0.1, 0.4)), store_region(database, a_part(0.6, 0.9))
    done = ciris("graph", "slider", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0] == "regions: 3, overlaps: 1, components: 2"
    assert f"{region}  {more}   0.05  (0.15) m" in done.stdout
    gaps = [f"gap of 0.2 in s between {a} and {b}; try the seed (0.5) m" for a, b in ((more, far), (far, more))]
    assert done.stdout.splitlines()[-1] in gaps
    assert ciris("graph", "slider", "--json", CIRIS_URL=url).json["complete"] is True


def test_the_client_asks_about_many_segments_at_once(url: str, region: str) -> None:
    with Client(url) as client:
        answer = client.segments("slider", [[[0.0], [0.1]], [[0.0], [0.9]]])
    assert [segment["covered"] for segment in answer["segments"]] == [True, False]


@pytest.mark.parametrize("command", ["nearest", "path", "plan", "graph"])
def test_an_unknown_scene_is_said_in_one_line(ciris: Ciris, url: str, command: str) -> None:
    q = {"graph": [], "plan": ["--from", "0", "--to", "1"]}.get(command, ["--q", "0", "--q", "1"])
    done = ciris(command, "nope", *q, CIRIS_URL=url)
    assert (done.status, done.stdout) == (2, "")
    assert "there is no scene 'nope'" in done.error


def test_a_plan_is_printed_with_its_regions(ciris: Ciris, url: str, region: str, database: Database) -> None:
    more = store_region(database, a_part(0.1, 0.4))
    done = ciris("plan", "slider", "--from", "-0.2", "--to", "0.3", "--speed", "0.5", "--acceleration", "1", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    header, first, second, what, verdict = done.stdout.splitlines()
    assert header.split() == ["from", "to", "proved", "by", "guarantee"]
    assert [first.split()[0], first.split()[3], second.split()[3]] == ["0", region, more]
    assert " configurations, 0.5 long in q (m), " in what
    assert verdict == "all of the motion lies in certified regions, guarantee exact"
    found = ciris("plan", "slider", "--from=-0.2", "--to", more, "--json", CIRIS_URL=url).json
    assert (found["found"], found["q"][0], found["t"][0]) == (True, [-0.2], 0.0)


def test_no_seed_is_advised_where_none_was_found(
    ciris: Ciris, url: str, region: str, database: Database, monkeypatch: pytest.MonkeyPatch
) -> None:
    store_region(database, a_part(0.6, 0.9))
    monkeypatch.setattr(advice, "in_collision", lambda scene, s, room: np.ones(len(s), dtype=bool))
    plan = ciris("plan", "slider", "--from", "0.1", "--to", "0.7", "--regions-only", CIRIS_URL=url).stdout
    graph = ciris("graph", "slider", CIRIS_URL=url).stdout
    assert [text.splitlines()[-1].partition("; ")[2] for text in (plan, graph)] == 2 * ["no free configuration was found near its middle"]


def test_a_plan_that_is_not_found_says_why(ciris: Ciris, url: str, region: str, database: Database) -> None:
    far = store_region(database, a_part(0.6, 0.9))
    apart = ciris("plan", "slider", "--from", "0.1", "--to", "0.7", "--regions-only", CIRIS_URL=url)
    assert (apart.status, apart.stdout) == (
        1,
        f"1 of 2 regions are connected with --from, 1 with --to\ngap of 0.4 in s between {region} and {far}; try the seed (0.4) m\n",
    )
    outside = ciris("plan", "slider", "--from", "0.1", "--to", "-0.8", "--regions-only", CIRIS_URL=url)
    assert (outside.status, outside.stdout) == (
        1,
        f"--to is in no certified region; nearest: 0.5 in s from {region} (exact), whose nearest point is (-0.3) m\n",
    )
    wrong = ciris("plan", "slider", "--from", "0.1,0.2", "--to", "far", CIRIS_URL=url)
    assert (wrong.status, wrong.error.partition(" (")[0]) == (2, "--to: the scene has no configuration 'far'")
    longer = ciris("plan", "slider", "--from", "0.1,0.2", "--to", "0.1", CIRIS_URL=url)
    assert (longer.status, longer.error.partition(" (")[0]) == (2, "--from: 2 numbers were given; the scene has 1 joint")


def test_without_regions_a_motion_is_planned_and_its_proof_kept(ciris: Ciris, url: str, scene: Scene, tmp_path: Path) -> None:
    done = ciris("plan", "slider", "--from=-0.5", "--to", "0.9", "--to", "0.4", "--via", "0.1", "--out", tmp_path / "p", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    header, piece, what, verdict, proof = done.stdout.splitlines()
    assert (header.split()[2:4], piece.split()[2]) == (["proved", "by"], "motion")
    assert " configurations, 0.9 long in q (m), " in what
    assert verdict == "all of the motion is proved to be free of collision, guarantee exact"
    assert proof == f"proof: {tmp_path / 'p'} (check it: ciris verify {tmp_path / 'p'})"
    assert ciris("verify", tmp_path / "p").status == 0


def test_what_is_wrong_with_the_ends_is_said_in_words(ciris: Ciris, url: str, scene: Scene) -> None:
    beyond = ciris("plan", "slider", "--from", "0.1", "--to", "1.5", CIRIS_URL=url)
    assert (beyond.status, beyond.stdout) == (1, "--to: joint model/slide is at 1.5 m, and its limits are from -1 to 1 m\n")
    pose = ("--to-pose", "0.5,0,0,0,0,0", "--frame", "cart")
    there = ciris("plan", "slider", "--from", "0.1", *pose, "--json", CIRIS_URL=url).json
    assert there["q"][-1] == [pytest.approx(0.5)]
    on_line = ("--to-pose", "0.5,0,0", "--frame", "cart", "--line", "--tolerance", "0.01")
    assert ciris("plan", "slider", "--from", "0.1", *on_line, CIRIS_URL=url).status == 0
    off = ciris("plan", "slider", "--from", "0.1", "--to-pose", "0.5,0.2,0,0,0,0", "--frame", "cart", CIRIS_URL=url)
    assert off.status == 1
    assert off.stdout.startswith("--to-pose: no configuration reaches it; the nearest that was found is off by 200 mm and ")
    past = ciris("plan", "slider", "--from", "0.1", "--to-pose", "1.9,0,0", "--frame", "cart", "--line", CIRIS_URL=url)
    assert (past.status, past.stdout) == (1, "the line ends at the part 0.5 of it: joint model/slide is at its limit\n")
    unknown = ciris("plan", "slider", "--from", "0.1", "--to-pose", "0.5,0,0,0,0,0", "--frame", "tool", CIRIS_URL=url)
    assert (unknown.status, unknown.error.partition(":")[0]) == (2, "--frame")


@pytest.mark.parametrize(
    ("arguments", "field"),
    [
        ((), "--to"),
        (("--to", "0.1", "--to-pose", "0,0,0,0,0,0"), "--to"),
        (("--to", "0.1", "--line"), "--line"),
        (("--to-pose", "0,0,0,0"), "--to-pose"),
        (("--to-pose", "0,0,0", "--frame", "cart"), "--to-pose"),
        (("--to-pose", "0,0,0,0,0,0"), "--frame"),
        (("--to-pose", "0,0,0,0,0,0", "--frame", "cart", "--tolerance", "0.1"), "--tolerance"),
        (("--to", "0.1", "--grow"), "--grow"),
    ],
)
def test_an_option_that_does_not_fit_the_others_is_refused(ciris: Ciris, arguments: tuple[str, ...], field: str) -> None:
    done = ciris("plan", "slider", "--from", "0.1", *arguments, CIRIS_URL="http://127.0.0.1:9")
    assert (done.status, done.error.partition(":")[0]) == (2, field)


HEAVY = ("asyncio.base_events", "flint", "numba", "numpy", "scipy")
WATCHED = f"""
import sys
from client.cli import main

status = main()
print(status, [name for name in {HEAVY} if name in sys.modules], file=sys.stderr)
"""


@pytest.mark.parametrize(
    "arguments",
    [
        ("plan", "slider", "--from", "0", "--to", "0.1"),
        ("certify-path", "slider", "--q", "0", "--q", "0.1"),
        ("certify-path", PLANAR, "--q", "0.2,-0.4", "--q", "-0.4,0.3"),
    ],
)
def test_a_question_loads_nothing_that_takes_long(url: str, region: str, tmp_path: Path, arguments: tuple[object, ...]) -> None:
    """Half of the time of such a command would be numpy's, and nothing here needs it."""
    command = [sys.executable, "-c", WATCHED, *map(str, arguments)]
    done = subprocess.run(command, cwd=tmp_path, env=surroundings(CIRIS_URL=url), capture_output=True, text=True, check=False)
    assert done.stderr == "0 []\n"
