"""The reference frame of a pair (C-IRIS B.1) and the joints that its plane moves with are chosen here.

Each side of a pair costs about (vertices) x N(k)^2 x (faces). N is the dimension of B.2 with the k joints between frame and body. So
the frame sits in the middle of the chain, nearer to the body with more vertices.

Through two arms the chains become long whatever the frame. A plane at rest in the body at which the arms part does not depend on the
other chain's joints and keeps degree 2 in its own, so N = 3^k. It is tried first where it is much cheaper. It is tried alone where a
plane that moves would be too dear.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

from certifier.conic.basis import dimension
from certifier.kinematics import Kinematics
from certifier.model import Volume

AFFORDABLE = 16 << 20
"""A plane that moves is tried at once up to this many bytes; above, a plane at rest is tried first if it takes less than half of them."""
LARGEST = 256 << 20
"""A plane that moves is not tried if it takes more bytes than this; by then it takes half a minute or more."""


@dataclass(frozen=True)
class Frame:
    """Holds the frame body F of a pair and the chains from it to both sides.

    Attributes:
        body: the frame body F.
        chain_a, chain_b: position indices of the joints from F to either body, ascending.
        joints: position indices of the joints that the plane moves with: all of both chains, or none.
    """

    body: str
    chain_a: tuple[int, ...]
    chain_b: tuple[int, ...]
    joints: tuple[int, ...]

    @property
    def path(self) -> tuple[int, ...]:
        """Returns all joints between the two bodies, ascending."""
        return tuple(sorted((*self.chain_a, *self.chain_b)))

    @property
    def at_rest(self) -> bool:
        """Returns whether there are joints between the bodies and the plane moves with none of them."""
        return bool(self.path) and not self.joints

    @property
    def dimensions(self) -> tuple[int, int]:
        """Returns N of either side, as long as only faces in the joints of the path are used."""
        joints = len(self.path)
        return self._dimension(len(self.chain_a), joints), self._dimension(len(self.chain_b), joints)

    def growth(self, n: int) -> float:
        """Returns the factor by which the cost grows when all n joints of the scene come into play."""
        whole = [self._dimension(len(chain), n) for chain in (self.chain_a, self.chain_b)]
        return sum(N**2 for N in whole) / sum(N**2 for N in self.dimensions)

    def _dimension(self, k: int, joints: int) -> int:
        return dimension(k, 0, 0) if self.at_rest else dimension(k, k, joints - k)

    def memory(self, volumes: tuple[Volume, Volume]) -> int:
        """Returns the bytes of the program's factors and columns."""
        columns = 2 * (4 * len(self.joints) + 5)
        return sum(8 * len(volume.vertices) * N * (N + columns) for volume, N in zip(volumes, self.dimensions, strict=True))

    @property
    def tables(self) -> int:
        """Returns the bytes of the products of the functions of either chain at its points (certifier.conic.cone)."""
        found = 0
        for k in (len(self.chain_a), len(self.chain_b)):
            products = 4**k + k * 4**k // 4 if self.at_rest else 4**k
            found += 8 * self._dimension(k, k) * products
        return found


def frames_to_try(kinematics: Kinematics, volumes: tuple[Volume, Volume]) -> list[Frame]:
    """Returns the frames to try for two volumes, one after the other until one has a plane."""
    moving, resting = choose_frame(kinematics, volumes), _resting(kinematics, *(volume.body for volume in volumes))
    if {*resting.chain_a} & {*resting.chain_b}:
        return [moving]
    if moving.memory(volumes) <= max(AFFORDABLE, 2 * resting.memory(volumes)):
        return [moving]
    return [resting, moving] if moving.memory(volumes) <= LARGEST else [resting]


def choose_frame(kinematics: Kinematics, volumes: tuple[Volume, Volume]) -> Frame:
    """Returns the cheapest frame on the path between the two volumes' bodies; its plane moves with the whole path.

    The cost counts all joints as in play, which also balances the chains well. Of equally cheap frames the one nearer to a is taken.
    """
    a, b = volumes
    return _cheapest(kinematics, a.body, b.body, len(a.vertices), len(b.vertices))


@lru_cache(maxsize=4096)
def _cheapest(kinematics: Kinematics, a: str, b: str, vertices_a: int, vertices_b: int) -> Frame:
    def cost(frame: Frame) -> int:
        sides = ((vertices_a, len(frame.chain_a)), (vertices_b, len(frame.chain_b)))
        return sum(vertices * dimension(k, k, kinematics.scene.n - k) ** 2 for vertices, k in sides)

    return min((_frame(kinematics, body, a, b) for body in kinematics.frames(a, b)), key=cost)


@lru_cache(maxsize=4096)
def _resting(kinematics: Kinematics, a: str, b: str) -> Frame:
    """Returns the body at which the chains of the two bodies part, with a plane that rests there."""
    return replace(_frame(kinematics, kinematics.common(a, b), a, b), joints=())


def _frame(kinematics: Kinematics, frame: str, a: str, b: str) -> Frame:
    chain_a, chain_b = (tuple(sorted(kinematics.chain(frame, body))) for body in (a, b))
    return Frame(frame, chain_a, chain_b, tuple(sorted((*chain_a, *chain_b))))
