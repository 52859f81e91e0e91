"""A certified region gets its proof file and its manifest here (docs/architecture.md, "Manifest")."""

from __future__ import annotations

from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from certifier.growth.actions import Candidate
from certifier.growth.obstacles import in_manifest
from certifier.jobs.archimedean import archimedean
from certifier.jobs.share import SampledProposal
from certifier.model import SCHEMA_VERSION, Array, Polytope, Scene
from certifier.outcome import Guarantee
from certifier.polytopes.ellipsoid import inscribed_ellipsoid, volume, volume_in_q
from certifier.polytopes.polytope import bounds, chebyshev_center, support, without_redundant
from certifier.polytopes.width import least_width_in_q
from certifier.proof.region import Implied, RegionProof, read_part
from certifier.proof.separation import Separation, digest
from certifier.verify import uncovered
from certifier.verify.region import RegionStatement, verify_region
from certifier.verify.separations import Progress

SUMMARY = ("q_volume", "share")
"""What lists of regions show of the manifest, in events, rows and answers of the API."""


@dataclass(frozen=True)
class Region:
    """A region is a polytope whose proof has been verified.

    Attributes:
        manifest: JSON-able; the caller adds ``seconds`` and the proof's path.
        proof: the portable proof file.
        statement: what the verifier says that the proof proves.
        reason: why growing ended, in a sentence; empty while it goes on.
    """

    manifest: dict[str, Any]
    proof: bytes
    statement: RegionStatement
    reason: str = ""

    @property
    def summary(self) -> dict[str, Any]:
        """Returns what lists show of the manifest."""
        return {name: self.manifest[name] for name in SUMMARY}


def certified_region(
    scene: Scene,
    candidate: Candidate,
    proofs: dict[int, bytes],
    provenance: dict[str, Any],
    proposal: SampledProposal | None = None,
    processes: int = 1,
    progress: Progress | None = None,
    last: Region | None = None,
) -> Region:
    """Assembles a region from its pairs' proofs, verifies the whole, and describes it.

    Args:
        proofs: pair index -> proof file, for every pair of the scene but those that the candidate has together with others.
        provenance: options, versions, growth curve, and the seconds of the whole job, of the seeding and of all pairs.
        proposal: what the region was grown from; None for a given polytope.
        processes: how many processes verify.
        progress: receives how many of how many parts they have checked.
        last: a region that was made here before. A proof file that is the same as its one is not verified again.

    Raises:
        ProofError: the proof does not hold; nothing may be served as certified then.
        RegionError: the polytope is empty or unbounded.
    """
    proofs = proofs | {other: proofs[index] for index, others in candidate.together.items() for other in others}
    polytope = without_redundant(candidate.polytope, fixed=2 * scene.n)
    C, d = polytope.C, polytope.d
    interior = chebyshev_center(polytope)[0] if candidate.center is None else candidate.center
    bound = archimedean(polytope)
    parts = tuple(read_part(data, scene) for data in dict.fromkeys(proofs[index] for index in range(len(scene.pairs))))
    data = RegionProof(scene, C, d, interior, _implied(polytope, parts), bound, parts).to_bytes()
    statement = last.statement if last is not None and last.proof == data else verify_region(data, processes, progress)
    ellipsoid = inscribed_ellipsoid(polytope)
    in_s = volume(polytope, seed=0)
    between = statement.between_bodies  # What stands for a condition has no distance in metres.
    manifest = {
        "schema_version": SCHEMA_VERSION,
        "scene": {"name": scene.name, "hash": scene.hash, "directives": scene.provenance.get("directives")},
        "space": {
            "kind": "tangent",
            "joints": [joint.name for joint in scene.moving],
            "revolute": scene.revolute.tolist(),
            "q_star": scene.q_star.tolist(),
            "q_lower": scene.q_lower.tolist(),
            "q_upper": scene.q_upper.tolist(),
            "s_lower": scene.s_lower.tolist(),
            "s_upper": scene.s_upper.tolist(),
        },
        **_halfspaces(polytope),
        "bounding_box": {"lower": bound.lower.tolist(), "upper": bound.upper.tolist()},
        "interior_point": interior.tolist(),
        "inscribed_ellipsoid": {"center": ellipsoid.center.tolist(), "shape": ellipsoid.shape.tolist()},
        "joint_ranges": _joint_ranges(scene, polytope, candidate.seed),
        "q_volume": _q_volume(scene, polytope, volume_in_q(polytope, scene, in_s, seed=0)),
        "volume": {"ellipsoid": ellipsoid.volume, "polytope": in_s[0], "polytope_stderr": in_s[1]},
        "share": None if proposal is None else proposal.share(polytope),
        "seed": None if candidate.seed is None else scene.to_q(candidate.seed).tolist(),
        "pairs": [
            {
                "a": p.a,
                "b": p.b,
                "padding": scene.padding_of(p),
                "outcome": "certified",
                "proved_distance": gap,
                "margin": gap,
                "proof_digest": digest(proofs[index]),
            }
            for index, p in enumerate(scene.pairs)
            for gap in [between.get(p)]
        ],
        "conditions": [{"name": one.name, "kind": one.kind, "statement": str(one)} for one in scene.conditions],
        "ignored": [{"a": i.a, "b": i.b, "reason": i.reason} for i in scene.ignored],
        "not_covered": uncovered.document(scene),
        "padding": scene.padding,
        "archimedean": {"N": bound.N},
        "guarantee": Guarantee.EXACT.value,
        "provenance": {
            **provenance,
            "proposal": None if proposal is None else _halfspaces(proposal.polytope),
            "cuts": in_manifest(scene, candidate.obstacles),
        },
    }
    return Region(manifest, data, statement)


def _q_volume(scene: Scene, polytope: Polytope, measured: tuple[float, float]) -> dict[str, Any]:
    """Returns a volume in joint positions as the manifest says it: ``value`` in ``unit``, and ``stderr``.

    ``box_side`` says it in degrees: a box with sides of that length in every joint has this volume. ``least_width`` says in degrees how
    thin the polytope is: in some direction, no straight motion within it is longer. They are None for arms with joints that slide, where
    lengths in joint space are no angles.
    """
    value, error = measured
    each = scene.units
    units = [f"{unit}^{each.count(unit)}" if each.count(unit) > 1 else unit for unit in ("rad", "m") if unit in each]
    widths = None if "m" in each else np.rad2deg([value ** (1 / scene.n), least_width_in_q(polytope, scene)])
    side, least = (None, None) if widths is None else map(float, widths)
    return {"value": value, "stderr": error, "unit": " ".join(units), "box_side": side, "least_width": least}


def _joint_ranges(scene: Scene, polytope: Polytope, seed: Array | None) -> dict[str, dict[str, Any]]:
    """Returns how far each joint moves within the polytope: name -> ``lower``, ``upper`` and their ``unit``, degrees or metres.

    The bounds come from linear programs. A joint reaches them, though seldom all joints at once. ``through_seed`` is how far it moves while
    the others stay at the seed, [lower, upper]; None without a seed.

    Raises:
        RegionError: as :func:`certifier.polytopes.polytope.bounds`.
    """
    lower, upper = (scene.to_q(s) for s in bounds(polytope))
    shown = [joint.shown for joint in scene.moving]
    alone = [None] * scene.n if seed is None else _through(scene, polytope, seed)
    return {
        joint.name: {
            "lower": float(scale * low),
            "upper": float(scale * high),
            "unit": unit,
            "through_seed": None if ends is None else [float(scale * end) for end in ends],
        }
        for joint, (unit, scale), low, high, ends in zip(scene.moving, shown, lower, upper, alone, strict=True)
    }


def _through(scene: Scene, polytope: Polytope, seed: Array) -> list[tuple[float, float] | None]:
    """Returns the positions between which each joint moves while the others stay at the seed, in s, as q."""
    slack = polytope.d - polytope.C @ seed
    found: list[tuple[float, float] | None] = []
    for i in range(scene.n):
        slope = polytope.C[:, i]
        ends = []
        for sign in (-1.0, 1.0):
            towards = sign * slope > 0
            s = seed.copy()
            s[i] += sign * (slack[towards] / (sign * slope[towards])).min()
            ends.append(float(scene.to_q(s)[i]))
        found.append((ends[0], ends[1]))
    return found


def growth_point(iteration: int, seconds: float, ellipsoid_volume: float | None, share: float | None) -> dict[str, Any]:
    """Returns a point of the manifest's growth curve: an iteration that resulted in a region ``seconds`` after the job began."""
    return {"iteration": iteration, "seconds": seconds, "ellipsoid_volume": ellipsoid_volume, "share": share}


def versions(scene: Scene) -> dict[str, Any]:
    """Returns the versions that a region's provenance names."""

    def of(package: str) -> str | None:
        try:
            return version(package)
        except PackageNotFoundError:
            return None

    return {"ciris": of("ciris"), "drake": scene.provenance.get("drake") or of("drake"), "python-flint": of("python-flint")}


def _halfspaces(polytope: Polytope) -> dict[str, Any]:
    return {"halfspace_normals": polytope.C.tolist(), "halfspace_offsets": polytope.d.tolist()}


def _implied(polytope: Polytope, proofs: tuple[Separation, ...]) -> Implied:
    """Returns the faces of the proofs' polytopes that are not, or no longer, faces of the region, with their bounds and multipliers.

    A face that is gone may share its normal with a joint limit, so offsets are compared as well.
    """
    own: dict[bytes, float] = {}
    for c, d in zip(polytope.C + 0.0, polytope.d, strict=True):
        own[c.tobytes()] = min(d, own.get(c.tobytes(), np.inf))
    faces = ((c, d) for proof in proofs for c, d in zip(proof.ground.C + 0.0, proof.ground.d, strict=True))
    rows = {c.tobytes(): c for c, d in faces if own.get(c.tobytes(), np.inf) > d}
    found = [(c, *support(polytope, c)) for c in rows.values()]
    m, n = polytope.C.shape
    return Implied(
        np.array([c for c, _, _ in found]).reshape(-1, n),
        np.array([bound for _, bound, _ in found]),
        np.array([y for _, _, y in found]).reshape(-1, m),
    )
