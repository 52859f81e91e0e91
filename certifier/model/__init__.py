"""A scene as numbers: joints, bodies, convex geometries and pairs; and polytopes of its configurations.

A :class:`Scene` is self-contained: nobody needs a robot file, a mesh or Drake to use it. The content hash, the kinematics, the proofs and
the verifier all refer to it. Drake's parsed doubles are taken as exact numbers.

Monogram notation: X_PF is the pose of frame F measured in frame P, and p_BV is the position of point V in frame B.
"""

from certifier.model.bodies import WORLD, Geometry, Ignored, Pair
from certifier.model.joints import Array, ConfigurationSpace, Joint, JointKind
from certifier.model.names import ALPHABET, MAX_NAME, MAX_SENTENCE, escaped, is_name, is_sentence
from certifier.model.polytope import Box, Polytope, StoredRegion
from certifier.model.scene import SCHEMA_VERSION, Scene
from certifier.model.volume import Volume

__all__ = [
    "ALPHABET",
    "MAX_NAME",
    "MAX_SENTENCE",
    "SCHEMA_VERSION",
    "WORLD",
    "Array",
    "Box",
    "ConfigurationSpace",
    "Geometry",
    "Ignored",
    "Joint",
    "JointKind",
    "Pair",
    "Polytope",
    "Scene",
    "StoredRegion",
    "Volume",
    "escaped",
    "is_name",
    "is_sentence",
]
