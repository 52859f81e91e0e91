"""``./start`` runs the embedded stack and the example job.

It shows the job's progress and the certified region, verifies the proof, and prints the dashboard's address.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import select
import signal
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import certifier
from certifier.errors import CirisError, unreadable
from certifier.outcome import DEADLINE
from certifier.words import counted
from ciris.documents import asked_as
from ciris.find import api_key, data_dir, running_stack
from ciris.synchronous.client import Client
from client import output, service
from client.files import ProofFile, file_name
from client.output import Screen
from client.seeds import seed_of

SCENE = Path(__file__).resolve().parent.parent / "examples" / "iiwa_shelf" / "scene.yaml"
DEADLINES_SECONDS = (120, 1200)
"""The region of seven joints would go on growing for minutes, so it has two. A busy machine that has no more than the box about the seed by
then has twenty more."""
STOP_SECONDS = 30
LOOK_SECONDS = 0.5
"""It looks this often whether a service that starts says why that takes long."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs the demonstration. Returns 0 only if the region was certified and its proof was verified here."""
    parser = argparse.ArgumentParser(prog="./start", description="A certified collision-free region for a 7-joint arm in front of a shelf.")
    parser.add_argument("--once", action="store_true", help="end after the job")
    once = parser.parse_args(arguments).once
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        with _stack() as url:
            verified, region = _demonstrate(url)
            if not once:
                print(f"\nlook at it: {url}/regions/{region}", flush=True)
                print(f"the service keeps running; dashboard: {url}/   (Ctrl-C ends it)", flush=True)
                signal.pause()
    except CirisError as error:
        print("error:", " ".join(str(error).split()), file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        print(file=sys.stderr)
        return 0 if not once else 130
    return 0 if verified else 1


def _demonstrate(url: str) -> tuple[bool, str | None]:
    """Returns whether the proof of the region was verified here, and the region's id on the service."""
    with Client(url, api_key()) as client:
        scene = client.add_scene(SCENE)
        print(f"ciris is up at {url} (data: {data_dir()})")
        bodies = counted(scene["geometries"], "convex body", "convex bodies")
        size = f"{counted(scene['joints'], 'joint')}, {bodies}, {counted(scene['pairs'], 'pair')} to separate"
        print(f"scene {scene['name']}: {size}", flush=True)
        grown = _grown(client, {"kind": "grow", "scene": asked_as(scene, None), "seed": {"q": seed_of(str(SCENE), None)}})
    path = ProofFile(str(data_dir() / f"{file_name(scene['name'])}.proof")).write(scene["name"], grown.proof)
    print("\nevery pair of bodies:")
    output.print_pairs(grown.manifest["pairs"])
    print("\ncertified region:")
    output.print_region(grown.manifest, [("time", output.seconds(grown.seconds)), ("ended", grown.remark), ("proof", str(path))])
    return _verified(grown.proof), grown.region


def _grown(client: Client, request: dict[str, Any]) -> service.Grown:
    grown = None
    for seconds in DEADLINES_SECONDS:
        asked = {**request, "deadline_seconds": seconds}
        try:
            grown = service.grow(client, asked, Screen(), idempotency_key=_key(asked))
        except CirisError as error:
            if error.code != "not_grown" or not error.message.startswith(DEADLINE):
                raise
        else:
            if grown.manifest["share"] is not None:
                return grown
        print(f"no region but a box about the seed was certified within {seconds} s; that is enough where nothing else runs", flush=True)
    if grown is not None:
        return grown
    hint = f"run it again when this machine has less to do, or give it longer: ciris grow {SCENE} --deadline 3600"
    raise CirisError("not_grown", "this machine is too busy for a first region", hint=hint)


def _verified(proof: bytes) -> bool:
    from certifier.errors import ProofError
    from certifier.verify.region import verify_region

    try:
        lines = verify_region(proof).lines()
    except ProofError as error:
        print("error: the proof does not hold:", error, file=sys.stderr)
        return False
    print("\nthe proof was verified here, independently of the service:", *lines, sep="\n  ")
    return True


def _key(request: dict[str, Any]) -> str:
    """Returns one key for this request and this code, so that a second run shows the region of the first."""
    code = hashlib.sha256(json.dumps(request, sort_keys=True).encode())
    root = Path(certifier.__file__).parent
    for file in sorted(root.rglob("*.py")):
        code.update(file.read_bytes())
    return f"start:{code.hexdigest()}"


@contextmanager
def _stack() -> Iterator[str]:
    """Yields the URL of the stack: of the one that runs already, or of one that runs as long as this block."""
    running = running_stack(data_dir())
    if running is not None and _answers(running):
        yield running
        return
    log = data_dir() / "logs" / "stack.log"
    try:
        log.parent.mkdir(parents=True, exist_ok=True)
        before = log.stat().st_size if log.exists() else 0
    except OSError as error:
        hint = "name a directory that you may write to"
        raise CirisError("not_writable", f"{log.parent} cannot be made: {unreadable(error)}", field="CIRIS_DATA_DIR", hint=hint) from None
    print("starting the service ...", flush=True)
    with log.open("ab") as errors:
        stack = subprocess.Popen([sys.executable, "-P", "-m", "workers.stack"], stdout=subprocess.PIPE, stderr=errors, text=True)
    try:
        assert stack.stdout is not None
        noted = 0
        while not select.select([stack.stdout], [], [], LOOK_SECONDS)[0]:
            notes = _said(log, before, "note: ")
            for note in notes[noted:]:
                print(note, flush=True)
            noted = len(notes)
        if not stack.stdout.readline():
            raise CirisError("stack_failed", f"the service did not start{_last_error(log, before)}", hint=f"see {log}")
        url = running_stack(data_dir())
        assert url is not None, "a stack that says it is up has written down where"
        yield url
    finally:
        stack.terminate()
        try:
            stack.wait(STOP_SECONDS)
        except subprocess.TimeoutExpired:
            stack.kill()


def _last_error(log: Path, start: int) -> str:
    """Returns what the log says from here on about the error that ended the service; empty where it says nothing."""
    said = _said(log, start, "error: ")
    return f": {said[-1]}" if said else ""


def _said(log: Path, start: int, how: str) -> list[str]:
    """Returns the lines for people that the log has from here on, of those that begin like this."""
    lines = log.read_bytes()[start:].decode(errors="replace").splitlines()
    return [line.removeprefix(how) for line in lines if line.startswith(how)]


def _answers(url: str) -> bool:
    try:
        with Client(url, api_key()) as client:
            client.ready()
    except CirisError:
        return False
    return True


if __name__ == "__main__":
    sys.exit(main())
