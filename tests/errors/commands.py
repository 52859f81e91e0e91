"""Errors of the ``ciris`` command, as it says them."""

from __future__ import annotations

import json
import sys

import numpy as np

from ciris import Space, connect
from db import scenes
from tests.client.conftest import PLANAR
from tests.errors.trial import Table, Trial
from tests.scenes import slider

EYE = [[1, 0], [0, 1], [-1, 0], [0, -1]]


def certify(t: Trial, *options: str, file: str = "p.json", **content: object) -> None:
    """Certifies a polytope file with this content, or with the one that is there."""
    if content:
        (t.directory / file).write_text(json.dumps(content))
    t.ciris("certify", PLANAR, "--polytope", file, *options)


def good(t: Trial, *options: str, **more: object) -> None:
    certify(t, *options, C=EYE, d=[0.05] * 4, **more)


def grow(t: Trial, *options: str) -> None:
    t.ciris("grow", PLANAR, "--local", *options)


def again(t: Trial, *options: str) -> None:
    t.ciris("recertify", *options, "--scene", PLANAR)


def beside_a_seed(t: Trial, seed: str) -> None:
    t.write(scene__yaml="", seed__yaml=seed)
    t.ciris("grow", "scene.yaml", "--local")


def asked(t: Trial, *arguments: str) -> None:
    """Runs a command that asks the service."""
    t.ciris(*arguments, CIRIS_URL=t.need("url"))


def shared(t: Trial) -> None:
    """Deletes a scene by one of its two names."""
    t.need("scene")
    with t.need("database").write() as session:
        scenes.add(session, slider())
        scenes.add(session, slider("other"))
    asked(t, "scene", "rm", "slider")


def to_a_terminal(t: Trial) -> None:
    region, _ = t.need("region"), t.need("ciris")
    t.need("monkeypatch").setattr(sys.stdout, "isatty", lambda: True)
    asked(t, "region", "export", region, "--format", "npz")


def bound(t: Trial) -> None:
    np.savez(t.directory / "p.npz", C=np.array(EYE), d=np.full(4, 0.05), q_star=np.array([1.0, 1.0]))
    certify(t, "--local", file="p.npz")


def one_joint() -> Space:
    return Space(("slide",), np.zeros(1), -np.ones(1), np.ones(1), np.array([False]))


COMMANDS: Table = {
    ("option", "--q"): [lambda t: t.ciris("path", "slider", "--q", "0.1"), lambda t: again(t, "x", "--q", "0,0")],
    ("option_value", "--deadline"): [lambda t: grow(t, "--deadline", "0"), lambda t: again(t, "x", "--deadline", "0")],
    ("option", "--deadline"): [lambda t: good(t, "--local", "--deadline", "9")],
    ("several_seeds", "--q"): [lambda t: grow(t, "--q", "0,0", "--q", "0,1")],
    ("seed_wrong_length", "--at[0]"): [lambda t: t.ciris("map", PLANAR, "--local", "--at", "0")],
    ("option", "--priority"): [lambda t: grow(t, "--local", "--priority", "1")],
    ("option", "--solver"): [lambda t: good(t, "--solver", "clarabel")],
    ("option", "--cells"): [lambda t: good(t, "--backend", "drake", "--cells", "2")],
    ("option", "--out"): [lambda t: good(t, "--backend", "drake", "--out", "x.proof")],
    ("option", "--backend"): [lambda t: good(t, "--backend", "drake")],
    ("not_writable", "--out"): [
        lambda t: grow(t, "--out", "."),
        lambda t: t.ciris("region", "export", "any", "--out", "nowhere/region.json"),
        lambda t: grow(t, "--out", "/proc/any.proof"),
    ],
    ("file_exists", "--out"): [
        lambda t: grow(t, "--out", t.write(a__proof="").name),
        lambda t: t.ciris("scene", "init", "arm.urdf", "--out", t.write(scene__yaml="").name),
    ],
    ("terminal", "--out"): [to_a_terminal],
    ("no_service", ""): [lambda t: t.ciris("scene", "ls")],
    ("api_key", "CIRIS_API_KEY"): [lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9", CIRIS_API_KEY="two words")],
    ("api_key", "CIRIS_API_KEY_FILE"): [
        lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9", CIRIS_API_KEY_FILE=str(t.write(key="two words")))
    ],
    ("points", "q"): [
        lambda t: connect("http://127.0.0.1:9").contains("cell"),
        lambda t: connect("http://127.0.0.1:9").contains("cell", 0.5),
        lambda t: connect("http://127.0.0.1:9").contains("cell", [0.5, "home"]),
    ],
    ("wrong_length", "q"): [lambda t: one_joint().to_s([0.1, 0.2])],
    ("unreachable", ""): [lambda t: t.ciris("scene", "ls", CIRIS_URL="http://127.0.0.1:9")],
    ("not_found", ""): [lambda t: asked(t, "job", "show", "..")],
    ("has_names", "SCENE"): [lambda t: shared(t)],
    ("job_not_found", "job"): [lambda t: asked(t, "job", "show", "nothing")],
    ("bad_number", "--q[1]"): [lambda t: grow(t, "--q", "0,x")],
    ("bad_number", "--q"): [lambda t: grow(t, "--q", ",")],
    ("seed_missing", "--q"): [lambda t: t.ciris("grow", t.write(alone__yaml="").name, "--local")],
    ("seed_file", "seed.yaml"): [lambda t: beside_a_seed(t, "q: [here]"), lambda t: beside_a_seed(t, "a: 1")],
    ("polytope_joints", "--polytope"): [lambda t: good(t, "--local", space={"joints": ["other/a", "other/b"]})],
    ("polytope_q_star", "--polytope"): [bound],
    ("polytope_file", "--polytope"): [
        lambda t: certify(t, file="nothing.npz"),
        lambda t: certify(t, C="x"),
        lambda t: certify(t, C=[[1, 0], [1]], d=[1, 1]),
        lambda t: certify(t, file="p.txt"),
        lambda t: certify(t, C=EYE),
    ],
    ("polytope_shape", "--polytope"): [lambda t: good(t, center=[0.0])],
    ("scene_not_found", "SCENE"): [lambda t: t.ciris("grow", "planar", "--q", "0,0", "--local")],
    ("scene_file", "--out"): [lambda t: t.ciris("scene", "init", "arm.urdf", "--out", "scene.txt")],
    ("bad_option", "--package"): [lambda t: t.ciris("scene", "init", "arm.urdf", "--package", "x")],
    ("seed_wrong_length", "--q"): [lambda t: t.ciris("scene", "check", PLANAR, "--q", "0")],
    ("option", "REGION"): [lambda t: again(t)],
    ("option", "--from"): [lambda t: again(t, "x", "--from", "planar-2dof")],
    ("no_file", "REGION"): [lambda t: again(t, "nothing.proof", "--local")],
    ("no_file", "nothing.proof"): [lambda t: t.ciris("verify", "nothing.proof")],
}
