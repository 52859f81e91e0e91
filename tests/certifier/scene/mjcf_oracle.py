"""Says where a scene and MuJoCo's reading of the same MJCF file differ: joints, ranges, geoms and pairs."""

from __future__ import annotations

from itertools import combinations

import mujoco
import numpy as np
from scipy.spatial import ConvexHull

from certifier.model import WORLD, Array, Geometry, Scene
from certifier.scene.tree import Tree
from tests.certifier.scene.test_load import poses

EXACT, MESH = 1e-9, 2e-6
"""Metres. MuJoCo keeps the points of meshes as 32-bit numbers."""
DIRECTIONS = 40
CONFIGURATIONS = 4
_HINGE, _SLIDE = int(mujoco.mjtJoint.mjJNT_HINGE), int(mujoco.mjtJoint.mjJNT_SLIDE)
_KINDS = {
    int(mujoco.mjtGeom.mjGEOM_PLANE): "half_space",
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "ellipsoid",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}


class Oracle:
    """Holds a scene of one model, called robot, beside MuJoCo's model of it."""

    def __init__(self, scene: Scene, model: mujoco.MjModel, seed: int) -> None:
        self.scene, self.model, self.data = scene, model, mujoco.MjData(model)
        self.random = np.random.default_rng(seed)
        paired = {*model.pair_geom1, *model.pair_geom2}
        self.solid = [g for g in range(model.ngeom) if model.geom_contype[g] or model.geom_conaffinity[g] or g in paired]
        self.found: list[str] = []

    def differences(self) -> list[str]:
        """Returns what differs, in sentences."""
        joints = self._joints()
        if len(self.solid) != len(self.scene.geometries):
            self.found.append(f"{len(self.solid)} geoms may collide, and the scene has {len(self.scene.geometries)} geometries")
        if self.found:
            return self.found
        fitting = {g: list(self.scene.geometries) for g in self.solid}
        touching: set[tuple[int, int]] = set()
        for _ in range(CONFIGURATIONS):
            q = self.random.uniform(self.scene.q_lower, self.scene.q_upper)
            for index, address in joints.items():
                self.data.qpos[address] = q[index]
            for step in (mujoco.mj_kinematics, mujoco.mj_comPos, mujoco.mj_collision):
                step(self.model, self.data)
            X_WB = {body: X.GetAsMatrix4() for body, X in poses(self.scene, q).items()}
            for g in self.solid:
                fitting[g] = [ours for ours in fitting[g] if self._fits(g, ours, X_WB[ours.body])]
            touching |= {tuple(sorted(contact.geom)) for contact in self.data.contact if contact.dist < 0}
        self._pairs(self._matched(fitting), touching)
        return self.found

    def _joints(self) -> dict[int, int]:
        """Compares the joints and returns where the position of each stands in MuJoCo, by its number here."""
        model, found = self.model, {}
        ours = {joint.name.removeprefix("robot/"): joint for joint in self.scene.moving}
        of_body = {joint.child.removeprefix("robot/"): name for name, joint in ours.items()}
        lower, upper = self.scene.own_limits
        for j in range(model.njnt):
            if model.jnt_type[j] not in (_HINGE, _SLIDE):
                continue
            name = model.joint(j).name or of_body.get(model.body(model.jnt_bodyid[j]).name, "")
            joint = ours.pop(name, None)
            if joint is None or joint.index is None:
                self.found.append(f"the joint {name} is missing")
                continue
            kind = "revolute" if model.jnt_type[j] == _HINGE else "prismatic"
            limits = model.jnt_range[j] if model.jnt_limited[j] else (-np.inf, np.inf)
            if joint.kind != kind or not np.allclose((lower[joint.index], upper[joint.index]), limits, rtol=1e-12, atol=1e-12):
                here = f"{joint.kind} from {lower[joint.index]} to {upper[joint.index]}"
                self.found.append(f"the joint {joint.name} is {here} instead of {kind} with {limits}")
            found[joint.index] = model.jnt_qposadr[j]
        self.found += [f"there is no joint {name}" for name in ours]
        return found

    def _fits(self, g: int, ours: Geometry, X_WB: Array) -> bool:
        """Says whether a geometry of the scene holds a geom at this configuration and reaches no farther outside than it says."""
        name = self.model.geom(g).name
        if ours.shape["kind"] != _KINDS[self.model.geom_type[g]] or (name and not ours.name.endswith(f"/{name}")):
            return False
        vertices = ours.vertices @ X_WB[:3, :3].T + X_WB[:3, 3]
        if ours.shape["kind"] == "half_space":
            return self._fits_plane(g, vertices)
        directions = self.random.normal(size=(DIRECTIONS, 3))
        if ours.radius == 0:
            directions = np.concatenate([directions, ConvexHull(vertices).equations[:, :3]])
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        points = self._farthest(g, directions)
        reach = (directions @ vertices.T).max(axis=1) + ours.radius
        tolerance = MESH if ours.shape["kind"] == "mesh" else EXACT
        inside = (points @ directions.T <= reach + tolerance).all()
        return bool(inside and (reach <= (points * directions).sum(axis=1) + ours.inflation + tolerance).all())

    def _fits_plane(self, g: int, vertices: Array) -> bool:
        """Says whether the box of a half-space ends at a plane and reaches beyond all other geoms to every other side."""
        R, p = self.data.geom_xmat[g].reshape(3, 3), self.data.geom_xpos[g]
        box = (vertices - p) @ R
        others = [h for h in self.solid if self.model.body_weldid[self.model.geom_bodyid[h]]]
        centers = (self.data.geom_xpos[others] - p) @ R
        below = (centers[:, :2] > box[:, :2].min(axis=0)) & (centers[:, :2] < box[:, :2].max(axis=0))
        return bool(abs(box[:, 2].max()) < EXACT and below.all() and (centers[:, 2] > box[:, 2].min()).all())

    def _farthest(self, g: int, directions: Array) -> Array:
        """Returns the points of a geom, (k, 3), that are farthest in directions, in the world."""
        model, size = self.model, self.model.geom_size[g]
        R, p = self.data.geom_xmat[g].reshape(3, 3), self.data.geom_xpos[g]
        d = directions @ R
        match _KINDS[model.geom_type[g]]:
            case "sphere":
                points = size[0] * d
            case "capsule":
                points = size[0] * d + np.outer(np.sign(d[:, 2]) * size[1], [0, 0, 1])
            case "cylinder":
                ring = d[:, :2] / np.maximum(np.linalg.norm(d[:, :2], axis=1), 1e-300)[:, None]
                points = np.column_stack([size[0] * ring, np.sign(d[:, 2]) * size[1]])
            case "box":
                points = np.sign(d) * size
            case "ellipsoid":
                points = d * size**2 / np.linalg.norm(d * size, axis=1)[:, None]
            case _:
                mesh = model.geom_dataid[g]
                vertices = model.mesh_vert[model.mesh_vertadr[mesh] :][: model.mesh_vertnum[mesh]].astype(float)
                points = vertices[(d @ vertices.T).argmax(axis=1)]
        return points @ R.T + p

    def _matched(self, fitting: dict[int, list[Geometry]]) -> dict[int, Geometry]:
        """Returns a geometry of its own for every geom, as far as there is one."""
        found: dict[int, Geometry] = {}
        for g, ours in sorted(fitting.items(), key=lambda item: len(item[1])):
            free = [geometry for geometry in ours if geometry not in found.values()]
            if free:
                found[g] = free[0]
            else:
                self.found.append(f"no geometry of the scene is geom {g} {self.model.geom(g).name}")
        return found

    def _pairs(self, ours: dict[int, Geometry], touching: set[tuple[int, int]]) -> None:
        """Compares pairs: what MuJoCo may let collide is a pair, or two bodies that a joint connects or that never move."""
        tree = Tree(list(self.scene.joints), [body for body in self.scene.bodies if body != WORLD])
        pairs = {frozenset((pair.a, pair.b)) for pair in self.scene.pairs}
        neighbours = {frozenset((joint.parent, joint.child)) for joint in self.scene.joints}
        for one, other in combinations(ours, 2):
            a, b = ours[one], ours[other]
            rigid = tree.group[a.body] == tree.group[b.body]
            known = rigid or frozenset((a.body, b.body)) in neighbours or frozenset((a.name, b.name)) in pairs
            if not known and (self._may_collide(one, other) or tuple(sorted((one, other))) in touching):
                self.found.append(f"{a.name} and {b.name} may collide and are no pair")

    def _may_collide(self, one: int, other: int) -> bool:
        """Says what MuJoCo's filters say, https://mujoco.readthedocs.io/en/stable/computation/index.html#selection."""
        model = self.model
        if {one, other} in [{*pair} for pair in zip(model.pair_geom1, model.pair_geom2, strict=True)]:
            return True
        bodies = [model.geom_bodyid[g] for g in (one, other)]
        welds = [model.body_weldid[body] for body in bodies]
        parents = [model.body_weldid[model.body_parentid[weld]] for weld in welds]
        excluded = (min(bodies) << 16) + max(bodies) in model.exclude_signature
        filtered = all(welds) and (welds[0] == parents[1] or welds[1] == parents[0])
        bits = model.geom_contype[one] & model.geom_conaffinity[other] or model.geom_contype[other] & model.geom_conaffinity[one]
        return bool(bits and welds[0] != welds[1] and not excluded and not filtered)
