"""Numbers that no double tells from others are refused at every door of the service where a configuration or a polytope comes in."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from fastapi.testclient import TestClient

from certifier.model import Scene

TURNS = 9185166224891948.0
"""A double; the next one is 2 radians away."""
GROW, COVER, CERTIFY = {"kind": "grow"}, {"kind": "cover"}, {"kind": "certify"}

DOORS = [
    ("planning/contains", lambda x: {"q": [[0.1], [x]]}, "q[1][0]"),
    ("planning/contains", lambda x: {"s": [[x]]}, "s[0][0]"),
    ("planning/nearest", lambda x: {"q": [[x]]}, "q[0][0]"),
    ("planning/nearest", lambda x: {"s": [[x]]}, "s[0][0]"),
    ("planning/segment", lambda x: {"q": [[[0.1], [x]]]}, "q[0][1][0]"),
    ("planning/segment", lambda x: {"q": [[[0.1], [x]]], "space": "s"}, "q[0][1][0]"),
    ("planning/segment", lambda x: {"s": [[[x], [0.1]]], "space": "s"}, "s[0][0][0]"),
    ("planning/path", lambda x: {"q": [[0.1], [x]]}, "q[1][0]"),
    ("planning/path", lambda x: {"q": [[x], [0.1]], "space": "s"}, "q[0][0]"),
    ("planning/path", lambda x: {"s": [[x], [0.1]], "space": "s"}, "s[0][0]"),
    ("planning/plan", lambda x: {"start": [x], "goal": [0.1]}, "start[0]"),
    ("planning/plan", lambda x: {"start": [0.1], "goal": [x]}, "goal[0]"),
    ("planning/contacts", lambda x: {"q": [[x]]}, "q[0][0]"),
    ("jobs", lambda x: GROW | {"seed": {"q": [x]}}, "seed.q[0]"),
    ("jobs", lambda x: GROW | {"seed": {"q": [0.1], "contain": [[0.0], [x]]}}, "seed.contain[1][0]"),
    ("jobs", lambda x: GROW | {"seed": {"method": "polytope", "C": [[1.0]], "d": [0.1], "center": [x]}}, "seed.center[0]"),
    ("jobs", lambda x: COVER | {"options": {"seeds": [[x]]}}, "options.seeds[0][0]"),
    ("jobs", lambda x: COVER | {"options": {"connect": [[0.1], [x]]}}, "options.connect[1][0]"),
    ("jobs", lambda x: COVER | {"options": {"paths": [[[0.1], [x]]]}}, "options.paths[0][1][0]"),
    ("jobs", lambda x: CERTIFY | {"polytope": {"C": [[1.0]], "d": [0.1], "center": [x]}}, "polytope.center[0]"),
]
MOTIONS = [
    ("planning/path", lambda x: {"bezier": [[[0.0], [x]]]}, "bezier[0][1][0]"),
    ("planning/path", lambda x: {"knots": [0, 0, 1, 1], "control_points": [[0.0], [x]]}, "control_points[1][0]"),
    ("planning/certify-path", lambda x: {"q": [[0.1], [x]]}, "q[1][0]"),
    ("planning/certify-path", lambda x: {"s": [[0.1], [x]]}, "s[1][0]"),
    ("jobs", lambda x: {"kind": "certify-path", "q": [[0.1], [x]]}, "q[1][0]"),
]


@pytest.mark.parametrize(("code", "doors"), [("number_too_large", DOORS), ("motion_not_finite", MOTIONS)])
def test_a_configuration_that_no_double_tells_from_others_is_refused(
    client: TestClient, region: str, code: str, doors: list[tuple[str, Callable[[float], dict[str, Any]], str]]
) -> None:
    for path, body, field in doors:
        for number in (1000000.0000000001, TURNS, -1e300):
            answer = client.post(f"/v1/{path}", json={"scene": "slider"} | body(number))
            problem = answer.json()
            assert (answer.status_code, problem.get("code"), problem.get("field")) == (422, code, field), (path, problem)
            assert problem["detail"] == f"{number} is no number of at most 1e+06"


@pytest.mark.parametrize("polytope", [{"C": [[1e200]], "d": [1.0]}, {"C": [[1.0]], "d": [1e300]}])
def test_a_polytope_whose_sums_overflow_is_refused(client: TestClient, scene: Scene, polytope: dict[str, Any]) -> None:
    answer = client.post("/v1/jobs", json=CERTIFY | {"scene": "slider", "polytope": polytope})
    assert (answer.status_code, answer.json()["code"], answer.json()["field"]) == (422, "polytope_not_finite", "polytope")


@pytest.mark.parametrize("times", [[-1.7e308, 1.7e308], [0.0, 1e101]])
def test_times_whose_differences_overflow_are_refused(client: TestClient, region: str, times: list[float]) -> None:
    for motion in ({"q": [[0.0], [0.4]]}, {"bezier": [[[0.0], [0.4]]]}):
        answer = client.post("/v1/planning/path", json={"scene": "slider", "times": times} | motion)
        assert (answer.status_code, answer.json()["field"]) == (422, f"times[{0 if times[0] else 1}]")
