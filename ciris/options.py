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
    """The job ends this many seconds after its creation, with the regions it has by then. Default: no deadline."""
    priority: int
    """From -3 to 3. Each step up doubles the job's share of the work for its API key. Default: 0."""
    labels: Mapping[str, str]
    """Labels to find the job by, at most 20: name -> value."""


JOB: Fields = {"deadline": ("deadline_seconds", "real"), "priority": ("priority", "whole"), "labels": ("labels", "labels")}


class PaperOptions(TypedDict, total=False):
    """The papers' algorithm grows the region instead: it shrinks the first polytope until every pair has one plane that moves with the
    joints, and then pushes the faces out. ``{}`` takes all of its defaults.
    """

    contraction: Literal["targeted", "uniform"]
    """``targeted`` adds faces where pairs fail; ``uniform`` moves every face inwards by the same amount. Default: targeted."""
    contractions: int
    """Number of targeted contractions. Each begins to cut at another distance; the largest region counts. Default: 2 for arms with at
    most six joints between two bodies, else 1.
    """
    bisection_steps: int
    """Steps of uniform contraction's bisection, one certification each. Default: 6."""
    pushes: int
    """How often the faces are pushed out after the contractions. After a push that fails, the next one is shorter. Default: 10 for arms
    with at most four joints between two bodies, 2 for at most six, else 0.
    """
    max_rounds: int
    """Most rounds of the polytope step (12) after the pushes. Default: 3 for arms with at most four joints between two bodies, else 0."""
    tolerance: float
    """Relative growth of the ellipsoid's volume that is still worth a push or a round. Default: 0.02."""
    backoff: int
    """How often a polytope step that fails to certify is halved towards the last certified polytope. Default: 2."""


class GrowOptions(JobOptions, total=False):
    """Options of jobs of the kind ``grow``."""

    method: Literal["iris_np2", "iris_zo", "limits", "box"]
    """How the first polytope is found: by Drake's IRIS (``iris_np2``, ``iris_zo``), or with the papers' algorithm also from the joint
    limits (``limits``), or as a box around the seed (``box``). Default: ``iris_np2``.
    """
    contain: ArrayLike
    """(n,) or (k, n). More configurations (joint positions) that the region must contain, such as where it meets another region."""
    half_width: float
    """Half the edge length of the first polytope, in s; the method ``box`` needs it. 0.1 is about 11 degrees of a joint."""
    iris_epsilon: float
    """IRIS adds faces until at most this fraction of the volume in s is in collision. Below 0.01, only its last rounds of faces reach
    it. Default: 0.001.
    """
    iris_delta: float
    """Probability with which IRIS may be wrong about that fraction. Default: 0.05."""
    iris_iterations: int
    """Largest number of alternations of IRIS between faces and ellipsoid, and again where balls about a hand join the scene. Default: 3."""
    iris_face_rounds: int
    """Number of rounds in which IRIS adds faces, within each alternation. Default: 20."""
    iris_tolerance: float
    """IRIS ends when the ellipsoid's volume grows by less than this fraction. Default: 0.02."""
    iris_margin: float
    """Distance in s that IRIS' faces keep from the collisions found. Default: 0.01."""
    iris_random_seed: int
    """Seed of IRIS' random choices alone. Another seed gives another proposal. Default: the seed of every random choice."""
    iris_tries: int
    """IRIS makes at most this many proposals, each with its own random seed, and growth takes the best. Default: 2."""
    cells: int
    """Cells of a pair in each stage. Cells still undecided when this budget is spent are removed by new faces. Default: 6000."""
    stages: int
    """Number of stages after which growth ends. Each stage gives a larger region than the one before. Default: it ends when a stage
    gains little.
    """
    paper: PaperOptions
    """The papers' algorithm grows the region instead: it shrinks the first polytope until every pair has one plane that moves with the
    joints, and then pushes the faces out. ``{}`` takes all of its defaults. Default: none.
    """
    random_seed: int
    """Seed of every random choice, those of Drake's IRIS too. Another seed gives another region. Default: 0."""


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
    """(n,) or (k, n). Configurations that each get a region, and that shall end in one connected component."""
    paths: Sequence[ArrayLike]
    """(k, n) each. Demonstrations: the motions, straight in joint positions from waypoint to waypoint, that shall be covered."""
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
    """A region ends after so long, with what there is of it. Default: no limit."""
    cells: int
    """Cells of a pair in each stage of a region. New faces remove the cells that are undecided after that. Default: 6000."""
    stages: int
    """Each region ends after this many stages. One stage gives the first regions sooner, and less coverage in the end. Default: 2 for
    robots with more than 4 joints; else a region ends when a stage gains little.
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


class CertifyOptions(JobOptions, total=False):
    """Options of jobs of the kind ``certify``."""

    random_seed: int
    """Seed of every random choice. Default: 0."""
    cells: int
    """Number of cells of the polytope that are tried for each pair, each with its own plane. With 1, each pair has one plane on all of
    the polytope. Default: 1.
    """


CERTIFY: Fields = {**JOB, "random_seed": ("random_seed", "whole"), "cells": ("cells", "whole")}


class RecertifyOptions(JobOptions, total=False):
    """Options of jobs of the kind ``recertify``."""

    random_seed: int
    """Seed of every random choice. Default: 0."""


RECERTIFY: Fields = {**JOB, "random_seed": ("random_seed", "whole")}
