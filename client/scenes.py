"""Scene files are drafted and checked here, on this machine and without a service."""

from __future__ import annotations

import os
import sys
from argparse import Namespace
from collections.abc import Collection, Iterable
from pathlib import Path

import numpy as np

from certifier.conditioned import condition_of
from certifier.conditions import called, condition_named, of_condition
from certifier.configurations import is_number
from certifier.errors import CirisError
from certifier.kinematics import Kinematics
from certifier.model import Pair, Scene
from certifier.pair.forecast import PairCost, forecast
from certifier.scene.contacts import touching
from certifier.scene.draft import Draft, Part, draft
from certifier.scene.hollow import beyond
from certifier.scene.load import load_scene
from certifier.seeding.limits import check_limits
from certifier.verify.conditions import conditions
from certifier.verify.decimals import at_most_mm
from certifier.verify.paddings import paddings
from certifier.verify.uncovered import unlisted
from certifier.words import counted
from client import output
from client.inputs import numbers
from client.local import positions_of
from client.seeds import seed_file, seed_of

COSTLIEST = 5
Triple = tuple[float, float, float]


def scene_init(args: Namespace) -> int:
    """Writes a scene file, and a seed beside it."""
    out = Path(args.out)
    if out.suffix not in (".yaml", ".yml"):
        raise CirisError("scene_file", f"the name of a scene file must end in .yaml, not as {out.name}", field="--out")
    seed = seed_file(out)
    for path in (out, seed):
        if path.exists():
            raise CirisError("file_exists", f"{path} is there already", field="--out", hint="move it away, or name another file")
    packages = {name: Path(directory) for name, directory in (_named(text, "--package", "DIRECTORY") for text in args.package)}
    arguments = dict(_named(text, "--xacro", "VALUE") for text in args.xacro)
    worlds, mounts = [_standing(text) for text in args.world], [_mounted(text) for text in args.mount]
    made = not out.parent.exists()
    out.parent.mkdir(parents=True, exist_ok=True)
    try:
        drafted = draft(Path(args.robot), worlds, out, packages, mounts, args.srdf and Path(args.srdf), os.environ, arguments)
    except CirisError:
        if made:
            out.parent.rmdir()
        raise
    out.write_text(drafted.text, encoding="utf-8")
    scene = drafted.scene
    print(f"{out}: {output.scene_size(scene.n, len(scene.geometries), len(scene.pairs))}; {len(scene.ignored)} ignored")
    for note in drafted.notes:
        print(note)
    output.print_configurations(scene.configurations, _units(scene))
    for warning in scene.warnings:
        print("warning:", warning, file=sys.stderr)
    for warning in _overlaps(drafted):
        print("warning:", warning, file=sys.stderr)
    if drafted.seed is None:
        print("warning: every configuration that was tried is in collision, so there is no seed", file=sys.stderr)
        return 0
    text = (
        f"q: {[round(float(x), 6) for x in drafted.seed]}\nabout: The free configuration nearest to q_star that ciris scene init found.\n"
    )
    seed.write_text(text, encoding="utf-8")
    print(f"{seed}: a configuration that is free of collision")
    print(f"next: ciris scene check {out}, then ciris grow {out} --local")
    return 0


def _units(scene: Scene) -> dict[str, str]:
    """Returns the units of joint positions by the names of the joints."""
    return {joint.name: joint.unit for joint in scene.moving}


def _overlaps(drafted: Draft) -> list[str]:
    """Returns what there is to say about pairs that overlap at every configuration that was tried."""
    doubtful = [pair for pair in drafted.ignored if pair in drafted.doubtful]
    said = [f"{pair.a} and {pair.b} are ignored, but {drafted.doubtful[pair]}" for pair in doubtful[:1]]
    said += (
        [f"{'so is 1 more pair' if len(doubtful) == 2 else f'so are {len(doubtful) - 1} more pairs'}: the comments at ignore say which"]
        if len(doubtful) > 1
        else []
    )
    for pair in drafted.overlapping:
        always = f"{pair.a} and {pair.b} overlap at every configuration that was tried"
        doubt = drafted.doubtful.get(pair)
        said.append(f"{always}, but {doubt}: decompose the mesh, or move the weld of one" if doubt else f"{always}: move the weld of one")
    return said


def _standing(text: str) -> Part:
    """Returns what ``FILE@X,Y,Z,ROLL,PITCH,YAW`` says; the pose, or its angles, may be missing."""
    file, pose = _split(text, "--world")
    return Part(Path(file), "", *pose)


def _mounted(text: str) -> Part:
    """Returns what ``FILE@LINK@X,Y,Z,ROLL,PITCH,YAW`` says. The draft asks for a link that is missing."""
    rest, pose = _split(text, "--mount")
    file, at, link = rest.rpartition("@")
    return Part(Path(file), link, *pose) if at and not Path(rest).is_file() else Part(Path(rest), "", *pose)


def _split(text: str, option: str) -> tuple[str, tuple[Triple, Triple]]:
    """Returns what stands before a pose, and the pose: metres and degrees."""
    before, at, pose = text.rpartition("@")
    if not at or not is_number(pose.partition(",")[0]):
        return text, ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    found = numbers(pose, option)
    if len(found) not in (3, 6):
        hint = "write X,Y,Z in metres, or X,Y,Z,ROLL,PITCH,YAW with degrees"
        raise CirisError("bad_option", f"a pose has 3 or 6 numbers, not {len(found)}", field=option, hint=hint)
    x, y, z, roll, pitch, yaw = [*found, 0.0, 0.0, 0.0][:6]
    return before, ((x, y, z), (roll, pitch, yaw))


def _named(text: str, option: str, what: str) -> tuple[str, str]:
    name, _, value = text.partition("=")
    if not name or not value:
        raise CirisError("bad_option", f"must be NAME={what}, not {text!r}", field=option)
    return name, value


def scene_check(args: Namespace) -> int:
    """Says what was read, what was replaced and ignored, what touches at a configuration, and what the pairs will cost."""
    scene = load_scene(args.path)
    q, whence = _configuration(scene, args)
    check_limits(scene, q, "q")
    (touches,) = touching(scene, [scene.in_windows(q)])
    broken = sorted((pair for pair in touches if pair in set(scene.pairs)), key=lambda p: (p.a, p.b))
    bad = [pair for pair in broken if condition_of(scene, pair) is None]
    unkept = dict.fromkeys(one.name for pair in broken if (one := condition_of(scene, pair)))
    costs = sorted(forecast(scene), key=lambda cost: -cost.seconds)
    if args.json:
        output.print_json(_document(scene, q, bad, unkept, costs))
        return 1 if broken else 0
    geometries = sum(not of_condition(geometry.name) for geometry in scene.geometries)
    print(f"{scene.name}: {output.scene_size(scene.n, geometries, len(scene.body_pairs))}, {len(scene.ignored)} ignored")
    for line in conditions(scene):
        print(line)
    print()
    output.print_table(("joint", "kind", "lower", "upper", "q*", "q", ""), _joints(scene, q), right="lower upper q* q")
    output.print_configurations(scene.configurations, _units(scene))
    print()
    if replaced := _replaced(scene):
        output.print_table(("geometry", "what stands for it", "outside of it", "beyond the mesh"), replaced)
        print()
    for warning in scene.warnings:
        print(f"warning: {warning}")
    for ignored in scene.ignored:
        print(f"ignored: {ignored.a} and {ignored.b}: {ignored.reason}")
    if missing := unlisted(scene):
        print(f"no pairs, as neighbours or by a filter of the model: {missing}")
    for line in paddings(scene) if scene.largest_padding else ():
        print(line)
    for pair in bad:
        padded = f", with a padding of {scene.padding_of(pair):g} m on each" if scene.padding_of(pair) else ""
        print(f"touching at {whence}: {pair.a} and {pair.b}{padded}")
    for name in unkept:
        print(f"not kept at {whence}: the condition {name}")
    if not broken:
        print(f"nothing touches at {whence}")
    print(f"one plane for a pair: {output.seconds(sum(cost.seconds for cost in costs))} for all pairs on one core; most for")
    kinematics = Kinematics.of(scene)
    for cost in costs[:COSTLIEST]:
        joints = len(kinematics.chain(*(scene.geometry(name).body for name in (cost.a, cost.b))))
        print(f"  {called(cost.a, cost.b)}: {counted(joints, 'joint')} between them, {output.seconds(cost.seconds)}")
    return 1 if broken else 0


def _configuration(scene: Scene, args: Namespace) -> tuple[np.ndarray, str]:
    seed = seed_file(args.path)
    if args.q is None and not seed.is_file():
        inside = 1e-3 * (scene.q_upper - scene.q_lower)
        return scene.q_star.clip(scene.q_lower + inside, scene.q_upper - inside), "q*"
    q = positions_of(scene, seed_of(args.path, args.q), "--q" if args.q is not None else seed.name)
    if len(q) != scene.n:
        field = seed.name if args.q is None else "--q"
        raise CirisError(
            "seed_wrong_length", f"{counted(len(q), 'number')} for {counted(scene.n, 'joint')}", field=field, hint=scene.in_order
        )
    return np.array(q), "--q" if args.q is not None else seed.name


def _joints(scene: Scene, q: np.ndarray) -> list[tuple[str, ...]]:
    rows = []
    for i, joint in enumerate(scene.moving):
        unit, scale = joint.shown
        values = (scene.q_lower[i], scene.q_upper[i], scene.q_star[i], q[i])
        texts = [f"{scale * x:.{2 if unit == 'deg' else 4}f} {unit}" for x in values]
        rows.append((joint.name, joint.kind.value, *texts, "window" if joint.own_limits is not None else ""))
    return rows


def _replaced(scene: Scene) -> list[tuple[str, ...]]:
    """Returns what stands for shapes that are not certified as they are, and how far it reaches: at most, and at least."""
    return [
        (
            geometry.name,
            geometry.substitution,
            at_most_mm(geometry.inflation) if geometry.inflation else "",
            f"{1000 * far:.3g} mm or more" if (far := beyond(scene, geometry.name)) else "",
        )
        for geometry in scene.geometries
        if geometry.substitution
    ]


def _document(scene: Scene, q: np.ndarray, bad: Iterable[Pair], unkept: Collection[str], costs: list[PairCost]) -> dict[str, object]:
    return {
        "name": scene.name,
        "hash": scene.hash,
        "joints": [
            {"name": j.name, "kind": j.kind.value, "lower": j.lower, "upper": j.upper, "own_limits": j.own_limits, "q_star": float(c)}
            for j, c in zip(scene.moving, scene.q_star, strict=True)
        ],
        "q": q.tolist(),
        "configurations": {name: dict(positions) for name, positions in scene.configurations.items()},
        "touching": [[pair.a, pair.b] for pair in bad],
        "conditions": [
            {"name": one.name, "kind": one.kind, "statement": str(one), "kept": one.name not in unkept} for one in scene.conditions
        ],
        "warnings": list(scene.warnings),
        "substitutions": [
            {"geometry": g.name, "what": g.substitution, "inflation": g.inflation} for g in scene.geometries if g.substitution
        ],
        "ignored": [{"a": i.a, "b": i.b, "reason": i.reason} for i in scene.ignored],
        "pairs": [
            {"a": cost.a, "b": cost.b, "padding": scene.padding_of(Pair(cost.a, cost.b)), "seconds": cost.seconds}
            for cost in costs
            if condition_named(cost.a, cost.b) is None
        ],
    }
