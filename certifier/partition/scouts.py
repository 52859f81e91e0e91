"""Contacts of two bodies are looked for here by descents. They show what samples do not: contacts in corners that hold next to nothing."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from certifier.model import Array
from certifier.partition.area import Area
from certifier.partition.bodies import Bodies
from certifier.partition.cell import Cell
from certifier.partition.chords import chords
from certifier.partition.hulls import gaps
from certifier.partition.tree import Node

SCOUTS, AMONG, STEPS = 64, 16, 12
"""A search for contacts starts from SCOUTS points and takes STEPS steps. Of AMONG times as many points, half of them samples and half on
the boundary, these are the ones where bodies are nearest."""
FIRST, HOPELESS = 8, 0.03
"""If the first FIRST descents come no nearer than HOPELESS, relative to the bodies' extent, the others are left out."""
NEAR_CONTACTS = 48
"""To find how far a contact reaches, this many configurations about it are looked at, at each of SCALES."""
SCALES = (0.5, 0.2, 0.07, 0.02)


def scouted(area: Area, bodies: Bodies, seed: int) -> list[Array]:
    """Returns contacts that a look at all of the polytope finds, (n,) each; other seeds look elsewhere."""
    contacts = []
    cell = Cell.at(area, Node(), area.lower, area.upper, area.samples)
    rng, count = np.random.default_rng(seed), SCOUTS * AMONG // 4
    targets = np.where(rng.random((count, len(area.lower))) < 0.5, area.lower, area.upper)
    samples = area.samples[rng.permutation(len(area.samples))[:count]]
    X = np.concatenate([samples, chords(cell.inside.C, cell.inside.d, area.center, targets, count, seed)])
    nearest = np.inf
    for number, place in enumerate(np.argsort(gaps(*bodies.hulls, X), kind="stable")[:SCOUTS]):
        if number == FIRST and nearest > HOPELESS * bodies.extent:
            break
        s, gap = bodies.approached(cell, X[place], STEPS)
        nearest = min(nearest, gap)
        if gap <= 0:
            contacts.append(s)
    return contacts


def with_others(area: Area, bodies: Bodies, joints: Sequence[int], contacts: Sequence[Array]) -> list[Array]:
    """Returns contacts with others about them, which show how far a contact reaches.

    Args:
        joints: position indices of the joints in play.
    """
    found: list[Array] = []
    rng, J = np.random.default_rng(len(contacts)), list(joints)
    covariance = np.cov(area.samples.T).reshape(len(area.lower), -1)
    root = np.linalg.cholesky(covariance[np.ix_(J, J)] + 1e-12 * np.eye(len(J)))
    for contact in contacts:
        near = np.tile(contact, (len(SCALES) * NEAR_CONTACTS, 1))
        scales = np.repeat(SCALES, NEAR_CONTACTS)[:, None]
        near[:, J] += scales * rng.normal(size=(len(near), len(J))) @ root.T / np.sqrt(len(J))
        near = near[area.polytope.contains(near)]
        found += [contact, *near[gaps(*bodies.hulls, near) <= 0]]
    return found
