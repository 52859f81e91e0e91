"""The tree of a partition is read back from its streams as it was, whatever volumes its leaves choose."""

from __future__ import annotations

import numpy as np

from certifier.kinematics import Kinematics
from certifier.model import WORLD
from certifier.partition.coarse import capsule
from certifier.partition.tree import Node
from certifier.proof.partition import STREAMS
from tests.certifier.scenes import box, planar_arm
from tests.certifier.verify.partitions import Producer


def test_streams_are_read_back():
    scene = planar_arm(2, box("world/obstacle", WORLD, (0.3, 0.3, 0.3), (1.7, 0.8, 0.0)))
    coarse = capsule(Kinematics.of(scene), scene.geometry("arm/link2/bar"))
    proof = Producer(scene, scene.pairs[1], WORLD, [-0.2, -0.3], [0.25, 0.3], coarse=(coarse, None)).proof(least=2)
    assert set(proof.choices.tolist()) == {0, 1}
    streams = {name: getattr(proof, name) for name in STREAMS}
    root = Node.of_streams(streams, {choice: sum(len(volume.vertices) for volume in both) for choice, both in proof.chosen.items()})
    again = root.to_streams(2)
    assert {name: array.tobytes() for name, array in again.items()} == {name: array.tobytes() for name, array in streams.items()}
    np.testing.assert_array_equal([node.choice for node in root.preorder() if node.plane is not None], proof.choices)
