"""A scene changes while planners ask: it is staged, its regions are made again, and it is promoted."""

from __future__ import annotations

import json
import re
import shlex
import threading
from pathlib import Path

from ciris.synchronous.client import Client
from tests.client.conftest import PLANAR, Ciris
from tests.client.test_recertify import EYE, POSE, changed, nudged

QUESTIONS = (("--from", "0.02,0", "--to", "-0.03,0.05"), ("--q", "0.02,0", "--q", "-0.03,0.05"))


def ask_on(url: str, done: threading.Event, found: list[tuple[str, int, bool]]) -> None:
    """Asks about the name all the time, as planners do."""
    with Client(url) as client:
        while not done.wait(0.1):
            plan = client.plan({"scene": "planar-2dof", "start": [0.02, 0.0], "goal": [-0.03, 0.05], "regions_only": True})
            contained = client.contains("planar-2dof", [[0.02, 0.0]])
            found.append((plan["scene"], plan["regions"], plan["found"]))
            found.append((contained["scene"], contained["regions"], contained["points"][0]["inside"]))


def test_planners_always_find_regions_while_a_scene_changes(ciris: Ciris, url: str, worker: None, tmp_path: Path) -> None:
    present = ciris("scene", "add", PLANAR, "--json", CIRIS_URL=url).json["id"]
    (tmp_path / "p.json").write_text(json.dumps({"C": EYE, "d": [0.1] * 4}))
    assert ciris("certify", "planar-2dof", "--polytope", "p.json", "--cells", "200").status == 0
    first = POSE.findall((PLANAR.parent / "obstacles.sdf").read_text())[0]
    moved = changed(tmp_path / "moved", first, nudged(first, 0.01))
    found: list[tuple[str, int, bool]] = []
    done = threading.Event()
    planner = threading.Thread(target=ask_on, args=(url, done, found))
    planner.start()
    try:
        staged = ciris("scene", "stage", "planar-2dof", moved)
        assert (staged.status, staged.stderr) == (0, "")
        said, *following = staged.stdout.splitlines()
        new, rest = said.split("  ")
        assert rest.startswith("planar-2dof@staged: 2 joints, ")
        commands = [line.partition(": ")[2] for line in following]
        assert commands == ["ciris recertify --from planar-2dof --scene planar-2dof@staged", "ciris scene promote planar-2dof"]
        early = ciris("scene", "promote", "planar-2dof")
        assert (early.status, "planar-2dof@staged has no regions, and planar-2dof has 1" in early.error) == (2, True)
        again, promote = (shlex.split(command)[1:] for command in commands)
        made = ciris(*again, "--json")
        assert made.status == 0, made.stderr
        assert [job["scene"] for job in made.json] == [new]
        for command, question in (("plan", QUESTIONS[0]), ("path", QUESTIONS[1]), ("contains", QUESTIONS[1]), ("nearest", QUESTIONS[1])):
            for scene, meant in (("planar-2dof", present), ("planar-2dof@staged", new)):
                answer = ciris(command, scene, *question, "--json")
                assert (answer.status, answer.json["scene"], answer.json["regions"]) == (0, meant, 1), command
        assert ciris("graph", "planar-2dof@staged", "--json").json["scene"] == new
        assert ciris("certify-path", "planar-2dof@staged", *QUESTIONS[1]).status == 0
        before = len(found)
        ended = ciris(*promote)
        assert ended.status == 0, ended.stderr
        assert ended.stdout.splitlines() == [
            f"planar-2dof means {new} from now on; regions: 1",
            f"before, it meant {present}; regions: 1",
        ]
        while len(found) < before + 6:
            assert planner.is_alive()
            done.wait(0.05)
    finally:
        done.set()
        planner.join()
    assert {(regions, good) for _, regions, good in found} == {(1, True)}
    assert list(dict.fromkeys(scene for scene, _, _ in found)) == [present, new]
    rows = {line.split()[0]: re.split(r"  +", line)[2] for line in ciris("scene", "ls").stdout.splitlines()[1:]}
    assert rows[new] == "planar-2dof"


def test_what_cannot_be_staged_or_promoted_says_what_to_do(ciris: Ciris, url: str, scene: object) -> None:
    done = ciris("scene", "promote", "slider", CIRIS_URL=url)
    assert (done.status, done.error) == (
        2,
        "scene: nothing is staged as the next version of 'slider' (`ciris scene stage NAME FILE` stages a scene)",
    )
    assert "no scene has the name 'planar'" in ciris("scene", "stage", "planar", PLANAR).error
    assert ciris("scene", "stage", "slider", PLANAR).status == 0
    assert ciris("scene", "promote", "slider").status == 0, "the present scene has no regions either"
    assert "'slider' means this scene already" in ciris("scene", "stage", "slider", PLANAR).error
