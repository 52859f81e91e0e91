"""Runs one benchmark of ciris and prints what it measured."""

from __future__ import annotations

import json
import logging
import math
import sys
from argparse import ArgumentParser, ArgumentTypeError, Namespace
from collections.abc import Callable
from pathlib import Path
from typing import Any

from benchmarks import (
    agreement,
    catalogue,
    compare,
    cover,
    fleet,
    growth,
    lookups,
    makers,
    maps,
    models,
    path,
    plan,
    query,
    recertify,
    report,
    robots,
    scaling,
    service,
    store,
    survey,
)
from certifier.errors import CirisError
from client.output import Screen, print_json

OK, FAILED, BAD_INPUT = 0, 1, 2


def main() -> int:
    """Runs one benchmark. It returns exit status 1 when verdicts contradict each other, or when a step of an arm failed."""
    logging.getLogger("drake").setLevel(logging.WARNING)
    args = _parser().parse_args()
    if args.benchmark == "docs":
        report.write()
        return OK
    screen = Screen()
    try:
        document = _BENCHMARKS[args.benchmark](args, screen)
    except CirisError as error:
        print(f"error: {error}", file=sys.stderr)
        return BAD_INPUT
    if args.json:
        print_json(document)
    else:
        print(report.text(document))
    contradicted = compare.Verdict.CONTRADICTION in (document.get("verdicts") or {})
    return FAILED if contradicted or any(row.get("failed") for row in document.get("rows", [])) else OK


def _pairs(args: Namespace, screen: Screen) -> dict[str, Any]:
    return compare.compare("pairs", compare.ladder(), args.against is not None, args.repeat, screen.line)


def _scene(args: Namespace, screen: Screen) -> dict[str, Any]:
    task = compare.whole_scene(args.scene, args.region, args.match, args.pairs)
    return compare.compare("scene", [task], args.against is not None, args.repeat, screen.line)


def _growth(args: Namespace, screen: Screen) -> dict[str, Any]:
    old = None if args.into is None else json.loads(args.into.read_text(encoding="utf-8"))
    document = growth.growth(args.scenes, args.against is not None, args.limit, screen.line, args.way)
    if old is None:
        return document
    document = growth.merged(old, document)
    args.into.write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    return document


def _cover(args: Namespace, screen: Screen) -> dict[str, Any]:
    more = {
        name: value
        for name in ("cells", "stages", "at_once", "region_seconds", "random_seed")
        if (value := getattr(args, name)) is not None
    }
    ways = args.way or [cover.CIRIS]
    return cover.cover(args.cases, ways, args.processes, args.deadline, args.data, args.verify, screen.line, **more)


_BENCHMARKS: dict[str, Callable[[Namespace, Screen], dict[str, Any]]] = {
    "pairs": _pairs,
    "scene": _scene,
    "growth": _growth,
    "path": lambda args, screen: path.path(args.scenes, args.motions, screen.line),
    "agreement": lambda args, screen: agreement.campaign(agreement.questions(), screen.line),
    "scaling": lambda args, screen: scaling.curves(args.against is not None, screen.line),
    "service": lambda args, screen: service.beside_local(args.scenes, args.postgresql, args.processes, args.turns, screen.line),
    "store": lambda args, screen: store.store(args.postgresql, store.COUNTS, screen.line),
    "fleet": lambda args, screen: fleet.fleet(
        args.postgresql, args.workers, args.pieces, args.seconds, args.limit, args.processes, screen.line
    ),
    "cover": _cover,
    "robots": lambda args, screen: robots.robots(args.robots, args.deadline, screen.line),
    "arms": lambda args, screen: makers.arms(args.arms, args.deadline, args.motions, screen.line),
    "map": lambda args, screen: maps.maps(args.scenes, args.limit, screen.line, args.drake),
    "lookups": lambda args, screen: lookups.lookups(args.scenes, args.cells, args.limit, screen.line),
    "recertify": lambda args, screen: recertify.changes(args.scenes, args.limit, screen.line),
    "query": lambda args, screen: query.query(args.regions, screen.line),
    "plan": lambda args, screen: plan.motions(args.scene, args.url, args.queries, args.points, screen.line),
    "survey": lambda args, screen: survey.survey(args.scenes, args.most, screen.line, args.cells),
}


def _parser() -> ArgumentParser:
    parser = ArgumentParser(prog="ciris bench", description=__doc__)
    kinds = parser.add_subparsers(dest="benchmark", required=True)
    as_json = ArgumentParser(add_help=False)
    as_json.add_argument("--json", action="store_true", help="print one JSON document")
    against = ArgumentParser(add_help=False, parents=[as_json])
    against.add_argument("--against", choices=["drake"], help="measure Drake with Clarabel too, in the same run")
    repeat = ArgumentParser(add_help=False)
    repeat.add_argument("--repeat", type=_count, default=1, metavar="N", help="run ciris this often; the fastest run counts")
    kinds.add_parser(
        "pairs", parents=[against, repeat], help="measure pairs with longer and longer chains, each one feasible and infeasible"
    )
    scene = kinds.add_parser("scene", parents=[against, repeat], help="measure the pairs of a scene")
    scene.add_argument("scene", nargs="?", default="iiwa_shelf", help=f"default iiwa_shelf; {', '.join(catalogue.SCENES)}")
    regions = "; ".join(f"{name}: {what}" for name, what in catalogue.REGIONS.items())
    scene.add_argument("--region", choices=list(catalogue.REGIONS), default="middle", help=f"default middle; {regions}")
    scene.add_argument("--match", default="", metavar="TEXT", help="measure only pairs with this text in their names")
    scene.add_argument("--pairs", type=_count, metavar="N", help="measure only the N cheapest of these pairs")
    grown = kinds.add_parser("growth", parents=[against], help="grow regions in several ways")
    grown.add_argument("scenes", nargs="*", metavar="EXAMPLE", default=list(catalogue.EXAMPLES), help="default: all")
    grown.add_argument(
        "--limit", type=float, default=growth.LIMIT, metavar="SECONDS", help=f"end each way after this long; default {growth.LIMIT:g}"
    )
    grown.add_argument("--way", action="append", choices=[growth.IRIS, *growth.WAYS], help="measure this way only; may be said again")
    grown.add_argument(
        "--into", type=Path, metavar="FILE", help="put the rows into this document, in place of the same examples' rows of the same ways"
    )
    moved = kinds.add_parser("path", parents=[as_json], help="certify random motions, beside dense sampling of them")
    moved.add_argument("scenes", nargs="*", metavar="SCENE", default=list(path.SCENES), help=f"default: all; {', '.join(path.SCENES)}")
    moved.add_argument("--motions", type=_count, default=20, metavar="N", help="how many motions of each length; default 20")
    kinds.add_parser("agreement", parents=[as_json], help="compare verdicts on hundreds of pairs with Drake's")
    kinds.add_parser("scaling", parents=[against], help="measure how the cost grows with obstacles, joints and faces")
    covered = kinds.add_parser("cover", parents=[as_json], help="measure how much regions cover over the seconds")
    covered.add_argument("cases", nargs="+", choices=list(cover.CASES), metavar="CASE", help=", ".join(cover.CASES))
    covered.add_argument(
        "--way", action="append", choices=[*cover.WAYS], help="drake and iris_zo: IRIS regions without certificates; default ciris"
    )
    covered.add_argument("--deadline", type=_seconds, metavar="SECONDS", help="default: the case's")
    covered.add_argument("--processes", type=_count, default=2, metavar="N", help="number of solving processes; default 2")
    covered.add_argument("--data", type=Path, metavar="DIR", help="keep the service's data in this new directory; default: remove it")
    covered.add_argument("--verify", action="store_true", help="have the service check the proof of every region once more")
    covered.add_argument("--cells", type=_count, metavar="N", help="instead of the cover's default")
    covered.add_argument("--stages", type=_count, metavar="N", help="instead of the cover's default")
    covered.add_argument("--at-once", type=_count, metavar="N", help="instead of the cover's default")
    covered.add_argument("--region-seconds", type=float, metavar="SECONDS", help="instead of the cover's default")
    covered.add_argument("--random-seed", type=int, metavar="N", help="instead of the cover's default")
    surveyed = kinds.add_parser("survey", parents=[as_json], help="certify every pair of every scene on every region")
    surveyed.add_argument("scenes", nargs="*", metavar="SCENE", default=list(catalogue.SCENES), help="default: all")
    surveyed.add_argument("--most", type=float, default=5.0, metavar="SECONDS", help="leave pairs with a longer forecast out; default 5")
    by_cells = "certify cell by cell: at most N cells for a pair, and 20 N if it is still undecided"
    surveyed.add_argument("--cells", type=_count, default=1, metavar="N", help=by_cells)
    served = kinds.add_parser("service", parents=[as_json], help="measure the service beside --local")
    served.add_argument("scenes", nargs="*", default=["iiwa_shelf"], metavar="EXAMPLE", help="default iiwa_shelf")
    served.add_argument("--postgresql", metavar="URL", help="measure the service with this empty PostgreSQL database too, besides SQLite")
    served.add_argument("--processes", type=_count, default=1, metavar="N", help="number of the service's solving processes; default 1")
    served.add_argument("--turns", type=_count, default=5, metavar="N", help="how often each is run; default 5")
    stored = kinds.add_parser("store", parents=[as_json], help="measure what the database takes for a pair in jobs of 1000 and of 100000")
    stored.add_argument("--postgresql", metavar="URL", help="measure this empty PostgreSQL database too, besides SQLite")
    many = kinds.add_parser("fleet", parents=[as_json], help="measure how many pieces of work many workers get from one database")
    many.add_argument("--postgresql", metavar="URL", help="in this empty PostgreSQL database; default: in SQLite")
    many.add_argument("--workers", type=_count, default=100, metavar="N", help="default 100")
    many.add_argument("--pieces", type=_count, default=100_000, metavar="N", help="undecided pieces at the beginning; default 100000")
    many.add_argument("--seconds", type=float, default=1.0, metavar="S", help="how long a worker holds a piece; default 1")
    many.add_argument("--limit", type=float, default=60.0, metavar="S", help="how long to measure; default 60")
    many.add_argument("--processes", type=_count, default=2, metavar="N", help="how many processes run the workers; default 2")
    shipped = kinds.add_parser("robots", parents=[as_json], help="take robots as people ship them from model files to a verified region")
    shipped.add_argument(
        "robots", nargs="*", metavar="ROBOT", default=list(models.ROBOTS), help=f"default: all; {', '.join(models.ROBOTS)}"
    )
    shipped.add_argument(
        "--deadline", type=_seconds, default=robots.DEADLINE, metavar="SECONDS", help=f"for each region; default {robots.DEADLINE:g}"
    )
    made = "take makers' arms with their hands from installed wheels to planned motions; the exit status is 1 if a step failed"
    held = kinds.add_parser("arms", parents=[as_json], help=made)
    held.add_argument("arms", nargs="*", metavar="ARM", default=list(makers.ARMS), help=f"default: all; {', '.join(makers.ARMS)}")
    held.add_argument(
        "--deadline", type=_seconds, default=makers.DEADLINE, metavar="SECONDS", help=f"for each region; default {makers.DEADLINE:g}"
    )
    held.add_argument("--motions", type=_count, default=makers.MOTIONS, metavar="N", help=f"how many to plan; default {makers.MOTIONS}")
    asked = kinds.add_parser("query", parents=[as_json], help="measure questions of planners about many regions, beside a plain product")
    asked.add_argument("--regions", type=_count, default=query.REGIONS, metavar="N", help=f"default {query.REGIONS}")
    planned = kinds.add_parser("plan", parents=[as_json], help="find and prove motions by a running service, beside OMPL without proofs")
    planned.add_argument("scene", metavar="SCENE", help=f"a scene file, or one of {', '.join(catalogue.FILES)}")
    planned.add_argument("--url", help="the service; default: the one that is found")
    planned.add_argument("--queries", type=_count, default=plan.QUERIES, metavar="N", help=f"how many questions; default {plan.QUERIES}")
    planned.add_argument(
        "--points", type=_count, default=plan.POINTS, metavar="N", help=f"points of each motion that Drake looks at; default {plan.POINTS}"
    )
    mapped = kinds.add_parser("map", parents=[as_json], help="grow maps, look configurations and motions up in them, and connect some")
    mapped.add_argument("scenes", nargs="*", metavar="EXAMPLE", default=list(maps.SCENES), help=f"default: {', '.join(maps.SCENES)}")
    mapped.add_argument(
        "--limit", type=float, default=maps.LIMIT, metavar="SECONDS", help=f"each map ends at this many seconds; default {maps.LIMIT:g}"
    )
    mapped.add_argument(
        "--drake", type=_count, default=0, metavar="N", help="Drake looks for collisions at N configurations of each free set; default 0"
    )
    looked = kinds.add_parser("lookups", parents=[as_json], help="look configurations and motions up in free sets of very many cells")
    looked.add_argument("scenes", nargs="*", metavar="EXAMPLE", default=list(lookups.SCENES), help=f"default: {', '.join(lookups.SCENES)}")
    looked.add_argument("--cells", type=_count, default=lookups.CELLS, metavar="N", help=f"how many are proved; default {lookups.CELLS}")
    looked.add_argument(
        "--limit", type=float, default=lookups.LIMIT, metavar="SECONDS", help=f"each map grows for this long; default {lookups.LIMIT:g}"
    )
    changed = kinds.add_parser("recertify", parents=[as_json], help="certify regions again whose scenes have changed, and grow them anew")
    changed.add_argument(
        "scenes", nargs="*", metavar="EXAMPLE", default=list(recertify.SCENES), help=f"default: {', '.join(recertify.SCENES)}"
    )
    changed.add_argument(
        "--limit",
        type=float,
        default=recertify.LIMIT,
        metavar="SECONDS",
        help=f"growth ends at this many seconds; default {recertify.LIMIT:g}",
    )
    kinds.add_parser("docs", help="write the tables of docs/benchmarks.md from docs/benchmarks/*.json")
    return parser


def _count(text: str) -> int:
    """Returns the whole number, 1 or larger, that a text stands for."""
    if not text.isdecimal() or int(text) < 1:
        raise ArgumentTypeError(f"'{text}' is not a whole number of at least 1")
    return int(text)


def _seconds(text: str) -> float:
    """Returns the positive number of seconds that a text stands for."""
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0 < value < math.inf:
        raise ArgumentTypeError(f"'{text}' is not a positive number of seconds")
    return value


if __name__ == "__main__":
    sys.exit(main())
