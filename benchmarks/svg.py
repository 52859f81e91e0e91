"""This module draws curves on doubly logarithmic axes as SVG, without a plotting library."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

WIDTH, HEIGHT = 300, 260
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 34, 30
COLOURS = ("#1f5fa8", "#c4501b", "#3d8a3d", "#7a4fa0")

Point = tuple[float, float]


@dataclass(frozen=True)
class Panel:
    """A panel is one pair of axes.

    Attributes:
        series: name -> points (x, y), all positive.
    """

    title: str
    series: dict[str, list[Point]]


def draw(panels: list[Panel], unit: str) -> str:
    """Draws the panels side by side. The last one names the colours.

    Args:
        unit: unit of all ordinates.
    """
    body = "\n".join(line for i, panel in enumerate(panels) for line in _panel(panel, i * WIDTH, unit, named=panel is panels[-1]))
    white = '<rect width="100%" height="100%" fill="#fff"/>'
    size = f'width="{len(panels) * WIDTH}" height="{HEIGHT}" viewBox="0 0 {len(panels) * WIDTH} {HEIGHT}"'
    style = "text { font: 11px sans-serif; fill: #333 } .grid { stroke: #ddd } .frame { stroke: #888; fill: none }"
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{style}</style>\n{white}\n{body}\n</svg>\n'


def _panel(panel: Panel, x0: float, unit: str, named: bool) -> Iterator[str]:
    points = [point for series in panel.series.values() for point in series]
    across, up = _Axis([x for x, _ in points], x0 + LEFT, x0 + WIDTH - RIGHT), _Axis([y for _, y in points], HEIGHT - BOTTOM, TOP)
    yield f'<text x="{x0 + LEFT}" y="{TOP - 18}" font-weight="bold">{panel.title}</text>'
    yield f'<text x="{x0 + LEFT}" y="{TOP - 5}">{unit}</text>'
    for tick in across.ticks():
        x = across(tick)
        yield f'<line class="grid" x1="{x:.1f}" y1="{TOP}" x2="{x:.1f}" y2="{HEIGHT - BOTTOM}"/>'
        yield f'<text x="{x:.1f}" y="{HEIGHT - BOTTOM + 15}" text-anchor="middle">{tick:g}</text>'
    for tick in up.ticks():
        y = up(tick)
        yield f'<line class="grid" x1="{x0 + LEFT}" y1="{y:.1f}" x2="{x0 + WIDTH - RIGHT}" y2="{y:.1f}"/>'
        yield f'<text x="{x0 + LEFT - 5}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>'
    yield f'<rect class="frame" x="{x0 + LEFT}" y="{TOP}" width="{WIDTH - LEFT - RIGHT}" height="{HEIGHT - TOP - BOTTOM}"/>'
    for i, ((name, series), colour) in enumerate(zip(panel.series.items(), COLOURS, strict=False)):
        places = [(across(x), up(y)) for x, y in series]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        yield f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        yield from (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colour}"/>' for x, y in places)
        if named:
            yield f'<text x="{x0 + LEFT + 8}" y="{TOP + 16 + 14 * i}" style="fill: {colour}">{name}</text>'


class _Axis:
    """A logarithmic axis runs from ``start`` to ``end`` in the picture, and has room for all values."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        margin = 1.15
        self._low, self._high = math.log(min(values) / margin), math.log(max(values) * margin)
        self._start, self._end = start, end

    def __call__(self, value: float) -> float:
        return self._start + (math.log(value) - self._low) / (self._high - self._low) * (self._end - self._start)

    def ticks(self) -> list[float]:
        """Returns 1, 2 and 5 times the powers of ten, or the powers alone where there are many."""
        low, high = math.exp(self._low), math.exp(self._high)
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        fine = [m * 10.0**p for p in powers for m in (1, 2, 5) if low <= m * 10.0**p <= high]
        coarse = [10.0**p for p in powers if low <= 10.0**p <= high]
        return fine if len(fine) <= 6 else coarse
