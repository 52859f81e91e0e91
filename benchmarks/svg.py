"""This module draws curves over logarithmic axes as SVG, without a plotting library."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

WIDTH, HEIGHT = 300, 260
LEFT, RIGHT, TOP, BOTTOM = 52, 12, 34, 30
COLUMNS = 3
"""At most this many panels stand side by side."""
COLOURS = ("#1f5fa8", "#c4501b", "#3d8a3d", "#7a4fa0")

Point = tuple[float, float]


@dataclass(frozen=True)
class Panel:
    """A panel is one pair of axes.

    Attributes:
        series: name -> points (x, y), all positive, but shares may be 0; the n-th series has the n-th colour, with points or without.
    """

    title: str
    series: dict[str, list[Point]]


def draw(panels: list[Panel], unit: str, share: bool = False) -> str:
    """Draws the panels in rows. The last one names the colours.

    Args:
        unit: unit of all ordinates.
        share: the ordinates are shares, on an axis from 0 to 1; otherwise their axis is logarithmic, like that of all abscissas.
    """
    places = ((panel, i % COLUMNS * WIDTH, i // COLUMNS * HEIGHT) for i, panel in enumerate(panels))
    body = "\n".join(line for panel, x0, y0 in places for line in _panel(panel, x0, y0, unit, share, named=panel is panels[-1]))
    white = '<rect width="100%" height="100%" fill="#fff"/>'
    width, height = min(len(panels), COLUMNS) * WIDTH, -(-len(panels) // COLUMNS) * HEIGHT
    size = f'width="{width}" height="{height}" viewBox="0 0 {width} {height}"'
    style = "text { font: 11px sans-serif; fill: #333 } .grid { stroke: #ddd } .frame { stroke: #888; fill: none }"
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size}>\n<style>{style}</style>\n{white}\n{body}\n</svg>\n'


def _panel(panel: Panel, x0: float, y0: float, unit: str, share: bool, named: bool) -> Iterator[str]:
    points = [point for series in panel.series.values() for point in series]
    left, right, top, bottom = x0 + LEFT, x0 + WIDTH - RIGHT, y0 + TOP, y0 + HEIGHT - BOTTOM
    across = _Axis([x for x, _ in points], left, right)
    up = _Shares(bottom, top) if share else _Axis([y for _, y in points], bottom, top)
    yield f'<text x="{left}" y="{top - 18}" font-weight="bold">{panel.title}</text>'
    yield f'<text x="{left}" y="{top - 5}">{unit}</text>'
    for tick in across.ticks():
        x = across(tick)
        yield f'<line class="grid" x1="{x:.1f}" y1="{top}" x2="{x:.1f}" y2="{bottom}"/>'
        yield f'<text x="{x:.1f}" y="{bottom + 15}" text-anchor="middle">{tick:g}</text>'
    for tick in up.ticks():
        y = up(tick)
        yield f'<line class="grid" x1="{left}" y1="{y:.1f}" x2="{right}" y2="{y:.1f}"/>'
        yield f'<text x="{left - 5}" y="{y + 4:.1f}" text-anchor="end">{tick:g}</text>'
    yield f'<rect class="frame" x="{left}" y="{top}" width="{right - left}" height="{bottom - top}"/>'
    for i, ((name, series), colour) in enumerate(zip(panel.series.items(), COLOURS, strict=False)):
        places = [(across(x), up(y)) for x, y in series]
        line = " ".join(f"{x:.1f},{y:.1f}" for x, y in places)
        yield f'<polyline points="{line}" fill="none" stroke="{colour}" stroke-width="1.5"/>'
        yield from (f'<circle cx="{x:.1f}" cy="{y:.1f}" r="2.5" fill="{colour}"/>' for x, y in places)
        if named:
            yield f'<text x="{left + 8}" y="{top + 16 + 14 * i}" style="fill: {colour}">{name}</text>'


class _Shares:
    """An axis of shares runs from 0 at ``start`` to 1 at ``end`` in the picture."""

    def __init__(self, start: float, end: float) -> None:
        self._start, self._end = start, end

    def __call__(self, value: float) -> float:
        return self._start + value * (self._end - self._start)

    def ticks(self) -> list[float]:
        """Returns every fifth of the whole."""
        return [i / 5 for i in range(6)]


class _Axis:
    """A logarithmic axis runs from ``start`` to ``end`` in the picture, and has room for all values."""

    def __init__(self, values: list[float], start: float, end: float) -> None:
        margin = 1.15
        self._low, self._high = math.log(min(values) / margin), math.log(max(values) * margin)
        self._start, self._end = start, end

    def __call__(self, value: float) -> float:
        return self._start + (math.log(value) - self._low) / (self._high - self._low) * (self._end - self._start)

    def ticks(self) -> list[float]:
        """Returns 1, 2 and 5 times the powers of ten, or the powers alone where there are many, or all multiples where there are few."""
        low, high = math.exp(self._low), math.exp(self._high)
        powers = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
        fine, finer, coarse = (
            [m * 10.0**p for p in powers for m in multiples if low <= m * 10.0**p <= high] for multiples in ((1, 2, 5), range(1, 10), (1,))
        )
        return finer if len(fine) < 2 else fine if len(fine) <= 6 else coarse
