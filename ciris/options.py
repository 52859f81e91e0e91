"""Options of jobs. This module is made from the tables of options: ``python -m tests.ciris.options``.

The service has a default for each. A mapping says of each option in which field of the request it is, and what it takes.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal, TypeAlias, TypedDict

from numpy.typing import ArrayLike

Fields: TypeAlias = "Mapping[str, tuple[str, str | Fields]]"


class JobOptions(TypedDict, total=False):
    """Options of all jobs."""

    deadline: float
    """The job ends this many seconds after its creation, with what is proved so far. Default: no deadline."""
    priority: int
    """From -3 to 3. Each step up doubles the job's share of the work for its API key. Default: 0."""
    labels: Mapping[str, str]
    """Labels to find the job by, at most 20: name -> value."""


JOB: Fields = {"deadline": ("deadline_seconds", "real"), "priority": ("priority", "whole"), "labels": ("labels", "labels")}


class PaperOptions(TypedDict, total=False):
    """Grow with the papers' algorithm instead: it shrinks the first polytope until every pair has one plane that moves with the joints,
    and then pushes the faces out.
    """

    contraction: Literal["targeted", "uniform"]
    """``targeted`` adds faces where pairs fail; ``uniform`` moves every face inwards by the same amount. Default: targeted."""
    contractions: int
    """Number of targeted contractions. Each begins to cut at another distance. The largest region is the result. Default: 2 for arms
    with at most six joints between two bodies, else 1.
    """
    bisection_steps: int
    """Steps of the bisection in uniform contraction, with one certification each. Default: 6."""
    pushes: int
    """How often to push the faces out after the contractions. After a push that fails, the next one is shorter. Default: 10 for arms
    with at most four joints between two bodies, 2 for at most six, else 0.
    """
    max_rounds: int
    """Most rounds of the polytope step (12) after the pushes. Default: 3 for arms with at most four joints between two bodies, else 0."""
    tolerance: float
    """Pushes and rounds end when the ellipsoid's volume grows by less than this part. Default: 0.02."""
    backoff: int
    """How often to halve a polytope step that cannot be certified, towards the last certified polytope. Default: 2."""


class GrowOptions(JobOptions, total=False):
    """Options of jobs of the kind ``grow``."""

    method: Literal["iris", "iris_np2", "iris_zo", "limits", "box"]
    """Source of the first polytope: IRIS (``iris``), or for comparison Drake's (``iris_np2``, ``iris_zo``), which takes minutes. The
    papers' algorithm can also begin with the joint limits (``limits``) or a box around the seed (``box``). Default: ``iris``.
    """
    contain: ArrayLike
    """(n,) or (k, n). More configurations (joint positions) that the region must contain, such as where it meets another region."""
    half_width: float
    """Half the edge length of the first polytope, in s; the method ``box`` needs it. 0.1 is about 11 degrees of a joint."""
    iris_epsilon: float
    """IRIS adds faces until at most this fraction of the polytope's volume is in collision: in q, or in s for Drake's IRIS. Default:
    0.001.
    """
    iris_delta: float
    """Probability that a larger fraction than that is in collision. Default: 0.05."""
    iris_iterations: int
    """Most alternations of IRIS between faces and ellipsoid. Default: 8."""
    iris_face_rounds: int
    """Most rounds of new faces within each alternation of IRIS. Default: 20."""
    iris_tolerance: float
    """IRIS ends when the ellipsoid's volume grows by less than this fraction. Default: 0.05."""
    iris_margin: float
    """Distance in s between IRIS' faces and the collisions that it finds. Default: 0.01."""
    iris_random_seed: int
    """Seed of the random choices of IRIS only. Another seed gives another proposal. Default: the seed of every random choice."""
    iris_tries: int
    """IRIS makes this many proposals, each with its own random seed, and growth takes the one of which it is likely to keep most.
    Default: 1.
    """
    cells: int
    """Most cells of a pair in each stage. After that, new faces cut off the cells that are still undecided. Default: 20000."""
    stages: int
    """Growth ends after this many stages. Each stage gives a larger region than the one before. Default: it ends when a region keeps
    0.95 of the proposal, or a stage gains little.
    """
    paper: PaperOptions
    """Grow with the papers' algorithm instead: it shrinks the first polytope until every pair has one plane that moves with the joints,
    and then pushes the faces out.
    """
    random_seed: int
    """Seed of every random choice, also in Drake's IRIS. Another seed gives another region. Default: 0."""


GROW: Fields = {
    **JOB,
    "method": ("seed.method", "choice"),
    "contain": ("seed.contain", "points"),
    "half_width": ("seed.half_width", "real"),
    "iris_epsilon": ("seed.epsilon", "real"),
    "iris_delta": ("seed.delta", "real"),
    "iris_iterations": ("seed.max_iterations", "whole"),
    "iris_face_rounds": ("seed.max_iterations_separating_planes", "whole"),
    "iris_tolerance": ("seed.tolerance", "real"),
    "iris_margin": ("seed.margin", "real"),
    "iris_random_seed": ("seed.random_seed", "whole"),
    "iris_tries": ("seed.tries", "whole"),
    "cells": ("options.cells", "whole"),
    "stages": ("options.stages", "whole"),
    "paper": (
        "options.paper",
        {
            "contraction": ("contraction", "choice"),
            "contractions": ("contractions", "whole"),
            "bisection_steps": ("bisection_steps", "whole"),
            "pushes": ("pushes", "whole"),
            "max_rounds": ("max_rounds", "whole"),
            "tolerance": ("tolerance", "real"),
            "backoff": ("backoff", "whole"),
        },
    ),
    "random_seed": ("options.random_seed", "whole"),
}


class CoverOptions(JobOptions, total=False):
    """Options of jobs of the kind ``cover``."""

    seeds: ArrayLike
    """(n,) or (k, n). Configurations (joint positions) that get regions first."""
    connect: ArrayLike
    """(n,) or (k, n). Goal: each of these configurations is in a region, and all of them are in one connected component."""
    paths: Sequence[ArrayLike]
    """(k, n) each. Goal: regions cover these motions, which are straight in joint positions from waypoint to waypoint."""
    coverage: float
    """Goal: this share of the collision-free configurations, uniform in joint positions within the limits, is in regions. Default: 0.95
    where nothing else is asked for, else no goal.
    """
    connected: bool
    """Goal: all regions of the scene are connected."""
    regions: int
    """Grow at most this many regions. Default: 1000."""
    at_once: int
    """Number of regions that grow at the same time. Default: 2."""
    region_seconds: float
    """The growth of a region ends after this many seconds, with the region so far. Default: no limit."""
    cells: int
    """Most cells of a pair in each stage of a region. After that, new faces cut off the cells that are still undecided. Default: 6000."""
    stages: int
    """The growth of a region ends after this many stages. A further stage makes the region larger. Default: 1 for robots with more than
    4 joints; else as for one region.
    """
    random_seed: int
    """Seed of every random choice. Default: 0."""


COVER: Fields = {
    **JOB,
    "seeds": ("options.seeds", "points"),
    "connect": ("options.connect", "points"),
    "paths": ("options.paths", "paths"),
    "coverage": ("options.coverage", "real"),
    "connected": ("options.connected", "flag"),
    "regions": ("options.regions", "whole"),
    "at_once": ("options.at_once", "whole"),
    "region_seconds": ("options.region_seconds", "real"),
    "cells": ("options.cells", "whole"),
    "stages": ("options.stages", "whole"),
    "random_seed": ("options.random_seed", "whole"),
}


class MapOptions(JobOptions, total=False):
    """Options of jobs of the kind ``map``."""

    coverage: float
    """The map ends when it covers this share of the free configurations. Default: 0.9."""
    at: ArrayLike
    """(n,) or (k, n). Joint positions that the map is to cover first."""
    paths: Sequence[ArrayLike]
    """(k, n) each. Motions that the map is to cover first, straight in joint positions from waypoint to waypoint."""
    asked: bool
    """Cover next the configurations that the service was asked about lately and nothing proved; those in collision are left out. The
    job's options have them in ``at``.
    """
    random_seed: int
    """Seed of every random choice. Default: 0."""


MAP: Fields = {
    **JOB,
    "coverage": ("options.coverage", "real"),
    "at": ("options.at", "points"),
    "paths": ("options.paths", "paths"),
    "asked": ("options.asked", "flag"),
    "random_seed": ("options.random_seed", "whole"),
}


class CertifyOptions(JobOptions, total=False):
    """Options of jobs of the kind ``certify``."""

    random_seed: int
    """Seed of every random choice. Default: 0."""
    cells: int
    """Most cells of the polytope for each pair, each with its own plane. With 1, each pair has one plane on all of the polytope.
    Default: 1.
    """


CERTIFY: Fields = {**JOB, "random_seed": ("random_seed", "whole"), "cells": ("cells", "whole")}


class RecertifyOptions(JobOptions, total=False):
    """Options of jobs of the kind ``recertify``."""

    random_seed: int
    """Seed of every random choice. Default: 0."""


RECERTIFY: Fields = {**JOB, "random_seed": ("random_seed", "whole")}
