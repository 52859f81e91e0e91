"""This module prints what people see: results on standard output, progress on standard error, one status line on a terminal."""

from __future__ import annotations

import json
import math
import shutil
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from certifier.verify.decimals import at_least_mm
from certifier.words import counted

Row = Sequence[str]

NEGATIVE = {"no_region", "not_grown", "not_covered", "revoked"}
"""These errors are answers: the input was fine, and the answer is no."""


class Screen:
    """A screen shows progress on standard error: lines that stay, and on a terminal one status line below them.

    The status line tells how long the command has run.
    """

    def __init__(self) -> None:
        self._terminal = sys.stderr.isatty()
        self._began = time.monotonic()
        self._status = ""
        self._part: float | None = None

    def line(self, text: str) -> None:
        """Prints a line that stays, above the status line."""
        self._erase()
        print(text, file=sys.stderr, flush=True)
        self._draw()

    def status(self, text: str, part: float | None = None) -> None:
        """Shows the present state in the status line, on a terminal only.

        Args:
            part: how much of it is done, from 0 to 1, which a bar shows; None where that is not known.
        """
        if self._terminal:
            self._status, self._part = text, part
            self._draw()

    def clear(self) -> None:
        """Removes the status line."""
        self._erase()
        self._status = ""

    def _draw(self) -> None:
        if self._status:
            took = seconds(time.monotonic() - self._began, whole=True)
            known = "" if self._part is None else f"{bar(self._part)} "
            width = shutil.get_terminal_size().columns - 1
            print(f"\r\x1b[2K{f'{known}{took}, {self._status}'[:width]}", end="", file=sys.stderr, flush=True)

    def _erase(self) -> None:
        if self._status:
            print("\r\x1b[2K", end="", file=sys.stderr, flush=True)


def bar(part: float, width: int = 20) -> str:
    """Returns a bar that is filled up to this part, from 0 to 1."""
    filled = int(width * part)
    return f"[{'#' * filled}{'-' * (width - filled)}]"


def print_json(document: Any) -> None:
    """Prints one JSON document on standard output."""
    json.dump(document, sys.stdout, indent=1, allow_nan=False)
    print()


def print_table(header: Row, rows: Iterable[Row], right: str = "") -> None:
    """Prints aligned columns. Those whose header is in ``right`` (space-separated) are aligned to the right."""
    lines = [tuple(header), *map(tuple, rows)]
    widths = [max(len(line[i]) for line in lines) for i in range(len(header))]
    flush = [name in right.split() for name in header]
    for line in lines:
        cells = (text.rjust(w) if r else text.ljust(w) for text, w, r in zip(line, widths, flush, strict=True))
        print("  ".join(cells).rstrip())


def print_configurations(configurations: Mapping[str, Mapping[str, float]], units: Mapping[str, str]) -> None:
    """Prints a line for each named configuration, if there are any.

    Args:
        units: of the joints' positions, by their names.
    """
    for name, positions in configurations.items():
        print(f"configuration {name}: {', '.join(f'{joint} {value:.6g} {units[joint]}' for joint, value in positions.items())}")


def scene_size(joints: int, geometries: int, pairs: int) -> str:
    """Returns how large a scene is, for people."""
    return ", ".join((counted(joints, "joint"), counted(geometries, "geometry", "geometries"), counted(pairs, "pair")))


def print_facts(facts: Iterable[tuple[str, str]]) -> None:
    """Prints names and values in two columns."""
    rows = list(facts)
    width = max(len(name) for name, _ in rows)
    for name, value in rows:
        print(f"  {name.ljust(width)}  {value}")


def plain(outcome: str | None) -> str:
    """Returns an outcome for people: ``not_certifiable`` -> ``not certifiable``."""
    return "-" if outcome is None else outcome.replace("_", " ")


def seconds(value: float | None, whole: bool = False) -> str:
    """Returns a duration, in seconds, as a text for people."""
    if value is None:
        return "-"
    return f"{value:.2f} s" if value < 10 and not whole else f"{value:.0f} s" if value < 600 else f"{value / 60:.0f} min"


def distance(value: float | None) -> str:
    """Returns a lower bound of a distance, in metres, as a text for people that is no larger."""
    return "-" if value is None else at_least_mm(value)


def share(document: dict[str, Any] | None) -> str:
    """Returns how much of its proposal a region keeps, with the standard error, as a text for people."""
    if document is None or document["value"] is None:
        return "-"
    return f"{100 * document['value']:.3g} +- {100 * document['stderr']:.1g} %"


def percent(part: float) -> str:
    """Returns a part of a whole, which is proved, as a text for people that is no larger: 100 % is all of it."""
    return "100 %" if part >= 1 else f"{math.floor(1e4 * part) / 100:.4g} %"


def q_volume(document: dict[str, Any] | None) -> str:
    """Returns a region's volume in joint positions as a text for people. Regions that an earlier checkout stored do not say it."""
    if document is None:
        return "-"
    least = f", {document['least_width']:.3g} deg or less where it is thinnest" if document.get("least_width") else ""
    side = f", average width {document['box_side']:.3g} deg{least}" if document["box_side"] else ""
    return f"{document['value']:.3g} +- {document['stderr']:.1g} {document['unit']}{side}"


def print_pairs(pairs: Iterable[dict[str, Any]]) -> None:
    """Prints one line for each pair of a ``certify`` document or a manifest, failures last."""
    ordered = sorted(pairs, key=lambda pair: pair["outcome"] != "certified")
    timed = any("stage" in pair for pair in ordered)
    rows = [
        (f"{p['a']} - {p['b']}", plain(p["outcome"]), distance(p["margin"]), *((plain(p["stage"]), seconds(p["seconds"])) if timed else ()))
        for p in ordered
    ]
    print_table(("pair", "outcome", "proved_distance", *(("stage", "time") if timed else ())), rows, right="proved_distance time")


def _range(known: dict[str, Any]) -> str:
    """Returns a joint's range as a text for people. Regions that an earlier checkout stored say nothing about the range at the seed."""
    alone = known.get("through_seed")
    through = f", {_position(alone[0])} to {_position(alone[1])} with the others at the seed" if alone else ""
    return f"{_position(known['lower'])} to {_position(known['upper'])} {known['unit']}{through}"


def _position(value: float) -> str:
    """Returns a joint position in degrees or metres for people, to whom a billionth is nothing."""
    return f"{round(value, 9) + 0.0:.4g}"


def _certified(pairs: Sequence[Mapping[str, Any]], ignored: int) -> str:
    """Returns how many pairs are certified. Earlier versions certified regions of scenes without any."""
    done = sum(pair["outcome"] == "certified" for pair in pairs)
    return f"{done} of {len(pairs)} certified, {ignored} ignored" if pairs else "no pair of bodies can collide in this scene"


def print_region(manifest: dict[str, Any], extra: Iterable[tuple[str, str]] = ()) -> None:
    """Prints a region's manifest in a few lines."""
    pairs, space = manifest["pairs"], manifest["space"]
    limits = 2 * len(space["joints"])
    faces = len(manifest["halfspace_offsets"])
    least = min((p for p in pairs if p["margin"] is not None), key=lambda p: p["margin"], default=None)
    # Regions that an earlier checkout stored have none of these.
    ranges, kept = manifest.get("joint_ranges", {}), manifest.get("share")
    moves = [f"{name}: {_range(r)}" for name, r in ranges.items()] or space["joints"]
    print_facts(
        [
            ("scene", f"{manifest['scene']['name']} ({manifest['scene']['hash'][:16]})"),
            *(("" if i else "joints", text) for i, text in enumerate(moves)),
            ("faces", f"{faces}, {limits} of them joint limits" if faces > limits else str(faces)),
            ("volume", q_volume(manifest.get("q_volume"))),
            *([("share", f"{share(kept)} of the proposal's collision-free part")] if kept else []),
            ("pairs", _certified(pairs, len(manifest["ignored"]))),
            *([("", manifest["not_covered"]["summary"])] if "not_covered" in manifest else []),
            *(("condition", f"{one['name']}: {one['statement']}") for one in manifest.get("conditions", ())),
            *([("proved distance", f"at least {distance(least['margin'])}: {least['a']} - {least['b']}")] if least else []),
            ("guarantee", manifest["guarantee"]),
            *extra,
        ]
    )
