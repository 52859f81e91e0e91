"""Each function here does what one command asks. It takes the parsed arguments and returns the exit status."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from certifier.conditions import called, condition_named, fails
from certifier.errors import CirisError
from certifier.outcome import Outcome
from certifier.verify.decimals import at_most_mm, exactly
from certifier.verify.uncovered import named
from certifier.words import joint_positions
from ciris.documents import Document
from client import output, service
from client.files import ProofFile, check_writable
from client.inputs import configuration, shown
from client.options import CERTIFY, GROW
from client.output import Screen, print_json
from client.polytopes import polytope_file
from client.request import refuse_of_service, request
from client.seeds import place_of_seed, seed_of

OK, NO = 0, 1
AT_ONCE = 100
"""The service says of at most this many configurations at a time what is wrong there."""


def up(args: Namespace) -> int:
    """Replaces this process by the supervisor of the embedded stack."""
    options = [f"--{name}={value}" for name, value in (("port", args.port), ("data", args.data)) if value is not None]
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-P", "-m", "workers.stack", *options])


def in_database(args: Namespace) -> int:
    """Replaces this process by the command that acts on the database: ``args.module`` with ``args.words``."""
    options = [] if args.data is None else [f"--data={args.data}"]
    sys.stdout.flush()
    os.execv(sys.executable, [sys.executable, "-P", "-m", args.module, *options, *args.words(args)])


def scene_add(args: Namespace) -> int:
    with service.connect(args.url) as client:
        scene = client.add_scene(args.path)
        service.warn(client, scene["id"])
    if args.json:
        print_json(scene)
    else:
        print(f"{scene['id']}  {scene['name']}: {scene['joints']} joints, {scene['geometries']} geometries, {scene['pairs']} pairs")
    return OK


def scene_constrain(args: Namespace) -> int:
    from certifier.scene.file import read_condition_file  # which needs PyYAML

    conditions = read_condition_file(Path(args.conditions))
    with service.connect(args.url) as client:
        scene = client.constrain_scene(service.scene_name(client, args.scene), conditions, args.name)
        service.warn(client, scene["id"])
    if args.json:
        print_json(scene)
    else:
        print(f"{scene['id']}  {scene['name']}")
        for condition in scene["conditions"]:
            print(f"condition '{condition['name']}': {condition['statement']}")
    return OK


def scene_ls(args: Namespace) -> int:
    with service.connect(args.url) as client:
        scenes = client.scenes()
    if args.json:
        print_json(scenes)
    else:
        rows = [(s["id"], s["name"], ", ".join(s["names"]), str(s["joints"]), str(s["geometries"]), str(s["pairs"])) for s in scenes]
        output.print_table(("id", "name", "meant by", "joints", "geometries", "pairs"), rows, right="joints geometries pairs")
    return OK


def scene_show(args: Namespace) -> int:
    with service.connect(args.url) as client:
        scene = client.scene(args.scene)
        lint, pairs = client.lint(args.scene), client.scene_pairs(args.scene)
    if args.json:
        print_json({**scene, "lint": lint, "pair_list": pairs})
        return OK
    print(f"{scene['name']} ({scene['id']}), padding {exactly(scene['padding'])} m")
    units = service.units(scene)
    rows = [(j["name"], j["kind"], *(f"{j[of]:.4f} {units[j['name']]}" for of in ("lower", "upper", "q_star"))) for j in scene["positions"]]
    output.print_table(("joint", "kind", "lower", "upper", "q*"), rows, right="lower upper q*")
    output.print_configurations(scene["configurations"], units)
    print()
    costs = [
        (
            f"{p['a']} - {p['b']}",
            f"{1000 * p['padding']:.4g} mm",
            p["frame"],
            f"{p['gram_a']}, {p['gram_b']}",
            f"{p['N_a']}, {p['N_b']}",
            output.seconds(p["seconds"]),
        )
        for p in pairs
        if condition_named(p["a"], p["b"]) is None
    ]
    output.print_table(("pair", "padding", "frame", "Gram", "N", "forecast"), costs, right="padding Gram N forecast")
    for item in lint["substitutions"]:
        print(f"{item['geometry']}: {item['substitution']} (reaches outside by at most {at_most_mm(item['inflation'])})")
    for item in lint["ignored"]:
        print(f"ignored: {item['a']} - {item['b']} ({item['reason']})")
    for one in scene["conditions"]:
        print(f"condition {one['name']}: {one['statement']}")
    _print_not_covered(scene["not_covered"])
    for warning in lint["warnings"]:
        print("warning:", warning)
    return OK


def grow(args: Namespace) -> int:
    try:
        return _grow(args)
    except CirisError as error:
        error.field = place_of_seed(error.field, args.scene, (getattr(args, "seed.q") or [None])[0])
        raise


def _grow(args: Namespace) -> int:
    screen = Screen()
    if args.local:
        from client.local import check_is_file

        check_is_file(args.scene)
        refuse_of_service(args)
    asked = request(args, GROW)
    requests = [{**asked, "seed": {"q": seed_of(args.scene, q), **asked["seed"]}} for q in getattr(args, "seed.q") or [None]]
    if len(requests) > 1:
        return _grow_many(args, requests, screen)
    check_writable(args.out)
    proof = ProofFile(args.out)
    if args.local:
        from client import local

        try:
            grown, url = local.grow(args.scene, requests[0], screen, args.watch, proof.write), None
        except KeyboardInterrupt:
            if proof.path is not None:
                screen.line(f"the proof of the best region so far: {proof.path} (check it: ciris verify {proof.path})")
            raise
    else:
        with service.connect(args.url) as client:
            scene = service.known_scene(client, args.scene)
            grown = service.grow(client, {"kind": "grow", "scene": scene["asked"], **requests[0]}, screen, args.watch)
            url = f"{client.url}/regions/{grown.region}"
    path = proof.write(grown.manifest["scene"]["name"], grown.proof)
    if args.json:
        print_json({**grown.manifest, "seconds": grown.seconds, "proof": str(path)})
        return OK
    extra = [("time", output.seconds(grown.seconds)), ("ended", grown.remark), ("proof", f"{path} (check it: ciris verify {path})")]
    output.print_region(grown.manifest, [*extra, *([("region", url)] if url else [])])
    return OK


def _grow_many(args: Namespace, requests: list[Document], screen: Screen) -> int:
    """Has the service run one job a seed. The regions stay on the service."""
    if args.local or args.out is not None:
        raise CirisError(
            "several_seeds", "several seeds need a service, which keeps their regions", field="--q", hint="leave out --local and --out"
        )
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)
        jobs = service.grow_many(client, [{"kind": "grow", "scene": scene["asked"], **one} for one in requests], screen, args.watch)
        grown = {job["region"]: client.region(job["region"]) for job in jobs if job["region"]}
    if args.json:
        print_json(jobs)
    else:
        rows = [
            (
                shown(one["seed"]["q"]),
                job["region"] or "none",
                _size(grown[job["region"]]) if job["region"] else "",
                output.share(grown[job["region"]]["share"]) if job["region"] else "",
                job["reason"] or "",
            )
            for one, job in zip(requests, jobs, strict=True)
        ]
        output.print_table(("q", "region", "size", "share", "ended"), rows, right="size share")
    return OK if len(grown) == len(jobs) else NO


def certify(args: Namespace) -> int:
    screen = Screen()
    polytope = polytope_file(args.polytope)
    drake, asked = _drake(args), request(args, CERTIFY)
    proof: bytes | None
    kept = None
    if args.out is not None:
        check_writable(args.out)
        kept = ProofFile(args.out)
    if args.local:
        from client import local

        refuse_of_service(args)
        document, units, proof = local.certify(args.scene, polytope, asked, screen, args.watch, drake, kept is not None)
    else:
        with service.connect(args.url) as client:
            known = service.known_scene(client, args.scene)
            document, units = service.certify(client, known, polytope, asked, screen, args.watch), [*service.units(known).values()]
            proof = client.proof(document["region"]) if kept is not None and document["region"] else None
    path = None if kept is None or proof is None else kept.write(document["scene"]["name"], proof)
    document = {**document, "proof": None if path is None else str(path)}
    if args.json:
        print_json(document)
    else:
        output.print_pairs(document["pairs"])
        for pair in document["pairs"]:
            if pair["witness_q"] is not None:
                collides = pair["outcome"] == Outcome.REFUTED
                how = fails(pair["a"], pair["b"]) if collides else f"{called(pair['a'], pair['b'])}: {pair['detail']},"
                print(f"{how} at q = {joint_positions(pair['witness_q'], units)}")
        scene = document["scene"]["name"]
        print(f"{scene}: {output.plain(document['outcome'])}, guarantee {document['guarantee']}, {output.seconds(document['seconds'])}")
        if document["region"] is not None:
            print(f"region {document['region']}")
        if path is not None:
            print(f"proof {path} (check it: ciris verify {path})")
    return OK if document["outcome"] == "certified" else NO


def _drake(args: Namespace) -> str | None:
    """Returns the name of the solver that Drake uses; None when our certifier is asked."""
    if args.backend != "drake":
        if args.solver is not None:
            raise CirisError("option", "only Drake takes a solver", field="--solver", hint="add --backend drake")
        return None
    if args.cells is not None:
        raise CirisError("option", "Drake's own program knows no cells", field="--cells", hint="leave --cells or --backend drake out")
    if args.out is not None:
        raise CirisError("option", "Drake writes no proof", field="--out", hint="leave --out or --backend drake out")
    if not args.local:
        raise CirisError("option", "the service asks its own certifier only", field="--backend", hint="add --local")
    return args.solver or "clarabel"


def region_ls(args: Namespace) -> int:
    with service.connect(args.url) as client:
        regions = client.regions(scene=args.scene)
        names = {scene["id"]: scene["name"] for scene in client.scenes()}
    if args.json:
        print_json(regions)
        return OK
    rows = [
        (
            r["id"],
            names.get(r["scene"]) or r["scene"],
            str(r["faces"]),
            _size(r),
            output.share(r["share"]),
            r["guarantee"],
            r["created_at"][:19],
        )
        for r in regions
    ]
    output.print_table(("id", "scene", "faces", "size", "share", "guarantee", "created"), rows, right="faces size share")
    return OK


def _size(region: dict[str, Any]) -> str:
    """Returns the size of a region in a list: its average and its least width in degrees, or its q-volume where joints slide."""
    size = region["q_volume"]
    if size is None or not size["box_side"]:
        return "-" if size is None else f"{size['value']:.3g} {size['unit']}"
    least = f", least {size['least_width']:.3g} deg" if size.get("least_width") else ""
    return f"average width {size['box_side']:.3g} deg{least}"


def region_show(args: Namespace) -> int:
    with service.connect(args.url) as client:
        region = client.region(args.region)
    if args.json:
        print_json(region["manifest"])
        return OK
    output.print_region(region["manifest"], [("job", region["job"]), ("created", region["created_at"])])
    print()
    output.print_pairs(region["manifest"]["pairs"])
    _print_not_covered(region["not_covered"])
    return OK


def _print_not_covered(found: dict[str, Any]) -> None:
    """Prints which pairs no proof is about."""
    print(found["summary"])
    for line in named(found):
        print(f"  {line}")


def region_export(args: Namespace) -> int:
    if args.out is not None:
        check_writable(args.out)
    with service.connect(args.url) as client:
        data = client.proof(args.region) if args.format == "proof" else client.export(args.region, args.format, args.name)
    if args.out is not None:
        Path(args.out).write_bytes(data)
    elif args.format in ("npz", "proof") and sys.stdout.isatty():
        raise CirisError("terminal", f"{args.format} is not for terminals", field="--out", hint="name a file")
    else:
        sys.stdout.buffer.write(data)
    return OK


def contains(args: Namespace) -> int:
    points = [configuration(text) for text in args.q]
    with service.connect(args.url) as client:
        scene = service.known_scene(client, args.scene)
        answer = client.contains(scene["asked"], points)
        outside = [(q, point) for q, point in zip(points, answer["points"], strict=True) if not point["inside"]]
        for i in range(0, len(outside), AT_ONCE):
            some = outside[i : i + AT_ONCE]
            contacts = client.contacts(scene["asked"], [q for q, _ in some])["contacts"]
            for (_, point), contact in zip(some, contacts, strict=True):
                point["trouble"] = contact["trouble"]
    inside = not outside
    if args.json:
        print_json(answer)
        return OK if inside else NO
    for q, point in zip(points, answer["points"], strict=True):
        where = shown(q)
        if point["inside"]:
            proofs = [f"{hit['region']} (margin {hit['margin']:.3g}, {hit['guarantee']})" for hit in point["regions"]]
            proofs += [f"motion {motion}" for motion in point["motions"]]
            proofs += [f"map of job {answer['map']}"] * bool(point["map"])
            print(f"inside: {where} in {'; '.join(proofs)}")
        else:
            beyond = "not in the scene's one region" if answer["regions"] == 1 else f"in none of {answer['regions']} regions"
            mapped = "" if point["map"] is None else ", nor does the map prove it free"
            trouble = ": " + "; ".join(point["trouble"]) if point["trouble"] else ", though floating point finds nothing wrong there"
            print(f"outside: {where} is {beyond}{mapped}{trouble}")
    return OK if inside else NO


def doctor(args: Namespace) -> int:
    from client.doctor import examine

    findings = examine(args.url)
    if args.json:
        print_json([vars(finding) for finding in findings])
    else:
        output.print_facts([(finding.name, f"{'' if finding.good else 'PROBLEM: '}{finding.text}") for finding in findings])
    return OK if all(finding.good for finding in findings) else NO
