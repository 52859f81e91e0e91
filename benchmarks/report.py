"""This module writes the documents of the benchmarks as tables: on a terminal, and between the marks of docs/benchmarks.md."""

from __future__ import annotations

import json
import re
import textwrap
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

from benchmarks import cover, growth, scaling
from benchmarks.catalogue import ROOT

PAGE, FIGURES = ROOT / "docs/benchmarks.md", ROOT / "docs/benchmarks"

COVER_ROWS = 16
"""The table of a cover has about this many rows."""
SEEN = 0.01
"""A region that keeps less of its proposal is no larger than the box about the seed, as far as samples can tell."""
LINE = 100
"""A line of docs has at most this many characters, unless it is a line of a table."""

Document = dict[str, Any]

PICTURES: dict[str, tuple[Path, Callable[[Document], str]]] = {
    "scaling": (FIGURES / "scaling.svg", scaling.picture),
    "growth": (ROOT / "docs/pictures/growth.svg", growth.picture),
    "cover": (ROOT / "docs/pictures/coverage.svg", cover.picture),
}
"""Maps a document to the file of its picture and what draws it."""


def text(document: Document) -> str:
    """Returns a document as text for people: the machine, then the document's tables, or before each table the machines of its rows."""
    parts = _TABLES[document["benchmark"]](document)
    return "\n\n".join([machine(document), *parts] if "machine" in document else parts)


def write() -> None:
    """Writes the tables of all documents in docs/benchmarks into docs/benchmarks.md, and draws the pictures."""
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8")), encoding="utf-8")
    for name, (path, picture) in PICTURES.items():
        path.write_text(picture(_document(name)), encoding="utf-8")


def page(old: str) -> str:
    """Returns the page with new tables between each ``<!-- NAME -->`` and ``<!-- end -->``.

    The tables come from docs/benchmarks/NAME.json, if that file exists.
    """

    def tables(found: re.Match[str]) -> str:
        measured = (FIGURES / f"{found[2]}.json").exists()
        return f"{found[1]}\n{_wrapped(text(_document(found[2]))) if measured else 'Not measured yet.'}\n\n{found[3]}"

    return re.sub(r"(<!-- (\w+) -->\n).*?(<!-- end -->)", tables, old, flags=re.DOTALL)


def _wrapped(text: str) -> str:
    """Breaks the text into lines of at most LINE characters. It leaves the rows of tables as they are."""
    lines = (line if line.startswith("|") else textwrap.fill(line, LINE, break_on_hyphens=False) for line in text.splitlines())
    return "\n".join(lines)


def _document(name: str) -> Document:
    document: Document = json.loads((FIGURES / f"{name}.json").read_text(encoding="utf-8"))
    return document


def machine(document: Document) -> str:
    """Returns a sentence that says on what machine, and with what software, the measurement was made."""
    here = document["machine"]
    versions = ", ".join(f"{package} {number}" for package, number in here["versions"].items())
    where = f"{here['processor']}, {here['cores']} cores, {here['memory_gib']} GiB; Python {here['python']}, {versions}"
    return f"Measured on: {where}; one thread."


def seconds(value: float) -> str:
    """Writes a duration with three significant digits, but nothing finer than milliseconds."""
    digits = 0 if value >= 99.95 else 1 if value >= 9.995 else 2 if value >= 0.995 else 3
    return f"{value:.{digits}f}"


def _ratio(value: float) -> str:
    return f"{value:.{1 if value < 9.95 else 0}f}"


def _plain(outcome: str) -> str:
    return outcome.replace("_", " ")


def _table(header: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """Returns a Markdown table with aligned columns. Columns of numbers are aligned to the right."""
    lines = [list(header), *map(list, rows)]
    widths = [max(3, *(len(line[i]) for line in lines)) for i in range(len(header))]
    right = [all(re.fullmatch(r"[\d.,e+-]*", line[i].replace(" ", "")) for line in lines[1:]) for i in range(len(header))]
    lines.insert(1, ["-" * (w - 1) + (":" if r else "-") for w, r in zip(widths, right, strict=True)])
    return "\n".join(
        "| " + " | ".join(cell.rjust(w) if r else cell.ljust(w) for cell, w, r in zip(line, widths, right, strict=True)) + " |"
        for line in lines
    )


def _compared(document: Document) -> list[str]:
    """Returns a table with one line for each pair, then the sums."""
    against = document["verdicts"] is not None
    header = ["pair", "region", "joints", "vertices", "ciris", "covers", "solve", "verify"]
    header += ["Drake", "build", "solve", "ratio", "verdicts"] if against else []
    rows = []
    for task in document["tasks"]:
        for row in task["pairs"]:
            ciris, drake = row["ciris"], row["drake"]
            cells = [f"{row['a']} - {row['b']}", task["region"], f"{row['k'][0]} + {row['k'][1]}", str(row["vertices"])]
            cells += [_plain(ciris["outcome"]), str(ciris["covers"]), seconds(ciris["solve_seconds"]), seconds(ciris["verify_seconds"])]
            if drake:
                cells += [_plain(drake["outcome"]), seconds(drake["build_seconds"]), seconds(drake["solve_seconds"])]
                cells += [_ratio(row["ratio"]) if row["ratio"] else "", row["verdict"]]
            rows.append(cells)
    total = document["total"]
    ciris, drake = total["ciris"], total["drake"]
    sums = [["ciris", seconds(ciris["setup_seconds"]), "", *(seconds(ciris[f"{name}_seconds"]) for name in ("solve", "verify"))]]
    sums[0].append(seconds(sum(ciris.values())))
    if drake:
        sums.append(["Drake", *(seconds(drake[f"{name}_seconds"]) for name in ("setup", "build", "solve")), ""])
        sums[1].append(seconds(sum(drake.values())))
        sums.append(["ratio", "", "", _ratio(total["solve_ratio"]), "", _ratio(total["ratio"])])
    parts = [_table(header, rows), _table([f"{total['pairs']} pairs", "setup", "build", "solve", "verify", "total"], sums)]
    if against:
        parts.append(f"Verdicts: {_counts(document['verdicts'])}.")
    return parts


def _growth(document: Document) -> list[str]:
    def line(row: Document) -> list[str]:
        return [f"{row['ellipsoid']:.3g}", seconds(row["seconds"]), str(row["faces"])]

    header = ["example", "way", "share", "stderr", "q-volume", "ellipsoid", "seconds", "faces", "processor", "seeding"]
    rows = []
    for row in document["ways"]:
        q_volume = f"{row['q_volume']:.3g}" if "q_volume" in row else ""
        cells = [row["scene"], row["way"], *_share(row), q_volume, *line(row), seconds(row["processor_seconds"])]
        cells += [seconds(row["seeding_seconds"]) if "seeding_seconds" in row else "", str(len(row["curve"])), *_proof(row), row["ended"]]
        rows.append(cells)
    parts = [_machines(document["ways"]), _table([*header, "certified regions", "proof MB", "cells in it", "verified in", "ended"], rows)]
    if document["against"]:
        rows = []
        for row in document["against"]:
            reached = [seconds(row["reached_seconds"]), _ratio(row["time_ratio"])] if row["reached_seconds"] else ["never", ""]
            runs = ", ".join(map(_ratio, row["time_ratios"])) if len(row["time_ratios"]) > 1 else ""
            rows.append([row["scene"], row["way"], *line(row), f"{row['volume_ratio']:.3g}", *reached, runs])
        header = ["example", "way", "ellipsoid", "seconds", "faces"]
        header += ["volume / Drake's", "reached Drake's after", "times as fast", "in each run"]
        parts += [_machines(document["against"]), _table(header, rows)]
    return parts


def _machines(rows: list[Document]) -> str:
    """Returns a sentence about each machine that the rows were measured on, with the examples where there are several machines."""
    examples: dict[str, dict[str, None]] = {}
    for row in rows:
        examples.setdefault(machine(row), {})[row["scene"]] = None
    if len(examples) == 1:
        return next(iter(examples))
    return "\n\n".join(f"{', '.join(names)}: {sentence}" for sentence, names in examples.items())


def _share(row: Document) -> list[str]:
    return [f"{row['share']:.3f}", f"{row['share_stderr']:.4f}"] if row.get("share") is not None else ["", ""]


def _proof(row: Document) -> list[str]:
    """Returns the proof's megabytes, its cells, and for how long it was verified."""
    if "proof_bytes" not in row:
        return ["", "", ""]
    return [f"{row['proof_bytes'] / 1e6:.2f}", str(row.get("cells", "")), seconds(row["verify_seconds"])]


def _agreement(document: Document) -> list[str]:
    rows = [[c["group"], _plain(c["ciris"]), _plain(c["drake"]), str(c["instances"]), c["verdict"]] for c in document["counts"]]
    parts = [_table(["group", "ciris", "Drake", "instances", "verdicts"], rows)]
    parts.append(
        f"{document['instances']} instances, {document['same_program']} of them the very same program: {_counts(document['verdicts'])}. "
        f"What speaks for our answers: {_counts(document['evidence'])}."
    )
    if document["disagreements"]:
        header = ["instance", "ciris", "Drake", "Drake's solver", "verdicts", "evidence for ours"]
        found = document["disagreements"]
        parts.append(
            _table(header, ([f["name"], _plain(f["ciris"]), _plain(f["drake"]), f["status"], f["verdict"], f["evidence"]] for f in found))
        )
    return parts


def _scaling(document: Document) -> list[str]:
    rows = []
    for curve in ("obstacles", "joints", "faces"):
        for point in document[curve]:
            cells = [curve, str(point["n"]), str(point["pairs"]), _counts(point["outcomes"])]
            cells += [seconds(point[part]) for part in ("setup_seconds", "seconds", "verify_seconds")]
            rows.append([*cells, seconds(point["drake_seconds"]) if "drake_seconds" in point else ""])
    return [_table(["curve", "number", "pairs", "outcomes", "setup", "certify", "verify again", "Drake"], rows)]


def _service(document: Document) -> list[str]:
    columns = {"seconds": "the command", "seeding_seconds": "seeding", "processor_seconds": "processor time", "stolen_seconds": "stolen"}
    rows = [[row["scene"], str(row["turn"]), row["way"], *(f"{row[key]:.1f}" for key in columns)] for row in document["rows"]]
    more = [
        [
            row["scene"],
            row["way"],
            str(row["cells"]),
            f"{row['seconds']:+.1f}",
            f"{row['processor_seconds']:+.1f}",
            f"{row['cell_ms']:+.2f}",
        ]
        for row in document["more"]
    ]
    many = "one solving process" if document["processes"] == 1 else f"{document['processes']} solving processes"
    return [
        f"With {many}, in seconds.",
        _table(["example", "turn", "way", *columns.values()], rows),
        "What the service takes more than `--local`, by the medians.",
        _table(["example", "database", "cells", "more, s", "more processor time, s", "of a cell of the proof, ms"], more),
    ]


def _store(document: Document) -> list[str]:
    header = ["database", "pairs", "settled", "insert all, s", "claim", "save", "claim and save", "look"]
    rows = []
    for row in document["rows"]:
        both = row["claim_ms"] + row["save_ms"]
        times = [f"{value:.1f}" for value in (row["claim_ms"], row["save_ms"], both, row["look_ms"])]
        rows.append([row["database"], str(row["pairs"]), str(row["settled"]), seconds(row["insert_seconds"]), *times])
    return [f"Milliseconds for one pair by the clock, medians of {document['repeat']}.", _table(header, rows)]


def _fleet(document: Document) -> list[str]:
    header = ["database", "workers", "pieces", "seconds each", "pieces a second", "efficiency", "processor time of a piece, ms"]
    counts = [document["database"], str(document["workers"]), str(document["pieces"]), f"{document['piece_seconds']:g}"]
    rates = [f"{document['pieces_per_second']:.1f}", f"{document['efficiency']:.3f}", f"{document['worker_cpu_ms_per_piece']:.1f}"]
    return [f"Measured for {document['measured_seconds']:.0f} s.", _table(header, [[*counts, *rates]])]


def _robots(document: Document) -> list[str]:
    columns = {"scene init": "init, s", "scene check": "check, s", "grow": "grow, s", "verify": "verify, s"}
    rows = []
    for row in document["rows"]:
        counts = [str(row.get(key, "")) for key in ("joints", "pairs", "ignored")]
        times = [f"{row['seconds'][verb]:.1f}" if verb in row["seconds"] else "" for verb in columns]
        share, megabytes = (f"{row['share']:.2f}", f"{row['proof_bytes'] / 1e6:.1f}") if row.get("share") is not None else ("", "")
        rows.append([row["robot"], *counts, *times, share, megabytes, row["ended"]])
    header = ["robot", "joints", "pairs", "ignored", *columns.values(), "share", "proof, MB", "ended"]
    return [f"{document['deadline']:g} s for each region, on all cores.", _table(header, rows)]


def _arms(document: Document) -> list[str]:
    """Returns a table with one line for each arm, and a sentence for each step that failed."""
    rows, said = [], []
    for row in document["rows"]:
        scene, planned = (row[step] if step in row and step not in row["failed"] else None for step in ("load", "plan"))
        times = {step: f"{row[step]['seconds']:.1f}" if step in row else "" for step in ("draft", "load", "grow", "verify")}
        cells = [row["arm"], *([str(scene[key]) for key in ("joints", "pairs", "ignored")] if scene else [""] * 3)]
        cells += [times["draft"], times["load"], *_regions(row.get("grow", {})), times["grow"], times["verify"]]
        cells += [f"{planned[key]:.2f}" for key in ("p50_seconds", "worst_seconds")] if planned else ["", ""]
        cells += [f"{planned[key]} of {planned['asked']}" for key in ("answered", "proved")] if planned else ["", ""]
        rows.append([*cells, ", ".join(row["failed"])])
        said += [f"{row['arm']}, {step}: {reason}" for step, reason in row["failed"].items()]
    header = ["arm", "joints", "pairs", "ignored", "draft, s", "load, s", "proposal, s", "a region, s", "with 0.01", "with 0.9", "share"]
    header += ["proof, MB", "grow, s", "verify, s", "plan p50, s", "worst", "answered", "proved", "failed"]
    return [f"{document['deadline']:g} s for each region, on all cores.", _table(header, rows), *said]


def _regions(grown: Document) -> list[str]:
    """Returns the seconds until there was a proposal, and a region; share and time of the first region with the share SEEN, and of the
    first with 0.9; share and megabytes of the last.
    """
    proposed = f"{grown['proposal_seconds']:.1f}" if "proposal_seconds" in grown else ""
    if "curve" not in grown:
        return [proposed, "", "", "", "", ""]

    def reached(least: float) -> str:
        known = (region for region in grown["curve"] if (region["share"] or 0.0) >= least)
        return next((f"{region['share']:.3f} after {region['seconds']:.0f} s" for region in known), "")

    share = "" if grown["share"] is None else f"{grown['share']:.3f}"
    box = f"{grown['curve'][0]['seconds']:.0f}"
    return [proposed, box, reached(SEEN), reached(0.9), share, f"{grown['proof_bytes'] / 1e6:.1f}"]


def _survey(document: Document) -> list[str]:
    rows = [
        [row["scene"], row["region"], _counts(row["outcomes"]), str(row["left_out"]), seconds(row["seconds"])] for row in document["counts"]
    ]
    parts = [_table(["scene", "region", "outcomes", "left out", "seconds"], rows)]
    if document["undecided"]:
        parts.append(_table(list(document["undecided"][0]), (list(row.values()) for row in document["undecided"])))
    if "forecast" not in document:
        return parts
    fit = document["forecast"]
    least, low, median, high, most = fit["quantiles"]["present"]
    parts.append(
        f"Forecast divided by measured time of {fit['size_classes']} size classes: median {median:.2f}, "
        f"80 % within {low:.2f} .. {high:.2f}, all within {least:.2f} .. {most:.2f}. "
        f"Constants that would fit best: {', '.join(f'{value:.2g}' for value in fit['constants'])}."
    )
    return parts


def _query(document: Document) -> list[str]:
    header = ["regions", "faces", "MB", "regions at a point", "1000 points", "plain product, 1 point", "nearest", "straight in s", "in q"]
    header += ["overlap of two", "add a region"]
    rows = []
    for row in document["rows"]:
        named = ("contains_ms", "plain_point_ms", "nearest_ms", "segment_s_ms", "segment_q_ms", "overlap_ms", "add_ms")
        sizes = [str(row["regions"]), str(row["faces"]), f"{row['megabytes']:.0f}", f"{row['hits']:.1f}"]
        rows.append([*sizes, *(f"{row[name]:.1f}" for name in named)])
    return ["Milliseconds of processor time, of one question where nothing else is said.", _table(header, rows)]


def _plan(document: Document) -> list[str]:
    """Returns a table of both planners, and sentences about lengths, repeated questions and tasks in narrow places."""
    header = ["planner", "answered", "proved", "p50, s", "p99, s", "length, p50", "fail"]
    parts = [("random questions", document), *([("tasks in narrow places", document["tasks"])] if document["tasks"] else [])]
    about = f"{document['scene']}: {document['joints']} joints, {document['pairs']} pairs"
    said = [f"{about}; the first motion took {document['first_seconds']:.2f} s."]
    for what, part in parts:
        rows = []
        for name, side, answered, proved in (
            ("ciris plan", "ours", part["answered"], str(part["proved"])),
            ("OMPL, no proof", "ompl", part["ompl_solved"], "-"),
        ):
            found = part[side]
            times = [f"{found['seconds'][which]:.3f}" for which in ("p50", "p99")]
            length = f"{found['length']['p50']:.2f}" if found["length"] else "-"
            rows.append([name, f"{answered} of {part['asked']}", proved, *times, length, str(found["fail"])])
        ratio = part["length_ratio"]
        solved = f"{part['answered_of_these']} of {part['ompl_solved']}"
        said += [f"{what}:", _table(header, rows), f"Of those that OMPL solved, we answered {solved}."]
        if ratio:
            said.append(f"Our length over OMPL's: median {ratio['p50']:.3f}.")
    again = document["again_seconds"]
    said.append(f"The same questions again: p50 {1000 * again['p50']:.1f} ms, p99 {1000 * again['p99']:.1f} ms.")
    return said


def _cover(document: Document) -> list[str]:
    """Returns for each case a short table of the coverage over the seconds, and sentences about the regions at the end."""
    return [part for row in document["rows"] for part in _covered(row, document["processes"])]


def _covered(row: dict[str, Any], processes: int) -> list[str]:
    header = ["way", "seconds", "covered %", "regions", "components", "% of it in the largest", "component of each to connect"]
    rows, said = [], []
    for way, run in row["runs"].items():
        shown = cover.table(way, run)
        rows += [*shown[:: max(len(shown) // COVER_ROWS, 1)][:-1], *shown[-1:]]
        extra = "" if "proofs_hold" not in run else f" The verifier has accepted the proofs of {run['proofs_hold']} regions once more."
        seeds = (
            f"{run['without_region']} of {run['begun']} seeds gave no region." if "begun" in run else f"{run['cells']} cells are proved."
        )
        said.append(f"{way}: {run['reason']}. {seeds}{extra}")
        if run.get("colliding"):
            mean, largest = (100 * run["colliding"][which] for which in ("mean", "largest"))
            said.append(f"In its regions {mean:.2g} % of the samples collide, in one of them {largest:.2g} %.")
    title = f"{row['case']}, {processes} processes, until {row['deadline_seconds']:g} s."
    return [title, _table(header, rows), *said]


def _counts(counts: dict[str, int]) -> str:
    return ", ".join(f"{number} {_plain(name)}" for name, number in sorted(counts.items(), key=lambda item: -item[1]))


def _path(document: Document) -> list[str]:
    """Returns a table with one line for each scene, and a sentence about what sampling says otherwise."""
    header = ["scene", "joints", "pairs", "certified", "contacts", "intervals", "s", "largest", "verify", "tube", "sampling", "told apart"]
    rows = []
    for row in document["rows"]:
        times = [seconds(row[what]["median"]) if row[what] else "-" for what in ("verify_seconds", "tube_seconds", "sampling_seconds")]
        intervals = f"{row['intervals']['median']:.0f}" if row["intervals"] else "-"
        counts = [str(row[what]) for what in ("joints", "pairs")] + [f"{row['certified']} of {row['motions']}", str(row["contacts"])]
        taken = [seconds(row["seconds"]["median"]), seconds(row["seconds"]["largest"])]
        rows.append([row["scene"], *counts, intervals, *taken, *times, f"{row['told_apart']} of {row['millimetres']}"])
    wrong = sum(row["certified_but_sampled_in_contact"] for row in document["rows"])
    between = sum(row["contacts_between_samples"] for row in document["rows"])
    said = f"Sampling finds a contact on {wrong} of the certified motions, and none on {between} of those with a contact."
    return [_table(header, rows), said, *_splines(document)]


def _splines(document: Document) -> list[str]:
    """Returns the same of cubic splines."""
    header = ["scene", "joints", "pairs", "splines certified", "contacts", "intervals", "s", "largest", "verify"]
    rows = []
    for row in document["rows"]:
        found = row["splines"]
        intervals = f"{found['intervals']['median']:.0f}" if found["intervals"] else "-"
        counts = [str(row["joints"]), str(row["pairs"]), f"{found['certified']} of {found['motions']}", str(found["contacts"])]
        taken = [found["seconds"]["median"], found["seconds"]["largest"], found["verify_seconds"] and found["verify_seconds"]["median"]]
        rows.append([row["scene"], *counts, intervals, *(seconds(value) if value else "-" for value in taken)])
    wrong = sum(row["splines"]["certified_but_sampled_in_contact"] for row in document["rows"])
    between = sum(row["splines"]["contacts_between_samples"] for row in document["rows"])
    return [_table(header, rows), f"Sampling finds a contact on {wrong} of the certified splines, and none on {between} of those with one."]


def _recertify(document: Document) -> list[str]:
    """Returns a table with one line for each change."""
    header = ["example", "change", "seconds", "verify", "kept", "carried", "proved", "cut for", "contact", "anew as large", "anew", "of it"]
    rows = []
    for row in document["rows"]:
        if "error" in row:
            rows.append([row["example"], row["change"], seconds(row["seconds"]), *["-"] * 8, row["error"]])
            continue
        anew, counts = row["anew"], [str(row[what]) for what in ("carried", "proved", "cut")]
        soon = "never" if anew is None or anew["as_large"] is None else seconds(anew["as_large"])
        kept = [seconds(row["seconds"]), seconds(row["verify_seconds"]), f"{100 * row['kept']['value']:.3g} %", *counts]
        found = "found" if row["contact"] else "none"
        size = ["-", "none"] if anew is None else [seconds(anew["seconds"]), f"{anew['volume'] / row['volume']:.2f}"]
        rows.append([row["example"], row["change"], *kept, found, soon, *size])
    return [_table(header, rows)]


def _map(document: Document) -> list[str]:
    """Returns a table with one line for each scene."""
    sizes_and_costs = ["cells", "proof", "verify", "free set", "point", "1000 points", "motion"]
    header = ["example", "pairs", "covered", *sizes_and_costs, "straight", "connected", "obstacle more", "Drake"]
    rows = []
    for row in document["rows"]:
        over_time = ", ".join(f"{share:.2f} after {seconds(at)}" for at, share in row["over_time"])
        sizes = [f"{row['proof_bytes'] / 1e6:.2f} MB", seconds(row["verify_seconds"]), f"{row['free_set_bytes'] / 1e3:.0f} kB"]
        costs = [f"{1e6 * row[what]['p99']:.0f} us" for what in ("point_seconds", "batch_seconds", "motion_seconds")]
        shares = [f"{row[what]:.2f}" for what in ("straight", "connected")]
        again = row["obstacle_more"]
        changed = ", ".join(
            f"{again[run]['coverage']:.2f} after {seconds(again[run]['seconds'])} {words}"
            for run, words in (("taken_over", "s"), ("anew", "s anew"))
        )
        asked = row["drake"]
        checked = f"{asked['collisions']} of {asked['configurations']}" if asked["configurations"] else ""
        rows.append([row["example"], str(row["pairs"]), over_time, str(row["cells"]), *sizes, *costs, *shares, changed, checked])
    return [_table(header, rows)]


def _lookups(document: Document) -> list[str]:
    """Returns a table with one line for each scene."""
    names = {"point": "point", "batch": "1000 points", "motion": "motion"}
    asked = [(what, which) for what in names for which in ("p50", "p99")]
    rows = []
    for row in document["rows"]:
        sizes = [str(row[size]) for size in ("trees", "grown", "cells")]
        rows.append([row["example"], *sizes, *(f"{1e6 * row[what][which]:.0f}" for what, which in asked)])
    header = ["example", "trees", "cells grown", "cells", *(f"{names[what]}, {which}" for what, which in asked)]
    return ["Microseconds of processor time.", _table(header, rows)]


_TABLES: dict[str, Callable[[Document], list[str]]] = {
    "pairs": _compared,
    "scene": _compared,
    "growth": _growth,
    "path": _path,
    "agreement": _agreement,
    "scaling": _scaling,
    "robots": _robots,
    "arms": _arms,
    "service": _service,
    "fleet": _fleet,
    "store": _store,
    "survey": _survey,
    "query": _query,
    "plan": _plan,
    "recertify": _recertify,
    "map": _map,
    "lookups": _lookups,
    "cover": _cover,
}
