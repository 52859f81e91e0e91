"""This module has the service grow and certify."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import datetime
from typing import TYPE_CHECKING, Any

from certifier.errors import CirisError
from certifier.outcome import Guarantee, Outcome
from certifier.words import counted
from ciris.documents import Document, asked_as
from ciris.find import api_key, service_url
from ciris.job import why_no_region
from ciris.synchronous.client import Client
from client import verdicts
from client.follow import follow
from client.inputs import is_scene_file
from client.output import NEGATIVE, Screen

if TYPE_CHECKING:  # It needs numpy, and most questions do not.
    from client.polytopes import PolytopeFile


@dataclass(frozen=True)
class Grown:
    """Describes a region that a job has grown.

    Attributes:
        manifest: the region's manifest.
        proof: the bytes of its proof file.
        seconds: how long the job took.
        region: its id on the service; None when it was grown in this process.
        remark: why growing ended.
    """

    manifest: Document
    proof: bytes
    seconds: float
    region: str | None = None
    remark: str = ""


def connect(url: str | None) -> Client:
    """Returns a client of the service at this address, or of the one that is found (:func:`ciris.find.service_url`).

    Raises:
        CirisError: no_service.
    """
    return Client(service_url(url), api_key())


def known_scene(client: Client, scene: str) -> Document:
    """Returns the scene of a scene file, which it uploads, or the scene with a name or id that the service knows.

    ``asked`` in it is what requests call it.
    """
    found = client.add_scene(scene) if is_scene_file(scene) else client.scene(scene)
    return {**found, "asked": asked_as(found, None if is_scene_file(scene) else scene)}


def scene_name(client: Client, scene: str) -> str:
    """Returns what a question calls a scene: as ``asked`` of :func:`known_scene`, or the name or id that was typed.

    The answer says if the service does not know it. So a name takes no request of its own.
    """
    asked: str = known_scene(client, scene)["asked"] if is_scene_file(scene) else scene
    return asked


def units(scene: Document) -> dict[str, str]:
    """Returns the units of joint positions by the names of the joints, in position order."""
    return {joint["name"]: "rad" if joint["kind"] == "revolute" else "m" for joint in scene["positions"]}


def warn(client: Client, scene_id: str) -> None:
    """Prints the warnings of a scene, as errors are printed."""
    for warning in client.lint(scene_id)["warnings"]:
        print("warning:", warning, file=sys.stderr)


def grow(client: Client, request: Document, screen: Screen, watch: bool = False, idempotency_key: str | None = None) -> Grown:
    """Makes the service grow a region, and waits for it.

    Under an idempotency key it takes the job made earlier, or a retry of that job where it ended without a region.

    Raises:
        CirisError: why there is no region.
    """
    job, new = client.create_job(request, idempotency_key)
    while not new and job["ended"] and job["region"] is None:
        job = client.retry(job["id"])
    screen.line(f"job {job['id']}{', done in an earlier run' if job['ended'] else ''}: {client.url}/jobs/{job['id']}")
    _tell_warnings(job, screen)
    if not job["ended"]:
        job = _wait(client, job["id"], screen, watch)
    if job["region"] is None:
        raise why_no_region(job)
    region = client.region(job["region"])
    return Grown(region["manifest"], client.proof(job["region"]), _seconds(job), job["region"], job["reason"] or "")


def grow_many(client: Client, requests: Sequence[Document], screen: Screen, watch: bool = False) -> list[Document]:
    """Makes the service grow regions, all at once, and waits for them. Returns the ended jobs, with a region or without."""
    jobs = [client.create_job(request)[0] for request in requests]
    for job in jobs:
        screen.line(f"job {job['id']}: {client.url}/jobs/{job['id']}")
        _tell_warnings(job, screen)
    return [_wait(client, job["id"], screen, watch) for job in jobs]


def _tell_warnings(job: Document, screen: Screen) -> None:
    """Tells what the service has warned of. A retry, and a service of an earlier version, have warned of nothing."""
    for warning in job.get("warnings", ()):
        screen.line(f"warning: {warning}")


def run(client: Client, request: Document, screen: Screen) -> Document:
    """Makes the service cover a scene or certify a motion, and waits for it. Returns the ended job.

    Raises:
        CirisError: what went wrong.
    """
    job, _ = client.create_job(request)
    screen.line(f"job {job['id']}: {client.url}/jobs/{job['id']}")
    job = _wait(client, job["id"], screen, False)
    if job["outcome"] is None or (job["error"] and job["error"]["code"] not in NEGATIVE):
        raise why_no_region(job)
    return job


def graph(client: Client, scene: str, screen: Screen) -> Document:
    """Returns which regions of a scene overlap, once the service has compared them all."""
    answer = client.graph(scene)
    while not answer["complete"]:
        screen.status(f"comparing regions: {counted(len(answer['edges']), 'overlap')} so far")
        answer = client.graph(scene)
    return answer


def certify(client: Client, scene: Document, given: PolytopeFile, asked: Document, screen: Screen, watch: bool = False) -> Document:
    """Makes the service certify a polytope, and returns the document of ``ciris certify --json``.

    Args:
        asked: the options of the request.

    Raises:
        CirisError: the polytope was refused, or the job was cancelled.
    """
    given.check_space([joint["name"] for joint in scene["positions"]], [joint["q_star"] for joint in scene["positions"]])
    body: dict[str, Any] = {"C": given.polytope.C.tolist(), "d": given.polytope.d.tolist()}
    if given.center is not None:
        body["center"] = given.center.tolist()
    job, _ = client.create_job({"kind": "certify", "scene": scene["asked"], "polytope": body, **asked})
    screen.line(f"job {job['id']}: {client.url}/jobs/{job['id']}")
    job = _wait(client, job["id"], screen, watch)
    if job["outcome"] is None or (job["error"] and job["error"]["code"] not in NEGATIVE):
        raise why_no_region(job)
    matrix = client.job_pairs(job["id"])
    names = {pair["index"]: pair for pair in matrix["pairs"]}
    outcome = Outcome(job["outcome"])
    guarantee = Guarantee.EXACT if outcome is Outcome.CERTIFIED else Guarantee.NONE
    settled = [cell for cell in matrix["cells"] if cell["state"] in set(Outcome)]
    pairs = [{**cell, "outcome": cell["state"], "a": names[cell["pair"]]["a"], "b": names[cell["pair"]]["b"]} for cell in settled]
    return verdicts.document(scene["name"], scene["hash"], outcome, guarantee, _seconds(job), pairs, job["region"])


def _wait(client: Client, job_id: str, screen: Screen, watch: bool) -> Document:
    try:
        wrong = "; ".join(f"{name}: {said}" for name, said in client.ready()["checks"].items() if said != "ok")
        if wrong:
            screen.line(f"warning: the job waits until the service has all that it needs ({wrong})")
        return follow(client, job_id, screen, watch)
    except (KeyboardInterrupt, CirisError):
        screen.line(f"job {job_id} goes on while the service runs: {client.url}/jobs/{job_id}")
        screen.line(f"come back to it with `ciris job follow {job_id[:8]}`, or end it with `ciris job cancel {job_id[:8]}`")
        raise


def _seconds(job: Document) -> float:
    start, end = (datetime.fromisoformat(job[name]) for name in ("started_at", "finished_at"))
    return (end - start).total_seconds()
