"""MuJoCo's reading of a robot's MJCF is what ciris reads of the same robot's SDFormat, or ciris refuses the file with its line.

No other reader of SDFormat is at hand. So random robots are written in both formats (:mod:`tests.certifier.scene.sdf_robots`).
"""

from __future__ import annotations

import re
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from scipy.spatial import ConvexHull

from certifier.errors import SceneError
from certifier.model import JointKind, Scene
from tests.certifier.scene.sdf_robots import Link, SdfWriter, Written, mjcf, random_robot
from tests.certifier.scene.workshop import parsed

FEW, MANY = 30, 100
"""Number of robots in the fast suite, and in the slow one."""
MUTATIONS = 10
"""Number of mutations of each robot."""
CONFIGURATIONS = 5
EXACT = 1e-9
SCENE = "directives: [{add_model: {name: arm, file: arm.sdf}}]\n"
KINDS = {"prismatic": JointKind.PRISMATIC, "revolute": JointKind.REVOLUTE, "continuous": JointKind.REVOLUTE}


def read(directory: Path, files: dict[str, str]) -> Scene:
    for name, text in files.items():
        (directory / name).write_text(text)
    (directory / "scene.yaml").write_text(SCENE)
    return parsed(directory / "scene.yaml")


def surface(model: mujoco.MjModel, geom: int) -> np.ndarray:
    """Points (k, 3) of a geom in its own frame, the extreme ones among them."""
    directions = np.concatenate([np.eye(3), -np.eye(3), np.random.default_rng(0).normal(size=(40, 3))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    size = model.geom_size[geom]
    match mujoco.mjtGeom(model.geom_type[geom]):
        case mujoco.mjtGeom.mjGEOM_BOX:
            return np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * size
        case mujoco.mjtGeom.mjGEOM_SPHERE:
            return directions * size[0]
        case mujoco.mjtGeom.mjGEOM_ELLIPSOID:
            return directions * size
        case mujoco.mjtGeom.mjGEOM_CAPSULE:
            return np.concatenate([directions * size[0] + [0, 0, end * size[1]] for end in (-1, 1)])
        case mujoco.mjtGeom.mjGEOM_CYLINDER:
            ring = directions[:, :2] / np.maximum(np.linalg.norm(directions[:, :2], axis=1, keepdims=True), 1e-9) * size[0]
            return np.concatenate([np.column_stack([ring, np.full(len(ring), end * size[1])]) for end in (-1, 1)])
    raise AssertionError("another kind of geom")


def outside(points: np.ndarray, vertices: np.ndarray, radius: float) -> float:
    """How far the farthest of points (k, 3) is outside of conv(vertices) + ball(radius), metres; negative inside."""
    if len(vertices) > 2:
        equations = ConvexHull(vertices).equations
        return float((points @ equations[:, :3].T + equations[:, 3]).max())
    along = vertices[-1] - vertices[0]
    t = np.clip((points - vertices[0]) @ along / max(along @ along, 1e-30), 0, 1)
    return float((np.linalg.norm(points - vertices[0] - t[:, None] * along, axis=1) - radius).max())


def difference(scene: Scene, written: Written, links: list[Link]) -> str:
    """What ciris' scene has otherwise than MuJoCo's model of the robot; empty where it has nothing."""
    model = mujoco.MjModel.from_xml_string(mjcf(links))
    data = mujoco.MjData(model)
    moving = {written.joints[k]: k for k, link in enumerate(links) if link.kind != "fixed"}
    if {j.name for j in scene.moving} != set(moving):
        return f"joints {[j.name for j in scene.moving]}"
    for joint in scene.moving:
        twin = model.joint(f"joint{moving[joint.name]}")
        if joint.kind is not KINDS[links[moving[joint.name]].kind]:
            return f"the kind of {joint.name}"
        own = (joint.lower, joint.upper) if joint.own_limits is None else joint.own_limits
        limits = tuple(twin.range) if twin.limited[0] else (None, None)
        if (None in own) != (None in limits) or (None not in own and not np.allclose(own, limits, rtol=0, atol=EXACT)):
            return f"the limits of {joint.name}: {own}, not {limits}"
    if len(scene.geometries) != model.ngeom:
        return f"{len(scene.geometries)} geometries, not {model.ngeom}"
    rng = np.random.default_rng(1)
    for _ in range(CONFIGURATIONS):
        q = rng.uniform(scene.q_lower, scene.q_upper)
        for joint, position in zip(scene.moving, q, strict=True):
            data.qpos[model.joint(f"joint{moving[joint.name]}").qposadr[0]] = position
        mujoco.mj_kinematics(model, data)
        for geom in range(model.ngeom):
            link, _, number = model.geom(geom).name.removeprefix("link").partition("/")
            ours = scene.geometry(f"{written.bodies[int(link)]}/{number}")
            X_WB = pose_of(scene, ours.body, q)
            points = surface(model, geom) @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]
            in_body = (points - X_WB[:3, 3]) @ X_WB[:3, :3]
            middle = (data.geom_xpos[geom] - X_WB[:3, 3]) @ X_WB[:3, :3]
            if (far := outside(in_body, ours.vertices, ours.radius)) > EXACT:
                return f"{ours.name} leaves out {far} m"
            if np.linalg.norm(np.array(ours.shape["X_BG"])[:3, 3] - middle) > EXACT:
                return f"{ours.name} is elsewhere"
    return ""


def pose_of(scene: Scene, body: str, q: np.ndarray) -> np.ndarray:
    """The pose of a body in the world at q, (4, 4)."""
    X = np.eye(4)
    while body != "world":
        joint = scene.joint_above[body]
        X_FM = np.eye(4)
        if joint.kind is JointKind.REVOLUTE:
            X_FM[:3, :3] = rotated(joint.axis, q[joint.index])
        elif joint.kind is JointKind.PRISMATIC:
            X_FM[:3, 3] = q[joint.index] * joint.axis
        X = joint.X_PF @ X_FM @ np.linalg.inv(joint.X_BM) @ X
        body = joint.parent
    return X


def rotated(axis: np.ndarray, angle: float) -> np.ndarray:
    quaternion, matrix = np.zeros(4), np.zeros(9)
    mujoco.mju_axisAngle2Quat(quaternion, axis, angle)
    mujoco.mju_quat2Mat(matrix, quaternion)
    return matrix.reshape(3, 3)


def robot(seed: int) -> tuple[list[Link], Written]:
    rng = np.random.default_rng(seed)
    links = random_robot(rng)
    return links, SdfWriter(links, rng).write()


@pytest.mark.parametrize("seed", range(FEW))
def test_sdformat_is_read_as_mujoco_reads_the_same_robot(tmp_path, seed):
    links, written = robot(seed)
    assert difference(read(tmp_path, written.files), written, links) == ""


def test_the_oracle_sees_what_is_wrong(tmp_path):
    """A limit, a size and a pose that are wrong are seen."""
    links, written = robot(0)
    scene = read(tmp_path, written.files)
    for change in ("lower", "shapes", "X_WL"):
        other = [Link(**vars(link)) for link in links]
        if change == "lower":
            other[1].lower -= 1e-6
        elif change == "shapes":
            kind, sizes, X = other[2].shapes[0]
            other[2].shapes = [(kind, [1.01 * size for size in sizes], X), *other[2].shapes[1:]]
        else:
            other[1].X_WL = other[1].X_WL.copy()
            other[1].X_WL[0, 3] += 1e-6
        assert difference(scene, written, other) != "", change


LEGAL = {(parent, "pose") for parent in ("model", "link", "joint", "frame", "collision", "include")} | {
    ("model", "link"),
    ("model", "joint"),
    ("model", "frame"),
    ("model", "model"),
    ("model", "include"),
    ("world", "model"),
    ("world", "include"),
    ("world", "frame"),
    ("link", "collision"),
    ("link", "visual"),
    ("link", "inertial"),
    ("sdf", "model"),
    ("sdf", "world"),
    ("cylinder", "radius"),
    ("capsule", "radius"),
    ("sphere", "radius"),
    ("drake:capsule", "radius"),
    ("cylinder", "length"),
    ("capsule", "length"),
    ("drake:capsule", "length"),
    ("joint", "axis"),
    ("joint", "parent"),
    ("joint", "child"),
    ("axis", "xyz"),
    ("axis", "limit"),
    ("axis", "use_parent_model_frame"),
    ("limit", "lower"),
    ("limit", "upper"),
    ("box", "size"),
    ("ellipsoid", "radii"),
    ("collision", "geometry"),
    ("include", "placement_frame"),
    ("include", "name"),
    ("include", "uri"),
    ("world", "gravity"),
    ("link", "gravity"),
    *(("geometry", shape) for shape in ("box", "sphere", "cylinder", "capsule", "ellipsoid", "drake:capsule", "drake:ellipsoid")),
}
"""Parents and children as SDFormat has them. Something that is moved to such a place makes another robot, which is read as written."""
NUMBERS = ["1,5", "0x10", "1e", "nan", "1.2.3", "", "--1", "1_0", "1;"]


def typo(name: str, rng) -> str:
    """A name with one letter left out, doubled, replaced, swapped with the next, or in another case."""
    k = int(rng.integers(0, len(name)))
    letter = "abcdefghijklmnopqrstuvwxyz_"[int(rng.integers(0, 27))]
    ways = [name[:k] + name[k + 1 :], name[:k] + name[k] + name[k:], name[:k] + letter + name[k + 1 :], name.swapcase()]
    ways.append(name[:k] + name[k : k + 2][::-1] + name[k + 2 :])
    return str(rng.choice([way for way in ways if way != name and re.fullmatch(r"[A-Za-z_][\w:]*", way)] or [f"x{name}"]))


def mutated(text: str, rng) -> tuple[str, str]:
    """An SDFormat file in which one thing is wrong, and the kind of mutation."""
    text = text.replace("<sdf ", '<sdf xmlns:drake="drake" ', 1)
    ElementTree.register_namespace("drake", "drake")
    root = ElementTree.fromstring(text)
    below = [element for element in root.iter() if element is not root]
    parents = {child: parent for parent in root.iter() for child in parent}
    element = below[int(rng.integers(0, len(below)))]
    kind = str(rng.choice(["element", "attribute", "number", "moved", "again"]))
    if kind == "attribute" and (named := [e for e in below if e.attrib]):
        element = named[int(rng.integers(0, len(named)))]
        key = str(rng.choice([*element.attrib]))
        element.attrib[typo(key, rng)] = element.attrib.pop(key)
    elif kind == "number" and (leaves := [e for e in below if re.fullmatch(r"[-+.e0-9 ]+", e.text or "")]):
        element = leaves[int(rng.integers(0, len(leaves)))]
        words = (element.text or "").split()
        words[int(rng.integers(0, len(words)))] = str(rng.choice(NUMBERS))
        element.text = " ".join(words)
    elif kind == "moved" and (
        places := [e for e in root.iter() if (bare(e), bare(element)) not in LEGAL and element not in inside(e, parents)]
    ):
        parents[element].remove(element)
        places[int(rng.integers(0, len(places)))].append(element)
    elif kind == "again" and bare(element) not in ("link", "joint", "frame", "model", "include", "collision"):
        parents[element].append(element)
    else:
        kind = "element"
        space, _, name = element.tag.rpartition("}")
        element.tag = f"{space}}}{typo(name, rng)}" if space else typo(name, rng)
    return ElementTree.tostring(root, encoding="unicode"), kind


def bare(element: ElementTree.Element) -> str:
    return element.tag.replace("{drake}", "drake:")


def inside(element: ElementTree.Element, parents: dict) -> list[ElementTree.Element]:
    """The element and those that it is in."""
    found = [element]
    while found[-1] in parents:
        found.append(parents[found[-1]])
    return found


def outcome(directory: Path, seed: int, number: int) -> tuple[str, str]:
    """What became of a mutation of a robot, and its kind."""
    links, written = robot(seed)
    rng = np.random.default_rng([seed, number])
    name = str(rng.choice([*written.files]))
    text, kind = mutated(written.files[name], rng)
    try:
        scene = read(directory, {**written.files, name: text})
    except SceneError as error:
        return ("refused" if re.search(r"\.sdf:[0-9]+: ", error.message) else f"refused without a line: {error}"), kind
    return difference(scene, written, links) or "read as the oracle", kind


@pytest.mark.parametrize("seed", range(12))
def test_a_file_in_which_one_thing_is_wrong_is_refused_or_read_as_the_oracle(tmp_path, seed):
    found = [outcome(tmp_path, seed, number) for number in range(3)]
    assert not [(said, kind) for said, kind in found if said not in ("refused", "read as the oracle")]


@pytest.mark.slow
def test_a_campaign_of_robots_and_of_mutations(tmp_path):
    counts: Counter[str] = Counter()
    for seed in range(1000, 1000 + MANY):
        links, written = robot(seed)
        assert difference(read(tmp_path, written.files), written, links) == "", seed
        for number in range(MUTATIONS):
            said, kind = outcome(tmp_path, seed, number)
            assert said in ("refused", "read as the oracle"), (seed, number, kind, said)
            counts[f"{kind}: {said}"] += 1
    print(dict(counts))
    assert sum(count for said, count in counts.items() if said.endswith("refused")) > MANY * MUTATIONS / 2
