"""This module parses the arguments of the ``ciris`` command and runs it."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import re
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import metadata
from types import FrameType
from typing import Any, NoReturn

from certifier.errors import CirisError, unreadable
from certifier.model import escaped
from client.output import NEGATIVE

EPILOG = """exit status: 0 success; 1 a negative answer (not certified, a proof that does not hold, a point outside);
2 bad input or no service; 130 interrupted. An error is one line on standard error. With --json a command prints one
JSON document on standard output; everything else goes to standard error.

SCENE is the path of a scene file (.yaml), or the name or id of a scene that the service knows."""

SCENE = "path of a scene file, or the name or id of a scene that the service knows"

INTERRUPTED = 130


OPTIONS = {
    "options.paper.max_rounds": "--rounds",
    "options.paper.pushes": "--pushes",
    "options.paper.contraction": "--contraction",
    "options.paper": "--paper",
    "options.cells": "--cells",
    "options.random_seed": "--random-seed",
    "seed.method": "--method",
    "seed.half_width": "--half-width",
    "seed.q": "--q",
    "deadline_seconds": "--deadline",
    "start": "--from",
    "goal": "--to",
    "speed": "--speed",
    "acceleration": "--acceleration",
    "options.coverage": "--coverage",
    "options.regions": "--regions",
    "options.at_once": "--at-once",
    "options.region_seconds": "--region-seconds",
    "options.connect": "--connect",
}
"""The fields of a request, and the options that people type for them."""


class _Parser(argparse.ArgumentParser):
    def __init__(self, **options: Any) -> None:
        super().__init__(**options, allow_abbrev=False)

    def error(self, message: str) -> NoReturn:
        self.exit(2, f"error: {escaped(message)} (see {self.prog} --help)\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs one command and returns the exit status."""
    _prepare_streams()
    signal.signal(signal.SIGTERM, _terminated)  # so that files that a command made for itself are removed
    parsed = parser().parse_args(_joined(sys.argv[1:] if arguments is None else arguments))
    try:
        status = _command(parsed.run)(parsed)
        sys.stdout.flush()  # what cannot be written is said below, not when Python ends
        return status
    except CirisError as error:
        return _fail(_in_options(str(error)), 1 if error.code in NEGATIVE else 2)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        return _fail(f"{error.filename or ''}: {unreadable(error)}".removeprefix(": "), 2)
    except KeyboardInterrupt:
        return _fail("interrupted", INTERRUPTED)


def _terminated(number: int, _frame: FrameType | None) -> NoReturn:
    raise SystemExit(128 + number)


def _prepare_streams() -> None:
    """Ensures that every text can be printed.

    A stream that the caller has closed leads nowhere, so that no file takes its place. A character that the terminal's encoding lacks is
    written as an escape.
    """
    for number in range(3):
        try:
            os.fstat(number)
        except OSError:
            os.open(os.devnull, os.O_RDWR)  # takes the least free number, which is this one
    sys.stdout, sys.stderr = sys.stdout or open(1, "w", closefd=False), sys.stderr or open(2, "w", closefd=False)  # noqa: SIM115
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _command(where: str) -> Callable[[argparse.Namespace], int]:
    """Imports and returns the command at ``module:function``. It does so now because a check of a proof needs few of the modules.

    Raises:
        CirisError: not_installed.
    """
    module, _, function = where.partition(":")
    try:
        command: Callable[[argparse.Namespace], int] = getattr(importlib.import_module(module), function)
    except ModuleNotFoundError as error:
        problem = f"this command needs {error.name}, which is not installed"
        raise CirisError(
            "not_installed", problem, hint="pip install '.[service]'; `ciris verify` needs no more than '.[verify]'"
        ) from error
    return command


def _in_options(message: str) -> str:
    """Returns an error's text with the option that was typed in the place of the field that it becomes."""
    for field, option in OPTIONS.items():
        if message.startswith(f"{field}: "):
            said = message.removeprefix(f"{field}: ").removeprefix(f"{field.rpartition('.')[2]} ")
            return f"{option}: {said}"
    return message


def _fail(message: str, status: int) -> int:
    print("error:", " ".join(message.split()), file=sys.stderr)
    return status


def _limits(args: argparse.Namespace) -> list[str]:
    """Returns the words of ``ciris project set``."""
    given = {"--max-bytes": args.max_bytes, "--keep-days": args.keep_days}
    return ["set", args.name, *(f"{option}={value}" for option, value in given.items() if value is not None)]


def _joined(arguments: Sequence[str]) -> list[str]:
    """Joins ``--q -0.5,1`` to ``--q=-0.5,1``, because argparse takes a list that begins with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and joined[-1] in ("--q", "--contain", "--connect", "--seed", "--from", "--to") and re.match(r"-[\d.]", argument):
            joined[-1] = f"{joined[-1]}={argument}"
        else:
            joined.append(argument)
    return joined


def _group(parser: argparse.ArgumentParser) -> Any:
    return parser.add_subparsers(required=True, metavar="COMMAND", parser_class=_Parser)


def parser() -> argparse.ArgumentParser:
    """Returns the parser of the command, from which docs/commands.md is made too (``python -m tests.docs.commands``)."""
    ciris = _Parser(
        prog="ciris",
        description="Certified collision-free regions of robot configuration space.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    ciris.add_argument("--version", action="version", version=f"ciris {metadata.version('ciris')}")
    verbs = _group(ciris)
    remote = _Parser(add_help=False)
    remote.add_argument("--url", help="URL of the service; default: CIRIS_URL, or the service that `ciris up` runs here")
    json = _Parser(add_help=False)
    json.add_argument("--json", action="store_true", help="print one JSON document")

    up = verbs.add_parser("up", help="run the service on this machine until Ctrl-C")
    up.add_argument("--port", type=int, help="port of the API; default: CIRIS_PORT or 8643, or any free port when that one is taken")
    up.add_argument("--data", metavar="DIR", help="data directory; default: CIRIS_DATA_DIR")
    up.set_defaults(run="client.commands:up")

    database = _Parser(add_help=False)
    database.add_argument("--data", metavar="DIR", help="data directory; default: CIRIS_DATA_DIR; not used where CIRIS_DATABASE_URL is set")
    project = _group(verbs.add_parser("project", help="make and list projects and set their limits, in this machine's database"))
    new = project.add_parser("add", parents=[database], help="make a project; its keys see nothing of other projects")
    new.add_argument("name", metavar="NAME", help="the new project's name")
    new.set_defaults(run="client.commands:in_database", module="db.projects", words=lambda args: ["add", args.name])
    known = project.add_parser("ls", parents=[database, json], help="list the projects with their limits")
    known.set_defaults(
        run="client.commands:in_database", module="db.projects", words=lambda args: ["ls", *(["--json"] if args.json else [])]
    )
    limits = project.add_parser("set", parents=[database], help="set a project's limits; 0 for none")
    limits.add_argument("name", metavar="NAME", help="the project's name")
    limits.add_argument("--max-bytes", metavar="N", help="refuse new scenes and jobs once the project stores N bytes; 0: no limit")
    limits.add_argument("--keep-days", metavar="DAYS", help="delete a job's data, except its regions, DAYS days after its end; 0: never")
    limits.set_defaults(run="client.commands:in_database", module="db.projects", words=_limits)

    key = _group(verbs.add_parser("key", help="make, list and revoke API keys: in this machine's database, or with --url over HTTP"))
    over_http = _Parser(add_help=False)
    over_http.add_argument("--url", help="URL of a service; then an admin's key of it manages the keys of its own project")
    of_project = _Parser(add_help=False)
    of_project.add_argument(
        "--project", metavar="NAME", help="the project that the key belongs to; default: the project named default; not with --url"
    )
    made = key.add_parser("add", parents=[database, over_http, of_project], help="make a key and print it; it is shown only once")
    made.add_argument("name", metavar="NAME", help="the new key's name")
    made.add_argument(
        "--scope", choices=["read", "submit", "admin"], required=True, help="what the key allows; each scope includes those before it"
    )
    made.set_defaults(run="client.keys:add")
    listed = key.add_parser("ls", parents=[database, over_http, json], help="list the keys, without their secrets")
    listed.set_defaults(run="client.keys:ls")
    revoked = key.add_parser(
        "revoke", parents=[database, over_http, of_project], help="revoke a key; the service refuses it within a second"
    )
    revoked.add_argument("name", metavar="NAME", help="the key's name")
    revoked.set_defaults(run="client.keys:revoke")

    scene = _group(verbs.add_parser("scene", help="draft, check, add, list, show and delete scenes"))
    init = scene.add_parser("init", help="write a scene file and a seed for a robot's model", epilog="Nothing is overwritten.")
    init.add_argument("robot", metavar="ROBOT", help="model file: URDF, SDFormat or MJCF")
    init.add_argument("--world", metavar="FILE", action="append", default=[], help="model of an obstacle around it; may be repeated")
    init.add_argument(
        "--package", metavar="NAME=DIR", action="append", default=[], help="directory of a package that a model names; may be repeated"
    )
    init.add_argument(
        "--out",
        metavar="FILE",
        default="scene.yaml",
        help="the scene file; default: scene.yaml here. The seed goes beside it, into seed.yaml, or NAME.seed.yaml for NAME.yaml",
    )
    init.set_defaults(run="client.scenes:scene_init")
    check = scene.add_parser("check", parents=[json], help="show what ciris reads from a scene file and its models, without a service")
    check.add_argument("path", metavar="PATH.yaml", help="the scene file")
    check.add_argument("--q", metavar="Q", help="a configuration to look at; default: the seed beside the file, or else q*")
    check.set_defaults(run="client.scenes:scene_check")
    add = scene.add_parser("add", parents=[remote, json], help="upload a scene file and all files it refers to")
    add.add_argument("path", metavar="PATH.yaml", help="the scene file")
    add.set_defaults(run="client.commands:scene_add")
    scene.add_parser("ls", parents=[remote, json], help="list scenes, newest first").set_defaults(run="client.commands:scene_ls")
    show = scene.add_parser("show", parents=[remote, json], help="show a scene's joints, warnings and pairs")
    show.add_argument("scene", metavar="ID", help="its id or its name")
    show.set_defaults(run="client.commands:scene_show")
    together = _Parser(add_help=False)
    together.add_argument(
        "--dependents",
        action="store_true",
        help="also delete its dependents; without this option, the command lists them and deletes nothing if there are any",
    )
    gone = scene.add_parser("rm", parents=[remote, together], help="delete a scene")
    gone.add_argument("scene", metavar="ID", help="its id or its name")
    gone.set_defaults(run="client.removal:scene_rm")

    grow = verbs.add_parser("grow", parents=[remote, json], help="grow a certified region around a configuration")
    grow.add_argument("scene", metavar="SCENE", help=SCENE)
    grow.add_argument(
        "--q",
        metavar='"0,0.3,..."',
        action="append",
        help="the seed: joint positions; default: q of the seed.yaml beside scene.yaml, or NAME.seed.yaml beside NAME.yaml; "
        "may be repeated: the service then grows one region for each seed, all at the same time",
    )
    grow.add_argument(
        "--contain",
        metavar='"0,0.3,..."',
        action="append",
        default=[],
        help="joint positions that the region must contain as well; may be repeated",
    )
    methods = "iris_np2 (default) and iris_zo: Drake's IRIS; with --paper also limits: the joint limits; box: a box around the seed"
    grow.add_argument("--method", help=f"where the proposal comes from, the polytope that growth begins with. {methods}")
    grow.add_argument("--half-width", type=float, metavar="W", help="for the method box: half its edge length in s, such as 0.1")
    grow.add_argument(
        "--cells", type=int, metavar="N", help="check N cells of a pair in each stage; then faces cut off its undecided cells"
    )
    grow.add_argument(
        "--deadline",
        type=float,
        metavar="SECONDS",
        help="end after this time with the best region so far, once it is verified; default: none",
    )
    grow.add_argument(
        "--label",
        metavar="NAME=VALUE",
        action="append",
        default=[],
        help="a label to find the job by (ciris job ls --label); may be repeated",
    )
    grow.add_argument(
        "--paper",
        action="store_true",
        help="grow with the papers' algorithm, which shrinks the proposal until every pair has one plane; the next three imply it",
    )
    grow.add_argument(
        "--contraction", help="how the proposal shrinks: targeted (default) adds faces where pairs fail; uniform moves all faces"
    )
    grow.add_argument(
        "--pushes", type=int, metavar="N", help="number of times that the faces are pushed out again; default: more for smaller arms"
    )
    grow.add_argument(
        "--rounds", type=int, metavar="N", help="rounds of the polytope step; default: a few for small arms, none for large ones"
    )
    grow.add_argument(
        "--random-seed", type=int, metavar="N", help="seed of every random choice, IRIS' too: another seed gives another region; default 0"
    )
    grow.add_argument("--out", metavar="FILE", help="new file for the proof; default: one in this directory, named after scene and proof")
    grow.add_argument("--watch", action="store_true", help="print a line for every pair when it is decided")
    grow.add_argument("--local", action="store_true", help="grow in this process, without a service")
    grow.set_defaults(run="client.commands:grow")

    again = verbs.add_parser("recertify", parents=[remote, json], help="make a region of a changed scene from a region of the old scene")
    again.add_argument("region", metavar="REGION", nargs="?", help="the region's id; with --local its proof file")
    again.add_argument("--from", dest="old", metavar="SCENE", help="certify all regions of this scene again, one job a region")
    again.add_argument("--scene", metavar="SCENE", required=True, help="the scene as it is now")
    again.add_argument(
        "--q",
        metavar='"0,0.3,..."',
        action="append",
        help="with --local: joint positions that must stay inside; may be repeated; "
        "default: the interior point that the proof names. The service keeps the seed inside",
    )
    again.add_argument("--deadline", type=float, metavar="SECONDS", help="end after this time; default: none")
    again.add_argument("--out", metavar="FILE", help="new file for the proof; default: one in this directory, named after scene and proof")
    again.add_argument("--watch", action="store_true", help="print a line for every pair when it is decided")
    again.add_argument("--local", action="store_true", help="certify in this process, without a service")
    again.set_defaults(run="client.recertify:recertify")

    cover = verbs.add_parser(
        "cover",
        parents=[remote, json],
        help="grow regions until they cover the free space, or connect configurations",
        epilog="Example: ciris cover examples/planar_2dof/scene.yaml --coverage 0.95 --connected --deadline 60. "
        "The exit status is 0 if all goals are reached. Regions that the scene has already count.",
    )
    cover.add_argument("scene", metavar="SCENE", help=SCENE)
    cover.add_argument(
        "--connect",
        metavar='"0,0.3,..."',
        action="append",
        default=[],
        help="joint positions to connect through overlapping regions; give it two times or more",
    )
    cover.add_argument(
        "--seed", metavar='"0,0.3,..."', action="append", default=[], help="joint positions that get a region first; may be repeated"
    )
    cover.add_argument(
        "--path",
        metavar="FILE",
        action="append",
        default=[],
        help="a motion to cover: npz, JSON, YAML or CSV with q (K x n), straight from waypoint to waypoint; may be repeated",
    )
    cover.add_argument(
        "--coverage", type=float, metavar="SHARE", help="goal: this share of the free configurations; default: 0.95 without another goal"
    )
    cover.add_argument("--connected", action="store_true", help="goal: all regions of the scene are connected")
    cover.add_argument("--regions", type=int, metavar="N", help="grow at most N regions; default 1000")
    cover.add_argument("--at-once", type=int, metavar="N", help="grow N regions at the same time; default 2")
    cover.add_argument(
        "--region-seconds", type=float, metavar="SECONDS", help="end the growth of each region after this time; default: none"
    )
    cover.add_argument(
        "--cells", type=int, metavar="N", help="check N cells of a pair in each stage of a region; then faces cut off its undecided cells"
    )
    cover.add_argument(
        "--stages",
        type=int,
        metavar="N",
        help="end each region after N stages; default: 2 for robots with more than 4 joints, else no limit",
    )
    cover.add_argument("--deadline", type=float, metavar="SECONDS", help="end after this time with the regions grown so far; default: none")
    cover.add_argument("--random-seed", type=int, metavar="N", help="seed of every random choice; default 0")
    cover.set_defaults(run="client.cover:cover")

    certify = verbs.add_parser("certify", parents=[remote, json], help="certify a given polytope: one outcome for each pair")
    certify.add_argument("scene", metavar="SCENE", help=SCENE)
    certify.add_argument(
        "--polytope",
        metavar="FILE",
        required=True,
        help="npz, JSON or YAML with C (m x n), d (m) and optionally center (n), in s; ciris adds the joint limits",
    )
    certify.add_argument(
        "--cells",
        type=int,
        metavar="N",
        help="check up to N cells of the polytope for each pair, each with its own plane; default: 1, one plane on all of it",
    )
    certify.add_argument("--watch", action="store_true", help="print a line for every pair when it is decided")
    certify.add_argument("--local", action="store_true", help="certify in this process, without a service")
    certify.add_argument("--out", metavar="FILE", help="new file for the proof, if the polytope is certified; default: none")
    certify.add_argument("--backend", choices=["ciris", "drake"], default="ciris", help="drake asks Drake's own program, as a cross-check")
    certify.add_argument("--solver", metavar="NAME", help="solver that Drake uses: clarabel (default), scs, csdp or mosek")
    certify.set_defaults(run="client.commands:certify")

    motion = verbs.add_parser("certify-path", parents=[remote, json], help="certify a motion through waypoints or along a spline")
    motion.add_argument("scene", metavar="SCENE", help=SCENE)
    motion.add_argument("--q", metavar='"0,0.3,..."', action="append", help="a waypoint: joint positions; give it two times or more")
    motion.add_argument("--path", metavar="FILE", help="npz, JSON, YAML or CSV with waypoints q or s and perhaps times t, or with a spline")
    motion.add_argument(
        "--space",
        choices=["q", "s"],
        help="coordinates in which the motion is straight, or in which a spline's control points are; default: those given; q for a spline",
    )
    motion.add_argument("--tube", action="store_true", help="search for the largest certified tube about the motion")
    motion.add_argument(
        "--clearance",
        action="store_true",
        help="prove a lower bound of the smallest distance, tight to 10 %% and 0.1 mm, and say where it is",
    )
    motion.add_argument(
        "--padding",
        type=float,
        metavar="METRES",
        default=0.0,
        help="prove the motion with this much added around every body, beyond the scene's padding; default: 0",
    )
    motion.add_argument("--local", action="store_true", help="certify in this process, without a service")
    motion.add_argument("--job", action="store_true", help="run it as a job of the service, for a motion that takes minutes")
    motion.add_argument(
        "--deadline", type=float, metavar="SECONDS", help="with --job: end without a verdict after this time; default: none"
    )
    motion.add_argument("--out", metavar="FILE", help="new file for the proof; default: none")
    motion.set_defaults(run="client.motion:certify_path")

    verify = verbs.add_parser("verify", parents=[json], help="check a proof file offline and print what it proves")
    verify.add_argument("proof", metavar="PROOF", help="the proof file")
    verify.set_defaults(run="client.verify:verify")

    clearance = verbs.add_parser(
        "clearance", parents=[json], help="prove how far apart the bodies are all over a region, from its proof file"
    )
    clearance.add_argument("proof", metavar="PROOF", help="the proof file of a region")
    clearance.add_argument("--out", metavar="FILE", help="new file for the proof of the clearance; default: none")
    clearance.set_defaults(run="client.clearance:clearance")

    job = _group(verbs.add_parser("job", help="list, show, follow, cancel, retry and delete jobs of the service"))
    ls = job.add_parser("ls", parents=[remote, json], help="list jobs, newest first")
    ls.add_argument("--state", help="list only jobs in this state: queued, running, succeeded, failed, cancelled and others")
    ls.add_argument("--scene", help="list only the jobs of this scene")
    ls.add_argument("--label", metavar="NAME=VALUE", action="append", default=[], help="list only the jobs with this label")
    ls.add_argument("--search", metavar="TEXT", help="list only the jobs whose id, reason, labels or scene mention this")
    ls.add_argument("--most", type=int, default=50, metavar="N", help="list at most N jobs; default 50")
    ls.set_defaults(run="client.jobs:job_ls")
    for verb, about in (
        ("show", "show a job and its regions"),
        ("follow", "print the events of a job until it has ended"),
        ("cancel", "ask a job to end; regions that it has certified remain"),
        ("retry", "run a job again that failed or was cancelled"),
    ):
        of_one = job.add_parser(verb, parents=[remote, json], help=about)
        of_one.add_argument("job", metavar="ID", help="its id, or the first characters of it")
        if verb == "follow":
            of_one.add_argument("--watch", action="store_true", help="print a line for every pair when it is decided")
        of_one.set_defaults(run=f"client.jobs:job_{verb}")

    told = job.add_parser("webhook", parents=[remote, json], help="show the calls to a job's webhook and their results")
    told.add_argument("job", metavar="ID", help="its id, or the first characters of it")
    told.add_argument("--resend", action="store_true", help="call the webhook again")
    told.set_defaults(run="client.jobs:job_webhook")
    hooks = job.add_parser(
        "webhooks", parents=[remote, json], help="list the webhooks that jobs call when they end, with the state of each call"
    )
    hooks.add_argument("--state", choices=["waiting", "delivered", "failed"], help="list only those in this state")
    hooks.set_defaults(run="client.jobs:job_webhooks")
    gone = job.add_parser("rm", parents=[remote, together], help="delete a job that has ended")
    gone.add_argument("job", metavar="ID", help="its id, or the first characters of it")
    gone.set_defaults(run="client.removal:job_rm")

    worker = _group(verbs.add_parser("worker", help="list, show, pause, resume and drain workers of the service"))
    worker.add_parser("ls", parents=[remote, json], help="list the live workers and what each is doing").set_defaults(
        run="client.workers:ls"
    )
    for verb, about in (
        ("show", "show a worker and what each of its processes is doing"),
        ("pause", "let a worker finish its work and take no more"),
        ("resume", "let a paused worker take work again"),
        ("drain", "let a worker finish its work and end; its supervisor may start another, but `ciris up` does not"),
    ):
        of_one = worker.add_parser(verb, parents=[remote, json], help=about)
        of_one.add_argument("worker", metavar="ID", help="its id, or the first characters of it")
        of_one.set_defaults(run=f"client.workers:{verb}")

    region = _group(verbs.add_parser("region", help="list, show, export and delete regions"))
    gone = region.add_parser("rm", parents=[remote], help="delete a region")
    gone.add_argument("region", metavar="ID", help="its id, or the first characters of it")
    gone.set_defaults(run="client.removal:region_rm")
    ls = region.add_parser("ls", parents=[remote, json], help="list regions, newest first")
    ls.add_argument("--scene", help="list only the regions of this scene")
    ls.set_defaults(run="client.commands:region_ls")
    show = region.add_parser("show", parents=[remote, json], help="show a region's manifest")
    show.add_argument("region", metavar="ID", help="its id, or the first characters of it")
    show.set_defaults(run="client.commands:region_show")
    export = region.add_parser("export", parents=[remote], help="write a region to a file")
    export.add_argument("region", metavar="ID", help="its id, or the first characters of it")
    export.add_argument(
        "--format", choices=["json", "npz", "drake-yaml", "proof"], default="json", help="format of the file; default: json"
    )
    export.add_argument("--name", help="name of the region in the file; default: its id")
    export.add_argument("--out", metavar="FILE", help="new file to write; default: standard output")
    export.set_defaults(run="client.commands:region_export")

    contains = verbs.add_parser("contains", parents=[remote, json], help="show which certified regions contain a configuration")
    contains.add_argument("scene", metavar="SCENE", help=SCENE)
    contains.add_argument("--q", metavar='"0,0.3,..."', required=True, action="append", help="joint positions; may be repeated")
    contains.set_defaults(run="client.commands:contains")

    near = verbs.add_parser(
        "nearest", parents=[remote, json], help="show which certified region is nearest to a configuration, and how far it is"
    )
    near.add_argument("scene", metavar="SCENE", help=SCENE)
    near.add_argument("--q", metavar='"0,0.3,..."', required=True, action="append", help="joint positions; may be repeated")
    near.set_defaults(run="client.planning:nearest")

    plan = verbs.add_parser(
        "plan",
        parents=[remote, json],
        help="plan a trajectory between two configurations through the certified regions",
        epilog="Example: ciris plan planar-2dof --from 0,0 --to 0.35,-0.2 --speed 1.5",
    )
    plan.add_argument("scene", metavar="SCENE", help=SCENE)
    of_end = "joint positions, or the id of a region for any point of it"
    plan.add_argument("--from", dest="start", metavar='"0,0.3,..."', required=True, help=f"where the motion begins: {of_end}")
    plan.add_argument("--to", dest="goal", metavar='"0,0.3,..."', required=True, help=f"where it ends: {of_end}")
    plan.add_argument("--speed", help="largest speed in rad/s or m/s, one for all joints or one for each; default 1")
    plan.add_argument("--acceleration", help="largest acceleration in rad/s² or m/s², one for all joints or one for each; default 2")
    plan.add_argument(
        "--grow", action="store_true", help="if there is no trajectory, grow regions until the two ends are connected, and plan again"
    )
    plan.add_argument("--deadline", type=float, metavar="SECONDS", help="with --grow: stop growing after this time; default: none")
    plan.set_defaults(run="client.planning:plan")

    path = verbs.add_parser("path", parents=[remote, json], help="decide whether every point of a path is in certified regions")
    path.add_argument("scene", metavar="SCENE", help=SCENE)
    path.add_argument("--q", metavar='"0,0.3,..."', action="append", help="a waypoint, joint positions; give two or more")
    path.add_argument("--path", metavar="FILE", help="npz, JSON, YAML or CSV with waypoints q or s and perhaps times t, or with a spline")
    path.add_argument(
        "--space",
        choices=["q", "s"],
        help="coordinates in which the motion is straight, or in which a spline's control points are; default: q",
    )
    path.set_defaults(run="client.planning:path")

    graph = verbs.add_parser("graph", parents=[remote, json], help="show which regions of a scene overlap, and where gaps are")
    graph.add_argument("scene", metavar="SCENE", help=SCENE)
    graph.set_defaults(run="client.planning:graph")

    bench = verbs.add_parser("bench", help="measure ciris, and Drake beside it if asked; see ciris bench BENCHMARK --help")
    kinds = ["pairs", "scene", "growth", "path", "agreement", "scaling", "service", "store", "survey", "robots", "query", "plan"]
    bench.add_argument("benchmark", choices=[*kinds, "cover", "recertify", "fleet", "docs"], help="what to measure")
    bench.add_argument("arguments", nargs=argparse.REMAINDER, metavar="...", help="the benchmark's own arguments")
    bench.set_defaults(run="client.bench:bench")

    doctor = verbs.add_parser(
        "doctor", parents=[remote, json], help="show what is installed, which solvers work, and what this machine can do"
    )
    doctor.set_defaults(run="client.commands:doctor")
    return ciris


if __name__ == "__main__":
    sys.exit(main())
