"""What is read of random URDF models is what yourdfpy and MuJoCo read of them; a file that was changed is read as they do or refused.

yourdfpy says where links are and how far joints go; MuJoCo says that as well, and where geometries reach.
"""

from __future__ import annotations

import copy
import re
from collections import Counter
from dataclasses import replace

import numpy as np
import pytest

from certifier.errors import SceneError
from certifier.scene.formats.urdf_names import HARMLESS, READ
from tests.certifier.scene.urdf_models import (
    Tree,
    differences,
    element,
    followers,
    in_mujoco,
    in_yourdfpy,
    load,
    meshes,
    ours,
    positions,
    robot,
)

FAST = 30
SLOW = 300
MUTANTS = 10
"""Number of mutants of each model in the slow campaign."""
WITHOUT_LINE = {"floating_body", "loop", "no_joints", "joint_range", "scene_field", "unsupported_joint"}
"""Errors of the scene as a whole, which name the body or the joint instead."""
NUMBERS = ("1,5", "0x10", "1e400", "nan", "", "1 2", "0", "-0.2", "0.123", "1e-3", "1_0", "7")


def compare(tree: Tree, scene, files, rng) -> list[str]:
    """In what the scene differs from what MuJoCo and yourdfpy read; the one that refuses the file is not heard, but one must read it."""
    at = positions(tree, scene, rng)
    found, said, heard = ours(scene, at), [], 0
    for name, read in (("MuJoCo", lambda: in_mujoco(tree, files, at)), ("yourdfpy", lambda: in_yourdfpy(tree, at))):
        try:
            oracle = read()
        except Exception as error:  # whatever an oracle raises on a broken file
            refusal = f"{name}: {type(error).__name__} {error}"
            continue
        heard += 1
        said += [f"{name}: {difference}" for difference in differences(found, oracle, followers(tree).keys())]
    return said if heard else [refusal]


@pytest.mark.parametrize("seed", range(FAST))
def test_random_models_are_read_as_others_read_them(tmp_path, seed):
    rng = np.random.default_rng(seed)
    tree, files = robot(rng), meshes(rng)
    at = positions(tree, scene := load(tmp_path, tree, files), rng)
    found, held = ours(scene, at), followers(tree).keys()
    assert differences(found, in_mujoco(tree, files, at), held) == []
    assert differences(found, in_yourdfpy(tree, at), held) == []


def test_the_comparison_sees_other_poses_limits_and_sizes(tmp_path):
    rng = np.random.default_rng(0)
    tree, files = robot(rng), meshes(rng)
    at = positions(tree, scene := load(tmp_path, tree, files), rng)
    found, held = ours(scene, at), followers(tree).keys()
    elsewhere = {name: value + 1e-3 for name, value in at.items()}
    assert any("pose of" in said for said in differences(found, in_mujoco(tree, files, elsewhere), held))
    smaller = replace(found, supports={body: reach - 1e-4 for body, reach in found.supports.items()})
    assert any("m farther" in said for said in differences(smaller, in_mujoco(tree, files, at), held))
    fewer = replace(found, supports={body: reach[1:] for body, reach in found.supports.items()})
    assert any("geometries" in said for said in differences(fewer, in_yourdfpy(tree, at), held))
    wider = replace(found, limits={name: (lower - 1e-6, upper) for name, (lower, upper) in found.limits.items()})
    assert any("limits of" in said for said in differences(wider, in_yourdfpy(tree, at), held))


def typo(rng: np.random.Generator, name: str) -> str:
    """A name with one thing wrong."""
    i = int(rng.integers(len(name)))
    match rng.integers(5):
        case 0:
            return name[:i] + name[i + 1 :] or "x"
        case 1:
            return name[:i] + name[i] + name[i:]
        case 2:
            return name[: max(i - 1, 0)] + name[max(i - 1, 0) : i + 1][::-1] + name[i + 1 :]
        case 3:
            return name.upper() if name.islower() else name.lower()
        case _:
            return name[:i] + "_" + name[i:]


def mutated(tree: Tree, rng: np.random.Generator) -> tuple[str, Tree, bool]:
    """What was changed, the changed tree, and whether it has to be refused."""
    made = copy.deepcopy(tree)
    around = {child: parent for parent in made.iter() for child in parent}
    parts = [part for part in around if around[part].tag in {place for place, _ in READ} and part.tag not in ("dynamics", "frame")]
    part = parts[int(rng.integers(len(parts)))]
    parent, keys = around[part], sorted(part.attrib)
    key = keys[int(rng.integers(len(keys)))] if keys else None
    match rng.integers(9):
        case 0:
            name, old = typo(rng, part.tag), part.tag
            part.tag = name
            known = (parent.tag, name) in READ or name in HARMLESS.get(parent.tag, ())
            return f"<{old}> as <{name}>", made, not known
        case 1 if key:
            name = typo(rng, key)
            part.set(name, part.attrib.pop(key))
            known = READ.get((parent.tag, part.tag))
            return f"{key} of <{part.tag}> as {name}", made, known is None or name not in known.attributes
        case 2:
            place = list(made.iter())[int(rng.integers(len(list(made.iter()))))]
            if place in part.iter() or place is parent:
                return "nothing", made, False
            parent.remove(part)
            place.append(part)
            known = (place.tag, part.tag) in READ
            return f"<{part.tag}> of <{parent.tag}> in <{place.tag}>", made, not known and part.tag not in HARMLESS.get(place.tag, ())
        case 3 if key:
            number = str(rng.choice(NUMBERS))
            values = part.attrib[key].split()
            if re.fullmatch(r"[-+.e\d]+", values[0]) if values else False:
                values[int(rng.integers(len(values)))] = number
            for same in ("a", "b", "c") if part.tag == "drake:ellipsoid" else (key,):  # others know balls only
                part.set(same, " ".join(values))
            return f"{key} of <{part.tag}> is {part.attrib[key]!r}", made, False
        case 4 if key:
            part.set(key, "${" + part.attrib[key] + "}")
            return f"{key} of <{part.tag}> is a macro", made, True
        case 5:
            part.append(element("xacro:gripper", parent="tip"))
            return f"a macro in <{part.tag}>", made, True
        case 6:
            parent.remove(part)
            return f"<{part.tag}> of <{parent.tag}> is missing", made, False
        case 7 if key:
            del part.attrib[key]
            return f"{key} of <{part.tag}> is missing", made, False
        case _:
            parent.append(copy.deepcopy(part))
            return f"<{part.tag}> of <{parent.tag}> twice", made, False


def outcome(directory, tree: Tree, files, rng) -> tuple[str, str]:
    """What becomes of a changed model: ``read``, ``refused`` or ``wrong``, and why."""
    what, changed, refused = mutated(tree, rng)
    try:
        scene = load(directory, changed, files)
    except SceneError as error:
        if re.match(r"arm\.urdf:\d+: |m\d\.obj:\d+: ", error.message) or (error.code in WITHOUT_LINE and not refused):
            return "refused", f"{what}: {error}"
        return "wrong", f"{what}: refused without a line: {error}"
    if refused:
        return "wrong", f"{what}: read, and should be refused"
    said = compare(changed, scene, files, rng)
    return ("wrong", f"{what}: {said}") if said else ("read", what)


@pytest.mark.parametrize("seed", range(FAST))
def test_a_model_with_something_changed_is_read_as_others_read_it_or_refused(tmp_path, seed):
    rng = np.random.default_rng(1000 + seed)
    tree, files = robot(rng), meshes(rng)
    for _ in range(3):
        kind, why = outcome(tmp_path, tree, files, rng)
        assert kind != "wrong", why


@pytest.mark.slow
def test_a_campaign_over_random_models_and_mutants(tmp_path):
    counts = Counter[str]()
    for seed in range(SLOW):
        rng = np.random.default_rng(10_000 + seed)
        tree, files = robot(rng), meshes(rng)
        said = compare(tree, load(tmp_path, tree, files), files, rng)
        assert said == [], (seed, said)
        for _ in range(MUTANTS):
            kind, why = outcome(tmp_path, tree, files, rng)
            assert kind != "wrong", (seed, why)
            counts[kind] += 1
    print(counts)
    assert min(counts["read"], counts["refused"]) > SLOW
