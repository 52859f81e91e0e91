"""How the growth of a region goes on and ends, and how its regions are made, wherever it is stored."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from certifier.errors import CirisError
from certifier.growth.actions import Candidate, Failed, Finish, Report, Transition
from certifier.growth.machine import advance, begin
from certifier.growth.options import GrowthOptions
from certifier.growth.refusal import at_deadline, ended_by, refusal
from certifier.growth.state import GrowthState
from certifier.jobs.former import Former
from certifier.jobs.region import Region, certified_region, growth_point, versions
from certifier.jobs.share import SampledProposal
from certifier.model import Polytope, Scene
from certifier.outcome import DEADLINE, Outcome
from certifier.verify.separations import Progress

REST = 4.0
"""While a region goes on growing, none is made for REST times as long as making the last one took, which is mostly verifying its proof."""


def decided(scene: Scene, options: GrowthOptions, state: GrowthState | None, report: Report | None) -> Transition:
    """Returns the first transition of a growth, which has no state yet, or the transition that follows a report.

    Raises:
        CirisError: as :func:`certifier.growth.machine.begin`.
    """
    if state is None:
        return begin(scene, options)
    assert report is not None, "a growth that has begun goes on with a report"
    return advance(scene, state, report)


def late(scene: Scene, state: GrowthState | None, certified: bool, told: dict[str, Any]) -> Finish:
    """Returns the end of a growth whose time has run out.

    Args:
        certified: whether it has a certified polytope.
        told: what the child process that makes the proposal has told last.
    """
    if certified:
        box = state is not None and state.best is not None and state.best.box
        return Finish(Outcome.CERTIFIED, f"{DEADLINE}; the region is a small box about the seed" if box else DEADLINE)
    return Finish(Outcome.INCONCLUSIVE, at_deadline(scene, state, told.get("hindrance", "")))


def proposing(seconds: float, told: dict[str, Any]) -> str:
    """Returns how far a proposal is, in words.

    Args:
        told: what the child process that makes it has told last.
    """
    faces = told.get("faces")
    return f"proposing, {seconds:.0f} s{'' if faces is None else f', {faces} face' + 's' * (faces != 1)}"


def failure(state: GrowthState | None, report: Failed) -> CirisError | None:
    """Returns what has ended a growth in words about what users gave; None where a region remains."""
    if state is not None and state.best is not None:
        return None
    return report.error if state is None or state.start is None else ended_by(report.error, state.start.hindrance)


def refused(finish: Finish, error: CirisError | None) -> CirisError | None:
    """Returns the error of a growth that has ended; None where it has a certified region.

    Args:
        error: what went wrong on the way, if something did.
    """
    if finish.outcome is Outcome.CERTIFIED:
        return None
    return error or refusal(finish.reason, late=finish.reason.startswith(DEADLINE))


@dataclass(frozen=True)
class Certified:
    """Names a polytope that a growth has certified.

    Attributes:
        seconds: from the job's start until it was certified.
        ellipsoid_volume: as :class:`certifier.growth.actions.Candidate` has it.
    """

    iteration: int
    polytope: Polytope
    ellipsoid_volume: float | None
    seconds: float


@dataclass(frozen=True)
class Account:
    """Says what a growth has done so far, for the provenance of its regions.

    Attributes:
        certified: the polytopes that it has certified, in order.
        seeding_seconds, pair_seconds, seconds: of the seeding, of all pairs together, and of the job.
        job: id of the service's job; None without a service.
    """

    certified: Sequence[Certified]
    seeding_seconds: float
    pair_seconds: float
    seconds: float
    job: str | None = None


def make_region(
    scene: Scene,
    state: GrowthState,
    candidate: Candidate,
    proofs: dict[int, bytes],
    account: Account,
    proposal: SampledProposal | None,
    former: Former | None,
    processes: int = 1,
    progress: Progress | None = None,
    last: Region | None = None,
) -> Region:
    """Makes a region of a certified polytope, which verifies its proof.

    Args:
        state: of the growth now.
        proofs: pair index -> proof file, for the pairs that ``candidate.proofs`` names, in its order.
        proposal: what the region is grown from; None for a given polytope.
        former: the region that is certified again; None where one is grown.
        processes, progress, last: as for :func:`certifier.jobs.region.certified_region`.

    Raises:
        ProofError: the proof does not hold. Nothing may be served as certified then.
    """

    def point(one: Certified) -> dict[str, Any]:
        share = None if proposal is None else proposal.share(one.polytope)["value"]
        return growth_point(one.iteration, one.seconds, one.ellipsoid_volume, share)

    provenance: dict[str, Any] = {} if account.job is None else {"job": account.job}
    provenance |= {
        "options": state.options.to_document(),
        "versions": versions(scene),
        "growth_curve": [point(one) for one in account.certified],
        "seeding_seconds": account.seeding_seconds,
        "pair_seconds": account.pair_seconds,
        "seconds": account.seconds,
    }
    if former is not None and proposal is not None:
        cuts = {} if state.whole is None else state.whole.cuts
        provenance["recertified"] = former.document(scene, cuts, proposal, candidate.polytope)
    return certified_region(scene, candidate, proofs, provenance, proposal, processes, progress, last)
