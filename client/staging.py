"""These commands change what a name means without an outage: they stage the changed scene, and promote it once it has its regions."""

from __future__ import annotations

from argparse import Namespace
from shlex import quote

from client import service
from client.output import Screen, print_json, scene_size

OK = 0


def scene_stage(args: Namespace) -> int:
    with service.connect(args.url) as client:
        scene = client.stage_scene(args.name, args.path)
        service.warn(client, scene["id"])
    if args.json:
        print_json(scene)
        return OK
    name, staged = quote(args.name), quote(_staged(args.name))
    size = scene_size(scene["joints"], scene["geometries"], scene["pairs"])
    print(f"{scene['id']}  {_staged(args.name)}: {size}")
    print(f"next: ciris recertify --from {name} --scene {staged}")
    print(f"then: ciris scene promote {name}")
    return OK


def scene_promote(args: Namespace) -> int:
    """Has the service compare the regions of the staged scene first, so that the first plans need not wait for it."""
    screen = Screen()
    with service.connect(args.url) as client:
        service.graph(client, _staged(args.name), screen)
        screen.clear()
        done = client.promote_scene(args.name, args.without_regions)
    if args.json:
        print_json(done)
        return OK
    print(f"{args.name} means {done['scene']} from now on; regions: {done['regions']}")
    if done["before"] is not None:
        print(f"before, it meant {done['before']}; regions: {done['regions_before']}")
    return OK


def _staged(name: str) -> str:
    return f"{name}@staged"
