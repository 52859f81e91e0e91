"""Names of configurations, as people type them and as Python programs write them, with a service and without one."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import ciris as python
from certifier.errors import CirisError
from certifier.model import Scene
from ciris.options import COVER, GROW
from ciris.requests import asked_for, grow_request, points
from client.inputs import configuration
from db import scenes
from db.session import Database
from tests.certifier.scene.workshop import write
from tests.client.conftest import Ciris

EXTRA = "configurations: {home: {turn: 0.5}, away: [1.5], far: [-0.5]}\n"


@pytest.fixture
def named(database: Database, region: str, scene: Scene) -> Scene:
    """The scene of the region, with configurations."""
    (joint,) = (joint.name for joint in scene.moving)
    with database.write() as session:
        scenes.add(session, replace(scene, configurations={"home": {joint: -0.1}, "away": {joint: 0.15}}))
    return scene


def test_the_commands_that_ask_a_service_take_names(ciris: Ciris, url: str, named: Scene, region: str) -> None:
    for command in ("contains", "nearest"):
        by_name = ciris(command, "slider", "--q", "home", "--json", CIRIS_URL=url)
        assert by_name.json == ciris(command, "slider", "--q", "-0.1", "--json", CIRIS_URL=url).json
    assert ciris("contains", "slider", "--q", "home", CIRIS_URL=url).stdout.startswith(f"inside: home in {region}")
    assert ciris("nearest", "slider", "--q", "home", CIRIS_URL=url).stdout.startswith("home: inside")
    plan = ciris("plan", "slider", "--from", "home", "--to", "away", "--regions-only", "--json", CIRIS_URL=url).json
    assert (plan["q"][0], plan["q"][-1]) == ([-0.1], [0.15])
    assert ciris("path", "slider", "--q", "home", "--q", "0", "--q", "away", CIRIS_URL=url).status == 0
    assert "configuration home: model/slide -0.1 m" in ciris("scene", "show", "slider", CIRIS_URL=url).stdout.splitlines()
    assert ciris("plan", "slider", "--from", "hom", "--to", "away", CIRIS_URL=url).error == (
        "--from: the scene has no configuration 'hom' (did you mean home?)"
    )
    several = ciris("plan", "slider", "--from", "home", "--to", "away", "--to", region, CIRIS_URL=url)
    assert several.error.startswith(f"--to: the scene has no configuration '{region}'")


@pytest.mark.parametrize("suffix", ["json", "yaml"])
def test_files_with_waypoints_have_names(ciris: Ciris, url: str, named: Scene, tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"path.{suffix}"
    file.write_text(json.dumps({"q": ["home", [0.0], "away"], "t": [0, 1, 2]}))
    by_name = ciris("path", "slider", "--path", file, "--json", CIRIS_URL=url)
    file.write_text(json.dumps({"q": [[-0.1], [0.0], [0.15]], "t": [0, 1, 2]}))
    assert by_name.status == 0
    assert by_name.json == ciris("path", "slider", "--path", file, "--json", CIRIS_URL=url).json
    file.write_text(json.dumps({"q": ["home", "nowhere"]}))
    refused = ciris("path", "slider", "--path", file, CIRIS_URL=url)
    assert refused.error.startswith("--path[1]: the scene has no configuration 'nowhere'")
    for rows, problem in ((["home", "away"], "t of"), (["home", {"a": 1}], "q[1] must be a finite number")):
        file.write_text(json.dumps({"q": rows, "t": [0]}))
        assert problem in ciris("path", "slider", "--path", file, CIRIS_URL=url).error


def test_an_id_means_no_single_name(ciris: Ciris, url: str, named: Scene, database: Database) -> None:
    """Two names of one content have a home each. The id alone is refused, by every command and in Python."""
    (joint,) = (joint.name for joint in named.moving)
    with database.write() as session:
        scene_id = scenes.add(session, replace(named, name="other", configurations={"home": {joint: 0.1}})).id
    for command in (("contains", scene_id, "--q", "home"), ("grow", scene_id, "--q", "home"), ("map", scene_id, "--at", "home")):
        refused = ciris(*command, CIRIS_URL=url)
        assert "'home' means other positions under the scene's name" in refused.error, refused.stdout
    assert ciris("contains", "other", "--q", "home", "--json", CIRIS_URL=url).json["points"][0]["inside"]
    with python.connect(url) as service:
        with pytest.raises(CirisError, match="means other positions"):
            service.contains(service.scene(scene_id), "home")
        for name, at in (("slider", -0.1), ("other", 0.1), (f"other@{scene_id}", 0.1)):
            assert service.contains(service.scene(name), "home").margin == pytest.approx(service.contains(name, [at]).margin)


def test_a_scene_is_deleted_by_name_only_if_it_has_no_other(ciris: Ciris, url: str, scene: Scene, database: Database) -> None:
    with database.write() as session:
        scene_id = scenes.add(session, replace(scene, name="shared")).id
    refused = ciris("scene", "rm", "slider", CIRIS_URL=url)
    assert (refused.status, "it is called shared as well" in refused.error) == (2, True)
    assert ciris("scene", "show", "shared", "--json", CIRIS_URL=url).status == 0
    assert ciris("scene", "rm", scene_id, CIRIS_URL=url).status == 0
    assert ciris("scene", "show", "shared", CIRIS_URL=url).status == 2


def test_the_python_client_takes_names(url: str, named: Scene) -> None:
    with python.connect(url) as service:
        assert service.scene("slider").configurations == {"home": {"model/slide": -0.1}, "away": {"model/slide": 0.15}}
        assert service.contains("slider", "home").margin == pytest.approx(service.contains("slider", [-0.1]).margin)
        assert service.contains("slider", ["home", [0.0], "away"]).inside.tolist() == [True, True, True]
        assert service.segments("slider", ["home", "away"]).covered.tolist() == [True]
        assert service.path("slider", ["home", "away"]).covered
        assert service.plan("slider", "home", "away", regions_only=True).q[-1] == pytest.approx([0.15])
        with pytest.raises(CirisError, match="no configuration"):
            service.contains("slider", "nowhere")


def test_requests_of_the_python_client_have_names_where_they_were_given() -> None:
    assert grow_request("s", "home,open", {"contain": ["away", np.zeros(2)]})["seed"] == {"q": "home,open", "contain": ["away", [0.0, 0.0]]}
    assert asked_for({"contain": "away"}, GROW)["seed"] == {"contain": ["away"]}
    assert asked_for({"seeds": ["a"], "paths": [["a", [1.0]]]}, COVER)["options"] == {"seeds": ["a"], "paths": [["a", [1.0]]]}
    assert points(2, q="home") == {"q": ["home"]}
    assert points(3, q=[["a", "b"], ("c", np.ones(1))]) == {"q": [["a", "b"], ["c", [1.0]]]}
    for wrong in ([[["a"]]], 3.0, [1.0, "a"]):
        with pytest.raises(CirisError):
            points(2, q=wrong)
    with pytest.raises(CirisError):
        points(2, s="home")


@pytest.mark.parametrize(
    ("text", "given"),
    [
        ("home", "home"),
        (" left/home , open ", "left/home , open"),
        ("hold-up", "hold-up"),
        ("2nd pose", "2nd pose"),
        ("0, 0.3,-1.8", [0.0, 0.3, -1.8]),
        ("0 0.3", [0.0, 0.3]),
        ("[0, 0.3]", [0.0, 0.3]),
        ("[home]", "[home]"),
        ("0,1_0", None),
        ("0,\u0663", None),
        ("[0, 0.3", None),
        ("home,0", None),
        ("0,home", None),
        ("", None),
        (",", None),
        ("nan", None),
        ("inf,0", None),
    ],
)
def test_a_text_is_numbers_or_names(text: str, given: object) -> None:
    if given is None:
        with pytest.raises(CirisError):
            configuration(text)
    else:
        assert configuration(text) == given


def test_without_a_service_names_are_those_of_the_scene_file(ciris: Ciris, tmp_path: Path) -> None:
    path = write(tmp_path, extra=EXTRA)
    done = ciris("scene", "check", path, "--q", "home", "--json")
    assert done.json["q"] == [0.5]
    assert done.json["configurations"]["away"] == {"arm/turn": 1.5}
    assert "configuration home: arm/turn 0.5 rad" in ciris("scene", "check", path).stdout.splitlines()
    (tmp_path / "seed.yaml").write_text("q: away\n")
    assert ciris("scene", "check", path, "--json").json["q"] == [1.5]
    assert ciris("scene", "check", path, "--q", "home,away").error.startswith("--q: 'home' has joint arm/turn at 0.5, and 'away' at 1.5")
    motions = [
        json.loads(ciris("certify-path", path, *(part for q in ends for part in ("--q", q)), "--local", "--json").stdout)
        for ends in (("home", "away"), ("0.5", "1.5"))
    ]
    assert [motion["outcome"] for motion in motions] == ["certified", "certified"]
    assert motions[0]["proved_distance"] == motions[1]["proved_distance"]
    wrong = ciris("certify-path", path, "--q", "home", "--q", "nowhere", "--local")
    assert (wrong.status, wrong.error.partition(" (")[0]) == (2, "--q[1]: the scene has no configuration 'nowhere'")
