"""Commands that delete scenes, jobs and regions. What depends on one is said, and deleted only where the user says so."""

from __future__ import annotations

from argparse import Namespace

from certifier.errors import CirisError
from client.service import connect

OK = 0


def scene_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        scene = client.scene(args.scene)
        others = [name for name in scene["names"] if name not in (args.scene, f"{args.scene}@staged")]
        if args.scene in scene["names"] and others:
            message = f"it is called {', '.join(others)} as well, and all of its names go with it"
            raise CirisError("has_names", message, field="SCENE", hint=f"give its id to delete it: ciris scene rm {scene['id']}")
        client.delete_scene(scene["id"], args.dependents)
    return OK


def job_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        client.delete_job(client.job(args.job)["id"], args.dependents)
    return OK


def region_rm(args: Namespace) -> int:
    with connect(args.url) as client:
        client.delete_region(client.region(args.region)["id"])
    return OK
