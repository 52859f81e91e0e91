"""A small producer of proofs over partitions, for tests: cells by halving, planes by linear programs on samples, multipliers by linear
programs on control values. It knows nothing of the producer that certifies."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import linprog

from certifier.errors import RegionError
from certifier.kinematics import Kinematics
from certifier.model import Pair, Polytope, Scene, Volume
from certifier.polytopes.polytope import chebyshev_center
from certifier.polytopes.sampling import hit_and_run
from certifier.proof.ground import Ground
from certifier.proof.partition import EMPTY, PLANE, PartitionProof

DEPTH = 8
MARGIN = 1e-7


@dataclass
class Streams:
    """The streams of a proof that is being made."""

    nodes: list[int] = field(default_factory=list)
    cuts: list[float] = field(default_factory=list)
    planes: list[np.ndarray] = field(default_factory=list)
    choices: list[int] = field(default_factory=list)
    pieces: list[int] = field(default_factory=list)
    multipliers: list[list[tuple[int, float]]] = field(default_factory=list)

    def extend(self, other: Streams) -> None:
        for name in vars(self):
            getattr(self, name).extend(getattr(other, name))

    def proof(self, scene, volumes, frame, ground, interior, coarse, play) -> PartitionProof:
        flat = [entry for entries in self.multipliers for entry in entries]
        return PartitionProof(
            scene,
            volumes,
            frame,
            ground,
            interior,
            coarse,
            np.array(self.nodes, dtype=np.int8),
            np.array(self.cuts, dtype=float),
            np.array(self.planes, dtype=float).reshape(-1, 5, 1 + len(play)),
            np.array(self.choices, dtype=np.int8),
            np.array(self.pieces, dtype=np.int8),
            np.array([len(entries) for entries in self.multipliers], dtype=np.int16),
            np.array([face for face, _ in flat], dtype=np.int16),
            np.array([value for _, value in flat], dtype=np.float32),
        )


class Producer:
    """Makes the proof of one pair on {C s <= d} within the box mid +- half, whose 2n faces come first among the rows.

    Every cell takes the first of the choices that has a plane, coarse volumes before others.
    """

    def __init__(self, scene: Scene, pair: Pair, frame: str, mid, half, C=None, d=None, interior=None, coarse=((), ())) -> None:
        n = scene.n
        self.scene, self.frame = scene, frame
        self.volumes = tuple(Volume.of(scene.geometry(name)) for name in (pair.a, pair.b))
        mid, half = (np.broadcast_to(np.asarray(x, dtype=float), (n,)).copy() for x in (mid, half))
        box = Ground.of_box(mid, half)
        more = 0 if C is None else len(d)
        C, d = (box.C, box.d) if C is None else (np.concatenate([box.C, C]), np.concatenate([box.d, d]))
        Y = [np.insert(Y, [2 * n] * more, 0.0, axis=1) for Y in (box.Y_lower, box.Y_upper)]
        self.ground = Ground(C, d, mid, half, *Y)
        self.lower, self.upper = np.nextafter(mid - half, np.inf), np.nextafter(mid + half, -np.inf)
        self.kinematics = Kinematics.of(scene)
        self.interior = chebyshev_center(Polytope(C, d))[0] if interior is None else interior
        self.coarse = coarse
        alternatives = [(fine, *others) for fine, others in zip(self.volumes, coarse, strict=True)]
        self.play = sorted({j for v in (*alternatives[0], *alternatives[1]) for j in self.kinematics.chain(frame, v.body)})
        self.chosen = {i + len(alternatives[0]) * j: (a, b) for i, a in enumerate(alternatives[0]) for j, b in enumerate(alternatives[1])}

    def proof(self, depth: int = DEPTH, least: int = 0, halvings: int = 0) -> PartitionProof | None:
        """The proof, with cells cut and pieces halved at least this many times; None where ``depth`` cuts are not enough."""
        self._halvings = halvings
        found = self._cell(self.lower, self.upper, depth, least)
        return found and found.proof(self.scene, self.volumes, self.frame, self.ground, self.interior, self.coarse, self.play)

    def _cell(self, lower, upper, depth: int, least: int, turn: int = 0) -> Streams | None:
        leaf = self._leaf(lower, upper) if turn >= least else None
        if leaf is not None or depth == 0:
            return leaf
        joint = self.play[turn % len(self.play)]
        cut = 0.5 * (lower[joint] + upper[joint]) + 0.01 * (upper[joint] - lower[joint])
        streams = Streams([joint], [float(cut)])
        for side in (0, 1):
            low, up = lower.copy(), upper.copy()
            (low if side else up)[joint] = cut
            part = self._cell(low, up, depth - 1, least, turn + 1)
            if part is None:
                return None
            streams.extend(part)
        return streams

    def _leaf(self, lower, upper) -> Streams | None:
        n, (C, d) = self.scene.n, (self.ground.C, self.ground.d)
        rows, ends = np.concatenate([C, np.eye(n), -np.eye(n)]), np.concatenate([d, upper, -lower])
        try:
            center, radius = chebyshev_center(Polytope(rows, ends))
        except RegionError:
            radius = -1.0
        if not radius > 1e-9:
            return self._missing(lower, upper)
        samples = hit_and_run(Polytope(rows, ends), center, 120, 0)
        found = (self._separated(choice, samples, lower, upper) for choice in sorted(self.chosen, reverse=True))
        return next((streams for streams in found if streams is not None), None)

    def _separated(self, choice: int, samples, lower, upper) -> Streams | None:
        volumes = self.chosen[choice]
        Z = self._plane(volumes, samples, lower, upper)
        if Z is None:
            return None
        kappa = self.kappa(Z, lower, upper)
        streams = Streams([PLANE], [], [np.vstack([Z, [kappa, *np.zeros(len(self.play))]])], [choice])
        for side, volume in enumerate(volumes):
            for v in volume.vertices:
                if not self._pieces(streams, Z, kappa, side, volume, v, lower, upper):
                    return None
        return streams

    def _missing(self, lower, upper) -> Streams | None:
        """Multipliers with -lambda'd + min over the cell of lambda'C s > 0."""
        C, d = self.ground.C, self.ground.d
        m, n = C.shape
        mid, half = 0.5 * (lower + upper), 0.5 * (upper - lower)
        # lambda, then x >= |lambda'C|
        cost = np.concatenate([d - C @ mid, half])
        limits = np.block([[C.T, -np.eye(n)], [-C.T, -np.eye(n)], [np.ones((1, m)), np.zeros((1, n))]])
        found = linprog(cost, limits, np.concatenate([np.zeros(2 * n), [1.0]]), bounds=(0, None))
        return Streams([EMPTY], multipliers=[_entries(found.x[:m])]) if found.fun < -MARGIN else None

    def _plane(self, volumes, samples, lower, upper):
        """The coefficients of largest margin at the samples, all at most 1 in magnitude in centred coordinates."""
        k, play = len(self.play), self.play
        mid, half = 0.5 * (lower + upper)[play], 0.5 * (upper - lower)[play]
        u = np.column_stack([np.ones(len(samples)), (samples[:, play] - mid) / half])
        corners = np.column_stack([np.ones(2**k), np.array(list(itertools.product((-1.0, 1.0), repeat=k))).reshape(2**k, k)])
        rows = []
        for side, volume in enumerate(volumes):
            p = self.kinematics.points(self.frame, volume.body, volume.vertices, samples)
            h = np.concatenate([p, np.ones((*p.shape[:2], 1))], axis=2)
            f = (1 - 2 * side) * np.einsum("svr,se->svre", h, u).reshape(-1, 4 * (1 + k))
            # margin + r kappa - f <= 0
            rows.append(np.column_stack([-f, np.full(len(f), volume.radius + self.scene.padding), np.ones(len(f))]))
        signs = np.array(list(itertools.product((-1.0, 1.0), repeat=3)))
        bound = np.einsum("ir,ce->icre", np.column_stack([signs, np.zeros(8)]), corners).reshape(-1, 4 * (1 + k))
        rows.append(np.column_stack([bound, -np.ones(len(bound)), np.zeros(len(bound))]))
        A = np.concatenate(rows)
        cost = np.zeros(A.shape[1])
        cost[-1] = -1.0
        found = linprog(cost, A, np.zeros(len(A)), bounds=[(-1, 1)] * (4 * (1 + k)) + [(0, None), (None, None)])
        if found.status != 0 or found.x[-1] < 1e-4:
            return None
        U = found.x[:-2].reshape(4, 1 + k)
        Z = U.copy()
        Z[:, 1:] = U[:, 1:] / half
        Z[:, 0] = U[:, 0] - Z[:, 1:] @ mid
        return Z

    def kappa(self, Z, lower, upper) -> float:
        corners = itertools.product(*zip(lower[self.play], upper[self.play], strict=True))
        return max(float(np.linalg.norm(Z[:3] @ [1.0, *corner])) for corner in corners) * (1 + 1e-9)

    def _pieces(self, streams: Streams, Z, kappa: float, side: int, volume, v, lower, upper) -> bool:
        """Adds the tree of pieces of one vertex; whether there is one."""
        own = sorted(self.kinematics.chain(self.frame, volume.body))
        axes = [*own, *(j for j in self.play if j not in own)]
        ranges = {j: [self._end(j, lower[j]), self._end(j, upper[j])] for j in own}
        outs = {j: (0.5 * (lower[j] + upper[j]), 0.5 * (upper[j] - lower[j])) for j in axes[len(own) :]}
        return self._piece(streams, (Z, kappa, side, volume, v), axes, dict.fromkeys(own, (0.0, 1.0)), ranges, outs, DEPTH)

    def _end(self, j: int, s: float):
        return (s, 1 / np.sqrt(1 + s * s)) if self.scene.revolute[j] else (s, 1.0)

    def _piece(self, streams: Streams, vertex, axes, parts, ranges, outs, depth: int) -> bool:
        for z0 in (0, 1) if depth <= DEPTH - self._halvings else ():
            entries = self._multipliers(vertex, parts, ranges, outs, z0)
            if entries is not None:
                streams.pieces.append(PLANE if z0 else EMPTY)
                streams.multipliers.append(entries)
                return True
        if depth == 0:
            return False
        axis = depth % len(axes)
        streams.pieces.append(axis)
        j = axes[axis]
        for side in (0, 1):
            new_parts, new_outs = dict(parts), dict(outs)
            if j in parts:
                a, b = parts[j]
                new_parts[j] = (0.5 * (a + b), b) if side else (a, 0.5 * (a + b))
            else:
                m, h = outs[j]
                new_outs[j] = (m + h / 2 if side else m - h / 2, h / 2)
            if not self._piece(streams, vertex, axes, new_parts, ranges, new_outs, depth - 1):
                return False
        return True

    def _multipliers(self, vertex, parts, ranges, outs, z0: int):
        """Multipliers that make all control values positive, by interpolating the polynomials on a grid, or None."""
        Z, kappa, side, volume, v = vertex
        own, C, d = list(parts), self.ground.C, self.ground.d
        m, N = len(d), 4 ** len(own)
        grid = np.array(list(itertools.product(np.linspace(0, 1, 4), repeat=len(own)))).reshape(N, len(own))
        s, scale = np.zeros((N, self.scene.n)), np.ones(N)
        for column, j in enumerate(own):
            (l, w0), (u, w1) = ranges[j]
            a, b = parts[j]
            t = a + (b - a) * grid[:, column]
            weight = (1 - t) * w0 + t * w1
            s[:, j] = ((1 - t) * w0 * l + t * w1 * u) / weight
            scale *= weight**3
        X = self.kinematics.numerators(self.frame, volume.body, s)
        basis, line = np.ones((1, 1)), np.array([[_bernstein(i, x) for i in range(4)] for x in np.linspace(0, 1, 4)])
        for _ in own:
            basis = np.kron(basis, line)
        den = X[:, 3, 3] * scale
        # den is of degree 2 in each own joint after the weights' squares; the third power of the weight makes degree 3.

        def control(values):
            return np.linalg.solve(basis, values)

        p = (X @ np.append(v, 1.0)) * scale[:, None]
        sign = 1 - 2 * side
        column = {j: 1 + i for i, j in enumerate(self.play)}
        constant = Z[:, 0] + sum((Z[:, column[j]] * mid for j, (mid, _) in outs.items()), np.zeros(4))
        f = sign * (p @ constant + sum((p @ Z[:, column[j]]) * s[:, j] for j in own)) - (volume.radius + self.scene.padding) * kappa * den
        c0, D = control(f), control(den)
        T = {j: control(den * s[:, j]) for j in own}
        c = {j: control(sign * (p @ Z[:, column[j]]) * half) for j, (_, half) in outs.items()}
        others = [j for j in range(self.scene.n) if j not in self.play]
        omid, ohalf = self.ground.mid[others], self.ground.half[others]
        # variables: lambda, x_other >= |S|, y_(o, alpha) >= |...|, margin
        count = m + len(others) + len(outs) * N + 1
        A, b = [], []
        rows = np.zeros((N, count))
        rows[:, :m] = np.outer(D, d - C[:, others] @ omid - sum((C[:, j] * mid for j, (mid, _) in outs.items()), np.zeros(m)))
        rows[:, :m] -= sum((np.outer(T[j], C[:, j]) for j in own), np.zeros((N, m)))
        rows[:, m : m + len(others)] = np.outer(D, ohalf)
        for i in range(len(outs)):
            rows[range(N), m + len(others) + i * N + np.arange(N)] = 1.0
        rows[:, -1] = np.abs(D)
        A.append(rows)
        b.append(z0 * c0)
        for i, j in enumerate(others):
            for way in (1, -1):
                row = np.zeros((1, count))
                row[0, :m], row[0, m + i] = way * C[:, j], -1.0
                A.append(row)
                b.append(np.zeros(1))
        for i, j in enumerate(outs):
            for way in (1, -1):
                rows = np.zeros((N, count))
                rows[:, :m] = way * np.outer(D, C[:, j]) * outs[j][1]
                rows[range(N), m + len(others) + i * N + np.arange(N)] = -1.0
                A.append(rows)
                b.append(-way * z0 * c[j])
        cost = np.zeros(count)
        cost[-1] = -1.0
        bounds = [(0, 100.0)] * m + [(0, None)] * (count - m - 1) + [(None, 1.0)]
        found = linprog(cost, np.concatenate(A), np.concatenate(b), bounds=bounds)
        return _entries(found.x[:m]) if found.status == 0 and found.x[-1] > MARGIN * 10 else None


def _bernstein(i: int, t: float) -> float:
    return (1, 3, 3, 1)[i] * t**i * (1 - t) ** (3 - i)


def _entries(values) -> list[tuple[int, float]]:
    return [(j, float(np.float32(x))) for j, x in enumerate(values) if x > 1e-9]
