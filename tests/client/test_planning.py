"""The commands that ask about regions, as people type them."""

from __future__ import annotations

import pytest

from certifier.model import Scene
from ciris.synchronous.client import Client
from db.session import Database
from tests.api.conftest import store_region
from tests.api.test_planning import a_part
from tests.client.conftest import Ciris


def test_nearest_says_how_far_the_nearest_region_is(ciris: Ciris, url: str, region: str) -> None:
    done = ciris("nearest", "slider", "--q", "0.1", "--q", "-0.8", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    inside, outside = done.stdout.splitlines()
    assert inside == f"0.1: inside {region} (exact)"
    assert outside == f"-0.8: 0.5 in s from {region} (exact), whose nearest point is -0.3"
    assert ciris("nearest", "slider", "--q", "0.1", "--json", CIRIS_URL=url).json["points"][0]["nearest"]["region"] == region


def test_nearest_without_a_region_is_a_negative_answer(ciris: Ciris, url: str, scene: Scene) -> None:
    done = ciris("nearest", "slider", "--q", "0.1", CIRIS_URL=url)
    assert (done.status, done.stdout) == (1, "0.1: the scene has no regions\n")


def test_a_path_is_answered_by_the_exit_status(ciris: Ciris, url: str, region: str, database: Database) -> None:
    more = store_region(database, a_part(0.1, 0.4))
    covered = ciris("path", "slider", "--q", "-0.2", "--q", "0.1", "--q", "0.3", CIRIS_URL=url)
    assert (covered.status, covered.stderr) == (0, "")
    header, first, second, verdict = covered.stdout.splitlines()
    assert header.split() == ["from", "to", "region", "guarantee"]
    assert [first.split()[0], first.split()[2], second.split()[1], second.split()[2]] == ["0", region, "2", more]
    assert verdict == "covered: every point of the path is in certified regions, 2 of 2"
    beyond = ciris("path", "slider", "--q", "-0.4", "--q", "0.1", "--space", "s", CIRIS_URL=url)
    assert beyond.status == 1
    assert beyond.stdout.splitlines() == [
        "not covered from 0 on, at q = -0.4",
        f"next: 0.1 in s from {region} (exact), whose nearest point is -0.3",
    ]
    assert ciris("path", "slider", "--q", "-0.4", "--q", "0.1", "--json", CIRIS_URL=url).json["covered"] is False
    alone = ciris("path", "slider", "--q", "0.1", CIRIS_URL=url)
    assert (alone.status, alone.error) == (2, "--q: a path has two waypoints or more (give it once for each waypoint)")


def test_the_graph_shows_overlaps_and_gaps(ciris: Ciris, url: str, region: str, database: Database) -> None:
    more, far = store_region(database, a_part(0.1, 0.4)), store_region(database, a_part(0.6, 0.9))
    done = ciris("graph", "slider", CIRIS_URL=url)
    assert (done.status, done.stderr) == (0, "")
    assert done.stdout.splitlines()[0] == "regions: 3, overlaps: 1, components: 2"
    assert f"{region}  {more}   0.05  0.15" in done.stdout
    assert done.stdout.splitlines()[-1] in [f"gap of 0.2 in s between {a} and {b}; try the seed 0.5" for a, b in ((more, far), (far, more))]
    assert ciris("graph", "slider", "--json", CIRIS_URL=url).json["complete"] is True


def test_the_client_asks_about_many_segments_at_once(url: str, region: str) -> None:
    with Client(url) as client:
        answer = client.segments("slider", [[[0.0], [0.1]], [[0.0], [0.9]]])
    assert [segment["covered"] for segment in answer["segments"]] == [True, False]


@pytest.mark.parametrize("command", ["nearest", "path", "graph"])
def test_an_unknown_scene_is_said_in_one_line(ciris: Ciris, url: str, command: str) -> None:
    q = [] if command == "graph" else ["--q", "0", "--q", "1"]
    done = ciris(command, "nope", *q, CIRIS_URL=url)
    assert (done.status, done.stdout) == (2, "")
    assert "there is no scene 'nope'" in done.error
