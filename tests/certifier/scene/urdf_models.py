"""Random URDF models, as trees of elements, and what MuJoCo and yourdfpy, which nobody here wrote, make of the same files."""

from __future__ import annotations

import copy
import io
from collections.abc import Collection
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
import yourdfpy

from certifier.kinematics import Kinematics
from certifier.model import Array, Scene
from tests.certifier.scene.workshop import parsed

Tree = ElementTree.Element
ROOT = "base"
SCENE = "directives: [{add_model: {name: arm, file: arm.urdf}}, {add_weld: {parent: world, child: arm::base}}]\n"
COMPILER = "<mujoco><compiler fusestatic='false' discardvisual='true' boundmass='0.1' boundinertia='0.1'/></mujoco>"
LEADER = 0.1
"""Where a joint is held that another one mimics, radians."""
TOLERANCE = 1e-6
"""MuJoCo holds the vertices of meshes as single precision numbers, metres."""
DIRECTIONS = np.random.default_rng(0).normal(size=(60, 3))


def number(rng: np.random.Generator, low: float, high: float) -> str:
    """A number in one of the ways in which people write it."""
    value = float(rng.uniform(low, high))
    return rng.choice([repr(value), f"{value:.3e}", f"{value:+.4f}", f" {value:.2f} "] if abs(value) > 0.02 else [repr(value)])


def vector(rng: np.random.Generator, low: float, high: float) -> str:
    return rng.choice([" ", "  ", "\t"]).join(number(rng, low, high).strip() for _ in range(3))


def element(tag: str, /, *children: Tree, **attributes: str) -> Tree:
    made = ElementTree.Element(tag, attributes)
    made.extend(children)
    return made


def origin(rng: np.random.Generator) -> list[Tree]:
    parts = {"xyz": vector(rng, -0.5, 0.5), "rpy": vector(rng, -3, 3)}
    kept = {key: value for key, value in parts.items() if rng.uniform() < 0.8}
    return [element("origin", **kept)] if rng.uniform() < 0.85 else []


def shape(rng: np.random.Generator) -> Tree:
    def size() -> str:
        return number(rng, 0.03, 0.4).strip()

    match rng.integers(8):
        case 0 | 1:
            return element("box", size=vector(rng, 0.03, 0.5))
        case 2:
            return element("sphere", radius=size())
        case 3:
            return element("cylinder", radius=size(), length=size())
        case 4:
            return element(str(rng.choice(["capsule", "drake:capsule"])), radius=size(), length=size())
        case 5:
            radius = size()
            return element("drake:ellipsoid", a=radius, b=radius, c=radius)
        case _:
            scale = {"scale": " ".join(vector(rng, 0.3, 2).split())} if rng.uniform() < 0.6 else {}
            convex = [element("drake:declare_convex")] if rng.uniform() < 0.3 else []
            return element("mesh", *convex, filename=f"m{rng.integers(3)}.obj", **scale)


def collision(rng: np.random.Generator, name: str) -> Tree:
    named = {"name": name} if rng.uniform() < 0.6 else {}
    more = [element("drake:proximity_properties")] if rng.uniform() < 0.2 else []
    return element("collision", *origin(rng), element("geometry", shape(rng)), *more, **named)


def joint(rng: np.random.Generator, number_: int, parent: str, child: str) -> Tree:
    kind = str(rng.choice(["revolute", "revolute", "prismatic", "continuous", "fixed"]))
    axis = [element("axis", xyz=vector(rng, -2, 2))] if rng.uniform() < 0.85 else []
    limits = {"lower": number(rng, -2, -0.1).strip(), "upper": number(rng, 0.1, 2).strip()}
    if kind == "continuous" and rng.uniform() < 0.7:
        limits = {}
    limit = [element("limit", **limits, effort="1", velocity="1")] if kind != "fixed" else []
    more = [element("dynamics", damping="0.1")] if rng.uniform() < 0.3 else []
    children = [element("parent", link=parent), element("child", link=child), *origin(rng), *axis, *limit, *more]
    rng.shuffle(children)
    return element("joint", *children, name=f"joint.{number_}", type=kind)


def robot(rng: np.random.Generator) -> Tree:
    """A robot of two to six links that hangs on the link ``base``; one joint at least moves, and one link at least has a collision."""
    links = [ROOT, *(f"link_{i}-{rng.integers(9)}" for i in range(int(rng.integers(1, 6))))]
    parts = [element("link", *(collision(rng, f"c{k}") for k in range(rng.integers(0, 3))), name=name) for name in links]
    parts += [joint(rng, i, links[int(rng.integers(i))], links[i]) for i in range(1, len(links))]
    parts += [element("link", collision(rng, "tip"), name="tip"), joint(rng, 0, links[-1], "tip")]
    parts[-1].set("type", "revolute")
    if parts[-1].find("limit") is None:
        parts[-1].append(element("limit"))
    parts[-1].find("limit").attrib.update(lower="-1.5", upper="1.5")  # type: ignore[union-attr]
    free = [part for part in parts[:-1] if part.tag == "joint" and part.get("type") != "fixed"]
    if len(free) > 1 and rng.uniform() < 0.5:
        free[0].append(element("mimic", joint="joint.0", multiplier=number(rng, -0.5, 0.5), offset=number(rng, -0.05, 0.05)))
    rng.shuffle(parts)
    frame = [element("frame", link=ROOT, name="stand", xyz="0 0 1")] if rng.uniform() < 0.3 else []
    made = element("robot", *parts, *frame, name="arm")
    made.set("xmlns:drake", "http://drake.mit.edu")
    ElementTree.indent(made)
    return made


def meshes(rng: np.random.Generator) -> dict[str, bytes]:
    """Three tetrahedra whose faces look outward."""
    files = {}
    for i in range(3):
        points = rng.uniform(-0.3, 0.3, (4, 3)) + 0.3 * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
        if np.linalg.det(points[1:] - points[0]) < 0:
            points[[1, 2]] = points[[2, 1]]
        lines = [f"v {x!r} {y!r} {z!r}" for x, y, z in points.tolist()]
        files[f"m{i}.obj"] = "\n".join([*lines, "f 1 3 2", "f 1 2 4", "f 1 4 3", "f 2 3 4", ""]).encode()
    return files


def twin(tree: Tree, capsule: str) -> bytes:
    """The same robot without Drake's extensions, with what MuJoCo needs to read it, and with another name for capsules."""
    made = copy.deepcopy(tree)
    for part in made.iter():
        if part.tag == "drake:ellipsoid":
            part.tag, part.attrib = "sphere", {"radius": part.attrib["a"]}
        elif part.tag in ("capsule", "drake:capsule"):
            part.tag = capsule
    made.append(ElementTree.fromstring(COMPILER))
    return ElementTree.tostring(made)


@dataclass(frozen=True)
class Reading:
    """What somebody makes of a file, at given joint positions.

    Attributes:
        limits: lower and upper of every joint that moves, infinite for none, by the joint's name.
        poses: (4, 4) of every link in the frame of the first, by the link's name.
        supports: by link, how far its geometries reach along DIRECTIONS in the frame of the first link, (k, 60), in metres.
        slack: by link, how much farther its geometries may reach than those of the file, (k, 1), in metres.
    """

    limits: dict[str, tuple[float, float]]
    poses: dict[str, Array]
    supports: dict[str, Array]
    slack: dict[str, Array] = field(default_factory=dict)


def followers(tree: Tree) -> dict[str, float]:
    """Where joints are that are coupled, by name."""
    found = {}
    for joint_ in tree.iter("joint"):
        for mimic in joint_.iter("mimic"):
            factor, offset = float(mimic.get("multiplier", "1")), float(mimic.get("offset", "0"))
            found |= {mimic.attrib["joint"]: LEADER, joint_.attrib["name"]: factor * LEADER + offset}
    return found


def positions(tree: Tree, scene: Scene, rng: np.random.Generator) -> dict[str, float]:
    q = rng.uniform(scene.q_lower, scene.q_upper)
    return followers(tree) | {j.name.removeprefix("arm/"): float(x) for j, x in zip(scene.moving, q, strict=True)}


def load(directory: Path, tree: Tree, files: dict[str, bytes]) -> Scene:
    """What is read here of a file, with a joint held that another one mimics."""
    fix = f"fix: {{joint.0: {LEADER}}}\n" if any(True for _ in tree.iter("mimic")) else ""
    for name, data in {**files, "arm.urdf": ElementTree.tostring(tree), "scene.yaml": (SCENE + fix).encode()}.items():
        (directory / name).write_bytes(data)
    return parsed(directory / "scene.yaml")


def ours(scene: Scene, at: dict[str, float]) -> Reading:
    q = np.array([at[j.name.removeprefix("arm/")] for j in scene.moving])
    kinematics, s = Kinematics.of(scene), scene.to_s(q)[None]
    limits = {j.name.removeprefix("arm/"): (lo, up) for j, lo, up in zip(scene.moving, *scene.own_limits, strict=True)}
    corners, poses = np.vstack([np.zeros(3), np.eye(3)]), {}
    for body in (b for b in scene.bodies if b.startswith("arm/")):
        p = kinematics.points(f"arm/{ROOT}", body, corners, s)[0]
        poses[body.removeprefix("arm/")] = np.vstack([np.column_stack([(p[1:] - p[0]).T, p[0]]), [0, 0, 0, 1]])
    supports: dict[str, list[Array]] = {}
    slack: dict[str, list[float]] = {}
    for g in scene.geometries:
        slack.setdefault(g.body.removeprefix("arm/"), []).append(g.inflation)
        v = kinematics.points(f"arm/{ROOT}", g.body, g.vertices, s)[0]
        reach = (DIRECTIONS @ v.T).max(axis=1) + g.radius * np.linalg.norm(DIRECTIONS, axis=1)
        supports.setdefault(g.body.removeprefix("arm/"), []).append(reach)
    sizes = ({body: np.array(found) for body, found in supports.items()}, {body: np.array(found)[:, None] for body, found in slack.items()})
    return Reading(limits, poses, *sizes)


def in_yourdfpy(tree: Tree, at: dict[str, float]) -> Reading:
    """It knows no capsules, and takes the axis of a slide as long as it is written, so here their length is 1."""
    made = ElementTree.fromstring(twin(tree, "cylinder"))
    for axis in made.iterfind("joint[@type='prismatic']/axis"):
        unit = np.array(axis.attrib["xyz"].split(), dtype=float)
        axis.set("xyz", " ".join(map(repr, (unit / np.linalg.norm(unit)).tolist())))
    model = yourdfpy.URDF.load(
        io.BytesIO(ElementTree.tostring(made)), build_scene_graph=True, load_meshes=False, load_collision_meshes=False
    )
    joints = {j.name: j for j in model.robot.joints if j.type != "fixed"}
    model.update_cfg({name: at.get(name, 0.0) for name, j in joints.items() if j.mimic is None})
    limits = {name: (-np.inf, np.inf) if j.type == "continuous" else (j.limit.lower, j.limit.upper) for name, j in joints.items()}
    poses = {link.name: model.get_transform(link.name, ROOT) for link in model.robot.links}
    return Reading(limits, poses, {link.name: np.empty((len(link.collisions), 0)) for link in model.robot.links if link.collisions})


def in_mujoco(tree: Tree, files: dict[str, bytes], at: dict[str, float]) -> Reading:
    model = mujoco.MjModel.from_xml_string(twin(tree, "capsule").decode(), files)
    data = mujoco.MjData(model)
    joints = {model.joint(i).name: model.joint(i) for i in range(model.njnt)}
    for name, found in joints.items():
        data.qpos[found.qposadr[0]] = at.get(name, 0.0)
    mujoco.mj_kinematics(model, data)
    limits = {name: tuple(map(float, j.range)) if model.jnt_limited[j.id] else (-np.inf, np.inf) for name, j in joints.items()}
    X_WB = {}
    for i in range(1, model.nbody):
        X_WB[model.body(i).name] = np.vstack([np.column_stack([data.xmat[i].reshape(3, 3), data.xpos[i]]), [0, 0, 0, 1]])
    to_root = np.linalg.inv(X_WB[ROOT])
    supports: dict[str, list[Array]] = {}
    for i in range(model.ngeom):
        X = to_root @ np.vstack([np.column_stack([data.geom_xmat[i].reshape(3, 3), data.geom_xpos[i]]), [0, 0, 0, 1]])
        reach = _support(model, i, DIRECTIONS @ X[:3, :3]) + DIRECTIONS @ X[:3, 3]
        supports.setdefault(model.body(int(model.geom_bodyid[i])).name, []).append(reach)
    return Reading(limits, {name: to_root @ X for name, X in X_WB.items()}, {body: np.array(found) for body, found in supports.items()})


def _support(model: mujoco.MjModel, geom: int, d: Array) -> Array:
    """How far a geom of MuJoCo's reaches along directions in its frame, (k,)."""
    size, kind = model.geom_size[geom], model.geom_type[geom]
    if kind == mujoco.mjtGeom.mjGEOM_BOX:
        return np.abs(d) @ size
    if kind == mujoco.mjtGeom.mjGEOM_SPHERE:
        return size[0] * np.linalg.norm(d, axis=1)
    if kind == mujoco.mjtGeom.mjGEOM_CAPSULE:
        return size[0] * np.linalg.norm(d, axis=1) + size[1] * np.abs(d[:, 2])
    if kind == mujoco.mjtGeom.mjGEOM_CYLINDER:
        return size[0] * np.linalg.norm(d[:, :2], axis=1) + size[1] * np.abs(d[:, 2])
    assert kind == mujoco.mjtGeom.mjGEOM_MESH, kind
    mesh = model.geom_dataid[geom]
    first = model.mesh_vertadr[mesh]
    return (d @ model.mesh_vert[first : first + model.mesh_vertnum[mesh]].T).max(axis=1)


def differences(found: Reading, oracle: Reading, held: Collection[str]) -> list[str]:
    """In what two readings differ, without the limits of joints that are held here."""
    said = []
    limits = {name: limit for name, limit in oracle.limits.items() if name not in held}
    if found.limits.keys() != limits.keys():
        return [f"joints {sorted(found.limits)} and {sorted(limits)}"]
    for name, limit in limits.items():
        if not np.allclose(found.limits[name], limit, rtol=1e-12, atol=0):
            said.append(f"limits of {name}: {found.limits[name]} and {limit}")
    if found.poses.keys() != oracle.poses.keys():
        return [*said, f"links {sorted(found.poses)} and {sorted(oracle.poses)}"]
    for name, X in oracle.poses.items():
        if not np.allclose(found.poses[name], X, atol=TOLERANCE):
            said.append(f"pose of {name}")
    counts = [{name: len(s) for name, s in reading.supports.items()} for reading in (found, oracle)]
    if counts[0] != counts[1]:
        return [*said, f"geometries {counts[0]} and {counts[1]}"]
    scale = np.linalg.norm(DIRECTIONS, axis=1)
    for name, reach in oracle.supports.items():
        if reach.shape[1]:
            beyond = (found.supports[name] - reach) / scale
            if beyond.min() < -TOLERANCE or (beyond - found.slack[name]).max() > TOLERANCE:
                said.append(f"geometries of {name} reach {beyond.min():g} to {beyond.max():g} m farther")
    return said
