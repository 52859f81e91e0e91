"""Errors of the ``ciris`` command, as it says them."""

from __future__ import annotations

import json
import threading
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer

import numpy as np

from ciris import Space, connect
from ciris.find import NO_SERVICE
from tests.client.conftest import PLANAR
from tests.errors.rows import Row, Trial, rows

FORMATS = "give C, d and perhaps center as lists of numbers, or a region that `ciris region export` wrote"
LIST = "joint positions, separated by commas"
EYE = [[1, 0], [0, 1], [-1, 0], [0, -1]]


def certify(t: Trial, *options: str, file: str = "p.json", **content: object) -> str:
    """Certifies a polytope file with this content, or with the one that is there."""
    if content:
        (t.directory / file).write_text(json.dumps(content))
    return t.ciris("certify", PLANAR, "--polytope", file, *options)


def good(t: Trial, *options: str, **more: object) -> str:
    return certify(t, *options, C=EYE, d=[0.05] * 4, **more)


def grow(t: Trial, *options: str) -> str:
    return t.ciris("grow", PLANAR, "--local", *options)


def again(t: Trial, *options: str) -> str:
    return t.ciris("recertify", *options, "--scene", PLANAR)


def beside_a_seed(t: Trial, seed: str) -> str:
    t.write(scene__yaml="", seed__yaml=seed)
    return t.ciris("grow", "scene.yaml", "--local")


def asked(t: Trial, *arguments: str) -> str:
    """Runs a command that asks the service."""
    return t.ciris(*arguments, CIRIS_URL=t.request.getfixturevalue("url"))


def asked_elsewhere(t: Trial) -> str:
    """Asks a web server that is no ciris."""
    with ThreadingHTTPServer(("127.0.0.1", 0), BaseHTTPRequestHandler) as server:
        thread = threading.Thread(target=server.serve_forever)
        thread.start()
        try:
            return t.ciris("scene", "ls", CIRIS_URL=f"http://127.0.0.1:{server.server_port}")
        finally:
            server.shutdown()
            thread.join()


def bound(t: Trial) -> str:
    np.savez(t.directory / "p.npz", C=np.array(EYE), d=np.full(4, 0.05), q_star=np.array([1.0, 1.0]))
    return certify(t, "--local", file="p.npz")


def one_joint() -> Space:
    return Space(("slide",), np.zeros(1), -np.ones(1), np.ones(1), np.array([False]))


COMMANDS: list[Row] = [
    *rows(
        "client/bench.py",
        ("no_benchmarks", "", "the benchmarks are not installed", "run ciris from a checkout of the repository", "an installed wheel"),
    ),
    *rows(
        "client/cli.py",
        (
            "not_installed",
            "",
            "this command needs {name}, which is not installed",
            "pip install '.[service]'; `ciris verify` needs no more than '.[verify]'",
            "an installation of the verifier alone",
        ),
    ),
    *rows(
        "client/planning.py",
        (
            "option",
            "--q",
            "a path has two waypoints or more",
            "give it once for each waypoint",
            lambda t: t.ciris("path", "slider", "--q", "0.1"),
        ),
    ),
    *rows(
        "client/commands.py",
        (
            "several_seeds",
            "--q",
            "several seeds need a service, which keeps their regions",
            "leave out --local and --out",
            lambda t: grow(t, "--q", "0,0", "--q", "0,1"),
        ),
        ("option", "--solver", "only Drake takes a solver", "add --backend drake", lambda t: good(t, "--solver", "clarabel")),
        (
            "option",
            "--cells",
            "Drake's own program knows no cells",
            "leave --cells or --backend drake out",
            lambda t: good(t, "--backend", "drake", "--cells", "2"),
        ),
        (
            "option",
            "--out",
            "Drake writes no proof",
            "leave --out or --backend drake out",
            lambda t: good(t, "--backend", "drake", "--out", "x.proof"),
        ),
        (
            "option",
            "--backend",
            "the service asks its own certifier only",
            "add --local",
            lambda t: good(t, "--backend", "drake"),
        ),
        ("terminal", "--out", "{format} is not for terminals", "name a file", "a terminal as standard output"),
    ),
    *rows(
        "client/files.py",
        ("not_writable", "--out", "{out} is a directory", "name a file", lambda t: grow(t, "--out", ".")),
        (
            "file_exists",
            "--out",
            "{out} is there already",
            "move it away, or name another file",
            lambda t: grow(t, "--out", t.write(a__proof="").name),
        ),
        (
            "not_writable",
            "--out",
            "there is no directory {...}",
            "make it, or name another",
            lambda t: t.ciris("region", "export", "any", "--out", "nowhere/region.json"),
        ),
        (
            "not_writable",
            "--out",
            "nothing can be written into {...}",
            "name a file elsewhere",
            "a directory of another user",
        ),
    ),
    *rows(
        "client/demo.py",
        ("stack_failed", "", "the service did not start", "see {log}", "a machine on which the stack does not come up"),
        (
            "not_grown",
            "",
            "no region was certified within {DEADLINE_SECONDS} s, which are enough where nothing else runs",
            "run it again when this machine has less to do, or give it longer: ciris grow {SCENE} --deadline 1200",
            "a machine that is too busy for the demonstration",
        ),
    ),
    *rows(
        "ciris/find.py",
        ("no_service", "", "no service is running here", NO_SERVICE, lambda t: t.ciris("scene", "ls")),
        (
            "api_key",
            "CIRIS_API_KEY",
            "this is not an API key",
            "it is one word, as `ciris key add` prints it",
            lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9", CIRIS_API_KEY="two words"),
        ),
        (
            "api_key",
            "CIRIS_API_KEY_FILE",
            "this is not an API key",
            "it is one word, as `ciris key add` prints it",
            lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9", CIRIS_API_KEY_FILE=str(t.write(key="two words"))),
        ),
    ),
    *rows(
        "ciris/requests.py",
        (
            "points",
            "q",
            "the points must be given either as q or as s",
            "q are joint positions, s tangent-space coordinates: give one of them",
            lambda t: connect("http://127.0.0.1:9").contains("cell"),
        ),
        (
            "points",
            "{name}",
            "it must be finite numbers in {...} or {axes} axes, joints last",
            "",
            lambda t: connect("http://127.0.0.1:9").contains("cell", 0.5),
        ),
    ),
    *rows(
        "ciris/space.py",
        (
            "wrong_length",
            "{field}",
            "it has the shape {shape}, and the last number must be {n}, one for each joint",
            "in the order {...}",
            lambda t: one_joint().to_s([0.1, 0.2]),
        ),
    ),
    *rows(
        "ciris/problems.py",
        (
            "unreachable",
            "",
            "the service at {url} does not answer: {reason}",
            "is `ciris up` running there?",
            lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9"),
        ),
        (
            "not_found",
            "",
            "{shown} is no name and no id",
            "`ls` of `ciris scene`, `job` and `region`, or `scenes()`, `jobs()` and `regions()` in Python, list them",
            lambda t: asked(t, "job", "show", ".."),
        ),
        ("{...}", "{...}", "{...}", "{...}", lambda t: asked(t, "job", "show", "nothing")),
    ),
    *rows(
        "client/inputs.py",
        ("bad_number", "{field}[{i}]", "{part} is not a finite number", LIST, lambda t: grow(t, "--q", "0,x")),
        ("bad_number", "--q", "no numbers were given", LIST, lambda t: grow(t, "--q", ",")),
        (
            "seed_missing",
            "--q",
            "no seed was given",
            "give one, or put q into {name} beside the scene file",
            lambda t: t.ciris("grow", t.write(alone__yaml="").name, "--local"),
        ),
        (
            "seed_file",
            "--q",
            "{path} holds no list of numbers called q",
            "write q: [0, 0.3] into it, one number for each joint",
            lambda t: beside_a_seed(t, "q: here"),
        ),
        (
            "polytope_joints",
            "--polytope",
            "the polytope has the joints {...}, and the scene {...}",
            "certify it in the scene that it was grown in",
            lambda t: good(t, "--local", space={"joints": ["other/a", "other/b"]}),
        ),
        (
            "polytope_q_star",
            "--polytope",
            "the polytope is about q* = {mine}, and the scene about {others}",
            "set q_star of the scene file to the polytope's",
            bound,
        ),
        ("polytope_file", "--polytope", "there is no file {path}", FORMATS, lambda t: certify(t, file="nothing.npz")),
        ("polytope_file", "--polytope", "{path} is no {kind} file of numbers", FORMATS, lambda t: certify(t, C="x")),
        ("polytope_file", "--polytope", "{path} is neither .npz nor .json nor .yaml", FORMATS, lambda t: certify(t, file="p.txt")),
        ("polytope_file", "--polytope", "{path} has no {...}", FORMATS, lambda t: certify(t, C=EYE)),
        (
            "polytope_shape",
            "--polytope",
            "center must be {...} finite numbers, as many as C has columns",
            "",
            lambda t: good(t, center=[0.0]),
        ),
    ),
    *rows(
        "client/local.py",
        (
            "scene_not_found",
            "SCENE",
            "{scene} is not a scene file",
            "--local needs the path of a .yaml file",
            lambda t: t.ciris("grow", "planar", "--q", "0,0", "--local"),
        ),
        (
            "option",
            "--deadline",
            "a polytope is certified here without a deadline",
            "leave out --deadline or --local",
            lambda t: good(t, "--local", "--deadline", "9"),
        ),
    ),
    *rows(
        "client/scenes.py",
        (
            "scene_file",
            "--out",
            "the name of a scene file must end in .yaml, not as {name}",
            "",
            lambda t: t.ciris("scene", "init", "arm.urdf", "--out", "scene.txt"),
        ),
        (
            "file_exists",
            "--out",
            "{path} is there already",
            "move it away, or name another file",
            lambda t: t.ciris("scene", "init", "arm.urdf", "--out", t.write(scene__yaml="").name),
        ),
        (
            "bad_option",
            "--package",
            "must be NAME=DIRECTORY, not {text}",
            "",
            lambda t: t.ciris("scene", "init", "arm.urdf", "--package", "x"),
        ),
        (
            "seed_wrong_length",
            "--q",
            "{...} numbers for {n} joints",
            "in order: {names}",
            lambda t: t.ciris("scene", "check", PLANAR, "--q", "0"),
        ),
    ),
    *rows(
        "client/recertify.py",
        ("option", "REGION", "no region was named", "name one, or name its scene with --from", lambda t: again(t)),
        (
            "option",
            "--q",
            "the service keeps what the region was grown around inside",
            "leave it out",
            lambda t: again(t, "x", "--q", "0,0"),
        ),
        (
            "option",
            "--from",
            "all regions of a scene need a service, which keeps the new regions",
            "leave out REGION, --q, --local and --out",
            lambda t: again(t, "x", "--from", "planar-2dof"),
        ),
        (
            "no_file",
            "REGION",
            "{...}",
            "--local needs the proof file of a region",
            lambda t: again(t, "nothing.proof", "--local"),
        ),
    ),
    *rows(
        "certifier/jobs/clearance.py",
        ("no_file", "", "{...}", "name a proof file", "a file that goes away before the child process reads it"),
        (
            "no_pairs",
            "PROOF",
            "the scene has no pair of bodies",
            "add what the robot can collide with",
            "a region of a scene without pairs",
        ),
    ),
    *rows(
        "client/verify.py",
        ("no_file", "nothing.proof", "{...}", "name a proof file", lambda t: t.ciris("verify", "nothing.proof")),
        ("no_file", "", "{...}", "name a proof file", "a file that goes away while it is checked"),
    ),
]
