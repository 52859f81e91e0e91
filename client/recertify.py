"""``ciris recertify`` makes a region of a changed scene from one of the scene before it changed."""

from __future__ import annotations

from argparse import Namespace
from pathlib import Path
from typing import Any

from certifier.conditions import called
from certifier.errors import CirisError, unreadable
from certifier.words import counted
from ciris.documents import Document
from ciris.synchronous.client import Client
from client import output, service
from client.files import ProofFile, check_writable
from client.inputs import configuration
from client.options import RECERTIFY
from client.output import Screen, print_json
from client.request import refuse_of_service, request

OK, NO = 0, 1


def recertify(args: Namespace) -> int:
    """Certifies a region again, writes its proof and prints what is kept. Returns the command's exit status.

    Raises:
        CirisError: why nothing is left of it, or what is wrong with the input.
    """
    screen, keep, asked = Screen(), [configuration(q) for q in args.q or []], request(args, RECERTIFY)
    if args.old is not None:
        return _all(args, asked, screen)
    if args.region is None:
        raise CirisError("option", "no region was named", field="REGION", hint="name one, or name its scene with --from")
    check_writable(args.out)
    url = None
    if args.local:
        from client import local

        refuse_of_service(args)
        grown = local.recertify(_proof(Path(args.region)), args.scene, keep or None, asked, screen, args.watch)
    else:
        if keep:
            raise CirisError("option", "the service keeps what the region was grown around inside", field="--q", hint="leave it out")
        with service.connect(args.url) as client:
            scene = service.known_scene(client, args.scene)
            grown = service.grow(client, _request(asked, scene, args.region), screen, args.watch)
            url = f"{client.url}/regions/{grown.region}"
    path = ProofFile(args.out).write(grown.manifest["scene"]["name"], grown.proof)
    if args.json:
        print_json({**grown.manifest, "seconds": grown.seconds, "proof": str(path)})
        return OK
    extra = [("time", output.seconds(grown.seconds)), ("ended", grown.remark), ("proof", f"{path} (check it: ciris verify {path})")]
    facts = [*_facts(grown.manifest["provenance"]["recertified"]), *extra, *([("region", url)] if url else [])]
    output.print_region(grown.manifest, facts)
    return OK


def _request(asked: Document, scene: Document, region: str) -> Document:
    return {"kind": "recertify", "scene": scene["asked"], "region": region, **asked}


def _all(args: Namespace, asked: Document, screen: Screen) -> int:
    """Has the service certify every region of a scene again, one job a region. The new regions stay on the service."""
    if args.local or args.out is not None or args.region is not None or args.q:
        hint = "leave out REGION, --q, --local and --out"
        raise CirisError("option", "all regions of a scene need a service, which keeps the new regions", field="--from", hint=hint)
    with service.connect(args.url) as client:
        old = _old(client, args.old)
        scene = service.known_scene(client, args.scene)
        regions = [region["id"] for region in client.regions(scene=old["id"])]
        jobs = service.grow_many(client, [_request(asked, scene, region) for region in regions], screen, args.watch)
        found = [client.region(job["region"])["manifest"]["provenance"] if job["region"] else None for job in jobs]
    if args.json:
        print_json(jobs)
    else:
        rows = [
            (region[:8], job["region"] or "none", output.share(said["recertified"]["kept"]) if said else "", job["reason"] or "")
            for region, job, said in zip(regions, jobs, found, strict=True)
        ]
        output.print_table(("was", "region", "kept", "ended"), rows, right="kept")
    return OK if all(found) else NO


def _old(client: Client, name: str) -> Document:
    """Returns the scene that ``--from`` names."""
    try:
        return client.scene(name)
    except CirisError as error:
        error.field = "--from" if error.field == "scene" else error.field
        raise


def _proof(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise CirisError("no_file", unreadable(error), field="REGION", hint="--local needs the proof file of a region") from None


def _facts(said: dict[str, Any]) -> list[tuple[str, str]]:
    """Returns what people hear of the region before and of its proofs."""
    cut = [called(pair["a"], pair["b"]) for pair in said["cut"]]
    return [
        ("kept", f"{output.share(said['kept'])} of the region before"),
        ("proofs", f"{counted(len(said['carried']), 'pair')} carried over, {len(said['proved'])} proved again"),
        *(("cut" if not i else "", f"something was cut off for {pair}") for i, pair in enumerate(cut)),
    ]
