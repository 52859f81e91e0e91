"""The OpenAPI document: what FastAPI knows of the routes, with every error by its status, and examples from a real service.

``python -m tests.api.examples`` makes the examples.
"""

from __future__ import annotations

import json
from functools import cache
from http import HTTPStatus
from pathlib import Path
from typing import Any

from fastapi import FastAPI
from fastapi.openapi.utils import get_openapi
from pydantic.json_schema import models_json_schema

from api import problems
from api.problems import Problem

EXAMPLES = Path(__file__).with_name("examples.json")
UPLOAD = "Body_create_scene"

ANYWHERE = ("unknown_host", "too_large", "too_many_requests", "internal")
WITH_KEY = ("key_needed", "scope_missing", "database_unavailable")
CHANGING = ("cross_site", "no_room")
WITH_BODY = ("malformed_json", "invalid_request", "content_encoding", "busy")
PLACES = {
    "scene_id": ("scene_not_found", "ambiguous_id"),
    "job_id": ("job_not_found", "ambiguous_id"),
    "region_id": ("region_not_found", "ambiguous_id"),
    "worker_id": ("worker_not_found", "ambiguous_id"),
    "pair": ("pair_not_found",),
    "scene": ("scene_not_found", "ambiguous_id"),
    "job": ("job_not_found", "ambiguous_id"),
    "parent": ("job_not_found", "ambiguous_id"),
    "region": ("region_not_found", "ambiguous_id"),
    "after": ("cursor",),
}
"""What may be wrong with a parameter, or a field of the body, of this name."""
CHILDREN = ("busy", "child_timeout", "child_memory", "child_died")
ALSO: dict[str, tuple[str, ...]] = {
    "create_scene": ("bundle_too_large", "storage_quota", "scene_not_found", "scene_unchanged", *CHILDREN),
    "promote_scene": ("scene_not_found", "scene_without_regions", "busy"),
    "delete_scene": ("has_dependents", "not_ended", "busy"),
    "create_job": ("idempotency_conflict", "quota_exceeded", "storage_quota", "time_quota", "region_not_found"),
    "create_jobs": ("scene_not_found", "region_not_found", "idempotency_conflict", "quota_exceeded", "storage_quota", "time_quota"),
    "cancel_jobs": ("job_not_found", "ambiguous_id"),
    "delete_job": ("has_dependents", "not_ended", "busy"),
    "cancel_job": ("busy",),
    "stream_job_events": ("busy",),
    "stream_project_events": ("busy",),
    "retry_job": ("job_not_retryable", "quota_exceeded", "storage_quota", "time_quota", "busy"),
    "get_job_cover": ("cover_not_found",),
    "get_job_map": ("map_not_found",),
    "download_map_proof": ("map_not_found", "proof_not_found"),
    "download_free_set": ("map_not_found", "proof_not_found"),
    "get_job_motion": ("motion_not_found",),
    "download_motion_proof": ("motion_not_found", "proof_not_found"),
    "get_job_webhook": ("webhook_not_found",),
    "resend_job_webhook": ("webhook_not_found", "webhook_waits", "busy"),
    "download_pair_proof": ("proof_not_found",),
    "get_job_cells": ("cells_not_found",),
    "get_region_cells": ("cells_not_found", "proof_not_found"),
    "get_region_pairs": ("proof_not_found",),
    "get_region_plane": ("cells_not_found", "proof_not_found", "wrong_length", "number_too_large"),
    "get_region_configurations": CHILDREN,
    "download_region_proof": ("proof_not_found",),
    "verify_region": ("proof_not_found", *CHILDREN),
    "export_region": ("bad_name",),
    "delete_region": ("busy",),
    "download_kept_proof": ("motion_not_found", "ambiguous_id", "proof_not_found"),
    "plan_trajectory": ("region_elsewhere", "region_not_found", *CHILDREN),
    "slice_space": CHILDREN,
    "certify_path": CHILDREN,
    "get_graph": CHILDREN,
    "create_key": ("first_key", "key_name", "too_many_keys", "other_projects", "project_not_found"),
    "revoke_key": ("key_not_found", "busy"),
    "list_projects": ("other_projects",),
    "create_project": ("other_projects", "project_name"),
    "get_any_project": ("other_projects", "project_not_found"),
    "set_limits": ("other_projects", "project_not_found"),
    "get_inventory": ("other_projects",),
    "pause_worker": ("worker_draining", "workers_shared", "busy"),
    "resume_worker": ("worker_draining", "workers_shared", "busy"),
    "drain_worker": ("workers_shared", "busy"),
}
"""What else may be wrong, by operation."""


def describe(app: FastAPI) -> dict[str, Any]:
    """Returns the OpenAPI document."""
    if app.openapi_schema is None:
        document = get_openapi(title=app.title, version=app.version, description=app.description, routes=app.routes, tags=TAGS)
        document["servers"] = [{"url": "/", "description": "The service that this document is from."}]
        schemas = document["components"]["schemas"]
        for name in ("HTTPValidationError", "ValidationError"):
            schemas.pop(name, None)
        schemas.update(models_json_schema([(Problem, "serialization")], ref_template="#/components/schemas/{model}")[1]["$defs"])
        for path in document["paths"].values():
            for method, operation in path.items():
                _describe_success(operation)
                _name_errors(method, operation, schemas)
        _add_examples(schemas)
        app.openapi_schema = document
    return app.openapi_schema


TAGS = [
    {"name": "scenes", "description": "Robots and what stands around them."},
    {"name": "jobs", "description": "Work that the service is asked to do, and how it goes."},
    {"name": "regions", "description": "Certified regions and their proofs."},
    {"name": "planning", "description": "Questions of planners about regions."},
    {"name": "project", "description": "The caller's project, its keys, and who changed what."},
    {"name": "projects", "description": "All projects, their limits and what they use; for admins of the project `default`."},
    {"name": "workers", "description": "The workers that live, what they do, and what they shall do."},
    {"name": "service", "description": "How the service is."},
]


def _describe_success(operation: dict[str, Any]) -> None:
    """Says what the answer of an operation that went well is: what the operation's description begins with."""
    for answer in operation["responses"].values():
        if answer["description"] == "Successful Response":
            answer["description"] = operation["description"].partition("\n")[0]


def _name_errors(method: str, operation: dict[str, Any], schemas: dict[str, Any]) -> None:
    """Gives an operation a response for every status that an error of it may have, with the codes that go with the status."""
    responses = operation["responses"]
    responses.pop("422", None)
    by_status: dict[HTTPStatus, list[str]] = {}
    for code in _codes(method, operation, schemas):
        by_status.setdefault(problems.status_of(code), []).append(code)
    for status, codes in sorted(by_status.items()):
        if str(status.value) not in responses:
            named = ", ".join(f"`{code}`" for code in codes)
            more = " or another code, which names what is wrong" if status == HTTPStatus.UNPROCESSABLE_ENTITY else ""
            responses[str(status.value)] = _problem(f"{status.phrase}: {named}{more}.")
    responses["default"] = _problem("Any other error.")


def _codes(method: str, operation: dict[str, Any], schemas: dict[str, Any]) -> list[str]:
    names = {parameter["name"] for parameter in operation.get("parameters", ())}
    content = operation.get("requestBody", {}).get("content", {})
    for described in content.values():
        schema = described["schema"]
        for one in (schema, *schema.get("oneOf", ())):
            names |= set(schemas[one["$ref"].rpartition("/")[2]]["properties"]) if "$ref" in one else set()
    codes = [*ANYWHERE, *(WITH_KEY if operation.get("security") else ()), *(CHANGING if method != "get" else ())]
    codes += WITH_BODY if content else ("invalid_request",) if operation.get("security") else ()
    codes += [code for name in sorted(names) for code in PLACES.get(name, ())]
    return list(dict.fromkeys([*codes, *ALSO.get(operation["operationId"], ())]))


def _problem(description: str) -> dict[str, Any]:
    return {"description": description, "content": {problems.MEDIA_TYPE: {"schema": {"$ref": "#/components/schemas/Problem"}}}}


@cache
def _examples() -> dict[str, dict[str, Any]]:
    found: dict[str, dict[str, Any]] = json.loads(EXAMPLES.read_text())
    return found


def _add_examples(schemas: dict[str, Any]) -> None:
    """Adds to every schema an example of it, unless it has one, and to every field a value."""
    for name, schema in schemas.items():
        example = _examples()["schemas"].get(name)
        if example is not None:
            schema.setdefault("examples", [example])
        for field, described in schema.get("properties", {}).items():
            values = [(example or {}).get(field), _examples()["fields"].get(f"{name}.{field}"), described.get("default")]
            described.setdefault("examples", [next((value for value in values if value is not None), None)])
    schemas[UPLOAD]["properties"]["bundle"]["examples"] = ["(the bytes of scene.zip)"]
    schemas[UPLOAD]["description"] = "Holds the upload of a scene, as multipart/form-data with one part, `bundle`."
    schemas[UPLOAD]["examples"] = [{"bundle": "(the bytes of scene.zip)"}]
