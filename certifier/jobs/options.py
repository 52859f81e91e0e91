"""The options say what every job may be asked for, whatever it does."""

from __future__ import annotations

from dataclasses import dataclass

from certifier.options import option


@dataclass(frozen=True)
class JobOptions:
    """The options that jobs of all kinds have."""

    deadline_seconds: float | None = option(
        None,
        "The job ends this many seconds after its creation, with what is proved so far.",
        otherwise="no deadline",
        argument="deadline",
        unit="s",
        above=0,
        greatest=30 * 86400,
    )
    priority: int = option(0, "From -3 to 3. Each step up doubles the job's share of the work for its API key.", least=-3, greatest=3)
    labels: dict[str, str] = option({}, "Labels to find the job by, at most 20: name -> value.", argument="label")
