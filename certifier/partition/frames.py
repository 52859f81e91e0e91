"""The body whose frame the planes of a pair are in is chosen here: the one in which neither volume sweeps far.

A joint turns a volume about its axis, and a plane that is affine in s follows that the worse, the farther the volume reaches from the
axis. So each joint between the volumes is better on the side of the volume that reaches less far from it: a joint of the arm moves the
hand against the table, and not the table against the hand.
"""

from __future__ import annotations

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import Array, Joint, JointKind, Volume

MOST_JOINTS = 6
"""At most this many joints are between the frame and either volume, where that is possible: k joints make 4^k control values."""
CONFIGURATIONS = 64
"""How far volumes reach is measured at this many configurations of the root cell."""


def choose_frame(kinematics: Kinematics, volumes: tuple[Volume, Volume], lower: Array, upper: Array) -> tuple[str, list[int]]:
    """Returns the frame of the planes of two volumes, and the position indices of the joints between them, ascending.

    Args:
        lower, upper: (n,) the root cell.
    """
    a, b = volumes
    # Slides are sampled as if they turned, too: which frame a proof has depends on these configurations.
    s = np.tan(np.random.default_rng(0).uniform(np.arctan(lower), np.arctan(upper), size=(CONFIGURATIONS, len(lower))))
    joints = [joint for joint, _ in kinematics.joints(a.body, b.body) if joint.index is not None]
    reach = {(joint.index, volume.body): _reach(kinematics, joint, volume, s) for joint in joints for volume in volumes}

    def cost(frame: str) -> tuple[int, float]:
        chains = [(volume.body, kinematics.chain(frame, volume.body)) for volume in volumes]
        longest = max(len(chain) for _, chain in chains)
        return max(longest - MOST_JOINTS, 0), sum(reach[j, body] for body, chain in chains for j in chain)

    return min(kinematics.frames(a.body, b.body), key=cost), sorted(kinematics.chain(a.body, b.body))


def _reach(kinematics: Kinematics, joint: Joint, volume: Volume, s: Array) -> float:
    """Returns how far a volume reaches from a joint's axis at the configurations, in metres; 0 for a joint that does not turn."""
    X = np.linalg.inv(joint.X_BM)
    points = kinematics.points(joint.child, volume.body, volume.vertices, s).reshape(-1, 3) @ X[:3, :3].T + X[:3, 3]
    return float(np.linalg.norm(np.cross(joint.axis, points), axis=1).max()) + volume.radius if joint.kind is JointKind.REVOLUTE else 0.0
