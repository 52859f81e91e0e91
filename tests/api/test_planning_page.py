"""The examples of docs/planning.md, asked and answered as the page says, about the regions that it names."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fastapi.testclient import TestClient

from certifier.jobs.region import Region, certified_region
from certifier.model import Scene
from certifier.pair.certification import Certification
from certifier.scene import load_scene
from db import scenes
from db.session import Database
from tests.api.conftest import store_region
from tests.certifier.scenes import accepted

ROOT = Path(__file__).parents[2]
PAGE = (ROOT / "docs" / "planning.md").read_text(encoding="utf-8")
BOXES = [((-0.3, -0.4), (0.3, 0.4)), ((0.1, -0.3), (0.4, 0.2)), ((-1.5, -1.0), (-1.3, -0.8))]
"""The three regions of the page, in q."""


def certified_box(scene: Scene, lower: tuple[float, ...], upper: tuple[float, ...]) -> Region:
    low, high = scene.to_s(np.array([lower, upper]))
    eye = np.eye(scene.n)
    polytope, center = scene.polytope(np.concatenate([eye, -eye]), np.concatenate([high, -low])), (low + high) / 2
    certification = Certification(scene, polytope, center)
    proofs = {index: certification.certify(index).proof or b"" for index in range(len(scene.pairs))}
    return certified_region(scene, accepted(polytope, center), proofs, {"seconds": 1.0})


@pytest.fixture
def ids(database: Database) -> list[str]:
    """The ids of the three regions."""
    scene = load_scene(ROOT / "examples" / "planar_2dof" / "scene.yaml")
    with database.write() as session:
        scenes.add(session, scene)
    return [store_region(database, certified_box(scene, *box)) for box in BOXES]


def same(shown: Any, answered: Any) -> bool:
    """Whether an answer is as shown, where numbers are rounded to four digits after the point and "..." stands for anything.

    In a list it stands for as many items as there are.
    """
    if shown == "...":
        return True
    if isinstance(shown, dict) and isinstance(answered, dict):
        return shown.keys() == answered.keys() and all(same(shown[key], answered[key]) for key in shown)
    if isinstance(shown, list) and isinstance(answered, list) and "..." in shown:
        ahead, behind = shown.index("..."), len(shown) - 1 - shown.index("...")
        rest = answered[len(answered) - behind :]
        return len(answered) > ahead + behind and same([*shown[:ahead], *shown[ahead + 1 :]], answered[:ahead] + rest)
    if isinstance(shown, list) and isinstance(answered, list):
        return len(shown) == len(answered) and all(map(same, shown, answered))
    if isinstance(shown, float) and isinstance(answered, float):
        return abs(shown - answered) <= 0.5001e-4
    return type(shown) is type(answered) and bool(shown == answered)


def test_every_answer_is_as_the_page_shows_it(client: TestClient, ids: list[str]) -> None:
    examples = re.findall(r"^    (POST|GET) (\S+)\n\n((?:```json\n.*?```\n\n?){1,2})", PAGE, flags=re.DOTALL | re.MULTILINE)
    named = list(dict.fromkeys(re.findall(r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}", PAGE)))
    assert {path.partition("?")[0] for _, path, _ in examples} == {
        f"/v1/planning/{name}" for name in ("plan", "path", "segment", "nearest", "contains", "graph", "contacts", "slice")
    }
    for method, path, blocks in examples:
        *body, shown = (json.loads(block) for block in re.findall(r"```json\n(.*?)```", blocks, flags=re.DOTALL))
        answer = client.request(method, path, json=body[0] if body else None)
        text = answer.text
        for real, name in zip(ids, named, strict=True):
            text = text.replace(real, name)
        assert answer.status_code == 200, text
        assert same(shown, json.loads(text)), f"{path}\n{json.dumps(json.loads(text), indent=1)}"
