"""The cones of certifier.conic.arrow as semidefinite constraints, for an oracle."""

from __future__ import annotations

import numpy as np


def add_rationals(program, group, z, y):
    """constant + local z + coupled y in K for every rational of the group: its coordinates are those of a sum of squares."""
    for block in group.blocks:
        cone = block.cone
        ((K, L, _),) = (part.shape for part in cone.parts)
        for constant, local, coupled in zip(*block.columns(), strict=True):
            columns, variables = [], []
            for j in range(K):
                Q = program.NewSymmetricContinuousVariables(L) if L > 1 else program.NewContinuousVariables(1, 1)
                program.AddPositiveSemidefiniteConstraint(Q) if L > 1 else program.AddBoundingBoxConstraint(0, np.inf, Q)
                for row, col in np.ndindex(L, L):
                    unit = np.zeros((1, K, L, L))
                    unit[0, j, row, col] = 1.0
                    columns.append(cone.values([unit])[0])
                    variables.append(Q[row, col])
            matrix = np.column_stack([*columns, -local, -coupled])
            program.AddLinearEqualityConstraint(matrix, constant, np.concatenate([variables, z, y[block.coupled]]))
