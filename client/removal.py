"""Commands that delete scenes, jobs and regions. What depends on one is said, and deleted only where the user says so."""

from __future__ import annotations

from argparse import Namespace

from client.service import connect

OK = 0


def scene_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        client.delete_scene(client.scene(args.scene)["id"], args.dependents)
    return OK


def job_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        client.delete_job(client.job(args.job)["id"], args.dependents)
    return OK


def region_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        client.delete_region(client.region(args.region)["id"])
    return OK
