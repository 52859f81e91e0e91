"""The OpenAPI document: operation ids are stable, errors are problems, examples hold."""

from collections.abc import Iterator
from copy import deepcopy
from pathlib import Path
from typing import Any

import jsonschema_rs
import pytest
from fastapi.testclient import TestClient
from pydantic import TypeAdapter

from api import submission
from api.app import create_app
from api.problems import Problem
from api.schemas.jobs import NewJob
from api.schemas.planning import ContainsRequest, NearestRequest, PathRequest, SegmentRequest
from api.schemas.plans import PlanRequest
from certifier.scene import load_scene
from db import scenes
from db.keys import Scope
from db.session import Database
from jobs import patterns
from jobs.request import WebhookRequest

EXAMPLES = Path(__file__).parents[2] / "examples"

OPERATIONS = {
    "create_scene": "POST /v1/scenes",
    "list_scenes": "GET /v1/scenes",
    "get_scene": "GET /v1/scenes/{scene_id}",
    "get_scene_model": "GET /v1/scenes/{scene_id}/model",
    "get_scene_meshes": "GET /v1/scenes/{scene_id}/meshes",
    "get_scene_pairs": "GET /v1/scenes/{scene_id}/pairs",
    "get_scene_lint": "GET /v1/scenes/{scene_id}/lint",
    "create_job": "POST /v1/jobs",
    "create_jobs": "POST /v1/jobs/batch",
    "cancel_jobs": "POST /v1/jobs/cancel",
    "list_project_events": "GET /v1/events",
    "stream_project_events": "GET /v1/events/stream",
    "list_jobs": "GET /v1/jobs",
    "get_job": "GET /v1/jobs/{job_id}",
    "cancel_job": "POST /v1/jobs/{job_id}/cancel",
    "retry_job": "POST /v1/jobs/{job_id}/retry",
    "get_job_pairs": "GET /v1/jobs/{job_id}/pairs",
    "get_job_pair_states": "GET /v1/jobs/{job_id}/pairs/states",
    "download_pair_proof": "GET /v1/jobs/{job_id}/pairs/{pair}/proof",
    "get_job_cells": "GET /v1/jobs/{job_id}/pairs/{pair}/cells",
    "get_job_growth": "GET /v1/jobs/{job_id}/growth",
    "get_job_timeline": "GET /v1/jobs/{job_id}/timeline",
    "get_job_cover": "GET /v1/jobs/{job_id}/cover",
    "get_job_map": "GET /v1/jobs/{job_id}/map",
    "download_map_proof": "GET /v1/jobs/{job_id}/map/proof",
    "download_free_set": "GET /v1/jobs/{job_id}/map/free-set",
    "get_job_motion": "GET /v1/jobs/{job_id}/motion",
    "download_motion_proof": "GET /v1/jobs/{job_id}/motion/proof",
    "list_webhooks": "GET /v1/webhooks",
    "get_job_webhook": "GET /v1/jobs/{job_id}/webhook",
    "resend_job_webhook": "POST /v1/jobs/{job_id}/webhook/resend",
    "get_job_workers": "GET /v1/jobs/{job_id}/workers",
    "get_job_obstacles": "GET /v1/jobs/{job_id}/obstacles",
    "list_job_events": "GET /v1/jobs/{job_id}/events",
    "stream_job_events": "GET /v1/jobs/{job_id}/events/stream",
    "list_regions": "GET /v1/regions",
    "get_region": "GET /v1/regions/{region_id}",
    "get_region_configurations": "GET /v1/regions/{region_id}/configurations",
    "get_region_pairs": "GET /v1/regions/{region_id}/pairs",
    "get_region_cells": "GET /v1/regions/{region_id}/pairs/{pair}/cells",
    "get_region_plane": "GET /v1/regions/{region_id}/pairs/{pair}/plane",
    "download_region_proof": "GET /v1/regions/{region_id}/proof",
    "verify_region": "POST /v1/regions/{region_id}/verify",
    "export_region": "GET /v1/regions/{region_id}/export",
    "delete_region": "DELETE /v1/regions/{region_id}",
    "contains": "POST /v1/planning/contains",
    "download_kept_proof": "GET /v1/planning/motions/{motion_id}/proof",
    "certify_path": "POST /v1/planning/certify-path",
    "find_nearest": "POST /v1/planning/nearest",
    "cover_segments": "POST /v1/planning/segment",
    "cover_path": "POST /v1/planning/path",
    "plan_trajectory": "POST /v1/planning/plan",
    "find_contacts": "POST /v1/planning/contacts",
    "slice_space": "POST /v1/planning/slice",
    "get_graph": "GET /v1/planning/graph",
    "constrain_scene": "POST /v1/scenes/{scene_id}/constrain",
    "promote_scene": "POST /v1/scenes/{scene_name}/promote",
    "get_scene_dependents": "GET /v1/scenes/{scene_id}/dependents",
    "delete_scene": "DELETE /v1/scenes/{scene_id}",
    "get_job_dependents": "GET /v1/jobs/{job_id}/dependents",
    "delete_job": "DELETE /v1/jobs/{job_id}",
    "get_project": "GET /v1/project",
    "create_key": "POST /v1/keys",
    "list_keys": "GET /v1/keys",
    "revoke_key": "DELETE /v1/keys/{name}",
    "list_audit": "GET /v1/audit",
    "list_projects": "GET /v1/projects",
    "create_project": "POST /v1/projects",
    "get_any_project": "GET /v1/projects/{project}",
    "set_limits": "PATCH /v1/projects/{project}",
    "get_inventory": "GET /v1/inventory",
    "list_workers": "GET /v1/workers",
    "get_worker": "GET /v1/workers/{worker_id}",
    "pause_worker": "POST /v1/workers/{worker_id}/pause",
    "resume_worker": "POST /v1/workers/{worker_id}/resume",
    "drain_worker": "POST /v1/workers/{worker_id}/drain",
    "get_health": "GET /healthz",
    "get_readiness": "GET /readyz",
    "get_metrics": "GET /metrics",
}


@pytest.fixture(scope="module")
def document(migrated_sqlite: Path) -> dict[str, Any]:
    """The document, which takes the service half a second to make."""
    database = Database(f"sqlite:///{migrated_sqlite}")
    made = create_app(database).openapi()
    database.close()
    return made


def operations(document: dict[str, Any]) -> dict[str, tuple[str, dict[str, Any]]]:
    return {
        operation["operationId"]: (f"{method.upper()} {path}", operation)
        for path, methods in document["paths"].items()
        for method, operation in methods.items()
    }


def test_the_document_is_served(client: TestClient, document: dict[str, Any]) -> None:
    assert client.get("/openapi.json").json() == document


def test_operation_ids_are_stable(document: dict[str, Any]) -> None:
    found = operations(document)
    assert {name: route for name, (route, _) in found.items()} == OPERATIONS


def test_every_operation_is_described_and_answers_errors_with_problems(document: dict[str, Any]) -> None:
    for name, (_, operation) in operations(document).items():
        assert operation["description"], name
        problem = {"application/problem+json": {"schema": {"$ref": "#/components/schemas/Problem"}}}
        assert operation["responses"]["default"]["content"] == problem
        errors = {status: answer for status, answer in operation["responses"].items() if status >= "4" and status != "default"}
        assert {"421", "429", "500"} <= set(errors), name
        for status, answer in errors.items():
            assert (name, status) == ("get_readiness", "503") or (answer["content"] == problem and "`" in answer["description"]), name
    assert "HTTPValidationError" not in document["components"]["schemas"]


def test_the_examples_are_accepted_by_the_schemas(document: dict[str, Any]) -> None:
    schemas = document["components"]["schemas"]
    for name in ("GrowRequest", "CertifyRequest", "CertifyPathRequest"):
        for example in schemas[name]["examples"]:
            TypeAdapter(NewJob).validate_python(example)
    for model in (ContainsRequest, NearestRequest, SegmentRequest, PathRequest, PlanRequest):
        for example in schemas[model.__name__]["examples"]:
            model.model_validate(example)
    for example in schemas["WebhookRequest"]["examples"]:
        submission.check_webhook(WebhookRequest.model_validate(example))
    for example in schemas["Problem"]["examples"]:
        Problem.model_validate(example)


def test_the_examples_work_on_the_scenes_that_they_name(client: TestClient, database: Database, document: dict[str, Any]) -> None:
    with database.write() as session:
        for name in ("iiwa_shelf", "planar_2dof"):
            scenes.add(session, load_scene(EXAMPLES / name / "scene.yaml"))
    schemas = document["components"]["schemas"]
    for name, path, status in (
        ("GrowRequest", "/v1/jobs", 201),
        ("CertifyRequest", "/v1/jobs", 201),
        ("CertifyPathRequest", "/v1/jobs", 201),
        ("ContainsRequest", "/v1/planning/contains", 200),
        ("MotionRequest", "/v1/planning/certify-path", 200),
        ("NearestRequest", "/v1/planning/nearest", 200),
        ("SegmentRequest", "/v1/planning/segment", 200),
        ("PathRequest", "/v1/planning/path", 200),
        ("PlanRequest", "/v1/planning/plan", 200),
        ("ContactsRequest", "/v1/planning/contacts", 200),
        ("SliceRequest", "/v1/planning/slice", 200),
    ):
        for example in schemas[name]["examples"]:
            answer = client.post(path, json=example)
            assert answer.status_code == status, answer.text


def test_every_field_parameter_and_answer_is_described_and_every_field_has_an_example(document: dict[str, Any]) -> None:
    for name, schema in document["components"]["schemas"].items():
        if schema.get("type") != "object":
            continue
        assert schema["description"], name
        for field, described in schema.get("properties", {}).items():
            assert described.get("description"), f"{name}.{field}"
            assert described["examples"] != [None] or described.get("type") == "null", f"{name}.{field} has no example"
        assert schema.get("examples"), f"{name} has no example: `python -m tests.api.examples` makes them"
    for name, (_, operation) in operations(document).items():
        assert operation["summary"], name
        for parameter in operation.get("parameters", ()):
            assert parameter.get("description"), f"{name}: {parameter['name']}"
        for status, answer in operation["responses"].items():
            assert answer["description"] not in ("", "Successful Response"), f"{name}: {status}"
        for content in operation.get("requestBody", {}).get("content", {}):
            assert content in ("application/json", "multipart/form-data")
    assert {tag for _, operation in operations(document).values() for tag in operation["tags"]} == {tag["name"] for tag in document["tags"]}


def misfits(document: dict[str, Any]) -> list[str]:
    """The examples that do not fit, each with its schema or field. One validator has all: each takes milliseconds to make."""
    described = dict[str, dict[str, Any]]()
    for name, schema in document["components"]["schemas"].items():
        described[name] = {"$ref": f"#/components/schemas/{name}", "examples": schema.get("examples", [])}
        described |= {f"{name}.{field}": one for field, one in schema.get("properties", {}).items()}
    lists = {place: {"type": "array", "items": one} for place, one in described.items()}
    whole = jsonschema_rs.validator_for({"properties": lists, "components": document["components"]})
    errors = whole.iter_errors({place: one["examples"] for place, one in described.items()})
    return [f"{error.instance_path[0]}: {error.message}" for error in errors]


def test_every_example_fits_its_schema(document: dict[str, Any]) -> None:
    assert misfits(document) == []
    wrong = deepcopy(document)
    wrong["components"]["schemas"]["Problem"]["examples"] += [{"status": "none"}]
    wrong["components"]["schemas"]["Problem"]["properties"]["status"]["examples"] += ["none"]
    assert {said.partition(":")[0] for said in misfits(wrong)} == {"Problem", "Problem.status"}


def test_every_operation_says_which_scope_it_needs(document: dict[str, Any]) -> None:
    assert document["components"]["securitySchemes"]["key"]["scheme"] == "bearer"
    for name, (_, operation) in operations(document).items():
        scopes = {scope for entry in operation.get("security", []) for scope in entry["key"]}
        assert scopes or name in ("get_health", "get_readiness"), name
        assert scopes <= set(Scope)


def test_every_pattern_is_said_in_words(document: dict[str, Any]) -> None:
    """What a text must match is in the document as a pattern, and in the answer to one that does not as a sentence."""

    def patterns_in(part: Any) -> Iterator[str]:
        if isinstance(part, dict):
            if isinstance(part.get("pattern"), str):
                yield part["pattern"]
            yield from part.get("patternProperties", {})
            for value in part.values():
                yield from patterns_in(value)
        elif isinstance(part, list):
            for value in part:
                yield from patterns_in(value)

    assert set(patterns_in(document)) == set(patterns.SAID)
