"""``ciris bench``: measurements side by side with Drake, in a checkout of the repository."""

from __future__ import annotations

import logging
import os
import sys
from argparse import Namespace
from pathlib import Path
from typing import Any

from certifier.errors import CirisError
from client import output
from client.output import Screen, print_json

OK, CONTRADICTED = 0, 1
NUMBERS = "k rationals solve verify build setup total ratio instances"


def pairs(args: Namespace) -> int:
    """Named instances of the catalogue, each in a scene of its own."""
    _prepare()
    from benchmarks import catalogue, compare

    return _compare(args, "pairs", [compare.Task(i.name, i.scene, i.region, [0]) for i in catalogue.named(args.names)])


def scene(args: Namespace) -> int:
    """The 7-joint arm against the bookcase, on 12 faces around the seed: 70 pairs, or the cheapest of them."""
    _prepare()
    from benchmarks import catalogue, compare

    return _compare(args, "scene", [compare.shelf(catalogue.scene("iiwa_shelf"), args.pairs)])


def agreement(args: Namespace) -> int:
    """The campaign on hundreds of pairs; no times."""
    _prepare()
    from benchmarks import agreement, machine, tables

    screen = Screen()
    document = agreement.campaign(agreement.questions(), screen.line)
    if args.json:
        print_json(document)
    else:
        print(machine.sentence(document["machine"]))
        for table in (tables.agreement_table(document), tables.disagreements_table(document)):
            print()
            output.print_table(*table, right=NUMBERS)
        evidence = ", ".join(f"{kind}: {number}" for kind, number in document["evidence"].items())
        print(
            f"\n{document['instances']} instances, {document['same_program']} of them the very same program. Evidence for ours: {evidence}."
        )
    return CONTRADICTED if document["contradictions"] else OK


def scaling(args: Namespace) -> int:
    """How the cost grows: the data and a picture of it."""
    _prepare()
    from benchmarks import scaling

    screen = Screen()
    document = scaling.curves(screen.line)
    if args.svg is not None:
        Path(args.svg).write_text(scaling.picture(document), encoding="utf-8")
    print_json(document)
    return OK


def _compare(args: Namespace, benchmark: str, tasks: list[Any]) -> int:
    from benchmarks import compare, machine, tables

    screen = Screen()
    reference = None
    if args.against == "drake":
        reference = compare.live(args.limit, screen.line)
    elif args.against is not None:
        reference = compare.Recorded(args.against)
    document = compare.compare(benchmark, tasks, reference, args.repeat, args.limit, screen.line)
    if args.json:
        print_json(document)
    else:
        print(machine.sentence(document["machine"]))
        if isinstance(reference, compare.Recorded):
            print(f"Drake's side is from {args.against}: {machine.sentence(document['drake_machine'])}")
        print("Seconds of processor time; solve is everything but the verification of the proof.\n")
        output.print_table(*tables.pairs_table(document), right=NUMBERS)
        print()
        output.print_table(*tables.totals_table(document), right=NUMBERS)
        if reference is not None:
            print(f"\nverdicts: {tables.verdicts_line(document)}")
    return CONTRADICTED if document["contradictions"] else OK


def _prepare() -> None:
    """Everything on one thread: what numpy's libraries are told before they are loaded counts, so this process starts anew if need be.

    Raises:
        CirisError: ``no_benchmarks`` outside a checkout of the repository.
    """
    try:
        from benchmarks.machine import ONE_THREAD
    except ModuleNotFoundError:
        raise CirisError("no_benchmarks", "the benchmarks are not installed", hint="run ciris from a checkout of the repository") from None
    if any(os.environ.get(name) != value for name, value in ONE_THREAD.items()):
        sys.stdout.flush()
        os.execve(sys.executable, [sys.executable, *sys.orig_argv[1:]], os.environ | ONE_THREAD)
    logging.getLogger("drake").setLevel(logging.WARNING)
