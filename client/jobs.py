"""Commands about jobs of the service: list, show, follow, cancel and retry them."""

from __future__ import annotations

from argparse import Namespace
from collections.abc import Sequence
from typing import Any

from certifier.errors import CirisError
from certifier.words import counted, unit_names
from ciris.documents import Document
from client import output, service
from client.follow import follow
from client.inputs import labels
from client.output import Screen, print_json

OK, NO = 0, 1
SHORT = 8
"""Number of characters of an id that lists show; the service knows a job by them."""
WORST = 5
"""Number of obstacles of a job that are shown."""


def job_ls(args: Namespace) -> int:
    wanted = labels(args.label)
    with service.connect(args.url) as client:
        jobs = client.jobs(state=args.state, scene=args.scene, labels=wanted, search=args.search, most=args.most)
        names = {scene["id"]: scene["name"] for scene in client.scenes()}
    if args.json:
        print_json(jobs)
        return OK
    rows = [
        (
            job["id"][:SHORT],
            job["kind"],
            job["status"],
            names.get(job["scene"]) or job["scene"],
            job["created_at"][:19],
            job["region"][:SHORT] if job["region"] else "",
            job["reason"] or "",
        )
        for job in jobs
    ]
    output.print_table(("id", "kind", "status", "scene", "created", "region", "reason"), rows)
    return OK


def job_show(args: Namespace) -> int:
    with service.connect(args.url) as client:
        job = client.job(args.job)
        regions, obstacles = client.regions(job=job["id"]), client.obstacles(job["id"])
        units = [*service.units(client.scene(job["scene"])).values()] if obstacles else []
    if args.json:
        print_json({**job, "regions": regions, "obstacles": obstacles})
        return OK
    _print(job)
    for region in regions:
        print(f"  region {region['id'][:SHORT]}: {output.share(region['share'])} of the proposal, {counted(region['faces'], 'face')}")
    for one in obstacles[:WORST]:
        print(f"  {one['text']}{_at(one['q'], units)}")
    return OK


def _at(q: list[float] | None, units: Sequence[str]) -> str:
    """Returns the configuration of an obstacle in radians and metres, as other commands take it."""
    return "" if q is None else f"\n    in {unit_names(units)}: --q={','.join(f'{x:.6g}' for x in q)}"


def job_follow(args: Namespace) -> int:
    """Tells what happens until the job has ended. Its exit status is 0 for a certified one."""
    with service.connect(args.url) as client:
        job = follow(client, args.job, Screen(), args.watch)
    if args.json:
        print_json(job)
    else:
        _print(job)
    return OK if job["outcome"] == "certified" else NO


def job_cancel(args: Namespace) -> int:
    """Asks a job to end. Of one that had ended before, it says so."""
    with service.connect(args.url) as client:
        before = client.job(args.job)
        job = client.cancel(before["id"])
    if before["ended"]:
        Screen().line(f"the job had ended before, {before['state']}; nothing was cancelled")
    return _say(job, args)


def job_retry(args: Namespace) -> int:
    with service.connect(args.url) as client:
        job = client.retry(args.job)
    return _say(job, args)


def job_webhook(args: Namespace) -> int:
    """Says how telling the receiver goes, and has it called again where the user asks for it."""
    with service.connect(args.url) as client:
        job = client.job(args.job)["id"]
        hook = client.resend_webhook(job) if args.resend else client.webhook(job)
    if args.json:
        print_json(hook)
        return OK
    output.print_facts(
        [("url", hook["url"]), ("state", hook["state"]), ("attempts", str(hook["attempts"])), ("next", hook["next_at"][:19])]
    )
    rows = [(one["at"][:19], f"{one['seconds']:.2f}", str(one["status"] or ""), one["error"] or "") for one in hook["deliveries"]]
    output.print_table(("at", "seconds", "status", "error"), rows, right="seconds")
    return OK


def job_webhooks(args: Namespace) -> int:
    """Lists whom jobs tell that they have ended, and whether that went well."""
    with service.connect(args.url) as client:
        found = client.webhooks(args.state)
    if args.json:
        print_json(found)
        return OK
    rows = [(one["job"][:SHORT], one["state"], str(one["attempts"]), one["url"], one["error"] or "") for one in found]
    output.print_table(("job", "state", "attempts", "url", "error"), rows, right="attempts")
    return OK


def _say(job: Document, args: Namespace) -> int:
    if args.json:
        print_json(job)
    else:
        _print(job)
    return OK


def _print(job: dict[str, Any]) -> None:
    error = job["error"]
    facts = [
        ("job", job["id"]),
        ("kind", job["kind"]),
        ("status", job["status"]),
        ("scene", job["scene"]),
        ("created", job["created_at"][:19]),
        *([("labels", ", ".join(f"{name}={value}" for name, value in job["labels"].items()))] if job["labels"] else []),
        ("outcome", output.plain(job["outcome"])),
        *([("reason", job["reason"])] if job["reason"] else []),
        *([("error", str(CirisError.from_document(error)))] if error else []),
        *([("region", job["region"])] if job["region"] else []),
    ]
    output.print_facts(facts)
