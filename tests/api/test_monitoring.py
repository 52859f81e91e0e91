"""The rules for alerts and the dashboard for Grafana name metrics, labels and values that /metrics really has."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
import yaml
from fastapi.testclient import TestClient

from tests.api.test_metrics import counted

DEPLOY = Path(__file__).parents[2] / "deploy" / "monitoring"
SELECTOR = re.compile(r"(ciris_\w+)(?:\{([^}]*)\})?")
MATCHER = re.compile(r'(\w+)(=~|!~|!=|=)"([^"]*)"')
GROUPING = re.compile(r"\b(?:by|on) \(([^)]*)\)")
FROM_PROMETHEUS = {"instance", "job"}


def expressions() -> list[str]:
    rules = yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"][0]["rules"]
    panels = json.loads((DEPLOY / "grafana.json").read_text())["panels"]
    return [rule["expr"] for rule in rules] + [target["expr"] for panel in panels for target in panel["targets"]]


@pytest.fixture
def served(client: TestClient, region: str) -> dict[str, list[dict[str, str]]]:
    """The labels of every sample, by the metric's name, after a job has ended and a few requests were answered."""
    client.get("/v1/nothing")
    found: dict[str, list[dict[str, str]]] = {}
    for sample in counted(client):
        name, _, labels = sample.partition("{")
        found.setdefault(name, []).append(dict(re.findall(r'(\w+)="([^"]*)"', labels)))
    return found


def test_every_metric_label_and_value_exists(served: dict[str, list[dict[str, str]]]) -> None:
    asked = expressions()
    assert len(asked) > 25
    for expression in asked:
        selectors = SELECTOR.findall(expression)
        assert selectors or expression.startswith("up{"), expression
        known: set[str] = set(FROM_PROMETHEUS)
        for name, matchers in selectors:
            assert name in served, expression
            known |= {label for labels in served[name] for label in labels}
            for label, how, value in MATCHER.findall(matchers):
                values = {labels.get(label) for labels in served[name]}
                assert values != {None}, f"{name} has no label {label}: {expression}"
                if label == "status":  # which ones there are depends on what was asked
                    continue
                for one in value.split("|") if "~" in how else [value]:
                    assert one in values, f"{name} has no {label}={one}: {expression}"
        for labels in GROUPING.findall(expression):
            assert set(labels.split(", ")) <= known, expression


def test_every_alert_says_what_is_wrong() -> None:
    for rule in yaml.safe_load((DEPLOY / "alerts.yaml").read_text())["groups"][0]["rules"]:
        assert rule["labels"]["severity"] in ("page", "warn")
        assert rule["annotations"]["summary"].endswith(".")
        named = re.findall(r"\$labels\.(\w+)", rule["annotations"]["summary"])
        assert all(re.search(rf"\b{name}\b", rule["expr"]) or name in FROM_PROMETHEUS for name in named), rule["alert"]


def test_the_dashboard_names_a_source_and_every_panel_has_a_title() -> None:
    board = json.loads((DEPLOY / "grafana.json").read_text())
    assert [one["type"] for one in board["templating"]["list"]] == ["datasource"]
    assert len({panel["id"] for panel in board["panels"]}) == len(board["panels"])
    assert all(panel["title"] and panel["datasource"]["uid"] == "${source}" for panel in board["panels"])
