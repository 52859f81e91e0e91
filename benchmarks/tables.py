"""The documents of the benchmarks as tables for people: a header and rows of text."""

from __future__ import annotations

from collections import Counter
from typing import Any

Table = tuple[tuple[str, ...], list[tuple[str, ...]]]


def seconds(value: float) -> str:
    """Three significant digits, milliseconds at the least."""
    digits = 0 if value >= 99.95 else 1 if value >= 9.995 else 2 if value >= 0.995 else 3
    return f"{value:.{digits}f}"


def ratio(value: float, bound: bool) -> str:
    """How many times as long Drake takes; at least that if it was stopped."""
    return f"{'>= ' if bound else ''}{value:.{1 if value < 9.95 else 0}f}"


def pairs_table(document: dict[str, Any]) -> Table:
    """A line a pair: both outcomes, both times in seconds."""
    against = document["drake_machine"] is not None
    header = ("pair", "k", "rationals", "ciris", "solve", "verify", *(("Drake", "build", "solve", "ratio", "verdicts") if against else ()))
    rows = []
    for task in document["tasks"]:
        for row in task["pairs"]:
            name = task["name"] if document["benchmark"] == "pairs" else f"{row['a']} - {row['b']}"
            ciris, drake = row["ciris"], row["drake"]
            cells = [name, f"{row['k'][0]}, {row['k'][1]}", str(row["rationals"]), _plain(ciris["outcome"])]
            cells += [seconds(ciris["solve_seconds"]), seconds(ciris["verify_seconds"])]
            if against:
                cells += [_plain(drake["outcome"]), seconds(drake["build_seconds"]), seconds(drake["solve_seconds"])]
                cells += [ratio(row["ratio"], row["bound"]), row["verdict"]]
            rows.append(tuple(cells))
    return header, rows


def totals_table(document: dict[str, Any]) -> Table:
    """Both sides' sums in seconds."""
    total = document["total"]
    ciris, drake = total["ciris"], total["drake"]
    rows = [("ciris", seconds(ciris["setup_seconds"]), "", *(seconds(ciris[f"{name}_seconds"]) for name in ("solve", "verify")))]
    rows[0] += (seconds(sum(ciris.values())),)
    if drake:
        parts = [seconds(drake[f"{name}_seconds"]) for name in ("setup", "build", "solve")]
        rows.append(("Drake", *parts, "", seconds(sum(drake.values()))))
        ratios = ratio(total["solve_ratio"], total["bound"]), "", ratio(total["ratio"], total["bound"])
        rows.append(("ratio", "", "", *ratios))
    return ("", "setup", "build", "solve", "verify", "total"), rows


def agreement_table(document: dict[str, Any]) -> Table:
    """How often which answers met."""
    header = ("group", "ciris", "Drake", "instances", "verdict")
    counts = document["counts"]
    return header, [(c["group"], _plain(c["ciris"]), _plain(c["drake"]), str(c["instances"]), c["verdict"]) for c in counts]


def disagreements_table(document: dict[str, Any]) -> Table:
    """Every instance on which the answers differ, with what else speaks for ours."""
    header = ("instance", "ciris", "Drake", "Drake's solver", "verdict", "evidence for ours")
    found = document["disagreements"]
    return header, [(f["name"], _plain(f["ciris"]), _plain(f["drake"]), f["status"], f["verdict"], f["evidence"]) for f in found]


def verdicts_line(document: dict[str, Any]) -> str:
    """How often the verdicts agreed."""
    counts = Counter(row["verdict"] for task in document["tasks"] for row in task["pairs"])
    return ", ".join(f"{number} {verdict}" for verdict, number in counts.most_common())


def _plain(outcome: str) -> str:
    return outcome.replace("_", " ")
