"""Commands about the workers of the service: list and show them, pause, resume and drain them."""

from __future__ import annotations

from argparse import Namespace

from ciris.documents import Document
from client.jobs import SHORT
from client.output import plain, print_facts, print_json, print_table
from client.service import connect

OK = 0


def ls(args: Namespace) -> int:
    with connect(args.url) as client:
        workers = client.workers()
    if args.json:
        print_json(workers)
        return OK
    header = ("id", "kind", "state", "busy", "of", "cores", "GiB", "host", "version", "does")
    print_table(header, [_row(worker) for worker in workers], right="busy of cores GiB")
    return OK


def show(args: Namespace) -> int:
    with connect(args.url) as client:
        worker = client.worker(args.worker)
    return _shown(worker, args)


def pause(args: Namespace) -> int:
    with connect(args.url) as client:
        worker = client.pause_worker(args.worker)
    return _shown(worker, args)


def resume(args: Namespace) -> int:
    with connect(args.url) as client:
        worker = client.resume_worker(args.worker)
    return _shown(worker, args)


def drain(args: Namespace) -> int:
    with connect(args.url) as client:
        worker = client.drain_worker(args.worker)
    return _shown(worker, args)


def _shown(worker: Document, args: Namespace) -> int:
    if args.json:
        print_json(worker)
        return OK
    print(f"worker {worker['id']}")
    print_facts(
        [
            ("kind", worker["kind"]),
            ("state", _state(worker)),
            *([("trouble", worker["trouble"])] if worker["trouble"] else []),
            ("process", worker["process"]),
            ("version", worker["version"]),
            ("busy", f"{worker['busy']} of {worker['processes']}"),
            ("cores", str(worker["cores"])),
            ("memory", f"{_gib(worker)} GiB"),
            ("started", worker["started_at"][:19]),
            ("seen", worker["seen_at"][:19]),
            *(("does", _work(work)) for work in worker["work"]),
        ]
    )
    return OK


def _row(worker: Document) -> tuple[str, ...]:
    jobs = dict.fromkeys(f"{work['work']} of {work['job'][:SHORT]}" for work in worker["work"])
    numbers = (str(worker["busy"]), str(worker["processes"]), str(worker["cores"]), _gib(worker))
    return worker["id"][:SHORT], worker["kind"], _state(worker), *numbers, worker["host"], worker["version"], ", ".join(jobs)


def _state(worker: Document) -> str:
    """Returns what a worker does, and what it was asked to do where it has not done that yet."""
    state, wanted = plain(worker["state"]), plain(worker["wanted"])
    comes = wanted == "running" and state in ("starting", "compiling")
    return state if state == wanted or comes else f"{state}, to be {wanted}"


def _work(work: Document) -> str:
    pairs = f" {', '.join(map(str, work['pairs']))} of iteration {work['iteration']}" if work["pairs"] else ""
    return f"{work['work']}{pairs} of job {work['job'][:SHORT]} in {work['process']}"


def _gib(worker: Document) -> str:
    return f"{worker['memory_bytes'] / 2**30:.1f}"
