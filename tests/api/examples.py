"""Answers of a real service become the examples of the OpenAPI document: ``python -m tests.api.examples`` writes api/examples.json.

It grows, certifies, covers and plans on examples/planar_2dof, and takes for every schema the fullest answer that has it, and for every
field that this lacks the first value that it met.
"""

from __future__ import annotations

import json
import os
import tempfile
import time
from pathlib import Path
from typing import Any

from fastapi.testclient import TestClient

from api.app import create_app
from certifier.scene.bundle import pack_bundle
from db import keys, leases, machine, migrate, webhooks, workers
from db.keys import Scope
from db.session import Database
from db.states import WorkerState
from db.workers import Made, WorkerKind
from tests.api.conftest import BASE_URL, working
from tests.api.test_meshes import CORNER, MODEL, zipped
from tests.services import queue_server
from tests.workers.service import environment

EXAMPLES = Path(__file__).parents[2] / "examples"
FILE = Path(__file__).parents[2] / "api" / "examples.json"
PAIR = {"a": "arm/upper/bar", "b": "arm/lower/bar"}
LOW = {"name": "low", "inside": {"what": ["arm/lower"], "half_spaces": [[0, 0, 1, 0.9]]}}
AHEAD = {"name": "ahead", "cone": {"body": "arm/lower", "axis": [1, 0, 0], "along": [1, 0, 0], "degrees": 60}}
CERTAIN = {
    "tube": 0.012,
    "clearance": 0.0141,
    "nearest": {"a": "arm/upper/bar", "b": "world/post", "piece": 0, "time": 0.25, "q": [0.4, 0.3], "distance": 0.0142},
}
"""A motion that is certified has these."""
JOB = {
    "error": {"code": "seed_in_collision", "message": "arm/upper/bar and world/post touch at the seed", "field": "seed.q", "hint": ""},
    "retry_of": "1f9b2a7c-5b0e-4b58-9c39-2f1d6a3c8e10",
    "parent": "5d0c1e42-0f7a-4a39-8a0e-6b1f1a9f2c11",
    "trace": "0af7651916cd43dd8448eb211c80319c",
}
"""A job that another one has asked for, that was tried again, and that went wrong has these."""
SELDOM: dict[str, dict[str, Any]] = {
    "IgnoredPair": {**PAIR, "reason": "neighbours: the joint between them always overlaps"},
    "UncoveredBodies": {"why": "ignored", "reason": "they are bolted together"},
    "Substitution": {"geometry": "arm/flange/disc", "substitution": "a capsule around a cylinder", "inflation": 0.003},
    "AuditPage": {"next": "MjAyNi0wNS0wMVQwODowMDowMCswMDowMCA1ZDBj"},
    "DrawnGeometry": {"substitution": "a capsule around a cylinder"},
    "Job": JOB,
    "AcceptedJob": JOB,
    "HeldWork": {"job": "1f9b2a7c-5b0e-4b58-9c39-2f1d6a3c8e10"},
    "Inventory": {"next": "welding"},
    "JobMotion": CERTAIN,
    "KeyPage": {"next": "MjAyNi0wNS0wMVQwODowMDowMCswMDowMCA1ZDBj"},
    "KeySummary": {"last_used_at": "2026-04-30T16:00:00Z", "expires_at": "2026-05-29T08:00:00Z", "revoked_at": "2026-05-01T08:00:00Z"},
    "MotionResponse": CERTAIN,
    "Obstacle": {"faces": 4, "lost": 0.013},
    "PairCell": {"witness_q": [0.4, 0.3], "open_cells": 12},
    "PairMatrix": {"next": "3.41"},
    "Partition": {"iteration": 7},
    "ProjectPage": {"next": "welding"},
    "Piece": {"map": "0d6f0f5e-52c7-4a3f-8d5c-0b7f7a9f3c21"},
    "PlanResponse": {
        "guarantee": "exact",
        "nearest": {
            "region": "1f0c6d4e-6d0e-4f0e-9a51-0c1f5d0a7b11",
            "guarantee": "exact",
            "distance": 0.05,
            "q": [0.4, 0.3],
            "s": [0.2, 0.15],
        },
        "uncovered": {"time": 0.625, "segment": 0, "q": [0.4, 0.3], "s": [0.2, 0.15], "next": None},
    },
    "Project": {"max_bytes": 50_000_000_000, "keep_days": 30, "max_solver_seconds": 720_000},
    "Promoted": {"scene": "2138b0193bfdd632", "regions": 3, "before": "0f8a6f0c2b7e11aa", "regions_before": 4},
    "ScenePage": {"next": "MjAyNi0wNS0wMVQwODowMDowMCswMDowMCA1ZDBj"},
    "Verification": {"error": {"code": "bad_proof", "message": "a plane does not separate its pair", "field": None, "hint": ""}},
    "WorkerPage": {"next": "MjAyNi0wNS0wMVQwODowMDowMCswMDowMCA1ZDBj"},
    "Webhook": {"error": "the receiver answered 500"},
    "WebhookSummary": {"error": "the receiver answered 500"},
    "WebhookPage": {"next": "MjAyNi0wNS0wMVQwODowMDowMCswMDowMCA1ZDBj"},
    "Delivery": {
        "at": "2026-05-01T08:00:00Z",
        "seconds": 0.12,
        "status": 500,
        "answer": "Internal Server Error",
        "error": "the receiver answered 500",
    },
}
"""What a short visit does not meet. The tests check it against the schemas, like the rest."""
MOST, NUMBERS = 4, 16
"""Lists are cut off after the first number of entries, lists of numbers after the second."""
TEXT = 300
"""Texts are cut off after this many characters."""


def shortened(value: Any) -> Any:
    """Returns a document with short lists, so that people can read it."""
    if isinstance(value, dict):
        return {name: shortened(part) for name, part in list(value.items())[:40]}
    if isinstance(value, list):
        numbers = all(isinstance(part, int | float) for part in value)
        return [shortened(part) for part in value[: NUMBERS if numbers else MOST]]
    return value[:TEXT] if isinstance(value, str) else value


class Collected:
    """Holds the first example of every schema of a document."""

    def __init__(self, document: dict[str, Any]) -> None:
        self.schemas: dict[str, Any] = document["components"]["schemas"]
        self.found: dict[str, Any] = {}
        self.fields: dict[str, Any] = {}

    def document(self) -> dict[str, Any]:
        """Returns what is written: the examples of schemas, and values of fields that these lack."""
        lacking = {
            name: value
            for name, value in self.fields.items()
            if self.found.get(name.partition(".")[0], {}).get(name.partition(".")[2]) in (None, [], {})
        }
        return {"schemas": dict(sorted(self.found.items())), "fields": dict(sorted(lacking.items()))}

    def take(self, schema: dict[str, Any], value: Any) -> None:
        """Looks through a value of a schema for examples of this schema and of those that it refers to."""
        if value is None:
            return
        if "$ref" in schema:
            name = schema["$ref"].rpartition("/")[2]
            known = self.found.get(name)
            if isinstance(value, dict) and (known is None or _empty(known) > _empty(value)):
                self.found[name] = shortened(value)
            for field, part in value.items() if isinstance(value, dict) else ():
                if part not in (None, [], {}):
                    self.fields.setdefault(f"{name}.{field}", shortened(part))
            self.take(self.schemas[name], value)
        for option in (*schema.get("anyOf", ()), *schema.get("oneOf", ()), *schema.get("allOf", ())):
            if "$ref" in option and not self._fits(option, value):
                continue
            self.take(option, value)
        if isinstance(value, dict):
            for field, described in schema.get("properties", {}).items():
                self.take(described, value.get(field))
        if isinstance(value, list) and isinstance(schema.get("items"), dict):
            for one in value[:50]:
                self.take(schema["items"], one)

    def _fits(self, option: dict[str, Any], value: Any) -> bool:
        described = self.schemas[option["$ref"].rpartition("/")[2]]
        if described.get("type") != "object":
            return False
        kind = described["properties"].get("kind", {}).get("const")
        return isinstance(value, dict) and set(value) <= set(described["properties"]) and kind in (None, value.get("kind"))


def _empty(value: dict[str, Any]) -> int:
    return sum(part in (None, [], {}) for part in value.values())


class Recorder:
    """Asks the service, and keeps what it answers under the schemas of the document."""

    def __init__(self, client: TestClient) -> None:
        self.client, self.document = client, client.get("/openapi.json").json()
        self.collected = Collected(self.document)

    def ask(self, method: str, route: str, body: Any = None, params: Any = None, once: str | None = None, **ids: Any) -> Any:
        headers = {"Authorization": f"Bearer {self.key}"} if hasattr(self, "key") else {}
        headers |= {} if once is None else {"Idempotency-Key": once}
        options = {"files": body} if isinstance(body, dict) and "bundle" in body else {"json": body} if body is not None else {}
        answer = self.client.request(method, route.format(**ids), params=params, headers=headers, **options)
        operation = self.document["paths"][route][method.lower()]
        if "json" in options:
            self.collected.take(operation["requestBody"]["content"]["application/json"]["schema"], body)
        if answer.is_success and answer.headers.get("content-type") == "application/json":
            described = operation["responses"][str(answer.status_code)]["content"]["application/json"]["schema"]
            self.collected.take(described, answer.json())
            return answer.json()
        if not answer.is_success:
            self.collected.take({"$ref": "#/components/schemas/Problem"}, answer.json())
        return answer

    def ended(self, job: Any) -> Any:
        until = time.monotonic() + 240
        while not job["ended"] and time.monotonic() < until:
            time.sleep(0.2)
            self.ask("GET", "/v1/workers")
            for part in ("workers", "obstacles"):
                self.ask("GET", f"/v1/jobs/{{job_id}}/{part}", job_id=job["id"])
            job = self.ask("GET", "/v1/jobs/{job_id}", job_id=job["id"])
        assert job["ended"], job
        return job


def record(client: TestClient, database: Database) -> dict[str, Any]:
    """Does what people do with a service, and returns an example of every schema that it met."""
    service = Recorder(client)
    ask = service.ask
    for route in ("/healthz", "/readyz"):
        ask("GET", route)
    with database.write() as session:  # the solver of the tests is no worker of its own, so its parent stands for one
        made = Made(leases.name_of(os.getppid()), WorkerKind.SOLVE, "0.1.0", 2, machine.cores(), machine.memory_bytes())
        workers.tell(session, made, WorkerState.RUNNING, "expiry failed: OverflowError")
    path = EXAMPLES / "planar_2dof" / "scene.yaml"
    scene = ask("POST", "/v1/scenes", {"bundle": ("scene.zip", pack_bundle(path), "application/zip")})
    name, home, away = scene["name"], [0.4, 0.3], [0.6, 0.5]
    hook = {"url": "https://planner.example.org/ciris", "secret": "whsec_AAECAwQFBgcICQoLDA0ODxAREhMUFRYXGBkaGxwdHh8="}
    seed = {"kind": "grow", "scene": name, "seed": {"q": home}, "options": {"stages": 1}, "labels": {"team": "welding"}}
    grown = service.ended(ask("POST", "/v1/jobs", {**seed, "webhook": hook}, once="cell-7"))
    ask("POST", "/v1/jobs", {**seed, "webhook": hook}, once="cell-7")  # the answer has the outcome then
    certify = {"kind": "certify", "scene": name, "polytope": {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.3, -0.1, 0.3, -0.1]}}
    service.ended(ask("POST", "/v1/jobs", certify))
    wide = {**certify, "polytope": {"C": [[1, 0]], "d": [2.0]}, "cells": 20}
    service.ended(ask("POST", "/v1/jobs", wide))
    motion = service.ended(
        ask("POST", "/v1/jobs", {"kind": "certify-path", "scene": name, "q": [home, away], "tube": True, "clearance": True})
    )
    ask("GET", "/v1/jobs/{job_id}/motion", job_id=motion["id"])
    other = ask("POST", "/v1/jobs", {"kind": "cover", "scene": name, "options": {"coverage": 0.6, "regions": 3}, "deadline_seconds": 40})
    service.ended(other)
    ask("GET", "/v1/jobs/{job_id}/cover", job_id=other["id"])
    wanted = {"coverage": 0.6, "at": [home], "paths": [[home, away]]}
    mapped = service.ended(ask("POST", "/v1/jobs", {"kind": "map", "scene": name, "options": wanted}))
    ask("GET", "/v1/jobs/{job_id}/map", job_id=mapped["id"])
    # It ends before it is cancelled: whoever works on what is not wanted any more ends itself, and that is this process.
    batch = ask("POST", "/v1/jobs/batch", {"jobs": [{**seed, "labels": {"batch": "7"}}]})
    service.ended(batch["jobs"][0])
    ask("POST", "/v1/jobs/cancel", {"labels": {"batch": "7"}})
    ask("GET", "/v1/events", params={"limit": 3})
    ask("POST", "/v1/jobs", {"kind": "recertify", "scene": name, "region": grown["region"]})
    for part in ("", "/lint", "/model", "/pairs", "/dependents"):
        ask("GET", f"/v1/scenes/{{scene_id}}{part}", scene_id=name)
    for part in ("", "/webhook", "/pairs", "/pairs/states", "/events", "/growth", "/timeline", "/obstacles", "/workers", "/dependents"):
        for job in (grown, other):
            ask("GET", f"/v1/jobs/{{job_id}}{part}", job_id=job["id"])
    ask("POST", "/v1/scenes/{scene_id}/constrain", {"name": "low-arm", "conditions": [LOW, AHEAD]}, scene_id=name)
    ask("GET", "/v1/scenes/{scene_id}/model", scene_id="low-arm")
    for part in ("", "/configurations", "/pairs", "/pairs/0/cells"):
        ask("GET", f"/v1/regions/{{region_id}}{part.replace('/0/', '/{pair}/')}", region_id=grown["region"], pair=0)
    ask("GET", "/v1/regions/{region_id}/pairs/{pair}/plane", params={"q": home}, region_id=grown["region"], pair=0)
    ask("POST", "/v1/regions/{region_id}/verify", region_id=grown["region"])
    for route in ("/v1/scenes", "/v1/jobs", "/v1/regions", "/v1/webhooks"):
        ask("GET", route, params={"limit": 2})
    for question, more in (
        ("contains", {"q": [home]}),
        ("nearest", {"q": [[2.0, -2.0]]}),
        ("segment", {"q": [[home, away], [home, [2.0, -2.0]]]}),
        ("path", {"q": [home, away, [0.6, 2.5]], "times": [0, 0.5, 1.25]}),
        ("plan", {"start": home, "goal": away}),
        ("plan", {"start": home, "goal": [2.0, -2.0], "regions_only": True}),
        ("plan", {"start": home, "goal": [-0.5, 1.2], "prove": True}),
        ("plan", {"start": home, "goal": [-1.2, 1.5]}),
        ("plan", {"start": home, "goal": [9.0, 0.0]}),
        ("plan", {"start": home, "pose": {"frame": "lower", "position": [9.0, 0.0, 0.0], "rpy": [0.0, 0.0, 0.0]}}),
        ("plan", {"start": home, "pose": {"frame": "lower", "position": [0.0, 0.3, 0.0]}, "line": {}}),
        ("contacts", {"q": [home, [1.5, 2.5]]}),
        ("slice", {"q": home, "x": scene["positions"][0]["name"], "y": scene["positions"][1]["name"], "size": 12}),
        ("certify-path", {"q": [home, away], "prove": True}),
    ):
        ask("POST", f"/v1/planning/{question}", {"scene": name, **more})
    ask("GET", "/v1/planning/graph", params={"scene": name})
    ask("POST", "/v1/planning/contains", {"scene": name, "q": [["a", "b"]]})
    arm = ask("POST", "/v1/scenes", {"bundle": ("scene.zip", pack_bundle(EXAMPLES / "iiwa_shelf" / "scene.yaml"), "application/zip")})
    ask("GET", "/v1/scenes/{scene_id}/lint", scene_id=arm["id"])
    corner = ask("POST", "/v1/scenes", {"bundle": ("scene.zip", zipped(arm_urdf=MODEL, link_obj=CORNER), "application/zip")})
    ask("GET", "/v1/scenes/{scene_id}/meshes", scene_id=corner["id"])
    with database.write() as session:
        service.key = keys.add(session, "admin", Scope.ADMIN)  # type: ignore[attr-defined]
        workers.tell(session, made, WorkerState.RUNNING)  # the inventory leaves out who has said nothing for a minute
        assert webhooks.of_job(session, grown["id"])
    time.sleep(1.5)
    ask("POST", "/v1/keys", {"name": "planner", "scope": "read", "days": 90})
    ask("DELETE", "/v1/keys/{name}", name="nobody")
    ask("POST", "/v1/projects", {"name": "welding"})
    ask("POST", "/v1/keys", {"name": "alice", "scope": "admin", "project": "welding"})
    limits = {"max_bytes": 50_000_000_000, "keep_days": 30, "max_solver_seconds": 720_000}
    ask("PATCH", "/v1/projects/{project}", limits, project="welding")
    ask("GET", "/v1/projects/{project}", project="welding")
    for route in ("/v1/keys", "/v1/audit", "/v1/project", "/v1/projects", "/v1/inventory"):
        ask("GET", route)
    ask("POST", "/v1/jobs", {"kind": "grow", "scene": name, "seed": {"q": [9.0, 0.0]}})
    for route, bodies in offered(name, home, away, grown["region"]).items():
        described = service.document["paths"][route]["post"]["requestBody"]["content"]["application/json"]["schema"]
        for body in bodies:
            service.collected.take(described, body)
    for schema, values in SELDOM.items():
        known = service.collected.schemas[schema]
        if set(known["required"]) <= set(values):
            service.collected.found.setdefault(schema, values)
        for field, value in values.items():
            service.collected.fields.setdefault(f"{schema}.{field}", value)
    return service.collected.document()


def offered(scene: str, home: list[float], away: list[float], region: str) -> dict[str, list[dict[str, Any]]]:
    """Returns requests that show the fields that nobody needs at first. The tests check them against the schemas."""
    more = {
        "scene": scene,
        "labels": {"team": "welding"},
        "priority": 1,
        "deadline_seconds": 600,
        "webhook": {"url": "https://example.org/", "secret": "whsec_" + "A" * 32},
    }
    knots, curve = [0, 0, 0, 0, 1, 1, 1, 1], [home, [0.45, 0.3], [0.5, 0.4], away]
    iris = {
        "epsilon": 0.001,
        "delta": 0.05,
        "max_iterations": 3,
        "max_iterations_separating_planes": 20,
        "tolerance": 0.02,
        "margin": 0.01,
        "tries": 2,
    }
    faces = {"C": [[1, 0], [-1, 0], [0, 1], [0, -1]], "d": [0.3, 0.3, 0.3, 0.3], "center": [0.0, 0.0]}
    paper = {"contraction": "targeted", "contractions": 1, "max_rounds": 2, "pushes": 2, "tolerance": 0.02}
    covering = {
        "seeds": [home],
        "connect": [home, away],
        "paths": [[home, away]],
        "connected": True,
        "at_once": 2,
        "region_seconds": 60,
    }
    return {
        "/v1/jobs": [
            {
                **more,
                "kind": "grow",
                "seed": {"method": "iris_np2", "q": home, "contain": [away], **iris, "random_seed": 1},
                "options": {"paper": paper},
            },
            {**more, "kind": "grow", "seed": {"method": "polytope", **faces}, "options": {"cells": 1000}},
            {**more, "kind": "grow", "seed": {"method": "box", "q": home, "half_width": 0.1}, "options": {"paper": {}}},
            {**more, "kind": "certify", "polytope": faces, "cells": 100, "random_seed": 1},
            {**more, "kind": "recertify", "region": region, "random_seed": 1},
            {
                **more,
                "kind": "certify-path",
                "s": [[0.2, 0.15], [0.3, 0.25]],
                "space": "s",
                "tube": True,
                "padding": 0.002,
                "clearance": True,
            },
            {**more, "kind": "certify-path", "bezier": [curve]},
            {**more, "kind": "certify-path", "knots": knots, "control_points": curve},
            {**more, "kind": "map", "former": "1f9b2a7c", "options": {"coverage": 0.9, "at": [home], "paths": [[home]], "random_seed": 1}},
            {**more, "kind": "cover", "options": {**covering, "cells": 1000, "stages": 1, "random_seed": 1}},
        ],
        "/v1/jobs/cancel": [{"jobs": ["1f9b2a7c"]}],
        "/v1/planning/contains": [{"scene": scene, "s": [[0.2, 0.15]]}],
        "/v1/planning/nearest": [{"scene": scene, "s": [[0.2, 0.15]]}],
        "/v1/planning/segment": [{"scene": scene, "space": "s", "s": [[[0.2, 0.15], [0.3, 0.15]]]}],
        "/v1/planning/path": [
            {"scene": scene, "space": "s", "s": [[0.2, 0.15], [0.3, 0.15]]},
            {"scene": scene, "bezier": [curve]},
            {"scene": scene, "knots": knots, "control_points": curve},
        ],
        "/v1/planning/plan": [{"scene": scene, "start": home, "goal": away, "speed": 1.0, "acceleration": [2.0, 2.0]}],
        "/v1/planning/slice": [
            {"scene": scene, "q": home, "x": "a", "y": "b", "regions": [region], "x_range": [-1, 1], "y_range": [-1, 1]}
        ],
        "/v1/planning/certify-path": [
            {"scene": scene, "s": [[0.2, 0.15], [0.3, 0.25]], "space": "s", "tube": True, "padding": 0.002, "clearance": True},
            {"scene": scene, "bezier": [curve]},
            {"scene": scene, "knots": knots, "control_points": curve},
        ],
    }


def main() -> None:
    with tempfile.TemporaryDirectory() as directory, queue_server() as queue:
        url = f"sqlite:///{directory}/examples.sqlite3"
        migrate.upgrade(url)
        with environment(CIRIS_DATABASE_URL=url, CIRIS_REDIS_URL=queue.url), working():
            database = Database(url)
            with TestClient(create_app(database), base_url=BASE_URL) as client:
                found = record(client, database)
            database.close()
    FILE.write_text(json.dumps(found, indent=1) + "\n")
    print(f"{len(found['schemas'])} schemas, {len(found['fields'])} fields")


if __name__ == "__main__":
    main()
